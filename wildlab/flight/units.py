"""Units a recipe may name, and what takes a value in them to radians, metres, seconds, pixels, microtesla."""

from __future__ import annotations

import math
from typing import Literal

from wildlab.geometry.gravity import STANDARD_GRAVITY

Dimension = Literal["angle", "length", "speed", "acceleration", "rate", "pixel", "time", "field"]

UNITS: dict[Dimension, dict[str, float]] = {
    "angle": {"deg": math.radians(1), "rad": 1.0, "deg-e7": math.radians(1e-7)},
    "length": {"m": 1.0, "cm": 0.01, "mm": 0.001, "km": 1000.0, "ft": 0.3048},
    "speed": {"m/s": 1.0, "cm/s": 0.01, "km/h": 1 / 3.6, "ft/s": 0.3048, "kn": 1852 / 3600},
    "acceleration": {"m/s2": 1.0, "g": STANDARD_GRAVITY, "mg": 1e-3 * STANDARD_GRAVITY, "ft/s2": 0.3048},
    "rate": {"rad/s": 1.0, "deg/s": math.radians(1), "mrad/s": 1e-3, "deg/h": math.radians(1) / 3600},
    # A proportion counts from 0 at the left or upper edge to 1 at the other.
    "pixel": {"px": 1.0, "proportion-of-width": math.nan, "proportion-of-height": math.nan},
    # To microtesla.
    "field": {"uT": 1.0, "nT": 1e-3, "T": 1e6, "G": 100.0, "mG": 0.1},
    "time": {"s": 1.0, "ms": 1e-3, "us": 1e-6},
}


def other_units(dimension: Dimension) -> dict[str, float]:
    """The units of a dimension that are not the one that is used inside, with what takes a value to that one.

    Examples
    --------
    >>> sorted(other_units("rate"))
    ['deg/h', 'deg/s', 'mrad/s']
    """
    return {unit: to for unit, to in UNITS[dimension].items() if to != 1}


def factor(unit: str, dimension: Dimension, width_px: float = math.nan, height_px: float = math.nan) -> float:
    """What to multiply by; the size of the image is only needed for proportions of it.

    Raises
    ------
    ValueError
        ``"problem; fix"`` where the unit is not one, or not one of this dimension.
    """
    if unit not in UNITS[dimension]:
        known = ", ".join(UNITS[dimension])
        elsewhere = [name for name, units in UNITS.items() if unit in units]
        what = (
            f"{unit!r} is a unit of {elsewhere[0]}, not of {dimension}"
            if elsewhere
            else f"{unit!r} is not a unit"
        )
        raise ValueError(f"{what}; use one of {known}")
    if unit == "proportion-of-width":
        return width_px
    if unit == "proportion-of-height":
        return height_px
    return UNITS[dimension][unit]
