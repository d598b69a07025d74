"""Frames that a thermal camera gives while it corrects itself: a closed shutter, or a picture that is held.

During a flat-field correction (FFC) some cameras show the closed shutter, others go on with the last picture.
A closed shutter has noise and nothing else: means over blocks differ no more than those of independent
pixels, and nothing small stands out. A held picture repeats to the last bit, which a camera with noise does
not do by itself. In compressed video of a camera that stands still whole pictures repeat though nothing is
held; there it cannot be told, and is not. Nor is a shutter whose picture is shaded.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from wildlab.flight.readers.frames.frame import Frame, spoilt

#: Side of the blocks, px, and the most that the variance of their means may be over that of independent
#: pixels. Closed shutters give 0.8 to 1.3 (also after gain control and JPEG); the 1310 real frames at hand
#: 106 and more; an even sea under the vignetting of a lens 180 and more.
BLOCK, MOST_RATIO, FEWEST = 16, 2.0, 16
#: The same in a sample of every fourth row and column, where those real frames still give 5 and more.
SAMPLED, SAMPLED_RATIO = 4, 3.0
#: px: side of the squares whose mean may lie off by so many standard deviations of independent pixels, and to
#: how many a single pixel counts. A dead pixel moves such a mean by one, a warm body of 3 px by nine.
SMALL, STANDS_OUT, CLIPPED_AT = 5, 7.0, 5.0
#: Frames alike, one after another, from which on a picture is held: where frames are shown twice to fill up a
#: frame rate, there are fewer. And the share of neighbouring frames that may be alike for it to be told.
HELD, MOST_ALIKE = 3, 0.25
#: What the problems of such frames have in them.
CORRECTIONS = ("flat-field correction", "picture is held")


def is_shutter(image: NDArray[Any], valid: NDArray[np.bool_]) -> bool:
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
        False where there are fewer blocks than `FEWEST` to judge by.

    Examples
    --------
    >>> noise = np.random.default_rng(1).normal(7000, 2, (96, 128))
    >>> slope = noise + np.arange(128)
    >>> [is_shutter(one, np.ones((96, 128), bool)) for one in (noise, slope)]
    [True, False]
    """
    grey = image if image.ndim == 2 else image[..., 1]
    # A sample rules out nearly all images, at a tenth of the time.
    few = (slice(None, None, SAMPLED), slice(None, None, SAMPLED))
    if not _is_even(grey[few], valid[few], BLOCK // SAMPLED, SAMPLED_RATIO):
        return False
    return _is_even(grey, valid, BLOCK, MOST_RATIO)


def _is_even(image: NDArray[Any], valid: NDArray[np.bool_], side: int, most_ratio: float) -> bool:
    rows, columns = (length // side for length in image.shape)
    if rows * columns < FEWEST:
        return False
    cut = (slice(rows * side), slice(columns * side))
    grey, valid = image[cut].astype(np.float32), valid[cut]
    whole = cv2.resize(valid.astype(np.float32), (columns, rows), interpolation=cv2.INTER_AREA) == 1
    if whole.sum() < FEWEST:
        return False
    middle = float(np.median(grey[valid]))
    sd = 1.4826 * float(np.median(np.abs(grey[valid] - middle))) or float(grey[valid].std())
    grey = np.clip(np.where(valid, grey, middle) - middle, -CLIPPED_AT * sd, CLIPPED_AT * sd)
    means = cv2.resize(grey, (columns, rows), interpolation=cv2.INTER_AREA)[whole]
    squares = cv2.resize(grey * grey, (columns, rows), interpolation=cv2.INTER_AREA)[whole]
    inside = float(np.mean(squares - means**2))
    if inside <= 0 or means.var() >= most_ratio * inside / side**2:
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


def mark_shutter(frames: Iterable[Frame], held_can_be_told: bool) -> Iterator[Frame]:
    """Frames in their order; those of a shutter with a problem in place of their image.

    Parameters
    ----------
    frames
        Of one camera, one after another.
    held_can_be_told
        Whether neighbouring frames of this camera differ as a rule.

    Yields
    ------
    Frame
        From the third one alike on, a picture is held; the first two of them stay.
    """
    before: NDArray[Any] | None = None
    run = 1
    for frame in frames:
        if not frame.usable:
            yield frame
            continue
        run = run + 1 if before is not None and are_alike(before, frame.image) else 1
        before = frame.image
        if is_shutter(frame.image, frame.valid):
            said = "the shutter is closed: it shows noise and nothing else (flat-field correction)"
            yield spoilt(frame.name, said, frame.time)
        elif held_can_be_told and run >= HELD:
            said = f"its picture is held: it repeats the {HELD - 1} frames before it to the last bit"
            yield spoilt(frame.name, said, frame.time)
        else:
            yield frame
