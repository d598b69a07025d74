"""Rings of points on the Earth: what makes one no outline of an area."""

from __future__ import annotations

import numpy as np

from wildlab.errors import WildlabError
from wildlab.geometry.frames import Array

#: The most points of a ring; a surveyor's fence has hundreds.
MOST_POINTS = 5_000
#: Square metres below which a ring is a slip of the pen.
LEAST_AREA = 1.0
#: Sine of the angle below which a side that turns back lies on the one before it.
STRAIGHT = 1e-9


def checked_ring(points: list[tuple[float, float]], what: str, file: str) -> Array:
    """Longitude and latitude of a ring, looked at as numbers on the Earth.

    Parameters
    ----------
    points
        Longitude and latitude, degrees; the last may repeat the first.
    what
        Whose ring it is, for messages.
    file
        Where it was found.

    Returns
    -------
    (K, 2) longitude, latitude, degrees; not closed, no point twice in a row.

    Raises
    ------
    WildlabError
        Where there are too few or too many points, or they are not degrees of one place.
    """
    if len(points) > MOST_POINTS + 1:
        raise WildlabError(
            f"{what} has {len(points):,} points, and {MOST_POINTS:,} are the most that is planned with",
            "simplify the outline",
            file=file,
        )
    ring = np.array(points, float).reshape(-1, 2)
    if not np.isfinite(ring).all():
        at = int(np.flatnonzero(~np.isfinite(ring).all(axis=1))[0])
        raise WildlabError(f"point {at + 1} of {what} is no finite number", "give degrees", file=file)
    _on_the_earth(ring, what, file)
    if len(ring) > 1 and (ring[0] == ring[-1]).all():
        ring = ring[:-1]
    if len(ring) > 1:
        ring = ring[~(ring == np.roll(ring, 1, axis=0)).all(axis=1)]
    if len(ring) < 3:
        raise WildlabError(
            f"{what} has {len(ring)} different point{'' if len(ring) == 1 else 's'}",
            "an outline needs three corners at least",
            file=file,
        )
    if np.ptp(ring[:, 0]) > 180:
        raise WildlabError(
            f"the longitudes of {what} span {np.ptp(ring[:, 0]):.0f} degrees",
            "split an area that crosses the antimeridian at 180 degrees, each part as a polygon of its own",
            file=file,
        )
    return ring


def _on_the_earth(ring: Array, what: str, file: str) -> None:
    most = np.abs(ring).max(axis=0) if len(ring) else np.zeros(2)
    if (most > 180).any():
        raise WildlabError(
            f"{what} has a coordinate of {most.max():g}, which is no degree",
            "give longitude and latitude in degrees of WGS84 (EPSG:4326), not metres of a map projection",
            file=file,
        )
    if most[1] > 90:
        if most[0] <= 90:
            raise WildlabError(
                f"{what} has a latitude of {most[1]:g} degrees: its coordinates are swapped",
                "give longitude first, then latitude",
                file=file,
            )
        raise WildlabError(
            f"{what} has a latitude of {most[1]:g} degrees", "give one of at most 90", file=file
        )


def check_shape(ring: Array, what: str, file: str) -> None:
    """Refuse a ring that bounds nothing, or that is not sure what it bounds.

    Parameters
    ----------
    ring
        (K, 2) metres, not closed.
    what, file
        As for `checked_ring`.

    Raises
    ------
    WildlabError
        Where its area is next to nothing, or it crosses or touches itself.
    """
    met = crossing(ring)
    if met is not None:
        one, other = met
        raise WildlabError(
            f"{what} crosses itself: the side after point {one + 1} meets the side after point {other + 1}",
            "put its points in the order in which they follow each other along the fence",
            file=file,
        )
    if ring_area(ring) < LEAST_AREA:
        raise WildlabError(
            f"{what} bounds {ring_area(ring):.2g} square metres", "check its coordinates", file=file
        )


def ring_area(ring: Array) -> float:
    """Area within a ring (K, 2) that does not cross itself, square metres.

    Examples
    --------
    >>> ring_area(np.array([[0.0, 0.0], [0.0, 20.0], [10.0, 20.0], [10.0, 0.0]]))
    200.0
    """
    p, q = ring, np.roll(ring, -1, axis=0)
    return float(abs(np.sum(p[:, 0] * q[:, 1] - p[:, 1] * q[:, 0])) / 2)


def crossing(ring: Array) -> tuple[int, int] | None:
    """Two sides of a ring (K, 2) that meet, but for the corner that neighbours share; None where none do.

    Returns
    -------
    Numbers of the sides, by the points that they begin at; or None.

    Examples
    --------
    >>> crossing(np.array([[0.0, 0.0], [10.0, 10.0], [10.0, 0.0], [0.0, 10.0]]))
    (0, 2)
    >>> crossing(np.array([[0.0, 0.0], [0.0, 10.0], [10.0, 10.0]]))
    """
    n = len(ring)
    begins, ends = ring, np.roll(ring, -1, axis=0)
    for one in range(n):
        others = np.arange(one + 1, n)
        # Neighbours share a corner; they meet beyond it only where the second one turns straight back.
        apart = others[(others != one + 1) & ~((one == 0) & (others == n - 1))]
        met = _segments_meet(begins[one], ends[one], begins[apart], ends[apart])
        if met.any():
            return one, int(apart[np.argmax(met)])
        follows = (one + 1) % n
        ahead, back = ends[one] - begins[one], ends[follows] - begins[follows]
        lengths = float(np.hypot(*ahead) * np.hypot(*back))
        if abs(float(_cross(ahead, back))) <= STRAIGHT * lengths and float(ahead @ back) < 0:
            return min(one, follows), max(one, follows)
    return None


def _cross(a: Array, b: Array) -> Array:
    return np.asarray(a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0])


def _segments_meet(a: Array, b: Array, c: Array, d: Array) -> Array:
    """Whether the segment a-b meets each of the segments c-d, touching included."""
    side_c, side_d = _cross(b - a, c - a), _cross(b - a, d - a)
    side_a, side_b = _cross(d - c, a - c), _cross(d - c, b - c)
    straddle = (side_c * side_d <= 0) & (side_a * side_b <= 0)
    # On one line, the products are all zero, and the boxes about the segments decide.
    low, high = np.minimum(a, b), np.maximum(a, b)
    boxes = ((np.minimum(c, d) <= high) & (np.maximum(c, d) >= low)).all(axis=-1)
    return np.asarray(straddle & boxes)
