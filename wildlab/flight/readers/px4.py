"""PX4 ULog (``.ulg``), with the field names of old and new firmware, by pyulog.

Stamps count since the start of the system, in us; UTC comes from pairs of them with the receiver's
(``time_utc_usec``). pyulog goes on behind damage, but builds whatever a definition claims: so each use of one
costs as many fields as it has, out of more than any log needs.
"""

from __future__ import annotations

import contextlib
import io
import struct
from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from wildlab.errors import WildlabError
from wildlab.flight.clock_fitting import ClockFit, fit_steady
from wildlab.flight.files import printable
from wildlab.flight.readers.log import (
    ANGLES,
    CUT_OFF,
    FIX_SPACE,
    LAT_LON,
    WORLD,
    Messages,
    RawLog,
    Stream,
    at_times,
    device_angles,
    euler_deg,
    fix_reasons,
    heading_at,
    holding,
    named,
    wrapped,
)
from wildlab.flight.schema import FIELD, FORCE, QUATERNION, RATE, VELOCITY
from wildlab.geometry.frames import Array

MAGIC = b"ULog\x01\x12\x35"
#: Of each message before its content.
HEAD_BYTES = 3
#: Fields of all topics of a log together (real ones have some 5000), and bytes that are no messages.
MOST_FIELDS, MOST_STRANGE = 50_000, 100_000

TOPICS = [
    "vehicle_attitude",
    "vehicle_global_position",
    "vehicle_local_position",
    "vehicle_gps_position",
    "sensor_gps",
    "sensor_combined",
    "vehicle_magnetometer",
    "sensor_mag",
    "camera_capture",
    "camera_trigger",
    "gimbal_device_attitude_status",
    "mount_orientation",
]
#: 2000 and 2100, s since 1970: no receiver's UTC is of another time.
_EARLIEST_S, _LATEST_S = 946_684_800.0, 4_102_444_800.0
#: A sample is at most so much older than its message, s; what is further is no time of a sample.
_OLDEST_S = 1.0
_GAUSS_UT = 100.0
#: Columns -> fields of old and new firmware.
SPREADS = {"sd_horizontal_m": "eph", "sd_vertical_m": "epv"}
QUALITY = {
    "sd_velocity_m_s": "s_variance_m_s",
    "satellites": "satellites_used",
    "fix": "fix_type",
    "hdop": "hdop",
}
#: Kinds of releases, by the lowest number of each.
_RELEASES = ((255, ""), (192, "release candidate"), (128, "beta"), (64, "alpha"), (0, "development"))


def sniff(head: bytes) -> bool:
    """Whether a file that begins with `head` is a ULog."""
    return head.startswith(MAGIC)


def decode(path: Path, data: bytes, zone: str | None) -> RawLog:
    """A ULog.

    Raises
    ------
    WildlabError
        Where it is none, was written in a way that is not known, or holds none of the topics that a flight
        is made of.
    """
    if not data.startswith(MAGIC):
        raise WildlabError("does not begin as a ULog does", "give the .ulg as it was logged", file=path)
    ulog, cut = _read(path, data)
    topics: dict[str, Messages] = {}
    for one in sorted(ulog.data_list, key=lambda one: one.multi_id):
        if "timestamp" in one.data:
            rows = np.arange(1, len(one.data["timestamp"]) + 1)
            topics.setdefault(one.name, Messages(one.name, one.data, rows))
    if not topics:
        raise WildlabError(
            "holds no message of position, attitude or sensors",
            "give the log of a flight",
            file=path,
        )
    log = Px4Log(topics, _utc(topics))
    parts, notes = _parts(log)
    lost_s = sum(one.duration for one in ulog.dropouts) / 1e3
    said = {
        f"the logger fell behind {len(ulog.dropouts)} times and lost {lost_s:.3f} s in all": ulog.dropouts,
        "damaged places are left out": ulog.file_corruption,
        CUT_OFF: cut,
        "UTC is not known: times count from the start of the system": log.fit is None,
    }
    clock = "UTC of the receiver" if log.fit else ""
    return RawLog(parts, _vehicle(ulog.msg_info_dict), clock, notes=notes + holding(said))


class Watched(io.BytesIO):
    """Bytes that remember whether the last read got less than it asked for; where a head is asked for, none
    at all is the end."""

    cut = False

    def read(self, size: int | None = -1, /) -> bytes:
        found = super().read(size)
        self.cut = len(found) < (size or 0) and not (size == HEAD_BYTES and not found)
        return found


def _read(path: Path, data: bytes) -> tuple[Any, bool]:
    """What pyulog makes of it, of the topics that are wanted, and whether it ends within a message."""
    from pyulog import ULog
    from pyulog.exceptions import ULogException

    class Definitions(dict[str, Any]):
        left = MOST_FIELDS

        def __getitem__(self, name: str) -> Any:
            found = super().__getitem__(name)
            self.left -= sum(max(many, 1) for _, many, _ in found.fields)
            if self.left < 0:
                raise KeyError(name)
            return found

    class Bounded(ULog):  # type: ignore[misc]
        def _read_file_definitions(self) -> None:
            super()._read_file_definitions()
            self._message_formats = Definitions(self._message_formats)  # type: ignore[has-type]

        def _check_packet_corruption(self, header: Any) -> bool:
            corrupt = bool(super()._check_packet_corruption(header))
            self.strange = getattr(self, "strange", 0) + corrupt
            if self.strange > MOST_STRANGE:
                raise struct.error  # as at the end of the file
            return corrupt

    try:
        with contextlib.redirect_stdout(io.StringIO()):
            stream = Watched(data)
            return Bounded(stream, TOPICS, disable_str_exceptions=True), stream.cut
    except (ULogException, ValueError, KeyError, IndexError, TypeError, struct.error) as error:
        problem = f"cannot be read ({printable(str(error))[:80]})"
        raise WildlabError(problem, "copy it again", file=path) from None


def _utc(topics: Mapping[str, Messages]) -> ClockFit | None:
    """Time since start to UTC, from the receiver that has most pairs."""
    best: ClockFit | None = None
    for name in ("vehicle_gps_position", "sensor_gps"):
        topic = topics.get(name)
        if topic is None or not topic.has("time_utc_usec"):
            continue
        utc = topic.get("time_utc_usec") / 1e6
        # UTC is of another instant than the message, where the receiver says so.
        own = (topic.get("timestamp") + np.nan_to_num(topic.get("timestamp_time_relative"))) / 1e6
        good = (topic.get("fix_type") >= FIX_SPACE) & (utc > _EARLIEST_S) & (utc < _LATEST_S)
        if good.any() and (best is None or good.sum() > best.used.sum()):
            best = fit_steady(own[good], utc[good])
    return best


def _vehicle(about: dict[str, object]) -> str:
    version, release = "", about.get("ver_sw_release")
    if isinstance(release, int) and release > 0:
        kind = next(name for least, name in _RELEASES if release & 255 >= least)
        version = "v" + ".".join(str(release >> shift & 255) for shift in (24, 16, 8))
        version += f" ({kind})" if kind else ""
    hardware = about.get("ver_hw")
    words = [about.get("sys_name"), version, f"on {hardware}" if isinstance(hardware, str) else ""]
    return printable(" ".join(one for one in words if isinstance(one, str) and one)[:200])


# -- parts


class Px4Log(NamedTuple):
    """Topics by name, and what takes time since start to UTC; None where that is not known."""

    topics: dict[str, Messages]
    fit: ClockFit | None

    def first(self, *names: str) -> Messages:
        """The first of these topics that there is, else one without messages."""
        nothing = Messages(names[0], {}, np.zeros(0, np.int64))
        return next((self.topics[name] for name in names if name in self.topics), nothing)

    def readings(self, found: Messages, columns: dict[str, Array], **more: object) -> Stream:
        """Columns of a topic with ``time_s`` (UTC, NaN where that is not known) and ``time_log_s``."""
        taken = taken_s(found)
        utc = np.full(len(taken), np.nan) if self.fit is None else self.fit.to_reference(taken)
        times = {"time_s": utc, "time_log_s": taken}
        return Stream(times | columns, found.rows, f"message of {found.name}", **more)  # type: ignore[arg-type]


def taken_s(found: Messages) -> Array:
    """When each was measured, (N,) s since start: by the sample's stamp where true, else its own."""
    stamp, sample = found.get("timestamp") / 1e6, found.get("timestamp_sample") / 1e6
    with np.errstate(invalid="ignore"):
        true = (sample > 0) & (sample <= stamp) & (stamp - sample <= _OLDEST_S)
    return np.where(true, sample, stamp)


def _parts(log: Px4Log) -> tuple[dict[str, Stream], list[str]]:
    """All parts that there are rows of, and sentences on what a user should know of them."""
    notes: list[str] = []
    poses = _poses(log, notes)
    parts = {
        "poses": poses,
        "gnss": _gnss(log),
        "imu": _imu(log),
        "magnetometer": _magnetometer(log),
        "triggers": _triggers(log),
        "gimbal": _gimbal(log, poses),
    }
    return {name: one for name, one in parts.items() if one is not None}, notes


def _poses(log: Px4Log, notes: list[str]) -> Stream | None:
    attitude = log.first("vehicle_attitude")
    place, local = log.first("vehicle_global_position"), log.first("vehicle_local_position")
    if not attitude.has("q[0]"):
        if len(place):
            notes.append(f"{len(place)} positions without attitudes make no poses")
        return None
    at = taken_s(attitude)
    if place.has("lat") or place.has("latitude_deg"):
        columns = _at(local, _local_motion(local), at) | _at(place, _from_global(place), at)
    else:
        columns = dict.fromkeys(("latitude_deg", "longitude_deg"), np.full(len(at), np.nan))
        notes.append(f"{len(attitude)} attitudes stand without any position on Earth")
    q = attitude.quaternion()
    with np.errstate(over="ignore", invalid="ignore"):
        q = q / np.linalg.norm(q, axis=1)[:, None]
    angles = euler_deg(attitude.quaternion(), 0.1)
    q[np.isnan(angles).any(axis=1)] = np.nan
    columns |= named((*QUATERNION, *ANGLES), (*q.T, *angles.T))
    return log.readings(attitude, columns)


def _at(found: Messages, values: dict[str, Array], times_s: Array) -> dict[str, Array]:
    """Columns of a topic at other times since start, but for those without any value."""
    known = {
        name: one for name, one in values.items() if name.endswith("tude_deg") or not np.isnan(one).all()
    }
    return at_times(taken_s(found), known, times_s, found.name)


def _from_global(place: Messages) -> dict[str, Array]:
    return {
        **_position(place),
        **place.columns(named(VELOCITY, ("vel_n", "vel_e", "vel_d"))),
        **place.columns(SPREADS),
    }


def _position(place: Messages) -> dict[str, Array]:
    """Degrees and m as floats; some firmware wrote 1e-7 deg and mm as integers."""

    def scaled(by: float, *names: str) -> Array:
        name = next((one for one in names if place.has(one)), names[0])
        values = place.get(name)
        return values * by if place.has(name) and place.fields[name].dtype.kind in "iu" else values

    ellipsoid = scaled(1e-3, "altitude_ellipsoid_m", "alt_ellipsoid")
    return {
        "latitude_deg": scaled(1e-7, "latitude_deg", "lat"),
        "longitude_deg": scaled(1e-7, "longitude_deg", "lon"),
        "height_sea_m": scaled(1e-3, "altitude_msl_m", "alt"),
        # Drivers that do not know it write zero.
        "height_ellipsoid_m": np.where(ellipsoid == 0, np.nan, ellipsoid),
    }


def _local_motion(local: Messages) -> dict[str, Array]:
    with np.errstate(invalid="ignore"):
        # The variance of the tilt is that of both axes together.
        tilt, heading = np.sqrt(local.get("tilt_var") / 2), np.sqrt(local.get("heading_var"))
    return {
        **local.columns(named(VELOCITY, ("vx", "vy", "vz"))),
        "sd_tilt_deg": np.degrees(tilt),
        "sd_heading_deg": np.degrees(heading),
    }


def _gnss(log: Px4Log) -> Stream:
    found = log.first("vehicle_gps_position", "sensor_gps")
    velocity = found.columns(named(VELOCITY, ("vel_n_m_s", "vel_e_m_s", "vel_d_m_s")))
    moving = found.get("vel_ned_valid") != 0
    columns = _position(found) | found.columns(SPREADS | QUALITY)
    columns |= {name: np.where(moving, one, np.nan) for name, one in velocity.items()}
    return log.readings(found, columns, unusable=fix_reasons(columns["fix"]))


def _imu(log: Px4Log) -> Stream:
    found = log.first("sensor_combined")
    names = [f"{name}[{i}]" for name in ("accelerometer_m_s2", "gyro_rad") for i in range(3)]
    return log.readings(found, found.columns(named((*FORCE, *RATE), names)))


def _magnetometer(log: Px4Log) -> Stream | None:
    for name in ("vehicle_magnetometer", "sensor_mag", "sensor_combined"):
        found = log.first(name)
        fields = "xyz" if name == "sensor_mag" else [f"magnetometer_ga[{i}]" for i in range(3)]
        if found.has(*fields):
            columns = {ours: found.get(one) * _GAUSS_UT for ours, one in zip(FIELD, fields, strict=True)}
            return log.readings(found, columns)
    return None


def _triggers(log: Px4Log) -> Stream:
    found = log.first("camera_capture", "camera_trigger")
    fields = LAT_LON | {"height_sea_m": "alt"} if found.has("lat") else {}
    return log.readings(found, found.columns({"number": "seq", **fields}), anywhere=True)


def _gimbal(log: Px4Log, poses: Stream | None) -> Stream | None:
    device, mount = log.first("gimbal_device_attitude_status"), log.first("mount_orientation")
    if device.has("q[0]"):
        heading = heading_at(poses, taken_s(device), "time_log_s")
        flags = np.nan_to_num(device.get("device_flags"))
        return log.readings(device, device_angles(device.quaternion(), flags, heading))
    if not len(mount):
        return None
    roll, pitch, yaw = np.degrees(mount.several(*(f"attitude_euler_angle[{i}]" for i in range(3)))).T
    world = wrapped(yaw + heading_at(poses, taken_s(mount), "time_log_s"))
    return log.readings(mount, named(WORLD, (roll, pitch, world)))
