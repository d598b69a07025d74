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
    Integers,
    exponential,
    multiply,
    normalise,
    rotation_of,
)
from wildlab.navigation.mekf import InitialState, check_initial
from wildlab.navigation.strapdown import Gap, ImuSamples, Measurements, Timeline, checked_imu

#: WGS84: gravitational constant (m^3/s^2), equatorial radius (m), J2, rate (rad/s).
MU, RADIUS, J2, RATE = 3.986004418e14, 6378137.0, 1.082629821313e-3, 7.292115e-5


@compiled
def gravity_at(p: Array, g: Array) -> None:
    """Gravity in ECEF, m/s^2: the Earth's attraction with its flattening, and the centrifugal force.

    What J2 leaves out is below 2e-4 m/s^2, some 20 millionths of it.
    """
    square = p[0] * p[0] + p[1] * p[1] + p[2] * p[2]
    pull = -MU / (square * np.sqrt(square))
    flat, polar = 1.5 * J2 * RADIUS * RADIUS / square, 5 * p[2] * p[2] / square
    g[0] = pull * p[0] * (1 + flat * (1 - polar)) + RATE * RATE * p[0]
    g[1] = pull * p[1] * (1 + flat * (1 - polar)) + RATE * RATE * p[1]
    g[2] = pull * p[2] * (1 + flat * (3 - polar))


@compiled
def attitude_step(q: Array, turn: Array, turned: float, work: Array) -> None:
    """``q`` turned by half a rotation vector ``turn`` (3,) in b, and by ``turned`` (rad) of the Earth."""
    by, after = work[0], work[1]
    exponential(turn[0] / 2, turn[1] / 2, turn[2] / 2, by)
    multiply(q, by, after)
    exponential(0.0, 0.0, -turned, by)
    multiply(by, after, q)
    normalise(q)


@compiled
def cross(a: Array, b: Array, out: Array) -> None:
    out[0], out[1], out[2] = a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


@compiled
def unit(a: Array, out: Array) -> None:
    size = np.sqrt(a[0] * a[0] + a[1] * a[1] + a[2] * a[2])
    for i in range(3):
        out[i] = a[i] / size if size > 0 else 0.0


@compiled
def force_directions(
    f: Array, R: Array, xi: Array, limit: float, f_b: Array, f_e: Array, work: Array
) -> None:
    """H (5.39): the measured direction in b, the estimated one in e."""
    unit(f, f_b)
    for i in range(3):
        work[i] = R[i, 0] * f[0] + R[i, 1] * f[1] + R[i, 2] * f[2] + xi[i]
        work[i] = min(max(work[i], -limit), limit)
    unit(work, f_e)


@compiled
def injection(a_b: Array, a_e: Array, R: Array, gain: float, out: Array, work: Array) -> None:
    """One term of H (5.36)."""
    for i in range(3):
        work[i] = R[0, i] * a_e[0] + R[1, i] * a_e[1] + R[2, i] * a_e[2]
    cross(a_b, work, out)
    for i in range(3):
        out[i] *= gain


@compiled
def project(b: Array, move: Array, inner: float, outer: float) -> None:
    """Takes from ``move`` what would carry the bias over its bound."""
    square = b[0] * b[0] + b[1] * b[1] + b[2] * b[2]
    along = b[0] * move[0] + b[1] * move[1] + b[2] * move[2]
    if square > inner * inner and along > 0:
        share = min(1.0, (square - inner * inner) / (outer * outer - inner * inner))
        for i in range(3):
            move[i] -= share * along * b[i] / square


@compiled
def update(x: Array, P: Array, y: Array, variance: Array, first: int, theta: float, K: Array) -> None:
    """Measurement update of the elements from ``first`` on, with the gains H (5.48)-(5.49)."""
    S, s_first = np.empty((3, 3)), theta if first == 3 else 1.0
    for i in range(3):
        for j in range(3):
            S[i, j] = P[first + i, first + j]
        S[i, i] += variance[i] / (s_first * s_first * theta)
    inverse = np.linalg.inv(S)
    for i in range(9):
        for j in range(3):
            K[i, j] = 0.0
            for k in range(3):
                K[i, j] += P[i, first + k] * inverse[k, j]
    scale = 1.0
    for i in range(9):
        if i == 3 or i == 6:
            scale *= theta
        for j in range(3):
            x[i] += scale * K[i, j] * y[j] / s_first
    rows = P[first : first + 3].copy()
    for i in range(9):
        for j in range(9):
            for k in range(3):
                P[i, j] -= K[i, k] * rows[k, j]
    for i in range(9):
        for j in range(i):
            P[i, j] = P[j, i] = (P[i, j] + P[j, i]) / 2


@compiled
def riccati_step(P: Array, h: float, q_f: float, q_xi: float) -> None:
    """H (5.50) between measurements, over the scaled time h: the transition is a polynomial."""
    for _ in range(2):  # once from the left and, transposed, once from the right
        for i in range(3):
            for j in range(9):
                P[i, j] += h * (P[3 + i, j] + h / 2 * P[6 + i, j])
                P[3 + i, j] += h * P[6 + i, j]
        for i in range(9):
            for j in range(i):
                P[i, j], P[j, i] = P[j, i], P[i, j]
    for i in range(3, 6):
        P[i, i] += h * q_f
        P[3 + i, 3 + i] += h * q_xi


@compiled
def observe(
    times: Array, f: Array, w: Array, gap: Array, row_of_node: Integers, node: Integers, kind: Integers,
    value: Array, variance: Array, lever: Array, gains: Array, q: Array, b: Array, x: Array, P: Array,
    out: Array,
) -> None:  # fmt: skip
    k1, k2, k_i, inner, outer, theta, q_f, q_xi, limit, hold = gains
    R, f_mean, sigma, held, move = np.empty((3, 3)), np.empty(3), np.empty(3), np.zeros(3), np.empty(3)
    f_b, f_e, g, a, c, work = np.empty(3), np.empty(3), np.empty(3), np.empty(3), np.empty(3), np.empty(3)
    y, K, held_until, quaternions = np.empty(3), np.empty((9, 3)), -np.inf, np.empty((2, 4))
    event = 0
    for k in range(len(times)):
        if k > 0:
            dt = times[k] - times[k - 1]
            if gap[k] > 0:
                for i in range(3):
                    x[i] += dt * x[3 + i]
            else:
                for i in range(3):
                    f_mean[i] = (f[k - 1, i] + f[k, i]) / 2
                rotation_of(q, R)
                force_directions(f_mean, R, x[6:9], limit, f_b, f_e, work)
                injection(f_b, f_e, R, k1, sigma, work)
                if times[k] <= held_until:
                    for i in range(3):
                        sigma[i] += held[i]
                for i in range(3):
                    a[i] = dt * ((w[k - 1, i] + w[k, i]) / 2 - b[i] + sigma[i])
                    move[i] = -k_i * sigma[i]
                attitude_step(q, a, RATE * dt / 2, quaternions)
                rotation_of(q, R)
                attitude_step(q, a, RATE * dt / 2, quaternions)
                project(b, move, inner, outer)
                gravity_at(x, g)
                cross(sigma, f_mean, c)
                vx, vy = x[3], x[4]
                for i in range(3):
                    b[i] += dt * move[i]
                    force = R[i, 0] * f_mean[0] + R[i, 1] * f_mean[1] + R[i, 2] * f_mean[2] + x[6 + i]
                    turn = 2 * RATE * vy if i == 0 else (-2 * RATE * vx if i == 1 else 0.0)
                    change = dt * (force + g[i] + turn)
                    x[i] += dt * (x[3 + i] + change / 2)
                    x[3 + i] += change
                for i in range(3):
                    x[6 + i] -= dt * (R[i, 0] * c[0] + R[i, 1] * c[1] + R[i, 2] * c[2])
            riccati_step(P, theta * dt, q_f, q_xi)
        while event < len(node) and node[event] == k:
            rotation_of(q, R)
            sort = kind[event]
            if sort in (POSITION, VELOCITY):
                first = 0 if sort == POSITION else 3
                arm = lever[event]
                if sort == VELOCITY:
                    cross(w[k] - b, lever[event], c)
                    arm = c
                for i in range(3):
                    y[i] = value[event, i] - x[first + i]
                    y[i] -= R[i, 0] * arm[0] + R[i, 1] * arm[1] + R[i, 2] * arm[2]
                update(x, P, y, variance[event], first, theta, K)
            else:
                # A direction: value in e, lever in b, H (5.38).
                force_directions(f[k], R, x[6:9], limit, f_b, f_e, work)
                cross(f_b, lever[event], a)
                cross(f_e, value[event], c)
                injection(a, c, R, k2, held, work)
                held_until = times[k] + hold
            event += 1
        row = row_of_node[k]
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


def _reference(times: ArrayLike, in_b: ArrayLike, in_n: ArrayLike) -> Aiding:
    t = np.asarray(times, float)
    b, n = (np.array(np.broadcast_to(np.asarray(a, float), (len(t), 3))) for a in (in_b, in_n))
    sizes = np.linalg.norm(b, axis=1), np.linalg.norm(n, axis=1)
    keep = np.isfinite(t) & (sizes[0] > 0) & (sizes[1] > 0) & np.isfinite(sizes[0] + sizes[1])
    b, n = b[keep] / sizes[0][keep, None], n[keep] / sizes[1][keep, None]
    return Aiding(REFERENCE, t[keep], n, np.ones_like(n), b)


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
    return _reference(times, in_b, np.asarray(p_second, float) - np.asarray(p_first, float))


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
    return _reference(times, field_b, field_n)


def course_reference(
    times: ArrayLike, v_n: ArrayLike, min_speed: float = 8.0, latency: float = 0.0
) -> Aiding:
    """The nose along the velocity over the ground. Beyond H.

    Parameters
    ----------
    times
        (N,) s, as stamped.
    v_n
        (N, 3) m/s in n; rows with NaN are left out.
    min_speed
        Level speed (m/s) from which a course counts.
    latency
        How long before its stamp a velocity was valid, s.

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
    return _reference(np.asarray(times, float) - latency, [1.0, 0.0, 0.0], v)


class ObserverInputs(NamedTuple):
    """What both the compiled observer and its reference take; positions and directions in e."""

    line: Timeline
    measured: Measurements
    gains: Array
    q: Array
    bias: Array
    x: Array
    P: Array
    unused: list[int]
    gaps: list[Gap]


def earth_axes(origin: Origin) -> tuple[Array, Array]:
    """Where n lies in e: position (3,), and ``R_en`` (3, 3)."""
    lat, lon, _ = origin
    north = [-np.sin(lat) * np.cos(lon), -np.sin(lat) * np.sin(lon), np.cos(lat)]
    east = [-np.sin(lon), np.cos(lon), 0.0]
    return geodetic_to_ecef(*origin), np.stack([north, east, np.cross(north, east)], axis=-1)


def prepare(
    imu: ImuSamples,
    start: InitialState,
    origin: Origin,
    aiding: Sequence[Aiding],
    gains: Gains,
    wanted: Array,
    max_gap: float,
) -> ObserverInputs:
    check_initial(start)
    line, gaps = set_out(imu, start.time, aiding, wanted, max_gap)
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
    return ObserverInputs(line, measured, numbers, q, state[13:].copy(), x, P, unused, gaps)


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
    ready = prepare(imu, start, origin, aiding, gains or Gains(), times, max_gap)
    line, measured = ready.line, ready.measured
    out = np.full((len(times), 16), np.nan)
    observe(
        line.times, line.f, line.w, line.gap, line.row_of_node, measured.node, measured.kind,
        measured.value, measured.variance, measured.lever, ready.gains, ready.q, ready.bias, ready.x,
        ready.P, out,
    )  # fmt: skip
    for gap in ready.gaps:
        out[(times > gap.start) & (times < gap.end)] = np.nan
    rows = out[row]
    p_e, R_en = earth_axes(origin)
    quaternion = np.full((len(wanted), 4), np.nan)
    filled = np.isfinite(rows[:, 0])
    if filled.any():
        quaternion[filled] = matrix_to_quaternion(R_en.T @ quaternion_to_matrix(rows[filled, :4]))
    return Observed(
        wanted, (rows[:, 7:10] - p_e) @ R_en, rows[:, 10:13] @ R_en, quaternion, rows[:, 4:7],
        rows[:, 13:] @ R_en, ready.gaps, ready.unused,
    )  # fmt: skip
