"""Time in ArduPilot logs: stamps since the board was switched on, and UTC from its satellite receiver."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray

from wildlab.flight.readers.ardupilot.messages import Table, percent
from wildlab.flight.readers.logs.log import Clock
from wildlab.flight.readers.logs.order import in_order
from wildlab.flight.readers.logs.places import placed
from wildlab.flight.time.leap_seconds import week_to_utc
from wildlab.flight.time.steady import fit_steady

Array = NDArray[np.float64]

#: `Status` of a fix in space, as MAVLink numbers them.
FIX_3D = 3
#: Fixes are written down by a loop that runs so often, s, at its slowest.
LOOP_S = 0.02
#: No fix is written down later than this, s.
LATEST_S = 5.0
#: So many messages on both sides of a step back make it one of the board, not of a damaged stamp.
_SURE_ROWS = 5
#: Messages that say something of the whole log.
_LASTING = frozenset({"FMT", "FMTU", "UNIT", "MULT", "PARM", "VER", "MSG"})


class Times(NamedTuple):
    """Stamps of a log, and what takes them to UTC.

    Attributes
    ----------
    rows, stamps
        (N,) where stamped messages stand in the file, and their stamps in s: for those that carry none.
    clock
        None where nothing in the log is stamped.
    """

    rows: NDArray[np.int64]
    stamps: Array
    clock: Clock | None

    def of(self, table: Table) -> Array:
        """(N,) s since the board was switched on; by their place in the file for messages without stamps."""
        own = own_stamps(table)
        if own is not None:
            return own
        if not len(self.rows):
            return np.full(len(table), np.nan)
        return np.interp(table.rows, self.rows, self.stamps, left=np.nan, right=np.nan)

    def utc(self, stamps: Array) -> Array:
        """(N,) s since 1970 of stamps; NaN where UTC is not known."""
        if self.clock is None or not self.clock.base:
            return np.full(len(stamps), np.nan)
        return np.asarray(self.clock.offset_s + self.clock.rate * stamps)

    def utc_of_fixes(self, receiver: Table) -> Array:
        """(N,) s since 1970 of GPS messages: the receiver's own time where it has a fix, else the clock's.

        A fix may be written down late; its own time then says so. One far from the clock's is damaged.
        """
        clock, own = self.utc(self.of(receiver)), gps_utc(receiver)
        return np.where(true_fix(receiver) & (np.abs(own - clock) < LATEST_S), own, clock)

    def stamp_of(self, utc_s: Array) -> Array:
        """(N,) stamps at which it was so late, s."""
        if self.clock is None or not self.clock.base:
            return np.full(len(utc_s), np.nan)
        return np.asarray((utc_s - self.clock.offset_s) / self.clock.rate)


def own_stamps(table: Table) -> Array | None:
    """(N,) s since the board was switched on, of messages that carry them; NaN: 0, which is none."""
    if table.has("SampleUS"):
        # When the sensor was read, not when that was written down.
        stamps = table.numbers("SampleUS") / 1e6
        if (stamps > 0).any():
            return np.where(stamps > 0, stamps, np.nan)
    if table.has("TimeUS"):
        return table.numbers("TimeUS") / 1e6
    if _week_in_ms(table):
        # The first generation calls milliseconds of the week TimeMS, and its stamp T.
        return table.numbers("T") / 1e3 if table.has("T") else None
    return table.numbers("TimeMS") / 1e3 if table.has("TimeMS") else None


def gps_utc(table: Table) -> Array:
    """(N,) s since 1970 by week and ms of the week of GPS or CAM messages; NaN where the week is 0."""
    week = table.numbers("GWk", "Week", "GPSWeek")
    ms = table.numbers("GMS", "TimeMS" if _week_in_ms(table) else "GMS", "GPSTime")
    known = (week > 0) & (ms >= 0) & (ms < 7 * 86400e3)
    return week_to_utc(np.where(known, week, np.nan), np.where(known, ms / 1e3, np.nan))


def _week_in_ms(table: Table) -> bool:
    return table.has("TimeMS") and table.has("Week") and not table.has("GMS")


def true_fix(table: Table) -> NDArray[np.bool_]:
    """(N,) GPS messages with a fix in space, at a place, in a week."""
    fixed = table.numbers("Status") >= FIX_3D
    where = placed(table.numbers("Lat"), table.numbers("Lng"))
    return np.asarray(fixed & where & np.isfinite(gps_utc(table)))


def times(tables: dict[str, Table], receiver: Table | None) -> Times:
    """Stamps of a log, and its clock by the true fixes of a receiver.

    Parameters
    ----------
    tables
        By name.
    receiver
        GPS messages, None where there are none.

    Returns
    -------
    Times
    """
    anchor = _stamped(tables)
    if anchor is None:
        return Times(np.empty(0, np.int64), np.empty(0), None)
    kept = in_order(anchor[1])
    made = Times(anchor[0].rows[kept], anchor[1][kept], Clock(""))
    if receiver is None:
        return made
    own, utc = made.of(receiver), gps_utc(receiver)
    fixed = true_fix(receiver)
    pairs = in_order(own, fixed) & in_order(utc, fixed)
    return made._replace(clock=_clock(own[pairs], utc[pairs])) if pairs.any() else made


def longest_run(tables: dict[str, Table]) -> tuple[dict[str, Table], str]:
    """The messages of one time that the board was on, and a sentence on those that are left out.

    Stamps begin again where it was switched on again within a log: the longest time is kept, by its messages.
    A few wrong stamps make no new time.
    """
    anchor = _stamped(tables)
    if anchor is None or len(anchor[1]) < 2 * _SURE_ROWS:
        return tables, ""
    rows, stamps = anchor[0].rows, anchor[1]
    if not (np.diff(stamps) < -1.0).any():
        return tables, ""
    middle = np.median(sliding_window_view(stamps, _SURE_ROWS), axis=1)
    back = np.flatnonzero(middle[_SURE_ROWS:] < middle[:-_SURE_ROWS] - 1.0) + _SURE_ROWS
    # Some places in a row see the same step: it is the one with the largest step between neighbours.
    groups = np.split(back, np.flatnonzero(np.diff(back) > 1) + 1) if len(back) else []
    begins = [int(group[np.argmin(stamps[group] - stamps[group - 1])]) for group in groups]
    if not begins:
        return tables, ""
    # What stands before the first stamp of a time, as an origin or a version, belongs to it.
    edges = np.array([0, *(rows[np.array(begins) - 1] + 1), np.iinfo(np.int64).max])
    every = np.concatenate([table.rows for table in tables.values()])
    counts = np.histogram(every, edges.astype(float))[0]
    best = int(np.argmax(counts))
    kept = {
        name: table
        if name in _LASTING
        else table.take((table.rows >= edges[best]) & (table.rows < edges[best + 1]))
        for name, table in tables.items()
    }
    left_out = int(counts.sum() - counts[best])
    said = (
        f"the board was switched on again within it: of {len(counts)} stretches the longest is used, "
        f"{left_out} of {counts.sum()} messages ({percent(left_out, int(counts.sum()))}) are not"
    )
    return {name: table for name, table in kept.items() if len(table)}, said


def _stamped(tables: dict[str, Table]) -> tuple[Table, Array] | None:
    """The most frequent messages with stamps, and these."""
    for table in sorted(tables.values(), key=len, reverse=True):
        if (own := own_stamps(table)) is not None:
            return table, own
    return None


def _clock(own: Array, utc: Array) -> Clock:
    fit = fit_steady(own, utc, resolution_s=LOOP_S)
    largest = float(np.abs(fit.residual[fit.used]).max())
    return Clock("GPS weeks", fit.rate, fit.offset_s, fit.spread_s, largest, int(fit.used.sum()), fit.rate_sd)
