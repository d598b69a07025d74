"""Initial alignment: position from a fix, attitude from two directions known in b and in n.

One direction is the specific force, which at rest points up. The other is whatever tells the heading: the
baseline between two antennas, the magnetic field, or, in flight, the course.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from wildlab.errors import WildlabError
from wildlab.geometry.frames import Array, flat_earth, matrix_to_quaternion
from wildlab.navigation.mekf import InitialState
from wildlab.navigation.strapdown import ImuSamples, checked_imu, integrate_strapdown

#: Deviations within a second, per axis, up to which an airframe stands: m/s^2 and rad/s; and the speed that
#: a receiver at rest stays below, m/s. Two small drones show up to 0.14 and 0.03 standing in wind, and
#: more than this on some axis when carried.
STILL_FORCE, STILL_RATE, STILL_SPEED = 0.3, 0.05, 1.0


def attitude_from_directions(
    first_b: ArrayLike, first_n: ArrayLike, second_b: ArrayLike, second_n: ArrayLike
) -> Array:
    """``R_nb`` (3, 3) that takes the first direction over exactly and the second as well as can be (TRIAD).

    Raises
    ------
    WildlabError
        If the two directions are zero or parallel.
    """
    triads = []
    for first, second in ((first_b, second_b), (first_n, second_n)):
        a = np.asarray(first, float)
        across = np.cross(a, np.asarray(second, float))
        if not np.linalg.norm(across) > 1e-9:
            raise WildlabError(
                "the directions that the attitude should follow from are parallel, zero or not known",
                "start at a time at which the specific force and the reference for the heading differ",
                field="start",
            )
        a, across = a / np.linalg.norm(a), across / np.linalg.norm(across)
        triads.append(np.stack([a, across, np.cross(a, across)], axis=-1))
    return np.asarray(triads[1] @ triads[0].T, float)


class Kinematics(NamedTuple):
    """How b moves in n at one time, (3,) each: m, m/s, m/s^2 (zero at rest)."""

    position: ArrayLike
    velocity: ArrayLike
    acceleration: ArrayLike = (0.0, 0.0, 0.0)


class Reference(NamedTuple):
    """A direction that is not vertical, (3,) in b and in n, for the heading."""

    in_b: ArrayLike
    in_n: ArrayLike


class InitialSd(NamedTuple):
    """Standard deviations of an initial state.

    Attributes
    ----------
    position_sd, velocity_sd
        m and m/s; (3,) in n, or one number.
    level_sd, heading_sd
        rad, about level axes and about the vertical. ``level_sd`` is of roll and pitch together with what
        the accelerometers' bias does to them.
    accelerometer_bias_sd, gyro_bias_sd
        m/s^2 and rad/s.
    """

    position_sd: ArrayLike = 5.0
    velocity_sd: ArrayLike = 1.0
    level_sd: float = 0.05
    heading_sd: float = 0.2
    accelerometer_bias_sd: float = 0.2
    gyro_bias_sd: float = 0.01


def align_at(
    time: float,
    imu: ImuSamples,
    moving: Kinematics,
    reference: Reference,
    sd: InitialSd,
    *,
    gravity: float,
    gyro_bias: ArrayLike = (0.0, 0.0, 0.0),
    window: float = 1.0,
) -> InitialState:
    """An initial state from what is known at one time.

    Parameters
    ----------
    time
        s.
    imu
        Its mean specific force within the window is taken as the direction of the acceleration less
        gravity.
    moving, reference, sd
        See `Kinematics`, `Reference`, `InitialSd`.
    gravity
        m/s^2.
    gyro_bias
        (3,) rad/s in b.
    window
        How long the window is, s; the time is its middle.

    Returns
    -------
    InitialState
        At that time, with an accelerometer bias of zero.

    Raises
    ------
    WildlabError
        If the inertial samples cannot be used, none lies within the window, or the directions do not give
        an attitude.
    """
    samples = checked_imu(imu)
    near = np.abs(samples.times - time) <= window / 2
    if not near.any():
        raise WildlabError(
            f"there is no inertial sample within {window / 2} s of the start at {time} s",
            "start later, or check that inertial sensors and GNSS are on the same clock",
            field="start",
        )
    up = np.asarray(moving.acceleration, float) - np.array([0.0, 0.0, gravity])
    R = attitude_from_directions(samples.specific_force[near].mean(axis=0), up, *reference)
    P = np.zeros((15, 15))
    blocks = ((0, sd.position_sd), (3, sd.velocity_sd), (9, sd.accelerometer_bias_sd), (12, sd.gyro_bias_sd))
    for first, size in blocks:
        block = slice(first, first + 3)
        P[block, block] = np.diag(np.broadcast_to(np.asarray(size, float), 3) ** 2)
    P[6:9, 6:9] = R.T @ np.diag([sd.level_sd**2, sd.level_sd**2, sd.heading_sd**2]) @ R
    parts = (moving.position, moving.velocity, matrix_to_quaternion(R), np.zeros(3), gyro_bias)
    return InitialState(float(time), np.concatenate([np.asarray(part, float) for part in parts]), P)


def align_from_baseline(
    imu: ImuSamples, times: ArrayLike, p_first: ArrayLike, p_second: ArrayLike, lever_first: ArrayLike,
    lever_second: ArrayLike, *, gravity: float, baseline_sd: float = 0.02, **sd: float,
) -> InitialState:  # fmt: skip
    """A start from the first pair of positions of two antennas.

    Velocity and acceleration are those of a parabola through the first second of the first antenna's fixes.

    Parameters
    ----------
    imu
        Inertial measurements; fixes before the first of them are not used.
    times
        (N,) s, of both antennas' positions.
    p_first, p_second
        (N, 3) m in n; rows with NaN are left out.
    lever_first, lever_second
        (3,) m in b.
    gravity
        m/s^2.
    baseline_sd
        Of the difference of the positions, m: the standard deviation of the heading follows from it.
    sd
        Standard deviations that differ from those of `InitialSd`, by name.

    Returns
    -------
    InitialState
        At the first pair; the position is that of b, the velocity that of the first antenna.

    Raises
    ------
    WildlabError
        If fewer than three pairs of positions are left, the inertial samples cannot be used or none is near
        the first pair, or no attitude follows from the baseline and the specific force.
    """
    t, p, other = np.asarray(times, float), np.asarray(p_first, float), np.asarray(p_second, float)
    arm, baseline_b = np.asarray(lever_first, float), np.asarray(lever_second, float) - lever_first
    begin = checked_imu(imu).times[0]
    both = np.flatnonzero(np.isfinite(p).all(axis=1) & np.isfinite(other).all(axis=1) & (t >= begin))
    both = both[(t[both] <= t[both[:1]] + 1.0) | (np.arange(len(both)) < 3)]
    if len(both) < 3:
        raise WildlabError(
            f"only {len(both)} pairs of antenna positions lie within the inertial samples",
            "check that inertial sensors and GNSS are on the same clock",
            field="start",
        )
    i = both[0]
    _, v, a = np.polynomial.polynomial.polyfit(t[both] - t[i], p[both], 2)
    length = float(np.linalg.norm(baseline_b))
    start = align_at(
        t[i], imu, Kinematics(p[i], v, 2 * a), Reference(baseline_b, other[i] - p[i]),
        InitialSd(**{"heading_sd": baseline_sd / length, **sd}), gravity=gravity,
    )  # fmt: skip
    from_arm = _turned(start.state[6:10], arm)
    return start._replace(state=np.concatenate([p[i] - from_arm, start.state[3:]]))


def align_from_course(
    imu: ImuSamples, times: ArrayLike, p_n: ArrayLike, v_n: ArrayLike, *, gravity: float,
    min_speed: float = 8.0, **sd: float,
) -> InitialState:  # fmt: skip
    """A start from the first fix in flight: the nose is taken to point where the airframe goes.

    It does not in wind: ``heading_sd`` must cover the crab angle (wind across, over airspeed). The
    acceleration is the slope of the velocities around that fix.

    Parameters
    ----------
    imu
        Inertial measurements; fixes outside them are not used.
    times, p_n, v_n
        (N,) s, (N, 3) m in n and (N, 3) m/s in n, valid at those times (a latency taken off).
    gravity
        m/s^2.
    min_speed
        Level speed (m/s) from which a course counts.
    sd
        Standard deviations, by name, that differ from those of `InitialSd` with a ``heading_sd`` of 0.4 and a
        ``level_sd`` of 0.1 rad.

    Returns
    -------
    InitialState
        At the first fix that is fast enough.

    Raises
    ------
    WildlabError
        If no fix within the inertial samples is fast enough, the samples cannot be used or none is near that
        fix, or no attitude follows from its velocity and the specific force.
    """
    t, p, v = np.asarray(times, float), np.asarray(p_n, float), np.asarray(v_n, float)
    samples = checked_imu(imu).times
    fast = (np.hypot(v[:, 0], v[:, 1]) >= min_speed) & np.isfinite(p).all(axis=1)
    fast &= (t >= samples[0]) & (t < samples[-1])
    if not fast.any():
        raise WildlabError(
            f"no GNSS velocity reaches {min_speed} m/s within the inertial samples",
            "start from two antennas or a magnetometer instead, or check the clocks",
            field="start",
        )
    i = int(np.argmax(fast))
    before, after = max(i - 1, 0), min(i + 1, len(t) - 1)
    a = (v[after] - v[before]) / (t[after] - t[before]) if after > before else np.zeros(3)
    return align_at(
        t[i], imu, Kinematics(p[i], v[i], a), Reference([1.0, 0.0, 0.0], v[i]),
        InitialSd(**{"heading_sd": 0.4, "level_sd": 0.1, **sd}), gravity=gravity,
    )  # fmt: skip


def _turned(q: Array, vector: Array) -> Array:
    w, u = q[0], q[1:]
    return np.asarray(vector + 2 * np.cross(u, np.cross(u, vector) + w * vector), float)


def find_rest(
    imu: ImuSamples, times: ArrayLike, v_n: ArrayLike, *, min_speed: float = 8.0, shortest: float = 10.0,
    longest: float = 30.0,
) -> tuple[float, float] | None:  # fmt: skip
    """When it last stood still before it took off.

    Still is a second in which neither force nor rate changes as it does in anybody's hands, and in which no
    fix moves. A long rest is cut to its end, since biases change while sensors warm up.

    Parameters
    ----------
    imu
        Inertial measurements, from before the flight on.
    times, v_n
        (N,) s and (N, 3) m/s in n, as in :func:`align_from_course`.
    min_speed
        Level speed (m/s) from which it counts as having taken off.
    shortest, longest
        How long a rest must be and what it is cut to, s.

    Returns
    -------
    tuple or None
        From when to when, s; None where it did not stand still for so long.

    Raises
    ------
    WildlabError
        For inertial samples that cannot be used; see `timeline.checked_imu`.
    """
    t, v = np.asarray(times, float), np.asarray(v_n, float)
    samples = checked_imu(imu)
    flown = t[np.hypot(v[:, 0], v[:, 1]) >= min_speed]
    first, seconds = samples.times[0], int((flown.min(initial=samples.times[-1]) - samples.times[0]) // 1.0)
    if seconds < shortest:
        return None
    before = samples.times < first + seconds
    second = (samples.times[before] - first).astype(int)
    count = np.bincount(second, minlength=seconds)
    still = count > 1
    for values, limit in ((samples.specific_force, STILL_FORCE), (samples.angular_rate, STILL_RATE)):
        for column in values[before].T:
            mean = np.bincount(second, column, seconds) / np.maximum(count, 1)
            off = column - mean[second]
            still &= np.bincount(second, off**2, seconds) <= limit**2 * count
    moving = (np.linalg.norm(v, axis=1) > STILL_SPEED) & (t >= first) & (t < first + seconds)
    still[(t[moving] - first).astype(int)] = False
    edges = np.flatnonzero(np.diff(np.concatenate([[False], still, [False]])))
    for begin, end in edges.reshape(-1, 2)[::-1]:
        if end - begin >= shortest:
            return float(first + max(begin, end - longest)), float(first + end)
    return None


def align_at_rest(
    imu: ImuSamples, times: ArrayLike, p_n: ArrayLike, v_n: ArrayLike, *, rest: tuple[float, float],
    gravity: float, min_speed: float = 4.0, **sd: float,
) -> InitialState:  # fmt: skip
    """A start on the ground, in the middle of a time of standing still, of which nobody knows the heading.

    Roll and pitch are levelled, the gyros' mean is their bias. The heading is the one from which the gyros
    alone lead to the course of the first fix that moves: along the runway, that is where the nose points.

    Parameters
    ----------
    imu
        Inertial measurements, from the rest until a fix moves.
    times, p_n, v_n
        (N,) s, (N, 3) m in n and (N, 3) m/s in n, as in :func:`align_from_course`.
    rest
        From when to when it stands still, s; at least two inertial samples and one fix.
    gravity
        m/s^2.
    min_speed
        Level speed (m/s) from which a course counts.
    sd
        Standard deviations, by name, that differ from those of `InitialSd` with a ``gyro_bias_sd`` of
        0.002 rad/s.

    Returns
    -------
    InitialState
        At the inertial sample in the middle, at the mean of the fixes during the rest, with no velocity.

    Raises
    ------
    WildlabError
        If the rest has fewer than two inertial samples or no fix, no fix behind it moves within the inertial
        samples, these cannot be used, or the specific force is along the nose.
    """
    t, p, v = np.asarray(times, float), np.asarray(p_n, float), np.asarray(v_n, float)
    samples = checked_imu(imu)
    still = (samples.times >= rest[0]) & (samples.times <= rest[1])
    fixes = (t >= rest[0]) & (t <= rest[1]) & np.isfinite(p).all(axis=1)
    fast = np.hypot(v[:, 0], v[:, 1]) >= min_speed
    moving = np.flatnonzero(fast & (t > rest[1]) & (t < samples.times[-1]))
    if still.sum() < 2 or not fixes.any() or not len(moving):
        raise WildlabError(
            f"the rest from {rest[0]} to {rest[1]} s has {still.sum()} inertial samples and {fixes.sum()} "
            f"fixes, and {len(moving)} fixes after it move at {min_speed} m/s",
            "name a time of standing still before the flight, or start from the course",
            field="start",
        )
    bias = samples.angular_rate[still].mean(axis=0)
    time = float(samples.times[still][int(still.sum()) // 2])
    window = 0.999 * 2 * min(time - rest[0], rest[1] - time)
    spread = InitialSd(**{"gyro_bias_sd": 0.002, **sd})

    def towards(heading: float) -> InitialState:
        nose = [np.cos(heading), np.sin(heading), 0.0]
        return align_at(
            time, imu, Kinematics(p[fixes].mean(axis=0), np.zeros(3)), Reference([1.0, 0.0, 0.0], nose),
            spread, gravity=gravity, gyro_bias=bias, window=window,
        )  # fmt: skip

    i = moving[0]
    rolling = (samples.times >= time) & (samples.times <= t[i])
    part = ImuSamples(
        samples.times[rolling], samples.specific_force[rolling], samples.angular_rate[rolling] - bias
    )
    q = towards(0.0).state[6:10]
    last = integrate_strapdown(part, p[i], v[i], q, flat_earth(gravity), max_gap=np.inf).quaternion[-1]
    nose = _turned(last, np.array([1.0, 0.0, 0.0]))
    return towards(float(np.arctan2(v[i, 1], v[i, 0]) - np.arctan2(nose[1], nose[0])))
