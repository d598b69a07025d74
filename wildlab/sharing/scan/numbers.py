"""All numbers that are written in a text, at once: 20 MB of them in about two seconds."""

from __future__ import annotations

from functools import cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Ints = NDArray[np.int64]
Bytes = NDArray[np.uint8]

#: More digits than this in a row do not fit 64 bits; what follows is beyond any precision wanted here.
LONGEST = 18


class Runs(NamedTuple):
    """Digits in a row: where they begin and end (bytes), and their value; (N,) each, in order."""

    start: Ints
    end: Ints
    value: Ints

    @property
    def length(self) -> Ints:
        return self.end - self.start


class Numbers(NamedTuple):
    """Numbers as they can be read, (N,) each, by where they begin; one place may be read in several ways.

    Attributes
    ----------
    start, end
        Bytes.
    value
        Without its sign: whether a minus or an S stands before a latitude makes no difference here.
    decimals
        How many digits stand after the point, less the exponent; below zero where last digits are left off.
    digits
        How many digits count (leading zeros do not).
    half
        Half of what the last digit counts, in the unit of the value.
    """

    start: Ints
    end: Ints
    value: Array
    decimals: Ints
    digits: Ints
    half: Array

    def take(self, which: NDArray[np.bool_] | Ints) -> Numbers:
        return Numbers(
            self.start[which],
            self.end[which],
            self.value[which],
            self.decimals[which],
            self.digits[which],
            self.half[which],
        )


def is_one_of(data: Bytes, signs: bytes) -> NDArray[np.bool_]:
    """Whether bytes are among some.

    Parameters
    ----------
    data
        (N,) uint8.
    signs
        Which.
    """
    return _among(signs)[data]


@cache
def _among(signs: bytes) -> NDArray[np.bool_]:
    table = np.zeros(256, bool)
    table[list(signs)] = True
    return table


def nothing() -> Numbers:
    """No numbers."""
    none, real = np.empty(0, np.int64), np.empty(0)
    return Numbers(none, none, real, none, none, real)


def runs_of(data: Bytes) -> Runs:
    """The digits in a row of a text in bytes.

    Parameters
    ----------
    data
        (N,) uint8, ASCII digits among anything.
    """
    digit = np.zeros(len(data) + 2, np.int8)
    digit[1:-1] = (data - np.uint8(48)) < 10  # below 48 it wraps to above 200
    edges = np.diff(digit)
    start, end = np.flatnonzero(edges == 1), np.flatnonzero(edges == -1)
    value = np.zeros(len(start), np.int64)
    length = end - start
    which = np.arange(len(start))
    for k in range(LONGEST):
        which = which[length[which] > k]
        if not len(which):
            break
        value[which] = value[which] * 10 + (data[start[which] + k] - 48)
    return Runs(start, end, value)


def numbers_of(data: Bytes, runs: Runs, *, grouped: bool = True) -> Numbers:
    """Whole numbers, decimals with point or comma, with exponents, and with their thousands apart.

    Parameters
    ----------
    data
        As :func:`runs_of` had it.
    runs
        Its digits.
    grouped
        Whether thousands may stand apart; among the coordinates of lines they do not.
    """
    if not len(runs.start):
        return nothing()
    length = np.minimum(runs.length, LONGEST)
    whole = _number(runs.start, runs.end, runs.value.astype(float), np.zeros(len(length), np.int64))
    apart = runs.start[1:] - runs.end[:-1] == 1
    between = data[np.minimum(runs.end[:-1], len(data) - 1)]
    # The digits behind a point are no number of their own.
    behind = np.concatenate(([False], apart & (between == ord("."))))
    found = [whole.take(~behind)]
    joined = apart & ((between == ord(".")) | (between == ord(",")))
    found.append(_with_decimals(runs, np.flatnonzero(joined), runs.value.astype(float), runs.start))
    # Thousands apart: 6 656 123.4, 6,656,123, 6'656'123.
    spaced = is_one_of(between, b" ,'_") & apart & (runs.length[1:] == 3)
    # Not out of the middle of a list of numbers of three digits.
    begins = (runs.length[:-1] <= 3) & (runs.value[:-1] > 0)
    begins[1:] &= ~(spaced[:-1] & (runs.length[:-2] <= 3))
    begins &= grouped
    chain = np.concatenate((spaced, [False, False, False]))
    begins &= ~(chain[:-3] & chain[1:-2] & chain[2:-1])
    two = np.flatnonzero(spaced & begins)
    found += _grouped(runs, two, runs.value[two] * 1000 + runs.value[two + 1], two + 1, joined)
    three = two[two + 2 < len(length)]
    three = three[spaced[three + 1]]
    value = (runs.value[three] * 1000 + runs.value[three + 1]) * 1000 + runs.value[three + 2]
    found += _grouped(runs, three, value, three + 2, joined)
    everything = Numbers(*(np.concatenate(fields) for fields in zip(*found, strict=True)))
    powered = _with_exponents(data, runs, everything)
    order = np.argsort(powered.start, kind="stable")
    return powered.take(order)


def _number(start: Ints, end: Ints, value: Array, decimals: Ints) -> Numbers:
    size = np.floor(np.log10(np.maximum(value, 1e-300)) + 1e-12).astype(np.int64) + 1
    digits = np.maximum(np.where(value > 0, size, 1) + decimals, 1)
    return Numbers(start, end, value, decimals, digits, 0.5 * 10.0 ** -decimals.astype(float))


def _with_decimals(runs: Runs, which: Ints, before: Array, begins: Ints) -> Numbers:
    """Numbers whose whole part is ``before`` and ends in run ``which``; the next run is their decimals."""
    decimals = np.minimum(runs.length[which + 1], LONGEST)
    value = before[which] + runs.value[which + 1] / 10.0**decimals
    return _number(begins[which], runs.end[which + 1], value, decimals)


def _grouped(
    runs: Runs, first: Ints, value: Ints, last: Ints, joined: NDArray[np.bool_]
) -> tuple[Numbers, ...]:
    """Numbers of several runs, without and with decimals."""
    plain = _number(runs.start[first], runs.end[last], value.astype(float), np.zeros(len(first), np.int64))
    more = (last < len(joined)) & joined[np.minimum(last, len(joined) - 1)] if len(joined) else last < 0
    end, decimals = last[more] + 1, np.minimum(runs.length[last[more] + 1], LONGEST)
    decimal = _number(
        runs.start[first[more]], runs.end[end], value[more] + runs.value[end] / 10.0**decimals, decimals
    )
    return plain, decimal


def _with_exponents(data: Bytes, runs: Runs, numbers: Numbers) -> Numbers:
    """Numbers followed by e and an exponent, times that power of ten."""
    last = len(data) - 1
    e = (data[np.minimum(numbers.end, last)] | 32) == ord("e")
    which = np.flatnonzero(e & (numbers.end < last))
    after = data[np.minimum(numbers.end[which] + 1, last)]
    signed = (after == ord("-")) | (after == ord("+"))
    begins = numbers.end[which] + 1 + signed
    run = np.searchsorted(runs.start, begins)
    there = (run < len(runs.start)) & (runs.start[np.minimum(run, len(runs.start) - 1)] == begins)
    which, run, after = which[there], run[there], after[there]
    small = runs.value[run] < 30
    which, run, after = which[small], run[small], after[small]
    power = np.where(after == ord("-"), -runs.value[run], runs.value[run])
    value, half = numbers.value.copy(), numbers.half.copy()
    decimals, end = numbers.decimals.copy(), numbers.end.copy()
    value[which] = value[which] * 10.0**power
    half[which] = half[which] * 10.0**power
    decimals[which] -= power
    end[which] = runs.end[run]
    return Numbers(numbers.start, end, value, decimals, numbers.digits, half)
