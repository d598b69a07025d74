"""DJI subtitles (``.SRT``) beside a video: places as `gnss`, attitudes of aircraft and gimbal where they are.

Each aircraft writes them in its own way; a block is known by what stands in it, so that two ways in one file
do no harm. Wall clocks are local and carry no zone. Facts of the families: their files.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from datetime import UTC, datetime
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from wildlab.errors import WildlabError
from wildlab.flight.readers.logs.log import Array, Clock, RawLog, Stream, make_stream
from wildlab.flight.readers.tracks.judging import Mask, decode, drop_rare_heights, gaps, judge, number, plural
from wildlab.flight.time.zones import wall_to_utc

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
#: Names of the columns below.
_NAMES = ("latitude_deg", "longitude_deg", "height_home_m", "height_sea_m", "satellites")
_AIRCRAFT = ("roll_deg", "pitch_deg", "yaw_deg")
_GIMBAL = ("roll_world_deg", "pitch_world_deg", "yaw_world_deg")
_NO_ZONE = "local time without a zone"


class _Block(NamedTuple):
    """What one subtitle says."""

    code: float
    wall: float
    place: tuple[float, ...]
    aircraft: tuple[float, ...]
    gimbal: tuple[float, ...]
    #: Whether the place stood as longitude and latitude without names, and the height as `altitude`.
    unnamed: bool
    vague: bool


def recognise(head: bytes, name: str) -> bool:
    """Whether subtitles with words of DJI begin the file."""
    text = decode(head)
    return _CODES.search(text) is not None and _TRACE.search(text) is not None


def read(path: Path, data: bytes, zone: str | None = None) -> RawLog:
    """Subtitles of a video.

    Parameters
    ----------
    path
        Only for messages.
    data
        The whole file.
    zone
        Of the wall clock, as ``"Europe/Oslo"`` or ``"+02:00"``.

    Returns
    -------
    RawLog
        ``gnss``, and ``poses`` and ``gimbal`` where attitudes are said; rows are subtitles. Without a zone,
        rows with a wall clock are marked; where there is no clock at all, stamps are the subtitles' codes.

    Raises
    ------
    WildlabError
        Where no subtitle has a place, or the zone is none.
    """
    blocks, rows, bad = _blocks(decode(data))
    if not any(np.isfinite(block.place[0]) for block in blocks):
        bad += len(blocks)
        problem = f"{plural(bad, 'subtitle')}, and none with a place"
        fix = "switch video captions on in DJI's app before the flight, and take the aircraft's own file"
        raise WildlabError(problem, fix, file=path)
    place = np.array([block.place for block in blocks])
    notes: list[str] = []
    _turn(place, np.array([block.unnamed for block in blocks]), notes)
    times, clock, reasons = _times(blocks, zone, notes)
    columns = {**times, **_filled(_NAMES, place)}
    notes += drop_rare_heights(columns)
    if any(block.vague for block in blocks):
        notes.append("altitude is taken as height above take-off, which the file does not say")
    wrong = judge(columns, reasons)
    parts = {"gnss": make_stream("gnss", columns, rows, "subtitle", wrong)}
    # What is wrong with a place is no fault of an angle.
    in_time = {reason: mask for reason, mask in wrong.items() if "stamp" in reason or "time" in reason}
    for part, names, angles, before in (
        ("poses", _AIRCRAFT, np.array([block.aircraft for block in blocks]), columns),
        ("gimbal", _GIMBAL, np.array([block.gimbal for block in blocks]), times),
    ):
        if np.isfinite(angles).any():
            made = {name: values for name, values in before.items() if name != "satellites"}
            made |= dict(zip(names, angles.T, strict=True))
            why = wrong if part == "poses" else in_time
            parts[part] = _turned(part, made, angles, rows, why)
    notes += gaps(columns["time_s" if zone else "time_log_s"], parts["gnss"].used)
    lost = (f"{plural(bad, 'subtitle')} of {bad + len(blocks)} without a place",) if bad else ()
    return RawLog("dji-srt", parts, clock=clock, lost=lost, notes=tuple(notes))


def _turned(
    part: str, columns: dict[str, Array], angles: Array, rows: NDArray[np.int64], wrong: dict[str, Mask]
) -> Stream:
    reasons = {
        **wrong,
        "no attitude": np.isnan(angles).any(axis=1),
        "impossible attitude": (np.abs(angles) > 360.0).any(axis=1),
    }
    return make_stream(part, columns, rows, "subtitle", reasons)


def _filled(names: Sequence[str], values: Array) -> dict[str, Array]:
    return {
        name: values[:, n]
        for n, name in enumerate(names)
        if name.endswith("_deg") or np.isfinite(values[:, n]).any()
    }


def _blocks(text: str) -> tuple[list[_Block], NDArray[np.int64], int]:
    """Subtitles with a place, their numbers from 1, and how many have none."""
    found = list(_CODES.finditer(text))
    blocks: list[_Block] = []
    rows: list[int] = []
    for k, code in enumerate(found):
        end = found[k + 1].start() if k + 1 < len(found) else len(text)
        # No family writes more; what follows is no subtitle.
        block = _block(code, text[code.end() : min(end, code.end() + 4000)])
        if block is not None:
            blocks.append(block)
            rows.append(k + 1)
    return blocks, np.array(rows, np.int64), len(found) - len(blocks)


def _block(code: re.Match[str], body: str) -> _Block | None:
    groups = {name: said.split(",") for name, said in _GROUP.findall(body)}
    pairs = {name.lower(): number(value) for name, value in _PAIR.findall(body)}
    latitude, longitude = pairs.get("latitude", np.nan), pairs.get("longitude", np.nan)
    if np.isnan(longitude):
        # So the word stands in files of some aircraft.
        longitude = pairs.get("longtitude", np.nan)
    home, sea, satellites = pairs.get("rel_alt", np.nan), pairs.get("abs_alt", np.nan), np.nan
    unnamed = vague = False
    if "latitude" in pairs:
        vague = "altitude" in pairs and np.isnan(home) and np.isnan(sea)
        home = pairs.get("altitude", np.nan) if vague else home
    elif len(said := groups.get("GPS", [])) >= 2:
        first, second = _first(said[0]), _first(said[1])
        if len(said) > 2 and said[2].strip().upper().endswith("M"):
            # The family that says its height here has the latitude first.
            latitude, longitude = first, second
        else:
            longitude, latitude, unnamed = first, second, True
            satellites = _first(said[2]) if len(said) > 2 else np.nan
        height = _HEIGHT.search(body)
        home = number(height[1]) if height else pairs.get("barometer", np.nan)
    if "GPS" not in groups and (np.isnan(latitude) or np.isnan(longitude)):
        return None
    # Both are said as pitch, roll, yaw.
    pitch, roll, yaw = _three(groups.get("F.PRY"))
    gimbal = _three(groups.get("G.PRY"))
    if np.isnan(gimbal).all():
        gimbal = [pairs.get(f"gb_{name}", np.nan) for name in ("pitch", "roll", "yaw")]
    return _Block(
        _seconds(code.groups()[:4]),
        _wall(_WALL.search(body)),
        (latitude, longitude, home, sea, satellites),
        (roll, pitch, yaw),
        (gimbal[1], gimbal[0], gimbal[2]),
        unnamed,
        vague,
    )


def _first(text: str) -> float:
    found = _NUMBER.search(text)
    return number(found[0]) if found else np.nan


def _three(texts: list[str] | None) -> list[float]:
    return [_first(text) for text in texts] if texts and len(texts) == 3 else [np.nan] * 3


def _seconds(code: Sequence[str]) -> float:
    hours, minutes, seconds, part = code
    return int(hours) * 3600.0 + int(minutes) * 60.0 + int(seconds) + int(part) / 10.0 ** len(part)


def _wall(found: re.Match[str] | None) -> float:
    """A wall clock in s since 1970 as if it were UTC; parts of a second stand as ms, and as ms and us."""
    if found is None:
        return np.nan
    try:
        year, month, day, hour, minute, second = map(int, found.groups()[:6])
        at = datetime(year, month, day, hour, minute, second, tzinfo=UTC).timestamp()
    except (ValueError, OverflowError):
        return np.nan
    digits = (found[7] or "0").ljust(3, "0") + (found[8] or "0").rjust(3, "0")
    return at + int(digits) * 1e-6


def _turn(place: Array, unnamed: Mask, notes: list[str]) -> None:
    """Puts latitude and longitude of the unnamed in order where they can only stand the other way."""
    found = place[unnamed]
    if len(found) and (np.abs(found[:, 0]) > 90).mean() > 0.5 and (np.abs(found[:, 1]) <= 90).mean() > 0.5:
        place[unnamed, :2] = found[:, [1, 0]]
        notes.append("the numbers behind GPS can only be latitude and longitude, in this order")


def _times(
    blocks: list[_Block], zone: str | None, notes: list[str]
) -> tuple[dict[str, Array], Clock | None, dict[str, Mask]]:
    wall = np.array([block.wall for block in blocks])
    if np.isnan(wall).all():
        notes.append("no clock in it: stamps are those of the subtitles, from the beginning of the video")
        codes = np.array([block.code for block in blocks])
        again = np.diff(codes, prepend=-np.inf) <= 0
        reasons = {"repeated stamp": again}
        return {"time_s": np.full(len(wall), np.nan), "time_log_s": codes}, None, reasons
    clocked = np.isfinite(wall)
    if zone is None:
        notes.append("its clock is local time without a zone: state the zone")
        times = {"time_s": np.full(len(wall), np.nan), "time_log_s": wall}
        return times, Clock(_NO_ZONE, pairs=int(clocked.sum())), {_NO_ZONE: clocked, "no time": ~clocked}
    utc = wall_to_utc(wall, zone)
    ahead = float(np.median((utc - wall)[clocked]))
    clock = Clock(f"wall clock of zone {zone[:60]}", offset_s=ahead, pairs=int(clocked.sum()))
    return {"time_s": utc, "time_log_s": wall}, clock, {}
