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
from typing import Any, BinaryIO, NoReturn
from xml.parsers import expat

from PIL import ExifTags, Image

from wildlab.errors import WildlabError
from wildlab.flight.files import regular_size, unreadable

#: Segments or chunks of a file that are looked at, bytes of EXIF in a TIFF, and of XMP.
MOST_PIECES, MOST_EXIF, MOST_XMP = 5000, 4_000_000, 1_000_000
#: Elements inside each other, and tags of one packet.
DEEPEST, MOST_TAGS = 50, 5000
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
_FRAMES = frozenset(range(0xC0, 0xD0)) - {0xC4, 0xC8, 0xCC}
#: Records of FLIR: the raw image, and the camera.
_RAW, _CAMERA = 1, 32


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
    if start[:3] == b"\xff\xd8\xff":
        _jpeg(stream, size, found)
    elif start == b"\x89PNG\r\n\x1a\n":
        _png(stream, size, found)
    elif start[:4] in (b"II*\0", b"MM\0*"):
        _tiff(stream, found)
    elif start[:4] in (b"FFF\0", b"AFF\0"):
        _records(stream, [(0, size)], found)
    else:
        found.problem = "is empty" if not size else "is no JPEG, PNG or TIFF file"


def _jpeg(stream: BinaryIO, size: int, found: Tags) -> None:
    pieces: dict[int, tuple[int, int]] = {}
    exif, at = b"", 2
    for _ in range(MOST_PIECES):
        stream.seek(at)
        head = stream.read(4)
        if len(head) < 4:
            found.problem = "its headers are cut off"
            break
        marker = head[1]
        if head[0] != 0xFF:
            found.problem = "its headers are damaged"
            break
        if marker in (0xFF, 0x01) or 0xD0 <= marker <= 0xD7:
            at += 1 if marker == 0xFF else 2
            continue
        if marker in (0xDA, 0xD9):
            break
        length = struct.unpack(">H", head[2:])[0] - 2
        if at + 4 + length > size:
            found.problem = "its headers are cut off"
            break
        if marker in _FRAMES and length >= 5:
            found.height, found.width = struct.unpack(">HH", stream.read(5)[1:])
        elif marker == 0xE1:
            name = stream.read(min(length, len(_JPEG_XMP)))
            if name.startswith(b"Exif\0") and not exif:
                exif = name[6:] + stream.read(max(length - len(name), 0))
            elif name == _JPEG_XMP:
                _xmp(stream.read(length - len(name)), found)
            elif name.startswith(b"FLIR\0") and length > 8:
                pieces[name[6]] = (at + 12, length - 8)
        at += 2 + max(length + 2, 2)
    if exif:
        _exif(_Bounded(io.BytesIO(exif), 2 * len(exif)), found)
    if pieces:
        _records(stream, [pieces[number] for number in sorted(pieces)], found)


def _png(stream: BinaryIO, size: int, found: Tags) -> None:
    at = 8
    for _ in range(MOST_PIECES):
        stream.seek(at)
        head = stream.read(8)
        if len(head) < 8:
            found.problem = "its headers are cut off"
            return
        (length,), kind = struct.unpack(">I", head[:4]), head[4:]
        if kind == b"IEND":
            return
        if at + 12 + length > size:
            found.problem = "is cut off before its end"
            return
        if kind == b"IHDR" and length >= 8:
            found.width, found.height = struct.unpack(">II", stream.read(8))
        elif kind == b"eXIf" and length <= MOST_EXIF:
            _exif(_Bounded(io.BytesIO(stream.read(length)), 2 * length), found)
        elif kind == b"iTXt" and length <= MOST_XMP:
            body = stream.read(length)
            # Flag 0: as it is, not packed.
            if body.startswith(_PNG_XMP) and body[len(_PNG_XMP)] == 0:
                _xmp(body[len(_PNG_XMP) + 2 :].split(b"\0", 2)[-1], found)
        at += 12 + length


def _tiff(stream: BinaryIO, found: Tags) -> None:
    stream.seek(0)
    _exif(_Bounded(stream, MOST_EXIF), found)
    for name, side in (("ImageWidth", "width"), ("ImageLength", "height")):
        value = found.exif.get(name)
        if isinstance(value, int) and 0 < value < 1 << 31:
            setattr(found, side, value)
    if not found.width and not found.problem:
        found.problem = "its header says no size"


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
    start, end = packet.find(b"<"), packet.rfind(b">") + 1
    packet = packet[max(start, 0) : end]
    if not packet or len(packet) > MOST_XMP:
        if packet:
            found.problem = found.problem or f"its XMP has {len(packet):,} bytes and is not read"
        return
    reader = _Xmp(found.xmp)
    parser = expat.ParserCreate(namespace_separator=" ")
    parser.buffer_text = True
    parser.StartElementHandler = reader.start
    parser.EndElementHandler = reader.end
    parser.CharacterDataHandler = reader.text
    parser.StartDoctypeDeclHandler = reader.refuse
    parser.EntityDeclHandler = reader.refuse
    try:
        parser.Parse(packet, True)
    except _Refused as error:
        found.problem = found.problem or str(error)
    except expat.ExpatError:
        if b"<!DOCTYPE" in packet or b"<!ENTITY" in packet:
            found.problem = found.problem or _Xmp.DECLARES
            return
        # Some programs write packets without declaring prefixes, and some are cut off: what they name is
        # still plain.
        for prefix, name, given, inside in _LOOSE.findall(packet.decode("utf-8", "replace")):
            found.xmp.setdefault(f"{_PREFIXES[prefix]}:{name}", (given or inside).strip())


class _Refused(Exception):
    pass


class _Xmp:
    """What expat tells: properties as attributes, or as elements with text, or as the first of a list."""

    DECLARES = "its XMP declares a document type or entities and is not read"

    def __init__(self, into: dict[str, str]) -> None:
        self._into = into
        self._inside: list[str] = []
        self._words: list[str] = []

    def refuse(self, *_: object) -> NoReturn:
        raise _Refused(self.DECLARES)

    def start(self, tag: str, attributes: dict[str, str]) -> None:
        if len(self._inside) >= DEEPEST:
            raise _Refused("its XMP is nested too deeply and is not read")
        self._inside.append(_short(tag))
        self._words = []
        for name, value in attributes.items():
            self._keep(_short(name), value)

    def text(self, words: str) -> None:
        self._words.append(words)

    def end(self, tag: str) -> None:
        # An item of a list counts for the property that the list is of.
        name = next((one for one in reversed(self._inside) if one), "")
        self._keep(name, "".join(self._words))
        self._inside.pop()
        self._words = []

    def _keep(self, name: str, value: str) -> None:
        value = value.strip()[:MOST_LETTERS]
        if name and value and len(self._into) < MOST_TAGS:
            self._into.setdefault(name, value)


def _short(tag: str) -> str:
    space, _, name = tag.rpartition(" ")
    return next((f"{short}:{name}" for part, short in SPACES if part in space), "")


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

    head = take(0, 64)
    if head[:4] not in (b"FFF\0", b"AFF\0"):
        return
    try:
        order = ">" if struct.unpack_from(">I", head, 20)[0] < 0x10000 else "<"
        start, count = struct.unpack_from(f"{order}II", head, 24)
        index = take(start, 32 * min(count, 256))
        for place in range(0, len(index) - 31, 32):
            (kind,) = struct.unpack_from(f"{order}H", index, place)
            at, _ = struct.unpack_from(f"{order}II", index, place + 12)
            if kind == _RAW and not found.raw_width:
                record = take(at, 6)
                own = "<" if struct.unpack_from("<H", record)[0] == 2 else ">"
                found.raw_width, found.raw_height = struct.unpack_from(f"{own}HH", record, 2)
            elif kind == _CAMERA and not found.view_deg:
                record = take(at, 0x1B8)
                own = "<" if struct.unpack_from("<H", record)[0] == 2 else ">"
                (view,) = struct.unpack_from(f"{own}f", record, 0x1B4)
                found.view_deg = float(view) if 0.1 < view < 179 else 0.0
                found.lens = record[0x170:0x190].split(b"\0")[0].decode("ascii", "replace").strip()
    except struct.error:
        found.problem = found.problem or "its records of FLIR are cut off"
