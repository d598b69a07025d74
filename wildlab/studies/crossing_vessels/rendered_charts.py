"""Figure of the crossing from rendered frames: counterpart of H figure 6.22."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from matplotlib.patches import Rectangle
from numpy.typing import NDArray

from wildlab.analysis.rendered import Photographer
from wildlab.reporting.figures import BLUE, GREEN, ORANGE, VERMILLION, new_figure
from wildlab.studies.crossing_vessels.charts import Shown
from wildlab.studies.crossing_vessels.rendered import Rendering
from wildlab.studies.crossing_vessels.spotted import WHOLE, Spotted, spot
from wildlab.studies.crossing_vessels.trial.crossing import BOATS, NONE

#: Around the boxes, px, and how wide what is shown is at least.
AROUND, LEAST = 30, 200


class Picture(NamedTuple):
    """A frame of the crossing: its counts (H, W), its detections and their boxes, (D, 4) px; m apart."""

    exposure: int
    counts: NDArray[np.uint16]
    spotted: Spotted
    box: NDArray[np.float64]
    apart: float


def telling_exposures(one: Rendering) -> list[int]:
    """Of the frames with both whole in view: where they are nearest and detected each alone, and as one.

    None, one or two of these; a frame without any detection has no place among them.
    """
    spotted, crossing = one.spotted, one.frames.crossing
    images = np.unique(crossing.looks.image)
    both = (spotted.share >= WHOLE).all(axis=1)
    chosen = []
    for kind in (spotted.found.all(axis=1), spotted.joined.any(axis=1)):
        rows = np.flatnonzero(np.isin(images, spotted.frames[both & kind]))
        if len(rows) and np.isfinite(crossing.apart[rows]).any():
            chosen.append(int(images[rows[np.nanargmin(crossing.apart[rows])]]))
    return chosen


def picture_of(twin: str, one: Rendering, exposure: int) -> Picture:
    """A frame rendered and searched again."""
    camera = Photographer(twin, one.seed)
    _, counts = camera.image(exposure)
    shot = next(iter(camera.shoot([exposure])))
    crossing = one.frames.crossing
    apart = float(crossing.apart[np.searchsorted(np.unique(crossing.looks.image), exposure)])
    rows, columns = counts.shape
    return Picture(exposure, counts, spot([shot], (rows, columns)), shot.detections.box, apart)


def picture_words(picture: Picture) -> str:
    """What is detected in a frame, and how far the two are from each other."""
    spotted = picture.spotted
    if spotted.joined.any():
        said = "found as one"
    else:
        said = ("none found", "one found", "both found")[int(spotted.found.sum())]
    false = int((spotted.boat == NONE).sum())
    return f"{said}, {picture.apart:.0f} m apart" + (f", {false} false" if false else "")


def frames_shown(twin: str, flights: Sequence[Rendering]) -> Shown | None:
    """The two at the crossing, each detected alone, and as one: of the first flight that has most of these.

    None where both are whole in no frame with a detection.
    """
    chosen = [telling_exposures(one) for one in flights]
    most = max((len(found) for found in chosen), default=0)
    if not most:
        return None
    at = next(k for k, found in enumerate(chosen) if len(found) == most)
    one = flights[at]
    pictures = [picture_of(twin, one, exposure) for exposure in chosen[at]]
    fig, axes = new_figure(5.9, 3.1 if most > 1 else 4.6, columns=most, squeeze=False)
    for ax, picture in zip(axes.flat, pictures, strict=True):
        (left, top), (right, bottom) = _part(picture)
        shown = picture.counts[top:bottom, left:right]
        low, high = np.percentile(shown, (0.5, 99.8))
        ax.imshow(picture.counts, cmap="gray", vmin=low, vmax=high, interpolation="nearest")
        for (x, y, width, height), boat, both in zip(
            picture.box, picture.spotted.boat, picture.spotted.both, strict=True
        ):
            colour = VERMILLION if boat == NONE else GREEN if both else (BLUE, ORANGE)[boat]
            box = Rectangle((x - 4, y - 4), width + 8, height + 8, fill=False, ec=colour, lw=1.8)
            ax.add_patch(box)
        ax.set(xlim=(left - 0.5, right - 0.5), ylim=(bottom - 0.5, top - 0.5), xticks=[], yticks=[])
        ax.grid(False)
        words = picture_words(picture)
        ax.set_title(words[0].upper() + words[1:])
    said = "; ".join(picture_words(picture) for picture in pictures)
    whole = "Parts" if most > 1 else "Part"
    return (
        fig, "fig-6-22",
        f"Both vessels in rendered frames at the crossing, with boxes about what is detected: {said}.",
        f"{whole} of rendered frames of flight {one.seed}, of those with both vessels whole in view: {said}. "
        f"Boxes: blue of {BOATS[0]}, orange of {BOATS[1]}, green of both in one, red of nothing. "
        "Counterpart of H figure 6.22.",
    )  # fmt: skip


def _part(picture: Picture) -> tuple[tuple[int, int], tuple[int, int]]:
    """Corners of the part that is shown, px: all boxes, and some sea about them."""
    rows, columns = picture.counts.shape
    low = picture.box[:, :2].min(axis=0) - AROUND
    high = (picture.box[:, :2] + picture.box[:, 2:]).max(axis=0) + AROUND
    middle, half = (low + high) / 2, np.maximum((high - low) / 2, LEAST / 2).max()
    size = np.array([columns, rows])
    half = min(half, size.min() / 2)
    middle = np.clip(middle, half, size - half)
    first, last = np.floor(middle - half).astype(int), np.ceil(middle + half).astype(int)
    return (int(first[0]), int(first[1])), (min(int(last[0]), columns), min(int(last[1]), rows))
