"""What DJI aircraft write: subtitles of videos, records of images, and flight records as AirData exports
them.

Subtitles (``.SRT``) are `gnss`, and attitudes of aircraft and gimbal where they are. Each aircraft writes
them in its own way; a block is known by what stands in it, so that two ways in one file do no harm. Wall
clocks are local and carry no zone. Facts of the families: their files.

The log of images (``_Timestamp.MRK``) of drones with RTK is `triggers`. A row has the number of the image,
GPS time, what was added to the antenna's place to come to the camera's (north, east, down, mm), then the
camera's latitude, longitude and height above the ellipsoid, standard deviations (north, east, up) and the
state of the receiver. Facts of the format: DJI's user manuals.

Rows of AirData's tables (CSV), in metres or in feet, carry a counter of milliseconds, and UTC in whole
seconds beside it, which the fraction was cut off of. The counter stands still while the record pauses, so
that each stretch between pauses has an offset of its own.
"""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pandas as pd

from wildlab.errors import WildlabError
from wildlab.flight.clock_fitting import WEEK_S, wall_to_utc, week_to_utc
from wildlab.flight.readers.log import ANGLES, PLACE, UTC_OF_LOG, WORLD, RawLog, Stream, holding, named
from wildlab.flight.readers.text import (
    calendar_s,
    decode,
    header_of,
    number,
    numbers,
    plural,
    read_text_table,
    stamp_s,
    told,
)
from wildlab.flight.schema import VELOCITY
from wildlab.geometry.frames import Array, Mask

#: What is said of a clock without a zone.
NO_ZONE = "local time without a zone"

# -- subtitles

_CODE = r"(\d{1,3}):(\d\d):(\d\d)[,.](\d{1,3})"
_CODES = re.compile(rf"{_CODE} *--> *{_CODE}", re.ASCII)
_WALL = re.compile(
    r"(\d{4})[-./](\d\d)[-./](\d\d) +(\d\d):(\d\d):(\d\d)(?:[,.](\d{1,3})(?:,(\d{1,3}))?)?", re.ASCII
)
#: ``GPS (a, b, c)`` and its like.
_GROUP = re.compile(r"\b(GPS|F\.PRY|G\.PRY) {0,2}\(([^()\n]{0,100})\)")
#: ``[latitude: 1.0]``, ``[rel_alt: 1.0 abs_alt: 2.0]``, ``BAROMETER:1.0M``.
_PAIR = re.compile(r"\b([A-Za-z_]{1,30}) {0,2}: {0,2}(-?\d{1,12}(?:\.\d{1,15})?)", re.ASCII)
_HEIGHT = re.compile(r"[ ,]H (-?\d{1,6}(?:\.\d{1,6})?)m", re.ASCII)
_NUMBER = re.compile(r"-?\d{1,12}(?:\.\d{1,15})?", re.ASCII)
_TRACE = re.compile(r"GPS {0,2}\(|\[\s*l(?:atitude|ong)|BAROMETER|SrtCnt|FrameCnt")
_PLACE = ("latitude_deg", "longitude_deg", "height_home_m", "height_sea_m")
#: Both are said as pitch, roll, yaw.
_AIRCRAFT = ("pitch_deg", "roll_deg", "yaw_deg")
_GIMBAL = ("pitch_world_deg", "roll_world_deg", "yaw_world_deg")


def srt_sniff(head: bytes) -> bool:
    """Whether subtitles with words of DJI begin the file."""
    text = decode(head)
    return _CODES.search(text) is not None and _TRACE.search(text) is not None


def srt_decode(path: Path, data: bytes, zone: str | None) -> RawLog:
    """Subtitles of a video, a row each.

    Without a zone, rows with a wall clock are marked; where there is no clock at all, stamps are the
    subtitles' codes.

    Raises
    ------
    WildlabError
        Where no subtitle has a place, or the zone is none.
    """
    text = decode(data)
    found = list(_CODES.finditer(text))
    ends = [*(one.start() for one in found[1:]), len(text)][: len(found)]
    # No family writes more; what follows is no subtitle.
    read = [
        _block(code, text[code.end() : min(end, code.end() + 4000)])
        for code, end in zip(found, ends, strict=True)
    ]
    rows = [at for at, one in enumerate(read, 1) if one]
    table = pd.DataFrame([one for one in read if one])
    if not len(table) or not table["latitude_deg"].notna().any():
        problem = f"{plural(len(found), 'subtitle')}, and none with a place"
        fix = "switch video captions on in DJI's app"
        raise WildlabError(problem, fix, file=path)
    columns = {str(name): one.to_numpy(float) for name, one in table.items()}
    times, clock, reasons = _times(columns["code"], columns["wall"], zone)
    notes = {
        "it has no clock: stamps count from the beginning of the video": not clock,
        "its clock is local time without a zone: state the zone": NO_ZONE in reasons,
        "altitude is taken as height above take-off": columns["vague"].any(),
    }
    parts = {"gnss": (*_PLACE, "satellites"), "poses": (*_PLACE, *_AIRCRAFT), "gimbal": _GIMBAL}
    made = {
        part: Stream(times | {name: columns[name] for name in names}, rows, "subtitle", reasons)
        for part, names in parts.items()
        if np.isfinite(columns[names[-1]]).any() or part == "gnss"
    }
    lost = told((len(found) - len(rows), "subtitle", f"of {len(found)} without a place"))
    return RawLog(made, clock=clock, lost=lost, notes=holding(notes))


def _block(code: re.Match[str], body: str) -> dict[str, float]:
    """What one subtitle says, empty where it says no place; `vague`: the height stood as `altitude`."""
    groups = {name: said.split(",") for name, said in _GROUP.findall(body)}
    pairs = {name.lower(): number(value) for name, value in _PAIR.findall(body)}

    def of(*names: str) -> float:
        return next((pairs[name] for name in names if np.isfinite(pairs.get(name, np.nan))), np.nan)

    # So the word stands in files of some aircraft.
    latitude, longitude = of("latitude"), of("longitude", "longtitude")
    home, sea, satellites = of("rel_alt"), of("abs_alt"), np.nan
    vague = "latitude" in pairs and "altitude" in pairs and np.isnan(home) and np.isnan(sea)
    if vague:
        home = of("altitude")
    elif "latitude" not in pairs and len(said := groups.get("GPS", [])) >= 2:
        longitude, latitude = _first(said[0]), _first(said[1])
        # The family that says its height here has the latitude first.
        if len(said) > 2 and said[2].strip().upper().endswith("M"):
            latitude, longitude = longitude, latitude
        elif len(said) > 2:
            satellites = _first(said[2])
        height = _HEIGHT.search(body)
        home = number(height[1]) if height else of("barometer")
    if "GPS" not in groups and np.isnan(latitude + longitude):
        return {}
    gimbal = _three(groups.get("G.PRY"))
    if np.isnan(gimbal).all():
        gimbal = [of(f"gb_{name}") for name in ("pitch", "roll", "yaw")]
    hours, minutes, seconds, part = code.groups()[:4]
    return {
        "code": int(hours) * 3600.0 + int(minutes) * 60.0 + int(seconds) + int(part) / 10.0 ** len(part),
        "wall": _wall(_WALL.search(body)),
        **named(_PLACE, (latitude, longitude, home, sea)),
        "satellites": satellites,
        **named(_AIRCRAFT, _three(groups.get("F.PRY"))),
        **named(_GIMBAL, gimbal),
        "vague": float(vague),
    }


def _first(text: str) -> float:
    found = _NUMBER.search(text)
    return number(found[0]) if found else np.nan


def _three(texts: list[str] | None) -> list[float]:
    return [_first(text) for text in texts] if texts and len(texts) == 3 else [np.nan] * 3


def _wall(found: re.Match[str] | None) -> float:
    """A wall clock in s since 1970 as if it were UTC; parts of a second stand as ms, and as ms and us."""
    if found is None:
        return np.nan
    digits = (found[7] or "0").ljust(3, "0") + (found[8] or "0").rjust(3, "0")
    return calendar_s(*found.groups()[:6]) + int(digits) * 1e-6


def _times(code: Array, wall: Array, zone: str | None) -> tuple[dict[str, Array], str, dict[str, Mask]]:
    none = np.full(len(wall), np.nan)
    clocked = np.isfinite(wall)
    if not clocked.any():
        return {"time_s": none, "time_log_s": code}, "", {}
    if zone is None:
        times = {"time_s": none, "time_log_s": wall}
        return times, NO_ZONE, {NO_ZONE: clocked, "no time": ~clocked}
    utc = wall_to_utc(wall, zone)
    return {"time_s": utc, "time_log_s": wall}, f"wall clock of zone {zone[:60]}", {}


# -- records of images

_N = r"(-?\d{1,9}(?:\.\d{1,12})?)"
_GAP = r"[ \t,]{1,20}"
_ROW = re.compile(
    rf"[ \t]{{0,20}}(\d{{1,7}}){_GAP}(\d{{1,6}}(?:\.\d{{1,12}})?){_GAP}\[(\d{{1,5}})\]"
    # The offsets, which the place has in it already, and which some rows leave out.
    rf"(?:{_GAP}-?\d{{1,9}}(?:\.\d{{1,9}})?,[NEV]){{0,3}}"
    rf"{_GAP}{_N},[ ]?Lat{_GAP}{_N},[ ]?Lon{_GAP}{_N},[ ]?Ellh"
    rf"(?:{_GAP}{_N}{_GAP}{_N}{_GAP}{_N})?(?:{_GAP}(\d{{1,3}}),[ ]?Q)?",
    re.ASCII,
)
#: State of the receiver -> kind of fix: none, single, by satellite, float, fixed.
_FIXES = {0.0: 0.0, 16.0: 3.0, 17.0: 4.0, 34.0: 5.0, 50.0: 6.0}


def mrk_sniff(head: bytes) -> bool:
    """Whether a row of a log of images begins the file."""
    return any(_ROW.match(line) for line in decode(head).splitlines()[:5])


def mrk_decode(path: Path, data: bytes, zone: str | None) -> RawLog:
    """Records of images, a line each.

    Raises
    ------
    WildlabError
        Where no line can be read.
    """
    lines = [(at, line) for at, line in enumerate(decode(data).split("\n"), 1) if line.strip("\r\x00 \t")]
    found = [(at, match.groups()) for at, line in lines if (match := _ROW.match(line))]
    if not found:
        problem = f"{plural(len(lines), 'line')}, and none is a record of an image"
        raise WildlabError(problem, "copy it from the card again", file=path)
    values = numbers(text for _, row in found for text in row).reshape(len(found), 10).T
    count, seconds, week, latitude, longitude, height, north, east, up, state = values
    time = np.where(seconds < WEEK_S, week_to_utc(week, seconds), np.nan)
    fix = np.array([_FIXES.get(one, 3.0 if np.isfinite(one) else np.nan) for one in state.tolist()])
    columns = {
        "time_s": time,
        "time_log_s": week * WEEK_S + seconds,
        "number": count,
        "latitude_deg": latitude,
        "longitude_deg": longitude,
        "height_ellipsoid_m": height,
        "sd_horizontal_m": np.sqrt((north**2 + east**2) / 2.0),
        "sd_vertical_m": up,
        "fix": fix,
    }
    return RawLog(
        {"triggers": Stream(columns, [at for at, _ in found], "line")},
        clock="GPS weeks",
        lost=told((len(lines) - len(found), "line", f"of {len(lines)} could not be read")),
        notes=["places are those of the camera, not the antenna"],
    )


# -- AirData

#: m, or m/s, in a unit as headers have it.
_UNITS = {
    "meters": 1.0,
    "m": 1.0,
    "feet": 0.3048,
    "ft": 0.3048,
    "m/s": 1.0,
    "mph": 0.44704,
    "km/h": 1 / 3.6,
    "kmh": 1 / 3.6,
    "kph": 1 / 3.6,
    "knots": 1852 / 3600,
    "kn": 1852 / 3600,
    "ft/s": 0.3048,
    "degrees": 1.0,
    "deg": 1.0,
    "millisecond": 1e-3,
    "ms": 1e-3,
    "": 1.0,
}
#: Our name -> names in headers, in lower case and without anything but letters; the first there is counts.
_COLUMNS = {
    "time_log_s": ("time",),
    "latitude_deg": ("latitude",),
    "longitude_deg": ("longitude",),
    "height_home_m": ("heightabovetakeoff", "ascent"),
    "height_sea_m": ("altitudeabovesealevel",),
    "v_north_m_s": ("xspeed",),
    "v_east_m_s": ("yspeed",),
    "v_down_m_s": ("zspeed",),
    "roll_deg": ("roll",),
    "pitch_deg": ("pitch",),
    "yaw_deg": ("compassheading",),
    "satellites": ("satellites",),
    "roll_world_deg": ("gimbalroll",),
    "pitch_world_deg": ("gimbalpitch",),
    "yaw_world_deg": ("gimbalheading", "gimbalyaw"),
    "photo": ("isphoto",),
}
#: A gimbal that keeps its heading within this, while the aircraft turns by more than that, degrees.
_STILL_DEG, _TURNED_DEG = 2.0, 45.0
#: The counter and the clock part by more than this in a pause only, s; fewer rows are no stretch.
_PAUSE_S, _FEW = 1.5, 10


def airdata_sniff(head: bytes) -> bool:
    """Whether the first line has AirData's columns of UTC and place."""
    return {"datetime_utc", "latitude", "longitude"} <= set(header_of(head))


def airdata_decode(path: Path, data: bytes, zone: str | None) -> RawLog:
    """A flight record, a row for each line.

    Raises
    ------
    WildlabError
        Where columns are missing, a unit is unknown, or no row can be read.
    """
    table = read_text_table(data, path)
    header = [_name_and_unit(one) for one in table.header]
    names = [name for name, _ in header]
    missing = [one for one in ("latitude", "longitude", "datetimeutc") if one not in names]
    if missing:
        problem = f"has no column {missing[0]!r}"
        raise WildlabError(problem, "export the flight from AirData again", file=path, field="header")
    cells = table.rows
    columns: dict[str, Array] = {}
    for ours, theirs in _COLUMNS.items():
        place = next((names.index(name) for name in theirs if name in names), None)
        if place is not None:
            columns[ours] = numbers(row[place] for row in cells) * _unit(path, ours, header[place])
    clocks = [row[names.index("datetimeutc")] for row in cells]
    known = {one: stamp_s(one) for one in set(clocks)}
    whole = np.array([known[one] for one in clocks])
    notes: list[str] = []
    own = columns.get("time_log_s", np.full(len(whole), np.nan))
    time = _fraction(own, whole, notes)
    times = {"time_s": time, "time_log_s": own if np.isfinite(own).any() else whole}
    return RawLog(
        _parts(times, columns, np.array(table.lines), notes),
        clock=UTC_OF_LOG if np.isfinite(whole).any() else "",
        lost=told(table.lost()),
        notes=notes,
    )


def _parts(
    times: dict[str, Array],
    columns: dict[str, Array],
    rows: Array,
    notes: list[str],
) -> dict[str, Stream]:
    def of(*names: str) -> dict[str, Array]:
        return times | {name: columns[name] for name in names if name in columns}

    parts = {"gnss": of(*PLACE, *VELOCITY, "satellites")}
    if all(np.isfinite(columns.get(name, np.nan)).any() for name in ANGLES):
        parts["poses"] = of(*PLACE, *VELOCITY, *ANGLES)
    if {"pitch_world_deg", "yaw_world_deg"} <= set(columns):
        parts["gimbal"] = of(*WORLD)
        if "yaw_deg" in columns:
            notes += _heading_that_stands(columns["yaw_world_deg"], columns["yaw_deg"])
    photo = np.nan_to_num(columns.get("photo", np.zeros(len(rows)))) > 0
    taken = photo & ~np.r_[False, photo[:-1]]
    made = {name: Stream(one, rows, "line") for name, one in parts.items()}
    if taken.any():
        own = {name: values[taken] for name, values in of(*PLACE, *ANGLES).items()}
        own["number"] = np.arange(1.0, taken.sum() + 1)
        made["triggers"] = Stream(own, rows[taken], "line")
    return made


def _heading_that_stands(gimbal: Array, aircraft: Array) -> list[str]:
    """A heading of the gimbal that does not follow the aircraft cannot count from north."""
    known = [np.unwrap(np.radians(one[np.isfinite(one)])) for one in (gimbal, aircraft)]
    if min(map(len, known)) < 2:
        return []
    still, turned = (float(np.degrees(np.ptp(one))) for one in known)
    if still >= _STILL_DEG or turned <= _TURNED_DEG:
        return []
    return [
        f"the gimbal's heading stays within {still:.2g} deg while the aircraft turns by {turned:.0f} deg: it "
        "hardly counts from north"
    ]


def _name_and_unit(cell: str) -> tuple[str, str]:
    """A column's name without anything but letters, and its unit."""
    name, _, unit = cell.partition("(")
    name, unit = re.sub(r"[^a-z]", "", name.lower()), unit.strip(") ").lower()
    # "datetime(utc)" and "datetime(local)" are two columns.
    return (name + unit if name == "datetime" else name), unit


def _unit(path: Path, ours: str, column: tuple[str, str]) -> float:
    name, unit = column
    if ours in ("satellites", "photo"):
        return 1.0
    if unit not in _UNITS:
        problem = f"has the unit {unit[:20]!r}, which is not known"
        raise WildlabError(problem, "export the flight in metric units", file=path, field=name)
    return _UNITS[unit]


def _fraction(own: Array, whole: Array, notes: list[str]) -> Array:
    """Stamps in whole seconds made finer by a counter, which stands still between stretches."""
    lack = pd.Series(whole - own)
    if lack.isna().all() or (whole[np.isfinite(whole)] % 1 > 0).any():
        return whole
    # Within a stretch the two differ by a constant, less the part of a second that was cut off.
    stretches = lack.groupby((lack.ffill().diff().abs() > _PAUSE_S).cumsum())
    constant = (stretches.max() + stretches.min() + 1.0) / 2.0
    stood = constant.diff()[stretches.size() >= _FEW].dropna()
    if len(stood):
        notes.append(
            f"the counter of milliseconds stood still {plural(len(stood), 'time')}, "
            f"{stood.sum():.1f} s together: each stretch has its own offset"
        )
    return own + constant[stretches.ngroup()].to_numpy()
