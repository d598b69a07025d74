"""Runs of one flight with constant velocity, compiled: `wildlab.tracking.run.run_filter` for each.

B runs share times, motion, noise and poses; measurements and covariances of the poses may differ from run to
run. States are ``[pN, pE, vN, vE]``; measurements are positions, or pixels of a camera
without distortion. A row's errors that are considered stand behind the state: one joint covariance serves the
Kalman and the Schmidt filter. All compiled functions stay in this one file, and have their many arguments,
for the reasons that `wildlab.navigation.kernels` gives.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from wildlab.errors import WildlabError
from wildlab.geometry.camera_poses import CameraPoses
from wildlab.geometry.compilation import compiled
from wildlab.geometry.frames import Array
from wildlab.tracking import kalman
from wildlab.tracking.kalman import LARGEST_CORRELATION, Considered
from wildlab.tracking.motion import Motion
from wildlab.tracking.run import Start, Track, check_rows, check_start, checked
from wildlab.tracking.sensors import POSE

Flags = NDArray[np.bool_]


class BatchCamera(NamedTuple):
    """The camera of all runs: what `wildlab.tracking.sensors.pixels` takes."""

    poses: CameraPoses
    plane_down: ArrayLike


def run_batch(
    times: ArrayLike,
    measurements: ArrayLike,
    R: ArrayLike,
    motion: Motion,
    start: Start,
    *,
    view: BatchCamera | None = None,
    pose: Considered | None = None,
) -> list[Track]:
    """Kalman filter on positions; with ``view`` the extended filter on pixels; with ``pose`` Schmidt's.

    Parameters
    ----------
    times
        (N,) s, in order.
    measurements
        (B, N, 2) positions north, east in n, m, or with ``view`` pixels u, v; rows of NaN are frames without
        a detection.
    R
        (2, 2) or (N, 2, 2), in m^2 or pixels squared.
    motion, start
        With four states.
    view
        The camera; None: the measurements are positions.
    pose
        The six errors of the poses, constant biases; their covariance is (N, 6, 6) or (B, N, 6, 6). None:
        poses are taken as true.

    Returns
    -------
    list of Track
        One of each run; ``S`` is NaN, for the compiled filters give the NIS in its place.

    Raises
    ------
    WildlabError
        As `run_filter`; and for measurements that are not (B, N, 2), a camera that distorts, or other errors.
    """
    z = np.asarray(measurements, float)
    if z.ndim != 3 or z.shape[2] != 2:
        raise WildlabError(
            f"measurements of the shape {z.shape}", "give (runs, times, 2)", field="measurements"
        )
    given = checked(times, np.moveaxis(z, 0, 1), R, 1.0, None)
    check_start(start)
    z = np.ascontiguousarray(np.moveaxis(given.z, 0, 1))
    B, N = z.shape[:2]
    first = max(int(np.searchsorted(given.times, start.time, "left")), start.row + 1)
    F, Q = np.empty((N, 4, 4)), np.empty((N, 4, 4))
    steps, which = np.unique(np.diff(given.times[first:], prepend=start.time), return_inverse=True)
    if len(steps):  # cameras keep time: the same few steps again and again
        F[first:], Q[first:] = (
            np.array(one)[which] for one in zip(*map(motion, steps.tolist()), strict=True)
        )
    P_poses = phis = None
    if pose is not None:
        if pose.names != POSE or not np.isposinf(pose.correlation_time).all():
            raise WildlabError(
                f"the batch filter considers constant errors of the pose, not {', '.join(pose.names)}",
                "use run_filter",
                field="pose",
            )
        covariance = np.asarray(pose.covariance, float)
        check_rows(covariance.shape[-3] if covariance.ndim > 2 else 1, N, "pose.covariance")
        P_poses = np.array(covariance if covariance.ndim == 4 else covariance[None], order="C")
        phis = _transitions(P_poses)
        unknown = ~np.isfinite(P_poses).all(axis=(2, 3))
        z[np.broadcast_to(unknown, (B, N))] = np.nan
        P_poses[unknown] = 0.0
    noise = np.array(np.broadcast_to(given.R[:, 0], (N, 2, 2)), order="C")
    noise[~np.isfinite(noise).all(axis=(1, 2))] = np.eye(2)  # their measurements are NaN by now
    x0, P0 = np.array(start.x, float), np.array(start.P, float)
    x, P = (np.full((B, N, *shape), np.nan) for shape in ((4,), (4, 4)))
    innovation, nis = np.full((B, N, 2), np.nan), np.full((B, N), np.nan)
    used, limited = np.zeros((B, N), bool), np.zeros((B, N), bool)
    singular = filter_runs(
        F, Q, phis, z, noise, *_camera_arrays(view, N), P_poses, x0, P0, first, x, P, innovation, nis,
        used, limited,
    )  # fmt: skip
    if singular >= 0:
        raise WildlabError(
            f"the innovation covariance S of row {singular} is not positive definite",
            "check the covariances of start, motion and measurements",
            field="S",
        )
    if start.row >= 0:
        used[:, start.row] = True
        x[:, start.row], P[:, start.row] = x0, P0
    S, chosen = np.full((N, 2, 2), np.nan), np.where(np.isfinite(nis), 0, -1)
    return [
        Track(given.times, x[i], P[i], innovation[i], S, nis[i], used[i], chosen[i], limited[i])
        for i in range(B)
    ]


def _transitions(covariances: Array) -> Array:
    """(B, N, k, k) `kalman.transitions_of_pose` of each run's covariances (B, N, k, k).

    Units do not matter to them, so runs whose covariances are in proportion share theirs.
    """
    largest = np.abs(np.nan_to_num(covariances)).max(axis=(1, 2, 3), keepdims=True)
    unit = covariances / np.maximum(largest, np.finfo(float).tiny)
    found: list[Array] = []
    for k, one in enumerate(unit):
        same = (j for j in range(k) if np.allclose(one, unit[j], rtol=1e-12, atol=0, equal_nan=True))
        like = next(same, None)
        found.append(kalman.transitions_of_pose(covariances[k]) if like is None else found[like])
    return np.array(found)


def _camera_arrays(
    view: BatchCamera | None, n_rows: int
) -> tuple[Array | None, Array | None, Array | None, Array, Array, Array]:
    """p_nc, R_nc, R_bc, lever arm, planes and intrinsics for the kernel; None and zeros without a camera."""
    if view is None:
        return None, None, None, np.zeros(3), np.zeros(n_rows), np.zeros(5)
    poses = view.poses
    camera = poses.camera
    poses.require_rows((n_rows,), "measurements")
    if np.ndim(view.plane_down):
        check_rows(np.shape(view.plane_down)[0], n_rows, "view.plane_down")
    if camera.distorts:
        raise WildlabError(
            "the camera distorts",
            "undistort the pixels, or use run_filter",
            field="camera",
        )
    p_nc, R_nc, R_bc = (
        np.array(np.broadcast_to(one, (n_rows, *shape)), order="C")
        for one, shape in ((poses.p_nc, (3,)), (poses.R_nc, (3, 3)), (poses.R_bc, (3, 3)))
    )
    planes = np.array(np.broadcast_to(np.asarray(view.plane_down, float), n_rows))
    intrinsics = np.array([camera.fx, camera.fy, camera.cx, camera.cy, camera.skew])
    return p_nc, R_nc, R_bc, poses.lever_arm, planes, intrinsics


@compiled
def filter_runs(
    F: Array, Q: Array, phis: Array | None, z: Array, R: Array, p_nc: Array | None, R_nc: Array | None,
    R_bc: Array | None, lever: Array, planes: Array, A: Array, P_poses: Array | None, x0: Array, P0: Array,
    start: int, out_x: Array, out_P: Array, out_v: Array, out_nis: Array, out_used: Flags, out_limited: Flags,
) -> int:  # fmt: skip
    """All runs through rows ``start`` to N; the row of a singular S, or -1.

    F, Q (N, 4, 4) and phis (1 or B, N, 6, 6) of the step to each row; z (B, N, 2); R and the camera's poses
    (N, ...), P_poses (1 or B, N, 6, 6), None without a camera, or where the pose is taken as true; planes
    (N,); A (5,): fx, fy, cx, cy, skew. An argument of None is a type of its own: each kind of filter is
    compiled for itself.
    """
    n = 4 if P_poses is None else 10
    joint, J, U, V, K = (
        np.zeros((n, n)),
        np.zeros((2, n)),
        np.empty((n, 2)),
        np.empty((4, 2)),
        np.empty((4, 2)),
    )
    L, G, v = np.zeros((n, n)), np.empty((4, n)), np.zeros(2)
    for run in range(len(z)):
        x = x0.copy()
        joint[:] = 0.0
        joint[:4, :4] = P0
        for row in range(start, z.shape[1]):
            _predict(x, joint, F[row], Q[row], G)
            if P_poses is not None:
                of_run = min(run, len(P_poses) - 1)
                _carry_errors(joint, G, phis[of_run, row], P_poses[of_run, row])  # type: ignore[index]  # there with `P_poses`
            if p_nc is not None:
                seen = _expect_pixel(
                    x, z[run, row], p_nc[row], R_nc[row], R_bc[row], lever, planes[row], A, v, J,  # type: ignore[index]
                )  # fmt: skip
            else:
                seen = np.isfinite(z[run, row, 0]) and np.isfinite(z[run, row, 1])
                for i in range(2):
                    v[i], J[i, i] = z[run, row, i] - x[i], 1.0
            if seen:
                if P_poses is not None and not _is_covariance(joint, L):
                    C, out_limited[run, row] = kalman.limit_cross(
                        joint[:4, 4:].copy(), joint[:4, :4].copy(), joint[4:, 4:].copy()
                    )
                    joint[:4, 4:] = C
                    joint[4:, :4] = C.T
                nis = _update(x, joint, J, v, R[row], U, V, K, G)
                if nis < 0:
                    return row
                out_used[run, row], out_nis[run, row] = True, nis
                out_v[run, row, 0], out_v[run, row, 1] = v[0], v[1]
            for i in range(4):
                out_x[run, row, i] = x[i]
                for j in range(4):
                    out_P[run, row, i, j] = joint[i, j]
    return -1


@compiled
def _predict(x: Array, joint: Array, F: Array, Q: Array, G: Array) -> None:
    """H (3.5a)-(3.5b) for x (4,) and the state's part of ``joint`` (n, n); G (4, n): F times its rows."""
    for i in range(4):
        for j in range(len(joint)):
            G[i, j] = (
                F[i, 0] * joint[0, j] + F[i, 1] * joint[1, j] + F[i, 2] * joint[2, j] + F[i, 3] * joint[3, j]
            )
    x0, x1, x2, x3 = x[0], x[1], x[2], x[3]
    for i in range(4):
        x[i] = F[i, 0] * x0 + F[i, 1] * x1 + F[i, 2] * x2 + F[i, 3] * x3
        for j in range(i + 1):
            joint[i, j] = joint[j, i] = Q[i, j] + (
                G[i, 0] * F[j, 0] + G[i, 1] * F[j, 1] + G[i, 2] * F[j, 2] + G[i, 3] * F[j, 3]
            )


@compiled
def _carry_errors(joint: Array, G: Array, phi: Array, P_pose: Array) -> None:
    """``F C Phi'``, and the errors' own covariance of the row."""
    for a in range(6):
        for i in range(4):
            value = 0.0
            for b in range(6):
                value += G[i, 4 + b] * phi[a, b]
            joint[i, 4 + a] = joint[4 + a, i] = value
        for b in range(6):
            joint[4 + a, 4 + b] = P_pose[a, b]


@compiled
def _expect_pixel(
    x: Array, z: Array, p: Array, R_nc: Array, R_bc: Array, lever: Array, plane: float, A: Array, v: Array,
    J: Array,
) -> bool:  # fmt: skip
    """Innovation v (2,) and derivatives J (2, n) of `predictions.predict_pixel` without distortion.

    False where the pixel or the pose is not there, or the target not in front of the camera.
    """
    n, e, d = x[0] - p[0], x[1] - p[1], plane - p[2]
    X = R_nc[0, 0] * n + R_nc[1, 0] * e + R_nc[2, 0] * d
    Y = R_nc[0, 1] * n + R_nc[1, 1] * e + R_nc[2, 1] * d
    Z = R_nc[0, 2] * n + R_nc[1, 2] * e + R_nc[2, 2] * d
    if not (Z > 0 and np.isfinite(X + Y + Z) and np.isfinite(z[0]) and np.isfinite(z[1])):
        return False
    q = 1 / Z
    X, Y = X * q, Y * q
    v[0], v[1] = z[0] - (A[0] * X + A[4] * Y + A[2]), z[1] - (A[1] * Y + A[3])
    # The target as seen from b.
    bx = (R_bc[0, 0] * X + R_bc[0, 1] * Y + R_bc[0, 2]) * Z + lever[0]
    by = (R_bc[1, 0] * X + R_bc[1, 1] * Y + R_bc[1, 2]) * Z + lever[1]
    bz = (R_bc[2, 0] * X + R_bc[2, 1] * Y + R_bc[2, 2]) * Z + lever[2]
    for k in range(2):
        # A row of the pixel's derivative with respect to the target in c.
        jx, jy, jz = (
            (A[0] * q, A[4] * q, -(A[0] * X + A[4] * Y) * q) if k == 0 else (0.0, A[1] * q, -A[1] * Y * q)
        )
        for i in range(3):
            by_axis = jx * R_nc[i, 0] + jy * R_nc[i, 1] + jz * R_nc[i, 2]
            if i < 2:
                J[k, i] = by_axis
            if J.shape[1] > 4:
                J[k, 4 + i] = -by_axis
        if J.shape[1] > 4:
            # R_bc' S(b) J: rows of J R_cb, crossed with the target as seen from b.
            gx = jx * R_bc[0, 0] + jy * R_bc[0, 1] + jz * R_bc[0, 2]
            gy = jx * R_bc[1, 0] + jy * R_bc[1, 1] + jz * R_bc[1, 2]
            gz = jx * R_bc[2, 0] + jy * R_bc[2, 1] + jz * R_bc[2, 2]
            J[k, 7], J[k, 8], J[k, 9] = gy * bz - gz * by, gz * bx - gx * bz, gx * by - gy * bx
    return True


@compiled
def _update(
    x: Array, joint: Array, J: Array, v: Array, R: Array, U: Array, V: Array, K: Array, G: Array
) -> float:  # fmt: skip
    """The NIS, and H (3.7d)-(3.7h), with errors (7.34)-(7.38); Joseph form.

    -1 where S is no covariance. x (4,), joint (n, n), J (2, n), v (2,), R (2, 2); what follows is scratch.
    """
    n = len(joint)
    for i in range(n):
        for a in range(2):
            value = joint[i, 0] * J[a, 0] + joint[i, 1] * J[a, 1]  # velocities are not seen
            for j in range(4, n):
                value += joint[i, j] * J[a, j]
            U[i, a] = value
    s00 = J[0, 0] * U[0, 0] + J[0, 1] * U[1, 0] + R[0, 0]
    s01 = J[0, 0] * U[0, 1] + J[0, 1] * U[1, 1] + R[0, 1]
    s11 = J[1, 0] * U[0, 1] + J[1, 1] * U[1, 1] + R[1, 1]
    for j in range(4, n):
        s00 += J[0, j] * U[j, 0]
        s01 += J[0, j] * U[j, 1]
        s11 += J[1, j] * U[j, 1]
    determinant = s00 * s11 - s01 * s01
    if not (determinant > 0 and s00 > 0):
        return -1.0
    i00, i01, i11 = s11 / determinant, -s01 / determinant, s00 / determinant
    nis = v[0] * (i00 * v[0] + i01 * v[1]) + v[1] * (i01 * v[0] + i11 * v[1])
    for i in range(4):
        K[i, 0], K[i, 1] = U[i, 0] * i00 + U[i, 1] * i01, U[i, 0] * i01 + U[i, 1] * i11
        x[i] += K[i, 0] * v[0] + K[i, 1] * v[1]
        # The target's rows of (7.37): G is the left factor times the prior, then comes the right one.
        for j in range(n):
            G[i, j] = joint[i, j] - K[i, 0] * U[j, 0] - K[i, 1] * U[j, 1]
        for a in range(2):
            value = G[i, 0] * J[a, 0] + G[i, 1] * J[a, 1] - K[i, 0] * R[0, a] - K[i, 1] * R[1, a]
            for j in range(4, n):
                value += G[i, j] * J[a, j]
            V[i, a] = value
    for i in range(4):
        for j in range(i + 1):
            one = G[i, j] - V[i, 0] * K[j, 0] - V[i, 1] * K[j, 1]
            other = G[j, i] - V[j, 0] * K[i, 0] - V[j, 1] * K[i, 1]
            joint[i, j] = joint[j, i] = (one + other) / 2
        for j in range(4, n):
            joint[i, j] = joint[j, i] = G[i, j]
    return float(nis)


@compiled
def _is_covariance(joint: Array, L: Array) -> bool:
    """Whether ``[P C; C' P_pose]`` surely is one, with no correlation that `kalman.limit_cross` would limit.

    By Cholesky's pivots, the errors first; what is near nothing (or NaN) is left to the careful way.
    """
    n, highest = len(joint), LARGEST_CORRELATION**2
    for a in range(n):
        i = (a + 4) % n
        for b in range(a + 1):
            value = joint[i, (b + 4) % n]
            if b >= n - 4:
                value *= highest
            for k in range(b):
                value -= L[a, k] * L[b, k]
            if b < a:
                L[a, b] = value / L[b, b]
            elif not value > 1e-9 * joint[i, i]:
                return False
            else:
                L[a, a] = np.sqrt(value)
    return True
