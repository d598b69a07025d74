"""MAVLink telemetry log (``.tlog``): what a ground station received, each frame behind its time of receipt.

Times are the vehicle's own (since it was switched on), brought to UTC by `tlog_clock`. One vehicle is read,
that which sent most attitudes; ground stations and other vehicles are named in the notes.
"""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np

from wildlab.errors import WildlabError
from wildlab.flight.files import printable
from wildlab.flight.readers.logs.log import RawLog
from wildlab.flight.readers.mavlink.clock import find_boot
from wildlab.flight.readers.mavlink.frames import MavlinkFrames, may_hold, messages, names, walk
from wildlab.flight.readers.mavlink.streams import read_parts

#: So many sound frames say what a file is, where its name does not.
ENOUGH = 3
#: MAV_AUTOPILOT_INVALID and MAV_TYPE_GCS: what is no autopilot says so in its heartbeat.
_NO_AUTOPILOT, _GROUND_STATION = 8, 6
#: What vehicles are known by, best first.
_FLIES = ("ATTITUDE", "GLOBAL_POSITION_INT", "GPS_RAW_INT")
_FIRMWARE = re.compile(r"^(Ardu\w+|APM:?\w*|PX4|AntennaTracker|Blimp)\b.*\d")


def recognise(head: bytes, name: str) -> bool:
    """Whether a file that begins with `head` is such a log; its name only makes up for a short beginning."""
    if not may_hold(head):
        return False
    found = len(walk(head).at)
    return found >= ENOUGH or (found > 0 and name.lower().endswith(".tlog"))


def read(path: Path, data: bytes, zone: str | None = None) -> RawLog:
    """A telemetry log.

    Parameters
    ----------
    path
        Only for messages.
    data
        The whole file.
    zone
        Not needed: receipts are in UTC.

    Returns
    -------
    RawLog

    Raises
    ------
    WildlabError
        Where it holds no sound frame, or no vehicle.
    """
    frames = walk(data)
    if not len(frames.at):
        raise WildlabError(
            "holds no sound MAVLink frame behind a time of receipt",
            "give the .tlog that the ground station wrote",
            file=path,
        )
    vehicles, stations = _systems(frames)
    if not vehicles:
        raise WildlabError(
            f"holds {len(frames.at)} messages, and none of attitude or position",
            "give the log of the flight itself",
            file=path,
        )
    (system, component), *others = vehicles
    boot = find_boot(frames, system, component)
    parts, notes = read_parts(frames, system, component, boot)
    if others:
        said = ", ".join(f"{one}" for one, _ in others)
        notes = [f"it holds several vehicles: system {system} is read, not {said}", *notes]
    if stations:
        said = ", ".join(map(str, sorted(stations)))
        notes = [*notes, f"left out as no vehicles: system {said}"]
    return RawLog(
        "tlog",
        parts,
        _vehicle(frames, system, component),
        boot.clock if boot else None,
        tuple(_lost(frames)),
        (*(boot.notes if boot else ()), *notes),
    )


def _systems(frames: MavlinkFrames) -> tuple[list[tuple[int, int]], set[int]]:
    """(system, component) of the autopilots, the busiest first, and systems that are none."""
    beats = messages(frames, "HEARTBEAT")
    no = (beats["autopilot"] == _NO_AUTOPILOT) | (beats["type"] == _GROUND_STATION)
    known = set(zip(beats.system.tolist(), beats.component.tolist(), strict=True))
    autopilots = set(zip(beats.system[~no].tolist(), beats.component[~no].tolist(), strict=True))
    counts: dict[tuple[int, int], tuple[int, ...]] = {}
    for place, name in enumerate(_FLIES):
        found = messages(frames, name)
        whose, many = np.unique(np.stack([found.system, found.component]), axis=1, return_counts=True)
        for one, count in zip(map(tuple, whose.T.tolist()), many.tolist(), strict=True):
            if one in autopilots or one not in known:
                had = counts.get(one, (0,) * len(_FLIES))
                counts[one] = (*had[:place], count, *had[place + 1 :])
    # A heartbeat says more than none: without it a component may forward what others sent.
    order = sorted(counts, key=lambda one: (one in autopilots, counts[one]), reverse=True)
    first: dict[int, tuple[int, int]] = {}
    for one in order:
        first.setdefault(one[0], one)
    everyone = set(np.unique(frames.system).tolist())
    return list(first.values()), everyone - set(first)


def _vehicle(frames: MavlinkFrames, system: int, component: int) -> str:
    texts = messages(frames, "STATUSTEXT", system, component)
    for text in texts.texts("text"):
        if _FIRMWARE.match(text):
            return printable(text)
    beats = messages(frames, "HEARTBEAT", system, component)
    if not len(beats):
        return ""
    kind = names("MAV_TYPE", int(beats["type"][0]))
    said = [names("MAV_AUTOPILOT", int(beats["autopilot"][0]))]
    version = messages(frames, "AUTOPILOT_VERSION", system, component)
    if len(version) and (number := int(version["flight_sw_version"][0])):
        said.append(".".join(str(number >> shift & 255) for shift in (24, 16, 8)))
    return " ".join(one for one in (*said, kind and f"({kind})") if one)


def _lost(frames: MavlinkFrames) -> list[str]:
    total = len(frames.data)
    lost = []
    if frames.damaged:
        lost.append(f"{frames.damaged} frames with a wrong checksum are left out, {len(frames.at)} are read")
    if frames.skipped:
        lost.append(
            f"{frames.skipped} of {total} bytes in {frames.places} places are no frames and are left out"
        )
    if frames.rest:
        lost.append(f"it ends within a frame: the last {frames.rest} of {total} bytes are left out")
    if frames.unknown:
        kinds = ", ".join(str(one) for one in sorted(frames.unknown)[:8])
        more = f" and {len(frames.unknown) - 8} more" if len(frames.unknown) > 8 else ""
        many = sum(frames.unknown.values())
        lost.append(f"{many} messages of kinds that are not known (numbers {kinds}{more}) are left out")
    return lost
