"""What a plan will have seen: how often, when last, how surely, and what was seen only blurred.

A node of the terrain counts as seen where an image shows it with nothing before it, and sharply: an image is
blurred where the camera turns and moves by more than a stated number of pixels while it is exposed.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from wildlab.errors import WildlabError
from wildlab.geometry.camera_poses import CameraPoses
from wildlab.geometry.frames import Array
from wildlab.geometry.terrain import Terrain
from wildlab.planning.areas import contains
from wildlab.planning.sightings import Sightings, see


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
    longest_gap
        The longest time for which it was not seen sharply, from the first image to the last, s: all of it
        where it never was.
    detected
        Probability that something there is detected at least once, by (5.8) and (5.9) for each look. Looks
        count as independent, which those of one pass are not: what hides in one image hides in the next.
        Read it as the most that can be hoped for.
    duration
        From the first image to the last, s.
    step
        Between nodes, metres.
    """

    looks: NDArray[np.intp]
    blurred: NDArray[np.intp]
    last: Array
    longest_gap: Array
    detected: Array
    duration: float
    step: float

    @property
    def seen(self) -> NDArray[np.bool_]:
        """(R, C) bool: seen sharply at least once."""
        return np.asarray(self.looks > 0)

    @property
    def revisit_age(self) -> Array:
        """(R, C) how long ago a node was last seen when the last image was taken, s; NaN where never."""
        return np.asarray(self.duration - self.last)


class Share(NamedTuple):
    """How much of an area was seen.

    Attributes
    ----------
    seen
        Share of its nodes that were seen sharply.
    only_blurred
        Share that is in blurred images alone.
    looks
        Mean number of sharp images of a node that was seen: the redundancy of F 5.4.
    detected
        Mean probability of detection over all its nodes.
    area
        Of its nodes, square metres.
    """

    seen: float
    only_blurred: float
    looks: float
    detected: float
    area: float


def cover(
    terrain: Terrain,
    poses: CameraPoses,
    times: ArrayLike,
    *,
    furthest: float,
    sharp: ArrayLike | None = None,
    range_scale: float = np.inf,
    border: float = 0.0,
    surface: Terrain | None = None,
) -> Coverage:
    """What images show of a terrain, over all of them.

    Parameters
    ----------
    terrain
        In the same n.
    poses
        Of the images, N rows.
    times
        (N,) s, ascending.
    furthest
        Distance up to which anything is looked for, metres.
    sharp
        (N,) bool, from `wildlab.planning.gimbal.blur`; None takes all images for sharp.
    range_scale
        ``r`` of (5.9), metres: at that distance one look detects with 1/e. Infinite is a perfect sensor.
    border
        How far inside the image a node must be, pixels: the margin of a plan against errors of the pose.
    surface
        What hides, as for `see`.

    Returns
    -------
    Coverage

    Raises
    ------
    WildlabError
        As `see`; where times are not ascending, or not one for each pose.

    Examples
    --------
    >>> import numpy as np
    >>> from wildlab.geometry import Camera, CameraPoses, Mount, Terrain
    >>> camera = Camera(100, 100, 100.0, 100.0, 50.0, 50.0)
    >>> flat = Terrain(np.zeros((101, 101), np.float32), north=-100.0, east=-100.0, step=2.0)
    >>> poses = CameraPoses(camera, Mount("down"), np.array([[0, 0, -20], [10, 0, -20.0]]), np.eye(3))
    >>> shown = cover(flat, poses, [0.0, 5.0], furthest=100.0)
    >>> print(np.bincount(shown.looks.ravel())[1:])
    [110  66]
    """
    t = np.asarray(times, float)
    count = poses.rows[0] if len(poses.rows) == 1 else -1
    if t.shape != (count,) or not (np.diff(t) >= 0).all():
        raise WildlabError(
            f"times of the shape {t.shape} for {count} poses, or not in order",
            "give one ascending time for each pose",
            field="times",
        )
    clear = np.ones(len(t), bool) if sharp is None else np.asarray(sharp, bool)
    if clear.shape != t.shape:
        raise WildlabError(
            f"{clear.size} marks of sharpness for {len(t)} images", "give one each", field="sharp"
        )
    found = see(terrain, poses, furthest, surface=surface)
    found = found.take(found.edge >= border) if border > 0 else found
    return from_sightings(found, terrain, t, clear, range_scale)


def from_sightings(
    found: Sightings, terrain: Terrain, times: Array, sharp: NDArray[np.bool_], range_scale: float = np.inf
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
        As for `cover`.

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
    # Images come in order, and so do the sightings of each node once they are sorted by it.
    order = np.argsort(node, kind="stable")
    node, at = node[order], at[order]
    last, gap = np.full(nodes, np.nan), np.full(nodes, end - start)
    if len(node):
        new = np.concatenate([[True], np.diff(node) > 0])
        final = np.concatenate([new[1:], [True]])
        last[node[final]] = at[final]
        since = np.where(new, at - start, np.diff(at, prepend=at[0]))
        longest = np.maximum.reduceat(since, np.flatnonzero(new))
        gap[node[final]] = np.maximum(longest, end - at[final])
    # 1 - prod(1 - P) by sums of logarithms; P of 1 has none.
    probability = np.exp(-((distance[order] / range_scale) ** 2))
    with np.errstate(divide="ignore"):
        missed = np.bincount(node, np.log1p(-np.minimum(probability, 1.0)), minlength=nodes)
    return Coverage(
        looks.reshape(shape),
        blurred.reshape(shape),
        last.reshape(shape),
        gap.reshape(shape),
        -np.expm1(missed).reshape(shape),
        end - start,
        terrain.step,
    )


def nodes_in(terrain: Terrain, fences: list[Array]) -> NDArray[np.intp]:
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
    points = np.stack(np.meshgrid(north, east, indexing="ij"), axis=-1).reshape(-1, 2)
    owner = np.full(len(points), -1, np.intp)
    for k, fence in enumerate(fences):
        owner[(owner < 0) & contains(fence, points)] = k
    return owner.reshape(rows, columns)


def share_seen(shown: Coverage, where: NDArray[np.bool_]) -> Share:
    """How much of some nodes was seen.

    Parameters
    ----------
    shown
        From `cover`.
    where
        (R, C) bool: the nodes, as by `nodes_in`.

    Returns
    -------
    Share
        Of no nodes at all, NaN and an area of zero.
    """
    count = int(where.sum())
    if not count:
        return Share(np.nan, np.nan, np.nan, np.nan, 0.0)
    looks, seen = shown.looks[where], shown.seen[where]
    return Share(
        float(seen.mean()),
        float((~seen & (shown.blurred[where] > 0)).mean()),
        float(looks[seen].mean()) if seen.any() else np.nan,
        float(shown.detected[where].mean()),
        count * shown.step**2,
    )
