"""DJI's log of images (``_Timestamp.MRK``) of drones with RTK: when and where each was taken, as `triggers`.

A row has the number of the image, GPS time, what was added to the antenna's place to come to the camera's
(north, east, down, mm), then the camera's latitude, longitude and height above the ellipsoid, standard
deviations (north, east, up) and the state of the receiver. Facts of the format: DJI's user manuals.
"""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np

from wildlab.errors import WildlabError
from wildlab.flight.readers.logs.log import Clock, RawLog, make_stream
from wildlab.flight.readers.tracks.judging import decode, judge, numbers, plural
from wildlab.flight.time.leap_seconds import WEEK_S, week_to_utc

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


def recognise(head: bytes, name: str) -> bool:
    """Whether a row of such a log begins the file."""
    return any(_ROW.match(line) for line in decode(head).splitlines()[:5])


def read(path: Path, data: bytes, zone: str | None = None) -> RawLog:
    """Records of images.

    Parameters
    ----------
    path
        Only for messages.
    data
        The whole file.
    zone
        Not needed: rows have GPS time.

    Returns
    -------
    RawLog
        ``triggers``; rows are lines of the file.

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
    number, seconds, week, latitude, longitude, height, north, east, up, state = values
    in_week = seconds < WEEK_S
    time = np.where(in_week, week_to_utc(week, seconds), np.nan)
    fix = np.array([_FIXES.get(one, 3.0 if np.isfinite(one) else np.nan) for one in state.tolist()])
    columns = {
        "time_s": time,
        "time_log_s": week * WEEK_S + seconds,
        "number": number,
        "latitude_deg": latitude,
        "longitude_deg": longitude,
        "height_ellipsoid_m": height,
        "sd_horizontal_m": np.sqrt((north**2 + east**2) / 2.0),
        "sd_vertical_m": up,
        "fix": fix,
    }
    wrong = judge(columns, {"no fix": fix == 0.0})
    rows = [at for at, _ in found]
    stream = make_stream("triggers", columns, rows, "line", wrong)
    known = np.isfinite(time)
    ahead = float(np.median((time - columns["time_log_s"])[known])) if known.any() else 0.0
    clock = Clock("GPS weeks", offset_s=ahead, pairs=int(known.sum())) if known.any() else None
    bad = len(lines) - len(found)
    lost = (f"{plural(bad, 'line')} of {len(lines)} could not be read",) if bad else ()
    notes = ("places are the camera's: the way from the antenna is in them already",)
    return RawLog("dji-mrk", {"triggers": stream}, clock=clock, lost=lost, notes=notes)
