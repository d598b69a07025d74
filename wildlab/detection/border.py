"""Objects that the border of the image cuts: the centre moved to where it would be, H (4.7).

A blob of which a part is hidden has its centre too far inside. Where the length of the object is known, the
centre is moved along the blob's major axis, towards the border, by ``L/2 - (a - i)``: half the length of the
object, less what the blob has behind its centre. With ``i`` from the centre to the border, that is ``a - i``
only if ``a`` is the full major axis.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike

from wildlab.detection.centres import cut_sides, hidden_part
from wildlab.detection.detections import Detections
from wildlab.detection.thresholds import FILLED, CentreErrors
from wildlab.errors import WildlabError
from wildlab.geometry.frames import Array

#: By how much the major axis must exceed the minor one for a direction, which H 4.3, 6.4.1 ask and not print.
AXIS_RATIO = 1.5
#: Of the major axis: further from the centre the border is not what cuts the blob.
REACH = 0.75


def adjust_at_border(
    detections: Detections,
    shape: tuple[int, int],
    length: ArrayLike,
    length_sd: float = 0.0,
    errors: CentreErrors | None = None,
    *,
    axis_ratio: float = AXIS_RATIO,
    full_axis: bool = True,
) -> Detections:
    """Move the centres of what the border of the image cuts, H (4.7), where the length is known.

    Only filled blobs whose major axis differs from the minor one by ``axis_ratio``, and meets the border
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
    errors
        What the covariances of the centres are made of.
    axis_ratio
        Smallest ratio of the axes.
    full_axis
        Whether ``a`` of (4.7) is the full major axis; with half of it, the centre moves too far.

    Returns
    -------
    Detections
        With moved centres, and their covariances without what the hidden part added.

    Raises
    ------
    WildlabError
        Where a length is not above zero.
    """
    lengths = np.broadcast_to(np.asarray(length, float), len(detections))
    if (lengths <= 0).any():
        raise WildlabError(f"a length of {lengths.min()} px", "give one above zero", field="length")
    given = errors or CentreErrors()
    moves = border_moves(detections, shape, lengths, axis_ratio=axis_ratio, full_axis=full_axis)
    uv, covariance = detections.uv.copy(), detections.covariance.copy()
    moved = np.isfinite(moves).all(axis=1)
    uv[moved] += moves[moved]
    for row in np.flatnonzero(moved):
        along = direction(detections.orientation[row])
        region = ellipse_covariance(detections.axes[row], detections.orientation[row])
        # The hidden part is known but for the length; how far the blob reaches behind its centre is not read
        # off the image but from its second moments, which for other shapes than an ellipse are some way off.
        without = covariance[row] - hidden_part(region, cut_sides(detections.box[row], shape), given)
        left = (4 * given.adjusted) ** 2 * region + (length_sd / 2) ** 2 * np.outer(along, along)
        covariance[row] = without + left
    return replace(detections, uv=uv, covariance=covariance)


def border_moves(
    detections: Detections,
    shape: tuple[int, int],
    lengths: Array,
    *,
    axis_ratio: float = AXIS_RATIO,
    full_axis: bool = True,
) -> Array:
    """By how much each centre is moved, H (4.7).

    Parameters
    ----------
    detections, shape, axis_ratio, full_axis
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
            or major < axis_ratio * minor
            or not np.isfinite(lengths[row])
        ):
            continue
        along = direction(detections.orientation[row])
        near = to_border(detections.uv[row], along, columns, rows)
        if abs(near) > REACH * major:
            continue
        a = major if full_axis else major / 2
        moves[row] = np.sign(near) * (lengths[row] / 2 - (a - abs(near))) * along
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
