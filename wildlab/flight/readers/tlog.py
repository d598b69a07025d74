"""MAVLink telemetry log (``.tlog``): what a ground station received, each frame behind its time of receipt,
by pymavlink (dialect ardupilotmega 2.0, which holds the common messages).

A time of receipt is eight bytes, big end first, us since 1970. The ground station stamps what it receives,
late by up to seconds; the vehicle stamps what it measures, since it was switched on. What goes with what is
fitted along the lower edge of the receipts (`wildlab.flight.clock_fitting`), or, where the vehicle knows UTC,
on what it says itself (``SYSTEM_TIME``). One vehicle is read, that which sent most attitudes; ground stations
and other vehicles are named in the notes.
"""

from __future__ import annotations

import re
from collections import Counter
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from wildlab.errors import WildlabError
from wildlab.flight.clock_fitting import ClockFit, fit_steady
from wildlab.flight.files import printable
from wildlab.flight.readers.log import (
    ANGLES,
    LAT_LON,
    WORLD,
    Messages,
    RawLog,
    Stream,
    any_of,
    at_times,
    device_angles,
    fix_reasons,
    heading_at,
    holding,
    level_velocity,
    named,
    wrapped,
)
from wildlab.flight.readers.text import told
from wildlab.flight.schema import FIELD, FORCE, RATE, VELOCITY
from wildlab.geometry.frames import Array, Mask
from wildlab.geometry.gravity import STANDARD_GRAVITY

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
            with suppress(dialect.MAVError):
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
    starts = np.r_[0, 1 + np.flatnonzero(np.diff(own) < -RESTART_S)]
    falls = len(starts) - 1
    if falls >= MOST_RUNS:
        # No vehicle is switched on so often: the stamps are of no use, and one line goes under most of them.
        starts = starts[:1]
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
        "the vehicle's stamps are of several clocks": falls >= MOST_RUNS,
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


def sniff(head: bytes) -> bool:
    """Whether a sound frame behind a time that can be true is among the first bytes of a file."""
    # Without the look at times, all that it takes to walk would be loaded for any file.
    return any(_plausible(head, one.start()) for one in _BEGINNING.finditer(head)) and walk(head).sound > 0


def decode(path: Path, data: bytes, zone: str | None) -> RawLog:
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


# -- parts


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
