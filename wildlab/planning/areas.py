"""Areas on the ground: polygons of north and east, checked before anything is planned on them."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import ArrayLike

from wildlab.errors import WildlabError
from wildlab.geometry.frames import Array, Mask

#: Corners nearer to one another than this are one corner, metres; and what counts as on a border.
SAME = 1e-6
#: Up to so many pairs of points and edges are looked at all at once.
TOGETHER = 20_000
#: Areas below this cannot be searched, square metres.
LEAST = 1e-3
#: Directions of rows that are tried at most.
MOST_DIRECTIONS = 60


def check_area(corners: ArrayLike, name: str = "area") -> Array:
    """A polygon that can be searched: clockwise as seen from above, not closed, no corner twice.

    Parameters
    ----------
    corners
        (K, 2) north and east, metres, in either sense; the first may stand at the end once more.
    name
        Of the area, for messages.

    Returns
    -------
    (K', 2) metres.

    Raises
    ------
    WildlabError
        Where it has fewer than three corners, corners that are not numbers, or no extent.

    Examples
    --------
    >>> print(check_area([[0, 0], [0, 10], [20, 10], [20, 0], [0, 0]]))
    [[20.  0.]
     [20. 10.]
     [ 0. 10.]
     [ 0.  0.]]
    """
    points = np.asarray(corners, float)
    if points.ndim != 2 or points.shape[-1] != 2:
        raise WildlabError(f"corners of the shape {points.shape}", "give rows of north and east", field=name)
    if not np.isfinite(points).all():
        row = int(np.flatnonzero(~np.isfinite(points).all(axis=1))[0])
        raise WildlabError(
            f"corner {row + 1} is not a number", "give north and east of every corner in metres", field=name
        )
    points = points[np.linalg.norm(points - np.roll(points, -1, axis=0), axis=1) > SAME]
    if len(points) < 3:
        raise WildlabError(
            f"the polygon has {len(points)} different corner{'s' * (len(points) != 1)}",
            "give three at least",
            field=name,
        )
    signed = _signed_area(points)
    if abs(signed) < LEAST:
        raise WildlabError(
            f"the polygon has an area of {abs(signed):.2g} m2",
            "its corners lie on one line: move one",
            field=name,
        )
    # North to the first axis, east to the second: positive is clockwise from above.
    return points if signed > 0 else np.ascontiguousarray(points[::-1])


def is_convex(corners: ArrayLike) -> bool:
    """Whether no inner angle of a checked polygon is above 180 degrees (F 5.2, footnote).

    Parameters
    ----------
    corners
        (K, 2) metres, from `check_area`.

    Returns
    -------
    bool
    """
    edges = np.roll(np.asarray(corners, float), -1, axis=0) - np.asarray(corners, float)
    following = np.roll(edges, -1, axis=0)
    turns = edges[:, 0] * following[:, 1] - edges[:, 1] * following[:, 0]
    lengths = np.linalg.norm(edges, axis=1) * np.linalg.norm(following, axis=1)
    return bool((turns >= -1e-9 * lengths).all())


def contains(corners: ArrayLike, points: ArrayLike) -> Mask:
    """Which points lie in a polygon, by counting the edges that a line to the north crosses.

    Parameters
    ----------
    corners
        (K, 2) metres.
    points
        (N, 2) metres, north and east. On the border either answer may come out.

    Returns
    -------
    (N,) bool; False of NaN.

    Examples
    --------
    >>> contains([[0, 0], [0, 10], [20, 10], [20, 0]], [[5, 5], [25, 5]])
    array([ True, False])
    """
    fence = np.asarray(corners, float)
    asked = np.atleast_2d(np.asarray(points, float))
    following = np.roll(fence, -1, axis=0)
    if len(fence) * len(asked) <= TOGETHER:
        spans = (fence[:, 1] > asked[:, 1:]) != (following[:, 1] > asked[:, 1:])
        with np.errstate(invalid="ignore", divide="ignore"):
            slope = (following[:, 0] - fence[:, 0]) / (following[:, 1] - fence[:, 1])
            north = fence[:, 0] + (asked[:, 1:] - fence[:, 1]) * slope
            return np.asarray((spans & (asked[:, :1] < north)).sum(axis=1) % 2 == 1)
    inside = np.zeros(len(asked), bool)
    for a, b in zip(fence, following, strict=True):
        spans = (a[1] > asked[:, 1]) != (b[1] > asked[:, 1])
        with np.errstate(invalid="ignore", divide="ignore"):
            at = a[0] + (asked[:, 1] - a[1]) / (b[1] - a[1]) * (b[0] - a[0])
            inside ^= spans & (asked[:, 0] < at)
    return inside


def inside_of(corners: ArrayLike) -> Callable[[Array], Mask]:
    """Whether points (..., 2) lie in an area, for areas that are asked often.

    A convex one is asked by its sides, which is many times faster than `contains`.

    Parameters
    ----------
    corners
        (K, 2) metres, from `check_area`.

    Returns
    -------
    Callable
        Points (..., 2) m -> (...) bool. On the border either answer may come out.

    Examples
    --------
    >>> inside = inside_of(check_area([[0, 0], [0, 10], [20, 10], [20, 0]], "area"))
    >>> inside(np.array([[[5.0, 5.0], [25.0, 5.0]]]))
    array([[ True, False]])
    """
    fence = np.asarray(corners, float)
    if not is_convex(fence):
        return lambda points: contains(fence, points.reshape(-1, 2)).reshape(points.shape[:-1])
    edges = np.roll(fence, -1, axis=0) - fence
    inward = np.stack([-edges[:, 1], edges[:, 0]])
    least = np.einsum("ki,ik->k", fence, inward)

    def inside(points: Array) -> Mask:
        north, east, within = points[..., 0], points[..., 1], np.ones(points.shape[:-1], bool)
        # Side by side: numpy is slow to ask whether all of a few are true.
        for (a, b), limit in zip(inward.T, least, strict=True):
            within &= a * north + b * east > limit
        return within

    return inside


def rectangle(north: float, east: float, length: float, width: float, course: float) -> Array:
    """Corners of a rectangle about its middle, (4, 2) metres, clockwise.

    Parameters
    ----------
    north, east
        Of its middle, metres.
    length, width
        Along the course and across it, metres.
    course
        From north to the east, radians.

    Returns
    -------
    (4, 2) metres.

    Examples
    --------
    >>> print(rectangle(0.0, 0.0, 4.0, 2.0, 0.0))
    [[ 2.  1.]
     [-2.  1.]
     [-2. -1.]
     [ 2. -1.]]
    """
    along = np.array([np.cos(course), np.sin(course)])
    across = np.array([-along[1], along[0]])
    signs = np.array([[1, 1], [-1, 1], [-1, -1], [1, -1]]) / 2
    corners = np.array([north, east]) + length * signs[:, :1] * along + width * signs[:, 1:] * across
    return check_area(corners, "rectangle")


def _signed_area(points: Array) -> float:
    # About the first corner: far from the origin a cross product loses digits.
    p = points - points[0]
    q = np.roll(p, -1, axis=0)
    return float((p[:, 0] * q[:, 1] - p[:, 1] * q[:, 0]).sum() / 2)


def edge_directions(corners: ArrayLike, most: int = MOST_DIRECTIONS) -> Array:
    """Directions of the edges of a fence, of those that differ the ones of the longest edges.

    Parameters
    ----------
    corners
        (K, 2) north and east, metres.
    most
        How many at most.

    Returns
    -------
    (D,) radians from 0 to below pi: a direction and its reverse are the same rows; the longest edge's first.

    Examples
    --------
    >>> print(edge_directions([[0, 0], [0, 40], [100, 40], [100, 0]]))
    [0.         1.57079633]
    """
    fence = np.asarray(corners, float)
    edges = np.roll(fence, -1, axis=0) - fence
    edges = edges[np.argsort(-np.linalg.norm(edges, axis=1), kind="stable")]
    angles = np.mod(np.arctan2(edges[:, 1], edges[:, 0]), np.pi)
    angles = np.where(np.pi - angles < 1e-9, 0.0, angles)
    # Of a fence with very many corners the edges that differ, and of these the longest.
    coarse = (
        np.round(angles, 2) if len(edges) <= MOST_DIRECTIONS else np.round(MOST_DIRECTIONS * angles / np.pi)
    )
    _, first = np.unique(coarse, return_index=True)
    return angles[np.sort(first)][:most]
