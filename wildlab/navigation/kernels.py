"""The hot loops, compiled: strapdown steps and the MEKF.

What they compute is written out again, short and slow, in `tests/navigation/reference_mekf.py`. All
compiled functions that call each other stay in this one file: the compiler's cache only looks at the file a
function stands in, and would go on using the old version of what it calls in another one. They take more
arguments than a function elsewhere may: scratch is made once, and an array by itself compiles faster and is
typed faster at each call than one in a tuple of many.

Vectors are written into arrays made once before a loop, and loops run over sizes known to the compiler.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from wildlab.geometry.compilation import compiled
from wildlab.geometry.frames import Array

Integers = NDArray[np.int64]

#: Errors of H (7.22). Behind them: of the axes, accelerometers first, row by row; Gauss-Markov errors.
N_ERRORS, N_AXES = 15, 18
#: Kinds of measurement.
POSITION, VELOCITY = 0, 1
#: What became of a measurement.
REJECTED, ACCEPTED, FORCED = 0, 1, 2


@compiled
def rotation_of(q: Array, R: Array) -> None:
    """H (7.13)."""
    w, x, y, z = q[0], q[1], q[2], q[3]
    R[0, 0], R[0, 1], R[0, 2] = w * w + x * x - y * y - z * z, 2 * (x * y - w * z), 2 * (x * z + w * y)
    R[1, 0], R[1, 1], R[1, 2] = 2 * (x * y + w * z), w * w - x * x + y * y - z * z, 2 * (y * z - w * x)
    R[2, 0], R[2, 1], R[2, 2] = 2 * (x * z - w * y), 2 * (y * z + w * x), w * w - x * x - y * y + z * z


@compiled
def multiply(a: Array, b: Array, out: Array) -> None:
    """H (7.14)."""
    out[0] = a[0] * b[0] - a[1] * b[1] - a[2] * b[2] - a[3] * b[3]
    out[1] = a[0] * b[1] + b[0] * a[1] + a[2] * b[3] - a[3] * b[2]
    out[2] = a[0] * b[2] + b[0] * a[2] + a[3] * b[1] - a[1] * b[3]
    out[3] = a[0] * b[3] + b[0] * a[3] + a[1] * b[2] - a[2] * b[1]


@compiled
def exponential(x: float, y: float, z: float, out: Array) -> None:
    """The quaternion of a rotation vector."""
    angle = np.sqrt(x * x + y * y + z * z)
    # sin(a / 2) / a, by its series where the quotient would be 0 / 0.
    scale = 0.5 - angle * angle / 48 if angle < 1e-4 else np.sin(angle / 2) / angle
    out[0] = np.cos(angle / 2)
    out[1], out[2], out[3] = scale * x, scale * y, scale * z


@compiled
def normalise(q: Array) -> None:
    size = np.sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3])
    for i in range(4):
        q[i] /= size


@compiled
def strapdown_step(
    x: Array, f: Array, w: Array, dt: float, earth: Array, work: Array, R_mid: Array, f_n: Array
) -> None:
    """One step of the state x (16,): position, velocity, quaternion, accelerometer bias, gyro bias.

    f, w are the mean of the measurements over the step; ``work`` (3, 4) is scratch. Leaves the attitude
    half-way in ``R_mid`` and the specific force in n in ``f_n``.
    """
    turn, q, back = work[0], work[1], work[2]
    rx, ry, rz = (w[0] - x[13]) * dt, (w[1] - x[14]) * dt, (w[2] - x[15]) * dt
    exponential(rx / 2, ry / 2, rz / 2, turn)
    # The Earth turns n the other way.
    exponential(-earth[3] * dt / 2, -earth[4] * dt / 2, -earth[5] * dt / 2, back)
    multiply(back, x[6:10], q)
    multiply(q, turn, x[6:10])
    rotation_of(x[6:10], R_mid)
    multiply(x[6:10], turn, q)
    multiply(back, q, x[6:10])
    normalise(x[6:10])
    fx, fy, fz = f[0] - x[10], f[1] - x[11], f[2] - x[12]
    for i in range(3):
        f_n[i] = R_mid[i, 0] * fx + R_mid[i, 1] * fy + R_mid[i, 2] * fz
    vx, vy, vz = x[3], x[4], x[5]
    g = earth[0] + earth[1] * x[2]  # down is positive, and gravity grows downwards
    x[3] += dt * (f_n[0] - g * earth[2] * x[0] - 2 * (earth[4] * vz - earth[5] * vy))
    x[4] += dt * (f_n[1] - g * earth[2] * x[1] - 2 * (earth[5] * vx - earth[3] * vz))
    x[5] += dt * (f_n[2] + g - 2 * (earth[3] * vy - earth[4] * vx))
    x[0] += dt / 2 * (vx + x[3])
    x[1] += dt / 2 * (vy + x[4])
    x[2] += dt / 2 * (vz + x[5])


@compiled
def integrate(times: Array, f: Array, w: Array, earth: Array, start: Array, out: Array) -> None:
    """Strapdown from the first row on; ``out`` (N, 16)."""
    x = start.copy()
    out[0] = x
    work, R_mid, f_n = np.empty((3, 4)), np.empty((3, 3)), np.empty(3)
    f_mean, w_mean = np.empty(3), np.empty(3)
    for k in range(1, len(times)):
        for i in range(3):
            f_mean[i] = (f[k - 1, i] + f[k, i]) / 2
            w_mean[i] = (w[k - 1, i] + w[k, i]) / 2
        strapdown_step(x, f_mean, w_mean, times[k] - times[k - 1], earth, work, R_mid, f_n)
        out[k] = x


@compiled
def transition_times(
    A: Array, B: Array, C: Array, E: Array, f: Array, w: Array, dt: float, kept_a: float, kept_g: float,
    M: Array, columns: int, axes: bool, slow: Array, out: Array,
) -> None:  # fmt: skip
    """``out = (Phi M)'`` for the first 15 rows of the transition matrix and so many columns of M (n, ...).

    Errors of the axes, where there are any, act as biases of their size times what is measured (f, w).
    ``slow`` (6, n) is scratch.
    """
    for r in range(3):
        for j in range(columns):
            slow[r, j], slow[3 + r, j] = M[9 + r, j], M[12 + r, j]
        if axes:
            a, g = N_ERRORS + 3 * r, N_ERRORS + 9 + 3 * r
            for j in range(columns):
                slow[r, j] += f[0] * M[a, j] + f[1] * M[a + 1, j] + f[2] * M[a + 2, j]
                slow[3 + r, j] += w[0] * M[g, j] + w[1] * M[g + 1, j] + w[2] * M[g + 2, j]
    for i in range(3):
        for j in range(columns):
            dv = (
                A[i, 0] * M[6, j] + A[i, 1] * M[7, j] + A[i, 2] * M[8, j]
                + B[i, 0] * slow[0, j] + B[i, 1] * slow[1, j] + B[i, 2] * slow[2, j]
                + C[i, 0] * slow[3, j] + C[i, 1] * slow[4, j] + C[i, 2] * slow[5, j]
            )  # fmt: skip
            out[j, i] = M[i, j] + dt * (M[3 + i, j] + dv / 2)
            out[j, 3 + i] = M[3 + i, j] + dv
            out[j, 6 + i] = E[i, 0] * M[6, j] + E[i, 1] * M[7, j] + E[i, 2] * M[8, j] - dt * slow[3 + i, j]
            out[j, 9 + i] = kept_a * M[9 + i, j]
            out[j, 12 + i] = kept_g * M[12 + i, j]


@compiled
def add_noise(P: Array, dt: float, q_v: float, q_a: float, drive_a: float, drive_g: float) -> None:
    for i in range(3):
        P[i, i] += q_v * dt**3 / 3
        P[i, 3 + i] += q_v * dt * dt / 2
        P[3 + i, i] += q_v * dt * dt / 2
        P[3 + i, 3 + i] += q_v * dt
        P[6 + i, 6 + i] += q_a * dt
        P[9 + i, 9 + i] += drive_a
        P[12 + i, 12 + i] += drive_g


@compiled
def kept_and_driven(dt: float, density: float, time: float) -> tuple[float, float]:
    """A first-order Gauss-Markov process over dt: the factor that is left, the variance that is added."""
    if np.isinf(time):
        return 1.0, density * density * dt
    kept = np.exp(-dt / time)
    return kept, density * density * time / 2 * (1 - kept * kept)


@compiled
def carry_extra(x: Array, P: Array, M: Array, dt: float, extra: Array) -> None:
    """Gauss-Markov or constant errors beyond the fifteen over a step. M (n, 15) is ``P Phi'``.

    ``extra`` (n - 15, 2) has their densities and times.
    """
    n = P.shape[0]
    for k in range(len(extra)):
        i, kept = N_ERRORS + k, 1.0
        if not np.isinf(extra[k, 1]):
            kept = np.exp(-dt / extra[k, 1])
            x[i + 1] *= kept
            for j in range(N_ERRORS, n):
                P[i, j] *= kept
            for j in range(N_ERRORS, n):
                P[j, i] *= kept
        for j in range(N_ERRORS):
            P[i, j] = P[j, i] = kept * M[i, j]
    for k in range(len(extra)):
        i = N_ERRORS + k
        if not np.isinf(extra[k, 1]):
            P[i, i] += kept_and_driven(dt, extra[k, 0], extra[k, 1])[1]


@compiled
def invert(S: Array, out: Array) -> None:
    """Inverse of a symmetric positive definite matrix (3, 3)."""
    for i in range(3):
        j, k = (i + 1) % 3, (i + 2) % 3
        for a in range(3):
            b, c = (a + 1) % 3, (a + 2) % 3
            out[a, i] = S[j, b] * S[k, c] - S[j, c] * S[k, b]
    determinant = S[0, 0] * out[0, 0] + S[0, 1] * out[1, 0] + S[0, 2] * out[2, 0]
    out[:, :] /= determinant


@compiled
def predict_measurement(
    kind: int, x: Array, w: Array, value: Array, lever: Array, R: Array, y: Array, H: Array
) -> None:
    """Innovation y and Jacobian H (3, 15) of a measurement."""
    H[:] = 0.0
    rotation_of(x[6:10], R)
    first = 0 if kind == POSITION else 3
    arm = lever
    if kind == VELOCITY:
        arm = np.cross(w - x[13:16], lever)
    for i in range(3):
        y[i] = value[i] - x[first + i]
        H[i, first + i] = 1.0
        for a in range(3):
            b, c = (a + 1) % 3, (a + 2) % 3
            y[i] -= R[i, a] * arm[a]
            H[i, 6 + a] = -(R[i, b] * arm[c] - R[i, c] * arm[b])
            if kind == VELOCITY:
                H[i, 12 + a] = R[i, b] * lever[c] - R[i, c] * lever[b]


@compiled
def columns_of(H: Array) -> Integers:
    """The columns in which any of the three rows has a value."""
    used, count = np.empty(H.shape[1], np.int64), 0
    for j in range(H.shape[1]):
        for a in range(3):
            if H[a, j] != 0:
                used[count] = j
                count += 1
                break
    return used[:count]


@compiled
def correct(
    x: Array, P: Array, H: Array, used: Integers, y: Array, variance: Array, axes: bool, S_inverse: Array,
    HP: Array, K: Array, M: Array, work: Array,
) -> None:  # fmt: skip
    """Measurement update, Joseph form; the attitude error is then folded into the quaternion.

    H has values in the columns ``used`` alone. K (3, n) is the gain's transpose, HP (3, n) is ``H P``: along
    rows the processor takes several columns at once. Errors of the axes have no gain, as in a Schmidt filter:
    they are considered, not estimated.
    """
    n = P.shape[0]
    dx = np.zeros(n)
    K[:] = 0.0
    for i in range(n):
        if axes and N_ERRORS <= i < N_ERRORS + N_AXES:
            continue
        for a in range(3):
            for b in range(3):
                K[a, i] += HP[b, i] * S_inverse[b, a]
            dx[i] += K[a, i] * y[a]
    # (I - K H) P (I - K H)' + K R K', the two products one after the other.
    M[:] = P
    for i in range(n):
        for a in range(3):
            gain = K[a, i]
            for j in range(n):
                M[i, j] -= gain * HP[a, j]
    for a in range(3):
        for i in range(n):
            left = -K[a, i] * variance[a]
            for j in used:
                left += M[i, j] * H[a, j]
            HP[a, i] = left
    for i in range(n):
        for a in range(3):
            left = HP[a, i]
            for j in range(n):
                M[i, j] -= left * K[a, j]
    x[:6] += dx[:6]
    x[10:] += dx[9:]
    # Four times the modified Rodrigues parameters, H (7.16), as a quaternion.
    s = (dx[6] * dx[6] + dx[7] * dx[7] + dx[8] * dx[8]) / 16
    turn, q = work[0], work[1]
    turn[0] = (1 - s) / (1 + s)
    for i in range(3):
        turn[1 + i] = dx[6 + i] / 2 / (1 + s)
    multiply(x[6:10], turn, q)
    normalise(q)
    x[6:10] = q
    # What is left of the attitude error is now seen from the turned body: I - S(dx / 2) on both sides.
    h0, h1, h2 = dx[6] / 2, dx[7] / 2, dx[8] / 2
    for j in range(n):
        a0, a1, a2 = M[6, j], M[7, j], M[8, j]
        M[6, j], M[7, j], M[8, j] = a0 + h2 * a1 - h1 * a2, a1 + h0 * a2 - h2 * a0, a2 + h1 * a0 - h0 * a1
    for i in range(n):
        a0, a1, a2 = M[i, 6], M[i, 7], M[i, 8]
        M[i, 6], M[i, 7], M[i, 8] = a0 + h2 * a1 - h1 * a2, a1 + h0 * a2 - h2 * a0, a2 + h1 * a0 - h0 * a1
    for i in range(n):
        for j in range(i + 1):
            P[i, j] = P[j, i] = (M[i, j] + M[j, i]) / 2


@compiled
def mekf(
    times: Array, f: Array, w: Array, gap: Array, row_of_node: Integers, earth: Array, noise: Array, x: Array,
    P: Array, axes: bool, extra: Array, node: Integers, kind: Integers, value: Array, variance: Array,
    lever: Array, gauss_markov: Integers, gate: float, patience: float, states: Array, covariances: Array,
    innovations: Array, spreads: Array, nis: Array, verdicts: Integers,
) -> None:  # fmt: skip
    """The whole filter over a timeline; `tests/navigation/reference_mekf.py` has the same in short."""
    n = P.shape[0]
    work, R, R_start, R_mid = np.empty((3, 4)), np.empty((3, 3)), np.empty((3, 3)), np.empty((3, 3))
    A, B, C, E = np.empty((3, 3)), np.empty((3, 3)), np.empty((3, 3)), np.empty((3, 3))
    f_mean, w_mean, f_n, y = np.empty(3), np.empty(3), np.empty(3), np.empty(3)
    f_felt, w_felt, slow = np.zeros(3), np.zeros(3), np.empty((6, n))
    H, S, S_inverse = np.empty((3, n)), np.empty((3, 3)), np.empty((3, 3))
    HP, K, M = np.empty((3, n)), np.empty((3, n)), np.empty((n, n))
    rejected_since = np.full(2, np.nan)
    event = 0
    for k in range(len(times)):
        if k > 0:
            dt = times[k] - times[k - 1]
            kept_a, drive_a = kept_and_driven(dt, noise[2], noise[3])
            kept_g, drive_g = kept_and_driven(dt, noise[4], noise[5])
            q_v, q_a = noise[0] * noise[0], noise[1] * noise[1]
            if gap[k] > 0:
                # Nothing was measured: straight on, with what an airframe may do meanwhile as uncertainty.
                f_felt[:], w_felt[:], A[:], B[:], C[:], E[:] = 0.0, 0.0, 0.0, 0.0, 0.0, np.eye(3)
                x[:3] += dt * x[3:6]
                q_v, q_a = noise[6] * noise[6] * gap[k], noise[7] * noise[7] * gap[k]
            else:
                for i in range(3):
                    f_mean[i] = (f[k - 1, i] + f[k, i]) / 2
                    w_mean[i] = (w[k - 1, i] + w[k, i]) / 2
                    f_felt[i], w_felt[i] = f_mean[i] - x[10 + i], w_mean[i] - x[13 + i]
                rotation_of(x[6:10], R_start)
                exponential(
                    -(w_mean[0] - x[13]) * dt, -(w_mean[1] - x[14]) * dt, -(w_mean[2] - x[15]) * dt, work[0]
                )
                rotation_of(work[0], E)
                strapdown_step(x, f_mean, w_mean, dt, earth, work, R_mid, f_n)
                for j in range(3):
                    for i in range(3):
                        b, c = (i + 1) % 3, (i + 2) % 3
                        A[i, j] = -dt * (f_n[b] * R_start[c, j] - f_n[c] * R_start[b, j])
                        C[i, j] = dt * dt / 2 * (f_n[b] * R_mid[c, j] - f_n[c] * R_mid[b, j])
                        B[i, j] = -dt * R_mid[i, j]
            x[10:13] *= kept_a
            x[13:16] *= kept_g
            transition_times(A, B, C, E, f_felt, w_felt, dt, kept_a, kept_g, P, n, axes, slow, M)
            transition_times(A, B, C, E, f_felt, w_felt, dt, kept_a, kept_g, M, N_ERRORS, axes, slow, P)
            carry_extra(x, P, M, dt, extra)
            add_noise(P, dt, q_v, q_a, drive_a, drive_g)
        while event < len(node) and node[event] == k:
            sort = kind[event]
            predict_measurement(sort, x, w[k], value[event], lever[event], R, y, H)
            if gauss_markov[event] >= 0:
                y -= x[1 + gauss_markov[event] : 4 + gauss_markov[event]]
                H[:, gauss_markov[event] : gauss_markov[event] + 3] = np.eye(3)
            used = columns_of(H)
            growth = 1.0
            while True:
                HP[:] = 0.0
                for a in range(3):
                    for i in range(n):
                        for j in used:
                            HP[a, i] += growth * P[i, j] * H[a, j]
                for a in range(3):
                    for b in range(3):
                        S[a, b] = variance[event, a] if a == b else 0.0
                        for j in used:
                            S[a, b] += H[a, j] * HP[b, j]
                invert(S, S_inverse)
                square = 0.0
                for a in range(3):
                    for b in range(3):
                        square += y[a] * S_inverse[a, b] * y[b]
                if growth == 1.0:
                    nis[event] = square
                    innovations[event] = y
                    spreads[event] = S
                    if square <= gate:
                        verdicts[event] = ACCEPTED
                        rejected_since[sort] = np.nan
                        break
                    if np.isnan(rejected_since[sort]):
                        rejected_since[sort] = times[k]
                    if times[k] - rejected_since[sort] < patience:
                        verdicts[event] = REJECTED
                        break
                    verdicts[event] = FORCED
                    rejected_since[sort] = np.nan
                elif square <= gate or growth > 1e12:
                    break
                growth *= 2.0
            if verdicts[event] != REJECTED:
                P *= growth
                correct(x, P, H, used, y, variance[event], axes, S_inverse, HP, K, M, work)
            event += 1
        row = row_of_node[k]
        if row >= 0:
            states[row] = x[:16]
            covariances[row] = P[:N_ERRORS, :N_ERRORS]
