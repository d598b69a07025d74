"""OpenCV's decoder, without what it writes to the terminal."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray


def decode_image(data: bytes) -> NDArray[Any] | None:
    """Numbers of an image file, as OpenCV has them.

    Parameters
    ----------
    data
        All bytes of a file whose header was looked at (`wildlab.flight.readers.frames.headers`).

    Returns
    -------
    (H, W) or (H, W, C), blue first, or None
        None where it cannot be decoded.

    Examples
    --------
    >>> decode_image(b"no image") is None
    True
    """
    with quiet():
        try:
            found = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_UNCHANGED)
        except cv2.error:
            return None
    return None if found is None else np.asarray(found)


@contextmanager
def quiet() -> Iterator[None]:
    """While this lasts, OpenCV writes nothing to the terminal."""
    before = cv2.utils.logging.getLogLevel()
    cv2.utils.logging.setLogLevel(cv2.utils.logging.LOG_LEVEL_SILENT)
    try:
        yield
    finally:
        cv2.utils.logging.setLogLevel(before)
