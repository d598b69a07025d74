"""Planning by what is to be learnt, and the planner above it: F 5.2, 5.3, appendix A."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from time import process_time

import numpy as np
import pandas as pd
from matplotlib.figure import Figure
from numpy.typing import NDArray

from wildlab.analysis.search import Searched, Searcher, rows_at, search
from wildlab.evaluation.intervals import mean_share_interval, share_interval
from wildlab.evaluation.shares import FAILS, HOLDS, MOSTLY, MOSTLY_NOT
from wildlab.messages.quantities import percent_between
from wildlab.planning.legs import Leg, Platform
from wildlab.reporting.charts.drawing import draw_way, finish
from wildlab.reporting.charts.forms import Values, draw_fences, draw_heights, fit_map, lines_chart
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
    draw_scene,
    searchers,
)
from wildlab.studies.page import Facts
from wildlab.studies.protocol import Study

#: Over how many worlds at most planning is timed.
TIMED = 10


class _Timed:
    """A planner, and how much of the processor's time it takes to choose and to add what was seen."""

    def __init__(self, searcher: Searcher) -> None:
        self.searcher = searcher
        self.seconds: list[float] = []

    def next_leg(self, platform: Platform, open_areas: NDArray[np.bool_]) -> Leg:
        """As `Searcher` has it."""
        began = process_time()
        chosen = self.searcher.next_leg(platform, open_areas)
        self.seconds.append(process_time() - began)
        return chosen


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
        found = search(scene.world, timed, scene.start, scene.sensor, scene.flying)
        spent = timed.seconds[1:]
        flown = found.at[-1] - found.at[scene.flying.images - 1]
        rows[seed] = {"decision": float(np.mean(spent)), "load": float(np.sum(spent) / flown)}
    return pd.DataFrame.from_dict(rows, orient="index")


COLOURS = {INFORMATION: BLUE, FIXED: PURPLE, ROWS: ORANGE, SWING: GREEN, CHANCE: GREY}
_STYLES = {INFORMATION: "-", FIXED: "--", ROWS: "-", SWING: "-", CHANCE: ":"}


def search_map(scene: PlanningScene, found: Searched, who: str) -> Figure:
    """The path of one planner over one world, until all were found or the time was up."""
    fig, ax = new_figure(5.6, 3.9)
    draw_heights(ax, scene.world.terrain, 10.0, every=4)
    draw_fences(ax, scene.world.areas)
    path = np.concatenate([scene.start.north_east[None], found.p_nc[:, :2]])
    draw_way(ax, path, COLOURS[who], width=1.3)
    ax.plot(*path[0, ::-1], "s", color=INK, ms=6, label="start")
    late = np.isinf(found.found)
    rows = rows_at(np.where(late, found.at[-1], found.found), scene.flying.interval).astype(int)
    places = scene.world.animals[rows, np.arange(len(rows))]
    for name, which, fill in (
        ("animal, where it was found", ~late, VERMILLION), ("not found, last position", late, "none")
    ):  # fmt: skip
        if which.any():
            ax.plot(*places[which, 1::-1].T, "o", ms=6, mec=INK, mew=1.0, mfc=fill, label=name)
    fit_map(ax, np.concatenate(scene.world.areas), 45.0)
    map_axes(ax)
    return finish(fig, "")


def share_over_time(runs: pd.DataFrame, names: Mapping[str, str]) -> Figure:
    """Share of the animals found over time, mean over worlds, with its 95 % interval."""
    at, lines = np.arange(STATIONS + 1) * BUDGET_S / STATIONS / 60, {}
    for who in SEARCHERS:
        shares = np.column_stack(
            [0 * runs[who, "share_1"], *(runs[who, f"share_{n + 1}"] for n in range(STATIONS))]
        )
        ends = (
            np.transpose([mean_share_interval(column)[1:] for column in shares.T])
            if len(shares) > 1
            else None
        )
        lines[names[who]] = Values(shares.mean(axis=0), ends, COLOURS[who], _STYLES[who])
    fig = lines_chart(at, lines, "time (min)", "share of animals found", size=(5.6, 4.6), ticks=False)
    fig.axes[0].set(xlim=(0, at[-1]), ylim=(0, 1.02))
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


STUDY = Study("information-planning", trial.trial, trial.check_claims, trial.RECORDED.get, answer)
