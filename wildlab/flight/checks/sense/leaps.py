"""Leaps of a position: a jump of the fix, or a filter that began anew, which a clock would seem to explain.

Whoever flies straight on is as far off by a leap along his way as by late stamps. What tells the two apart is
in the leaping table alone: its places go where its velocity, or its places before and after, did not. A clock
that is off leaves every table as smooth as it was.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import replace
from typing import NamedTuple

import numpy as np
import pandas as pd

from wildlab.flight.checks.corrections import LEAP
from wildlab.flight.checks.findings import POSITION, Finding
from wildlab.flight.checks.inertial_data import VELOCITY
from wildlab.flight.checks.sense import words
from wildlab.flight.store import Flight
from wildlab.geometry.frames import Array

#: A leap is over within so many seconds, at least so long (m), and so many of the usual spreads of a stretch
#: as long.
WITHIN_S, LEAST_M, FAR = 2.0, 5.0, 8.0
#: Places so long before and after it (s) say how far it went.
BESIDE_S = 5.0
#: Steps from whose median a velocity is taken where the table has none.
STEPS = 9
#: Rows below which nothing is told from noise; leaps beyond which a table is rough, and not leaping.
FEWEST, MOST = 30, 5
#: Causes for which a leap may be mistaken, by how they begin.
_CLOCKS = ("clock", "leap seconds")


class Leap(NamedTuple):
    """Where a position leapt: the table (with the target, of truth), when, and by how much, (3,) m in n."""

    table: str
    time_s: float
    by: Array


def find_leaps(table: pd.DataFrame, name: str = "") -> list[Leap]:
    """Leaps of the positions of one table, in the order of time.

    Parameters
    ----------
    table
        With ``time_s``, a position and perhaps a velocity; of one target.
    name
        What the leaps are said to be of.

    Examples
    --------
    >>> t = np.arange(0.0, 60.0, 0.5)
    >>> north = 10 * t + np.where(t > 20, 40, 0)
    >>> place = pd.DataFrame({"time_s": t, "north_m": north, "east_m": 0.0, "down_m": 0.0})
    >>> [(one.time_s, one.by.round(1).tolist()) for one in find_leaps(place)]
    [(20.5, [40.0, 0.0, 0.0])]
    """
    has_velocity = VELOCITY[0] in table
    values = table[["time_s", *POSITION, *(VELOCITY if has_velocity else [])]].to_numpy(float)
    values = values[np.isfinite(values[:, :4]).all(axis=1)]
    t, p = values[:, 0], values[:, 1:4]
    if len(t) < FEWEST or (np.diff(t) <= 0).any():
        return []
    step = np.diff(t)[:, None]
    gone = np.diff(p, axis=0)
    if has_velocity and np.isfinite(values[:, 4:]).all():
        expected = (values[1:, 4:] + values[:-1, 4:]) / 2 * step
    else:
        expected = _middle(gone / step) * step
    # Behind a gap nobody knows how far it should have gone.
    unexplained = np.where(step > max(WITHIN_S, 3 * float(np.median(step))), 0.0, gone - expected)
    left = np.concatenate([np.zeros((1, 3)), np.cumsum(unexplained, axis=0)])
    end = np.minimum(np.searchsorted(t, t + WITHIN_S), len(t) - 1)
    size = np.linalg.norm(left[end] - left, axis=1)
    limit = max(LEAST_M, FAR * float(np.median(size)))
    found: list[Leap] = []
    # The first row of each run of stretches that are too long is as much before the leap as a stretch is.
    rows = np.flatnonzero(size > limit)
    for run in np.split(rows, np.flatnonzero(np.diff(rows) > 1) + 1) if len(rows) else []:
        first, last = int(run[0]), int(end[run[-1]])
        row = first + int(np.argmax(np.linalg.norm(unexplained[first:last], axis=1))) + 1
        before = left[(t >= t[first] - BESIDE_S) & (t <= t[first])]
        after = left[(t >= t[last]) & (t <= t[last] + BESIDE_S)]
        by = np.median(after, axis=0) - np.median(before, axis=0)
        # What comes back at once is a stray place.
        if np.linalg.norm(by) > limit:
            found.append(Leap(name, float(t[row]), by))
    return found if len(found) <= MOST else []


def _middle(rates: Array) -> Array:
    """Running median (N, 3) of (N, 3), by columns."""
    padded = np.pad(rates, ((STEPS // 2, STEPS // 2), (0, 0)), mode="edge")
    return np.asarray(np.median(np.lib.stride_tricks.sliding_window_view(padded, STEPS, axis=0), axis=-1))


def without_leaps(flight: Flight) -> tuple[Flight, list[Leap]]:
    """The flight with the leaps of all its positions taken off, and these."""
    leaps: list[Leap] = []

    def smooth(table: pd.DataFrame, name: str) -> pd.DataFrame:
        found = find_leaps(table, name)
        leaps.extend(found)
        place = table[list(POSITION)].to_numpy(float)
        for one in found:
            place = np.where(table["time_s"].to_numpy(float)[:, None] >= one.time_s, place - one.by, place)
        return table.assign(**dict(zip(POSITION, place.T, strict=True))) if found else table

    nav = {
        name: table if name.startswith("truth") or "frame_id" in table else smooth(table, f"nav/{name}")
        for name, table in flight.nav.items()
    }
    tables = dict(flight.tables)
    if flight.gnss is not None:
        tables["gnss"] = smooth(flight.gnss, "gnss")
    if flight.truth is not None and len(flight.truth):
        targets = flight.truth.groupby("target_id", sort=False)
        parts = [smooth(rows, f"truth of {target}") for target, rows in targets]
        tables["truth"] = pd.concat(parts).loc[flight.truth.index]
    return replace(flight, nav=nav, tables=tables), leaps


def told_from_leaps(check: Callable[[Flight], Iterable[Finding]], flight: Flight) -> Iterator[Finding]:
    """What a check finds; where it names a clock and a position leaps, what it finds without the leap.

    Parameters
    ----------
    check
        Of a flight.
    flight
        The flight.

    Yields
    ------
    Finding
        The leaps first, where the clock is then named no more, or still is.
    """
    found = list(check(flight))
    if not any(cause.startswith(_CLOCKS) for one in found for cause in one.causes):
        yield from found
        return
    smooth, leaps = without_leaps(flight)
    if not leaps:
        yield from found
        return
    again = list(check(smooth))
    yield from (_finding(one) for one in leaps)
    yield from again


def _finding(one: Leap) -> Finding:
    size = words.number(float(np.linalg.norm(one.by)))
    table, _, target = one.table.partition(" of ")
    of = f" of {target}" if target else ""
    return Finding(
        "problem",
        table,
        "north_m",
        f"the position{of} leaps by {size} m at {one.time_s:.1f} s, where its velocity does not, and stays: "
        "the fix jumped, or the filter began anew",
        "use the part of the flight before the leap or the one behind it, or another source of positions; no "
        "offset of a clock mends it",
        (LEAP,),
    )
