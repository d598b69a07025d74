"""How wrong a georeferenced point may be: a 2x2 ground covariance per detection, on a plane or on terrain.

Errors of the pixel, the pose (position in n, attitude as a rotation vector in b: ``R_true = R Exp(delta)``,
H 7.15), the mount (a rotation vector in m) and the height of the ground are taken to the ground by
linearisation. First order, the ground about a point is the plane that touches it. A shift of the ray there
moves the point along the ray onto that plane: with the normal ``v`` of the plane and the ray ``d``,
``I - d v' / v'd``.

Where the ray is flat against its own uncertainty (the cotangent bends), or the heading sweeps an arc that no
ellipse along its tangent holds, that is known to be wrong, and the ellipse comes from samples. How flat is
too flat has a closed form. With depression ``a`` of the ray against the plane and standard deviation ``s`` of
``a`` the second-order term of ``h cot(a)`` is ``s cot(a)`` times the first. Linear ellipses are kept up to a
tenth, which for 2 deg is a ray 19 deg below the horizon. So has the arc: a heading of standard deviation
``s`` draws a point at the distance ``r`` in by ``r s^2 / 2``, whose own standard deviation is
``r s^2 / sqrt(2)``. Linear ellipses are kept up to a third of the one that they have in that direction.

Where terrain leaves the touching plane is found by trying it: rays towards 16 points of the ellipse on that
plane, half way and at the 90 % ellipse, are followed to the terrain. Where one of them misses, or meets it
elsewhere than on the plane by more than a fraction of the ellipse, samples decide.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from wildlab.geometry.camera import normalise, normalise_jacobian
from wildlab.geometry.camera_poses import CameraPoses
from wildlab.geometry.covariances import chi2_quantile
from wildlab.geometry.frames import Array, rotation_vector_to_matrix, skew
from wildlab.geometry.georeference import (
    Met,
    Terrain,
    georeference_pixels,
    intersect_plane,
    intersect_terrain,
    matching,
    pixels_to_terrain,
)

#: Ratio of the second-order to the first-order term above which the linear ellipse is not trusted.
FLAT = 0.1
#: Ratio of the arc's standard deviation to the linear one, towards the aircraft, above which it is not.
ARC = 1 / 3
#: Share of samples that meet no ground beyond which no ellipse is given at all.
UNBOUNDED = 0.05
SAMPLES = 1000
#: Of the ellipse's own size, how far the terrain may lie from the touching plane.
BENT = 0.2
#: At which radii of the ellipse, in standard deviations, that is tried: 90 % lie within the second.
TRIED = (1.07, 2.146)
#: Samples on either side of a gap before they are two groups, and the gap in standard deviations within them.
GROUP, GAP = 0.02, 1.0


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

    Attributes
    ----------
    covariance
        (N, 2, 2), north-east, metres squared; its 90 % ellipse is ``chi2_2(0.9)`` times it.
    method
        (N,): ``"linear"``, ``"sampled"``, ``"split"`` (sampled, and the samples fall into a near and a far
        group: a ridge), ``"unbounded"`` (more than 5 % of the samples meet no ground: covariance NaN) or
        ``"none"`` (the point itself is NaN).
    """

    covariance: Array
    method: NDArray[np.str_]


class GroundJacobians(NamedTuple):
    """Derivatives of the ground point (N, 2) north-east with respect to each source of error."""

    pixel: Array  # (N, 2, 2)
    pose: Array  # (N, 2, 6): position in n, rotation vector in b
    mount: Array  # (N, 2, 3): rotation vector in m
    plane: Array  # (N, 2): the ground's down coordinate


def ground_jacobians(poses: CameraPoses, uv: ArrayLike, plane_down: ArrayLike) -> GroundJacobians:
    """Derivatives of :func:`~wildlab.geometry.georeference.georeference_pixels`, north and east.

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
    points = georeference_pixels(poses, uv, plane_down)
    return terrain_jacobians(poses, uv, points, 0.0 * points[..., :2])


def terrain_jacobians(
    poses: CameraPoses, uv: ArrayLike, points: ArrayLike, slopes: ArrayLike
) -> GroundJacobians:
    """Derivatives of where a pixel's ray meets the plane that touches the ground.

    Parameters
    ----------
    poses
        The camera, with a pose for each pixel or one for all.
    uv
        (N, 2) pixels.
    points
        (N, 3) where their rays meet the ground, metres in n.
    slopes
        (N, 2) of the ground there: metres upwards for a metre north, and for a metre east.

    Returns
    -------
    GroundJacobians
        NaN where a point or a slope is.

    Raises
    ------
    WildlabError
        Where there is another number of poses than of pixels.

    Examples
    --------
    100 m above level ground, looking straight down: a pixel is a tenth of a metre.

    >>> from wildlab.geometry.camera import Camera
    >>> from wildlab.geometry.camera_poses import Mount
    >>> camera = Camera(640, 512, 1000.0, 1000.0, 320.0, 256.0)
    >>> poses = CameraPoses(camera, Mount("down"), np.array([0.0, 0.0, -100.0]), np.eye(3))
    >>> J = terrain_jacobians(poses, [[320.0, 256.0]], [[0.0, 0.0, 0.0]], [[0.0, 0.0]])
    >>> print(np.abs(np.round(J.pixel[0], 3)))
    [[0.  0.1]
     [0.1 0. ]]
    """
    pixels, _ = matching(poses, uv)
    camera, R, R_nc = poses.camera, poses.R_nb, poses.R_nc
    xy, d_c, d_n = _rays(poses, pixels)
    d_m = d_c @ poses.R_mc.T
    d_b = np.einsum("...ji,...j->...i", R, d_n)
    normal = _normals(slopes)
    toward = np.einsum("...i,...i->...", normal, d_n)[..., None, None]
    away = np.asarray(points, float) - poses.p_nc
    with np.errstate(divide="ignore", invalid="ignore"):
        depth = np.einsum("...i,...i->...", away, d_n) / np.einsum("...i,...i->...", d_n, d_n)
        onto = np.eye(3)[:2] - d_n[..., :2, None] * (normal[..., None, :] / toward)
    along = onto * depth[..., None, None]
    pose = np.empty((*depth.shape, 2, 6))
    pose[..., :3] = onto
    pose[..., 3:] = -along @ R @ skew(d_b) - onto @ R @ skew(poses.lever_arm)
    return GroundJacobians(
        pixel=along @ R_nc[..., :, :2] @ normalise_jacobian(camera, xy),
        pose=pose,
        mount=-along @ (R @ poses.R_bm) @ skew(d_m),
        plane=-onto[..., 2],
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
    poses: CameraPoses, uv: ArrayLike, errors: PoseErrors, slopes: ArrayLike = (0.0, 0.0)
) -> Array:
    """How flat each ray is on the ground against its own uncertainty: ``s cot(a)``.

    That is the standard deviation of ``v'd``, for a unit normal and a unit ray, over ``v'd`` itself.

    Parameters
    ----------
    poses
        The camera, with a pose for each pixel or one for all.
    uv
        (N, 2) pixels.
    errors
        Covariances of the sources; those of position and height play no part.
    slopes
        (N, 2) of the ground where their rays meet it, or (2,); level where it is left out.

    Returns
    -------
    (N,), no unit; infinite at and above the horizon, and where a ray comes from behind the slope.

    Raises
    ------
    WildlabError
        Where there is another number of poses than of pixels.
    """
    pixels, _ = matching(poses, uv)
    xy, d_c, d_n = _rays(poses, pixels)
    length = np.linalg.norm(d_c, axis=-1, keepdims=True)
    d_n = d_n / length
    normal = _normals(slopes)
    normal = normal / np.linalg.norm(normal, axis=-1, keepdims=True)
    toward = np.einsum("...i,...i->...", normal, d_n)
    # A rotation vector r turns the ray by r x d, and v'd by (d x v)'r.
    axis = np.cross(d_n, normal)
    on_body = np.einsum("...ji,...j->...i", poses.R_nb, axis)
    on_mount = np.einsum("...ji,...j->...i", poses.R_bm, on_body)
    across = normal - toward[..., None] * d_n
    J = poses.R_nc[..., :, :2] @ normalise_jacobian(poses.camera, xy)
    on_pixel = np.einsum("...i,...ij->...j", across, J) / length
    variance = (
        np.einsum("...i,...ij,...j->...", on_body, np.asarray(errors.pose)[..., 3:, 3:], on_body)
        + np.einsum("...i,ij,...j->...", on_mount, errors.mount, on_mount)
        + np.einsum("...i,...ij,...j->...", on_pixel, errors.pixel, on_pixel)
    )
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.where(toward > 0, np.sqrt(variance) / toward, np.inf)


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
    ground: Terrain | ArrayLike,
    errors: PoseErrors,
    rng: np.random.Generator,
    met: Met | None = None,
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
    ground
        Terrain in the same n, or the down coordinate of a plane in n, metres, scalar or (N,).
    errors
        Covariances of the sources, see :class:`PoseErrors`.
    rng
        Drawn from only where a ray is sampled.
    met
        Where the rays meet the terrain, if that is known already.

    Returns
    -------
    The covariances (N, 2, 2), metres squared, and how each was found.

    Raises
    ------
    WildlabError
        Where there is another number of poses than of pixels.
    """
    pixels = np.atleast_2d(np.asarray(uv, float))
    n = len(pixels)
    terrain = ground if isinstance(ground, Terrain) else None
    planes = np.zeros(n) if terrain else np.broadcast_to(np.asarray(ground, float), n)
    if terrain:
        points = (pixels_to_terrain(poses, pixels, terrain) if met is None else met).points
        slopes = terrain.slopes_at(points[:, :2])
    else:
        points = georeference_pixels(poses, pixels, planes)
        slopes = 0.0 * points[:, :2]
    covariance = _linear(terrain_jacobians(poses, pixels, points, slopes), errors)
    linear = np.isfinite(covariance).all(axis=(1, 2))
    doubtful = linear & _curved(poses, pixels, points, slopes, covariance, errors)
    if terrain:
        # A ray may end where the slope has no height beside it: a point without a plane is sampled, too.
        doubtful |= np.isfinite(points).all(axis=1) & ~linear
        rest = linear & ~doubtful
        doubtful[rest] = _bent(poses.take(rest), terrain, points[rest], slopes[rest], covariance[rest])
    method = np.where(linear, "linear", "none").astype("<U9")
    for i in np.flatnonzero(doubtful).tolist():
        one = PoseErrors(
            pixel=np.broadcast_to(errors.pixel, (n, 2, 2))[i],
            pose=np.broadcast_to(errors.pose, (n, 6, 6))[i],
            mount=errors.mount,
            plane=float(np.broadcast_to(errors.plane, n)[i]),
        )
        pose = poses.take(i)
        samples = sample_ground(pose, pixels[i], terrain or float(planes[i]), one, rng, SAMPLES)
        covariance[i], method[i] = _of_samples(samples, points[i], pose.p_nc)
    if not terrain:
        # On a plane there is no ridge that would part samples: those far away are rays along it.
        method[method == "split"] = "sampled"
    return GroundCovariance(covariance, method)


def _curved(
    poses: CameraPoses, pixels: Array, points: Array, slopes: Array, covariance: Array, errors: PoseErrors
) -> NDArray[np.bool_]:
    """Where the linear covariance (N, 2, 2) of a touching plane is known to be wrong."""
    arc = arc_bend(points[:, :2] - poses.p_nc[..., :2], ray_heading_sd(poses, errors), covariance)
    bent = (arc > ARC) | ~(ray_flatness(poses, pixels, errors, slopes) <= FLAT)
    return np.asarray(bent)


def sample_ground(
    pose: CameraPoses,
    uv: ArrayLike,
    ground: Terrain | float,
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
    ground
        Terrain in the same n, or the down coordinate of a plane in n, metres; it rises or sinks as a whole.
    errors
        Covariances of the sources, each given once.
    rng
        Drawn from.
    n
        How many draws.

    Returns
    -------
    (n, 3) metres in n; misses are NaN.

    Raises
    ------
    WildlabError
        Where there is more than one pose.
    """
    pixel, _ = matching(pose, uv)
    rays, starts = sample_rays(pose, pixel, errors, rng, n)
    off = np.sqrt(errors.plane) * rng.standard_normal(n)
    if not isinstance(ground, Terrain):
        return intersect_plane(rays, starts, ground + off)
    # Ground that is higher is the same as a camera that is lower, but for the height of the point.
    shift = np.column_stack([np.zeros((n, 2)), off])
    return np.asarray(intersect_terrain(ground, rays, starts + shift).points - shift)


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


def _rays(poses: CameraPoses, pixels: Array) -> tuple[Array, Array, Array]:
    """Normalised pixels, and rays of depth 1 in c and in n."""
    xy = normalise(poses.camera, pixels)
    d_c = np.concatenate([xy, np.ones((*xy.shape[:-1], 1))], axis=-1)
    return xy, d_c, np.einsum("...ij,...j->...i", poses.R_nc, d_c)


def _normals(slopes: ArrayLike) -> Array:
    """(..., 3) normals of slopes, into the ground: ``down + height(north, east)`` grows along them."""
    given = np.asarray(slopes, float)
    return np.concatenate([given, np.ones((*given.shape[:-1], 1))], axis=-1)


def _bent(
    poses: CameraPoses, terrain: Terrain, points: Array, slopes: Array, covariance: Array
) -> NDArray[np.bool_]:
    """Where the terrain leaves the plane that touches it, within the ellipse."""
    values, vectors = np.linalg.eigh(covariance)
    axes = vectors * np.sqrt(np.maximum(values, 0.0))[:, None, :]
    turns = np.arange(8) * np.pi / 4
    unit = np.concatenate([radius * np.column_stack([np.cos(turns), np.sin(turns)]) for radius in TRIED])
    offsets = np.einsum("nij,kj->nki", axes, unit)
    rise = np.einsum("nki,ni->nk", offsets, slopes)
    aims = points[:, None, :] + np.concatenate([offsets, -rise[..., None]], axis=-1)
    starts = np.broadcast_to(np.broadcast_to(poses.p_nc, points.shape)[:, None, :], aims.shape)
    rays = aims - starts
    met = intersect_terrain(terrain, rays.reshape(-1, 3), starts.reshape(-1, 3)).points.reshape(aims.shape)
    off = (met - aims)[..., :2]
    # In standard deviations along the axes of the ellipse; a sharp one has a least width to divide by.
    width = np.sqrt(np.maximum(values, 1e-12 * values[:, 1:] + 1e-12))
    inside = np.einsum("nij,nki->nkj", vectors, off) / width[:, None, :]
    far = np.linalg.norm(inside, axis=-1) / np.linalg.norm(unit, axis=-1)
    return np.asarray(~(far <= BENT).all(axis=1))


def _of_samples(samples: Array, centre: Array, p_nc: Array) -> tuple[Array, str]:
    """Covariance (2, 2) that holds nine tenths of samples, and what became of it."""
    offsets = samples[:, :2] - centre[:2]
    hit = np.isfinite(offsets).all(axis=1)
    if hit.mean() < 1 - UNBOUNDED:
        return np.full((2, 2), np.nan), "unbounded"
    distance = np.where(hit, np.linalg.norm(offsets, axis=1), np.inf)
    # The shape comes from the nearer nine tenths: a few rays that go far beyond would own it otherwise.
    core = offsets[distance <= np.quantile(distance, 0.9)]
    shape = core.T @ core / len(core)
    shape += 1e-9 * np.trace(shape) * np.eye(2)
    squared = np.where(
        hit, np.einsum("ni,ij,nj->n", offsets, np.linalg.inv(shape), offsets, optimize=True), np.inf
    )
    size = np.quantile(squared, 0.9, method="lower") / chi2_quantile(0.9, 2)
    away = np.linalg.norm(samples[hit] - p_nc, axis=1)
    return np.asarray(shape * size), "split" if _two_groups(away) else "sampled"


def _two_groups(distances: Array) -> bool:
    """Whether distances fall into a near and a far group."""
    ordered = np.sort(distances)
    n = len(ordered)
    few = max(2, int(GROUP * n))
    gaps = np.diff(ordered)[few - 1 : n - few]
    if not len(gaps):
        return False
    cut = int(np.argmax(gaps)) + few
    near, far = ordered[:cut], ordered[cut:]
    within = np.sqrt((near.var() * len(near) + far.var() * len(far)) / n)
    return bool(gaps.max() > GAP * within)
