"""Logs of autopilots but ArduPilot's own: MAVLink telemetry (``.tlog``), and PX4 ULog (``.ulg``) by pyulog.

A telemetry log is what a ground station received, each frame behind its time of receipt, by pymavlink
(dialect ardupilotmega 2.0, which holds the common messages). The time is eight bytes, big end first, us since
1970. The ground station stamps what it receives, late by up to seconds; the vehicle stamps what it measures,
since it was switched on. What goes with what is fitted along the lower edge of the receipts
(`wildlab.flight.clock_fitting`), or, where the vehicle knows UTC, on what it says itself (``SYSTEM_TIME``).
One vehicle is read, that which sent most attitudes; ground stations and other vehicles stand in the notes.
"""

from __future__ import annotations

import contextlib
import io
import re
import struct
from collections import Counter
from collections.abc import Mapping
from dataclasses import replace
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
    any_of,
    at_times,
    device_angles,
    euler_deg,
    fix_reasons,
    heading_at,
    holding,
    level_velocity,
    named,
    wrapped,
)
from wildlab.flight.readers.text import told
from wildlab.flight.schema import FIELD, FORCE, QUATERNION, RATE, VELOCITY
from wildlab.geometry.frames import STANDARD_GRAVITY, Array, Mask

#: MAV_AUTOPILOT_INVALID and MAV_TYPE_GCS: what is no autopilot says so in its heartbeat.
_NO_AUTOPILOT, _GROUND_STATION = 8, 6
#: What vehicles are known by, best first.
_FLIES = ("ATTITUDE", "GLOBAL_POSITION_INT", "GPS_RAW_INT")
_FIRMWARE = re.compile(r"^(Ardu\w+|APM:?\w*|PX4|AntennaTracker|Blimp)\b.*\d")
#: In units of g: what a device at rest and in flight feels in the middle, whatever it is called raw.
_FELT = (0.5, 2.0)
#: Values that mean "not known" in 8 and 16 bits.
_NO_8, _NO_16 = 255, 65535
#: 1990 and 2100, in us since 1970: no telemetry log is of another time.
EARLIEST_US, LATEST_US = 631_152_000_000_000, 4_102_444_800_000_000
VERSIONS = (0xFE, 0xFD)
_SIGNED, _SIGNATURE = 0x01, 13
#: A stamp begins with 0 for two thousand years yet, and the ninth byte begins a frame.
_BEGINNING = re.compile(rb"\x00(?=[\x00-\xff]{7}[\xfd\xfe])", re.DOTALL)
#: What is kept of each message beside its fields.
_HEAD = ("received_s", "system", "component")
#: Messages of use.
KINDS = frozenset(
    {
        *("HEARTBEAT", "STATUSTEXT", "SYSTEM_TIME"),
        *("ATTITUDE", "GLOBAL_POSITION_INT", "LOCAL_POSITION_NED", "GPS_RAW_INT"),
        *("HIGHRES_IMU", "SCALED_IMU", "SCALED_IMU2", "RAW_IMU"),
        *("CAMERA_FEEDBACK", "CAMERA_TRIGGER", "GIMBAL_DEVICE_ATTITUDE_STATUS", "MOUNT_ORIENTATION"),
    }
)


class Telemetry(NamedTuple):
    """Sound frames of a log.

    `kinds`: messages of `KINDS` by name. `systems`: everybody who sent anything. `sound`: how many frames.
    `lost`: as `RawLog` has it.
    """

    kinds: dict[str, Messages]
    systems: set[int]
    sound: int
    lost: tuple[str, ...]

    def of(self, name: str, system: int | None = None, component: int | None = None) -> Messages:
        """Messages of one kind, from whom; None: from all."""
        nothing = Messages(name, dict.fromkeys(_HEAD, np.zeros(0)), np.zeros(0, np.int64))
        found = self.kinds.get(name, nothing)
        chosen = np.ones(len(found), bool)
        for field, value in (("system", system), ("component", component)):
            chosen &= (found.fields[field] == value) | (value is None)
        return found.take(chosen)


def _dialect() -> Any:
    # Takes a tenth of a second, and only these logs need it.
    from pymavlink.dialects.v20 import ardupilotmega

    return ardupilotmega


def _plausible(data: bytes, at: int) -> bool:
    return EARLIEST_US < int.from_bytes(data[at : at + 8], "big") < LATEST_US


def names(enumeration: str, value: int) -> str:
    """What MAVLink calls a value, in small letters: ``names("MAV_TYPE", 1)`` is ``"fixed wing"``."""
    entry = _dialect().enums.get(enumeration, {}).get(value)
    return "" if entry is None else entry.name.removeprefix(enumeration + "_").replace("_", " ").lower()


def walk(data: bytes) -> Telemetry:
    """All frames of a telemetry log, or of its beginning; none where it is no such log."""
    dialect = _dialect()
    library = dialect.MAVLink(None)
    rows: dict[str, list[tuple[Any, ...]]] = {}
    systems: set[int] = set()
    bad = skipped = places = number = pos = covered = 0
    while pos + 16 <= len(data):
        end = _end(data, pos)
        whole = pos < end <= len(data) and _plausible(data, pos)
        message = None
        if whole:
            with contextlib.suppress(dialect.MAVError):
                message = library.decode(bytearray(data[pos + 8 : end]))
        # What pymavlink does not know has no checksum.
        known = message is not None and message.get_msgId() >= 0
        if not known and not (whole and _begins(data, end)):
            next_ = _BEGINNING.search(data, pos + 1)
            if next_ is None:
                break
            pos = next_.start()
            continue
        number += 1
        if message is None or not known:
            bad += 1
        else:
            name, system = message.get_type(), message.get_srcSystem()
            systems.add(system)
            if name in KINDS:
                received_s = int.from_bytes(data[pos : pos + 8], "big") / 1e6
                values = (getattr(message, field) for field in message.fieldnames)
                row = (number, received_s, system, message.get_srcComponent(), *values)
                rows.setdefault(name, []).append(row)
        if pos > covered:
            skipped, places = skipped + pos - covered, places + 1
        pos = covered = end
    fields = {one.msgname: one.fieldnames for one in dialect.mavlink_map.values()}
    kinds = {name: _messages(name, fields[name], found) for name, found in rows.items()}
    lost = [
        (bad, "frame", f"damaged or of kinds that are not known, {number - bad} are read"),
        (skipped, "byte", f"of {len(data)} in {places} places are no frames"),
        (len(data) - covered, "byte", f"of {len(data)} at the end: it ends within a frame"),
    ]
    return Telemetry(kinds, systems, number - bad, told(*lost))


def _messages(name: str, fields: list[str], rows: list[tuple[Any, ...]]) -> Messages:
    number, *values = zip(*rows, strict=True)
    found: dict[str, Any] = {}
    for field, column in zip((*_HEAD, *fields), values, strict=True):
        several = np.asarray(column)
        found |= (
            {field: several}
            if several.ndim == 1
            else {f"{field}[{i}]": one for i, one in enumerate(several.T)}
        )
    return Messages(name, found, np.array(number, np.int64))


def _begins(data: bytes, at: int) -> bool:
    """Whether a frame seems to begin, or the file ends before that can be seen."""
    return len(data) - at <= 8 or (data[at] == 0 and data[at + 8] in VERSIONS)


def _end(data: bytes, pos: int) -> int:
    """End of the frame; 0 where none is here."""
    if data[pos + 8] == VERSIONS[0]:
        return pos + 16 + data[pos + 9]
    if data[pos + 8] == VERSIONS[1] and not data[pos + 10] & ~_SIGNED:
        return pos + 20 + data[pos + 9] + (_SIGNATURE if data[pos + 10] & _SIGNED else 0)
    return 0


DAY_S = 86400.0
#: Stamps that fall back by more than this mean that the vehicle was switched on again.
RESTART_S = 10.0
MOST_RUNS = 50
#: A stamp goes with its receipt if it lies within this of it, the clocks' difference taken off.
BESIDE_S = 60.0
#: Messages with time since start that each autopilot sends all the time.
_STAMPED = ("ATTITUDE", "GLOBAL_POSITION_INT", "SYSTEM_TIME", "LOCAL_POSITION_NED", "SCALED_IMU2")


class Boot(NamedTuple):
    """Runs of a vehicle from one start to the next, each with its clock.

    `first` (S,): number of the frame that each begins with. `rate`, `offset_s` (S,): to UTC. `behind_s` (S,):
    middle of what receipts are behind UTC. `clock`: as of the longest run. `notes`: sentences.
    """

    first: Array
    rate: Array
    offset_s: Array
    behind_s: Array
    clock: str
    notes: list[str]

    def utc(self, boot_s: Array, found: Messages) -> tuple[Array, Mask]:
        """UTC (N,) of stamps (N,) in messages, s since 1970, and whether it goes with their receipts."""
        run = np.maximum(np.searchsorted(self.first, found.rows, side="right") - 1, 0)
        utc = self.offset_s[run] + self.rate[run] * boot_s
        with np.errstate(invalid="ignore"):
            return utc, np.abs(found.get("received_s") - self.behind_s[run] - utc) < BESIDE_S


def find_boot(frames: Telemetry, system: int, component: int) -> Boot | None:
    """The clock of an autopilot; None where nothing that it sent has a stamp."""
    kinds = {name: frames.of(name, system, component) for name in _STAMPED}
    stamps = [(one.rows, one.get("time_boot_ms") / 1e3, one.get("received_s")) for one in kinds.values()]
    number, own, received = np.concatenate(stamps, axis=1)
    order = np.argsort(number, kind="stable")
    number, own, received = (one[order][own[order] > 0] for one in (number, own, received))
    if not len(own):
        return None
    # No vehicle is switched on more often: its stamps are of several clocks, and their receipts say so.
    starts = np.r_[0, 1 + np.flatnonzero(np.diff(own) < -RESTART_S)][:MOST_RUNS]
    ends = np.r_[starts[1:], len(own)]
    told = kinds["SYSTEM_TIME"]
    unix = told.get("time_unix_usec") / 1e6
    said = unix > 0
    near = said & (np.abs(unix - told.get("received_s")) < DAY_S)
    believed = bool(near.sum() > said.sum() / 2)
    fits: list[ClockFit] = []
    from_vehicle: list[bool] = []
    for a, b in zip(starts, ends, strict=True):
        inside = near & (told.rows >= number[a]) & (told.rows <= number[b - 1])
        from_vehicle.append(believed and int(inside.sum()) > 2)
        fits.append(
            fit_steady(told.get("time_boot_ms")[inside] / 1e3, unix[inside])
            if from_vehicle[-1]
            else fit_steady(own[a:b], received[a:b], late=True)
        )
    rate, offset_s = np.array([(one.rate, one.offset_s) for one in fits]).T
    run = np.repeat(np.arange(len(starts)), ends - starts)
    late = received - offset_s[run] - rate[run] * own
    behind = np.array([np.median(late[a:b]) for a, b in zip(starts, ends, strict=True)])
    main = int(np.argmax(ends - starts))
    base = "UTC of the messages SYSTEM_TIME" if from_vehicle[main] else "times of receipt"
    middle = f"{np.median(late):.3f} s (median)"
    notes = {
        "SYSTEM_TIME is more than a day from its receipt, and not used": (said.any() and not believed),
        f"the ground station received {middle} after the vehicle's UTC": from_vehicle[main],
        f"UTC is fitted along the earliest receipts; others are {middle} later": (not from_vehicle[main]),
        f"the vehicle was switched on {len(starts)} times; each run has a clock of its own": len(starts) > 1,
    }
    return Boot(number[starts], rate, offset_s, behind, base, holding(notes))


class Vehicle(NamedTuple):
    """Messages of one vehicle: its frames, its numbers, and its clock, None where nothing has a stamp."""

    frames: Telemetry
    system: int
    component: int
    boot: Boot | None

    def own(self, name: str) -> Messages:
        """Messages of its autopilot."""
        return self.frames.of(name, self.system, self.component)

    def any(self, name: str) -> Messages:
        """Messages of all its components: cameras and gimbals may be such."""
        return self.frames.of(name, self.system)

    def readings(
        self, found: Messages, field: str, columns: dict[str, Array], unusable: dict[str, Mask] | None = None
    ) -> Stream:
        """Columns of messages with ``time_s`` and ``time_log_s``.

        `field` is ``"time_boot_ms"``, ``"time_usec"``, or ``""`` where messages have no stamp. Without one
        that goes by a known clock, ``time_s`` is that of receipt. Stamps of others than the autopilot are
        used only if they go by its clock.
        """
        received, none = found.get("received_s"), np.full(len(found), np.nan)
        times, wrong = {"time_s": received, "time_log_s": none}, dict(unusable or {})
        if found.has(field):
            stamp = found.get(field) / (1e3 if field == "time_boot_ms" else 1e6)
            if field == "time_usec" and _most(np.abs(stamp - received) < DAY_S):
                times = {"time_s": stamp, "time_log_s": stamp}
            elif self.boot is not None:
                utc, beside = self.boot.utc(stamp, found)
                own = field == "time_boot_ms" and bool((found.get("component") == self.component).all())
                if _most(beside) or own:
                    times = {"time_s": utc, "time_log_s": stamp}
                    wrong["a stamp that its receipt contradicts"] = ~beside
        return Stream(times | columns, found.rows, "frame", wrong)


def _most(rows: Mask) -> bool:
    return bool(len(rows) and rows.mean() > 0.5)


def tlog_sniff(head: bytes) -> bool:
    """Whether a sound frame behind a time that can be true is among the first bytes of a file."""
    # Without the look at times, all that it takes to walk would be loaded for any file.
    return any(_plausible(head, one.start()) for one in _BEGINNING.finditer(head)) and walk(head).sound > 0


def tlog_decode(path: Path, data: bytes, zone: str | None) -> RawLog:
    """A telemetry log, its rows counted in frames.

    Raises
    ------
    WildlabError
        Where it holds no sound frame, or no vehicle.
    """
    frames = walk(data)
    if not frames.sound:
        raise WildlabError(
            "holds no sound MAVLink frame",
            "give the .tlog of the ground station",
            file=path,
        )
    vehicles, stations = _systems(frames)
    if not vehicles:
        raise WildlabError(
            f"holds {frames.sound} messages, and none of attitude or position",
            "give the log of the flight itself",
            file=path,
        )
    (system, component), *others = vehicles
    vehicle = Vehicle(frames, system, component, find_boot(frames, system, component))
    parts, notes = _parts(vehicle)
    if others:
        said = ", ".join(f"{one}" for one, _ in others)
        notes = [f"it holds several vehicles: system {system} is read, not {said}", *notes]
    if stations:
        said = ", ".join(map(str, sorted(stations)))
        notes = [*notes, f"left out as no vehicles: system {said}"]
    clock, before = (vehicle.boot.clock, vehicle.boot.notes) if vehicle.boot else ("", [])
    return RawLog(parts, _called(vehicle), clock, frames.lost, [*before, *notes])


def _systems(frames: Telemetry) -> tuple[list[tuple[int, int]], set[int]]:
    """(system, component) of the autopilots, the busiest first, and systems that are none."""
    beats = frames.of("HEARTBEAT")
    no = (beats.get("autopilot") == _NO_AUTOPILOT) | (beats.get("type") == _GROUND_STATION)
    autopilots = set(_senders(beats.take(~no)))
    counts = [Counter(_senders(frames.of(name))) for name in _FLIES]
    # A heartbeat says more than none: without it a component may forward what others sent.
    order = sorted(
        set().union(*counts) - (set(_senders(beats)) - autopilots),
        key=lambda one: (one in autopilots, *(count[one] for count in counts)),
        reverse=True,
    )
    first: dict[int, tuple[int, int]] = {}
    for one in order:
        first.setdefault(one[0], one)
    return list(first.values()), frames.systems - set(first)


def _senders(found: Messages) -> list[tuple[int, int]]:
    return list(zip(found.fields["system"].tolist(), found.fields["component"].tolist(), strict=True))


def _called(vehicle: Vehicle) -> str:
    for text in vehicle.own("STATUSTEXT").texts("text"):
        if _FIRMWARE.match(text.strip()):
            return printable(text.strip())
    beats = vehicle.own("HEARTBEAT")
    if not len(beats):
        return ""
    autopilot, kind = (
        names(enumeration, int(beats.get(field)[0]))
        for enumeration, field in (("MAV_AUTOPILOT", "autopilot"), ("MAV_TYPE", "type"))
    )
    return f"{autopilot} ({kind})"


def _parts(vehicle: Vehicle) -> tuple[dict[str, Stream], list[str]]:
    """All parts that there are rows of, and sentences on what a user should know of them."""
    notes: list[str] = []
    parts = {"poses": _poses(vehicle, notes), "gnss": _gnss(vehicle), **_inertial(vehicle, notes)}
    parts |= {"triggers": _triggers(vehicle, notes), "gimbal": _gimbal(vehicle, parts["poses"], notes)}
    return {name: one for name, one in parts.items() if one is not None}, notes


def _poses(vehicle: Vehicle, notes: list[str]) -> Stream | None:
    attitude, position = vehicle.own("ATTITUDE"), vehicle.own("GLOBAL_POSITION_INT")
    if not len(attitude):
        if len(position):
            notes.append(f"{len(position)} positions without attitudes make no poses")
        return None
    columns = {name: np.degrees(attitude.get(name[:-4])) for name in ANGLES}
    place = position.columns(LAT_LON, 1e7)
    place |= position.columns({"height_sea_m": "alt", "height_home_m": "relative_alt"}, 1e3)
    place |= position.columns(named(VELOCITY, ("vx", "vy", "vz")), 1e2)
    made = vehicle.readings(attitude, "time_boot_ms", columns)
    where = vehicle.readings(position, "time_boot_ms", {})
    doubtful = any_of(where.unusable.values(), len(position))
    stamps, at = where.columns["time_s"], made.columns["time_s"]
    found = at_times(stamps, place, at, "GLOBAL_POSITION_INT", doubtful)
    return replace(made, columns=made.columns | found)


def _gnss(vehicle: Vehicle) -> Stream:
    found = vehicle.own("GPS_RAW_INT")

    def known(none: int, divisor: float, **names: str) -> dict[str, Array]:
        return {
            name: np.where(one == none / divisor, np.nan, one)
            for name, one in found.columns(names, divisor).items()
        }

    motion = known(_NO_16, 1e2, speed="vel", course="cog")
    columns = {
        **found.columns(LAT_LON, 1e7),
        **found.columns({"height_sea_m": "alt"}, 1e3),
        # Zeros at the end of a message are not sent: zero and not known look alike.
        **known(0, 1e3, height_ellipsoid_m="alt_ellipsoid", sd_horizontal_m="h_acc", sd_vertical_m="v_acc"),
        **known(0, 1e3, sd_velocity_m_s="vel_acc"),
        **known(_NO_8, 1.0, satellites="satellites_visible"),
        **known(_NO_16, 1e2, hdop="eph"),
        **level_velocity(motion["speed"], motion["course"]),
        "fix": found.get("fix_type"),
    }
    return vehicle.readings(found, "time_usec", columns, fix_reasons(columns["fix"]))


def _inertial(vehicle: Vehicle, notes: list[str]) -> dict[str, Stream | None]:
    """Of the first device, from the message in the best known units."""
    for name in ("HIGHRES_IMU", "SCALED_IMU", "RAW_IMU"):
        found = vehicle.own(name)
        found = found.take(found.get("id") == 0) if found.has("id") else found
        if not len(found):
            continue
        # Gauss and milligauss to microtesla, among others.
        f, w, ut = (1.0, 1.0, 100.0) if name == "HIGHRES_IMU" else (STANDARD_GRAVITY / 1e3, 1e-3, 0.1)
        force, rate, field = (
            np.stack([found.get(f"{axis}{kind}") for axis in "xyz"]) * by
            for kind, by in (("acc", f), ("gyro", w), ("mag", ut))
        )
        stamp = "time_usec" if found.has("time_usec") else "time_boot_ms"
        felt = float(np.median(np.linalg.norm(force, axis=0))) / STANDARD_GRAVITY
        parts: dict[str, Stream | None] = {}
        if _FELT[0] < felt < _FELT[1]:
            parts["imu"] = vehicle.readings(found, stamp, named((*FORCE, *RATE), (*force, *rate)))
        else:
            notes.append(f"{name} is left out: its median is {felt:.3g} g, so its units are not known")
        if (field != 0).any():
            parts["magnetometer"] = vehicle.readings(found, stamp, named(FIELD, field))
        return parts
    return {}


def _triggers(vehicle: Vehicle, notes: list[str]) -> Stream | None:
    found, trigger = vehicle.any("CAMERA_FEEDBACK"), vehicle.any("CAMERA_TRIGGER")
    if not len(found):
        made = vehicle.readings(trigger, "time_usec", {"number": trigger.get("seq")})
        return made if len(trigger) else None
    fields = {"number": "img_idx", "height_sea_m": "alt_msl", "height_home_m": "alt_rel"}
    columns = found.columns(fields | {name: name[:-4] for name in ANGLES}) | found.columns(LAT_LON, 1e7)
    made = replace(vehicle.readings(found, "time_usec", columns), anywhere=True)
    if np.isnan(made.columns["time_log_s"]).all():
        notes.append("times of the triggers are those of receipt")
    return made


def _gimbal(vehicle: Vehicle, poses: Stream | None, notes: list[str]) -> Stream | None:
    kinds = ("GIMBAL_DEVICE_ATTITUDE_STATUS", "MOUNT_ORIENTATION")
    found = next((one for name in kinds if len(one := vehicle.any(name))), None)
    if found is None:
        return None
    made = vehicle.readings(found, "time_boot_ms", {})
    heading = heading_at(poses, made.columns["time_s"])
    if np.isnan(made.columns["time_log_s"]).all():
        notes.append("times of the gimbal are those of receipt")
    if found.has("flags"):
        angles = device_angles(found.quaternion(), found.get("flags"), heading)
    else:
        yaw = found.get("yaw_absolute")
        # Where the extension is not sent, its yaw is against the vehicle.
        yaw = yaw if (yaw != 0).any() else wrapped(found.get("yaw") + heading)
        angles = named(WORLD, (found.get("roll"), found.get("pitch"), yaw))
    return replace(made, columns=made.columns | angles)


# -- PX4 ULog, with the field names of old and new firmware

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


def ulog_sniff(head: bytes) -> bool:
    """Whether a file that begins with `head` is a ULog."""
    return head.startswith(MAGIC)


def ulog_decode(path: Path, data: bytes, zone: str | None) -> RawLog:
    """A ULog, its rows counted in messages of a topic; errors as of `tlog_decode`.

    Stamps count since the start of the system, in us; UTC comes from pairs of them with the receiver's
    (``time_utc_usec``). pyulog goes on behind damage, but builds whatever a definition claims: so each use of
    one costs as many fields as it has, out of more than any log needs.
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
    parts, notes = _ulog_parts(log)
    lost_s = sum(one.duration for one in ulog.dropouts) / 1e3
    said = {
        f"the logger fell behind {len(ulog.dropouts)} times and lost {lost_s:.3f} s in all": ulog.dropouts,
        "damaged places are left out": ulog.file_corruption,
        CUT_OFF: cut,
        "UTC is not known: times count from the start of the system": log.fit is None,
    }
    clock = "UTC of the receiver" if log.fit else ""
    return RawLog(parts, _vehicle(ulog), clock, notes=notes + holding(said))


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


def _vehicle(ulog: Any) -> str:
    about = ulog.msg_info_dict
    stated = isinstance(about.get("ver_sw_release"), int)
    version = (ulog.get_version_info_str() or "(development)") if stated else None
    hardware = about.get("ver_hw")
    words = [about.get("sys_name"), version, f"on {hardware}" if isinstance(hardware, str) else None]
    return printable(" ".join(one for one in words if isinstance(one, str))[:200])


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


def _ulog_parts(log: Px4Log) -> tuple[dict[str, Stream], list[str]]:
    """All parts that there are rows of, and sentences on what a user should know of them."""
    notes: list[str] = []
    poses = _ulog_poses(log, notes)
    parts = {
        "poses": poses,
        "gnss": _ulog_gnss(log),
        "imu": _imu(log),
        "magnetometer": _magnetometer(log),
        "triggers": _ulog_triggers(log),
        "gimbal": _ulog_gimbal(log, poses),
    }
    return {name: one for name, one in parts.items() if one is not None}, notes


def _ulog_poses(log: Px4Log, notes: list[str]) -> Stream | None:
    attitude = log.first("vehicle_attitude")
    place, local = log.first("vehicle_global_position"), log.first("vehicle_local_position")
    if not attitude.has("q[0]"):
        if len(place):
            notes.append(f"{len(place)} positions without attitudes make no poses")
        return None
    at = taken_s(attitude)
    if place.has("lat") or place.has("latitude_deg"):
        there = _position(place) | place.columns(named(VELOCITY, ("vel_n", "vel_e", "vel_d")) | SPREADS)
        columns = _at(local, _local_motion(local), at) | _at(place, there, at)
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


def _ulog_gnss(log: Px4Log) -> Stream:
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


def _ulog_triggers(log: Px4Log) -> Stream:
    found = log.first("camera_capture", "camera_trigger")
    fields = LAT_LON | {"height_sea_m": "alt"} if found.has("lat") else {}
    return log.readings(found, found.columns({"number": "seq", **fields}), anywhere=True)


def _ulog_gimbal(log: Px4Log, poses: Stream | None) -> Stream | None:
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
