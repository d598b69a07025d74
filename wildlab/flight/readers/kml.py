"""Polygons and points of a KML file, read by expat without entities, links or else what reaches out."""

from __future__ import annotations

import math
from pathlib import Path
from typing import NamedTuple, NoReturn
from xml.parsers import expat

from wildlab.errors import WildlabError
from wildlab.flight.files import printable

#: Elements inside each other at most.
DEEPEST = 100
#: Letters of a name that are kept.
MOST_LETTERS = 200


class KmlPolygon(NamedTuple):
    """A polygon of a placemark: its name, and its rings of (longitude, latitude), the outer one first."""

    name: str
    rings: list[list[tuple[float, float]]]


class KmlPoint(NamedTuple):
    """A point of a placemark: its name, (longitude, latitude, altitude), and what the altitude counts from.

    The altitude is NaN where there is none; `mode` is KML's ``altitudeMode``, ``clampToGround`` where it is
    not said.
    """

    name: str
    place: tuple[float, float, float]
    mode: str


def read_kml(data: bytes, path: Path) -> list[KmlPolygon]:
    """Polygons of a KML file.

    Parameters
    ----------
    data
        Its content.
    path
        For messages.

    Returns
    -------
    list of KmlPolygon

    Raises
    ------
    WildlabError
        Where it is not XML, declares a document type or entities, or has coordinates that are none.
    """
    return _read(data, path).found


def read_kml_points(data: bytes, path: Path) -> tuple[list[KmlPoint], int]:
    """Points of a KML file, and how many other geometries it has.

    Parameters
    ----------
    data
        Its content.
    path
        For messages.

    Returns
    -------
    list of KmlPoint, int

    Raises
    ------
    WildlabError
        As `read_kml`.
    """
    reader = _read(data, path)
    return reader.points, reader.others


def _read(data: bytes, path: Path) -> _Reader:
    reader = _Reader(path)
    parser = expat.ParserCreate(namespace_separator=" ")
    parser.StartElementHandler = reader.start
    parser.EndElementHandler = reader.end
    parser.CharacterDataHandler = reader.text
    parser.StartDoctypeDeclHandler = reader.doctype
    parser.EntityDeclHandler = reader.doctype
    parser.buffer_text = True
    try:
        parser.Parse(data, True)
    except expat.ExpatError as error:
        said = printable(str(error))[:100]
        raise WildlabError(f"is not KML ({said})", "export it anew", file=path) from None
    if not reader.kml:
        raise WildlabError("is XML, and no KML", "export it as KML or GeoJSON", file=path)
    return reader


class _Reader:
    """What expat tells, element by element."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self.found: list[KmlPolygon] = []
        self.points: list[KmlPoint] = []
        self.others = 0
        self.kml = False
        self._place: tuple[float, float, float] | None = None
        self._mode = ""
        self._inside: list[str] = []
        self._name = ""
        self._outer: list[list[tuple[float, float]]] = []
        self._inner: list[list[tuple[float, float]]] = []
        self._words: list[str] = []
        self._first = self._first_point = 0

    def doctype(self, *_: object) -> NoReturn:
        raise WildlabError(
            "declares a document type or entities, which KML needs none of",
            "export it anew, or take the declaration out",
            file=self.path,
        )

    def start(self, tag: str, _: dict[str, str]) -> None:
        name = tag.rpartition(" ")[2]
        if len(self._inside) >= DEEPEST:
            raise WildlabError("its elements are too deep in each other", "export it anew", file=self.path)
        self.kml = self.kml or (not self._inside and name == "kml")
        self._inside.append(name)
        self._words = []
        if name == "Placemark":
            self._name, self._first = "", len(self.found)
            self._first_point = len(self.points)
        elif name == "Point":
            self._place, self._mode = None, "clampToGround"
        elif name == "Polygon":
            self._outer, self._inner = [], []

    def text(self, words: str) -> None:
        self._words.append(words)

    def end(self, tag: str) -> None:
        name = self._inside.pop()
        if name == "name" and self._inside[-1:] == ["Placemark"]:
            self._name = "".join(self._words)[:MOST_LETTERS]
        elif name == "coordinates" and "Polygon" in self._inside:
            where = self._inner if "innerBoundaryIs" in self._inside else self._outer
            where.append(self._points("".join(self._words)))
        elif name == "coordinates" and self._inside[-1:] == ["Point"]:
            words = "".join(self._words)
            self._points(words)
            self._place = self._high(words)
        elif name == "altitudeMode" and self._inside[-1:] == ["Point"]:
            self._mode = "".join(self._words).strip()[:MOST_LETTERS]
        elif name == "Point" and self._place is not None:
            self.points.append(KmlPoint(self._name, self._place, self._mode))
        elif name in ("LineString", "Track", "Model") or (name == "LinearRing" and self._lone()):
            self.others += 1
        elif name == "Polygon":
            self.others += 1
            if not self._outer:
                raise WildlabError("a polygon has no outline", "export it anew", file=self.path)
            self.found.append(KmlPolygon(self._name, [*self._outer[:1], *self._inner]))
        elif name == "Placemark":
            # The name may stand after the polygons.
            self.found[self._first :] = [one._replace(name=self._name) for one in self.found[self._first :]]
            own = [one._replace(name=self._name) for one in self.points[self._first_point :]]
            self.points[self._first_point :] = own
            self._name = ""
        self._words = []

    def _lone(self) -> bool:
        return "Polygon" not in self._inside

    def _high(self, words: str) -> tuple[float, float, float] | None:
        parts = (words.split() or [""])[0].split(",")
        if len(parts) < 2:
            return None
        return float(parts[0]), float(parts[1]), float(parts[2]) if len(parts) > 2 and parts[2] else math.nan

    def _points(self, words: str) -> list[tuple[float, float]]:
        points = []
        for word in words.split():
            parts = word.split(",")
            try:
                points.append((float(parts[0]), float(parts[1])))
            except (ValueError, IndexError):
                raise WildlabError(
                    f"{printable(word)[:40]!r} is no coordinate",
                    "give longitude,latitude with a comma and without blanks between them",
                    file=self.path,
                    field="coordinates",
                ) from None
        return points
