"""What logs of autopilots share, whatever they call it: messages of one kind, and values at other times."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from wildlab.flight.clocks import between
from wildlab.flight.readers.log import WORLD, Array, Mask, Readings, any_of, judge, named
from wildlab.flight.readers.text import decode
from wildlab.geometry.frames import matrix_to_euler, quaternion_to_matrix

#: Kinds of fix as MAVLink numbers them: on the level, and in space.
FIX_PLANE, FIX_SPACE = 2, 3
#: GIMBAL_DEVICE_FLAGS: yaw is held against north; it is given against the vehicle; it is given against north.
YAW_LOCK, YAW_VEHICLE, YAW_NORTH = 16, 32, 64
IMU = ("f_x_m_s2", "f_y_m_s2", "f_z_m_s2", "w_x_rad_s", "w_y_rad_s", "w_z_rad_s")
FIELD = ("field_x_ut", "field_y_ut", "field_z_ut")
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
    rows: NDArray[np.int64]

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


def usable(part: str, found: Readings) -> Mask:
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
    good = usable("", Readings({"time_log_s": own, **place}, unusable={"doubtful": none}))
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


def heading_at(poses: Readings | None, times_s: Array, clock: str = "time_s") -> Array:
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
