"""Which rows of a part have stamps that run: the others are marked, not dropped."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import ArrayLike, NDArray

from wildlab.flight.readers.logs.log import HEIGHTS, Stream, make_stream
from wildlab.flight.readers.logs.order import in_order, leaps
from wildlab.flight.readers.logs.places import placed

Flags = NDArray[np.bool_]


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
    runs = in_order(values)
    repeated = finite & ~runs & np.isin(values, values[runs])
    return {
        "no time": ~finite,
        "a repeated stamp": repeated,
        "a stamp out of order": finite & ~runs & ~repeated,
    }


def places_that_hold(stamps: ArrayLike, columns: Mapping[str, ArrayLike], doubtful: Flags) -> Flags:
    """Rows (N,) to interpolate between: their stamps run, they are on Earth and can be reached.

    Parameters
    ----------
    stamps
        (N,) s.
    columns
        Latitudes, longitudes and heights, named as in a part.
    doubtful
        (N,) rows that are not asked.

    Returns
    -------
    (N,) bool
    """
    good = ~doubtful & placed(columns["latitude_deg"], columns["longitude_deg"])
    good[good] = in_order(np.asarray(stamps, float)[good])
    good[good] = ~_far(stamps, columns, np.flatnonzero(good))
    return good


def _far(stamps: ArrayLike, columns: Mapping[str, ArrayLike], rows: NDArray[np.intp]) -> Flags:
    at = np.asarray(stamps, float)
    height = next((columns[name] for name in HEIGHTS if name in columns), np.full(len(at), np.nan))
    place = (columns["latitude_deg"], columns["longitude_deg"], height)
    return leaps(at[rows], *(np.asarray(one, float)[rows] for one in place))


def running_stream(
    part: str,
    columns: Mapping[str, ArrayLike],
    rows: ArrayLike,
    counted_in: str,
    unusable: Mapping[str, Flags],
) -> Stream | None:
    """As `make_stream`, with rows marked, too, whose stamps do not run, or whose places nothing could reach,
    among those that are used.

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
    wrong = {reason: np.asarray(holds, bool) for reason, holds in unusable.items()}
    good = np.flatnonzero(~_any(wrong, len(stamps)))
    for reason, holds in stamps_that_fail(stamps[good]).items():
        wrong[reason] = _at(good[holds], len(stamps))
    if "latitude_deg" in columns and part != "triggers":
        good = np.flatnonzero(~_any(wrong, len(stamps)))
        wrong["a place out of reach"] = _at(good[_far(stamps, columns, good)], len(stamps))
    return make_stream(part, columns, rows, counted_in, wrong)


def _any(wrong: Mapping[str, Flags], count: int) -> Flags:
    return np.asarray(np.logical_or.reduce([*wrong.values(), np.zeros(count, bool)]))


def _at(rows: NDArray[np.intp], count: int) -> Flags:
    here = np.zeros(count, bool)
    here[rows] = True
    return here
