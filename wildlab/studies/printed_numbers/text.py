"""What the page on printed numbers says, as the items have it."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from wildlab.reporting.figures import BLUE, INK, VERMILLION, new_figure
from wildlab.studies.printed_numbers.item import MARGIN, Item

COLUMNS = {
    "label": "pair",
    "topic": "what",
    "one": "printed",
    "other": "from another print",
    "unit": "unit",
    "ratio": "times",
    "verdict": "the two",
}
DIGITS = {"one": 2, "other": 2, "ratio": 2}

METHOD = rf"""Numbers of tables are those typed into the published numbers; numbers of the text are typed
beside their section. Two numbers fit together where one is at most {MARGIN:g} times the other: words like
"approximately" and the last digit printed leave that much open.

A length on the ground is a number of pixels times the height over the focal length of H (2.3). NIS, H (3.12),
of the same innovations goes with the inverse of their covariance; where the measurement noise makes nearly
all of it, with the inverse square of its standard deviation. Independent errors add in squares."""

LIMITS = [
    "Nothing about which of two numbers is the right one: the flights were never published.",
    "A thesis has hundreds of numbers; these are the ones met while its cases were rebuilt.",
    "Where two places differ in more than one thing, what each of them does cannot be told apart here.",
]


def _names(items: Sequence[Item]) -> str:
    return "; ".join(f"{item.topic} ({item.ratio:.2f})" for item in items)


def summary(items: Sequence[Item]) -> list[str]:
    """Three sentences."""
    apart = [item for item in items if item.apart]
    most = max(items, key=lambda item: abs(np.log(item.ratio)))
    count = f"{len(apart)} of" if apart else "None of the"
    return [
        f"{count} {len(items)} pairs of printed numbers that hang together are more than "
        f"{100 * (MARGIN - 1):.0f} % apart.",
        f"Furthest apart, {most.ratio:.2f} times, is this pair: {most.topic}.",
        "Beside each pair stands what is not the same in the two places, which may be all there is to it.",
    ]


def table_of(items: Sequence[Item]) -> pd.DataFrame:
    """A row for each item, with the columns of `COLUMNS`."""
    return pd.DataFrame([{name: getattr(item, name) for name in COLUMNS} for item in items])


def ratios_chart(items: Sequence[Item]) -> Figure:
    """How many times each number is the other, on one logarithmic axis."""
    fig, ax = new_figure(5.9, 0.6 + 0.33 * len(items))
    rows = np.arange(len(items))[::-1]
    ratios = [item.ratio for item in items]
    widest = 1.15 * max(MARGIN, *ratios, *(1 / ratio for ratio in ratios))
    ax.axvspan(1 / MARGIN, MARGIN, color=BLUE, alpha=0.15, lw=0)
    ax.axvline(1.0, color=INK, lw=0.8)
    ax.scatter(ratios, rows, c=[VERMILLION if item.apart else BLUE for item in items], s=36, zorder=3)
    ax.set_yticks(rows, [item.label for item in items])
    ax.set_xscale("log")
    ax.set_xlim(1 / widest, widest)
    ticks = [tick for tick in (0.25, 0.5, 0.7, 1.0, 1.4, 2.0, 4.0) if 1 / widest <= tick <= widest]
    ax.set_xticks(ticks, [f"{tick:g}" for tick in ticks])
    ax.minorticks_off()
    ax.set_xlabel("the one number over the other")
    ax.set_title(f"{sum(item.apart for item in items)} of {len(items)} pairs lie outside")
    ax.grid(axis="y", visible=False)
    return fig


def chart_alt(items: Sequence[Item]) -> str:
    """What the chart shows, in words."""
    outside = [item for item in items if item.apart]
    inside = [item for item in items if not item.apart]
    parts = [f"Dots on a logarithmic axis, one for each of {len(items)} pairs of numbers."]
    if outside:
        parts.append(f"Outside of the margin: {_names(outside)}.")
    if inside:
        parts.append(f"Inside: {_names(inside)}.")
    return " ".join(parts)


def points_of(item: Item) -> list[str]:
    """What is said of one item: its quotes, the arithmetic, what differs, and what follows."""
    quoted = "; ".join(f"{words} ({section})" for section, words in item.quotes)
    return [
        f"Printed: {quoted}.",
        f"Arithmetic: {item.arithmetic}",
        f"What differs: {item.differs}",
        f"So: {item.reading[0] if item.apart else item.reading[1]}",
    ]
