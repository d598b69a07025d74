"""How wrong a point on terrain may be: a 2x2 ground covariance per detection, slope and ridges minded.

First order, the ground about a point is the plane that touches it. A shift of the ray there moves the point
along the ray onto that plane: with the normal ``v`` of the plane and the ray ``d``, ``I - d v' / v'd``. For
level ground this is `wildlab.geometry.uncertainty`.

Where that fails is found by trying it: rays towards 16 points of the ellipse on the touching plane, half way
and at the 90 % ellipse, are followed to the terrain. Where one of them misses, or meets it elsewhere than on
the plane by more than a fraction of the ellipse, samples decide. So they do where the ray is flat against the
ground and its own uncertainty (see `wildlab.geometry.uncertainty`: the same bend, counted from the slope).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from wildlab.errors import WildlabError
from wildlab.geometry.camera import normalise, normalise_jacobian
from wildlab.geometry.camera_poses import CameraPoses
from wildlab.geometry.frames import Array, skew
from wildlab.geometry.georeference import matching
from wildlab.geometry.terrain import Met, Terrain, intersect_terrain, pixels_to_terrain
from wildlab.geometry.uncertainty import (
    ARC,
    FLAT,
    SAMPLES,
    UNBOUNDED,
    PoseErrors,
    arc_bend,
    ray_heading_sd,
    sample_rays,
)

#: Of the ellipse's own size, how far the terrain may lie from the touching plane.
BENT = 0.2
#: At which radii of the ellipse, in standard deviations, that is tried: 90 % lie within the second.
TRIED = (1.07, 2.146)
#: Samples on either side of a gap before they are two groups, and the gap in standard deviations within them.
GROUP, GAP = 0.02, 1.0


class TerrainJacobians(NamedTuple):
    """Derivatives of the point (N, 2) north-east on the touching plane, by source of error."""

    pixel: Array  # (N, 2, 2)
    pose: Array  # (N, 2, 6)
    mount: Array  # (N, 2, 3)
    height: Array  # (N, 2): by the terrain's height, upwards


class TerrainCovariance(NamedTuple):
    """Result of :func:`terrain_covariance`.

    Attributes
    ----------
    covariance
        (N, 2, 2), north-east, metres squared.
    method
        (N,): ``"linear"``, ``"sampled"``, ``"split"`` (sampled, and the samples fall into a near and a far
        group: a ridge), ``"unbounded"`` (more than 5 % of the samples meet no ground: covariance NaN) or
        ``"none"`` (the point itself is NaN).
    """

    covariance: Array
    method: NDArray[np.str_]


def terrain_jacobians(
    poses: CameraPoses, uv: ArrayLike, points: ArrayLike, slopes: ArrayLike
) -> TerrainJacobians:
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
    TerrainJacobians
        NaN where a point or a slope is.

    Raises
    ------
    WildlabError
        Where there is another number of poses than of pixels.

    Examples
    --------
    100 m above level ground, looking straight down: a pixel is a tenth of a metre.

    >>> from wildlab.geometry.camera import Camera
    >>> from wildlab.geometry.mount import Mount
    >>> camera = Camera(640, 512, 1000.0, 1000.0, 320.0, 256.0)
    >>> poses = CameraPoses(camera, Mount("down"), np.array([0.0, 0.0, -100.0]), np.eye(3))
    >>> J = terrain_jacobians(poses, [[320.0, 256.0]], [[0.0, 0.0, 0.0]], [[0.0, 0.0]])
    >>> print(np.abs(np.round(J.pixel[0], 3)))
    [[0.  0.1]
     [0.1 0. ]]
    """
    pixels, _ = matching(poses, np.atleast_2d(np.asarray(uv, float)))
    camera, R, R_nc = poses.camera, poses.R_nb, poses.R_nc
    xy, d_c, d_n = _rays(poses, pixels)
    d_m = d_c @ poses.R_mc.T
    d_b = np.einsum("...ji,...j->...i", R, d_n)
    normal = _normals(slopes)
    toward = np.einsum("ni,ni->n", normal, d_n)
    with np.errstate(divide="ignore", invalid="ignore"):
        depth = np.einsum("ni,ni->n", np.asarray(points, float) - poses.p_nc, d_n) / np.einsum(
            "ni,ni->n", d_n, d_n
        )
        onto = np.eye(3)[:2] - d_n[:, :2, None] * (normal / toward[:, None])[:, None, :]
        height = -d_n[:, :2] / toward[:, None]
    along = onto * depth[:, None, None]
    pose = np.empty((len(pixels), 2, 6))
    pose[..., :3] = onto
    pose[..., 3:] = -along @ R @ skew(d_b) - onto @ R @ skew(poses.lever_arm)
    return TerrainJacobians(
        pixel=along @ R_nc[..., :, :2] @ normalise_jacobian(camera, xy),
        pose=pose,
        mount=-along @ (R @ poses.R_bm) @ skew(d_m),
        height=height,
    )


def terrain_flatness(poses: CameraPoses, uv: ArrayLike, slopes: ArrayLike, errors: PoseErrors) -> Array:
    """How flat each ray is on the ground against its own uncertainty: `ray_flatness`, counted from the slope.

    That is the standard deviation of ``v'd``, for a unit normal and a unit ray, over ``v'd`` itself.

    Parameters
    ----------
    poses
        The camera, with a pose for each pixel or one for all.
    uv
        (N, 2) pixels.
    slopes
        (N, 2) of the ground where their rays meet it.
    errors
        Covariances of the sources; those of position and height play no part.

    Returns
    -------
    (N,), no unit; infinite where a ray comes from behind the slope.

    Raises
    ------
    WildlabError
        Where there is another number of poses than of pixels.
    """
    pixels, _ = matching(poses, np.atleast_2d(np.asarray(uv, float)))
    xy, d_c, d_n = _rays(poses, pixels)
    length = np.linalg.norm(d_c, axis=-1, keepdims=True)
    d_n = d_n / length
    normal = _normals(slopes)
    normal = normal / np.linalg.norm(normal, axis=-1, keepdims=True)
    toward = np.einsum("ni,ni->n", normal, d_n)
    # A rotation vector r turns the ray by r x d, and v'd by (d x v)'r.
    axis = np.cross(d_n, normal)
    on_body = np.einsum("...ji,...j->...i", poses.R_nb, axis)
    on_mount = np.einsum("...ji,...j->...i", poses.R_bm, on_body)
    across = normal - toward[:, None] * d_n
    J = poses.R_nc[..., :, :2] @ normalise_jacobian(poses.camera, xy)
    on_pixel = np.einsum("...i,...ij->...j", across, J) / length
    variance = (
        np.einsum("...i,...ij,...j->...", on_body, np.asarray(errors.pose)[..., 3:, 3:], on_body)
        + np.einsum("...i,ij,...j->...", on_mount, errors.mount, on_mount)
        + np.einsum("...i,...ij,...j->...", on_pixel, errors.pixel, on_pixel)
    )
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.where(toward > 0, np.sqrt(variance) / toward, np.inf)


def terrain_covariance(
    poses: CameraPoses,
    uv: ArrayLike,
    terrain: Terrain,
    errors: PoseErrors,
    rng: np.random.Generator,
    met: Met | None = None,
) -> TerrainCovariance:
    """Covariance of each point (north, east) on terrain, by linearisation or, where that fails, by sampling.

    A sampled covariance has the shape of the samples' second moment about the computed point and the size
    that puts 90 % of them inside its 90 % ellipse, as in `wildlab.geometry.uncertainty.ground_covariance`.

    Parameters
    ----------
    poses
        The camera, with a pose for each pixel or one for all.
    uv
        (N, 2) pixels.
    terrain
        In the same n.
    errors
        Covariances of the sources; ``plane`` is the variance of the terrain's height.
    rng
        Drawn from only where a ray is sampled.
    met
        Where the rays meet the terrain, if that is known already.

    Returns
    -------
    TerrainCovariance

    Raises
    ------
    WildlabError
        Where there is another number of poses, or of errors, than of pixels.
    """
    pixels, _ = matching(poses, np.atleast_2d(np.asarray(uv, float)))
    n = len(pixels)
    _check_errors(errors, n)
    points = (pixels_to_terrain(poses, pixels, terrain) if met is None else met).points
    slopes = terrain.slopes_at(points[:, :2])
    jacobians = terrain_jacobians(poses, pixels, points, slopes)
    covariance = _linear(jacobians, errors)
    method = np.where(np.isfinite(covariance).all(axis=(1, 2)), "linear", "none").astype("<U9")
    linear = method == "linear"
    # A ray may end where the slope has no height beside it: a point without a plane is sampled, too.
    doubtful = np.isfinite(points).all(axis=1) & ~linear
    doubtful |= linear & ~(terrain_flatness(poses, pixels, slopes, errors) <= FLAT)
    offset = points[:, :2] - poses.p_nc[..., :2]
    doubtful |= linear & (arc_bend(offset, ray_heading_sd(poses, errors), covariance) > ARC)
    rest = linear & ~doubtful
    doubtful[rest] = _bent(poses.take(rest), terrain, points[rest], slopes[rest], covariance[rest])
    for i in np.flatnonzero(doubtful):
        one = PoseErrors(
            pixel=np.broadcast_to(errors.pixel, (n, 2, 2))[i],
            pose=np.broadcast_to(errors.pose, (n, 6, 6))[i],
            mount=errors.mount,
            plane=float(np.broadcast_to(errors.plane, n)[i]),
        )
        p_nc = poses.take(int(i)).p_nc
        samples = sample_terrain(poses.take(int(i)), pixels[i], terrain, one, rng, SAMPLES)
        covariance[i], method[i] = _of_samples(samples, points[i], p_nc)
    return TerrainCovariance(covariance, method)


def sample_terrain(
    pose: CameraPoses,
    uv: ArrayLike,
    terrain: Terrain,
    errors: PoseErrors,
    rng: np.random.Generator,
    n: int,
) -> Array:
    """Points on terrain of one detection with its errors drawn from their covariances.

    Parameters
    ----------
    pose
        The camera, with one pose.
    uv
        (2,) pixel.
    terrain
        In the same n; it rises or sinks as a whole.
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
    higher = np.sqrt(float(np.asarray(errors.plane))) * rng.standard_normal(n)
    # Ground that is higher is the same as a camera that is lower, but for the height of the point.
    shift = np.column_stack([np.zeros((n, 2)), higher])
    return np.asarray(intersect_terrain(terrain, rays, starts + shift).points - shift)


def _rays(poses: CameraPoses, pixels: Array) -> tuple[Array, Array, Array]:
    """Normalised pixels, and rays of depth 1 in c and in n."""
    xy = normalise(poses.camera, pixels)
    d_c = np.concatenate([xy, np.ones((len(xy), 1))], axis=-1)
    return xy, d_c, np.einsum("...ij,...j->...i", poses.R_nc, d_c)


def _normals(slopes: ArrayLike) -> Array:
    """(N, 3) normals of slopes, into the ground: ``down + height(north, east)`` grows along them."""
    given = np.atleast_2d(np.asarray(slopes, float))
    return np.concatenate([given, np.ones((len(given), 1))], axis=1)


def _check_errors(errors: PoseErrors, n: int) -> None:
    for name, axes in (("pixel", 2), ("pose", 2), ("plane", 0)):
        shape = np.shape(getattr(errors, name))
        lead = shape[: len(shape) - axes]
        if lead not in ((), (n,)):
            raise WildlabError(
                f"errors of the rows {lead} for {n} pixels", "give one for each, or one for all", field=name
            )


def _linear(jacobians: TerrainJacobians, errors: PoseErrors) -> Array:
    J_pixel, J_pose, J_mount, J_height = jacobians
    swap = np.swapaxes
    return np.asarray(
        J_pixel @ errors.pixel @ swap(J_pixel, -1, -2)
        + J_pose @ errors.pose @ swap(J_pose, -1, -2)
        + J_mount @ errors.mount @ swap(J_mount, -1, -2)
        + np.asarray(errors.plane)[..., None, None] * J_height[..., :, None] * J_height[..., None, :]
    )


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
    size = np.quantile(squared, 0.9, method="lower") / 4.605170185988092  # chi-square of 2, at 0.9
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
