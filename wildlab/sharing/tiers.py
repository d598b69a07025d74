"""Who is told what of where and when: ``data/sharing/tiers.toml``, and a flight's place in it."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from typing import Annotated, Literal

from pydantic import Field, model_validator

from wildlab.errors import WildlabError
from wildlab.flight.files import Strict, check_model, read_toml
from wildlab.flight.manifest_parts import LocationsPart
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
            raise ValueError("the categories are not 1, 2, 3, 4; give each once, in that order")
        if set(self.unstated) != {"withheld", "generalised", "open"} or set(self.tier) != set(TIERS):
            raise ValueError("a sensitivity or a tier has no row; give each one")
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
            f"category {agreed} is agreed with partners, and the public is told by category {category}, "
            "which is less careful",
            "set agreed_category to the category or above it, or leave it out",
            field="locations.agreed_category",
        )
    stated = own is not None
    if row.agreed and agreed is not None:
        category, stated = agreed, True
    cell = table.category[category - 1].cell_deg
    return Treatment(tier, category, stated, None if row.exact else cell, row.dates[category - 1], row.exact)
