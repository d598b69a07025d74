"""The chart of what wrong heights cost."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.ticker import FuncFormatter

from wildlab.evaluation.runs import mean_interval
from wildlab.reporting.figures import BLUE, ORANGE, VERMILLION, new_figure
from wildlab.studies.sensitivity.heights import COARSE_M, LANDS, Shift

_SHOWN = {
    "plane": (VERMILLION, "a plane"),
    "coarse": (ORANGE, f"nodes {COARSE_M:.0f} m apart"),
    "level": (BLUE, "1 m too high"),
}


def heights_shown(found: list[Shift]) -> tuple[Any, str, str]:
    """Distance from the true point by pitch and by what is wrong: figure, alt text and caption."""
    fig, ax = new_figure(5.6, 3.4)
    some = [one for one in found if one.pitch < 90]
    said = []
    for name, (color, label) in _SHOWN.items():
        means = [mean_interval(one.off[name]) for one in some]
        pitch = [one.pitch for one in some]
        low = [max(one.low, 1e-3) for one in means]
        ax.fill_between(pitch, low, [one.high for one in means], color=color, alpha=0.2, lw=0)
        ax.plot(pitch, [one.estimate for one in means], "o-", color=color, ms=4, label=label)
        said.append(f"{label}: " + ", ".join(f"{one.estimate:.2g} m" for one in means))
    ax.set_yscale("log")
    ax.yaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    ax.legend(loc="upper right")
    ax.set(xlabel="camera below the horizon (degrees)", ylabel="distance from the true point (m)")
    ax.set_xticks([one.pitch for one in some])
    steepest = some[int(np.argmax([one.pitch for one in some]))].pitch
    flattest = min(one.pitch for one in some)
    alt = (
        f"Distance from the true point against pitch, {flattest:.0f} to {steepest:.0f} degrees below the "
        f"horizon. {'; '.join(said)}."
    )
    caption = (
        f"Median over rays, averaged over {LANDS} landscapes; bands are 95 % intervals of the mean. "
        f"{straight_words(found)}"
    )
    return fig, alt, caption


def straight_words(found: list[Shift]) -> str:
    """What wrong heights cost a camera that looks straight down."""
    straight = [values for one in found if one.pitch >= 90 for values in one.off.values()]
    largest = max(float(np.nanmax(values)) for values in straight)
    return (
        f"Straight down it is {largest:.2g} m at most." if largest > 0.005 else "Straight down it is nothing."
    )
