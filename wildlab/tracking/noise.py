"""How much a measurement may be off: covariances ``R`` (N, m, m), one for each row."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from wildlab.geometry.frames import Array


def constant_noise(n: int, *sd: float) -> Array:
    """The same uncorrelated noise in all rows.

    Parameters
    ----------
    n
        N, the number of rows.
    sd
        Standard deviation of each of the m elements of a measurement, in the element's own unit.

    Returns
    -------
    R, (N, m, m), in the units squared.
    """
    return np.tile(np.diag(np.square(sd)), (n, 1, 1))


def noise_by_altitude(height: ArrayLike, fraction: float = 0.05) -> Array:
    """Georeferenced positions, H 6.2.4: standard deviation a fraction of the height above the plane.

    Parameters
    ----------
    height
        (N,) of the camera above the plane, m.
    fraction
        Without a unit, the same north and east; 0.05 is what H 6.4.4 flies with.

    Returns
    -------
    R, (N, 2, 2), m^2.
    """
    sd = fraction * np.asarray(height, float)
    return np.asarray(sd[:, None, None] ** 2 * np.eye(2))
