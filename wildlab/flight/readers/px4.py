"""PX4 ULog (``.ulg``), with the field names of old and new firmware, by pyulog.

Only what `wildlab.flight.readers.ulog` has found sound is given to pyulog. Stamps count since the start of
the system, in us; UTC comes from pairs of them with the receiver's (``time_utc_usec``).
"""

from __future__ import annotations

import contextlib
import io
from collections.abc import Mapping
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from wildlab.errors import WildlabError
from wildlab.flight.files import printable
from wildlab.flight.readers.autopilot import (
    AXES,
    FIELD,
    FIX_SPACE,
    IMU,
    Messages,
    at_times,
    device_angles,
    euler_deg,
    fix_reasons,
    heading_at,
    wrapped,
)
from wildlab.flight.readers.judging import placed
from wildlab.flight.readers.log import ANGLES, WORLD, Array, Clock, Decoded, Readings
from wildlab.flight.readers.ulog import MAGIC, Sound, sound_part
from wildlab.flight.time.fitting import ClockFit
from wildlab.flight.time.steady import fit_steady

TOPICS = frozenset(
    {
        *("vehicle_attitude", "vehicle_global_position", "vehicle_local_position"),
        *("vehicle_gps_position", "sensor_gps", "sensor_combined", "vehicle_magnetometer", "sensor_mag"),
        *("camera_capture", "camera_trigger", "gimbal_device_attitude_status", "mount_orientation"),
    }
)
#: 2000 and 2100, s since 1970: no receiver's UTC is of another time.
_EARLIEST_S, _LATEST_S = 946_684_800.0, 4_102_444_800.0
#: A sample is at most so much older than its message, s; what is further is no time of a sample.
_OLDEST_S = 1.0
#: Of the sphere on which PX4 lays its local frame, m.
PX4_EARTH_M = 6371000.0
_GAUSS_UT = 100.0
#: Kinds of releases, by the lowest number of each.
_RELEASES = ((255, ""), (192, "release candidate"), (128, "beta"), (64, "alpha"), (0, "development"))


def sniff(head: bytes, name: str) -> bool:
    """Whether a file that begins with `head` is a ULog; its name is not needed."""
    return head.startswith(MAGIC)


def decode(path: Path, data: bytes, zone: str | None = None) -> Decoded:
    """A ULog.

    Raises
    ------
    WildlabError
        Where it is none, was written in a way that is not known, or holds none of the topics that a flight
        is made of.
    """
    if not data.startswith(MAGIC):
        raise WildlabError("does not begin as a ULog does", "give the .ulg as it was logged", file=path)
    sound = sound_part(data, TOPICS)
    if sound.flags:
        raise WildlabError(
            f"says that it holds what readers have to know of, and is not known (flags {sound.flags:#x})",
            "export it with PX4's own tools first, or copy it again if it was damaged",
            file=path,
        )
    topics, about = _topics(sound)
    lost = _lost(sound, len(data))
    if not topics:
        said = "; ".join(f"{count} {what} {rest}" for count, what, rest in lost if count)
        raise WildlabError(
            f"holds no message of position, attitude or sensors that can be read{said and f' ({said})'}",
            "give the log of a flight",
            file=path,
        )
    log = Px4Log(topics, _utc(topics))
    parts, notes = _parts(log)
    if sound.dropouts:
        notes.append(f"the logger fell behind {sound.dropouts} times and lost {sound.dropout_s:.3f} s in all")
    if log.fit is None:
        notes.append("no receiver told UTC: its times count from the start of the system alone")
    clock = Clock("") if log.fit is None else Clock.fitted("UTC of the receiver", log.fit)
    return Decoded(parts, _vehicle(about), clock, lost, notes)


def _topics(sound: Sound) -> tuple[dict[str, Messages], dict[str, object]]:
    """The first instance of each topic, and what the log says of itself."""
    from pyulog import ULog
    from pyulog.exceptions import ULogException

    try:
        with contextlib.redirect_stdout(io.StringIO()):
            log = ULog(io.BytesIO(sound.data))
    except (ULogException, ValueError, KeyError, IndexError, TypeError):
        return {}, {}
    found: dict[str, Messages] = {}
    for one in sorted(log.data_list, key=lambda one: one.multi_id):
        rows = np.arange(1, len(one.data["timestamp"]) + 1)
        found.setdefault(one.name, Messages(one.name, one.data, rows))
    return found, dict(log.msg_info_dict)


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


def _lost(sound: Sound, total: int) -> list[tuple[int, str, str]]:
    homeless = list(sound.homeless.items())
    lost = [
        (sound.skipped, "byte", f"of {total} in {sound.places} places are no messages"),
        (sound.rest, "byte", f"of {total} at the end: it ends within a message"),
    ]
    for name, count in homeless[:8]:
        whose = f"the topic {printable(name)!r}" if name else "topics that nothing introduces"
        lost.append((count, "message", f"of {whose} without a definition that can be true"))
    more = sum(count for _, count in homeless[8:])
    return [*lost, (more, "message", f"of {len(homeless) - 8} more topics likewise")]


# -- parts


class Px4Log(NamedTuple):
    """Topics by name, and what takes time since start to UTC; None where that is not known."""

    topics: dict[str, Messages]
    fit: ClockFit | None

    def first(self, *names: str) -> Messages | None:
        """The first of these topics that there is."""
        return next((self.topics[name] for name in names if name in self.topics), None)

    def readings(self, found: Messages, columns: dict[str, Array], **more: object) -> Readings:
        """Columns of a topic with ``time_s`` (UTC, NaN where that is not known) and ``time_log_s``."""
        taken = taken_s(found)
        utc = np.full(len(taken), np.nan) if self.fit is None else self.fit.to_reference(taken)
        times = {"time_s": utc, "time_log_s": taken}
        return Readings(times | columns, found.rows, f"message of {found.name}", **more)  # type: ignore[arg-type]


def taken_s(found: Messages) -> Array:
    """When each was measured, (N,) s since start: by the sample's stamp where true, else its own."""
    stamp, sample = found.get("timestamp") / 1e6, found.get("timestamp_sample") / 1e6
    with np.errstate(invalid="ignore"):
        true = (sample > 0) & (sample <= stamp) & (stamp - sample <= _OLDEST_S)
    return np.where(true, sample, stamp)


def from_local(
    north_m: ArrayLike, east_m: ArrayLike, latitude_deg: ArrayLike, longitude_deg: ArrayLike
) -> tuple[Array, Array]:
    """Latitude and longitude of places in PX4's local frame.

    PX4 lays the frame out by an azimuthal equidistant projection of a sphere; back on the same sphere it
    gives what its filter held, where an ellipsoid would be off by up to 0.5 % of the distance.

    Parameters
    ----------
    north_m, east_m
        (N,) m.
    latitude_deg, longitude_deg
        (N,) of the frame's origin.

    Returns
    -------
    latitude, longitude
        (N,) deg.
    """
    x, y = np.asarray(north_m, float) / PX4_EARTH_M, np.asarray(east_m, float) / PX4_EARTH_M
    lat_0, lon_0 = np.radians(latitude_deg), np.radians(longitude_deg)
    c = np.hypot(x, y)
    share = np.sinc(c / np.pi)  # sin(c) / c
    lat = np.arcsin(np.clip(np.cos(c) * np.sin(lat_0) + x * share * np.cos(lat_0), -1.0, 1.0))
    lon = lon_0 + np.arctan2(y * share, np.cos(lat_0) * np.cos(c) - x * share * np.sin(lat_0))
    return np.degrees(lat), np.degrees(lon)


def _parts(log: Px4Log) -> tuple[dict[str, Readings], list[str]]:
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


def _poses(log: Px4Log, notes: list[str]) -> Readings | None:
    attitude = log.first("vehicle_attitude")
    place, local = log.first("vehicle_global_position"), log.first("vehicle_local_position")
    if attitude is None or not attitude.has("q[0]"):
        if place is not None:
            notes.append(f"{len(place)} positions stand without any attitude: there are no poses")
        return None
    at = taken_s(attitude)
    if place is not None and (place.has("lat") or place.has("latitude_deg")):
        columns = _at(place, _from_global(place), at)
        if local is not None:
            columns = _at(local, _local_motion(local), at) | columns
    elif local is not None and local.has("ref_lat"):
        columns = _at(local, _from_local(local) | _local_motion(local), at)
        notes.append("positions are those of the local frame on its origin: the log has no global ones")
    else:
        columns = dict.fromkeys(("latitude_deg", "longitude_deg"), np.full(len(at), np.nan))
        notes.append(f"{len(attitude)} attitudes stand without any position on Earth")
    q = attitude.quaternion()
    with np.errstate(over="ignore", invalid="ignore"):
        q = q / np.linalg.norm(q, axis=1)[:, None]
    angles = euler_deg(attitude.quaternion(), 0.1)
    q[np.isnan(angles).any(axis=1)] = np.nan
    columns |= dict(zip(("q_w", "q_x", "q_y", "q_z", *ANGLES), (*q.T, *angles.T), strict=True))
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
        **{f"v_{axis}_m_s": place.get(f"vel_{axis[0]}") for axis in ("north", "east", "down")},
        **{"sd_horizontal_m": place.get("eph"), "sd_vertical_m": place.get("epv")},
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


def _from_local(local: Messages) -> dict[str, Array]:
    origin = local.get("ref_lat"), local.get("ref_lon")
    latitude, longitude = from_local(local.get("x"), local.get("y"), *origin)
    known = placed(*origin)
    if local.has("xy_global"):
        known &= local.get("xy_global") > 0
    return {
        "latitude_deg": np.where(known, latitude, np.nan),
        "longitude_deg": np.where(known, longitude, np.nan),
        "height_sea_m": local.get("ref_alt") - local.get("z"),
        **{"sd_horizontal_m": local.get("eph"), "sd_vertical_m": local.get("epv")},
    }


def _local_motion(local: Messages) -> dict[str, Array]:
    with np.errstate(invalid="ignore"):
        # The variance of the tilt is that of both axes together.
        tilt, heading = np.sqrt(local.get("tilt_var") / 2), np.sqrt(local.get("heading_var"))
    return {
        **{f"v_{axis}_m_s": local.get(f"v{one}") for axis, one in zip(AXES, "xyz", strict=True)},
        **{"sd_tilt_deg": np.degrees(tilt), "sd_heading_deg": np.degrees(heading)},
    }


def _gnss(log: Px4Log) -> Readings | None:
    found = log.first("vehicle_gps_position", "sensor_gps")
    if found is None or not (found.has("lat") or found.has("latitude_deg")):
        return None
    moving = found.get("vel_ned_valid") != 0
    columns = {
        **_position(found),
        **{"sd_horizontal_m": found.get("eph"), "sd_vertical_m": found.get("epv")},
        "sd_velocity_m_s": found.get("s_variance_m_s"),
        "satellites": found.get("satellites_used"),
        **{"fix": found.get("fix_type"), "hdop": found.get("hdop")},
    }
    for axis in AXES:
        columns[f"v_{axis}_m_s"] = np.where(moving, found.get(f"vel_{axis[0]}_m_s"), np.nan)
    return log.readings(found, columns, unusable=fix_reasons(columns["fix"]))


def _imu(log: Px4Log) -> Readings | None:
    found = log.first("sensor_combined")
    if found is None:
        return None
    names = [f"{name}[{i}]" for name in ("accelerometer_m_s2", "gyro_rad") for i in range(3)]
    columns = {ours: found.get(theirs) for ours, theirs in zip(IMU, names, strict=True)}
    return None if np.isnan(list(columns.values())).all() else log.readings(found, columns)


def _magnetometer(log: Px4Log) -> Readings | None:
    for name in ("vehicle_magnetometer", "sensor_mag", "sensor_combined"):
        found = log.first(name)
        if found is None:
            continue
        fields = "xyz" if name == "sensor_mag" else [f"magnetometer_ga[{i}]" for i in range(3)]
        columns = {ours: found.get(one) * _GAUSS_UT for ours, one in zip(FIELD, fields, strict=True)}
        if not np.isnan(list(columns.values())).all():
            return log.readings(found, columns)
    return None


def _triggers(log: Px4Log) -> Readings | None:
    found = log.first("camera_capture", "camera_trigger")
    if found is None:
        return None
    columns = {"number": found.get("seq")}
    if found.has("lat"):
        there = placed(found.get("lat"), found.get("lon"))
        place = {"latitude_deg": "lat", "longitude_deg": "lon", "height_sea_m": "alt"}
        columns |= {name: np.where(there, found.get(field), np.nan) for name, field in place.items()}
    return log.readings(found, columns, anywhere=True)


def _gimbal(log: Px4Log, poses: Readings | None) -> Readings | None:
    device, mount = log.first("gimbal_device_attitude_status"), log.first("mount_orientation")
    if device is not None and device.has("q[0]"):
        heading = heading_at(poses, taken_s(device), "time_log_s")
        flags = np.nan_to_num(device.get("device_flags"))
        return log.readings(device, device_angles(device.quaternion(), flags, heading))
    if mount is None:
        return None
    roll, pitch, yaw = np.degrees(mount.several(*(f"attitude_euler_angle[{i}]" for i in range(3)))).T
    world = wrapped(yaw + heading_at(poses, taken_s(mount), "time_log_s"))
    return log.readings(mount, dict(zip(WORLD, (roll, pitch, world), strict=True)))
