"""PX4 ULog (``.ulg``), with the field names of old and new firmware, by pyulog.

Only what `ulog_frames` has found sound is given to pyulog. Stamps count since the start of the system, in us;
UTC comes from pairs of them with the receiver's (``time_utc_usec``).
"""

from __future__ import annotations

import contextlib
import io
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from wildlab.errors import WildlabError
from wildlab.flight.files import printable
from wildlab.flight.readers.logs.log import Clock, RawLog
from wildlab.flight.readers.px4.frames import MAGIC, Sound, sound_part
from wildlab.flight.readers.px4.streams import TOPICS, read_parts
from wildlab.flight.readers.px4.topics import Topic
from wildlab.flight.time.fitting import ClockFit
from wildlab.flight.time.steady import fit_steady

Array = NDArray[np.float64]

#: 2000 and 2100, s since 1970: no receiver's UTC is of another time.
_EARLIEST_S, _LATEST_S = 946_684_800.0, 4_102_444_800.0
_FIX_SPACE = 3
#: Kinds of releases, by the lowest number of each.
_RELEASES = ((255, ""), (192, "release candidate"), (128, "beta"), (64, "alpha"), (0, "development"))


def recognise(head: bytes, name: str) -> bool:
    """Whether a file that begins with `head` is a ULog; its name is not needed."""
    return head.startswith(MAGIC)


def read(path: Path, data: bytes, zone: str | None = None) -> RawLog:
    """A ULog.

    Parameters
    ----------
    path
        Only for messages.
    data
        The whole file.
    zone
        Not needed: its UTC is the receiver's.

    Returns
    -------
    RawLog

    Raises
    ------
    WildlabError
        Where it is none, was written in a way that is not known, or holds none of the topics that a flight
        is made of.
    """
    if not data.startswith(MAGIC):
        raise WildlabError("does not begin as a ULog does", "give the .ulg as it was logged", file=path)
    sound = sound_part(data, TOPICS)
    if sound.flags:
        raise WildlabError(
            f"says that it holds what readers have to know of, and is not known (flags {sound.flags:#x})",
            "export it with PX4's own tools first, or copy it again if it was damaged",
            file=path,
        )
    topics, about = _topics(sound)
    lost = _lost(sound, len(data))
    if not topics:
        said = f" ({'; '.join(lost)})" if lost else ""
        raise WildlabError(
            f"holds no message of position, attitude or sensors that can be read{said}",
            "give the log of a flight",
            file=path,
        )
    fit = _utc(topics)
    parts, notes = read_parts(topics, fit)
    if sound.dropouts:
        notes.append(f"the logger fell behind {sound.dropouts} times and lost {sound.dropout_s:.3f} s in all")
    if fit is None:
        notes.append("no receiver told UTC: its times count from the start of the system alone")
    return RawLog("ulog", parts, _vehicle(about), _clock(fit, topics), tuple(lost), tuple(notes))


def _topics(sound: Sound) -> tuple[dict[str, Topic], dict[str, object]]:
    """The first instance of each topic, and what the log says of itself."""
    from pyulog import ULog
    from pyulog.exceptions import ULogException

    said = io.StringIO()
    try:
        with contextlib.redirect_stdout(said):
            log = ULog(io.BytesIO(sound.data))
    except (ULogException, ValueError, KeyError, IndexError, TypeError):
        return {}, {}
    found: dict[str, Topic] = {}
    for one in sorted(log.data_list, key=lambda one: one.multi_id):
        if one.name not in found:
            found[one.name] = Topic(one.name, one.data)
    return found, dict(log.msg_info_dict)


def _utc(topics: dict[str, Topic]) -> ClockFit | None:
    """Time since start to UTC, from the receiver that has most pairs."""
    best: ClockFit | None = None
    for name in ("vehicle_gps_position", "sensor_gps"):
        topic = topics.get(name)
        if topic is None or "time_utc_usec" not in topic.data:
            continue
        utc = topic.get("time_utc_usec") / 1e6
        # UTC is of another instant than the message, where the receiver says so.
        own = (topic.get("timestamp") + np.nan_to_num(topic.get("timestamp_time_relative"))) / 1e6
        good = (topic.get("fix_type") >= _FIX_SPACE) & (utc > _EARLIEST_S) & (utc < _LATEST_S)
        if good.any() and (best is None or good.sum() > best.used.sum()):
            best = fit_steady(own[good], utc[good])
    return best


def _clock(fit: ClockFit | None, topics: dict[str, Topic]) -> Clock | None:
    if fit is None:
        return Clock("") if topics else None
    left = float(np.abs(fit.residual[fit.used]).max())
    base = "UTC of the receiver"
    return Clock(base, fit.rate, fit.offset_s, fit.spread_s, left, int(fit.used.sum()), fit.rate_sd)


def _vehicle(about: dict[str, object]) -> str:
    version, release = "", about.get("ver_sw_release")
    if isinstance(release, int) and release > 0:
        kind = next(name for least, name in _RELEASES if release & 255 >= least)
        version = "v" + ".".join(str(release >> shift & 255) for shift in (24, 16, 8))
        version += f" ({kind})" if kind else ""
    hardware = about.get("ver_hw")
    words = [about.get("sys_name"), version, f"on {hardware}" if isinstance(hardware, str) else ""]
    return printable(" ".join(one for one in words if isinstance(one, str) and one)[:200])


def _lost(sound: Sound, total: int) -> list[str]:
    lost = []
    if sound.skipped:
        lost.append(
            f"{sound.skipped} of {total} bytes in {sound.places} places are no messages and are left out"
        )
    if sound.rest:
        lost.append(f"it ends within a message: the last {sound.rest} of {total} bytes are left out")
    for name, count in list(sound.homeless.items())[:8]:
        whose = f"the topic {printable(name)!r}" if name else "topics that nothing introduces"
        lost.append(f"{count} messages of {whose} have no definition that can be true and are left out")
    if len(sound.homeless) > 8:
        more = sum(list(sound.homeless.values())[8:])
        lost.append(f"{more} messages of {len(sound.homeless) - 8} more topics are left out likewise")
    return lost
