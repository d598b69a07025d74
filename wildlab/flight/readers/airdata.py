"""Flight records of DJI aircraft as AirData exports them (CSV), in metres or in feet.

Rows carry a counter of milliseconds, and UTC in whole seconds beside it. The fraction comes from the rows
where the second changes; the counter stands still while the record pauses, so that each stretch between
pauses has a fit of its own.
"""

from __future__ import annotations

import csv
import re
from itertools import pairwise
from pathlib import Path

import numpy as np

from wildlab.errors import WildlabError
from wildlab.flight.readers import text
from wildlab.flight.readers.dji import NO_ZONE
from wildlab.flight.readers.log import Array, Clock, Decoded, Mask, Readings
from wildlab.flight.readers.text import numbers, plural, stamp_s
from wildlab.flight.time.fitting import ClockFit, fit_clock
from wildlab.flight.time.zones import wall_to_utc

#: m, or m/s, in a unit as headers have it.
_UNITS = {
    **{"meters": 1.0, "m": 1.0, "feet": 0.3048, "ft": 0.3048, "m/s": 1.0, "mph": 0.44704},
    **{"km/h": 1 / 3.6, "kmh": 1 / 3.6, "kph": 1 / 3.6, "knots": 1852 / 3600, "kn": 1852 / 3600},
    **{"ft/s": 0.3048, "degrees": 1.0, "deg": 1.0, "millisecond": 1e-3, "ms": 1e-3, "": 1.0},
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
_PLACE = ("latitude_deg", "longitude_deg", "height_home_m", "height_sea_m")
_VELOCITY = ("v_north_m_s", "v_east_m_s", "v_down_m_s")
_ATTITUDE = ("roll_deg", "pitch_deg", "yaw_deg")
_GIMBAL = ("roll_world_deg", "pitch_world_deg", "yaw_world_deg")
#: A gimbal that keeps its heading within this, while the aircraft turns by more than that, degrees.
_STILL_DEG, _TURNED_DEG = 2.0, 45.0
#: The counter and the clock part by more than this in a pause only, s; fewer changes of second make no fit.
_PAUSE_S, _FEW = 1.5, 10


def sniff(head: bytes, name: str) -> bool:
    """Whether the first line has AirData's columns of time, UTC and place."""
    names = {one for one, _ in _header(text.decode(head).split("\n", 1)[0])}
    return {"time", "latitude", "longitude"} <= names and any(one.startswith("datetime") for one in names)


def decode(path: Path, data: bytes, zone: str | None = None) -> Decoded:
    """A flight record, a row for each line; `zone` is that of stamps where the file has only local ones.

    Raises
    ------
    WildlabError
        Where columns are missing, a unit is unknown, or no row can be read.
    """
    # Each line by itself: a quotation mark that is never closed costs one.
    lines = text.decode(data).split("\n")
    header = _header(lines[0])
    names = [name for name, _ in header]
    clock_at = [at for at, name in enumerate(names) if name.startswith("datetime")]
    missing = [word for word in ("latitude", "longitude") if word not in names]
    missing += [] if clock_at else ["datetime(utc)"]
    if missing:
        problem = f"has no column {' and '.join(repr(one) for one in missing)}"
        raise WildlabError(problem, "export the flight from AirData again", file=path, field="header")
    found = [(at, _cells(line)) for at, line in enumerate(lines[1:], 2) if line.strip("\r\x00 ")]
    kept = [(at, row) for at, row in found if len(row) >= 0.5 * len(header)]
    if not kept:
        raise WildlabError("has no row under its header", "export the flight from AirData again", file=path)
    cells = [row + [""] * (len(header) - len(row)) for _, row in kept]
    columns: dict[str, Array] = {}
    for ours, theirs in _COLUMNS.items():
        place = next((names.index(name) for name in theirs if name in names), None)
        if place is not None:
            columns[ours] = numbers(row[place] for row in cells) * _unit(path, ours, header[place])
    utc = "datetimeutc" in names
    clocks = [row[names.index("datetimeutc") if utc else clock_at[0]] for row in cells]
    notes: list[str] = []
    times, clock, unusable = _times(clocks, utc, columns, zone, notes)
    return Decoded(
        _parts(times, columns, np.array([at for at, _ in kept]), unusable, notes),
        clock=clock,
        lost=[(len(found) - len(kept), "line", f"of {len(found)} cut off")],
        notes=notes,
    )


def _parts(
    times: dict[str, Array],
    columns: dict[str, Array],
    rows: Array,
    unusable: dict[str, Mask],
    notes: list[str],
) -> dict[str, Readings]:
    def of(*names: str) -> dict[str, Array]:
        return times | {name: columns[name] for name in names if name in columns}

    parts = {"gnss": of(*_PLACE, *_VELOCITY, "satellites")}
    if all(np.isfinite(columns.get(name, np.nan)).any() for name in _ATTITUDE):
        parts["poses"] = of(*_PLACE, *_VELOCITY, *_ATTITUDE)
    if {"pitch_world_deg", "yaw_world_deg"} <= set(columns):
        parts["gimbal"] = of(*_GIMBAL)
        if "yaw_deg" in columns:
            notes += _heading_that_stands(columns["yaw_world_deg"], columns["yaw_deg"])
    photo = np.nan_to_num(columns.get("photo", np.zeros(len(rows)))) > 0
    taken = photo & ~np.r_[False, photo[:-1]]
    made = {name: Readings(one, rows, "line", unusable) for name, one in parts.items()}
    if taken.any():
        own = {name: values[taken] for name, values in of(*_PLACE, *_ATTITUDE).items()}
        own["number"] = np.arange(1.0, taken.sum() + 1)
        why = {reason: mask[taken] for reason, mask in unusable.items()}
        made["triggers"] = Readings(own, rows[taken], "line", why)
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


def _header(line: str) -> list[tuple[str, str]]:
    """Names without anything but letters, and units, of the columns."""
    found = []
    for cell in _cells(line) if line else []:
        name, _, unit = cell.partition("(")
        name, unit = re.sub(r"[^a-z]", "", name.lower()), unit.strip(") ").lower()
        # "datetime(utc)" and "datetime(local)" are two columns.
        found.append((name + unit if name == "datetime" else name, unit))
    return found


def _unit(path: Path, ours: str, column: tuple[str, str]) -> float:
    name, unit = column
    if ours in ("satellites", "photo"):
        return 1.0
    if unit not in _UNITS:
        problem = f"has the unit {unit[:20]!r}, which is not known"
        raise WildlabError(problem, "export the flight in metric units", file=path, field=name)
    return _UNITS[unit]


def _cells(line: str) -> list[str]:
    line = line.strip("\r\x00 ")
    try:
        return next(csv.reader([line]))
    except (csv.Error, StopIteration):
        return line.split(",")


def _times(
    clocks: list[str], utc: bool, columns: dict[str, Array], zone: str | None, notes: list[str]
) -> tuple[dict[str, Array], Clock | None, dict[str, Mask]]:
    """Times of the rows, how they were found, and rows that have none for a reason of its own."""
    known = {one: stamp_s(one) for one in set(clocks)}
    wall = np.array([known[one] for one in clocks])
    own = columns.get("time_log_s", np.full(len(wall), np.nan))
    local = None if utc else zone
    whole = wall if local is None else wall_to_utc(wall, local)
    base = "UTC of the log" if utc else NO_ZONE if zone is None else f"wall clock of zone {zone[:60]}"
    time, clock = _fraction(own, whole, base, notes)
    if not np.isfinite(own).any():
        own = wall
    if utc or zone is not None:
        return {"time_s": time, "time_log_s": own}, clock, {}
    notes.append("its clock is local time without a zone: state the zone")
    times = {"time_s": np.full(len(wall), np.nan), "time_log_s": own}
    return times, clock, {base: np.ones(len(wall), bool)}


def _fraction(own: Array, whole: Array, base: str, notes: list[str]) -> tuple[Array, Clock | None]:
    """Stamps in whole seconds made finer by a counter: where a second changes, it has just begun."""
    both = np.flatnonzero(np.isfinite(own) & np.isfinite(whole))
    if not np.isfinite(whole).any():
        return whole, None
    changes = np.flatnonzero(np.diff(whole[both]) > 0)
    before, after = both[changes], both[changes + 1]
    near = (own[after] > own[before]) & (own[after] - own[before] < 1.0)
    before, after = before[near], after[near]
    if len(after) < 3 or (whole[both] % 1 > 0).any():
        return whole, Clock(base, pairs=len(both))
    reference, middle = whole[after], (own[before] + own[after]) / 2
    # Nothing but a pause, or a wrong row, parts the two by more than the second that one of them is coarse.
    lack = (whole - own)[both]
    breaks = both[np.flatnonzero(np.abs(np.diff(lack)) > _PAUSE_S) + 1]
    time = np.full(len(own), np.nan)
    fits: list[ClockFit] = []
    for begin, end in pairwise([0, *breaks.tolist(), len(own)]):
        within = (before >= begin) & (after < end)
        if within.sum() >= _FEW:
            fits.append(fit_clock(middle[within], reference[within]))
            time[begin:end] = fits[-1].to_reference(own[begin:end])
        else:
            # Too short to be fitted: half a second is cut off in the mean.
            time[begin:end] = own[begin:end] + np.nanmedian((whole - own)[begin:end]) + 0.5
    stood = [float(b.offset_s - a.offset_s) for a, b in pairwise(fits)]
    if stood:
        notes.append(
            f"the counter of milliseconds stood still {plural(len(stood), 'time')}, "
            f"{sum(stood):.1f} s together: each stretch has its own fit"
        )
    if not fits:
        return time, Clock(base, spread_s=1 / np.sqrt(12), largest_s=0.5, pairs=len(both))
    left = np.concatenate([one.residual[one.used] for one in fits])
    fit = max(fits, key=lambda one: int(one.used.sum()))
    spread = max(one.spread_s for one in fits)
    return time, Clock(
        base, fit.rate, fit.offset_s, spread, float(np.abs(left).max()), len(left), fit.rate_sd
    )
