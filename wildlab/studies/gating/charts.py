"""Charts of the study of gating, H 6.4.3: rates beside published, one run, what moves them."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import pandas as pd
from matplotlib.figure import Figure
from numpy.typing import NDArray

from wildlab.reporting.figures import (
    BLUE,
    GREEN,
    GREY,
    INK,
    ORANGE,
    VERMILLION,
    log_band,
    map_axes,
    new_figure,
)
from wildlab.studies.gating.monte_carlo import FORMS, Gated
from wildlab.studies.gating.text import FED, NAMES
from wildlab.studies.gating.variations import standard_error

Array = NDArray[np.float64]

_COLOURS = {"position": BLUE, "pixels": VERMILLION, "angles": GREEN}
_OBJECTS = {"main object": BLUE, "second object": ORANGE}


def rates_chart(rates: Mapping[str, Array], published: Mapping[str, float], title: str) -> Figure:
    """Mean success rates with twice their standard error, beside the published ones (hollow)."""
    fig, ax = new_figure(5.6, 3.9)
    at = np.arange(len(FORMS))
    looks = {"assigned": ("o", VERMILLION, -0.14), "own": ("s", BLUE, 0.14), "nothing": ("^", GREY, 0.28)}
    for fed, (marker, color, aside) in looks.items():
        twice = [2 * standard_error(runs) for runs in rates[fed]]
        mean, label = rates[fed].mean(axis=1), f"updated {FED[fed]}"
        ax.errorbar(at + aside, mean, yerr=twice, fmt=marker, color=color, ms=7, capsize=3, label=label)
    ax.plot(at, [published[form] for form in FORMS], "D", mfc="white", mec=INK, ms=8, label="published")
    ax.set_xticks(at, [NAMES[form] for form in FORMS])
    ax.set(xlim=(-0.6, 2.6), ylim=(None, 100), ylabel="right associations (%)", title=title)
    fig.legend(*ax.get_legend_handles_labels(), loc="outside lower right", ncols=2)
    return fig


def spread_chart(rates: Mapping[str, Array], title: str) -> Figure:
    """Distribution of the success rate over runs: solid where the assigned, dotted where the own updates."""
    fig, ax = new_figure(5.6, 3.9)
    for fed, style in (("assigned", "-"), ("own", ":")):
        for form, runs in zip(FORMS, rates[fed], strict=True):
            share = 100 * np.arange(1, len(runs) + 1) / len(runs)
            label = NAMES[form] if fed == "assigned" else None
            ax.plot(np.sort(runs), share, style, color=_COLOURS[form], label=label)
    ax.plot([], [], ":", color=GREY, label="updated with its own")
    ax.set(xlim=(0, 100), ylim=(0, 100), title=title)
    ax.set(xlabel="right associations in a run (%)", ylabel="runs with no more than that (%)")
    fig.legend(*ax.get_legend_handles_labels(), loc="outside lower right", ncols=2)
    return fig


def right_wrong_chart(one: Gated, title: str) -> Figure:
    """Right and wrong associations of a single run by image, one band for each form."""
    fig, ax = new_figure(5.6, 3.4)
    for row, form in enumerate(FORMS):
        right = one.right[row, 0]
        ax.plot(np.arange(len(right)) + 1, 2 * row + right, ".", color=_COLOURS[form], ms=4)
        ax.annotate(NAMES[form], (1, 2 * row + 0.5), fontsize=9.5, va="center", color=_COLOURS[form])
    ax.set_yticks(range(2 * len(FORMS)), ["wrong", "right"] * len(FORMS))
    ax.set(xlabel="image", ylim=(-0.4, 5.5), title=title)
    return fig


def nis_chart(one: Gated, form: str, band: tuple[float, float]) -> Figure:
    """NIS of both objects of a single run by image, with the band of a consistent filter."""
    nis = one.nis[FORMS.index(form), 0]
    fig, ax = new_figure(5.6, 3.4)
    for which, (name, color) in enumerate(_OBJECTS.items()):
        ax.plot(np.arange(len(nis)) + 1, nis[:, which], ".-", lw=0.7, ms=4, color=color, label=name)
    log_band(ax, *band)
    ax.set(xlabel="image", ylabel="NIS", title=f"NIS by {NAMES[form]}")
    ax.set_ylim(top=30 * np.nanmax(nis))
    ax.legend(loc="upper right", ncols=2)
    return fig


def estimates_map(one: Gated, title: str) -> Figure:
    """Where the three forms have the main object of a single run, image after image."""
    fig, ax = new_figure(5.0, 4.8)
    for row, form in enumerate(FORMS):
        north, east = one.estimate[row, 0].T
        ax.plot(east, north, ".-", lw=0.8, ms=3, color=_COLOURS[form], label=NAMES[form])
    north, east = one.targets[0, 0]
    ax.plot(east, north, "k+", ms=13, mew=2, label="main object, truth")
    ax.set_title(title)
    fig.legend(*ax.get_legend_handles_labels(), loc="outside lower right", ncols=2)
    map_axes(ax)
    return fig


def detections_map(one: Gated, title: str) -> Figure:
    """Georeferenced detections of both objects of a single run about their true places."""
    fig, ax = new_figure(5.0, 4.8)
    for which, (name, color) in enumerate(_OBJECTS.items()):
        north, east = one.measured[0, :, which].T
        ax.plot(east, north, ".", color=color, ms=5, alpha=0.7, label=name)
    north, east = one.targets[0].T
    ax.plot(east, north, "k+", ms=13, mew=2, label="truth")
    ax.set_title(title)
    fig.legend(*ax.get_legend_handles_labels(), loc="outside lower right", ncols=3)
    map_axes(ax)
    return fig


def varied_chart(varied: pd.DataFrame, published: Mapping[str, float], title: str) -> Figure:
    """Success rates of each variation of `wildlab.studies.gating.variations.vary`; dashed: published."""
    fig, ax = new_figure(5.9, 5.6)
    y = np.arange(len(varied))[::-1]
    for shift, form in zip((0.2, 0.0, -0.2), FORMS, strict=True):
        ax.axvline(published[form], color=_COLOURS[form], lw=0.8, ls=(0, (3, 3)))
        ax.plot(varied[form], y + shift, "o", color=_COLOURS[form], ms=5, label=NAMES[form])
    ax.set_yticks(y, varied["variation"])
    ax.set(xlabel="right associations (%), dashed: published", title=title)
    fig.legend(*ax.get_legend_handles_labels(), loc="outside lower right", ncols=3)
    return fig
