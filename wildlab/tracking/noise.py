"""How much a measurement may be off: covariances ``R`` (N, m, m), one for each row."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from wildlab.geometry.frames import Array


def constant_noise(n: int, *sd: float) -> Array:
    """(N, m, m) from one standard deviation for each of the m elements."""
    return np.tile(np.diag(np.square(sd)), (n, 1, 1))


def noise_by_altitude(height: ArrayLike, fraction: float = 0.05) -> Array:
    """Georeferenced positions, H 6.2.4: standard deviation a fraction of the height (N,) above the plane.

    0.05 is what H 6.4.4 flies with. (N, 2, 2) square metres.
    """
    sd = fraction * np.asarray(height, float)
    return np.asarray(sd[:, None, None] ** 2 * np.eye(2))
