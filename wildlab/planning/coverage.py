"""What images show of a terrain: which nodes, how often, when last and how surely; and animals that walk
meanwhile.

A node counts as seen where an image shows it with nothing before it, and sharply: an image is blurred where
the camera turns and moves by more than a stated number of pixels while it is exposed. All images are looked
at at once, and lines of sight are exact.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike
from scipy.ndimage import maximum_filter, minimum_filter

from wildlab.geometry.camera import Camera, normalise
from wildlab.geometry.camera_poses import CameraPoses
from wildlab.geometry.compilation import compiled
from wildlab.geometry.frames import Array, Indices, Mask
from wildlab.geometry.georeference import Terrain
from wildlab.geometry.viewsheds import image_border, lines_clear, widest_view
from wildlab.planning.patterns import check_area, contains, grid_points


class Coverage(NamedTuple):
    """What images showed of a terrain, each (R, C) like its heights.

    Attributes
    ----------
    looks
        In how many sharp images a node is.
    blurred
        In how many blurred ones.
    last
        When it was last seen sharply, s; NaN where never.
    detected
        Probability that something there is detected at least once, by (5.8) and (5.9) for each look. Looks
        count as independent, which those of one pass are not: what hides in one image hides in the next.
        Read it as the most that can be hoped for.
    duration
        From the first image to the last, s.
    step
        Between nodes, metres.
    """

    looks: Indices
    blurred: Indices
    last: Array
    detected: Array
    duration: float
    step: float

    @property
    def seen(self) -> Mask:
        """(R, C) bool: seen sharply at least once."""
        return np.asarray(self.looks > 0)

    @property
    def revisit_age(self) -> Array:
        """(R, C) how long ago a node was last seen when the last image was taken, s; NaN where never."""
        return np.asarray(self.duration - self.last)


def from_sightings(
    found: Sightings, terrain: Terrain, times: Array, sharp: Mask, range_scale: float = np.inf
) -> Coverage:
    """Coverage by sightings that are known already.

    Parameters
    ----------
    found
        From `see`.
    terrain
        Of which it tells.
    times
        (N,) s of the images.
    sharp
        (N,) bool.
    range_scale
        ``r`` of (5.9), metres: at that distance one look detects with 1/e. Infinite is a perfect sensor.

    Returns
    -------
    Coverage
    """
    shape, nodes = terrain.height.shape, terrain.height.size
    clear = sharp[found.image]
    node, at, distance = found.node[clear], times[found.image[clear]], found.distance[clear]
    looks = np.bincount(node, minlength=nodes)
    blurred = np.bincount(found.node[~clear], minlength=nodes)
    start, end = (float(times[0]), float(times[-1])) if len(times) else (0.0, 0.0)
    last = np.full(nodes, np.nan)
    np.fmax.at(last, node, at)
    # 1 - prod(1 - P) by sums of logarithms; P of 1 has none.
    probability = np.exp(-((distance / range_scale) ** 2))
    with np.errstate(divide="ignore"):
        missed = np.bincount(node, np.log1p(-np.minimum(probability, 1.0)), minlength=nodes)
    return Coverage(
        looks.reshape(shape),
        blurred.reshape(shape),
        last.reshape(shape),
        -np.expm1(missed).reshape(shape),
        end - start,
        terrain.step,
    )


def nodes_in(terrain: Terrain, fences: list[Array]) -> Indices:
    """Which area each node of a terrain lies in.

    Parameters
    ----------
    terrain
        In the same n.
    fences
        Polygons (K, 2), metres; where two share a node, the first has it.

    Returns
    -------
    (R, C) number of the area, -1 outside of all.
    """
    rows, columns = terrain.height.shape
    north = terrain.north + terrain.step * np.arange(rows)
    east = terrain.east + terrain.step * np.arange(columns)
    points = grid_points(north, east)
    owner = np.full(len(points), -1, np.intp)
    for k, fence in enumerate(fences):
        owner[(owner < 0) & contains(fence, points)] = k
    return owner.reshape(rows, columns)


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
    """

    image: Indices
    node: Indices
    distance: Array

    def take(self, which: Mask) -> Sightings:
        """Some of them, by (S,) bool."""
        return Sightings(self.image[which], self.node[which], self.distance[which])


def see(
    terrain: Terrain,
    poses: CameraPoses,
    furthest: float,
    *,
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
    hidden
        Whether the ground hides anything; else all that is in the image is seen.

    Returns
    -------
    Sightings

    Examples
    --------
    >>> import numpy as np
    >>> from wildlab.geometry.camera import Camera
    >>> from wildlab.geometry.camera_poses import CameraPoses
    >>> from wildlab.geometry.camera_poses import Mount
    >>> from wildlab.geometry.georeference import Terrain
    >>> camera = Camera(100, 100, 100.0, 100.0, 50.0, 50.0)
    >>> flat = Terrain(np.zeros((101, 101), np.float32), north=-100.0, east=-100.0, step=2.0)
    >>> poses = CameraPoses(camera, Mount("down"), np.array([[0, 0, -20], [30, 0, -20.0]]), np.eye(3))
    >>> print(np.bincount(see(flat, poses, 100.0).image))
    [121 121]
    """
    p, R = np.asarray(poses.p_nc, float), np.asarray(poses.R_nc, float)
    first, count = _blocks(terrain, poses.camera, p, R, furthest)
    # Compiled functions are imported where they are called: a compiler takes its time to be imported.

    camera = poses.camera
    lens = np.array(
        [
            *(camera.width, camera.height, camera.fx, camera.fy, camera.cx, camera.cy, camera.skew),
            *(*camera.distortion, widest_view(camera) * (1 + 1e-9)),
        ],
        float,
    )
    grid = np.array([terrain.north, terrain.east, terrain.step])
    image, node, distance, points = in_images(
        terrain.height, grid, lens, first, count, p.copy(), R.copy(), furthest
    )
    found = Sightings(image, node, distance)
    if not hidden or not len(node):
        return found
    clear = [
        lines_clear(terrain, points[begin : begin + _TOGETHER], p[image[begin : begin + _TOGETHER]])
        for begin in range(0, len(node), _TOGETHER)
    ]
    return found.take(np.concatenate(clear))


def _blocks(terrain: Terrain, camera: Camera, p: Array, R: Array, furthest: float) -> tuple[Indices, Indices]:
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


def walks(
    fence: ArrayLike,
    times: ArrayLike,
    count: int,
    speed_sd: float,
    step: float,
    rng: np.random.Generator,
) -> Array:
    """Random walks within an area, F (4.5) with the noise of (4.8): a new velocity every step.

    Parameters
    ----------
    fence
        (K, 2) metres. An animal whose step would lead out of it stays where it is.
    times
        (N,) s from 0, ascending.
    count
        Of animals; each starts anywhere in the area with equal chance.
    speed_sd
        Standard deviation of each component of the velocity, m/s.
    step
        How long an animal keeps to a velocity, s.
    rng
        Random numbers.

    Returns
    -------
    (count, N, 2) metres, linear between steps.

    Raises
    ------
    WildlabError
        As `check_area`.
    """
    corners = check_area(fence, "fence")
    t = np.asarray(times, float)
    here = _anywhere(corners, count, rng)
    steps = int(np.ceil(float(t.max(initial=0.0)) / step)) + 1
    way = np.empty((steps + 1, count, 2))
    way[0] = here
    for k in range(steps):
        there = here + step * speed_sd * rng.standard_normal((count, 2))
        here = np.where(contains(corners, there)[:, None], there, here)
        way[k + 1] = here
    at = t / step
    before = np.minimum(at.astype(np.intp), steps - 1)
    part = (at - before)[:, None, None]
    return np.asarray(np.swapaxes(way[before] * (1 - part) + way[before + 1] * part, 0, 1))


def first_seen(found: Sightings, terrain: Terrain, times: ArrayLike, sharp: Mask, ways: ArrayLike) -> Array:
    """When each animal was first in a sharp image that shows the node nearest to it.

    Parameters
    ----------
    found
        Sightings of nodes, from `see`.
    terrain
        Of which they tell; its step is how precisely "in the image" is known.
    times
        (N,) s of the images.
    sharp
        (N,) bool.
    ways
        (A, N, 2) where the animals are at these times, metres, from `walks`.

    Returns
    -------
    (A,) s; NaN of those that were never seen.
    """
    t, where = np.asarray(times, float), np.asarray(ways, float)
    rows, columns = terrain.height.shape
    i = np.rint((where[..., 0] - terrain.north) / terrain.step).astype(np.int64)
    j = np.rint((where[..., 1] - terrain.east) / terrain.step).astype(np.int64)
    on = (i >= 0) & (i < rows) & (j >= 0) & (j < columns)
    size = np.int64(rows * columns)
    # Image and node as one number: those that are shown are few beside all there could be.
    shown = np.sort(found.image.astype(np.int64) * size + found.node)
    asked = np.where(on, np.arange(len(t)) * size + i * columns + j, -1)
    place = np.minimum(np.searchsorted(shown, asked), max(len(shown) - 1, 0))
    hit = (shown[place] == asked) & sharp if len(shown) else np.zeros(asked.shape, bool)
    return np.where(hit.any(axis=1), t[hit.argmax(axis=1)], np.nan)


def _anywhere(corners: Array, count: int, rng: np.random.Generator) -> Array:
    low, high = corners.min(axis=0), corners.max(axis=0)
    found = np.zeros((0, 2))
    while len(found) < count:
        tried = rng.uniform(low, high, (2 * count + 10, 2))
        found = np.concatenate([found, tried[contains(corners, tried)]])
    return found[:count]


@compiled
def edge_of(lens: Any, x: float, y: float, z: float) -> float:
    """How far a point of c is inside the image, pixels; negative outside of it.

    ``lens`` holds width, height, fx, fy, cx, cy, skew, k1, k2, p1, p2, k3 and the tangent of the outermost
    angle that the image shows: far outside the image a lens's polynomial may fold back into it.
    """
    if not z > 0:
        return -1.0
    a, b = x / z, y / z
    r2 = a * a + b * b
    if not r2 <= lens[12] * lens[12]:
        return -1.0
    radial = 1 + r2 * (lens[7] + r2 * (lens[8] + r2 * lens[11]))
    p = a * radial + 2 * lens[9] * a * b + lens[10] * (r2 + 2 * a * a)
    q = b * radial + lens[9] * (r2 + 2 * b * b) + 2 * lens[10] * a * b
    u, v = lens[2] * p + lens[6] * q + lens[4], lens[3] * q + lens[5]
    return float(min(u, lens[0] - u, v, lens[1] - v))


@compiled
def in_images(
    height: Any, grid: Any, lens: Any, first: Any, count: Any, p: Any, R: Any, furthest: float
) -> Any:
    """Nodes within each image's block that are in the image and not too far.

    ``grid`` is north and east of the first node, and the step. Image, node, distance, points (S, 3).
    """
    room = 1024
    image, node = np.empty(room, np.int64), np.empty(room, np.int64)
    distance, points = np.empty(room), np.empty((room, 3))
    n = 0
    columns = height.shape[1]
    for k in range(len(p)):
        for i in range(first[k, 0], first[k, 0] + count[k, 0]):
            for j in range(first[k, 1], first[k, 1] + count[k, 1]):
                north, east = grid[0] + grid[2] * i, grid[1] + grid[2] * j
                down = -np.float64(height[i, j])
                dx, dy, dz = north - p[k, 0], east - p[k, 1], down - p[k, 2]
                far = np.sqrt(dx * dx + dy * dy + dz * dz)
                if not far <= furthest:
                    continue
                inside = edge_of(
                    lens,
                    R[k, 0, 0] * dx + R[k, 1, 0] * dy + R[k, 2, 0] * dz,
                    R[k, 0, 1] * dx + R[k, 1, 1] * dy + R[k, 2, 1] * dz,
                    R[k, 0, 2] * dx + R[k, 1, 2] * dy + R[k, 2, 2] * dz,
                )
                if not inside >= 0:
                    continue
                if n == room:
                    room *= 2
                    image, node = grown(image, room), grown(node, room)
                    distance = grown(distance, room)
                    more = np.empty((room, 3))
                    more[:n] = points
                    points = more
                image[n], node[n], distance[n] = k, i * columns + j, far
                points[n, 0], points[n, 1], points[n, 2] = north, east, down
                n += 1
    return image[:n], node[:n], distance[:n], points[:n]


@compiled
def grown(values: Any, room: int) -> Any:
    """The same with more room at its end."""
    more = np.empty(room, values.dtype)
    more[: len(values)] = values
    return more
