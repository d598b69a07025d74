"""One still image, as hostile input: its claimed size is looked at before anything is unpacked."""

from __future__ import annotations

import struct
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from wildlab.errors import WildlabError
from wildlab.flight.files import read_regular

#: The most bytes of an image file that are read, and the most pixels that it may unpack to.
FILE_LIMIT, PIXEL_LIMIT = 400 << 20, 100_000_000
#: What a folder's images are told by.
ENDINGS = (".png", ".jpg", ".jpeg", ".tif", ".tiff", ".bmp")


def still_files(paths: list[Path]) -> list[Path]:
    """Image files named one by one, and those in folders (by their ending, in the order of their names).

    Raises
    ------
    WildlabError
        Where a path is not there, or a folder holds none.
    """
    found: list[Path] = []
    for path in paths:
        if path.is_dir():
            inside = sorted(one for one in path.iterdir() if one.suffix.lower() in ENDINGS and one.is_file())
            if not inside:
                raise WildlabError(
                    "there are no images in this folder",
                    f"name one with {', '.join(ENDINGS)} files",
                    file=path,
                )
            found += inside
        elif path.exists():
            found.append(path)
        else:
            raise WildlabError("there is no such file or folder", "check the path", file=path)
    return list(dict.fromkeys(found))


def read_still(path: Path) -> NDArray[Any]:
    """The pixels of a PNG, JPEG, TIFF or BMP file, as they are stored: no turning by what its tags say.

    Parameters
    ----------
    path
        Of the file.

    Returns
    -------
    (H, W) uint8 or uint16 or float, or (H, W, 3) red, green and blue.

    Raises
    ------
    WildlabError
        Where it is missing, no such image, damaged, or claims more pixels than are unpacked.
    """
    try:
        data = read_regular(path, FILE_LIMIT)
    except FileNotFoundError:
        raise WildlabError("there is no such file", "check the path", file=path) from None
    if not data:
        raise WildlabError("is empty", "copy it again", file=path)
    size = claimed_size(data)
    if size is None:
        raise WildlabError(
            "is no PNG, JPEG, TIFF or BMP image", "convert it to one of these, or leave it out", file=path
        )
    width, height = size
    if width < 1 or height < 1 or width * height > PIXEL_LIMIT:
        raise WildlabError(
            f"claims to be {width} x {height} pixels, and {PIXEL_LIMIT:,} are the most that are unpacked",
            "check that it is the right file",
            file=path,
        )
    cut = (data.startswith(b"\x89PNG") and b"IEND" not in data[-64:]) or (
        data.startswith(b"\xff\xd8") and b"\xff\xd9" not in data[2:][-65536:]
    )
    image = None
    if not cut:
        try:
            image = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_UNCHANGED)
        except cv2.error:
            image = None
    if image is None or image.shape[:2] != (height, width):
        raise WildlabError("is damaged or cut off", "copy it again, or leave it out", file=path)
    return np.asarray(image if image.ndim == 2 else image[..., 2::-1])


def claimed_size(data: bytes) -> tuple[int, int] | None:
    """Width and height as the first bytes of an image file say; None where it is none that is known."""
    try:
        if data.startswith(b"\x89PNG\r\n\x1a\n"):
            return struct.unpack(">II", data[16:24])
        if data.startswith(b"\xff\xd8"):
            return _jpeg_size(data)
        if data.startswith((b"II*\0", b"MM\0*")):
            return _tiff_size(data)
        if data.startswith(b"BM"):
            width, height = struct.unpack("<ii", data[18:26])
            return width, abs(height)
    except (struct.error, IndexError):
        return None
    return None


def _jpeg_size(data: bytes) -> tuple[int, int] | None:
    at = 2
    while at + 9 < len(data) and data[at] == 0xFF:
        kind = data[at + 1]
        if 0xC0 <= kind <= 0xCF and kind not in (0xC4, 0xC8, 0xCC):  # a start of frame
            height, width = struct.unpack(">HH", data[at + 5 : at + 9])
            return width, height
        at += 2 + struct.unpack(">H", data[at + 2 : at + 4])[0]
    return None


def _tiff_size(data: bytes) -> tuple[int, int] | None:
    order = "<" if data.startswith(b"II") else ">"
    at = struct.unpack(f"{order}I", data[4:8])[0]
    count = struct.unpack(f"{order}H", data[at : at + 2])[0]
    found: dict[int, int] = {}
    for entry in range(min(count, 1000)):
        start = at + 2 + 12 * entry
        tag, kind = struct.unpack(f"{order}HH", data[start : start + 4])
        if tag in (256, 257):
            form = "H" if kind == 3 else "I"
            found[tag] = struct.unpack_from(f"{order}{form}", data, start + 8)[0]
    return (found[256], found[257]) if {256, 257} <= set(found) else None
