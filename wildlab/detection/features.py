"""What a found region looks like: area, centre, axes, orientation, Hu's invariants (H 4.5, 4.6), boundary.

Pixels are squares about their centres, and the centre of the upper left one is (0, 0), as in OpenCV. The
moments of a region are those of the squares, so that a rectangle of w by h pixels has exactly the moments of
the rectangle.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from wildlab.geometry.frames import Array

#: Variance of a point within a pixel, px^2, along either side.
WITHIN_PIXEL = 1 / 12


class Shape(NamedTuple):
    """A region's shape.

    Attributes
    ----------
    area
        px^2.
    centre
        (2,) u and v, px.
    covariance
        (2, 2) of the points of the region, H (4.6) divided by the area, px^2.
    axes
        (2,) full lengths of the ellipse with that covariance, px.
    orientation
        Of the major axis, from u towards v, within a quarter turn of u, rad.
    hu
        (7,) invariants under translation, rotation and scale.
    """

    area: float
    centre: Array
    covariance: Array
    axes: Array
    orientation: float
    hu: Array


def axes_of(covariance: Array) -> tuple[Array, float]:
    """Full axes (2,) and orientation of the ellipse whose points have that covariance (2, 2).

    Eigenvectors of H (4.6). The points of an ellipse with full axis ``a`` have the variance ``a^2 / 16``.

    Examples
    --------
    >>> axes, angle = axes_of(np.diag([1.0, 4.0]))
    >>> axes.tolist(), round(angle, 4)
    ([8.0, 4.0], 1.5708)
    """
    a, b, c = covariance[0, 0], covariance[0, 1], covariance[1, 1]
    middle, half = (a + c) / 2, float(np.hypot((a - c) / 2, b))
    sizes = np.array([middle + half, max(middle - half, 0.0)])
    angle = 0.5 * float(np.arctan2(2 * b, a - c))
    return 4 * np.sqrt(sizes), angle


def shape_of(mask: NDArray[Any], left: int = 0, top: int = 0) -> Shape:
    """The shape of a region.

    Parameters
    ----------
    mask
        (H, W), nonzero inside; a part of an image.
    left, top
        Where in the image that part begins, px.

    Returns
    -------
    Shape
    """
    found = cv2.moments(np.ascontiguousarray(mask, np.uint8), binaryImage=True)
    area = found["m00"]
    centre = np.array([found["m10"], found["m01"]]) / area
    second = np.array([[found["mu20"], found["mu11"]], [found["mu11"], found["mu02"]]]) / area
    covariance = second + WITHIN_PIXEL * np.eye(2)
    axes, orientation = axes_of(covariance)
    hu = np.asarray(cv2.HuMoments(found), float).ravel()
    return Shape(area, centre + np.array([left, top]), covariance, axes, orientation, hu)


def boundary_spread(outline: NDArray[Any], centre: Array) -> Array:
    """Integral of ``(r - c)(r - c)^T`` along a region's outer boundary, px^3.

    Where each piece of the boundary lies a bit further out or in, independently, the centre moves by the
    integral of ``(r - c) dn ds`` over the area: its covariance is this, times the variance of ``dn`` and the
    length over which it stays the same, divided by the squared area.

    Parameters
    ----------
    outline
        (K, 1, 2) or (K, 2) centres of the boundary's pixels in order, as of OpenCV's ``findContours``.
    centre
        (2,) of the region, px.

    Returns
    -------
    (2, 2).
    """
    points = np.asarray(outline, float).reshape(-1, 2)
    steps = np.linalg.norm(np.roll(points, -1, axis=0) - points, axis=1)
    # Through the pixels' centres a contour is half a pixel short on each side.
    away = points - centre
    distance = np.linalg.norm(away, axis=1, keepdims=True)
    away = away * (1 + 0.5 / np.maximum(distance, 0.5))
    lengths = np.maximum((steps + np.roll(steps, 1)) / 2, 1.0)
    return np.asarray((away * lengths[:, None]).T @ away)
