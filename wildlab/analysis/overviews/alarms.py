"""What is so wrong on a flight that nothing else about it counts for much: its alarms.

An alarm is computed whatever other reports there are, and stands before every gain.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from wildlab.analysis.overviews.lost import POSITION, ordered
from wildlab.evaluation.streams import Pace, runs_of
from wildlab.evaluation.vibration import HARMFUL, Vibration
from wildlab.flight.clocks import gnss_times
from wildlab.flight.store import Flight

Array = NDArray[np.float64]

QUATERNION = ["q_w", "q_x", "q_y", "q_z"]
VELOCITY = ["v_north_m_s", "v_east_m_s", "v_down_m_s"]
#: A step between poses that is off by so many usual differences, and so many metres, from what their speeds
#: make of it; without speeds, from the steps before and after it.
JUMP, JUMP_M = 8.0, 3.0
#: Steps longer than so many usual ones are pauses, over which speeds explain nothing.
MOST_STEPS = 3.0
#: An airframe that leans by more, degrees, does not fly as anybody means it to.
LEANT_DEG = 80.0
#: Poses contradict a satellite position that lies so many metres, and so many of its stated standard
#: deviations, beside them; more than this share of such positions is too many for chance.
APART_M, APART_SD, APART_SHARE = 5.0, 3.0, 0.05
#: What an alarm may be of, worst first; True where the flight or its poses went wrong for certain.
ALARMS = {"jumps": True, "leans": True, "apart": False, "shakes": False}


class Alarm(NamedTuple):
    """One thing that is very wrong.

    Attributes
    ----------
    what
        A key of `ALARMS`.
    often
        How often: jumps, spells, or satellite positions that are contradicted.
    first, worst
        Stamps of the first time and of the worst one, s.
    size, limit
        The worst, and what it is held against: m, degrees, m or m/s^2.
    share
        Of the time, or of the satellite positions; of jumps 0.
    """

    what: str
    often: int
    first: float
    worst: float
    size: float
    limit: float
    share: float

    @property
    def broken(self) -> bool:
        """Whether the flight or its poses went wrong for certain."""
        return ALARMS[self.what]


def alarms_of(
    flight: Flight, source: str | None, pace: Pace | None, vibration: tuple[Vibration, Array] | None
) -> list[Alarm]:
    """Everything that is very wrong, worst first.

    Parameters
    ----------
    flight
        Whose times are times.
    source, pace
        The poses that are shown, and their pace; None without any.
    vibration
        Of the inertial sensor with the (N,) stamps of its samples; None where it cannot be told.

    Returns
    -------
    list of Alarm
    """
    found = []
    if source is not None and pace is not None and "frame_id" not in flight.nav[source]:
        nav = flight.nav[source]
        spells, sizes = jumps_of(nav, pace)
        if len(spells):
            at = int(np.argmax(sizes))
            found.append(
                Alarm("jumps", len(spells), spells[0, 0], spells[at, 0], float(sizes[at]), JUMP_M, 0.0)
            )
        t, q = ordered(nav, nav["time_s"].to_numpy(float), QUATERNION)
        length = np.linalg.norm(q, axis=1)
        t, q = t[length > 0], q[length > 0] / length[length > 0, None]
        # Between down in the body and down in n: the last element of the rotation's matrix.
        lean = np.degrees(np.arccos(np.clip(1 - 2 * (q[:, 1] ** 2 + q[:, 2] ** 2), -1, 1)))
        found += _beyond("leans", t, lean, LEANT_DEG)
        found += _apart(flight, source, pace)
    if vibration is not None:
        found += _beyond("shakes", vibration[1], vibration[0].worst, HARMFUL)
    return found


def jumps_of(nav: pd.DataFrame, pace: Pace) -> tuple[Array, Array]:
    """Steps between poses that the speeds, or else the steps, before and after do not explain.

    Parameters
    ----------
    nav
        Poses over time, with or without velocities.
    pace
        Of them.

    Returns
    -------
    (K, 2) begin and end, s, and (K,) m by which they are off.
    """
    stated = set(VELOCITY) <= set(nav) and bool(nav[VELOCITY].notna().any().all())
    t, values = ordered(nav, nav["time_s"].to_numpy(float), POSITION + (VELOCITY if stated else []))
    if len(t) < 4:
        return np.empty((0, 2)), np.empty(0)
    step, way = np.diff(t)[:, None], np.diff(values[:, :3], axis=0)
    if stated:
        off = np.linalg.norm(way - (values[1:, 3:] + values[:-1, 3:]) / 2 * step, axis=1)
    else:
        v = way / step
        # Beside a jump one neighbour is right; the jump itself agrees with neither.
        before = np.linalg.norm(way[1:] - v[:-1] * step[1:], axis=1)
        after = np.linalg.norm(way[:-1] - v[1:] * step[:-1], axis=1)
        off = np.minimum(np.append(np.inf, before), np.append(after, np.inf))
    usual = float(np.median(off))
    far = (off > max(JUMP * usual, JUMP_M)) & (step[:, 0] <= MOST_STEPS * pace.step_s)
    return np.stack([t[:-1][far], t[1:][far]], axis=1), off[far]


def beside_satellites(flight: Flight, times: Array, place: Array, gaps: Array) -> tuple[Array, Array, Array]:
    """How far poses lie from the satellite positions.

    Parameters
    ----------
    flight
        With satellite positions.
    times, place
        (N,) s and (N, 3) m of the poses.
    gaps
        (K, 2) pauses of the poses, in which they lie nowhere.

    Returns
    -------
    (M,) stamps in s, (M, 3) m in n, poses less satellites, and (M,) their stated standard deviation, NaN
    where there is none.
    """
    gnss = flight.table("gnss")
    stamps, theirs = gnss_times(flight), gnss[POSITION].to_numpy(float)
    inside = np.isfinite(theirs).all(axis=1) & (stamps >= times[0]) & (stamps <= times[-1])
    for begin, end in gaps:
        inside &= ~((stamps > begin) & (stamps < end))
    own = np.stack([np.interp(stamps[inside], times, column) for column in place.T], axis=1)
    sd = gnss["sd_horizontal_m"].to_numpy(float) if "sd_horizontal_m" in gnss else np.full(len(gnss), np.nan)
    return stamps[inside], own - theirs[inside], sd[inside]


def _beyond(what: str, t: Array, values: Array, limit: float) -> list[Alarm]:
    over = values > limit
    if not over.any():
        return []
    spells, at = runs_of(over, t), int(np.argmax(values))
    return [Alarm(what, len(spells), t[over][0], t[at], float(values[at]), limit, float(over.mean()))]


def _apart(flight: Flight, source: str, pace: Pace) -> list[Alarm]:
    nav = flight.nav[source]
    t, place = ordered(nav, nav["time_s"].to_numpy(float), POSITION)
    if flight.gnss is None or not len(t):
        return []
    stamps, off, sd = beside_satellites(flight, t, place, pace.gaps)
    level = np.hypot(off[:, 0], off[:, 1])
    over = level > np.fmax(APART_M, APART_SD * sd)
    if not len(level) or over.mean() <= APART_SHARE:
        return []
    at = int(np.argmax(np.where(over, level, 0.0)))
    first, share = float(stamps[over].min()), float(over.mean())
    return [Alarm("apart", int(over.sum()), first, stamps[at], float(level[at]), APART_M, share)]
