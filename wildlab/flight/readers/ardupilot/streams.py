"""Messages of ArduPilot as parts of a log, in all generations of their names."""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from wildlab.errors import WildlabError
from wildlab.flight.readers.ardupilot import motion
from wildlab.flight.readers.ardupilot.clock import (
    Times,
    longest_run,
    own_stamps,
    times,
    true_fix,
)
from wildlab.flight.readers.ardupilot.messages import Table
from wildlab.flight.readers.logs.log import RawLog, Stream
from wildlab.flight.readers.logs.places import placed

Array = NDArray[np.float64]

#: What an autopilot of this family calls itself, with its version.
_VEHICLE = re.compile(
    r"\b(?:Ardu\w+|APM:?\w+|AntennaTracker|Blimp|Rover|Sub)\s+V?\d[\w.()-]*(?: \([0-9a-f]+\))?"
)


# Damaged values may be anything: they are marked, not warned of.
@np.errstate(all="ignore")
def raw_log(
    path: Path, format_: str, tables: dict[str, Table], lost: Sequence[str], counted_in: str, title: str = ""
) -> RawLog:
    """A log of messages.

    Parameters
    ----------
    path
        Only for messages.
    format_
        As in `formats.FORMATS`.
    tables
        Messages by name.
    lost
        Sentences on what could not be read.
    counted_in
        What `Table.rows` counts.
    title
        What the file says of the vehicle outside of messages.

    Returns
    -------
    RawLog

    Raises
    ------
    WildlabError
        Where PX4 wrote it, or no message tells of motion or images.
    """
    if any(name in tables and tables[name].has(one) for name, one in (("ATT", "qw"), ("TIME", "StartTime"))):
        problem = "is a log of PX4's old format sdlog2, whose messages have other units under the same names"
        raise WildlabError(problem, "log with a newer PX4, as .ulg", file=path)
    tables, left_out = longest_run(tables)
    receivers = [one for one in motion.sensors(tables, ("GPS", "GPS2", "GPS3")) if one.has("Lat", "Lng")]
    receiver = next((one for one in receivers if true_fix(one).any()), receivers[0] if receivers else None)
    when = times(tables, receiver)
    parts: dict[str, Stream | None] = {}
    place = next(
        (one for name in ("POS", "AHR2", "XKF1", "NKF1") if (one := motion.place_of(name, tables, when))),
        None,
    )
    if receiver is not None:
        satellites = motion.gnss(receiver, tables, when, counted_in)
        parts["gnss"] = satellites
        if satellites is not None:
            place = place or motion.place_of_gnss(satellites, receiver, when)
    parts["poses"] = motion.poses(tables, when, place, counted_in)
    parts["imu"] = motion.imu(tables, when, counted_in)
    parts["magnetometer"] = motion.magnetometer(tables, when, counted_in)
    parts["gimbal"] = _gimbal(tables, when, counted_in)
    parts["triggers"] = _triggers(tables, when, counted_in)
    found = {name: part for name, part in parts.items() if part is not None}
    if not found:
        problem = "has no message of attitude, position, sensors or images"
        raise WildlabError(problem, "log these messages (LOG_BITMASK of the autopilot)", file=path)
    notes = _notes(tables, when, found, receivers, receiver, place)
    return RawLog(
        format_, found, _vehicle(tables, title), when.clock, (*lost, *filter(None, [left_out])), tuple(notes)
    )


def _vehicle(tables: dict[str, Table], title: str) -> str:
    said = [text for name, field in (("VER", "FWS"), ("MSG", "Message")) if name in tables
            for text in tables[name].texts(field)]  # fmt: skip
    for text in [*said, title]:
        if match := _VEHICLE.search(text):
            return match.group()
    return ""


def _gimbal(tables: dict[str, Table], when: Times, counted_in: str) -> Stream | None:
    """Where the first gimbal looks: against north and the horizon, and its yaw against the airframe."""
    found = [one for one in motion.sensors(tables, ("MNT", "MNT1", "MOUNT")) if one.has("Roll", "Pitch")]
    if not found:
        return None
    table = found[0]
    columns = {
        "roll_world_deg": table.numbers("Roll", unit="deg"),
        "pitch_world_deg": table.numbers("Pitch", unit="deg"),
    }
    if table.has("YawE"):
        columns["yaw_world_deg"] = table.numbers("YawE", unit="deg")
    if table.has("YawB"):
        columns["pan_deg"] = table.numbers("YawB", unit="deg")
    known = np.logical_and.reduce([np.isfinite(one) for one in columns.values()])
    return motion.stream(
        "gimbal", columns, when.of(table), when, table.rows, counted_in, {"no angle": ~known}
    )


def _triggers(tables: dict[str, Table], when: Times, counted_in: str) -> Stream | None:
    """When the camera took an image: messages CAM, else TRIG, of the first camera."""
    found = [one for one in motion.sensors(tables, ("CAM", "TRIG")) if one.has("Lat", "Lng")]
    if not found:
        return None
    table = found[0]
    # The first generation has only GPS time, of the fix before: the messages around tell more closely.
    stamps = when.of(table)
    get = table.numbers
    latitude, longitude = get("Lat", unit="deg"), get("Lng", unit="deg")
    # Before the first fix images have no place, but they were taken.
    known = placed(latitude, longitude)
    columns = {
        "latitude_deg": np.where(known, latitude, np.nan),
        "longitude_deg": np.where(known, longitude, np.nan),
    }
    if table.has("RelAlt"):
        # Without it, copters and planes meant different things by `Alt`.
        columns |= {"height_sea_m": get("Alt", unit="m"), "height_home_m": get("RelAlt", unit="m")}
    columns |= {
        "roll_deg": get("Roll", "R", unit="deg"),
        "pitch_deg": get("Pitch", "P", unit="deg"),
        "yaw_deg": get("Yaw", "Y", unit="deg"),
    }
    if table.has("Img"):
        columns["number"] = get("Img")
    return motion.stream("triggers", columns, stamps, when, table.rows, counted_in, {})


def _notes(
    tables: dict[str, Table],
    when: Times,
    found: dict[str, Stream],
    receivers: list[Table],
    receiver: Table | None,
    place: motion.Place | None,
) -> list[str]:
    notes = []
    unstamped = [
        name
        for name in ("GPS", "ATT", "IMU", "CAM", "TRIG")
        if name in tables and own_stamps(tables[name]) is None
    ]
    if unstamped and when.clock is not None:
        names = " and ".join(unstamped)
        notes.append(f"messages {names} carry no stamps: their times are those of the messages around them")
    if "imu" not in found:
        notes.append("it has no messages of an IMU: no rates of turn and no accelerations")
    if when.clock is None:
        notes.append("its messages carry no stamps")
    elif not when.clock.base:
        notes.append("no fix of a satellite receiver tells the time: its stamps are not known in UTC")
    if "poses" in found and place is not None:
        heights = [
            name for name, of in (("sea level", place.sea), ("home", place.home)) if np.isfinite(of).any()
        ]
        above = " and ".join(heights)
        notes.append(
            f"positions of poses are those of messages {place.name}; their heights count from {above}"
        )
    if receiver is not None and len(receivers) > 1:
        number = 1 + next(i for i, one in enumerate(receivers) if one is receiver)
        notes.append(f"it has {len(receivers)} satellite receivers; receiver {number} is used")
    if "triggers" in found and "height_sea_m" not in found["triggers"].columns:
        notes.append("heights of its messages CAM are left out: it does not say what they count from")
    return notes
