"""What the tables of a flight are: every column's name, type, unit and meaning, in one place.

Tables are Parquet files. Extra columns are carried along untouched (`wildlab check` points them out, since an
optional column that is misspelt is an extra one).
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import numpy as np
import pandas as pd

from wildlab.errors import WildlabError

DType = Literal["float", "text"]

#: Detection kinds and the columns each of them must fill.
DETECTION_KINDS: dict[str, tuple[str, ...]] = {
    "pixel": ("u_px", "v_px"),
    "bearing": ("azimuth_rad",),
    # The elevation where it is measured: a level radar has none.
    "range-bearing": ("azimuth_rad", "range_m"),
    "position": ("north_m", "east_m", "down_m"),
    # From optical flow, between the image before and this one.
    "velocity": ("v_north_m_s", "v_east_m_s"),
}

#: Upper triangle of the 6x6 pose covariance, row by row: cov_00, cov_01, ..., cov_55.
COVARIANCE_COLUMNS = tuple(f"cov_{i}{j}" for i in range(6) for j in range(i, 6))


Bounds = tuple[float, float]

#: Physical bounds, wide enough for all that flies or floats with a camera; beyond is a wrong unit, a wrong
#: column or a broken row. Level distance: the local level at the origin is of no use further out, m.
PLACE: Bounds = (-1e6, 1e6)
#: From above the highest balloon to below the deepest place, and what the Earth falls away in `PLACE`, m.
DOWN: Bounds = (-60e3, 100e3)
#: Twice the speed of sound, m/s.
SPEED: Bounds = (-700.0, 700.0)
#: Twice as fast as small gyros measure, rad/s.
TURN: Bounds = (-80.0, 80.0)
#: A hundred times gravity: launches and hard landings stay below, m/s^2.
FELT: Bounds = (-1000.0, 1000.0)
#: What small magnetometers can measure, uT; the Earth's field is a fortieth of it.
MAGNETIC: Bounds = (-2500.0, 2500.0)
#: As far as radars of boats see, m.
RANGE: Bounds = (0.0, 200e3)
#: Twice around, rad.
AROUND: Bounds = (-4 * np.pi, 4 * np.pi)
ABOVE_ZERO: Bounds = (0.0, np.inf)


@dataclass(frozen=True)
class Column:
    """One column. `may_be_nan`: a row without the value is fine; `bounds`: outside, no UAV, boat or animal
    was ever, in the column's unit."""

    name: str
    dtype: DType
    unit: str
    meaning: str
    required: bool = True
    may_be_nan: bool = False
    bounds: Bounds | None = None


@dataclass(frozen=True)
class Table:
    """One table. `together`: groups of optional columns that only make sense all at once."""

    name: str
    meaning: str
    columns: tuple[Column, ...]
    together: tuple[tuple[str, ...], ...] = ()

    @property
    def column_names(self) -> tuple[str, ...]:
        return tuple(column.name for column in self.columns)


def _position(of: str, *, required: bool = True, may_be_nan: bool = False) -> tuple[Column, ...]:
    return tuple(
        Column(
            f"{axis}_m",
            "float",
            "m",
            f"{axis} coordinate of {of} in frame n",
            required,
            may_be_nan,
            DOWN if axis == "down" else PLACE,
        )
        for axis in ("north", "east", "down")
    )


def _velocity() -> tuple[Column, ...]:
    return tuple(
        Column(f"v_{axis}_m_s", "float", "m/s", f"velocity of b towards {axis}", False, True, SPEED)
        for axis in ("north", "east", "down")
    )


_TIME = Column("time_s", "float", "s", "flight time: seconds since the epoch")
_GIMBAL = tuple(
    Column(f"{axis}_rad", "float", "rad", f"gimbal {axis}", False, True, AROUND) for axis in ("pan", "tilt")
)

#: Of a second antenna on the same clock, at the same times: two of them give a heading.
SECOND_COLUMNS = ("second_north_m", "second_east_m", "second_down_m")
#: From b to the (first) antenna and to the second one, in b: x ahead, y right, z down.
LEVER_COLUMNS = (
    *(f"lever_{axis}_m" for axis in "xyz"),
    *(f"second_lever_{axis}_m" for axis in "xyz"),
)
_SECOND = tuple(
    Column(name, "float", "m", f"{name.split('_')[1]} coordinate of a second antenna in frame n", False, True)
    for name in SECOND_COLUMNS
)

NAV = Table(
    "nav",
    "pose of the platform from one source (one table per source, in nav/)",
    (
        _TIME,
        *_position("b"),
        *(
            Column(f"q_{part}", "float", "1", f"{part} of the unit quaternion b -> n (Hamilton)")
            for part in ("w", "x", "y", "z")
        ),
        *_velocity(),
        *(
            Column(
                name,
                "float",
                "m, rad (products)",
                "covariance of (north, east, down, rotation vector in b): R_true = R_logged Exp(delta)",
                required=False,
                may_be_nan=True,
            )
            for name in COVARIANCE_COLUMNS
        ),
        Column("frame_id", "text", "", "the one frame this pose belongs to (no interpolation)", False),
    ),
    together=(("v_north_m_s", "v_east_m_s", "v_down_m_s"), COVARIANCE_COLUMNS),
)

TABLES: dict[str, Table] = {
    table.name: table
    for table in (
        Table(
            "frames",
            "one row per image, or per look of another sensor; one that saw nothing has no detections",
            (
                Column("frame_id", "text", "", "name of the image"),
                Column("time_s", "float", "s", "when it was taken, on the camera's own clock"),
                Column("time_onboard_s", "float", "s", "when the onboard computer stamped it", False, True),
                Column("group", "text", "", "sub-flight it belongs to", required=False),
                Column("sensor", "text", "", "which sensor looked, where there are several", required=False),
                *_GIMBAL,
            ),
            together=(("pan_rad", "tilt_rad"),),
        ),
        Table(
            "gimbal",
            "gimbal angles over time",
            (
                _TIME,
                Column("pan_rad", "float", "rad", "gimbal pan", bounds=AROUND),
                Column("tilt_rad", "float", "rad", "gimbal tilt", bounds=AROUND),
            ),
        ),
        Table(
            "imu",
            "inertial measurements in b",
            (
                _TIME,
                *(
                    Column(f"f_{a}_m_s2", "float", "m/s^2", f"specific force along {a}", bounds=FELT)
                    for a in "xyz"
                ),
                *(
                    Column(f"w_{a}_rad_s", "float", "rad/s", f"angular rate about {a}", bounds=TURN)
                    for a in "xyz"
                ),
            ),
        ),
        Table(
            "magnetometer",
            "magnetic field in b, as measured: what is magnetic on board still in it",
            (
                _TIME,
                *(
                    Column(f"field_{a}_ut", "float", "uT", f"magnetic field along {a}", bounds=MAGNETIC)
                    for a in "xyz"
                ),
            ),
        ),
        Table(
            "gnss",
            "satellite positions",
            (
                _TIME,
                *_position("the antenna"),
                *_velocity(),
                Column(
                    "sd_horizontal_m", "float", "m", "SD of each horizontal axis", False, True, ABOVE_ZERO
                ),
                Column("sd_vertical_m", "float", "m", "SD of the height", False, True, ABOVE_ZERO),
                Column(
                    "sd_velocity_m_s",
                    "float",
                    "m/s",
                    "SD of each axis of the velocity",
                    False,
                    True,
                    ABOVE_ZERO,
                ),
                Column("satellites", "float", "", "satellites the fix is from", False, True),
                Column("fix", "float", "", "kind of fix, as the receiver numbers them", False, True),
                *_SECOND,
                *(
                    Column(name, "float", "m", f"where that antenna is in b, along {name[-3]}", False)
                    for name in LEVER_COLUMNS
                ),
            ),
            together=(
                ("v_north_m_s", "v_east_m_s", "v_down_m_s"),
                SECOND_COLUMNS,
                LEVER_COLUMNS[:3],
                LEVER_COLUMNS[3:],
            ),
        ),
        Table(
            "detections",
            "what was seen in the frames, and other programs' answers to the same",
            (
                Column("detection_id", "text", "", "name of the detection; may occur once per source"),
                Column("frame_id", "text", "", "frame it was seen in"),
                Column("source", "text", "", "who says so"),
                Column("kind", "text", "", " | ".join(DETECTION_KINDS)),
                Column("u_px", "float", "px", "to the right, as the calibration counts", False, True),
                Column("v_px", "float", "px", "downwards", False, True),
                Column("azimuth_rad", "float", "rad", "from north towards east", False, True, AROUND),
                Column("elevation_rad", "float", "rad", "above the horizon", False, True, AROUND),
                Column("range_m", "float", "m", "slant range", False, True, RANGE),
                *_position("the detection", required=False, may_be_nan=True),
                Column("v_north_m_s", "float", "m/s", "its velocity towards north", False, True, SPEED),
                Column("v_east_m_s", "float", "m/s", "its velocity towards east", False, True, SPEED),
                Column("v_cov_nn", "float", "m^2/s^2", "variance of that towards north", False, True),
                Column("v_cov_ne", "float", "m^2/s^2", "covariance of both", False, True),
                Column("v_cov_ee", "float", "m^2/s^2", "variance of that towards east", False, True),
                Column("target_id", "text", "", "target it is of, empty = not known", False),
                Column(
                    "plane_down_m", "float", "m", "down coordinate of the ground there", False, True, DOWN
                ),
                Column("area_px", "float", "px^2", "area of what is seen of it", False, True),
                Column("major_px", "float", "px", "longer axis of the ellipse with its moments", False, True),
                Column("minor_px", "float", "px", "shorter axis of that ellipse", False, True),
                Column("angle_rad", "float", "rad", "of the longer axis, from u towards v", False, True),
                Column("touches_border", "float", "1", "1 if the image's edge cuts it, else 0", False, True),
            ),
            (("v_cov_nn", "v_cov_ne", "v_cov_ee"),),
        ),
        Table(
            "truth",
            "where the targets really were",
            (
                Column("target_id", "text", "", "name of the target"),
                Column(
                    "time_s", "float", "s", "when, on the truth's own clock; NaN = never moves", True, True
                ),
                *_position("the target"),
                Column(
                    "sd_horizontal_m", "float", "m", "SD of each horizontal axis", False, True, ABOVE_ZERO
                ),
                Column("sd_vertical_m", "float", "m", "SD of the height", False, True, ABOVE_ZERO),
            ),
        ),
    )
}


def extra_columns(table: Table, data: pd.DataFrame) -> list[str]:
    """Columns of `data` that the schema does not name."""
    return [str(name) for name in data.columns if name not in table.column_names]


def conform(table: Table, data: pd.DataFrame, file: Path | str, *, ours: bool = False) -> pd.DataFrame:
    """The table with every known column in its type (float64, or text as str), rows numbered from 0.

    `file` is only for the message. Values are not judged here (see `check_flight`), only their shape.

    Parameters
    ----------
    table
        The schema: one of `TABLES`, or `NAV`.
    data
        What was read or computed.
    file
        Where it comes from, for messages.
    ours
        Nobody else holds `data`: columns that have their type already are not copied.

    Returns
    -------
    DataFrame
        With the schema's types.

    Raises
    ------
    WildlabError
        Where a required column is missing, only some of a group of columns are there, or a type is wrong.

    Examples
    --------
    >>> import pandas as pd
    >>> read = pd.DataFrame({"tilt_rad": [0], "pan_rad": [0], "time_s": [1]})
    >>> set(conform(TABLES["gimbal"], read, "gimbal").dtypes.astype(str))
    {'float64'}
    """
    result = data if ours and isinstance(data.index, pd.RangeIndex) else data.reset_index(drop=True)
    if not result.columns.is_unique or not all(isinstance(name, str) for name in result.columns):
        problem = "two columns have the same name, or one has none"
        raise WildlabError(problem, "give each its own name", file=file)
    for column in table.columns:
        if column.name in result.columns:
            if ours and column.dtype == "float" and result[column.name].dtype == np.float64:
                continue
            result[column.name] = _typed(column, result[column.name], file)
        elif column.required:
            raise _missing(column.name, table, file)
    for group in table.together:
        there = [name for name in group if name in result.columns]
        if there and len(there) < len(group):
            lacking = next(name for name in group if name not in there)
            raise WildlabError(
                f"{there[0]!r} is there without it",
                f"add it, or leave out all of {', '.join(group)}",
                file=file,
                field=lacking,
            )
    if table.name == "detections":
        for kind, needed in DETECTION_KINDS.items():
            if (result["kind"] == kind).any():
                for name in needed:
                    if name not in result.columns:
                        raise _missing(name, table, file)
        unknown = sorted(set(result["kind"]) - set(DETECTION_KINDS))
        if unknown:
            raise WildlabError(
                f"{unknown[0]!r} is not a kind of detection",
                f"use one of {', '.join(DETECTION_KINDS)}",
                file=file,
                field="kind",
            )
    return result


def _missing(name: str, table: Table, file: Path | str) -> WildlabError:
    column = next(column for column in table.columns if column.name == name)
    unit = f", {column.unit}" if column.unit not in ("", "1") else ""
    return WildlabError(
        f"this column of the table {table.name!r} is missing",
        f"add it: {column.meaning}{unit}",
        file=file,
        field=name,
    )


def _typed(column: Column, values: pd.Series, file: Path | str) -> pd.Series:
    if column.dtype == "float":
        kinds = pd.api.types
        plain = kinds.is_float_dtype(values) or kinds.is_integer_dtype(values)
        if len(values) and not plain:  # a column without rows has no type of its own
            raise WildlabError(
                f"holds {values.dtype} where numbers are expected",
                "write it as floating point",
                file=file,
                field=column.name,
            )
        return pd.Series(values.to_numpy(dtype=np.float64, na_value=np.nan), name=column.name)
    wrong = next((value for value in values if not isinstance(value, str)), None)
    if len(values) and not values.map(lambda value: isinstance(value, str)).all():
        raise WildlabError(
            f"holds {wrong!r} where text is expected",
            "write every value as text, empty where there is none",
            file=file,
            field=column.name,
        )
    return pd.Series(values.astype(object).to_numpy(), name=column.name, dtype=object)
