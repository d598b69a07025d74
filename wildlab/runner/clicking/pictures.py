"""Images as a browser can show them: PNG, those of 16 bits and thermal ones stretched."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from wildlab.flight.readers.frames.image import read_image

#: Shares of the pixels, %, that are black and white where an image is stretched.
DARK, BRIGHT = 0.5, 99.8


def picture_of(path: Path) -> bytes | str:
    """An image file as PNG, with the pixels that it has, or a sentence that says why not.

    Parameters
    ----------
    path
        Of the file.

    Returns
    -------
    bytes or str
        Pixels stand as they are stored: what a file says of turning it is not obeyed.
    """
    frame = read_image(path)
    if not frame.usable:
        return frame.problem
    image = frame.image if frame.unit in ("grey", "colour") else stretched(frame.image)
    if image.ndim == 3:
        image = np.ascontiguousarray(image[..., ::-1])
    done, packed = cv2.imencode(".png", image, [cv2.IMWRITE_PNG_COMPRESSION, 1])
    return packed.tobytes() if done else "It cannot be shown."


def stretched(image: NDArray[Any]) -> NDArray[np.uint8]:
    """Counts or temperatures as grey levels.

    Parameters
    ----------
    image
        (H, W), NaN where nothing is known.

    Returns
    -------
    (H, W) uint8
        Black to white from the 0.5th to the 99.8th percentile.

    Examples
    --------
    >>> stretched(np.arange(1000, 1500, dtype=np.uint16).reshape(20, 25))[[0, -1], [0, -1]].tolist()
    [0, 255]
    """
    numbers = image.astype(np.float32)
    known = numbers[np.isfinite(numbers)]
    if not known.size:
        return np.zeros(image.shape, np.uint8)
    low, high = np.percentile(known, [DARK, BRIGHT])
    scaled = (numbers - low) / max(float(high - low), 1e-6)
    return np.asarray(np.nan_to_num(np.clip(scaled, 0, 1) * 255).round(), np.uint8)
