"""Warm animals as F finds them (F 3.2, 7.4, 8.1.1, 8.4): grey, background off, threshold, contours."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Literal

import cv2
import numpy as np
from numpy.typing import NDArray

from wildlab.detection.contrast import fill_invalid
from wildlab.detection.detections import PART, Detections, describe, no_detections, remove_near
from wildlab.errors import WildlabError, above_zero
from wildlab.geometry.frames import Array, Mask

Grey = NDArray[np.uint8]
#: The most contours of one image that are looked at further.
MOST_CONTOURS = 5000


@dataclass(frozen=True)
class Warm:
    """Thresholds of F's chain.

    Attributes
    ----------
    background
        ``enhance`` is the thermal enhancement F (3.2), ``mean`` the background subtraction F (3.3),
        ``median`` the same with the median, which many animals do not bias (F 8.1.1); ``none`` leaves the
        grey image.
    threshold
        ``constant``, or ``adaptive``: about each pixel.
    level
        0 to 255. F prints 150 for a constant threshold, 65 and 160 for adaptive ones.
    level_is
        What the level is of an adaptive threshold; F does not say it. ``floor``: a pixel is above the mean
        of its block, and above the level. ``offset``: it is that much above the mean.
    block_px
        Side of the block, px, odd. F prints 51, 251 and 451; `block_from_distance` gives one.
    smallest_px, largest_px
        Limits of the area inside a contour, px^2; `gate_from_distance` gives them.
    apart_px
        Of detections nearer than this one stays (`wildlab.detection.detections`); 0 for all.
    hottest
        What the mean of a detection is at most, in the unit of the image (F 8.4).
    window
        Brightness and contrast (F 3.1): what becomes black and white, in the unit of the image. None takes
        the 0.1 and 99.9 per cent of an image that is not 8-bit.
    warm_is_bright
        False for black-hot images.
    part
        How far the middle of an animal is from that of what is warm of it
        (`wildlab.detection.detections.describe`).
    """

    background: Literal["none", "enhance", "mean", "median"] = "median"
    threshold: Literal["constant", "adaptive"] = "constant"
    level: float = 65.0
    level_is: Literal["floor", "offset"] = "floor"
    block_px: int = 251
    smallest_px: float = 12.0
    largest_px: float = 1500.0
    apart_px: float = 10.0
    hottest: float = float("inf")
    window: tuple[float, float] | None = None
    warm_is_bright: bool = True
    part: float = PART

    def __post_init__(self) -> None:
        if self.block_px < 3 or self.block_px % 2 == 0:
            raise WildlabError(
                f"a block of {self.block_px} px has no pixel in its middle", "give an odd number from 3"
            )


def to_grey(image: NDArray[Any], window: tuple[float, float] | None = None) -> Grey:
    """An image of any kind in 256 grey levels.

    Parameters
    ----------
    image
        (H, W), or (H, W, 3) red, green and blue, F (3.1).
    window
        What becomes black and what white (F 3.1). None leaves 8-bit images as they are, and takes the 0.1
        and 99.9 per cent of others.

    Returns
    -------
    (H, W) uint8

    Examples
    --------
    >>> to_grey(np.array([[[255, 0, 0], [0, 255, 0]]], np.uint8)).tolist()
    [[76, 150]]
    """
    plain = image
    if image.ndim == 3:
        # As OpenCV does it, whose function F names.
        plain = np.asarray(cv2.cvtColor(np.ascontiguousarray(image), cv2.COLOR_RGB2GRAY))
    if window is None and plain.dtype == np.uint8:
        return plain
    if window is None:
        some = plain[::4, ::4] if min(plain.shape) > 64 else plain
        low, high = np.nanpercentile(some, [0.1, 99.9])
    else:
        low, high = window
    scale = 255 / max(float(high - low), 1e-9)
    return np.asarray(cv2.convertScaleAbs(np.clip((plain.astype(np.float32) - low) * scale, 0, 255)))


def enhance(grey: Grey) -> Grey:
    """Thermal enhancement, F (3.2); what is below black is black.

    Parameters
    ----------
    grey
        (H, W).

    Returns
    -------
    (H, W) uint8

    Examples
    --------
    >>> enhance(np.array([[10, 150, 200]], np.uint8)).tolist()
    [[0, 100, 200]]
    """
    return np.asarray(cv2.convertScaleAbs(np.maximum(2 * grey.astype(np.int16) - int(grey.max()), 0)))


def subtract_background(grey: Grey, valid: Mask, by: Literal["mean", "median"]) -> Grey:
    """Background subtraction, F (3.3), by the mean of the image, or its median (F 8.1.1).

    Parameters
    ----------
    grey
        (H, W).
    valid
        (H, W) bool: whose mean it is.
    by
        Which of the two.

    Returns
    -------
    (H, W) uint8
        What is below black is black.

    Examples
    --------
    >>> subtract_background(np.array([[10, 10, 100]], np.uint8), np.ones((1, 3), bool), "median").tolist()
    [[0, 0, 90]]
    """
    # A histogram has it all, and is quicker than sorting.
    counts = cv2.calcHist([grey], [0], valid.astype(np.uint8), [256], [0, 256]).ravel().astype(float)
    total = counts.cumsum()
    level = counts @ np.arange(256) / total[-1] if by == "mean" else np.searchsorted(total, total[-1] / 2)
    return np.asarray(cv2.subtract(grey, np.full_like(grey, round(float(level)))))


def block_from_distance(distance_m: float, focal_px: float, animal_m: float = 2.5, times: float = 6.0) -> int:
    """Side of the block of an adaptive threshold from the distance to the ground (F 8.1.1, 8.4).

    Parameters
    ----------
    distance_m
        From the camera to the ground along the middle of the image, m.
    focal_px
        Focal length, px.
    animal_m
        Length of the animal, m; a rhinoceros has 3.5, an antelope 1.5.
    times
        How many animals long the block is. Chosen: about F's 251 px for animals of some 40 px.

    Returns
    -------
    int
        px, odd, at least 3.

    Raises
    ------
    WildlabError
        Where a length is not above zero.

    Examples
    --------
    >>> block_from_distance(60.0, 1000.0), block_from_distance(120.0, 1000.0)
    (251, 125)
    """
    above_zero(distance_m=distance_m, focal_px=focal_px, animal_m=animal_m, times=times)
    return max(3, int(times * animal_m * focal_px / distance_m) | 1)


def gate_from_distance(
    distance_m: float, focal_px: float, smallest_m2: float = 0.1, largest_m2: float = 8.0
) -> tuple[float, float]:
    """Limits of the area in the image from those on the ground (F 3.2).

    Parameters
    ----------
    distance_m, focal_px
        As for `block_from_distance`.
    smallest_m2, largest_m2
        Area that is seen of an animal, m^2.

    Returns
    -------
    (smallest, largest), px^2

    Raises
    ------
    WildlabError
        Where a number is not above zero.

    Examples
    --------
    >>> gate_from_distance(100.0, 1000.0, 0.5, 4.0)
    (50.0, 400.0)
    """
    above_zero(distance_m=distance_m, focal_px=focal_px, smallest_m2=smallest_m2)
    if not smallest_m2 < largest_m2:
        raise WildlabError(f"largest_m2 is {largest_m2}", "give more than smallest_m2", field="largest_m2")
    per_m2 = (focal_px / distance_m) ** 2
    return smallest_m2 * per_m2, largest_m2 * per_m2


def find_warm(image: NDArray[Any], valid: Mask, thresholds: Warm | None = None) -> Detections:
    """Animals warmer than the ground, as F finds them.

    Parameters
    ----------
    image
        (H, W) grey levels, counts or K, or (H, W, 3) red, green, blue.
    valid
        (H, W) bool: where there is a scene.
    thresholds
        None takes the defaults.

    Returns
    -------
    Detections
        The score is the largest grey level of a detection above the threshold.

    Raises
    ------
    WildlabError
        Where nothing is valid, or the shapes are not alike.

    Examples
    --------
    >>> image = np.full((120, 160), 100, np.uint8)
    >>> image[60:66, 40:50] = 200
    >>> find_warm(image, np.ones((120, 160), bool)).uv.tolist()
    [[44.5, 62.5]]
    """
    t = thresholds or Warm()
    measured = image if image.ndim == 2 else to_grey(image)
    grey = to_grey(measured, t.window)
    if not valid.all() or grey.shape != valid.shape:
        grey = fill_invalid(grey, valid).astype(np.uint8)
    if not t.warm_is_bright:
        grey = np.asarray(255 - grey)
    if t.background == "enhance":
        grey = enhance(grey)
    elif t.background != "none":
        grey = subtract_background(grey, valid, t.background)
    above = grey_above(grey, t)
    above[~valid] = 0
    labels, excess = _contours(above, grey, t)
    if not labels.any():
        return no_detections()
    noise = _noise(grey, valid)
    found = describe(labels, measured, valid, contrast=grey, noise=noise, part=t.part, score=excess)
    found = found.select(found.intensity <= t.hottest)
    return remove_near(found, t.apart_px)


def grey_above(grey: Grey, t: Warm) -> Grey:
    """1 where a pixel is above the threshold, else 0 (F 3.2.4, 3.2.5).

    Parameters
    ----------
    grey
        (H, W) without its background.
    t
        Thresholds.

    Returns
    -------
    (H, W) uint8
    """
    if t.threshold == "constant":
        return np.asarray(cv2.threshold(grey, t.level, 1, cv2.THRESH_BINARY)[1], np.uint8)
    mean = np.asarray(cv2.blur(grey, (t.block_px, t.block_px), borderType=cv2.BORDER_REPLICATE), np.uint8)
    if t.level_is == "offset":
        over = np.asarray(cv2.subtract(grey, mean), np.uint8)
        return np.asarray(cv2.threshold(over, t.level, 1, cv2.THRESH_BINARY)[1], np.uint8)
    return ((grey > mean) & (grey > t.level)).astype(np.uint8)


def _contours(above: Grey, grey: Grey, t: Warm) -> tuple[NDArray[np.int32], Array]:
    """Labels (H, W) of what lies inside outer contours of sufficient size, and their largest excess."""
    outlines, _ = cv2.findContours(above, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)
    labels = np.zeros(above.shape, np.int32)
    excess: list[float] = []
    # A contour's polygon runs through the middles of pixels: half of them are outside of it.
    areas = [cv2.contourArea(one) + len(one) / 2 + 1 for one in outlines]
    good = [row for row, area in enumerate(areas) if t.smallest_px <= area <= t.largest_px]
    for row in sorted(good, key=lambda one: -areas[one])[:MOST_CONTOURS]:
        cv2.drawContours(labels, outlines, row, len(excess) + 1, cv2.FILLED)
        left, top, width, height = cv2.boundingRect(outlines[row])
        part = np.s_[top : top + height, left : left + width]
        own = labels[part] == len(excess) + 1
        excess.append(float(grey[part][own].max()) - t.level)
    return labels, np.array(excess)


def _noise(grey: Grey, valid: Mask) -> float:
    """Standard deviation of neighbouring pixels' differences over root two, by the median."""
    across = np.abs(np.diff(grey[::16].astype(np.int16), axis=1))
    pairs = across[valid[::16, 1:] & valid[::16, :-1]]
    return max(1.4826 * float(np.median(pairs)) / np.sqrt(2), 0.5) if pairs.size else 0.5
