"""The cell that stands for a place: generalised, never randomised, and how far off that may be."""

from __future__ import annotations

import math
from dataclasses import dataclass

import pymap3d.vincenty

#: Sides of cells, degrees, by GBIF's guide.
SIDES = (0.001, 0.01, 0.1)
#: Digits after the point of a cell's middle are its own, so that no rounding error prints more of them.
_DIGITS = 6


@dataclass(frozen=True)
class Cell:
    """A cell of a grid that is the same for all flights.

    Attributes
    ----------
    latitude_deg, longitude_deg
        Its middle.
    size_deg
        Its side, degrees.
    uncertainty_m
        From the middle, no part of the flight is farther than this, metres, rounded up to two digits.
    """

    latitude_deg: float
    longitude_deg: float
    size_deg: float
    uncertainty_m: float


def cell_of(latitude_deg: float, longitude_deg: float, size_deg: float, reach_m: float = 0.0) -> Cell:
    """The cell that a place is in.

    Coordinates are rounded to multiples of the cell's side, as GBIF's guide has it, and before that to those
    of the finer ones: so every cell lies whole in one of the next size, and a copy for the public beside one
    for a partner tells nothing that the finer one does not. Two flights in one cell give the same one, so
    that no mean of many copies is nearer to the truth.

    Parameters
    ----------
    latitude_deg, longitude_deg
        Of the flight's middle.
    size_deg
        Side of the cells.
    reach_m
        How far the flight reaches from its middle.

    Returns
    -------
    Cell

    Examples
    --------
    >>> cell = cell_of(58.662064, 16.433337, 0.1)
    >>> cell.latitude_deg, cell.longitude_deg, cell.uncertainty_m
    (58.7, 16.4, 7000.0)
    """
    sides = [*(side for side in SIDES if side < size_deg), size_deg]
    lat, lon = latitude_deg, (longitude_deg + 180) % 360 - 180
    for side in sides:
        lat, lon = rounded(lat, side), rounded(lon, side)
    lat, lon = max(-90.0, min(90.0, lat)), -180.0 if lon >= 180.0 else lon
    # What was rounded more than once may be farther off by half of each of the finer sides.
    return Cell(lat, lon, size_deg, round_up(half_diagonal(lat, sum(sides)) + reach_m))


def rounded(value: float, step: float) -> float:
    """To the nearest multiple of a step, halves up."""
    return round(math.floor(value / step + 0.5) * step, _DIGITS) + 0.0


def half_diagonal(latitude_deg: float, size_deg: float) -> float:
    """From the middle of a cell to its farthest corner on the WGS84 ellipsoid, metres."""
    half = size_deg / 2
    corners = [max(-90.0, min(90.0, latitude_deg + side * half)) for side in (-1, 1)]
    distances = (pymap3d.vincenty.vdist(latitude_deg, 0.0, corner, half)[0] for corner in corners)
    return max(float(one) for one in distances)


def round_up(metres: float) -> float:
    """To two digits, never down."""
    if metres <= 0:
        return 0.0
    step = 10.0 ** (math.floor(math.log10(metres)) - 1)
    return round(math.ceil(metres / step - 1e-9) * step, _DIGITS)


def place_words(cell: Cell | None) -> str:
    """Where it was, in words; without a cell, that it is not told."""
    if cell is None:
        return "The place is withheld: distances are in metres from a point that is not named."
    lat, lon = _side(cell.latitude_deg, "N", "S"), _side(cell.longitude_deg, "E", "W")
    return (
        f"The flight was near {lat}, {lon}: in a cell of {cell.size_deg:g}° about that point, which is up "
        f"to {distance_words(cell.uncertainty_m)} from it. Distances are in metres from a point that is not "
        "named."
    )


def generalisation_words(cell: Cell | None, category: int) -> str:
    """The text for Darwin Core's ``dataGeneralizations`` (or ``informationWithheld``)."""
    of = f"(category {category} of GBIF's guide to sensitive species)"
    if cell is None:
        return f"informationWithheld: coordinates, heights above sea level and terrain withheld {of}."
    return (
        f"dataGeneralizations: coordinates rounded to {cell.size_deg:g} degrees {of}; "
        f"coordinateUncertaintyInMeters {cell.uncertainty_m:.0f}; heights above sea "
        "level and terrain withheld."
    )


def distance_words(metres: float) -> str:
    """``"6.3 km"``, ``"130 m"``: two digits as they are."""
    return f"{metres / 1e3:g} km" if metres >= 1e3 else f"{metres:g} m"


def _side(value: float, positive: str, negative: str) -> str:
    return f"{abs(value):g}° {positive if value >= 0 else negative}"
