"""A target's velocity from optical flow: H 5.4, 5.6.3."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from wildlab.reporting.charts.drawing import (
    draw_dots,
    draw_line,
    draw_way,
    finish,
    name_rows,
    new_strips,
    with_breaks,
)
from wildlab.reporting.charts.forms import draw_picture
from wildlab.reporting.figures import BLUE, GREY, INK, ORANGE, VERMILLION, map_axes, new_figure
from wildlab.simulation.twins import AUTOPILOT
from wildlab.studies.optical_flow_velocity import trial
from wildlab.studies.optical_flow_velocity.trial import LOGGED, READINGS, Looked, sizes
from wildlab.studies.page import Facts
from wildlab.studies.protocol import Study

#: Displacements are drawn so many times as long: they are of a few pixels.
LONGER = 4.0


def plot_path(looked: Looked) -> Figure:
    """Where the airframe flew, and where the ship lies: H figure 5.14 (a)."""
    way = looked.flight.nav[AUTOPILOT][["north_m", "east_m"]].to_numpy(float)
    fig, ax = new_figure(5.2, 4.4)
    draw_way(ax, way, ORANGE, "airframe, by the autopilot", width=1.7)
    ax.plot(*way[0, ::-1], "o", color=ORANGE, ms=6)
    body = looked.scene.bodies(0)[0]
    ax.fill(*body.corners(body.layers[0], 0.0)[:, 1::-1].T, color=INK, label="ship")
    map_axes(ax)
    return finish(fig, "")


def plot_gimbal(looked: Looked) -> Figure:
    """How the gimbal turned, and when the ship was in view: H figure 5.14 (b)."""
    gimbal = looked.flight.table("gimbal")
    fig, ax = new_figure(5.6, 3.0)
    ax.fill_between(
        looked.scene.times, 0, 1, where=looked.shares > 0, transform=ax.get_xaxis_transform(), color=GREY,
        alpha=0.2, lw=0, label="ship in view",
    )  # fmt: skip
    for name, colour in (("pan", BLUE), ("tilt", VERMILLION)):
        draw_line(ax, gimbal["time_s"], np.degrees(gimbal[f"{name}_rad"]), colour, name, width=1.7)
    return finish(fig, "", "time (s)", "angle (deg)")


def plot_features(looked: Looked) -> Figure:
    """Features on the ship in one image, and how far each moved to the next: H figures 4.2, 5.13."""
    counts = [len(pair.matches) for pair in looked.pairs]
    pair = looked.pairs[int(np.argsort(counts)[len(counts) // 2])]
    kelvin = looked.scene.view(pair.first, waves_move=False).kelvin
    fig, ax = new_figure(5.4, 4.5)
    draw_picture(ax, kelvin, limits=(float(kelvin.min()), float(np.quantile(kelvin, 0.995))))
    at, moved = pair.matches.first, LONGER * (pair.matches.second - pair.matches.first)
    ax.quiver(*at.T, *moved.T, angles="xy", scale_units="xy", scale=1, color=ORANGE, width=0.004)
    ax.plot(*at.T, "o", color=ORANGE, ms=3)
    return fig


def plot_flow(table: pd.DataFrame) -> Figure:
    """Flow by the camera's motion and measured flow: H figure 5.15."""
    fig, axes = new_strips(2, 4.8, 5.8)
    for ax, axis, name in zip(axes, "uv", ("horizontal", "vertical"), strict=True):
        # Broken where pairs are not neighbours.
        line = with_breaks(table["time_s"], table[f"camera_{axis}"], 1.0)
        draw_line(ax, *line, VERMILLION, "by the camera's motion", width=1.4)
        draw_dots(ax, table["time_s"], table[f"flow_{axis}"], BLUE, "measured", alpha=1.0)
        ax.set_ylabel(f"{name} (px/s)")
    return finish(fig, "", "time (s)")


def plot_velocity(table: pd.DataFrame) -> Figure:
    """Velocities of all pairs of images, with their intervals: H figure 5.16."""
    fig, axes = new_strips(2, 4.8, 5.8)
    look: dict[str, Any] = {
        "fmt": "o",
        "color": BLUE,
        "ecolor": GREY,
        "elinewidth": 0.6,
        "ms": 3,
        "label": "pair",
    }
    for ax, axis, variance in zip(axes, ("north", "east"), ("cov_nn", "cov_ee"), strict=True):
        v = table[f"v_{axis}_m_s"].to_numpy(float)
        ax.errorbar(table["time_s"], v, 1.96 * np.sqrt(table[variance].to_numpy(float)), **look)
        ax.axhline(0.0, color=INK, lw=1.2, label="truth")
        ax.axhline(float(np.nanmean(v)), color=VERMILLION, ls="--", lw=1.4, label="mean")
        ax.set_ylabel(f"{axis} (m/s)")
    return finish(fig, "", "time (s)")


def plot_readings(runs: pd.DataFrame, names: Mapping[str, str]) -> Figure:
    """Standard deviation of a pair's velocity by each way of reading the log, medians over flights."""
    medians = [float(pd.Series(sizes(runs, one)).median()) for one in READINGS]
    fig, ax = new_figure(5.8, 3.0)
    ax.barh(
        range(len(READINGS)), medians, color=[BLUE if one == LOGGED else GREY for one in READINGS], height=0.6
    )
    for row, value in enumerate(medians):
        ax.text(value, row, f" {value:.1f}", va="center")
    name_rows(ax, [names[one] for one in READINGS])
    ax.set_xlim(0, 1.15 * max(medians))
    return finish(fig, "", "SD along an axis (m/s)")


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
            for one in READINGS
        ]
    )


def answer(facts: Facts) -> list[str]:
    """How much the velocities of single pairs scatter, and whether poses or images cause it."""
    return [
        f"scatter-{facts.outcome('very-large-variance')}",
        f"own-motion-{facts.outcome('own-motion-dominates')}",
    ]


STUDY = Study("optical-flow-velocity", trial.trial, trial.check_claims, trial.RECORDED.get, answer)
