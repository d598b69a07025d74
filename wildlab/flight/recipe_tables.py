"""Tables of a recipe, converted to frame n: poses, sensors on board, frames, detections and truth."""

from __future__ import annotations

from dataclasses import dataclass
from operator import attrgetter
from typing import Any, Literal, NamedTuple

import numpy as np
import pandas as pd

from wildlab.flight.checks.findings import (
    NORM_TOLERANCE,
)
from wildlab.flight.clocks import covariance_columns
from wildlab.flight.raw_files import (
    Nanoseconds,
    RawFiles,
    RawTable,
    Text,
    numbers,
    plain_numbers,
    texts,
    times,
)
from wildlab.flight.readers.log import named
from wildlab.flight.recipes import (
    FORMS,
    Attitude,
    Block,
    Detections,
    FramesPart,
    Ground,
    Poses,
    Position,
    Quantity,
    Recipe,
    Satellite,
    Series,
    Spreads,
    Truth,
    Velocity,
    YawFromBearing,
)
from wildlab.flight.schema import POSITION, QUATERNION, VELOCITY, Dimension
from wildlab.geometry.covariances import pose_covariance, tilt_from_roll_pitch
from wildlab.geometry.frames import (
    R_NED_ENU,
    Array,
    Indices,
    Mask,
    Origin,
    enu_to_ned,
    euler_to_matrix,
    geodetic_to_ned,
    matrix_to_quaternion,
    ned_to_geodetic,
    quaternion_to_matrix,
    wrap,
)

#: Takes a vector from forward-left-up to forward-right-down, and back.
FLIP = np.diag([1.0, -1.0, -1.0])


#: Rows that say the same of one frame agree to this, in metres or radians.
SAME = 1e-9


class RawPosition(NamedTuple):
    """Positions as a table has them, in radians and metres: columns (N, 3) as in `form`."""

    form: str
    values: Array


@dataclass(frozen=True)
class LocalFrame:
    """What takes raw positions to frame n: the origin, and the metres to take off heights."""

    origin: Origin
    correction_m: float
    taken_off: tuple[str, ...]

    def off(self, what: str) -> float:
        return self.correction_m if what in self.taken_off else 0.0

    def ned(self, position: RawPosition, what: str) -> Array:
        """Positions in n, (N, 3); `what` they are decides whether the vertical correction is taken off."""
        a, b, c = position.values.T
        off = self.off(what)
        if position.form == "ned":
            return np.column_stack([a, b, c + off])
        if position.form == "wgs84":
            return geodetic_to_ned(a, b, c - off, self.origin)
        return enu_to_ned(np.column_stack([a, b, c - off]))


@dataclass(frozen=True)
class Rows:
    """One table without its times and places.

    Attributes
    ----------
    columns
        (N,) each, as the flight has them.
    stamps
        Of each row; None where rows have none of their own.
    position
        As the raw table has them; None where it has none.
    ids
        Frames: of poses that belong to frames, (N,); of frames, of each row of their file.
    note
        A sentence for the flight's description.
    """

    columns: dict[str, Any]
    stamps: Any
    position: RawPosition | None = None
    ids: Text | None = None
    note: str = ""

    def table(self, time_s: Array, position: Array | None) -> pd.DataFrame:
        """The table of the flight, with positions (N, 3) in n where it has any."""
        placed = {} if position is None else named(POSITION, position.T)
        return pd.DataFrame({"time_s": time_s} | placed | self.columns)


def read_position(table: RawTable, position: Position, part: str) -> RawPosition:
    """The three columns of a position, in radians and metres.

    Raises
    ------
    WildlabError
        Where a column is missing or a cell is not a number.
    """
    columns = []
    for name in FORMS[position.form]:
        dimension: Literal["angle", "length"] = "angle" if name in ("latitude", "longitude") else "length"
        values = numbers(table, getattr(position, name), dimension, f"{part}.{name}")
        limit = {"latitude": np.pi / 2, "longitude": 2 * np.pi}.get(name, np.inf)

        def beyond(row: int, values: Array = values, name: str = name) -> str:
            return f"{np.degrees(values[row]):g} deg is no {name}"

        table.refuse(
            np.abs(values) > limit,
            beyond,
            "check column and unit",
            getattr(position, name).column or "value",
            f"{part}.{name}",
        )
        columns.append(values)
    nowhere = (columns[0] == 0) & (columns[1] == 0)
    # A receiver writes zeros until it knows where it is; a local position may well be zero.
    if position.form == "wgs84":
        table.refuse(
            nowhere,
            f"latitude and longitude are both 0 in {int(nowhere.sum())} rows",
            "take out these rows",
            (position.latitude.column if position.latitude else None) or "value",
            f"{part}.latitude",
        )
    return RawPosition(position.form, np.column_stack(columns))


def read_velocity(table: RawTable, velocity: Velocity, part: str) -> Array:
    """North, east, down, (N, 3) m/s.

    Raises
    ------
    WildlabError
        Where a column is missing or a cell is not a number.
    """

    def speeds(name: str) -> Array:
        return numbers(table, getattr(velocity, name), "speed", f"{part}.{name}")

    if velocity.course is not None:
        speed, course = speeds("speed"), numbers(table, velocity.course, "angle", f"{part}.course")
        north, east = speed * np.cos(course), speed * np.sin(course)
    else:
        north, east = speeds("north"), speeds("east")
    down = speeds("down") if velocity.up is None else -speeds("up")
    return np.column_stack([north, east, down])


def read_poses(recipe: Recipe, block: Poses, table: RawTable, part: str, ids: Text | None) -> Rows:
    """One nav source. Where several rows are of one frame (`ids`), they have to say the same, and become one.

    Raises
    ------
    WildlabError
        Where a column is missing, a cell is not a number or not a time, a quaternion is not normalised, or
        rows of one frame differ.
    """
    position = None if block.position is None else read_position(table, block.position, f"{part}.position")
    values = {"attitude": _read_attitude(table, block.attitude, f"{part}.attitude")}
    stamps = None
    if block.velocity is not None:
        values["velocity"] = read_velocity(table, block.velocity, f"{part}.velocity")
    if block.spreads is not None:
        values["spreads"] = _read_spreads(table, block.spreads, f"{part}.spreads")
    if block.time is not None:
        stamps = times(table, block.time, f"{part}.time", recipe.time.zone, recipe.time.epoch)
    note = ""
    if position is None:
        note = f"The positions of nav/{part.removeprefix('poses.')} are linear between those of the receiver."
    elif ids is not None:
        frame, first = _rows_of_frames(ids)
        values["position"] = position.values
        for one in values.values():
            differs = np.abs(one - one[first][frame]).max(axis=1) > SAME
            _refuse_differing(table, differs, frame, first, ids, "pose", part)
        if block.attitude.yaw_from_bearing is not None:
            bearing, of = block.attitude.yaw_from_bearing, f"{part}.attitude.yaw_from_bearing"
            yaw, note = _yaw_from_bearing(table, bearing, of, position, frame, first)
            values["attitude"] = np.column_stack([values["attitude"], yaw[frame]])
        values, ids = {name: one[first] for name, one in values.items()}, ids[first]
        position = position._replace(values=values["position"])
    attitude = values["attitude"]
    rotation = (
        euler_to_matrix(*attitude.T) if block.attitude.quaternion is None else quaternion_to_matrix(attitude)
    )
    if block.attitude.axes == "flu-enu":
        rotation = R_NED_ENU @ rotation @ FLIP
    columns: dict[str, Any] = named(QUATERNION, matrix_to_quaternion(rotation).T)
    if "velocity" in values:
        columns |= named(VELOCITY, values["velocity"].T)
    if ids is not None:
        columns["frame_id"] = ids
    if "spreads" in values:
        horizontal, vertical, tilt, heading = values["spreads"].T
        P = pose_covariance(horizontal, vertical, tilt, heading, rotation)
        columns |= dict(covariance_columns(P))
    return Rows(columns, stamps, position, ids, note)


def _read_attitude(table: RawTable, attitude: Attitude, part: str) -> Array:
    """Quaternions (w, x, y, z), or roll, pitch and (where it is not recovered) yaw."""
    if attitude.quaternion is None:
        angles = (("roll", attitude.roll), ("pitch", attitude.pitch), ("yaw", attitude.yaw))
        return np.column_stack(
            [numbers(table, q, "angle", f"{part}.{name}") for name, q in angles if q is not None]
        )
    q = np.column_stack([plain_numbers(table, name, f"{part}.quaternion") for name in attitude.quaternion])
    if attitude.order == "xyzw":
        q = q[:, [3, 0, 1, 2]]
    norm = np.linalg.norm(q, axis=1)
    table.refuse(
        np.abs(norm - 1) > NORM_TOLERANCE,
        lambda row: f"not normalised: its length is {norm[row]:.4g}",
        "check that these are the parts of a rotation",
        ", ".join(attitude.quaternion),
        f"{part}.quaternion",
    )
    return q * np.array([1, -1, -1, -1]) if attitude.inverse else q


def _read_spreads(table: RawTable, spreads: Spreads, part: str) -> Array:
    """(N, 4) standard deviations: horizontal and vertical position, tilt and heading."""

    def angle(quantity: Quantity | None) -> Array:
        return np.zeros(0) if quantity is None else numbers(table, quantity, "angle", part)

    tilt, heading = angle(spreads.tilt), angle(spreads.heading)
    if spreads.tilt is None:
        tilt, heading = tilt_from_roll_pitch(angle(spreads.roll), angle(spreads.pitch)), angle(spreads.yaw)
    lengths = [numbers(table, q, "length", part) for q in (spreads.horizontal, spreads.vertical)]
    return np.column_stack([*lengths, tilt, heading])


def _rows_of_frames(ids: Text) -> tuple[Indices, Indices]:
    """For each row the number of its frame, and for each frame its first row."""
    frame, _ = pd.factorize(ids)
    _, first = np.unique(frame, return_index=True)
    return frame, first


def _refuse_differing(
    table: RawTable,
    differs: Mask,
    frame: Indices,
    first: Indices,
    ids: Text,
    column: str,
    part: str,
) -> None:
    """Refuse rows (N,) that say something else of their frame than its first row does."""
    table.refuse(
        differs,
        lambda row: (
            f"this row of frame {ids[row]!r} says something else than line {table.lines[first[frame[row]]]}"
        ),
        "give each frame one pose, or more unique columns",
        column,
        part,
    )


def _yaw_from_bearing(
    table: RawTable,
    bearing: YawFromBearing,
    part: str,
    position: RawPosition,
    frame: Indices,
    first: Indices,
) -> tuple[Array, str]:
    """Yaw of each frame (circular mean over its rows), and a sentence about how well the rows agree."""
    latitude = numbers(table, bearing.latitude, "angle", f"{part}.latitude")
    longitude = numbers(table, bearing.longitude, "angle", f"{part}.longitude")
    beside = numbers(table, bearing.minus, "angle", f"{part}.minus")
    from pyproj import Geod  # few recipes need it

    lat, lon, _ = position.values[first][frame].T
    azimuth, *_ = Geod(ellps="WGS84").inv(*np.degrees([lon, lat, longitude, latitude]))
    yaw = np.radians(azimuth) - beside
    if bearing.past_nadir is not None:
        slant = numbers(table, bearing.past_nadir.slant, "angle", f"{part}.past_nadir.slant")
        minus = numbers(table, bearing.past_nadir.minus, "angle", f"{part}.past_nadir.minus")
        yaw = yaw + np.where(slant - minus > np.pi / 2, np.pi, 0)
    mean = np.arctan2(np.bincount(frame, np.sin(yaw)), np.bincount(frame, np.cos(yaw)))
    off = np.degrees(np.angle(np.exp(1j * (yaw - mean[frame]))))
    worst = int(np.argmax(np.abs(off)))
    largest = float(np.abs(off[worst]))
    if largest > bearing.largest_deviation_deg:
        raise table.fail(
            f"its yaw is {largest:.3g} deg from the frame's mean, over {bearing.largest_deviation_deg:g}",
            "look for a wrong sign or column, or frames that are one",
            "yaw",
            part,
            worst,
        )
    return mean, (
        f"The yaw of {len(first)} frames is recovered from {len(frame)} recorded bearings, which agree "
        f"with the mean of their frame to {largest:.3f} deg."
    )


# -- sensors, frames, detections and truth


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


def read_sensors(recipe: Recipe, raw: RawFiles) -> dict[str, Rows]:
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
                columns = named(VELOCITY, read_velocity(rows, block.velocity, "gnss.velocity").T)
        columns |= read_columns(rows, block, name, ON_BOARD[name], may_be_empty=name == "gnss")
        for key in ("satellites", "fix") if isinstance(block, Satellite) else ():
            if (column := getattr(block, key)) is not None:
                columns[key] = plain_numbers(rows, column, f"gnss.{key}", may_be_empty=True)
        stamps = times(rows, block.time, f"{name}.time", recipe.time.zone, recipe.time.epoch)
        found[name] = Rows(columns, stamps, position)
    return found


def read_frames(recipe: Recipe, raw: RawFiles) -> Rows:
    """The images: one per row with its id, or one per unique combination of columns, numbered as they come.
    None at all where the recipe has no frames.

    Raises
    ------
    WildlabError
        Where a column is missing, a cell cannot be read, or rows of one frame differ.
    """
    block = recipe.frames
    if block is None:
        return Rows({"frame_id": np.empty(0, object)}, None, ids=np.empty(0, object))
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
        _refuse_differing(rows, differs, frame, first, of_row, ", ".join(block.unique), "frames")
    table = table.iloc[first].reset_index(drop=True).drop(columns="stamp", errors="ignore")
    return Rows(dict(table), None if stamps is None else stamps[first], ids=of_row)


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
            "move the edges",
            group.column,
            "frames.group",
            row,
        )
    return np.array(group.labels, dtype=object)[np.searchsorted(edges, value)]


def _numbered(prefix: str, n: int) -> list[str]:
    width = len(str(max(n - 1, 0)))
    return [f"{prefix}{i:0{width}d}" for i in range(n)]


def frames_of_rows(
    frames: Rows, recipe: Recipe, block: Block, column: str | None, table: RawTable, part: str
) -> Text | None:
    """For each row of a file the frame it belongs to: by a column, or because the frames are of that file.

    None where neither is the case.
    """
    if column is not None:
        return texts(table, column, f"{part}.frame")
    if recipe.frames is None:
        return None
    same = (block.file, block.separator) == (recipe.frames.file, recipe.frames.separator)
    return frames.ids if same else None


def read_detections(
    block: Detections,
    raw: RawFiles,
    recipe: Recipe,
    part: str,
    frames: Rows,
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
        raise rows.fail("a pixel needs a frame", "name its column", "frame", part)
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
        columns |= named(POSITION, position.T)
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
            "bearings from the bow need a time",
            "name the column of the frame",
            "frame",
            part,
        )
    heading = lens["heading"].reindex(frame).to_numpy()
    unknown = ~np.isfinite(heading)
    rows.refuse(
        unknown,
        lambda row: (
            f"no pose says where the bow points in frame {frame[row]!r}: "
            f"{int(unknown.sum())} of {len(frame)} are so"
        ),
        "give poses, or leave these rows out with `where`",
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
    columns |= named(POSITION, position.T) | read_columns(rows, block, part, _SPREADS, may_be_empty=True)
    return pd.DataFrame(columns)
