"""Charts of a whole flight: the path and what is wrong on it, streams, height, speed, attitude, shaking."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.colors import BoundaryNorm, ListedColormap
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from numpy.typing import ArrayLike, NDArray

from wildlab.analysis.overviews.image_coverage import Coverage
from wildlab.analysis.overviews.overview import TROUBLES, Issue, Path
from wildlab.evaluation.streams import Pace
from wildlab.evaluation.vibration import FINE, HARMFUL, Vibration
from wildlab.names import figure_name
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

Array = NDArray[np.float64]

#: Of what is wrong on a path.
TROUBLE_COLOURS = dict(zip(TROUBLES, (VERMILLION, INK, ORANGE, PURPLE, "#8C6D00", GREEN, SKY), strict=True))
#: Of sources of a pose and the like, in the order in which they come.
LINES = (BLUE, VERMILLION, GREEN, PURPLE, SKY)
#: Steps of how many images show a place, and their colours, light to dark.
LOOKS = (1, 2, 3, 5, 10, 30)
SHADES = ("#D6E8F2", "#A9CFE4", "#74B0D4", "#3F8DBF", "#14679E", "#083F66")
#: Troubles shorter than this are drawn this long, s: a line of no length is not seen.
SHORTEST_S = 1.0


class Clock:
    """Time of a figure: seconds or minutes since the flight's first stamp."""

    def __init__(self, begin: float, length: float) -> None:
        self.begin, self.unit = begin, 60.0 if length > 300 else 1.0
        self.label = "time since the first stamp (min)" if length > 300 else "time since the first stamp (s)"

    def __call__(self, times: ArrayLike) -> Array:
        return np.asarray((np.asarray(times, float) - self.begin) / self.unit)


def path_chart(path: Path, troubles: Sequence[Issue], title: str) -> Figure:
    """The path in local metres, coloured by what is wrong, worst on top."""
    fig, ax = new_figure(4.7, 5.0)
    north, east = path.place[:, 0], path.place[:, 1]
    keep = thinned(len(east))
    dots = len(east) < 3 or not path.timed
    ax.plot(east[keep], north[keep], "." if dots else "-", color=BLUE, lw=1.1, ms=4)
    handles = [
        Line2D(
            [], [], color=BLUE, lw=1.4, label="nothing found" if troubles else figure_name(path_name(path))
        )
    ]
    for trouble in reversed(troubles):
        color = TROUBLE_COLOURS[trouble.what]
        pieces = []
        for begin, end in trouble.spells:
            middle, half = (begin + end) / 2, max(end - begin, SHORTEST_S) / 2
            at = np.unique(np.clip([middle - half, middle + half], path.times[0], path.times[-1]))
            inside = path.times[(path.times > at[0]) & (path.times < at[-1])]
            at = np.unique(np.concatenate([at, inside[:: max(1, len(inside) // 500)]]))
            pieces.append(
                np.stack([np.interp(at, path.times, east), np.interp(at, path.times, north)], axis=1)
            )
        broken = trouble.what == "no poses"
        ax.add_collection(
            LineCollection(pieces, colors=color, lw=3, linestyles=":" if broken else "-", zorder=3)
        )
        if trouble.what == "position jumps":
            # Too short for a line, and not to be missed.
            at = trouble.spells.mean(axis=1)
            ax.plot(
                np.interp(at, path.times, east), np.interp(at, path.times, north), "x", color=color, ms=11,
                mew=2.5, zorder=6,
            )  # fmt: skip
        label = f"{trouble.what}, {_spell_words(trouble)}"
        handles.insert(
            0, Line2D([], [], color=color, lw=3, ls=":" if broken else "-", label=figure_name(label))
        )
    ax.plot(east[0], north[0], "o", mfc="white", mec=INK, ms=7, mew=1.5, zorder=4)
    ax.plot(east[-1], north[-1], "s", mfc=INK, mec=INK, ms=5, zorder=4)
    handles += [
        Line2D([], [], marker="o", ls="", mfc="white", mec=INK, ms=7, mew=1.5, label="first"),
        Line2D([], [], marker="s", ls="", mfc=INK, mec=INK, ms=5, label="last"),
    ]
    _room(ax, east, north)
    ax.set_title(title)
    map_axes(ax)
    fig.legend(handles=handles, loc="outside lower left", ncols=1 if len(handles) > 3 else 3, fontsize=10)
    return fig


def path_name(path: Path) -> str:
    """Whose path it is."""
    who = {"gnss": "satellite receiver", "truth": "first target"}
    return who.get(path.who, path.who.removeprefix("nav/"))


def _room(ax: Axes, east: Array, north: Array) -> None:
    """Room about a path: at least some metres, so that one that stands still is not noise blown up."""
    reach = max(float(np.ptp(east)), float(np.ptp(north)), 5.0) / 2
    middle = np.array([east.min() + east.max(), north.min() + north.max()]) / 2
    ax.update_datalim([middle - reach, middle + reach])
    ax.autoscale_view()


def _spell_words(trouble: Issue) -> str:
    count = len(trouble.spells)
    times = "once" if count == 1 else f"{count} times"
    return f"{times}, {trouble.seconds:.0f} s" if trouble.seconds >= 1 else times


def coverage_chart(coverage: Coverage, path: Path | None, title: str) -> Figure:
    """How many images show each place, in local metres."""
    fig, ax = new_figure(4.7, 5.0)
    rows, columns = coverage.counts.shape
    half, step = coverage.step / 2, coverage.step
    extent = (
        coverage.east - half,
        coverage.east + (columns - 0.5) * step,
        coverage.north - half,
        coverage.north + (rows - 0.5) * step,
    )
    shown = np.ma.masked_equal(coverage.counts, 0)
    norm = BoundaryNorm([*LOOKS, max(100, int(coverage.counts.max()) + 1)], len(SHADES))
    picture = ax.imshow(
        shown, origin="lower", extent=extent, cmap=ListedColormap(SHADES), norm=norm, interpolation="nearest"
    )
    if path is not None:
        # What was seen is shown, not the whole way there.
        place = path.place[thinned(len(path.place))][:, [1, 0]].copy()
        low, high = np.array([extent[0], extent[2]]), np.array([extent[1], extent[3]])
        place[((place < low) | (place > high)).any(axis=1)] = np.nan
        ax.plot(place[:, 0], place[:, 1], color=INK, lw=0.7, alpha=0.8)
    bar = fig.colorbar(picture, ax=ax, shrink=0.8, ticks=LOOKS)
    bar.ax.set_yticklabels([f"{low}" if low < LOOKS[-1] else f"{low} +" for low in LOOKS])
    bar.set_label("images that show a place")
    ax.set_title(title)
    map_axes(ax)
    return fig


def streams_chart(streams: Mapping[str, Pace], clock: Clock, title: str) -> Figure:
    """When each stream gave samples, and its pauses."""
    named = {name: pace for name, pace in streams.items() if pace.n}
    fig, ax = new_figure(5.9, 0.9 + 0.34 * len(named))
    for row, pace in enumerate(named.values()):
        begin, end = (float(t) for t in clock([pace.begin, pace.end]))
        ax.plot([begin, end], [row, row], color=BLUE, lw=9, solid_capstyle="butt", alpha=0.85)
        for gap in pace.gaps:
            left, right = clock(gap)
            ax.plot([left, right], [row, row], color="white", lw=9, solid_capstyle="butt")
            ax.plot([left, right], [row, row], color=VERMILLION, lw=3, solid_capstyle="butt")
            # Also where the pause is too short to be seen.
            ax.plot((left + right) / 2, row, "|", color=VERMILLION, ms=12, mew=1.6)
    ax.set_yticks(range(len(named)), [figure_name(name) for name in named])
    ax.set_ylim(len(named) - 0.4, -0.6)
    ax.grid(axis="y", visible=False)
    ax.set_xlabel(clock.label)
    ax.set_title(title)
    return fig


def lines_chart(
    series: Mapping[str, tuple[Array, Array]],
    clock: Clock,
    label: str,
    title: str,
    *,
    ground: tuple[Array, Array] | None = None,
    floor: bool = False,
) -> Figure:
    """One quantity over time, a line for each source; ``ground`` is the height of the ground below."""
    fig, ax = new_figure(4.6, 3.3)
    if ground is not None:
        keep = thinned(len(ground[0]))
        at, height = clock(ground[0][keep]), ground[1][keep]
        ax.plot(at, height, color=GREY, ls="-.", lw=1.2, label="ground")
    for (name, (times, values)), look in zip(_truth_first(series), _looks(series), strict=True):
        keep = thinned(len(times))
        ax.plot(clock(times[keep]), values[keep], **look, lw=1.2, label=figure_name(name))
    if floor:
        ax.set_ylim(0, None)
    ax.set_xlabel(clock.label)
    ax.set_ylabel(label)
    ax.set_title(title)
    if len(ax.lines) > 1:
        fig.legend(loc="outside lower left", ncols=2)
    return fig


def attitude_chart(series: Mapping[str, tuple[Array, Array]], clock: Clock, title: str) -> Figure:
    """Roll, pitch and yaw over time, a strip each; jumps at 180 degrees are not joined."""
    fig, axes = new_figure(4.6, 4.8, rows=3, sharex=True)
    for row, axis in enumerate(("roll (°)", "pitch (°)", "yaw (°)")):
        for (name, (times, angles)), look in zip(_truth_first(series), _looks(series), strict=True):
            keep = thinned(len(times))
            t, value = clock(times[keep]), angles[keep, row].copy()
            value[1:][np.abs(np.diff(value)) > 180] = np.nan
            axes[row].plot(t, value, **look, lw=1.1, label=figure_name(name) if row == 0 else None)
        axes[row].set_ylabel(axis)
    axes[0].set_title(title)
    axes[-1].set_xlabel(clock.label)
    if len(series) > 1:
        fig.legend(loc="outside lower left", ncols=2)
    return fig


def _truth_first(series: Mapping[str, tuple[Array, Array]]) -> list[tuple[str, tuple[Array, Array]]]:
    """What is known best lies behind what is judged by it."""
    return sorted(series.items(), key=lambda one: not one[0].startswith("truth"))


def _looks(series: Mapping[str, object]) -> list[dict[str, Any]]:
    """Of sources, the truth first: black it, a second one dashed, and those that have one the colour of all
    figures."""
    taken = {COLOURS.get(name) for name in series}
    others = iter((*(one for one in LINES if one not in taken), *LINES * 3))
    named = sorted(series, key=lambda one: not one.startswith("truth"))
    truths = sum(one.startswith("truth") for one in named)
    return [
        {"color": colour("truth"), "ls": "--" if index else "-"}
        if index < truths
        else {"color": COLOURS.get(name) or next(others)}
        for index, name in enumerate(named)
    ]


def turning_chart(times: Array, rates: Array, clock: Clock, title: str) -> Figure:
    """Angular rates (N, 3) in degrees a second over time."""
    fig, ax = new_figure(4.6, 4.8)
    envelope = _envelope(times, rates)
    for axis, color in zip(range(3), LINES, strict=False):
        low, high = envelope[1][:, axis], envelope[2][:, axis]
        ax.fill_between(clock(envelope[0]), low, high, color=color, alpha=0.6, lw=0.4, label="xyz"[axis])
    ax.set_xlabel(clock.label)
    ax.set_ylabel("turning about each axis (°/s)")
    ax.set_title(title)
    fig.legend(loc="outside lower left", ncols=3)
    return fig


def _envelope(times: Array, values: Array, columns: int = 700) -> tuple[Array, Array, Array]:
    """Least and greatest (C, K) of bins of equal numbers of samples: nothing short is thinned away."""
    edges = np.unique(np.linspace(0, len(times), min(columns, len(times)) + 1).astype(int))[:-1]
    return times[edges], np.minimum.reduceat(values, edges), np.maximum.reduceat(values, edges)


def satellites_chart(
    satellites: tuple[Array, Array] | None, sd: Mapping[str, tuple[Array, Array]], clock: Clock, title: str
) -> Figure:
    """How many satellites, and how uncertain the positions are said to be, over time."""
    strips = [*(["satellites"] if satellites else []), *(["sd"] if sd else [])]
    fig, axes = new_figure(5.9, 1.6 + 1.5 * len(strips), rows=len(strips), sharex=True, squeeze=False)
    for ax, strip in zip(axes[:, 0], strips, strict=True):
        if strip == "satellites" and satellites is not None:
            keep = thinned(len(satellites[0]))
            ax.step(clock(satellites[0][keep]), satellites[1][keep], color=BLUE, lw=1.2, where="post")
            ax.set_ylabel("satellites")
            ax.set_ylim(0, None)
        else:
            for (name, (times, values)), color in zip(sd.items(), LINES, strict=False):
                keep = thinned(len(times))
                ax.plot(clock(times[keep]), values[keep], color=color, lw=1.2, label=figure_name(name))
            ax.set_ylabel("stated SD (m)")
            ax.set_ylim(0, None)
            ax.legend(loc="upper right")
    axes[0, 0].set_title(title)
    axes[-1, 0].set_xlabel(clock.label)
    return fig


def bands_chart(found: Vibration, title: str) -> Figure:
    """Shaking by band of frequency, a bar for each axis."""
    fig, ax = new_figure(4.6, 3.5)
    place = np.arange(len(found.bands))
    for axis, color in zip(range(3), LINES, strict=False):
        ax.bar(place + 0.26 * (axis - 1), found.rms[:, axis], 0.24, color=color, label="xyz"[axis])
    ax.set_xticks(place, [f"{low:g}–\n{high:g}" for low, high in np.round(found.bands)])
    ax.set_xlabel("band (Hz)")
    ax.set_ylabel("root mean square (m/s²)")
    ax.set_title(title)
    # Beside the axes, where it hides nothing.
    fig.legend(*ax.get_legend_handles_labels(), loc="outside lower right", ncols=3)
    return fig


def shaking_chart(found: Vibration, times: Array, clock: Clock, title: str) -> Figure:
    """Shaking of each axis over time by the measure of the limits, with these where they are in reach."""
    fig, ax = new_figure(4.6, 3.5)
    at, _, high = _envelope(times, found.level)
    for axis, color in zip(range(3), LINES, strict=False):
        ax.plot(clock(at), high[:, axis], color=color, lw=1.1, label="xyz"[axis])
    top = 1.1 * float(found.level.max())
    for limit, words in ((FINE, "may harm"), (HARMFUL, "nearly always harms")):
        if limit < 1.5 * top:
            ax.axhline(limit, color=GREY, lw=1, ls=(0, (4, 3)))
            ax.annotate(f"{words}, above {limit:g}", (0.01, limit), (0, 3), fontsize=10, color=INK,
                        xycoords=("axes fraction", "data"), textcoords="offset points")  # fmt: skip
            top = max(top, 1.15 * limit)
    ax.set_ylim(0, top)
    ax.set_xlabel(clock.label)
    ax.set_ylabel("shaking above 5 Hz (m/s²)")
    ax.set_title(title)
    # Beside the axes, where it hides nothing.
    fig.legend(*ax.get_legend_handles_labels(), loc="outside lower right", ncols=3)
    return fig
