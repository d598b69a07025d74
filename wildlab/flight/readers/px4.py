"""PX4 ULog (``.ulg``), with the field names of old and new firmware, by pyulog.

Stamps count since the start of
the system, in us; UTC comes from pairs of them with the receiver's (``time_utc_usec``).

pyulog stops at the first message whose size is a lie, and builds whatever a format claims. So the file is
walked first: each message is measured against its own definition, what does not hold is left out and
counted, and pyulog gets only the sound messages of the topics that are wanted.
"""

from __future__ import annotations

import contextlib
import io
import re
import struct
from collections import Counter
from collections.abc import Mapping
from pathlib import Path
from typing import NamedTuple

import numpy as np

from wildlab.errors import WildlabError
from wildlab.flight.clock_fitting import ClockFit, fit_steady
from wildlab.flight.files import printable
from wildlab.flight.readers.autopilot import (
    FIELD,
    FIX_SPACE,
    IMU,
    LAT_LON,
    Messages,
    at_times,
    device_angles,
    euler_deg,
    fix_reasons,
    heading_at,
    wrapped,
)
from wildlab.flight.readers.log import ANGLES, VELOCITY, WORLD, Array, Clock, Decoded, Readings, named

# -- what can be believed

MAGIC = b"ULog\x01\x12\x35"
HEADER = 16
#: Bytes of the types of ULog's fields.
SIZES = {
    **{f"{kind}{bits}_t": bits // 8 for kind in ("int", "uint") for bits in (8, 16, 32, 64)},
    "float": 4,
    "double": 8,
    "bool": 1,
    "char": 1,
}
#: No message is longer, for its length has two bytes; no format nests deeper than this, none has more fields.
LONGEST, DEEPEST, MOST_FIELDS = 65535, 8, 2048
#: So many instances of a topic are passed on: a vehicle has at most so many sensors of a kind.
INSTANCES = 8
_FIELD = re.compile(r"([A-Za-z_]\w*)(?:\[(\d{1,5})\])? (\w+)", re.ASCII)
#: Kinds of messages, and the fewest bytes that each has.
_KINDS = dict(zip(b"BFIMPQADRSOLC", (40, 3, 3, 4, 3, 4, 4, 3, 2, 8, 2, 9, 11), strict=True))
_FORMAT, _INFO, _ADD, _DATA, _DROPOUT, _FLAGS, _SYNC = b"FIADOBS"
#: Kinds that hold a key with its value, or a text behind its level, and how many bytes stand before that.
_KEYED = {ord("I"): 0, ord("P"): 0, ord("M"): 1, ord("Q"): 1}
_TEXTS = {ord("L"): 9, ord("C"): 11}
SYNC = bytes.fromhex("2f731320250cbb12")
_KEY = re.compile(rb"(\w+)(?:\[(\d{1,5})\])? (\S+)")
_NAME = re.compile(rb"\w+")
_COLON = ord(":")
_READABLE = bytes([9, 10, 13, 27, *range(32, 127)])
_HEAD = struct.Struct("<HB")
#: Looked through at once where a message that holds is searched: little at first, for it is often near.
_FIRST_CHUNK, _CHUNK = 1 << 8, 1 << 16
#: A message of a kind that is not known is believed up to this size, as pyulog has it.
_UNKNOWN_LONGEST = 10_000


class Sound(NamedTuple):
    """What holds of a ULog.

    `data`: the same log, of sound messages alone. `skipped`: bytes between sound messages, in so many
    `places`. `rest`: bytes at the end that are no whole message. `homeless`: topic (or ``""``, not known) ->
    data messages whose definition is missing or cannot be true. `dropouts`, `dropout_s`: how often the
    logger fell behind, and how long. `flags`: incompatible ones that are not known, 0 where all are.
    """

    data: bytes
    skipped: int
    places: int
    rest: int
    homeless: dict[str, int]
    dropouts: int
    dropout_s: float
    flags: int


class _Walk:
    """A walk over a file; what was learnt on the way decides what holds next."""

    def __init__(self, data: bytes) -> None:
        self.data = data
        self.formats: dict[str, list[tuple[str, int, str]]] = {}
        self.measured: dict[str, tuple[int, int] | None] = {}
        self.names: dict[int, str] = {}
        self.instances: Counter[str] = Counter()
        # Fewest and most bytes of a topic's data: fields that only fill up may be left away at the end.
        self.sizes: dict[int, tuple[int, int]] = {}
        # The same of topics without a definition, from the first message that seemed sound.
        self.learnt: dict[int, tuple[int, int]] = {}
        self.wanted: set[int] = set()
        self.kept: list[tuple[int, int]] = []
        self.homeless: Counter[str] = Counter()
        self.dropouts = self.dropout_ms = self.flags = 0
        self.appended: list[int] = []

    def header(self, pos: int, limit: int) -> tuple[int, int]:
        """End and kind of the message at a place, (0, 0) where none can be."""
        if pos + 3 > limit:
            return 0, 0
        size, kind = _HEAD.unpack_from(self.data, pos)
        end = pos + 3 + size
        least = _KINDS.get(kind)
        fits = size >= least if least is not None else kind > 0 and 0 < size <= _UNKNOWN_LONGEST
        return (end, kind) if fits and end <= limit else (0, 0)

    def holds(self, pos: int, limit: int) -> int:
        """End of the message at a place if it is sound, else 0."""
        end, kind = self.header(pos, limit)
        if not end:
            return 0
        sure = self.certain(kind, pos, end)
        # Where its content does not tell, what follows has to be sound beyond doubt.
        return end if (self.followed(end, limit) if sure is None else sure) else 0

    def followed(self, end: int, limit: int) -> bool:
        if end == limit:
            return True
        next_end, kind = self.header(end, limit)
        return bool(next_end and self.certain(kind, end, next_end))

    def certain(self, kind: int, pos: int, end: int) -> bool | None:
        """Whether the content of a message shows that it is one, by its kind; None where it shows nothing."""
        size = end - pos - 3
        if kind == _DATA:
            topic = self.data[pos + 3] | self.data[pos + 4] << 8
            bounds = self.sizes.get(topic) or self.learnt.get(topic)
            return None if bounds is None else bounds[0] <= size - 2 <= bounds[1]
        # What is long is looked at only where its beginning is right.
        start = pos + 3
        if kind == _FORMAT:
            begins = _NAME.match(self.data, start, start + 100)
            named = begins is not None and self.data[begins.end()] == _COLON
            return (named and self.format(start, end) is not None) or None
        if kind == _ADD:
            return (size <= 300 and _NAME.fullmatch(self.data, start + 3, end) is not None) or None
        if kind in _KEYED:
            return _informs(self.data[start + _KEYED[kind] : start + 300], size - _KEYED[kind]) or None
        if kind in _TEXTS:
            if self.data[start] not in b"01234567":
                return None
            text = self.data[start + _TEXTS[kind] : end]
            return len(text.translate(None, _READABLE)) <= len(text) / 4 or None
        if kind == _SYNC:
            return self.data[start:end] == SYNC
        return (size == 2) if kind in b"OR" else (pos == HEADER) if kind == _FLAGS else None

    def format(self, start: int, end: int) -> tuple[str, list[tuple[str, int, str]]] | None:
        """Name and fields (type, how many, name) of a definition, None where it cannot be read."""
        name, colon, fields = self.data[start:end].decode("latin-1").partition(":")
        read = []
        for one in filter(None, fields.split(";")):
            matched = _FIELD.fullmatch(one)
            if matched is None:
                return None
            read.append((matched[1], int(matched[2] or 0), matched[3]))
        return (name, read) if colon and read and re.fullmatch(r"\w+", name, re.ASCII) else None

    def measure(self, name: str) -> tuple[int, int] | None:
        """Fewest and most bytes of a topic; None where its definition cannot be true."""
        if name not in self.measured and name in self.formats:
            self.measured[name] = self._measure(name, self.formats[name])
        return self.measured.get(name)

    def _measure(self, name: str, fields: list[tuple[str, int, str]]) -> tuple[int, int] | None:
        flat = self.flatten(name, 0)
        if flat is None or not 0 < flat[0] <= LONGEST or flat[1] > MOST_FIELDS:
            return None
        if ("uint64_t", 0, "timestamp") not in fields:
            return None
        most = least = flat[0]
        for kind, many, field in reversed(fields):
            if not field.startswith("_padding") or kind not in SIZES:
                break
            least -= SIZES[kind] * max(many, 1)
        return least, most

    def flatten(self, name: str, depth: int) -> tuple[int, int] | None:
        """Bytes and number of the fields of a definition with all that it holds."""
        if depth > DEEPEST or name not in self.formats:
            return None
        fields = self.formats[name]
        if len({field for _, _, field in fields}) < len(fields):
            return None
        size = count = 0
        for kind, many, _ in fields:
            inner = (SIZES[kind], 1) if kind in SIZES else self.flatten(kind, depth + 1)
            if inner is None:
                return None
            size, count = size + inner[0] * max(many, 1), count + inner[1] * max(many, 1)
            if size > LONGEST or count > MOST_FIELDS:
                return None
        return size, count

    def take(self, pos: int, end: int) -> None:
        """Learn from a sound message, and keep it where pyulog is to have it."""
        kind, body = self.data[pos + 2], self.data[pos + 3 : end]
        if kind == _DATA:
            topic = int.from_bytes(body[:2], "little")
            if topic not in self.sizes:
                self.learnt.setdefault(topic, (end - pos - 5, end - pos - 5))
                self.homeless[self.names.get(topic, "")] += 1
            elif topic in self.wanted:
                self.kept.append((pos, pos + 5 + self.sizes[topic][0]))
        elif kind == _FORMAT:
            read = self.format(pos + 3, end)
            if read is not None and read[0] not in self.formats:
                self.formats[read[0]] = read[1]
        elif kind == _ADD:
            topic, name = int.from_bytes(body[1:3], "little"), body[3:].decode("latin-1")
            if topic not in self.names:
                self.names[topic] = name
                bounds = self.measure(name)
                if bounds is not None:
                    self.sizes[topic] = bounds
                    self.instances[name] += 1
                    if name in TOPICS and self.instances[name] <= INSTANCES:
                        self.wanted.add(topic)
                        self.kept.append((pos, end))
        elif kind == _INFO:
            if _informs(body, len(body)):
                self.kept.append((pos, end))
        elif kind == _DROPOUT:
            self.dropouts += 1
            self.dropout_ms += int.from_bytes(body[:2], "little")
        elif kind == _FLAGS and pos == HEADER:
            self.flags = int.from_bytes(body[8:16], "little") & ~1
            if body[8] & 1:
                offsets = struct.unpack_from("<3Q", body, 16)
                self.appended = sorted(one for one in offsets if end < one < len(self.data))

    def next_sound(self, pos: int, limit: int) -> int:
        """The next place with a message that shows that it is one; `limit` where none does."""
        chunk = _FIRST_CHUNK
        while pos + 3 <= limit:
            here = np.frombuffer(self.data, np.uint8, min(chunk + 2, limit - pos), pos).astype(np.int64)
            size, kind = here[:-2] | here[1:-1] << 8, here[2:]
            likely = np.isin(kind, list(_KINDS)) & (size > 1) & (size <= limit - pos)
            for at in (pos + np.flatnonzero(likely)).tolist():
                end, here_kind = self.header(at, limit)
                # Among many places some lead to a message by chance.
                if end and self.certain(here_kind, at, end) and (end == limit or self.holds(end, limit)):
                    return int(at)
            pos, chunk = pos + len(size), min(2 * chunk, _CHUNK)
        return limit


def sound_part(data: bytes) -> Sound:
    """Walk a ULog, the whole file, which begins with `MAGIC`; of its messages those of `TOPICS` are kept."""
    walk = _Walk(data)
    skipped = places = 0
    pos = rest = min(HEADER, len(data))
    edges = [len(data)]
    while pos < len(data):
        limit = next(one for one in edges if one > pos)
        end = walk.holds(pos, limit)
        if end:
            walk.take(pos, end)
            if len(edges) == 1 and walk.appended:
                # What was added after a crash begins at these places, even within a message.
                edges = [*walk.appended, len(data)]
            pos = end
            continue
        found = walk.next_sound(pos + 1, limit)
        if found == len(data):
            rest = pos
            break
        skipped, places, pos = skipped + found - pos, places + 1, found
    else:
        rest = len(data)
    formats = b"".join(_written(name, fields) for name, fields in walk.formats.items())
    # What only fills up is left away: pyulog takes it for a mistake.
    kept = b"".join([_HEAD.pack(b - a - 3, data[a + 2]) + data[a + 3 : b] for a, b in walk.kept])
    return Sound(
        data[:HEADER] + formats + kept,
        skipped,
        places,
        len(data) - rest,
        dict(walk.homeless),
        walk.dropouts,
        walk.dropout_ms / 1e3,
        walk.flags,
    )


def _informs(body: bytes, size: int) -> bool:
    """Whether a key at the beginning of so many bytes says how long its value is, and it is so long."""
    matched = _KEY.fullmatch(body[1 : 1 + body[0]]) if body else None
    if matched is None or matched[1].decode() not in SIZES:
        return False
    many = 1 if matched[2] is None else int(matched[2])
    return size - 1 - body[0] == SIZES[matched[1].decode()] * many


def _written(name: str, fields: list[tuple[str, int, str]]) -> bytes:
    said = "".join(f"{kind}{f'[{many}]' if many else ''} {field};" for kind, many, field in fields)
    body = f"{name}:{said}".encode()
    return _HEAD.pack(len(body), _FORMAT) + body


# -- messages

TOPICS = frozenset(
    {
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
    }
)
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


def decode(path: Path, data: bytes, zone: str | None) -> Decoded:
    """A ULog.

    Raises
    ------
    WildlabError
        Where it is none, was written in a way that is not known, or holds none of the topics that a flight
        is made of.
    """
    if not data.startswith(MAGIC):
        raise WildlabError("does not begin as a ULog does", "give the .ulg as it was logged", file=path)
    sound = sound_part(data)
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
    names = ", ".join(repr(printable(name)) for name in list(sound.homeless)[:8] if name)
    return [
        (sound.skipped, "byte", f"of {total} in {sound.places} places are no messages"),
        (sound.rest, "byte", f"of {total} at the end: it ends within a message"),
        (sum(sound.homeless.values()), "message", f"without a definition that can be true ({names})"),
    ]


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
    else:
        columns = dict.fromkeys(("latitude_deg", "longitude_deg"), np.full(len(at), np.nan))
        notes.append(f"{len(attitude)} attitudes stand without any position on Earth")
    q = attitude.quaternion()
    with np.errstate(over="ignore", invalid="ignore"):
        q = q / np.linalg.norm(q, axis=1)[:, None]
    angles = euler_deg(attitude.quaternion(), 0.1)
    q[np.isnan(angles).any(axis=1)] = np.nan
    columns |= named(("q_w", "q_x", "q_y", "q_z", *ANGLES), (*q.T, *angles.T))
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


def _gnss(log: Px4Log) -> Readings | None:
    found = log.first("vehicle_gps_position", "sensor_gps")
    if found is None or not (found.has("lat") or found.has("latitude_deg")):
        return None
    velocity = found.columns(named(VELOCITY, ("vel_n_m_s", "vel_e_m_s", "vel_d_m_s")))
    moving = found.get("vel_ned_valid") != 0
    columns = _position(found) | found.columns(SPREADS | QUALITY)
    columns |= {name: np.where(moving, one, np.nan) for name, one in velocity.items()}
    return log.readings(found, columns, unusable=fix_reasons(columns["fix"]))


def _imu(log: Px4Log) -> Readings | None:
    found = log.first("sensor_combined")
    if found is None:
        return None
    names = [f"{name}[{i}]" for name in ("accelerometer_m_s2", "gyro_rad") for i in range(3)]
    columns = found.columns(named(IMU, names))
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
    fields = LAT_LON | {"height_sea_m": "alt"} if found.has("lat") else {}
    return log.readings(found, found.columns({"number": "seq", **fields}), anywhere=True)


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
    return log.readings(mount, named(WORLD, (roll, pitch, world)))
