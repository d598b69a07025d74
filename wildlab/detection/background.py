"""What an image would be without what is looked for: the median about each pixel, and how it scatters."""

from __future__ import annotations

from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from wildlab.errors import WildlabError

Image = NDArray[np.float32]
Mask = NDArray[np.bool_]

#: What a standard deviation is to the median absolute deviation, for normal noise.
MAD = 1.4826
#: Standard deviation of what rounding to whole numbers takes away.
ROUNDING = 12**-0.5
#: Pixels of a window's side after it was made smaller: finer says nothing of a median over so many.
COARSE = 15


def fill_invalid(image: NDArray[Any], valid: Mask) -> Image:
    """An image whose invalid pixels have the value of the nearest valid one.

    Parameters
    ----------
    image
        (H, W).
    valid
        (H, W) bool, some of it True.

    Returns
    -------
    (H, W) float32

    Raises
    ------
    WildlabError
        Where no pixel is valid, or the shapes are not alike.

    Examples
    --------
    >>> fill_invalid(np.array([[5.0, 0.0]]), np.array([[True, False]])).tolist()
    [[5.0, 5.0]]
    """
    if image.ndim != 2 or image.shape != valid.shape:
        shapes = f"an image of shape {image.shape} and a mask of shape {valid.shape}"
        raise WildlabError(f"{shapes}", "give both as (H, W); make grey of a colour image first")
    if not valid.any():
        raise WildlabError("no pixel of the image is valid", "leave such frames out")
    plain = image.astype(np.float32)
    if valid.all():
        return plain
    labels = cv2.distanceTransformWithLabels(
        (~valid).astype(np.uint8), cv2.DIST_L2, 3, labelType=cv2.DIST_LABEL_PIXEL
    )[1]
    values = np.zeros(int(labels.max()) + 1, np.float32)
    values[labels[valid]] = plain[valid]
    return np.asarray(values[labels])


def median_background(image: Image, window_px: int) -> Image:
    """Median over a square window about each pixel.

    Parameters
    ----------
    image
        (H, W), filled where it is not valid.
    window_px
        Side of the window, px.

    Returns
    -------
    (H, W) float32

    Notes
    -----
    The image is made smaller by whole numbers until the window has about `COARSE` pixels, and its numbers are
    put into 254 steps between its 0.1 and 99.9 per cent: coarser than the image, much finer than its noise.

    Examples
    --------
    >>> image = np.full((40, 40), 7, np.float32)
    >>> image[20, 20] = 900
    >>> float(median_background(image, 15)[20, 20])
    7.0
    """
    low, high = np.percentile(image[::4, ::4], [0.1, 99.9])
    step = max(float(high - low), 1e-6) / 254
    shrink = max(1, window_px // COARSE)
    size = (max(1, image.shape[1] // shrink), max(1, image.shape[0] // shrink))
    small = cv2.resize(image, size, interpolation=cv2.INTER_AREA) if shrink > 1 else image
    steps = np.clip(np.rint((small - low) / step), 0, 255).astype(np.uint8)
    blurred = cv2.medianBlur(steps, max(3, (window_px // shrink) | 1))
    found = blurred.astype(np.float32) * np.float32(step) + np.float32(low)
    if shrink > 1:
        found = cv2.resize(found, (image.shape[1], image.shape[0]), interpolation=cv2.INTER_LINEAR)
    return np.asarray(found, np.float32)


def robust_deviation(contrast: Image, valid: Mask, least: float = 1e-6) -> float:
    """Standard deviation of an image about zero, by its median absolute value.

    Parameters
    ----------
    contrast
        (H, W).
    valid
        (H, W) bool.
    least
        What it is at least: of whole numbers `ROUNDING`, or even ground would have no noise at all.

    Returns
    -------
    float
        Of every fourth pixel in both directions.

    Examples
    --------
    >>> noise = np.random.default_rng(1).normal(0, 3, (400, 400)).astype(np.float32)
    >>> round(robust_deviation(noise, np.ones((400, 400), bool)))
    3
    """
    some = contrast[::4, ::4][valid[::4, ::4]]
    some = some if some.size else contrast[valid]
    return max(MAD * float(np.median(np.abs(some))), least)


def local_deviation(contrast: Image, valid: Mask, window_px: int, least: float = 1e-6) -> Image:
    """The same about each pixel, at least 0.7 of that of the whole image.

    Parameters
    ----------
    contrast, valid, least
        As for `robust_deviation`.
    window_px
        Side of the window, px.

    Returns
    -------
    (H, W) float32
    """
    everywhere = robust_deviation(contrast, valid, least)
    there = MAD * median_background(np.abs(contrast), window_px)
    return np.asarray(np.maximum(there, 0.7 * everywhere), np.float32)
