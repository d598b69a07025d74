"""What a flight has seen of a terrain, what hides a point, and how large a pixel is on sloping ground."""

from __future__ import annotations

from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from wildlab.errors import WildlabError
from wildlab.geometry.camera import normalise, normalise_jacobian
from wildlab.geometry.camera_poses import CameraPoses
from wildlab.geometry.frames import Array, wrap
from wildlab.geometry.georeference import matching, pixel_rays
from wildlab.geometry.ray_ends import HIT
from wildlab.geometry.terrain import Terrain, intersect_terrain, pixels_to_terrain
from wildlab.geometry.visibility import lines_clear, visible_nodes


class Viewshed(NamedTuple):
    """How often each node of a terrain was seen.

    Attributes
    ----------
    counts
        (R, C) int32, of how many images; 0 where the height is not known.
    known
        (R, C) bool, whether the node has a height.
    """

    counts: NDArray[np.int32]
    known: NDArray[np.bool_]

    @property
    def share(self) -> float:
        """Share of the known nodes that were seen at all."""
        return float((self.counts > 0).sum() / self.known.sum())


def viewshed(terrain: Terrain, poses: CameraPoses, above: float = 0.0, furthest: float = np.inf) -> Viewshed:
    """How many images show each node of a terrain.

    Parameters
    ----------
    terrain
        In the same n.
    poses
        Of the camera, one for each image; an image whose pose is not known shows nothing.
    above
        How far above the ground what is looked for stands, metres.
    furthest
        Distance up to which it can be seen, metres.

    Returns
    -------
    Viewshed

    Examples
    --------
    Two images of even ground, 20 m apart, of 20 m by 20 m each:

    >>> from wildlab.geometry import Camera, Mount
    >>> camera = Camera(100, 100, 100.0, 100.0, 50.0, 50.0)
    >>> flat = Terrain(np.zeros((101, 101), np.float32), north=-100.0, east=-100.0, step=2.0)
    >>> where = np.array([[0.0, 0.0, -20.0], [10.0, 0.0, -20.0]])
    >>> seen = viewshed(flat, CameraPoses(camera, Mount("down"), where, np.eye(3)))
    >>> int(seen.counts.max()), int((seen.counts > 0).sum())
    (2, 176)
    """
    counts = np.zeros(terrain.height.shape, np.int32)
    rows = poses.rows[0] if poses.rows else 1
    for row in range(rows):
        pose = poses.take(row)
        if np.isfinite(pose.p_nc).all() and np.isfinite(pose.R_nc).all():
            seen = visible_nodes(terrain, pose, above, furthest)
            counts[seen.rows, seen.columns] += seen.visible
    return Viewshed(counts, np.isfinite(terrain.height))


class Hidden(NamedTuple):
    """What stands between a camera and points.

    Attributes
    ----------
    clear
        (N,) bool, whether the camera sees the point.
    by
        (N, 3) metres in n, where a line from the camera first meets the ground before the point; NaN of
        clear ones, and where the map knows nothing.
    """

    clear: NDArray[np.bool_]
    by: Array


def hidden_by(terrain: Terrain, points: ArrayLike, p_nc: ArrayLike) -> Hidden:
    """Whether points are occluded, and by what.

    Parameters
    ----------
    terrain
        In the same n.
    points
        (N, 3) metres in n, on the ground or above it.
    p_nc
        Where the camera is, (3,) or (N, 3) metres.

    Returns
    -------
    Hidden

    Examples
    --------
    >>> height = np.zeros((3, 5), np.float32)
    >>> height[:, 2] = 10.0
    >>> wall = Terrain(height, north=-1.0, east=0.0, step=1.0)
    >>> print(np.round(hidden_by(wall, [[0.0, 4.0, 0.0]], [0.0, 0.0, -5.0]).by, 2))
    [[ 0.    1.33 -3.33]]
    """
    targets, starts = np.atleast_2d(np.asarray(points, float)), np.asarray(p_nc, float)
    clear = lines_clear(terrain, targets, starts)
    by = np.full(targets.shape, np.nan)
    some = ~clear
    if some.any():
        begins = np.broadcast_to(starts, targets.shape)[some]
        by[some] = intersect_terrain(terrain, targets[some] - begins, begins, furthest=1.0).points
    return Hidden(clear, by)


def ground_per_pixel(poses: CameraPoses, uv: ArrayLike, terrain: Terrain) -> Array:
    """How much ground one pixel covers, along the slope of the ground.

    Parameters
    ----------
    poses
        The camera, with a pose for each pixel or one for all.
    uv
        (N, 2) pixels.
    terrain
        In the same n.

    Returns
    -------
    (N, 2) metres for a pixel to the right, and for one down; NaN where the ray does not meet the ground.

    Examples
    --------
    >>> from wildlab.geometry import Camera, Mount
    >>> camera = Camera(640, 512, 1000.0, 1000.0, 320.0, 256.0)
    >>> flat = Terrain(np.zeros((3, 3), np.float32), north=-500.0, east=-500.0, step=500.0)
    >>> pose = CameraPoses(camera, Mount("down"), np.array([0.0, 0.0, -100.0]), np.eye(3))
    >>> print(ground_per_pixel(pose, [[320.0, 256.0]], flat))
    [[0.1 0.1]]
    """
    pixels, _ = matching(poses, np.atleast_2d(np.asarray(uv, float)))
    ends = pixels_to_terrain(poses, pixels, terrain).points
    R = np.broadcast_to(poses.R_nc, (len(pixels), 3, 3))
    xy = normalise(poses.camera, pixels)
    rays = pixel_rays(poses.camera, pixels, R)
    # How the ray turns with the pixel, and the normal of the ground where it ends.
    turns = R[:, :, :2] @ normalise_jacobian(poses.camera, xy)
    normal = np.concatenate([terrain.slopes_at(ends[:, :2]), np.ones((len(ends), 1))], axis=1)
    with np.errstate(invalid="ignore", divide="ignore"):
        length = ((ends - poses.p_nc) * rays).sum(axis=1) / (rays * rays).sum(axis=1)
        across = np.einsum("ni,nik->nk", normal, turns) / (normal * rays).sum(axis=1)[:, None]
        moves = length[:, None, None] * (turns - rays[:, :, None] * across[:, None, :])
    return np.asarray(np.linalg.norm(moves, axis=1))


class Footprint(NamedTuple):
    """The outline of what one image shows of the ground.

    Attributes
    ----------
    points
        (K, 2) metres north and east, in order about the image, not closed; NaN where a ray of the border
        ends nowhere and nothing is cut.
    became
        (K,) what became of the ray, a key of `RAY_STATUS`.
    cut
        (K,) bool, whether the point stands on the circle of the furthest distance, in place of a ray that
        comes no nearer.
    """

    points: Array
    became: NDArray[np.int8]
    cut: NDArray[np.bool_]


def footprint(
    terrain: Terrain, poses: CameraPoses, per_side: int = 16, furthest: float = np.inf
) -> Footprint:
    """The outline on the ground of one image: where the rays of its border meet the terrain.

    Safe at the horizon: a ray that does not come to the ground within the furthest distance has no point of
    its own. Runs of such rays are cut along the circle of that distance about the camera.

    Parameters
    ----------
    terrain
        In the same n.
    poses
        The camera, with one pose.
    per_side
        Rays along each side of the image.
    furthest
        Over the ground, metres; without one, nothing is cut.

    Returns
    -------
    Footprint
        What hides ground inside the outline is not cut out: `visible_nodes` does that.

    Raises
    ------
    WildlabError
        Where there is more than one pose, or no ray for a side.

    Examples
    --------
    >>> from wildlab.geometry import Camera, Mount
    >>> camera = Camera(100, 100, 100.0, 100.0, 50.0, 50.0)
    >>> flat = Terrain(np.zeros((101, 101), np.float32), north=-100.0, east=-100.0, step=2.0)
    >>> pose = CameraPoses(camera, Mount("down"), np.array([0.0, 0.0, -20.0]), np.eye(3))
    >>> print(footprint(flat, pose, per_side=1).points)
    [[ 10. -10.]
     [ 10.  10.]
     [-10.  10.]
     [-10. -10.]]
    """
    p, R = np.asarray(poses.p_nc, float), np.asarray(poses.R_nc, float)
    if p.size != 3 or R.size != 9:
        raise WildlabError(f"positions of the shape {p.shape}", "give one pose", field="poses")
    if per_side < 1:
        raise WildlabError(f"{per_side} rays along a side", "give one at least", field="per_side")
    p, R = p.reshape(3), R.reshape(3, 3)
    met = intersect_terrain(terrain, pixel_rays(poses.camera, _outline(poses, per_side), R), p)
    points = met.points[:, :2].copy()
    with np.errstate(invalid="ignore"):
        near = (met.became == HIT) & (np.hypot(*(points - p[:2]).T) <= furthest)
    if not np.isfinite(furthest):
        return Footprint(points, met.became, np.zeros(len(points), bool))
    points[~near] = np.nan
    if near.any():
        points[~near] = _on_circle(points, near, p[:2], furthest)
    return Footprint(points, met.became, ~near & near.any())


def _outline(poses: CameraPoses, per_side: int) -> Array:
    """(4 K, 2) pixels about the border of the image, from the upper left clockwise."""
    along, zero = np.arange(per_side) / per_side, np.zeros(per_side)
    sides = [(along, zero), (zero + 1, along), (1 - along, zero + 1), (zero, 1 - along)]
    size = (poses.camera.width, poses.camera.height)
    return np.concatenate([np.stack(side, axis=1) for side in sides]) * size


def _on_circle(points: Array, near: NDArray[np.bool_], middle: Array, furthest: float) -> Array:
    """Points of a circle in place of those not near, evenly between the near ones beside each run."""
    count, found = len(points), np.full(points.shape, np.nan)
    bearing = np.arctan2(points[:, 1] - middle[1], points[:, 0] - middle[0])
    first = int(np.flatnonzero(near)[0])
    order = (first + np.arange(count + 1)) % count  # begins and ends with a near one
    stops = np.flatnonzero(near[order])
    for a, b in pairwise(stops):
        turn = float(wrap(bearing[order[b]] - bearing[order[a]]))
        for k in range(a + 1, b):
            angle = bearing[order[a]] + turn * (k - a) / (b - a)
            found[order[k]] = middle + furthest * np.array([np.cos(angle), np.sin(angle)])
    return found[~near]
