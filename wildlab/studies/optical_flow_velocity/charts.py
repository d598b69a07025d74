"""Charts of the study of velocity from flow: counterparts of H figures 5.13 to 5.16, and of the scatter."""

from __future__ import annotations

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from wildlab.reporting.figures import BLUE, GREY, INK, ORANGE, VERMILLION, map_axes, new_figure
from wildlab.simulation.twins import AUTOPILOT
from wildlab.studies.optical_flow_velocity import text as words
from wildlab.studies.optical_flow_velocity.trial import LOGGED, READINGS, STAMPS, Looked

#: What `Report.figures` takes: figure, name, alternative text, caption.
Shown = tuple[Figure, str, str, str]
#: Times as long as drawn, so that a displacement of a few pixels can be seen.
_LONGER = 4.0


def path_shown(looked: Looked) -> Shown:
    """Where the airframe flew, and where the ship lies: H figure 5.14 (a)."""
    nav = looked.flight.nav[AUTOPILOT]
    fig, ax = new_figure(5.2, 4.4)
    ax.plot(nav["east_m"], nav["north_m"], color=ORANGE, label="airframe, by the autopilot")
    ax.plot(nav["east_m"].iloc[0], nav["north_m"].iloc[0], "o", color=ORANGE, ms=6)
    body = looked.scene.bodies(0)[0]
    outline = body.corners(body.layers[0], 0.0)
    ax.fill(outline[:, 1], outline[:, 0], color=INK, label="ship")
    far = float(np.hypot(nav["east_m"], nav["north_m"]).max())
    ax.set_title(f"The airframe passes a ship, up to {far:.0f} m away")
    map_axes(ax)
    fig.legend(*ax.get_legend_handles_labels(), loc="outside lower right", ncols=2)
    return (
        fig, "path", f"Map of the flight, up to {far:.0f} m from the ship in its middle.",
        "The dot is where it begins. Counterpart of H figure 5.14 (a).",
    )  # fmt: skip


def gimbal_shown(looked: Looked) -> Shown:
    """How the gimbal turned, and when the ship was in view: H figure 5.14 (b)."""
    gimbal, seen = looked.flight.table("gimbal"), looked.shares > 0
    fig, ax = new_figure(5.6, 3.0)
    times = looked.scene.times
    ax.fill_between(
        times, 0, 1, where=seen, transform=ax.get_xaxis_transform(), color=GREY, alpha=0.2, lw=0,
        label="ship in view",
    )  # fmt: skip
    for name, colour in (("pan", BLUE), ("tilt", VERMILLION)):
        ax.plot(gimbal["time_s"], np.degrees(gimbal[f"{name}_rad"]), color=colour, label=name)
    swing = float(np.degrees(np.ptp(gimbal["tilt_rad"])))
    ax.set(xlabel="time (s)", ylabel="angle (deg)")
    ax.set_title(f"The gimbal tilts over {swing:.0f} deg")
    fig.legend(*ax.get_legend_handles_labels(), loc="outside lower right", ncols=3)
    part = f"some of the ship in view in {int(seen.sum())} of {len(seen)} images"
    return (
        fig, "gimbal", f"Pan and tilt of the gimbal over time, {part}.",
        f"As the gimbal logs them; {part}. Counterpart of H figure 5.14 (b).",
    )  # fmt: skip


def features_shown(looked: Looked) -> Shown:
    """Features on the ship in one image, and how far each moved to the next: H figures 4.2, 5.13."""
    counts = [len(pair.matches) for pair in looked.pairs]
    pair = looked.pairs[int(np.argsort(counts)[len(counts) // 2])]
    kelvin = looked.scene.view(pair.first, waves_move=False).kelvin
    fig, ax = new_figure(5.4, 4.5)
    ax.imshow(kelvin, cmap="gray", vmax=float(np.quantile(kelvin, 0.995)), interpolation="nearest")
    moved = _LONGER * (pair.matches.second - pair.matches.first)
    ax.quiver(
        *pair.matches.first.T, *moved.T, angles="xy", scale_units="xy", scale=1, color=ORANGE, width=0.004
    )
    ax.plot(*pair.matches.first.T, "o", color=ORANGE, ms=3)
    ax.set(xticks=[], yticks=[], xlim=(-0.5, kelvin.shape[1] - 0.5), ylim=(kelvin.shape[0] - 0.5, -0.5))
    ax.grid(False)
    far = float(np.linalg.norm(moved, axis=1).mean() / _LONGER)
    ax.set_title(f"{len(pair.matches)} features move by {far:.1f} px")
    return (
        fig, "features", f"A rendered image of the ship with {len(pair.matches)} features and their flow.",
        f"A pair with as many features as the middle one of all. Arrows are {_LONGER:g} times as long as the "
        "displacement to the next image. Counterpart of H figure 5.13.",
    )  # fmt: skip


def _over_time(ax: Axes, table: pd.DataFrame, column: str, colour: str, label: str) -> None:
    """A line over time, broken where pairs are not neighbours."""
    times, values = table["time_s"].to_numpy(float), table[column].to_numpy(float)
    gaps = np.flatnonzero(np.diff(times) > 1.0) + 1
    broken = np.insert(times, gaps, np.nan), np.insert(values, gaps, np.nan)
    ax.plot(*broken, color=colour, label=label, lw=1.4)


def flow_shown(table: pd.DataFrame) -> Shown:
    """Flow by the camera's motion beside measured flow: H figure 5.15."""
    fig, axes = new_figure(5.8, 4.8, rows=2, sharex=True)
    said, sizes = [], []
    for ax, axis, name in zip(axes, "uv", ("horizontal", "vertical"), strict=True):
        _over_time(ax, table, f"camera_{axis}", VERMILLION, "by the camera's motion")
        ax.plot(table["time_s"], table[f"flow_{axis}"], ".", color=BLUE, ms=4, label="measured")
        ax.set(ylabel=f"{name} (px/s)")
        both = table[[f"flow_{axis}", f"camera_{axis}"]].dropna().to_numpy(float)
        sizes.append(f"{np.corrcoef(both.T)[0, 1]:.2f}")
        said.append(f"{sizes[-1]} {name}ly")
    axes[1].set(xlabel="time (s)")
    axes[0].set_title(f"The two correlate by {' and '.join(sizes)}")
    fig.legend(*axes[0].get_legend_handles_labels(), loc="outside lower right", ncols=2)
    return (
        fig, "flow", f"Flow over time, measured and by the camera's motion; correlations {', '.join(said)}.",
        "Means over the features of each pair of images. Counterpart of H figure 5.15.",
    )  # fmt: skip


def velocity_shown(table: pd.DataFrame) -> Shown:
    """Velocities of all pairs of images, with their intervals: H figure 5.16."""
    fig, axes = new_figure(5.8, 4.8, rows=2, sharex=True)
    said = []
    for ax, axis, variance in zip(axes, ("north", "east"), ("cov_nn", "cov_ee"), strict=True):
        v = table[f"v_{axis}_m_s"].to_numpy(float)
        half = 1.96 * np.sqrt(table[variance].to_numpy(float))
        ax.errorbar(
            table["time_s"], v, half, fmt="o", color=BLUE, ecolor=GREY, elinewidth=0.6, ms=3, label="pair"
        )
        ax.axhline(0.0, color=INK, lw=1.2, label="truth")
        ax.axhline(float(np.nanmean(v)), color=VERMILLION, ls="--", lw=1.4, label="mean")
        ax.set(ylabel=f"{axis} (m/s)")
        said.append(f"{np.nanmean(v):.1f} m/s {axis} (SD {np.nanstd(v, ddof=1):.1f})")
    axes[1].set(xlabel="time (s)")
    axes[0].set_title("Mean " + ", ".join(one.partition(" (")[0] for one in said))
    fig.legend(*axes[0].get_legend_handles_labels(), loc="outside lower right", ncols=3)
    return (
        fig, "velocity", f"Velocities of single pairs over time; means {', '.join(said)}.",
        "Bars: 95 % intervals as stated. The ship is at rest. Counterpart of H figure 5.16.",
    )  # fmt: skip


def readings_shown(spread: pd.DataFrame) -> Shown:
    """Standard deviation of a pair's velocity by each way of reading the log."""
    shown = [one for one in READINGS if one != STAMPS]
    sizes = [words.size(spread, one) for one in shown]
    fig, ax = new_figure(5.8, 3.0)
    ax.barh(range(len(shown)), sizes, color=[BLUE if one == LOGGED else GREY for one in shown], height=0.6)
    for row, value in enumerate(sizes):
        ax.text(value, row, f" {value:.1f}", va="center")
    ax.set_yticks(range(len(shown)), [words.NAMES[one] for one in shown])
    ax.set(xlabel="standard deviation along an axis (m/s)", ylim=(len(shown) - 0.4, -0.6))
    ax.set_xlim(0, 1.15 * max(sizes))
    ax.set_title(f"{sizes[0]:.1f} m/s, with exact poses {sizes[-1]:.1f} m/s")
    said = ", ".join(f"{words.NAMES[one]} {value:.1f} m/s" for one, value in zip(shown, sizes, strict=True))
    return fig, "readings", f"Standard deviation of a velocity: {said}.", "Medians over flights."
