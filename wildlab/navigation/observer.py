"""The nonlinear observer of H 5.5: attitude with gyro bias, and translational motion in ECEF.

Where H integrates, measurements come one by one. Between them the Riccati equation (5.50) has a closed form,
and each updates the estimate with the gain that (5.48)-(5.49) tend to: with ``theta`` 1 that of a Kalman
filter. The injection of the second vector is held in b until the next one, at most half as long again as
usual.

H's second vector is the baseline between two antennas. A log with one antenna has none;
:func:`field_reference` takes the magnetic field, :func:`course_reference` the course, instead. Both are
beyond H, and as wrong as the field's calibration or the crab angle. So are antennas' velocities.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from wildlab.geometry.compilation import compiled
from wildlab.geometry.frames import (
    Array,
    Origin,
    geodetic_to_ecef,
    matrix_to_quaternion,
    quaternion_to_matrix,
)
from wildlab.navigation.aiding import Aiding, gather, set_out
from wildlab.navigation.kernels import (
    POSITION,
    VELOCITY,
    exponential,
    multiply,
    rotation_of,
    skew,
)
from wildlab.navigation.mekf import InitialState, check_initial
from wildlab.navigation.strapdown import Gap, ImuSamples, Measurements, Timeline, checked_imu

#: WGS84: gravitational constant (m^3/s^2), equatorial radius (m), J2, rate (rad/s).
MU, RADIUS, J2, RATE = 3.986004418e14, 6378137.0, 1.082629821313e-3, 7.292115e-5


@compiled
def gravity_at(p: Array) -> Array:
    """Gravity in ECEF, m/s^2: the Earth's attraction with its flattening, and the centrifugal force.

    What J2 leaves out is below 2e-4 m/s^2, some 20 millionths of it.
    """
    square = p @ p
    flat = 1.5 * J2 * RADIUS**2 / square * (np.array((1.0, 1.0, 3.0)) - 5 * p[2] ** 2 / square)
    return -MU / square**1.5 * p * (1 + flat) + RATE**2 * np.array((p[0], p[1], 0.0))


@compiled
def attitude_step(q: Array, turn: Array, turned: float) -> Array:
    """``q`` turned by half a rotation vector ``turn`` (3,) in b, and by ``turned`` (rad) of the Earth."""
    return multiply(exponential(np.array((0.0, 0.0, -turned))), multiply(q, exponential(turn / 2)))


@compiled
def unit(a: Array) -> Array:
    size = np.sqrt(a @ a)
    return a / size if size > 0 else np.zeros(3)


@compiled
def force_directions(f: Array, R: Array, xi: Array, limit: float) -> tuple[Array, Array]:
    """H (5.39): the measured direction in b, the estimated one in e."""
    return unit(f), unit(np.clip(R @ f + xi, -limit, limit))


@compiled
def injection(a_b: Array, a_e: Array, R: Array, gain: float) -> Array:
    """One term of H (5.36)."""
    return gain * (skew(a_b) @ (R.T @ a_e))


@compiled
def projected(b: Array, move: Array, inner: float, outer: float) -> Array:
    """``move`` without what would carry the bias over its bound."""
    square, along = b @ b, b @ move
    if square <= inner**2 or along <= 0:
        return move
    share = min(1.0, float((square - inner**2) / (outer**2 - inner**2)))
    return move - share * along * b / square


@compiled
def update(x: Array, P: Array, y: Array, variance: Array, first: int, theta: float) -> tuple[Array, Array]:
    """Measurement update of the elements from ``first`` on, with the gains H (5.48)-(5.49)."""
    s_first, H = theta if first == 3 else 1.0, np.zeros((3, 9))
    H[:, first : first + 3] = np.eye(3)
    PH = P @ H.T
    K = PH @ np.linalg.inv(H @ PH + np.diag(variance) / (s_first**2 * theta))
    P = P - K @ PH.T
    scale = np.repeat(np.array((1.0, theta, theta**2)), 3)
    return x + scale * (K @ y) / s_first, (P + P.T) / 2


@compiled
def riccati_step(P: Array, h: float, q_f: float, q_xi: float) -> Array:
    """H (5.50) between measurements, over the scaled time h: the transition is a polynomial."""
    Phi = np.eye(9) + h * np.eye(9, k=3) + h * h / 2 * np.eye(9, k=6)
    return Phi @ P @ Phi.T + h * np.diag(np.repeat(np.array((0.0, q_f, q_xi)), 3))


@compiled
def observe(
    line: Timeline, measured: Measurements, gains: Array, q: Array, b: Array, x: Array, P: Array, out: Array
) -> None:
    k1, k2, k_i, inner, outer, theta, q_f, q_xi, limit, hold = gains
    held, held_until, event, earth = np.zeros(3), -np.inf, 0, np.array((0.0, 0.0, RATE))
    for k in range(len(line.times)):
        if k > 0:
            dt = line.times[k] - line.times[k - 1]
            if line.gap[k] > 0:
                x[:3] += dt * x[3:6]
            else:
                f, w = (line.f[k - 1] + line.f[k]) / 2, (line.w[k - 1] + line.w[k]) / 2
                R = rotation_of(q)
                f_b, f_e = force_directions(f, R, x[6:9], limit)
                sigma = injection(f_b, f_e, R, k1)
                if line.times[k] <= held_until:
                    sigma += held
                turn = dt * (w - b + sigma)
                half = attitude_step(q, turn, RATE * dt / 2)
                q, R = attitude_step(half, turn, RATE * dt / 2), rotation_of(half)
                b = b + dt * projected(b, -k_i * sigma, inner, outer)
                change = dt * (R @ f + x[6:9] + gravity_at(x[:3]) - 2 * (skew(earth) @ x[3:6]))
                x[:3] += dt * (x[3:6] + change / 2)
                x[3:6] += change
                x[6:9] -= dt * (R @ (skew(sigma) @ f))
            P = riccati_step(P, theta * dt, q_f, q_xi)
        while event < len(measured.node) and measured.node[event] == k:
            R, kind = rotation_of(q), measured.kind[event]
            value, lever = measured.value[event], measured.lever[event]
            if kind in (POSITION, VELOCITY):
                first = 0 if kind == POSITION else 3
                arm = lever if kind == POSITION else skew(line.w[k] - b) @ lever
                y = value - x[first : first + 3] - R @ arm
                x, P = update(x, P, y, measured.variance[event], first, theta)
            else:
                # A direction: value in e, lever in b, H (5.38).
                f_b, f_e = force_directions(line.f[k], R, x[6:9], limit)
                held = injection(skew(f_b) @ lever, skew(f_e) @ value, R, k2)
                held_until = line.times[k] + hold
            event += 1
        row = line.row_of_node[k]
        if row >= 0:
            out[row, :4], out[row, 4:7], out[row, 7:16] = q, b, x


REFERENCE = 3


class Gains(NamedTuple):
    """Tuning of the observer.

    Attributes
    ----------
    k1, k2
        Of the specific force and of the second vector, rad/s (H 5.36).
    k_i
        Of the gyro bias, 1/s (H 5.35c).
    bias_bound
        What the gyro bias does not exceed, rad/s; the estimate is kept within 1.2 times that.
    theta
        The time scale of H (5.41).
    force_noise, correction_noise
        Spectral densities behind Q in H (5.50): of the specific force, m/s/sqrt(s), and of what corrects it,
        m/s^2/sqrt(s).
    force_bound
        Each component of the estimated specific force is cut off here, m/s^2 (H 5.39).
    """

    k1: float = 0.3
    k2: float = 0.3
    k_i: float = 0.01
    bias_bound: float = 0.05
    theta: float = 1.0
    force_noise: float = 0.05
    correction_noise: float = 0.1
    force_bound: float = 80.0


class Observed(NamedTuple):
    """The estimate at M times; NaN outside and inside gaps.

    ``correction`` (M, 3), m/s^2, is the observer's auxiliary state in n: what it adds to the specific force
    that the accelerometers measure. The rest is as in `Navigation`.
    """

    times: Array
    position: Array
    velocity: Array
    quaternion: Array
    gyro_bias: Array
    correction: Array
    gaps: list[Gap]
    unused: list[int]


def baseline_reference(
    times: ArrayLike, p_first: ArrayLike, p_second: ArrayLike, lever_first: ArrayLike, lever_second: ArrayLike
) -> Aiding:
    """The vector from one antenna to the other, H (5.40).

    Parameters
    ----------
    times
        (N,) s, of both antennas' positions.
    p_first, p_second
        (N, 3) m in n; rows with NaN are left out.
    lever_first, lever_second
        Of the antennas, (3,) m in b.

    Returns
    -------
    Aiding
        For :func:`run_observer` only.

    Raises
    ------
    ValueError
        For shapes that do not fit.
    """
    in_b = np.asarray(lever_second, float) - np.asarray(lever_first, float)
    return field_reference(times, in_b, np.asarray(p_second, float) - np.asarray(p_first, float))


def field_reference(times: ArrayLike, field_b: ArrayLike, field_n: ArrayLike) -> Aiding:
    """The magnetic field as the second vector. Beyond H.

    Parameters
    ----------
    times
        (N,) s.
    field_b
        (N, 3) in b, of any unit, calibrated for hard and soft iron; rows with NaN are left out.
    field_n
        The field as it is there, (3,) in n, of any unit; see `wildlab.navigation.aiding.earth_field`.

    Returns
    -------
    Aiding
        For :func:`run_observer` only.

    Raises
    ------
    ValueError
        For shapes that do not fit.
    """
    t = np.asarray(times, float)
    b, n = (np.array(np.broadcast_to(np.asarray(a, float), (len(t), 3))) for a in (field_b, field_n))
    sizes = np.linalg.norm(b, axis=1), np.linalg.norm(n, axis=1)
    keep = np.isfinite(t) & (sizes[0] > 0) & (sizes[1] > 0) & np.isfinite(sizes[0] + sizes[1])
    b, n = b[keep] / sizes[0][keep, None], n[keep] / sizes[1][keep, None]
    return Aiding(REFERENCE, t[keep], n, np.ones_like(n), b)


def course_reference(times: ArrayLike, v_n: ArrayLike, min_speed: float = 8.0) -> Aiding:
    """The nose along the velocity over the ground. Beyond H.

    Parameters
    ----------
    times
        (N,) s, when they were valid.
    v_n
        (N, 3) m/s in n; rows with NaN are left out.
    min_speed
        Level speed (m/s) from which a course counts.

    Returns
    -------
    Aiding
        For :func:`run_observer` only.

    Raises
    ------
    ValueError
        For shapes that do not fit.
    """
    v = np.array(v_n, float)
    v[~(np.hypot(v[:, 0], v[:, 1]) >= min_speed)] = np.nan
    return field_reference(times, [1.0, 0.0, 0.0], v)


def earth_axes(origin: Origin) -> tuple[Array, Array]:
    """Where n lies in e: position (3,), and ``R_en`` (3, 3)."""
    lat, lon, _ = origin
    north = [-np.sin(lat) * np.cos(lon), -np.sin(lat) * np.sin(lon), np.cos(lat)]
    east = [-np.sin(lon), np.cos(lon), 0.0]
    return geodetic_to_ecef(*origin), np.stack([north, east, np.cross(north, east)], axis=-1)


def run_observer(
    imu: ImuSamples,
    start: InitialState,
    origin: Origin,
    aiding: Sequence[Aiding],
    output_times: ArrayLike | None = None,
    *,
    gains: Gains | None = None,
    max_gap: float = 0.1,
) -> Observed:
    """Position, velocity, attitude and gyro bias, without a covariance: the observer has none to give.

    Parameters
    ----------
    imu, start, output_times
        As for `mekf.run_mekf`.
    origin
        Of n: latitude, longitude (rad), ellipsoidal height (m).
    aiding
        Positions, and velocities where there are any, as from `aiding`; and a second vector from
        :func:`baseline_reference`, :func:`field_reference` or :func:`course_reference`. Without one, the
        heading hangs on the estimated specific force alone, which shows it in turns only.
    gains
        How it is tuned; without them, as `Gains` has it.
    max_gap
        Intervals between inertial samples longer than this (s) are crossed in a straight line.

    Returns
    -------
    Observed
        At the output times; see there.

    Raises
    ------
    WildlabError
        For arrays that do not fit, an initial state that is not finite or without a covariance, or one
        outside the inertial samples.
    """
    wanted = checked_imu(imu).times if output_times is None else np.asarray(output_times, float)
    times, row = np.unique(wanted, return_inverse=True)
    gains = gains or Gains()
    check_initial(start)
    line, gaps = set_out(imu, start.time, aiding, times, max_gap)
    p_e, R_en = earth_axes(origin)
    in_e = [a._replace(value=a.value @ R_en.T + (p_e if a.kind == POSITION else 0.0)) for a in aiding]
    measured, _, unused = gather(in_e, line)
    seen = line.times[np.unique(measured.node[measured.kind == REFERENCE])]
    apart = np.diff(seen) if len(seen) > 1 else [0.0]
    numbers = np.array(
        [
            gains.k1, gains.k2, gains.k_i, gains.bias_bound, 1.2 * gains.bias_bound, gains.theta,
            gains.force_noise**2, gains.correction_noise**2, gains.force_bound, 1.5 * float(np.median(apart)),
        ]
    )  # fmt: skip
    state = np.asarray(start.state, float)
    x = np.concatenate([p_e + R_en @ state[:3], R_en @ state[3:6], np.zeros(3)])
    q = matrix_to_quaternion(R_en @ quaternion_to_matrix(state[6:10]))
    # What the estimated force may be off by at first: the accelerometers' bias, and gravity leaning with
    # roll.
    force = (9.8**2 * start.covariance[6:9, 6:9] + start.covariance[9:12, 9:12]).trace() / 3
    spread = [start.covariance[i : i + 3, i : i + 3].trace() / 3 for i in (0, 3)] + [force]
    P = np.diag(np.repeat(spread, 3) / np.repeat([1.0, gains.theta**2, gains.theta**4], 3))
    out = np.full((len(times), 16), np.nan)
    observe(line, measured, numbers, q, state[13:].copy(), x, P, out)
    for gap in gaps:
        out[(times > gap.start) & (times < gap.end)] = np.nan
    rows = out[row]
    quaternion = np.full((len(wanted), 4), np.nan)
    filled = np.isfinite(rows[:, 0])
    if filled.any():
        quaternion[filled] = matrix_to_quaternion(R_en.T @ quaternion_to_matrix(rows[filled, :4]))
    return Observed(
        wanted, (rows[:, 7:10] - p_e) @ R_en, rows[:, 10:13] @ R_en, quaternion, rows[:, 4:7],
        rows[:, 13:] @ R_en, gaps, unused,
    )  # fmt: skip
