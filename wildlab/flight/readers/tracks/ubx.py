"""u-blox UBX: positions (`gnss`), and where the receiver knows how it is turned, `poses`.

NAV-PVT says all of a position; older receivers say it in NAV-POSLLH, NAV-VELNED and NAV-TIMEGPS or NAV-SOL of
one time of week. NAV-HPPOSLLH adds digits. Receivers with dead reckoning say HNR-PVT and HNR-ATT often.
UTC is the receiver's own, leap seconds and all; where it has none it comes from weeks and the table.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from wildlab.errors import WildlabError
from wildlab.flight.readers.logs.log import Array, Clock, RawLog, Stream, make_stream
from wildlab.flight.readers.tracks import nmea
from wildlab.flight.readers.tracks.judging import Mask, gaps, judge, plural
from wildlab.flight.readers.tracks.ubx_frames import Rows, UbxFrames, between, frames, rows
from wildlab.flight.time.fitting import fit_clock
from wildlab.flight.time.leap_seconds import WEEK_S, week_to_utc
from wildlab.geometry.attitude_uncertainty import tilt_from_roll_pitch

Index = NDArray[np.int64]
_PVT, _POSLLH, _HPPOSLLH, _VELNED = (0x01, 0x07), (0x01, 0x02), (0x01, 0x14), (0x01, 0x12)
_TIMEGPS, _TIMEUTC, _SOL, _STATUS, _DOP = (0x01, 0x20), (0x01, 0x21), (0x01, 0x06), (0x01, 0x03), (0x01, 0x04)
_NAV_ATT, _HNR_ATT, _HNR_PVT = (0x01, 0x05), (0x28, 0x01), (0x28, 0x00)
#: Kinds of fix: none, dead reckoning alone, plane, space, both together, time alone.
_FIXES = np.array([0.0, 1.0, 2.0, 3.0, 3.0, 0.0])
_TEXT = bytes(range(32, 127)) + b"\t\r\n"


def recognise(head: bytes, name: str) -> bool:
    """Whether a message with the right checksum is among the first bytes."""
    return len(frames(head).start) > 0


def read(path: Path, data: bytes, zone: str | None = None) -> RawLog:
    """A log of a u-blox receiver; text and NMEA between the messages do no harm.

    Parameters
    ----------
    path
        Only for messages.
    data
        The whole file.
    zone
        Not needed: the receiver has UTC.

    Returns
    -------
    RawLog
        ``gnss``, and ``poses`` where attitudes are known; rows are messages of UBX, counted from 1.

    Raises
    ------
    WildlabError
        Where no message has a position, nor any sentence of NMEA.
    """
    found = frames(data)
    rest = between(data, found)
    lost = _lost(found, rest)
    sentences = nmea.sentences(rest)
    gnss = _of_pvt(data, found, _PVT) or _of_old(data, found) or _of_pvt(data, found, _HNR_PVT)
    if gnss is None:
        made = nmea.tracks(sentences)
        if made is None:
            problem = f"{plural(len(found.start), 'message')} of u-blox, and none with a position"
            raise WildlabError(problem, "log UBX-NAV-PVT of the receiver", file=path)
        notes = ("no message of UBX has a position: sentences of NMEA do, counted without them", *made.notes)
        return RawLog("ubx", made.parts, clock=made.clock, lost=(*lost, *made.lost), notes=notes)
    parts = {"gnss": gnss}
    if poses := _poses(data, found, gnss):
        parts["poses"] = poses
    notes = tuple(gaps(gnss.columns["time_s"], gnss.used))
    if sentences.kind:
        notes += (f"{plural(len(sentences.kind), 'sentence')} of NMEA left aside",)
    return RawLog("ubx", parts, clock=_clock(gnss), lost=lost, notes=notes)


def _lost(found: UbxFrames, rest: bytes) -> tuple[str, ...]:
    strange = len(rest.translate(None, _TEXT))
    said = []
    if found.broken:
        said.append(f"{plural(found.broken, 'message')} with a wrong checksum or cut off")
    if strange:
        said.append(f"{plural(strange, 'byte')} of no message of UBX and of no text")
    return tuple(said)


def _clock(stream: Stream) -> Clock | None:
    own, time = stream.columns["time_log_s"][stream.used], stream.columns["time_s"][stream.used]
    if not np.isfinite(own * time).any():
        return None
    fit = fit_clock(own, time)
    largest = float(np.nanmax(np.abs(fit.residual)))
    return Clock(
        "UTC of the log", fit.rate, fit.offset_s, fit.spread_s, largest, int(fit.used.sum()), fit.rate_sd
    )


def _weeks_through(itow: NDArray[Any]) -> Array:
    """Time of week in s, going on where a week ends."""
    seconds = itow.astype(float) / 1000.0
    steps = np.diff(seconds, prepend=seconds[:1])
    return np.asarray(seconds - WEEK_S * np.cumsum(np.round(steps / WEEK_S)))


def _utc(row: Rows) -> Array:
    """s since 1970 of a calendar date with ns, which may be negative; NaN where it is no date."""
    month, day = row["month"].astype(int), row["day"].astype(int)
    fine = (month >= 1) & (month <= 12) & (day >= 1) & (row["hour"] < 24) & (row["minute"] < 60)
    fine &= (row["second"] <= 60) & (np.abs(row["nano"].astype(np.int64)) <= 10**9)
    months = (row["year"].astype(int) - 1970) * 12 + np.where(fine, month, 1) - 1
    first = months.astype("datetime64[M]").astype("datetime64[D]").astype(int)
    after = (months + 1).astype("datetime64[M]").astype("datetime64[D]").astype(int)
    fine &= day <= after - first
    clock = row["hour"] * 3600.0 + row["minute"] * 60.0 + row["second"] + row["nano"] * 1e-9
    return np.where(fine, (first + day - 1) * 86400.0 + clock, np.nan)


def _at(own: Array, other: Array, values: NDArray[Any]) -> Array:
    """Values of the messages of the same time of week, NaN where there is none."""
    result = np.full(len(own), np.nan)
    if len(other):
        order = np.argsort(other, kind="stable")
        place = np.minimum(np.searchsorted(other[order], own), len(other) - 1)
        same = other[order][place] == own
        result[same] = values[order][place][same]
    return result


def _place(row: Rows) -> dict[str, Array]:
    columns = {
        "latitude_deg": row["lat"] * 1e-7,
        "longitude_deg": row["lon"] * 1e-7,
        "height_ellipsoid_m": row["height"] * 1e-3,
        "height_sea_m": row["sea"] * 1e-3,
        "sd_horizontal_m": row["h_acc"] * 1e-3,
        "sd_vertical_m": row["v_acc"] * 1e-3,
    }
    columns["undulation_m"] = columns["height_ellipsoid_m"] - columns["height_sea_m"]
    return columns


def _more_digits(data: bytes, found: UbxFrames, columns: dict[str, Array]) -> None:
    row, _ = rows(data, found, _HPPOSLLH)
    if not len(row):
        return
    own, other = columns["time_log_s"], _weeks_through(row["itow"])
    valid = (row["flags"] & 1) == 0
    finer = {
        "latitude_deg": row["lat"] * 1e-7 + row["lat_hp"] * 1e-9,
        "longitude_deg": row["lon"] * 1e-7 + row["lon_hp"] * 1e-9,
        "height_ellipsoid_m": row["height"] * 1e-3 + row["height_hp"] * 1e-4,
        "height_sea_m": row["sea"] * 1e-3 + row["sea_hp"] * 1e-4,
        "sd_horizontal_m": row["h_acc"] * 1e-4,
        "sd_vertical_m": row["v_acc"] * 1e-4,
    }
    for name, values in finer.items():
        fine = _at(own, other, np.where(valid, values, np.nan))
        columns[name] = np.where(np.isfinite(fine), fine, columns[name])
    columns["undulation_m"] = columns["height_ellipsoid_m"] - columns["height_sea_m"]


def _of_pvt(data: bytes, found: UbxFrames, kind: tuple[int, int]) -> Stream | None:
    """`gnss` of NAV-PVT, or of HNR-PVT, which has course and speed instead of a velocity."""
    row, which = rows(data, found, kind)
    if not len(row):
        return None
    columns = {"time_s": _utc(row), "time_log_s": _weeks_through(row["itow"]), **_place(row)}
    kinds = _FIXES[np.minimum(row["fix"], 5)]
    flags = row["flags"].astype(int)
    reasons: dict[str, Mask] = {}
    if kind == _PVT:
        columns |= {f"v_{axis}_m_s": row[f"vel_{axis[0]}"] * 1e-3 for axis in ("north", "east", "down")}
        columns["satellites"] = row["satellites"].astype(float)
        carrier = flags >> 6
        columns["fix"] = np.where(
            kinds < 3, kinds, np.select([carrier == 2, carrier == 1, flags & 2 > 0], [6.0, 5.0, 4.0], kinds)
        )
        dop, _ = rows(data, found, _DOP)
        if len(dop):
            times = _weeks_through(dop["itow"])
            columns["hdop"] = _at(columns["time_log_s"], times, dop["hdop"] * 0.01)
        _more_digits(data, found, columns)
        # So the receiver says that it has no place, in what older ones left at nothing.
        reasons["no position"] = (row["flags3"] & 1) > 0
    else:
        course = np.radians(row["course"] * 1e-5)
        columns["v_north_m_s"] = row["speed"] * 1e-3 * np.cos(course)
        columns["v_east_m_s"] = row["speed"] * 1e-3 * np.sin(course)
        columns["fix"] = np.where((kinds == 3) & (flags & 2 > 0), 4.0, kinds)
    columns["sd_velocity_m_s"] = row["s_acc"] * 1e-3
    estimated = row["fix"] == 1
    reasons = {
        "no fix": ((kinds < 2) & ~estimated) | (flags & 1 == 0),
        "estimated, not measured": estimated,
        "time is not known to the receiver": (row["valid"] & 3) != 3,
        **reasons,
    }
    return make_stream("gnss", columns, which, "message", judge(columns, reasons))


def _of_old(data: bytes, found: UbxFrames) -> Stream | None:
    row, which = rows(data, found, _POSLLH)
    if not len(row):
        return None
    own = _weeks_through(row["itow"])
    columns = {"time_s": _weeks_to_utc(data, found, own), "time_log_s": own, **_place(row)}
    velocity, _ = rows(data, found, _VELNED)
    if len(velocity):
        times = _weeks_through(velocity["itow"])
        for axis in ("north", "east", "down"):
            columns[f"v_{axis}_m_s"] = _at(own, times, velocity[f"vel_{axis[0]}"] * 1e-2)
        columns["sd_velocity_m_s"] = _at(own, times, velocity["s_acc"] * 1e-2)
    reasons: dict[str, Mask] = {}
    for kind in (_STATUS, _SOL):
        status, _ = rows(data, found, kind)
        if not len(status):
            continue
        times = _weeks_through(status["itow"])
        said = _at(own, times, status["fix"])
        ok = _at(own, times, (status["flags"] & 1).astype(float))
        kinds = np.where(np.isnan(said), np.nan, _FIXES[np.clip(np.nan_to_num(said), 0, 5).astype(int)])
        columns["fix"] = kinds
        reasons["no fix"] = ((kinds < 2) & (said != 1)) | (ok == 0)
        reasons["estimated, not measured"] = said == 1
        if kind == _SOL:
            columns["satellites"] = _at(own, times, status["satellites"])
    dop, _ = rows(data, found, _DOP)
    if len(dop):
        columns["hdop"] = _at(own, _weeks_through(dop["itow"]), dop["hdop"] * 0.01)
    _more_digits(data, found, columns)
    return make_stream("gnss", columns, which, "message", judge(columns, reasons))


def _weeks_to_utc(data: bytes, found: UbxFrames, own: Array) -> Array:
    """UTC of times of week, by the nearest message that knows both."""
    pairs: list[tuple[Array, Array]] = []
    row, _ = rows(data, found, _TIMEUTC)
    valid = (row["valid"] & 4) > 0
    pairs.append((_weeks_through(row["itow"])[valid], _utc(row)[valid]))
    for kind, field in ((_TIMEGPS, "valid"), (_SOL, "flags")):
        row, _ = rows(data, found, kind)
        # Both bits: the week and the time in it; they stand at different places.
        bits = 3 if kind == _TIMEGPS else 12
        valid = (row[field] & bits) == bits
        seconds = row["itow"] * 1e-3 + row["ftow"] * 1e-9
        pairs.append((_weeks_through(row["itow"])[valid], week_to_utc(row["week"], seconds)[valid]))
    for stamps, utc in pairs:
        known = np.isfinite(utc)
        if not known.any():
            continue
        order = np.argsort(stamps[known], kind="stable")
        stamps, utc = stamps[known][order], utc[known][order]
        after = np.clip(np.searchsorted(stamps, own), 0, len(stamps) - 1)
        before = np.maximum(after - 1, 0)
        nearest = np.where(np.abs(stamps[after] - own) <= np.abs(own - stamps[before]), after, before)
        return np.asarray(utc[nearest] + own - stamps[nearest])
    return np.full(len(own), np.nan)


def _poses(data: bytes, found: UbxFrames, gnss: Stream) -> Stream | None:
    """Attitude of HNR-ATT at the positions of HNR-PVT, or of NAV-ATT at those of `gnss`."""
    place = gnss
    row, _ = rows(data, found, _HNR_ATT)
    if len(row):
        place = _of_pvt(data, found, _HNR_PVT) or gnss
    else:
        row, _ = rows(data, found, _NAV_ATT)
    if not len(row):
        return None
    own, times = place.columns["time_log_s"], _weeks_through(row["itow"])
    columns = {
        name: values
        for name, values in place.columns.items()
        if name not in ("use", "why", "satellites", "fix", "hdop", "sd_velocity_m_s")
    }
    for name, field in (("roll", "roll"), ("pitch", "pitch"), ("yaw", "heading")):
        # Without an accuracy there is no angle.
        angle = np.where(row[f"{field}_acc"] > 0, row[field] * 1e-5, np.nan)
        columns[f"{name}_deg"] = _at(own, times, angle)
    roll, pitch, heading = (row[f"{field}_acc"] * 1e-5 for field in ("roll", "pitch", "heading"))
    columns["sd_tilt_deg"] = _at(own, times, tilt_from_roll_pitch(roll, pitch))
    columns["sd_heading_deg"] = _at(own, times, heading)
    angles = np.column_stack([columns[f"{name}_deg"] for name in ("roll", "pitch", "yaw")])
    why = place.columns["why"]
    reasons = {str(reason): why == reason for reason in dict.fromkeys(why) if reason}
    reasons["no attitude"] = np.isnan(angles).any(axis=1)
    reasons["impossible attitude"] = (np.abs(angles) > 360.0).any(axis=1)
    return make_stream("poses", columns, place.rows, "message", reasons)
