"""What an image file says of itself before it is decoded: kind, size, and whether all of it is there.

A file may claim any size, and a decoder would believe it. So the claim is read first, from the bytes of the
header, and held against `MOST_PIXELS`.
"""

from __future__ import annotations

import struct
import zlib
from typing import Literal, NamedTuple

Kind = Literal["png", "jpeg", "tiff"]

#: The most pixels that are decoded: four times the largest camera sensors that fly on small aircraft.
MOST_PIXELS = 100_000_000
#: The most entries of a TIFF directory that are looked at.
MOST_TAGS = 4096
_PNG = b"\x89PNG\r\n\x1a\n"
#: JPEG markers that begin a frame and so have its size; the others of that range are tables.
_FRAME_MARKERS = frozenset(range(0xC0, 0xD0)) - {0xC4, 0xC8, 0xCC}
_START_OF_SCAN, _END_OF_IMAGE = 0xDA, b"\xff\xd9"


class Header(NamedTuple):
    """What a file claims.

    Attributes
    ----------
    kind
        Of file.
    width, height
        px.
    problem
        "" or a clause that says what is wrong with it.
    """

    kind: Kind
    width: int
    height: int
    problem: str = ""


def read_header(data: bytes) -> Header | str:
    """Kind and size of an image, and whether it is whole.

    Parameters
    ----------
    data
        All bytes of the file.

    Returns
    -------
    Header or str
        A clause where it is no image that can be read.

    Examples
    --------
    >>> read_header(b"GIF89a")
    'it is no PNG, JPEG or TIFF file'
    """
    try:
        if data.startswith(_PNG):
            found: Header | str = _png(data)
        elif data.startswith(b"\xff\xd8\xff"):
            found = _jpeg(data)
        elif data[:4] in (b"II*\0", b"MM\0*"):
            found = _tiff(data)
        else:
            return "the file is empty" if not data else "it is no PNG, JPEG or TIFF file"
    except struct.error:
        return "the file is cut off inside its header"
    if isinstance(found, str):
        return found
    if found.width < 1 or found.height < 1:
        return f"it claims a size of {found.width} x {found.height} pixels"
    if found.width * found.height > MOST_PIXELS:
        claim = f"it claims {found.width:,} x {found.height:,} pixels"
        return f"{claim}, and {MOST_PIXELS:,} pixels are the most that is decoded"
    return found


def _png(data: bytes) -> Header:
    width, height = struct.unpack_from(">II", data, 16)
    problem, at = "", len(_PNG)
    while True:
        if at + 12 > len(data):
            problem = "the file is cut off before its end"
            break
        (length,) = struct.unpack_from(">I", data, at)
        body = data[at + 4 : at + 8 + length]
        if len(body) < 4 + length or at + 12 + length > len(data):
            problem = "the file is cut off before its end"
            break
        # Damage is found here, where it can be said; the decoder would write to the terminal.
        if zlib.crc32(body) != struct.unpack_from(">I", data, at + 8 + length)[0]:
            problem = f"its part at byte {at:,} is damaged"
            break
        if body[:4] == b"IEND":
            break
        at += 12 + length
    return Header("png", width, height, problem)


def _jpeg(data: bytes) -> Header | str:
    at, size = 2, (0, 0)
    while True:
        if at + 4 > len(data):
            return "the file is cut off inside its header"
        if data[at] != 0xFF:
            return "its header is damaged"
        marker = data[at + 1]
        if marker == 0xFF or marker == 0x01 or 0xD0 <= marker <= 0xD7:
            at += 1 if marker == 0xFF else 2  # fill bytes, and markers that stand alone
            continue
        (length,) = struct.unpack_from(">H", data, at + 2)
        if marker in _FRAME_MARKERS:
            height, width = struct.unpack_from(">HH", data, at + 5)
            size = (width, height)
        if marker == _START_OF_SCAN:
            break
        at += 2 + max(length, 2)
    # Inside a scan 0xFF is followed by 0 or a restart, so the end is found for certain. A thumbnail in the
    # header has an end of its own, which is why the search begins here.
    whole = data.find(_END_OF_IMAGE, at) >= 0
    return Header("jpeg", *size, "" if whole else "the file is cut off before its end")


def _tiff(data: bytes) -> Header | str:
    order = "<" if data[:2] == b"II" else ">"
    (start,) = struct.unpack_from(f"{order}I", data, 4)
    (count,) = struct.unpack_from(f"{order}H", data, start)
    tags = {}
    for entry in range(min(count, MOST_TAGS)):
        at = start + 2 + 12 * entry
        tag, kind, values = struct.unpack_from(f"{order}HHI", data, at)
        tags[tag] = (kind, values, at + 8)

    def numbers(tag: int) -> list[int]:
        if tag not in tags:
            return []
        kind, values, at = tags[tag]
        letter, size = {3: ("H", 2), 4: ("I", 4)}.get(kind, ("", 0))
        if not letter or values * size > len(data):
            return []
        if values * size > 4:
            (at,) = struct.unpack_from(f"{order}I", data, at)
        return list(struct.unpack_from(f"{order}{values}{letter}", data, at))

    width, height = numbers(256), numbers(257)
    if not width or not height:
        return "its header says no size"
    starts, lengths = numbers(273) or numbers(324), numbers(279) or numbers(325)
    ends = [a + b for a, b in zip(starts, lengths, strict=False)]
    whole = all(end <= len(data) for end in ends)
    return Header("tiff", width[0], height[0], "" if whole else "the file is cut off before its end")
