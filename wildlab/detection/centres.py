"""How far a found centre may be from the true one: from shape, blur, and the border of the image."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from wildlab.detection.features import axes_of
from wildlab.detection.thresholds import FILLED, CentreErrors
from wildlab.geometry.frames import Array

#: Rows and columns at the border in which the contour of something cut may end.
AT_BORDER = 2


def cut_sides(box: NDArray[Any], shape: tuple[int, ...]) -> NDArray[np.bool_]:
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
    region: Array,
    boundary: Array,
    cut: NDArray[np.bool_],
    smoothing_sd: float,
    errors: CentreErrors,
) -> Array:
    """Covariance (2, 2) of an object's centre, px^2: from its shape, the blur, and the border of the image.

    Each piece of the contour, as long as the blur is wide, lies somewhere within the blur; parts that look
    different move the centre by a share of the object's own spread; where the contour is broken only a line
    of it was found; at the border of the image an unknown part is hidden beyond it.

    Parameters
    ----------
    area
        px^2.
    region, boundary
        (2, 2) each: `Shape.covariance`, and what `wildlab.detection.features.boundary_spread` gives.
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
    ellipse = 4 * np.pi * np.sqrt(max(float(np.linalg.det(region)), 1e-12))
    line = errors.broken * max(FILLED - area / ellipse, 0.0) * float(axes_of(region)[0][0])
    even = (errors.floor**2 + line**2) * np.eye(2)
    return np.asarray(contour + errors.shape**2 * region + even + hidden_part(region, cut, errors))


def hidden_part(region: Array, cut: NDArray[np.bool_], errors: CentreErrors) -> Array:
    """What the border of the image adds to the covariance of a centre (2, 2), px^2; zero for what is whole.

    Parameters
    ----------
    region
        (2, 2) covariance of the points of the visible part, px^2.
    cut
        (4,) from :func:`cut_sides`.
    errors
        CentreErrors.

    Returns
    -------
    (2, 2).
    """
    if not cut.any():
        return np.zeros((2, 2))
    across = np.diag(np.array([cut[0] or cut[2], cut[1] or cut[3]], float))
    # Along its own axes, and across the border: a ship of which a corner shows lies any way.
    major = float(axes_of(region)[0][0])
    return np.asarray(errors.cut**2 * (16 * region + 0.25 * major**2 * across))
