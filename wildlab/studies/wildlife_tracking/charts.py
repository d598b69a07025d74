"""Figures of the study of tracking animals: counterparts of F figures 5.4, 7.13, 7.14 and 7.19."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Rectangle

from wildlab.analysis.animals.follow import FollowedAnimals, Known
from wildlab.analysis.animals.images import NONE
from wildlab.analysis.animals.revisit import Patrolled
from wildlab.evaluation.runs import mean_interval
from wildlab.geometry.frames import Array
from wildlab.reporting.figures import (
    BLUE,
    GREY,
    INK,
    ORANGE,
    SKY,
    VERMILLION,
    ellipse,
    map_axes,
    new_figure,
)
from wildlab.studies.page import Shown
from wildlab.studies.wildlife_tracking.rendered import Renderings, seen_again, telling_image
from wildlab.studies.wildlife_tracking.trial import (
    GONDOLA,
    NEGATIVE,
    POSITIVE,
    REVISITS,
    UAV,
    Runs,
    World,
)

#: Probability that the drawn ellipses hold, as in F figure 4.1.
HELD = 0.95
#: So many images after a visit has found its animal is the last of the maps of it.
AFTER = 60


def figures(runs: Runs, table: pd.DataFrame, renderings: Renderings, names: Mapping[str, str]) -> list[Shown]:
    """All figures of the page; those of a visit and of one animal only where the world has them.

    Parameters
    ----------
    runs, renderings
        Of the world shown.
    table
        Of all worlds.
    names
        Words for platforms and weathers.
    """
    gondola = runs.worlds[GONDOLA], runs.followed[GONDOLA, NEGATIVE]
    multicopter = runs.worlds[UAV], runs.followed[UAV, NEGATIVE]
    found = {
        "fig-7-19b": tracks_map(*gondola, 1.0),
        "fig-7-19a": tracks_map(*gondola, 0.5),
        "fig-7-13": tracks_map(*multicopter, 1.0),
        "covariance": deviation_over_time(runs),
        "negative": negative_differences(table, names),
        "fig-7-14": visit_maps(runs.worlds[UAV], runs.patrolled[REVISITS]),
        "frames": frame_in_weathers(renderings, names),
    }
    return [Shown(fig, name) for name, fig in found.items() if fig is not None]


def tracks_map(world: World, followed: FollowedAnimals, share: float) -> Figure:
    """Animals, tracks and the path up to a share of the first lap."""
    fig, ax = new_figure(5.9, 5.2)
    times = world.images.times
    known = _at(followed.known, times, share * world.lap)
    seen = {one.animal for one in followed.found if one.image <= known.image}
    way = world.images.poses.p_nc[: known.image + 1, :2]
    _ground(ax, world, way)
    _animals(ax, world.images.truth[known.image], seen)
    _tracks(ax, known)
    _fit(ax, world, way)
    _explain(fig)
    return fig


def _at(known: list[Known], times: Array, time: float) -> Known:
    return known[int(np.argmin([abs(times[one.image] - time) for one in known]))]


def _ground(ax: Axes, world: World, way: Array) -> None:
    for fence in world.fences:
        ring = np.concatenate([fence, fence[:1]])
        ax.plot(ring[:, 1], ring[:, 0], color=INK, lw=1.2)
    ax.plot(way[:, 1], way[:, 0], color=GREY, lw=1.0)
    ax.plot(way[-1, 1], way[-1, 0], "^", color=INK, ms=7)
    ax.grid(False)


def _explain(fig: Figure, *, animals: bool = True) -> None:
    """What lines and signs of a map are, below it."""
    ground = [
        Line2D([], [], color=INK, lw=1.2, label="fence of an enclosure"),
        Line2D([], [], color=GREY, lw=1.0, label="path so far"),
        Line2D([], [], color=INK, marker="^", ms=7, lw=0, label="the camera now"),
    ]
    if animals:
        dot: dict[str, Any] = {"marker": "o", "ms": 4.5, "mec": INK, "mew": 0.9, "lw": 0}
        ground += [
            Line2D([], [], color=BLUE, lw=1.3, label="track of an animal"),
            Line2D([], [], mfc=VERMILLION, label="animal, detected", **dot),
            Line2D([], [], mfc="none", label="animal, not detected yet", **dot),
        ]
    else:
        ground += [
            Line2D([], [], color=VERMILLION, lw=2.0, label="track of the animal visited"),
            Line2D([], [], color=BLUE, lw=1.2, label="other tracks"),
        ]
    fig.legend(handles=ground, loc="outside lower center", ncols=2)


def _animals(ax: Axes, places: Array, seen: set[int]) -> None:
    for animal, (north, east) in enumerate(places):
        ax.plot(east, north, "o", ms=4.5, mec=INK, mew=0.9, mfc=VERMILLION if animal in seen else "none")


def _tracks(ax: Axes, known: Known, color: str = BLUE) -> None:
    for mean, covariance in zip(known.mean, known.covariance, strict=True):
        ellipse(ax, mean[::-1], covariance[::-1, ::-1], HELD, color=color, lw=1.3)


def _fit(ax: Axes, world: World, way: Array) -> None:
    """The view to the enclosures and the way, whatever an ellipse reaches to."""
    points = np.concatenate([*world.fences, way])
    low, high = points.min(axis=0) - 25, points.max(axis=0) + 25
    ax.set(xlim=(low[1], high[1]), ylim=(low[0], high[0]))
    map_axes(ax)


def visit_rows(flown: Patrolled) -> tuple[int, int] | None:
    """Of the visit after which the covariance fell furthest: its first image, and that which found it.

    None where no visit found its animal.
    """
    best: tuple[float, int, int] | None = None
    for one in flown.found:
        if flown.goal[one.image] != one.track or not np.isfinite(one.before):
            continue
        first = one.image
        while first > 0 and flown.goal[first - 1] == one.track:
            first -= 1
        if best is None or one.before - one.after > best[0]:
            best = (one.before - one.after, first, one.image)
    return None if best is None else best[1:]


def visit_maps(world: World, flown: Patrolled) -> Figure | None:
    """Before a visit, as it finds its animal, and when the search goes on (F figures 5.4 and 7.14)."""
    rows = visit_rows(flown)
    if rows is None:
        return None
    first, found = rows
    track = int(flown.goal[found])
    later = min(found + AFTER, len(flown.times) - 1)
    waited = f"{flown.times[later] - flown.times[found]:.0f} s later"
    fig, axes = new_figure(5.9, 9.0, rows=3)
    middle = flown.known[found].mean[flown.known[found].identity == track][0]
    for ax, row, what in zip(
        axes, (max(first - 1, 0), found, later), ("Before the visit", "Seen again", waited), strict=True
    ):
        known = flown.known[row]
        mine = known.identity == track
        _ground(ax, world, flown.p_nc[: row + 1, :2])
        for mean, covariance in zip(known.mean[~mine], known.covariance[~mine], strict=True):
            ellipse(ax, mean[::-1], covariance[::-1, ::-1], HELD, color=BLUE, lw=1.2)
        sd = np.nan
        for mean, covariance in zip(known.mean[mine], known.covariance[mine], strict=True):
            ellipse(ax, mean[::-1], covariance[::-1, ::-1], HELD, color=VERMILLION, lw=2.0)
            sd = float(np.sqrt(np.trace(covariance) / 2))
        ax.set(xlim=(middle[1] - 160, middle[1] + 160), ylim=(middle[0] - 95, middle[0] + 95))
        map_axes(ax, scale_bar=ax is axes[-1])
        ax.set_xlabel("east (m)" if ax is axes[-1] else "")
        ax.set_title(f"{what}: SD {sd:.1f} m")
    _explain(fig, animals=False)
    return fig


def most_seen(followed: FollowedAnimals, out: float) -> int | None:
    """The animal that came back into sight most often, after being out of it for so long, s."""
    back = [one.animal for one in followed.found if np.isfinite(one.away) and one.away > out]
    return int(np.bincount(back).argmax()) if back else None


def deviation_over_time(runs: Runs) -> Figure | None:
    """Predicted deviation of one animal's track over time, with and without the negative update."""
    world = runs.worlds[UAV]
    animal = most_seen(runs.followed[UAV, NEGATIVE], 60.0)
    if animal is None:
        return None
    fig, ax = new_figure(5.9, 3.6)
    for name, color, label, style in (
        (POSITIVE, ORANGE, "detections alone", "--"), (NEGATIVE, BLUE, "with negative update", "-")
    ):  # fmt: skip
        times, sd = sd_of(world, runs.followed[UAV, name], animal)
        ax.plot(times / 60, sd, style, color=color, label=label)
    seen = [one.image for one in runs.followed[UAV, NEGATIVE].found if one.animal == animal]
    ax.plot(world.images.times[seen] / 60, np.zeros(len(seen)), "|", color=INK, ms=12, label="detected")
    ax.axvline(world.lap / 60, color=GREY, lw=1.0, ls=":", label="a lap")
    ax.set(xlabel="time (min)", ylabel="predicted SD (m)", ylim=(0, None))
    fig.legend(*ax.get_legend_handles_labels(), loc="outside lower center", ncols=2)
    return fig


def sd_of(world: World, followed: FollowedAnimals, animal: int) -> tuple[Array, Array]:
    """Times (K,) s and the stated standard deviation (K,) m of an animal's track at the stations."""
    own, row, times, sd = 0, 0, list[float](), list[float]()
    for known in followed.known:
        while row < len(followed.found) and followed.found[row].image <= known.image:
            if followed.found[row].animal == animal:
                own = followed.found[row].track
            row += 1
        at = np.flatnonzero(known.identity == own)
        times.append(float(world.images.times[known.image]))
        sd.append(float(np.sqrt(np.trace(known.covariance[at[0]]) / 2)) if len(at) else np.nan)
    return np.array(times), np.array(sd)


def negative_differences(runs: pd.DataFrame, names: Mapping[str, str]) -> Figure:
    """What the negative update changes, world by world."""
    fig, axes = new_figure(5.9, 3.8, columns=2, sharey=True)
    rng = np.random.default_rng(0)  # to tell points apart, across
    platforms = (GONDOLA, UAV)
    for ax, name, label in zip(axes, ("sd", "rmse"), ("Predicted SD", "RMS error"), strict=True):
        for place, platform in enumerate(platforms):
            one, other = f"{platform}-{NEGATIVE}", f"{platform}-{POSITIVE}"
            values = (runs[one, name] - runs[other, name]).dropna().to_numpy(float)
            across = place + rng.uniform(-0.16, 0.16, len(values))
            ax.plot(across, values, "o", ms=4, color=(BLUE, ORANGE)[place], alpha=0.55, mew=0)
            if len(values) > 1:
                found = mean_interval(values)
                bar = [[found.estimate - found.low], [found.high - found.estimate]]
                ax.errorbar(place + 0.3, found.estimate, bar, fmt="D", color=INK, ms=5, capsize=4)
        ax.axhline(0, color=GREY, lw=1.0)
        ax.set(xlim=(-0.5, 1.6), xticks=[0, 1], xticklabels=[names[one] for one in platforms])
        ax.set_title(label)
    axes[0].set_ylabel("with less without (m)")
    return fig


def frame_in_weathers(runs: Renderings, names: Mapping[str, str]) -> Figure:
    """One frame in each weather, with what is detected in it."""
    k = telling_image(runs)
    fig, axes = new_figure(5.9, 4.1 * len(runs.by_weather), rows=len(runs.by_weather), squeeze=False)
    in_view = set(np.flatnonzero(runs.world.images.in_view[k]).tolist())
    for ax, (name, one) in zip(axes.flat, runs.by_weather.items(), strict=True):
        grey, found, judged = seen_again(runs.world, one, k)
        ax.imshow(grey, cmap="gray", vmin=0, vmax=255, interpolation="nearest")
        for (left, top, width, height), animal in zip(found.box, judged.animal, strict=True):
            colour = VERMILLION if animal == NONE else SKY
            ax.add_patch(
                Rectangle((left - 5, top - 5), width + 10, height + 10, fill=False, ec=colour, lw=1.6)
            )
        ax.set(xlim=(-0.5, grey.shape[1] - 0.5), ylim=(grey.shape[0] - 0.5, -0.5), xticks=[], yticks=[])
        ax.grid(False)
        false = int((judged.animal == NONE).sum())
        hits = len(in_view & set(judged.animal.tolist()))
        ax.set_title(f"{names[name]}: {hits} of {len(in_view)} found, {false} false")
    return fig
