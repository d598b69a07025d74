"""What every reader of raw logs gives: parts with the same columns, units and marks, whatever the format.

Stamps of the log's own clock are kept beside the UTC time that they were brought to; heights stand in the
column of what they count from, and are not converted here; rows that cannot be used stay, and say why.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from wildlab.flight.clock_fitting import ClockFit

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

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
VELOCITY = ("v_north_m_s", "v_east_m_s", "v_down_m_s")
_SPREADS = ("sd_horizontal_m", "sd_vertical_m", "sd_velocity_m_s")

#: Parts of a log, and the columns that each may have beside `TIMES` and `MARKS`.
PARTS: dict[str, tuple[str, ...]] = {
    # Where the vehicle was and how it was turned, as it found itself; attitude b -> n by roll, pitch and yaw
    # (zyx), or by a quaternion.
    "poses": (
        *PLACE,
        *VELOCITY,
        *(*ANGLES, "q_w", "q_x", "q_y", "q_z"),
        *("sd_horizontal_m", "sd_vertical_m", "sd_tilt_deg", "sd_heading_deg"),
    ),
    # Satellite positions, of the first receiver; `fix` as NMEA and MAVLink number kinds: 3 is in space.
    "gnss": (*PLACE, *VELOCITY, *_SPREADS, "satellites", "fix", "hdop"),
    # Forward, right, down; at rest and level f is (0, 0, -g).
    "imu": ("f_x_m_s2", "f_y_m_s2", "f_z_m_s2", "w_x_rad_s", "w_y_rad_s", "w_z_rad_s"),
    "magnetometer": tuple(f"field_{axis}_ut" for axis in "xyz"),
    # Of the camera: how it is turned against north and the horizon (`..._world_...`: pitch -90 looks down),
    # or against the airframe (pan and tilt as `wildlab.geometry.mount` has them).
    "gimbal": (*WORLD, "pan_deg", "tilt_deg"),
    # Records of the autopilot that the camera was triggered.
    "triggers": (
        *("number", *PLACE, *ANGLES),
        *("sd_horizontal_m", "sd_vertical_m", "fix", "file"),
    ),
    # Images with what stands in them; `time_log_s` is the camera's own wall clock as if it were UTC.
    "photos": (
        *("file", *PLACE, *ANGLES, *WORLD, "sd_horizontal_m", "sd_vertical_m", "fix"),
        *("width_px", "height_px", "focal_mm", "focal_px", "focal_35mm", "focal_from", "camera"),
    ),
    # Surveyed points that do not move.
    "marks": ("name", *PLACE, "sd_horizontal_m", "sd_vertical_m"),
    # Pixels of things in images: a point, and a box where there is one.
    "clicks": (
        *("image", "name", "u_px", "v_px", "score"),
        *("box_u_px", "box_v_px", "box_width_px", "box_height_px"),
    ),
}
#: Columns of text; all others are numbers.
TEXTS = frozenset({"why", "file", "camera", "focal_from", "name", "image"})


class Clock(NamedTuple):
    """How the log's own stamps were brought to UTC.

    Attributes
    ----------
    base
        What UTC was known from, in a clause: ``"GPS weeks"``, ``"GPS time of messages GPS"``, ``"times of
        receipt"``, ``"UTC of the log"``, ``"local time without a zone"``; ``""`` where it was not.
    rate
        Seconds of UTC for a second of the log's clock.
    offset_s
        UTC of the log's zero, s since 1970.
    spread_s, largest_s
        Robust standard deviation and largest absolute value of what is left over.
    pairs
        From how many pairs of stamps.
    rate_sd
        Standard deviation of the rate; NaN where it was not estimated, or taken for 1.
    """

    base: str
    rate: float = 1.0
    offset_s: float = 0.0
    spread_s: float = 0.0
    largest_s: float = 0.0
    pairs: int = 0
    rate_sd: float = math.nan

    @classmethod
    def fitted(cls, base: str, fit: ClockFit) -> Clock:
        """As a fit of pairs of stamps has it."""
        left = float(np.abs(fit.residual[fit.used]).max())
        return cls(base, fit.rate, fit.offset_s, fit.spread_s, left, int(fit.used.sum()), fit.rate_sd)


def any_of(masks: Iterable[ArrayLike], count: int) -> Mask:
    """(N,) where any of some masks (N,) holds; nowhere, if there is none."""
    none: list[Any] = [np.zeros(count, bool)]
    return np.asarray(np.logical_or.reduce([*none, *masks]), bool)


class Readings(NamedTuple):
    """One part as a reader decodes it, before anything is judged.

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
    rows: ArrayLike | None = None
    counted_in: str = "message"
    unusable: Mapping[str, Mask] = {}
    anywhere: bool = False


@dataclass(frozen=True)
class Decoded:
    """What `decode` of a format gives.

    Attributes
    ----------
    parts
        By name, see `PARTS`.
    vehicle, clock
        As of `RawLog`.
    lost
        How much of what could not be read: a number, what it counts, and the rest of the sentence. Of none
        nothing is said.
    notes
        Sentences on what a user should know of it.
    """

    parts: dict[str, Readings]
    vehicle: str = ""
    clock: Clock | None = None
    lost: Sequence[tuple[int, str, str]] = ()
    notes: Sequence[str] = ()


@dataclass(frozen=True)
class Stream:
    """One part of a log: its columns (N,), and for each row where it stands in the file, counted from 1."""

    columns: dict[str, NDArray[Any]]
    rows: NDArray[np.int64]
    counted_in: str = "message"

    def __len__(self) -> int:
        return len(self.rows)

    @property
    def used(self) -> Mask:
        """(N,) rows that can be used."""
        return np.asarray(self.columns["use"] == 1.0)

    def take(self, rows: NDArray[Any]) -> Stream:
        """The rows that a mask or an index picks."""
        return Stream(
            {name: one[rows] for name, one in self.columns.items()}, self.rows[rows], self.counted_in
        )


@dataclass(frozen=True)
class RawLog:
    """A log, read.

    Attributes
    ----------
    format
        As in `formats.FORMATS`.
    parts
        By name, see `PARTS`; only those that the log has rows of.
    vehicle
        What it says of what carried it, in its words: ``"ArduCopter V3.1.3"``. Empty: nothing.
    clock
        How its stamps became UTC; None where it has none that run.
    lost
        Sentences on what could not be read, each with how much of it.
    notes
        Sentences on what a user should know of it.
    """

    format: str
    parts: dict[str, Stream] = field(default_factory=dict)
    vehicle: str = ""
    clock: Clock | None = None
    lost: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()


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
    known = {*PARTS[part], *TIMES}
    made: dict[str, NDArray[Any]] = {}
    for name, values in columns.items():
        if name not in known:
            raise ValueError(f"{name!r} is no column of {part!r}")
        made[name] = np.asarray(values, dtype=object if name in TEXTS else np.float64)
    lengths = {len(one) for one in made.values()}
    if len(lengths) != 1:
        raise ValueError(f"columns of {part!r} have the lengths {sorted(lengths)}")
    count = lengths.pop()
    why = np.full(count, "", dtype=object)
    for reason, holds in (unusable or {}).items():
        why[np.asarray(holds, bool) & (why == "")] = reason
    at = np.arange(1, count + 1) if rows is None else np.asarray(rows, np.int64)
    marks: dict[str, NDArray[Any]] = {"use": (why == "").astype(np.float64), "why": why}
    return Stream({**made, **marks}, at, counted_in)
