"""Charts of a whole flight: the path and what is wrong on it, streams, poses, shaking; and of navigation:
errors within their bounds, biases, and how far to believe a filter."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.colors import BoundaryNorm, ListedColormap
from matplotlib.figure import Figure
from numpy.typing import ArrayLike

from wildlab.analysis.overview import TROUBLES, Coverage, Issue, Path
from wildlab.evaluation.streams import FINE, HARMFUL, Pace
from wildlab.flight.schema import QUATERNION
from wildlab.geometry.frames import matrix_to_euler, quaternion_to_matrix
from wildlab.names import figure_name
from wildlab.reporting.charts.drawing import (
    DASHED,
    LINES,
    Array,
    draw_band,
    draw_cells,
    draw_line,
    draw_way,
    finish,
    mark_level,
    name_rows,
    new_strips,
    without_jumps,
)
from wildlab.reporting.figures import (
    BLUE,
    COLOURS,
    GREEN,
    GREY,
    INK,
    ORANGE,
    PURPLE,
    SKY,
    VERMILLION,
    colour,
    map_axes,
    new_figure,
    thinned,
)

#: What legends call sources whose names are not words.
NAMES = {
    "mekf": "filter (MEKF)",
    "mekf-published-like": "filter, tuned like H 7.5.3",
    "mekf-published-like-turning": "filter, tuned like H 7.5.4, flight 1",
    "mekf-published-like-long": "filter, tuned like H 7.5.4, flight 2",
    "onboard": "found on board",
}
#: Labels of strips whose jumps at 180 degrees are not joined.
ANGLES = ("roll (°)", "pitch (°)", "yaw (°)")
#: Quantities over time by label with unit, each by source: times (s), and values.
Strips = Mapping[str, Mapping[str, tuple[ArrayLike, ArrayLike]]]


def poses_between(nav: Mapping[str, pd.DataFrame], start: float, end: float) -> tuple[Strips, Strips]:
    """Attitude (degrees) and velocity of nav tables between two times (seconds), for `strips`."""
    attitude: dict[str, dict[str, tuple[ArrayLike, ArrayLike]]] = {}
    velocity: dict[str, dict[str, tuple[ArrayLike, ArrayLike]]] = {}
    for name, table in nav.items():
        part = table[table["time_s"].between(start, end)]
        q = part[QUATERNION].to_numpy(float)
        euler = np.degrees(matrix_to_euler(quaternion_to_matrix(q))).T
        for label, angle in zip(ANGLES, euler, strict=True):
            attitude.setdefault(label, {})[name] = part["time_s"], angle
        for axis in ("north", "east", "down"):
            velocity.setdefault(f"{axis} (m/s)", {})[name] = part["time_s"], part[f"v_{axis}_m_s"]
    return attitude, velocity


def strips(quantities: Strips, clock: Clock | None = None) -> Figure:
    """Quantities over time, one strip each, one line for each source; jumps of angles are not joined.

    Parameters
    ----------
    quantities
        Of sources, which have the same colour in all strips.
    clock
        Of the abscissa; left out, seconds.
    """
    fig, axes = new_strips(len(quantities), 1.2 * len(quantities) + 1.4)
    sources = list(dict.fromkeys(name for one in quantities.values() for name in one))
    # Of lines that lie on one another the first is the widest, so that each later one shows it.
    widths = np.linspace(min(1.0 + 0.9 * (len(sources) - 1), 2.8), 1.0, len(sources))
    looks = _looks(sources)
    for ax, (label, one) in zip(axes, quantities.items(), strict=True):
        for width, (name, look) in zip(widths, looks.items(), strict=True):
            if name in one:
                times, values = one[name]
                values = without_jumps(values) if label in ANGLES else values
                draw_line(
                    ax, clock(times) if clock else times, values, name=_named(name), width=width, **look
                )
        ax.set_ylabel(label)
    return finish(fig, clock.label if clock else "time (s)")


def mark_period(fig: Figure, period: tuple[float, float] | None) -> None:
    """Draw a black line over time at either end of a period, s, in every strip; nothing without one."""
    for ax in fig.axes if period is not None else ():
        limits = ax.get_xlim()
        for at in period or ():
            ax.axvline(at, color="black", lw=1.2)
        ax.set_xlim(limits)


def error_bands(
    times: ArrayLike,
    errors: Mapping[str, ArrayLike],
    bounds: Mapping[str, ArrayLike],
    labels: Sequence[str],
    largest: float | None = None,
) -> Figure:
    """Errors over time, one strip for each axis and one line for each source, within two standard deviations.

    Parameters
    ----------
    times
        (K,) s.
    errors
        (K, 3) by source, in the unit that the labels say.
    bounds
        (K, 3) standard deviations by source, for those that state them.
    labels
        Of the three strips, with units.
    largest
        What the strips reach at most, where single errors (the start) would squeeze the rest.
    """
    fig, axes = new_strips(3, 4.9)
    for i, (ax, label) in enumerate(zip(axes, labels, strict=True)):
        shown = {name: np.asarray(error, float)[:, i] for name, error in errors.items()}
        twice = {name: 2 * np.asarray(sd, float)[:, i] for name, sd in bounds.items()}
        # What scatters most is drawn first, and the bands over all: nothing hides what is narrower.
        for name in sorted(shown, key=lambda name: -_spread(shown[name])):
            draw_line(ax, times, shown[name], colour(name), _named(name), width=0.9)
        for name, two in twice.items():
            draw_band(ax, times, -two, two, colour(name), f"two SD of the {_named(name)}")
            for edge in (-two, two):
                draw_line(ax, times, edge, INK, width=0.8, ls=DASHED["ls"], zorder=3.1)
        reach = max(float(np.nanmax(np.abs(one), initial=0.0)) for one in (*shown.values(), *twice.values()))
        ax.axhline(0, color=GREY, lw=0.6)
        if reach > 0:
            ax.set_ylim(*(np.array([-1.05, 1.05]) * min(reach, largest or reach)))
        ax.set_ylabel(label)
    return finish(fig, "time (s)")


def bias_chart(times: ArrayLike, biases: ArrayLike, sd: ArrayLike) -> Figure:
    """Biases (K, 6) that a filter estimates, accelerometers (mm/s^2) and gyros (deg/h), within two
    standard deviations."""
    fig, axes = new_strips(2, 4.4)
    scale = np.repeat([1e3, np.degrees(3600.0)], 3)
    b, two = scale * np.asarray(biases, float), 2 * scale * np.asarray(sd, float)
    for strip, (ax, label) in enumerate(zip(axes, ("accelerometers (mm/s²)", "gyros (°/h)"), strict=True)):
        for i, (name, color) in enumerate(zip(("forward", "right", "down"), LINES, strict=False), 3 * strip):
            draw_line(ax, times, b[:, i], color, name)
            draw_band(ax, times, b[:, i] - two[:, i], b[:, i] + two[:, i], color, alpha=0.15)
        part = slice(3 * strip, 3 * strip + 3)
        late = (np.abs(b) + two)[len(b) // 10 :, part]
        ax.set_ylim(*(np.array([-1.1, 1.1]) * float(np.nanmax(late, initial=0.0))))
        ax.set_ylabel(label)
    return finish(fig, "time (s)")


def _named(source: str) -> str:
    return NAMES.get(source, source)


def _spread(values: Array) -> float:
    return float(np.nanstd(values)) if np.isfinite(values).any() else 0.0


#: Of what is wrong on a path.
TROUBLE_COLOURS = dict(zip(TROUBLES, (VERMILLION, INK, ORANGE, PURPLE, "#8C6D00", GREEN, SKY), strict=True))
#: Steps of how many images show a place, and their colours, light to dark.
LOOKS = (1, 2, 3, 5, 10, 30)
SHADES = ("#D6E8F2", "#A9CFE4", "#74B0D4", "#3F8DBF", "#14679E", "#083F66")
#: Troubles shorter than this are drawn this long, s: a line of no length is not seen.
SHORTEST_S = 1.0
#: Of a chart of many samples.
COLUMNS = 700


class Clock:
    """Time of a figure: seconds or minutes since the flight's first stamp."""

    def __init__(self, begin: float, length: float) -> None:
        self.begin, self.unit = begin, 60.0 if length > 300 else 1.0
        self.label = f"time since the first stamp ({'min' if length > 300 else 's'})"

    def __call__(self, times: ArrayLike) -> Array:
        return np.asarray((np.asarray(times, float) - self.begin) / self.unit)


def path_chart(path: Path, troubles: Sequence[Issue]) -> Figure:
    """The path in local metres, coloured by what is wrong, worst on top."""
    fig, ax = new_figure(4.7, 5.0)
    dots = len(path.place) < 3 or not path.timed
    for trouble in troubles:
        pieces = [_piece(path, begin, end) for begin, end in trouble.spells]
        color, broken = TROUBLE_COLOURS[trouble.what], trouble.what == "no poses"
        count = len(trouble.spells)
        name = f"{trouble.what}, {'once' if count == 1 else f'{count} times'}"
        name += f", {trouble.seconds:.0f} s" if trouble.seconds >= 1 else ""
        # NaN between the pieces; what comes first is worst, and on top.
        way = np.concatenate([np.vstack([piece, [np.nan, np.nan]]) for piece in pieces])
        order = 4 - 0.1 * list(TROUBLES).index(trouble.what)
        ax.plot(way[:, 1], way[:, 0], ":" if broken else "-", color=color, lw=3, zorder=order,
                label=figure_name(name))  # fmt: skip
        if trouble.what == "position jumps":
            # Too short for a line, and not to be missed.
            middle = np.array([_place(path, np.array([spell.mean()]))[0] for spell in trouble.spells])
            ax.plot(middle[:, 1], middle[:, 0], "x", color=color, ms=11, mew=2.5, zorder=6)
    draw_way(ax, path.place, BLUE, "nothing found" if troubles else path_name(path), width=1.1,
             ls="none" if dots else "-", marker="." if dots else "", ms=4)  # fmt: skip
    for end, name, look in ((0, "first", {"marker": "o", "mfc": "white", "ms": 7, "mew": 1.5}),
                            (-1, "last", {"marker": "s", "mfc": INK, "ms": 5})):  # fmt: skip
        ax.plot(*path.place[end, [1, 0]], ls="none", mec=INK, zorder=5, label=figure_name(name), **look)
    # At least some metres about a path, so that one that stands still is not noise blown up.
    low, high = path.place[:, :2].min(axis=0), path.place[:, :2].max(axis=0)
    middle, reach = (low + high)[::-1] / 2, max(float((high - low).max()), 5.0) / 2
    ax.update_datalim([middle - reach, middle + reach])
    ax.autoscale_view()
    map_axes(ax)
    return finish(fig)


def path_name(path: Path) -> str:
    """Whose path it is."""
    who = {"gnss": "satellite receiver", "truth": "first target"}
    return who.get(path.who, path.who.removeprefix("nav/"))


def _place(path: Path, times: Array) -> Array:
    """Places (N, 2) on a path."""
    return np.stack([np.interp(times, path.times, path.place[:, axis]) for axis in (0, 1)], axis=1)


def _piece(path: Path, begin: float, end: float) -> Array:
    """A part of a path (N, 2), of `SHORTEST_S` at least."""
    middle, half = (begin + end) / 2, max(end - begin, SHORTEST_S) / 2
    ends = np.clip([middle - half, middle + half], path.times[0], path.times[-1])
    inside = path.times[(path.times > ends[0]) & (path.times < ends[-1])]
    return _place(path, np.unique([*ends, *inside[:: max(1, len(inside) // 500)]]))


def coverage_chart(coverage: Coverage, path: Path | None) -> Figure:
    """How many images show each place, in local metres."""
    fig, ax = new_figure(4.7, 5.0)
    norm = BoundaryNorm([*LOOKS, max(100, int(coverage.counts.max()) + 1)], len(SHADES))
    counts, corner = np.ma.masked_equal(coverage.counts, 0), (coverage.east, coverage.north)
    picture = draw_cells(ax, counts, *corner, coverage.step, cmap=ListedColormap(SHADES), norm=norm)
    if path is not None:
        # What was seen is shown, not the whole way there.
        place = path.place[thinned(len(path.place))][:, :2].copy()
        left, right, low, high = picture.get_extent()
        outside = (place < [low, left]) | (place > [high, right])
        place[outside.any(axis=1)] = np.nan
        draw_way(ax, place, INK, width=0.7, alpha=0.8)
    bar = fig.colorbar(picture, ax=ax, shrink=0.8, ticks=LOOKS)
    bar.ax.set_yticklabels([f"{low}" if low < LOOKS[-1] else f"{low} +" for low in LOOKS])
    bar.set_label("images that show a place")
    map_axes(ax)
    return finish(fig)


def streams_chart(streams: Mapping[str, Pace], clock: Clock) -> Figure:
    """When each stream gave samples, and its pauses."""
    named = {name: pace for name, pace in streams.items() if pace.n}
    fig, ax = new_figure(5.9, 0.9 + 0.34 * len(named))
    for row, pace in enumerate(named.values()):
        ax.hlines(row, *clock([pace.begin, pace.end]), color=BLUE, lw=9, alpha=0.85)
        for gap in pace.gaps:
            ax.hlines(row, *clock(gap), color="white", lw=9)
            ax.hlines(row, *clock(gap), color=VERMILLION, lw=3)
            # Also where the pause is too short to be seen.
            ax.plot(clock(gap).mean(), row, "|", color=VERMILLION, ms=12, mew=1.6)
    name_rows(ax, list(named))
    return finish(fig, clock.label)


def _looks(sources: Sequence[str]) -> dict[str, dict[str, Any]]:
    """Looks of sources, the truth first, since it lies behind what is judged by it: it is black, a second one
    dashed; others have their colour of all figures, if any."""
    taken = {COLOURS.get(name) for name in sources}
    others = iter((*(one for one in LINES if one not in taken), *LINES * 3))
    named = sorted(sources, key=lambda one: not one.startswith("truth"))
    truths = sum(one.startswith("truth") for one in named)
    return {
        name: {"color": colour("truth"), "ls": "--" if index else "-"}
        if index < truths
        else {"color": COLOURS.get(name) or next(others)}
        for index, name in enumerate(named)
    }


def _envelope(times: Array, values: Array) -> tuple[Array, Array, Array]:
    """Least and greatest (C, K) of bins of equal numbers of samples: nothing short is thinned away."""
    edges = np.unique(np.linspace(0, len(times), min(COLUMNS, len(times)) + 1).astype(int))[:-1]
    return times[edges], np.minimum.reduceat(values, edges), np.maximum.reduceat(values, edges)


def shaking_chart(level: Array, times: Array, clock: Clock) -> Figure:
    """Shaking of each axis over time by the measure of the limits, with these where they are in reach."""
    fig, ax = new_figure(4.6, 3.5)
    at, _, high = _envelope(times, level)
    for axis, color in zip(range(3), LINES, strict=False):
        draw_line(ax, clock(at), high[:, axis], color, "xyz"[axis])
    top = 1.1 * float(level.max())
    for limit, words in ((FINE, "may harm"), (HARMFUL, "nearly always harms")):
        if limit < 1.5 * top:
            mark_level(ax, limit, f"{words}, above {limit:g}")
            top = max(top, 1.15 * limit)
    ax.set_ylim(0, top)
    return finish(fig, clock.label, "shaking above 5 Hz (m/s²)")
