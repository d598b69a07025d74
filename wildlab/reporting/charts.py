"""Charts that more than one notebook draws: errors about the truth, their distribution, their order."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import pandas as pd
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator
from numpy.typing import ArrayLike, NDArray

from wildlab.geometry.frames import matrix_to_euler, quaternion_to_matrix
from wildlab.reporting.figures import (
    BLUE,
    GREY,
    INK,
    ORANGE,
    VERMILLION,
    colour,
    ellipse,
    end_label,
    map_axes,
    new_figure,
)

Array = NDArray[np.float64]


def error_scatter(errors: ArrayLike, title: str, color: str = BLUE, reach: float | None = None) -> Figure:
    """Errors (N, 2) north-east about the truth, with the ellipse that holds 90 % of a normal distribution.

    ``reach`` is the half width of the map in metres, for figures that are to be compared.
    """
    e = _finite(errors)
    fig, ax = new_figure(4.6, 4.4)
    reach = reach or float(max(1.0, 1.15 * np.abs(e).max())) if len(e) else 1.0
    ax.plot(e[:, 1], e[:, 0], ".", color=color, alpha=0.55, ms=6, mec="none")
    if len(e) > 2:
        ellipse(ax, e.mean(axis=0)[::-1], np.cov(e[:, ::-1].T), color=color)
    ax.plot(0, 0, "+", color="black", ms=13, mew=2)
    ax.plot(*e.mean(axis=0)[::-1], "o", mfc="white", mec=color, ms=7, mew=1.6)
    ax.set_xlim(-reach, reach)
    ax.set_ylim(-reach, reach)
    ax.annotate("truth", (0, 0), (8, -14), textcoords="offset points", fontsize=9, color=INK)
    ax.set_title(title)
    map_axes(ax, east="error, east (m)", north="error, north (m)")
    return fig


def error_shares(series: Mapping[str, tuple[ArrayLike, str]], title: str) -> Figure:
    """Share of points within a distance, one line for each series of errors (N, 2), with its colour."""
    fig, ax = new_figure(4.6, 4.4)
    right = 0.0
    ax.axhline(90, color=GREY, lw=0.8, ls=(0, (3, 3)))
    ends = []
    for label, (errors, color) in series.items():
        distance = np.sort(np.hypot(*_finite(errors).T))
        share = 100 * np.arange(1, len(distance) + 1) / len(distance)
        ax.step(distance, share, where="post", color=color)
        right = max(right, float(distance[-1]))
        ends.append((float(np.quantile(distance, 0.5)), label, color))
    # Names stand beside their own line at different heights, so that lines close together keep theirs apart.
    for place, (_, label, color) in enumerate(sorted(ends)):
        level = 62 - 24 * place
        errors = series[label][0]
        x = float(np.quantile(np.hypot(*_finite(errors).T), level / 100))
        end_label(ax, x, level, label, color)
    ax.set_xlim(0, right * 1.02)
    ax.set_ylim(0, 102)
    ax.set_xlabel("distance from the truth (m)")
    ax.set_ylabel("points within that distance (%)")
    ax.set_title(title)
    return fig


def errors_by_image(judged: pd.DataFrame, title: str, color: str = BLUE) -> Figure:
    """Distance of every point from the truth by image in order of time, with each image's mean."""
    order = judged.groupby("frame_id", sort=False)["time_s"].first().sort_values(kind="stable").index
    place = judged["frame_id"].map({name: i for i, name in enumerate(order)})
    mean = judged.groupby(place)["error_m"].mean()
    fig, ax = new_figure(5.9, 3.0)
    ax.plot(place, judged["error_m"], ".", color=color, alpha=0.55, ms=6, mec="none")
    ax.plot(mean.index, mean, color=VERMILLION, lw=1.3)
    end_label(ax, mean.index[-1], float(mean.iloc[-1]), "mean per\nimage", VERMILLION)
    ax.set_ylim(0, None)
    ax.xaxis.set_major_locator(MaxNLocator(integer=True))
    ax.set_xlabel("image, in order")
    ax.set_ylabel("error (m)")
    ax.set_title(title)
    return fig


def _finite(errors: ArrayLike) -> Array:
    e = np.asarray(errors, float).reshape(-1, 2)
    return np.asarray(e[np.isfinite(e).all(axis=1)])


def path_map(nav: pd.DataFrame, times: ArrayLike, title: str, target: str = "target") -> Figure:
    """The path of a nav table in local metres, the places at ``times`` marked, the target at the origin."""
    at = np.clip(np.searchsorted(nav["time_s"], np.asarray(times, float)), 0, len(nav) - 1)
    fig, ax = new_figure(5.2, 4.6)
    ax.plot(nav["east_m"], nav["north_m"], color=GREY, lw=0.7)
    ax.plot(nav["east_m"].to_numpy()[at], nav["north_m"].to_numpy()[at], ".", color=ORANGE, ms=4)
    ax.plot(0, 0, "k+", ms=13, mew=2)
    ax.annotate(target, (0, 0), (10, -4), textcoords="offset points", fontsize=9.5)
    ax.set_title(title)
    map_axes(ax)
    return fig


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
        for name, (times, quantities) in sources.items():
            y = np.array(quantities[label], float)
            y[1:][np.abs(np.diff(y)) > 180] = np.nan
            ax.plot(times, y, lw=1.0, color=colour(name), label=name)
        ax.set_ylabel(label)
    if len(sources) > 1:
        fig.legend(*axes[0].get_legend_handles_labels(), loc="outside lower right", ncols=len(sources))
    axes[0].set_title(title)
    axes[-1].set_xlabel("time (s)")
    return fig


def filter_chart(raw: ArrayLike, estimate: ArrayLike, stated: ArrayLike, title: str) -> Figure:
    """Distances from the truth (T,) of measurements and of the estimate, with what the filter states."""
    index = np.arange(len(np.asarray(raw)))
    fig, ax = new_figure(5.9, 3.6)
    ax.plot(index, raw, ".", color=GREY, ms=3, alpha=0.6)
    ax.plot(index, estimate, color=BLUE)
    ax.fill_between(index, 0, np.asarray(stated), color=BLUE, alpha=0.15, lw=0)
    end_label(ax, index[-1], float(np.asarray(estimate)[-1]), "filtered", BLUE)
    end_label(ax, index[-1], float(np.median(np.asarray(raw))), "single\nimages", GREY)
    ax.set_ylim(0, 1.05 * float(np.max(np.asarray(raw))))
    ax.set_xlabel("observation")
    ax.set_ylabel("distance from the truth (m)")
    ax.set_title(title)
    return fig


def autocorrelation_chart(series: Mapping[str, ArrayLike], bound: float, title: str) -> Figure:
    """Autocorrelations by lag, one line for each series, with the band that white noise stays in."""
    fig, ax = new_figure(5.9, 3.4)
    ax.axhspan(-bound, bound, color=GREY, alpha=0.18, lw=0)
    ends = sorted(((float(np.asarray(r)[-1]), name) for name, r in series.items()), reverse=True)
    for (name, values), color in zip(series.items(), (BLUE, VERMILLION), strict=True):
        r = np.asarray(values, float)
        ax.plot(np.arange(len(r)), r, color=color)
        end_label(ax, len(r) - 1, r[-1] + (0.06 if name == ends[0][1] else -0.06), name, color)
    ax.set_xlabel("lag (observations)")
    ax.set_ylabel("autocorrelation")
    ax.set_title(title)
    return fig
