"""Text of strangers, within bounds: encodings, numbers, stamps, tables, JSON, XML."""

from __future__ import annotations

import csv
import io
import json
import math
import re
import unicodedata
from collections.abc import Iterable
from datetime import UTC, datetime
from itertools import dropwhile
from pathlib import Path
from typing import Annotated, Any, NamedTuple, TypeVar
from xml.etree.ElementTree import Element, ParseError, iterparse

import numpy as np
from pydantic import AllowInfNan, FailFast, Strict

from wildlab.errors import WildlabError
from wildlab.flight.files import printable
from wildlab.geometry.frames import Array
from wildlab.names import from_csv_cell

#: No log is from after this, s since 1970.
LATEST_S = datetime(2100, 1, 1, tzinfo=UTC).timestamp()
#: Rows, and columns of one, at most; letters of a value that are kept.
MOST_ROWS, MOST_COLUMNS, MOST_LETTERS = 1_000_000, 200, 1000
#: Plain decimal numbers only: `float` would read "1_0", "nan" and "infinity" too.
_NUMBER = re.compile(r"\s*[-+]?(\d+\.?\d*|\.\d+)([eE][-+]?\d{1,3})?\s*", re.ASCII)
_STAMP = re.compile(
    r"\s*(\d{4})[-:./](\d\d?)[-:./](\d\d?)[ T]+(\d\d?):(\d\d?):(\d\d?(?:\.\d*)?)\s*", re.ASCII
)
_FOLDED = str.maketrans({"ä": "ae", "ö": "oe", "ü": "ue", "å": "aa", "ß": "ss", "ø": "o", "æ": "ae"})


def decode(data: bytes) -> str:
    """Text of a file in UTF-8, in UTF-16 with its mark, or else in Latin-1; never fails.

    A letter that is cut at the end is left out.
    """
    for mark, codec in ((b"\xef\xbb\xbf", "utf-8"), (b"\xff\xfe", "utf-16-le"), (b"\xfe\xff", "utf-16-be")):
        if data.startswith(mark):
            return data[len(mark) :].decode(codec, "replace")
    try:
        return data.decode("utf-8")
    except UnicodeDecodeError as error:
        cut = error.start >= len(data) - 3 and error.reason == "unexpected end of data"
        return data[: error.start].decode("utf-8") if cut else data.decode("latin-1")


def number(text: str | bytes | None, comma: bool = False) -> float:
    """A plain decimal number, NaN where the text is none; with `comma`, one may stand for the point.

    Examples
    --------
    >>> number("63,5", comma=True), number(" -1.5e1 "), number("0x10")
    (63.5, -15.0, nan)
    """
    if isinstance(text, bytes):
        text = text.decode("latin-1")
    if comma and text:
        text = text.replace(",", ".", 1)
    if not text or len(text) > 64 or not _NUMBER.fullmatch(text):
        return math.nan
    value = float(text)
    return value if math.isfinite(value) else math.nan


def numbers(texts: Iterable[str | None]) -> Array:
    """(N,) plain decimal numbers, NaN where a text is none."""
    return np.array([number(text) for text in texts], dtype=float)


def calendar_s(*parts: str | float) -> float:
    """s since 1970 of year, month, day and perhaps hour, minute, second as if it were UTC; NaN where none."""
    year, month, day, hour, minute, second = (*map(float, parts), 0.0, 0.0, 0.0)[:6]
    try:
        begun = datetime(int(year), int(month), int(day), tzinfo=UTC).timestamp()
    except (ValueError, OverflowError):
        return math.nan
    fine = hour < 25 and minute < 60 and second < 61
    return begun + hour * 3600.0 + minute * 60.0 + second if fine else math.nan


def stamp_s(text: str) -> float:
    """s since 1970 of a date and a clock, ``2026-06-01 10:00:00.25`` and alike, as if it were UTC, or NaN."""
    found = _STAMP.fullmatch(text[:60])
    return calendar_s(*found.groups()) if found else math.nan


def plural(count: int, singular: str) -> str:
    """``"1 row"``, ``"2,000 rows"``."""
    word, of, rest = singular.partition(" ")
    several = word[:-1] + "ies" if word.endswith("ry") else word + ("es" if word[-1:] == "x" else "s")
    return f"{count:,} {word if count == 1 else several}{of}{rest}"


#: How much of what could not be read: a number, what it counts, and the rest of the sentence.
Loss = tuple[int, str, str]


def told(*lost: Loss) -> tuple[str, ...]:
    """Sentences on what could not be read; of none nothing is said."""
    return tuple(f"{plural(count, what)} {rest}".rstrip() for count, what, rest in lost if count)


class TextTable(NamedTuple):
    """A table, read.

    Attributes
    ----------
    header
        Names of its columns as they stand there.
    rows
        Values as text, as many in each as there are columns.
    lines
        Where each row stands in the file, counted from 1.
    comma
        Whether a comma may stand for the decimal point.
    short
        Lines with fewer or more values than columns, and how many; they are no rows.
    """

    header: list[str]
    rows: list[list[str]]
    lines: list[int]
    comma: bool
    short: list[tuple[int, int]]

    def numbers(self, column: int) -> Array:
        """(N,) values of a column, NaN where one is no number."""
        return np.array([number(row[column], self.comma) for row in self.rows], float)

    def lost(self) -> Loss:
        """What is lost of it: lines that are no rows."""
        first = (
            f"without {len(self.header)} values, the first is line {self.short[0][0]}" if self.short else ""
        )
        return len(self.short), "line", first


def plain(name: str) -> str:
    """A column's name as people vary it: ``Latitude [deg]`` is ``latitude_deg``, ``hEll`` is ``hell``;
    letters of other languages are written with those of English.

    Examples
    --------
    >>> plain("Länge (°)"), plain("HØYDE"), plain("Repère"), plain("Höjd")
    ('laenge', 'hoyde', 'repere', 'hoejd')
    """
    folded = unicodedata.normalize("NFC", name.strip()).lower().translate(_FOLDED)
    bare = "".join(one for one in unicodedata.normalize("NFD", folded) if not unicodedata.combining(one))
    return re.sub(r"[^a-z0-9]+", "_", bare).strip("_")


def header_of(head: bytes) -> list[str]:
    """Plain names of the columns of a table by its first bytes; empty where it is none."""
    text = decode(head)
    line = next((one for _, one in _told(text)), "") if "\0" not in text else ""
    return [plain(one) for one in line.replace('"', "").split(_sign(line))] if _sign(line) in line else []


def _told(text: str) -> list[tuple[int, str]]:
    """Lines from the header on, with their numbers: before it, those that begin with ``#`` say nothing."""
    lines = [(at, one) for at, one in enumerate(text.splitlines(), 1) if one.strip()]
    return list(dropwhile(lambda one: one[1].lstrip().startswith("#"), lines))


def _sign(line: str) -> str:
    return max(";\t,", key=line.count)


def read_text_table(data: bytes, path: Path) -> TextTable:
    """A table of text.

    Parameters
    ----------
    data
        The file's content. Lines that begin with ``#`` and have not as many values as columns say nothing.
    path
        For messages.

    Returns
    -------
    TextTable

    Raises
    ------
    WildlabError
        Where it has no header, no row, or too many columns.
    """
    told = _told(decode(data).replace("\0", ""))
    if not told or _sign(told[0][1]) not in told[0][1]:
        raise WildlabError("has no header of columns", "write CSV with a line of names", file=path)
    sign = _sign(told[0][1])

    def values(line: str) -> list[str]:
        try:
            cells = next(csv.reader(io.StringIO(line), delimiter=sign), [])
        except csv.Error:
            return []
        return [from_csv_cell(one.strip()) for one in cells]

    header = values(told[0][1])
    if len(header) > MOST_COLUMNS:
        raise WildlabError(f"has {len(header):,} columns", "give a table with fewer", file=path)
    rows, at, short = [], [], []
    if len(told) > MOST_ROWS:
        raise WildlabError(f"has more than {MOST_ROWS:,} rows", "give it in parts", file=path)
    for line, text in told[1:]:
        row = values(text)
        if len(row) == len(header) + 1 and not row[-1]:
            row.pop()  # a sign at the end of the line
        if len(row) == len(header):
            rows.append([one[:MOST_LETTERS] for one in row])
            at.append(line)
        elif not text.lstrip().startswith("#"):
            short.append((line, len(row)))
    if not rows:
        what = "has no row under its header"
        if short:
            what = "line {} has {} values, and there are {} columns".format(*short[0], len(header))
        raise WildlabError(what, "give one row for each thing", file=path)
    return TextTable(header, rows, at, sign != ",", short)


# -- JSON and XML


T = TypeVar("T")
#: A list that is refused by the first thing that is wrong in it: a hostile one has millions.
Several = Annotated[list[T], FailFast()]
#: A finite number, and what names a thing; true is neither.
Real = Annotated[float, Strict(), AllowInfNan(False)]
Identity = Annotated[int, Strict()] | Annotated[str, Strict()]


def parse_json(data: bytes, path: Path, what: str = "readable JSON") -> Any:
    """The content of a JSON file in UTF-8; `path`, and `what` it should be, are for messages.

    Raises
    ------
    WildlabError
        Where it is not JSON, or nested too deeply.
    """
    try:
        return json.loads(data.decode("utf-8-sig"))
    except (ValueError, RecursionError) as error:
        said = printable(str(error) or "its brackets are too deep")[:100]
        raise WildlabError(f"is not {what} ({said})", "write it anew, in UTF-8", file=path) from None


#: Bytes and elements of an XML file, and elements inside each other, at most.
MOST_XML, MOST_ELEMENTS, DEEPEST = 50_000_000, 1_000_000, 50
_DECLARED = re.compile(rb"\s*<\?xml[^>]*encoding=[\"'](iso-8859-\d{1,2}|windows-125\d)[\"']", re.IGNORECASE)
_DOCTYPE = re.compile(r"<!\s*(DOCTYPE|ENTITY|ELEMENT|ATTLIST|NOTATION)", re.IGNORECASE)


def xml_text(data: bytes, path: Path | None) -> str:
    """Text of an XML file, before any parser sees it.

    Raises
    ------
    WildlabError
        Where it is too large, or declares a document type or entities; `path` is for messages.
    """
    declared = _DECLARED.match(data)
    content = data.decode(declared[1].decode(), "replace") if declared else decode(data)
    content = content.replace("\0", "")
    large = len(data) > MOST_XML
    if large or _DOCTYPE.search(content):
        problem = f"has more than {MOST_XML:,} bytes" if large else "declares a document type or entities"
        raise WildlabError(problem, "export it anew", file=path)
    return content


def parse_xml(data: bytes, path: Path | None = None, what: str = "readable XML") -> Element:
    """The root of an XML file, names without their name spaces.

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
    WildlabError
        Where it is not XML, breaks off, is too large or nested too deeply, or declares a document type or
        entities.
    """

    def fail(problem: str) -> WildlabError:
        return WildlabError(problem, "export it anew", file=path)

    content = xml_text(data, path).encode("utf-8", "replace")
    content = re.sub(rb"^\s*<\?xml[^>]*\?>", b"", content)
    depth = 0
    try:
        events = iterparse(io.BytesIO(content), ("start", "end"))  # noqa: S314 - without entities
        for number, (event, one) in enumerate(events):
            depth += 1 if event == "start" else -1
            one.tag = one.tag.rpartition("}")[2]
            if depth > DEEPEST or number > 2 * MOST_ELEMENTS:
                raise fail("its elements are too many, or too deep in each other")
    except ParseError as error:
        raise fail(f"is not {what} ({printable(str(error))[:100]})") from None
    return one
