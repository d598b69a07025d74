"""Charts that show several flights on one axis."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import ArrayLike

from wildlab.names import figure_name
from wildlab.reporting.figures import BLUE, GREY, new_figure


def dots_chart(
    names: Sequence[str],
    value: ArrayLike,
    low: ArrayLike,
    high: ArrayLike,
    label: str,
    title: str,
    goal: float | None = None,
) -> Figure:
    """One dot a flight, with its interval where it has one (NaN where not), on one axis from zero.

    Parameters
    ----------
    names
        Of N flights.
    value, low, high
        (N,).
    label
        Of the axis.
    title
        Of the figure.
    goal
        A value to mark.

    Returns
    -------
    Figure
    """
    x, left, right = (np.asarray(one, float) for one in (value, low, high))
    fig, ax = new_figure(4.6, 1.3 + 0.36 * len(names))
    rows = np.arange(len(names))
    if goal is not None:
        ax.axvline(goal, color=GREY, lw=1, ls=(0, (4, 3)))
        ax.annotate(f"ideal {goal:g}" if goal else "none", (goal, 1.0), (3, -2), fontsize=10, va="top",
                    xycoords=("data", "axes fraction"), textcoords="offset points")  # fmt: skip
    for row, a, b in zip(rows, left, right, strict=True):
        if np.isfinite(a + b):
            ax.plot([a, b], [row, row], color=BLUE, lw=2.2)
    ax.plot(x, rows, "o", color=BLUE, ms=7)
    ax.set_yticks(rows, [figure_name(name if len(name) <= 24 else f"{name[:22]}…") for name in names])
    ax.set_ylim(len(names) - 0.4, -0.8)
    everything = np.concatenate([x, left[np.isfinite(left)], right[np.isfinite(right)], [goal or 0.0]])
    span = float(np.nanmax(everything) - min(0.0, np.nanmin(everything))) or 1.0
    ax.set_xlim(
        min(0.0, float(np.nanmin(everything))) - 0.04 * span, float(np.nanmax(everything)) + 0.08 * span
    )
    ax.set_xlabel(label)
    ax.grid(axis="y", visible=False)
    ax.set_title(title)
    return fig
