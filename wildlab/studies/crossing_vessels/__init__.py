"""Two vessels that cross, distinguished by their images: H 6.4.4."""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from wildlab.analysis.rendered import Photographer
from wildlab.evaluation.shares import Check, columns_of
from wildlab.geometry.frames import Array
from wildlab.reporting.charts.drawing import draw_dots, draw_way, finish
from wildlab.reporting.charts.forms import draw_picture, spread_points
from wildlab.reporting.figures import BLUE, INK, ORANGE, VERMILLION, map_axes, new_figure
from wildlab.studies.crossing_vessels import trial
from wildlab.studies.crossing_vessels.trial import (
    APART_M,
    BOATS,
    DISTANCE,
    FEATURES,
    LOOKS,
    NAMES,
    SUBJECTS,
    TUNING,
    Flown,
    looks_of,
)
from wildlab.studies.page import Facts
from wildlab.studies.protocol import Study


def check_claims(runs: pd.DataFrame) -> dict[str, Check]:
    """What the flights give for each claim of H 6.4.4, by the claim's id.

    Parameters
    ----------
    runs
        What `trial` gives, one row for each flight.
    """

    of = columns_of(runs)

    def worse(subject: str) -> Array:
        """The larger share of wrong associations of the two vessels."""
        return np.maximum(*(of(subject, f"wrong_rate_boat_{n}") for n in (1, 2)))

    met = of(LOOKS, "closest") < TUNING.measurement
    swapped = of(DISTANCE, "swapped") > 0
    size, intensity, hu = (of(LOOKS, f"separation_{name}") for name in ("size", "intensity", "hu"))
    wrong, wrong_without = of(FEATURES, "wrong"), of(DISTANCE, "wrong")
    return {
        "swap-without-features": Check(true=swapped, premise=met),
        "never-recovers": Check(true=of(DISTANCE, "swapped_at_end") > 0, premise=swapped),
        "accurate-though-swapped": Check(true=of(DISTANCE, "any_near_share") > 0.5, premise=swapped),
        "size-best": Check(true=(size > intensity) & (size > hu)),
        "intensity-differs": Check(measured=intensity, above=True),
        "hu-similar": Check(measured=hu),
        "no-swap-with-features": Check(true=of(FEATURES, "swapped") == 0, premise=met),
        "mostly-within-20-m": Check(true=of(FEATURES, "near_share") > 0.5),
        "most-correct-in-contrast": Check(
            true=(worse(FEATURES) < 0.5) & (worse(DISTANCE) >= 0.5), premise=met
        ),
        "fewer-wrong": Check.smaller(wrong, wrong_without, "detections"),
    }


def rules_table(runs: pd.DataFrame, names: Mapping[str, str]) -> pd.DataFrame:
    """One row for each rule: the flights swapped (%), and medians over flights."""
    medians = ("wrong", "mae")
    return pd.DataFrame(
        [
            {"rule": names[rule], "swapped": 100 * float(runs[rule, "swapped"].mean())}
            | {name: float(runs[rule, name].median()) for name in medians}
            for rule in SUBJECTS
        ]
    )


#: Tracks by the vessel whose detections started them, as in H figure 6.21.
_COLOURS = (BLUE, ORANGE)
#: Of the height of a map, left free below everything on it for the scale bar.
FREE = 0.3
_AXES = {"size": "ln of the size in m²", "intensity": "intensity (counts)", "hu": "ln of Hu's first moment"}


def plot_tracks(flown: Flown, names: Mapping[str, str]) -> Figure:
    """True paths and tracks without features and with them (H figures 6.23 and 6.24)."""
    fig, axes = new_figure(5.9, 6.6, rows=2)
    for ax, rule in zip(axes, (DISTANCE, FEATURES), strict=True):
        bank, crossing = flown.banks[rule], flown.crossing
        for boat, way, style in zip(BOATS, crossing.truth, ("-", "--"), strict=True):
            draw_way(ax, way, INK, f"{boat}, true", ls=style)
        for track, owner in enumerate(crossing.boat[bank.started]):
            name = f"track that {BOATS[owner]} started"
            draw_way(ax, bank.x[:, track], _COLOURS[owner], name, width=1.4, alpha=0.85)
        ax.set_title(names[rule])
        low, high = ax.get_ylim()
        ax.set_ylim(low - FREE * (high - low), high)
        map_axes(ax, scale_bar=ax is axes[-1], east="east (m)" if ax is axes[-1] else "")
    return finish(fig, "")


def plot_features(looks: list[Array]) -> Figure:
    """Features of both vessels in rendered images (H figure 6.21)."""
    fig, axes = new_figure(5.9, 3.2, columns=3)
    apart = looks_of(looks)
    for ax, (k, name) in zip(axes, enumerate(NAMES), strict=True):
        for number, pool in enumerate(looks):
            across = number + spread_points(len(pool), 0.18)
            draw_dots(ax, across, pool[:, k], _COLOURS[number], size=10, alpha=0.7)
        ax.set(xlim=(-0.5, 1.5), xticks=[0, 1], xticklabels=["1", "2"], xlabel="boat", ylabel=_AXES[name])
        ax.grid(False, axis="x")
        value = apart["looks", f"separation_{name}"]
        ax.set_title(f"{value:.0f} apart" if value >= 10 else f"{value:.1f} apart")
    return fig


def plot_frame(flown: Flown, twin: str, seed: int) -> Figure:
    """A rendered frame in which both are detected, about `APART_M` apart, with what the detector finds."""
    crossing = flown.crossing
    images, detections = np.unique(crossing.looks.image, return_counts=True)
    both = np.flatnonzero(detections == len(BOATS))
    row = both[np.nanargmin(np.abs(crossing.apart[both] - APART_M))]
    camera = Photographer(twin, seed)
    _, counts = camera.image(int(images[row]))
    (shot,) = camera.shoot([int(images[row])])
    found, box = shot.judged.found, shot.detections.box
    colors = [
        next((_COLOURS[number - 1] for number, rows in found.items() if k in rows), VERMILLION)
        for k in range(len(box))
    ]
    fig, ax = new_figure(5.9, 4.6)
    draw_picture(ax, counts, f"{crossing.apart[row]:.0f} m apart", limits=None, boxes=box, colors=colors)
    return fig


def answer(facts: Facts) -> list[str]:
    """Whether features keep the tracks apart, and which feature does."""
    apart = facts.value(trial.LOOKS, "separation_size")
    best = "unknown" if math.isnan(apart) else "size" if facts.outcome("size-best") == "holds" else "open"
    return [f"swap-{facts.outcome('no-swap-with-features')}", f"feature-{best}"]


STUDY = Study("crossing-vessels", trial.trial, check_claims, trial.UNITS.get, answer)
