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
from typing import Annotated, Any, Literal

import numpy as np
import pandas as pd
from numpy.typing import NDArray
from pydantic import AfterValidator, BaseModel, Field, RootModel

from wildlab.errors import WildlabError
from wildlab.flight.files import check_model
from wildlab.flight.readers.log import named
from wildlab.flight.readers.text import Real, Several, parse_json

Part = Literal["frames", "lidar", "radar", "ir", "eo", "truth"]

#: `sensorID` as published, and what it stands for.
SENSORS: dict[int, str] = {1: "lidar", 2: "radar", 3: "ir", 4: "eo"}
CAMERAS = ("ir", "eo")
#: The published files have up to 0.6 MB; a frame has up to a few hundred bytes.
MOST_BYTES = 64 << 20
#: No coordinate of a ferry's surroundings is further from its origin, m.
Metres = Annotated[Real, Field(ge=-1e6, le=1e6)]
Bearing = Annotated[Real, Field(ge=-2 * math.pi, le=2 * math.pi)]


def _alike(measured: Any) -> Any:
    if measured and isinstance(measured[0], list) and len(measured[0]) != len(measured[1]):
        raise ValueError("it has not as many norths as easts; copy the published file again")
    return measured


class SeenBearings(BaseModel):
    """A camera's frame."""

    sensor: Literal[3, 4] = Field(alias="sensorID")
    time: Real
    own: tuple[Metres, Metres] = Field(alias="ownshipPosition")
    measurement: Bearing | list[Bearing]


class SeenPoints(SeenBearings):
    """A frame of lidar or radar."""

    sensor: Literal[1, 2] = Field(alias="sensorID")  # type: ignore[assignment]
    measurement: Annotated[  # type: ignore[assignment]
        tuple[()] | tuple[Metres, Metres] | tuple[list[Metres], list[Metres]], AfterValidator(_alike)
    ]


class Detections(RootModel[Several[Annotated[SeenBearings | SeenPoints, Field(discriminator="sensor")]]]):
    """A file of detections."""


class Target(BaseModel):
    """Where one target was."""

    identity: Annotated[int, Field(alias="targetID", strict=True, ge=0, lt=1000)]
    time: Real
    position: tuple[Metres, Metres, Metres]


class Truth(RootModel[Several[Several[Target]]]):
    """A file of truth."""


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
    content = parse_json(data, path) if len(data) <= MOST_BYTES else None
    if not isinstance(content, list) or not content:
        problem = f"is no list of frames of at most {MOST_BYTES >> 20} MiB"
        raise WildlabError(problem, "copy the published file again", file=path)
    return _truth(content, path) if part == "truth" else _detections(content, part, path)


def _detections(
    content: list[Any], part: Part, path: Path
) -> tuple[dict[str, NDArray[Any]], NDArray[np.int64]]:
    found = check_model(Detections, content, path).root
    table = pd.DataFrame(
        [(SENSORS[one.sensor], one.time, *one.own) for one in found],
        columns=["sensor", "time", "north", "east"],
    )
    # Frames of one sensor come in order; those of several do not everywhere.
    table = table.sort_values("time", kind="stable")
    counted = table.groupby("sensor").cumcount() + 1
    table["frame"] = table["sensor"] + counted.map("-{:04d}".format)
    if part == "frames":
        columns = {name: table[name].to_numpy() for name in ("frame", "sensor", "time", "north", "east")}
        return columns, table.index.to_numpy() + 1
    ours = table[table["sensor"] == part]
    measures = ("bearing",) if part in CAMERAS else ("north", "east")
    seen = [np.array(found[at].measurement, float).reshape(len(measures), -1).T for at in ours.index]
    if part not in CAMERAS:
        seen = [points + found[at].own for points, at in zip(seen, ours.index, strict=True)]
    counts = [len(one) for one in seen]
    values = np.concatenate([np.empty((0, len(measures))), *seen])
    names = {"frame": np.repeat(ours["frame"].to_numpy(object), counts)}
    return names | named(measures, values.T), np.repeat(ours.index.to_numpy(), counts) + 1


def _truth(content: list[Any], path: Path) -> tuple[dict[str, NDArray[Any]], NDArray[np.int64]]:
    frames = check_model(Truth, [one if isinstance(one, list) else [one] for one in content], path).root
    names = ["target", "time", "north", "east", "down"]
    table = pd.DataFrame(
        [
            (str(one.identity), one.time, *one.position, at)
            for at, frame in enumerate(frames, 1)
            for one in frame
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
