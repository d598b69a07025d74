"""Published formulas that say something else than what they are for, computed both ways on one case.

What each is about lies in ``data/printed_numbers.toml``. Whether two results differ is computed, never
asserted.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import NamedTuple

import numpy as np
import pandas as pd

from wildlab.geometry.flodell import camera_rotation, geodetic_to_enu_linear, metres_per_degree
from wildlab.geometry.frames import Array, ned_to_enu
from wildlab.geometry.line_of_sight import compare_angles, in_field_of_view
from wildlab.planning.high_level import utilities
from wildlab.planning.information import SearchSensor, as_printed, bearing_information
from wildlab.reporting.text import number
from wildlab.simulation.landscape import synthetic_landscape
from wildlab.studies.printed_numbers.pairs import load_words

#: By how much of the larger one two results of one formula may differ and still be the same.
SAME = 0.001
#: The same of formulas of planning, which are held against derivatives.
MARGIN = 1e-9
#: The view on which these are computed: a camera 80 m above a point 60 m north and 30 m east of it.
POINT, CAMERA = (60.0, 30.0, 0.0), (0.0, 0.0, -80.0)


class Computed(NamedTuple):
    """What a formula gives as written, and what it is meant to give; ``axis`` is that of metres."""

    as_written: float
    meant: float
    axis: str = ""

    @property
    def differs(self) -> bool:
        """Whether the two are different."""
        return not abs(self.as_written - self.meant) <= SAME * max(abs(self.as_written), abs(self.meant))


def occlusion_of_itself() -> Computed:
    """F (2.24): the point's own angle is among those compared with it."""
    as_written, meant = (_share_in_sight(itself=itself, signed=False) for itself in (True, False))
    return Computed(as_written, meant)


def longer_side() -> Computed:
    """F 2.5.2: the longer side of the line is found by its sign."""
    as_written, meant = (_share_in_sight(itself=False, signed=signed) for signed in (True, False))
    return Computed(as_written, meant)


def view_behind() -> Computed:
    """F (2.22)-(2.23): a point behind the camera has the same quotient as one in front of it."""
    rng = np.random.default_rng(1)
    points = rng.normal(size=(20_000, 3))
    angles = (np.radians(60.0), np.radians(60.0))
    ahead = in_field_of_view(angles, points, np.zeros(3), camera_rotation(0.0, 0.0, 0.0))
    u, v = points[:, 1] / points[:, 0], points[:, 2] / points[:, 0]
    either = (np.abs(np.arctan(u)) <= angles[0] / 2) & (np.abs(np.arctan(v)) <= angles[1] / 2)
    return Computed(float(either.mean()), float(ahead.mean()))


def metres_added() -> Computed:
    """F (2.2)-(2.3): the product of a row and a column adds metres east to metres north."""
    origin = (np.radians(58.662064), np.radians(16.433337))  # F (2.1)
    away = np.radians(0.001)
    east, north = geodetic_to_enu_linear(origin[0] + away, origin[1] + away, origin)
    one = 0.001 * sum(metres_per_degree(origin[0]))
    # Of the two numbers that are meant, the one to which the one as written is nearer.
    meant = {"north": float(north), "east": float(east)}
    axis = min(meant, key=lambda name: abs(one - meant[name]))
    return Computed(one, meant[axis], axis)


#: Of both theses, in the order of their sections.
FORMULAS: Mapping[str, Callable[[], Computed]] = {
    "metres-added": metres_added,
    "view-behind": view_behind,
    "occlusion-of-itself": occlusion_of_itself,
    "longer-side": longer_side,
}


def formulas_table(computed: Mapping[str, Computed] | None = None) -> pd.DataFrame:
    """A row for each formula; ``computed`` left out, all of `FORMULAS`."""
    words = load_words()["formula"]
    rows = []
    for key, one in (computed or {key: compute() for key, compute in FORMULAS.items()}).items():
        said = {name: text.format(axis=one.axis) for name, text in words[key].items()}
        results = {name: number(getattr(one, name), 3) for name in ("as_written", "meant")}
        said["reading"] = said.pop("meant")
        rows.append(said | results | {"verdict": "differ" if one.differs else "agree"})
    return pd.DataFrame(rows)


class Shown(NamedTuple):
    """A formula of planning on one view, in numbers, and whether it differs from what it should follow from;
    None where it is not defined."""

    shown: str
    apart: bool | None

    @property
    def verdict(self) -> str:
        """In words."""
        return "not defined" if self.apart is None else "differ" if self.apart else "agree"


def information_formulas() -> dict[str, Shown]:
    """F (A.1) element by element and the derivatives of (5.7), in units of 1 / (sigma r)^2."""
    written, derived, theta = _both()
    at = f"at an elevation of {np.degrees(theta):.0f}°".replace("-", "−")
    projection = np.abs(written @ written - written).max()
    # (A.1) with the sign of an elevation that counts upwards, and cos^2 in element 33.
    corrected = written * np.array([[1.0, 1.0, -1.0], [1.0, 1.0, -1.0], [-1.0, -1.0, 1.0]])
    corrected[2, 2] = float(np.cos(theta) ** 2)
    elements = {
        "element-33": ((2, 2),),
        "signs": ((0, 2), (1, 2)),
        "level": ((0, 0), (0, 1), (1, 1)),
    }
    left = np.abs(corrected @ corrected - corrected).max()
    return {
        **{
            key: _compared([written[one] for one in which], [derived[one] for one in which], at)
            for key, which in elements.items()
        },
        "projection": Shown(
            f"its square differs from it by {projection:.2f}; corrected, by {left:.0e}",
            bool(projection > MARGIN),
        ),
    }


def aging_formulas() -> dict[str, Shown]:
    """F (5.5), with the sizes and the start of the matrices that it is for."""
    sizes, start = Shown("defined", False), Shown("defined", False)
    try:
        np.eye(2) @ np.eye(3) @ np.eye(2)
    except ValueError:
        sizes = Shown("I (2 x 2) times a matrix (3 x 3)", None)
    try:
        np.linalg.inv(np.zeros((3, 3)))
    except np.linalg.LinAlgError:
        start = Shown("0 has no inverse", None)
    return {"sizes": sizes, "start": start}


def utility_formulas() -> dict[str, Shown]:
    """F (5.2) and what it is for: a goal that is reached should no longer be flown to."""
    known = [np.eye(2), 400 * np.eye(2)]
    worth = utilities([[0.0, 0.0], [100.0, 0.0]], known, (0.0, 0.0), (50.0, 0.0), alpha=1.0, c=200.0)
    shown = (
        f"utility of an animal just found {worth[0]:.0f}, of one known to 20 m {worth[1]:.1f}, "
        f"of the search {worth[2]:.1f}"
    )
    return {"utility": Shown(shown, bool(np.argmax(worth) == 0))}


def planning_table() -> pd.DataFrame:
    """A row for each formula of planning: the words for it, what it gives on one view, and the verdict."""
    words = load_words()["planning"]
    computed = information_formulas() | aging_formulas() | utility_formulas()
    return pd.DataFrame(
        [{**words[key], "shown": one.shown, "verdict": one.verdict} for key, one in computed.items()]
    )


def _share_in_sight(*, itself: bool, signed: bool) -> float:
    """Share of a simulated terrain that is in sight from 60 m above its middle."""
    land = synthetic_landscape(1)
    nodes = np.argwhere(np.isfinite(land.height))
    lens = np.array([1.0, 1.0, 0.0])
    lens[2] = -float(land.heights_at(lens[None, :2])[0]) - 60.0
    return float(compare_angles(land, nodes, lens, itself=itself, signed=signed).clear.mean())


def _both() -> tuple[Array, Array, float]:
    """(A.1) and the derivatives in F's axes, in units of 1 / (sigma r)^2, and the elevation, rad."""
    away = ned_to_enu(np.subtract(POINT, CAMERA))
    unit = float(away @ away)
    sensor = SearchSensor(1.0, 1.0, sd=1.0, reach=1.0, nearest=1e-9)
    turn = np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]])
    derived = turn @ bearing_information([POINT], CAMERA, sensor)[0] @ turn.T * unit
    written = as_printed([POINT], CAMERA, 1.0)[0] * unit
    return written, derived, float(np.arctan2(away[2], np.hypot(away[0], away[1])))


def _compared(written: Sequence[float], derived: Sequence[float], at: str) -> Shown:
    numbers = [", ".join(f"{value:.2f}" for value in each).replace("-", "−") for each in (written, derived)]
    apart = not np.allclose(written, derived, rtol=MARGIN, atol=MARGIN)
    return Shown(f"{at}: {numbers[0]} as written, {numbers[1]} derived", apart)
