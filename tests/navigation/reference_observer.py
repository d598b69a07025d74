"""Reference implementation of the observer of H 5.5 in plain numpy: the compiled one is tested against it."""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation

from wildlab.geometry.frames import Array, skew
from wildlab.navigation.kernels import POSITION, VELOCITY
from wildlab.navigation.observer import J2, MU, RADIUS, RATE, ObserverInputs

EARTH = np.array([0.0, 0.0, RATE])


def gravity_at(p: Array) -> Array:
    """Gravity in ECEF: attraction with J2, and the centrifugal force."""
    r = np.linalg.norm(p)
    flat = 1.5 * J2 * (RADIUS / r) ** 2 * (np.array([1.0, 1.0, 3.0]) - 5 * (p[2] / r) ** 2)
    return np.asarray(-MU / r**3 * p * (1 + flat) - np.cross(EARTH, np.cross(EARTH, p)))


def unit(vector: Array) -> Array:
    return np.asarray(vector / np.linalg.norm(vector), float)


def projected(move: Array, b: Array, inner: float, outer: float) -> Array:
    square, along = b @ b, b @ move
    if square <= inner**2 or along <= 0:
        return move
    share = min(1.0, float((square - inner**2) / (outer**2 - inner**2)))
    return np.asarray(move - share * along * b / square)


def observer(ready: ObserverInputs) -> Array:
    """Rows of the timeline: quaternion (e), gyro bias, position, velocity and correction in e, (M, 16)."""
    line, measured = ready.line, ready.measured
    k1, k2, k_i, inner, outer, theta, q_f, q_xi, limit, hold = ready.gains
    attitude, b, P = Rotation.from_quat(ready.q, scalar_first=True), ready.bias, ready.P
    p, v, xi = ready.x[:3], ready.x[3:6], ready.x[6:]
    scale = np.repeat([1.0, theta, theta**2], 3)
    held, held_until, event, eye = np.zeros(3), -np.inf, 0, np.eye(3)
    out = np.full((line.row_of_node.max() + 1, 16), np.nan)

    def directions(f: Array) -> tuple[Array, Array]:
        return unit(f), unit(np.clip(attitude.apply(f) + xi, -limit, limit))

    for k, t in enumerate(line.times):
        if k > 0:
            dt = t - line.times[k - 1]
            if line.gap[k] > 0:
                p = p + dt * v
            else:
                f, w = (part[k - 1 : k + 1].mean(axis=0) for part in (line.f, line.w))
                f_b, f_e = directions(f)
                sigma = k1 * np.cross(f_b, attitude.inv().apply(f_e)) + (held if t <= held_until else 0.0)
                back = Rotation.from_rotvec(-EARTH * dt / 2)
                turn = Rotation.from_rotvec((w - b + sigma) * dt / 2)
                half = back * attitude * turn
                attitude = back * half * turn
                b = b + dt * projected(-k_i * sigma, b, inner, outer)
                change = dt * (half.apply(f) + xi + gravity_at(p) - 2 * np.cross(EARTH, v))
                p, v = p + dt * (v + change / 2), v + change
                xi = xi - dt * half.apply(np.cross(sigma, f))
            h = theta * dt
            Phi = np.kron(np.array([[1, h, h * h / 2], [0, 1, h], [0, 0, 1]]), eye)
            P = Phi @ P @ Phi.T + h * np.kron(np.diag([0.0, q_f, q_xi]), eye)
        while event < len(measured.node) and measured.node[event] == k:
            kind, value, lever = (part[event] for part in (measured.kind, measured.value, measured.lever))
            if kind in (POSITION, VELOCITY):
                first, s = (0, 1.0) if kind == POSITION else (3, theta)
                arm = lever if kind == POSITION else skew(line.w[k] - b) @ lever
                rows = slice(first, first + 3)
                y = value - np.concatenate([p, v])[rows] - attitude.apply(arm)
                R = np.diag(measured.variance[event]) / (s**2 * theta)
                K = P[:, rows] @ np.linalg.inv(P[rows, rows] + R)
                p, v, xi = (np.concatenate([p, v, xi]) + scale * (K @ y) / s).reshape(3, 3)
                P = P - K @ P[rows]
            else:
                f_b, f_e = directions(line.f[k])
                second_e = attitude.inv().apply(np.cross(f_e, value))
                held, held_until = k2 * np.cross(np.cross(f_b, lever), second_e), t + hold
            event += 1
        if line.row_of_node[k] >= 0:
            q = attitude.as_quat(scalar_first=True)
            out[line.row_of_node[k]] = np.concatenate([q, b, p, v, xi])
    return out
