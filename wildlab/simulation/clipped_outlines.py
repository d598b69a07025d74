"""What an image shows of an outline that may reach beyond its edge: polygons cut exactly, and their moments.

A detector that fills what it finds (H 4.3) has of a partly visible ship the centre, the area and the axes of
the visible part. All of these are integrals over a polygon, so they are computed as such, without pixels.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from wildlab.geometry.frames import Array


class Blob(NamedTuple):
    """The visible part of an outline.

    Attributes
    ----------
    centre
        (2,) px; NaN where nothing shows.
    area
        px^2.
    major, minor
        Full axes of the ellipse with the same second moments (H 4.5, 4.6), px.
    angle
        Of the major axis, from u towards v, rad, within a quarter turn of u.
    cut
        Whether the edge of the image cuts the outline.
    """

    centre: Array
    area: float
    major: float
    minor: float
    angle: float
    cut: bool


NOTHING = Blob(np.full(2, np.nan), 0.0, np.nan, np.nan, np.nan, False)


def clip_polygon(polygon: ArrayLike, width: float, height: float) -> Array:
    """The part of a convex polygon within an image, by cutting it at one edge after the other.

    Parameters
    ----------
    polygon
        (K, 2) corners in order, either way round.
    width, height
        The image reaches from 0 to these.

    Returns
    -------
    (M, 2) corners in the same order; (0, 2) where nothing is left.
    """
    corners = np.asarray(polygon, float)
    for axis, limit, side in ((0, 0.0, 1.0), (0, width, -1.0), (1, 0.0, 1.0), (1, height, -1.0)):
        if len(corners) == 0:
            break
        inside = side * (corners[:, axis] - limit)
        kept: list[Array] = []
        for here, there, d_here, d_there in zip(
            corners, np.roll(corners, -1, axis=0), inside, np.roll(inside, -1), strict=True
        ):
            if d_here >= 0:
                kept.append(here)
            if (d_here > 0 > d_there) or (d_here < 0 < d_there):
                cut = here + d_here / (d_here - d_there) * (there - here)
                cut[axis] = limit
                kept.append(cut)
        corners = np.array(kept).reshape(-1, 2)
    return corners


def moments(polygon: ArrayLike) -> tuple[float, Array, Array]:
    """Area, centroid (2,) and covariance (2, 2) of the area within a polygon (K, 2) without crossings."""
    corners = np.asarray(polygon, float)
    middle = corners.mean(axis=0)  # about it, so that little is lost where the polygon lies far from zero
    a = corners - middle
    b = np.roll(a, -1, axis=0)
    cross = a[:, 0] * b[:, 1] - b[:, 0] * a[:, 1]
    area = cross.sum() / 2
    centre = ((a + b) * cross[:, None]).sum(axis=0) / (6 * area)
    both = a + b
    second = np.einsum("k,ki,kj->ij", cross, a, a) + np.einsum("k,ki,kj->ij", cross, b, b)
    second = (second + np.einsum("k,ki,kj->ij", cross, both, both)) / (24 * area)
    return float(abs(area)), middle + centre, second - np.outer(centre, centre)


def visible_part(polygon: ArrayLike, width: float, height: float) -> Blob:
    """What an image shows of a convex outline with corners (K, 2) px; a corner that is NaN shows nothing."""
    corners = np.asarray(polygon, float)
    if not np.isfinite(corners).all():
        return NOTHING
    shown = clip_polygon(corners, width, height)
    if len(shown) < 3:
        return NOTHING
    area, centre, covariance = moments(shown)
    if not area > 1e-9:
        return NOTHING
    sizes, axes = np.linalg.eigh(covariance)
    along = axes[:, 1]
    angle = float(np.arctan(along[1] / along[0])) if along[0] != 0 else np.pi / 2
    minor, major = 4 * np.sqrt(np.maximum(sizes, 0.0))
    outside = (corners < 0) | (corners > [width, height])
    return Blob(centre, area, float(major), float(minor), angle, bool(outside.any()))
