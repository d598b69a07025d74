"""What a camera, and a flight, sees of a terrain: what is in the image, and not hidden by the ground."""

from __future__ import annotations

from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from wildlab.errors import WildlabError
from wildlab.geometry.camera import Camera, distort, normalise
from wildlab.geometry.camera_poses import CameraPoses
from wildlab.geometry.frames import Array, wrap
from wildlab.geometry.georeference import HIT, pixel_rays
from wildlab.geometry.terrain import Terrain, _to_grid, intersect_terrain

#: A line of sight ends this share of its length before the point: the point lies on the ground itself.
SHORT_OF = 1e-7
#: Along each side of the image, rays that bound the footprint.
BORDER_RAYS = 9


def lines_clear(terrain: Terrain, points: ArrayLike, p_nc: ArrayLike) -> NDArray[np.bool_]:
    """Whether nothing known lies between a camera and points: exact on bilinear patches.

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
    (N,) bool. False too where the line leads through what the map does not know, below its highest height,
    where the camera is below the ground, and for what is NaN.

    Raises
    ------
    WildlabError
        Where there are neither as many cameras as points, nor one.

    Examples
    --------
    A wall of 10 m between a camera and a point; a second point is higher.

    >>> import numpy as np
    >>> height = np.zeros((3, 5), np.float32)
    >>> height[:, 2] = 10.0
    >>> wall = Terrain(height, north=-1.0, east=0.0, step=1.0)
    >>> print(lines_clear(wall, [[0.0, 4.0, 0.0], [0.0, 4.0, -20.0]], [0.0, 0.0, -5.0]))
    [False  True]
    """
    targets, starts = (np.atleast_2d(np.asarray(each, float)) for each in (points, p_nc))
    if targets.shape[-1] != 3 or starts.shape[-1] != 3 or len(starts) not in (1, len(targets)):
        raise WildlabError(
            f"cameras of the shape {starts.shape} for points of the shape {targets.shape}",
            "give one camera for each point, or one for all, three columns each",
            field="p_nc",
        )
    # Compiled functions are imported where they are called: a compiler takes its time to be imported.
    from wildlab.geometry.compilation import announced
    from wildlab.geometry.terrain_kernels import clear_all

    blocks, shapes = terrain._blocks
    lenses, ends = (_to_grid(terrain, each, whole=True) for each in (starts, targets))
    with announced("lines of sight"):
        return np.asarray(clear_all(terrain.height, blocks, shapes, lenses, ends, SHORT_OF, terrain._top))


def widest_view(camera: Camera) -> float:
    """How far from the axis an image shows anything.

    Parameters
    ----------
    camera
        Its lens may fold back: what lies further out than this is not shown, whatever its polynomial says.

    Returns
    -------
    float
        The tangent of the angle from the axis.
    """
    border = np.hypot(*normalise(camera, image_border(camera)).T)
    if np.isfinite(border).all():
        return float(border.max())
    # No ray comes to the corners: the image ends where a longer way from the axis comes no further out.
    r = np.linspace(0.0, 4.0, 4001)
    grows = np.diff(distort(np.stack([r, 0 * r], axis=1), camera.distortion)[:, 0]) > 0
    return float(r[-1] if grows.all() else r[int(np.argmin(grows))])


def image_border(camera: Camera) -> Array:
    """Pixels along the border of the image, its corners among them.

    Parameters
    ----------
    camera
        Of which the size counts.

    Returns
    -------
    (4 K, 2) px
    """
    along = np.linspace(0.0, 1.0, BORDER_RAYS)
    right, down = camera.width, camera.height
    zero, one = np.zeros(BORDER_RAYS), np.ones(BORDER_RAYS)
    sides = [(along, zero), (along, one), (zero, along), (one, along)]
    return np.concatenate([np.stack([u * right, v * down], axis=1) for u, v in sides])


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
        What hides ground inside the outline is not cut out.

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
