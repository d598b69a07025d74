"""What every reader of raw logs gives: parts with the same columns, units and marks, whatever the format.

Stamps of the log's own clock are kept beside the UTC time that they were brought to; heights stand in the
column of what they count from, and are not converted here. A row is judged by what it says and by its
neighbours, and nothing is dropped: rows that cannot be used stay, and say why. Rows that are used have a
place (where the part has places), a time (if any row has one), values that can be true and stamps that
strictly increase.
"""

from __future__ import annotations

from bisect import bisect_left
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from wildlab.flight.clock_fitting import GPS_START_S
from wildlab.flight.clocks import between
from wildlab.flight.readers.text import LATEST_S, decode
from wildlab.flight.schema import BOUNDS, FIELD, FORCE, QUATERNION, RATE, VELOCITY
from wildlab.geometry.frames import Array, Indices, Mask, matrix_to_euler, quaternion_to_matrix

#: Columns that every part over time has: s since 1970 in UTC (NaN: not known), and the log's own stamp, s.
TIMES = ("time_s", "time_log_s")
#: Why a row is not used, and 1.0 where it is.
MARKS = ("use", "why")
#: What a height counts from: the ellipsoid of WGS84, mean sea level, or where the vehicle was switched on or
#: took off. `undulation_m`: ellipsoid minus sea level there, as the receiver has it.
HEIGHTS = ("height_ellipsoid_m", "height_sea_m", "height_home_m", "undulation_m")
#: Of the airframe; of the camera, against north and the horizon.
ANGLES, WORLD = (tuple(f"{one}{end}_deg" for one in ("roll", "pitch", "yaw")) for end in ("", "_world"))
PLACE = ("latitude_deg", "longitude_deg", *HEIGHTS)
_SPREADS = ("sd_horizontal_m", "sd_vertical_m", "sd_velocity_m_s")

#: Parts of a log, and the columns that each may have beside `TIMES` and `MARKS`.
PARTS: dict[str, tuple[str, ...]] = {
    # Where the vehicle was and how it was turned, as it found itself; attitude b -> n by roll, pitch and yaw
    # (zyx), or by a quaternion.
    "poses": (
        *PLACE,
        *VELOCITY,
        *(*ANGLES, *QUATERNION),
        *("sd_horizontal_m", "sd_vertical_m", "sd_tilt_deg", "sd_heading_deg"),
    ),
    # Satellite positions, of the first receiver; `fix`: 0 none, 1 estimated, 2 plane, 3 in space, 4
    # differential, 5 float, 6 fixed.
    "gnss": (*PLACE, *VELOCITY, *_SPREADS, "satellites", "fix", "hdop"),
    # Forward, right, down; at rest and level f is (0, 0, -g).
    "imu": (*FORCE, *RATE),
    "magnetometer": (*FIELD,),
    # Of the camera: how it is turned against north and the horizon (`..._world_...`: pitch -90 looks down),
    # or against the airframe (pan and tilt as `wildlab.geometry.camera_poses` has them).
    "gimbal": (*WORLD, "pan_deg", "tilt_deg"),
    # Records of the autopilot that the camera was triggered.
    "triggers": (
        *("number", *PLACE, *ANGLES),
        *("sd_horizontal_m", "sd_vertical_m", "fix", "file"),
    ),
    # Images with what stands in them; `time_log_s` is the camera's own wall clock as if it were UTC.
    "photos": (
        *("file", *PLACE, *ANGLES, *WORLD, "sd_horizontal_m", "sd_vertical_m", "fix"),
        *("width_px", "height_px", "focal_px", "focal_from", "camera"),
    ),
    # Surveyed points that do not move.
    "marks": ("name", *PLACE, "sd_horizontal_m", "sd_vertical_m"),
    # Pixels of things in images: a point, and a box where there is one.
    "clicks": (
        *("image", "name", "u_px", "v_px", "score"),
        *("box_u_px", "box_v_px", "box_width_px", "box_height_px"),
    ),
}
#: What UTC was known from where rows state it.
UTC_OF_LOG = "UTC of the log"
#: Columns of text; all others are numbers.
TEXTS = frozenset({"why", "file", "camera", "focal_from", "name", "image"})


def named(names: Iterable[str], values: Iterable[Any]) -> dict[str, Any]:
    """Values by as many names."""
    return dict(zip(names, values, strict=True))


def holding(notes: Mapping[str, object]) -> list[str]:
    """Sentences for which what stands beside them holds."""
    return [sentence for sentence, holds in notes.items() if holds]


def level_velocity(speed: Array, course_deg: Array) -> dict[str, Array]:
    """Columns of a speed over ground (N,) towards a course (N,), clockwise from north."""
    course = np.radians(course_deg)
    return {"v_north_m_s": speed * np.cos(course), "v_east_m_s": speed * np.sin(course)}


def any_of(masks: Iterable[ArrayLike], count: int) -> Mask:
    """(N,) where any of some masks (N,) holds; nowhere, if there is none."""
    none: list[Any] = [np.zeros(count, bool)]
    return np.asarray(np.logical_or.reduce([*none, *masks]), bool)


@dataclass(frozen=True)
class Stream:
    """One part of a log; once it is judged, with the columns of `MARKS`.

    Attributes
    ----------
    columns
        (N,) each, by the names of `PARTS` and `TIMES`.
    rows
        (N,) where each stands in the file; counted from 1 where left out.
    counted_in
        What `rows` counts.
    unusable
        Reason -> (N,) bool: what the format itself says of its rows.
    anywhere
        Whether rows without a place count, too.
    """

    columns: dict[str, Any]
    rows: Any = None
    counted_in: str = "message"
    unusable: Mapping[str, Mask] = field(default_factory=dict)
    anywhere: bool = False

    def __len__(self) -> int:
        return len(next(iter(self.columns.values())))

    @property
    def used(self) -> Mask:
        """(N,) rows that can be used."""
        return np.asarray(self.columns["use"] == 1.0)

    def without(self, rows: Mask, reason: str) -> Stream:
        """The same, some of the rows (N,) not used for a reason, of what was judged."""
        lost = rows & self.used
        marks = {"use": np.where(lost, 0.0, self.columns["use"]), "why": self.columns["why"].copy()}
        marks["why"][lost] = reason
        return replace(self, columns=self.columns | marks)

    def take(self, rows: NDArray[Any]) -> Stream:
        """The rows that a mask or an index picks, of what was judged or has no marks of its own."""
        columns = {name: one[rows] for name, one in self.columns.items()}
        return Stream(columns, self.rows[rows], self.counted_in)


@dataclass(frozen=True)
class RawLog:
    """A log, as `decode` of its format gives it, and judged.

    Attributes
    ----------
    parts
        By name, see `PARTS`; once judged only those that the log has rows of.
    vehicle
        What it says of what carried it, in its words: ``"ArduCopter V3.1.3"``. Empty: nothing.
    clock
        What UTC was known from, in a clause: ``"GPS weeks"``, ``"times of receipt"``, ``"local time without a
        zone"``; empty where it was not.
    lost
        Sentences on what could not be read, each with how much of it.
    notes
        Sentences on what a user should know of it.
    """

    parts: dict[str, Stream]
    vehicle: str = ""
    clock: str = ""
    lost: Sequence[str] = ()
    notes: Sequence[str] = ()


def make_stream(
    part: str,
    columns: Mapping[str, ArrayLike],
    rows: ArrayLike | None = None,
    counted_in: str = "message",
    unusable: Mapping[str, ArrayLike] | None = None,
) -> Stream:
    """A part, its columns in their types, with the marks ``use`` and ``why``.

    Parameters
    ----------
    part
        Of `PARTS`.
    columns
        By name, (N,) each; those that `PARTS` names and `TIMES`.
    rows
        (N,) where each stands in the file; counted from 1 where left out.
    counted_in
        What `rows` counts.
    unusable
        Reason -> (N,) bool: rows that are not to be used. The first reason that holds is the row's.

    Returns
    -------
    Stream

    Raises
    ------
    ValueError
        Where a column is not one of the part's, or has another length: a mistake of a reader.
    """
    made = {
        name: np.asarray(values, dtype=object if name in TEXTS else np.float64)
        for name, values in columns.items()
    }
    (count,) = {len(one) for one in made.values()}
    why = np.full(count, "", dtype=object)
    for reason, holds in (unusable or {}).items():
        why[np.asarray(holds, bool) & (why == "")] = reason
    at = np.arange(1, count + 1) if rows is None else np.asarray(rows, np.int64)
    return Stream({**made, "use": (why == "").astype(np.float64), "why": why}, at, counted_in)


# -- which rows can be used, and what is said of a log


#: A log does not run for longer than this, s: stamps so far from all others are wrong, if they are few.
LONGEST_S, FEW = 7 * 86400.0, 5
#: Receivers that have no place say zero and zero; so near to it nobody flies, degrees.
NOWHERE_DEG = 1e-6
#: Receivers that have no dilution of precision say 99, 99.9 or 99.99.
NO_DILUTION = 99.0
#: Places of one moment may be so far apart by their noise, m.
NOISE_M = 30.0
#: Parts that are judged by what they are of, not by their times.
STILL = ("photos", "marks", "clicks")
#: Beginning of a column -> beyond it no sensor of a flying thing measures: m/s2, rad/s, microtesla.
SENSORS = {"f_": 1000.0, "w_": 100.0, "field_": 1000.0}
#: Parts with angles -> beyond them none is an angle, deg.
TURNS = {"poses": 361.0, "gimbal": 720.0}
#: What is said of a log whose last message is not whole.
CUT_OFF = "it ends within a message: the file was cut off, or the power was"
ONE_HEIGHT = "heights above ellipsoid and sea level are the same: they are taken as above sea level"
_EARTH_M = 6371e3


def judge_log(found: RawLog) -> RawLog:
    """A log out of what its reader decoded.

    Parameters
    ----------
    found
        What `decode` gave.

    Returns
    -------
    RawLog
        With the parts that have rows. Columns without any value are left out, but for times and angles.
    """
    parts = {name: one for name, one in found.parts.items() if len(one)}
    notes = list(found.notes)
    for name, one in parts.items():
        columns = one.columns if name in STILL else _filled(name, one)
        parts[name] = replace(one, columns=columns)
    if "gnss" in parts and _one_height(parts["gnss"].columns):
        notes.append(ONE_HEIGHT)
        for name in ("poses", "gnss"):
            if name in parts:
                parts[name].columns.pop("height_ellipsoid_m", None)
    streams = {
        name: make_stream(
            name, one.columns, one.rows, one.counted_in, one.unusable if name in STILL else judge(name, one)
        )
        for name, one in parts.items()
    }
    return replace(found, parts=streams, lost=tuple(found.lost), notes=tuple(dict.fromkeys(notes)))


def _filled(part: str, one: Stream) -> dict[str, Any]:
    """Columns with any value; images may be taken before the first fix, and then have no place."""
    columns = dict(one.columns)
    if "latitude_deg" in columns:
        there = placed(columns["latitude_deg"], columns["longitude_deg"])
        if one.anywhere:
            columns |= {name: np.where(there, columns[name], np.nan) for name in PLACE if name in columns}
        else:
            # Where few rows have a height, all would be of no use beside these.
            heights = [np.isfinite(values) for name, values in columns.items() if name.startswith("height_")]
            if 0 < 2 * any_of(heights, len(there))[there].sum() < there.sum():
                columns = {name: values for name, values in columns.items() if name not in HEIGHTS}
    return {
        name: values
        for name, values in columns.items()
        if name in TEXTS
        or part in ("imu", "magnetometer")
        or name.startswith("time")
        or name.endswith("_deg")
        or np.isfinite(np.asarray(values, float)).any()
    }


def _one_height(columns: Mapping[str, ArrayLike]) -> bool:
    """Whether heights above the ellipsoid and above sea level are the same in all rows."""
    if not {"height_sea_m", "height_ellipsoid_m"} <= set(columns):
        return False
    apart = np.asarray(columns["height_sea_m"], float) - np.asarray(columns["height_ellipsoid_m"], float)
    known = np.isfinite(apart)
    return bool(known.any() and (apart[known] == 0).all())


def placed(latitude_deg: ArrayLike, longitude_deg: ArrayLike) -> Mask:
    """(N,) whether latitudes and longitudes (N,) are numbers, on Earth, and not both zero."""
    latitude, longitude = np.asarray(latitude_deg, float), np.asarray(longitude_deg, float)
    return ~any_of(_misplaced(latitude, longitude).values(), len(latitude))


def _misplaced(latitude: Array, longitude: Array) -> dict[str, Mask]:
    with np.errstate(invalid="ignore"):
        return {
            "no position": ~(np.isfinite(latitude) & np.isfinite(longitude)),
            "impossible position": (np.abs(latitude) > 90) | (np.abs(longitude) > 360),
            "position is a placeholder": (np.abs(latitude) < NOWHERE_DEG) & (np.abs(longitude) < NOWHERE_DEG),
        }


def judge(part: str, decoded: Stream) -> dict[str, Mask]:
    """Why rows of a part cannot be used.

    Parameters
    ----------
    part
        Of `log.PARTS`.
    decoded
        By a reader. Looked at are times in UTC, or the log's own where no row has UTC. What the format itself
        says of its rows comes first.

    Returns
    -------
    dict
        Reason -> (N,) bool for `make_stream`.
    """
    have = {name: np.asarray(values, float) for name, values in decoded.columns.items() if name not in TEXTS}
    stamps = [have[name] for name in TIMES if name in have]
    # In UTC, or by the log's own clock where no row has UTC.
    time = next((one for one in stamps if np.isfinite(one).any()), stamps[-1])
    utc = have.get("time_s", np.full(len(time), np.nan))
    found = dict(decoded.unusable)

    def add(reason: str, *masks: Mask) -> None:
        found[reason] = any_of([*masks, *([found[reason]] if reason in found else [])], len(time))

    def starting(*starts: str) -> list[Array]:
        return [values for name, values in have.items() if name.startswith(starts)]

    # Damaged values may be anything: they are marked, not warned of.
    with np.errstate(invalid="ignore", over="ignore"):
        where = "latitude_deg" in have and not decoded.anywhere
        if where and "fix" in have:
            add("no fix", have["fix"] == 0)
            add("estimated, not measured", have["fix"] == 1)
        if where:
            for reason, mask in _misplaced(have["latitude_deg"], have["longitude_deg"]).items():
                add(reason, mask)
            low, high = BOUNDS["down"]
            add("impossible height", *((-one < low) | (-one > high) for one in starting("height_")))
            add("impossible speed", *(np.abs(one) > BOUNDS["speed"][1] for one in starting("v_")))
            add("no dilution of precision", *(one >= NO_DILUTION for one in starting("hdop")))
        if part in TURNS:
            turns = starting("roll_", "pitch_", "yaw_", "pan_", "tilt_")
            add("no attitude", *(np.isnan(one) for one in (*turns, *starting("q_"))))
            add("impossible attitude", *(np.abs(one) > TURNS[part] for one in turns))
            if q := starting("q_"):
                add("no attitude", ~(np.abs(np.linalg.norm(q, axis=0) - 1) < 0.01))
        for start, most in SENSORS.items():
            if measured := starting(start):
                add("no measurement", *(~np.isfinite(one) for one in measured))
                add("beyond any sensor", *(np.abs(one) > most for one in measured))
                if start == "field_":
                    add("no measurement", (np.array(measured) == 0).all(axis=0))
        if np.isfinite(time).any():
            add("no time", np.isnan(time))
            add("impossible time", (utc < GPS_START_S) | (utc > LATEST_S))
        bad = any_of(found.values(), len(time))
        heights = starting("height_")
        if where and heights:
            without = ~any_of([~np.isnan(one) for one in heights], len(time))
            if not without[~bad].all():
                add("no height", without & ~bad)
                bad = bad | without
    _judge_order(time, have if where else {}, bad, found)
    return found


def _judge_order(time: Array, have: Mapping[str, Array], bad: Mask, found: dict[str, Mask]) -> None:
    good = np.flatnonzero(~bad & np.isfinite(time))
    if not len(good):
        return

    def mark(reason: str, rows: Indices) -> None:
        found[reason] = np.zeros(len(time), bool)
        found[reason][rows] = True

    alone = _alone(time[good])
    mark("stamp far from all others", good[alone])
    good = good[~alone]
    kept = in_order(time[good])
    left, stamps = good[~kept], time[good[kept]]
    again = np.isin(time[left], stamps)
    mark("repeated stamp", left[again])
    mark("stamp out of order", left[~again])
    good = good[kept]
    if have:
        high = next((have[one] for one in HEIGHTS if one in have), np.zeros(len(time)))
        place = np.radians(have["latitude_deg"]), np.radians(have["longitude_deg"]), np.nan_to_num(high)
        mark("impossible jump", good[~_reachable(time[good], *(one[good] for one in place))])


def _alone(time: Array) -> Mask:
    """Stamps of which only a few are within days of each other, where there are many others."""
    order = np.argsort(time, kind="stable")
    group = np.cumsum(np.r_[0, np.diff(time[order]) > LONGEST_S])
    sizes = np.bincount(group)
    alone = np.zeros(len(time), bool)
    alone[order] = (sizes < FEW)[group] & (sizes.max() >= 2 * FEW)
    return alone


def in_order(stamps: ArrayLike, wanted: ArrayLike | None = None) -> Mask:
    """The most rows whose stamps strictly increase; the others repeat one, go back or leap ahead.

    Parameters
    ----------
    stamps
        (N,) s, in the order of the file; NaN is left out.
    wanted
        (N,) bool: rows that count; the others are left out, and do not make others be left out.

    Returns
    -------
    (N,) bool

    Examples
    --------
    >>> in_order([1.0, 2.0, 2.0, 9000.0, 3.0, 4.0, 0.5, 5.0]).tolist()
    [True, True, False, False, True, True, False, True]
    """
    at = np.asarray(stamps, float)
    usable = np.isfinite(at) if wanted is None else np.isfinite(at) & np.asarray(wanted, bool)
    kept = np.zeros(len(at), bool)
    rows = np.flatnonzero(usable)
    if (np.diff(at[rows]) > 0).all():
        kept[rows] = True
        return kept
    # The longest increasing run of rows: for each length, the row with the smallest stamp that ends one. Of
    # repeated stamps the first is kept.
    smallest: list[float] = []
    ending: list[int] = []
    before: list[int] = []
    for i, value in enumerate(at[rows].tolist()):
        length = bisect_left(smallest, value)
        before.append(ending[length - 1] if length else -1)
        if length == len(smallest):
            smallest.append(value)
            ending.append(i)
        elif value < smallest[length]:
            smallest[length], ending[length] = value, i
    i = ending[-1]
    while i >= 0:
        kept[rows[i]] = True
        i = before[i]
    return kept


def _reachable(time: Array, latitude: Array, longitude: Array, height: Array) -> Mask:
    """Rows that can be reached from the longest unbroken run of rows, at a speed that the schema allows."""

    def reached(i: Any, j: NDArray[Any]) -> Mask:
        """Whether rows j can be reached from rows i, on a sphere: good to 0.5 %, which is enough."""
        p, q = latitude[i], latitude[j]
        turned = longitude[j] - longitude[i]
        half = np.sin((q - p) / 2) ** 2 + np.cos(p) * np.cos(q) * np.sin(turned / 2) ** 2
        level = 2 * _EARTH_M * np.arcsin(np.sqrt(np.clip(half, 0.0, 1.0)))
        away = np.hypot(level, height[j] - height[i])
        return np.asarray(away <= NOISE_M + BOUNDS["speed"][1] * np.abs(time[j] - time[i]))

    every = np.arange(len(time))
    runs = np.split(every, 1 + np.flatnonzero(~reached(every[:-1], every[1:])))
    longest = int(np.argmax([len(run) for run in runs]))
    kept = np.zeros(len(time), bool)
    kept[runs[longest]] = True
    before = [run[::-1] for run in runs[:longest][::-1]]
    for last, others in ((runs[longest][-1], runs[longest + 1 :]), (runs[longest][0], before)):
        for run in others:
            near = np.flatnonzero(reached(last, run))
            if len(near):
                kept[run[near[0] :]] = True
                last = run[-1]
    return kept


# -- what logs of autopilots share, whatever they call it: messages of one kind, values at other times

#: Kinds of fix as MAVLink numbers them: on the level, and in space.
FIX_PLANE, FIX_SPACE = 2, 3
#: GIMBAL_DEVICE_FLAGS: yaw is held against north; it is given against the vehicle; it is given against north.
YAW_LOCK, YAW_VEHICLE, YAW_NORTH = 16, 32, 64
#: Columns of a place on Earth -> fields of MAVLink and of its relatives.
LAT_LON = {"latitude_deg": "lat", "longitude_deg": "lon lng"}


class Columns(Mapping[str, Any]):
    """Fields by name that are computed when they are asked for."""

    def __init__(self, names: Collection[str], compute: Callable[[str], Any]) -> None:
        self._names, self._compute = names, compute

    def __getitem__(self, name: str) -> Any:
        if name not in self._names:
            raise KeyError(name)
        return self._compute(name)

    def __iter__(self) -> Iterator[str]:
        return iter(self._names)

    def __len__(self) -> int:
        return len(self._names)


@dataclass(frozen=True, eq=False)
class Messages:
    """Messages of one kind.

    Attributes
    ----------
    name
        As the log calls them.
    fields
        (N,) each by name; those of an array are called ``q[0]`` and so on.
    rows
        (N,) where each stands in the file, counted from 1.
    """

    name: str
    fields: Mapping[str, Any]
    rows: Indices

    def __len__(self) -> int:
        return len(self.rows)

    def has(self, *names: str) -> bool:
        """Whether it has all of these fields."""
        return all(name in self.fields for name in names)

    def get(self, *names: str) -> Array:
        """(N,) the first of these fields that it has; NaN where it has none of them."""
        for name in names:
            if name in self.fields:
                # NaN of the signalling kind in a damaged log is a NaN like others.
                with np.errstate(invalid="ignore"):
                    return np.asarray(self.fields[name]).astype(np.float64)
        return np.full(len(self), np.nan)

    def columns(self, names: Mapping[str, str], divisor: float = 1.0) -> dict[str, Array]:
        """Columns by our names out of fields (the first of those in a text that it has), divided by a
        number."""
        return {ours: self.get(*theirs.split()) / divisor for ours, theirs in names.items()}

    def several(self, *names: str) -> Array:
        """Fields beside each other, (N, K)."""
        return np.stack([self.get(name) for name in names], axis=1)

    def quaternion(self) -> Array:
        """The field ``q``, (N, 4)."""
        return self.several(*(f"q[{i}]" for i in range(4)))

    def texts(self, name: str) -> list[str]:
        """(N,) a field of text; none where it has no such field."""
        found = self.fields[name].tolist() if name in self.fields else []
        return [decode(one.split(b"\0")[0]) if isinstance(one, bytes) else str(one) for one in found]

    def take(self, which: NDArray[Any]) -> Self:
        """The messages that a mask or an index picks."""
        fields = Columns(self.fields.keys(), lambda name: self.fields[name][which])
        return replace(self, fields=fields, rows=self.rows[which])


def fix_reasons(fix: Array) -> dict[str, Mask]:
    """Reason -> (N,) rows that are no fixes in space, by their kinds; one that is not known may be one."""
    return {"no fix": fix < FIX_PLANE, "a fix without height": fix < FIX_SPACE}


def usable(part: str, found: Stream) -> Mask:
    """(N,) rows of a part that can be used."""
    return ~any_of(judge(part, found).values(), len(found.columns["time_log_s"]))


def at_times(
    stamps: ArrayLike, values: Mapping[str, Array], times: Array, what: str, doubtful: Mask | None = None
) -> dict[str, Array]:
    """Columns at other times, linear; NaN where they do not reach, across a gap, or beside a NaN.

    Parameters
    ----------
    stamps
        (N,) s; of rows whose stamps do not run or whose places nothing can reach nothing is taken.
    values
        (N,) each; of a longitude the short way is taken.
    times
        (T,) s of the same clock.
    what
        For messages.
    doubtful
        (N,) rows of which nothing is taken.

    Returns
    -------
    dict
        (T,) each.
    """
    own = np.asarray(stamps, float)
    place = {name: one for name, one in values.items() if name.startswith(("lat", "lon", "height_"))}
    none = np.isnan(own) if doubtful is None else np.isnan(own) | doubtful
    good = usable("", Stream({"time_log_s": own, **place}, unusable={"doubtful": none}))
    found, finite = np.full((len(times), len(values)), np.nan), np.isfinite(times)
    if good.any():
        taken = {name: one[good] for name, one in values.items()}
        if "longitude_deg" in taken:
            taken["longitude_deg"] = np.unwrap(taken["longitude_deg"], period=360.0)
        # Damaged values may be anything.
        with np.errstate(over="ignore", invalid="ignore"):
            found[finite] = between(own[good], np.stack(list(taken.values()), axis=1), times[finite], what)
    made = named(values, found.T)
    if "longitude_deg" in made:
        made["longitude_deg"] = wrapped(made["longitude_deg"])
    return made


def heading_at(poses: Stream | None, times_s: Array, clock: str = "time_s") -> Array:
    """Yaw of the vehicle at times (N,) of a clock of its poses, deg; NaN where they do not reach."""
    if poses is None or not (used := usable("poses", poses)).any():
        return np.full(len(times_s), np.nan)
    yaw = np.unwrap(poses.columns["yaw_deg"][used], period=360.0)
    return at_times(poses.columns[clock][used], {"yaw": yaw}, times_s, "poses")["yaw"]


def device_angles(q: ArrayLike, flags: ArrayLike, heading_deg: ArrayLike) -> dict[str, Array]:
    """Angles of a gimbal device against north and the horizon.

    Parameters
    ----------
    q
        (N, 4) w, x, y, z; roll and pitch against the horizon, yaw against what the flags say.
    flags
        (N,) of the device; where they do not say what yaw counts from, it is north if yaw is held there, and
        the vehicle if not, as the first devices had it.
    heading_deg
        (N,) yaw of the vehicle, NaN where it is not known.

    Returns
    -------
    dict
        ``roll_world_deg``, ``pitch_world_deg``, ``yaw_world_deg``, (N,) each; NaN where they are not known.
    """
    angles = euler_deg(q, 0.5)
    said = np.asarray(flags).astype(np.int64)
    north = np.where(said & (YAW_NORTH | YAW_VEHICLE), said & YAW_NORTH, said & YAW_LOCK) > 0
    yaw = np.where(north, angles[:, 2], wrapped(angles[:, 2] + np.asarray(heading_deg, float)))
    return named(WORLD, (angles[:, 0], angles[:, 1], yaw))


def euler_deg(q: ArrayLike, tolerance: float) -> Array:
    """Roll, pitch and yaw (N, 3), deg, of quaternions (N, 4) whose length is 1 but for a tolerance, else
    NaN."""
    turns = np.asarray(q, float)
    with np.errstate(over="ignore", invalid="ignore"):
        good = np.isfinite(turns).all(axis=1) & (np.abs(np.linalg.norm(turns, axis=1) - 1) < tolerance)
    turns = np.where(good[:, None], turns, [1.0, 0.0, 0.0, 0.0])
    return np.where(good[:, None], np.degrees(matrix_to_euler(quaternion_to_matrix(turns))), np.nan)


def wrapped(angle_deg: ArrayLike) -> Array:
    """Angles (N,) in [-180, 180) deg."""
    return np.asarray((np.asarray(angle_deg, float) + 180.0) % 360.0 - 180.0)
