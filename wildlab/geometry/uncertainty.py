"""How wrong a georeferenced point may be: a 2x2 ground covariance per detection.

Errors of the pixel, the pose (position in n, attitude as a rotation vector in b: ``R_true = R Exp(delta)``,
H 7.15), the mount (a rotation vector in m) and the height of the plane are taken to the ground by
linearisation. Where the ray is flat against its own uncertainty that is known to be wrong (the cotangent
bends), and the ellipse comes from samples instead.

How flat is too flat has a closed form. With depression ``a`` of the ray and standard deviation ``s`` of ``a``
the second-order term of ``h cot(a)`` is ``s cot(a)`` times the first. Linear ellipses are kept up to a tenth,
which for 2 deg is a ray 19 deg below the horizon.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.stats import chi2

from wildlab.geometry.camera import Camera, normalise, normalise_jacobian
from wildlab.geometry.frames import Array, rotation_vector_to_matrix, skew
from wildlab.geometry.georeference import intersect_plane, pixel_to_plane
from wildlab.geometry.mount import R_MC_DOWN, R_MC_FORWARD, Mount, camera_pose, mount_rotation

#: Ratio of the second-order to the first-order term above which the linear ellipse is not trusted.
FLAT = 0.1
#: Share of samples above the horizon beyond which no ellipse is given at all.
UNBOUNDED = 0.05
SAMPLES = 1000


class PoseErrors(NamedTuple):
    """Covariances of what a ground point is computed from. SI units and radians.

    Attributes
    ----------
    pixel
        (2, 2) or (N, 2, 2), pixels squared.
    pose
        (6, 6) or (N, 6, 6): position in n, rotation vector in b.
    mount
        (3, 3): rotation vector in m, after pan and tilt.
    plane
        Variance of the plane's height, scalar or (N,).
    """

    pixel: Array
    pose: Array
    mount: Array
    plane: Array | float


class GroundCovariance(NamedTuple):
    """Result of :func:`ground_covariance`.

    ``covariance`` (N, 2, 2), north-east, metres squared; its 90 % ellipse is ``chi2_2(0.9)`` times it.
    ``method`` (N,): ``"linear"``, ``"sampled"``, ``"unbounded"`` (more than 5 % of the rays above the
    horizon, covariance NaN) or ``"none"`` (the point itself is NaN).
    """

    covariance: Array
    method: NDArray[np.str_]


class GroundJacobians(NamedTuple):
    """Derivatives of the ground point (N, 2) north-east with respect to each source of error."""

    pixel: Array  # (N, 2, 2)
    pose: Array  # (N, 2, 6)
    mount: Array  # (N, 2, 3)
    plane: Array  # (N, 2)


def ground_jacobians(
    camera: Camera,
    mount: Mount,
    uv: ArrayLike,
    p_nb: ArrayLike,
    R_nb: ArrayLike,
    plane_down: ArrayLike,
    pan: ArrayLike | None = None,
    tilt: ArrayLike | None = None,
) -> GroundJacobians:
    """Derivatives of :func:`~wildlab.geometry.georeference.pixel_to_plane`, north and east.

    A small shift of the ray's foot or direction moves the ground point along the ray's own projection onto
    the plane: ``[I, -d_h / d_z]`` times the shift in n. All derivatives follow from that.

    Parameters
    ----------
    uv
        (N, 2) pixels.
    p_nb, R_nb
        Pose of the airframe (N, 3), (N, 3, 3).
    plane_down
        Down coordinate of the plane, scalar or (N,).
    pan, tilt
        Gimbal angles (N,), where the gimbal moves.

    Returns
    -------
    Derivatives with respect to the pixel, the pose (position in n, rotation vector in b), the mount
    (rotation vector in m) and the plane's down coordinate. Rows of rays that miss the plane are NaN.
    """
    R = np.asarray(R_nb, float)
    p_nc, R_nc = camera_pose(mount, p_nb, R, pan, tilt)
    xy = normalise(camera, uv)
    d_c = np.concatenate([xy, np.ones((*xy.shape[:-1], 1))], axis=-1)
    R_nm = R @ mount_rotation(mount, pan, tilt)
    d_m = d_c @ (R_MC_DOWN if mount.looks == "down" else R_MC_FORWARD).T
    d_n = np.einsum("...ij,...j->...i", R_nc, d_c)
    d_b = np.einsum("...ji,...j->...i", R, d_n)
    drop = np.broadcast_to(np.asarray(plane_down, float) - p_nc[..., 2], d_n.shape[:-1])
    hits = (d_n[..., 2] > 0) & (drop > 0)
    with np.errstate(divide="ignore", invalid="ignore"):
        slope = np.where(hits[..., None], d_n[..., :2] / d_n[..., 2:], np.nan)
        depth = np.where(hits, drop / d_n[..., 2], np.nan)
    onto_plane = np.concatenate([np.broadcast_to(np.eye(2), (*slope.shape, 2)), -slope[..., None]], axis=-1)
    along = onto_plane * depth[..., None, None]

    lever = np.asarray(mount.lever_arm, float)
    pose = np.empty((*slope.shape, 6))
    pose[..., :3] = onto_plane
    pose[..., 3:] = -along @ R @ skew(d_b) - onto_plane @ R @ skew(lever)
    return GroundJacobians(
        pixel=along @ R_nc[..., :, :2] @ normalise_jacobian(camera, xy),
        pose=pose,
        mount=-along @ R_nm @ skew(d_m),
        plane=slope,
    )


def _linear(jacobians: GroundJacobians, errors: PoseErrors) -> Array:
    """Sum of each source's covariance carried to the ground, (N, 2, 2)."""
    J_pixel, J_pose, J_mount, J_plane = jacobians
    swap = np.swapaxes
    return np.asarray(
        J_pixel @ errors.pixel @ swap(J_pixel, -1, -2)
        + J_pose @ errors.pose @ swap(J_pose, -1, -2)
        + J_mount @ errors.mount @ swap(J_mount, -1, -2)
        + np.asarray(errors.plane)[..., None, None] * J_plane[..., :, None] * J_plane[..., None, :]
    )


def ray_flatness(
    camera: Camera,
    mount: Mount,
    uv: ArrayLike,
    R_nb: ArrayLike,
    errors: PoseErrors,
    pan: ArrayLike | None = None,
    tilt: ArrayLike | None = None,
) -> Array:
    """``s cot(a)`` of each ray (N,): its depression's standard deviation times the cotangent of it.

    Infinite at and above the horizon.
    """
    R = np.asarray(R_nb, float)
    R_bm = mount_rotation(mount, pan, tilt)
    R_nc = camera_pose(mount, np.zeros(3), R, pan, tilt)[1]
    xy = normalise(camera, uv)
    d_c = np.concatenate([xy, np.ones((*xy.shape[:-1], 1))], axis=-1)
    length = np.linalg.norm(d_c, axis=-1, keepdims=True)
    d_n = np.einsum("...ij,...j->...i", R_nc, d_c) / length
    level = np.hypot(d_n[..., 0], d_n[..., 1])
    with np.errstate(divide="ignore", invalid="ignore"):
        # Unit vector of increasing depression; any horizontal direction serves a ray straight down.
        steeper = np.stack(
            [-d_n[..., 0] * d_n[..., 2] / level, -d_n[..., 1] * d_n[..., 2] / level, level], axis=-1
        )
    steeper[level < 1e-12] = [1.0, 0.0, 0.0]
    # The ray turns by a rotation vector r (in n) through r x d; its depression changes by (d x steeper) . r.
    axis = np.cross(d_n, steeper)
    on_body = np.einsum("...ji,...j->...i", R, axis)
    on_mount = np.einsum("...ji,...j->...i", np.asarray(R_bm), on_body)
    on_pixel = (
        np.einsum("...i,...ij->...j", steeper, R_nc[..., :, :2] @ normalise_jacobian(camera, xy)) / length
    )
    variance = (
        np.einsum("...i,...ij,...j->...", on_body, np.asarray(errors.pose)[..., 3:, 3:], on_body)
        + np.einsum("...i,ij,...j->...", on_mount, errors.mount, on_mount)
        + np.einsum("...i,...ij,...j->...", on_pixel, errors.pixel, on_pixel)
    )
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.where(d_n[..., 2] > 0, np.sqrt(variance) * level / d_n[..., 2], np.inf)


def ground_covariance(
    camera: Camera,
    mount: Mount,
    uv: ArrayLike,
    p_nb: ArrayLike,
    R_nb: ArrayLike,
    plane_down: ArrayLike,
    errors: PoseErrors,
    rng: np.random.Generator,
    pan: ArrayLike | None = None,
    tilt: ArrayLike | None = None,
) -> GroundCovariance:
    """Covariance of each ground point (north, east), by linearisation or, for flat rays, by sampling.

    A sampled covariance has the shape of the samples' second moment about the computed point and the size
    that puts 90 % of them inside its 90 % ellipse: what readers of an ellipse take it to mean.

    Parameters
    ----------
    uv, p_nb, R_nb, plane_down, pan, tilt
        As in :func:`ground_jacobians`, one row per detection.
    errors
        Covariances of the sources, see :class:`PoseErrors`.
    rng
        Drawn from only where a ray is sampled.
    """
    uv, p_nb, R_nb = (
        np.atleast_2d(uv).astype(float),
        np.atleast_2d(p_nb).astype(float),
        np.asarray(R_nb, float),
    )
    R_nb = np.broadcast_to(R_nb, (len(uv), 3, 3))
    p_nb = np.broadcast_to(p_nb, (len(uv), 3))
    plane = np.broadcast_to(np.asarray(plane_down, float), len(uv))
    covariance = _linear(ground_jacobians(camera, mount, uv, p_nb, R_nb, plane, pan, tilt), errors)
    method = np.where(np.isfinite(covariance).all(axis=(1, 2)), "linear", "none").astype("<U9")
    flat = (method == "linear") & (ray_flatness(camera, mount, uv, R_nb, errors, pan, tilt) > FLAT)
    for i in np.flatnonzero(flat):
        one = PoseErrors(
            pixel=np.broadcast_to(errors.pixel, (len(uv), 2, 2))[i],
            pose=np.broadcast_to(errors.pose, (len(uv), 6, 6))[i],
            mount=errors.mount,
            plane=float(np.broadcast_to(errors.plane, len(uv))[i]),
        )
        gimbal = [
            None if angle is None else float(np.broadcast_to(angle, len(uv))[i]) for angle in (pan, tilt)
        ]
        covariance[i] = _sampled(camera, mount, uv[i], p_nb[i], R_nb[i], plane[i], one, rng, gimbal)
        method[i] = "sampled" if np.isfinite(covariance[i]).all() else "unbounded"
    return GroundCovariance(covariance, method)


def sample_ground(
    camera: Camera,
    mount: Mount,
    uv: Array,
    p_nb: Array,
    R_nb: Array,
    plane_down: float,
    errors: PoseErrors,
    rng: np.random.Generator,
    n: int,
    pan: float | None = None,
    tilt: float | None = None,
) -> Array:
    """Ground points (n, 2) of one detection with its errors drawn from their covariances; misses are NaN."""
    pose = rng.multivariate_normal(np.zeros(6), errors.pose, n)
    R = R_nb @ rotation_vector_to_matrix(pose[:, 3:])
    turn = rotation_vector_to_matrix(rng.multivariate_normal(np.zeros(3), errors.mount, n))
    pixels = uv + rng.multivariate_normal(np.zeros(2), errors.pixel, n)
    planes = plane_down + np.sqrt(errors.plane) * rng.standard_normal(n)
    xy = normalise(camera, pixels)
    d_c = np.concatenate([xy, np.ones((n, 1))], axis=1)
    d_m = d_c @ (R_MC_DOWN if mount.looks == "down" else R_MC_FORWARD).T
    rays = np.einsum("nij,nj->ni", R @ mount_rotation(mount, pan, tilt) @ turn, d_m)
    p_nc = p_nb + pose[:, :3] + R @ np.asarray(mount.lever_arm)
    return intersect_plane(rays, p_nc, planes)[:, :2]


def _sampled(
    camera: Camera,
    mount: Mount,
    uv: Array,
    p_nb: Array,
    R_nb: Array,
    plane_down: float,
    errors: PoseErrors,
    rng: np.random.Generator,
    gimbal: list[float | None],
) -> Array:
    """Covariance (2, 2) of one flat ray from samples; NaN where too many miss the ground."""
    ground = sample_ground(camera, mount, uv, p_nb, R_nb, plane_down, errors, rng, SAMPLES, *gimbal)
    centre = pixel_to_plane(camera, uv, *camera_pose(mount, p_nb, R_nb, *gimbal), plane_down)[:2]
    offsets = ground - centre
    hit = np.isfinite(offsets).all(axis=1)
    if hit.mean() < 1 - UNBOUNDED:
        return np.full((2, 2), np.nan)
    # The shape comes from the nearer nine tenths: a few rays that graze the horizon would own it otherwise.
    distance = np.where(hit, np.linalg.norm(offsets, axis=1), np.inf)
    core = offsets[distance <= np.quantile(distance, 0.9)]
    shape = core.T @ core / len(core)
    squared = np.where(
        hit, np.einsum("ni,ij,nj->n", offsets, np.linalg.inv(shape), offsets, optimize=True), np.inf
    )
    return np.asarray(shape * np.quantile(squared, 0.9, method="lower") / chi2.ppf(0.9, 2))


def ellipse_axes(covariance: ArrayLike, probability: float = 0.9) -> tuple[Array, Array, Array]:
    """Half axes (metres) and bearing of the long one (radians from north) of covariance ellipses.

    (N, 2, 2) north-east -> three arrays (N,). ``probability`` of the content of a normal distribution.
    NaN covariances give NaN.
    """
    C = np.asarray(covariance, float)
    mean = (C[..., 0, 0] + C[..., 1, 1]) / 2
    half = (C[..., 0, 0] - C[..., 1, 1]) / 2
    spread = np.hypot(half, C[..., 0, 1])
    scale = chi2.ppf(probability, 2)
    long_axis = np.sqrt(scale * (mean + spread))
    short_axis = np.sqrt(scale * np.maximum(mean - spread, 0))
    return long_axis, short_axis, np.arctan2(C[..., 0, 1], half) / 2


def inside_ellipse(offset: ArrayLike, covariance: ArrayLike, probability: float = 0.9) -> np.ndarray:
    """Which offsets (N, 2) from the truth lie inside the ellipse of their covariance (N, 2, 2). (N,) bool.

    NaN rows are outside.
    """
    e, C = np.asarray(offset, float), np.asarray(covariance, float)
    determinant = C[..., 0, 0] * C[..., 1, 1] - C[..., 0, 1] * C[..., 1, 0]
    with np.errstate(invalid="ignore", divide="ignore"):
        squared = (
            C[..., 1, 1] * e[..., 0] ** 2
            - 2 * C[..., 0, 1] * e[..., 0] * e[..., 1]
            + C[..., 0, 0] * e[..., 1] ** 2
        ) / determinant
        return np.asarray(squared <= chi2.ppf(probability, 2))
