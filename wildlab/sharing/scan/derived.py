"""Numbers that follow from a place, and give it away as well."""

from __future__ import annotations

import numpy as np

from wildlab.flight.heights import undulation
from wildlab.geometry.gravity import EARTH_RATE, normal_gravity
from wildlab.sharing.scan.secrets import Array

# WGS84: semi-major axis (m), first eccentricity squared.
_A, _E2 = 6378137.0, 6.69437999014e-3
#: Of so many places only: of more, by chance one number is always among them.
MOST = 3


def derived_numbers(places: Array) -> list[float]:
    """Gravity, the geoid's undulation, radii of the Earth, what a degree measures: at the first few places.

    Parameters
    ----------
    places
        (N, 3) as `Secrets` has them: the origin first.

    Returns
    -------
    list
        The undulation only where a grid of it is installed.
    """
    some = places[:MOST]
    if not len(some):
        return []
    latitude, height = np.radians(some[:, 0]), np.nan_to_num(some[:, 2])
    s2 = np.sin(latitude) ** 2
    meridian, normal = _A * (1 - _E2) / (1 - _E2 * s2) ** 1.5, _A / np.sqrt(1 - _E2 * s2)
    degree = np.radians(1.0)
    heights = undulation(some[:, 0], some[:, 1])
    found = [
        normal_gravity(latitude, height),
        meridian, normal, meridian * degree, normal * np.cos(latitude) * degree,
        EARTH_RATE * np.cos(latitude), EARTH_RATE * np.sin(latitude),
        *([] if heights is None else [heights]),
    ]  # fmt: skip
    return [float(value) for value in np.concatenate(found) if np.isfinite(value)]
