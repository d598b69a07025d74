"""Two printed numbers that should fit together, and where the numbers of tables are read.

Every word that says whether two numbers fit follows from `Item.apart`.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

from wildlab.reporting.published import load_published

#: By which factor two printed numbers of one thing may differ and still fit together: words like
#: "approximately" and "nearly", and the last digit printed. Set once, for all.
MARGIN = 1.05

#: Published numbers by (subject, name), by study.
Printed = Mapping[str, Mapping[tuple[str, str], float]]

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


class Item(NamedTuple):
    """Two numbers that should fit together.

    Attributes
    ----------
    key, topic
        Name of the metric's subject, and in words.
    quotes
        What is printed: (section, words).
    one, other
        The printed number, and what another print makes of it.
    unit
        Of both, ``""`` for none.
    arithmetic
        How the other comes about.
    differs
        What is not the same in the two places.
    reading
        What follows if they do not fit together, and what if they do.
    """

    key: str
    topic: str
    quotes: tuple[tuple[str, str], ...]
    one: float
    other: float
    unit: str
    arithmetic: str
    differs: str
    reading: tuple[str, str]

    @property
    def ratio(self) -> float:
        """How many times the other number the one is."""
        return self.one / self.other

    @property
    def apart(self) -> bool:
        """Whether the two differ by more than `MARGIN`; so does what cannot be computed."""
        return not 1 / MARGIN <= self.ratio <= MARGIN

    @property
    def label(self) -> str:
        """The key in words, for an axis."""
        words = self.key.replace("-", " ").replace("nis ", "NIS ")
        return words[0].upper() + words[1:]

    @property
    def verdict(self) -> str:
        """In two words."""
        return "do not fit" if self.apart else "fit together"

    @property
    def title(self) -> str:
        """The two numbers, and whether they fit."""
        unit = f" {self.unit}" if self.unit else ""
        said = f"{self.topic}: {_figures(self.one)}{unit} beside {_figures(self.other)}{unit}"
        return f"{said}, {self.ratio:.2f} times" if self.apart else f"{said}, which fit together"


def _figures(value: float) -> str:
    """Three figures, and no more after the point than they need."""
    return f"{value:.0f}" if abs(value) >= 100 else f"{value:#.3g}".rstrip(".")


def load_printed() -> dict[str, dict[tuple[str, str], float]]:
    """Published numbers of `STUDIES` by study, and by (subject, name)."""
    found = {}
    for study in STUDIES:
        table = load_published(study)
        found[study] = dict(
            zip(zip(table["subject"], table["name"], strict=True), table["value"], strict=True)
        )
    return found
