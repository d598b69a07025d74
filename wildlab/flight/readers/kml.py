"""Polygons and points of a KML file."""

from __future__ import annotations

import math
from pathlib import Path
from typing import NamedTuple
from xml.parsers import expat

from wildlab.errors import WildlabError
from wildlab.flight.files import printable
from wildlab.flight.readers.documents import XmlReader

#: Letters of a name that are kept.
MOST_LETTERS = 200


class Placemark(NamedTuple):
    """A point or a polygon of a placemark.

    `rings` of (longitude, latitude, altitude) in degrees and m, the outer one first; of a point one with a
    single place. The altitude is NaN where there is none; `mode` is KML's ``altitudeMode``.
    """

    name: str
    rings: list[list[tuple[float, float, float]]]
    mode: str = ""


class Kml(XmlReader):
    """Polygons and points of a KML file, and how many geometries it has that are no points."""

    def __init__(self, path: Path) -> None:
        super().__init__(path)
        self.polygons: list[Placemark] = []
        self.points: list[Placemark] = []
        self.others = 0
        self._own: list[Placemark] = []
        self._name = self._mode = ""
        self._outer: list[list[tuple[float, float, float]]] = []
        self._inner: list[list[tuple[float, float, float]]] = []

    def begin(self, name: str, attributes: dict[str, str]) -> None:
        if not self.inside and name != "kml":
            raise WildlabError("is XML, and no KML", "export it as KML or GeoJSON", file=self.path)
        if name == "Placemark":
            self._name, self._own = "", []
        elif name in ("Point", "Polygon"):
            self._mode, self._outer, self._inner = "clampToGround", [], []

    def finish(self, name: str, words: str) -> None:
        parent = self.inside[-1] if self.inside else ""
        if name == "name" and parent == "Placemark":
            self._name = words[:MOST_LETTERS]
        elif name == "coordinates" and (parent == "Point" or "Polygon" in self.inside):
            (self._inner if "innerBoundaryIs" in self.inside else self._outer).append(self._places(words))
        elif name == "altitudeMode" and parent == "Point":
            self._mode = words.strip()[:MOST_LETTERS]
        elif name == "Point" and self._outer and self._outer[-1]:
            self._own.append(Placemark("", [self._outer[-1][:1]], self._mode))
        elif name == "Polygon":
            self.others += 1
            if not self._outer:
                raise WildlabError("a polygon has no outline", "export it anew", file=self.path)
            self._own.append(Placemark("", [self._outer[0], *self._inner]))
        elif name in ("LineString", "Track", "Model") or (
            name == "LinearRing" and "Polygon" not in self.inside
        ):
            self.others += 1
        elif name == "Placemark":
            # The name may stand after the geometries.
            for one in self._own:
                (self.points if one.mode else self.polygons).append(one._replace(name=self._name))

    def _places(self, words: str) -> list[tuple[float, float, float]]:
        places = []
        for word in words.split():
            parts = word.split(",")
            try:
                high = float(parts[2]) if len(parts) > 2 and parts[2] else math.nan
                places.append((float(parts[0]), float(parts[1]), high))
            except (ValueError, IndexError):
                raise WildlabError(
                    f"{printable(word)[:40]!r} is no coordinate",
                    "give longitude,latitude with a comma and without blanks between them",
                    file=self.path,
                    field="coordinates",
                ) from None
        return places


def read_kml(data: bytes, path: Path) -> Kml:
    """Polygons and points of a KML file; `path` is for messages.

    Raises
    ------
    WildlabError
        Where it is not KML, declares a document type or entities, or has coordinates that are none.
    """
    try:
        return Kml(path).read(data)
    except expat.ExpatError as error:
        said = printable(str(error))[:100]
        raise WildlabError(f"is not KML ({said})", "export it anew", file=path) from None
