"""What stands in the headers of an image file: EXIF, XMP, and FLIR's records; no pixel is decoded.

Only so much of a file is read as its headers take, whatever it claims. EXIF is read by Pillow out of the
bytes of its segment; XMP by expat without a document type, entities or links. Tags of XMP are known by their
name space and not by its prefix: ``dji:GimbalYawDegree``.
"""

from __future__ import annotations

import io
import re
import struct
import warnings
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, BinaryIO
from xml.parsers import expat

from PIL import ExifTags, Image

from wildlab.errors import WildlabError
from wildlab.flight.files import regular_size, unreadable
from wildlab.flight.readers.documents import XmlReader
from wildlab.flight.readers.frames.headers import JPEG, PNG, TIFF, jpeg_pieces, png_pieces
from wildlab.flight.readers.frames.thermal import (
    CAMERA,
    RAW,
    RECORDS,
    find_records,
    flir_order,
    record_order,
)

#: Bytes of EXIF in a TIFF, and of XMP, and tags of one packet.
MOST_EXIF, MOST_XMP, MOST_TAGS = 4_000_000, 1_000_000, 5000
#: Letters of a value that are kept.
MOST_LETTERS = 400
#: Name spaces by a part of their address; Pix4D's is used by Parrot, MicaSense, senseFly and others.
SPACES = (
    ("dji.com/drone-dji", "dji"),
    ("pix4d.com/camera", "camera"),
    ("parrot.com/drone-parrot", "parrot"),
    ("ns.flir.com/", "flir"),
    ("dji.com/FLIR", "flir"),
    ("ns.adobe.com/exif/", "exif"),
    ("ns.adobe.com/xap/", "xmp"),
    ("ns.adobe.com/tiff/", "tiff"),
)
#: The same by prefix, for packets that are no XML any more.
_PREFIXES = {"drone-dji": "dji", "drone-parrot": "parrot", "Camera": "camera", "FLIR": "flir"}
_PREFIXES |= {"exif": "exif", "xmp": "xmp", "tiff": "tiff"}
_LOOSE = re.compile(
    r"<?\b(drone-dji|drone-parrot|Camera|FLIR|exif|xmp|tiff):(\w{1,60})\s*(?:=\s*[\"']([^\"'<>]{0,400})|>([^<>]{1,400})<)"
)
_JPEG_XMP = b"http://ns.adobe.com/xap/1.0/\0"
_PNG_XMP = b"XML:com.adobe.xmp\0"


@dataclass
class Tags:
    """What the headers of one image say.

    Attributes
    ----------
    width, height
        Of the picture, px; 0 where the file does not say it.
    exif
        By the names of the standard, those of GPS too, as Pillow gives them.
    xmp
        Text by name space and name: ``dji:GimbalYawDegree``.
    raw_width, raw_height
        Of FLIR's raw thermal image, px; 0 without one.
    view_deg
        Width of the field of view as FLIR's records have it, deg; 0 where they do not say it.
    lens
        What FLIR's records call the lens.
    problem
        "" or a clause on what of the headers could not be read.
    """

    width: int = 0
    height: int = 0
    exif: dict[str, Any] = field(default_factory=dict)
    xmp: dict[str, str] = field(default_factory=dict)
    raw_width: int = 0
    raw_height: int = 0
    view_deg: float = 0.0
    lens: str = ""
    problem: str = ""


def size_of(tags: Tags) -> tuple[int, int]:
    """Width and height of the pixels that are read, px: FLIR's raw image goes before the picture."""
    raw = tags.raw_width, tags.raw_height
    return raw if all(raw) else (tags.width, tags.height)


class _Bounded(io.RawIOBase):
    """A file of which no more than so many bytes are given, wherever they stand."""

    def __init__(self, stream: BinaryIO, most: int) -> None:
        self._stream, self._left = stream, most

    def readable(self) -> bool:
        return True

    def seekable(self) -> bool:
        return True

    def seek(self, offset: int, whence: int = 0) -> int:
        return self._stream.seek(offset, whence)

    def tell(self) -> int:
        return self._stream.tell()

    def read(self, size: int = -1) -> bytes:
        if size < 0 or size > self._left:
            raise OSError("more is claimed than is read")
        found = self._stream.read(size)
        self._left -= len(found)
        return found


def read_tags(path: Path) -> Tags:
    """Tags of one image file; whatever cannot be read is left out and said in `Tags.problem`.

    Parameters
    ----------
    path
        Of a JPEG, PNG, TIFF or ``.fff`` file.

    Returns
    -------
    Tags
    """
    found = Tags()
    try:
        size = regular_size(path)
        with path.open("rb") as stream:
            _read(stream, size, found)
    except FileNotFoundError:
        found.problem = "there is no such file"
    except WildlabError as error:
        found.problem = error.problem
    except OSError as error:
        found.problem = unreadable(error, path).problem
    except struct.error:
        found.problem = "its headers are cut off"
    return found


def _read(stream: BinaryIO, size: int, found: Tags) -> None:
    start = stream.read(8)
    if start.startswith(JPEG):
        _jpeg(stream, size, found)
    elif start == PNG:
        _png(stream, size, found)
    elif start[:4] in TIFF:
        stream.seek(0)
        _exif(_Bounded(stream, MOST_EXIF), found)
        sides = (found.exif.get(name) for name in ("ImageWidth", "ImageLength"))
        found.width, found.height = (
            one if isinstance(one, int) and 0 < one < 1 << 31 else 0 for one in sides
        )
        if not found.width:
            found.problem = found.problem or "its header says no size"
    elif start[:4] in RECORDS:
        _records(stream, [(0, size)], found)
    else:
        found.problem = "is empty" if not size else "is no JPEG, PNG or TIFF file"


def _jpeg(stream: BinaryIO, size: int, found: Tags) -> None:
    pieces = jpeg_pieces(stream, size)
    found.width, found.height, found.problem = pieces.width, pieces.height, pieces.problem
    segments = [one for one in pieces.found if one.kind == 0xE1]
    begins = []
    exif = b""
    for one in segments:
        stream.seek(one.at)
        begins.append(stream.read(min(one.length, len(_JPEG_XMP))))
        if begins[-1].startswith(b"Exif\0") and not exif:
            exif = begins[-1][6:] + stream.read(max(one.length - len(begins[-1]), 0))
        elif begins[-1] == _JPEG_XMP:
            _xmp(stream.read(one.length - len(_JPEG_XMP)), found)
    if exif:
        _exif(_Bounded(io.BytesIO(exif), 2 * len(exif)), found)
    records = [(segments[at].at + 8, segments[at].length - 8) for at in flir_order(begins)]
    if records:
        _records(stream, records, found)


def _png(stream: BinaryIO, size: int, found: Tags) -> None:
    pieces = png_pieces(stream, size)
    found.width, found.height, found.problem = pieces.width, pieces.height, pieces.problem
    for one in pieces.found:
        stream.seek(one.at)
        if one.kind == b"eXIf" and one.length <= MOST_EXIF:
            _exif(_Bounded(io.BytesIO(stream.read(one.length)), 2 * one.length), found)
        elif one.kind == b"iTXt" and one.length <= MOST_XMP:
            body = stream.read(one.length)
            # Flag 0: as it is, not packed.
            if body.startswith(_PNG_XMP) and body[len(_PNG_XMP) :][:1] == b"\0":
                _xmp(body[len(_PNG_XMP) + 2 :].split(b"\0", 2)[-1], found)


def _exif(stream: Any, found: Tags) -> None:
    own = Image.Exif()
    try:
        with warnings.catch_warnings():
            # Pillow warns of what is broken and goes on; what is left is judged tag by tag.
            warnings.simplefilter("ignore")
            own.load_from_fp(stream)
            parts = [(dict(own), ExifTags.TAGS)]
            for pointer, names in ((0x8769, ExifTags.TAGS), (0x8825, ExifTags.GPSTAGS)):
                if pointer in own:
                    parts.append((dict(own.get_ifd(pointer)), names))
    except Exception:  # Pillow raises whatever comes first of a broken directory
        found.problem = found.problem or "its EXIF cannot be read"
        return
    for tags, names in parts:
        for number, value in tags.items():
            if number == 0x02BC and isinstance(value, bytes | str):
                _xmp(value if isinstance(value, bytes) else value.encode("utf-8", "replace"), found)
            elif number in names:
                found.exif.setdefault(names[number], value)


def _xmp(packet: bytes, found: Tags) -> None:
    packet = packet[max(packet.find(b"<"), 0) : packet.rfind(b">") + 1]
    if len(packet) > MOST_XMP:
        found.problem = found.problem or f"its XMP has {len(packet):,} bytes and is not read"
    if not 0 < len(packet) <= MOST_XMP:
        return
    try:
        Xmp(found.xmp).read(packet)
    except WildlabError as error:
        found.problem = found.problem or f"its XMP is not read: {error.problem}"
    except expat.ExpatError:
        if b"<!DOCTYPE" in packet or b"<!ENTITY" in packet:
            found.problem = found.problem or "its XMP declares a document type or entities and is not read"
            return
        # Some programs write packets without declaring prefixes, and some are cut off: what they name is
        # still plain.
        for prefix, name, given, inside in _LOOSE.findall(packet.decode("utf-8", "replace")):
            found.xmp.setdefault(f"{_PREFIXES[prefix]}:{name}", (given or inside).strip())


class Xmp(XmlReader):
    """Properties of XMP as attributes, or as elements with text, or as the first of a list."""

    deepest = 50

    def __init__(self, into: dict[str, str]) -> None:
        super().__init__()
        self._into = into

    def called(self, tag: str) -> str:
        space, _, name = tag.rpartition(" ")
        return next((f"{short}:{name}" for part, short in SPACES if part in space), "")

    def begin(self, name: str, attributes: dict[str, str]) -> None:
        for one, value in attributes.items():
            self._keep(self.called(one), value)

    def finish(self, name: str, words: str) -> None:
        # An item of a list counts for the property that the list is of.
        self._keep(next((one for one in (name, *reversed(self.inside)) if one), ""), words)

    def _keep(self, name: str, value: str) -> None:
        value = value.strip()[:MOST_LETTERS]
        if name and value and len(self._into) < MOST_TAGS:
            self._into.setdefault(name, value)


def _records(stream: BinaryIO, pieces: list[tuple[int, int]], found: Tags) -> None:
    """Size of the raw image, and the view that the camera's record has; pieces are places and lengths."""

    def take(at: int, length: int) -> bytes:
        got = b""
        for start, there in pieces:
            if at < there and len(got) < length:
                stream.seek(start + at)
                got += stream.read(min(length - len(got), there - at))
            at = max(at - there, 0)
        return got

    try:
        records = find_records(take)
        if RAW in records:
            record = take(records[RAW][0], 6)
            found.raw_width, found.raw_height = struct.unpack_from(f"{record_order(record)}HH", record, 2)
        if CAMERA in records:
            record = take(records[CAMERA][0], 0x1B8)
            (view,) = struct.unpack_from(f"{record_order(record)}f", record, 0x1B4)
            found.view_deg = float(view) if 0.1 < view < 179 else 0.0
            found.lens = record[0x170:0x190].split(b"\0")[0].decode("ascii", "replace").strip()
    except struct.error:
        found.problem = found.problem or "its records of FLIR are cut off"
