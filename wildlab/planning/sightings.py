"""Which nodes of a terrain each of many images shows: all images at once, and lines of sight exact.

`wildlab.geometry.viewsheds.visible_nodes` does the same for one image; a plan has thousands, and their nodes
are looked at together.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import maximum_filter, minimum_filter

from wildlab.errors import WildlabError
from wildlab.geometry.camera import Camera, normalise
from wildlab.geometry.camera_poses import CameraPoses
from wildlab.geometry.frames import Array
from wildlab.geometry.terrain import Terrain
from wildlab.geometry.viewsheds import image_border, lines_clear, widest_view

#: Lines of sight that are looked at together; what they take is some tens of megabytes.
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
    edge
        (S,) how far it is from the nearest edge of the image, pixels.
    """

    image: NDArray[np.intp]
    node: NDArray[np.intp]
    distance: Array
    edge: Array

    def take(self, which: NDArray[np.bool_]) -> Sightings:
        """Some of them, by (S,) bool."""
        return Sightings(self.image[which], self.node[which], self.distance[which], self.edge[which])


def see(
    terrain: Terrain,
    poses: CameraPoses,
    furthest: float,
    *,
    surface: Terrain | None = None,
    hidden: bool = True,
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
    surface
        What hides: the ground with trees on it; None takes the ground alone.
    hidden
        Whether anything hides; else all that is in the image is seen.

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
    # Compiled functions are imported where they are called: a compiler takes its time to be imported.
    from wildlab.geometry.compilation import announced
    from wildlab.planning.view_kernels import in_images

    camera = poses.camera
    lens = np.array(
        [
            *(camera.width, camera.height, camera.fx, camera.fy, camera.cx, camera.cy, camera.skew),
            *(*camera.distortion, widest_view(camera) * (1 + 1e-9)),
        ],
        float,
    )
    grid = np.array([terrain.north, terrain.east, terrain.step])
    with announced("the view over terrain"):
        image, node, distance, edge, points = in_images(
            terrain.height, grid, lens, first, count, p.copy(), R.copy(), furthest
        )
    found = Sightings(image, node, distance, edge)
    if not hidden or not len(node):
        return found
    clear = [
        lines_clear(
            surface or terrain, points[begin : begin + _TOGETHER], p[image[begin : begin + _TOGETHER]]
        )
        for begin in range(0, len(node), _TOGETHER)
    ]
    return found.take(np.concatenate(clear))


def _blocks(
    terrain: Terrain, camera: Camera, p: Array, R: Array, furthest: float
) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """First row and column, and how many of each, of nodes that an image may show. (N, 2) each.

    What it shows lies within the hull of where its border's rays come to the lowest and to the highest
    ground within the furthest distance; and within that distance, where a ray does not sink.
    """
    directions = normalise(camera, image_border(camera))
    directions = directions[np.isfinite(directions).all(axis=1)]
    # A little more than the border: between two rays a distorted border bulges.
    rays = np.concatenate([1.02 * directions, np.ones((len(directions), 1))], axis=1)
    rays = np.einsum("nij,kj->nki", R, rays)
    rays /= np.linalg.norm(rays, axis=-1, keepdims=True)
    sinks = (rays[..., 2] > _FLAT).all(axis=1)
    with np.errstate(divide="ignore", invalid="ignore"):
        slopes = rays[..., :2] / rays[..., 2:]
    window = np.full(len(p), furthest)
    # The ground about a camera bounds how far it sees, and so which ground about it there is to look at.
    for _ in range(2):
        low, high = _bounds(terrain, p, window)
        reach = np.stack([p[:, :2] - furthest, p[:, :2] + furthest])
        drops = [np.maximum(-p[:, 2] - level, 0.0)[:, None, None] for level in (high, low)]
        with np.errstate(invalid="ignore"):
            ends = np.concatenate([p[:, None, :2] + drop * slopes for drop in drops], axis=1)
        reach[0, sinks] = np.maximum(reach[0, sinks], ends[sinks].min(axis=1))
        reach[1, sinks] = np.minimum(reach[1, sinks], ends[sinks].max(axis=1))
        furthest_corner = np.abs(reach - p[:, :2]).max(axis=(0, 2))
        # A few sizes of window are enough.
        with np.errstate(divide="ignore"):
            window = np.minimum(furthest, furthest * 2.0 ** np.ceil(np.log2(furthest_corner / furthest)))
    corner = np.array([terrain.north, terrain.east])
    shape = np.array(terrain.height.shape)
    reach = np.nan_to_num(reach, nan=-1e9)
    first = np.clip(np.floor((reach[0] - corner) / terrain.step), 0, shape).astype(np.intp)
    last = np.clip(np.ceil((reach[1] - corner) / terrain.step) + 1, 0, shape).astype(np.intp)
    count = np.maximum(last - first, 0)
    # A block without rows has no nodes, whatever its columns say.
    count[(count == 0).any(axis=1)] = 0
    return first, count


def _bounds(terrain: Terrain, p: Array, window: Array) -> tuple[Array, Array]:
    """Lowest and highest ground within so many metres, (N,), of each camera, metres. (N,) each."""
    rows, columns = terrain.height.shape
    known = np.isfinite(terrain.height)
    at = (p[:, :2] - (terrain.north, terrain.east)) / terrain.step
    outside = ~((at >= 0) & (at <= (rows - 1, columns - 1))).all(axis=1)
    i, j = np.clip(np.nan_to_num(np.rint(at)), 0, (rows - 1, columns - 1)).astype(np.intp).T
    low, high = np.full(len(p), np.inf), np.full(len(p), -np.inf)
    for one in np.unique(window[~outside]):
        half = int(np.ceil(one / terrain.step)) + 1
        size = (min(2 * half + 1, 2 * rows + 1), min(2 * half + 1, 2 * columns + 1))
        which = (window == one) & ~outside
        for bound, limit, of in ((low, np.inf, minimum_filter), (high, -np.inf, maximum_filter)):
            bound[which] = of(np.where(known, terrain.height, limit), size, mode="nearest")[
                i[which], j[which]
            ]
    # Cameras off the map see what no window about a node bounds.
    least, most = float(terrain.height[known].min()), float(terrain.height[known].max())
    return np.where(np.isfinite(low), low, least), np.where(np.isfinite(high), high, most)
