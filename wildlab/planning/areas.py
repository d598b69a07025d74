"""Areas on the ground: polygons of north and east, checked before anything is planned on them."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from wildlab.errors import WildlabError
from wildlab.geometry.compilation import compiled
from wildlab.geometry.frames import Array, Mask

#: Corners nearer to one another than this are one corner, metres; and what counts as on a border.
SAME = 1e-6
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


def contains(corners: ArrayLike, points: ArrayLike) -> Mask:
    """Which points lie in a polygon, by counting the edges that a line to the north crosses.

    Parameters
    ----------
    corners
        (K, 2) metres.
    points
        (..., 2) metres, north and east. On the border either answer may come out.

    Returns
    -------
    (...) bool; False of NaN.

    Examples
    --------
    >>> contains([[0, 0], [0, 10], [20, 10], [20, 0]], [[5, 5], [25, 5]])
    array([ True, False])
    """
    asked = np.asarray(points, float)
    fence = np.ascontiguousarray(corners, float)
    return _contains(fence, np.ascontiguousarray(asked.reshape(-1, 2))).reshape(asked.shape[:-1])


@compiled
def _contains(fence: Array, points: Array) -> Mask:
    north, east = fence.T
    inside = np.zeros(len(points), np.bool_)
    for k in range(len(fence)):
        if east[k - 1] == east[k]:
            continue
        slope = (north[k] - north[k - 1]) / (east[k] - east[k - 1])
        for i in range(len(points)):
            if (east[k - 1] > points[i, 1]) != (east[k] > points[i, 1]):
                inside[i] ^= points[i, 0] < north[k - 1] + (points[i, 1] - east[k - 1]) * slope
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
