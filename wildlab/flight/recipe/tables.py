"""Tables of a recipe beside the poses: sensors on board, frames, detections and truth."""

from __future__ import annotations

from dataclasses import dataclass
from operator import attrgetter

import numpy as np
import pandas as pd

from wildlab.flight.recipe.model import Detections, FramesPart, Ground, Recipe, Truth
from wildlab.flight.recipe.parts import Block, Satellite, Series
from wildlab.flight.recipe.poses import (
    LocalFrame,
    RawPosition,
    ned_columns,
    read_position,
    read_velocity,
    velocity_columns,
)
from wildlab.flight.recipe.raw import (
    Array,
    Nanoseconds,
    RawFiles,
    RawTable,
    Text,
    numbers,
    plain_numbers,
    texts,
    times,
)
from wildlab.flight.units import Dimension
from wildlab.geometry.frames import geodetic_to_ned, ned_to_geodetic, wrap

#: Columns of a flight's tables: name, quantity of the recipe's part, dimension.
Columns = tuple[tuple[str, str, Dimension], ...]
_GIMBAL: Columns = (("pan_rad", "pan", "angle"), ("tilt_rad", "tilt", "angle"))
_SPREADS: Columns = (
    ("sd_horizontal_m", "sd_horizontal", "length"),
    ("sd_vertical_m", "sd_vertical", "length"),
)
ON_BOARD: dict[str, Columns] = {
    "imu": tuple(
        column
        for axis in "xyz"
        for column in (
            (f"f_{axis}_m_s2", f"force.{axis}", "acceleration"),
            (f"w_{axis}_rad_s", f"rate.{axis}", "rate"),
        )
    ),
    "gnss": (*_SPREADS, ("sd_velocity_m_s", "sd_velocity", "speed")),
    "magnetometer": tuple((f"field_{axis}_ut", f"field.{axis}", "field") for axis in "xyz"),
    "gimbal": _GIMBAL,
}


def read_columns(
    rows: RawTable, block: Series, part: str, columns: Columns, *, may_be_empty: bool = False
) -> dict[str, Array]:
    """Those of the columns whose quantity the block has, (N,) each.

    Raises
    ------
    WildlabError
        Where a column is missing, or a cell is not a number.
    """
    quantities = [(name, key, attrgetter(key)(block), dimension) for name, key, dimension in columns]
    return {
        name: numbers(rows, quantity, dimension, f"{part}.{key}", may_be_empty=may_be_empty)
        for name, key, quantity, dimension in quantities
        if quantity is not None
    }


@dataclass(frozen=True)
class SensorRows:
    """One table without its times and positions; its stamps, and the raw positions of a receiver."""

    columns: dict[str, Array]
    stamps: Nanoseconds
    position: RawPosition | None = None

    def table(self, start: int, places: LocalFrame) -> pd.DataFrame:
        """The table of the flight; `start` is its epoch in nanoseconds since 1970."""
        columns: dict[str, Array] = {"time_s": (self.stamps - start) / 1e9}
        if self.position is not None:
            columns |= ned_columns(places.ned(self.position, "gnss"))
        return pd.DataFrame(columns | self.columns)


def read_sensors(recipe: Recipe, raw: RawFiles) -> dict[str, SensorRows]:
    """Those of `imu`, `gnss`, `magnetometer` and `gimbal` that the recipe has.

    Raises
    ------
    WildlabError
        Where a column is missing, a cell is not a number or not a time, or no row counts.
    """
    found = {}
    for name, block in recipe.on_board.items():
        rows, columns, position = raw.series(block, name), {}, None
        if isinstance(block, Satellite):
            position = read_position(rows, block.position, "gnss.position")
            if block.velocity is not None:
                columns = velocity_columns(read_velocity(rows, block.velocity, "gnss.velocity"))
        columns |= read_columns(rows, block, name, ON_BOARD[name], may_be_empty=name == "gnss")
        for key in ("satellites", "fix") if isinstance(block, Satellite) else ():
            if (column := getattr(block, key)) is not None:
                columns[key] = plain_numbers(rows, column, f"gnss.{key}", may_be_empty=True)
        stamps = times(rows, block.time, f"{name}.time", recipe.time.zone, recipe.time.epoch)
        found[name] = SensorRows(columns, stamps, position)
    return found


@dataclass(frozen=True)
class FrameRows:
    """The frames (without time_s), their stamps, and for each row of their file the frame it belongs to."""

    table: pd.DataFrame
    stamps: Nanoseconds | None
    of_row: Text


def read_frames(recipe: Recipe, raw: RawFiles) -> FrameRows:
    """The images: one per row with its id, or one per unique combination of columns, numbered as they come.
    None at all where the recipe has no frames.

    Raises
    ------
    WildlabError
        Where a column is missing, a cell cannot be read, or rows of one frame differ.
    """
    block = recipe.frames
    if block is None:
        return FrameRows(pd.DataFrame({"frame_id": np.empty(0, object)}), None, np.empty(0, object))
    rows = raw.series(block, "frames")
    if block.id is not None:
        of_row = texts(rows, block.id, "frames.id")
        first = np.arange(len(rows))
    else:
        keys = [texts(rows, column, "frames.unique") for column in block.unique]
        frame, found = pd.factorize(pd.MultiIndex.from_arrays([*keys, np.zeros(len(rows))]))
        _, first = np.unique(frame, return_index=True)
        of_row = np.array(_numbered(block.prefix, len(found)), dtype=object)[frame]
    columns: dict[str, Text | Array | Nanoseconds] = {"frame_id": of_row}
    if block.group is not None:
        columns["group"] = _groups(rows, block)
    if block.sensor is not None:
        columns["sensor"] = texts(rows, block.sensor, "frames.sensor")
    columns |= read_columns(rows, block, "frames", _GIMBAL)
    stamps = None
    if block.time is not None:
        stamps = times(rows, block.time, "frames.time", recipe.time.zone, recipe.time.epoch)
        columns["stamp"] = stamps
    table = pd.DataFrame(columns)
    if block.id is None:
        others = table.iloc[first[frame]].reset_index(drop=True)
        differs = np.asarray((table != others).to_numpy().any(axis=1))
        rows.refuse(
            differs,
            lambda row: (
                f"this row of frame {of_row[row]!r} says something else than line "
                f"{rows.lines[first[frame[row]]]}"
            ),
            "name more columns in unique",
            ", ".join(block.unique),
            "frames",
        )
    table = table.iloc[first].reset_index(drop=True).drop(columns="stamp", errors="ignore")
    return FrameRows(table, None if stamps is None else stamps[first], of_row)


def _groups(rows: RawTable, block: FramesPart) -> Text:
    group = block.group
    if group is None or not group.edges:
        return texts(rows, group.column if group else "", "frames.group")
    value = plain_numbers(rows, group.column, "frames.group")
    edges = np.array(group.edges)
    nearest = np.abs(value[:, None] - edges).min(axis=1)
    if (nearest < group.clear).any():
        row = int(np.argmin(nearest))
        raise rows.fail(
            f"{value[row]:g} is closer than {group.clear:g} to the edge between two groups",
            "look at how the numbers are spread, and move the edges",
            group.column,
            "frames.group",
            row,
        )
    return np.array(group.labels, dtype=object)[np.searchsorted(edges, value)]


def _numbered(prefix: str, n: int) -> list[str]:
    width = len(str(max(n - 1, 0)))
    return [f"{prefix}{i:0{width}d}" for i in range(n)]


def frames_of_rows(
    frames: FrameRows, recipe: Recipe, block: Block, column: str | None, table: RawTable, part: str
) -> Text | None:
    """For each row of a file the frame it belongs to: by a column, or because the frames are of that file.

    None where neither is the case.
    """
    if column is not None:
        return texts(table, column, f"{part}.frame")
    if recipe.frames is None:
        return None
    same = (block.file, block.separator) == (recipe.frames.file, recipe.frames.separator)
    return frames.of_row if same else None


def read_detections(
    block: Detections,
    raw: RawFiles,
    recipe: Recipe,
    part: str,
    frames: FrameRows,
    places: LocalFrame,
    image: tuple[float, float],
    lens: pd.DataFrame,
) -> pd.DataFrame:
    """Detections of one source.

    Parameters
    ----------
    image
        Width and height in pixels.
    lens
        Position of the platform (north, east, down, m) and its heading (rad) by frame_id.

    Raises
    ------
    WildlabError
        Where a column is missing or a cell cannot be read, pixels belong to no frame, or bearings count from
        the bow and it is not known where that points.
    """
    rows = raw.series(block, part, may_be_empty=True)  # a night in which nothing was seen
    frame = frames_of_rows(frames, recipe, block, block.frame, rows, part)
    if frame is None and block.kind == "pixel":
        raise rows.fail(
            "nothing says which frame a pixel is in", "name the column of the frame", "frame", part
        )
    columns: dict[str, Text | Array | str] = {
        "detection_id": np.array(_numbered(block.prefix, len(rows)), dtype=object)
        if block.id is None
        else texts(rows, block.id, f"{part}.id"),
        "frame_id": np.full(len(rows), "", dtype=object) if frame is None else frame,
        "source": np.full(len(rows), block.source, dtype=object),
        "kind": np.full(len(rows), block.kind, dtype=object),
        "target_id": np.full(len(rows), "", dtype=object)
        if block.target is None
        else texts(rows, block.target, f"{part}.target", may_be_empty=True),
    }
    if block.pixel is not None:
        columns["u_px"] = numbers(rows, block.pixel.u, "pixel", f"{part}.pixel.u", image=image)
        columns["v_px"] = numbers(rows, block.pixel.v, "pixel", f"{part}.pixel.v", image=image)
    elif block.position is not None:
        position = places.ned(read_position(rows, block.position, f"{part}.position"), "positions")
        columns |= ned_columns(position)
    elif block.azimuth is not None:
        azimuth = numbers(rows, block.azimuth, "angle", f"{part}.azimuth")
        if block.counts_from == "bow":
            azimuth = np.asarray(wrap(azimuth + _headings(rows, frame, lens, part)), np.float64)
        columns["azimuth_rad"] = azimuth
        beside: Columns = (("elevation_rad", "elevation", "angle"), ("range_m", "range", "length"))
        columns |= read_columns(rows, block, part, beside)
    if block.ground is not None:
        under = np.full((len(rows), 3), np.nan)
        if frame is not None:
            under = lens[["north", "east", "down"]].reindex(frame).to_numpy()
        columns["plane_down_m"] = _ground(rows, block.ground, f"{part}.ground", places, under)
    return pd.DataFrame(columns)


def _headings(rows: RawTable, frame: Text | None, lens: pd.DataFrame, part: str) -> Array:
    """Where the bow points at each detection, rad from north towards east."""
    if frame is None:
        raise rows.fail(
            "these bearings count from the bow, and nothing says when they were taken",
            "name the column of the frame, and give the frames a time",
            "frame",
            part,
        )
    heading = lens["heading"].reindex(frame).to_numpy()
    unknown = ~np.isfinite(heading)
    rows.refuse(
        unknown,
        lambda row: (
            f"this bearing counts from the bow, and no pose says where that points in frame {frame[row]!r}: "
            f"{int(unknown.sum())} of {len(frame)} are so"
        ),
        "give poses for as long as anything is detected, or leave these rows out with `where`",
        "counts_from",
        part,
    )
    return np.asarray(heading, np.float64)


def _ground(rows: RawTable, ground: Ground, part: str, places: LocalFrame, under: Array) -> Array:
    """Down coordinate of the ground at each detection; `under` (N, 3) is the platform above it."""
    off = places.off("ground")
    if ground.down is not None:
        return numbers(rows, ground.down, "length", f"{part}.down", may_be_empty=True) + off
    if ground.height is None:
        raise ValueError("ground without down and height")
    height = numbers(rows, ground.height, "length", f"{part}.height", may_be_empty=True) - off
    if ground.latitude is not None and ground.longitude is not None:
        latitude = numbers(rows, ground.latitude, "angle", f"{part}.latitude")
        longitude = numbers(rows, ground.longitude, "angle", f"{part}.longitude")
    else:
        latitude, longitude, _ = ned_to_geodetic(under, places.origin).T
    return geodetic_to_ned(latitude, longitude, height, places.origin)[:, 2]


def read_truth(
    block: Truth, raw: RawFiles, recipe: Recipe, part: str, places: LocalFrame, start: int
) -> pd.DataFrame:
    """Where targets were; `start` is the epoch in nanoseconds since 1970.

    Raises
    ------
    WildlabError
        Where a column is missing or a cell cannot be read.
    """
    rows = raw.series(block, part)
    names = np.full(len(rows), block.target, dtype=object)
    if block.id is not None:
        names = texts(rows, block.id, f"{part}.id")
    time_s = np.full(len(rows), np.nan)
    if block.time is not None:
        time_s = (times(rows, block.time, f"{part}.time", recipe.time.zone, recipe.time.epoch) - start) / 1e9
    position = places.ned(read_position(rows, block.position, f"{part}.position"), "truth")
    columns: dict[str, Text | Array] = {"target_id": names, "time_s": time_s}
    columns |= ned_columns(position) | read_columns(rows, block, part, _SPREADS, may_be_empty=True)
    return pd.DataFrame(columns)
