"""The words of the report on the wildlife camera, each from the numbers it states."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pandas as pd

from wildlab.studies.wildlife_camera.lens import Video

#: An error of so many pixels in a direction is not seen beside that of a detection.
UNSEEN_PX = 0.5
#: A reading that fits this well (per cent), and so many times better than the next, is the one.
FITS, CLEARLY = 2.0, 2.0
#: One model is better than the other by more than this factor, else they are alike.
BETTER = 1.2


def inverse_words(error: np.ndarray, height: float, focal: float) -> str:
    """How far the approximate inverse misses, and what that is on the ground."""
    largest, middle = float(error.max()), float(np.median(error))
    ground = height * largest / focal
    said = (
        f"The thesis's shortcut for taking lens distortion off (F 2.19) is {largest:.2g} pixels off at "
        f"worst, "
        f"{ground:.2g} metres on the ground from {height:.0f} metres"
    )
    if largest < UNSEEN_PX:
        return f"{said}: nobody will see it."
    where = "only the rim of the image suffers" if middle < UNSEEN_PX else "it shows all over"
    return f"{said}, and no more than {middle:.1g} pixels in half of the image: {where}."


def video_words(videos: Sequence[Video], fx: float, fy: float) -> str:
    """Which size of image the printed numbers fit."""
    best, second = videos[0], videos[1]
    stretch = 100 * (fx / fy - 1)
    said = (
        f"The pixels of this camera are square, and the printed focal lengths differ by {abs(stretch):.0f} %"
    )
    if best.off < FITS and second.off > CLEARLY * best.off:
        return (
            f"{said}: they are not those of the sensor, but of video of {best.name}, which they fit to "
            f"{best.off:.1f} %."
        )
    return f"{said}; no usual video explains them for certain ({best.name} is {best.off:.1f} % off)."


def assumed_words(straight: pd.DataFrame, bent: pd.DataFrame) -> str:
    """What assuming zero gains where it is true, and costs where it is not."""
    gain, cost = straight["all"].median(), bent["few"].median()
    when_true = straight["few"].median()
    when_not = bent["all"].median()
    first = (
        f"Where skew and the other distortion are zero, assuming so keeps directions to {when_true:.2f} "
        f"pixels "
        f"instead of {gain:.2f}"
        if gain > BETTER * when_true
        else f"Where skew and the other distortion are zero, assuming so hardly matters ({when_true:.2f} "
        f"pixels, and {gain:.2f} "
        f"without)"
    )
    second = (
        f"where they are not, it costs {cost:.1f} pixels instead of {when_not:.2f}"
        if cost > BETTER * when_not
        else f"where they are not, it costs nothing ({cost:.2f} pixels)"
    )
    return f"{first}; {second}."


def told_words(straight: pd.DataFrame, names: Sequence[str], images: int) -> str:
    """How small a skew or bend the pictures could have shown."""
    units = {"skew": " px"}
    limits = [f"{name} {2 * straight[f'sd_{name}'].median():.2g}{units.get(name, '')}" for name in names]
    return f"{images} pictures would have shown, at two standard deviations, {', '.join(limits)}."


def sheet_words(fx: float, fy: float, sheet: float) -> str:
    """Both printed focal lengths beside the data sheet's."""
    columns, rows = 100 * (fx / sheet - 1), 100 * (fy / sheet - 1)
    return (
        f"The data sheet gives {sheet:.1f} px for columns and rows: the printed {fx:.0f} px are "
        f"{columns:+.1f} % off, "
        f"the printed {fy:.0f} px {rows:+.1f} %."
    )


def title(error: np.ndarray) -> str:
    """Title of the map of the error."""
    return f"Below {np.quantile(error, 0.9):.2g} px in nine tenths, {error.max():.2g} px at worst"
