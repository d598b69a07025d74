"""Which numbers that H gives in two places, or of two related things, agree."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
from matplotlib.figure import Figure
from numpy.typing import ArrayLike

from wildlab.flight.files import read_toml
from wildlab.geometry.frames import Array
from wildlab.paths import DATA
from wildlab.reporting.charts.forms import Values, rows_chart
from wildlab.reporting.figures import BLUE, INK, VERMILLION
from wildlab.reporting.published import published_values

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
    """What each pair is about: ``data/printed_numbers.toml``."""
    return read_toml(DATA / "printed_numbers.toml", "the words of pairs")


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
