"""Who is told what of where and when: ``data/sharing/tiers.toml``, a flight's place in it, and the cell that
stands for a place: generalised, never randomised, and how far off that may be."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from typing import Annotated, Literal

import pymap3d.vincenty
from pydantic import Field, model_validator

from wildlab.errors import WildlabError
from wildlab.flight.files import Strict, check_model, read_toml
from wildlab.flight.manifest import LocationsPart
from wildlab.messages.catalogue import fill, load_texts
from wildlab.paths import DATA

Tier = Literal["public", "partner", "team"]
#: The most careful first.
TIERS: tuple[Tier, ...] = ("public", "partner", "team")
#: What a date is cut down to.
Date = Literal["month", "day", "exact"]
FILE = DATA / "sharing" / "tiers.toml"
_Dates = tuple[Date, Date, Date, Date]


class CategoryRow(Strict):
    """One category: its cell, degrees; None where the place is withheld."""

    number: Annotated[int, Field(ge=1, le=4)]
    what: str
    cell_deg: Annotated[float, Field(gt=0, le=1)] | None = None


class TierRow(Strict):
    """One tier. ``agreed``: what was agreed counts; ``exact``: nothing of the flight is changed."""

    agreed: bool
    exact: bool = False
    dates: _Dates
    why: str


class Table(Strict):
    """The whole file."""

    category: tuple[CategoryRow, ...]
    unstated: dict[Literal["withheld", "generalised", "open"], Annotated[int, Field(ge=1, le=4)]]
    tier: dict[Tier, TierRow]

    @model_validator(mode="after")
    def _whole(self) -> Table:
        if [row.number for row in self.category] != [1, 2, 3, 4]:
            raise ValueError("give the categories 1, 2, 3, 4 in that order")
        if set(self.unstated) != {"withheld", "generalised", "open"} or set(self.tier) != set(TIERS):
            raise ValueError("give each sensitivity and tier a row")
        return self


@dataclass(frozen=True)
class Treatment:
    """What becomes of one flight in a copy.

    Attributes
    ----------
    tier
        For whom.
    category
        1, the most sensitive, to 4, by which place and date are told.
    stated
        Whether the manifest states the category (or what was agreed); else it was assumed.
    cell_deg
        The cell that is named, degrees; None where the place is withheld.
    date
        What dates are cut down to.
    exact
        Whether the flight stays as it is.
    unconfirmed
        A less careful category that the manifest states and nobody has confirmed; None where there is none.
    """

    tier: Tier
    category: int
    stated: bool
    cell_deg: float | None
    date: Date
    exact: bool
    unconfirmed: int | None = None


@cache
def load_tiers(path: Path = FILE) -> Table:
    """The table of tiers and categories.

    Raises
    ------
    WildlabError
        Where the file is missing, or a key is unknown, missing or wrong.
    """
    return check_model(Table, read_toml(path, "the table of tiers"), path)


def confirmed_treatment(locations: LocationsPart, confirmed: LocationsPart, tier: Tier) -> Treatment:
    """As `treatment_of`, by the more careful of what is stated and what was confirmed.

    Parameters
    ----------
    locations
        As the manifest states them.
    confirmed
        As they were written, or accepted last.
    tier
        For whom the copy is.

    Returns
    -------
    Treatment

    Examples
    --------
    >>> found = confirmed_treatment(LocationsPart(category=3), LocationsPart(category=1), "public")
    >>> found.category, found.unconfirmed
    (1, 3)
    """
    stated, before = (treatment_of(one, tier) for one in (locations, confirmed))
    if before.category >= stated.category:
        return stated
    return replace(before, unconfirmed=stated.category)


def treatment_of(locations: LocationsPart, tier: Tier) -> Treatment:
    """What becomes of a flight with such locations in a copy of a tier.

    Parameters
    ----------
    locations
        As ``[locations]`` of its manifest has it.
    tier
        For whom the copy is.

    Returns
    -------
    Treatment

    Raises
    ------
    WildlabError
        Where a category was agreed that is more careful than that of the public, which contradicts itself.

    Examples
    --------
    >>> treatment_of(LocationsPart(), "public").cell_deg is None
    True
    >>> treatment_of(LocationsPart(category=2), "public").cell_deg
    0.1
    """
    table = load_tiers()
    row = table.tier[tier]
    own, agreed = locations.category, locations.agreed_category
    category = table.unstated[locations.sensitivity] if own is None else own
    if agreed is not None and agreed < category:
        raise WildlabError(
            f"category {agreed}, agreed with partners, is more careful than the public's {category}",
            "set agreed_category to the category or above",
            field="locations.agreed_category",
        )
    stated = own is not None
    if row.agreed and agreed is not None:
        category, stated = agreed, True
    cell = table.category[category - 1].cell_deg
    return Treatment(tier, category, stated, None if row.exact else cell, row.dates[category - 1], row.exact)


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
        lat, lon = round_to_step(lat, side), round_to_step(lon, side)
    lat, lon = max(-90.0, min(90.0, lat)), -180.0 if lon >= 180.0 else lon
    # What was rounded more than once may be farther off by half of each of the finer sides.
    return Cell(lat, lon, size_deg, round_up(half_diagonal(lat, sum(sides)) + reach_m))


def round_to_step(value: float, step: float) -> float:
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


def describe(key: str, **values: object) -> str:
    """A text of ``data/messages/en/sharing.toml`` with its values."""
    return fill(load_texts("sharing").answers[key], {}, {name: str(value) for name, value in values.items()})


def describe_place(cell: Cell | None) -> str:
    """Where it was, in words; without a cell, that it is not told."""
    if cell is None:
        return describe("withheld")
    metres = cell.uncertainty_m
    return describe(
        "cell",
        latitude=_side(cell.latitude_deg, "N", "S"),
        longitude=_side(cell.longitude_deg, "E", "W"),
        size=f"{cell.size_deg:g}",
        uncertainty=f"{metres / 1e3:g} km" if metres >= 1e3 else f"{metres:g} m",
    )


def describe_generalisation(cell: Cell | None, category: int) -> str:
    """The text for Darwin Core's ``dataGeneralizations`` (or ``informationWithheld``)."""
    if cell is None:
        return describe("information-withheld", category=category)
    size, metres = f"{cell.size_deg:g}", f"{cell.uncertainty_m:.0f}"
    return describe("data-generalizations", category=category, size=size, metres=metres)


def _side(value: float, positive: str, negative: str) -> str:
    return f"{abs(value):g}° {positive if value >= 0 else negative}"
