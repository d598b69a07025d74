"""Inertial samples and satellite velocities as intervals that can be compared with each other.

A receiver says how the velocity changed over a second or so, an inertial sensor what was felt meanwhile: both
are means over an interval.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import pandas as pd
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from wildlab.flight.clocks import gnss_times
from wildlab.flight.store import Flight

Array = NDArray[np.float64]

FORCE = tuple(f"f_{axis}_m_s2" for axis in "xyz")
RATE = tuple(f"w_{axis}_rad_s" for axis in "xyz")
VELOCITY = ("v_north_m_s", "v_east_m_s", "v_down_m_s")
POSITION = ("north_m", "east_m", "down_m")
QUATERNION = ("q_w", "q_x", "q_y", "q_z")

#: Intervals are this long or a little longer, where the log's own rate allows: shorter ones are all noise.
STEP_S = 1.0
LONGEST_S = 2.5
#: More intervals than this say nothing new.
MOST = 3000
#: Sine of the angle below the horizon from which x is no nose: 45 deg.
STEEP = 0.7
#: Turns further than this between two attitudes could as well be the other way round.
TURN = 2.5


class Inertial:
    """Samples: times (N,), specific force and angular rate, a column per axis (N,) each.

    Ten hours at 250 Hz are nine million rows: columns are not copied, and what is made of them is made of one
    column at a time.
    """

    def __init__(self, times: Array, columns: Mapping[str, Array]) -> None:
        self.times = times
        self._columns = columns
        # Of one sensor at a time: asked for many lags in a row, and three columns of ten hours are large.
        self._kept: tuple[tuple[str, ...], list[Array]] = ((), [])

    def mean_force(self, start: Array, end: Array) -> Array:
        """Mean over intervals (K,) each, (K, 3); NaN where they are not inside of the samples."""
        return self._mean(FORCE, start, end)

    def mean_rate(self, start: Array, end: Array) -> Array:
        """The same of the angular rate."""
        return self._mean(RATE, start, end)

    def mean_of_forces(self) -> Array:
        """Mean of all samples of the specific force. (3,)"""
        return np.array([self._columns[name].mean() for name in FORCE])

    def sizes_of_forces(self) -> Array:
        """How long the specific force of each sample is. (N,)"""
        total = np.zeros(len(self.times))
        for name in FORCE:
            total += self._columns[name] ** 2
        return np.sqrt(total, out=total)

    def _mean(self, names: Sequence[str], start: Array, end: Array) -> Array:
        if self._kept[0] != tuple(names):
            self._kept = ((), [])
            self._kept = (tuple(names), [self._sum(name) for name in names])
        mean = np.empty((len(start), len(names)))
        for column, total in enumerate(self._kept[1]):
            mean[:, column] = np.interp(end, self.times, total) - np.interp(start, self.times, total)
        mean /= (end - start)[:, None]
        mean[(start < self.times[0]) | (end > self.times[-1])] = np.nan
        return mean

    def _sum(self, name: str) -> Array:
        """Integral over time of a column, from the first sample on. (N,)"""
        value = self._columns[name]
        total = np.empty(len(value))
        total[0] = 0.0
        np.add(value[1:], value[:-1], out=total[1:])
        total[1:] *= 0.5
        total[1:] *= np.diff(self.times)
        return np.cumsum(total, out=total)


@dataclass(frozen=True)
class Moves:
    """What the receiver says of intervals: start and end (K,), and the velocity at both (K, 3), `measured` or
    made of positions."""

    start: Array
    end: Array
    before: Array
    after: Array
    measured: bool

    @property
    def acceleration(self) -> Array:
        """Mean over each interval, in n. (K, 3)"""
        return np.asarray((self.after - self.before) / (self.end - self.start)[:, None])

    def course_rate(self, slowest: float) -> Array:
        """How fast the course turns, rad/s; NaN below a speed. (K,)"""
        north, east = self.before[:, 0], self.before[:, 1]
        turned = np.arctan2(
            north * self.after[:, 1] - east * self.after[:, 0],
            north * self.after[:, 0] + east * self.after[:, 1],
        )
        speed = np.minimum(np.hypot(north, east), np.hypot(self.after[:, 0], self.after[:, 1]))
        return np.where(speed > slowest, turned / (self.end - self.start), np.nan)


@dataclass(frozen=True)
class Turns:
    """What one nav source says of intervals: start and end (K,), and the mean angular rate in b (K, 3)."""

    source: str
    start: Array
    end: Array
    rate: Array


def samples(flight: Flight) -> Inertial | None:
    """The inertial samples, without those that hold no number; None where their times are of no use."""
    table = flight.imu
    if table is None:
        return None
    columns = {name: table[name].to_numpy(dtype=float) for name in ("time_s", *FORCE, *RATE)}
    good = np.ones(len(table), bool)
    for value in columns.values():
        good &= np.isfinite(value)
    if not good.all():
        columns = {name: value[good] for name, value in columns.items()}
    times = columns.pop("time_s")
    if len(times) < 2 or (np.diff(times) <= 0).any():
        return None
    return Inertial(times, columns)


def fixes(flight: Flight) -> pd.DataFrame | None:
    """Satellite positions, with the flight times they are of as `time_s`; None where these are of no use."""
    table = flight.gnss
    if table is None:
        return None
    shifted = table.assign(time_s=gnss_times(flight))
    good = np.isfinite(shifted[["time_s", *POSITION]].to_numpy(float)).all(axis=1)
    kept: pd.DataFrame = shifted.iloc[np.flatnonzero(good)].reset_index(drop=True)
    return None if len(kept) < 2 or (np.diff(kept["time_s"].to_numpy(float)) <= 0).any() else kept


def moves(table: pd.DataFrame | None) -> Moves | None:
    """Intervals between satellite positions; their velocities from the positions where there are none."""
    if table is None:
        return None
    times = table["time_s"].to_numpy(float)
    measured = VELOCITY[0] in table
    if measured:
        velocity = table[list(VELOCITY)].to_numpy(float)
        good = np.isfinite(velocity).all(axis=1)
        times, velocity = times[good], velocity[good]
    else:
        velocity = np.diff(table[list(POSITION)].to_numpy(float), axis=0) / np.diff(times)[:, None]
        times = (times[1:] + times[:-1]) / 2
    first, last = _intervals(times)
    if len(first) == 0:
        return None
    return Moves(times[first], times[last], velocity[first], velocity[last], measured)


def airframe_sources(flight: Flight) -> list[str]:
    """Nav sources by time that sensors on board, and the course, can be held against.

    Not those of a camera: where the lens lies along x of the poses, and these point down, or are one of
    several sources and the mount is said to be on them. Nor a twin's truth.
    """
    logs = [
        name for name, nav in flight.nav.items() if not name.startswith("truth") and "frame_id" not in nav
    ]
    mount = flight.manifest.mount
    along_x = mount.looks == "forward" and mount.pan_deg == mount.tilt_deg == 0 and flight.gimbal is None

    def of_camera(name: str) -> bool:
        w, x, y, z = flight.nav[name][list(QUATERNION)].to_numpy(float).T
        steep = len(w) > 0 and float(np.nanmedian(2 * (x * z - w * y))) > STEEP
        return along_x and (steep or (name == mount.poses and len(logs) > 1))

    return [name for name in logs if not of_camera(name)]


def turns(flight: Flight) -> Iterator[Turns]:
    """Intervals of each nav source of the airframe whose poses follow each other closely enough."""
    for name in airframe_sources(flight):
        nav = flight.nav[name]
        values = nav[["time_s", *QUATERNION]].to_numpy(float)
        values = values[np.isfinite(values).all(axis=1) & (np.abs(values[:, 1:]).sum(axis=1) > 0.5)]
        times = values[:, 0]
        if len(times) < 2 or (np.diff(times) <= 0).any():
            continue
        first, last = _intervals(times, STEP_S / 2, STEP_S)
        if len(first) == 0:
            continue
        q = [Rotation.from_quat(values[at, 1:], scalar_first=True) for at in (first, last)]
        turned = (q[0].inv() * q[1]).as_rotvec()
        clear = np.linalg.norm(turned, axis=1) < TURN
        start, end = times[first][clear], times[last][clear]
        yield Turns(name, start, end, turned[clear] / (end - start)[:, None])


def attitudes_near(nav: pd.DataFrame, times: Array, within_s: float = 0.3) -> tuple[NDArray[np.intp], Array]:
    """``R_nb`` of the pose nearest to each time, for those times that have one. (K,) rows, (K, 3, 3)"""
    stamps = nav["time_s"].to_numpy(float)
    after = np.clip(np.searchsorted(stamps, times), 1, len(stamps) - 1)
    nearest = np.where(times - stamps[after - 1] < stamps[after] - times, after - 1, after)
    q = nav[list(QUATERNION)].to_numpy(float)[nearest]
    near = (np.abs(stamps[nearest] - times) < within_s) & np.isfinite(q).all(axis=1)
    near &= np.abs(q).sum(axis=1) > 0.5
    rows = np.flatnonzero(near)
    if len(rows) == 0:
        return rows, np.empty((0, 3, 3))
    return rows, Rotation.from_quat(q[rows], scalar_first=True).as_matrix()


def _intervals(
    times: Array, shortest: float = 0.9 * STEP_S, longest: float = LONGEST_S
) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """First and last index of each interval, evenly thinned out to `MOST`."""
    last = np.searchsorted(times, times + shortest)
    first = np.flatnonzero(last < len(times))
    last = last[first]
    good = times[last] - times[first] <= longest
    first, last = first[good], last[good]
    thin = max(1, -(-len(first) // MOST))
    return first[::thin], last[::thin]
