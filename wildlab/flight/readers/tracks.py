"""Tracks of satellite receivers as `gnss`: NMEA 0183, u-blox UBX, GPX (1.0 and 1.1), RTKLIB's ``.pos``; and
what the sensors of the Autoferry data set saw.

Sentences of NMEA are found wherever they stand in a line, so that stamps of a logger before them do no harm.
They are joined into epochs by the time that they carry; days come from RMC and ZDA, and are carried to the
sentences that have none, over midnight too. Facts of the sentences: NMEA 0183, as `pynmea2` has it.

Of UBX, NAV-PVT says all of a position. Receivers with dead reckoning say HNR-PVT and HNR-ATT often: these
are `poses`. UTC is the receiver's own. Messages of a kind are taken all at once, some 50 times as fast as
`pyubx2` makes an object of each. Facts of the protocol: u-blox interface descriptions of series 7 to 9, as
`pyubx2` has them.

Points of a damaged GPX are salvaged. Of RTKLIB, calendar dates or weeks with their time, in GPST or UTC,
latitude and longitude in degrees; other solutions are refused, with what to set. Facts of the format:
RTKLIB's manual, appendix B, and its output.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import replace
from datetime import UTC, datetime
from functools import reduce
from operator import xor
from pathlib import Path
from typing import Any, Literal, NamedTuple
from xml.etree.ElementTree import Element

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from wildlab.errors import WildlabError
from wildlab.flight.clock_fitting import GPS_START_S, WEEK_S, gps_to_utc
from wildlab.flight.readers import text
from wildlab.flight.readers.log import UTC_OF_LOG, RawLog, Stream, holding, level_velocity, named
from wildlab.flight.readers.text import number, numbers, parse_xml, plural, stamp_s, told
from wildlab.flight.schema import VELOCITY
from wildlab.geometry.covariances import tilt_from_roll_pitch
from wildlab.geometry.frames import Array, Indices, Mask

# -- NMEA 0183

#: Talker, kind, fields, checksum.
_SENTENCE = re.compile(rb"\$(([A-Z][A-Z0-9])([A-Z]{3}),([^$!*\r\n]{0,400}))(?:\*([0-9A-Fa-f]{2}))?")
#: Sentences of use and their fields; those with a position first, best first.
SENTENCES = {
    "GGA": "time lat ns lon ew mode satellites hdop height _ undulation",
    "GNS": "time lat ns lon ew mode satellites hdop height undulation",
    "RMC": "time status lat ns lon ew speed course date _ _ mode",
    "GLL": "lat ns lon ew time status mode",
    "VTG": "course _ _ _ speed",
    "GST": "time _ _ _ _ north east up",
    "ZDA": "time day month year",
}
_FIELDS = {kind: names.split() for kind, names in SENTENCES.items()}
_NAMES = sorted({name for names in _FIELDS.values() for name in names})
_POSITIONS = ("GGA", "GNS", "RMC", "GLL")
#: Talkers that are satellite receivers, not plotters that repeat one.
_RECEIVERS = frozenset({"GP", "GN", "GL", "GA", "GB", "BD", "GQ", "QZ", "GI", "IR"})
#: Quality of GGA, and letters of the others, as kinds of fix: 3 in space, 4 differential, 5 float, 6 fixed;
#: and those that are estimated, typed in or simulated.
_MODES = named("123459ADPFR", (3.0, 4.0, 3.0, 6.0, 5.0, 4.0, 3.0, 4.0, 3.0, 5.0, 6.0))
_GUESSED = frozenset("678EMS")
_KNOT_M_S, _DAY_S = 1852.0 / 3600.0, 86400.0


class Sentences(NamedTuple):
    """Sentences whose checksum holds, by their kinds; in a table those of use; and how many are bad."""

    kinds: list[str]
    table: pd.DataFrame
    bad: int


def sentences(data: bytes) -> Sentences:
    """Every sentence whose checksum holds; all, where none of them has one. What stands in a comment is none.

    Fields are text, by the names of `SENTENCES`.
    """
    found = [
        (number, one)
        for number, line in enumerate(data.split(b"\n"), 1)
        if not line.startswith(b"#")
        for one in _SENTENCE.finditer(line)
    ]
    checked = any(one[5] for _, one in found)
    good = [
        (at, one) for at, one in found if not checked or (one[5] and int(one[5], 16) == reduce(xor, one[1]))
    ]
    kinds = [one[3].decode() for _, one in good]
    rows = [
        {"line": at, "talker": one[2].decode(), "kind": kind}
        | dict(zip(_FIELDS[kind], one[4].decode("latin-1").split(","), strict=False))
        for (at, one), kind in zip(good, kinds, strict=True)
        if kind in _FIELDS
    ]
    table = pd.DataFrame(rows, columns=["line", "talker", "kind", *_NAMES])
    table[_NAMES] = table[_NAMES].fillna("").apply(lambda column: column.str.strip())
    return Sentences(kinds, table, len(found) - len(good))


def nmea_sniff(head: bytes) -> bool:
    """Whether a file begins with sentences."""
    found = sentences(head)
    return bool(len(found.table)) or len(found.kinds) >= 3


def nmea_decode(path: Path, data: bytes, zone: str | None) -> RawLog:
    """A log of sentences; rows are lines of the file.

    Raises
    ------
    WildlabError
        Where no sentence has a position.
    """
    kinds, table, bad = sentences(data)
    time = _times(table)
    dated = bool(len(table)) and bool(np.isfinite(_days(table)[np.isfinite(time)]).any())
    talkers = table["talker"][table["kind"].isin(_POSITIONS)].value_counts()
    # A receiver changes its talker with the satellites in use; others repeat it.
    allowed = _RECEIVERS if _RECEIVERS & set(talkers.index) else {*talkers.index[:1]}
    left = talkers[~talkers.index.isin(allowed)]
    found = _epochs(table.assign(time=time)[table["talker"].isin(allowed)])
    place = found["place"]
    if not len(place):
        problem = f"{plural(len(kinds), 'sentence')} of NMEA 0183, and none with a position"
        raise WildlabError(problem, "log RMC, GGA, GNS or GLL of the receiver", file=path)
    utc = place["time"].to_numpy(float) if dated else np.full(len(place), np.nan)
    timed = int(np.isfinite(utc).sum())
    count = plural(int(left.sum()), "position")
    notes = {
        f"{count} of other talkers ({', '.join(sorted(left.index))}) left aside": len(left),
        "no sentence carries a date (RMC, ZDA): UTC is not known": not timed,
    }
    columns = {"time_s": utc, "time_log_s": place["time"].to_numpy(float), **_columns(found)}
    return RawLog(
        {"gnss": Stream(columns, place["line"], "line", {"no fix": found["no_fix"]})},
        clock=UTC_OF_LOG if timed else "",
        lost=told((bad, "sentence", "with a wrong or missing checksum")),
        notes=holding(notes),
    )


def _days(table: pd.DataFrame) -> Array:
    """(N,) s since 1970 of the beginning of the day that RMC or ZDA names, else NaN."""
    said = table["date"].where((table["kind"] == "RMC") & (table["status"] == "A"))
    whole = table["day"] + table["month"] + table["year"]
    dates = pd.to_datetime(said, format="%d%m%y", errors="coerce")
    dates = dates.fillna(pd.to_datetime(whole, format="%d%m%Y", errors="coerce"))
    return np.asarray((dates - pd.Timestamp(0)).dt.total_seconds(), float)


def _times(table: pd.DataFrame) -> Array:
    """(N,) UTC; where no sentence has a date, s of a day that is not known."""
    said = table["time"].where(table["time"].str.fullmatch(r"\d{6}(\.\d*)?"))
    clock = numbers(said.fillna(""))
    hours, minutes, seconds = clock // 1e4, clock // 100 % 100, clock % 100
    with np.errstate(invalid="ignore"):
        fine = (hours < 24) & (minutes < 60) & (seconds < 61)
    of_day = np.where(fine, hours * 3600 + minutes * 60 + seconds, np.nan)
    timed = np.flatnonzero(np.isfinite(of_day))
    stamps = np.full(len(table), np.nan)
    begun = pd.Series(_days(table) + of_day)[timed]
    if begun.notna().any():
        # One without a date is within half a day of the last one that has a date, or of the first.
        anchor = begun.ffill().bfill().to_numpy()
        steps = of_day[timed] - anchor % _DAY_S
        stamps[timed] = anchor + steps - np.round(steps / _DAY_S) * _DAY_S
    else:
        stamps[timed] = np.unwrap(of_day[timed], period=_DAY_S)
    # Equal texts are equal stamps, whichever day they were counted from.
    return np.round(stamps, 4)


def _epochs(table: pd.DataFrame) -> dict[str, Any]:
    """By its kind the sentence of each time that has a position; in `place` the best of those with one."""
    own = table["kind"] != "VTG"
    # A second sentence of a kind at the same time is another row, and later found to be a repetition.
    at = table["time"].fillna(pd.Series(-1.0 - np.arange(len(table)), table.index))
    again = table.assign(time=at).groupby(["time", "kind"]).cumcount()
    epoch = table[own].groupby([at[own], again[own]], sort=False).ngroup().reindex(table.index)
    # VTG carries no time, and belongs to what came before it.
    table = table.assign(epoch=epoch.ffill()).dropna(subset="epoch")
    places = table[table["kind"].isin(_POSITIONS)]
    kinds = [_fix(*one) for one in zip(places["status"], places["mode"], places["kind"], strict=True)]
    places = places.assign(fix=kinds)
    better = places["kind"].map(_POSITIONS.index)
    best = places.assign(better=better).sort_values(["epoch", "better"]).drop_duplicates("epoch")
    best = best.set_index("epoch")
    # One sentence without a fix is enough.
    none = places["epoch"][places["fix"] == 0]
    others = {
        kind: table[table["kind"] == kind].drop_duplicates("epoch").set_index("epoch").reindex(best.index)
        for kind in ("RMC", "VTG", "GST")
    }
    return {"place": best, "no_fix": np.isin(best.index, none), **others}


def _fix(status: str, mode: str, kind: str) -> float:
    """Kind of fix by one sentence, NaN where it does not say."""
    if status == "A" and not mode:
        return np.nan
    valid = status == "A" or kind in ("GGA", "GNS")
    best = max((_MODES.get(one, 0.0) for one in mode), default=0.0) if valid else 0.0
    return 1.0 if best == 0.0 and any(one in _GUESSED for one in mode) else best


def _columns(found: Mapping[str, Any]) -> dict[str, Array]:
    place, rmc, vtg = found["place"], found["RMC"], found["VTG"]

    def of(table: pd.DataFrame, name: str) -> Array:
        return numbers(table[name].fillna(""))

    moving = np.isfinite(of(rmc, "speed"))
    speed, course = (np.where(moving, of(rmc, name), of(vtg, name)) for name in ("speed", "course"))
    north, east, up = (of(found["GST"], name) for name in ("north", "east", "up"))
    return {
        "latitude_deg": _degrees(of(place, "lat"), place["ns"]),
        "longitude_deg": _degrees(of(place, "lon"), place["ew"]),
        "height_sea_m": of(place, "height"),
        "undulation_m": of(place, "undulation"),
        # At rest without a course, too.
        **level_velocity(speed * _KNOT_M_S, np.where(speed == 0, 0.0, course)),
        # The root of the mean of both variances.
        "sd_horizontal_m": np.sqrt((north**2 + east**2) / 2.0),
        "sd_vertical_m": up,
        "satellites": of(place, "satellites"),
        "fix": place["fix"].to_numpy(float),
        "hdop": of(place, "hdop"),
    }


def _degrees(value: Array, side: pd.Series) -> Array:
    """Of ``dddmm.mmmm`` and its letter, NaN where it is none."""
    whole = np.floor(value / 100.0)
    minutes = value - 100.0 * whole
    sign = side.map({"N": 1.0, "E": 1.0, "S": -1.0, "W": -1.0}).to_numpy(float)
    return np.where((value >= 0) & (minutes < 60.0), sign * (whole + minutes / 60.0), np.nan)


# -- u-blox UBX

#: Class and number of messages.
PVT, DOP = (0x01, 0x07), (0x01, 0x04)
NAV_ATT, HNR_ATT, HNR_PVT = (0x01, 0x05), (0x28, 0x01), (0x28, 0x00)
#: Sync, class, number, length; then the payload and two bytes of checksum.
_SYNC, _HEADER, _CHECK = (0xB5, 0x62), 6, 2
#: Kinds of fix: none, dead reckoning alone, plane, space, both together, time alone.
_FIXES = pd.Series([0.0, 1.0, 2.0, 3.0, 3.0, 0.0])
_TEXT = bytes(range(32, 127)) + b"\t\r\n"


def _fields(text: str) -> list[Any]:
    """Names with their types, ``itow:u4``; groups of names by one type, ``lon lat:i4``; ``+n`` bytes
    unused."""
    made: list[Any] = []
    for group in text.split(", "):
        names, _, kind = group.partition(":")
        made += [
            (f"_{len(made) + at}", f"V{name[1:]}") if name[0] == "+" else (name, f"<{kind}")
            for at, name in enumerate(names.split())
        ]
    return made


_DATE = "year:u2, month day hour minute second:u1"
_PLACE = "lon lat height sea:i4"
_ATTITUDE = "itow:u4, +4, roll pitch heading:i4, roll_acc pitch_acc heading_acc:u4"
#: Fields of messages, as far as they are used. Newer versions are longer, never otherwise.
LAYOUTS: dict[tuple[int, int], Any] = {
    kind: np.dtype(_fields(text))
    for kind, text in {
        PVT: f"itow:u4, {_DATE}, valid:u1, time_acc:u4, nano:i4, fix flags flags2 satellites:u1, {_PLACE}, "
        "h_acc v_acc:u4, vel_n vel_e vel_d speed course:i4, s_acc course_acc:u4, pdop:u2, flags3:u1",
        DOP: "itow:u4, +8, hdop:u2",
        NAV_ATT: _ATTITUDE,
        HNR_ATT: _ATTITUDE,
        HNR_PVT: f"itow:u4, {_DATE}, valid:u1, nano:i4, fix flags:u1, +2, {_PLACE}, "
        "speed speed_3d course heading:i4, h_acc v_acc s_acc:u4",
    }.items()
}
#: Classes that the interface descriptions have; others are chance.
CLASSES = (0x01, 0x02, 0x04, 0x05, 0x06, 0x09, 0x0A, 0x0B, 0x0C, 0x0D, 0x10, 0x13, 0x21, 0x27, 0x28)


class UbxFrames(NamedTuple):
    """Messages whose checksum holds, in the order of the file.

    Attributes
    ----------
    data
        The whole file.
    start, stop
        (M,) bytes of each, its header and checksum among them.
    """

    data: bytes
    start: Indices
    stop: Indices

    def rows(self, kind: tuple[int, int]) -> pd.DataFrame:
        """Fields of all messages of a kind, `which` of the file's they are, from 1, and `own_s`: time of
        week, going on where a week ends."""
        raw, layout = np.frombuffer(self.data, np.uint8), LAYOUTS[kind]
        ours = (raw[self.start + 2] == kind[0]) & (raw[self.start + 3] == kind[1])
        which = np.flatnonzero(ours & (self.stop - self.start >= layout.itemsize + _HEADER + _CHECK))
        taken = raw[(self.start[which] + _HEADER)[:, None] + np.arange(layout.itemsize)]
        found = np.ascontiguousarray(taken).view(layout).reshape(-1)
        table = pd.DataFrame({name: found[name] for name in layout.names or () if name[0] != "_"})
        own = np.unwrap(table["itow"].to_numpy(float) / 1000.0, period=WEEK_S)
        return table.assign(which=which + 1, own_s=own)

    def at(self, own_s: Array, kind: tuple[int, int]) -> pd.DataFrame:
        """Fields of the messages of a kind at the same times of week (N,), NaN where there are none."""
        return self.rows(kind).drop_duplicates("own_s").set_index("own_s").reindex(own_s).reset_index()


def frames(data: bytes) -> UbxFrames:
    """Messages in any stream of bytes, whatever else is in it. A length that lies costs one message.

    Sums of all bytes before each place give the checksum of any stretch at once, so that no stretch is read
    twice; both run modulo 256, as the checksum itself.
    """
    # Two more bytes, so that a stop at the end of the file is an index, too.
    raw = np.frombuffer(data + bytes(_HEADER + _CHECK), np.uint8)
    at = np.flatnonzero(
        (raw[:-1] == _SYNC[0]) & (raw[1:] == _SYNC[1]) & np.isin(np.roll(raw, -2)[:-1], CLASSES)
    )
    begin, end = at + 2, at + _HEADER + raw[at + 4] + 256 * raw[at + 5].astype(np.int64)
    whole = end + _CHECK <= len(data)
    begin, end = begin[whole], end[whole]
    first = np.r_[np.zeros(1, np.uint8), np.cumsum(raw, dtype=np.uint8)]
    second = np.r_[np.zeros(1, np.uint8), np.cumsum(first[1:], dtype=np.uint8)]
    sum_a = first[end] - first[begin]
    sum_b = second[end] - second[begin] - (end - begin).astype(np.uint8) * first[begin]
    good = (raw[end] == sum_a) & (raw[end + 1] == sum_b)
    spans: list[tuple[int, int]] = []
    for i, j in zip((begin[good] - 2).tolist(), (end[good] + _CHECK).tolist(), strict=True):
        if not spans or i >= spans[-1][1]:
            spans.append((i, j))
    start, stop = np.array(spans, np.int64).reshape(-1, 2).T
    return UbxFrames(data, start, stop)


def ubx_sniff(head: bytes) -> bool:
    """Whether a message with the right checksum is among the first bytes."""
    return len(frames(head).start) > 0


def ubx_decode(path: Path, data: bytes, zone: str | None) -> RawLog:
    """A log of a u-blox receiver; text between the messages does no harm. Rows are messages of UBX.

    Raises
    ------
    WildlabError
        Where no message has a position, nor any sentence of NMEA.
    """
    found = frames(data)
    gnss = _of_pvt(found, PVT)
    if gnss is None:
        return nmea_decode(path, data, zone)
    poses = _poses(found, gnss)
    begins, ends = np.r_[found.start, len(data)].tolist(), np.r_[0, found.stop].tolist()
    rest = b"".join(data[i:j] for i, j in zip(ends, begins, strict=True))
    return RawLog(
        {"gnss": gnss} | ({"poses": poses} if poses else {}),
        clock=UTC_OF_LOG,
        lost=told((len(rest.translate(None, _TEXT)), "byte", "of no message of UBX and of no text")),
    )


def _utc(rows: pd.DataFrame) -> Array:
    """s since 1970 of a calendar date with ns, which may be negative; NaN where it is no date."""
    date = pd.to_datetime(rows[["year", "month", "day"]], errors="coerce")
    clock = rows["hour"] * 3600.0 + rows["minute"] * 60.0 + rows["second"] + rows["nano"] * 1e-9
    fine = (rows["hour"] < 24) & (rows["minute"] < 60) & (rows["second"] <= 60) & (rows["nano"].abs() <= 1e9)
    return np.asarray(((date - pd.Timestamp(0)).dt.total_seconds() + clock).where(fine), float)


def _place(found: UbxFrames, rows: pd.DataFrame) -> dict[str, Array]:
    """Place, heights and spreads of messages."""
    own = rows["own_s"].to_numpy()
    columns = {
        "time_log_s": own,
        **{f"{name}itude_deg": rows[name[:3]].to_numpy() * 1e-7 for name in ("lat", "long")},
        "height_ellipsoid_m": rows["height"].to_numpy() * 1e-3,
        "height_sea_m": rows["sea"].to_numpy() * 1e-3,
        "sd_horizontal_m": rows["h_acc"].to_numpy() * 1e-3,
        "sd_vertical_m": rows["v_acc"].to_numpy() * 1e-3,
        "hdop": found.at(own, DOP)["hdop"].to_numpy() * 0.01,
    }
    return columns | {"undulation_m": columns["height_ellipsoid_m"] - columns["height_sea_m"]}


def _of_pvt(found: UbxFrames, kind: tuple[int, int]) -> Stream | None:
    """`gnss` of NAV-PVT, or of HNR-PVT, which has course and speed instead of a velocity."""
    rows = found.rows(kind)
    if not len(rows):
        return None
    one = {name: rows[name].to_numpy() for name in rows}
    columns = {"time_s": _utc(rows), **_place(found, rows), "sd_velocity_m_s": one["s_acc"] * 1e-3}
    kinds, flags = rows["fix"].map(_FIXES).fillna(0.0).to_numpy(), one["flags"].astype(int)
    reasons: dict[str, Mask] = {
        "no fix": flags & 1 == 0,
        "time is not known to the receiver": (one["valid"] & 3) != 3,
    }
    carrier = flags >> 6 if kind == PVT else 0 * flags
    better = np.select([carrier == 2, carrier == 1, flags & 2 > 0], [6.0, 5.0, 4.0], kinds)
    columns["fix"] = np.where(kinds < 3, kinds, better)
    if kind == PVT:
        columns |= {name: one[f"vel_{name[2]}"] * 1e-3 for name in VELOCITY}
        columns["satellites"] = one["satellites"].astype(float)
        # So the receiver says that it has no place, in what older ones left at nothing.
        reasons["no position"] = (one["flags3"] & 1) > 0
    else:
        columns |= level_velocity(one["speed"] * 1e-3, one["course"] * 1e-5)
    return Stream(columns, one["which"], "message", reasons)


def _poses(found: UbxFrames, gnss: Stream) -> Stream | None:
    """Attitude of HNR-ATT at the positions of HNR-PVT, or of NAV-ATT at those of `gnss`."""
    place, kind = _of_pvt(found, HNR_PVT), HNR_ATT
    if place is None:
        place, kind = gnss, NAV_ATT
    turned = found.at(place.columns["time_log_s"], kind)
    if not turned["roll"].notna().any():
        return None
    columns = {
        name: values
        for name, values in place.columns.items()
        if name not in ("satellites", "fix", "hdop", "sd_velocity_m_s")
    }
    spreads = [turned[f"{name}_acc"].to_numpy(float) * 1e-5 for name in ("roll", "pitch", "heading")]
    for name, spread in zip(("roll", "pitch", "heading"), spreads, strict=True):
        # Without an accuracy there is no angle.
        angle = np.where(spread > 0, turned[name] * 1e-5, np.nan)
        columns["yaw_deg" if name == "heading" else f"{name}_deg"] = angle
    columns |= {"sd_tilt_deg": tilt_from_roll_pitch(*spreads[:2]), "sd_heading_deg": spreads[2]}
    fix = place.columns["fix"]
    kinds = {"no fix": place.unusable["no fix"] | (fix == 0), "estimated, not measured": fix == 1}
    return replace(place, columns=columns, unusable={**place.unusable, **kinds})


# -- GPX

#: Kinds of fix as GPX names them, as numbers.
_GPX_FIXES = {"none": 0.0, "2d": 2.0, "3d": 3.0, "dgps": 4.0, "pps": 3.0}
#: Our columns -> elements of a point.
_ELEMENTS = {
    "height_sea_m": "ele",
    "undulation_m": "geoidheight",
    "satellites": "sat",
    "hdop": "hdop",
    "speed": "speed",
    "course": "course",
}
_POINT = re.compile(r"<trkpt\b[^<>]*?(?:/>|>.*?</trkpt\s*>)", re.DOTALL)


def gpx_sniff(head: bytes) -> bool:
    """Whether a file begins as GPX."""
    return re.search(r"<(?:\w+:)?gpx[\s>]", text.decode(head[:-1] if len(head) % 2 else head)) is not None


def gpx_decode(path: Path, data: bytes, zone: str | None) -> RawLog:
    """The tracks of a GPX file, in order of time; rows are points as counted in the file.

    Raises
    ------
    WildlabError
        Where the file declares entities or a document type, or has no point of a track.
    """
    # What prefixes name is not read, and one that nobody declared would spoil its point.
    content = re.sub(r"<(/?)[\w.-]+:", r"<\1", text.xml_text(data, path))
    # Each piece is searched once, so that points that never end cost no more than others.
    pieces = re.split(r"(?=<trkpt\b)", content)[1:]
    columns = _gpx_columns(_points([point[0] for point in map(_POINT.match, pieces) if point]))
    placed = np.isfinite(columns["latitude_deg"] + columns["longitude_deg"])
    broken = len(pieces) - int(placed.sum())
    if not placed.any():
        problem = "has no point of a track" + (f"; {broken} are broken" if broken else "")
        raise WildlabError(problem, "export the recorded track", file=path)
    columns = {name: one[placed] for name, one in columns.items()}
    timed = int((columns["time_s"] >= GPS_START_S).sum())
    notes = ["no point carries a time that can be true"]
    return _in_order_of_time(
        RawLog(
            {"gnss": Stream(columns, 1 + np.arange(len(columns["time_s"])), "point")},
            clock=UTC_OF_LOG if timed else "",
            lost=told((broken, "point", f"of {len(pieces)} could not be read")),
            notes=[] if timed else notes,
        )
    )


def _in_order_of_time(found: RawLog) -> RawLog:
    """Some programs write the newest track first."""
    part = found.parts["gnss"]
    time = part.columns["time_s"]
    if not found.clock or not (np.diff(time) < 0).any():
        return found
    part = part.take(np.argsort(time, kind="stable"))
    return replace(found, parts={"gnss": part}, notes=[*found.notes, "rows were put in order of time"])


def _points(points: list[str]) -> list[Element]:
    """Points that can be read: halves are tried where a whole cannot be."""
    body = re.sub(r"\s[\w.-]+:[\w.-]+\s*=", " other=", "".join(points))
    try:
        return list(parse_xml(f"<points>{body}</points>".encode("utf-8", "replace")))
    except WildlabError:
        middle = len(points) // 2
        return _points(points[:middle]) + _points(points[middle:]) if middle else []


def _gpx_columns(points: Sequence[Element]) -> dict[str, Array]:
    def of(tag: str) -> list[str]:
        return [point.findtext(tag, "").strip() for point in points]

    time = np.array([_seconds(said) for said in of("time")])
    columns = {
        "time_s": time,
        "time_log_s": time,
        **{f"{one}itude_deg": numbers(point.get(one[:3]) for point in points) for one in ("lat", "long")},
        **{ours: numbers(of(tag)) for ours, tag in _ELEMENTS.items()},
        "fix": np.array([_GPX_FIXES.get(said, np.nan) for said in of("fix")]),
    }
    # GPX 1.0 knows speed in m/s and course from true north.
    return columns | level_velocity(columns.pop("speed"), columns.pop("course"))


def _seconds(said: str) -> float:
    try:
        at = datetime.fromisoformat(said)
        return (at if at.tzinfo is not None else at.replace(tzinfo=UTC)).timestamp()
    except (OverflowError, ValueError):
        return np.nan


# -- RTKLIB

#: Kind of fix by the quality: none, fixed, float, by satellite, differential, single, precise, estimated.
_QUALITY = pd.Series([0.0, 6.0, 5.0, 4.0, 4.0, 3.0, 8.0, 1.0])
_SPLIT = re.compile(r"[\s,;]+")
#: Words that only the line of the header with the names of columns has.
_NAMED = re.compile("latitude|x-ecef|e-baseline")
#: RTKLIB writes up to 22 columns; a header may not ask for a table of any width.
MOST_COLUMNS = 64


def pos_sniff(head: bytes) -> bool:
    """Whether a header names columns, or rows look as RTKLIB writes them."""
    lines = text.decode(head).splitlines()
    return any(one.startswith("%") and re.search(f"{_NAMED.pattern}|program   : RTK", one) for one in lines)


def pos_decode(path: Path, data: bytes, zone: str | None) -> RawLog:
    """Positions as RTKLIB wrote them, in order of time; rows are lines of the file.

    Raises
    ------
    WildlabError
        Where the solution is no latitude and longitude in GPST or UTC, its columns change within the file, or
        no row can be read.
    """
    lines = [(at, line.strip()) for at, line in enumerate(text.decode(data).split("\n"), 1) if line.strip()]
    comments = [line for _, line in lines if line.startswith("%")]
    cells = [(at, _SPLIT.split(line)) for at, line in lines if not line.startswith("%")]
    headers = {line for line in comments if _NAMED.search(line)}
    scale, *names = _SPLIT.split(next(iter(headers), "").strip(" \t\r%"))[:MOST_COLUMNS]
    if len(headers) > 1 or (headers and ("latitude(deg)" not in names or scale not in ("GPST", "UTC"))):
        problem = f"is a solution of the kind {' '.join([scale, *names[:2]])[:60]!r}"
        problem = "changes its columns within the file" if len(headers) > 1 else problem
        remedy = "write it with out-solformat = llh, out-degform = deg, out-timesys = gpst"
        raise WildlabError(problem, remedy, file=path, field="header")
    rows = [(at, time, row[2:]) for at, row in cells if len(row) > 4 and np.isfinite(time := _time(row))]
    bad = len(cells) - len(rows) if names else len(cells)
    if not rows or not names:
        problem = "has no position" + (f"; {plural(bad, 'line')} cannot be read" if bad else "")
        raise WildlabError(problem, "write it again with a header", file=path)
    flat = [cell for _, _, row in rows for cell in (row + [""] * len(names))[: len(names)]]
    values = named((name.partition("(")[0] for name in names), numbers(flat).reshape(len(rows), -1).T)

    def of(name: str) -> Array:
        return values.get(name, np.full(len(rows), np.nan))

    own = np.array([time for _, time, _ in rows])
    above_sea = any("height=" in line and "geodetic" in line for line in comments)
    quality = of("Q")
    known = pd.Series(quality).map(_QUALITY).to_numpy(float)
    fix = np.where(np.isfinite(quality) & np.isnan(known), 0.0, known)
    columns = {
        "time_s": gps_to_utc(own - GPS_START_S) if scale == "GPST" else own,
        "time_log_s": own,
        **{f"{name}_deg": of(name) for name in ("latitude", "longitude")},
        "height_sea_m" if above_sea else "height_ellipsoid_m": of("height"),
        "sd_horizontal_m": np.sqrt((of("sdn") ** 2 + of("sde") ** 2) / 2.0),
        "sd_vertical_m": of("sdu"),
        "satellites": of("ns"),
        "v_north_m_s": of("vn"),
        "v_east_m_s": of("ve"),
        "v_down_m_s": -of("vu"),
        "fix": fix,
    }
    return _in_order_of_time(
        RawLog(
            {"gnss": Stream(columns, np.array([at for at, _, _ in rows]), "line")},
            clock="GPS time of the rows" if scale == "GPST" else UTC_OF_LOG,
            lost=told((bad, "line", f"of {bad + len(rows)} could not be read")),
        )
    )


def _time(row: list[str]) -> float:
    """s since 1970 in the file's own scale, of a date and a clock, or of a week and a time in it, or NaN."""
    if "/" in row[0]:
        return stamp_s(" ".join(row[:2]))
    week, seconds = map(number, row[:2])
    fine = week.is_integer() and 0 <= seconds < WEEK_S and 0 <= week < 10000
    return GPS_START_S + week * WEEK_S + seconds if fine else np.nan


# -- Autoferry

#: Parts of the data set.
Part = Literal["frames", "lidar", "radar", "ir", "eo", "truth"]

#: `sensorID` as published, and what it stands for.
SENSORS = {1: "lidar", 2: "radar", 3: "ir", 4: "eo"}
CAMERAS = ("ir", "eo")
#: The published files have up to 0.6 MB.
MOST_BYTES = 64 << 20
#: No coordinate of a ferry's surroundings is further from its origin, m.
FURTHEST_M = 1e6


def read_part(path: Path, data: bytes, part: Part) -> tuple[dict[str, NDArray[Any]], Indices]:
    """Columns of one part of a file, and for each row the number of the frame in the file, counted from 1.

    A file of detections is a list of frames, each of one sensor at one time: where own ship was, and what the
    sensor saw from there. Cameras saw bearings from north (radians); lidar and radar saw points, metres north
    and east of own ship, as one list of norths and one of easts. MATLAB wrote it: a single bearing is a
    number, a single point a pair, and nothing at all an empty list. A file of truth repeats, for every frame,
    the last position of every target.

    ``frames``: ``frame`` (its name, as ``lidar-0007``), ``sensor``, ``time`` (s since 1970), ``north`` and
    ``east`` of own ship (m), in order of time. ``lidar``, ``radar``: ``frame``, ``north``, ``east`` of each
    point in the local frame, own ship's position at the stamp added. ``ir``, ``eo``: ``frame``, ``bearing``
    (rad). ``truth``: ``target``, ``time``, ``north``, ``east``, ``down``, each sample once, in order of
    target and time.

    Raises
    ------
    WildlabError
        Naming file, frame and field: not JSON, too large, another structure, a number that is none.
    """
    content = text.parse_json(data, path) if len(data) <= MOST_BYTES else None
    if not isinstance(content, list) or not content:
        problem = f"is no list of frames of at most {MOST_BYTES >> 20} MiB"
        raise WildlabError(problem, "copy the published file again", file=path)
    return _truth(content, path) if part == "truth" else _detections(content, part, path)


def _given(frame: Any, at: int, field: str, shape: Sequence[int], most: float, path: Path) -> Array:
    """The numbers of one field of a frame in a shape, within bounds."""
    try:
        values = np.array(frame[field], float).reshape(shape)
    except (KeyError, TypeError, ValueError, OverflowError):
        values = np.array(np.nan)
    if not (np.abs(values) <= most).all() or (field == "sensorID" and values.item() not in SENSORS):
        problem = f"frame {at} has {str(frame)[:60]!r}, which is not as published"
        raise WildlabError(problem, "copy the published file again", file=path, field=field)
    return values


def _detections(content: list[Any], part: Part, path: Path) -> tuple[dict[str, NDArray[Any]], Indices]:
    rows, seen = [], []
    for at, one in enumerate(content, 1):
        sensor = SENSORS[int(_given(one, at, "sensorID", (), 4, path))]
        time = float(_given(one, at, "time", (), 1e10, path))
        own = _given(one, at, "ownshipPosition", (2,), FURTHEST_M, path)
        shape, most = ((1, -1), 2 * np.pi) if sensor in CAMERAS else ((2, -1), FURTHEST_M)
        measured = _given(one, at, "measurement", shape, most, path).T
        seen.append(measured if sensor in CAMERAS else measured + own)
        rows.append((sensor, time, *own))
    table = pd.DataFrame(rows, columns=["sensor", "time", "north", "east"])
    # Frames of one sensor come in order; those of several do not everywhere.
    table = table.sort_values("time", kind="stable")
    counted = table.groupby("sensor").cumcount() + 1
    table["frame"] = table["sensor"] + counted.map("-{:04d}".format)
    if part == "frames":
        columns = {name: table[name].to_numpy() for name in ("frame", "sensor", "time", "north", "east")}
        return columns, table.index.to_numpy() + 1
    ours = table[table["sensor"] == part]
    measures = ("bearing",) if part in CAMERAS else ("north", "east")
    counts = [len(seen[at]) for at in ours.index]
    values = np.concatenate([np.empty((0, len(measures))), *(seen[at] for at in ours.index)])
    names = {"frame": np.repeat(ours["frame"].to_numpy(object), counts)}
    return names | named(measures, values.T), np.repeat(ours.index.to_numpy(), counts) + 1


def _truth(content: list[Any], path: Path) -> tuple[dict[str, NDArray[Any]], Indices]:
    names = ["target", "time", "north", "east", "down"]
    table = pd.DataFrame(
        [
            (
                str(int(_given(one, at, "targetID", (), 1000, path))),
                float(_given(one, at, "time", (), 1e10, path)),
                *_given(one, at, "position", (3,), FURTHEST_M, path),
                at,
            )
            for at, frame in enumerate(content, 1)
            for one in (frame if isinstance(frame, list) else [frame])
        ],
        columns=[*names, "row"],
    )
    table = table.drop_duplicates(names)
    twice = table.duplicated(["target", "time"])
    if twice.any():
        problem = f"the target is elsewhere at the same time in frame {table['row'][twice].iloc[0]}"
        raise WildlabError(problem, "copy the published file again", file=path, field="position")
    table = table.sort_values(["target", "time"])
    return {name: table[name].to_numpy() for name in names}, table["row"].to_numpy(np.int64)
