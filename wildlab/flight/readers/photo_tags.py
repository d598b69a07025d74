"""What stands in the headers of an image file (EXIF, XMP, FLIR's records), and what it means; no pixel is
decoded.

EXIF is read by Pillow. Properties of XMP are looked for by the prefixes that all makers write
(``drone-dji:GimbalYawDegree``, here ``dji:GimbalYawDegree``), so that a packet that is cut off or never was
XML is read as far as it goes, and nothing in it is obeyed.

A value is a number or NaN: place, heights, attitude, stamps, focal lengths. Nothing is guessed: the pitch
of a pixel is not looked up by the camera's name, and a height stands with what it counts from.
"""

from __future__ import annotations

import math
import re
import struct
import warnings
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from PIL import ExifTags, Image
from scipy.spatial.transform import Rotation

from wildlab.errors import WildlabError
from wildlab.flight.files import regular_size, unreadable
from wildlab.flight.readers.frames.image import MOST_BYTES
from wildlab.flight.readers.frames.thermal import (
    CAMERA,
    RAW,
    RECORDS,
    find_records,
    gather_pieces,
    open_image,
    record_order,
    segments_of,
)
from wildlab.flight.readers.text import LATEST_S, stamp_s

#: Bytes of XMP that are looked through.
MOST_XMP = 1_000_000
#: Name spaces by their prefixes; Pix4D's is used by Parrot, MicaSense, senseFly and others.
_PREFIXES = {"drone-dji": "dji", "drone-parrot": "parrot", "Camera": "camera", "FLIR": "flir"}
_PREFIXES["tiff"] = "tiff"
#: A property as an attribute, or as an element with text.
_PROPERTY = re.compile(
    rf"<?\b({'|'.join(_PREFIXES)}):(\w{{1,60}})\s*(?:=\s*[\"']([^\"'<>]{{0,400}})|>([^<>]{{1,400}})<)"
)


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
    problem: str = ""


def size_of(tags: Tags) -> tuple[int, int]:
    """Width and height of the pixels that are read, px: FLIR's raw image goes before the picture."""
    raw = tags.raw_width, tags.raw_height
    return raw if all(raw) else (tags.width, tags.height)


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
        size = regular_size(path, MOST_BYTES)
        with path.open("rb") as stream:
            records = stream.read(4) in RECORDS
            stream.seek(0)
            image = "" if records else open_image(stream)
            if isinstance(image, Image.Image):
                _read(image, found)
            elif records:
                _records(stream.read(), found)
            else:
                found.problem = image if size else "is empty"
    except FileNotFoundError:
        found.problem = "there is no such file"
    except WildlabError as error:
        found.problem = error.problem
    except OSError as error:
        found.problem = unreadable(error, path).problem
    return found


def _read(image: Image.Image, found: Tags) -> None:
    found.width, found.height = image.size
    packets = [image.info.get("xmp", b"")]
    try:
        with warnings.catch_warnings():
            # Pillow warns of what is broken and goes on; what is left is judged tag by tag.
            warnings.simplefilter("ignore")
            own = image.getexif()
            parts = [(dict(own), ExifTags.TAGS)]
            for pointer, names in ((0x8769, ExifTags.TAGS), (0x8825, ExifTags.GPSTAGS)):
                if pointer in own:
                    parts.append((dict(own.get_ifd(pointer)), names))
    except Exception:  # Pillow raises whatever comes first of a broken directory
        parts, found.problem = [], "its EXIF cannot be read"
    for tags, names in parts:
        for number, value in tags.items():
            if number == 0x02BC:
                packets.append(value)
            elif number in names:
                found.exif.setdefault(names[number], value)
    for packet in packets:
        content = packet.decode("utf-8", "replace") if isinstance(packet, bytes) else str(packet)
        for prefix, name, given, inside in _PROPERTY.findall(content[:MOST_XMP]):
            if value := (given or inside).strip():
                found.xmp.setdefault(f"{_PREFIXES[prefix]}:{name}", value)
    if records := gather_pieces(segments_of(image)):
        _records(records, found)


def _records(data: bytes, found: Tags) -> None:
    """Size of the raw image, and the view that the camera's record has."""
    try:
        records = find_records(data)
        if RAW in records:
            order = record_order(records[RAW])
            found.raw_width, found.raw_height = struct.unpack_from(f"{order}HH", records[RAW], 2)
        if CAMERA in records:
            record = records[CAMERA]
            (view,) = struct.unpack_from(f"{record_order(record)}f", record, 0x1B4)
            found.view_deg = float(view) if 0.1 < view < 179 else 0.0
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
    ways = (one for one in (given, sides) if all(map(math.isfinite, one)))
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
