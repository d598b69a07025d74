"""RTKLIB positions (``.pos``): tracks that were computed afterwards, as `gnss`.

Calendar dates or weeks with their time; GPST, UTC or JST; latitude and longitude in degrees or in degrees,
minutes and seconds, or ECEF. The line of the header that names the columns says which. Baselines are refused:
they are of no place. Facts of the format: RTKLIB's manual, appendix B, and its output.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pandas as pd
import pymap3d

from wildlab.errors import WildlabError
from wildlab.flight.readers import text
from wildlab.flight.readers.log import Array, Clock, Decoded, Readings
from wildlab.flight.readers.text import number, numbers, plural, stamp_s
from wildlab.flight.time_scales import GPS_START_S, WEEK_S, gps_to_utc

#: Quality of a solution -> kind of fix: fixed, float, by satellite, differential, single, precise point.
_FIXES = {1.0: 6.0, 2.0: 5.0, 3.0: 4.0, 4.0: 4.0, 5.0: 3.0, 6.0: 8.0, 7.0: 1.0}
_SPLIT = re.compile(r"[\s,;]+")
_CALENDAR = re.compile(r"(\d{4})/(\d{1,2})/(\d{1,2})", re.ASCII)
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


def sniff(head: bytes, name: str) -> bool:
    """Whether a header names columns, or rows look as RTKLIB writes them."""
    lines = text.decode(head).splitlines()
    for line in lines:
        if line.startswith("%") and any(word in line for word in (*_NAMED, "program   : RTK")):
            return True
    rows = [_SPLIT.split(line.strip()) for line in lines[:5] if not line.startswith("%")]
    return bool(rows) and all(_plausible(row) for row in rows[: max(len(rows) - 1, 1)])


def _plausible(row: list[str]) -> bool:
    """A time, a place with as many digits as RTKLIB writes, and a quality."""
    if len(row) < 7 or not (_CALENDAR.fullmatch(row[0]) or re.fullmatch(r"\d{4}", row[0])):
        return False
    digits = [len(cell.partition(".")[2]) for cell in row[2:4]]
    values = numbers(row[2:7])
    return min(digits) >= 6 and bool(abs(values[0]) <= 90 and abs(values[1]) <= 360 and values[3] in range(8))


def decode(path: Path, data: bytes, zone: str | None = None) -> Decoded:
    """Positions as RTKLIB wrote them, in order of time; rows are lines of the file.

    Raises
    ------
    WildlabError
        Where the file has baselines, or no row that can be read.
    """
    found, bad, guessed = _rows(path, text.decode(data))
    if not found:
        problem = "has no position" + (f"; {plural(bad, 'line')} cannot be read" if bad else "")
        raise WildlabError(problem, "write the solution of RTKLIB again", file=path)
    table = pd.concat([pd.DataFrame(_columns(layout, rows)) for layout, rows in found.items()])
    table["line"] = [at for rows in found.values() for at, _, _ in rows]
    table = table.sort_values("line", kind="stable")
    notes = {
        "rows are not in order of time in the file; they were put in order": (
            (np.diff(table["time_s"]) < 0).any()
        ),
        "no header names the columns: taken as latitude, longitude, ellipsoidal height, at GPS time": guessed,
    }
    table = table.sort_values("time_s", kind="stable")
    columns = {str(name): values.to_numpy() for name, values in table.items()}
    lines = columns.pop("line")
    reasons = {"no fix": columns["fix"] == 0.0, "estimated, not measured": columns["fix"] == 1.0}
    base = "GPS time of the rows" if {one.scale for one in found} == {"GPST"} else "UTC of the log"
    ahead = float(np.nanmedian(columns["time_s"] - columns["time_log_s"]))
    return Decoded(
        {"gnss": Readings(columns, lines, "line", reasons)},
        clock=Clock(base, offset_s=ahead, pairs=len(lines)),
        lost=[(bad, "line", f"of {bad + len(lines)} could not be read")],
        notes=[said for said, holds in notes.items() if holds],
    )


_Row = tuple[int, float, list[str]]


def _rows(path: Path, said: str) -> tuple[dict[Layout, list[_Row]], int, bool]:
    """Rows by their layout: line, time in its own scale in s since 1970, and what follows it."""
    found: dict[Layout, list[_Row]] = {}
    layout: Layout | None = None
    above_sea = guessed = False
    bad = 0
    for at, line in enumerate(said.split("\n"), start=1):
        if not line.strip():
            continue
        if line.lstrip().startswith("%"):
            if "height=" in line:
                above_sea = "geodetic" in line
            if any(word in line for word in _NAMED):
                layout = _layout(path, line, above_sea)
            continue
        cells = _SPLIT.split(line.strip())
        if layout is None and _plausible(cells):
            layout, guessed = _layout(path, _USUAL, False), True
        time = _time(cells)
        if layout is None or not np.isfinite(time) or len(cells) < 5:
            bad += 1
        else:
            found.setdefault(layout, []).append((at, time, cells[2:]))
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


def _time(cells: list[str]) -> float:
    """s since 1970 in the file's own scale, of a date and a clock, or of a week and a time in it, or NaN."""
    if "/" in cells[0]:
        return stamp_s(" ".join(cells[:2]))
    week, seconds = map(number, [*cells, ""][:2])
    fine = week.is_integer() and 0 <= seconds < WEEK_S and 0 <= week < 10000
    return GPS_START_S + week * WEEK_S + seconds if fine else np.nan


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
    return columns


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
