"""The JSON of the Autoferry sensor fusion data set as hostile input: checked frames become plain columns.

A file of detections is a list of frames, each of one sensor at one time: where own ship was, and what the
sensor saw from there. Cameras saw bearings from north (radians); lidar and radar saw points, metres north and
east of own ship, as one list of norths and one of easts. MATLAB wrote it: a single bearing is a number, a
single point a pair, and nothing at all an empty list. A file of truth repeats, for every frame, the last
position of every target.
"""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from wildlab.errors import WildlabError
from wildlab.flight.files import printable

Part = Literal["frames", "lidar", "radar", "ir", "eo", "truth"]

#: `sensorID` as published, and what it stands for.
SENSORS: dict[int, str] = {1: "lidar", 2: "radar", 3: "ir", 4: "eo"}
CAMERAS = ("ir", "eo")
#: The published files have up to 0.6 MB; a frame has up to a few hundred bytes.
MOST_BYTES = 64 << 20
#: No coordinate of a ferry's surroundings is further from its origin, m.
FURTHEST_M = 1e6


def read_part(path: Path, data: bytes, part: Part) -> tuple[dict[str, NDArray[Any]], NDArray[np.int64]]:
    """Columns of one part of a file, and for each row the number of the frame in the file, counted from 1.

    ``frames``: ``frame`` (its name, as ``lidar-0007``), ``sensor``, ``time`` (s since 1970), ``north`` and
    ``east`` of own ship (m), in order of time. ``lidar``, ``radar``: ``frame``, ``north``, ``east`` of each
    point in the local frame, own ship's position at the stamp added. ``ir``, ``eo``: ``frame``, ``bearing``
    (rad). ``truth``: ``target``, ``time``, ``north``, ``east``, ``down``, each sample once, in order of
    target and time.

    Parameters
    ----------
    path
        Only for messages.

    Raises
    ------
    WildlabError
        Naming file, frame and field: not JSON, too large, another structure, a number that is none.
    """
    content = _parse(path, data)
    if not isinstance(content, list) or not content:
        raise _fail(path, "the file", f"holds {_shown(content)} where a list of frames is expected")
    return _truth(path, content) if part == "truth" else _detections(path, content, part)


def _detections(
    path: Path, content: list[Any], part: Part
) -> tuple[dict[str, NDArray[Any]], NDArray[np.int64]]:
    times = np.empty(len(content))
    own = np.empty((len(content), 2))
    sensors: list[str] = []
    seen: list[NDArray[np.float64]] = []
    for i, frame in enumerate(content):
        where = f"frame {i + 1}"
        identity = _member(path, where, frame, "sensorID")
        if isinstance(identity, bool) or not isinstance(identity, int) or identity not in SENSORS:
            known = ", ".join(f"{key} ({name})" for key, name in SENSORS.items())
            raise _fail(path, "sensorID", f"{where}: is {_shown(identity)}; known are {known}")
        sensors.append(SENSORS[identity])
        times[i] = _number(path, where, "time", _member(path, where, frame, "time"))
        own[i] = _vector(path, where, "ownshipPosition", _member(path, where, frame, "ownshipPosition"), 2)
        measured = _member(path, where, frame, "measurement")
        if sensors[-1] in CAMERAS:
            seen.append(_bearings(path, where, measured))
        else:
            seen.append(_points(path, where, measured) + own[i])
    # Frames of one sensor come in order; those of several do not everywhere.
    order = np.argsort(times, kind="stable")
    names = np.empty(len(content), dtype=object)
    counted = dict.fromkeys(SENSORS.values(), 0)
    for i in order:
        counted[sensors[i]] += 1
        names[i] = f"{sensors[i]}-{counted[sensors[i]]:04d}"
    if part == "frames":
        return {
            "frame": names[order],
            "sensor": np.array(sensors, dtype=object)[order],
            "time": times[order],
            "north": own[order, 0],
            "east": own[order, 1],
        }, order + 1
    rows = [i for i in order if sensors[i] == part]
    of_row = np.repeat(rows, [len(seen[i]) for i in rows]).astype(np.int64)
    width = 1 if part in CAMERAS else 2
    values = np.concatenate([np.empty((0, width)), *(seen[i].reshape(-1, width) for i in rows)])
    columns = dict(zip(("bearing",) if width == 1 else ("north", "east"), values.T, strict=True))
    return {"frame": names[of_row], **columns}, of_row + 1


def _truth(path: Path, content: list[Any]) -> tuple[dict[str, NDArray[Any]], NDArray[np.int64]]:
    found: dict[tuple[str, float], tuple[NDArray[np.float64], int]] = {}
    for i, frame in enumerate(content):
        where = f"frame {i + 1}"
        for target in [frame] if isinstance(frame, dict) else _list(path, where, "the frame", frame):
            identity = _member(path, where, target, "targetID")
            if isinstance(identity, bool) or not isinstance(identity, int) or not 0 <= identity < 1000:
                raise _fail(path, "targetID", f"{where}: is {_shown(identity)}, not a number of a target")
            time = _number(path, where, "time", _member(path, where, target, "time"))
            position = _vector(path, where, "position", _member(path, where, target, "position"), 3)
            known = found.setdefault((str(identity), time), (position, i))
            if not np.array_equal(known[0], position):
                raise _fail(
                    path,
                    "position",
                    f"{where}: target {identity} is elsewhere at the same time in frame {known[1] + 1}",
                )
    keys = sorted(found)
    values = np.array([found[key][0] for key in keys]).reshape(-1, 3)
    columns: dict[str, NDArray[Any]] = {
        "target": np.array([target for target, _ in keys], dtype=object),
        "time": np.array([time for _, time in keys], dtype=float),
    }
    columns |= dict(zip(("north", "east", "down"), values.T, strict=True))
    return columns, np.array([found[key][1] + 1 for key in keys], dtype=np.int64)


def _bearings(path: Path, where: str, measured: Any) -> NDArray[np.float64]:
    several = measured if isinstance(measured, list) else [measured]
    found = np.array([_number(path, where, "measurement", one) for one in several], dtype=float)
    if (np.abs(found) > 2 * math.pi).any():
        worst = found[np.argmax(np.abs(found))]
        raise _fail(path, "measurement", f"{where}: the bearing {worst:g} is more than a turn in radians")
    return found


def _points(path: Path, where: str, measured: Any) -> NDArray[np.float64]:
    """(M, 2) of ``[]``, ``[north, east]`` or ``[[north, ...], [east, ...]]``."""
    rows = _list(path, where, "measurement", measured)
    if not rows:
        return np.empty((0, 2))
    if len(rows) == 2 and all(isinstance(row, list) for row in rows) and len(rows[0]) == len(rows[1]):
        return np.array([_vector(path, where, "measurement", row, len(row)) for row in rows]).reshape(2, -1).T
    if len(rows) == 2 and not any(isinstance(row, list) for row in rows):
        return _vector(path, where, "measurement", rows, 2)[None]
    raise _fail(
        path,
        "measurement",
        f"{where}: {_shown(measured)} is no list of norths and one of easts, alike in length",
    )


def _vector(path: Path, where: str, field: str, value: Any, length: int) -> NDArray[np.float64]:
    several = _list(path, where, field, value)
    if len(several) != length:
        raise _fail(path, field, f"{where}: has {len(several)} numbers where {length} are expected")
    found = np.array([_number(path, where, field, one) for one in several], dtype=float)
    if (np.abs(found) > FURTHEST_M).any():
        raise _fail(path, field, f"{where}: {_shown(value)} is further away than {FURTHEST_M / 1e3:g} km")
    return found


def _number(path: Path, where: str, field: str, value: Any) -> float:
    if isinstance(value, (int, float)) and not isinstance(value, bool):
        try:
            found = float(value)
        except OverflowError:
            found = math.inf
        if math.isfinite(found):
            return found
    raise _fail(path, field, f"{where}: {_shown(value)} is not a finite number")


def _list(path: Path, where: str, field: str, value: Any) -> list[Any]:
    if not isinstance(value, list):
        raise _fail(path, field, f"{where}: is {_shown(value)} where a list is expected")
    return value


def _member(path: Path, where: str, value: Any, name: str) -> Any:
    if not isinstance(value, dict):
        raise _fail(path, name, f"{where}: is {_shown(value)}, and has no {name!r}")
    if name not in value:
        raise _fail(path, name, f"{where}: has no {name!r}")
    return value[name]


def _parse(path: Path, data: bytes) -> Any:
    if len(data) > MOST_BYTES:
        raise _fail(path, "", f"has more than {MOST_BYTES >> 20} MiB, and the published files less than one")

    def no_constant(name: str) -> Any:
        raise ValueError(f"{name} is not JSON")

    def once(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
        found = dict(pairs)
        if len(found) < len(pairs):
            raise ValueError("a name stands twice in one object")
        return found

    try:
        return json.loads(data.decode("utf-8-sig"), parse_constant=no_constant, object_pairs_hook=once)
    except (ValueError, RecursionError) as error:
        first = (str(error).strip() or type(error).__name__).splitlines()[0]
        raise _fail(path, "", f"is not readable JSON ({printable(first[:120])})") from None


def _shown(value: Any) -> str:
    if isinstance(value, dict):
        return "an object"
    if isinstance(value, list):
        return f"a list of {len(value)}"
    text = printable(repr(value)) if not isinstance(value, int) or abs(value) < 10**30 else "a huge number"
    return text if len(text) <= 60 else text[:57] + "..."


def _fail(path: Path, field: str, problem: str) -> WildlabError:
    fix = "copy the published file again, or mend it there"
    return WildlabError(problem, fix, file=path, field=field or None)
