"""Printed formulas that do not follow from one another: F's planning by information (5.2, 5.5, appendix A).

Whether a formula and what it should follow from differ is computed on one view, never asserted.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import pandas as pd

from wildlab.geometry.frames import Array, ned_to_enu
from wildlab.planning.high_level import utilities
from wildlab.planning.information import SearchSensor, as_printed, bearing_information

#: The view on which formulas are held against each other: a camera 80 m above a point 60 m north, 30 m east.
POINT, CAMERA = (60.0, 30.0, 0.0), (0.0, 0.0, -80.0)
#: Relative difference from which two results count as different.
MARGIN = 1e-9
COLUMNS = {
    "where": "where",
    "printed": "printed",
    "follows": "what follows",
    "shown": "on one view",
    "verdict": "the two",
}


class Formula(NamedTuple):
    """A formula beside what another place of the same thesis makes of it.

    Attributes
    ----------
    where, printed, follows
        Of the formula: place, what it says, and what it should say by the other place.
    shown
        Both on one view, in numbers.
    apart
        Whether they differ there.
    defined
        Whether there is anything to compute: what is not defined as printed differs from nothing.
    """

    where: str
    printed: str
    follows: str
    shown: str
    apart: bool
    defined: bool = True

    @property
    def formula(self) -> str:
        """The numbered formula that it is, or is a part of."""
        return self.where.partition(")")[0] + ")"

    @property
    def verdict(self) -> str:
        """In words."""
        return "differ" if self.apart else "agree" if self.defined else "not defined"


def information_formulas() -> list[Formula]:
    """F (A.1) element by element beside the derivatives of (5.7), in units of 1 / (sigma r)^2."""
    letter, derived, theta = _both()
    cos2 = float(np.cos(theta) ** 2)
    low = np.degrees(theta)
    level = f"at an elevation of {low:.0f}°".replace("-", "−")
    projection = np.abs(letter @ letter - letter).max()
    # (A.1) with the sign of an elevation that counts upwards, and cos^2 in element 33.
    mended = letter * np.array([[1.0, 1.0, -1.0], [1.0, 1.0, -1.0], [-1.0, -1.0, 1.0]])
    mended[2, 2] = cos2
    signs, level_ones = ((0, 2), (1, 2)), ((0, 0), (0, 1), (1, 1))
    return [
        _of("F (A.1), element 33", "sin θ", "cos² θ, from (5.7)", (letter[2, 2],), (derived[2, 2],), level),
        _of(
            "F (A.1), elements 13 and 23", "with a plus",
            "with a minus, from (5.7), whose elevation counts upwards",
            [letter[one] for one in signs], [derived[one] for one in signs], level,
        ),
        _of(
            "F (A.1), elements 11, 12 and 22", "what the azimuth tells, once",
            "divided by cos² θ, from (5.7) with the same noise for both angles",
            [letter[one] for one in level_ones], [derived[one] for one in level_ones], level,
        ),
        Formula(
            "F (A.1) as a whole", "the sums of one image", "a projection, were sign and element 33 mended",
            f"the square differs from the matrix by {projection:.2f}; mended, by "
            f"{np.abs(mended @ mended - mended).max():.0e}",
            bool(projection > MARGIN),
        ),
    ]  # fmt: skip


def aging_formulas() -> list[Formula]:
    """F (5.5) beside the sizes and the start of the matrices it is for."""
    try:
        np.eye(2) @ np.eye(3) @ np.eye(2)
        sizes = ""
    except ValueError:
        sizes = "I (2 x 2) times a matrix (3 x 3): not defined"
    try:
        np.linalg.inv(np.zeros((3, 3)))
        start = ""
    except np.linalg.LinAlgError:
        start = "0 has no inverse"
    return [
        Formula(
            "F (5.5)", "F_t = G_t = I, 2 x 2", "3 x 3 for the state, 3 x 2 for a walk on the ground",
            sizes or "defined", False, not sizes,
        ),
        Formula(
            "F (5.5) and the text below (5.4)", "information begins at 0",
            "(5.5) and (5.6) invert it; (5.10) begins with a small value", start or "defined",
            False, not start,
        ),
    ]  # fmt: skip


def utility_formulas() -> list[Formula]:
    """F (5.2) beside what it is for: a goal that is reached should no longer be flown to."""
    known = [np.eye(2), 400 * np.eye(2)]
    worth = utilities([[0.0, 0.0], [100.0, 0.0]], known, (0.0, 0.0), (50.0, 0.0), alpha=1.0, c=200.0)
    return [
        Formula(
            "F (5.2) with (5.3)", "utility over distance", "the next goal, once one is reached",
            f"an animal just found is worth {worth[0]:.0f}, one known to 20 m {worth[1]:.1f}, the search "
            f"{worth[2]:.1f}",
            bool(np.argmax(worth) == 0),
        )
    ]  # fmt: skip


def all_formulas() -> list[Formula]:
    """All of them, in the order of the page."""
    return [*information_formulas(), *aging_formulas(), *utility_formulas()]


def table_of_formulas(formulas: Sequence[Formula]) -> pd.DataFrame:
    """A row for each, with the columns of `COLUMNS`."""
    return pd.DataFrame([{name: getattr(one, name) for name in COLUMNS} for one in formulas])


def formula_words(formulas: Sequence[Formula]) -> str:
    """How many do not follow, and where what is used here stands."""
    computed, empty = ([one for one in formulas if one.defined is so] for so in (True, False))
    parts = sum(one.apart for one in computed)
    names = {one.formula for one in computed}
    apart = {one.formula for one in computed if one.apart}
    undefined = f" {len(empty)} more are not defined as printed, so that nothing differs." if empty else ""
    return (
        f"{len(apart)} of {len(names)} printed formulas of F's planning differ from what another place of F "
        f"makes of them, in {parts} of {len(computed)} rows: of a matrix every row is a part.{undefined} "
        "What is used here is derived from (5.7) and held against numerical derivatives; the print is "
        "computed beside it for this table alone."
    )


def _both() -> tuple[Array, Array, float]:
    """The print and the derivatives in F's axes, in units of 1 / (sigma r)^2, and the elevation, rad."""
    away = ned_to_enu(np.subtract(POINT, CAMERA))
    unit = float(away @ away)
    sensor = SearchSensor(1.0, 1.0, sd=1.0, reach=1.0, nearest=1e-9)
    turn = np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]])
    derived = turn @ bearing_information([POINT], CAMERA, sensor)[0] @ turn.T * unit
    letter = as_printed([POINT], CAMERA, 1.0)[0] * unit
    return letter, derived, float(np.arctan2(away[2], np.hypot(away[0], away[1])))


def _of(
    where: str, printed: str, follows: str, letter: Sequence[float], derived: Sequence[float], level: str
) -> Formula:
    numbers = [", ".join(f"{value:.2f}" for value in each).replace("-", "−") for each in (letter, derived)]
    apart = not np.allclose(letter, derived, rtol=MARGIN, atol=MARGIN)
    return Formula(where, printed, follows, f"{level}: {numbers[0]} as printed, {numbers[1]} derived", apart)
