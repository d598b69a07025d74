"""Printed formulas whose letter is not what they are for: what each does, computed on a case.

Which words follow is decided by the computed number (`Formula.differs`), not by this file.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np
import pandas as pd

from wildlab.geometry.flodell import camera_rotation, geodetic_to_enu_linear, metres_per_degree
from wildlab.geometry.line_of_sight import compare_angles, in_field_of_view
from wildlab.reporting.text import number
from wildlab.simulation.landscape import synthetic_landscape

COLUMNS = {
    "where": "where",
    "printed": "printed",
    "measure": "what is computed",
    "letter": "by the letter",
    "sense": "in its sense",
    "verdict": "the letter",
    "meant": "what is meant",
}
#: By how much of the larger one two results of one formula may differ and still be the same.
SAME = 0.001


class Formula(NamedTuple):
    """A printed formula, its letter beside its sense.

    Attributes
    ----------
    where
        Section and number.
    printed
        What the print says, in words.
    measure
        What is computed of both, with its unit.
    letter, sense
        The results.
    meant
        How it is read here, and where that stands.
    """

    where: str
    printed: str
    measure: str
    letter: float
    sense: float
    meant: str

    @property
    def differs(self) -> bool:
        """Whether letter and sense give something else."""
        return not abs(self.letter - self.sense) <= SAME * max(abs(self.letter), abs(self.sense))


def occlusion_of_itself() -> Formula:
    """F (2.24): the point's own angle is among those compared with it."""
    letter, sense = (_seen(itself=itself, signed=False) for itself in (True, False))
    return Formula(
        "F 2.5.2, (2.24)",
        "a point is occluded if some angle of the line is smaller than or equal to its own; its own is "
        "one of them",
        "share of a drawn land that is seen from 60 m above its middle",
        letter,
        sense,
        "only points before it can hide a point (`compare_angles`)",
    )


def longer_side() -> Formula:
    """F 2.5.2: the longer side of the line is found by its sign."""
    letter, sense = (_seen(itself=False, signed=signed) for signed in (True, False))
    return Formula(
        "F 2.5.2",
        "the line is scaled along y if dx <= dy, along x otherwise, without absolute values",
        "share of a drawn land that is seen from 60 m above its middle",
        letter,
        sense,
        "the longer of both sides, whatever its sign (`compare_angles`)",
    )


def view_behind() -> Formula:
    """F (2.22)-(2.23): a point behind the camera has the same quotient as one before it."""
    rng = np.random.default_rng(1)
    points = rng.normal(size=(20_000, 3))
    angles = (np.radians(60.0), np.radians(60.0))
    ahead = in_field_of_view(angles, points, np.zeros(3), camera_rotation(0.0, 0.0, 0.0))
    u, v = points[:, 1] / points[:, 0], points[:, 2] / points[:, 0]
    letter = (np.abs(np.arctan(u)) <= angles[0] / 2) & (np.abs(np.arctan(v)) <= angles[1] / 2)
    return Formula(
        "F 2.5.1, (2.22) and (2.23)",
        "a point is in the field of view if the angles of two quotients are small; both signs turned give "
        "the same",
        "share of all directions that a view of 60 by 60 degrees holds",
        float(letter.mean()),
        float(ahead.mean()),
        "points before the camera only (`in_field_of_view`)",
    )


def metres_added() -> Formula:
    """F (2.2)-(2.3): the product of a row and a column adds metres east to metres north."""
    origin = (np.radians(58.662064), np.radians(16.433337))  # F (2.1)
    away = np.radians(0.001)
    east, north = geodetic_to_enu_linear(origin[0] + away, origin[1] + away, origin)
    k_phi, k_lambda = metres_per_degree(origin[0])
    one = 0.001 * (k_phi + k_lambda)
    # Of the two numbers that are meant, the one to which the one of the letter is nearer.
    axis, meant = min(
        {"north": float(north), "east": float(east)}.items(), key=lambda item: abs(one - item[1])
    )
    return Formula(
        "F 2.3.1, (2.2)",
        "a row of two factors times a column of two differences, which is one number and not two",
        f"metres {axis} of a point 0.001 degrees further north and east; the letter has one number for both",
        one,
        meant,
        "one factor for each axis (`geodetic_to_enu_linear`)",
    )


#: Of both theses, in the order of their sections.
FORMULAS: tuple[Callable[[], Formula], ...] = (metres_added, view_behind, occlusion_of_itself, longer_side)


def all_formulas() -> list[Formula]:
    """Every formula of `FORMULAS`, computed."""
    return [make() for make in FORMULAS]


def formulas_table(formulas: Sequence[Formula]) -> pd.DataFrame:
    """A row for each formula, with the columns of `COLUMNS`."""
    rows = []
    for one in formulas:
        row = one._asdict() | {"verdict": "does something else" if one.differs else "does the same"}
        rows.append(row | {name: number(getattr(one, name), 3) for name in ("letter", "sense")})
    return pd.DataFrame(rows)


def formulas_words(formulas: Sequence[Formula]) -> str:
    """How many of them do something else by the letter."""
    count = sum(one.differs for one in formulas)
    return (
        f"By the letter {count} of {len(formulas)} printed formulas do something else than what they are "
        f"for. "
        "Each was computed both ways on one case; what is used here is the sense."
    )


def _seen(*, itself: bool, signed: bool) -> float:
    """Share of a drawn land that is seen from 60 m above its middle."""
    land = synthetic_landscape(1)
    nodes = np.argwhere(np.isfinite(land.height))
    lens = np.array([1.0, 1.0, 0.0])
    lens[2] = -float(land.heights_at(lens[None, :2])[0]) - 60.0
    return float(compare_angles(land, nodes, lens, itself=itself, signed=signed).clear.mean())
