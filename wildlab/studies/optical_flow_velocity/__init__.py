"""A target's velocity from optical flow: H 5.4, 5.6.3."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from wildlab.reporting.figures import BLUE, GREY, INK, ORANGE, VERMILLION, map_axes, new_figure
from wildlab.simulation.twins import AUTOPILOT
from wildlab.studies.optical_flow_velocity import trial
from wildlab.studies.optical_flow_velocity.trial import (
    LIKELY,
    LOGGED,
    READINGS,
    SLOW,
    STAMPS,
    Looked,
    sizes,
)
from wildlab.studies.page import Facts
from wildlab.studies.protocol import Study, name_metrics

#: Displacements are drawn so many times as long: they are of a few pixels.
LONGER = 4.0


def plot_path(looked: Looked) -> Figure:
    """Where the airframe flew, and where the ship lies: H figure 5.14 (a)."""
    nav = looked.flight.nav[AUTOPILOT]
    fig, ax = new_figure(5.2, 4.4)
    ax.plot(nav["east_m"], nav["north_m"], color=ORANGE, label="airframe, by the autopilot")
    ax.plot(nav["east_m"].iloc[0], nav["north_m"].iloc[0], "o", color=ORANGE, ms=6)
    body = looked.scene.bodies(0)[0]
    outline = body.corners(body.layers[0], 0.0)
    ax.fill(outline[:, 1], outline[:, 0], color=INK, label="ship")
    map_axes(ax)
    fig.legend(*ax.get_legend_handles_labels(), loc="outside lower right", ncols=2)
    return fig


def plot_gimbal(looked: Looked) -> Figure:
    """How the gimbal turned, and when the ship was in view: H figure 5.14 (b)."""
    gimbal, times = looked.flight.table("gimbal"), looked.scene.times
    fig, ax = new_figure(5.6, 3.0)
    ax.fill_between(
        times, 0, 1, where=looked.shares > 0, transform=ax.get_xaxis_transform(), color=GREY, alpha=0.2, lw=0,
        label="ship in view",
    )  # fmt: skip
    for name, colour in (("pan", BLUE), ("tilt", VERMILLION)):
        ax.plot(gimbal["time_s"], np.degrees(gimbal[f"{name}_rad"]), color=colour, label=name)
    ax.set(xlabel="time (s)", ylabel="angle (deg)")
    fig.legend(*ax.get_legend_handles_labels(), loc="outside lower right", ncols=3)
    return fig


def plot_features(looked: Looked) -> Figure:
    """Features on the ship in one image, and how far each moved to the next: H figures 4.2, 5.13."""
    counts = [len(pair.matches) for pair in looked.pairs]
    pair = looked.pairs[int(np.argsort(counts)[len(counts) // 2])]
    kelvin = looked.scene.view(pair.first, waves_move=False).kelvin
    fig, ax = new_figure(5.4, 4.5)
    ax.imshow(kelvin, cmap="gray", vmax=float(np.quantile(kelvin, 0.995)), interpolation="nearest")
    moved = LONGER * (pair.matches.second - pair.matches.first)
    ax.quiver(
        *pair.matches.first.T, *moved.T, angles="xy", scale_units="xy", scale=1, color=ORANGE, width=0.004
    )
    ax.plot(*pair.matches.first.T, "o", color=ORANGE, ms=3)
    ax.set(xticks=[], yticks=[], xlim=(-0.5, kelvin.shape[1] - 0.5), ylim=(kelvin.shape[0] - 0.5, -0.5))
    ax.grid(False)
    return fig


def _over_time(ax: Axes, table: pd.DataFrame, column: str, colour: str, label: str) -> None:
    """A line over time, broken where pairs are not neighbours."""
    times, values = table["time_s"].to_numpy(float), table[column].to_numpy(float)
    gaps = np.flatnonzero(np.diff(times) > 1.0) + 1
    broken = np.insert(times, gaps, np.nan), np.insert(values, gaps, np.nan)
    ax.plot(*broken, color=colour, label=label, lw=1.4)


def plot_flow(table: pd.DataFrame) -> Figure:
    """Flow by the camera's motion and measured flow: H figure 5.15."""
    fig, axes = new_figure(5.8, 4.8, rows=2, sharex=True)
    for ax, axis, name in zip(axes, "uv", ("horizontal", "vertical"), strict=True):
        _over_time(ax, table, f"camera_{axis}", VERMILLION, "by the camera's motion")
        ax.plot(table["time_s"], table[f"flow_{axis}"], ".", color=BLUE, ms=4, label="measured")
        ax.set(ylabel=f"{name} (px/s)")
    axes[1].set(xlabel="time (s)")
    fig.legend(*axes[0].get_legend_handles_labels(), loc="outside lower right", ncols=2)
    return fig


def plot_velocity(table: pd.DataFrame) -> Figure:
    """Velocities of all pairs of images, with their intervals: H figure 5.16."""
    fig, axes = new_figure(5.8, 4.8, rows=2, sharex=True)
    for ax, axis, variance in zip(axes, ("north", "east"), ("cov_nn", "cov_ee"), strict=True):
        v = table[f"v_{axis}_m_s"].to_numpy(float)
        half = 1.96 * np.sqrt(table[variance].to_numpy(float))
        ax.errorbar(
            table["time_s"], v, half, fmt="o", color=BLUE, ecolor=GREY, elinewidth=0.6, ms=3, label="pair"
        )
        ax.axhline(0.0, color=INK, lw=1.2, label="truth")
        ax.axhline(float(np.nanmean(v)), color=VERMILLION, ls="--", lw=1.4, label="mean")
        ax.set(ylabel=f"{axis} (m/s)")
    axes[1].set(xlabel="time (s)")
    fig.legend(*axes[0].get_legend_handles_labels(), loc="outside lower right", ncols=3)
    return fig


def plot_readings(runs: pd.DataFrame, names: Mapping[str, str]) -> Figure:
    """Standard deviation of a pair's velocity by each way of reading the log, medians over flights."""
    shown = [one for one in READINGS if one != STAMPS]
    medians = [float(pd.Series(sizes(runs, one)).median()) for one in shown]
    fig, ax = new_figure(5.8, 3.0)
    ax.barh(range(len(shown)), medians, color=[BLUE if one == LOGGED else GREY for one in shown], height=0.6)
    for row, value in enumerate(medians):
        ax.text(value, row, f" {value:.1f}", va="center")
    ax.set_yticks(range(len(shown)), [names[one] for one in shown])
    ax.set(xlabel="SD along an axis (m/s)", ylim=(len(shown) - 0.4, -0.6))
    ax.set_xlim(0, 1.15 * max(medians))
    return fig


def readings_table(runs: pd.DataFrame, names: Mapping[str, str]) -> pd.DataFrame:
    """A row for each way of reading the same features: medians over flights, and pairs of all flights."""
    medians = ("mean_north", "mean_east", "sd_north", "sd_east")
    return pd.DataFrame(
        [
            {
                "reading": names[one],
                **{name: float(runs[one, name].median()) for name in medians},
                "inside": 100 * float(runs[one, "interval_share_95"].median()),
                "pairs": float(runs[one, "pairs"].sum()),
            }
            for one in (*READINGS, SLOW, LIKELY)
        ]
    )


def answer(facts: Facts) -> list[str]:
    """How much the velocities of single pairs scatter, and whether poses or images cause it."""
    return [
        f"scatter-{facts.outcome('very-large-variance')}",
        f"own-motion-{facts.outcome('own-motion-dominates')}",
    ]


STUDY = Study(
    "optical-flow-velocity",
    trial.SUBJECTS,
    trial.trial,
    trial.check_claims,
    name_metrics(trial.RECORDED),
    answer,
)
