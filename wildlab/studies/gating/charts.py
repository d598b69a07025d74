"""Charts of the study of gating, H 6.4.3: rates beside published, one run, what moves them."""

from __future__ import annotations

from collections.abc import Mapping
from textwrap import fill

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from wildlab.reporting.figures import (
    BLUE,
    GREEN,
    GREY,
    INK,
    ORANGE,
    PURPLE,
    VERMILLION,
    log_band,
    map_axes,
    new_figure,
)
from wildlab.studies.gating import text as words
from wildlab.studies.gating.monte_carlo import FORMS, GATES, Gated, Outcome
from wildlab.studies.gating.readings import DEFAULT, READINGS, STRESS
from wildlab.studies.gating.tables import PRINTED_RUNS
from wildlab.studies.gating.text import NAMES
from wildlab.studies.gating.variations import standard_error

#: What `Report.figures` takes: figure, name, alternative text, caption.
Shown = tuple[Figure, str, str, str]

_COLOURS = {"position": BLUE, "pixels": VERMILLION, "angles": GREEN, "both": PURPLE}
_OBJECTS = {"main object": BLUE, "second object": ORANGE}
_LOOKS = (("s", BLUE, -0.12), ("^", GREY, 0.12), ("o", VERMILLION, 0.0))


def rates_shown(outcomes: Mapping[str, Outcome], published: Mapping[str, float]) -> Shown:
    """Mean success rates of each reading but the stress test's, beside the published ones (hollow).

    Bars are twice the standard error, the published ones' with the default reading's spread between runs.
    """
    fig, ax = new_figure(5.6, 3.9)
    at = np.arange(len(GATES))
    shown = [name for name in outcomes if name != STRESS]
    for name, (marker, color, aside) in zip(shown, _LOOKS, strict=False):
        rates = outcomes[name].rate
        twice = [2 * standard_error(runs) for runs in rates]
        label = f"updated with {READINGS[name].short}"
        ax.errorbar(
            at + aside, rates.mean(axis=1), yerr=twice, fmt=marker, color=color, ms=7, capsize=3, label=label
        )
    spread = outcomes[DEFAULT].rate.std(axis=1, ddof=1)[: len(FORMS)]
    ax.errorbar(
        at[: len(FORMS)], [published[form] for form in FORMS], yerr=2 * spread / np.sqrt(PRINTED_RUNS),
        fmt="D", mfc="white", mec=INK, ecolor=INK, ms=8, capsize=3, label="published",
    )  # fmt: skip
    ax.set_xticks(at, [fill(NAMES[gate], 11) for gate in GATES])
    ax.set(xlim=(-0.5, len(GATES) - 0.5), ylabel="right associations (%)")
    rates = outcomes[DEFAULT].rate
    ax.set_title(words.rates_title(rates))
    fig.legend(*ax.get_legend_handles_labels(), loc="outside lower right", ncols=1)
    printed = ", ".join(f"{NAMES[form]} {published[form]} %" for form in FORMS)
    return (
        fig,
        "success-rates",
        f"Success rates. Published: {printed}. {words.readings_words(outcomes)}.",
        f"Mean over {rates.shape[1]} runs, bars twice the standard error; hollow: H table 6.6.",
    )


def spread_shown(outcomes: Mapping[str, Outcome]) -> Shown:
    """Distribution of the success rate over runs: solid by the default reading, dotted in the stress test."""
    fig, ax = new_figure(5.6, 3.9)
    lost = {}
    for name, style in ((DEFAULT, "-"), (STRESS, ":")):
        rates = outcomes[name].rate[: len(FORMS)]
        lost[name] = ", ".join(f"{share:.1f}" for share in words.mostly_wrong(rates))
        for form, runs in zip(FORMS, rates, strict=True):
            share = 100 * np.arange(1, len(runs) + 1) / len(runs)
            label = NAMES[form] if name == DEFAULT else None
            ax.plot(np.sort(runs), share, style, color=_COLOURS[form], label=label)
    ax.plot([], [], ":", color=GREY, label=f"updated with {READINGS[STRESS].short}")
    ax.set(xlim=(0, 100), ylim=(0, 100), title=words.spread_title(outcomes))
    ax.set(xlabel="right associations in a run (%)", ylabel="runs with no more than that (%)")
    fig.legend(*ax.get_legend_handles_labels(), loc="outside lower right", ncols=2)
    said = (
        f"of the runs (position, pixels, angles) are right in less than half of their images: "
        f"{lost[DEFAULT]} % "
        f"updated with {READINGS[DEFAULT].short}, {lost[STRESS]} % updated with {READINGS[STRESS].short}."
    )
    return fig, "spread-over-runs", f"Distribution of the success rate over runs; {said}", f"So many {said}"


def right_wrong_shown(one: Gated) -> Shown:
    """Right and wrong associations of a single run by image, one band for each form."""
    fig, ax = new_figure(5.6, 3.4)
    for row, form in enumerate(FORMS):
        right = one.right[row, 0]
        ax.plot(np.arange(len(right)) + 1, 2 * row + right, ".", color=_COLOURS[form], ms=4)
        ax.annotate(NAMES[form], (1, 2 * row + 0.5), fontsize=10, va="center", color=_COLOURS[form])
    ax.set_yticks(range(2 * len(FORMS)), ["wrong", "right"] * len(FORMS))
    title = words.mistakes_title(one)
    ax.set(xlabel="image", ylim=(-0.4, 5.5), title=title.replace(", by angles", ",\nby angles"))
    rights = words.rights_words(one)
    alt = f"For each image and form whether the association was right; {rights} % were. {title}."
    return fig, "fig-6-17a", alt, "Counterpart of H figure 6.17a."


def nis_shown(one: Gated, form: str, band: tuple[float, float], figure: str) -> Shown:
    """NIS of both objects of a single run by image, with the band of a consistent filter."""
    nis = one.nis[GATES.index(form), 0]
    main, second = np.nanmedian(nis, axis=0)
    fig, ax = new_figure(5.6, 3.4)
    for which, (name, color) in enumerate(_OBJECTS.items()):
        ax.plot(np.arange(len(nis)) + 1, nis[:, which], ".-", lw=0.7, ms=4, color=color, label=name)
    log_band(ax, *band)
    ax.set(xlabel="image", ylabel="NIS")
    ax.set_title(f"Median NIS by {NAMES[form]}:\n{main:.2g} of the main object, {second:.2g} of the second")
    ax.set_ylim(top=30 * np.nanmax(nis))
    ax.legend(loc="upper right", ncols=2)
    return (
        fig,
        f"fig-{figure.replace('.', '-')}",
        f"NIS of both objects by image on a log axis, by {NAMES[form]}; the median is {main:.2g} for the "
        f"main object and {second:.2g} for the second.",
        f"Both objects, with the 95 % band of two degrees of freedom. Counterpart of H figure {figure}.",
    )


def estimates_shown(one: Gated) -> Shown:
    """Where the three forms have the main object of a single run; forms with the same track share a line."""
    fig, ax = new_figure(5.0, 4.8)
    for group in words.same_tracks(one):
        north, east = one.estimate[FORMS.index(group[0]), 0].T
        label = "; ".join(NAMES[form] for form in group)
        ax.plot(east, north, ".-", lw=0.8, ms=3, color=_COLOURS[group[0]], label=label)
    north, east = one.targets[0, 0]
    ax.plot(east, north, "k+", ms=13, mew=2, label="main object, truth")
    title = words.estimates_title(one)
    ax.set_title(title.replace(": ", ":\n", 1))
    fig.legend(*ax.get_legend_handles_labels(), loc="outside lower right", ncols=1)
    map_axes(ax)
    tracks = len(words.same_tracks(one))
    return (
        fig,
        "fig-6-19a",
        f"Map of the estimated positions of the main object beside its true place. {title}.",
        f"Estimates after each image; {tracks} different track{'s' if tracks > 1 else ''} of the three "
        "forms. Counterpart of H figure 6.19a.",
    )


def detections_shown(one: Gated) -> Shown:
    """Georeferenced detections of both objects of a single run about their true places."""
    fig, ax = new_figure(5.0, 4.8)
    for which, (name, color) in enumerate(_OBJECTS.items()):
        north, east = one.measured[0, :, which].T
        ax.plot(east, north, ".", color=color, ms=5, alpha=0.7, label=name)
    north, east = one.targets[0].T
    ax.plot(east, north, "k+", ms=13, mew=2, label="truth")
    title = words.detections_title(one)
    ax.set_title(title.replace(" by ", "\nby ", 1))
    fig.legend(*ax.get_legend_handles_labels(), loc="outside lower right", ncols=3)
    map_axes(ax)
    alt = f"Map of the georeferenced detections of both objects about their true places. {title}."
    return fig, "fig-6-19b", alt, "Scatter: standard deviation. Counterpart of H figure 6.19b."


def varied_shown(varied: pd.DataFrame, published: Mapping[str, float], reading: str) -> Shown:
    """Success rates of each variation of `wildlab.studies.gating.variations.vary`; dashed: published."""
    fig, ax = new_figure(5.9, 5.6)
    y = np.arange(len(varied))[::-1]
    for shift, form in zip((0.2, 0.0, -0.2), FORMS, strict=True):
        ax.axvline(published[form], color=_COLOURS[form], lw=0.8, ls=(0, (3, 3)))
        ax.plot(varied[form], y + shift, "o", color=_COLOURS[form], ms=5, label=NAMES[form])
    ax.set_yticks(y, varied["variation"])
    title = words.varied_title(varied, reading)
    ax.set(xlabel="right associations (%)\ndashed: published")
    # Above the names of the variations too: the axes alone are too narrow for it.
    fig.suptitle(title, x=0.01, ha="left", fontsize=11, fontweight="bold")
    fig.legend(*ax.get_legend_handles_labels(), loc="outside lower right", ncols=3)
    said = words.varied_words(varied, published)
    return fig, f"varied-{reading}", f"{title.replace(chr(10), ' ')}. {said}", said
