"""Figures of the study of crossing vessels: counterparts of H figures 6.21, 6.23, 6.24, and one of ours."""

from __future__ import annotations

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from wildlab.reporting.figures import BLUE, GREY, INK, ORANGE, VERMILLION, map_axes, new_figure
from wildlab.reporting.spread import bounds_of, spread_words
from wildlab.studies.crossing_vessels.trial import (
    DISTANCE,
    FEATURES,
    NAMES,
    SEPARATIONS,
    Flown,
    curve_subject,
    looks_of,
    swapped,
    wrong_of,
)
from wildlab.studies.crossing_vessels.trial.crossing import BOATS, Crossing

Array = NDArray[np.float64]
#: What `Report.figures` takes: figure, name, alternative text, caption.
Shown = tuple[Figure, str, str, str]
#: Tracks by the vessel whose detections started them, as in H figure 6.21.
_COLOURS = (BLUE, ORANGE)
#: Of the height of a map, left free below everything on it for the scale bar.
FREE = 0.3
_AXES = {"size": "ln of the size in m²", "intensity": "intensity (counts)", "hu": "ln of Hu's first moment"}


def tracks_shown(flown: Flown) -> Shown:
    """Tracks without features and with them, beside the truth (H figures 6.23 and 6.24)."""
    fig, axes = new_figure(5.9, 6.6, rows=2)
    said = []
    for ax, rule, name in zip(axes, (DISTANCE, FEATURES), ("Distance alone", "And features"), strict=True):
        bank, crossing = flown.banks[rule], flown.crossing
        for number, boat in enumerate(BOATS):
            north, east = crossing.truth[number].T
            ax.plot(east, north, color=INK, lw=1.2, ls=("-", "--")[number], label=f"{boat}, true")
        for track, first in enumerate(bank.started):
            owner = int(crossing.boat[first])
            new = track == int(np.flatnonzero(crossing.boat[bank.started] == owner)[0])
            label = f"track that {BOATS[owner]} started" if new else None
            x = bank.x[:, track]
            ax.plot(x[:, 1], x[:, 0], color=_COLOURS[owner], lw=1.4, alpha=0.85, label=label)
        words = outcome_words(crossing, rule, flown)
        ax.set_title(f"{name}: {words}")
        said.append(f"{'with' if rule == FEATURES else 'without'} features {words}")
        low, high = ax.get_ylim()
        ax.set_ylim(low - FREE * (high - low), high)
        map_axes(ax, scale_bar=ax is axes[-1])
    axes[0].set_xlabel("")
    fig.legend(*axes[0].get_legend_handles_labels(), loc="outside lower center", ncols=2)
    return (
        fig, "fig-6-23", f"Map of both vessels and their tracks: {'; '.join(said)}.",
        f"{'; '.join(said).capitalize()}. A track has the colour of the vessel whose detections started it. "
        "Counterpart of H figures 6.23 and 6.24.",
    )  # fmt: skip


def outcome_words(crossing: Crossing, rule: str, flown: Flown) -> str:
    """Whether the tracks of one flight were swapped, and how many detections went wrong."""
    after, end = swapped(crossing, flown.banks[rule])
    wrong = int(wrong_of(crossing, flown.banks[rule]).sum())
    if after and end:
        how = "swapped for good"
    elif after:
        how = "swapped, and not at the end"
    else:
        how = "swapped at the end" if end else "no swap"
    return f"{how}, {wrong} wrong"


def looks_shown(looks: list[Array]) -> Shown:
    """What the two look like in rendered images (H figure 6.21)."""
    fig, axes = new_figure(5.9, 3.2, columns=3)
    apart, said = looks_of(looks), []
    rng = np.random.default_rng(0)  # to tell points apart, across
    for ax, (k, name) in zip(axes, enumerate(NAMES), strict=True):
        for number, pool in enumerate(looks):
            across = number + rng.uniform(-0.18, 0.18, len(pool))
            ax.plot(across, pool[:, k], "o", color=_COLOURS[number], ms=5, alpha=0.7, mew=0)
        ax.set(xlim=(-0.5, 1.5), xticks=[0, 1], xticklabels=["1", "2"], xlabel="boat", ylabel=_AXES[name])
        ax.grid(False, axis="x")
        value = apart["looks", f"separation_{name}"]
        ax.set_title(f"{value:.0f} apart" if value >= 10 else f"{value:.1f} apart")
        said.append(f"{'Hu moment' if name == 'hu' else name} {value:.1f}")
    return (
        fig, "fig-6-21",
        f"Size, intensity and Hu's first moment of both vessels in rendered images, apart by so many "
        f"spreads within a vessel: {', '.join(said)}.",
        f"Rendered images of the flight of the figures. Means apart, in spreads within a vessel: "
        f"{', '.join(said)}. Counterpart of H figure 6.21.",
    )  # fmt: skip


def curve_shown(spread: pd.DataFrame) -> Shown:
    """Wrong associations and swaps over the separation of a made-up feature."""
    fig, axes = new_figure(5.9, 4.6, rows=2, sharex=True)
    subjects = [curve_subject(separation) for separation in SEPARATIONS]
    middle = np.array([spread[one, "wrong"].median() for one in subjects])
    bounds = np.array([bounds_of(spread[one, "wrong"]) for one in subjects])
    share = 100 * np.array([spread[one, "swapped"].mean() for one in subjects])
    top, low = axes
    if np.isfinite(bounds).all():
        top.fill_between(SEPARATIONS, *bounds.T, color=BLUE, alpha=0.18, lw=0)
    top.plot(SEPARATIONS, middle, "o-", color=BLUE)
    low.plot(SEPARATIONS, share, "o-", color=BLUE, label="one made-up feature")
    _level(top, spread[DISTANCE, "wrong"].median(), GREY)
    _level(low, 100 * spread[DISTANCE, "swapped"].mean(), GREY, "distance alone")
    _level(top, spread[FEATURES, "wrong"].median(), VERMILLION)
    _level(low, 100 * spread[FEATURES, "swapped"].mean(), VERMILLION, "as rendered")
    top.set_yscale("symlog", linthresh=1)
    # None wrong lies a little above the axis, where its line is seen.
    top.set(ylabel="wrong", ylim=(-0.4, None))
    low.set(ylabel="swapped (%)", ylim=(-3, 103), xticks=SEPARATIONS)
    low.set_xlabel("difference of the two (spreads of the feature)")
    at = {separation: value for separation, value in zip(SEPARATIONS, middle, strict=True)}
    most = max(SEPARATIONS)
    top.set_title(f"Wrong: {at[0]:.0f} at no difference, {at[most]:.0f} at {most} spreads")
    fig.legend(*low.get_legend_handles_labels(), loc="outside lower center", ncols=3)
    said = "; ".join(
        f"{separation}: {value:.0f} wrong, {part:.0f} % swapped"
        for separation, value, part in zip(SEPARATIONS, middle, share, strict=True)
    )
    band = spread_words(len(spread)).key
    return (
        fig, "separation",
        f"Detections wrong and flights swapped over how different the two are, in spreads: {said}.",
        "Above the detections that went to the wrong track, median of the flights"
        f"{f', and band: {band}' if band else ''}; below the flights swapped. By difference in spreads: "
        f"{said}.",
    )  # fmt: skip


def _level(ax: Axes, value: float, color: str, label: str | None = None) -> None:
    ax.axhline(value, color=color, lw=1.3, ls="--", label=label)
