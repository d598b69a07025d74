"""JSON and XML of strangers: parsed within bounds, and values checked when they are asked for."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any, NamedTuple, NoReturn, Self
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


class XmlReader:
    """What expat tells of a file, element by element, without entities, links or else what reaches out.

    Readers of a format say what becomes of elements in `begin` and `finish`.
    """

    #: Elements inside each other at most.
    deepest = 100

    def __init__(self, path: Path | None = None) -> None:
        self.path = path
        #: Names of the elements about the one that is told.
        self.inside: list[str] = []
        self._words: list[str] = []

    def read(self, data: bytes) -> Self:
        """Go through a file.

        Raises
        ------
        WildlabError
            Where it declares a document type or entities, or is nested too deeply.
        expat.ExpatError
            Where it is not XML.
        """
        parser = expat.ParserCreate(namespace_separator=" ")
        parser.buffer_text = True
        parser.StartElementHandler = self._start
        parser.EndElementHandler = self._end
        parser.CharacterDataHandler = self._words.append
        parser.StartDoctypeDeclHandler = parser.EntityDeclHandler = self._refuse
        parser.Parse(data, True)
        return self

    def called(self, tag: str) -> str:
        """What an element or attribute is called, of its name space and name."""
        return tag.rpartition(" ")[2]

    def begin(self, name: str, attributes: dict[str, str]) -> None:
        """An element begins."""

    def finish(self, name: str, words: str) -> None:
        """An element ends; the text is that behind the last element within it."""

    def _start(self, tag: str, attributes: dict[str, str]) -> None:
        if len(self.inside) >= self.deepest:
            raise WildlabError("its elements are too deep in each other", "export it anew", file=self.path)
        name = self.called(tag)
        self._words.clear()
        self.begin(name, attributes)
        self.inside.append(name)

    def _end(self, tag: str) -> None:
        self.finish(self.inside.pop(), "".join(self._words))
        self._words.clear()

    def _refuse(self, *_: object) -> NoReturn:
        raise WildlabError(
            "declares a document type or entities, which no such file needs",
            "export it anew, or take the declaration out",
            file=self.path,
        )
