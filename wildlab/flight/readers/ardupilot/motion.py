"""What ArduPilot's messages say of its motion: poses, satellite positions, and the sensors."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from wildlab.flight.clocks import between
from wildlab.flight.readers.ardupilot.clock import FIX_3D, Times, gps_utc
from wildlab.flight.readers.ardupilot.messages import Table
from wildlab.flight.readers.logs.log import Stream
from wildlab.flight.readers.logs.order import in_order
from wildlab.flight.readers.logs.places import impossible_places, placed
from wildlab.flight.readers.logs.stamps import places_that_hold, running_stream
from wildlab.flight.readers.tracks.judging import NO_DILUTION
from wildlab.flight.schema import SPEED

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

#: Spreads of this and more are what 16 bits hold, not what a receiver found.
WORST_SPREAD_M = 655.0
#: Beyond these no sensor of a flying thing measures: m/s2, rad/s, microtesla.
MOST_FORCE, MOST_RATE, MOST_FIELD = 1000.0, 100.0, 1000.0
#: Columns of satellite positions that are there even where no row has a value.
_NEEDED = ("latitude_deg", "longitude_deg", "height_sea_m", "fix")
#: Metres of a step of 1e-7 deg of latitude, as ArduPilot takes it between degrees and metres.
_STEP_M = 0.011131884502145034


class Place(NamedTuple):
    """Positions by one kind of message: those rows that are true, in the order of their stamps.

    Attributes
    ----------
    name
        Of the messages.
    stamps
        (N,) s.
    latitude, longitude, sea, home
        (N,) deg, and m above mean sea level and where the vehicle was armed; NaN where not known.
    """

    name: str
    stamps: Array
    latitude: Array
    longitude: Array
    sea: Array
    home: Array


def sensors(tables: dict[str, Table], names: tuple[str, ...]) -> list[Table]:
    """One table per sensor, of messages by these names, in their order."""
    return [one for name in names if name in tables for one in tables[name].instances()]


def stream(
    part: str,
    columns: dict[str, Array],
    stamps: Array,
    times: Times,
    rows: NDArray[np.int64],
    counted_in: str,
    unusable: dict[str, Mask],
    utc: Array | None = None,
) -> Stream | None:
    """A part with its times, from stamps (N,); `utc` are times that the messages know better than these."""
    both = {"time_s": times.utc(stamps) if utc is None else utc, "time_log_s": stamps}
    return running_stream(part, both | columns, rows, counted_in, unusable)


def gnss(receiver: Table, tables: dict[str, Table], times: Times, counted_in: str) -> Stream | None:
    """Satellite positions of one receiver, with what messages GPA say of how sure it was."""
    get = receiver.numbers
    latitude, longitude, height = get("Lat", unit="deg"), get("Lng", unit="deg"), get("Alt", unit="m")
    speed, course, down = get("Spd", unit="m/s"), np.radians(get("GCrs", unit="deg")), get("VZ", unit="m/s")
    fix, hdop, stamps = get("Status"), get("HDop"), times.of(receiver)
    found = _accuracies(receiver, tables, stamps, down)
    columns = {
        **{"latitude_deg": latitude, "longitude_deg": longitude, "height_sea_m": height},
        **{"v_north_m_s": speed * np.cos(course), "v_east_m_s": speed * np.sin(course), "v_down_m_s": down},
        **{"satellites": get("NSats"), "fix": fix, "hdop": hdop},
        **found,
    }
    # What this generation does not log has no column.
    columns = {
        name: values for name, values in columns.items() if name in _NEEDED or np.isfinite(values).any()
    }
    week = get("GWk", "Week")
    impossible = impossible_places(columns)
    # Its parts to the north and east may each be possible.
    impossible["an impossible speed"] = impossible.get("an impossible speed", False) | (speed > SPEED[1])
    unusable = {
        "no fix": ~(fix >= FIX_3D - 1),
        "a fix without height": ~(fix >= FIX_3D),
        "no position": ~placed(latitude, longitude),
        "no GPS week": np.isfinite(week) & np.isnan(gps_utc(receiver)),
        "no dilution of precision": hdop >= NO_DILUTION,
        **impossible,
    }
    utc = times.utc_of_fixes(receiver)
    return stream("gnss", columns, stamps, times, receiver.rows, counted_in, unusable, utc)


def _accuracies(receiver: Table, tables: dict[str, Table], stamps: Array, down: Array) -> dict[str, Array]:
    """Columns from the messages GPA of the same receiver, which have the stamps of its GPS messages."""
    instance = receiver.numbers("I")[:1]
    names = ("GPA",) if receiver.name == "GPS" else ("GPA" + receiver.name[3:], "GPA2")
    for table in sensors(tables, names):
        if np.isfinite(instance).any() and table.numbers("I")[0] != instance[0]:
            continue
        theirs = times_us(table)
        order = np.argsort(theirs, kind="stable")
        wanted = np.nan_to_num(np.round(stamps * 1e6), nan=-1.0)
        at = order[np.clip(np.searchsorted(theirs[order], wanted), 0, len(order) - 1)]
        met = theirs[at] == wanted

        def column(
            name: str, most: float, at: NDArray[np.intp] = at, met: Mask = met, table: Table = table
        ) -> Array:
            values = table.numbers(name)[at]
            return np.where(met & (values != 0) & (np.abs(values) < most), values, np.nan)

        made = {
            "sd_horizontal_m": column("HAcc", WORST_SPREAD_M),
            "sd_vertical_m": column("VAcc", WORST_SPREAD_M),
            "sd_velocity_m_s": column("SAcc", WORST_SPREAD_M),
            # A receiver that has no vertical velocity is logged with one of 0.
            "v_down_m_s": np.where(met & (table.numbers("VV")[at] == 0), np.nan, down),
            # ArduPilot has it the other way round: sea level minus ellipsoid.
            "undulation_m": -column("Und", 200.0),
        }
        return {name: values for name, values in made.items() if np.isfinite(values).any()}
    return {}


def times_us(table: Table) -> Array:
    """(N,) stamps of messages in whole microseconds; -2 where there is none."""
    us = table.numbers("TimeUS") if table.has("TimeUS") else 1e3 * table.numbers("TimeMS")
    return np.where(np.isfinite(us), np.round(us), -2.0)


def imu(tables: dict[str, Table], times: Times, counted_in: str) -> Stream | None:
    """Specific force and rates of turn of the first IMU; None where the log has none."""
    whole = [one for one in sensors(tables, ("IMU", "IMU2", "IMU3")) if one.has("GyrX", "AccX")]
    force = sensors(tables, ("ACC", "ACC1", "ACC2", "ACC3"))
    turn = sensors(tables, ("GYR", "GYR1", "GYR2", "GYR3"))
    if whole:
        table = whole[0]
        f = np.column_stack([table.numbers(f"Acc{axis}", unit="m/s2") for axis in "XYZ"])
        w = np.column_stack([table.numbers(f"Gyr{axis}", unit="rad/s") for axis in "XYZ"])
    elif force and turn:
        table = turn[0]
        w = np.column_stack([table.numbers(f"Gyr{axis}", unit="rad/s") for axis in "XYZ"])
        f = np.column_stack([force[0].numbers(f"Acc{axis}", unit="m/s2") for axis in "XYZ"])
        f = moved(times.of(force[0]), f, times.of(table), f"messages {force[0].name}")
    else:
        return None
    columns = {f"f_{axis}_m_s2": f[:, i] for i, axis in enumerate("xyz")}
    columns |= {f"w_{axis}_rad_s": w[:, i] for i, axis in enumerate("xyz")}
    unusable = {
        "no value": ~(np.isfinite(f).all(axis=1) & np.isfinite(w).all(axis=1)),
        "beyond any sensor": np.any(np.abs(f) > MOST_FORCE, axis=1) | np.any(np.abs(w) > MOST_RATE, axis=1),
    }
    return stream("imu", columns, times.of(table), times, table.rows, counted_in, unusable)


def magnetometer(tables: dict[str, Table], times: Times, counted_in: str) -> Stream | None:
    """The field that the first compass found; None where the log has none."""
    found = [one for one in sensors(tables, ("MAG", "MAG2", "MAG3")) if one.has("MagX", "MagY", "MagZ")]
    if not found:
        return None
    field = np.column_stack([found[0].numbers(f"Mag{axis}", unit="uT") for axis in "XYZ"])
    columns = {f"field_{axis}_ut": field[:, i] for i, axis in enumerate("xyz")}
    unusable = {
        "no value": ~np.isfinite(field).all(axis=1) | (field == 0).all(axis=1),
        "beyond any sensor": (np.abs(field) > MOST_FIELD).any(axis=1),
    }
    return stream("magnetometer", columns, times.of(found[0]), times, found[0].rows, counted_in, unusable)


def moved(stamps: Array, values: Array, to: Array, what: str) -> Array:
    """Values (N, K) of stamps (N,) at other ones (T,), linear in time; none across a gap or beside a NaN."""
    kept = in_order(stamps)
    if kept.sum() == 0:
        return np.full((len(to), values.shape[1]), np.nan)
    return between(stamps[kept], values[kept], to, what)


def place_of(name: str, tables: dict[str, Table], times: Times) -> Place | None:
    """True positions by messages POS, AHR2, or XKF1 and NKF1 with the origin of ORGN; None where none is."""
    if name not in tables or not (one := tables[name].instances()):
        return None
    table = one[0]
    stamps = times.of(table)
    if name in ("XKF1", "NKF1"):
        found = _from_origin(table, tables, times, stamps)
        if found is None:
            return None
        latitude, longitude, sea = found
        home = np.full(len(stamps), np.nan)
    else:
        latitude, longitude = table.numbers("Lat", unit="deg"), table.numbers("Lng", unit="deg")
        sea = table.numbers("Alt", unit="m")
        home = table.numbers("RelHomeAlt", "RelAlt", unit="m")
        if table.has("RelOriginAlt"):
            # Before the filter has its origin, heights count from nothing.
            nowhere = np.isnan(table.numbers("RelOriginAlt"))
            sea, home = np.where(nowhere, np.nan, sea), np.where(nowhere, np.nan, home)
    where = {"latitude_deg": latitude, "longitude_deg": longitude, "height_sea_m": sea}
    kept = places_that_hold(stamps, where, ~(np.isfinite(sea) | np.isfinite(home)))
    if not kept.any():
        return None
    return Place(name, stamps[kept], latitude[kept], longitude[kept], sea[kept], home[kept])


def place_of_gnss(part: Stream, receiver: Table, times: Times) -> Place | None:
    """Positions of the satellite receiver; heights above home where its messages have the autopilot's."""
    stamps = times.stamp_of(part.columns["time_s"])
    stamps = stamps if np.isfinite(stamps).any() else part.columns["time_log_s"]
    used = part.used & np.isfinite(stamps)
    if not used.any():
        return None
    names = ("latitude_deg", "longitude_deg", "height_sea_m")
    latitude, longitude, sea = (part.columns[one][used] for one in names)
    home = receiver.numbers("RelAlt", "RAlt", unit="m")[used]
    return Place(receiver.name, stamps[used], latitude, longitude, sea, home)


def _from_origin(
    table: Table, tables: dict[str, Table], times: Times, stamps: Array
) -> tuple[Array, ...] | None:
    if "ORGN" not in tables:
        return None
    origins = tables["ORGN"]
    # Type 0 is where the filter counts from; 1 is home.
    origins = origins.take(origins.numbers("Type") == 0) if origins.has("Type") else origins
    latitude, longitude = origins.numbers("Lat", unit="deg"), origins.numbers("Lng", unit="deg")
    since = times.of(origins)
    kept = in_order(since, placed(latitude, longitude))
    if not kept.any():
        return None
    at = np.maximum(np.searchsorted(since[kept], stamps, side="right") - 1, 0)
    latitude_0, longitude_0 = latitude[kept][at], longitude[kept][at]
    north, east, down = (table.numbers(one, unit="m") for one in ("PN", "PE", "PD"))
    step = north / _STEP_M * 1e-7
    # The width of a degree halfway, as the autopilot has it: so its own degrees come back.
    width = np.maximum(np.cos(np.radians(latitude_0 + step / 2)), 0.01)
    return (
        latitude_0 + step,
        longitude_0 + east / _STEP_M * 1e-7 / width,
        origins.numbers("Alt")[kept][at] - down,
    )


def poses(tables: dict[str, Table], times: Times, place: Place | None, counted_in: str) -> Stream | None:
    """Attitudes with the positions at their times; None where the log has no attitude.

    Attitudes are those of messages ATT, else quaternions of XKQ or NKQ, else of AHR2.
    """
    ways: list[tuple[tuple[str, ...], tuple[str, ...], Callable[[Table], dict[str, Array]]]] = [
        (("ATT",), ("Roll", "Pitch", "Yaw"), _angles),
        (("XKQ", "XKQ1", "NKQ", "NKQ1", "XKQ2", "NKQ2"), ("Q1", "Q2", "Q3", "Q4"), _quaternion),
        (("AHR2", "AHRS"), ("Roll", "Pitch", "Yaw"), _angles),
    ]
    found = (
        (one, made(one)) for names, fields, made in ways for one in sensors(tables, names) if one.has(*fields)
    )
    table, columns = next(found, (None, {}))
    if table is None:
        return None
    stamps = times.of(table)
    known = np.logical_and.reduce([np.isfinite(one) for one in columns.values()])
    if "q_w" in columns:
        norm = np.sqrt(sum(np.square(one) for one in columns.values()))
        known &= np.abs(norm - 1) < 0.01
    turned = np.logical_or.reduce([np.abs(one) > 361 for one in columns.values()])
    unusable: dict[str, Mask] = {"no attitude": ~known, "angle beyond a full turn": turned}
    where = _at(place, stamps)
    unusable["no position at that time"] = ~np.isfinite(where["latitude_deg"])
    heights = [one for one in ("height_sea_m", "height_home_m") if np.isfinite(where[one]).any()]
    unusable["no height at that time"] = ~np.logical_or.reduce(
        [np.isfinite(where[one]) for one in heights] or [np.zeros(len(stamps), bool)]
    )
    columns |= {name: where[name] for name in ("latitude_deg", "longitude_deg", *heights)}
    columns |= _velocities(tables, times, stamps)
    return stream("poses", columns, stamps, times, table.rows, counted_in, unusable)


def _angles(table: Table) -> dict[str, Array]:
    return {f"{one.lower()}_deg": table.numbers(one, unit="deg") for one in ("Roll", "Pitch", "Yaw")}


def _quaternion(table: Table) -> dict[str, Array]:
    return {f"q_{axis}": table.numbers(f"Q{i}") for i, axis in enumerate("wxyz", start=1)}


def _at(place: Place | None, stamps: Array) -> dict[str, Array]:
    names = ("latitude_deg", "longitude_deg", "height_sea_m", "height_home_m")
    if place is None:
        return {name: np.full(len(stamps), np.nan) for name in names}
    turned = np.unwrap(place.longitude, period=360.0)
    values = between(
        place.stamps,
        np.column_stack([place.latitude, turned, place.sea, place.home]),
        stamps,
        f"messages {place.name}",
    )
    values[:, 1] = (values[:, 1] + 180) % 360 - 180
    return {name: values[:, i] for i, name in enumerate(names)}


def _velocities(tables: dict[str, Table], times: Times, stamps: Array) -> dict[str, Array]:
    for table in sensors(tables, ("XKF1", "NKF1", "EKF1")):
        if table.has("VN", "VE", "VD"):
            v = np.column_stack([table.numbers(one, unit="m/s") for one in ("VN", "VE", "VD")])
            v = moved(times.of(table), v, stamps, f"messages {table.name}")
            return {f"v_{one}_m_s": v[:, i] for i, one in enumerate(("north", "east", "down"))}
    return {}
