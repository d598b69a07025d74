"""Planning by what is to be learnt, and the planner above it: F 5.2, 5.3, appendix A."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from time import process_time

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from wildlab.analysis.search import Searched, Searcher, rows_at, search
from wildlab.evaluation.runs import mean_share_interval, share_interval
from wildlab.evaluation.shares import FAILS, HOLDS, MOSTLY, MOSTLY_NOT
from wildlab.messages.quantities import percent_between
from wildlab.planning.legs import Leg, Platform
from wildlab.reporting.figures import (
    BLUE,
    GREEN,
    GREY,
    INK,
    ORANGE,
    PURPLE,
    VERMILLION,
    map_axes,
    new_figure,
)
from wildlab.studies.information_planning import trial
from wildlab.studies.information_planning.trial import (
    BUDGET_S,
    CHANCE,
    FIXED,
    INFORMATION,
    ROWS,
    SEARCHERS,
    STATIONS,
    SWING,
    PlanningScene,
    Situation,
    draw_scene,
    searchers,
)
from wildlab.studies.page import Facts
from wildlab.studies.protocol import Study, name_metrics

#: Over how many worlds at most planning is timed.
TIMED = 10


class _Timed:
    """A planner, and how much of the processor's time it takes to choose and to add what was seen."""

    def __init__(self, searcher: Searcher) -> None:
        self.searcher = searcher
        self.seconds: list[float] = []

    def next_leg(self, platform: Platform, open_areas: NDArray[np.bool_]) -> tuple[Leg, int]:
        """As `Searcher` has it."""
        began = process_time()
        chosen = self.searcher.next_leg(platform, open_areas)
        self.seconds.append(process_time() - began)
        return chosen

    def flown(self, leg: Leg) -> None:
        """As `Searcher` has it."""
        began = process_time()
        self.searcher.flown(leg)
        self.seconds[-1] += process_time() - began


def planning_cost(seeds: Iterable[int], twin: str) -> pd.DataFrame:
    """What planning by information takes of the processor, without the world and the camera about it.

    Parameters
    ----------
    seeds
        Of the worlds; the first `TIMED` are taken.
    twin
        As for `trial`.

    Returns
    -------
    DataFrame
        A row for each seed: ``decision``, s for each decision on the mean, and ``load``, share of one core
        over the search. The first decision is left out: it loads what is compiled.
    """
    rows = {}
    for seed in list(seeds)[:TIMED]:
        scene = draw_scene(seed, twin)
        timed = _Timed(searchers(scene, seed)[INFORMATION]())
        found = search(scene.world, timed, scene.start, scene.sensor, scene.flying, scene.grid[:1])
        spent = timed.seconds[1:]
        flown = found.at[-1] - found.at[scene.flying.images - 1]
        rows[seed] = {"decision": float(np.mean(spent)), "load": float(np.sum(spent) / flown)}
    return pd.DataFrame.from_dict(rows, orient="index")


COLOURS = {INFORMATION: BLUE, FIXED: PURPLE, ROWS: ORANGE, SWING: GREEN, CHANCE: GREY}
_STYLES = {INFORMATION: "-", FIXED: "--", ROWS: "-", SWING: "-", CHANCE: ":"}


def search_map(scene: PlanningScene, found: Searched, who: str) -> Figure:
    """The path of one planner over one world, until all were found or the time was up."""
    fig, ax = new_figure(5.6, 3.9)
    _ground(ax, scene)
    path = np.concatenate([scene.start.north_east[None], found.p_nc[:, :2]])
    ax.plot(path[:, 1], path[:, 0], color=COLOURS[who], lw=1.3)
    ax.plot(path[0, 1], path[0, 0], "s", color=INK, ms=6, label="start")
    for animal, time in enumerate(found.found):
        seen_at = found.at[-1] if np.isinf(time) else time
        row = int(rows_at(np.array([seen_at]), scene.flying.interval)[0])
        at = scene.world.animals[row, animal]
        late = np.isinf(time)
        ax.plot(at[1], at[0], "o", ms=6, mec=INK, mew=1.0, mfc="none" if late else VERMILLION)
    ax.plot([], [], "o", ms=6, mec=INK, mfc=VERMILLION, label="animal, where it was found")
    if np.isinf(found.found).any():
        ax.plot([], [], "o", ms=6, mec=INK, mfc="none", label="not found, last position")
    lows = np.min([area.min(axis=0) for area in scene.world.areas], axis=0) - 45
    highs = np.max([area.max(axis=0) for area in scene.world.areas], axis=0) + 45
    ax.set(xlim=(lows[1], highs[1]), ylim=(lows[0], highs[0]))
    map_axes(ax)
    fig.legend(*ax.get_legend_handles_labels(), loc="outside lower center", ncols=2)
    return fig


def _ground(ax: Axes, scene: PlanningScene) -> None:
    terrain = scene.world.terrain
    south, north, west, east = terrain.extent
    every = 4
    heights = terrain.height[::every, ::every]
    ax.contour(
        np.linspace(west, east, heights.shape[1]), np.linspace(south, north, heights.shape[0]), heights,
        levels=np.arange(0, 200, 10), colors="#C9D0D6", linewidths=0.7,
    )  # fmt: skip
    for area in scene.world.areas:
        ring = np.concatenate([area, area[:1]])
        ax.plot(ring[:, 1], ring[:, 0], color=INK, lw=1.2)


def share_over_time(runs: pd.DataFrame, names: Mapping[str, str]) -> Figure:
    """Share of the animals found over time, mean over worlds, with its 95 % interval."""
    at = np.arange(STATIONS + 1) * BUDGET_S / STATIONS / 60
    fig, ax = new_figure(5.6, 4.6)
    for who in SEARCHERS:
        shares = np.column_stack([runs[who, f"share_{n + 1}"] for n in range(STATIONS)])
        shares = np.concatenate([np.zeros((len(shares), 1)), shares], axis=1)
        if len(shares) > 1:
            low, high = np.transpose([mean_share_interval(column)[1:] for column in shares.T])
            ax.fill_between(at, low, high, color=COLOURS[who], alpha=0.16, lw=0)
        ax.plot(at, shares.mean(axis=0), _STYLES[who], color=COLOURS[who], label=names[who])
    ax.set(xlabel="time (min)", ylabel="share of animals found", xlim=(0, at[-1]), ylim=(0, 1.02))
    fig.legend(*ax.get_legend_handles_labels(), loc="outside lower center", ncols=2)
    return fig


def times_of_worlds(runs: pd.DataFrame, names: Mapping[str, str]) -> Figure:
    """In which share of the worlds all animals were found by a time."""
    fig, ax = new_figure(5.6, 4.6)
    for who in SEARCHERS:
        whole = runs[who, "share_found"].to_numpy(float) >= 1
        times = np.sort(runs[who, "all_found"].to_numpy(float)[whole]) / 60
        x = np.concatenate([[0.0], times, [BUDGET_S / 60]])
        y = np.concatenate([[0.0], np.arange(1, len(times) + 1), [len(times)]]) / len(runs)
        ax.step(x, y, _STYLES[who], where="post", color=COLOURS[who], label=names[who])
    ax.set(
        xlabel="time until all are found (min)",
        ylabel="share of worlds",
        xlim=(0, BUDGET_S / 60),
        ylim=(0, 1.02),
    )
    fig.legend(*ax.get_legend_handles_labels(), loc="outside lower center", ncols=2)
    return fig


def tours_map(situation: Situation) -> Figure:
    """The path of the greedy high-level planner and the shortest one."""
    fig, ax = new_figure(5.6, 3.9)
    greedy, ahead = situation.greedy, situation.ahead
    for tour, colour, name in ((greedy, VERMILLION, "greedy"), (ahead, BLUE, "shortest")):
        label = f"{name}, {tour.time / 60:.1f} min"
        ax.plot(tour.path[:, 1], tour.path[:, 0], color=colour, lw=1.5, label=label)
    ax.scatter(
        situation.positions[:, 1],
        situation.positions[:, 0],
        s=8 * np.sqrt(situation.covariances[:, 0, 0]),
        color=GREY,
        label="known animals",
    )
    ax.plot(*situation.platform[::-1], "s", color=INK, ms=6, label="platform")
    ax.plot(*situation.way_point[::-1], "D", mfc="none", mec=INK, ms=7, label="next way point of the search")
    ax.margins(0.12)
    map_axes(ax)
    fig.legend(*ax.get_legend_handles_labels(), loc="outside lower center", ncols=2)
    return fig


def planners_table(runs: pd.DataFrame, names: Mapping[str, str]) -> pd.DataFrame:
    """Medians over worlds of times (min), and in how many worlds the planner by information is sooner."""
    own = runs[INFORMATION, "all_found"].to_numpy(float)
    rows = []
    for who in SEARCHERS:
        times = runs[who, "all_found"].to_numpy(float)
        sooner = share_interval(int((own < times).sum()), int((~np.isnan(own + times)).sum()))
        missed = int((runs[who, "share_found"] < 1).sum())
        rows.append(
            {
                "planner": names[who],
                "half": _median_minutes(runs[who, "half_found"]),
                "all": _median_minutes(runs[who, "all_found"]),
                "missed": f"{missed} of {len(runs)}",
                "sooner": "" if who == INFORMATION else percent_between(sooner, 0),
            }
        )
    return pd.DataFrame(rows)


def _median_minutes(seconds: pd.Series) -> str:
    """A median in minutes; of searches that ended before it, that they did."""
    middle = float(seconds.median())
    return f"over {BUDGET_S / 60:.0f}" if middle >= BUDGET_S - 1e-6 else f"{middle / 60:.1f}"


_SIDES = {HOLDS: "sooner", MOSTLY: "sooner", MOSTLY_NOT: "later", FAILS: "later"}


def answer(facts: Facts) -> list[str]:
    """On most worlds sooner than rows with a swinging camera or not, then the same with fixed cameras."""
    medians = [facts.value(who, "all_found") for who in (INFORMATION, SWING)]
    if any(map(math.isnan, medians)):
        return ["unknown"]
    swing, fixed = (
        _SIDES.get(facts.verdicts.get(claim, ""), "open")
        for claim in ("lower-search-time-swing", "lower-search-time-fixed")
    )
    # A search ends then: what is recorded at the limit is no time at which all were found.
    limit = "-at-limit" if max(medians) >= BUDGET_S else ""
    return [f"free-{swing}{limit}", f"fixed-{fixed}"]


STUDY = Study(
    "information-planning",
    trial.SUBJECTS,
    trial.trial,
    trial.check_claims,
    name_metrics(trial.RECORDED),
    answer,
)
