"""Charts of navigation: poses, errors within their bounds, biases, and how far to believe a filter."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
import pandas as pd
from matplotlib.figure import Figure
from numpy.typing import ArrayLike

from wildlab.evaluation.consistency import chi_square_interval
from wildlab.geometry.frames import matrix_to_euler, quaternion_to_matrix
from wildlab.reporting.charts.drawing import (
    DASHED,
    LINES,
    Array,
    draw_band,
    draw_line,
    finish,
    new_strips,
    without_jumps,
)
from wildlab.reporting.figures import BLUE, GREY, INK, colour, log_band

#: What legends call sources whose names are not words.
NAMES = {
    "mekf": "filter (MEKF)",
    "mekf-published-like": "filter, tuned like H 7.5.3",
    "mekf-published-like-turning": "filter, tuned like H 7.5.4, flight 1",
    "mekf-published-like-long": "filter, tuned like H 7.5.4, flight 2",
    "onboard": "found on board",
}
#: Quantities over time by label with unit: times (seconds), and values.
Strips = tuple[ArrayLike, Mapping[str, ArrayLike]]


def poses_between(
    nav: Mapping[str, pd.DataFrame], start: float, end: float
) -> tuple[dict[str, Strips], dict[str, Strips]]:
    """Attitude (degrees) and velocity of nav tables between two times (seconds), for `strips`."""
    attitude: dict[str, Strips] = {}
    velocity: dict[str, Strips] = {}
    for name, table in nav.items():
        part = table[table["time_s"].between(start, end)]
        q = part[["q_w", "q_x", "q_y", "q_z"]].to_numpy(float)
        euler = np.degrees(matrix_to_euler(quaternion_to_matrix(q))).T
        attitude[name] = (part["time_s"], dict(zip(("roll (°)", "pitch (°)", "yaw (°)"), euler, strict=True)))
        axes = ("north", "east", "down")
        velocity[name] = (part["time_s"], {f"{axis} (m/s)": part[f"v_{axis}_m_s"] for axis in axes})
    return attitude, velocity


def strips(sources: Mapping[str, Strips]) -> Figure:
    """Quantities over time, one strip each, one line for each source; jumps of angles are not joined.

    Parameters
    ----------
    sources
        By name of the source, which has its fixed colour; all have the same labels.
    """
    labels = list(next(iter(sources.values()))[1])
    fig, axes = new_strips(len(labels), 1.2 * len(labels) + 1.4)
    # Of lines that lie on one another the first is the widest, so that each later one shows it.
    widths = np.linspace(1.0 + 0.9 * (len(sources) - 1), 1.0, len(sources))
    for ax, label in zip(axes, labels, strict=True):
        for width, (name, (times, quantities)) in zip(widths, sources.items(), strict=True):
            draw_line(ax, times, without_jumps(quantities[label]), colour(name), _named(name), width=width)
        ax.set_ylabel(label)
    return finish(fig, "time (s)")


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


def squares_chart(series: Mapping[str, tuple[ArrayLike, ArrayLike]], dof: int, what: str) -> Figure:
    """NIS or NEES over time on log axes, a strip for each series, with the 95 % band of single values.

    ``series`` has times and values by name.
    """
    fig, axes = new_strips(len(series), 1.6 * len(series) + 0.4)
    low, high = chi_square_interval(dof)
    for ax, (name, (times, values)) in zip(axes, series.items(), strict=True):
        v = np.asarray(values, float)
        draw_line(ax, times, v, BLUE, ls="none", marker=".", ms=2, alpha=0.5, mec="none", rasterized=True)
        log_band(ax, low, high)
        lowest, highest = np.nanquantile(v, [0.005, 0.999])
        ax.set_ylim(min(low / 3, float(lowest)), max(high * 3, float(highest)))
        ax.set_ylabel(f"{what}\n{name}")
    return finish(fig, "time (s)")


def _named(source: str) -> str:
    return NAMES.get(source, source)


def _spread(values: Array) -> float:
    return float(np.nanstd(values)) if np.isfinite(values).any() else 0.0
