"""How wrong a georeferenced point may be: a 2x2 ground covariance per detection.

Errors of the pixel, the pose (position in n, attitude as a rotation vector in b: ``R_true = R Exp(delta)``,
H 7.15), the mount (a rotation vector in m) and the height of the plane are taken to the ground by
linearisation. Where the ray is flat against its own uncertainty (the cotangent bends), or the heading sweeps
an arc that no ellipse along its tangent holds, that is known to be wrong, and the ellipse comes from samples.

How flat is too flat has a closed form. With depression ``a`` of the ray and standard deviation ``s`` of ``a``
the second-order term of ``h cot(a)`` is ``s cot(a)`` times the first. Linear ellipses are kept up to a tenth,
which for 2 deg is a ray 19 deg below the horizon. So has the arc: a heading of standard deviation ``s`` draws
a point at the distance ``r`` in by ``r s^2 / 2``, whose own standard deviation is ``r s^2 / sqrt(2)``. Linear
ellipses are kept up to a third of the one that they have in that direction.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from wildlab.errors import WildlabError
from wildlab.geometry.camera import normalise, normalise_jacobian
from wildlab.geometry.camera_poses import CameraPoses
from wildlab.geometry.covariances import chi2_quantile
from wildlab.geometry.frames import Array, rotation_vector_to_matrix, skew
from wildlab.geometry.georeference import georeference_pixels, intersect_plane, matching

#: Ratio of the second-order to the first-order term above which the linear ellipse is not trusted.
FLAT = 0.1
#: Ratio of the arc's standard deviation to the linear one, towards the aircraft, above which it is not.
ARC = 1 / 3
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


def ground_jacobians(poses: CameraPoses, uv: ArrayLike, plane_down: ArrayLike) -> GroundJacobians:
    """Derivatives of :func:`~wildlab.geometry.georeference.georeference_pixels`, north and east.

    A small shift of the ray's foot or direction moves the ground point along the ray's own projection onto
    the plane: ``[I, -d_h / d_z]`` times the shift in n. All derivatives follow from that.

    Parameters
    ----------
    poses
        The camera, with a pose for each pixel or one for all.
    uv
        (N, 2) pixels.
    plane_down
        Down coordinate of the plane in n, metres, scalar or (N,).

    Returns
    -------
    Derivatives with respect to the pixel, the pose (position in n, rotation vector in b), the mount
    (rotation vector in m) and the plane's down coordinate. Rows of rays that miss the plane are NaN.

    Raises
    ------
    WildlabError
        Where there is another number of poses, or of planes, than of pixels.
    """
    pixels, planes = matching(poses, uv, plane_down)
    camera, R, R_nc = poses.camera, poses.R_nb, poses.R_nc
    xy = normalise(camera, pixels)
    d_c = np.concatenate([xy, np.ones((*xy.shape[:-1], 1))], axis=-1)
    R_nm = R @ poses.R_bm
    d_m = d_c @ poses.R_mc.T
    d_n = np.einsum("...ij,...j->...i", R_nc, d_c)
    d_b = np.einsum("...ji,...j->...i", R, d_n)
    drop = np.broadcast_to(planes - poses.p_nc[..., 2], d_n.shape[:-1])
    hits = (d_n[..., 2] > 0) & (drop > 0)
    with np.errstate(divide="ignore", invalid="ignore"):
        slope = np.where(hits[..., None], d_n[..., :2] / d_n[..., 2:], np.nan)
        depth = np.where(hits, drop / d_n[..., 2], np.nan)
    onto_plane = np.concatenate([np.broadcast_to(np.eye(2), (*slope.shape, 2)), -slope[..., None]], axis=-1)
    along = onto_plane * depth[..., None, None]

    pose = np.empty((*slope.shape, 6))
    pose[..., :3] = onto_plane
    pose[..., 3:] = -along @ R @ skew(d_b) - onto_plane @ R @ skew(poses.lever_arm)
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


def ray_flatness(poses: CameraPoses, uv: ArrayLike, errors: PoseErrors) -> Array:
    """How flat each ray is against its own uncertainty: ``s cot(a)``.

    That is the standard deviation of its depression ``a`` times the cotangent of it.

    Parameters
    ----------
    poses
        The camera, with a pose for each pixel or one for all.
    uv
        (N, 2) pixels.
    errors
        Covariances of the sources; those of position and plane play no part.

    Returns
    -------
    (N,), no unit; infinite at and above the horizon.

    Raises
    ------
    WildlabError
        Where there is another number of poses than of pixels.
    """
    pixels, _ = matching(poses, uv)
    camera, R, R_nc = poses.camera, poses.R_nb, poses.R_nc
    xy = normalise(camera, pixels)
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
    on_mount = np.einsum("...ji,...j->...i", poses.R_bm, on_body)
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


def arc_bend(offset: ArrayLike, heading_sd: ArrayLike, covariance: ArrayLike) -> Array:
    """How far the arc that a heading sweeps leaves its tangent, against the ellipse towards the aircraft.

    Parameters
    ----------
    offset
        (N, 2) from the aircraft to the ground point, north and east, metres.
    heading_sd
        Standard deviation of the ray's rotation about the vertical, rad, scalar or (N,).
    covariance
        (N, 2, 2), linear, metres squared.

    Returns
    -------
    (N,), no unit; NaN where the covariance is.

    Examples
    --------
    A heading of 10 deg moves a point at 100 m by 2.2 m towards the aircraft, where 1 m is stated:

    >>> print(arc_bend([[100.0, 0.0]], np.radians(10), np.diag([1.0, 300.0])[None]).round(1))
    [2.2]
    """
    away, C = np.asarray(offset, float), np.asarray(covariance, float)
    squared = np.einsum("...i,...ij,...j->...", away, C, away)
    distance = np.linalg.norm(away, axis=-1)
    with np.errstate(divide="ignore", invalid="ignore"):
        drawn_in = distance**2 * np.square(np.asarray(heading_sd, float)) / np.sqrt(2 * squared)
    return np.asarray(np.where(squared > 0, drawn_in, 0.0 * squared))


def ray_heading_sd(poses: CameraPoses, errors: PoseErrors) -> Array:
    """By how much errors of pose and mount turn rays about the vertical.

    Parameters
    ----------
    poses
        The camera, with a pose for each pixel or one for all.
    errors
        Covariances of the sources; only these two play a part.

    Returns
    -------
    Standard deviation, rad, scalar or (N,).
    """
    on_body = poses.R_nb[..., 2, :]
    on_mount = np.einsum("...ji,...j->...i", poses.R_bm, on_body)
    return np.asarray(
        np.sqrt(
            np.einsum("...i,...ij,...j->...", on_body, np.asarray(errors.pose)[..., 3:, 3:], on_body)
            + np.einsum("...i,ij,...j->...", on_mount, errors.mount, on_mount)
        )
    )


def ground_covariance(
    poses: CameraPoses,
    uv: ArrayLike,
    plane_down: ArrayLike,
    errors: PoseErrors,
    rng: np.random.Generator,
) -> GroundCovariance:
    """Covariance of each ground point (north, east), by linearisation or, where that fails, by sampling.

    A sampled covariance has the shape of the samples' second moment about the computed point and the size
    that puts 90 % of them inside its 90 % ellipse: what readers of an ellipse take it to mean.

    Parameters
    ----------
    poses
        The camera, with a pose for each pixel or one for all.
    uv
        (N, 2) or (2,) pixels, one row per detection.
    plane_down
        Down coordinate of the plane in n, metres, scalar or (N,).
    errors
        Covariances of the sources, see :class:`PoseErrors`.
    rng
        Drawn from only where a ray is sampled.

    Returns
    -------
    The covariances (N, 2, 2), metres squared, and how each was found.

    Raises
    ------
    WildlabError
        Where there is another number of poses, of planes or of errors than of pixels.
    """
    uv = np.atleast_2d(uv).astype(float)
    n = len(uv)
    for name, axes in (("pixel", 2), ("pose", 2), ("plane", 0)):
        shape = np.shape(getattr(errors, name))
        lead = shape[: len(shape) - axes]
        if lead not in ((), (n,)):
            raise WildlabError(
                f"errors of the rows {lead} for {n} pixels", "give one for each, or one for all", field=name
            )
    covariance = _linear(ground_jacobians(poses, uv, plane_down), errors)
    method = np.where(np.isfinite(covariance).all(axis=(1, 2)), "linear", "none").astype("<U9")
    planes = np.broadcast_to(np.asarray(plane_down, float), n)
    offset = georeference_pixels(poses, uv, planes)[:, :2] - poses.p_nc[..., :2]
    bent = arc_bend(offset, ray_heading_sd(poses, errors), covariance) > ARC
    curved = (method == "linear") & (bent | (ray_flatness(poses, uv, errors) > FLAT))
    for i in np.flatnonzero(curved):
        one = PoseErrors(
            pixel=np.broadcast_to(errors.pixel, (n, 2, 2))[i],
            pose=np.broadcast_to(errors.pose, (n, 6, 6))[i],
            mount=errors.mount,
            plane=float(np.broadcast_to(errors.plane, n)[i]),
        )
        covariance[i] = _sampled(poses.take(int(i)), uv[i], float(planes[i]), one, rng)
        method[i] = "sampled" if np.isfinite(covariance[i]).all() else "unbounded"
    return GroundCovariance(covariance, method)


def sample_ground(
    pose: CameraPoses,
    uv: ArrayLike,
    plane_down: float,
    errors: PoseErrors,
    rng: np.random.Generator,
    n: int,
) -> Array:
    """Ground points of one detection with its errors drawn from their covariances.

    Parameters
    ----------
    pose
        The camera, with one pose.
    uv
        (2,) pixel.
    plane_down
        Down coordinate of the plane in n, metres.
    errors
        Covariances of the sources, each given once.
    rng
        Drawn from.
    n
        How many draws.

    Returns
    -------
    (n, 2) metres, north and east; misses are NaN.

    Raises
    ------
    WildlabError
        Where there is more than one pose.
    """
    pixel, plane = matching(pose, uv, plane_down)
    rays, starts = sample_rays(pose, pixel, errors, rng, n)
    planes = plane + np.sqrt(errors.plane) * rng.standard_normal(n)
    return intersect_plane(rays, starts, planes)[:, :2]


def sample_rays(
    pose: CameraPoses, uv: ArrayLike, errors: PoseErrors, rng: np.random.Generator, n: int
) -> tuple[Array, Array]:
    """Rays of one pixel with errors of pixel, pose and mount drawn from their covariances.

    Parameters
    ----------
    pose
        The camera, with one pose.
    uv
        (2,) pixel.
    errors
        Covariances of the sources, each given once; that of the plane is left to who meets it.
    rng
        Drawn from.
    n
        How many draws.

    Returns
    -------
    tuple of (n, 3) and (n, 3)
        Directions in n, and where they start, metres.
    """
    off = rng.multivariate_normal(np.zeros(6), errors.pose, n)
    R = pose.R_nb @ rotation_vector_to_matrix(off[:, 3:])
    turn = rotation_vector_to_matrix(rng.multivariate_normal(np.zeros(3), errors.mount, n))
    pixels = np.asarray(uv, float) + rng.multivariate_normal(np.zeros(2), errors.pixel, n)
    xy = normalise(pose.camera, pixels)
    d_m = np.concatenate([xy, np.ones((n, 1))], axis=1) @ pose.R_mc.T
    rays = np.einsum("nij,nj->ni", R @ pose.R_bm @ turn, d_m)
    return rays, np.asarray(pose.p_nb + off[:, :3] + R @ pose.lever_arm)


def _sampled(
    pose: CameraPoses, uv: Array, plane_down: float, errors: PoseErrors, rng: np.random.Generator
) -> Array:
    """Covariance (2, 2) of one ray from samples; NaN where too many miss the ground."""
    ground = sample_ground(pose, uv, plane_down, errors, rng, SAMPLES)
    centre = georeference_pixels(pose, uv, plane_down)[:2]
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
    return np.asarray(shape * np.quantile(squared, 0.9, method="lower") / chi2_quantile(0.9, 2))
