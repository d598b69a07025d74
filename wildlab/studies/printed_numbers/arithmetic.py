"""What one printed number says about another: rules of three, and the little that is known of filters.

Nothing here is simulated. All functions are of numbers or arrays alike.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from wildlab.geometry.frames import Array


def pixels_on_ground(pixels: ArrayLike, height: ArrayLike, focal_length: ArrayLike) -> Array:
    """Length on level ground, straight below, that so many pixels cover.

    Parameters
    ----------
    pixels
        px.
    height
        Of the camera, m.
    focal_length
        px.

    Returns
    -------
    m.

    Examples
    --------
    >>> float(pixels_on_ground(20.0, 350.0, 1000.0))
    7.0
    """
    return np.asarray(np.asarray(pixels, float) * np.asarray(height, float) / np.asarray(focal_length, float))


def images_in(duration: ArrayLike, rate: ArrayLike) -> Array:
    """Images that a camera takes: of ``duration`` (s) at ``rate`` (Hz).

    Examples
    --------
    >>> float(images_in(80.0, 7.5))
    600.0
    """
    return np.asarray(np.asarray(duration, float) * rate)


def rescaled_nis(nis: ArrayLike, sd: ArrayLike, other_sd: ArrayLike) -> Array:
    """NIS of the same innovations had the filter been told of another measurement noise.

    Where the noise makes nearly all of the innovation's covariance, as it does for a target that is seen many
    times, NIS goes with its inverse (H 3.12). The more the state's own covariance counts, the less NIS
    changes: this is as far as it can go.

    Parameters
    ----------
    nis
        With the standard deviation ``sd``.
    sd, other_sd
        Standard deviations of the measurement noise, in one unit.

    Examples
    --------
    >>> float(rescaled_nis(0.5, 20.0, 10.0))
    2.0
    """
    return np.asarray(np.asarray(nis, float) * (np.asarray(sd, float) / other_sd) ** 2)


def rest_of(total: ArrayLike, part: ArrayLike) -> Array:
    """What independent error is left of a total error beside a part of it: they add in squares.

    NaN where the part is larger than the total.

    Examples
    --------
    >>> float(rest_of(5.0, 3.0))
    4.0
    """
    with np.errstate(invalid="ignore"):
        return np.asarray(np.sqrt(np.asarray(total, float) ** 2 - np.asarray(part, float) ** 2))


def off_nadir(shorter: ArrayLike, longer: ArrayLike) -> Array:
    """How far from straight down a pixel looks that covers ``longer``, where straight down it is ``shorter``.

    Along the slope of the view a pixel covers ``1 / cos^2`` of the angle as much, on level ground; rad. NaN
    where ``longer`` is shorter.

    Examples
    --------
    >>> bool(np.isclose(off_nadir(1.0, 2.0), np.pi / 4))
    True
    """
    with np.errstate(invalid="ignore"):
        return np.asarray(np.arccos(np.sqrt(np.asarray(shorter, float) / longer)))
