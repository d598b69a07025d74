"""What stands in the headers of an image file (EXIF, XMP, FLIR's records), and what it means; no pixel is
decoded.

Only so much of a file is read as its headers take, whatever it claims. EXIF is read by Pillow out of the
bytes of its segment; XMP by expat without a document type, entities or links. Tags of XMP are known by their
name space and not by its prefix: ``dji:GimbalYawDegree``.

A value is a number or NaN: place, heights, attitude, stamps, focal lengths. Nothing is guessed: the pitch
of a pixel is not looked up by the camera's name, and a height stands with what it counts from.
"""

from __future__ import annotations

import io
import math
import re
import struct
import warnings
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, BinaryIO
from xml.etree.ElementTree import Element

from PIL import ExifTags, Image
from scipy.spatial.transform import Rotation

from wildlab.errors import WildlabError
from wildlab.flight.files import regular_size, unreadable
from wildlab.flight.readers.documents import BrokenXml, parse_xml
from wildlab.flight.readers.frames.headers import JPEG, PNG, TIFF, jpeg_pieces, png_pieces
from wildlab.flight.readers.frames.thermal import (
    CAMERA,
    RAW,
    RECORDS,
    find_records,
    flir_order,
    record_order,
)
from wildlab.flight.readers.text import LATEST_S, stamp_s

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
        _properties(parse_xml(packet), "", found.xmp)
    except BrokenXml:
        if b"<!DOCTYPE" in packet or b"<!ENTITY" in packet:
            found.problem = found.problem or "its XMP declares a document type or entities and is not read"
            return
        # Some programs write packets without declaring prefixes, and some are cut off: what they name is
        # still plain.
        for prefix, name, given, inside in _LOOSE.findall(packet.decode("utf-8", "replace")):
            found.xmp.setdefault(f"{_PREFIXES[prefix]}:{name}", (given or inside).strip())
    except WildlabError as error:
        found.problem = found.problem or f"its XMP is not read: {error.problem}"


def _properties(element: Element, name: str, into: dict[str, str]) -> None:
    """Properties as attributes, or as elements with text, or as the first of a list."""
    # An item of a list counts for the property that the list is of.
    name = _short(element.tag) or name
    for tag, value in element.attrib.items():
        _keep(_short(tag), value, into)
    for one in element:
        _properties(one, name, into)
    _keep(name, element[-1].tail or "" if len(element) else element.text or "", into)


def _short(tag: str) -> str:
    space, _, name = tag.rpartition(" ")
    return next((f"{short}:{name}" for part, short in SPACES if part in space), "")


def _keep(name: str, value: str, into: dict[str, str]) -> None:
    value = value.strip()[:MOST_LETTERS]
    if name and value and len(into) < MOST_TAGS:
        into.setdefault(name, value)


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


# -- what they mean

NAN = math.nan
#: No image is from before 1990, s since 1970.
EARLIEST_S = 631_151_999.0
#: Diagonal of a frame of 35 mm film, mm: what an equivalent focal length is defined by (CIPA DCG-001).
DIAGONAL_35MM = math.hypot(36.0, 24.0)
#: Kinds of fix as MAVLink numbers them, by DJI's RtkFlag.
RTK_FIXES = {16: 3.0, 32: 5.0, 34: 5.0, 50: 6.0}
#: Two statements of one focal length that differ by more contradict each other.
CONTRADICTS = 0.1
#: Where focal lengths in px come from, best first.
CALIBRATED, BY_SENSOR, BY_SIZE, BY_VIEW, BY_FILM = (
    "calibrated by the maker",
    "focal length and resolution of the sensor",
    "focal length and size of the sensor",
    "field of view",
    "35 mm equivalent",
)
_RATIONAL = re.compile(r"\s*([+-]?\d{1,18}(?:\.\d{0,18})?(?:[eE][+-]?\d{1,3})?)\s*(?:/\s*(\d{1,18}))?\s*")


def number(value: Any) -> float:
    """A tag as a number: what Pillow gives, or text such as ``+12.5`` or ``25/2``; NaN where it is none."""
    if isinstance(value, bytes):
        value = value.split(b"\0")[0].decode("ascii", "replace")
    if isinstance(value, tuple | list):
        value = value[0] if len(value) == 1 else None
    if isinstance(value, str):
        found = _RATIONAL.fullmatch(value)
        if found is None:
            return NAN
        value = float(found[1]) / float(found[2]) if found[2] and float(found[2]) else float(found[1])
    try:
        result = float(value)
    except (TypeError, ValueError, ZeroDivisionError, OverflowError):
        return NAN
    return result if math.isfinite(result) else NAN


def text(value: Any) -> str:
    """A tag as text on one line, without what a terminal would obey."""
    if isinstance(value, bytes):
        value = value.decode("utf-8", "replace")
    if not isinstance(value, str):
        return ""
    return "".join(one for one in value.split("\0")[0].strip()[:200] if one.isprintable())


def place_of(tags: Tags) -> tuple[float, float, str]:
    """Latitude and longitude, deg, and why they cannot be used: "" where they can."""
    given = (
        _first(tags, "dji:GpsLatitude", "dji:Latitude"),
        # Misspelt by the maker in most of its cameras.
        _first(tags, "dji:GpsLongtitude", "dji:GpsLongitude", "dji:Longitude"),
    )
    sides = _angle(tags.exif, "GPSLatitude", 90.0), _angle(tags.exif, "GPSLongitude", 180.0)
    written = [_degrees_minutes(tags.xmp.get(one, "")) for one in ("exif:GPSLatitude", "exif:GPSLongitude")]
    ways = (one for one in (given, sides, written) if all(map(math.isfinite, one)))
    latitude, longitude = next(ways, (NAN, NAN))
    if not (math.isfinite(latitude) and math.isfinite(longitude)):
        there = "GPSLatitude" in tags.exif and "GPSLongitude" in tags.exif
        return NAN, NAN, "position without its hemisphere, or none" if there else "no position"
    if abs(latitude) > 90 or abs(longitude) > 180:
        return NAN, NAN, "position that is none on Earth"
    if latitude == 0 and longitude == 0:
        return 0.0, 0.0, "placeholder of a position"
    if text(tags.exif.get("GPSStatus")).upper() == "V":
        return latitude, longitude, "no fix"
    return latitude, longitude, ""


def _angle(exif: dict[str, Any], name: str, most: float) -> float:
    """Degrees, minutes and seconds with the sign of their Ref tag; NaN without a Ref."""
    value = exif.get(name)
    parts = [number(one) for one in value] if isinstance(value, tuple | list) else [number(value)]
    if not 1 <= len(parts) <= 3 or not math.isfinite(parts[0]):
        return NAN
    # Seconds may be 0/0 where minutes have decimals.
    parts = [part if math.isfinite(part) else 0.0 for part in parts]
    size = sum(part / scale for part, scale in zip(parts, (1.0, 60.0, 3600.0), strict=False))
    side = text(exif.get(f"{name}Ref")).upper()[:1]
    sign = {"N": 1.0, "E": 1.0, "S": -1.0, "W": -1.0}.get(side, NAN)
    return sign * abs(size) if abs(size) <= most else NAN


def _degrees_minutes(value: str) -> float:
    """``53,26.856N`` or ``53,26,51N`` of XMP."""
    found = re.fullmatch(r"(\d{1,3}),(\d{1,2}(?:\.\d{1,15})?)(?:,(\d{1,2}(?:\.\d{1,15})?))?([NSEW])", value)
    if found is None:
        return NAN
    size = float(found[1]) + float(found[2]) / 60 + float(found[3] or 0) / 3600
    return -size if found[4] in "SW" else size


def heights_of(tags: Tags) -> tuple[float, float, float]:
    """Heights above the ellipsoid, above sea level and above where the vehicle took off, m."""
    ellipsoid = sea = NAN
    height = number(tags.exif.get("GPSAltitude"))
    side = tags.exif.get("GPSAltitudeRef", b"\0")
    kind = side[0] if isinstance(side, bytes) and side else side if isinstance(side, int) else 0
    kind = kind - ord("0") if isinstance(kind, int) and ord("0") <= kind <= ord("3") else kind
    if math.isfinite(height):
        height = -abs(height) if kind in (1, 3) else height
        # 2 and 3 are those above and below the ellipsoid, since Exif 3.0.
        ellipsoid, sea = (height, NAN) if kind in (2, 3) else (NAN, height)
    own = number(tags.xmp.get("dji:AbsoluteAltitude"))
    if math.isfinite(own):
        by_rtk = rtk_of(tags) in RTK_FIXES or tags.xmp.get("dji:AltitudeType", "").lower().startswith("rtk")
        ellipsoid, sea = (own, NAN) if by_rtk else (ellipsoid, own)
    if tags.xmp.get("camera:VertCS", "").lower().startswith("ellips") and math.isfinite(sea):
        ellipsoid, sea = sea, NAN
    home = _first(tags, "dji:RelativeAltitude", "flir:MAVRelativeAltitude")
    return _within(ellipsoid, -1000, 100e3), _within(sea, -1000, 100e3), _within(home, -1000, 100e3)


def rtk_of(tags: Tags) -> int:
    """DJI's RtkFlag; -1 where there is none."""
    flag = number(tags.xmp.get("dji:RtkFlag"))
    return int(flag) if math.isfinite(flag) and 0 <= flag < 1000 else -1


def fix_of(tags: Tags) -> float:
    """Kind of fix; NaN where it is not said."""
    if rtk_of(tags) in RTK_FIXES:
        return RTK_FIXES[rtk_of(tags)]
    mode = number(text(tags.exif.get("GPSMeasureMode")) or tags.exif.get("GPSMeasureMode"))
    return mode if mode in (2.0, 3.0) else NAN


def spreads_of(tags: Tags) -> tuple[float, float]:
    """Standard deviations of each horizontal axis and of the height, m."""
    north, east, up = (number(tags.xmp.get(f"dji:RtkStd{one}")) for one in ("Lat", "Lon", "Hgt"))
    own = math.sqrt((north**2 + east**2) / 2), _first(tags, "camera:GPSXYAccuracy")
    levels = (*own, number(tags.exif.get("GPSHPositioningError")))
    level = next((one for one in levels if math.isfinite(one)), NAN)
    up = up if math.isfinite(up) else _first(tags, "camera:GPSZAccuracy")
    # Zero stands for not known.
    return _within(level, 0, 1e6), _within(up, 0, 1e6)


def airframe_of(tags: Tags) -> tuple[float, float, float]:
    """Roll, pitch and yaw of the airframe, deg."""
    return _angles(tags, "dji:Flight{}Degree", "parrot:Drone{}Degree", "flir:MAV{}")


def camera_angles_of(tags: Tags) -> tuple[float, float, float]:
    """Roll, pitch and yaw of the optical axis against north and the horizon, deg; pitch -90 looks down."""
    found = _angles(tags, "dji:Gimbal{}Degree", "parrot:Camera{}Degree")
    return found if math.isfinite(found[0]) else from_nadir(*_angles(tags, "camera:{}"))


def from_nadir(roll: float, pitch: float, yaw: float) -> tuple[float, float, float]:
    """Angles counted from a camera that looks straight down as those of its optical axis.

    Parameters
    ----------
    roll, pitch, yaw
        deg, zyx; zero is a camera that looks down with the top of its image to the north (Pix4D's tags).

    Returns
    -------
    roll, pitch, yaw
        deg, zyx; zero is a camera that looks to the north, level.

    Examples
    --------
    >>> [round(one, 6) + 0.0 for one in from_nadir(0.0, 60.0, 45.0)]
    [0.0, -30.0, 45.0]
    """
    if not math.isfinite(roll + pitch + yaw):
        return NAN, NAN, NAN
    # Ahead of the optical axis' frame is down of the other.
    down = Rotation.from_euler("ZYX", [yaw, pitch, roll], degrees=True)
    R = (down * Rotation.from_euler("Y", -90, degrees=True)).as_matrix()
    level = math.hypot(R[0, 0], R[1, 0])
    pitch = math.atan2(-R[2, 0], level)
    if level < 1e-9:
        # Straight down there is one turn about the vertical; it stands in yaw.
        return 0.0, math.degrees(pitch), math.degrees(math.atan2(-R[0, 1], R[1, 1]))
    turned, heading = math.atan2(R[2, 1], R[2, 2]), math.atan2(R[1, 0], R[0, 0])
    return math.degrees(turned), math.degrees(pitch), math.degrees(heading)


def _angles(tags: Tags, *ways: str) -> tuple[float, float, float]:
    """Roll, pitch and yaw by the first of some names that all three are there by, NaN where there is none."""
    for way in ways:
        roll, pitch, yaw = (number(tags.xmp.get(way.format(one))) for one in ("Roll", "Pitch", "Yaw"))
        if max(abs(roll), abs(pitch), abs(yaw)) <= 720 and math.isfinite(roll + pitch + yaw):
            return roll, pitch, yaw
    return NAN, NAN, NAN


def _first(tags: Tags, *names: str) -> float:
    return next((found for name in names if math.isfinite(found := number(tags.xmp.get(name)))), NAN)


def _within(value: float, least: float, most: float) -> float:
    return value if least < value < most else NAN


# -- stamps


def wall_of(tags: Tags) -> tuple[float, float]:
    """The camera's wall clock, s since 1970 as if it were UTC, and how far it is ahead of UTC, s."""
    for date, part, zone in (
        ("DateTimeOriginal", "SubsecTimeOriginal", "OffsetTimeOriginal"),
        ("DateTimeDigitized", "SubsecTimeDigitized", "OffsetTimeDigitized"),
        ("DateTime", "SubsecTime", "OffsetTime"),
    ):
        wall = _stamp(text(tags.exif.get(date)))
        if math.isfinite(wall):
            digits = text(tags.exif.get(part))
            wall += float(f"0.{digits}") if digits.isascii() and digits.isdecimal() else 0.0
            return wall, _offset(text(tags.exif.get(zone)) or text(tags.exif.get("OffsetTime")))
    for name in ("exif:DateTimeOriginal", "xmp:CreateDate", "xmp:ModifyDate"):
        said = tags.xmp.get(name, "")
        ends = re.search(r"(Z|[+-]\d\d:\d\d)$", said)
        wall = _stamp(said[: ends.start()] if ends else said)
        if math.isfinite(wall):
            return wall, _offset(ends[1]) if ends else NAN
    return NAN, NAN


def satellite_time_of(tags: Tags) -> float:
    """UTC by satellites, s since 1970: of the exposure where the maker has it, else the stamp of GPS."""
    own = _stamp(tags.xmp.get("dji:UTCAtExposure", ""))
    if math.isfinite(own):
        return own
    day = _stamp(f"{text(tags.exif.get('GPSDateStamp'))} 00:00:00")
    clock = tags.exif.get("GPSTimeStamp")
    parts = [number(one) for one in clock] if isinstance(clock, tuple | list) and len(clock) == 3 else []
    if not parts or not math.isfinite(day + sum(parts)):
        return NAN
    seconds = 3600 * parts[0] + 60 * parts[1] + parts[2]
    return day + seconds if 0 <= seconds < 86401 else NAN


def _stamp(said: str) -> float:
    # Cameras whose clock was never set begin in 1970, 1980 or 2000; the first two are no flights.
    return _within(stamp_s(said), EARLIEST_S, LATEST_S)


def _offset(said: str) -> float:
    if said == "Z":
        return 0.0
    found = re.fullmatch(r"([+-])(\d\d):?(\d\d)", said.strip())
    if found is None or int(found[2]) > 14 or int(found[3]) > 59:
        return NAN
    size = 3600.0 * int(found[2]) + 60.0 * int(found[3])
    return -size if found[1] == "-" else size


# -- focal lengths


def focal_px_of(tags: Tags, width: int, height: int) -> list[tuple[str, float]]:
    """Every statement of a focal length in px, with what it comes from, best first.

    Parameters
    ----------
    tags
        Of the image.
    width, height
        Of the pixels that are read, px.

    Returns
    -------
    list of (str, float)
        What it comes from, and px; empty where nothing is said. Size of a pixel is only taken from tags.
    """
    found: list[tuple[str, float]] = []
    if not width or not height:
        return found
    scale = max(width, height) / max(tags.width or width, tags.height or height)
    own = dewarped_of(tags)
    if not math.isfinite(own):
        own = number(tags.xmp.get("dji:CalibratedFocalLength"))
    if 0 < own < 1e6:
        found.append((CALIBRATED, own * scale))
    mm = _mm(tags)
    per_mm = [_per_mm(tags, axis) for axis in "XY"]
    if mm > 0 and all(map(math.isfinite, per_mm)):
        square = abs(per_mm[0] / per_mm[1] - 1) < 0.01
        # Some cameras write the size of their sensor where its resolution belongs: then pixels are square by
        # that reading, and by the standard's they are as oblong as the image.
        pitches = per_mm[0] / width, per_mm[1] / height
        if square:
            found.append((BY_SENSOR, mm * per_mm[0] * scale))
        elif abs(pitches[0] / pitches[1] - 1) < 0.01:
            found.append((BY_SIZE, mm / pitches[0]))
    if 0 < tags.view_deg < 179:
        found.append((BY_VIEW, width / 2 / math.tan(math.radians(tags.view_deg) / 2)))
    film = film_of(tags)
    if film > 0:
        found.append((BY_FILM, film * math.hypot(width, height) / DIAGONAL_35MM))
    return [(what, px) for what, px in found if 1 < px < 1e7]


def dewarped_of(tags: Tags) -> float:
    """Focal length of DJI's calibration of this very lens (DewarpData: a date; fx, fy, ...), px, or NaN."""
    given = tags.xmp.get("dji:DewarpData", "").partition(";")[2].split(",")
    both = [number(one) for one in given[:2]]
    usable = len(given) == 9 and all(0 < one < 1e6 for one in both) and abs(both[0] / both[1] - 1) < 0.05
    return math.sqrt(both[0] * both[1]) if usable else NAN


def focal_mm_of(tags: Tags) -> float:
    """Focal length, mm; NaN where it is not said."""
    return _within(_mm(tags), 0, 1e5)


def film_of(tags: Tags) -> float:
    """Focal length of a camera for 35 mm film with the same view, mm; NaN where it is not said."""
    return _within(number(tags.exif.get("FocalLengthIn35mmFilm")), 0, 1e5)


def _mm(tags: Tags) -> float:
    own = number(tags.xmp.get("camera:PerspectiveFocalLength"))
    if own > 0 and tags.xmp.get("camera:PerspectiveFocalLengthUnits", "mm") == "mm":
        return own
    return number(tags.exif.get("FocalLength"))


def _per_mm(tags: Tags, axis: str) -> float:
    value = number(tags.exif.get(f"FocalPlane{axis}Resolution"))
    unit = number(tags.exif.get("FocalPlaneResolutionUnit", 2))
    # 1 (none) and 2 are inches, by the standard; 3 cm, 4 mm, 5 um, as cameras use them.
    mm = {2.0: 25.4, 3.0: 10.0, 4.0: 1.0, 5.0: 1e-3}.get(unit, NAN)
    return value / mm if value > 0 else NAN
