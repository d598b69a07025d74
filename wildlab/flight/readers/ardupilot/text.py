"""ArduPilot DataFlash logs as text (``.log``): a message per line, values already in their units."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from wildlab.errors import WildlabError
from wildlab.flight.readers.ardupilot import streams as ardupilot
from wildlab.flight.readers.ardupilot.messages import TEXT_CHARACTERS, Table, percent, with_units
from wildlab.flight.readers.logs.log import RawLog

_FMT = re.compile(rb"^\s*FMT\s*,\s*\d+\s*,\s*\d+\s*,\s*\w+\s*,\s*\w*\s*,", re.MULTILINE)
_NAME = re.compile(r"\s*([A-Z][A-Z0-9_]{0,3})\s*,")


class _Definition(NamedTuple):
    kind: int
    name: str
    characters: str
    fields: tuple[str, ...]


def recognise(head: bytes, name: str) -> bool:
    """Whether a file is one: a line among its first bytes defines a message.

    Parameters
    ----------
    head
        The first bytes of the file.
    name
        Not looked at.
    """
    return _FMT.search(head) is not None


def read(path: Path, data: bytes, zone: str | None = None) -> RawLog:
    """A DataFlash log as text.

    Parameters
    ----------
    path
        Only for messages.
    data
        The whole file.
    zone
        Not needed: its clock is that of the satellites.

    Returns
    -------
    RawLog
        Rows are counted in lines.

    Raises
    ------
    WildlabError
        Where no message of it can be read, or PX4 wrote it.
    """
    lines = _lines(data)
    tables, lost = _tables(lines, _definitions(lines))
    if not set(tables) - {"FMT"}:
        problem = "holds no message of an ArduPilot log that can be read"
        raise WildlabError(problem, "copy it again, or take the .bin", file=path)
    title = next((line for line in lines[:20] if "V" in line and "," not in line), "")
    return ardupilot.raw_log(path, "dataflash-text", tables, lost, "line", title)


def _lines(data: bytes) -> list[str]:
    lines = data.decode("utf-8", errors="replace").split("\n")
    return lines if lines[-1].strip() else lines[:-1]


def _definitions(lines: list[str]) -> dict[str, _Definition]:
    """What its lines FMT say, by the name of the message; the first that can be true."""
    known: dict[str, _Definition] = {}
    for line in lines:
        if not line.lstrip().startswith("FMT"):
            continue
        values = [one.strip() for one in line.split(",")]
        if len(values) < 5 or not values[1].isdecimal() or len(values[1]) > 3:
            continue
        fields = tuple(one for one in values[5:] if one)
        characters = values[4]
        if len(characters) == len(fields) and values[3] not in known:
            known[values[3]] = _Definition(int(values[1]), values[3], characters, fields)
    known["FMT"] = _Definition(128, "FMT", "BBnNZ", ("Type", "Length", "Name", "Format", "Columns"))
    return known


def _tables(lines: list[str], known: dict[str, _Definition]) -> tuple[dict[str, Table], list[str]]:
    """Messages by name, and what was lost."""
    numbers: dict[str, list[int]] = {}
    strange = 0
    undefined: dict[str, int] = {}
    for number, line in enumerate(lines):
        match = _NAME.match(line)
        if match is None:
            # Empty lines and the words before the first definition are no messages.
            strange += bool(line.strip()) and bool(numbers)
        elif match[1] in known:
            numbers.setdefault(match[1], []).append(number)
        else:
            undefined[match[1]] = undefined.get(match[1], 0) + 1
    tables: dict[str, Table] = {}
    short = 0
    for name, at in numbers.items():
        table, without = _table(lines, known[name], at)
        short += without
        if len(table):
            tables[name] = table
    lost = []
    if undefined:
        names = ", ".join([*list(undefined)[:3], *(["..."] if len(undefined) > 3 else [])])
        lost.append(
            f"{_of(sum(undefined.values()), lines)} have no line FMT that says what they hold: {names}"
        )
    if short:
        lost.append(f"{_of(short, lines)} have more or fewer values than their FMT says")
    if strange:
        lost.append(f"{_of(strange, lines)} are no messages")
    return with_units(tables, {name: known[name].kind for name in tables}), lost


def _table(lines: list[str], one: _Definition, at: list[int]) -> tuple[Table, int]:
    """The messages of one name from their lines, and how many have too few or too many values."""
    count = len(one.fields)
    # Commas in a text at the end are its own.
    most = count if one.characters[-1:] and one.characters[-1] in TEXT_CHARACTERS else -1
    split = [lines[number].split(",", most)[1:] for number in at]
    whole = [i for i, values in enumerate(split) if len(values) == count]
    rows = np.array([at[i] + 1 for i in whole], np.int64)
    kept = [split[i] for i in whole]

    def column(field: int) -> NDArray[Any]:
        words = [values[field] for values in kept]
        if one.characters[field] in TEXT_CHARACTERS + "aM":
            return np.array([word.strip() for word in words] or [""], dtype=object)[: len(words)]
        try:
            return np.array(words, dtype=np.float64)
        except ValueError:
            return np.array([_number(word) for word in words], dtype=np.float64)

    return Table(one.name, one.fields, one.characters, rows, column), len(at) - len(whole)


def _of(count: int, lines: list[str]) -> str:
    return f"{count} of {len(lines)} lines ({percent(count, len(lines))})"


def _number(word: str) -> float:
    try:
        return float(word)
    except ValueError:
        return float("nan")
