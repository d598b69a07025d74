"""Parts of a telemetry log, each from the messages of one vehicle that tell it best."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from wildlab.flight.clocks import between
from wildlab.flight.readers.logs.gimbals import device_angles, heading_at, unturned, wrapped
from wildlab.flight.readers.logs.log import Stream
from wildlab.flight.readers.logs.places import ONE_HEIGHT, impossible_places, one_height, placed
from wildlab.flight.readers.logs.stamps import places_that_hold, running_stream
from wildlab.flight.readers.mavlink.clock import Boot, Flags, times
from wildlab.flight.readers.mavlink.frames import MavlinkFrames, Messages, messages

Array = NDArray[np.float64]

STANDARD_GRAVITY = 9.80665
#: In units of g: what a device at rest and in flight feels in the middle, whatever it is called raw.
_FELT = (0.5, 2.0)
#: Values that mean "not known" in 8 and 16 bits.
_NO_8, _NO_16 = 255, 65535
_FIX_SPACE, _FIX_PLANE = 3, 2


def read_parts(
    frames: MavlinkFrames, system: int, component: int, boot: Boot | None
) -> tuple[dict[str, Stream], list[str]]:
    """All parts that there are rows of, and sentences on what a user should know of them.

    Parameters
    ----------
    frames
        Of the log.
    system, component
        The autopilot's.
    boot
        Its clock, None where nothing has a stamp.

    Returns
    -------
    parts, notes
    """
    notes: list[str] = []

    def own(name: str) -> Messages:
        return messages(frames, name, system, component)

    gnss = _gnss(own("GPS_RAW_INT"), boot)
    if gnss is not None and one_height(gnss.columns):
        notes.append(ONE_HEIGHT)
        del gnss.columns["height_ellipsoid_m"]
    parts = {
        "poses": _poses(own("ATTITUDE"), own("GLOBAL_POSITION_INT"), boot, notes),
        "gnss": gnss,
        **_inertial({name: own(name) for name in ("HIGHRES_IMU", "SCALED_IMU", "RAW_IMU")}, boot, notes),
    }
    # Cameras and gimbals may be components of their own.
    cameras = {name: messages(frames, name, system) for name in ("CAMERA_FEEDBACK", "CAMERA_TRIGGER")}
    parts["triggers"] = _triggers(cameras, component, boot, notes)
    poses = parts["poses"]
    for reader in (_gimbal_device, _mount_orientation, _mount_status):
        made = reader(frames, system, component, boot, poses, notes)
        if made is not None:
            parts["gimbal"] = made
            break
    return {name: one for name, one in parts.items() if one is not None and len(one)}, notes


def _poses(attitude: Messages, position: Messages, boot: Boot | None, notes: list[str]) -> Stream | None:
    if not len(attitude):
        if len(position):
            notes.append(f"{len(position)} positions stand without any attitude: there are no poses")
        return None
    columns, wrong = times(attitude, boot, "time_boot_ms")
    at = columns["time_s"]
    place = {
        "latitude_deg": position["lat"] / 1e7,
        "longitude_deg": position["lon"] / 1e7,
        "height_sea_m": position["alt"] / 1e3,
        "height_home_m": position["relative_alt"] / 1e3,
        "v_north_m_s": position["vx"] / 1e2,
        "v_east_m_s": position["vy"] / 1e2,
        "v_down_m_s": position["vz"] / 1e2,
    }
    stamps, doubtful = times(position, boot, "time_boot_ms")
    bad = np.logical_or.reduce([*doubtful.values(), np.zeros(len(position), bool)])
    good = places_that_hold(stamps["time_s"], place, bad)
    values = np.stack(list(place.values()), axis=1)[good]
    found = np.full((len(attitude), len(place)), np.nan)
    finite = np.isfinite(at)
    if good.any():
        found[finite] = between(stamps["time_s"][good], values, at[finite], "GLOBAL_POSITION_INT")
    columns |= dict(zip(place, found.T, strict=True))
    columns |= {f"{name}_deg": np.degrees(attitude[name]) for name in ("roll", "pitch", "yaw")}
    turns = np.stack([attitude[name] for name in ("roll", "pitch", "yaw")])
    with np.errstate(invalid="ignore"):
        turned = (np.abs(turns) <= 2 * np.pi).all(axis=0)
    wrong |= {"no attitude": ~turned, "no position within reach": np.isnan(found).any(axis=1)}
    wrong |= impossible_places(columns)
    return _stream("poses", columns, attitude, wrong)


def _gnss(found: Messages, boot: Boot | None) -> Stream | None:
    columns, wrong = times(found, boot, "time_usec")
    speed = _known(found["vel"], _NO_16) / 1e2
    course = np.radians(_known(found["cog"], _NO_16) / 1e2)
    columns |= {
        "latitude_deg": found["lat"] / 1e7,
        "longitude_deg": found["lon"] / 1e7,
        "height_sea_m": found["alt"] / 1e3,
        # Zeros at the end of a message are not sent: zero and not known look alike.
        "height_ellipsoid_m": _known(found["alt_ellipsoid"], 0) / 1e3,
        "v_north_m_s": speed * np.cos(course),
        "v_east_m_s": speed * np.sin(course),
        "sd_horizontal_m": _known(found["h_acc"], 0) / 1e3,
        "sd_vertical_m": _known(found["v_acc"], 0) / 1e3,
        "sd_velocity_m_s": _known(found["vel_acc"], 0) / 1e3,
        "satellites": _known(found["satellites_visible"], _NO_8),
        "fix": found["fix_type"],
        "hdop": _known(found["eph"], _NO_16) / 1e2,
    }
    wrong = {
        "no fix": columns["fix"] < _FIX_PLANE,
        "a fix without height": columns["fix"] < _FIX_SPACE,
        **wrong,
        "no position": ~placed(columns["latitude_deg"], columns["longitude_deg"]),
        **impossible_places(columns),
    }
    return _stream("gnss", _without_empty(columns), found, wrong)


def _inertial(kinds: dict[str, Messages], boot: Boot | None, notes: list[str]) -> dict[str, Stream | None]:
    """Of the first device, from the message in the best known units."""
    for name, every in kinds.items():
        found = every.only(every["id"] == 0) if "id" in every.fields else every
        if not len(found):
            continue
        si = name == "HIGHRES_IMU"
        force = np.stack([found[f"{axis}acc"] for axis in "xyz"]) * (1.0 if si else STANDARD_GRAVITY / 1e3)
        rate = np.stack([found[f"{axis}gyro"] for axis in "xyz"]) * (1.0 if si else 1e-3)
        # Gauss and milligauss to microtesla.
        field = np.stack([found[f"{axis}mag"] for axis in "xyz"]) * (100.0 if si else 0.1)
        columns, wrong = times(found, boot, "time_usec" if "time_usec" in found.fields else "time_boot_ms")
        felt = float(np.median(np.linalg.norm(force, axis=0))) / STANDARD_GRAVITY
        parts: dict[str, Stream | None] = {}
        if _FELT[0] < felt < _FELT[1]:
            names = ("f_x_m_s2", "f_y_m_s2", "f_z_m_s2", "w_x_rad_s", "w_y_rad_s", "w_z_rad_s")
            values = np.concatenate([force, rate])
            bad = {"not a number": ~np.isfinite(values).all(axis=0)}
            made = columns | dict(zip(names, values, strict=True))
            parts["imu"] = _stream("imu", made, found, wrong | bad)
        else:
            notes.append(
                f"{name} is left out: it feels {felt:.3g} g in the middle, so that its units are not known"
            )
        if (field != 0).any():
            bad = {"no measurement": ~np.isfinite(field).all(axis=0) | (field == 0).all(axis=0)}
            made = columns | {f"field_{axis}_ut": one for axis, one in zip("xyz", field, strict=True)}
            parts["magnetometer"] = _stream("magnetometer", made, found, wrong | bad)
        return parts
    return {}


def _triggers(
    kinds: dict[str, Messages], component: int, boot: Boot | None, notes: list[str]
) -> Stream | None:
    feedback, trigger = kinds["CAMERA_FEEDBACK"], kinds["CAMERA_TRIGGER"]
    found = feedback if len(feedback) else trigger
    if not len(found):
        return None
    columns, wrong = times(found, boot, "time_usec", bool((found.component == component).all()))
    if found is trigger:
        return _stream("triggers", {**columns, "number": found["seq"]}, found, wrong)
    there = placed(found["lat"] / 1e7, found["lng"] / 1e7)
    columns |= {"number": found["img_idx"]}
    place = {"latitude_deg": found["lat"] / 1e7, "longitude_deg": found["lng"] / 1e7}
    place |= {"height_sea_m": found["alt_msl"], "height_home_m": found["alt_rel"]}
    columns |= {name: np.where(there, values, np.nan) for name, values in place.items()}
    columns |= {f"{name}_deg": found[name] for name in ("roll", "pitch", "yaw")}
    if np.isnan(columns["time_log_s"]).all():
        notes.append("times of the triggers are those of receipt: their own stamps go by no known clock")
    return _stream("triggers", columns, found, wrong)


def _gimbal_device(
    frames: MavlinkFrames,
    system: int,
    component: int,
    boot: Boot | None,
    poses: Stream | None,
    notes: list[str],
) -> Stream | None:
    found = messages(frames, "GIMBAL_DEVICE_ATTITUDE_STATUS", system)
    if not len(found):
        return None
    columns, wrong = _gimbal_times(found, component, boot, notes)
    angles = device_angles(found.fields["q"], found.fields["flags"], heading_at(poses, columns["time_s"]))
    return _stream("gimbal", columns | angles, found, wrong | unturned(angles))


def _mount_orientation(
    frames: MavlinkFrames,
    system: int,
    component: int,
    boot: Boot | None,
    poses: Stream | None,
    notes: list[str],
) -> Stream | None:
    found = messages(frames, "MOUNT_ORIENTATION", system)
    if not len(found):
        return None
    columns, wrong = _gimbal_times(found, component, boot, notes)
    yaw = found["yaw_absolute"]
    if not (yaw != 0).any():
        # The extension is not sent; its yaw is against the vehicle.
        yaw = wrapped(found["yaw"] + heading_at(poses, columns["time_s"]))
    columns |= {"roll_world_deg": found["roll"], "pitch_world_deg": found["pitch"], "yaw_world_deg": yaw}
    return _stream("gimbal", columns, found, wrong | unturned(columns))


def _mount_status(
    frames: MavlinkFrames,
    system: int,
    component: int,
    boot: Boot | None,
    poses: Stream | None,
    notes: list[str],
) -> Stream | None:
    found = messages(frames, "MOUNT_STATUS", system)
    if not len(found):
        return None
    columns, wrong = times(found, boot, "")
    notes.append(
        "the gimbal is known from MOUNT_STATUS, which has no stamps (times are those of receipt) and does "
        "not say against what it counts: taken as pitch and roll against the horizon, yaw against the vehicle"
    )
    yaw = found["pointing_c"] / 1e2 + heading_at(poses, columns["time_s"])
    columns |= {
        "roll_world_deg": found["pointing_b"] / 1e2,
        "pitch_world_deg": found["pointing_a"] / 1e2,
        "yaw_world_deg": wrapped(yaw),
    }
    return _stream("gimbal", columns, found, wrong | unturned(columns))


def _gimbal_times(
    found: Messages, component: int, boot: Boot | None, notes: list[str]
) -> tuple[dict[str, Array], dict[str, Flags]]:
    columns, wrong = times(found, boot, "time_boot_ms", bool((found.component == component).all()))
    if np.isnan(columns["time_log_s"]).all():
        notes.append("times of the gimbal are those of receipt: its own stamps go by no known clock")
    return columns, wrong


def _known(values: Array, none: int) -> Array:
    return np.where(values == none, np.nan, values)


def _without_empty(columns: dict[str, Array]) -> dict[str, Array]:
    """Without columns that no row has a value in; times stay."""
    return {name: one for name, one in columns.items() if name.startswith("time") or not np.isnan(one).all()}


def _stream(part: str, columns: dict[str, Array], found: Messages, wrong: dict[str, Flags]) -> Stream | None:
    return running_stream(part, columns, found.number, "frame", wrong)
