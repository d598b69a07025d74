"""GPX (1.0 and 1.1): tracks of hand-held receivers, phones and watches, as `gnss`.

A file that declares a document type or entities is refused, before any parser sees it. Points of a damaged
file are salvaged one by one. Elevations are above sea level, as the standard has it.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from datetime import UTC
from pathlib import Path

import gpxpy
import gpxpy.gpx
import numpy as np

from wildlab.errors import WildlabError
from wildlab.flight.readers.logs.log import Array, Clock, RawLog, make_stream
from wildlab.flight.readers.tracks.judging import decode, drop_rare_heights, gaps, judge, plural

#: GPX has a depth of five; extensions add a few.
DEEPEST = 64
#: Kinds of fix as GPX names them, as numbers.
_FIXES = {"none": 0.0, "2d": 2.0, "3d": 3.0, "dgps": 4.0, "pps": 3.0}
_TAG = re.compile(r"<(/?)[A-Za-z_][^<>]*?(/?)>")
_POINT = re.compile(r"<trkpt\b[^<>]*?(?:/>|>.*?</trkpt\s*>)", re.DOTALL)
_NEXT_POINT = re.compile(r"(?=<trkpt\b)")
_SEGMENT_END = re.compile(r"</trkseg\s*>")

Point = gpxpy.gpx.GPXTrackPoint


def recognise(head: bytes, name: str) -> bool:
    """Whether a file begins as GPX."""
    return re.search(r"<(?:\w+:)?gpx[\s>]", decode(head[:-1] if len(head) % 2 else head)) is not None


def read(path: Path, data: bytes, zone: str | None = None) -> RawLog:
    """The tracks of a GPX file, all segments in order of time.

    Parameters
    ----------
    path
        Only for messages.
    data
        The whole file.
    zone
        Not needed: GPX has UTC.

    Returns
    -------
    RawLog
        ``gnss``; rows are points as they are counted in the file.

    Raises
    ------
    WildlabError
        Where the file declares entities or a document type, is nested too deeply, or has no point of a track.
    """
    text = _text(data)
    if re.search(r"<!\s*(DOCTYPE|ENTITY|ELEMENT|ATTLIST|NOTATION)", text, re.IGNORECASE):
        problem = "declares a document type or entities, which no GPX needs"
        raise WildlabError(problem, "export the track again, or delete the declaration", file=path)
    if _depth(text) > DEEPEST:
        problem = f"is nested more than {DEEPEST} deep, where GPX needs five"
        raise WildlabError(problem, "export the track again", file=path)
    segments, broken = _segments(text)
    points = [point for segment in segments for point in segment]
    if not points:
        problem = "has no point of a track" + (f"; {broken} are broken" if broken else "")
        raise WildlabError(problem, "export the recorded track, not a route or waypoints", file=path)
    lost = () if not broken else (f"{plural(broken, 'point')} of {broken + len(points)} could not be read",)
    return _log(segments, lost)


def _log(segments: Sequence[Sequence[Point]], lost: tuple[str, ...]) -> RawLog:
    counts = np.cumsum([0, *(len(segment) for segment in segments)])
    starts = [_first_time(segment) for segment in segments]
    order = list(range(len(segments)))
    if all(np.isfinite(starts)):
        # Some programs write the newest track first.
        order.sort(key=lambda k: starts[k])
    points = [point for k in order for point in segments[k]]
    rows = np.concatenate([np.arange(counts[k], counts[k + 1]) for k in order]) + 1
    columns = _columns(points)
    notes = drop_rare_heights(columns)
    no_fix = columns["fix"] == 0.0 if "fix" in columns else np.zeros(len(points), bool)
    stream = make_stream("gnss", columns, rows, "point", judge(columns, {"no fix": no_fix}))
    time = columns["time_s"]
    notes += gaps(time, stream.used)
    if order != sorted(order):
        notes.append("segments are not in order of time in the file; they were put in order")
    timed = bool(np.isfinite(time).any())
    if timed and not stream.used.any():
        notes.append("no point carries a time that can be true: as a track over time it is of no use")
    elif not timed:
        notes.append("no point carries a time: as a track over time it is of no use")
    known = int(np.isfinite(time[stream.used]).sum())
    clock = Clock("UTC of the log", pairs=known) if known else None
    return RawLog("gpx", {"gnss": stream}, clock=clock, lost=lost, notes=tuple(notes))


def _columns(points: Sequence[Point]) -> dict[str, Array]:
    def of(name: str) -> Array:
        return np.array([getattr(point, name) for point in points], dtype=float)

    time = np.array([_seconds(point) for point in points])
    columns = {
        "time_s": time,
        "time_log_s": time,
        "latitude_deg": of("latitude"),
        "longitude_deg": of("longitude"),
        "height_sea_m": of("elevation"),
        "undulation_m": of("geoid_height"),
        "satellites": of("satellites"),
        "hdop": of("horizontal_dilution"),
        "fix": np.array([_FIXES.get(point.type_of_gpx_fix or "", np.nan) for point in points]),
    }
    # GPX 1.0 knows speed in m/s and course from true north.
    speed, course = of("speed"), np.radians(of("course"))
    if np.isfinite(speed * course).any():
        columns["v_north_m_s"], columns["v_east_m_s"] = speed * np.cos(course), speed * np.sin(course)
    return {
        name: values
        for name, values in columns.items()
        if name.startswith("time") or name.endswith("_deg") or np.isfinite(values).any()
    }


def _seconds(point: Point) -> float:
    try:
        at = point.time
        if at is None:
            return np.nan
        return (at if at.tzinfo is not None else at.replace(tzinfo=UTC)).timestamp()
    except (OverflowError, ValueError):
        return np.nan


def _first_time(segment: Sequence[Point]) -> float:
    return next((at for at in map(_seconds, segment) if np.isfinite(at)), np.nan)


def _text(data: bytes) -> str:
    """Its characters, without a declaration of XML: they are decoded already."""
    declared = re.match(rb"\s*<\?xml[^>]*encoding=[\"']([A-Za-z0-9._-]{1,40})[\"']", data[:200])
    codec = declared[1].decode().lower() if declared else ""
    single = re.fullmatch(r"iso-8859-\d{1,2}|windows-125\d|latin-?1|us-ascii", codec)
    text = data.decode(codec, "replace") if single else decode(data)
    # Characters that XML does not know are no reason to lose the point that they stand in.
    return re.sub(r"^\s*<\?xml[^>]*\?>", "", text).replace("\x00", "").lstrip()


def _depth(text: str) -> int:
    steps = [-1 if tag[1] else 0 if tag[2] else 1 for tag in _TAG.finditer(text)]
    return int(np.cumsum(steps).max(initial=0)) if steps else 0


def _parse(text: str) -> list[list[Point]] | None:
    """Segments with points, None where gpxpy does not take the text."""
    try:
        gpx = gpxpy.parse(text)
    except (gpxpy.gpx.GPXException, ValueError, TypeError, AttributeError, LookupError, OverflowError):
        return None
    segments = [segment.points for track in gpx.tracks for segment in track.segments]
    return [segment for segment in segments if segment]


def _segments(text: str) -> tuple[list[list[Point]], int]:
    """Segments, and how many points could not be read."""
    whole = _parse(text)
    if whole is not None:
        return whole, 0
    prefix = re.search(r"<(\w+):gpx[\s>]", text)
    if prefix:
        text = re.sub(rf"<(/?){re.escape(prefix[1])}:", r"<\1", text)
    read: list[list[Point]] = []
    opened = 0
    for segment in _SEGMENT_END.split(text):
        # Each piece is searched once, so that points that never end cost no more than others.
        pieces = _NEXT_POINT.split(segment)[1:]
        opened += len(pieces)
        found = _salvage([point[0] for point in map(_POINT.match, pieces) if point])
        read += [found] if found else []
    return read, opened - sum(map(len, read))


def _salvage(points: list[str]) -> list[Point]:
    """Points that can be read: halves are tried where a whole cannot be."""
    if not points:
        return []
    # A prefix that nobody declared would spoil the point: what it names is not read anyway.
    body = re.sub(r"<(/?)[\w.-]+:([\w.-]+)", r"<\1\2", "".join(points))
    body = re.sub(r"\s[\w.-]+:[\w.-]+\s*=", " other=", body)
    got = _parse(f"<gpx version='1.0' creator=''><trk><trkseg>{body}</trkseg></trk></gpx>")
    if got is not None:
        return [point for segment in got for point in segment]
    if len(points) == 1:
        return []
    middle = len(points) // 2
    return _salvage(points[:middle]) + _salvage(points[middle:])
