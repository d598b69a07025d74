"""Figures of drawn and rendered detections: one frame, errors in the image, and the tracks' errors."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from wildlab.reporting.figures import BLUE, ORANGE, VERMILLION, new_figure
from wildlab.simulation.scene.flights import corner_of
from wildlab.studies.end_to_end.trial import (
    DRAWN,
    MARGIN,
    RENDERED,
    FlightPair,
    PixelErrors,
    tracked_filters,
)


def frame(pair: FlightPair) -> Figure:
    """A frame about the vessel, with what is drawn, what is found and where its outline's centre is."""
    rows = np.flatnonzero(pair.marks.found)
    row = int(rows[len(rows) // 2])
    exposure = int(pair.marks.exposure[row])
    window = pair.camera.flight.window(exposure, MARGIN)
    _, counts = pair.camera.image(exposure, window)
    corner = corner_of(window)
    fig, ax = new_figure(5.2, 4.2)
    low, high = np.quantile(counts, [0.005, 0.998])  # but for dead pixels
    ax.imshow(counts, cmap="gray", vmin=low, vmax=high, interpolation="nearest")
    ax.plot(*(pair.drawn_uv[row] - corner), "x", color=VERMILLION, ms=10, mew=2, label="drawn")
    ax.plot(*(pair.marks.uv[row] - corner), "+", color=BLUE, ms=12, mew=2, label="found")
    ax.plot(*(pair.marks.centre[row] - corner), "o", mfc="none", mec=ORANGE, ms=9, mew=1.6, label="centre")
    ax.set(xticks=[], yticks=[])
    ax.grid(False)
    fig.legend(*ax.get_legend_handles_labels(), loc="outside lower center", ncols=3)
    return fig


def pixel_errors(errors: PixelErrors) -> Figure:
    """Errors of both kinds in the image, along the vessel's axes."""
    fig, axes = new_figure(5.9, 3.4, columns=2)
    for ax, e, color, name in zip(axes, errors, (VERMILLION, BLUE), ("Drawn", "Rendered"), strict=True):
        known = e[np.isfinite(e).all(axis=1)]
        ax.plot(known[:, 1], known[:, 0], "o", color=color, ms=3, alpha=0.5, mew=0)
        ax.plot(*known.mean(axis=0)[::-1], "k+", ms=12, mew=2)
        reach = 1.1 * float(np.abs(known).max())
        ax.set(xlim=(-reach, reach), ylim=(-reach, reach), xlabel="to the right (px)")
        ax.set_aspect("equal", adjustable="box")
        ax.set_title(name)
    axes[0].set_ylabel("ahead (px)")
    return fig


def track_errors(runs: pd.DataFrame, names: Mapping[str, str]) -> Figure:
    """Mean distance of each filter on each flight, with both kinds of detections."""
    fig, ax = new_figure(5.6, 3.0)
    filters = tracked_filters(runs)
    for row, who in enumerate(filters):
        pairs = runs[[(f"{DRAWN}-{who}", "mae"), (f"{RENDERED}-{who}", "mae")]].to_numpy(float)
        for k, (drawn, rendered) in enumerate(pairs):
            y = row + 0.5 * ((k + 0.5) / len(pairs) - 0.5)
            ax.plot([drawn, rendered], [y, y], color="0.75", lw=1)
            ax.plot(drawn, y, "x", color=VERMILLION, ms=5, label="drawn" if row == k == 0 else None)
            ax.plot(rendered, y, "o", color=BLUE, ms=4, label="rendered" if row == k == 0 else None)
    ax.set_yticks(range(len(filters)), [names[who] for who in filters])
    ax.set(xlabel="mean distance from the truth (m)", ylim=(len(filters) - 0.5, -0.5))
    ax.set_xlim(left=0)
    fig.legend(*ax.get_legend_handles_labels(), loc="outside lower right", ncols=2)
    return fig
