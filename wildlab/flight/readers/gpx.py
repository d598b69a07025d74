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
from wildlab.flight.readers import text
from wildlab.flight.readers.log import Array, Clock, Decoded, Readings
from wildlab.flight.time_scales import GPS_START_S

#: GPX has a depth of five; extensions add a few.
DEEPEST = 64
#: Kinds of fix as GPX names them, as numbers.
_FIXES = {"none": 0.0, "2d": 2.0, "3d": 3.0, "dgps": 4.0, "pps": 3.0}
#: Our columns -> attributes of gpxpy's points.
_COLUMNS = {
    **{"latitude_deg": "latitude", "longitude_deg": "longitude", "height_sea_m": "elevation"},
    **{"undulation_m": "geoid_height", "satellites": "satellites", "hdop": "horizontal_dilution"},
}
_TAG = re.compile(r"<(/?)[A-Za-z_][^<>]*?(/?)>")
_POINT = re.compile(r"<trkpt\b[^<>]*?(?:/>|>.*?</trkpt\s*>)", re.DOTALL)
_NEXT_POINT = re.compile(r"(?=<trkpt\b)")
_SEGMENT_END = re.compile(r"</trkseg\s*>")

Point = gpxpy.gpx.GPXTrackPoint


def sniff(head: bytes, name: str) -> bool:
    """Whether a file begins as GPX."""
    return re.search(r"<(?:\w+:)?gpx[\s>]", text.decode(head[:-1] if len(head) % 2 else head)) is not None


def decode(path: Path, data: bytes, zone: str | None = None) -> Decoded:
    """The tracks of a GPX file, all segments in order of time; rows are points as counted in the file.

    Raises
    ------
    WildlabError
        Where the file declares entities or a document type, is nested too deeply, or has no point of a track.
    """
    said = _text(data)
    if re.search(r"<!\s*(DOCTYPE|ENTITY|ELEMENT|ATTLIST|NOTATION)", said, re.IGNORECASE):
        problem = "declares a document type or entities, which no GPX needs"
        raise WildlabError(problem, "export the track again, or delete the declaration", file=path)
    if _depth(said) > DEEPEST:
        problem = f"is nested more than {DEEPEST} deep, where GPX needs five"
        raise WildlabError(problem, "export the track again", file=path)
    segments, broken = _segments(said)
    if not segments:
        problem = "has no point of a track" + (f"; {broken} are broken" if broken else "")
        raise WildlabError(problem, "export the recorded track, not a route or waypoints", file=path)
    counts = np.cumsum([0, *(len(segment) for segment in segments)])
    starts = [next((at for at in map(_seconds, one) if np.isfinite(at)), np.nan) for one in segments]
    order = list(range(len(segments)))
    if np.isfinite(starts).all():
        # Some programs write the newest track first.
        order.sort(key=lambda k: starts[k])
    columns = _columns([point for k in order for point in segments[k]])
    rows = np.concatenate([np.arange(counts[k], counts[k + 1]) for k in order]) + 1
    timed = int((columns["time_s"] >= GPS_START_S).sum())
    notes = {
        "segments are not in order of time in the file; they were put in order": order != sorted(order),
        "no point carries a time that can be true: as a track over time it is of no use": not timed,
    }
    return Decoded(
        {"gnss": Readings(columns, rows, "point", {"no fix": columns["fix"] == 0.0})},
        clock=Clock("UTC of the log", pairs=timed) if timed else None,
        lost=[(broken, "point", f"of {broken + len(rows)} could not be read")],
        notes=[said for said, holds in notes.items() if holds],
    )


def _columns(points: Sequence[Point]) -> dict[str, Array]:
    def of(name: str) -> Array:
        return np.array([getattr(point, name) for point in points], dtype=float)

    time = np.array([_seconds(point) for point in points])
    # GPX 1.0 knows speed in m/s and course from true north.
    speed, course = of("speed"), np.radians(of("course"))
    return {
        **{"time_s": time, "time_log_s": time},
        **{ours: of(theirs) for ours, theirs in _COLUMNS.items()},
        **{"v_north_m_s": speed * np.cos(course), "v_east_m_s": speed * np.sin(course)},
        "fix": np.array([_FIXES.get(point.type_of_gpx_fix or "", np.nan) for point in points]),
    }


def _seconds(point: Point) -> float:
    try:
        at = point.time
        if at is None:
            return np.nan
        return (at if at.tzinfo is not None else at.replace(tzinfo=UTC)).timestamp()
    except (OverflowError, ValueError):
        return np.nan


def _text(data: bytes) -> str:
    """Its characters, without a declaration of XML: they are decoded already."""
    declared = re.match(rb"\s*<\?xml[^>]*encoding=[\"']([A-Za-z0-9._-]{1,40})[\"']", data[:200])
    codec = declared[1].decode().lower() if declared else ""
    single = re.fullmatch(r"iso-8859-\d{1,2}|windows-125\d|latin-?1|us-ascii", codec)
    said = data.decode(codec, "replace") if single else text.decode(data)
    # Characters that XML does not know are no reason to lose the point that they stand in.
    return re.sub(r"^\s*<\?xml[^>]*\?>", "", said).replace("\x00", "").lstrip()


def _depth(said: str) -> int:
    steps = [-1 if tag[1] else 0 if tag[2] else 1 for tag in _TAG.finditer(said)]
    return int(np.cumsum(steps).max(initial=0)) if steps else 0


def _parse(said: str) -> list[list[Point]] | None:
    """Segments with points, None where gpxpy does not take the text."""
    try:
        gpx = gpxpy.parse(said)
    except (gpxpy.gpx.GPXException, ValueError, TypeError, AttributeError, LookupError, OverflowError):
        return None
    return [segment.points for track in gpx.tracks for segment in track.segments if segment.points]


def _segments(said: str) -> tuple[list[list[Point]], int]:
    """Segments, and how many points could not be read."""
    whole = _parse(said)
    if whole is not None:
        return whole, 0
    prefix = re.search(r"<(\w+):gpx[\s>]", said)
    if prefix:
        said = re.sub(rf"<(/?){re.escape(prefix[1])}:", r"<\1", said)
    read: list[list[Point]] = []
    opened = 0
    for segment in _SEGMENT_END.split(said):
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
    middle = len(points) // 2
    return _salvage(points[:middle]) + _salvage(points[middle:]) if middle else []
