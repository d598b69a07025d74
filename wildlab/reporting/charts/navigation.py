"""Charts of navigation: poses, errors within their bounds, biases, and how far to believe a filter."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter
from numpy.typing import ArrayLike, NDArray

from wildlab.evaluation.consistency import chi_square_interval
from wildlab.geometry.frames import matrix_to_euler, quaternion_to_matrix
from wildlab.names import figure_name
from wildlab.reporting.figures import (
    BLUE,
    GREEN,
    GREY,
    INK,
    PURPLE,
    VERMILLION,
    colour,
    log_band,
    new_figure,
    thinned,
)

Array = NDArray[np.float64]

LINES = (BLUE, VERMILLION, PURPLE)
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


def strips(sources: Mapping[str, Strips], title: str) -> Figure:
    """Quantities over time, one strip each, one line for each source; jumps of angles are not joined.

    Parameters
    ----------
    sources
        By name of the source, which has its fixed colour; all have the same labels.
    """
    labels = list(next(iter(sources.values()))[1])
    fig, axes = new_figure(5.9, 1.5 * len(labels) + 0.1, rows=len(labels), sharex=True)
    for ax, label in zip(axes, labels, strict=True):
        for width, (name, (times, quantities)) in zip(_widths(len(sources)), sources.items(), strict=True):
            keep = thinned(len(np.asarray(times)))
            y = np.array(quantities[label], float)[keep]
            y[1:][np.abs(np.diff(y)) > 180] = np.nan
            t = np.asarray(times, float)[keep]
            ax.plot(t, y, lw=width, color=colour(name), label=figure_name(NAMES.get(name, name)))
        ax.set_ylabel(label)
    if len(sources) > 1:
        fig.legend(*axes[0].get_legend_handles_labels(), loc="outside lower right", ncols=len(sources))
    axes[0].set_title(title)
    axes[-1].set_xlabel("time (s)")
    return fig


def _widths(count: int) -> Array:
    """Widths of lines that lie on one another: the first is the widest, so that each later one shows it."""
    return np.linspace(1.0 + 0.9 * (count - 1), 1.0, count)


def span_words(sources: Mapping[str, Strips]) -> str:
    """From where to where each quantity goes, by source: for alternative texts."""
    said = []
    for name, (_, quantities) in sources.items():
        parts = []
        for label, values in quantities.items():
            what, _, unit = label.rstrip(")").partition(" (")
            known = np.asarray(values, float)
            if np.isfinite(known).any():
                low, high = np.nanmin(known), np.nanmax(known)
                parts.append(f"{what} {low:.0f} to {high:.0f} {unit}".replace(" °", "°"))
        said.append(f"{NAMES.get(name, name)}: {', '.join(parts)}")
    return "; ".join(said)


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
    title: str,
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
    fig, axes = new_figure(5.9, 4.9, rows=3, sharex=True)
    t = np.asarray(times, float)
    keep = thinned(len(t))
    for i, (ax, label) in enumerate(zip(axes, labels, strict=True)):
        reach = 0.0
        shown = {name: np.asarray(error, float)[keep, i] for name, error in errors.items()}
        # What scatters most is drawn first, and the bands over all: nothing hides what is narrower.
        order = sorted(
            shown, key=lambda name: -np.nanstd(shown[name]) if np.isfinite(shown[name]).any() else 0
        )
        for level, name in enumerate(order):
            e = shown[name]
            ax.plot(
                t[keep],
                e,
                lw=0.9,
                color=colour(name),
                label=figure_name(NAMES.get(name, name)),
                zorder=2 + 0.1 * level,
            )
            reach = max(reach, float(np.nanmax(np.abs(e), initial=0.0)))
        for name, stated in bounds.items():
            two = 2 * np.asarray(stated, float)[keep, i]
            two_of = f"two SD of the {NAMES.get(name, name)}"
            ax.fill_between(
                t[keep], -two, two, color=colour(name), alpha=0.2, lw=0, label=figure_name(two_of), zorder=3
            )
            for edge in (-two, two):
                ax.plot(t[keep], edge, color=INK, lw=0.8, ls=(0, (4, 2)), zorder=3.1)
            reach = max(reach, float(np.nanmax(two, initial=0.0)))
        ax.axhline(0, color=GREY, lw=0.6)
        if reach > 0:
            ax.set_ylim(*(np.array([-1.05, 1.05]) * min(reach, largest or reach)))
        ax.set_ylabel(label)
    return _finished(fig, axes, title)


def deviation_chart(
    times: ArrayLike, sd: ArrayLike, printed: Sequence[float] | None, units: Sequence[str], title: str
) -> Figure:
    """Standard deviations that a filter states over time: position above, attitude below, with log axes.

    Parameters
    ----------
    sd
        (K, 6): north, east, down, roll, pitch, yaw, in the units given (one for each strip).
    printed
        Six published means, drawn as broken lines; None where there are none.
    """
    fig, axes = new_figure(5.9, 4.4, rows=2, sharex=True)
    t, values = np.asarray(times, float), np.asarray(sd, float)
    keep = thinned(len(t))
    for ax, first, names, unit in zip(
        axes, (0, 3), (("north", "east", "down"), ("roll", "pitch", "yaw")), units, strict=True
    ):
        for i, (name, color) in enumerate(zip(names, LINES, strict=True)):
            ax.plot(t[keep], values[keep, first + i], color=color, lw=1.2, label=figure_name(name))
            if printed is not None:
                ax.axhline(printed[first + i], color=color, lw=1.0, ls=(0, (4, 3)), alpha=0.8)
        ax.set_yscale("log")
        low, high = ax.get_ylim()
        # Over more than a decade and a half, labels in between would lie on one another.
        ax.yaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0) if high < 30 * low else (1.0,)))
        ax.yaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
        ax.yaxis.set_minor_formatter(NullFormatter())
        ax.set_ylabel(f"SD ({unit})")
        ax.legend(loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=3, fontsize=10)
    axes[0].set_title(title, pad=26)
    axes[-1].set_xlabel("time (s)")
    return fig


def bias_chart(times: ArrayLike, biases: ArrayLike, sd: ArrayLike, title: str) -> Figure:
    """Biases (K, 6) that a filter estimates, accelerometers (mm/s^2) and gyros (deg/h), within two
    standard deviations."""
    fig, axes = new_figure(5.9, 4.4, rows=2, sharex=True)
    t = np.asarray(times, float)
    keep = thinned(len(t))
    scales = (1e3, np.degrees(3600.0))
    for ax, first, scale, label in zip(
        axes, (0, 3), scales, ("accelerometers (mm/s²)", "gyros (°/h)"), strict=True
    ):
        reach = 0.0
        for i, (name, color) in enumerate(zip(("forward", "right", "down"), LINES, strict=True)):
            b, s = (scale * np.asarray(a, float)[keep, first + i] for a in (biases, sd))
            ax.plot(t[keep], b, color=color, lw=1.1, label=figure_name(name))
            ax.fill_between(t[keep], b - 2 * s, b + 2 * s, color=color, alpha=0.15, lw=0, zorder=3)
            late = slice(len(b) // 10, None)
            reach = max(reach, float(np.nanmax(np.abs(b[late]) + 2 * s[late], initial=0.0)))
        ax.set_ylim(-1.1 * reach, 1.1 * reach)
        ax.set_ylabel(label)
    return _finished(fig, axes, title)


def squares_chart(
    series: Mapping[str, tuple[ArrayLike, ArrayLike]], dof: int, what: str, title: str
) -> Figure:
    """NIS or NEES over time on log axes, a strip for each series, with the 95 % band of single values.

    ``series`` has times and values by name.
    """
    fig, axes = new_figure(5.9, 1.6 * len(series) + 0.4, rows=len(series), sharex=True, squeeze=False)
    low, high = chi_square_interval(dof)
    for ax, (name, (times, values)) in zip(axes[:, 0], series.items(), strict=True):
        t, v = np.asarray(times, float), np.asarray(values, float)
        keep = thinned(len(t))
        ax.plot(t[keep], v[keep], ".", ms=2, color=BLUE, alpha=0.5, mec="none", rasterized=True)
        log_band(ax, low, high)
        ax.set_ylim(
            min(low / 3, float(np.nanquantile(v, 0.005))), max(high * 3, float(np.nanquantile(v, 0.999)))
        )
        ax.set_ylabel(f"{what}\n{_short(name)}")
    axes[0, 0].set_title(title)
    axes[-1, 0].set_xlabel("time (s)")
    return fig


def speed_chart(sources: Mapping[str, tuple[ArrayLike, ArrayLike]], title: str) -> Figure:
    """Speed over ground by source: times (s) and velocities (N, 3)."""
    fig, ax = new_figure(5.9, 3.0)
    for name, (times, velocity) in sources.items():
        speed = np.linalg.norm(np.asarray(velocity, float), axis=1)
        keep = thinned(len(speed))
        ax.plot(
            np.asarray(times, float)[keep],
            speed[keep],
            lw=1.0,
            color=colour(name),
            label=figure_name(NAMES.get(name, name)),
        )
    ax.set_ylim(0, None)
    ax.set_ylabel("speed over ground (m/s)")
    return _finished(fig, [ax], title)


def correlation_strips(series: Mapping[str, ArrayLike], bounds: Mapping[str, float], title: str) -> Figure:
    """Autocorrelations (elements, lags + 1) of innovations, a strip for each source, with the white band."""
    fig, axes = new_figure(5.9, 1.5 * len(series) + 0.4, rows=len(series), sharex=True, squeeze=False)
    for ax, (name, rows) in zip(axes[:, 0], series.items(), strict=True):
        ax.axhspan(-bounds[name], bounds[name], color=GREEN, alpha=0.2, lw=0)
        for row, color, axis in zip(np.asarray(rows, float), LINES, ("north", "east", "down"), strict=False):
            ax.plot(np.arange(1, len(row)), row[1:], color=color, lw=1.1, label=figure_name(axis))
        top = max(0.2, 1.1 * float(np.nanmax(np.abs(np.asarray(rows, float)[:, 1:]))))
        ax.set_ylim(-top, top)
        ax.set_ylabel(_short(name))
    axes[-1, 0].set_xlabel("lag (measurements)")
    return _finished(fig, axes[:, 0], title, xlabel=None)


def velocities_of(nav: pd.DataFrame) -> tuple[Array, Array]:
    """Times and velocities (N, 3) of a nav table, for `speed_chart`."""
    return nav["time_s"].to_numpy(float), nav[["v_north_m_s", "v_east_m_s", "v_down_m_s"]].to_numpy(float)


def _short(source: str) -> str:
    return source.replace("second position", "2nd antenna")


def _finished(fig: Figure, axes: Sequence[Axes], title: str, xlabel: str | None = "time (s)") -> Figure:
    handles = axes[0].get_legend_handles_labels()
    if len(handles[0]) > 1:
        fig.legend(*handles, loc="outside lower right", ncols=len(handles[0]))
    axes[0].set_title(title)
    if xlabel:
        axes[-1].set_xlabel(xlabel)
    return fig
