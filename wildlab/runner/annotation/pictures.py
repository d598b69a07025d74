"""Images as a browser can show them, those of 16 bits and thermal ones stretched."""

from __future__ import annotations

from pathlib import Path
from typing import Any, NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from wildlab.errors import WildlabError
from wildlab.flight.files import read_regular
from wildlab.flight.readers.frames.image import MOST_BYTES, decode

#: Shares of the pixels, %, that are black and white where an image is stretched.
DARK, BRIGHT = 0.5, 99.8
#: Colour images with more pixels are sent as JPEG, which takes a twentieth of the time.
MOST_EXACT = 4_000_000
QUALITY = 95


class Picture(NamedTuple):
    """Bytes of a picture and their kind, as browsers call it."""

    data: bytes
    kind: str


def picture_of(path: Path) -> Picture | str:
    """An image file as a picture with the pixels that it has, or a sentence that says why not.

    Parameters
    ----------
    path
        Of the file.

    Returns
    -------
    Picture or str
        Pixels stand as they are stored: what a file says of turning it is not obeyed.
    """
    try:
        found = decode(read_regular(path, MOST_BYTES))
    except FileNotFoundError:
        found = "there is no such file any more"
    except WildlabError as error:
        found = f"it {error.problem}"
    if isinstance(found, str):
        return f"This image cannot be shown: {found}."
    image, unit, _ = found
    if unit not in ("grey", "colour"):
        image = stretched(image)
    if image.ndim == 3:
        image = np.ascontiguousarray(image[..., ::-1])
    if image.ndim == 3 and image.shape[0] * image.shape[1] > MOST_EXACT:
        done, packed = cv2.imencode(".jpg", image, [cv2.IMWRITE_JPEG_QUALITY, QUALITY])
        kind = "image/jpeg"
    else:
        done, packed = cv2.imencode(".png", image, [cv2.IMWRITE_PNG_COMPRESSION, 1])
        kind = "image/png"
    return Picture(packed.tobytes(), kind) if done else "This image cannot be shown."


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
