"""All numbers that a text can be read as, and what in it can be read as degrees, minutes and seconds."""

from __future__ import annotations

import re
from collections.abc import Collection, Iterator
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Ints = NDArray[np.int64]

_POWER = r"(?:[eE](?P<power>[+-]?\d{1,2})(?!\d))?"
#: Whole numbers, decimals with point or comma, and thousands apart; each with what may follow it.
_READINGS = tuple(
    re.compile(pattern)
    for pattern in (
        r"(?<!\d)(?<!\d\.)(?P<whole>\d{1,20})(?!\d)(?P<rest>)" + _POWER,
        r"(?<!\d)(?=(?P<whole>\d{1,20})[.,](?P<rest>\d+)" + _POWER + ")",
        r"(?<!\d)(?<!\d{3}[ ,'_])(?=(?P<whole>\d{1,3}(?P<gap>[ ,'_])\d{3}(?:(?P=gap)\d{3})?)(?!\d)"
        r"(?:[.,](?P<rest>\d+))?(?P<power>))",
    )
)
_GAPS = str.maketrans("", "", " ,'_")
#: What stands behind degrees: their sign, d, or what it becomes where signs are lost.
_MARK = re.compile(r" ?[\xb0\xbadD?*\xc2]")


class Hit(NamedTuple):
    """Something found in a text: ``start``, ``end`` (characters), what kind of secret, how it is written."""

    start: int
    end: int
    kind: str
    written: str


class Numbers(NamedTuple):
    """Numbers as they can be read, (N,) each, by where they begin; one place may be read in several ways.

    Attributes
    ----------
    start, end
        Characters.
    value
        Without its sign: a minus or an S before a latitude makes no difference here.
    decimals
        Digits behind the point, less the exponent; below zero where last digits are left off.
    half
        Half of what the last digit counts, in the unit of the value.
    """

    start: Ints
    end: Ints
    value: Array
    decimals: Ints
    half: Array

    @property
    def digits(self) -> Ints:
        """How many digits count: leading zeros do not."""
        size = np.floor(np.log10(np.maximum(self.value, 1e-300)) + 1e-12).astype(np.int64) + 1
        return np.maximum(np.where(self.value > 0, size, 1) + self.decimals, 1)

    def take(self, which: NDArray[np.bool_] | Ints) -> Numbers:
        return Numbers(
            self.start[which], self.end[which], self.value[which], self.decimals[which], self.half[which]
        )


def numbers_of(text: str) -> Numbers:
    """Every number in a text, in every reading."""
    rows = []
    for reading in _READINGS:
        for match in reading.finditer(text):
            whole, rest, power = match["whole"].translate(_GAPS), match["rest"] or "", match["power"] or "0"
            end = match.end("power") if match["power"] else match.end("rest" if rest else "whole")
            rows.append((match.start("whole"), end, float(f"{whole}.{rest}e{power}"), len(rest) - int(power)))
    return _numbers(rows)


def _numbers(rows: list[tuple[int, int, float, int]]) -> Numbers:
    start, end, value, decimals = zip(*sorted(rows), strict=True) if rows else ((), (), (), ())
    places = np.array(decimals, np.int64)
    return Numbers(
        np.array(start, np.int64), np.array(end, np.int64), np.array(value, float), places,
        0.5 * 10.0 ** -places.astype(float),
    )  # fmt: skip


def angles_of(text: str, numbers: Numbers, degrees: Collection[int]) -> Iterator[tuple[str, Numbers]]:
    """What can be read as degrees with minutes, by how it is written, in degrees.

    Parameters
    ----------
    text, numbers
        A text, and the numbers in it.
    degrees
        Whole degrees that are looked for.
    """
    wanted = "|".join(str(one) for one in sorted(degrees))
    begin = rf"(?<![\d.,])0{{0,2}}(?:{wanted})(?=(?P<gap>\D{{1,12}})"
    end = r"(?P<last>\d{1,2})(?P<rest>[.,]\d+)?(?!\d))"
    for name, minutes, unit in (
        ("minutes and seconds", r"(?P<minutes>\d{1,2})\D{1,12}", 3600),
        ("minutes", "(?P<minutes>)", 60),
    ):
        rows, half = [], []
        for match in re.finditer(begin + minutes + end, text) if wanted else ():
            rest = (match["rest"] or "").replace(",", ".")
            whole, last = int(match["minutes"] or 0), int(match["last"])
            marked = _MARK.match(match["gap"]) is not None
            # 60.07 is a decimal, and two numbers with a blank between say nothing yet.
            if match["gap"] == "." or max(whole, last) >= 60 or not (unit == 3600 or marked or rest):
                continue
            fine = max(len(rest) - 1, 0)
            value = int(match[0]) + whole / 60 + float(f"{last}{rest}") / unit
            decimals = fine + (3 if unit == 3600 else 1) + marked
            # With the sign of degrees a single one counts sooner: 60 deg 07' 24" is nothing else.
            decimals = max(decimals, 5) if marked and unit == 3600 else decimals
            at = match.end("rest") if rest else match.end("last")
            rows.append((match.start(), at, value, decimals))
            half.append(0.5 * 10.0**-fine / unit)
        yield f"degrees, {name}", _numbers(rows)._replace(half=np.array(half, float))
    yield "ddmm.mmmm", _packed(text, numbers, 100.0, degrees)
    yield "ddmmss", _packed(text, numbers, 10_000.0, degrees)


def _packed(text: str, numbers: Numbers, whole: float, wanted: Collection[int]) -> Numbers:
    """Degrees, minutes (and seconds) in one number: 6007.4057, 600724.34."""
    near = np.isin(np.floor(numbers.value / whole), sorted(wanted))
    n = numbers.take(near & (numbers.value >= 1) & (numbers.decimals >= 0))
    degrees = np.floor(n.value / whole)
    rest = n.value - degrees * whole
    minutes = np.floor(rest / 100)
    if whole == 100.0:
        good, value, more = rest < 60, degrees + rest / 60, 1
    else:
        seconds = rest - minutes * 100
        good = (minutes < 60) & (seconds < 60) & (n.value >= 1000)
        value, more = degrees + minutes / 60 + seconds / 3600, 3
    # A letter behind it says what it is: 6007N 01015E.
    letter = np.array([text[end : end + 1] in tuple("NSEWnsew") for end in n.end], np.int64)
    half = n.half / (60 if whole == 100.0 else 3600)
    return n._replace(value=value, decimals=n.decimals + more + letter, half=half).take(good)
