"""RTKLIB positions (``.pos``): tracks that were computed afterwards, as `gnss`.

Calendar dates or weeks with their time; GPST, UTC or JST; latitude and longitude in degrees or in degrees,
minutes and seconds, or ECEF. The line of the header that names the columns says which. Baselines are refused:
they are of no place. Facts of the format: RTKLIB's manual, appendix B, and its output.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from datetime import UTC, datetime
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pymap3d

from wildlab.errors import WildlabError
from wildlab.flight.readers.logs.log import Array, Clock, RawLog, make_stream
from wildlab.flight.readers.tracks.judging import decode, gaps, judge, number, numbers, plural
from wildlab.flight.time.leap_seconds import GPS_START_S, WEEK_S, gps_to_utc

#: Quality of a solution -> kind of fix: fixed, float, by satellite, differential, single, precise point.
_FIXES = {1.0: 6.0, 2.0: 5.0, 3.0: 4.0, 4.0: 4.0, 5.0: 3.0, 6.0: 8.0, 7.0: 1.0}
_SPLIT = re.compile(r"[\s,;]+")
_CALENDAR = re.compile(r"(\d{4})/(\d{1,2})/(\d{1,2})", re.ASCII)
_CLOCK = re.compile(r"(\d{1,2}):(\d{1,2}):(\d{1,2}(?:\.\d*)?)", re.ASCII)
_NAMED = ("latitude", "x-ecef", "e-baseline")
#: What RTKLIB writes unless told otherwise, for a file whose header is gone.
_USUAL = "GPST latitude(deg) longitude(deg) height(m) Q ns sdn(m) sde(m) sdu(m) sdne(m) sdeu(m) sdun(m)"
_JST_S = 9 * 3600.0
#: RTKLIB writes up to 22 columns; a header may not ask for a table of any width.
MOST_COLUMNS = 64


class Layout(NamedTuple):
    """What the columns after the time are, the scale of the time, and what heights count from."""

    scale: str
    names: tuple[str, ...]
    above_sea: bool


def recognise(head: bytes, name: str) -> bool:
    """Whether a header names columns, or rows look as RTKLIB writes them."""
    lines = decode(head).splitlines()
    for line in lines:
        if line.startswith("%") and any(word in line for word in (*_NAMED, "program   : RTK")):
            return True
    rows = [_SPLIT.split(line.strip()) for line in lines[:5] if not line.startswith("%")]
    return bool(rows) and all(_plausible(row) for row in rows[: max(len(rows) - 1, 1)])


def _plausible(row: list[str]) -> bool:
    """A time, a place with as many digits as RTKLIB writes, and a quality."""
    if len(row) < 7 or not (_CALENDAR.fullmatch(row[0]) or re.fullmatch(r"\d{4}", row[0])):
        return False
    digits = [len(text.partition(".")[2]) for text in row[2:4]]
    values = numbers(row[2:7])
    return min(digits) >= 6 and bool(abs(values[0]) <= 90 and abs(values[1]) <= 360 and values[3] in range(8))


def read(path: Path, data: bytes, zone: str | None = None) -> RawLog:
    """Positions as RTKLIB wrote them, in order of time.

    Parameters
    ----------
    path
        Only for messages.
    data
        The whole file.
    zone
        Not needed: the header has the scale of its times.

    Returns
    -------
    RawLog
        ``gnss``; rows are lines of the file.

    Raises
    ------
    WildlabError
        Where the file has baselines, or no row that can be read.
    """
    found, bad, guessed = _rows(path, decode(data))
    if not found:
        problem = "has no position" + (f"; {plural(bad, 'line')} cannot be read" if bad else "")
        raise WildlabError(problem, "write the solution of RTKLIB again", file=path)
    pieces = [_columns(layout, lines) for layout, lines in found.items()]
    names = list(dict.fromkeys(name for piece in pieces for name in piece))
    counts = [len(lines) for lines in found.values()]
    columns = {
        name: np.concatenate(
            [piece.get(name, np.full(n, np.nan)) for piece, n in zip(pieces, counts, strict=True)]
        )
        for name in names
    }
    lines = np.concatenate([[at for at, _, _ in rows] for rows in found.values()]).astype(np.int64)
    time = columns["time_s"]
    in_file = np.argsort(lines, kind="stable")
    order = in_file[np.argsort(time[in_file], kind="stable")]
    notes = []
    if (np.diff(time[in_file]) < 0).any():
        notes.append("rows are not in order of time in the file; they were put in order")
    if guessed:
        notes.append(
            "no header names the columns: taken as latitude, longitude, ellipsoidal height, at GPS time"
        )
    columns = {name: values[order] for name, values in columns.items()}
    quality = columns.get("fix", np.full(len(order), np.nan))
    reasons = {"no fix": quality == 0.0, "estimated, not measured": quality == 1.0}
    stream = make_stream("gnss", columns, lines[order], "line", judge(columns, reasons))
    notes += gaps(columns["time_s"], stream.used)
    scales = {layout.scale for layout in found}
    base = "GPS time of the rows" if scales == {"GPST"} else "UTC of the log"
    ahead = np.nanmedian(columns["time_s"] - columns["time_log_s"])
    clock = Clock(base, offset_s=float(ahead), pairs=len(order))
    lost = (f"{plural(bad, 'line')} of {bad + len(order)} could not be read",) if bad else ()
    return RawLog("rtklib-pos", {"gnss": stream}, clock=clock, lost=lost, notes=tuple(notes))


_Row = tuple[int, float, list[str]]


def _rows(path: Path, text: str) -> tuple[dict[Layout, list[_Row]], int, bool]:
    """Rows by their layout: line, time in its own scale in s since 1970, and what follows it."""
    found: dict[Layout, list[_Row]] = {}
    layout: Layout | None = None
    above_sea = guessed = False
    bad = 0
    days: dict[str, float] = {}
    for at, line in enumerate(text.split("\n"), start=1):
        if not line.strip():
            continue
        if line.lstrip().startswith("%"):
            if "height=" in line:
                above_sea = "geodetic" in line
            if any(word in line for word in _NAMED):
                layout = _layout(path, line, above_sea)
            continue
        tokens = _SPLIT.split(line.strip())
        if layout is None:
            if not _plausible(tokens):
                bad += 1
                continue
            layout, guessed = _layout(path, _USUAL, False), True
        time = _time(tokens, days)
        rest = tokens[2:]
        if time is None or len(rest) < 3:
            bad += 1
            continue
        found.setdefault(layout, []).append((at, time, rest))
    return found, bad, guessed


def _layout(path: Path, line: str, above_sea: bool) -> Layout:
    words = [word for word in _SPLIT.split(line.strip(" \t\r%")) if word]
    if "e-baseline" in line:
        problem = "has baselines from its base station, and no places"
        fix = "write the solution as lat/lon/height (out-solformat = llh)"
        raise WildlabError(problem, fix, file=path)
    names: list[str] = []
    for word in words[1:]:
        name = word.partition("(")[0]
        # Degrees, minutes and seconds are three columns under one name.
        parts = ("", "_min", "_sec") if name in ("latitude", "longitude") and "(d'" in word else ("",)
        names += [name + part for part in parts]
    return Layout(words[0].upper(), tuple(names[:MOST_COLUMNS]), above_sea)


def _time(tokens: list[str], days: dict[str, float]) -> float | None:
    """s since 1970 in the file's own scale, of a date and a clock, or of a week and a time in it."""
    if len(tokens) < 2:
        return None
    if "/" not in tokens[0]:
        week, seconds = number(tokens[0]), number(tokens[1])
        fine = week.is_integer() and 0 <= seconds < WEEK_S and 0 <= week < 10000
        return GPS_START_S + week * WEEK_S + seconds if fine else None
    if tokens[0] not in days:
        date = _CALENDAR.fullmatch(tokens[0])
        try:
            year, month, day = map(int, date.groups()) if date else (0, 0, 0)
            days[tokens[0]] = datetime(year, month, day, tzinfo=UTC).timestamp()
        except (ValueError, OverflowError):
            days[tokens[0]] = np.nan
    clock = _CLOCK.fullmatch(tokens[1])
    if clock is None:
        return None
    hours, minutes, seconds = int(clock[1]), int(clock[2]), float(clock[3])
    value = days[tokens[0]] + hours * 3600.0 + minutes * 60.0 + seconds
    return value if np.isfinite(value) and hours < 25 and minutes < 60 and seconds < 61 else None


def _columns(layout: Layout, found: list[_Row]) -> dict[str, Array]:
    width = len(layout.names)
    flat = [token for _, _, rest in found for token in (rest + [""] * width)[:width]]
    values = dict(zip(layout.names, numbers(flat).reshape(len(found), width).T, strict=True))
    log = np.array([time for _, time, _ in found])
    time = log - _JST_S if layout.scale == "JST" else log
    columns = {"time_s": gps_to_utc(log - GPS_START_S) if layout.scale == "GPST" else time}
    columns["time_log_s"] = log

    def of(name: str) -> Array:
        return values.get(name, np.full(len(found), np.nan))

    if "x-ecef" in values:
        columns |= _from_ecef(of("x-ecef"), of("y-ecef"), of("z-ecef"), of)
    else:
        for name in ("latitude", "longitude"):
            whole = of(name)
            if f"{name}_min" in values:
                part = of(f"{name}_min") / 60.0 + of(f"{name}_sec") / 3600.0
                whole = whole + np.where(np.signbit(whole), -part, part)
            columns[f"{name}_deg"] = whole
        columns["height_sea_m" if layout.above_sea else "height_ellipsoid_m"] = of("height")
        columns["sd_horizontal_m"] = np.sqrt((of("sdn") ** 2 + of("sde") ** 2) / 2.0)
        columns["sd_vertical_m"] = of("sdu")
        columns["v_north_m_s"], columns["v_east_m_s"] = of("vn"), of("ve")
        columns["v_down_m_s"] = -of("vu")
    columns["satellites"] = of("ns")
    columns["fix"] = np.array([_FIXES.get(one, 0.0 if np.isfinite(one) else np.nan) for one in of("Q")])
    return {
        name: values
        for name, values in columns.items()
        if name.endswith("_deg") or name.startswith("time") or np.isfinite(values).any()
    }


def _from_ecef(x: Array, y: Array, z: Array, of: Callable[[str], Array]) -> dict[str, Array]:
    """Place, spreads and velocity of ECEF; on the axis of the Earth and within it there is no place."""
    inside = ~(np.hypot(np.hypot(x, y), z) > 1e6)
    x, y, z = (np.where(inside, np.nan, one) for one in (x, y, z))
    latitude, longitude, height = (np.asarray(one, float) for one in pymap3d.ecef2geodetic(x, y, z))
    sine, cosine = np.sin(np.radians(latitude)), np.cos(np.radians(latitude))
    east = np.stack(
        [-np.sin(np.radians(longitude)), np.cos(np.radians(longitude)), np.zeros_like(x)], axis=-1
    )
    up = np.stack([cosine * east[:, 1], -cosine * east[:, 0], sine], axis=-1)
    # The file has roots of variances, and of covariances with their sign.
    cov = np.empty((len(x), 3, 3))
    for i, j, name in ((0, 0, "x"), (1, 1, "y"), (2, 2, "z"), (0, 1, "xy"), (1, 2, "yz"), (0, 2, "zx")):
        root = of(f"sd{name}")
        cov[:, i, j] = cov[:, j, i] = root * np.abs(root)
    vertical = np.einsum("ni,nij,nj->n", up, cov, up)
    level = np.trace(cov, axis1=1, axis2=2) - vertical
    velocity = np.column_stack([of(f"v{axis}") for axis in "xyz"])
    return {
        "latitude_deg": latitude,
        "longitude_deg": longitude,
        "height_ellipsoid_m": height,
        "sd_horizontal_m": np.sqrt(np.maximum(level, 0.0) / 2.0),
        "sd_vertical_m": np.sqrt(np.maximum(vertical, 0.0)),
        "v_north_m_s": np.einsum("ni,ni->n", velocity, np.cross(up, east)),
        "v_east_m_s": np.einsum("ni,ni->n", velocity, east),
        "v_down_m_s": -np.einsum("ni,ni->n", velocity, up),
    }
