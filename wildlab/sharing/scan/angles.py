"""Degrees, minutes and seconds in all their spellings, as numbers of degrees."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from wildlab.sharing.scan.numbers import Bytes, Ints, Numbers, Runs, is_one_of, nothing

#: Between degrees and minutes at most so many characters: "60 deg 07", "60&deg; 07" is one by then.
GAP = 12
#: What stands behind degrees: their sign, d, or what it becomes where signs are lost.
MARKS = b"\xb0\xbadD?*\xc2"


def angles_of(data: Bytes, runs: Runs, numbers: Numbers) -> dict[str, Numbers]:
    """What can be read as degrees with minutes, in degrees.

    Parameters
    ----------
    data
        The text.
    runs, numbers
        What `wildlab.sharing.scan.numbers` read in it.

    Returns
    -------
    dict
        By what it is called: degrees, minutes and seconds; degrees and minutes; ddmm.mmmm as in NMEA;
        ddmmss; fractions as in EXIF.
    """
    if len(runs.start) < 1:
        return {}
    return {
        "degrees, minutes and seconds": _apart(data, runs, numbers, seconds=True),
        "degrees and minutes": _apart(data, runs, numbers, seconds=False),
        "ddmm.mmmm": _packed(data, numbers, 100.0),
        "ddmmss": _packed(data, numbers, 10_000.0),
        "fractions": _fractions(data, runs),
    }


def _last(numbers: Numbers, runs: Runs) -> Ints:
    """For each run the number that begins with it and is written to the last decimal."""
    # Of several readings that begin at one place, the one that ends last.
    order = np.lexsort((numbers.end, numbers.start))
    start = numbers.start[order]
    final = np.searchsorted(start, runs.start, "right") - 1
    return order[final]


def _marked(data: Bytes, at: Ints) -> NDArray[np.bool_]:
    """Whether what follows a number says degrees: the sign, d, or what it becomes where signs are lost."""
    last = len(data) - 1
    one, two = data[np.minimum(at, last)], data[np.minimum(at + 1, last)]
    marked: NDArray[np.bool_] = is_one_of(one, MARKS) | ((one == 32) & is_one_of(two, MARKS))
    return marked


def _apart(data: Bytes, runs: Runs, numbers: Numbers, *, seconds: bool) -> Numbers:
    """Degrees and what follows, as numbers apart."""
    steps = 2 if seconds else 1
    n = len(runs.start) - steps
    if n <= 0:
        return nothing()
    i = np.arange(n)
    fits = (runs.value[:n] <= 360) & (runs.length[:n] <= 3) & (runs.length[1 : n + 1] <= 2)
    fits &= runs.value[1 : n + 1] < 60
    for k in range(steps):
        gap = runs.start[k + 1 : n + k + 1] - runs.end[k : n + k]
        fits &= gap <= GAP
    i = i[fits]
    last = _last(numbers, runs)[i + steps]
    # Anything like 60.1 that only looks like more than one number is no minutes; so is a last one too large.
    small = (numbers.value[last] < 60) & (numbers.decimals[last] >= 0)
    i, last = i[small], last[small]
    marked = _marked(data, runs.end[i])
    # 60.07.24 and 1.25 are versions, dates and decimals: a point between counts where more says so.
    plain_point = (data[runs.end[i]] == ord(".")) & (runs.start[i + 1] - runs.end[i] == 1)
    good = ~plain_point if seconds else ~plain_point & (marked | (numbers.decimals[last] >= 1))
    i, last, marked = i[good], last[good], marked[good]
    decimals = numbers.decimals[last]
    if seconds:
        value = runs.value[i] + runs.value[i + 1] / 60 + numbers.value[last] / 3600
        fine = decimals + 3 + marked
    else:
        value = runs.value[i] + numbers.value[last] / 60
        fine = decimals + 1 + marked
    # With the sign of degrees a single one counts sooner: 60 deg 07' 24" is nothing else.
    fine = np.where(marked & seconds, np.maximum(fine, 5), fine)
    half = numbers.half[last] / (3600 if seconds else 60)
    return Numbers(runs.start[i], numbers.end[last], value, fine, fine + 2, half)


def _packed(data: Bytes, numbers: Numbers, whole: float) -> Numbers:
    """Degrees, minutes (and seconds) in one number: 6007.4057, 600724.34."""
    which = np.flatnonzero((numbers.value >= 1) & (numbers.value < 360 * whole) & (numbers.decimals >= 0))
    n = numbers.take(which)
    degrees = np.floor(n.value / whole)
    rest = n.value - degrees * whole
    if whole == 100.0:
        good, value, more = rest < 60, degrees + rest / 60, 1
    else:
        minutes = np.floor(rest / 100)
        seconds = rest - minutes * 100
        good = (minutes < 60) & (seconds < 60) & (n.value >= 1000)
        value, more = degrees + minutes / 60 + seconds / 3600, 3
    # A letter behind it says what it is: 6007N 01015E.
    letter = is_one_of(data[np.minimum(n.end, len(data) - 1)], b"NSEWnsew")
    fine = n.decimals + more + letter
    half = n.half / (60 if whole == 100.0 else 3600)
    return Numbers(n.start, n.end, value, fine, n.digits, half).take(good)


def _fractions(data: Bytes, runs: Runs) -> Numbers:
    """Three fractions in a row, as EXIF has degrees, minutes and seconds: 60/1, 7/1, 2434/100."""
    n = len(runs.start) - 5
    if n <= 0:
        return nothing()
    slash = (data[np.minimum(runs.end[:-1], len(data) - 1)] == ord("/")) & (
        runs.start[1:] - runs.end[:-1] == 1
    )
    fits = slash[:n] & slash[2 : n + 2] & slash[4 : n + 4]
    for k in (1, 3):
        fits &= runs.start[k + 1 : n + k + 1] - runs.end[k : n + k] <= GAP
    for k in (1, 3, 5):
        fits &= runs.value[k : n + k] > 0
    i = np.flatnonzero(fits)
    value = (
        runs.value[i] / runs.value[i + 1]
        + runs.value[i + 2] / runs.value[i + 3] / 60
        + runs.value[i + 4] / runs.value[i + 5] / 3600
    )
    fine = np.full(len(i), 5)
    return Numbers(runs.start[i], runs.end[i + 5], value, fine, fine + 2, np.full(len(i), 2e-6))
