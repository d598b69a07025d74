"""The hot loop of the nonlinear observer, compiled; `reference_observer` says the same in short.

Quaternions are worked out here again rather than called from `kernels`: the compiler's cache looks only at
the file that a function stands in.
"""

from __future__ import annotations

import numpy as np

from wildlab.geometry.compilation import compiled
from wildlab.geometry.frames import Array
from wildlab.navigation.kernels import POSITION, VELOCITY, Integers

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
def attitude_step(q: Array, x: float, y: float, z: float, turned: float) -> None:
    """``q`` turned by the rotation vector x, y, z in b, and by ``turned`` (rad) of the Earth."""
    angle = np.sqrt(x * x + y * y + z * z)
    scale = 0.5 - angle * angle / 48 if angle < 1e-4 else np.sin(angle / 2) / angle
    c, sx, sy, sz = np.cos(angle / 2), scale * x, scale * y, scale * z
    w0 = q[0] * c - q[1] * sx - q[2] * sy - q[3] * sz
    x0 = q[0] * sx + c * q[1] + q[2] * sz - q[3] * sy
    y0 = q[0] * sy + c * q[2] + q[3] * sx - q[1] * sz
    z0 = q[0] * sz + c * q[3] + q[1] * sy - q[2] * sx
    ce, se = np.cos(turned / 2), np.sin(turned / 2)
    q[0], q[1], q[2], q[3] = ce * w0 + se * z0, ce * x0 + se * y0, ce * y0 - se * x0, ce * z0 - se * w0
    size = np.sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3])
    for i in range(4):
        q[i] /= size


@compiled
def rotation(q: Array, R: Array) -> None:
    w, x, y, z = q[0], q[1], q[2], q[3]
    R[0, 0], R[0, 1], R[0, 2] = w * w + x * x - y * y - z * z, 2 * (x * y - w * z), 2 * (x * z + w * y)
    R[1, 0], R[1, 1], R[1, 2] = 2 * (x * y + w * z), w * w - x * x + y * y - z * z, 2 * (y * z - w * x)
    R[2, 0], R[2, 1], R[2, 2] = 2 * (x * z - w * y), 2 * (y * z + w * x), w * w - x * x - y * y + z * z


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
    y, K, held_until = np.empty(3), np.empty((9, 3)), -np.inf
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
                rotation(q, R)
                force_directions(f_mean, R, x[6:9], limit, f_b, f_e, work)
                injection(f_b, f_e, R, k1, sigma, work)
                if times[k] <= held_until:
                    for i in range(3):
                        sigma[i] += held[i]
                for i in range(3):
                    a[i] = dt * ((w[k - 1, i] + w[k, i]) / 2 - b[i] + sigma[i])
                    move[i] = -k_i * sigma[i]
                attitude_step(q, a[0] / 2, a[1] / 2, a[2] / 2, RATE * dt / 2)
                rotation(q, R)
                attitude_step(q, a[0] / 2, a[1] / 2, a[2] / 2, RATE * dt / 2)
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
            rotation(q, R)
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
