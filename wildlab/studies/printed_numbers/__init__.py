"""Which numbers that H gives in two places, or of two related things, agree."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
from matplotlib.figure import Figure
from numpy.typing import ArrayLike

from wildlab.flight.files import read_toml
from wildlab.geometry.flodell import camera_rotation, geodetic_to_enu_linear, metres_per_degree
from wildlab.geometry.frames import Array, ned_to_enu
from wildlab.geometry.line_of_sight import compare_angles, in_field_of_view
from wildlab.messages.quantities import number
from wildlab.paths import DATA
from wildlab.planning.information import SearchSensor, as_printed, bearing_information
from wildlab.planning.planner import utilities
from wildlab.reporting.charts.forms import Values, rows_chart
from wildlab.reporting.figures import BLUE, INK, VERMILLION
from wildlab.reporting.published import published_values
from wildlab.simulation.landscape import synthetic_landscape
from wildlab.studies.page import Facts
from wildlab.studies.protocol import Study

#: By which factor two published numbers of one thing may differ and still agree: words like "approximately"
#: and "nearly", and the last digit given. Set once, for all.
MARGIN = 1.05
#: Mean of the two focal lengths of H (2.3), px.
FOCAL_LENGTH = (1159.2 + 1167.8) / 2
STUDIES = (
    "static-point",
    "slow-vessel",
    "linear-vs-nonlinear-fast",
    "linear-vs-nonlinear-slow",
    "coloured-noise-fast",
    "coloured-noise-drifting",
    "schmidt-fast-vessel",
    "schmidt-slow-vessel-eight",
    "schmidt-drifting-vessel-eight",
)

#: Published numbers by (subject, name), by study.
Published = Mapping[str, Mapping[tuple[str, str], float]]


class Pair(NamedTuple):
    """Two numbers that should agree: the published one, and the one that another place gives."""

    key: str
    one: float
    other: float

    @property
    def ratio(self) -> float:
        """How many times the other number the one is."""
        return self.one / self.other

    @property
    def apart(self) -> bool:
        """Whether the two differ by more than `MARGIN`, or cannot be computed."""
        return not 1 / MARGIN <= self.ratio <= MARGIN


def rescaled_nis(nis: ArrayLike, sd: ArrayLike, other_sd: ArrayLike) -> Array:
    """NIS of the same innovations with another standard deviation of the measurement noise, in one unit.

    Where the noise makes nearly all of the innovation's covariance, NIS goes with its inverse (H 3.12). The
    more the state's own covariance counts, the less NIS changes: this is its largest change.

    Examples
    --------
    >>> float(rescaled_nis(0.5, 20.0, 10.0))
    2.0
    """
    return np.asarray(np.asarray(nis, float) * (np.asarray(sd, float) / other_sd) ** 2)


def rest_of(total: ArrayLike, part: ArrayLike) -> Array:
    """The independent error that, with ``part``, adds up to ``total`` in squares; NaN where there is none.

    Examples
    --------
    >>> float(rest_of(5.0, 3.0))
    4.0
    """
    with np.errstate(invalid="ignore"):
        return np.asarray(np.sqrt(np.asarray(total, float) ** 2 - np.asarray(part, float) ** 2))


def _mean_of_the_slow_vessel(published: Published) -> tuple[float, float]:
    numbers = published["slow-vessel"]
    return float(np.hypot(numbers["observer", "mean_north"], numbers["observer", "mean_east"])), 2.0


def _reference(published: Published) -> tuple[float, float]:
    """H 5.6.2: angles that make the error of table 5.4 from 350 m, from 200 m; the rest of table 5.6."""
    images = published["static-point"]["observer", "mae"] * 200.0 / 350.0
    rest = float(rest_of(published["slow-vessel"]["observer", "mae"], images))
    return rest, published["coloured-noise-drifting"]["cv", "mae"]


def _nis_of_two_noises(published: Published) -> tuple[float, float]:
    numbers, metres = published["linear-vs-nonlinear-slow"], 30.0 * 300.0 / FOCAL_LENGTH
    return numbers["ekf", "nis"], float(rescaled_nis(numbers["kf", "nis"], 10.0, metres))


def _nis_of_two_poses_fast(published: Published) -> tuple[float, float]:
    observer = published["linear-vs-nonlinear-fast"]["ekf", "nis"]
    return published["schmidt-fast-vessel"]["ekf", "nis"], float(rescaled_nis(observer, 20.0, 30.0))


_PAIRS: Mapping[str, Callable[[Published], tuple[float, float]]] = {
    "noise-by-altitude": lambda _: (17.5, 0.05 * 300.0),
    "mean-within-two-metres": _mean_of_the_slow_vessel,
    "images-in-view": lambda _: (400.0, (80 - (50 - 20) - (80 - 72)) * 7.5),
    "frame-rate": lambda _: (141 / 14.0, 7.5),
    "images-of-the-first-case": lambda _: (8000.0, 25 * 60 * 7.5),
    "altitude": lambda _: ((200.0 + 300.0) / 2, 200.0),
    "reference": _reference,
    "pixels-and-metres": lambda _: (7.0, 20.0 * 350.0 / FOCAL_LENGTH),
    "nis-of-two-noises": _nis_of_two_noises,
    "nis-of-two-poses-fast": _nis_of_two_poses_fast,
    "nis-of-two-poses-slow": lambda published: (
        published["schmidt-slow-vessel-eight"]["ekf", "nis"],
        published["linear-vs-nonlinear-slow"]["ekf", "nis"],
    ),
    "the-same-filter-twice": lambda published: (
        published["coloured-noise-fast"]["cv", "mae"],
        published["linear-vs-nonlinear-fast"]["kf", "mae"],
    ),
}


def load_numbers() -> dict[str, dict[tuple[str, str], float]]:
    """Published numbers of `STUDIES` by study, and by (subject, name)."""
    return {study: dict(published_values(study)) for study in STUDIES}


def all_pairs(published: Published | None = None) -> list[Pair]:
    """Every pair, in the order of the thesis's subjects; ``published`` left out, what is published."""
    numbers = load_numbers() if published is None else published
    return [Pair(key, *compute(numbers)) for key, compute in _PAIRS.items()]


@lru_cache
def load_words() -> Mapping[str, Any]:
    """What each pair and formula is about: ``data/printed_numbers.toml``."""
    return read_toml(DATA / "printed_numbers.toml", "the words of pairs and formulas")


def pairs_table(pairs: list[Pair]) -> pd.DataFrame:
    """A row for each pair: both numbers, their ratio, whether they agree, and the words for them."""
    words = load_words()["pair"]
    return pd.DataFrame(
        [
            {
                **words[one.key],
                "one": one.one,
                "other": one.other,
                "ratio": one.ratio,
                "verdict": "differ" if one.apart else "agree",
            }
            for one in pairs
        ]
    )


def plot_ratios(pairs: list[Pair]) -> Figure:
    """How many times each number is the other, on one logarithmic axis."""
    words, ratios = load_words()["pair"], np.array([one.ratio for one in pairs])
    topics = [words[one.key]["topic"].partition(" (")[0] for one in pairs]
    apart = np.array([one.apart for one in pairs])
    series = {
        name: Values(np.where(which, ratios, np.nan), color=color)
        for name, which, color in (("agree", ~apart, BLUE), ("differ", apart, VERMILLION))
    }
    widest = 1.15 * max(MARGIN, *ratios, *(1 / ratios))
    limits = {"xscale": "log", "xlim": (1 / widest, widest)}
    fig = rows_chart(topics, series, "ratio", size=(5.9, 1.0 + 0.33 * len(pairs)), apart=0.0, **limits)
    (ax,) = fig.axes
    ax.axvspan(1 / MARGIN, MARGIN, color=BLUE, alpha=0.15, lw=0)
    ax.axvline(1.0, color=INK, lw=0.8)
    ticks = [tick for tick in (0.25, 0.5, 0.7, 1.0, 1.4, 2.0, 4.0) if 1 / widest <= tick <= widest]
    ax.set_xticks(ticks, [f"{tick:g}" for tick in ticks])
    ax.minorticks_off()
    return fig


#: By how much of the larger one two results of one formula may differ and still be the same.
SAME = 0.001
#: The same of formulas of planning, which are held against derivatives.
DERIVED_MARGIN = 1e-9
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


class FormulaResult(NamedTuple):
    """A formula of planning on one view, in numbers, and whether it differs from what it should follow from;
    None where it is not defined."""

    shown: str
    apart: bool | None

    @property
    def verdict(self) -> str:
        """In words."""
        return "not defined" if self.apart is None else "differ" if self.apart else "agree"


def information_formulas() -> dict[str, FormulaResult]:
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
        "projection": FormulaResult(
            f"its square differs from it by {projection:.2f}; corrected, by {left:.0e}",
            bool(projection > DERIVED_MARGIN),
        ),
    }


#: F (5.5), with the sizes and the start of the matrices that it is for.
AGING = {
    "sizes": FormulaResult("I (2 x 2) times a matrix (3 x 3)", None),
    "start": FormulaResult("0 has no inverse", None),
}


def utility_formulas() -> dict[str, FormulaResult]:
    """F (5.2) and what it is for: a goal that is reached should no longer be flown to."""
    known = [np.eye(2), 400 * np.eye(2)]
    worth = utilities([[0.0, 0.0], [100.0, 0.0]], known, (0.0, 0.0), (50.0, 0.0), alpha=1.0, c=200.0)
    shown = (
        f"utility of an animal just found {worth[0]:.0f}, of one known to 20 m {worth[1]:.1f}, "
        f"of the search {worth[2]:.1f}"
    )
    return {"utility": FormulaResult(shown, bool(np.argmax(worth) == 0))}


def planning_table() -> pd.DataFrame:
    """A row for each formula of planning: the words for it, what it gives on one view, and the verdict."""
    words = load_words()["planning"]
    computed = information_formulas() | AGING | utility_formulas()
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


def _compared(written: Sequence[float], derived: Sequence[float], at: str) -> FormulaResult:
    numbers = [", ".join(f"{value:.2f}" for value in each).replace("-", "−") for each in (written, derived)]
    apart = not np.allclose(written, derived, rtol=DERIVED_MARGIN, atol=DERIVED_MARGIN)
    return FormulaResult(f"{at}: {numbers[0]} as written, {numbers[1]} derived", apart)


def answer(facts: Facts) -> list[str]:
    """How many pairs of numbers differ by more than the margin."""
    ratios = [facts.value(subject, name) for name, subject in facts.recorded if name == "ratio"]
    if not ratios:
        return ["unknown"]
    if all(1 / MARGIN <= ratio <= MARGIN for ratio in ratios):
        return ["all-agree"]
    return ["some-differ", "reasons"]


STUDY = Study("printed-numbers", answer=answer)
