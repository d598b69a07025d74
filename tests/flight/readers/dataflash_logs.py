"""A small writer of DataFlash logs, binary and as text, and one flight in three generations of names."""

import struct
from collections.abc import Callable
from dataclasses import dataclass, field
from datetime import UTC, datetime
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

#: Format characters, struct's letter for each, and a factor; texts have none.
LETTERS_TABLE = """
    b b 1    B B 1    h h 1    H H 1    i i 1    I I 1    f f 1    d d 1    q q 1    Q Q 1    M B 1    g e 1
    c h 100  C H 100  e i 100  E I 100  L i 1e7  n 4s 0   N 16s 0  Z 64s 0
"""
LETTERS = {
    character: (letter, float(factor))
    for character, letter, factor in zip(*[iter(LETTERS_TABLE.split())] * 3, strict=True)
}


def fmt(kind: int, name: str, characters: str, columns: str, length: int | None = None) -> bytes:
    size = struct.calcsize("<" + "".join(LETTERS[one][0] for one in characters if one in LETTERS)) + 3
    texts = (name.encode(), characters.encode(), columns.encode())
    said = size if length is None else length
    return b"\xa3\x95\x80" + struct.pack("<BB4s16s64s", kind, said, *texts)


@dataclass
class Log:
    """Messages with values in their units; each is defined where it is used first.

    `forms`: a line for each kind of message, with its name, format characters and columns.
    """

    forms: str = ""
    kinds: dict[str, tuple[int, str, str]] = field(default_factory=dict)
    messages: list[tuple[str, tuple[Any, ...]]] = field(default_factory=list)

    def __post_init__(self) -> None:
        for number, line in enumerate(self.forms.split("\n"), 1):
            if words := line.split():
                self.kinds[words[0]] = (number, words[1], words[2])

    def add(self, name: str, *values: Any) -> None:
        assert len(values) == len(self.kinds[name][1]), name
        self.messages.append((name, values))

    def body(self, name: str, values: tuple[Any, ...]) -> bytes:
        kind, characters, _ = self.kinds[name]
        made = b""
        for value, character in zip(values, characters, strict=True):
            letter, factor = LETTERS[character]
            if factor == 0:
                value = str(value).encode()
            elif letter not in "fde":
                value = round(value * factor)
            made += struct.pack("<" + letter, value)
        return b"\xa3\x95" + bytes([kind]) + made

    def pieces(self) -> list[bytes]:
        """All messages, definitions too, each as its bytes."""
        made = [fmt(128, "FMT", "BBnNZ", "Type,Length,Name,Format,Columns")]
        seen = set()
        for name, values in self.messages:
            if name not in seen:
                kind, characters, columns = self.kinds[name]
                made.append(fmt(kind, name, characters, columns))
                seen.add(name)
            made.append(self.body(name, values))
        return made

    def binary(self) -> bytes:
        return b"".join(self.pieces())

    def text(self) -> bytes:
        lines = ["", "ArduCopter V3.1", ""]
        for name, (kind, characters, columns) in self.kinds.items():
            size = len(self.body(name, tuple(0 for _ in characters)))
            lines.append(f"FMT, {kind}, {size}, {name}, {characters}, {columns}")
        for name, values in self.messages:
            lines.append(", ".join([name, *(str(one) for one in values)]))
        return "\n".join(lines).encode() + b"\n"


#: When the made-up flight began, and where.
BEGAN = {2014: datetime(2014, 10, 19, 1, 0, tzinfo=UTC), 2025: datetime(2025, 1, 3, 13, 0, tzinfo=UTC)}
#: GPS time minus UTC then.
LEAP_S = {2014: 16, 2025: 18}
LATITUDE, LONGITUDE, HEIGHT, HOME = 41.7, -8.8, 130.0, 100.0


@dataclass(frozen=True)
class Truth:
    """A straight flight: where and how at stamps (N,) of the board, and UTC of them."""

    year: int
    rate: float = 1.0
    boot_s: float = 20.0

    def utc(self, stamp: Any) -> Any:
        return BEGAN[self.year].timestamp() + self.rate * (np.asarray(stamp) - self.boot_s)

    def week_ms(self, stamp: float) -> tuple[int, int]:
        gps = float(self.utc(stamp)) + LEAP_S[self.year] - datetime(1980, 1, 6, tzinfo=UTC).timestamp()
        week, rest = divmod(gps, 604800.0)
        return int(week), round(rest * 1e3)

    def place(self, stamp: Any) -> tuple[Any, Any, Any]:
        """Latitude, longitude and height."""
        t = np.asarray(stamp) - self.boot_s
        return LATITUDE + 1e-4 * t, LONGITUDE - 1e-4 * t, HEIGHT + 0.5 * t

    def heights(self, stamp: float) -> tuple[float, float, float]:
        """Above sea level, home, and sea level as the receiver has it."""
        height = self.place(stamp)[2]
        return height, height - HOME, height

    def attitude(self, stamp: Any) -> tuple[Any, Any, Any]:
        t = np.asarray(stamp) - self.boot_s
        return 5.0 + 0 * t, -2.0 + 0 * t, 90.0 + 0.5 * t


FIRST = """
    MSG Z Message
    ATT IccccCC TimeMS,DesRoll,Roll,DesPitch,Pitch,DesYaw,Yaw
    IMU Iffffff TimeMS,GyrX,GyrY,GyrZ,AccX,AccY,AccZ
    MAG Ihhhhhhhhh TimeMS,MagX,MagY,MagZ,OfsX,OfsY,OfsZ,MOfsX,MOfsY,MOfsZ
    GPS BIHBcLLeeEefI Status,TimeMS,Week,NSats,HDop,Lat,Lng,RelAlt,Alt,Spd,GCrs,VZ,T
    CAM IHLLeccC GPSTime,GPSWeek,Lat,Lng,Alt,Roll,Pitch,Yaw
"""


def _run(log: Log, truth: Truth, seconds: float, steps: dict[float, Callable[[float], None]]) -> None:
    """Call each function at its step, in the order of time, from the board's switch-on on."""
    calls = [
        (truth.boot_s + i * step, number, call)
        for number, (step, call) in enumerate(steps.items())
        for i in range(int(seconds / step))
    ]
    for stamp, _, call in sorted(calls, key=lambda one: one[:2]):
        call(stamp)


def first_generation(truth: Truth, seconds: float = 40.0) -> Log:
    """TimeMS everywhere; GPS has ms of the week as TimeMS and the stamp as T; CAM has GPS time only."""
    log = Log(FIRST)
    log.add("MSG", "ArduCopter V3.1.3 (92cdd2a3)")

    def fast(t: float) -> None:
        ms = round(t * 1e3)
        roll, pitch, yaw = truth.attitude(t)
        log.add("IMU", ms, 0.01, 0.02, 0.03, 0.1, 0.2, -9.8)
        log.add("ATT", ms, 0, roll, 0, pitch, 0, yaw)
        log.add("MAG", ms, 200, -100, 400, 0, 0, 0, 0, 0, 0)

    def slow(t: float) -> None:
        week, ms = truth.week_ms(t)
        latitude, longitude, height = truth.place(t)
        where = (latitude, longitude, height - HOME, height)
        log.add("GPS", 3, ms, week, 9, 1.5, *where, 14.0, 315.0, -0.5, round(t * 1e3))

    def photo(t: float) -> None:
        week, ms = truth.week_ms(t)
        log.add("CAM", ms, week, *truth.place(t)[:2], 30.0, *truth.attitude(t))

    _run(log, truth, seconds, {0.1: fast, 0.2: slow, 5.0: photo})
    return log


SECOND = """
    MSG QZ TimeUS,Message
    ATT QccccCCCC TimeUS,DesRoll,Roll,DesPitch,Pitch,DesYaw,Yaw,ErrRP,ErrYaw
    NKF1 Qfff TimeUS,VN,VE,VD
    POS QLLff TimeUS,Lat,Lng,Alt,RelHomeAlt
    IMU2 Qffffff TimeUS,GyrX,GyrY,GyrZ,AccX,AccY,AccZ
    IMU Qffffff TimeUS,GyrX,GyrY,GyrZ,AccX,AccY,AccZ
    GPS QBIHBcLLefffB TimeUS,Status,GMS,GWk,NSats,HDop,Lat,Lng,Alt,Spd,GCrs,VZ,U
    GPA QCCCCBIH TimeUS,VDop,HAcc,VAcc,SAcc,VV,SMS,Delta
    TRIG QIHLLeeeccC TimeUS,GPSTime,GPSWeek,Lat,Lng,Alt,RelAlt,GPSAlt,Roll,Pitch,Yaw
"""


def second_generation(truth: Truth, seconds: float = 40.0) -> Log:
    """TimeUS; one message name per sensor."""
    log = Log(SECOND)
    log.add("MSG", round(truth.boot_s * 1e6), "ArduPlane V3.8.2-dev (8178ab40)")

    def fast(t: float) -> None:
        us = round(t * 1e6)
        roll, pitch, yaw = truth.attitude(t)
        log.add("IMU2", us, 9, 9, 9, 9, 9, 9)
        log.add("IMU", us, 0.01, 0.02, 0.03, 0.1, 0.2, -9.8)
        log.add("ATT", us, 0, roll, 0, pitch, 0, yaw, 0, 0)
        log.add("NKF1", us, 9.9, -9.9, -0.5)
        log.add("POS", us, *truth.place(t)[:2], *truth.heights(t)[:2])

    def slow(t: float) -> None:
        us, (week, ms) = round(t * 1e6), truth.week_ms(t)
        log.add("GPS", us, 3, ms, week, 11, 0.77, *truth.place(t), 14.0, 315.0, -0.5, 1)
        log.add("GPA", us, 1.2, 1.61, 2.41, 0.51, 1, round(t * 1e3), 200)

    def photo(t: float) -> None:
        us, (week, ms) = round(t * 1e6), truth.week_ms(t)
        log.add("TRIG", us, ms, week, *truth.place(t)[:2], *truth.heights(t), *truth.attitude(t))

    _run(log, truth, seconds, {0.1: fast, 0.2: slow, 5.0: photo})
    return log


# Columns of ATT stand in another order than any release had them.
THIRD = """
    VER QBZ TimeUS,Maj,FWS
    ATT cQCc Pitch,TimeUS,Yaw,Roll
    XKQ QBffff TimeUS,C,Q1,Q2,Q3,Q4
    XKF1 QBfff TimeUS,C,VN,VE,VD
    POS QLLfff TimeUS,Lat,Lng,Alt,RelHomeAlt,RelOriginAlt
    ACC QBQfff TimeUS,I,SampleUS,AccX,AccY,AccZ
    GYR QBQfff TimeUS,I,SampleUS,GyrX,GyrY,GyrZ
    MAG QBhhhBI TimeUS,I,MagX,MagY,MagZ,Health,S
    GPS QBBIHBcLLeffffB TimeUS,I,Status,GMS,GWk,NSats,HDop,Lat,Lng,Alt,Spd,GCrs,VZ,Yaw,U
    GPA QBCCCCfBIHf TimeUS,I,VDop,HAcc,VAcc,SAcc,YAcc,VV,SMS,Delta,Und
    MNT QBffffffff TimeUS,I,DesRoll,Roll,DesPitch,Pitch,DesYawB,YawB,DesYawE,YawE
    CAM QBHIHLLeeefff TimeUS,I,Img,GPSTime,GPSWeek,Lat,Lng,Alt,RelAlt,GPSAlt,R,P,Y
"""


def third_generation(truth: Truth, seconds: float = 40.0, attitude: bool = True) -> Log:
    """An instance per sensor, ACC and GYR apart, a gimbal, images numbered; no fix at first."""
    log = Log(THIRD)
    began = round(truth.boot_s * 1e6)
    log.add("VER", began, 4, "ArduPlane V4.2.3 (55685c43)")
    fix = truth.boot_s + 10

    def fast(t: float) -> None:
        us = round(t * 1e6)
        roll, pitch, yaw = truth.attitude(t)
        if attitude:
            log.add("ATT", pitch, us, yaw, roll)
        half = np.radians(yaw) / 2
        for each in (0, 1):
            log.add("XKQ", us, each, np.cos(half), 0, 0, np.sin(half))
            log.add("XKF1", us, each, 9.9 + each, -9.9, -0.5)
            log.add("ACC", us + 900, each, us, 0.1 + each, 0.2, -9.8)
            log.add("GYR", us + 1000, each, us + 500, 0.01, 0.02, 0.03)
        log.add("MAG", us, 0, 200, -100, 400, 1, 0)
        log.add("MNT", us, 0, 0, 1.0, 0, -60.0, 0, 20.0, 0, 110.0)
        sea, home, _ = truth.heights(t)
        where = truth.place(t)[:2] if t >= fix else (0, 0)
        log.add("POS", us, *where, sea, home, home if t >= fix else float("nan"))

    def slow(t: float) -> None:
        us, (week, ms), known = round(t * 1e6), truth.week_ms(t), t >= fix
        where = truth.place(t) if known else (60.9, -97.0, 17836.0)
        sds = (1.5, 2.5, 0.5) if known else (655.35, 655.35, 655.35)
        for receiver in (0, 1):
            shown = (3, ms, week, 6, 1.2) if known and receiver else (1, ms, week if known else 0, 0, 99.99)
            log.add("GPS", us, receiver, *shown, *where, 14, 315, -0.5, 0, 1)
            log.add("GPA", us, receiver, 1.2, *sds, 0, 1, round(t * 1e3), 200, -48.5)

    number = iter(range(1, 1000))

    def photo(t: float) -> None:
        us, (week, ms) = round(t * 1e6), truth.week_ms(t)
        shown = (*truth.place(t)[:2], *truth.heights(t), *truth.attitude(t))
        log.add("CAM", us, 0, next(number), ms, week, *shown)

    _run(log, truth, seconds, {0.1: fast, 0.2: slow, 5.0: photo})
    return log
