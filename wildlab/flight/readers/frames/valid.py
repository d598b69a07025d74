"""Which pixels of a frame show the scene: no letterbox or curved border, no burnt-in text."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

Mask = NDArray[np.bool_]

#: Grey levels by which JPEG makes an empty border uneven.
JPEG_UNEVEN = 4
#: px that are taken off beside a border, where compression and interpolation mix it with the scene.
BESIDE = 3
#: Smallest share of the image that is a border, and that is a clipped area: a warm animal may be clipped too.
SMALLEST_BORDER, SMALLEST_CLIPPED = 0.002, 0.02
#: Share of a side of the image that a border lies along, unless it reaches into a corner.
ALONG = 0.2
#: Overlays: how much a pixel may change from frame to frame, what the median pixel must change by at least,
#: both as shares of the range of the numbers, and the most of the image that text covers.
STILL, MOVED, MOST_TEXT = 0.012, 0.03, 0.25
#: Share of the 7 x 7 pixels about one of an overlay that belong to it, at least.
DENSE = 3 / 49


def find_no_data(image: NDArray[Any]) -> Mask:
    """Where an image is empty: a flat black region along its sides or in a corner, or numbers that are none.

    Parameters
    ----------
    image
        (H, W) or (H, W, 3).

    Returns
    -------
    (H, W) bool
        True where there is no scene. Letterboxes, and the curved borders that undistortion leaves.

    Examples
    --------
    >>> image = np.full((40, 60), 90, np.uint8)
    >>> image[:8] = 0
    >>> int(find_no_data(image)[:, 0].sum())
    11
    """
    grey = image if image.ndim == 2 else image.max(axis=2)
    none = ~np.isfinite(grey) if grey.dtype.kind == "f" else np.zeros(grey.shape, bool)
    if none.all() or not grey.size:
        return none
    lowest = grey[~none].min()
    unevenness = JPEG_UNEVEN if grey.dtype == np.uint8 else 0
    # Where the darkest of the picture is bright there is nothing black in it.
    flat = grey <= lowest + unevenness if lowest <= unevenness else np.zeros(grey.shape, bool)
    flat |= none
    opened = cv2.morphologyEx(flat.astype(np.uint8), cv2.MORPH_OPEN, np.ones((3, 3), np.uint8))
    count, labels, stats, _ = cv2.connectedComponentsWithStats(opened, connectivity=4)
    large = stats[:, cv2.CC_STAT_AREA] >= SMALLEST_BORDER * grey.size
    chosen = np.zeros(count, bool)
    for side in (labels[0], labels[-1], labels[:, 0], labels[:, -1]):
        chosen |= np.bincount(side, minlength=count) >= ALONG * len(side)
        chosen[[side[0], side[-1]]] = True
    chosen[0] = False
    return none | _wider((chosen & large)[labels], BESIDE)


def find_clipped(image: NDArray[Any]) -> Mask:
    """Large areas at the highest number that an image can hold: nothing can be told apart in them.

    Parameters
    ----------
    image
        (H, W) of whole numbers; others clip nowhere.

    Returns
    -------
    (H, W) bool
        True inside areas of `SMALLEST_CLIPPED` of the image and more.

    Examples
    --------
    >>> sky = np.zeros((40, 60), np.uint8)
    >>> sky[30:] = 255
    >>> sky[3:6, 3:6] = 255
    >>> bool(find_clipped(sky)[35, 5]), bool(find_clipped(sky)[4, 4])
    (True, False)
    """
    if image.ndim != 2 or image.dtype.kind != "u":
        return np.zeros(image.shape[:2], bool)
    at_top = (image >= np.iinfo(image.dtype).max - (2 if image.dtype == np.uint8 else 0)).astype(np.uint8)
    if at_top.mean() < SMALLEST_CLIPPED:
        return np.zeros(image.shape, bool)
    _, labels, stats, _ = cv2.connectedComponentsWithStats(at_top, connectivity=8)
    large = stats[:, cv2.CC_STAT_AREA] >= SMALLEST_CLIPPED * image.size
    large[0] = False
    return _wider(large[labels], BESIDE)


def find_overlay(images: Sequence[NDArray[Any]]) -> Mask | None:
    """Text and marks that a camera burns into its pictures: what stays while the scene moves.

    Parameters
    ----------
    images
        Each (H, W), all alike; five or more, far enough apart in time for the scene to have moved.

    Returns
    -------
    (H, W) bool or None
        None where it cannot be told: too few images, or a camera that stands still.

    Notes
    -----
    Inside an overlay a pixel is extreme or beside something that is, so that a dull spot that happens to
    keep its value is not taken for text.
    """
    if len(images) < 5:
        return None
    stack = np.stack([image.astype(np.float32) for image in images])
    low, high = stack.min(axis=0), stack.max(axis=0)
    span = float(np.nanmax(high) - np.nanmin(low))
    change = high - low
    if span <= 0 or float(np.nanmedian(change)) < MOVED * span:
        return None
    middle = np.median(stack, axis=0)
    apart = np.abs(middle - cv2.medianBlur(_as_bytes(middle), 31).astype(np.float32) * span / 255 - low.min())
    still = (change <= STILL * span) & (apart > 0.2 * span)
    # Strokes lie beside strokes: single pixels that noise happens to leave alone are none.
    still &= cv2.blur(still.astype(np.float32), (7, 7)) >= DENSE - 1e-6
    # Letters are thin and lie close together: what is between them belongs to them.
    marks = cv2.morphologyEx(still.astype(np.uint8), cv2.MORPH_CLOSE, np.ones((7, 7), np.uint8)) > 0
    return _wider(marks, BESIDE) if 0 < marks.mean() < MOST_TEXT else np.zeros(marks.shape, bool)


def _as_bytes(image: NDArray[np.float32]) -> NDArray[np.uint8]:
    low, high = float(image.min()), float(image.max())
    return np.asarray((image - low) * (255 / max(high - low, 1e-9)), np.uint8)


def _wider(mask: Mask, by: int) -> Mask:
    if not mask.any():
        return mask
    return cv2.dilate(mask.astype(np.uint8), np.ones((2 * by + 1, 2 * by + 1), np.uint8)) > 0


def problem_of(image: NDArray[Any], valid: Mask) -> str:
    """Why a picture shows nothing, as a clause; "" where it does.

    Parameters
    ----------
    image
        (H, W) or (H, W, 3).
    valid
        (H, W) bool.

    Returns
    -------
    str

    Examples
    --------
    >>> problem_of(np.zeros((4, 4), np.uint8), np.ones((4, 4), bool))
    'every pixel has the value 0: a covered lens, or an empty picture'
    """
    if not image.size:
        return "the picture has no pixels"
    low, high = image.min(), image.max()
    if image.dtype.kind == "f" and not np.isfinite(image).any():
        return "no pixel has a number"
    if low == high:
        return f"every pixel has the value {low:g}: a covered lens, or an empty picture"
    if image.ndim == 2 and image.dtype.kind == "u":
        top = np.iinfo(image.dtype).max - (2 if image.dtype == np.uint8 else 0)
        share = float((image >= top).mean())
        if share > 0.5:
            return f"{share:.0%} of the pixels are at the highest value: the picture is saturated"
    return "" if valid.any() else "no pixel shows the scene: all are border, overlay or clipped"
