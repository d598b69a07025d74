"""The hot loops, compiled: strapdown steps and the MEKF."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from wildlab.geometry.compilation import compiled
from wildlab.geometry.frames import Array

if TYPE_CHECKING:
    from wildlab.navigation.strapdown import Measurements, Timeline

Integers = NDArray[np.int64]

#: Errors of H (7.22). Behind them: of the axes, accelerometers first, row by row; Gauss-Markov errors.
N_ERRORS, N_AXES = 15, 18
#: Kinds of measurement.
POSITION, VELOCITY = 0, 1
#: What became of a measurement.
REJECTED, ACCEPTED, FORCED = 0, 1, 2


@compiled
def rotation_of(q: Array) -> Array:
    """H (7.13)."""
    w, x, y, z = q[0], q[1], q[2], q[3]
    return np.array(
        (
            (w * w + x * x - y * y - z * z, 2 * (x * y - w * z), 2 * (x * z + w * y)),
            (2 * (x * y + w * z), w * w - x * x + y * y - z * z, 2 * (y * z - w * x)),
            (2 * (x * z - w * y), 2 * (y * z + w * x), w * w - x * x - y * y + z * z),
        )
    )


@compiled
def multiply(a: Array, b: Array) -> Array:
    """H (7.14), of length one."""
    product = np.array(
        (
            a[0] * b[0] - a[1] * b[1] - a[2] * b[2] - a[3] * b[3],
            a[0] * b[1] + b[0] * a[1] + a[2] * b[3] - a[3] * b[2],
            a[0] * b[2] + b[0] * a[2] + a[3] * b[1] - a[1] * b[3],
            a[0] * b[3] + b[0] * a[3] + a[1] * b[2] - a[2] * b[1],
        )
    )
    return product / np.sqrt(product @ product)


@compiled
def exponential(rotation: Array) -> Array:
    """The quaternion of a rotation vector."""
    angle = np.sqrt(rotation @ rotation)
    # sin(a / 2) / a, by its series where the quotient would be 0 / 0.
    scale = 0.5 - angle * angle / 48 if angle < 1e-4 else np.sin(angle / 2) / angle
    return np.array((np.cos(angle / 2), scale * rotation[0], scale * rotation[1], scale * rotation[2]))


@compiled
def skew(a: Array) -> Array:
    """H (5.1)."""
    return np.array(((0.0, -a[2], a[1]), (a[2], 0.0, -a[0]), (-a[1], a[0], 0.0)))


@compiled
def strapdown_step(x: Array, f: Array, w: Array, dt: float, earth: Array) -> tuple[Array, Array, Array]:
    """One step of the state x (16,): position, velocity, quaternion, accelerometer bias, gyro bias.

    f, w are the mean of the measurements over the step. Besides the state after it, the attitude half-way
    and the specific force in n.
    """
    # The Earth turns n the other way.
    turn, back = exponential((w - x[13:16]) * (dt / 2)), exponential(earth[3:6] * (-dt / 2))
    half = multiply(multiply(back, x[6:10]), turn)
    R_mid = rotation_of(half)
    f_n = R_mid @ (f - x[10:13])
    p, v = x[:3], x[3:6]
    g = earth[0] + earth[1] * p[2]  # down is positive, and gravity grows downwards
    attraction = g * np.array((-earth[2] * p[0], -earth[2] * p[1], 1.0))
    after = x.copy()
    after[3:6] = v + dt * (f_n + attraction - 2 * (skew(earth[3:6]) @ v))
    after[:3] = p + dt / 2 * (v + after[3:6])
    after[6:10] = multiply(multiply(back, half), turn)
    return after, R_mid, f_n


@compiled
def integrate(times: Array, f: Array, w: Array, earth: Array, start: Array) -> Array:
    """Strapdown from the first row on, (N, 16)."""
    out = np.empty((len(times), 16))
    out[0] = start
    for k in range(1, len(times)):
        f_mean, w_mean = (f[k - 1] + f[k]) / 2, (w[k - 1] + w[k]) / 2
        out[k] = strapdown_step(out[k - 1], f_mean, w_mean, times[k] - times[k - 1], earth)[0]
    return out


@compiled
def transition(
    x: Array, f: Array, w: Array, dt: float, earth: Array, axes: bool, count: int
) -> tuple[Array, Array]:
    """The state after a step, and how all errors before it make the first nine after it, (9, count).

    Errors of the axes, where there are any, act as biases of their size times what is measured.
    """
    after, R_mid, f_n = strapdown_step(x, f, w, dt, earth)
    F = np.eye(9, count)
    F[:3, 3:6] = dt * np.eye(3)
    F[3:6, 6:9] = -dt * (skew(f_n) @ rotation_of(x[6:10]))
    F[3:6, 9:12] = -dt * R_mid
    F[3:6, 12:15] = dt * dt / 2 * (skew(f_n) @ R_mid)
    F[6:9, 6:9] = rotation_of(exponential((x[13:16] - w) * dt))
    F[6:9, 12:15] = -dt * np.eye(3)
    if axes:
        for i in range(3):
            for j in range(3):
                F[3:, N_ERRORS + 3 * i + j] = F[3:, 9 + i] * (f[j] - x[10 + j])
                F[3:, N_ERRORS + 9 + 3 * i + j] = F[3:, 12 + i] * (w[j] - x[13 + j])
    F[:3, 6:] = dt / 2 * F[3:6, 6:]
    return after, F


@compiled
def carry(P: Array, F: Array, kept: Array, driven: Array, dt: float, q_v: float, q_a: float) -> Array:
    """The covariance after a step: the first nine errors by F, the slow ones behind them decay alone."""
    top = F @ P
    after = np.empty_like(P)
    after[:9, :9] = top @ F.T
    after[:9, 9:] = top[:, 9:] * kept
    after[9:, :9] = after[:9, 9:].T
    after[9:, 9:] = P[9:, 9:] * np.outer(kept, kept)
    for i in range(3):
        after[i, i] += q_v * dt**3 / 3
        after[i, 3 + i] += q_v * dt * dt / 2
        after[3 + i, i] += q_v * dt * dt / 2
        after[3 + i, 3 + i] += q_v * dt
        after[6 + i, 6 + i] += q_a * dt
    for i in range(len(kept)):
        after[9 + i, 9 + i] += driven[i]
    return after


@compiled
def predict_measurement(
    kind: int, x: Array, w: Array, value: Array, lever: Array, count: int
) -> tuple[Array, Array]:
    """Innovation (3,) and Jacobian (3, count) of a measurement."""
    R, first, H = rotation_of(x[6:10]), 0 if kind == POSITION else 3, np.zeros((3, count))
    arm = lever if kind == POSITION else skew(w - x[13:16]) @ lever
    H[:, first : first + 3] = np.eye(3)
    H[:, 6:9] = -(R @ skew(arm))
    if kind == VELOCITY:
        H[:, 12:15] = R @ skew(lever)
    return value - x[first : first + 3] - R @ arm, H


@compiled
def correct(x: Array, P: Array, H: Array, y: Array, R: Array, axes: bool) -> tuple[Array, Array]:
    """Measurement update, Joseph form; the attitude error is then folded into the quaternion.

    Errors of the axes have no gain, as in a Schmidt filter: they are considered, not estimated.
    """
    K = np.linalg.solve(H @ P @ H.T + R, H @ P).T.copy()
    if axes:
        K[N_ERRORS : N_ERRORS + N_AXES] = 0.0
    dx = K @ y
    left = np.eye(len(P)) - K @ H
    after = x.copy()
    after[:6] += dx[:6]
    after[10:] += dx[9:]
    # Four times the modified Rodrigues parameters, H (7.16), as a quaternion.
    m = dx[6:9] / 4
    after[6:10] = multiply(x[6:10], np.array((1 - m @ m, 2 * m[0], 2 * m[1], 2 * m[2])))
    # What is left of the attitude error is now seen from the turned body.
    G = np.eye(len(P))
    G[6:9, 6:9] -= skew(dx[6:9] / 2)
    P = G @ (left @ P @ left.T + K @ R @ K.T) @ G.T
    return after, (P + P.T) / 2


@compiled
def mekf(
    line: Timeline, measured: Measurements, earth: Array, noise: Array, slow: Array, x: Array, P: Array,
    axes: bool, gate: float, patience: float, rows: int,
) -> tuple[Array, Array, Array, Array, Array, Integers]:  # fmt: skip
    """The whole filter over a timeline: states and covariances of so many rows, and of each measurement the
    innovation, its covariance, NIS and verdict."""
    n, events = len(P), len(measured.node)
    states, covariances = np.full((rows, 16), np.nan), np.full((rows, N_ERRORS, N_ERRORS), np.nan)
    innovations, spreads = np.full((events, 3), np.nan), np.full((events, 3, 3), np.nan)
    nis, verdicts = np.full(events, np.nan), np.zeros(events, np.int64)
    rejected_since = np.full(2, np.nan)
    event = 0
    for k in range(len(line.times)):
        if k > 0:
            dt = line.times[k] - line.times[k - 1]
            kept = np.exp(-dt / slow[:, 1])
            driven = slow[:, 0] ** 2 * np.where(np.isinf(slow[:, 1]), dt, slow[:, 1] / 2 * (1 - kept**2))
            q_v, q_a = noise[0] ** 2, noise[1] ** 2
            if line.gap[k] > 0:
                # Nothing was measured: straight on, with what an airframe may do meanwhile as uncertainty.
                F = np.eye(9, n)
                F[:3, 3:6], F[6:9, 12:15] = dt * np.eye(3), -dt * np.eye(3)
                x[:3] += dt * x[3:6]
                q_v, q_a = noise[2] ** 2 * line.gap[k], noise[3] ** 2 * line.gap[k]
            else:
                f, w = (line.f[k - 1] + line.f[k]) / 2, (line.w[k - 1] + line.w[k]) / 2
                x, F = transition(x, f, w, dt, earth, axes, n)
            x[10:] *= kept
            P = carry(P, F, kept, driven, dt, q_v, q_a)
        while event < events and measured.node[event] == k:
            kind, first = measured.kind[event], measured.gauss_markov[event]
            y, H = predict_measurement(kind, x, line.w[k], measured.value[event], measured.lever[event], n)
            if first >= 0:
                y -= x[1 + first : 4 + first]
                H[:, first : first + 3] = np.eye(3)
            R = np.diag(measured.variance[event])
            known = H @ P @ H.T
            nis[event] = y @ np.linalg.solve(known + R, y)
            innovations[event], spreads[event], verdicts[event] = y, known + R, ACCEPTED
            if nis[event] > gate:
                if np.isnan(rejected_since[kind]):
                    rejected_since[kind] = line.times[k]
                verdicts[event] = REJECTED if line.times[k] - rejected_since[kind] < patience else FORCED
            if verdicts[event] == FORCED:
                growth = 2.0
                while growth <= 1e12 and y @ np.linalg.solve(growth * known + R, y) > gate:
                    growth *= 2.0
                P = growth * P
            if verdicts[event] != REJECTED:
                rejected_since[kind] = np.nan
                x, P = correct(x, P, H, y, R, axes)
            event += 1
        row = line.row_of_node[k]
        if row >= 0:
            states[row] = x[:16]
            covariances[row] = P[:N_ERRORS, :N_ERRORS]
    return states, covariances, innovations, spreads, nis, verdicts
