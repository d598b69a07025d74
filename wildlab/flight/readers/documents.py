"""JSON, XML and KML of strangers: parsed within bounds, and values checked when they are asked for."""

from __future__ import annotations

import json
import math
from itertools import count
from pathlib import Path
from typing import Any, NamedTuple, NoReturn
from xml.etree.ElementTree import Element, TreeBuilder
from xml.parsers import expat

from wildlab.errors import WildlabError
from wildlab.flight.files import printable


class Field(NamedTuple):
    """A value of a JSON file and where it stands: ``images[3].bbox``."""

    value: Any
    where: str
    path: Path

    def fail(self, wanted: str, fix: str = "mend it") -> WildlabError:
        """An error that says what is there and what is wanted, to be raised."""
        return WildlabError(
            f"is {shown(self.value)}, and {wanted}", fix, file=self.path, field=self.where or None
        )

    def member(self, key: str) -> Field:
        """A member of an object; of one that is not there the value is None."""
        if not isinstance(self.value, dict):
            raise self.fail("an object is wanted")
        return Field(self.value.get(key), f"{self.where}.{key}" if self.where else key, self.path)

    def items(self) -> list[Field]:
        """What stands in a list."""
        if not isinstance(self.value, list):
            raise self.fail("a list is wanted")
        return [Field(one, f"{self.where}[{at}]", self.path) for at, one in enumerate(self.value)]

    def number(self, most: float = math.inf) -> float:
        """A finite number that is no further from zero than `most`."""
        found = number(self.value)
        if math.isnan(found):
            raise self.fail("a finite number is wanted")
        if abs(found) > most:
            raise self.fail(f"no more than {most:g} is wanted")
        return found

    def name(self) -> str:
        """A text that is not empty."""
        if not isinstance(self.value, str) or not self.value:
            raise self.fail("a name is wanted")
        return self.value

    def identity(self) -> int | str:
        """A whole number or a text."""
        if isinstance(self.value, bool) or not isinstance(self.value, int | str):
            raise self.fail("a number or a name is wanted")
        return self.value


def parse_json(data: bytes, path: Path, what: str = "readable JSON", *, plain: bool = True) -> Field:
    """The content of a JSON file.

    Parameters
    ----------
    data
        UTF-8.
    path
        For messages.
    what
        What it should be, for messages.
    plain
        Whether numbers that are none (``NaN``) and names that stand twice in an object are refused.

    Raises
    ------
    WildlabError
        Where it is not JSON, or nested too deeply.
    """

    def constant(name: str) -> float:
        if plain:
            raise ValueError(f"{name} is not JSON")
        return float(name)

    def once(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
        found = dict(pairs)
        if plain and len(found) < len(pairs):
            raise ValueError("a name stands twice in one object")
        return found

    try:
        text = data.decode("utf-8-sig")
        return Field(json.loads(text, parse_constant=constant, object_pairs_hook=once), "", path)
    except (ValueError, RecursionError) as error:
        said = printable(str(error) or "its brackets are too deep")[:100]
        raise WildlabError(f"is not {what} ({said})", "write it anew, in UTF-8", file=path) from None


def number(value: Any) -> float:
    """A JSON value as a finite number, NaN where it is none.

    Examples
    --------
    >>> number(3), number("3"), number(True), number(10**400)
    (3.0, nan, nan, nan)
    """
    try:
        found = math.nan if isinstance(value, bool) or not isinstance(value, int | float) else float(value)
    except OverflowError:
        return math.nan
    return found if math.isfinite(found) else math.nan


def shown(value: Any) -> str:
    """A value of a hostile file, short and printable, in at most 60 characters."""
    if value is None:
        return "missing"
    try:
        text = printable(repr(value))
    except ValueError:  # an integer with thousands of digits
        text = "a number with too many digits"
    return text if len(text) <= 60 else f"{text[:57]}..."


#: Bytes and elements of an XML file, elements inside each other, and letters of a name, at most.
MOST_XML, MOST_ELEMENTS, DEEPEST, MOST_LETTERS = 50_000_000, 1_000_000, 50, 200


class BrokenXml(WildlabError):
    """XML that breaks off; `root` is what stands before that, None where nothing does."""

    root: Element | None = None


def parse_xml(data: bytes, path: Path | None = None, what: str = "readable XML") -> Element:
    """The root of an XML file, without entities, links or else what reaches out; name spaces stand before
    names.

    Parameters
    ----------
    data
        Its content.
    path
        For messages.
    what
        What it should be, for messages.

    Raises
    ------
    BrokenXml
        Where it is not XML, or breaks off.
    WildlabError
        Where it is too large, declares a document type or entities, or is nested too deeply.
    """

    def fail(problem: str) -> WildlabError:
        return WildlabError(problem, "export it anew", file=path)

    def refuse(*_: object) -> NoReturn:
        raise fail("declares a document type or entities, which no such file needs")

    def start(tag: str, attributes: dict[str, str]) -> None:
        if len(inside) >= DEEPEST:
            raise fail("its elements are too deep in each other")
        if next(counted) >= MOST_ELEMENTS:
            raise fail(f"has more than {MOST_ELEMENTS:,} elements")
        inside.append(tag)
        builder.start(tag, attributes)

    def end(tag: str) -> None:
        builder.end(inside.pop())

    if len(data) > MOST_XML:
        raise fail(f"has {len(data):,} bytes, and {MOST_XML:,} are the most that is read of XML")
    counted = count()
    inside: list[str] = []
    builder = TreeBuilder()
    parser = expat.ParserCreate(namespace_separator=" ")
    parser.buffer_text = True
    parser.StartElementHandler, parser.EndElementHandler = start, end
    parser.CharacterDataHandler = builder.data
    parser.StartDoctypeDeclHandler = parser.EntityDeclHandler = refuse
    try:
        parser.Parse(data, True)
    except expat.ExpatError as error:
        broken = BrokenXml(f"is not {what} ({printable(str(error))[:100]})", "export it anew", file=path)
        begun = bool(inside)
        while inside:
            end("")
        broken.root = builder.close() if begun else None
        raise broken from None
    return builder.close()


# -- KML


class Placemark(NamedTuple):
    """A point or a polygon of a placemark.

    `rings` of (longitude, latitude, altitude) in degrees and m, the outer one first; of a point one with a
    single place. The altitude is NaN where there is none; `mode` is KML's ``altitudeMode``.
    """

    name: str
    rings: list[list[tuple[float, float, float]]]
    mode: str = ""


class Kml(NamedTuple):
    """Polygons and points of a KML file, and how many geometries it has that are no points."""

    polygons: list[Placemark]
    points: list[Placemark]
    others: int


def read_kml(data: bytes, path: Path) -> Kml:
    """Polygons and points of a KML file; `path` is for messages.

    Raises
    ------
    WildlabError
        Where it is not KML, declares a document type or entities, or has coordinates that are none.
    """
    root = parse_xml(data, path, "KML")
    for one in root.iter():
        one.tag = one.tag.rpartition(" ")[2]
    if root.tag != "kml":
        raise WildlabError("is XML, and no KML", "export it as KML or GeoJSON", file=path)

    def places(of: Element, where: str) -> list[list[tuple[float, float, float]]]:
        return [_places(one.text or "", path) for one in of.iterfind(f"{where}coordinates")]

    found = Kml([], [], sum(len(list(root.iter(one))) for one in ("LineString", "Track", "Model", "Polygon")))
    rings = len(list(root.iter("LinearRing"))) - len(root.findall(".//Polygon//LinearRing"))
    for mark in root.iter("Placemark"):
        name = (mark.findtext("name") or "")[:MOST_LETTERS]
        for one in mark.iter("Point"):
            mode = (one.findtext("altitudeMode") or "clampToGround").strip()[:MOST_LETTERS]
            found.points.extend(Placemark(name, [ring[:1]], mode) for ring in places(one, "") if ring)
        for one in mark.iter("Polygon"):
            outer = places(one, "outerBoundaryIs//")
            if not outer:
                raise WildlabError("a polygon has no outline", "export it anew", file=path)
            found.polygons.append(Placemark(name, [outer[0], *places(one, "innerBoundaryIs//")]))
    return found._replace(others=found.others + rings)


def _places(words: str, path: Path) -> list[tuple[float, float, float]]:
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
                file=path,
                field="coordinates",
            ) from None
    return places
