"""The hot loops of many runs, compiled: constant velocity's four states, two measured elements.

Runs are taken in blocks of at most `LANES`, one run in each lane, with the lanes on the last axis: the
innermost loops run over lanes, and all other sizes are known to the compiler. What they compute is what
`wildlab.tracking.run.run_filter` computes for each run; tests hold the two together.

An argument of None (no camera, no pose) is a type of its own: each kind of filter is compiled for itself,
when it is first used, without the branches that it does not take. Values are copied in loops and not by
slices, whose check of shapes takes seconds to compile. All compiled functions stay in this one file, and have
their many arguments, for the reasons that `wildlab.navigation.kernels` gives.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from wildlab.geometry.compilation import compiled
from wildlab.geometry.frames import Array
from wildlab.tracking.schmidt import LARGEST_CORRELATION, NEGLIGIBLE

Flags = NDArray[np.bool_]
Integers = NDArray[np.int64]

LANES = 64


@compiled
def predict_lanes(x: Array, P: Array, F: Array, Q: Array, y: Array, M: Array) -> None:
    """H (3.5a)-(3.5b) for x (4, L) and P (4, 4, L); ``y`` and ``M`` are scratch of the same shapes."""
    lanes = x.shape[-1]
    for i in range(4):
        for r in range(lanes):
            y[i, r] = F[i, 0] * x[0, r] + F[i, 1] * x[1, r] + F[i, 2] * x[2, r] + F[i, 3] * x[3, r]
        for j in range(4):
            for r in range(lanes):
                M[i, j, r] = (
                    F[i, 0] * P[0, j, r] + F[i, 1] * P[1, j, r] + F[i, 2] * P[2, j, r] + F[i, 3] * P[3, j, r]
                )
    for i in range(4):
        for r in range(lanes):
            x[i, r] = y[i, r]
        for j in range(i + 1):
            for r in range(lanes):
                P[i, j, r] = P[j, i, r] = Q[i, j] + (
                    M[i, 0, r] * F[j, 0] + M[i, 1, r] * F[j, 1] + M[i, 2, r] * F[j, 2] + M[i, 3, r] * F[j, 3]
                )


@compiled
def carry_cross(C: Array, F: Array, left: float, phi: Array, M: Array) -> None:
    """``F C Phi'`` times what is left of the correlation; C (4, 6, L), phi (36, L)."""
    lanes = C.shape[-1]
    for i in range(4):
        for a in range(6):
            for r in range(lanes):
                M[i, a, r] = left * (
                    F[i, 0] * C[0, a, r] + F[i, 1] * C[1, a, r] + F[i, 2] * C[2, a, r] + F[i, 3] * C[3, a, r]
                )
    for i in range(4):
        for a in range(6):
            for r in range(lanes):
                C[i, a, r] = 0.0
            for b in range(6):
                for r in range(lanes):
                    C[i, a, r] += M[i, b, r] * phi[6 * a + b, r]


@compiled
def invert_and_weigh(S: Array, v: Array, inverse: Array, nis: Array, ok: Array, singular: Flags) -> None:
    """Inverse of S (2, 2, L) and NIS; lanes whose S is no covariance are marked."""
    lanes = v.shape[-1]
    for r in range(lanes):
        determinant = S[0, 0, r] * S[1, 1, r] - S[0, 1, r] * S[0, 1, r]
        singular[r] = ok[r] > 0 and not (determinant > 0 and S[0, 0, r] > 0)
        inverse[0, 0, r], inverse[1, 1, r] = S[1, 1, r] / determinant, S[0, 0, r] / determinant
        inverse[0, 1, r] = inverse[1, 0, r] = -S[0, 1, r] / determinant
        nis[r] = v[0, r] * (inverse[0, 0, r] * v[0, r] + inverse[0, 1, r] * v[1, r]) + v[1, r] * (
            inverse[1, 0, r] * v[0, r] + inverse[1, 1, r] * v[1, r]
        )


@compiled
def update_lanes(
    x: Array, P: Array, C: Array, P_pose: Array, v: Array, H: Array, H_pose: Array, R: Array,
    considered: Array | None, threshold: float, ok: Array, nis: Array, singular: Flags,
    U: Array, W: Array, S: Array, inverse: Array, K: Array, G: Array,
) -> None:  # fmt: skip
    """H (3.7d)-(3.7h), or with the pose H (7.34)-(7.38); Joseph form.

    C (4, 6, L), P_pose (6, 6, L), v (2, L), H (2, 2, L), H_pose (2, 6, L), R (2, 2, L); after ``singular``
    scratch. Nothing changes where ``ok`` (L,) is zero or the gate is missed; ``ok`` comes back as what was
    used. ``v`` must be finite everywhere.
    """
    lanes = x.shape[-1]
    for i in range(4):
        for a in range(2):
            for r in range(lanes):
                U[i, a, r] = P[i, 0, r] * H[a, 0, r] + P[i, 1, r] * H[a, 1, r]
            if considered is not None:
                for c in range(6):
                    for r in range(lanes):
                        U[i, a, r] += C[i, c, r] * H_pose[a, c, r]
    for a in range(2):
        for b in range(2):
            for r in range(lanes):
                S[a, b, r] = H[a, 0, r] * U[0, b, r] + H[a, 1, r] * U[1, b, r] + R[a, b, r]
    if considered is not None:
        for c in range(6):
            for b in range(2):
                for r in range(lanes):
                    W[c, b, r] = C[0, c, r] * H[b, 0, r] + C[1, c, r] * H[b, 1, r]
                for d in range(6):
                    for r in range(lanes):
                        W[c, b, r] += P_pose[c, d, r] * H_pose[b, d, r]
                for a in range(2):
                    for r in range(lanes):
                        S[a, b, r] += H_pose[a, c, r] * W[c, b, r]
    invert_and_weigh(S, v, inverse, nis, ok, singular)
    for r in range(lanes):
        ok[r] = ok[r] if nis[r] <= threshold else 0.0
    for i in range(4):
        for a in range(2):
            for r in range(lanes):
                gain = U[i, 0, r] * inverse[0, a, r] + U[i, 1, r] * inverse[1, a, r]
                K[i, a, r] = gain if ok[r] > 0 else 0.0
        for r in range(lanes):
            x[i, r] += K[i, 0, r] * v[0, r] + K[i, 1, r] * v[1, r]
    # The target's rows of (7.37): [G, C] is the left factor times the prior, then comes the right one.
    for i in range(4):
        for j in range(4):
            for r in range(lanes):
                G[i, j, r] = P[i, j, r] - K[i, 0, r] * U[j, 0, r] - K[i, 1, r] * U[j, 1, r]
        if considered is not None:
            for c in range(6):
                for r in range(lanes):
                    C[i, c, r] -= K[i, 0, r] * W[c, 0, r] + K[i, 1, r] * W[c, 1, r]
    for i in range(4):
        for a in range(2):
            for r in range(lanes):
                U[i, a, r] = (
                    G[i, 0, r] * H[a, 0, r] + G[i, 1, r] * H[a, 1, r]
                    - K[i, 0, r] * R[0, a, r] - K[i, 1, r] * R[1, a, r]
                )  # fmt: skip
            if considered is not None:
                for c in range(6):
                    for r in range(lanes):
                        U[i, a, r] += C[i, c, r] * H_pose[a, c, r]
    for i in range(4):
        for j in range(i + 1):
            for r in range(lanes):
                one = G[i, j, r] - U[i, 0, r] * K[j, 0, r] - U[i, 1, r] * K[j, 1, r]
                other = G[j, i, r] - U[j, 0, r] * K[i, 0, r] - U[j, 1, r] * K[i, 1, r]
                P[i, j, r] = P[j, i, r] = (one + other) / 2


@compiled
def expect_pixels(
    x: Array, z: Array, pose: Array, R_bc: Array, lever: Array, plane: float, A: Array,
    v: Array, H: Array, H_pose: Array, ok: Array,
) -> None:  # fmt: skip
    """Innovation and derivatives of `measurement.predict_pixel` without distortion.

    z (2, L); pose (12, L): position of the camera and R_nc by rows; R_bc (9, L); A (5,): fx, fy, cx, cy,
    skew.
    ``ok`` is one where the pixel and the pose are there and the target is in front of the camera; the rest is
    zero then.
    """
    lanes = x.shape[-1]
    for r in range(lanes):
        n, e, d = x[0, r] - pose[0, r], x[1, r] - pose[1, r], plane - pose[2, r]
        X = pose[3, r] * n + pose[6, r] * e + pose[9, r] * d
        Y = pose[4, r] * n + pose[7, r] * e + pose[10, r] * d
        Z = pose[5, r] * n + pose[8, r] * e + pose[11, r] * d
        seen = Z > 0 and np.isfinite(X + Y + Z) and np.isfinite(z[0, r]) and np.isfinite(z[1, r])
        ok[r] = 1.0 if seen else 0.0
        q = 1 / Z if seen else 0.0
        X, Y = (X * q, Y * q) if seen else (0.0, 0.0)
        v[0, r] = z[0, r] - (A[0] * X + A[4] * Y + A[2]) if seen else 0.0
        v[1, r] = z[1, r] - (A[1] * Y + A[3]) if seen else 0.0
        # Rows of the pixel's derivative with respect to the target in c.
        ux, uy, uz, vy, vz = A[0] * q, A[4] * q, -(A[0] * X + A[4] * Y) * q, A[1] * q, -A[1] * Y * q
        bx = R_bc[0, r] * X + R_bc[1, r] * Y + R_bc[2, r]
        by = R_bc[3, r] * X + R_bc[4, r] * Y + R_bc[5, r]
        bz = R_bc[6, r] * X + R_bc[7, r] * Y + R_bc[8, r]
        Z = Z if seen else 0.0
        bx, by, bz = bx * Z + lever[0], by * Z + lever[1], bz * Z + lever[2]
        for i in range(3):
            cx = pose[3 + 3 * i, r] if seen else 0.0
            cy = pose[4 + 3 * i, r] if seen else 0.0
            cz = pose[5 + 3 * i, r] if seen else 0.0
            a, b = ux * cx + uy * cy + uz * cz, vy * cy + vz * cz
            if i < 2:
                H[0, i, r], H[1, i, r] = a, b
            H_pose[0, i, r], H_pose[1, i, r] = -a, -b
        # R_bc' S(b) J: rows of J R_cb, crossed with the target as seen from b.
        for k in range(2):
            jx, jy, jz = (ux, uy, uz) if k == 0 else (0.0, vy, vz)
            gx = jx * R_bc[0, r] + jy * R_bc[1, r] + jz * R_bc[2, r]
            gy = jx * R_bc[3, r] + jy * R_bc[4, r] + jz * R_bc[5, r]
            gz = jx * R_bc[6, r] + jy * R_bc[7, r] + jz * R_bc[8, r]
            H_pose[k, 3, r], H_pose[k, 4, r], H_pose[k, 5, r] = (
                gy * bz - gz * by, gz * bx - gx * bz, gx * by - gy * bx
            )  # fmt: skip


@compiled
def root_of(covariance: Array) -> tuple[Array, Array]:
    """`schmidt._root`."""
    n = len(covariance)
    sd, inverse, scaled = np.empty(n), np.empty(n), np.empty((n, n))
    for i in range(n):
        sd[i] = np.sqrt(max(covariance[i, i], 0.0))
        inverse[i] = 1 / sd[i] if sd[i] > 0 else 0.0
    for i in range(n):
        for j in range(n):
            scaled[i, j] = covariance[i, j] * (inverse[i] * inverse[j])
    values, vectors = np.linalg.eigh(scaled)
    there = values > NEGLIGIBLE * max(values[-1], NEGLIGIBLE)
    lengths, vectors = np.sqrt(values[there]), np.ascontiguousarray(vectors[:, there])
    return sd.reshape(-1, 1) * vectors * lengths, np.ascontiguousarray((vectors / lengths).T) * inverse


@compiled
def limit_one(C: Array, P: Array, P_pose: Array) -> tuple[Array, bool]:
    """`schmidt.limit_cross` of a single run."""
    if not np.any(C):
        return C, False
    root, inverse = root_of(P)
    root_pose, inverse_pose = root_of(P_pose)
    if root.shape[1] == 0 or root_pose.shape[1] == 0:
        return np.zeros_like(C), True
    u, correlations, w = np.linalg.svd(inverse @ C @ np.ascontiguousarray(inverse_pose.T), False)
    lost = root.shape[1] < len(P) or root_pose.shape[1] < len(P_pose)
    too_high = correlations[0] > LARGEST_CORRELATION
    if not (too_high or lost):
        return C, False
    limited = (
        root @ np.ascontiguousarray(u * np.minimum(correlations, LARGEST_CORRELATION)) @ w
        @ np.ascontiguousarray(root_pose.T)
    )  # fmt: skip
    changed = bool(np.any(np.abs(limited - C) > 1e-9 * np.abs(C)))
    return limited, too_high or changed


@compiled
def mark_sound(C: Array, P: Array, P_pose: Array, L: Array, Y: Array, M: Array, sound: Array) -> None:
    """Marks (in ``sound``) the lanes whose ``[P C; C' P_pose]`` is surely a covariance.

    By Cholesky's pivots of P_pose and of what P has beyond ``C P_pose^-1 C'``.
    """
    lanes = C.shape[-1]
    for r in range(lanes):
        sound[r] = 1.0
    for i in range(6):
        for j in range(i + 1):
            for r in range(lanes):
                L[i, j, r] = P_pose[i, j, r]
            for k in range(j):
                for r in range(lanes):
                    L[i, j, r] -= L[i, k, r] * L[j, k, r]
            if j < i:
                for r in range(lanes):
                    L[i, j, r] /= L[j, j, r]
        for r in range(lanes):
            # A pivot near nothing (or a NaN) is left to the careful way.
            sound[r] = sound[r] if L[i, i, r] > 1e-9 * P_pose[i, i, r] else 0.0
            L[i, i, r] = np.sqrt(L[i, i, r]) if sound[r] > 0 else 1.0
    for i in range(4):
        for a in range(6):
            for r in range(lanes):
                Y[i, a, r] = C[i, a, r]
            for k in range(a):
                for r in range(lanes):
                    Y[i, a, r] -= L[a, k, r] * Y[i, k, r]
            for r in range(lanes):
                Y[i, a, r] /= L[a, a, r]
    highest = LARGEST_CORRELATION**2
    for i in range(4):
        for j in range(i + 1):
            for r in range(lanes):
                M[i, j, r] = highest * P[i, j, r]
            for a in range(6):
                for r in range(lanes):
                    M[i, j, r] -= Y[i, a, r] * Y[j, a, r]
            for k in range(j):
                for r in range(lanes):
                    M[i, j, r] -= M[i, k, r] * M[j, k, r]
            if j < i:
                for r in range(lanes):
                    M[i, j, r] /= M[j, j, r]
        for r in range(lanes):
            sound[r] = sound[r] if M[i, i, r] > 1e-9 * P[i, i, r] else 0.0
            M[i, i, r] = np.sqrt(M[i, i, r]) if sound[r] > 0 else 1.0


@compiled
def load(source: Array, row: int, first: int, target: Array) -> None:
    """Row of (B or 1, N, k) into (k, L): one run in each lane, the last run in lanes beyond it."""
    lanes = target.shape[-1]
    last = len(source) - 1
    for r in range(lanes):
        for i in range(source.shape[2]):
            target[i, r] = source[min(first + r, last), row, i]


@compiled
def filter_batch(
    F: Array, Q: Array, left: Array, phis: Array | None, z: Array, R: Array, poses: Array | None,
    R_bc: Array | None, P_poses: Array | None, lever: Array, planes: Array, A: Array, x0: Array, P0: Array,
    start: int, threshold: float, slots: Integers,
    out_x: Array, out_P: Array, out_v: Array, out_nis: Array, out_used: Flags, out_limited: Flags,
) -> int:  # fmt: skip
    """All runs through rows ``start`` to N; the row of a singular S, or -1.

    F, Q (N, 4, 4), left (N,) and phis (1 or B, N, 36) of the step to each row; z (B, N, 2); R (1 or B, N, 4);
    poses, R_bc, P_poses (1 or B, N, 12, 9, 36), None without a camera, or where the pose is taken as true;
    planes (N,); x0 (B, 4); P0 (1 or B, 4, 4);
    outputs with the runs last, x and P of each row at its place in ``slots`` (N,), nowhere where that is -1.
    """
    n_runs, n_rows = z.shape[:2]
    lanes = min(LANES, n_runs)
    x, P, C = np.empty((4, lanes)), np.empty((4, 4, lanes)), np.zeros((4, 6, lanes))
    y, M, N = np.empty((4, lanes)), np.empty((4, 4, lanes)), np.empty((4, 6, lanes))
    U, W, K = np.empty((4, 2, lanes)), np.zeros((6, 2, lanes)), np.empty((4, 2, lanes))
    S, inverse, L = np.empty((2, 2, lanes)), np.empty((2, 2, lanes)), np.zeros((6, 6, lanes))
    seen, v, noise = np.empty((2, lanes)), np.empty((2, lanes)), np.empty((4, lanes))
    H, H_pose = np.zeros((2, 2, lanes)), np.zeros((2, 6, lanes))
    pose, turn, P_pose = np.zeros((12, lanes)), np.zeros((9, lanes)), np.zeros((36, lanes))
    phi = np.empty((36, lanes))
    ok, nis, offered, singular = np.empty(lanes), np.empty(lanes), np.empty(lanes), np.zeros(lanes, np.bool_)
    R_now, pose_now = noise.reshape(2, 2, lanes), P_pose.reshape(6, 6, lanes)
    for first in range(0, n_runs, lanes):
        width = min(lanes, n_runs - first)
        for i in range(4):
            for a in range(6):
                for r in range(lanes):
                    C[i, a, r] = 0.0
        for r in range(lanes):
            run = min(first + r, n_runs - 1)
            for i in range(4):
                x[i, r] = x0[run, i]
                for j in range(4):
                    P[i, j, r] = P0[min(run, len(P0) - 1), i, j]
        for row in range(start, n_rows):
            predict_lanes(x, P, F[row], Q[row], y, M)
            load(z, row, first, seen)
            load(R, row, first, noise)
            if poses is not None:
                load(poses, row, first, pose)
                load(R_bc, row, first, turn)  # type: ignore[arg-type]  # there with `poses`
                expect_pixels(x, seen, pose, turn, lever, planes[row], A, v, H, H_pose, ok)
            else:
                for r in range(lanes):
                    there = np.isfinite(seen[0, r]) and np.isfinite(seen[1, r])
                    ok[r] = 1.0 if there else 0.0
                    for i in range(2):
                        v[i, r] = seen[i, r] - x[i, r] if there else 0.0
                        H[i, i, r] = 1.0
            if P_poses is not None:
                load(phis, row, first, phi)  # type: ignore[arg-type]  # there with `P_poses`
                carry_cross(C, F[row], left[row], phi, N)
                load(P_poses, row, first, P_pose)
                mark_sound(C, P, pose_now, L, N, M, nis)
                for r in range(width):
                    if ok[r] > 0 and nis[r] == 0:
                        limited, out_limited[row, first + r] = limit_one(
                            np.ascontiguousarray(C[:, :, r]), np.ascontiguousarray(P[:, :, r]),
                            np.ascontiguousarray(pose_now[:, :, r]),
                        )  # fmt: skip
                        for i in range(4):
                            for a in range(6):
                                C[i, a, r] = limited[i, a]
            for r in range(width):
                offered[r] = ok[r]
            update_lanes(
                x, P, C, pose_now, v, H, H_pose, R_now, P_poses, threshold, ok, nis, singular,
                U, W, S, inverse, K, M,
            )  # fmt: skip
            for r in range(width):
                if singular[r]:
                    return row
                run = first + r
                out_used[row, run] = ok[r] > 0
                out_nis[row, run] = nis[r] if offered[r] > 0 else np.nan
                for i in range(2):
                    out_v[row, i, run] = v[i, r] if offered[r] > 0 else np.nan
            slot = slots[row]
            if slot >= 0:
                for i in range(4):
                    for r in range(width):
                        out_x[slot, i, first + r] = x[i, r]
                    for j in range(4):
                        for r in range(width):
                            out_P[slot, i, j, first + r] = P[i, j, r]
    return -1
