"""Which of many numbers are those of a place: two of them that belong together, or one that says it all."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from wildlab.sharing.scan.encodings import Axis, Encoding
from wildlab.sharing.scan.hits import Hit
from wildlab.sharing.scan.numbers import Ints, Numbers
from wildlab.sharing.scan.secrets import Array

#: Two numbers further apart in the text than this (characters) do not belong together.
TOGETHER = 160
#: So many neighbours of each number are tried, and so many hits of one kind are listed.
NEIGHBOURS, MOST = 6, 500
#: A single number must agree with the true one to this, m, or to its last digit.
ALONE_M = 0.55


class Sorted:
    """Numbers by their size, so that those within a range are found without looking at all of them."""

    def __init__(self, numbers: Numbers) -> None:
        self.numbers = numbers
        self.order = np.argsort(numbers.value, kind="stable")
        self.values = numbers.value[self.order]

    def within(self, centres: Array, tolerance: Array) -> Ints:
        """Which are within a tolerance of any centre, in the order of the text."""
        good = np.isfinite(centres)
        low, high = merged(centres[good] - tolerance[good], centres[good] + tolerance[good])
        first = np.searchsorted(self.values, low, "left")
        last = np.searchsorted(self.values, high, "right")
        found = [self.order[a:b] for a, b in zip(first, last, strict=True) if b > a]
        return np.sort(np.concatenate(found)) if found else np.empty(0, np.int64)


def merged(low: Array, high: Array) -> tuple[Array, Array]:
    """Ranges in order, those that overlap as one.

    Parameters
    ----------
    low, high
        (N,) where each begins and ends.

    Returns
    -------
    (low, high), (M,) each.
    """
    if not len(low):
        return low, high
    order = np.argsort(low)
    low, high = low[order], np.maximum.accumulate(high[order])
    new = np.concatenate(([True], low[1:] > high[:-1]))
    ends = np.concatenate((np.flatnonzero(new)[1:] - 1, [len(low) - 1]))
    return low[new], high[ends]


def within(values: Array, low: Array, high: Array) -> NDArray[np.bool_]:
    """Whether numbers lie in any of some ranges.

    Parameters
    ----------
    values
        (N,), in any order.
    low, high
        (M,) as of :func:`merged`.

    Returns
    -------
    (N,) bool.
    """
    if not len(low):
        return np.zeros(len(values), bool)
    index = np.searchsorted(low, values, "right") - 1
    return np.asarray((index >= 0) & (values <= high[np.maximum(index, 0)]))


def reach(encodings: Sequence[Encoding], near_m: float) -> tuple[Array, Array]:
    """The ranges outside of which a number is none of a place in any encoding.

    Parameters
    ----------
    encodings
        How places may be written.
    near_m
        How near to a place is a leak.

    Returns
    -------
    (low, high), as of :func:`merged`.
    """
    values, tolerance = [np.empty(0)], [np.empty(0)]
    for encoding in encodings:
        for axis in encoding.axes:
            good = np.isfinite(axis.values)
            values.append(axis.values[good])
            tolerance.append((near_m * axis.per_metre + 0.5 * 10.0**-encoding.decimals)[good])
    centres, around = np.concatenate(values), np.concatenate(tolerance)
    return merged(centres - around, centres + around)


def pairs(numbers: Sorted, encoding: Encoding, near_m: float, cell: float = 0.0) -> list[Hit]:
    """Two numbers that belong to the same place and stand close together.

    Parameters
    ----------
    numbers
        Those of a text.
    encoding
        How places may be written.
    near_m
        How near to a place is a leak.
    cell
        Multiples of it may be written, in the unit of the encoding; 0 for none.
    """
    all_numbers = numbers.numbers
    hits = []
    for i, one in enumerate(encoding.axes):
        for other in encoding.axes[i + 1 :]:
            first = _candidates(numbers, one, encoding.decimals, near_m, cell)
            if not len(first):
                continue
            second = _candidates(numbers, other, encoding.decimals, near_m, cell)
            if not len(second):
                continue
            for a, b in _together(all_numbers, first, second):
                if _same_place(all_numbers, a, b, one, other, near_m):
                    start = min(all_numbers.start[a], all_numbers.start[b])
                    end = max(all_numbers.end[a], all_numbers.end[b])
                    what = f"{one.name} and {other.name}, {encoding.name}"
                    hits.append(Hit(int(start), int(end), "place", what))
                    if len(hits) >= MOST:
                        return hits
    return hits


def _candidates(numbers: Sorted, axis: Axis, decimals: int, near_m: float, cell: float) -> Ints:
    tolerance = near_m * axis.per_metre + 0.5 * 10.0**-decimals
    found = numbers.within(axis.values, tolerance)
    fine = numbers.numbers.decimals[found] >= decimals
    if cell > 0:
        steps = numbers.numbers.value[found] / cell
        fine &= np.abs(steps - np.round(steps)) > 1e-6
    return found[fine]


def _together(numbers: Numbers, first: Ints, second: Ints) -> list[tuple[int, int]]:
    """Pairs of one of the first and one of the second that stand close together."""
    found: list[tuple[int, int]] = []
    positions = numbers.start[second]
    middle = np.searchsorted(positions, numbers.start[first])
    for shift in range(-NEIGHBOURS, NEIGHBOURS):
        index = middle + shift
        inside = (index >= 0) & (index < len(second))
        a, b = first[inside], second[index[inside]]
        gap = np.maximum(numbers.start[a] - numbers.end[b], numbers.start[b] - numbers.end[a])
        # Below zero the two overlap: two readings of one and the same number.
        close = (gap >= 0) & (gap <= TOGETHER)
        found += list(zip(a[close].tolist(), b[close].tolist(), strict=True))
        if len(found) > 20 * MOST:
            break
    return sorted(found)


def _same_place(numbers: Numbers, a: int, b: int, one: Axis, other: Axis, near_m: float) -> bool:
    half = numbers.half[[a, b]]
    near: NDArray[np.bool_] = np.abs(numbers.value[a] - one.values) <= near_m * one.per_metre + half[0]
    near &= np.abs(numbers.value[b] - other.values) <= near_m * other.per_metre + half[1]
    return bool(near.any())


def alone(numbers: Sorted, encoding: Encoding, cell: float = 0.0) -> list[Hit]:
    """Numbers so fine, and so much those of a place, that one of them gives it away.

    Parameters
    ----------
    numbers
        Those of a text.
    encoding
        How places may be written.
    cell
        As for :func:`pairs`.
    """
    hits = []
    for axis in encoding.axes:
        if axis.decimals is None:
            continue
        fine = numbers.numbers.half[numbers.numbers.decimals >= axis.decimals]
        coarse = ALONE_M * axis.per_metre + fine.max(initial=0.0)
        found = numbers.within(axis.values, coarse)
        found = found[numbers.numbers.decimals[found] >= axis.decimals]
        if cell > 0:
            steps = numbers.numbers.value[found] / cell
            found = found[np.abs(steps - np.round(steps)) > 1e-6]
        some = numbers.numbers.take(found[:MOST])
        off = np.abs(some.value[:, None] - axis.values)
        close = (off <= np.maximum(ALONE_M * axis.per_metre, some.half[:, None])).any(axis=1)
        hits += [
            Hit(int(start), int(end), "place", f"{axis.name}, {encoding.name}")
            for start, end in zip(some.start[close], some.end[close], strict=True)
        ]
    return hits
