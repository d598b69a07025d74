"""What the camera can see over terrain, by F's two algorithms and exactly: F 2.5, 7.2."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Mapping
from functools import partial

import numpy as np
import pandas as pd
from matplotlib.figure import Figure
from numpy.typing import ArrayLike

from wildlab.evaluation.intervals import mean_interval, mean_share_interval
from wildlab.evaluation.shares import Check
from wildlab.geometry.frames import Array
from wildlab.geometry.line_of_sight import cast_rays, compare_angles, field_of_view, in_field_of_view
from wildlab.geometry.terrain import Terrain
from wildlab.geometry.viewsheds import lines_clear
from wildlab.messages.quantities import percent, percent_between
from wildlab.reporting.charts.drawing import finish
from wildlab.reporting.charts.forms import Values, draw_heights, fit_map, lines_chart
from wildlab.reporting.figures import BLUE, GREEN, INK, ORANGE, VERMILLION, map_axes, new_figure
from wildlab.reporting.published import bounds_of
from wildlab.simulation.error_models import stream
from wildlab.simulation.landscape import synthetic_landscape
from wildlab.studies.line_of_sight import trial
from wildlab.studies.line_of_sight.trial import (
    ANGLES,
    EXACT,
    FEWEST,
    HEIGHT,
    HEIGHTS,
    INCIDENCES,
    LETTER,
    RAYS,
    STEP,
    TILT,
    TOLERANCE,
    TREES,
    VIEW,
    WHOLE_RAYS,
    TerrainView,
    camera_of,
    look,
    nodes_of,
    settings,
)
from wildlab.studies.page import Facts
from wildlab.studies.protocol import Study

#: How often each call is timed; the quickest counts.
REPEATS = 5
#: What is timed.
WAYS = (RAYS, WHOLE_RAYS, ANGLES, EXACT)
#: Over how many lands at most: more would tell no more of a ratio than this.
MOST = 20
#: Grid points in view that are timed, at most; and of the whole map one in so many.
MOST_POINTS, PART = 2000, 10


def best_times(calls: Mapping[str, Callable[[], object]], repeats: int) -> dict[str, float]:
    """Fewest seconds of the processor for each call, all in turn: what else a machine does only adds."""
    for call in calls.values():
        call()  # the first one compiles, and fills the caches
    times: dict[str, list[float]] = {name: [] for name in calls}
    for _ in range(repeats):
        for name, call in calls.items():
            begun = time.process_time()
            call()
            times[name].append(time.process_time() - begun)
    return {name: min(each) for name, each in times.items()}


def timed(seeds: Iterable[int], twin: str, repeats: int = REPEATS) -> pd.DataFrame:
    """Times of the three ways over views like those of the trials.

    Parameters
    ----------
    seeds
        Of the lands; the first `MOST` are taken.
    twin
        Whose camera it is.
    repeats
        Of each call, of which the quickest counts.

    Returns
    -------
    DataFrame
        A row for each seed; columns (way, height): seconds a grid point in view; `VIEW`: seconds for each
        grid point of the map to tell whether it is in view.
    """
    camera, rows, lands = camera_of(twin), {}, list(seeds)[:MOST]
    angles = field_of_view(camera)
    for seed in lands:
        land, rng = synthetic_landscape(seed), stream(seed, "times")
        row: dict[tuple[str, int], float] = {}
        _, points = nodes_of(land)
        for height in HEIGHTS:
            view = look(land, camera, rng, height, TILT)
            # In the order of the map: to fetch heights from all over it would be what takes the time.
            some = np.sort(rng.permutation(len(view.nodes))[:MOST_POINTS])
            nodes, ends, lens = view.nodes[some], view.points[some], view.p_nc
            found = best_times(
                {
                    RAYS: partial(cast_rays, land, nodes, lens, STEP, TOLERANCE),
                    WHOLE_RAYS: partial(cast_rays, land, nodes, lens, STEP, TOLERANCE, shorten=False),
                    ANGLES: partial(compare_angles, land, nodes, lens),
                    EXACT: partial(lines_clear, land, ends, lens),
                    VIEW: partial(in_field_of_view, angles, points[::PART], lens, view.R_nc),
                },
                repeats,
            )
            for way, seconds in found.items():
                count = len(points[::PART]) if way == VIEW else len(some)
                row[way, height] = seconds / count if count >= FEWEST else np.nan
        rows[seed] = row
    names = [(way, height) for height in HEIGHTS for way in (*WAYS, VIEW)]
    values = np.array([[row[name] for name in names] for row in rows.values()])
    return pd.DataFrame(values, pd.Index(rows, name="seed"), pd.MultiIndex.from_tuples(names))


def seconds(times: pd.DataFrame, way: str) -> Array:
    """(lands, heights) of one way, s a grid point."""
    return np.column_stack([times[way, height].to_numpy(float) for height in HEIGHTS])


def furthest_ratio(times: pd.DataFrame, way: str, beside: str) -> Array:
    """(lands,) where both differ most, how many times the quicker's time the slower one takes."""
    apart = np.abs(np.log(seconds(times, way) / seconds(times, beside)))
    return np.asarray(np.exp(np.nanmax(apart, axis=1)))


#: A ratio of times, the larger over the smaller, is never below this.
EQUAL = 1.0


def at_heights(runs: pd.DataFrame, subject: str, name: str) -> Array:
    """(lands, heights) of one number."""
    return np.column_stack([runs[subject, f"{name}_{height}m"] for height in HEIGHTS])


def disagreement(runs: pd.DataFrame, way: str) -> Array:
    """(lands,) share of grid points answered otherwise than exactly by a way, mean over heights."""
    return np.asarray(1 - np.nanmean(at_heights(runs, way, "agreement"), axis=1))


def saved(runs: pd.DataFrame) -> Array:
    """(lands, heights) how many times as many steps rays take that begin at the camera."""
    return at_heights(runs, WHOLE_RAYS, "steps") / at_heights(runs, RAYS, "steps")


def hidden(runs: pd.DataFrame) -> Array:
    """(lands, incidences) share of what is seen without trees that trees hide."""
    return np.column_stack([runs[TREES, f"hidden_{degrees}deg"] for degrees in INCIDENCES])


def check_claims(runs: pd.DataFrame, times: pd.DataFrame) -> dict[str, Check]:
    """What the lands give for each claim, by the claim's id.

    Parameters
    ----------
    runs
        What `trial` gives, one row for each land.
    times
        What `timed` gives, one row for each land that was timed.
    """
    trees, factor = hidden(runs), saved(runs)
    cheap = np.nanmax(seconds(times, VIEW), axis=1)
    dear = np.nanmin(np.hstack([seconds(times, way) for way in (RAYS, ANGLES)]), axis=1)
    letter = np.column_stack([runs[LETTER, f"seen_{name}"] for name, *_ in settings()])
    return {
        "run-times-similar": _times(times, RAYS),
        "run-times-similar-from-the-camera": _times(times, WHOLE_RAYS),
        "occlusion-costs-more": Check(true=dear > cheap, first=1e6 * dear, second=1e6 * cheap, unit="µs"),
        "shortening-pays-high-up": Check.larger(factor[:, -1], factor[:, 0], "times"),
        "view-grows-linearly": Check(measured=np.abs(runs[VIEW, "exponent"].to_numpy(float) - 1)),
        "trees-count-with-incidence": Check(
            true=np.asarray((np.diff(trees, axis=1) > 0).all(axis=1)), first=trees[:, -1], second=trees[:, 0]
        ),
        "algorithms-agree": Check(
            measured=np.maximum(disagreement(runs, RAYS), disagreement(runs, ANGLES)), reach=(0.0, 1.0)
        ),
        "letter-hides-everything": Check(true=np.asarray(np.nanmax(letter, axis=1) == 0)),
    }


def _times(times: pd.DataFrame, way: str) -> Check:
    return Check(measured=furthest_ratio(times, way, ANGLES), reach=(EQUAL, np.inf))


_COLOURS = {RAYS: BLUE, WHOLE_RAYS: GREEN, ANGLES: VERMILLION, EXACT: INK}
#: What all charts over the height of the camera have.
_HEIGHT = "height above the ground (m)"


def agreement_over_height(runs: pd.DataFrame, names: Mapping[str, str]) -> Figure:
    """Agreement of both algorithms with the exact line of sight."""
    lines = {
        names[way]: _mean(100 * at_heights(runs, way, "agreement"), _COLOURS[way], 100.0)
        for way in (RAYS, ANGLES)
    }
    return lines_chart(HEIGHTS, lines, _HEIGHT, "correct points (%)", xscale="log")


def times_over_height(times: pd.DataFrame, names: Mapping[str, str]) -> Figure:
    """Time per grid point: the counterpart of F figure 7.1."""
    lines = {}
    for way in WAYS:
        values = 1e6 * seconds(times, way)
        ends = np.transpose([bounds_of(pd.Series(column)) for column in values.T])
        lines[names[way]] = Values(np.nanmedian(values, axis=0), ends, _COLOURS[way])
    return lines_chart(HEIGHTS, lines, _HEIGHT, "time per grid point (µs)", xscale="log", yscale="log")


def hidden_over_incidence(runs: pd.DataFrame) -> Figure:
    """Share of the ground that trees hide."""
    lines = {"": _mean(100 * hidden(runs), GREEN)}
    label, ground = "incidence, from straight down (°)", "ground hidden by trees (%)"
    return lines_chart(INCIDENCES, lines, label, ground, size=(5.6, 3.2), ylim=(0, None))


def view_map(land: Terrain, view: TerrainView, names: Mapping[str, str]) -> Figure:
    """One view on the map: what is seen, and where each algorithm says something else."""
    exact = lines_clear(land, view.points, view.p_nc)
    ways = {
        RAYS: cast_rays(land, view.nodes, view.p_nc, STEP, TOLERANCE).clear,
        ANGLES: compare_angles(land, view.nodes, view.p_nc).clear,
    }
    fig, axes = new_figure(5.8, 3.9, columns=2, sharey=True)
    for ax, (way, clear) in zip(axes, ways.items(), strict=True):
        draw_heights(ax, land)
        for name, which, colour in (
            ("hidden", ~exact & ~clear, INK), ("wrongly visible", clear & ~exact, ORANGE),
            ("wrongly hidden", exact & ~clear, VERMILLION),
        ):  # fmt: skip
            ax.plot(*view.points[which, 1::-1].T, ".", ms=2.2, color=colour)
            ax.plot([], [], "o", color=colour, label=name)
        ax.plot(*view.p_nc[1::-1], "^", color=BLUE, ms=7, label="camera")
        ax.set_title(f"{names[way]}: {percent(float((clear != exact).mean()))} wrong", fontsize=10)
        fit_map(ax, np.vstack([view.points, view.p_nc]), 10.0)
    map_axes(axes[0])
    map_axes(axes[1], north="")
    return finish(fig, "")


def agreement_table(runs: pd.DataFrame) -> pd.DataFrame:
    """Shares of grid points by height and tilt, with the 95 % interval of their mean over terrains."""
    shares = []
    for name, height, tilt in settings():
        row = {"where": f"{height:.0f} m, {tilt:.0f}°", "seen": _share(runs[EXACT, f"seen_{name}"])}
        for way in (RAYS, ANGLES):
            row[way] = _share(runs[way, f"agreement_{name}"])
            wrong = [percent(float(runs[way, f"{what}_{name}"].mean())) for what in ("too_many", "too_few")]
            row[f"{way}-wrong"] = " / ".join(wrong)
        shares.append(row)
    return pd.DataFrame(shares)


def _share(values: ArrayLike) -> str:
    return percent_between(mean_share_interval(values))


def _mean(values: Array, colour: str, most: float = np.inf) -> Values:
    """Mean over terrains and its 95 % interval."""
    mean = np.nanmean(values, axis=0)
    if len(values) < 2:
        return Values(mean, color=colour)
    ends = np.clip([mean_interval(column)[1:] for column in values.T], 0.0, most).T
    return Values(mean, ends, colour)


def answer(facts: Facts) -> list[str]:
    """Which algorithm is nearer to the exact line of sight, then what trees would hide."""
    seen = f"agreement_{HEIGHT}m"
    slant, above = (f"hidden_{degrees}deg" for degrees in (INCIDENCES[-1], INCIDENCES[0]))
    return [
        f"rays-{facts.compare((RAYS, seen), (ANGLES, seen))}",
        f"trees-{facts.compare((TREES, slant), (TREES, above))}",
    ]


STUDY = Study("line-of-sight", trial.trial, check_claims, lambda _: "1", answer)
