"""Tracks of one receiver as `gnss`: GPX (1.0 and 1.1), and RTKLIB's positions (``.pos``).

Points of a damaged GPX are salvaged one by one; one that declares a document type or entities is refused,
before any parser sees it. Elevations are above sea level, as the standard has it.

Of RTKLIB, calendar dates or weeks with their time, in GPST or UTC, latitude and longitude in degrees. The
line of the header that names the columns says which. Other solutions are refused, with what to set. Facts of
the format: RTKLIB's manual, appendix B, and its output.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from datetime import UTC, datetime
from pathlib import Path
from xml.etree.ElementTree import Element

import numpy as np

from wildlab.errors import WildlabError
from wildlab.flight.readers import text
from wildlab.flight.readers.log import Array, Clock, Decoded, Readings, holding, level_velocity, named
from wildlab.flight.readers.text import number, numbers, parse_xml, plural, stamp_s
from wildlab.flight.time_scales import GPS_START_S, WEEK_S, gps_to_utc

# -- GPX

#: Kinds of fix as GPX names them, as numbers.
_FIXES = {"none": 0.0, "2d": 2.0, "3d": 3.0, "dgps": 4.0, "pps": 3.0}
#: Our columns -> elements of a point.
_ELEMENTS = {
    "height_sea_m": "ele",
    "undulation_m": "geoidheight",
    "satellites": "sat",
    "hdop": "hdop",
    "speed": "speed",
    "course": "course",
}
_POINT = re.compile(r"<trkpt\b[^<>]*?(?:/>|>.*?</trkpt\s*>)", re.DOTALL)


def gpx_sniff(head: bytes) -> bool:
    """Whether a file begins as GPX."""
    return re.search(r"<(?:\w+:)?gpx[\s>]", text.decode(head[:-1] if len(head) % 2 else head)) is not None


def gpx_decode(path: Path, data: bytes, zone: str | None) -> Decoded:
    """The tracks of a GPX file, all segments in order of time; rows are points as counted in the file.

    Raises
    ------
    WildlabError
        Where the file declares entities or a document type, or has no point of a track.
    """
    declared = re.match(rb"\s*<\?xml[^>]*encoding=[\"'](iso-8859-\d{1,2}|windows-125\d)[\"']", data, re.I)
    content = data.decode(declared[1].decode(), "replace") if declared else text.decode(data)
    content = content.replace("\0", "")
    if re.search(r"<!\s*(DOCTYPE|ENTITY|ELEMENT|ATTLIST|NOTATION)", content, re.IGNORECASE):
        problem = "declares a document type or entities, which no GPX needs"
        raise WildlabError(problem, "export the track again", file=path)
    prefix = re.search(r"<(\w+):gpx[\s>]", content)
    if prefix:
        content = re.sub(rf"<(/?){prefix[1]}:", r"<\1", content)
    segments: list[dict[str, Array]] = []
    broken = 0
    for segment in re.split(r"</trkseg\s*>", content):
        # Each piece is searched once, so that points that never end cost no more than others.
        pieces = re.split(r"(?=<trkpt\b)", segment)[1:]
        columns = _columns(_points([point[0] for point in map(_POINT.match, pieces) if point]))
        placed = np.isfinite(columns["latitude_deg"] + columns["longitude_deg"])
        broken += len(pieces) - int(placed.sum())
        segments += [{name: one[placed] for name, one in columns.items()}] if placed.any() else []
    if not segments:
        problem = "has no point of a track" + (f"; {broken} are broken" if broken else "")
        raise WildlabError(problem, "export the recorded track, not a route or waypoints", file=path)
    starts = [next(iter(one["time_s"][np.isfinite(one["time_s"])]), np.nan) for one in segments]
    # Some programs write the newest track first.
    order = np.argsort(starts, kind="stable") if np.isfinite(starts).all() else np.arange(len(starts))
    counts = np.cumsum([0, *(len(one["fix"]) for one in segments)])
    rows = 1 + np.concatenate([np.arange(counts[k], counts[k + 1]) for k in order])
    columns = {name: np.concatenate([segments[k][name] for k in order]) for name in segments[0]}
    timed = int((columns["time_s"] >= GPS_START_S).sum())
    notes = {
        "segments are not in order of time in the file; they were put in order": (np.diff(order) < 0).any(),
        "no point carries a time that can be true: as a track over time it is of no use": not timed,
    }
    return Decoded(
        {"gnss": Readings(columns, rows, "point", {"no fix": columns["fix"] == 0.0})},
        clock=Clock("UTC of the log", pairs=timed) if timed else None,
        lost=[(broken, "point", f"of {broken + len(columns['fix'])} could not be read")],
        notes=holding(notes),
    )


def _points(points: list[str]) -> list[Element]:
    """Points that can be read: halves are tried where a whole cannot be."""
    # A prefix that nobody declared would spoil the point: what it names is not read anyway.
    body = re.sub(r"<(/?)[\w.-]+:([\w.-]+)", r"<\1\2", "".join(points))
    body = re.sub(r"\s[\w.-]+:[\w.-]+\s*=", " other=", body)
    try:
        return list(parse_xml(f"<points>{body}</points>".encode("utf-8", "replace")))
    except WildlabError:
        middle = len(points) // 2
        return _points(points[:middle]) + _points(points[middle:]) if middle else []


def _columns(points: Sequence[Element]) -> dict[str, Array]:
    time = np.array([_seconds(point.findtext("time", "")) for point in points])
    columns = {
        "time_s": time,
        "time_log_s": time,
        **{f"{one}itude_deg": numbers(point.get(one[:3]) for point in points) for one in ("lat", "long")},
        **{
            ours: numbers(point.findtext(tag, "").strip() for point in points)
            for ours, tag in _ELEMENTS.items()
        },
        "fix": np.array([_FIXES.get(point.findtext("fix", "").strip(), np.nan) for point in points]),
    }
    # GPX 1.0 knows speed in m/s and course from true north.
    return columns | level_velocity(columns.pop("speed"), columns.pop("course"))


def _seconds(said: str) -> float:
    try:
        at = datetime.fromisoformat(said.strip())
        return (at if at.tzinfo is not None else at.replace(tzinfo=UTC)).timestamp()
    except (OverflowError, ValueError):
        return np.nan


# -- RTKLIB

#: Kind of fix by the quality: none, fixed, float, by satellite, differential, single, precise, estimated.
_QUALITY = np.array([0.0, 6.0, 5.0, 4.0, 4.0, 3.0, 8.0, 1.0])
_SPLIT = re.compile(r"[\s,;]+")
#: Words that only the line of the header with the names of columns has.
_NAMED = re.compile("latitude|x-ecef|e-baseline")
#: RTKLIB writes up to 22 columns; a header may not ask for a table of any width.
MOST_COLUMNS = 64


def pos_sniff(head: bytes) -> bool:
    """Whether a header names columns, or rows look as RTKLIB writes them."""
    lines = text.decode(head).splitlines()
    return any(one.startswith("%") and re.search(f"{_NAMED.pattern}|program   : RTK", one) for one in lines)


def pos_decode(path: Path, data: bytes, zone: str | None) -> Decoded:
    """Positions as RTKLIB wrote them, in order of time; rows are lines of the file.

    Raises
    ------
    WildlabError
        Where the solution is no latitude and longitude in GPST or UTC, its columns change within the file, or
        no row can be read.
    """
    lines = [(at, line.strip()) for at, line in enumerate(text.decode(data).split("\n"), 1) if line.strip()]
    comments = [line for _, line in lines if line.startswith("%")]
    cells = [(at, _SPLIT.split(line)) for at, line in lines if not line.startswith("%")]
    headers = list(dict.fromkeys(line for line in comments if _NAMED.search(line)))
    scale, *names = _SPLIT.split((headers or [""])[0].strip(" \t\r%"))[:MOST_COLUMNS]
    if len(headers) > 1 or (headers and ("latitude(deg)" not in names or scale not in ("GPST", "UTC"))):
        problem = f"is a solution of the kind {' '.join([scale, *names[:2]])[:60]!r}"
        problem = "changes its columns within the file" if len(headers) > 1 else problem
        fix = "write it with out-solformat = llh, out-degform = deg, out-timesys = gpst"
        raise WildlabError(problem, fix, file=path, field="header")
    rows = [(at, time, row[2:]) for at, row in cells if len(row) > 4 and np.isfinite(time := _time(row))]
    bad = len(cells) - len(rows) if names else len(cells)
    if not rows or not names:
        problem = "has no position" + (f"; {plural(bad, 'line')} cannot be read" if bad else "")
        raise WildlabError(problem, "write the solution of RTKLIB again, with its header", file=path)
    flat = [cell for _, _, row in rows for cell in (row + [""] * len(names))[: len(names)]]
    values = named((name.partition("(")[0] for name in names), numbers(flat).reshape(len(rows), -1).T)

    def of(name: str) -> Array:
        return values.get(name, np.full(len(rows), np.nan))

    own = np.array([time for _, time, _ in rows])
    above_sea = any("height=" in line and "geodetic" in line for line in comments)
    quality = of("Q")
    known = np.isin(quality, range(8))
    columns = {
        "time_s": gps_to_utc(own - GPS_START_S) if scale == "GPST" else own,
        "time_log_s": own,
        **{f"{name}_deg": of(name) for name in ("latitude", "longitude")},
        "height_sea_m" if above_sea else "height_ellipsoid_m": of("height"),
        "sd_horizontal_m": np.sqrt((of("sdn") ** 2 + of("sde") ** 2) / 2.0),
        "sd_vertical_m": of("sdu"),
        "satellites": of("ns"),
        "v_north_m_s": of("vn"),
        "v_east_m_s": of("ve"),
        "v_down_m_s": -of("vu"),
        "fix": np.where(
            known, _QUALITY[np.where(known, quality, 0).astype(int)], np.where(np.isnan(quality), np.nan, 0.0)
        ),
    }
    order = np.argsort(columns["time_s"], kind="stable")
    notes = {
        "rows are not in order of time in the file; they were put in order": (
            (np.diff(columns["time_s"]) < 0).any()
        ),
    }
    columns = {name: one[order] for name, one in columns.items()}
    reasons = {"no fix": columns["fix"] == 0.0, "estimated, not measured": columns["fix"] == 1.0}
    base = "GPS time of the rows" if scale == "GPST" else "UTC of the log"
    return Decoded(
        {"gnss": Readings(columns, np.array([at for at, _, _ in rows])[order], "line", reasons)},
        clock=Clock.shifted(base, columns["time_log_s"], columns["time_s"]),
        lost=[(bad, "line", f"of {bad + len(rows)} could not be read")],
        notes=holding(notes),
    )


def _time(row: list[str]) -> float:
    """s since 1970 in the file's own scale, of a date and a clock, or of a week and a time in it, or NaN."""
    if "/" in row[0]:
        return stamp_s(" ".join(row[:2]))
    week, seconds = map(number, row[:2])
    fine = week.is_integer() and 0 <= seconds < WEEK_S and 0 <= week < 10000
    return GPS_START_S + week * WEEK_S + seconds if fine else np.nan
