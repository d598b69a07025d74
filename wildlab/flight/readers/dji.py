"""What DJI aircraft write beside their pictures: subtitles of videos, and records of images.

Subtitles (``.SRT``) are `gnss`, and attitudes of aircraft and gimbal where they are. Each aircraft writes
them in its own way; a block is known by what stands in it, so that two ways in one file do no harm. Wall
clocks are local and carry no zone. Facts of the families: their files.

The log of images (``_Timestamp.MRK``) of drones with RTK is `triggers`. A row has the number of the image,
GPS time, what was added to the antenna's place to come to the camera's (north, east, down, mm), then the
camera's latitude, longitude and height above the ellipsoid, standard deviations (north, east, up) and the
state of the receiver. Facts of the format: DJI's user manuals.
"""

from __future__ import annotations

import re
from pathlib import Path
from typing import NamedTuple

import numpy as np

from wildlab.errors import WildlabError
from wildlab.flight.readers.log import Array, Clock, Decoded, Mask, Readings
from wildlab.flight.readers.text import calendar_s, decode, number, numbers, plural
from wildlab.flight.time.leap_seconds import WEEK_S, week_to_utc
from wildlab.flight.time.zones import wall_to_utc

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
_PLACE = ("latitude_deg", "longitude_deg", "height_home_m", "height_sea_m", "satellites")
#: Both are said as pitch, roll, yaw.
_AIRCRAFT = ("pitch_deg", "roll_deg", "yaw_deg")
_GIMBAL = ("pitch_world_deg", "roll_world_deg", "yaw_world_deg")


class _Block(NamedTuple):
    """What one subtitle says: seconds, `_PLACE`, `_AIRCRAFT` and `_GIMBAL`.

    `unnamed`: the place stood as longitude and latitude without names; `vague`: the height as `altitude`.
    """

    code: float
    wall: float
    place: list[float]
    aircraft: list[float]
    gimbal: list[float]
    unnamed: bool
    vague: bool


def srt_sniff(head: bytes, name: str) -> bool:
    """Whether subtitles with words of DJI begin the file."""
    text = decode(head)
    return _CODES.search(text) is not None and _TRACE.search(text) is not None


def srt_decode(path: Path, data: bytes, zone: str | None = None) -> Decoded:
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
    ends = [one.start() for one in found[1:]] + [len(text)]
    # No family writes more; what follows is no subtitle.
    read = [
        _block(code, text[code.end() : min(end, code.end() + 4000)])
        for code, end in zip(found, ends, strict=True)
    ]
    rows = [at for at, one in enumerate(read, 1) if one is not None]
    blocks = [one for one in read if one is not None]
    if not any(np.isfinite(block.place[0]) for block in blocks):
        problem = f"{plural(len(found), 'subtitle')}, and none with a place"
        fix = "switch video captions on in DJI's app before the flight, and take the aircraft's own file"
        raise WildlabError(problem, fix, file=path)
    place = np.array([block.place for block in blocks])
    turned = _turn(place, np.array([block.unnamed for block in blocks]))
    times, clock, reasons = _times(blocks, zone)
    notes = {
        "the numbers behind GPS can only be latitude and longitude, in this order": turned,
        "no clock in it: stamps are those of the subtitles, from the beginning of the video": clock is None,
        "its clock is local time without a zone: state the zone": NO_ZONE in reasons,
        "altitude is taken as height above take-off, which the file does not say": any(
            block.vague for block in blocks
        ),
    }
    columns = {**times, **dict(zip(_PLACE, place.T, strict=True))}
    parts = {"gnss": Readings(columns, rows, "subtitle", reasons)}
    placed = {name: values for name, values in columns.items() if name != "satellites"}
    for part, names, before in (("poses", _AIRCRAFT, placed), ("gimbal", _GIMBAL, times)):
        angles = np.array([block.aircraft if part == "poses" else block.gimbal for block in blocks])
        if np.isfinite(angles).any():
            made = before | dict(zip(names, angles.T, strict=True))
            parts[part] = Readings(made, rows, "subtitle", reasons)
    bad = len(found) - len(blocks)
    return Decoded(
        parts,
        clock=clock,
        lost=[(bad, "subtitle", f"of {len(found)} without a place")],
        notes=[said for said, holds in notes.items() if holds],
    )


def _block(code: re.Match[str], body: str) -> _Block | None:
    groups = {name: said.split(",") for name, said in _GROUP.findall(body)}
    pairs = {name.lower(): number(value) for name, value in _PAIR.findall(body)}

    def of(*names: str) -> float:
        return next((pairs[name] for name in names if np.isfinite(pairs.get(name, np.nan))), np.nan)

    # So the word stands in files of some aircraft.
    latitude, longitude = of("latitude"), of("longitude", "longtitude")
    home, sea, satellites = of("rel_alt"), of("abs_alt"), np.nan
    unnamed = vague = False
    if "latitude" in pairs:
        vague = "altitude" in pairs and np.isnan(home) and np.isnan(sea)
        home = of("altitude") if vague else home
    elif len(said := groups.get("GPS", [])) >= 2:
        longitude, latitude = _first(said[0]), _first(said[1])
        # The family that says its height here has the latitude first.
        unnamed = len(said) == 2 or not said[2].strip().upper().endswith("M")
        if unnamed:
            satellites = _first(said[2]) if len(said) > 2 else np.nan
        else:
            latitude, longitude = longitude, latitude
        height = _HEIGHT.search(body)
        home = number(height[1]) if height else of("barometer")
    if "GPS" not in groups and (np.isnan(latitude) or np.isnan(longitude)):
        return None
    gimbal = _three(groups.get("G.PRY"))
    if np.isnan(gimbal).all():
        gimbal = [of(f"gb_{name}") for name in ("pitch", "roll", "yaw")]
    hours, minutes, seconds, part = code.groups()[:4]
    return _Block(
        int(hours) * 3600.0 + int(minutes) * 60.0 + int(seconds) + int(part) / 10.0 ** len(part),
        _wall(_WALL.search(body)),
        [latitude, longitude, home, sea, satellites],
        _three(groups.get("F.PRY")),
        gimbal,
        unnamed,
        vague,
    )


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


def _turn(place: Array, unnamed: Mask) -> bool:
    """Puts latitude and longitude of the unnamed in order where they can only stand the other way."""
    found = np.abs(place[unnamed])
    if not len(found) or (found[:, 0] > 90).mean() <= 0.5 or (found[:, 1] <= 90).mean() <= 0.5:
        return False
    place[unnamed, :2] = place[unnamed][:, [1, 0]]
    return True


def _times(blocks: list[_Block], zone: str | None) -> tuple[dict[str, Array], Clock | None, dict[str, Mask]]:
    wall = np.array([block.wall for block in blocks])
    none = np.full(len(wall), np.nan)
    clocked = np.isfinite(wall)
    if not clocked.any():
        return {"time_s": none, "time_log_s": np.array([block.code for block in blocks])}, None, {}
    if zone is None:
        times = {"time_s": none, "time_log_s": wall}
        return times, Clock(NO_ZONE, pairs=int(clocked.sum())), {NO_ZONE: clocked, "no time": ~clocked}
    utc = wall_to_utc(wall, zone)
    ahead = float(np.median((utc - wall)[clocked]))
    clock = Clock(f"wall clock of zone {zone[:60]}", offset_s=ahead, pairs=int(clocked.sum()))
    return {"time_s": utc, "time_log_s": wall}, clock, {}


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


def mrk_sniff(head: bytes, name: str) -> bool:
    """Whether a row of a log of images begins the file."""
    return any(_ROW.match(line) for line in decode(head).splitlines()[:5])


def mrk_decode(path: Path, data: bytes, zone: str | None = None) -> Decoded:
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
        raise WildlabError(problem, "copy the file from the aircraft's card again", file=path)
    values = numbers(text for _, row in found for text in row).reshape(len(found), 10).T
    count, seconds, week, latitude, longitude, height, north, east, up, state = values
    time = np.where(seconds < WEEK_S, week_to_utc(week, seconds), np.nan)
    fix = np.array([_FIXES.get(one, 3.0 if np.isfinite(one) else np.nan) for one in state.tolist()])
    columns = {
        **{"time_s": time, "time_log_s": week * WEEK_S + seconds, "number": count},
        **{"latitude_deg": latitude, "longitude_deg": longitude, "height_ellipsoid_m": height},
        **{"sd_horizontal_m": np.sqrt((north**2 + east**2) / 2.0), "sd_vertical_m": up, "fix": fix},
    }
    known = np.isfinite(time)
    ahead = float(np.median((time - columns["time_log_s"])[known])) if known.any() else 0.0
    return Decoded(
        {"triggers": Readings(columns, [at for at, _ in found], "line", {"no fix": fix == 0.0})},
        clock=Clock("GPS weeks", offset_s=ahead, pairs=int(known.sum())) if known.any() else None,
        lost=[(len(lines) - len(found), "line", f"of {len(lines)} could not be read")],
        notes=["places are the camera's: the way from the antenna is in them already"],
    )
