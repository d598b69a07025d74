"""How much bending of a lens the views of a board carry: lens models compared on views held out."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from wildlab.geometry.frames import Array
from wildlab.geometry.intrinsics import FEWEST, LENSES, PINHOLE, calibrate_camera, view_errors

#: Blocks of views that are held out in turn, and what is taken where there are too few views for that.
BLOCKS, TOO_FEW_FOR_CHOICE = 5, "k1"


class LensChoice(NamedTuple):
    """The lens model taken, one of `LENSES`, and by model the root mean squared distance on views that it was
    not estimated from, pixels; empty where there were too few to hold any out."""

    lens: str
    held_out: dict[str, float]


def choose_lens(board: ArrayLike, uv: ArrayLike, width: int, height: int) -> LensChoice:
    """The simplest lens model that is no worse than the best on views held out.

    No worse: by less than one standard error of the difference over views. Held-out views lie next to one
    another, for pictures taken in a row are alike.

    Parameters
    ----------
    board
        (M, 3) points of the flat board.
    uv
        (V, M, 2) their pixels, views in the order in which they were taken; NaN where one is not seen.
    width, height
        Of the image, pixels.

    Returns
    -------
    LensChoice
    """
    uv = np.asarray(uv, float)
    blocks = np.array_split(np.arange(len(uv)), min(BLOCKS, len(uv)))
    if len(uv) - max(len(block) for block in blocks) < FEWEST:
        return LensChoice(TOO_FEW_FOR_CHOICE, {})
    squared: dict[str, Array] = {}
    for lens, bends in LENSES.items():
        errors = np.empty(len(uv))
        for block in blocks:
            rest = np.delete(uv, block, axis=0)
            camera = calibrate_camera(board, rest, width, height, (*PINHOLE, *bends), resample=False).camera
            errors[block] = view_errors(camera, board, uv[block])
        squared[lens] = errors**2
    means = {lens: float(one.mean()) if np.isfinite(one).all() else np.inf for lens, one in squared.items()}
    best = min(means, key=lambda lens: means[lens])
    for lens in sorted(LENSES, key=lambda lens: len(LENSES[lens])):
        apart = squared[lens] - squared[best]
        if means[lens] - means[best] <= apart.std(ddof=1) / np.sqrt(len(uv)):
            break
    return LensChoice(lens, {name: float(np.sqrt(mean)) for name, mean in means.items()})
