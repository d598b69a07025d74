"""Many runs of one flight at once: `wildlab.tracking.run.run_filter` for constant velocity, compiled.

For Monte Carlo studies: B runs share their times and their motion model; measurements, poses and covariances
may differ from run to run. States are ``[pN, pE, vN, vE]``; measurements are positions, or pixels of a camera
without distortion.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from wildlab.errors import WildlabError
from wildlab.geometry.camera_poses import CameraPoses
from wildlab.geometry.compilation import announced
from wildlab.geometry.frames import Array
from wildlab.tracking import kalman, schmidt
from wildlab.tracking.batch_kernels import Flags, filter_batch
from wildlab.tracking.motion import Motion
from wildlab.tracking.records import Start, Track, check_rows, check_start, checked
from wildlab.tracking.schmidt import PoseUncertainty


class BatchTracks(NamedTuple):
    """What the filter made of B runs of N measurements; the estimates after each of M rows.

    NaN before the start. Views of arrays in which the runs come last; where all runs have the same
    covariances, ``P`` is one array that every run looks at, and cannot be written to.
    """

    times: Array  # (M,)
    x: Array  # (B, M, 4)
    P: Array  # (B, M, 4, 4)
    innovation: Array  # (B, N, 2)
    nis: Array  # (B, N)
    used: NDArray[np.bool_]  # (B, N)
    limited: NDArray[np.bool_]  # (B, N), see `run.Track`


class BatchCamera(NamedTuple):
    """The camera of all runs: what `wildlab.tracking.sensors.pixels` takes.

    The rows of ``poses`` are those of all runs alike, (N,), or (B, N): each has its own. ``plane_down`` is a
    scalar or (N,).
    """

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
    pose: PoseUncertainty | None = None,
    gate_probability: float = 1.0,
    rows: ArrayLike | None = None,
) -> BatchTracks:
    """Kalman filter on positions; with ``view`` the extended filter on pixels; with ``pose`` Schmidt's.

    Parameters
    ----------
    times
        (N,) s, in order.
    measurements
        (B, N, 2) positions north, east in n, m, or with ``view`` pixels u, v; rows of NaN are frames without
        a detection.
    R
        (2, 2), (N, 2, 2) or (B, N, 2, 2), in m^2 or pixels squared.
    motion
        A model with four states.
    start
        ``x`` (4,) or (B, 4), ``P`` (4, 4) or (B, 4, 4); time and row are the same for all.
    view
        The camera; None: the measurements are positions.
    pose
        Uncertainty of the poses; its covariance is (N, 6, 6) or (B, N, 6, 6), m and rad. None: poses are
        taken as true.
    gate_probability
        As in `wildlab.tracking.run.run_filter`.
    rows
        (M,) the rows after which estimates are kept; all when not given. Long flights of many runs fill the
        memory with covariances, and writing them takes as long as computing them.

    Returns
    -------
    BatchTracks
        Estimates of each run after the kept rows, innovation and NIS of all rows.

    Raises
    ------
    WildlabError
        As `run_filter`; and for measurements that are not (B, N, 2), or a camera that distorts.
    """
    z = np.asarray(measurements, float)
    R = np.asarray(R, float)
    if z.ndim != 3 or z.shape[2] != 2:
        raise WildlabError(
            f"measurements of the shape {z.shape}", "give (runs, times, 2)", field="measurements"
        )
    R_rows = np.moveaxis(R, 0, 1) if R.ndim == 4 else R
    given = checked(times, np.moveaxis(z, 0, 1), R_rows, gate_probability, None)
    check_start(start)
    z = np.ascontiguousarray(np.moveaxis(given.z, 0, 1))
    B, N = z.shape[:2]
    first = max(int(np.searchsorted(given.times, start.time, "left")), start.row + 1)
    F, Q, left = np.empty((N, 4, 4)), np.empty((N, 4, 4)), np.ones(N)
    steps, which = np.unique(np.diff(given.times[first:], prepend=start.time), return_inverse=True)
    if len(steps):  # cameras keep time: the same few steps again and again
        F[first:], Q[first:] = (
            np.array(one)[which] for one in zip(*map(motion, steps.tolist()), strict=True)
        )
        if pose is not None:
            left[first:] = np.array([schmidt.fade(dt, pose.correlation_time) for dt in steps.tolist()])[which]

    P_poses = phis = None
    if pose is not None:
        check_rows(np.shape(pose.covariance)[-3], N, "pose.covariance")
        P_poses = _per_run(pose.covariance, 2, N)
        phis = _transitions(P_poses, pose)
        unknown = ~np.isfinite(P_poses).all(axis=2)
        z[np.broadcast_to(unknown, (B, N))] = np.nan
        P_poses[unknown] = 0.0
    noise = _per_run(R, 2, N)
    noise[~np.isfinite(noise).all(axis=2)] = [1.0, 0.0, 0.0, 1.0]  # their measurements are NaN by now
    P0 = np.asarray(start.P, float)
    kept = np.arange(N) if rows is None else np.arange(N)[np.asarray(rows, np.int64)]
    slots = np.full(N, -1)
    slots[kept] = np.arange(len(kept))
    estimates = [np.empty((len(kept), *shape, B)) for shape in ((4,), (4, 4))]
    scores = [np.empty((N, *shape, B)) for shape in ((2,), ())]
    for a in estimates:
        a[kept < first] = np.nan
    for a in scores:
        a[:first] = np.nan
    out = (*estimates, *scores, np.zeros((N, B), bool), np.zeros((N, B), bool))
    there = np.isfinite(z).all(axis=2)
    alike = len(noise) == 1 and P0.ndim == 2 and bool((there == there[:1]).all())
    if alike and view is None and pose is None and np.isinf(given.threshold):
        x0 = np.broadcast_to(np.asarray(start.x, float), (B, 4))
        return _run_alike(given.times, z, there[0], noise[0].reshape(N, 2, 2), F, Q, x0, start, first, kept)
    poses, R_bc, lever, planes, intrinsics = _camera_arrays(view, B, N)
    kind = "Schmidt" if pose is not None else "Kalman" if view is None else "extended Kalman"
    with announced(f"the {kind} filter for many runs"):
        singular = filter_batch(
            F, Q, left, phis, z, noise, poses, R_bc, P_poses, lever, planes, intrinsics,
            np.array(np.broadcast_to(np.asarray(start.x, float), (B, 4)), order="C"),
            np.ascontiguousarray(P0[None] if P0.ndim == 2 else P0),
            first, given.threshold, slots, *out,
        )  # fmt: skip
    if singular >= 0:
        raise _singular(singular)
    if start.row >= 0:
        if slots[start.row] >= 0:
            out[0][slots[start.row]] = np.asarray(start.x, float).T.reshape(4, -1)
            out[1][slots[start.row]] = np.moveaxis(P0, 0, -1) if P0.ndim == 3 else P0[..., None]
        out[4][start.row] = True
    return BatchTracks(given.times[kept], *(np.moveaxis(a, -1, 0) for a in out))


def as_tracks(found: BatchTracks) -> list[Track]:
    """Each run as the readable filters give it, where estimates were kept after all rows.

    Parameters
    ----------
    found
        From `run_batch`, B runs of N measurements.

    Returns
    -------
    list of Track
        B of them; ``S`` is NaN, for the compiled filters give the NIS in its place.
    """
    S = np.full((len(found.times), 2, 2), np.nan)
    chosen = np.where(np.isfinite(found.nis), 0, -1).astype(np.int64)
    each = zip(*found[1:6], chosen, found.limited, strict=True)
    return [
        Track(found.times, x, P, v, S, nis, used, which, limited)
        for x, P, v, nis, used, which, limited in each
    ]


def _run_alike(
    times: Array, z: Array, there: Flags, R: Array, F: Array, Q: Array, x0: Array, start: Start, first: int,
    kept: NDArray[np.int64],
) -> BatchTracks:  # fmt: skip
    """Positions without a gate, with the same noise and the same gaps in all runs.

    What such a filter knows of its errors does not depend on what it measures: covariances and gains are
    those of a single run, and only the estimates are many. z (B, N, 2); there (N,); R (N, 2, 2); x0 (B, 4).
    """
    B, N = z.shape[:2]
    H, P, x = np.eye(2, 4), np.asarray(start.P, float), np.array(x0.T, order="C")
    z_last = np.ascontiguousarray(np.moveaxis(z, 0, -1))
    estimates, covariances = np.empty((len(kept), 4, B)), np.empty((len(kept), 4, 4))
    innovation, nis = np.empty((N, 2, B)), np.empty((N, B))
    used = np.zeros((N, B), bool)
    slots = {int(row): slot for slot, row in enumerate(kept)}
    for a in (estimates, covariances):
        a[kept < first] = np.nan
    unseen = ~there | (np.arange(N) < first)
    innovation[unseen], nis[unseen] = np.nan, np.nan
    if start.row >= 0:
        used[start.row] = True
        if start.row in slots:
            estimates[slots[start.row]], covariances[slots[start.row]] = x, P
    for row in range(first, N):
        x = F[row] @ x
        P = kalman.predict(np.zeros(4), P, F[row], Q[row])[1]
        if there[row]:
            S = P[:2, :2] + R[row]
            if not (S[0, 0] > 0 and np.linalg.det(S) > 0):
                raise _singular(row)
            single = kalman.correct(np.zeros(4), P, np.zeros(2), H, R[row])
            v = np.subtract(z_last[row], x[:2], out=innovation[row])
            x = x + single.gain @ v
            nis[row] = (v * (np.linalg.inv(single.S) @ v)).sum(axis=0)
            P, used[row] = single.P, True
        if row in slots:
            estimates[slots[row]], covariances[slots[row]] = x, P
    x_first, v_first = np.moveaxis(estimates, -1, 0), np.moveaxis(innovation, -1, 0)
    shared = np.broadcast_to(covariances, (B, len(kept), 4, 4))
    return BatchTracks(times[kept], x_first, shared, v_first, nis.T, used.T, np.zeros((B, N), bool))


def _transitions(covariances: Array, pose: PoseUncertainty) -> Array:
    """What `schmidt.transitions_of_pose` gives for each run's covariances (B, N, 36), as (B, N, 36).

    They take most of the time of a run. They do not depend on the scale: runs whose covariances are multiples
    of those of another share its own. And where nothing is left of ``C`` they do not matter.
    """
    phis = np.tile(np.eye(6).ravel(), (*covariances.shape[:2], 1))
    if pose.correlation_time == 0:
        return phis
    known: list[int] = []
    for run, own in enumerate(covariances):
        like = next((other for other in known if _multiples(covariances[other], own)), None)
        if like is None:
            known.append(run)
            phis[run] = schmidt.transitions_of_pose(own.reshape(-1, 6, 6), pose.change).reshape(-1, 36)
        else:
            phis[run] = phis[like]
    return phis


def _multiples(one: Array, other: Array) -> bool:
    """Whether ``other`` is ``one`` times a number above zero, but for rounding; NaN where that has it."""
    largest = np.nanargmax(np.abs(one)) if np.isfinite(one).any() else 0
    if not (one.flat[largest] > 0 and other.flat[largest] > 0):
        return False
    factor = other.flat[largest] / one.flat[largest]
    return bool(np.allclose(other, factor * one, rtol=1e-12, atol=0, equal_nan=True))


def _singular(row: int) -> WildlabError:
    return WildlabError(
        f"the innovation covariance S of row {row} is not positive definite",
        "check the covariances of start, motion and measurements",
        field="S",
    )


def _camera_arrays(
    view: BatchCamera | None, runs: int, n_rows: int
) -> tuple[Array | None, Array | None, Array, Array, Array]:
    """Poses, R_bc, lever arm, planes and intrinsics for the kernel; without a camera no poses, and zeros."""
    if view is None:
        return None, None, np.zeros(3), np.zeros(n_rows), np.zeros(5)
    poses = view.poses
    camera = poses.camera
    poses.require_rows((n_rows,) if len(poses.rows) == 1 else (runs, n_rows), "measurements")
    if np.ndim(view.plane_down):
        check_rows(np.shape(view.plane_down)[0], n_rows, "view.plane_down")
    if camera.distorts:
        raise WildlabError(
            "the camera distorts, and the batch filter knows none that does",
            "take the distortion out of the pixels first, or use run_filter",
            field="camera",
        )
    p_nc, R_nc = _per_run(poses.p_nc, 1, n_rows), _per_run(poses.R_nc, 2, n_rows)
    return (
        np.ascontiguousarray(np.concatenate([p_nc, R_nc], axis=2)),
        _per_run(poses.R_bc, 2, n_rows),
        poses.lever_arm,
        np.array(np.broadcast_to(np.asarray(view.plane_down, float), n_rows)),
        np.array([camera.fx, camera.fy, camera.cx, camera.cy, camera.skew]),
    )


def _per_run(values: ArrayLike, axes: int, n_rows: int) -> Array:
    """(1 or B, N, k) from one value of so many axes, one for each row, or one for each run and row."""
    a = np.asarray(values, float)
    single = a.shape[a.ndim - axes :]
    a = np.broadcast_to(a, (1, n_rows, *single)) if a.ndim <= axes + 1 else a
    return np.array(a, order="C").reshape(len(a), n_rows, -1)
