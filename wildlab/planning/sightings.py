"""Which nodes of a terrain each of many images shows: all images at once, and lines of sight exact.

`wildlab.geometry.visibility.visible_nodes` does the same for one image; a plan has thousands, and their nodes
are looked at together.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import maximum_filter, minimum_filter

from wildlab.errors import WildlabError
from wildlab.geometry.camera import Camera, in_image, normalise, project
from wildlab.geometry.camera_poses import CameraPoses
from wildlab.geometry.frames import Array
from wildlab.geometry.terrain import Terrain
from wildlab.geometry.visibility import lines_clear

#: Nodes that are looked at together; what they take is some tens of megabytes.
_TOGETHER = 250_000
#: Border rays that sink by less than this share of their length meet no ground worth the name.
_FLAT = 1e-3


class Sightings(NamedTuple):
    """Nodes that images show: one row for each node of each image, images in order.

    Attributes
    ----------
    image
        (S,) which pose.
    node
        (S,) which node, counted row by row of the terrain.
    distance
        (S,) from the camera to the node, metres.
    """

    image: NDArray[np.intp]
    node: NDArray[np.intp]
    distance: Array


def see(
    terrain: Terrain,
    poses: CameraPoses,
    furthest: float,
    *,
    border: float = 0.0,
    surface: Terrain | None = None,
) -> Sightings:
    """All nodes that images show.

    Parameters
    ----------
    terrain
        In the same n.
    poses
        Of the images, N rows.
    furthest
        Distance up to which anything is looked for, metres.
    border
        How far inside the image a node must be, pixels.
    surface
        What hides: the ground with trees on it; None takes the ground alone.

    Returns
    -------
    Sightings

    Raises
    ------
    WildlabError
        Where the furthest distance is not above zero and finite, or poses are not one row of instants.

    Examples
    --------
    >>> import numpy as np
    >>> from wildlab.geometry import Camera, CameraPoses, Mount, Terrain
    >>> camera = Camera(100, 100, 100.0, 100.0, 50.0, 50.0)
    >>> flat = Terrain(np.zeros((101, 101), np.float32), north=-100.0, east=-100.0, step=2.0)
    >>> poses = CameraPoses(camera, Mount("down"), np.array([[0, 0, -20], [30, 0, -20.0]]), np.eye(3))
    >>> print(np.bincount(see(flat, poses, 100.0).image))
    [121 121]
    """
    if not (np.isfinite(furthest) and furthest > 0):
        raise WildlabError(
            f"a furthest distance of {furthest} m",
            "say up to which distance anything is to be found, in metres above zero",
            field="furthest",
        )
    if len(poses.rows) != 1:
        raise WildlabError(f"poses with the rows {poses.rows}", "give one row of instants", field="poses")
    p, R = np.asarray(poses.p_nc, float), np.asarray(poses.R_nc, float)
    first, count = _blocks(terrain, poses.camera, p, R, furthest)
    sizes = count.prod(axis=1)
    outermost = _outermost(poses.camera)
    columns = terrain.height.shape[1]
    flat_height = terrain.height.ravel()
    found = []
    ends = np.cumsum(sizes)
    begin = 0
    while begin < len(p):
        before = ends[begin - 1] if begin else 0
        end = max(int(np.searchsorted(ends, before + _TOGETHER, side="right")), begin + 1)
        image = np.repeat(np.arange(begin, end), sizes[begin:end])
        within = np.arange(len(image)) - np.repeat(
            ends[begin:end] - sizes[begin:end] - before, sizes[begin:end]
        )
        row = first[image, 0] + within // np.maximum(count[image, 1], 1)
        column = first[image, 1] + within % np.maximum(count[image, 1], 1)
        node = row * columns + column
        points = np.stack(
            [
                terrain.north + terrain.step * row,
                terrain.east + terrain.step * column,
                -flat_height[node].astype(float),
            ],
            axis=-1,
        )
        distance = np.linalg.norm(points - p[image], axis=1)
        with np.errstate(invalid="ignore"):
            kept = np.flatnonzero(distance <= furthest)
        kept = kept[_in_view(poses.camera, points[kept], p[image[kept]], R[image[kept]], outermost, border)]
        kept = kept[lines_clear(surface or terrain, points[kept], p[image[kept]])] if len(kept) else kept
        found.append((image[kept], node[kept], distance[kept]))
        begin = end
    if not found:
        return Sightings(np.zeros(0, np.intp), np.zeros(0, np.intp), np.zeros(0))
    return Sightings(*(np.concatenate([part[k] for part in found]) for k in range(3)))


def _in_view(
    camera: Camera, points: Array, p: Array, R: Array, outermost: float, border: float
) -> NDArray[np.bool_]:
    offset = points - p
    seen = R[:, 0] * offset[:, :1] + R[:, 1] * offset[:, 1:2] + R[:, 2] * offset[:, 2:]
    with np.errstate(invalid="ignore"):
        # Far outside the image a lens's polynomial may fold back into it.
        ahead = (seen[:, 2] > 0) & (np.hypot(seen[:, 0], seen[:, 1]) <= outermost * seen[:, 2])
    ahead[ahead] = in_image(camera, project(camera, seen[ahead]), border)
    return np.asarray(ahead)


def _border(camera: Camera) -> Array:
    along = np.linspace(0.0, 1.0, 9)
    sides = [(along, 0 * along), (along, 0 * along + 1), (0 * along, along), (0 * along + 1, along)]
    return np.concatenate([np.stack([u * camera.width, v * camera.height], axis=1) for u, v in sides])


def _outermost(camera: Camera) -> float:
    """How far from the axis the image shows anything, as the tangent of an angle."""
    u, v = np.meshgrid(np.linspace(0, camera.width, 33), np.linspace(0, camera.height, 33))
    seen = np.hypot(*normalise(camera, np.stack([u.ravel(), v.ravel()], axis=-1)).T)
    return float(np.nanmax(seen)) * 1.001


def _blocks(
    terrain: Terrain, camera: Camera, p: Array, R: Array, furthest: float
) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """First row and column, and how many of each, of nodes that an image may show. (N, 2) each.

    What it shows lies within the hull of where its border's rays come to the lowest and to the highest
    ground within the furthest distance; and within that distance, where a ray does not sink.
    """
    low, high = _bounds(terrain, p, furthest)
    directions = normalise(camera, _border(camera))
    directions = directions[np.isfinite(directions).all(axis=1)]
    # A little more than the border: between two rays a distorted border bulges.
    rays = np.concatenate([1.02 * directions, np.ones((len(directions), 1))], axis=1)
    rays = np.einsum("nij,kj->nki", R, rays)
    rays /= np.linalg.norm(rays, axis=-1, keepdims=True)
    sinks = (rays[..., 2] > _FLAT).all(axis=1)
    reach = np.stack([p[:, :2] - furthest, p[:, :2] + furthest])
    with np.errstate(divide="ignore", invalid="ignore"):
        slopes = rays[..., :2] / rays[..., 2:]
        ends = np.concatenate(
            [
                p[:, None, :2] + np.maximum(-p[:, 2] - level, 0.0)[:, None, None] * slopes
                for level in (high, low)
            ],
            axis=1,
        )
    reach[0, sinks] = np.maximum(reach[0, sinks], ends[sinks].min(axis=1))
    reach[1, sinks] = np.minimum(reach[1, sinks], ends[sinks].max(axis=1))
    corner = np.array([terrain.north, terrain.east])
    shape = np.array(terrain.height.shape)
    reach = np.nan_to_num(reach, nan=-1e9)
    first = np.clip(np.floor((reach[0] - corner) / terrain.step), 0, shape).astype(np.intp)
    last = np.clip(np.ceil((reach[1] - corner) / terrain.step) + 1, 0, shape).astype(np.intp)
    count = np.maximum(last - first, 0)
    # A block without rows has no nodes, whatever its columns say.
    count[(count == 0).any(axis=1)] = 0
    return first, count


def _bounds(terrain: Terrain, p: Array, furthest: float) -> tuple[Array, Array]:
    """Lowest and highest ground within the furthest distance of each camera, metres. (N,) each."""
    rows, columns = terrain.height.shape
    known = np.isfinite(terrain.height)
    half = int(np.ceil(furthest / terrain.step)) + 1
    size = (min(2 * half + 1, 2 * rows + 1), min(2 * half + 1, 2 * columns + 1))
    low = minimum_filter(np.where(known, terrain.height, np.inf), size, mode="nearest")
    high = maximum_filter(np.where(known, terrain.height, -np.inf), size, mode="nearest")
    at = (p[:, :2] - (terrain.north, terrain.east)) / terrain.step
    outside = ~((at >= 0) & (at <= (rows - 1, columns - 1))).all(axis=1)
    i, j = np.clip(np.nan_to_num(np.rint(at)), 0, (rows - 1, columns - 1)).astype(np.intp).T
    least, most = float(terrain.height[known].min()), float(terrain.height[known].max())
    # Cameras off the map see what no window about a node bounds.
    return (
        np.where(outside | ~np.isfinite(low[i, j]), least, low[i, j]),
        np.where(outside | ~np.isfinite(high[i, j]), most, high[i, j]),
    )
