"""The MEKF in plain numpy, which the compiled one is tested against."""

from __future__ import annotations

import numpy as np
from scipy.linalg import block_diag
from scipy.spatial.transform import Rotation

from wildlab.geometry.frames import Array, skew
from wildlab.navigation.kernels import ACCEPTED, FORCED, POSITION, REJECTED, Integers
from wildlab.navigation.mekf import MekfInputs


def rotation(q: Array) -> Rotation:
    return Rotation.from_quat(q, scalar_first=True)


def strapdown_step(x: Array, f: Array, w: Array, dt: float, earth: Array) -> tuple[Array, Array, Array]:
    """The state (16,) after a step with mean measurements f, w; ``R_mid``, ``f_n`` as in the compiled one."""
    turn = Rotation.from_rotvec((w - x[13:16]) * dt / 2)
    back = Rotation.from_rotvec(-earth[3:6] * dt / 2)  # the Earth turns n
    half = back * rotation(x[6:10]) * turn
    R_mid = half.as_matrix()
    f_n = R_mid @ (f - x[10:13])
    p, v = x[:3], x[3:6]
    g = (earth[0] + earth[1] * p[2]) * np.array([-earth[2] * p[0], -earth[2] * p[1], 1.0])
    after = x.copy()
    after[3:6] = v + dt * (f_n + g - 2 * np.cross(earth[3:6], v))
    after[:3] = p + dt / 2 * (v + after[3:6])
    q = (back * half * turn).as_quat(scalar_first=True)
    after[6:10] = q if q @ x[6:10] >= 0 else -q  # q and -q are one attitude: stay on the side we were
    return after, R_mid, f_n


def transition(
    x: Array, f: Array, w: Array, dt: float, earth: Array, kept: tuple[float, float], axes: bool = False
) -> Array:
    """How the errors (15 or more) before a step become those after it."""
    _, R_mid, f_n = strapdown_step(x, f, w, dt, earth)
    Phi = np.eye(len(x) - 1)
    Phi[3:6, 6:9] = -dt * skew(f_n) @ rotation(x[6:10]).as_matrix()
    Phi[3:6, 9:12] = -dt * R_mid
    Phi[3:6, 12:15] = dt**2 / 2 * skew(f_n) @ R_mid
    Phi[:3, 3:6] = dt * np.eye(3)
    Phi[6:9, 6:9] = Rotation.from_rotvec(-(w - x[13:16]) * dt).as_matrix()
    Phi[6:9, 12:15] = -dt * np.eye(3)
    if axes:  # a bias of the size of the error times what is measured
        for first, bias, of in ((15, 9, f - x[10:13]), (24, 12, w - x[13:16])):
            Phi[3:9, first : first + 9] = Phi[3:9, bias : bias + 3] @ np.kron(np.eye(3), of)
    Phi[:3, 6:] = dt / 2 * Phi[3:6, 6:]
    Phi[9:12, 9:12] *= kept[0]
    Phi[12:15, 12:15] *= kept[1]
    return Phi


def process_noise(dt: float, q_v: float, q_a: float, drive_a: float, drive_g: float) -> Array:
    axis = np.zeros((5, 5))
    axis[:2, :2] = q_v * np.array([[dt**3 / 3, dt**2 / 2], [dt**2 / 2, dt]])
    axis[2, 2], axis[3, 3], axis[4, 4] = q_a * dt, drive_a, drive_g
    return np.asarray(np.kron(axis, np.eye(3)), float)


def carry_errors(extra: Array, dt: float) -> tuple[Array, Array]:
    """Transition and noise of the errors beyond the fifteen, each (m, m), over dt.

    ``extra`` (m, 2) as `mekf.MekfInputs` has it. What the noise puts back is what stationary errors lose.
    """
    kept = np.exp(-dt / extra[:, 1])
    stationary = np.where(np.isfinite(extra[:, 1]), extra[:, 0] ** 2 * extra[:, 1] / 2, 0.0)
    return np.diag(kept), np.diag(stationary * (1 - kept**2))


def predict_measurement(kind: int, x: Array, w: Array, value: Array, lever: Array) -> tuple[Array, Array]:
    """Innovation (m,) and Jacobian (m, 15)."""
    R = rotation(x[6:10]).as_matrix()
    H = np.zeros((3, 15))
    if kind == POSITION:
        H[:, :3], H[:, 6:9] = np.eye(3), -R @ skew(lever)
        return value - x[:3] - R @ lever, H
    swing = np.cross(w - x[13:16], lever)
    H[:, 3:6], H[:, 6:9], H[:, 12:15] = np.eye(3), -R @ skew(swing), R @ skew(lever)
    return value - x[3:6] - R @ swing, H


def correct(x: Array, P: Array, H: Array, y: Array, R: Array, axes: bool = False) -> tuple[Array, Array]:
    """State and covariance after a measurement, Joseph form; errors of the axes have no gain."""
    K = np.linalg.solve(H @ P @ H.T + R, H @ P).T
    if axes:
        K[15:33] = 0.0
    dx = K @ y
    kept = np.eye(len(P)) - K @ H
    P = kept @ P @ kept.T + K @ R @ K.T
    after = x.copy()
    after[:6] += dx[:6]
    after[10:] += dx[9:]
    m = dx[6:9] / 4  # the modified Rodrigues parameters, H (7.16)
    turn = np.array([1 - m @ m, *(2 * m)]) / (1 + m @ m)
    q = (rotation(x[6:10]) * rotation(turn)).as_quat(scalar_first=True)
    after[6:10] = q if q @ x[6:10] >= 0 else -q
    G = np.eye(len(P))
    G[6:9, 6:9] -= skew(dx[6:9] / 2)
    return after, G @ P @ G.T


def mekf(ready: MekfInputs, earth: Array, patience: float) -> tuple[Array, Array, Array, Integers]:
    """States (K, n + 1) and covariances (K, n, n) at the rows of the timeline; NIS and verdicts (E,)."""
    line, measured, noise, axes, extra, gate = (
        ready.line, ready.measured, ready.noise, ready.axes, ready.extra, ready.gate,
    )  # fmt: skip
    x, P = ready.state, ready.covariance
    n = len(P)
    rows = line.row_of_node.max() + 1
    states, covariances = np.empty((rows, n + 1)), np.empty((rows, n, n))
    nis, verdicts = np.full(len(measured.node), np.nan), np.zeros(len(measured.node), np.int64)
    rejected_since = np.full(2, np.nan)
    event = 0
    for k, t in enumerate(line.times):
        if k > 0:
            dt = t - line.times[k - 1]
            kept, drive = [1.0, 1.0], [0.0, 0.0]
            for i, (density, time) in enumerate((noise[2:4], noise[4:6])):
                kept[i] = np.exp(-dt / time)
                whole = dt if np.isinf(time) else time / 2 * (1 - kept[i] ** 2)
                drive[i] = density**2 * whole
            Phi_extra, Q_extra = carry_errors(extra, dt)
            if line.gap[k] > 0:
                Phi = np.diag([1.0] * 9 + [kept[0]] * 3 + [kept[1]] * 3 + [1.0] * len(extra))
                Phi[:3, 3:6] = dt * np.eye(3)
                Phi[6:9, 12:15] = -dt * np.eye(3)
                Q = process_noise(dt, *(noise[6:8] ** 2 * line.gap[k]), *drive)
                x = np.concatenate([x[:3] + dt * x[3:6], x[3:]])
            else:
                f, w = line.f[k - 1 : k + 1].mean(axis=0), line.w[k - 1 : k + 1].mean(axis=0)
                Phi = transition(x, f, w, dt, earth, (kept[0], kept[1]), axes)
                Q = process_noise(dt, *(noise[:2] ** 2), *drive)
                x = strapdown_step(x, f, w, dt, earth)[0]
            x = np.concatenate([x[:10], x[10:16] * np.repeat(kept, 3), Phi_extra @ x[16:]])
            Phi[15:, 15:] = Phi_extra
            P = Phi @ P @ Phi.T + block_diag(Q, Q_extra)
        while event < len(measured.node) and measured.node[event] == k:
            kind = measured.kind[event]
            y, H = predict_measurement(kind, x, line.w[k], measured.value[event], measured.lever[event])
            H = np.hstack([H, np.zeros((len(y), n - 15))])
            if measured.gauss_markov[event] >= 0:
                first = measured.gauss_markov[event]
                y, H[:, first : first + 3] = y - x[first + 1 : first + 4], np.eye(3)
            R = np.diag(measured.variance[event, : len(y)])
            nis[event] = y @ np.linalg.solve(H @ P @ H.T + R, y)
            verdicts[event] = ACCEPTED
            if nis[event] > gate:
                if np.isnan(rejected_since[kind]):
                    rejected_since[kind] = t
                verdicts[event] = REJECTED if t - rejected_since[kind] < patience else FORCED
            if verdicts[event] == FORCED:
                growth = 1.0
                while growth <= 1e12 and y @ np.linalg.solve(growth * H @ P @ H.T + R, y) > gate:
                    growth *= 2
                P = growth * P
            if verdicts[event] != REJECTED:
                rejected_since[kind] = np.nan
                x, P = correct(x, P, H, y, R, axes)
            event += 1
        if line.row_of_node[k] >= 0:
            states[line.row_of_node[k]], covariances[line.row_of_node[k]] = x, P
    return states, covariances, nis, verdicts
