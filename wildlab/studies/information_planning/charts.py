"""Charts of the study of planning by information: ways over the ground, and when animals are found."""

from __future__ import annotations

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from wildlab.analysis.search import Searched, rows_at
from wildlab.evaluation.runs import mean_share_interval
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
from wildlab.reporting.text import percent
from wildlab.studies.information_planning.text import NAMES, median_words, minutes
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
)

#: What `Report.figures` takes: figure, name, alternative text, caption.
Shown = tuple[Figure, str, str, str]
COLOURS = {INFORMATION: BLUE, FIXED: PURPLE, ROWS: ORANGE, SWING: GREEN, CHANCE: GREY}
_STYLES = {INFORMATION: "-", FIXED: "--", ROWS: "-", SWING: "-", CHANCE: ":"}


def way_shown(scene: PlanningScene, found: Searched, who: str) -> Shown:
    """The way of one planner over one world, until all were found or the time was up."""
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
        ax.plot([], [], "o", ms=6, mec=INK, mfc="none", label="not found, where it was last")
    lows = np.min([area.min(axis=0) for area in scene.world.areas], axis=0) - 45
    highs = np.max([area.max(axis=0) for area in scene.world.areas], axis=0) + 45
    ax.set(xlim=(lows[1], highs[1]), ylim=(lows[0], highs[0]))
    map_axes(ax)
    last = found.found.max()
    what = f"all found after {minutes(last)} min" if np.isfinite(last) else _missed(found)
    ax.set_title(f"{NAMES[who].capitalize()}: {what}")
    fig.legend(*ax.get_legend_handles_labels(), loc="outside lower center", ncols=2)
    return (
        fig, f"way-{who}",
        f"Map of two enclosures and the way flown {NAMES[who]}: {what}.",
        f"Grey: height of the ground, every 10 m. {percent_seen(found)} of the cells were seen.",
    )  # fmt: skip


def _missed(found: Searched) -> str:
    return f"{int(np.isinf(found.found).sum())} of {len(found.found)} not found in {minutes(BUDGET_S)} min"


def percent_seen(found: Searched) -> str:
    """Share of the grid that was seen, in words."""
    return percent(float(found.covered[-1]))


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


def share_shown(spread: pd.DataFrame) -> Shown:
    """Share of the animals found over time, mean over worlds, with 95 % bands of the mean."""
    at = np.arange(STATIONS + 1) * BUDGET_S / STATIONS / 60
    fig, ax = new_figure(5.6, 3.8)
    ends = {}
    for who in SEARCHERS:
        shares = np.column_stack([spread[who, f"share_{n + 1}"] for n in range(STATIONS)])
        shares = np.concatenate([np.zeros((len(shares), 1)), shares], axis=1)
        mean = shares.mean(axis=0)
        if len(shares) > 1:
            low, high = np.transpose([mean_share_interval(column)[1:] for column in shares.T])
            ax.fill_between(at, low, high, color=COLOURS[who], alpha=0.16, lw=0)
        ax.plot(at, mean, _STYLES[who], color=COLOURS[who], label=NAMES[who])
        ends[who] = float(np.interp(5.0, at, mean))
    ax.set(xlabel="time (min)", ylabel="share of the animals found", xlim=(0, at[-1]), ylim=(0, 1.02))
    ax.set_title(
        f"After 5 min: {100 * ends[INFORMATION]:.0f} % by information, "
        f"{100 * ends[SWING]:.0f} % swinging rows"
    )
    fig.legend(*ax.get_legend_handles_labels(), loc="outside lower center", ncols=2)
    said = ", ".join(f"{NAMES[who]} {100 * ends[who]:.0f} %" for who in SEARCHERS)
    return (
        fig, "share-found", f"Share of the animals found against time; after 5 minutes: {said}.",
        f"Mean over {len(spread)} worlds; bands: Student's 95 % intervals of the mean.",
    )  # fmt: skip


def times_shown(spread: pd.DataFrame) -> Shown:
    """In which share of the worlds all animals were found by a time."""
    fig, ax = new_figure(5.6, 3.8)
    for who in SEARCHERS:
        whole = spread[who, "share_found"].to_numpy(float) >= 1
        times = np.sort(spread[who, "all_found"].to_numpy(float)[whole]) / 60
        x = np.concatenate([[0.0], times, [BUDGET_S / 60]])
        y = np.concatenate([[0.0], np.arange(1, len(times) + 1), [len(times)]]) / len(spread)
        ax.step(x, y, _STYLES[who], where="post", color=COLOURS[who], label=NAMES[who])
    ax.set(
        xlabel="time until all are found (min)",
        ylabel="share of the worlds",
        xlim=(0, BUDGET_S / 60),
        ylim=(0, 1.02),
    )
    middle = {who: median_words(spread[who, "all_found"]) for who in SEARCHERS}
    ax.set_title(f"All found: {middle[INFORMATION]} min by information, {middle[SWING]} swinging rows")
    fig.legend(*ax.get_legend_handles_labels(), loc="outside lower center", ncols=2)
    said = "; ".join(f"{NAMES[who]} {middle[who]} min" for who in SEARCHERS)
    return (
        fig, "times", f"Share of the worlds in which all animals were found by a time; medians: {said}.",
        f"Empirical distributions over {len(spread)} worlds; the title has the medians.",
    )  # fmt: skip


def greedy_shown(situation: Situation) -> Shown:
    """The way of the greedy high-level planner beside the shortest one."""
    fig, ax = new_figure(5.6, 3.9)
    greedy, ahead = situation.greedy, situation.ahead
    for tour, colour, name in ((greedy, VERMILLION, "by F (5.3)"), (ahead, BLUE, "shortest order")):
        ax.plot(
            tour.path[:, 1], tour.path[:, 0], color=colour, lw=1.5, label=f"{name}, {minutes(tour.time)} min"
        )
    spread = np.sqrt(situation.covariances[:, 0, 0])
    ax.scatter(
        situation.positions[:, 1],
        situation.positions[:, 0],
        s=8 * spread,
        color=GREY,
        label="animals that are known",
    )
    ax.plot(*situation.platform[::-1], "s", color=INK, ms=6, label="platform")
    ax.plot(*situation.way_point[::-1], "D", mfc="none", mec=INK, ms=7, label="next way point of the search")
    ax.margins(0.12)
    map_axes(ax)
    longer = 100 * (greedy.time / ahead.time - 1)
    turned = f", and turns round {greedy.broken_off} times" if greedy.broken_off else ""
    ax.set_title(f"The greedy way is {longer:.0f} % longer{turned}")
    fig.legend(*ax.get_legend_handles_labels(), loc="outside lower center", ncols=2)
    return (
        fig, "greedy",
        f"Two ways to the same goals: the greedy one takes {minutes(greedy.time)} min, the shortest "
        f"{minutes(ahead.time)} min.",
        "Larger dots: animals that were not seen for longer. Counterpart of F figure 5.4.",
    )  # fmt: skip
