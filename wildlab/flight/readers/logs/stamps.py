"""Which rows of a part have stamps that run: the others are marked, not dropped."""

from __future__ import annotations

from bisect import bisect_left
from collections.abc import Mapping

import numpy as np
from numpy.typing import ArrayLike, NDArray

from wildlab.flight.readers.logs.log import Stream, make_stream

Flags = NDArray[np.bool_]

#: Stamps further than this from the middle one are of no flight that the others are of.
LONGEST_S = 86400.0


def longest_increasing(stamps: ArrayLike) -> Flags:
    """The largest choice of rows whose stamps strictly increase, so that one wrong stamp costs one row.

    Parameters
    ----------
    stamps
        (N,) finite numbers.

    Returns
    -------
    (N,) bool

    Examples
    --------
    >>> longest_increasing([1, 2, 90, 3, 3, 4]).tolist()
    [True, True, False, True, False, True]
    """
    values = np.asarray(stamps)
    if len(values) < 2 or (np.diff(values) > 0).all():
        return np.ones(len(values), bool)
    # Row that ends the best run of each length, and the row before each row in its run.
    tails: list[float] = []
    ends: list[int] = []
    before: list[int] = []
    for at, value in enumerate(values.tolist()):
        place = bisect_left(tails, value)
        before.append(ends[place - 1] if place else -1)
        if place == len(tails):
            tails.append(value)
            ends.append(at)
        elif value < tails[place]:
            tails[place], ends[place] = value, at
    chosen = np.zeros(len(values), bool)
    at = ends[-1]
    while at >= 0:
        chosen[at] = True
        at = before[at]
    return chosen


def stamps_that_fail(stamps: ArrayLike) -> dict[str, Flags]:
    """Reason -> (N,) rows whose stamps (N,), s, cannot be used, as `make_stream` takes them.

    Parameters
    ----------
    stamps
        (N,) s; NaN where there is none.

    Returns
    -------
    dict
        What is left has finite stamps that strictly increase.
    """
    values = np.asarray(stamps, float)
    finite = np.isfinite(values)
    far = np.zeros(len(values), bool)
    if finite.any():
        with np.errstate(over="ignore"):
            far[finite] = np.abs(values[finite] - np.median(values[finite])) > LONGEST_S
    near = finite & ~far
    runs = np.zeros(len(values), bool)
    runs[near] = longest_increasing(values[near])
    repeated = near & ~runs & np.isin(values, values[runs])
    return {
        "no time": ~finite,
        "a stamp more than a day from the others": far,
        "a repeated stamp": repeated,
        "a stamp out of order": near & ~runs & ~repeated,
    }


def running_stream(
    part: str,
    columns: Mapping[str, ArrayLike],
    rows: ArrayLike,
    counted_in: str,
    unusable: Mapping[str, Flags],
) -> Stream | None:
    """As `make_stream`, with rows marked, too, whose stamps do not run among those that are used.

    Looked at is ``time_s``, or ``time_log_s`` where no row has UTC.

    Parameters
    ----------
    part, columns, rows, counted_in, unusable
        Of `make_stream`.

    Returns
    -------
    Stream, or None where it has no row.
    """
    stamps = np.asarray(columns["time_s"], float)
    if np.isnan(stamps).all() and "time_log_s" in columns:
        stamps = np.asarray(columns["time_log_s"], float)
    if not len(stamps):
        return None
    bad = np.zeros(len(stamps), bool)
    for holds in unusable.values():
        bad |= holds
    wrong = dict(unusable)
    for reason, holds in stamps_that_fail(stamps[~bad]).items():
        here = np.zeros(len(stamps), bool)
        here[np.flatnonzero(~bad)[holds]] = True
        wrong[reason] = wrong.get(reason, np.zeros(len(stamps), bool)) | here
    return make_stream(part, columns, rows, counted_in, wrong)
