"""Parts of a PX4 log, each from the topic that tells it best."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from wildlab.flight.clocks import between
from wildlab.flight.readers.logs.gimbals import device_angles, heading_at, unturned, wrapped
from wildlab.flight.readers.logs.log import Stream
from wildlab.flight.readers.logs.order import in_order
from wildlab.flight.readers.logs.places import ONE_HEIGHT, impossible_places, one_height, placed
from wildlab.flight.readers.logs.stamps import places_that_hold, running_stream
from wildlab.flight.readers.px4.topics import Flags, Topic, from_local
from wildlab.flight.time.fitting import ClockFit
from wildlab.geometry.frames import matrix_to_euler, quaternion_to_matrix

Array = NDArray[np.float64]

TOPICS = frozenset(
    {
        *("vehicle_attitude", "vehicle_global_position", "vehicle_local_position"),
        *("vehicle_gps_position", "sensor_gps", "sensor_combined", "vehicle_magnetometer", "sensor_mag"),
        *("camera_capture", "camera_trigger", "gimbal_device_attitude_status", "mount_orientation"),
    }
)
_FIX_SPACE, _FIX_PLANE = 3, 2
#: A quaternion of another length is none.
_UNIT = (0.9, 1.1)
_GAUSS_UT = 100.0


def read_parts(topics: dict[str, Topic], fit: ClockFit | None) -> tuple[dict[str, Stream], list[str]]:
    """All parts that there are rows of, and sentences on what a user should know of them.

    Parameters
    ----------
    topics
        By name, the first instance of each.
    fit
        Time since start to UTC; None where that is not known.

    Returns
    -------
    parts, notes
    """
    notes: list[str] = []
    poses, gnss = _poses(topics, fit, notes), _gnss(topics, fit)
    if gnss is not None and one_height(gnss.columns):
        notes.append(ONE_HEIGHT)
        for stream in (poses, gnss):
            if stream is not None:
                stream.columns.pop("height_ellipsoid_m", None)
    parts = {
        "poses": poses,
        "gnss": gnss,
        "imu": _imu(topics, fit),
        "magnetometer": _magnetometer(topics, fit),
        "triggers": _triggers(topics, fit),
        "gimbal": _gimbal(topics, fit, poses),
    }
    return {name: one for name, one in parts.items() if one is not None}, notes


def _poses(topics: dict[str, Topic], fit: ClockFit | None, notes: list[str]) -> Stream | None:
    attitude = topics.get("vehicle_attitude")
    place, local = topics.get("vehicle_global_position"), topics.get("vehicle_local_position")
    if attitude is None or not attitude.has("q[0]"):
        if place is not None:
            notes.append(f"{len(place)} positions stand without any attitude: there are no poses")
        return None
    columns = attitude.times(fit)
    at = columns["time_log_s"]
    if place is not None and place.has("lat", "latitude_deg"):
        columns |= _at(place, _from_global(place), at)
        if local is not None:
            motion = _local_motion(local)
            columns |= {name: one for name, one in _at(local, motion, at).items() if name not in columns}
    elif local is not None and local.has("ref_lat"):
        columns |= _at(local, _from_local(local) | _local_motion(local), at)
        notes.append("positions are those of the local frame on its origin: the log has no global ones")
    else:
        columns |= {"latitude_deg": np.full(len(at), np.nan), "longitude_deg": np.full(len(at), np.nan)}
        notes.append(f"{len(attitude)} attitudes stand without any position on Earth")
    q = attitude.several("q", 4)
    with np.errstate(over="ignore", invalid="ignore"):
        length = np.linalg.norm(q, axis=1)
        turned = (length > _UNIT[0]) & (length < _UNIT[1])
    q = np.where(turned[:, None], q / np.where(turned, length, 1.0)[:, None], np.nan)
    angles = np.degrees(matrix_to_euler(quaternion_to_matrix(q)))
    columns |= dict(zip(("q_w", "q_x", "q_y", "q_z"), q.T, strict=True))
    columns |= dict(zip(("roll_deg", "pitch_deg", "yaw_deg"), angles.T, strict=True))
    wrong: dict[str, Flags] = {
        "no attitude": ~turned,
        "no position within reach": ~placed(columns["latitude_deg"], columns["longitude_deg"]),
        **impossible_places(columns),
    }
    return _stream("poses", columns, attitude, wrong)


def _from_global(place: Topic) -> dict[str, Array]:
    return {
        # Degrees as a double; some firmware wrote 1e-7 deg as an integer, mm with it.
        "latitude_deg": _degrees(place, "latitude_deg", "lat"),
        "longitude_deg": _degrees(place, "longitude_deg", "lon"),
        "height_sea_m": _metres(place, "altitude_msl_m", "alt"),
        "height_ellipsoid_m": _ellipsoid(place),
        "v_north_m_s": place.get("vel_n"),
        "v_east_m_s": place.get("vel_e"),
        "v_down_m_s": place.get("vel_d"),
        "sd_horizontal_m": place.get("eph"),
        "sd_vertical_m": place.get("epv"),
    }


def _from_local(local: Topic) -> dict[str, Array]:
    latitude, longitude = from_local(
        local.get("x"), local.get("y"), local.get("ref_lat"), local.get("ref_lon")
    )
    known = placed(local.get("ref_lat"), local.get("ref_lon"))
    if local.has("xy_global"):
        known &= local.get("xy_global") > 0
    return {
        "latitude_deg": np.where(known, latitude, np.nan),
        "longitude_deg": np.where(known, longitude, np.nan),
        "height_sea_m": local.get("ref_alt") - local.get("z"),
        "sd_horizontal_m": local.get("eph"),
        "sd_vertical_m": local.get("epv"),
    }


def _local_motion(local: Topic) -> dict[str, Array]:
    with np.errstate(invalid="ignore"):
        # The variance of the tilt is that of both axes together.
        tilt, heading = np.sqrt(local.get("tilt_var") / 2), np.sqrt(local.get("heading_var"))
    return {
        "v_north_m_s": local.get("vx"),
        "v_east_m_s": local.get("vy"),
        "v_down_m_s": local.get("vz"),
        "sd_tilt_deg": np.degrees(tilt),
        "sd_heading_deg": np.degrees(heading),
    }


def _at(topic: Topic, values: dict[str, Array], times_s: Array) -> dict[str, Array]:
    """Columns of a topic at other times since start, linear, no gap bridged; without those of no value."""
    stamps = topic.taken_s()
    good = in_order(stamps)
    if "latitude_deg" in values:
        good = places_that_hold(stamps, values, np.zeros(len(stamps), bool))
        # Longitudes next to the date line are neighbours.
        longitude = values["longitude_deg"].copy()
        longitude[good] = np.unwrap(longitude[good], period=360.0)
        values = {**values, "longitude_deg": longitude}
    kept = {name: one for name, one in values.items() if not np.isnan(one).all()}
    if "latitude_deg" in values:
        kept |= {name: values[name] for name in ("latitude_deg", "longitude_deg")}
    found = np.full((len(times_s), len(kept)), np.nan)
    finite = np.isfinite(times_s)
    if good.any() and kept:
        table = np.stack(list(kept.values()), axis=1)[good]
        with np.errstate(over="ignore", invalid="ignore"):
            found[finite] = between(stamps[good], table, times_s[finite], topic.name)
    made = dict(zip(kept, found.T, strict=True))
    if "longitude_deg" in made:
        made["longitude_deg"] = wrapped(made["longitude_deg"])
    return made


def _gnss(topics: dict[str, Topic], fit: ClockFit | None) -> Stream | None:
    found = topics.get("vehicle_gps_position", topics.get("sensor_gps"))
    if found is None or not found.has("lat", "latitude_deg"):
        return None
    columns = found.times(fit) | {
        "latitude_deg": _degrees(found, "latitude_deg", "lat"),
        "longitude_deg": _degrees(found, "longitude_deg", "lon"),
        "height_sea_m": _metres(found, "altitude_msl_m", "alt"),
        "height_ellipsoid_m": _ellipsoid(found),
        "sd_horizontal_m": found.get("eph"),
        "sd_vertical_m": found.get("epv"),
        "sd_velocity_m_s": found.get("s_variance_m_s"),
        "satellites": found.get("satellites_used"),
        "fix": found.get("fix_type"),
        "hdop": found.get("hdop"),
    }
    moving = found.get("vel_ned_valid") != 0
    for axis, name in zip("ned", ("v_north_m_s", "v_east_m_s", "v_down_m_s"), strict=True):
        columns[name] = np.where(moving, found.get(f"vel_{axis}_m_s"), np.nan)
    kept = {"time_s", "time_log_s", "latitude_deg", "longitude_deg"}
    columns = {name: one for name, one in columns.items() if name in kept or not np.isnan(one).all()}
    fix = found.get("fix_type")
    wrong = {
        "no fix": fix < _FIX_PLANE,
        "a fix without height": fix < _FIX_SPACE,
        "no position": ~placed(columns["latitude_deg"], columns["longitude_deg"]),
        **impossible_places(columns),
    }
    return _stream("gnss", columns, found, wrong)


def _imu(topics: dict[str, Topic], fit: ClockFit | None) -> Stream | None:
    found = topics.get("sensor_combined")
    if found is None:
        return None
    values = np.concatenate([found.several("accelerometer_m_s2", 3), found.several("gyro_rad", 3)], axis=1)
    if np.isnan(values).all():
        return None
    names = ("f_x_m_s2", "f_y_m_s2", "f_z_m_s2", "w_x_rad_s", "w_y_rad_s", "w_z_rad_s")
    columns = found.times(fit) | dict(zip(names, values.T, strict=True))
    # Ten times what such sensors can measure.
    largest = np.array([3000.0] * 3 + [400.0] * 3)
    with np.errstate(invalid="ignore"):
        wrong = {
            "not a number": np.asarray(~np.isfinite(values).all(axis=1)),
            "more than a sensor can measure": np.asarray((np.abs(values) > largest).any(axis=1)),
        }
    return _stream("imu", columns, found, wrong)


def _magnetometer(topics: dict[str, Topic], fit: ClockFit | None) -> Stream | None:
    for name in ("vehicle_magnetometer", "sensor_mag", "sensor_combined"):
        found = topics.get(name)
        if found is None:
            continue
        field = found.several("magnetometer_ga", 3)
        if name == "sensor_mag":
            field = np.stack([found.get(axis) for axis in "xyz"], axis=1)
        if np.isnan(field).all():
            continue
        columns = found.times(fit)
        columns |= {f"field_{axis}_ut": one for axis, one in zip("xyz", field.T * _GAUSS_UT, strict=True)}
        return _stream(
            "magnetometer", columns, found, {"no measurement": np.asarray(~np.isfinite(field).all(axis=1))}
        )
    return None


def _triggers(topics: dict[str, Topic], fit: ClockFit | None) -> Stream | None:
    found = topics.get("camera_capture", topics.get("camera_trigger"))
    if found is None:
        return None
    columns = found.times(fit) | {"number": found.get("seq")}
    if found.has("lat"):
        there = placed(found.get("lat"), found.get("lon"))
        place = {"latitude_deg": "lat", "longitude_deg": "lon", "height_sea_m": "alt"}
        columns |= {name: np.where(there, found.get(field), np.nan) for name, field in place.items()}
    return _stream("triggers", columns, found, {})


def _gimbal(topics: dict[str, Topic], fit: ClockFit | None, poses: Stream | None) -> Stream | None:
    found = topics.get("gimbal_device_attitude_status")
    if found is not None and found.has("q[0]"):
        columns = found.times(fit)
        flags = np.nan_to_num(found.get("device_flags"))
        angles = device_angles(
            found.several("q", 4), flags, heading_at(poses, columns["time_log_s"], "time_log_s")
        )
        return _stream("gimbal", columns | angles, found, unturned(angles))
    found = topics.get("mount_orientation")
    if found is None:
        return None
    columns = found.times(fit)
    roll, pitch, yaw = np.degrees(found.several("attitude_euler_angle", 3)).T
    world = wrapped(yaw + heading_at(poses, columns["time_log_s"], "time_log_s"))
    angles = {"roll_world_deg": roll, "pitch_world_deg": pitch, "yaw_world_deg": world}
    return _stream("gimbal", columns | angles, found, unturned(angles))


def _degrees(topic: Topic, new: str, old: str) -> Array:
    """An angle that is in degrees where it is a float, in 1e-7 deg where it is an integer."""
    name = new if new in topic.data else old
    values = topic.get(name)
    return values * 1e-7 if name in topic.data and topic.data[name].dtype.kind in "iu" else values


def _metres(topic: Topic, new: str, old: str) -> Array:
    """A height that is in m where it is a float, in mm where it is an integer; NaN where it has none."""
    name = new if new in topic.data else old
    values = topic.get(name)
    return values * 1e-3 if name in topic.data and topic.data[name].dtype.kind in "iu" else values


def _ellipsoid(topic: Topic) -> Array:
    """Height above the ellipsoid, m; NaN where it is just zero, which drivers write that do not know it."""
    height = _metres(topic, "altitude_ellipsoid_m", "alt_ellipsoid")
    return np.where(height == 0, np.nan, height)


def _stream(part: str, columns: dict[str, Array], found: Topic, wrong: dict[str, Flags]) -> Stream | None:
    return running_stream(part, columns, np.arange(1, len(found) + 1), f"message of {found.name}", wrong)
