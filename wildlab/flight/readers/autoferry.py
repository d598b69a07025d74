"""The JSON of the Autoferry sensor fusion data set as hostile input: checked frames become plain columns.

A file of detections is a list of frames, each of one sensor at one time: where own ship was, and what the
sensor saw from there. Cameras saw bearings from north (radians); lidar and radar saw points, metres north and
east of own ship, as one list of norths and one of easts. MATLAB wrote it: a single bearing is a number, a
single point a pair, and nothing at all an empty list. A file of truth repeats, for every frame, the last
position of every target.
"""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from wildlab.errors import WildlabError
from wildlab.flight.readers.log import named
from wildlab.flight.readers.text import Field, parse_json

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
    if len(data) > MOST_BYTES:
        limit = f"has more than {MOST_BYTES >> 20} MiB, and the published files less than one"
        raise WildlabError(limit, "copy the published file again", file=path)
    content = parse_json(data, path)
    frames = content.items()
    if not frames:
        raise content.fail("a list of frames is wanted", "copy the published file again")
    return _truth(frames) if part == "truth" else _detections(frames, part)


def _detections(frames: list[Field], part: Part) -> tuple[dict[str, NDArray[Any]], NDArray[np.int64]]:
    times = np.array([frame.member("time").number() for frame in frames])
    own = np.array([_vector(frame.member("ownshipPosition"), 2) for frame in frames])
    sensors, seen = [], []
    for frame, place in zip(frames, own, strict=True):
        sensors.append(_sensor(frame.member("sensorID")))
        measured = frame.member("measurement")
        seen.append(_bearings(measured) if sensors[-1] in CAMERAS else _points(measured) + place)
    # Frames of one sensor come in order; those of several do not everywhere.
    order = np.argsort(times, kind="stable")
    names = np.empty(len(frames), dtype=object)
    counted = dict.fromkeys(SENSORS.values(), 0)
    for i in order:
        counted[sensors[i]] += 1
        names[i] = f"{sensors[i]}-{counted[sensors[i]]:04d}"
    if part == "frames":
        kinds = np.array(sensors, dtype=object)[order]
        columns = {"frame": names[order], "sensor": kinds, "time": times[order]}
        return columns | named(("north", "east"), own[order].T), order + 1
    rows = [i for i in order if sensors[i] == part]
    of_row = np.repeat(rows, [len(seen[i]) for i in rows]).astype(np.int64)
    measures = ("bearing",) if part in CAMERAS else ("north", "east")
    values = np.concatenate([np.empty((0, len(measures))), *(seen[i] for i in rows)])
    return {"frame": names[of_row], **named(measures, values.T)}, of_row + 1


def _truth(frames: list[Field]) -> tuple[dict[str, NDArray[Any]], NDArray[np.int64]]:
    found: dict[tuple[str, float], tuple[NDArray[np.float64], int]] = {}
    for i, frame in enumerate(frames):
        for target in [frame] if isinstance(frame.value, dict) else frame.items():
            identity = target.member("targetID")
            if type(identity.value) is not int or not 0 <= identity.value < 1000:
                raise identity.fail("the number of a target is wanted")
            position = target.member("position")
            place = _vector(position, 3)
            known = found.setdefault((str(identity.value), target.member("time").number()), (place, i))
            if not np.array_equal(known[0], place):
                raise position.fail(f"the target is elsewhere at the same time in frame {known[1] + 1}")
    keys = sorted(found)
    values = np.array([found[key][0] for key in keys]).reshape(-1, 3)
    columns: dict[str, NDArray[Any]] = {
        "target": np.array([target for target, _ in keys], dtype=object),
        "time": np.array([time for _, time in keys], dtype=float),
    }
    columns |= named(("north", "east", "down"), values.T)
    return columns, np.array([found[key][1] + 1 for key in keys], dtype=np.int64)


def _sensor(identity: Field) -> str:
    if type(identity.value) is not int or identity.value not in SENSORS:
        raise identity.fail("known are " + ", ".join(f"{key} ({name})" for key, name in SENSORS.items()))
    return SENSORS[identity.value]


def _bearings(measured: Field) -> NDArray[np.float64]:
    """(M, 1) of a number or a list of them."""
    several = measured.items() if isinstance(measured.value, list) else [measured]
    return np.array([one.number(2 * math.pi) for one in several], dtype=float).reshape(-1, 1)


def _points(measured: Field) -> NDArray[np.float64]:
    """(M, 2) of ``[]``, ``[north, east]`` or ``[[north, ...], [east, ...]]``."""
    rows = measured.items()
    if not rows:
        return np.empty((0, 2))
    lists = [row for row in rows if isinstance(row.value, list)]
    if len(rows) == 2 and not lists:
        return _vector(measured, 2)[None]
    if len(rows) == len(lists) == 2 and len(rows[0].value) == len(rows[1].value):
        return np.array([_vector(row, len(row.value)) for row in rows]).reshape(2, -1).T
    raise measured.fail("a list of norths and one of easts are wanted, alike in length")


def _vector(field: Field, length: int) -> NDArray[np.float64]:
    several = field.items()
    if len(several) != length:
        raise field.fail(f"it has {len(several)} numbers where {length} are wanted")
    return np.array([one.number(FURTHEST_M) for one in several], dtype=float)
