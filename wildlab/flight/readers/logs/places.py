"""Which places and speeds cannot be true, for readers whose formats have them as numbers."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import ArrayLike, NDArray

from wildlab.flight.schema import DOWN, SPEED

Flags = NDArray[np.bool_]

#: Degrees around zero and zero where nobody flies: receivers without a place say so.
NOWHERE_DEG = 1e-6

#: What is said where `one_height` holds.
ONE_HEIGHT = (
    "the receiver gives one and the same number above the ellipsoid and above sea level: only the latter is "
    "kept, and may be the former"
)


def one_height(columns: Mapping[str, ArrayLike]) -> bool:
    """Whether a receiver's heights above the ellipsoid and above sea level are the same in all rows."""
    if not {"height_sea_m", "height_ellipsoid_m"} <= set(columns):
        return False
    apart = np.asarray(columns["height_sea_m"], float) - np.asarray(columns["height_ellipsoid_m"], float)
    known = np.isfinite(apart)
    return bool(known.any() and (apart[known] == 0).all())


def placed(latitude_deg: ArrayLike, longitude_deg: ArrayLike) -> Flags:
    """(N,) whether latitudes and longitudes (N,) are numbers, on Earth, and not both zero."""
    latitude, longitude = np.asarray(latitude_deg, float), np.asarray(longitude_deg, float)
    with np.errstate(invalid="ignore"):
        nowhere = (np.abs(latitude) < NOWHERE_DEG) & (np.abs(longitude) < NOWHERE_DEG)
        return np.asarray((np.abs(latitude) <= 90) & (np.abs(longitude) <= 360) & ~nowhere)


def impossible_places(columns: Mapping[str, ArrayLike]) -> dict[str, Flags]:
    """Reason -> (N,) rows of a part whose heights or speeds cannot be true, as `make_stream` takes them.

    Parameters
    ----------
    columns
        Of the part; a height that is not a number says nothing, but a row needs one.

    Returns
    -------
    dict
    """
    heights = [np.asarray(columns[one], float) for one in columns if one.startswith("height")]
    speeds = [np.asarray(columns[one], float) for one in columns if one.startswith("v_")]
    found: dict[str, Flags] = {}
    with np.errstate(invalid="ignore"):
        if heights:
            found["no height"] = np.logical_and.reduce([np.isnan(one) for one in heights])
            outside = [(-one < DOWN[0]) | (-one > DOWN[1]) for one in heights]
            found["an impossible height"] = np.logical_or.reduce(outside)
        if speeds:
            fast = [(one < SPEED[0]) | (one > SPEED[1]) for one in speeds]
            found["an impossible speed"] = np.logical_or.reduce(fast)
    return found
