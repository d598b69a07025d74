"""What a camera has and keeps, seen over a sequence: pixels that are dead or stuck, and dark corners."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from wildlab.flight.readers.frames.valid import MOVED, Mask

#: Fewest frames, and standard deviations by which a dead pixel lies off its neighbours in each of them.
FEWEST, FAR = 5, 8.0
#: A lens spreads a point over its neighbours, a dead pixel stands alone: by what share of its own distance
#: from the median the next of its eight neighbours may lie off, on the mean over the frames. A blur of 0.6 px
#: gives 0.25.
ALONE = 0.1
#: Constant pixels that chance alone may give, where constant ones are called dead.
CHANCE = 0.01
#: The most of the pixels that are dead: above it something else is seen.
MOST_DEAD = 0.01


def find_dead(images: Sequence[NDArray[Any]], valid: Mask) -> Mask | None:
    """Pixels that do not see the scene: constant while it moves, or far from their neighbours in each frame.

    Parameters
    ----------
    images
        Each (H, W), all alike; five or more, far enough apart in time for the scene to have moved.
    valid
        (H, W) bool: where all of them show the scene. Borders and burnt-in text stand still too.

    Returns
    -------
    (H, W) bool or None
        None where it cannot be told: too few images, or a camera that stands still.

    Notes
    -----
    A pixel is constant where no frame changes it though the typical one changes, if frames are enough for
    none to be so by chance. It is far where it lies on the same side of the median of the 5 x 5 about it in
    each frame, by `FAR` standard deviations (robust, of that difference over the frame) and more, and alone:
    a point seen through a lens is not.

    Examples
    --------
    >>> rng = np.random.default_rng(1)
    >>> images = [rng.normal(500, 9, (32, 32)).astype(np.float32) for _ in range(6)]
    >>> for image in images: image[4, 7] = 900
    >>> np.argwhere(find_dead(images, np.ones((32, 32), bool))).tolist()
    [[4, 7]]
    """
    if len(images) < FEWEST or not valid.any():
        return None
    change, moved = _change(images, valid)
    if not moved:
        return None
    sides = np.zeros(change.shape, np.int16)
    far, alone = np.zeros(change.shape, np.float32), np.zeros(change.shape, np.float32)
    for image in images:
        apart, beyond = _stand_out(_whole(image), valid)
        sides += np.sign(apart).astype(np.int16)
        far += apart
        alone += beyond
    # Gain control sets many pixels to black and white; only one that stands alone there is dead.
    constant = (change == 0) & (cv2.blur((change == 0).astype(np.float32), (3, 3)) < 0.5)
    if _by_chance(images, valid) > CHANCE:
        constant[:] = False
    stuck = (np.abs(sides) == len(images)) & (np.sign(far) * alone > (1 - ALONE) * np.abs(far))
    found = (constant | stuck) & valid
    return found if found.mean() <= MOST_DEAD else np.zeros(found.shape, bool)


def _by_chance(images: Sequence[NDArray[Any]], valid: Mask) -> float:
    """How many pixels would be constant without a fault: of few grey levels some happen to repeat."""
    same = float(np.mean([(image == images[0])[valid].mean() for image in images[1:]]))
    return float(valid.sum()) * same ** (len(images) - 1)


def _change(images: Sequence[NDArray[Any]], valid: Mask) -> tuple[NDArray[np.float32], bool]:
    """By how much each pixel changes (H, W), and whether the typical one does as a scene that moves."""

    def range_of(seen: Sequence[NDArray[np.float32]]) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
        return np.minimum.reduce(seen), np.maximum.reduce(seen)

    seen = [_whole(image) for image in images]
    # A level that drifts moves all pixels alike, and is no motion.
    low, high = range_of([image - np.float32(np.median(image[valid])) for image in seen])
    span = float(np.quantile(high[valid], 0.99) - np.quantile(low[valid], 0.01))
    moved = span > 0 and float(np.median((high - low)[valid])) >= MOVED * span
    low, high = range_of(seen)
    return high - low, moved


def _whole(image: NDArray[Any]) -> NDArray[np.float32]:
    seen = image.astype(np.float32)
    return np.nan_to_num(seen, nan=float(np.nanmedian(seen))) if image.dtype.kind == "f" else seen


def _stand_out(image: NDArray[np.float32], valid: Mask) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """(H, W) of how far off the median of the 5 x 5, 0 where not far, and off the next of the others."""
    apart = image - cv2.medianBlur(image, 5)
    sd = 1.4826 * float(np.median(np.abs(apart[valid])))
    apart[np.abs(apart) <= FAR * max(sd, 1e-6 * float(np.abs(image).max()) + 1e-12)] = 0
    ring = np.ones((3, 3), np.uint8)
    ring[1, 1] = 0
    # The corner of something sharp is far from the median too, but not from what is beside it.
    above, below = image - cv2.dilate(image, ring), image - cv2.erode(image, ring)
    return apart, np.where(apart > 0, above, below).astype(np.float32)


class Vignetting(NamedTuple):
    """How dark corners are: ``offset`` (H, W) of what the lens adds, zero in the middle.

    Attributes
    ----------
    offset
        (H, W), in the unit of the images; negative where corners are dark.
    corner, sd
        Of the corners, and the standard deviation of that mean over the images.
    images
        By how many.
    """

    offset: NDArray[np.float32]
    corner: float
    sd: float
    images: int


#: Rings into which the image is cut, and how many standard deviations a fall is measured by, at least.
RINGS, MEASURED = 24, 3.0


def measure_vignetting(images: Sequence[NDArray[Any]], valid: Mask) -> Vignetting | None:
    """What a lens adds towards the corners, from images of a scene that moves.

    Parameters
    ----------
    images
        Each (H, W), of one size and unit; five or more, far enough apart in time for the scene to differ.
    valid
        (H, W) bool.

    Returns
    -------
    Vignetting or None
        None where too few images agree that there is any, or the camera stands still: then what is seen of
        the scene cannot be told from what the lens does.

    Notes
    -----
    Each image gives medians of rings about its middle, less that of the inner ones: warm bodies do not move
    a median, and the scene is another in each. ``a r^2 + b r^4`` is fitted to their mean over images, each
    ring weighed by its pixels. It is measured where the corner's fall is `MEASURED` standard deviations of
    its mean over the images. A slope across the image is no vignetting and stays.

    Examples
    --------
    >>> rng = np.random.default_rng(1)
    >>> v, u = np.mgrid[-1:1:48j, -1:1:48j]
    >>> images = [rng.normal(900, 5, (48, 48)) - 20 * (u**2 + v**2) for _ in range(6)]
    >>> found = measure_vignetting(images, np.ones((48, 48), bool))
    >>> bool(abs(found.corner + 40) < 2)
    True
    """
    if len(images) < FEWEST or not valid.any():
        return None
    if not _change(images, valid)[1]:
        return None
    rows, columns = valid.shape
    v, u = np.ogrid[:rows, :columns]
    half = np.array([(rows - 1) / 2, (columns - 1) / 2])
    square = ((v - half[0]) ** 2 + (u - half[1]) ** 2) / max(float((half**2).sum()), 1.0)
    # Rings of one area: of r^2 evenly.
    ring = np.minimum((square * RINGS).astype(int), RINGS - 1)
    inside = [np.flatnonzero(valid & (ring == number)) for number in range(RINGS)]
    enough = [number for number, pixels in enumerate(inside) if len(pixels) >= 16]
    if len(enough) < RINGS // 2:
        return None
    at = np.array([square.ravel()[inside[number]].mean() for number in enough])
    weight = np.sqrt([len(inside[number]) for number in enough])
    falls = []
    for image in images:
        flat = image.ravel().astype(float)
        falls.append([np.nanmedian(flat[inside[number]]) for number in enough])
    design = np.stack([np.ones(len(at)), at, at**2], axis=1) * weight[:, None]
    fits, *_ = np.linalg.lstsq(design, (np.array(falls) * weight).T, rcond=None)
    corners = fits[1] + fits[2]
    corner, sd = float(corners.mean()), float(corners.std(ddof=1) / np.sqrt(len(images)))
    if not abs(corner) > MEASURED * sd:
        return None
    a, b = fits[1:].mean(axis=1)
    return Vignetting((a * square + b * square**2).astype(np.float32), corner, sd, len(images))


def without_vignetting(image: NDArray[Any], offset: NDArray[np.float32]) -> NDArray[Any]:
    """An image less what the lens adds, in its own kind of numbers.

    Parameters
    ----------
    image
        (H, W) uint8, uint16 or float.
    offset
        (H, W) as `Vignetting` has it.

    Returns
    -------
    (H, W)
        Whole numbers are rounded, and stay within what their kind can hold.
    """
    even = image.astype(np.float32) - offset
    if image.dtype.kind == "f":
        return np.asarray(even, image.dtype)
    limits = np.iinfo(image.dtype)
    return np.asarray(np.clip(np.rint(even), limits.min, limits.max).astype(image.dtype))
