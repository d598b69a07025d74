"""Which of two detections belongs to the target that is tracked: H 6.3.2, 6.4.3."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from textwrap import fill
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from wildlab.evaluation.consistency import chi_square_interval
from wildlab.evaluation.shares import FAILS, HOLDS, UNDECIDABLE
from wildlab.flight.store import Flight
from wildlab.geometry.frames import Array
from wildlab.reporting.charts.drawing import draw_dots, draw_way, finish
from wildlab.reporting.charts.forms import Values, draw_lines, rows_chart
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
    Choices,
    Gated,
    Outcome,
    Overflight,
    gate,
    overflight,
    success_rates,
)
from wildlab.studies.page import Facts, Shown
from wildlab.studies.protocol import Study

#: The reading that is compared with published rates and that decides the claims.
DEFAULT = "own"
#: The one that shows what mistakes do to a tracker that believes them.
STRESS = "assigned"
READINGS: Mapping[str, Choices] = {
    "own": Choices(updated_with="own"),
    "assigned": Choices(updated_with="assigned"),
    "angles": Choices(updated_with="own", angles_update="angles"),
}
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
    shares = 100 * gate(over, READINGS[DEFAULT], runs).right[: len(FORMS)].mean(axis=2)
    chosen = int(np.abs(shares.T - PUBLISHED_RUN).max(axis=1).argmin())
    return gate(over, READINGS[DEFAULT], runs[chosen : chosen + 1])


def standard_error(values: Array) -> float:
    """Of the mean of independent values (N,), those that are NaN left out."""
    finite = values[np.isfinite(values)]
    return float(finite.std(ddof=1) / np.sqrt(len(finite)))


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


#: How far to the side the targets are put, m: three quarters of the way to the edge of the image.
ASIDE_M = 30.0


def variations(flight: Flight, chosen: Choices) -> dict[str, tuple[Overflight, Choices]]:
    """The flight and the choices of each variation, by what is changed; the first changes nothing."""
    over = overflight(flight)
    flights = {
        "as chosen": over,
        "camera at rest, looking down": overflight(flight, gimbal="down"),
        "camera of half the focal length": overflight(flight, focal_scale=0.5),
        "camera of one and a half times it": overflight(flight, focal_scale=1.5),
        "50 m high": overflight(flight, height_scale=0.5),
        "200 m high": overflight(flight, height_scale=2.0),
        f"targets {ASIDE_M:.0f} m to the right": overflight(flight, right=ASIDE_M),
        f"targets {ASIDE_M:.0f} m to the left": overflight(flight, right=-ASIDE_M),
    }
    filters: dict[str, Callable[[Choices], Choices]] = {
        "no process noise": lambda c: replace(c, sd_acceleration=0.0),
        "process noise 0.2 m/s²": lambda c: replace(c, sd_acceleration=0.2),
        "process noise 1 m/s²": lambda c: replace(c, sd_acceleration=1.0),
        "a second between the 50 iterations": lambda c: replace(c, warm_up_step=1.0),
        "track not updated": lambda c: replace(c, updated_with="nothing"),
        "one-argument arctangent": lambda c: replace(c, azimuth="arctan"),
        "(6.10) to the letter": lambda c: replace(c, azimuth="printed"),
        "only images that show both": lambda c: replace(c, in_image_only=True),
    }
    return {name: (other, chosen) for name, other in flights.items()} | {
        name: (over, change(chosen)) for name, change in filters.items()
    }


def vary(flight: Flight, chosen: Choices, runs: int, seed: int) -> pd.DataFrame:
    """Mean success rates (per cent) of every variation, on the same draws.

    Returns
    -------
    DataFrame
        ``variation``; for each form its mean, and as ``<form>_change`` and ``<form>_se`` the mean difference
        from the first row, run by run, with its standard error; and as ``<form>_mean_se`` the mean's own.
    """
    rows: list[dict[str, object]] = []
    first: Array | None = None
    for name, (over, choices) in variations(flight, chosen).items():
        rates = success_rates(over, choices, runs, seed)[: len(FORMS)]
        first = rates if first is None else first
        row: dict[str, object] = {"variation": name}
        for form, own, base in zip(FORMS, rates, first, strict=True):
            change = (own - base)[np.isfinite(own)]
            row |= {
                form: np.nanmean(own),
                f"{form}_change": change.mean(),
                f"{form}_se": standard_error(change),
                f"{form}_mean_se": standard_error(own),
            }
        rows.append(row)
    return pd.DataFrame(rows)


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
    at, look = np.arange(len(GATES)), {"ms": 7, "capsize": 3}
    shown = [name for name in outcomes if name != STRESS]
    for name, (marker, color, aside) in zip(shown, _MARKS, strict=False):
        rates = outcomes[name].rate
        twice, label = [2 * standard_error(runs) for runs in rates], names[f"updated-with-{name}"]
        ax.errorbar(at + aside, rates.mean(axis=1), twice, fmt=marker, color=color, label=label, **look)
    spread = outcomes[DEFAULT].rate.std(axis=1, ddof=1)[: len(FORMS)]
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


def plot_variations(
    varied: pd.DataFrame, published: Mapping[tuple[str, str], float], names: Mapping[str, str]
) -> Figure:
    """Success rates of each variation of `vary`; dashed: published."""
    series = {names[form]: Values(varied[form], color=_COLOURS[form]) for form in FORMS}
    label = "right associations (%)\ndashed: published"
    fig = rows_chart(list(varied["variation"]), series, label, size=(5.9, 5.6), apart=0.2)
    for form in FORMS:
        fig.axes[0].axvline(published[form, "success_rate"], color=_COLOURS[form], lw=0.8, ls=(0, (3, 3)))
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
