"""Figures of drawn and rendered detections: one frame, errors in the image, and the tracks' errors."""

from __future__ import annotations

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from wildlab.reporting.figures import BLUE, ORANGE, VERMILLION, new_figure
from wildlab.simulation.scene.flights import corner_of
from wildlab.studies.end_to_end.text import FILTERS
from wildlab.studies.end_to_end.trial import (
    DRAWN,
    MARGIN,
    RENDERED,
    FlightPair,
    PixelErrors,
    followed_by,
)

#: What `Report.figures` takes: figure, name, alternative text, caption.
Shown = tuple[Figure, str, str, str]


def frame_shown(pair: FlightPair) -> Shown:
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
    off = [float(np.hypot(*(uv - pair.marks.centre[row]))) for uv in (pair.drawn_uv[row], pair.marks.uv[row])]
    ax.set_title(f"Found {off[1]:.1f} px, drawn {off[0]:.1f} px from the centre")
    fig.legend(*ax.get_legend_handles_labels(), loc="outside lower center", ncols=3)
    return (
        fig, "frame",
        f"A rendered frame about the vessel: found {off[1]:.1f} px from the outline's centre, drawn "
        f"{off[0]:.1f} px from it.",
        f"Frame {exposure + 1} of the flight of the figures, {MARGIN} px about the vessel.",
    )  # fmt: skip


def pixels_shown(errors: PixelErrors) -> Shown:
    """Errors of both kinds in the image, along the vessel's axes."""
    fig, axes = new_figure(5.9, 3.4, columns=2)
    said = []
    for ax, e, colour, name in zip(axes, errors, (VERMILLION, BLUE), ("Drawn", "Rendered"), strict=True):
        known = e[np.isfinite(e).all(axis=1)]
        rms = float(np.sqrt((known**2).sum(axis=1).mean()))
        ax.plot(known[:, 1], known[:, 0], "o", color=colour, ms=3, alpha=0.5, mew=0)
        ax.plot(*known.mean(axis=0)[::-1], "k+", ms=12, mew=2)
        reach = 1.1 * float(np.abs(known).max())
        ax.set(xlim=(-reach, reach), ylim=(-reach, reach), xlabel="to the right (px)")
        ax.set_aspect("equal", adjustable="box")
        ax.set_title(f"{name}: {rms:.1f} px")
        said.append(f"{name.lower()} {rms:.2f} px")
    axes[0].set_ylabel("ahead (px)")
    return (
        fig, "pixels", f"Errors in the image, root mean square: {', '.join(said)}.",
        f"About the vessel's point, along its own axes; each panel has its own scale. Cross: mean. "
        f"Root mean square: {', '.join(said)}.",
    )  # fmt: skip


def tracks_shown(spread: pd.DataFrame) -> Shown:
    """Mean distance of each filter on each flight, with both kinds of detections."""
    fig, ax = new_figure(5.6, 3.0)
    filters = followed_by(spread)
    said = []
    for row, who in enumerate(filters):
        pairs = spread[[(f"{DRAWN}-{who}", "mae"), (f"{RENDERED}-{who}", "mae")]].to_numpy(float)
        for k, (drawn, rendered) in enumerate(pairs):
            y = row + 0.5 * ((k + 0.5) / len(pairs) - 0.5)
            ax.plot([drawn, rendered], [y, y], color="0.75", lw=1)
            ax.plot(drawn, y, "x", color=VERMILLION, ms=5, label="drawn" if row == k == 0 else None)
            ax.plot(rendered, y, "o", color=BLUE, ms=4, label="rendered" if row == k == 0 else None)
        apart = f"{np.median(pairs[:, 1] - pairs[:, 0]):+.2f}".replace("-", "\N{MINUS SIGN}")
        said.append(f"{FILTERS[who]} {apart} m")
    ax.set_yticks(range(len(filters)), [FILTERS[who] for who in filters])
    ax.set(xlabel="mean distance from the truth (m)", ylim=(len(filters) - 0.5, -0.5))
    ax.set_xlim(left=0)
    fig.legend(*ax.get_legend_handles_labels(), loc="outside lower right", ncols=2)
    return (
        fig, "tracks", f"Mean distances of tracks; rendered less drawn in the middle: {'; '.join(said)}.",
        f"Each line is a flight. Rendered less drawn, median: {'; '.join(said)}.",
    )  # fmt: skip
