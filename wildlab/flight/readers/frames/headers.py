"""What an image file says of itself before it is decoded: kind, size, and whether all of it is there.

A file may claim any size, and a decoder would believe it. So the claim is read first, from the bytes of the
header, and held against `MOST_PIXELS`.
"""

from __future__ import annotations

import io
import struct
import zlib
from typing import BinaryIO, Literal, NamedTuple

Kind = Literal["png", "jpeg", "tiff"]

#: The most pixels that are decoded: four times the largest camera sensors that fly on small aircraft.
MOST_PIXELS = 100_000_000
#: The most entries of a TIFF directory, and pieces of another file, that are looked at.
MOST_TAGS, MOST_PIECES = 4096, 100_000
PNG, JPEG, TIFF = b"\x89PNG\r\n\x1a\n", b"\xff\xd8\xff", (b"II*\0", b"MM\0*")
#: JPEG markers that begin a frame and so have its size; the others of that range are tables.
_FRAME_MARKERS = frozenset(range(0xC0, 0xD0)) - {0xC4, 0xC8, 0xCC}
_START_OF_SCAN, _END_OF_IMAGE = 0xDA, b"\xff\xd9"


class HeaderPiece(NamedTuple):
    """A segment of a JPEG (its marker) or a chunk of a PNG (its name), and where its content stands."""

    kind: int | bytes
    at: int
    length: int


class HeaderPieces(NamedTuple):
    """Pieces of a file, of a JPEG those before its scan; its size (px, 0 where it says none); "" or a
    problem."""

    found: list[HeaderPiece]
    width: int = 0
    height: int = 0
    problem: str = ""


def jpeg_pieces(stream: BinaryIO, size: int) -> HeaderPieces:
    """Segments of a JPEG of so many bytes; the last one begins the scan, where the header is whole."""
    found: list[HeaderPiece] = []
    width = height = 0
    at = 2
    for _ in range(MOST_PIECES):
        stream.seek(at)
        head = stream.read(4)
        if len(head) < 4:
            return HeaderPieces(found, width, height, "the file is cut off inside its header")
        marker = head[1]
        if head[0] != 0xFF:
            return HeaderPieces(found, width, height, "its header is damaged")
        if marker in (0xFF, 0x01) or 0xD0 <= marker <= 0xD7:
            at += 1 if marker == 0xFF else 2  # fill bytes, and markers that stand alone
            continue
        length = max(struct.unpack(">H", head[2:])[0] - 2, 0)
        found.append(HeaderPiece(marker, at + 4, length))
        if marker in (_START_OF_SCAN, _END_OF_IMAGE[1]):
            break
        if at + 4 + length > size:
            return HeaderPieces(found[:-1], width, height, "the file is cut off inside its header")
        if marker in _FRAME_MARKERS and length >= 5:
            height, width = struct.unpack(">HH", stream.read(5)[1:])
        at += 4 + length
    return HeaderPieces(found, width, height)


def png_pieces(stream: BinaryIO, size: int) -> HeaderPieces:
    """Chunks of a PNG of so many bytes up to its end."""
    found: list[HeaderPiece] = []
    width = height = 0
    at = len(PNG)
    for _ in range(MOST_PIECES):
        stream.seek(at)
        head = stream.read(8)
        length, kind = int.from_bytes(head[:4], "big"), head[4:]
        if len(head) < 8 or at + 12 + length > size:
            return HeaderPieces(found, width, height, "the file is cut off before its end")
        found.append(HeaderPiece(kind, at + 8, length))
        if kind == b"IHDR" and length >= 8:
            width, height = struct.unpack(">II", stream.read(8))
        elif kind == b"IEND":
            break
        at += 12 + length
    return HeaderPieces(found, width, height)


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
        if data.startswith(PNG):
            found: Header | str = _png(data)
        elif data.startswith(JPEG):
            found = _jpeg(data)
        elif data[:4] in TIFF:
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
    struct.unpack_from(">II", data, 16)
    pieces = png_pieces(io.BytesIO(data), len(data))
    problem = pieces.problem
    for one in pieces.found:
        # Damage is found here, where it can be said; the decoder would write to the terminal.
        if (
            zlib.crc32(data[one.at - 4 : one.at + one.length])
            != struct.unpack_from(">I", data, one.at + one.length)[0]
        ):
            problem = f"its part at byte {one.at - 8:,} is damaged"
            break
    return Header("png", pieces.width, pieces.height, problem)


def _jpeg(data: bytes) -> Header | str:
    pieces = jpeg_pieces(io.BytesIO(data), len(data))
    if pieces.problem:
        return pieces.problem
    # Inside a scan 0xFF is followed by 0 or a restart, so the end is found for certain. A thumbnail in the
    # header has an end of its own, which is why the search begins here.
    whole = bool(pieces.found) and data.find(_END_OF_IMAGE, pieces.found[-1].at - 4) >= 0
    return Header("jpeg", pieces.width, pieces.height, "" if whole else "the file is cut off before its end")


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
        kind, values, at = tags.get(tag, (0, 0, 0))
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
    whole = all(a + b <= len(data) for a, b in zip(starts, lengths, strict=False))
    return Header("tiff", width[0], height[0], "" if whole else "the file is cut off before its end")
