"""Inertial and satellite measurements: gaps, clocks, then units and axes.

A receiver says how the velocity changed over a second or so, an inertial sensor what was felt meanwhile: both
are means over an interval. How long the specific force is does not depend on the attitude, and the receiver's
velocity tells it too: so two clocks can be compared before anything else is known. What is wrong with units
and axes gives an attitude that looks plausible: each is held against what knows better, gravity, the course
over ground; the attitude of a nav source is held against them in `attitude`.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import pandas as pd
from scipy.integrate import cumulative_trapezoid
from scipy.spatial.transform import Rotation

from wildlab.flight.checks.findings import (
    APART,
    Correction,
    Finding,
    Level,
    change_columns,
    finite_rows,
    part_of,
    say,
    shift_clock,
)
from wildlab.flight.checks.known_points import best_of
from wildlab.flight.clocks import gnss_times
from wildlab.flight.schema import FORCE, POSITION, QUATERNION, RATE, SECOND_COLUMNS, VELOCITY
from wildlab.flight.store import Flight
from wildlab.geometry.frames import USUAL_GRAVITY, Array, Indices, quaternion_to_matrix

AXES = "xyz"

#: Intervals are this long or a little longer, where the log's own rate allows: shorter ones are all noise.
STEP_S = 1.0
LONGEST_S = 2.5
#: More intervals than this say nothing new.
MOST = 3000
#: Sine of the angle below the horizon from which x is no nose: 45 deg.
STEEP = 0.7
#: A pose further than this from a time (s) is not that of it.
NEAREST_S = 0.3


@dataclass(frozen=True)
class Inertial:
    """Samples: times (N,), specific force and angular rate, a column per axis (N,) each. They are not copied:
    ten hours at 250 Hz are nine million rows."""

    times: Array
    columns: Mapping[str, Array]

    @cached_property
    def _totals(self) -> dict[str, Array]:
        """The columns, integrated."""
        return {
            name: cumulative_trapezoid(values, self.times, initial=0) for name, values in self.columns.items()
        }

    def mean(self, names: Sequence[str], start: Array, end: Array) -> Array:
        """Mean of `FORCE` or `RATE` over intervals (K,) each, (K, 3); NaN where they are not inside of the
        samples."""
        total = [self._totals[name] for name in names]
        gained = [np.interp(end, self.times, one) - np.interp(start, self.times, one) for one in total]
        mean = np.column_stack(gained) / (end - start)[:, None]
        mean[(start < self.times[0]) | (end > self.times[-1])] = np.nan
        return np.asarray(mean)


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
        return (self.after - self.before) / (self.end - self.start)[:, None]

    @property
    def force(self) -> Array:
        """The specific force that goes with it, in n. (K, 3)"""
        return self.acceleration - [0.0, 0.0, USUAL_GRAVITY]

    def course_rate(self) -> Array:
        """How fast the course turns, rad/s; NaN where it is too slow for a course. (K,)"""
        north, east = self.before[:, 0], self.before[:, 1]
        turned = np.arctan2(
            north * self.after[:, 1] - east * self.after[:, 0],
            north * self.after[:, 0] + east * self.after[:, 1],
        )
        speed = np.minimum(np.hypot(north, east), np.hypot(self.after[:, 0], self.after[:, 1]))
        return np.where(speed > SLOWEST, turned / (self.end - self.start), np.nan)


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
        velocity = table[VELOCITY].to_numpy(float)
        good = np.isfinite(velocity).all(axis=1)
        times, velocity = times[good], velocity[good]
    else:
        velocity = np.diff(table[POSITION].to_numpy(float), axis=0) / np.diff(times)[:, None]
        times = (times[1:] + times[:-1]) / 2
    first, last = intervals(times)
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
        w, x, y, z = flight.nav[name][QUATERNION].to_numpy(float).T
        steep = len(w) > 0 and np.nanmedian(2 * (x * z - w * y)) > STEEP
        return along_x and (steep or (name == mount.poses and len(logs) > 1))

    return [name for name in logs if not of_camera(name)]


def attitudes_near(nav: pd.DataFrame, times: Array) -> tuple[Indices, Array]:
    """``R_nb`` of the pose nearest to each time, for those times that have one. (K,) rows, (K, 3, 3)"""
    stamps = nav["time_s"].to_numpy(float)
    after = np.clip(np.searchsorted(stamps, times), 1, len(stamps) - 1)
    nearest = np.where(times - stamps[after - 1] < stamps[after] - times, after - 1, after)
    q = nav[QUATERNION].to_numpy(float)[nearest]
    near = (np.abs(stamps[nearest] - times) < NEAREST_S) & np.isfinite(q).all(axis=1)
    near &= np.abs(q).sum(axis=1) > 0.5
    rows = np.flatnonzero(near)
    if len(rows) == 0:
        return rows, np.empty((0, 3, 3))
    return rows, Rotation.from_quat(q[rows], scalar_first=True).as_matrix()


def trimmed_size(values: Array, counted: float) -> float:
    """Root mean square length of vectors (N, K) that are known, but for the largest; infinite of none."""
    length = np.sort(np.linalg.norm(values[np.isfinite(values).all(axis=1)], axis=1))
    kept = length[: max(1, int(counted * len(length)))]
    return float(np.sqrt(np.mean(kept**2))) if len(length) else np.inf


def increasing_rows(table: pd.DataFrame, names: Sequence[str], enough: int) -> Array | None:
    """Finite rows of times and columns (N, 1 + K); None of too few, or where the times do not increase."""
    values = finite_rows(table, ("time_s", *names))
    return None if len(values) < enough or (np.diff(values[:, 0]) <= 0).any() else values


def intervals(
    times: Array, shortest: float = 0.9 * STEP_S, longest: float = LONGEST_S, most: int = MOST
) -> tuple[Indices, Indices]:
    """First and last index of each interval, evenly thinned out to so many."""
    last = np.searchsorted(times, times + shortest)
    first = np.flatnonzero(last < len(times))
    last = last[first]
    good = times[last] - times[first] <= longest
    first, last = first[good], last[good]
    thin = max(1, -(-len(first) // most))
    return first[::thin], last[::thin]


# -- whether a flight goes fast enough for its course to give the heading, as navigation needs at the start

#: Level speed from which an airframe counts as flying, and its course as a heading, m/s.
FLYING = 8.0


def why_no_start(flight: Flight) -> str:
    """Why nothing gives the heading that navigation starts from: a clause, or nothing where something does.

    Two antennas do, or one fix at `FLYING` or faster while inertial samples are there.

    Parameters
    ----------
    flight
        With the tables ``imu`` and ``gnss``, neither empty.

    Returns
    -------
    str
    """
    gnss = flight.table("gnss")
    if len(gnss) < 2:
        return say("one-fix")
    if set(SECOND_COLUMNS) <= set(gnss.columns):
        return ""
    t, samples = gnss_times(flight), flight.table("imu")["time_s"].to_numpy(float)
    names = VELOCITY[:2]
    if set(names) <= set(gnss.columns):
        v = gnss[names].to_numpy(float)
    else:
        v = np.gradient(gnss[POSITION[:2]].to_numpy(float), t, axis=0)
    speed = np.hypot(v[:, 0], v[:, 1])
    speed = speed[(t >= samples[0]) & (t < samples[-1]) & np.isfinite(speed)]
    if not len(speed):
        return say("no-fix-with-inertial")
    return "" if speed.max() >= FLYING else say("slow", flying=FLYING, speed=speed.max())


# -- gaps and clocks

#: Longer without a sample than this, the attitude is not measured any more: half a roll takes no longer.
IMU_GAP_S = 0.5
#: Longer without a fix than this, dead reckoning by a small sensor is metres off.
OUTAGE_S = 5.0
#: Less of the shorter log than this in common, the clocks are in doubt.
COMMON = 0.5
#: How far apart clocks are looked for, how coarsely, and from which offset on it is worth saying.
LAG_S, COARSE_S, OFFSET_S = 60.0, 0.25, 0.4
#: Correlation that makes an offset believable, how much less it has to leave unexplained (as a ratio of
#: variances) than no offset, and by what logarithm of the likelihood it has to be the better explanation.
ALIKE, BETTER, SURE = 0.6, 1.2, 10.0
#: Peaks that differ by less than this are equally high.
ROUNDS = 0.01
#: Without any correlation above this over all offsets, the logs are not of one flight.
UNLIKE = 0.3
#: Intervals and standard deviation (m/s^2) of the force without which nothing can be told, and without which
#: the lack of a correlation means nothing.
ENOUGH, LIVELY, VERY_LIVELY = 30, 0.2, 0.3


def inertial(flight: Flight) -> Iterator[Finding]:
    """Everything about `imu` and `gnss` that makes navigation wrong without looking wrong."""
    imu, table = samples(flight), fixes(flight)
    if imu is not None:
        yield from _gaps("imu", imu.times, IMU_GAP_S)
    if table is not None:
        # A receiver that falls silent before the end leaves an outage too; before its first fix it had none.
        times = table["time_s"].to_numpy()
        last = times[-1] if imu is None or imu.times[0] > times[-1] else max(times[-1], imu.times[-1])
        yield from _gaps("gnss", np.append(times, last), OUTAGE_S)
    if imu is None:
        return
    apart = list(_overlap(imu, table))
    yield from apart
    moved = None if any(one.level == "problem" for one in apart) else moves(table)
    wrong = [*_force_unit(imu, moved), *_rate_unit(imu, moved)]
    yield from wrong
    if any(one.field.startswith("f_") for one in wrong):
        return
    late = [] if moved is None else list(_offset(flight, imu, moved))
    yield from late
    if not wrong and not late:
        yield from list(_gravity(imu, moved)) or _against_course(imu, moved)


def _gaps(table: str, times: Array, longest: float) -> Iterator[Finding]:
    step = np.diff(times)
    long = step > max(longest, 5 * np.median(step))
    if long.any():
        worst = int(np.argmax(step))
        facts = {"seconds": step[worst], "after": times[worst], "n": int(long.sum())}
        yield Finding("warning", table, "time_s", f"{table}-gap", facts)


def _overlap(imu: Inertial, table: pd.DataFrame | None) -> Iterator[Finding]:
    if table is None:
        return
    one, other = imu.times, table["time_s"].to_numpy()
    common = min(other[-1], one[-1]) - max(other[0], one[0])
    if common < COMMON * min(other[-1] - other[0], one[-1] - one[0]):
        facts = {"imu_from": one[0], "imu_to": one[-1], "from": other[0], "to": other[-1], "common": common}
        level: Level = "problem" if common <= 0 else "warning"
        code = "imu-gnss-apart" if common <= 0 else "imu-gnss-little-common"
        yield Finding(level, "gnss", "time_s", code, facts, (APART,))


def _offset(flight: Flight, imu: Inertial, moved: Moves) -> Iterator[Finding]:
    """Whether what the receiver says was felt is felt at another time."""
    expected = np.linalg.norm(moved.force, axis=1)

    def felt_at(lag: float) -> Array:
        return np.asarray(np.linalg.norm(imu.mean(FORCE, moved.start + lag, moved.end + lag), axis=1))

    def alike(lag: float) -> float:
        felt = felt_at(lag)
        good = np.isfinite(felt)
        # An offset that leaves little in common could fit by accident.
        if good.sum() < max(ENOUGH, len(felt) / 4) or min(felt[good].std(), expected[good].std()) < LIVELY:
            return np.nan
        return float(np.corrcoef(felt[good], expected[good])[0, 1])

    coarse = np.arange(-LAG_S, LAG_S + COARSE_S / 2, COARSE_S)
    found = np.array([alike(lag) for lag in coarse])
    here = alike(0.0)
    if np.isnan(here) or np.isnan(found).all():
        return
    # Whoever flies rounds is as like himself a round later: of peaks equally high the nearest is meant.
    high = np.flatnonzero(np.nan_to_num(found, nan=-1.0) > np.nanmax(found) - ROUNDS)
    peaks = [i for i in high if found[i] == np.nanmax(found[max(0, i - 8) : i + 9])]
    middle = coarse[min(peaks, key=lambda i: abs(coarse[i]))]
    best = best_of(lambda lag: -alike(lag), middle + COARSE_S * np.array([-1.0, 0.0, 1.0]))
    most = alike(best)
    unexplained = (1 - here**2) / max(1 - most**2, 1e-12)
    # Overlapping intervals count once.
    likelier = float(np.sum(np.diff(moved.start, append=moved.end[-1]).clip(max=STEP_S))) / STEP_S
    likelier *= 0.5 * np.log(unexplained)
    facts: dict[str, Any] = {"here": here}
    if most < UNLIKE and moved.measured and np.nanstd(felt_at(0.0)) > VERY_LIVELY:
        facts |= {"unlike": UNLIKE, "lag": LAG_S}
        yield Finding("warning", "gnss", "time_s", "imu-gnss-unlike", facts)
    elif most > ALIKE and abs(best) > OFFSET_S and unexplained > BETTER and likelier > SURE:
        offset = flight.manifest.clocks.gnss_offset_s + best
        facts |= {"by": best, "most": most, "offset": offset}
        correct = (shift_clock("gnss_offset_s", best),)
        yield Finding("warning", "gnss", "time_s", "imu-gnss-offset", facts, corrections=correct)


# -- units and axes

#: Half of all samples lie above and half below: this one does not mind manoeuvres.
PLAUSIBLE = (5.0, 20.0)  # m/s^2
IN_G = (0.5, 2.0)
#: Means over a second of what is felt agree with the receiver much better than this.
CLOSE = 1.4
#: deg/s for rad/s is a factor of 57; a tenth of it is beyond any manoeuvre.
FACTOR = 10.0
#: Sustained over a second: more than one and a half turns.
FASTEST = 10.0  # rad/s
#: Share of a flight that may be faster, as where it ends in a tumble.
TUMBLING = 0.01
#: Length of the mean direction of down in the body: 0.9 where one flies, 0.7 or more where a gimbal goes from
#: the horizon to straight down, and below 0.4 where degrees were read as radians.
TUMBLED = 0.5
#: Turning counts from here on, flying as well.
TURNING, SLOWEST = 0.05, 5.0  # rad/s, m/s
ENOUGH_TURNS = 10
#: So clear a correlation is a sign.
CLEAR = 0.6
#: So closely the rate about z follows the course where the nose points where it goes.
FOLLOWS = 0.9
#: The mean force points within 45 deg of where it should, or away from it.
ALONG = 0.7
#: Of so many seconds, spread over the flight, it is asked how far the airframe turned in each.
SECONDS = 300_000


def _force_unit(imu: Inertial, moved: Moves | None) -> Iterator[Finding]:
    """Specific force in g, without gravity, or in another unit."""
    size, should = float(np.median(np.sqrt(sum(imu.columns[name] ** 2 for name in FORCE)))), 0.0
    low, high = PLAUSIBLE
    if moved is not None and moved.measured:
        felt_then = np.linalg.norm(imu.mean(FORCE, moved.start, moved.end), axis=1)
        good = np.isfinite(felt_then)
        if good.sum() >= ENOUGH:
            size = float(np.median(felt_then[good]))
            should = float(np.median(np.linalg.norm(moved.force[good], axis=1)))
            low, high = should / CLOSE, should * CLOSE
    if low <= size <= high:
        return
    code = "force-long" if size > high else "force-short"
    if IN_G[0] <= size <= IN_G[1]:
        code = "force-in-g"
    scale = np.sqrt(low * high) / size
    facts = {"size": size, "should": should}
    correct = change_columns("imu", FORCE, lambda f: scale * f)
    yield Finding("problem", "imu", "f_z_m_s2", code, facts, corrections=(correct,))


def _rate_unit(imu: Inertial, moved: Moves | None) -> Iterator[Finding]:
    """Angular rate in deg/s, or taken for it."""
    if moved is not None:
        speed = np.linalg.norm(imu.mean(RATE, moved.start, moved.end), axis=1)
        course = np.abs(moved.course_rate())
        good = np.isfinite(speed) & (course > TURNING)
        ratio = np.median(speed[good] / course[good]) if good.sum() >= ENOUGH_TURNS else 1.0
        if not 1 / FACTOR <= ratio <= FACTOR:
            # Who flies sideways may turn less than the course does.
            fast = ratio > FACTOR
            facts = {"ratio": ratio, "fast": fast, "unit": "deg/s" if fast else "rad/s"}
            correct = (change_columns("imu", RATE, np.radians),) if fast else ()
            level: Level = "problem" if fast else "warning"
            yield Finding(level, "imu", "w_z_rad_s", "rate-against-course", facts, corrections=correct)
            return
    end = imu.times[imu.times >= imu.times[0] + 1.0]
    end = end[:: max(1, len(end) // SECONDS)]
    fast = np.linalg.norm(imu.mean(RATE, end - 1.0, end), axis=1) if len(end) else np.zeros(1)
    if (fastest := np.nanmax(fast)) > FASTEST:
        yield Finding("problem", "imu", "w_z_rad_s", "rate-too-fast", {"turned": fastest / (2 * np.pi)})


def turning(flight: Flight) -> Iterator[Finding]:
    """Attitudes that turn faster than anything flies, or point down in every direction of the body, as of
    angles in degrees that were read as radians."""
    causes = ("attitude in degrees",)
    for source, nav in flight.nav.items():
        table = f"nav/{source}"
        facts: dict[str, Any] = {"part": part_of(table)}
        q = finite_rows(nav, QUATERNION)
        if len(q) < ENOUGH or not q.any(axis=1).all():
            continue
        agreeing = float(np.linalg.norm(quaternion_to_matrix(q)[:, 2].mean(axis=0)))
        if agreeing < TUMBLED:
            yield Finding("problem", table, "q_w", "down-everywhere", facts | {"length": agreeing}, causes)
            continue
        values = None if "frame_id" in nav else increasing_rows(nav, QUATERNION, ENOUGH)
        if values is None:
            continue
        R = Rotation.from_quat(values[:, 1:], scalar_first=True)
        turned = np.cumsum((R[:-1].inv() * R[1:]).as_rotvec(), axis=0)
        t = values[1:, 0]
        first, last = intervals(t)
        rate = np.linalg.norm(turned[last] - turned[first], axis=1) / (t[last] - t[first])
        if len(rate) and (fast := rate > FASTEST).mean() > TUMBLING:
            facts["turned"] = rate[fast].max() / (2 * np.pi)
            yield Finding("problem", table, "q_w", "turns-too-fast", facts, causes)


def _gravity(imu: Inertial, moved: Moves | None) -> Iterator[Finding]:
    """On average an aircraft neither climbs nor falls: the mean force points to its upper side."""
    mean = np.array([imu.columns[name].mean() for name in FORCE])
    size = np.linalg.norm(mean)
    if size < USUAL_GRAVITY / 2 or mean[2] < -ALONG * size:
        return
    axis = int(np.argmax(np.abs(mean)))
    code = "gravity-oblique"
    corrections: tuple[Correction, ...] = ()
    facts: dict[str, Any] = {
        "mean": mean.tolist(),
        "down": f"{'-' if mean[axis] > 0 else ''}{AXES[axis]}",
        "hint": "",
    }
    if axis != 2 and abs(mean[axis]) > ALONG * size:
        code = "gravity-along-other-axis"
    elif axis == 2 and mean[2] > ALONG * size:
        code = "gravity-upside-down"
        corrections = (
            change_columns("imu", (*FORCE, *RATE), lambda x: x * [1, -1, -1, 1, -1, -1]),
            change_columns("imu", FORCE, lambda f: -f),
        )
        both = _turning(imu, moved)
        about_z = 0.0 if both is None else _together(both[0][:, 2], both[1])
        if abs(about_z) > CLEAR:
            facts["hint"] = f" (here the turns say that z points {'up' if about_z < 0 else 'down'})"
    yield Finding("problem", "imu", f"f_{AXES[axis]}_m_s2", code, facts, corrections=corrections)


def _together(a: Array, b: Array) -> float:
    """As a correlation, but about zero: a circle is flown one way all the time."""
    size = np.sqrt(np.sum(a**2) * np.sum(b**2))
    return float(np.sum(a * b) / size) if size > 0 else 0.0


def _turning(imu: Inertial, moved: Moves | None) -> tuple[Array, Array] | None:
    """Rates (K, 3) and how fast the course turns (K,), where there are turns."""
    if moved is None:
        return None
    rate, course = imu.mean(RATE, moved.start, moved.end), moved.course_rate()
    good = np.isfinite(rate).all(axis=1) & np.isfinite(course)
    return (rate[good], course[good]) if (good & (np.abs(course) > TURNING)).sum() >= ENOUGH else None


def _against_course(imu: Inertial, moved: Moves | None) -> Iterator[Finding]:
    """A course to the right is a turn to the right about z; a banked turn raises the nose either way."""
    both = _turning(imu, moved)
    if both is None:
        return
    rate, course = both
    turning = np.abs(course) > TURNING
    about_z, about_y = _together(rate[:, 2], course), _together(rate[turning, 1], np.abs(course[turning]))
    # Who flies sideways turns as the course does by chance alone, and never as closely.
    if about_z < -FOLLOWS:
        yield Finding("warning", "imu", "w_z_rad_s", "z-against-course", {"correlation": about_z})
    elif about_z > FOLLOWS and about_y < -CLEAR:
        yield Finding("warning", "imu", "w_y_rad_s", "nose-drops-in-turns", {"correlation": about_y})
