"""DJI's own thermal JPEGs: raw numbers of the sensor in APP3 segments.

Known of them is (exiftool's tables of JPEG and DJI tags): APP3 holds raw thermal data, APP4 parameters, APP5
a calibration. The raw data are 16 bits for each pixel and grow with warmth. How they become temperatures
differs from camera to camera and is known to DJI's own program library alone, which is not open. Cameras of
DJI with a sensor of FLIR (XT, XT2) write FLIR's records instead: `wildlab.flight.readers.frames.flir`.
"""

from __future__ import annotations

import struct

import numpy as np
from numpy.typing import NDArray

from wildlab.flight.readers.frames.flir import smoother_order

#: What is said of such a file.
AS_COUNTS = (
    "DJI's own thermal data (APP3) are read as counts: how they become temperatures is known to DJI's "
    "program library alone, which is not open; the preview picture is not used"
)
AS_PREVIEW = (
    "DJI's own thermal data (APP3) have another size than the picture and are not read, and DJI's program "
    "library for them is not open: the preview picture is used, with its own gain and palette"
)
#: The fewest bytes of APP3 that are taken for an image: others keep small notes there.
LEAST = 4096


def read_dji(data: bytes, width: int, height: int) -> tuple[NDArray[np.uint16] | None, str]:
    """Raw numbers of DJI's sensor out of a JPEG, and what is to be said.

    Parameters
    ----------
    data
        All bytes of the JPEG.
    width, height
        Of its picture, px.

    Returns
    -------
    counts, note
        (H, W) uint16, or None where there are none of the picture's size; the note is "" where the file has
        no thermal data of DJI at all.

    Examples
    --------
    >>> read_dji(b"no JPEG", 8, 8)
    (None, '')
    """
    parts, named, at = [], False, 2
    while at + 4 <= len(data) and data[at] == 0xFF and data[at + 1] != 0xDA:
        (length,) = struct.unpack_from(">H", data, at + 2)
        body = data[at + 4 : at + 2 + length]
        if data[at + 1] == 0xE3:
            parts.append(body)
        elif data[at + 1] == 0xE1:
            named = named or b"DJI" in body or b"drone-dji" in body
        at += 2 + max(length, 2)
    raw = b"".join(parts)
    if not named or len(raw) < LEAST:
        return None, ""
    if len(raw) != 2 * width * height:
        return None, AS_PREVIEW
    return smoother_order(np.frombuffer(raw, "<u2").reshape(height, width).astype(np.uint16)), AS_COUNTS
