"""Points marked by hand become detections of a flight."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from pathlib import Path, PurePosixPath
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
import pyarrow
import pyarrow.parquet

from wildlab.errors import WildlabError
from wildlab.files import write_atomic
from wildlab.flight.checksums import accept_changes
from wildlab.flight.files import printable
from wildlab.flight.schema import TABLES, conform
from wildlab.flight.store import load_flight
from wildlab.runner.annotation.session import read_points, table_of

# pyarrow carries no types.
arrow: Any = pyarrow
parquet: Any = pyarrow.parquet

#: Who says so, in the table of detections.
SOURCE = "clicks"


class Taken(NamedTuple):
    """What became of the points.

    Attributes
    ----------
    points, frames
        How many were taken, and in how many frames.
    left
        Names of images that are no frames of the flight, with the number of their points.
    replaced
        Detections of an earlier time that these took the place of.
    """

    points: int
    frames: int
    left: dict[str, int]
    replaced: int


def take_clicks(folder: Path) -> Taken:
    """Write the points marked in a flight's images into its detections, in place of earlier ones.

    Parameters
    ----------
    folder
        Of the flight.

    Returns
    -------
    Taken

    Raises
    ------
    WildlabError
        Where nothing is marked, no image is a frame of the flight, or the flight cannot be read or written.
    """
    flight = load_flight(folder)
    table = table_of(folder)
    points = read_points(table)
    if not any(points.values()):
        fix = f'mark points first: wildlab click "{folder}"'
        raise WildlabError("no point is marked in this flight's images", fix, file=table)
    frames = flight.table("frames")["frame_id"].astype(str).tolist()
    find = _finder(frames)
    rows: list[tuple[str, str, float, float]] = []
    of_frame: dict[str, str] = {}
    left: dict[str, int] = {}
    for image, marked in points.items():
        frame = find(image)
        if frame is None:
            left[image] = len(marked)
            continue
        if marked and (other := of_frame.setdefault(frame, image)) != image:
            raise WildlabError(
                f"points are marked in two images of the frame {printable(frame)}: {printable(other)} and "
                f"{printable(image)}",
                "mark those of one camera, and take the lines of the other out",
                file=table,
                field="image",
            )
        rows += [(frame, one.name, one.u, one.v) for one in marked]
    if not rows:
        first = printable(next(iter(left)))
        raise WildlabError(
            f"none of {len(left)} images with points is a frame of this flight: {first}",
            f"frames are called as {printable(frames[0])!r}; name the folder of their images with --images"
            if frames
            else "import the flight with its images",
            file=table,
            field="image",
        )
    before = flight.tables.get("detections")
    replaced = 0 if before is None else int((before["source"] == SOURCE).sum())
    own = pd.DataFrame(rows, columns=["frame_id", "target_id", "u_px", "v_px"])
    own.insert(0, "detection_id", [f"click-{number:05d}" for number in range(1, len(own) + 1)])
    own["source"], own["kind"] = SOURCE, "pixel"
    joined = own if before is None else _joined(before[before["source"] != SOURCE], own)
    _write(folder, conform(TABLES["detections"], joined, "detections"))
    return Taken(len(own), own["frame_id"].nunique(), left, replaced)


def _joined(before: pd.DataFrame, own: pd.DataFrame) -> pd.DataFrame:
    """Both tables, each column in its type: what a detection does not have is NaN, or empty text."""
    columns = list(dict.fromkeys([*before.columns, *own.columns]))
    texts = {column.name for column in TABLES["detections"].columns if column.dtype == "text"}

    def filled(table: pd.DataFrame) -> pd.DataFrame:
        whole = {}
        for name in columns:
            other = before if name in before else own
            text = name in texts or other[name].dtype == object
            nothing = np.full(len(table), "", dtype=object) if text else np.full(len(table), np.nan)
            whole[name] = table[name].to_numpy() if name in table else nothing
        return pd.DataFrame(whole)

    return pd.concat([filled(before), filled(own)], ignore_index=True) if len(before) else filled(own)


def _finder(frames: list[str]) -> Callable[[str], str | None]:
    """Which frame an image is: by its name, else without its ending, if that is of one frame alone."""
    whole = set(frames)
    stems = Counter(PurePosixPath(one).stem for one in frames)
    by_stem = {PurePosixPath(one).stem: one for one in frames}

    def find(image: str) -> str | None:
        if image in whole:
            return image
        stem = PurePosixPath(image).stem
        if stem in whole:
            return stem
        return by_stem[stem] if stems[stem] == 1 else None

    return find


def _write(folder: Path, table: pd.DataFrame) -> None:
    """The table in its place, and its checksum: everything else in the folder stays, images too."""
    sink = arrow.BufferOutputStream()
    plain = arrow.Table.from_pandas(table, preserve_index=False).replace_schema_metadata(None)
    parquet.write_table(plain, sink)
    write_atomic(folder / "detections.parquet", sink.getvalue().to_pybytes())
    accept_changes(folder)
