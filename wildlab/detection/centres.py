"""Where the centre of a found region is and how far off it may be: moments (H 4.5, 4.6), blur, the image's
border.

Pixels are squares about their centres, and the centre of the upper left one is (0, 0), as in OpenCV. The
moments of a region are those of the squares, so that a rectangle of w by h pixels has exactly the moments of
the rectangle.

A blob of which a part is hidden beyond the border of the image has its centre too far inside. Where the
length of the object is known, H (4.7) moves it along the blob's major axis, towards the border, by ``L/2 - (a
- i)``: half the length of the object, less what the blob has behind its centre. With ``i`` from the centre to
the border, that is ``a - i`` only if ``a`` is the full major axis.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from wildlab.detection.detections import Detections
from wildlab.geometry.frames import Array, Mask

#: Share of its ellipse that a blob fills below which it is not a filled one.
FILLED = 0.9
#: Rows and columns at the border in which the contour of something cut may end.
AT_BORDER = 2


@dataclass(frozen=True)
class CentreErrors:
    """How far a found centre may be from the true one: what `wildlab.detection.floating` states.

    The true centre is that of the object's whole outline in the image. The numbers were set on scenes of
    `wildlab.simulation.scene.drawn` with seeds that no test and no study uses: 1000 to 1499, 3000 to 3299.

    Attributes
    ----------
    floor
        Standard deviation that nothing falls below, px.
    edge
        Of where a piece of the contour lies, as a share of the blur.
    shape
        Share of the object's own spread by which parts that look different (houses, engines, wakes) move the
        centre.
    broken
        Share of the major axis by which the centre moves where the contour is not closed, and the blob is a
        line in place of an area.
    cut
        Share of the major axis by which the border of the image moves it, for the hidden part.
    adjusted
        Share of the major axis that is left of that once the centre was moved by H (4.7).
    """

    floor: float = 0.2
    edge: float = 0.1
    shape: float = 0.01
    broken: float = 0.2
    cut: float = 0.28
    adjusted: float = 0.1


#: As they were set.
USUAL = CentreErrors()


def cut_sides(box: NDArray[Any], shape: tuple[int, ...]) -> Mask:
    """Which borders of an image of that shape (rows, columns) a box touches: left, top, right, bottom.

    Parameters
    ----------
    box
        (4,) left, top, width, height, px.
    shape
        Rows and columns of the image.

    Returns
    -------
    (4,) bool.
    """
    left, top, width, height = box
    return np.array(
        [
            left < AT_BORDER,
            top < AT_BORDER,
            left + width > shape[1] - AT_BORDER,
            top + height > shape[0] - AT_BORDER,
        ]
    )


def centre_covariance(
    area: float,
    axes: Array,
    angle: float,
    boundary: Array,
    cut: Mask,
    smoothing_sd: float,
    errors: CentreErrors = USUAL,
) -> Array:
    """Covariance (2, 2) of an object's centre, px^2: from its shape, the blur, and the border of the image.

    Each piece of the contour, as long as the blur is wide, lies somewhere within the blur; parts that look
    different move the centre by a share of the object's own spread; where the contour is broken only a line
    of it was found; at the border of the image an unknown part is hidden beyond it.

    Parameters
    ----------
    area
        px^2.
    axes, angle
        Of the ellipse with the same second moments: (2,) full lengths, px, and orientation, rad.
    boundary
        (2, 2) from :func:`boundary_spread`.
    cut
        (4,) from :func:`cut_sides`.
    smoothing_sd
        Of the smoothing, px.
    errors
        CentreErrors.

    Returns
    -------
    (2, 2).
    """
    blur = float(np.hypot(smoothing_sd, 1.0))
    pieces = 2 * np.sqrt(np.pi) * blur  # over which a Gaussian blur makes the contour lie alike
    contour = (errors.edge * blur) ** 2 * pieces / area**2 * boundary
    ellipse = max(np.pi / 4 * float(axes.prod()), 1e-6)
    line = errors.broken * max(FILLED - area / ellipse, 0.0) * float(axes[0])
    even = (errors.floor**2 + line**2) * np.eye(2)
    looks = errors.shape**2 * ellipse_covariance(axes, angle)
    return np.asarray(contour + looks + even + hidden_part(axes, angle, cut, errors))


def hidden_part(axes: Array, angle: float, cut: Mask, errors: CentreErrors = USUAL) -> Array:
    """What the border of the image adds to :func:`centre_covariance` (2, 2), px^2; zero for what is whole."""
    if not cut.any():
        return np.zeros((2, 2))
    across = np.diag(np.array([cut[0] or cut[2], cut[1] or cut[3]], float))
    # Along its own axes, and across the border: a ship of which a corner shows lies any way.
    whole = 16 * ellipse_covariance(axes, angle)
    return np.asarray(errors.cut**2 * (whole + 0.25 * axes[0] ** 2 * across))


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


#: By how much the major axis must exceed the minor one for a direction, which H 4.3, 6.4.1 ask and not print.
AXIS_RATIO = 1.5
#: Of the major axis: further from the centre the border is not what cuts the blob.
REACH = 0.75


def adjust_at_border(
    detections: Detections,
    shape: tuple[int, int],
    length: ArrayLike,
    length_sd: float = 0.0,
) -> Detections:
    """Move the centres of what the border of the image cuts, H (4.7), where the length is known.

    Only filled blobs whose major axis differs from the minor one by `AXIS_RATIO`, and meets the border
    where it cuts the blob, are moved; never those that two opposite borders cut, of which the hidden parts
    are unknown. The centre may come to lie outside of the image.

    Parameters
    ----------
    detections
        Of one image.
    shape
        Rows and columns of the image.
    length
        Of the whole object, px, one or (N,); NaN where it is not known.
    length_sd
        Standard deviation of that, px.

    Returns
    -------
    Detections
        With moved centres, and their covariances without what the hidden part added.

    """
    lengths = np.broadcast_to(np.asarray(length, float), len(detections))
    moves = border_moves(detections, shape, lengths)
    uv, covariance = detections.uv.copy(), detections.covariance.copy()
    moved = np.isfinite(moves).all(axis=1)
    uv[moved] += moves[moved]
    for row in np.flatnonzero(moved):
        along = direction(detections.orientation[row])
        ellipse = detections.axes[row], float(detections.orientation[row])
        # The hidden part is known but for the length; how far the blob reaches behind its centre is not read
        # off the image but from its second moments, which for other shapes than an ellipse are some way off.
        without = covariance[row] - hidden_part(*ellipse, cut_sides(detections.box[row], shape))
        left = (4 * USUAL.adjusted) ** 2 * ellipse_covariance(*ellipse) + (length_sd / 2) ** 2 * np.outer(
            along, along
        )
        covariance[row] = without + left
    return replace(detections, uv=uv, covariance=covariance)


def border_moves(detections: Detections, shape: tuple[int, int], lengths: Array) -> Array:
    """By how much each centre is moved, H (4.7).

    Parameters
    ----------
    detections, shape
        As for :func:`adjust_at_border`.
    lengths
        (N,) px.

    Returns
    -------
    (N, 2) px, NaN where a centre stays.
    """
    rows, columns = shape
    moves = np.full((len(detections), 2), np.nan)
    # Of a broken contour only a line was found, and its axis says little.
    filled = detections.area >= FILLED * np.pi / 4 * detections.axes.prod(axis=1)
    for row, box in enumerate(detections.box):
        sides = cut_sides(box, shape)
        major, minor = detections.axes[row]
        opposite = (sides[0] and sides[2]) or (sides[1] and sides[3])
        if (
            not sides.any()
            or opposite
            or not filled[row]
            or major < AXIS_RATIO * minor
            or not np.isfinite(lengths[row])
        ):
            continue
        along = direction(detections.orientation[row])
        near = to_border(detections.uv[row], along, columns, rows)
        if abs(near) > REACH * major:
            continue
        moves[row] = np.sign(near) * (lengths[row] / 2 - (major - abs(near))) * along
    return moves


def ellipse_covariance(axes: Array, angle: float) -> Array:
    """Covariance (2, 2) of the points of an ellipse with full axes (2,), the major one at that angle."""
    along = direction(angle)
    across = np.array([-along[1], along[0]])
    return np.asarray(
        (axes[0] / 4) ** 2 * np.outer(along, along) + (axes[1] / 4) ** 2 * np.outer(across, across)
    )


def direction(angle: float) -> Array:
    """Unit vector (2,) at an angle from u towards v."""
    return np.array([np.cos(angle), np.sin(angle)])


def to_border(centre: Array, along: Array, width: float, height: float) -> float:
    """How far along a direction, or against it (negative), the nearer border of the image is from a centre.

    The image reaches half a pixel beyond the centres of its first and last pixels.

    Examples
    --------
    >>> import numpy as np
    >>> to_border(np.array([9.5, 50.0]), np.array([1.0, 0.0]), 100, 100)
    -10.0
    """
    distances = []
    for at, step, size in zip(centre, along, (width, height), strict=True):
        if abs(step) > 1e-12:
            distances += [(-0.5 - at) / step, (size - 0.5 - at) / step]
    forward = min(value for value in distances if value >= 0)
    backward = max(value for value in distances if value <= 0)
    return float(forward if forward < -backward else backward)
