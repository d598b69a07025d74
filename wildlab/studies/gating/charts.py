"""Figures of gating, H 6.4.3: success rates, one run, and what moves the rates."""

from __future__ import annotations

from collections.abc import Mapping
from textwrap import fill

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from wildlab.evaluation.consistency import chi_square_interval
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
from wildlab.studies.gating.monte_carlo import FORMS, GATES, Gated, Outcome
from wildlab.studies.gating.readings import DEFAULT, STRESS, standard_error
from wildlab.studies.page import Shown

#: Runs behind a published success rate, H 6.4.3.
PUBLISHED_RUNS = 10_000
_COLOURS = {"position": BLUE, "pixels": VERMILLION, "angles": GREEN, "both": PURPLE}
_OBJECTS = {"main object": BLUE, "second object": ORANGE}
_MARKS = (("s", BLUE, -0.12), ("^", GREY, 0.12), ("o", VERMILLION, 0.0))


def plot_rates(
    outcomes: Mapping[str, Outcome], published: Mapping[tuple[str, str], float], names: Mapping[str, str]
) -> Figure:
    """Mean success rates of each reading but the stress test's; ``published`` by subject and name, hollow.

    Bars are twice the standard error, the published ones' with the default reading's spread between runs.
    """
    fig, ax = new_figure(5.6, 3.9)
    at = np.arange(len(GATES))
    shown = [name for name in outcomes if name != STRESS]
    for name, (marker, color, aside) in zip(shown, _MARKS, strict=False):
        rates = outcomes[name].rate
        twice = [2 * standard_error(runs) for runs in rates]
        look = {"fmt": marker, "color": color, "ms": 7, "capsize": 3}
        ax.errorbar(at + aside, rates.mean(axis=1), yerr=twice, label=names[f"updated-with-{name}"], **look)
    spread = outcomes[DEFAULT].rate.std(axis=1, ddof=1)[: len(FORMS)]
    ax.errorbar(
        at[: len(FORMS)], [published[form, "success_rate"] for form in FORMS],
        yerr=2 * spread / np.sqrt(PUBLISHED_RUNS), fmt="D", mfc="white", mec=INK, ecolor=INK, ms=8, capsize=3,
        label="published",
    )  # fmt: skip
    ax.set_xticks(at, [fill(names[gate], 11) for gate in GATES])
    ax.set(xlim=(-0.5, len(GATES) - 0.5), ylabel="right associations (%)")
    fig.legend(*ax.get_legend_handles_labels(), loc="outside lower right", ncols=1)
    return fig


def plot_distributions(outcomes: Mapping[str, Outcome], names: Mapping[str, str]) -> Figure:
    """Distribution of the success rate over runs: solid by the default reading, dotted in the stress test."""
    fig, ax = new_figure(5.6, 3.9)
    for name, style in ((DEFAULT, "-"), (STRESS, ":")):
        for form, runs in zip(FORMS, outcomes[name].rate[: len(FORMS)], strict=True):
            share = 100 * np.arange(1, len(runs) + 1) / len(runs)
            label = names[form] if name == DEFAULT else None
            ax.plot(np.sort(runs), share, style, color=_COLOURS[form], label=label)
    ax.plot([], [], ":", color=GREY, label=names[f"updated-with-{STRESS}"])
    ax.set(xlim=(0, 100), ylim=(0, 100))
    ax.set(xlabel="right associations in a run (%)", ylabel="runs with no more than that (%)")
    fig.legend(*ax.get_legend_handles_labels(), loc="outside lower right", ncols=2)
    return fig


def plot_right_and_wrong(one: Gated, names: Mapping[str, str]) -> Figure:
    """Right and wrong associations of a single run by image, one band for each form."""
    fig, ax = new_figure(5.6, 3.4)
    for row, form in enumerate(FORMS):
        right = one.right[row, 0]
        ax.plot(np.arange(len(right)) + 1, 2 * row + right, ".", color=_COLOURS[form], ms=4)
        ax.annotate(names[form], (1, 2 * row + 0.5), fontsize=10, va="center", color=_COLOURS[form])
    ax.set_yticks(range(2 * len(FORMS)), ["wrong", "right"] * len(FORMS))
    ax.set(xlabel="image", ylim=(-0.4, 5.5))
    return fig


def plot_nis(one: Gated, form: str) -> Figure:
    """NIS of both objects of a single run by image, with the band of a consistent filter."""
    nis = one.nis[GATES.index(form), 0]
    fig, ax = new_figure(5.6, 3.4)
    for which, (name, color) in enumerate(_OBJECTS.items()):
        ax.plot(np.arange(len(nis)) + 1, nis[:, which], ".-", lw=0.7, ms=4, color=color, label=name)
    log_band(ax, *chi_square_interval(2))
    ax.set(xlabel="image", ylabel="NIS")
    ax.set_ylim(top=30 * np.nanmax(nis))
    ax.legend(loc="upper right", ncols=2)
    return fig


def plot_estimates(one: Gated, names: Mapping[str, str]) -> Figure:
    """Where the three forms have the main object of a single run; forms with the same track share a line."""
    groups: list[list[int]] = []
    for row in range(len(FORMS)):
        same = [group for group in groups if np.allclose(one.estimate[group[0]], one.estimate[row])]
        if same:
            same[0].append(row)
        else:
            groups.append([row])
    fig, ax = new_figure(5.0, 4.8)
    for group in groups:
        north, east = one.estimate[group[0], 0].T
        label = "; ".join(names[FORMS[row]] for row in group)
        ax.plot(east, north, ".-", lw=0.8, ms=3, color=_COLOURS[FORMS[group[0]]], label=label)
    north, east = one.targets[0, 0]
    ax.plot(east, north, "k+", ms=13, mew=2, label="main object, truth")
    fig.legend(*ax.get_legend_handles_labels(), loc="outside lower right", ncols=1)
    map_axes(ax)
    return fig


def plot_detections(one: Gated) -> Figure:
    """Georeferenced detections of both objects of a single run about their true places."""
    fig, ax = new_figure(5.0, 4.8)
    for which, (name, color) in enumerate(_OBJECTS.items()):
        north, east = one.measured[0, :, which].T
        ax.plot(east, north, ".", color=color, ms=5, alpha=0.7, label=name)
    north, east = one.targets[0].T
    ax.plot(east, north, "k+", ms=13, mew=2, label="truth")
    fig.legend(*ax.get_legend_handles_labels(), loc="outside lower right", ncols=3)
    map_axes(ax)
    return fig


def plot_variations(
    varied: pd.DataFrame, published: Mapping[tuple[str, str], float], names: Mapping[str, str]
) -> Figure:
    """Success rates of each variation of `wildlab.studies.gating.variations.vary`; dashed: published."""
    fig, ax = new_figure(5.9, 5.6)
    y = np.arange(len(varied))[::-1]
    for shift, form in zip((0.2, 0.0, -0.2), FORMS, strict=True):
        ax.axvline(published[form, "success_rate"], color=_COLOURS[form], lw=0.8, ls=(0, (3, 3)))
        ax.plot(varied[form], y + shift, "o", color=_COLOURS[form], ms=5, label=names[form])
    ax.set_yticks(y, varied["variation"])
    ax.set(xlabel="right associations (%)\ndashed: published")
    fig.legend(*ax.get_legend_handles_labels(), loc="outside lower right", ncols=3)
    return fig


def run_figures(one: Gated, names: Mapping[str, str]) -> list[Shown]:
    """Counterparts of H figures 6.17 to 6.19 for a single run."""
    return [
        Shown(plot_right_and_wrong(one, names), "mistakes", "fig-6-17a"),
        Shown(plot_nis(one, "position"), "nis-position", "fig-6-17b"),
        Shown(plot_nis(one, "pixels"), "nis-pixels", "fig-6-18a"),
        Shown(plot_nis(one, "angles"), "nis-angles", "fig-6-18b"),
        Shown(plot_estimates(one, names), "estimates", "fig-6-19a"),
        Shown(plot_detections(one), "detections", "fig-6-19b"),
    ]
