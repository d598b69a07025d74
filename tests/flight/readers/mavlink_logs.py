"""Made-up logs: telemetry by pymavlink's own packing, ULogs by a small writer."""

import re
import struct
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np
from pymavlink.dialects.v20 import ardupilotmega

START_S = 1_700_000_000.0
#: How late each message is by the clock of a vehicle that was switched on so long before.
BOOT_S = 500.0
ORIGIN = (63.4, 10.4)


def frame(
    message: Any, received_s: float, system: int = 1, component: int = 1, version_1: bool = False
) -> bytes:
    """A message as it stands in a telemetry log."""
    sender = ardupilotmega.MAVLink(None, srcSystem=system, srcComponent=component)
    packed = message.pack(sender, force_mavlink1=version_1)
    return struct.pack(">Q", round(received_s * 1e6)) + packed


def made(name: str, **fields: Any) -> Any:
    """A message with the fields given, and zeros in the others."""
    kind = next(one for one in ardupilotmega.mavlink_map.values() if one.msgname == name)
    values = {}
    for field, type_, count in zip(kind.fieldnames, kind.fieldtypes, _counts(kind), strict=True):
        none: Any = b"" if type_ == "char" else [0] * count if count else 0
        values[field] = fields.pop(field, none)
    assert not fields, fields
    return kind(**values)


def _counts(kind: Any) -> list[int]:
    by_name = dict(zip(kind.ordered_fieldnames, kind.array_lengths, strict=True))
    return [by_name[field] for field in kind.fieldnames]


def telemetry(
    count: int = 200,
    step_s: float = 0.2,
    jitter_s: float = 0.3,
    system: int = 1,
    boot_s: float = BOOT_S,
    start_s: float = START_S,
    version_1: bool = False,
    heartbeat: bool = True,
    seed: int = 1,
) -> list[tuple[float, bytes]]:
    """(time of receipt, frame) of a flight to the north at 10 m/s, places 0.1 s after attitudes.

    What waits holds up what comes after it.
    """
    rng = np.random.default_rng(seed)
    found = []

    def send(at: float, message: Any) -> None:
        last = found[-1][0] if found else 0.0
        received = max(start_s + at + rng.uniform(0, jitter_s), last)
        found.append((received, frame(message, received, system, 1, version_1)))

    if heartbeat:
        send(0.0, made("HEARTBEAT", type=1, autopilot=3, mavlink_version=3))
    for row in range(count):
        at = row * step_s
        ms = round((boot_s + at) * 1e3)
        send(at, made("ATTITUDE", time_boot_ms=ms, roll=0.1, pitch=-0.05, yaw=np.radians(row % 90)))
        later = round((boot_s + at + 0.1) * 1e3)
        north = 10 * (at + 0.1)
        send(
            at + 0.1,
            made(
                "GLOBAL_POSITION_INT",
                time_boot_ms=later,
                lat=round((ORIGIN[0] + north / 111_412) * 1e7),
                lon=round(ORIGIN[1] * 1e7),
                alt=150_000,
                relative_alt=50_000,
                vx=1000,
            ),
        )
    return found


def joined(*sent: Sequence[tuple[float, bytes]]) -> bytes:
    """All frames in the order of their receipt."""
    every = [item for each in sent for item in each]
    return b"".join(one for _, one in sorted(every, key=lambda item: item[0]))


_CODES = {"float": "f", "double": "d", "uint8_t": "B", "int32_t": "i", "uint32_t": "I", "uint64_t": "Q"}
_CODES |= {"bool": "?", "int64_t": "q", "uint16_t": "H", "char": "c"}


def message(kind: str, body: bytes) -> bytes:
    """One message of a ULog."""
    return struct.pack("<HB", len(body), ord(kind)) + body


def ulog(
    topics: Mapping[str, tuple[str, Iterable[Sequence[Any]]]],
    about: Mapping[str, Any] | None = None,
    flags: bytes = bytes(40),
    before: bytes = b"",
    after: bytes = b"",
) -> bytes:
    """A ULog.

    `topics`: name (with ``#1`` for an instance) -> format (``"uint64_t timestamp;float[3] gyro_rad;"``) and
    rows, whose arrays are laid flat.
    """
    parts = [b"ULog\x01\x12\x35\x01" + struct.pack("<Q", 1000), message("B", flags), before]
    for key, value in (about or {}).items():
        if isinstance(value, int):
            kind, body = f"uint32_t {key}", struct.pack("<I", value)
        else:
            kind, body = f"char[{len(value)}] {key}", value.encode()
        parts.append(message("I", bytes([len(kind)]) + kind.encode() + body))
    names = dict.fromkeys(name.split("#")[0] for name in topics)
    forms = {name.split("#")[0]: form for name, (form, _) in topics.items()}
    parts += [message("F", f"{name}:{forms[name]}".encode()) for name in names]
    rows = []
    for number, (name, (form, values)) in enumerate(topics.items()):
        plain, _, instance = name.partition("#")
        parts.append(message("A", struct.pack("<BH", int(instance or 0), number) + plain.encode()))
        code = "<" + "".join(
            (many and f"{many}{_CODES[kind]}") or _CODES[kind]
            for kind, many in re.findall(r"(\w+?)(?:\[(\d+)\])? \w+;", form)
        )
        packed = [message("D", struct.pack("<H", number) + struct.pack(code, *row)) for row in values]
        # As if all topics were written at steady rates from beginning to end.
        rows += [(at / len(packed), one) for at, one in enumerate(packed)]
    return b"".join([*parts, *(one for _, one in sorted(rows, key=lambda row: row[0])), after])
