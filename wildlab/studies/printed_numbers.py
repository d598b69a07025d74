"""Which numbers that H gives in two places, or of two related things, agree."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from wildlab.flight.files import read_toml
from wildlab.paths import DATA
from wildlab.reporting.charts.drawing import Values, rows_chart
from wildlab.reporting.figures import BLUE, INK, VERMILLION
from wildlab.reporting.published import published_values
from wildlab.studies.rules import Rules

#: By which factor two published numbers of one thing may differ and still agree: words like "approximately"
#: and "nearly", and the last digit given. Set once, for all.
MARGIN = 1.05


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


def published_number(key: str) -> float:
    """A published number by "study/subject/name"."""
    study, subject, name = key.split("/")
    return published_values(study)[subject, name]


def all_pairs(number: Callable[[str], float] = published_number) -> list[Pair]:
    """Every pair, in the order of the thesis's subjects; ``number`` gives what is published."""
    words = load_words()
    rules = Rules(number, words["given"])
    return [
        Pair(key, *(float(rules(one[side])) for side in ("one", "other")))
        for key, one in words["pair"].items()
    ]


@lru_cache
def load_words() -> Mapping[str, Any]:
    """The pairs and what each is about: ``data/printed_numbers.toml``."""
    return read_toml(DATA / "printed_numbers.toml", "the pairs of numbers")


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
