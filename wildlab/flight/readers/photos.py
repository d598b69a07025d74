"""A folder of images as a raw log: one row for each, with what stands in its headers (EXIF, XMP, FLIR's
records), and what it means; no pixel is decoded.

EXIF is read by Pillow. Properties of XMP are looked for by the prefixes that all makers write
(``drone-dji:GimbalYawDegree``, here ``dji:GimbalYawDegree``), so that a packet that is cut off or never was
XML is read as far as it goes, and nothing in it is obeyed.

A value is a number or NaN: place, heights, attitude, stamps, focal lengths. Nothing is guessed: the pitch
of a pixel is not looked up by the camera's name, and a height stands with what it counts from. A row with
``use`` 1 has a place and a height that can be a pose; one without is still an image, and its stamp may be as
good. Two images may have one stamp (cameras beside each other, or clocks that count whole seconds).
"""

from __future__ import annotations

import math
import re
import struct
import warnings
from collections import Counter
from dataclasses import dataclass, field, replace
from datetime import datetime
from pathlib import Path
from typing import Any

import numpy as np
from PIL import ExifTags, Image
from scipy.spatial.transform import Rotation

from wildlab.errors import WildlabError
from wildlab.flight.clock_fitting import wall_to_utc
from wildlab.flight.files import regular_size, unreadable
from wildlab.flight.manifest import CameraPart
from wildlab.flight.readers.frames.image import (
    CAMERA,
    MOST_BYTES,
    RAW,
    RECORDS,
    SUFFIXES,
    file_name,
    find_records,
    gather_pieces,
    no_images,
    open_image,
    record_order,
    segments_of,
)
from wildlab.flight.readers.log import ANGLES, WORLD, RawLog, Stream, any_of, holding, named
from wildlab.flight.readers.text import LATEST_S, plural, stamp_s, told
from wildlab.geometry.frames import Array

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
    """Tags of a JPEG, PNG, TIFF or ``.fff``; what cannot be read is left out and said in `Tags.problem`."""
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
    with warnings.catch_warnings():
        # Straight down there is one turn about the vertical; it stands in yaw.
        warnings.simplefilter("ignore")
        turned = (down * Rotation.from_euler("Y", -90, degrees=True)).as_euler("ZYX", degrees=True)
    return float(turned[2]), float(turned[1]), float(turned[0])


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
    try:
        offset = datetime.strptime(said.strip(), "%z").utcoffset()
    except ValueError:
        return NAN
    return NAN if offset is None else _within(offset.total_seconds(), -54001, 54001)


# -- focal lengths


def focal_px_of(tags: Tags, width: int, height: int) -> tuple[str, float]:
    """The best statement of a focal length in px, behind what it comes from; "" and NaN where there is none.

    Parameters
    ----------
    tags
        Of the image.
    width, height
        Of the pixels that are read, px.

    Returns
    -------
    str and float
        Size of a pixel is only taken from tags.
    """
    found: list[tuple[str, float]] = []
    if not width or not height:
        return "", NAN
    scale = max(width, height) / max(tags.width or width, tags.height or height)
    own = dewarped_of(tags)
    if not math.isfinite(own):
        own = number(tags.xmp.get("dji:CalibratedFocalLength"))
    if 0 < own < 1e6:
        found.append((CALIBRATED, own * scale))
    mm = _mm(tags)
    per_mm = [_per_mm(tags, axis) for axis in "XY"]
    if mm > 0 and abs(per_mm[0] / per_mm[1] - 1) < 0.01:
        found.append((BY_SENSOR, mm * per_mm[0] * scale))
    # Some cameras write the size of their sensor where its resolution belongs: then pixels are square by that
    # reading, and by the standard's they are as oblong as the image.
    elif mm > 0 and abs(per_mm[0] / width * height / per_mm[1] - 1) < 0.01:
        found.append((BY_SIZE, mm * width / per_mm[0]))
    if 0 < tags.view_deg < 179:
        found.append((BY_VIEW, width / 2 / math.tan(math.radians(tags.view_deg) / 2)))
    film = number(tags.exif.get("FocalLengthIn35mmFilm"))
    if 0 < film < 1e5:
        found.append((BY_FILM, film * math.hypot(width, height) / DIAGONAL_35MM))
    return next(((what, px) for what, px in found if 1 < px < 1e7), ("", NAN))


def dewarped_of(tags: Tags) -> float:
    """Focal length of DJI's calibration of this very lens (DewarpData: a date; fx, fy, ...), px, or NaN."""
    given = tags.xmp.get("dji:DewarpData", "").partition(";")[2].split(",")
    both = [number(one) for one in given[:2]]
    usable = len(given) == 9 and all(0 < one < 1e6 for one in both) and abs(both[0] / both[1] - 1) < 0.05
    return math.sqrt(both[0] * both[1]) if usable else NAN


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


# -- folders

#: Images of a folder at most.
MOST_IMAGES = 200_000
#: Endings of images that are none of `SUFFIXES`.
OTHERS = frozenset(
    {".dng", ".heic", ".heif", ".raw", ".arw", ".cr2", ".cr3", ".nef", ".rw2", ".webp", ".bmp"}
)
#: Endings of names, and of DJI's ImageSource, by what the camera beside others is.
_LENSES = {"t": "thermal", "w": "wide", "z": "zoom", "v": "visual", "r": "thermal"}
_SOURCES = {"infrared": "thermal", "thermal": "thermal", "wide": "wide", "zoom": "zoom", "visible": "visual"}


def natural_key(name: str) -> list[tuple[int, int, str]]:
    """A key that sorts names as people count: ``b9`` before ``b10``.

    Examples
    --------
    >>> sorted(["b10", "b9", "A1"], key=natural_key)
    ['A1', 'b9', 'b10']
    """
    parts = re.findall(r"[0-9]{1,18}|[^0-9]+", name.lower())
    return [(0, int(one), "") if one[0] in "0123456789" else (1, 0, one) for one in parts]


def is_photos(folder: Path) -> bool:
    """Whether a folder itself holds images that can be read."""
    try:
        return folder.is_dir() and any(one.suffix.lower() in SUFFIXES for one in folder.iterdir())
    except OSError:
        return False


_HEIGHTS = ("height_ellipsoid_m", "height_sea_m", "height_home_m")
#: Columns -> what gives them of the tags of an image.
_COLUMNS: dict[tuple[str, ...], Any] = {
    _HEIGHTS: heights_of,
    ANGLES: airframe_of,
    WORLD: camera_angles_of,
    ("sd_horizontal_m", "sd_vertical_m"): spreads_of,
}
#: A camera's clock that scatters more about GPS than this is not one clock, s.
ONE_CLOCK_S = 5.0
#: A clock that differs more from GPS than a stamp of whole seconds and a slow shutter explain, s.
OFF_S = 2.0
#: What is said of a clock without a zone, and what others are known from.
LOCAL, BY_GPS, BY_ZONE = "local time without a zone", "GPS time of the images", "zones that the images state"


def folder_decode(folder: Path, zone: str | None) -> RawLog:
    """The images of a folder and of all folders below it, as a card has them: ``100MEDIA``, ``101MEDIA``.

    Parameters
    ----------
    folder
        Of images, or of folders of images.
    zone
        Of the camera's clock where images do not say it: ``"Europe/Oslo"``, ``"+02:00"``.

    Returns
    -------
    RawLog
        With the part ``photos``, by folders and in the order of names; files of folders below have names
        with ``/``. Angles of the airframe are ``roll_deg`` and so on, those of the optical axis
        ``roll_world_deg`` and so on. Sizes are those of the pixels that are read: of FLIR's raw image,
        where there is one.

    Raises
    ------
    WildlabError
        Where there is no image, or the zone is none.
    """
    paths, lost = _files(folder)
    tags = [read_tags(path) for path in paths]
    sizes = [size_of(one) for one in tags]
    latitude, longitude, reasons = zip(*[place_of(one) for one in tags], strict=True)
    above = [one.parent.relative_to(folder).as_posix() for one in paths]
    files = [
        file_name(path) if place == "." else f"{place}/{file_name(path)}"
        for path, place in zip(paths, above, strict=True)
    ]
    cameras = _cameras(files, tags, sizes)
    focal = [focal_px_of(one, *size) for one, size in zip(tags, sizes, strict=True)]
    columns: dict[str, Any] = {"file": files, "latitude_deg": latitude, "longitude_deg": longitude}
    for names, of in _COLUMNS.items():
        table = named(names, np.array([of(one) for one in tags], float).T)
        columns |= {name: values for name, values in table.items() if np.isfinite(values).any()}
    high = any_of([np.isfinite(columns[name]) for name in _HEIGHTS if name in columns], len(tags))
    why = [why or ("" if up else "no height") for why, up in zip(reasons, high, strict=True)]
    columns |= {
        "fix": [fix_of(one) for one in tags],
        "width_px": [width or NAN for width, _ in sizes],
        "height_px": [height or NAN for _, height in sizes],
        "focal_px": [px for _, px in focal],
        "focal_from": [how for how, _ in focal],
        "camera": cameras,
    }
    wall, time = np.full((2, len(tags)), NAN)
    clocks: Counter[str] = Counter()
    notes: list[str] = []
    # Cameras beside each other have folders of their own.
    for place in dict.fromkeys(above):
        rows = np.flatnonzero(np.array(above) == place)
        wall[rows], time[rows], clock, said = _times([tags[row] for row in rows], zone)
        clocks[clock] += len(rows)
        notes += said
    problems = Counter(one.problem for one in tags if one.problem)
    makers = {name for name in cameras if name}
    part = Stream(
        columns | {"time_log_s": wall, "time_s": time},
        unusable={reason: np.array(why) == reason for reason in dict.fromkeys(why) if reason},
        counted_in="image",
    )
    return RawLog(
        {"photos": part},
        vehicle=makers.pop() if len(makers) == 1 else "",
        clock=max(clocks, key=clocks.__getitem__, default=""),
        lost=told(*lost, *((count, "image", f": {what}") for what, count in problems.items())),
        notes=[*notes, *_notes(tags, cameras, why)],
    )


def _files(folder: Path) -> tuple[list[Path], list[tuple[int, str, str]]]:
    """Images of a folder and those below as people count, and what is left out; nothing hidden."""
    try:
        there = [
            one
            for one in folder.rglob("*")
            if not any(part.startswith(".") for part in one.relative_to(folder).parts)
        ]
    except OSError as error:
        raise unreadable(error, folder) from None
    paths = [one for one in there if one.suffix.lower() in SUFFIXES and not one.is_dir()]
    if not paths:
        raise no_images(folder)

    def key(path: Path) -> tuple[Any, ...]:
        place = path.parent.relative_to(folder).as_posix()
        return natural_key(place), natural_key(path.name), path.name

    others = Counter(end for one in there if (end := one.suffix.lower()) in OTHERS)
    left = [(count, "image", f"{end}: this kind is not read") for end, count in sorted(others.items())]
    left.append((max(len(paths) - MOST_IMAGES, 0), "image", f"beyond the first {MOST_IMAGES:,}"))
    return sorted(paths, key=key)[:MOST_IMAGES], left


def _times(tags: list[Tags], zone: str | None) -> tuple[Array, Array, str, list[str]]:
    """The camera's clock as if it were UTC, and UTC, (N,) s since 1970; how the one became the other; notes.

    The camera's clock has the intervals, and satellites or a zone bring it to UTC: a stamp of GPS may be of
    the second before, or of the last fix.
    """
    wall, ahead = np.array([wall_of(one) for one in tags], float).reshape(-1, 2).T
    sky = np.array([satellite_time_of(one) for one in tags], float)
    both, stated = np.isfinite(sky - wall), np.isfinite(ahead)
    if not np.isfinite(wall).any():
        timed = bool(np.isfinite(sky).any())
        return sky, sky, BY_GPS if timed else "", [] if timed else ["no image carries a time"]
    apart = float(np.median((sky - wall)[both])) if both.any() else NAN
    zone_s = float(np.median(ahead[stated])) if stated.any() else NAN
    left = np.abs((sky - wall)[both] - apart)
    spread = 1.4826 * float(np.median(left)) if both.any() else 0.0
    if stated.any() and (stated.all() or not both.any()):
        # Where one image does not state its zone, the others' is that of the same clock.
        time = wall - np.where(stated, ahead, zone_s)
        clock = BY_ZONE
    elif both.any():
        time = np.where(np.isfinite(wall), wall + apart, sky) if spread <= ONE_CLOCK_S else sky
        clock = BY_GPS
    elif zone is not None:
        time = wall_to_utc(wall, zone)
        clock = f"local time of the zone {zone}"
    else:
        time, clock = np.full(len(wall), NAN), LOCAL
    without = int(np.isnan(np.fmax(wall, sky)).sum())
    notes = {
        f"the camera's clock, which is used, is {-(apart + zone_s):+.0f} s from the GPS time in the images": (
            clock == BY_ZONE and spread <= ONE_CLOCK_S and abs(apart + zone_s) > OFF_S
        ),
        "the camera's clock is not steady: GPS time is used": clock == BY_GPS and spread > ONE_CLOCK_S,
        "the camera's clock is local time: state its zone": clock == LOCAL,
        f"{plural(without, 'image')} without a time": without,
    }
    return wall, time, clock, holding(notes)


def _notes(tags: list[Tags], cameras: list[str], why: list[str]) -> list[str]:
    """What a user should know of a folder: cameras, sizes, heights."""
    notes: Counter[str] = Counter(one for one in why if one)
    rtk = [rtk_of(one) for one in tags]
    fixed = [one in RTK_FIXES for one in rtk]
    notes["heights with RTK count from the ellipsoid"] = sum(fixed)
    if any(fixed):
        notes["RTK was lost: heights count from sea level"] = sum(one >= 0 for one in rtk) - sum(fixed)
    notes["distortion of DewarpData is not used"] = sum(
        math.isfinite(dewarped_of(one)) and one.xmp.get("dji:DewarpFlag", "0") != "1" for one in tags
    )
    notes["DJI's absolute altitude may be tens of metres off (barometer)"] = sum(
        "dji:AbsoluteAltitude" in one.xmp and not ok for one, ok in zip(tags, fixed, strict=True)
    )
    several = Counter(one or "a camera without a name" for one in cameras)
    names = "; ".join(f"{name} ({plural(count, 'image')})" for name, count in several.most_common(8))
    return [
        *([f"there are {len(several)} cameras: {names}"] if len(several) > 1 else []),
        *(f"{plural(count, 'image')}: {text}" for text, count in notes.items() if count),
    ]


def _cameras(files: list[str], tags: list[Tags], sizes: list[tuple[int, int]]) -> list[str]:
    names = []
    for file, one in zip(files, tags, strict=True):
        make, model = (
            text(one.exif.get(tag)) or text(one.xmp.get(f"tiff:{tag}")) for tag in ("Make", "Model")
        )
        name = (
            model if make and model.lower().startswith(make.split()[0].lower()) else f"{make} {model}".strip()
        )
        source = one.xmp.get("dji:ImageSource", "").lower()
        lens = next((what for part, what in _SOURCES.items() if part in source), "")
        ending = re.search(r"_([TWZVR])(?:_\w*)?\.\w+$", file, re.I)
        if not lens and ending and (name or one.exif):
            lens = _LENSES[ending[1].lower()]
        names.append(", ".join(part for part in (name, lens) if part))
    # One name with several sizes is several cameras in one housing.
    several: dict[str, set[tuple[int, int]]] = {}
    for name, size in zip(names, sizes, strict=True):
        if all(size):
            several.setdefault(name, set()).add((max(size), min(size)))
    return [
        f"{name}, {max(size)} x {min(size)}".removeprefix(", ")
        if len(several.get(name, ())) > 1 and all(size)
        else name
        for name, size in zip(names, sizes, strict=True)
    ]


def of_camera(log: RawLog, camera: str) -> RawLog:
    """The images of one camera, by its name as ``camera`` has it."""
    stream = log.parts["photos"]
    return replace(log, parts={**log.parts, "photos": stream.take(stream.columns["camera"] == camera)})


def camera_of(
    log: RawLog, stated: CameraPart | None = None, focal_px: float | None = None
) -> tuple[CameraPart | None, str]:
    """The one camera of a folder and how it is known, in a clause; or None and why it is not.

    What the user states, the camera or its focal length alone, counts for more than the tags.
    """
    columns = log.parts["photos"].columns
    every = np.column_stack([columns["width_px"], columns["height_px"]])
    known = np.isfinite(every).all(axis=1)
    sizes = np.unique(every[known], axis=0)
    if stated is not None:
        own = (stated.width_px, stated.height_px)
        if len(sizes) and (sizes != own).any():
            seen = ", ".join("{:.0f} x {:.0f}".format(*one) for one in sizes[:4])
            return None, f"the stated camera has {own[0]} x {own[1]} px, and they have {seen}"
        return stated, "as you stated it"
    names = sorted({str(one) for one in columns.get("camera", np.full(len(known), ""))[known]})
    if len(names) > 1 and focal_px is None:
        said = ", ".join(one or "one without a name" for one in names[:5])
        return None, f"they are of {len(names)} cameras: {said}"
    if len(sizes) != 1:
        return None, "they are of several sizes" if len(sizes) else "nothing says how large they are"
    width, height = map(int, sizes[0])
    how = "as you stated it"
    if focal_px is None:
        focal = columns["focal_px"][known]
        if not np.isfinite(focal).any():
            return None, "no tag has the focal length in pixels"
        focal_px = float(np.nanmedian(focal))
        if np.nanmax(np.abs(focal / focal_px - 1)) > 0.02:
            least, most = np.nanmin(focal), np.nanmax(focal)
            return None, f"the focal length changes from {least:.0f} to {most:.0f} px: the lens zooms"
        how = Counter(str(each) for each in columns["focal_from"][known] if each).most_common(1)[0][0]
        if how == BY_FILM:
            film = focal_px * DIAGONAL_35MM / math.hypot(width, height)
            how += f" of {film:g} mm over the diagonal, rounded to within {50 / film:.0f} %"
    camera = CameraPart(
        name=(names[0] if len(names) == 1 else "") or "not stated",
        width_px=width,
        height_px=height,
        fx_px=focal_px,
        fy_px=focal_px,
        cx_px=(width - 1) / 2,
        cy_px=(height - 1) / 2,
    )
    how = f"{width} x {height} px, focal length {focal_px:.0f} px ({how})"
    return camera, f"{how}; a central principal point, no distortion"
