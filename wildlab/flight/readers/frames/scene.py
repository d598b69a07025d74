"""Which pixels of a frame show the scene, and which frames do.

Not the scene are letterboxes and curved borders, burnt-in text, pixels that are dead or stuck, and the
frames that a thermal camera gives while it corrects itself (FFC): some cameras show the closed shutter,
others go on with the last picture. A closed shutter has noise and nothing else: means over blocks differ no
more than those of independent pixels, and nothing small stands out. A held picture repeats to the last bit,
which a camera with noise does not do by itself. In compressed video of a camera that stands still whole
pictures repeat though nothing is held; there it cannot be told, and is not. Nor is a shutter whose picture
is shaded.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from wildlab.geometry.frames import Mask

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
    return none | _wider((chosen & large)[labels])


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
    return _wider(large[labels])


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
    apart = np.abs(middle - cv2.medianBlur(middle.astype(np.uint8), 31))
    still = (change <= STILL * span) & (apart > 0.2 * span)
    # Strokes lie beside strokes: single pixels that noise happens to leave alone are none.
    still &= cv2.blur(still.astype(np.float32), (7, 7)) >= DENSE - 1e-6
    # Letters are thin and lie close together: what is between them belongs to them.
    marks = cv2.morphologyEx(still.astype(np.uint8), cv2.MORPH_CLOSE, np.ones((7, 7), np.uint8)) > 0
    return _wider(marks) if 0 < marks.mean() < MOST_TEXT else np.zeros(marks.shape, bool)


def _wider(mask: Mask) -> Mask:
    if not mask.any():
        return mask
    return cv2.dilate(mask.astype(np.uint8), np.ones((2 * BESIDE + 1, 2 * BESIDE + 1), np.uint8)) > 0


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
            return f"{share:.0%} of the pixels are saturated"
    return "" if valid.any() else "no pixel shows the scene"


# -- shutters

#: Side of the blocks, px, and the most that the variance of their means may be over that of independent
#: pixels. Closed shutters give 0.8 to 1.3 (also after gain control and JPEG); the 1310 real frames at hand
#: 106 and more; an even sea under the vignetting of a lens 180 and more.
BLOCK, MOST_RATIO, FEWEST_BLOCKS = 16, 2.0, 16
#: px: side of the squares whose mean may lie off by so many standard deviations of independent pixels, and to
#: how many a single pixel counts. A dead pixel moves such a mean by one, a warm body of 3 px by nine.
SMALL, STANDS_OUT, CLIPPED_AT = 5, 7.0, 5.0
#: Frames alike, one after another, from which on a picture is held: where frames are shown twice to fill up a
#: frame rate, there are fewer. And the share of neighbouring frames that may be alike for it to be told.
HELD, MOST_ALIKE = 3, 0.25


def is_shutter(image: NDArray[Any], valid: Mask) -> bool:
    """Whether an image has noise and nothing else, as that of a closed shutter.

    Parameters
    ----------
    image
        (H, W) or (H, W, 3).
    valid
        (H, W) bool.

    Returns
    -------
    bool
        False where there are fewer blocks than `FEWEST_BLOCKS` to judge by.

    Examples
    --------
    >>> noise = np.random.default_rng(1).normal(7000, 2, (96, 128))
    >>> slope = noise + np.arange(128)
    >>> [is_shutter(one, np.ones((96, 128), bool)) for one in (noise, slope)]
    [True, False]
    """
    grey = image if image.ndim == 2 else image[..., 1]
    rows, columns = (length // BLOCK for length in grey.shape)
    if rows * columns < FEWEST_BLOCKS:
        return False
    cut = (slice(rows * BLOCK), slice(columns * BLOCK))
    grey, valid = grey[cut].astype(np.float32), valid[cut]
    whole = cv2.resize(valid.astype(np.float32), (columns, rows), interpolation=cv2.INTER_AREA) == 1
    if whole.sum() < FEWEST_BLOCKS:
        return False
    middle = float(np.median(grey[valid]))
    sd = 1.4826 * float(np.median(np.abs(grey[valid] - middle))) or float(grey[valid].std())
    grey = np.clip(np.where(valid, grey, middle) - middle, -CLIPPED_AT * sd, CLIPPED_AT * sd)
    means = cv2.resize(grey, (columns, rows), interpolation=cv2.INTER_AREA)[whole]
    squares = cv2.resize(grey * grey, (columns, rows), interpolation=cv2.INTER_AREA)[whole]
    inside = float(np.mean(squares - means**2))
    if inside <= 0 or means.var() >= MOST_RATIO * inside / BLOCK**2:
        return False
    return bool(np.abs(cv2.blur(grey, (SMALL, SMALL))).max() < STANDS_OUT * np.sqrt(inside) / SMALL)


def are_alike(one: NDArray[Any], other: NDArray[Any]) -> bool:
    """Whether two images are the same to the last bit.

    Parameters
    ----------
    one, other
        Of any kind.

    Returns
    -------
    bool
    """
    if one.shape != other.shape or one.dtype != other.dtype:
        return False
    few = (slice(None, None, 16), slice(None, None, 16))
    missing = one.dtype.kind == "f"
    return all(np.array_equal(a, b, equal_nan=missing) for a, b in ((one[few], other[few]), (one, other)))


# -- pixels over a sequence

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
    ring = np.where(valid, np.minimum((square * RINGS).astype(int), RINGS - 1), RINGS)
    pixels = np.bincount(ring.ravel(), minlength=RINGS)[:RINGS]
    enough = np.flatnonzero(pixels >= 16)
    if len(enough) < RINGS // 2:
        return None
    at, weight = ndimage.mean(square, ring, enough), np.sqrt(pixels[enough])
    falls = [ndimage.median(image, ring, enough) for image in images]
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
