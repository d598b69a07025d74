"""Which of two detections belongs to the target that is tracked: H 6.3.2, 6.4.3."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from textwrap import fill
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from wildlab.evaluation.consistency import chi_square_interval
from wildlab.evaluation.shares import FAILS, HOLDS, UNDECIDABLE
from wildlab.geometry.frames import Array
from wildlab.reporting.charts.drawing import draw_dots, draw_way, finish
from wildlab.reporting.charts.forms import Values, draw_lines
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
from wildlab.studies.gating.monte_carlo import (
    FORMS,
    GATES,
    Gated,
    Outcome,
    Overflight,
    gate,
)
from wildlab.studies.page import Facts, Shown
from wildlab.studies.protocol import Study

#: The reading that is compared with published rates and that decides the claims.
DEFAULT = "own"
#: The one that shows what mistakes do to a tracker that believes them.
STRESS = "assigned"
#: Whether the assigned measurement updates the track, by reading.
READINGS = {DEFAULT: False, STRESS: True}
#: Less than this share of right associations (per cent) is mostly wrong.
MOSTLY_WRONG = 50.0
#: Success rates (per cent) of the run that H 6.4.3 shows, in the order of `FORMS`.
PUBLISHED_RUN = (91.5, 91.5, 92.2)


def subject(gate: str, reading: str) -> str:
    """Under what name a gate's numbers by a reading are recorded; by the default reading it is the gate's."""
    name = "pixels-and-angles" if gate == "both" else gate
    return name if reading == DEFAULT else f"{name}/updated-with-{reading}"


def mostly_wrong(rates: Array) -> Array:
    """Share of the runs (%) in which more than half of the images are wrong; (k, runs) -> (k,)."""
    return np.asarray(100 * (rates < MOSTLY_WRONG).mean(axis=1))


def metrics_of(outcomes: Mapping[str, Outcome]) -> list[dict[str, Any]]:
    """Every mean rate with its standard error."""
    return [
        {"name": name, "subject": subject(gate, reading), "value": value, "unit": "%", "n": len(rates)}
        for reading, one in outcomes.items()
        for gate, rates in zip(GATES, one.rate, strict=True)
        for name, value in (("success_rate", rates.mean()), ("success_rate_se", standard_error(rates)))
    ]


def rates_table(outcomes: Mapping[str, Outcome], names: Mapping[str, str]) -> pd.DataFrame:
    """For each reading mean success rates (%) by each gate, and the runs (%) mostly wrong by angles."""
    return pd.DataFrame(
        [
            {"reading": names[f"updated-with-{reading}"]}
            | dict(zip(GATES, one.rate.mean(axis=1), strict=True))
            | {"mostly_wrong": mostly_wrong(one.rate)[GATES.index("angles")]}
            for reading, one in outcomes.items()
        ]
    )


def typical_run(over: Overflight, sources: Sequence[np.random.SeedSequence]) -> Gated:
    """Of some runs by the default reading the one whose rates are nearest to those of H's single run."""
    runs = list(sources)
    shares = 100 * gate(over, runs).right[: len(FORMS)].mean(axis=2)
    chosen = int(np.abs(shares.T - PUBLISHED_RUN).max(axis=1).argmin())
    return gate(over, runs[chosen : chosen + 1])


def standard_error(values: Array) -> float:
    """Of the mean of independent values (N,)."""
    return float(values.std(ddof=1) / np.sqrt(len(values)))


def claim_margins(outcome: Outcome) -> dict[str, Array]:
    """How far each claim of H 6.4.3 is from its limits in each run, by its id: (k, runs) for k limits.

    A claim is true where the means of all its margins are positive. ``forms-agree``: no two forms differ by
    more than one percentage point, either way. ``angles-least-accurate``: the leads of position and of
    pixels over the angles, percentage points. ``mistakes-on-different-images``: of the runs in which pixels
    or angles are ever wrong, more than half have them wrong in different images (percentage points from
    half); NaN in a run without mistakes, which says nothing.
    """
    rates = dict(zip(GATES, outcome.rate, strict=True))
    pairs = [(rates[a], rates[b]) for i, a in enumerate(FORMS) for b in FORMS[i + 1 :]]
    differ = np.where(outcome.mistakes.sum(axis=0) > 0, 0.5 - outcome.same_images, np.nan)
    return {
        "forms-agree": np.stack([1 - sign * (a - b) for a, b in pairs for sign in (1, -1)]),
        "angles-least-accurate": np.stack([rates[form] - rates["angles"] for form in ("position", "pixels")]),
        "mistakes-on-different-images": 100 * differ[None],
    }


def verdict(margins: Array) -> str:
    """Whether the means of all margins (k, runs) are positive, each by twice its standard error."""
    known = [one[np.isfinite(one)] for one in margins]
    if min(len(one) for one in known) < 2:
        return UNDECIDABLE
    mean = np.array([one.mean() for one in known])
    unsure = 2 * np.array([standard_error(one) for one in known])
    if (mean > unsure).all():
        return HOLDS
    return FAILS if (mean < -unsure).any() else UNDECIDABLE


#: Runs behind a published success rate, H 6.4.3.
PUBLISHED_RUNS = 10_000
_COLOURS = {"position": BLUE, "pixels": VERMILLION, "angles": GREEN, "both": PURPLE}
_OBJECTS = {"main object": BLUE, "second object": ORANGE}


def plot_rates(
    outcomes: Mapping[str, Outcome], published: Mapping[tuple[str, str], float], names: Mapping[str, str]
) -> Figure:
    """Mean success rates by the default reading; ``published`` by subject and name, hollow.

    Bars are twice the standard error, the published ones' with the same spread between runs.
    """
    fig, ax = new_figure(5.6, 3.9)
    at, look = np.arange(len(GATES)), {"ms": 7, "capsize": 3}
    rates = outcomes[DEFAULT].rate
    twice, label = [2 * standard_error(runs) for runs in rates], names[f"updated-with-{DEFAULT}"]
    ax.errorbar(at, rates.mean(axis=1), twice, fmt="s", color=BLUE, label=label, **look)
    spread = rates.std(axis=1, ddof=1)[: len(FORMS)]
    printed = [published[form, "success_rate"] for form in FORMS]
    hollow = {"fmt": "D", "mfc": "white", "mec": INK, "ecolor": INK, "label": "published"}
    ax.errorbar(at[: len(FORMS)], printed, 2 * spread / np.sqrt(PUBLISHED_RUNS), **hollow, **look)
    ax.set_xticks(at, [fill(names[gate], 11) for gate in GATES])
    ax.set_xlim(-0.5, len(GATES) - 0.5)
    return finish(fig, "", ylabel="right associations (%)")


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
    return finish(fig, "", "right associations in a run (%)", "runs with no more than that (%)")


def plot_right_and_wrong(one: Gated, names: Mapping[str, str]) -> Figure:
    """Right and wrong associations of a single run by image, one band for each form."""
    fig, ax = new_figure(5.6, 3.4)
    for row, form in enumerate(FORMS):
        right = one.right[row, 0]
        ax.plot(np.arange(len(right)) + 1, 2 * row + right, ".", color=_COLOURS[form], ms=4)
        ax.annotate(names[form], (1, 2 * row + 0.5), fontsize=10, va="center", color=_COLOURS[form])
    ax.set_yticks(range(2 * len(FORMS)), ["wrong", "right"] * len(FORMS))
    ax.set_ylim(-0.4, 5.5)
    return finish(fig, "", "image")


def plot_nis(one: Gated, form: str) -> Figure:
    """NIS of both objects of a single run by image, with the band of a consistent filter."""
    nis = one.nis[GATES.index(form), 0]
    fig, ax = new_figure(5.6, 3.4)
    lines = {
        name: Values(nis[:, k], color=color, look=".-") for k, (name, color) in enumerate(_OBJECTS.items())
    }
    draw_lines(ax, np.arange(len(nis)) + 1, lines)
    log_band(ax, *chi_square_interval(2))
    return finish(fig, "", "image", "NIS")


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
        label = "; ".join(names[FORMS[row]] for row in group)
        draw_way(ax, one.estimate[group[0], 0], _COLOURS[FORMS[group[0]]], label, width=0.8, marker=".", ms=3)
    ax.plot(*one.targets[0, 0, ::-1], "k+", ms=13, mew=2, label="main object, truth")
    map_axes(ax)
    return finish(fig, "")


def plot_detections(one: Gated) -> Figure:
    """Georeferenced detections of both objects of a single run about their true places."""
    fig, ax = new_figure(5.0, 4.8)
    for which, (name, color) in enumerate(_OBJECTS.items()):
        north, east = one.measured[0, :, which].T
        draw_dots(ax, east, north, color, name, size=5, alpha=0.7)
    ax.plot(*one.targets[0, :, ::-1].T, "k+", ms=13, mew=2, label="truth")
    map_axes(ax)
    return finish(fig, "")


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


def answer(facts: Facts) -> list[str]:
    """How often the nearer detection is the right one, and what mistakes do to a track that they update."""
    own, stress = (
        [facts.value(subject("angles", reading), name) for name in ("success_rate", "success_rate_se")]
        for reading in ("own", STRESS)
    )
    if math.isnan(own[0] + stress[0]):
        return ["rate-unknown", "stress-unknown"]
    lost, error = own[0] - stress[0], 2 * math.hypot(own[1], stress[1])
    stress_test = "lower" if lost > error else "higher" if -lost > error else "unclear"
    agree = facts.outcome("forms-agree") == "holds"
    return ["rate-forms-agree" if agree else "rate-by-form", f"stress-{stress_test}"]


STUDY = Study("gating", answer=answer)
