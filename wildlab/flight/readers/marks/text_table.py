"""Tables as text that people write: a header, a sign between values, decimal points or commas."""

from __future__ import annotations

import csv
import io
import math
import re
import unicodedata
from pathlib import Path
from typing import NamedTuple

from wildlab.errors import WildlabError
from wildlab.names import from_csv_cell

#: Rows, and columns of one, at most; letters of a value that are kept.
MOST_ROWS, MOST_COLUMNS, MOST_LETTERS = 1_000_000, 200, 200
#: A number with digits before or after the point.
_NUMBER = re.compile(r"[+-]?(?:\d{1,20}(?:\.\d{0,20})?|\.\d{1,20})(?:[eE][+-]?\d{1,3})?")
_FOLDED = str.maketrans({"ä": "ae", "ö": "oe", "ü": "ue", "å": "aa", "ß": "ss", "ø": "o", "æ": "ae"})


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
        Lines with fewer or more values than columns; they are no rows.
    """

    header: list[str]
    rows: list[list[str]]
    lines: list[int]
    comma: bool
    short: list[int]


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
    try:
        text = head.decode("utf-8-sig", errors="strict")
    except UnicodeDecodeError as error:
        # The head may end within a letter.
        whole = error.end < len(head) - 4
        text = head.decode("latin-1") if whole else head[: error.start].decode("utf-8-sig")
    if "\0" in text:
        return []
    line = next((one for one in text.splitlines() if one.strip() and not one.lstrip().startswith("#")), "")
    return [plain(one) for one in line.replace('"', "").split(_sign(line))] if _sign(line) in line else []


def _sign(line: str) -> str:
    return max(";\t,", key=line.count)


def read_text_table(data: bytes, path: Path) -> TextTable:
    """A table of text.

    Parameters
    ----------
    data
        The file's content, UTF-8 or Latin-1; lines that begin with ``#`` say nothing.
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
    try:
        text = data.decode("utf-8-sig")
    except UnicodeDecodeError:
        text = data.decode("latin-1")
    lines = text.replace("\0", "").splitlines()
    told = [(at, one) for at, one in enumerate(lines, 1) if one.strip() and not one.lstrip().startswith("#")]
    if not told or _sign(told[0][1]) not in told[0][1]:
        raise WildlabError(
            "has no header of columns", "write it as CSV with a first line of names", file=path
        )
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
    for number, line in told[1 : MOST_ROWS + 1]:
        row = values(line)
        if len(row) == len(header) + 1 and not row[-1]:
            row.pop()  # a sign at the end of the line
        if len(row) != len(header):
            short.append(number)
            continue
        rows.append([one[:MOST_LETTERS] for one in row])
        at.append(number)
    if not rows:
        raise WildlabError("has no row under its header", "give one row for each thing", file=path)
    return TextTable(header, rows, at, sign != ",", short)


def to_number(text: str, comma: bool = False) -> float:
    """A number as people write it, NaN where it is none.

    Parameters
    ----------
    text
        Of one value.
    comma
        Whether a comma may stand for the point.

    Returns
    -------
    float

    Examples
    --------
    >>> to_number("63,5", comma=True), to_number(" -1.5e1 "), to_number("0x10")
    (63.5, -15.0, nan)
    """
    text = text.strip()
    if comma:
        text = text.replace(",", ".", 1)
    value = float(text) if _NUMBER.fullmatch(text) else math.nan
    return value if math.isfinite(value) else math.nan


def said_of_short(table: TextTable) -> list[str]:
    """What is lost of a table: lines that are no rows."""
    if not table.short:
        return []
    count = len(table.short)
    lines = "1 line" if count == 1 else f"{count:,} lines"
    return [f"{lines} without {len(table.header)} values, the first is line {table.short[0]}"]
