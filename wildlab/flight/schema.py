"""What the tables of a flight are, by ``data/tables.toml``: every column's name, type, unit and meaning. And
the units that a recipe may name.

Tables are Parquet files. Extra columns are carried along untouched (`wildlab check` points them out, since an
optional column that is misspelt is an extra one).
"""

from __future__ import annotations

import math
import tomllib
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import numpy as np
import pandas as pd

from wildlab.errors import WildlabError
from wildlab.geometry.frames import STANDARD_GRAVITY
from wildlab.paths import DATA

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

#: Of a second antenna on the same clock, at the same times: two of them give a heading.
SECOND_COLUMNS = ("second_north_m", "second_east_m", "second_down_m")
#: From b to the (first) antenna and to the second one, in b: x ahead, y right, z down.
LEVER_COLUMNS = tuple(f"{which}lever_{axis}_m" for which in ("", "second_") for axis in "xyz")

#: Names of columns that go together, in all tables.
POSITION = ["north_m", "east_m", "down_m"]
VELOCITY = ["v_north_m_s", "v_east_m_s", "v_down_m_s"]
QUATERNION = ["q_w", "q_x", "q_y", "q_z"]
FORCE = ["f_x_m_s2", "f_y_m_s2", "f_z_m_s2"]
RATE = ["w_x_rad_s", "w_y_rad_s", "w_z_rad_s"]
FIELD = ["field_x_ut", "field_y_ut", "field_z_ut"]

Bounds = tuple[float, float]


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


def _expanded(name: str) -> tuple[str, ...]:
    return COVARIANCE_COLUMNS if name == "cov_ij" else (name,)


def _columns(stated: Mapping[str, Mapping[str, Any]], bounds: Mapping[str, Bounds]) -> Iterator[Column]:
    for key, one in stated.items():
        for name in _expanded(key):
            yield Column(
                name,
                "text" if "text" in one else "float",
                one.get("unit", ""),
                one["meaning"],
                "optional" not in one,
                "empty" in one,
                bounds[one["bounds"]] if "bounds" in one else None,
            )


def _read_tables() -> tuple[dict[str, Bounds], dict[str, Table]]:
    """Bounds by name, and tables."""
    stated = tomllib.loads((DATA / "tables.toml").read_text(encoding="utf-8"))
    bounds = {name: (low, high) for name, (low, high) in stated.pop("bounds").items()}
    tables = {
        name: Table(
            name,
            one["meaning"],
            tuple(_columns(one["columns"], bounds)),
            tuple(tuple(c for key in group for c in _expanded(key)) for group in one.get("together", [])),
        )
        for name, one in stated.items()
    }
    return bounds, tables


BOUNDS, TABLES = _read_tables()
NAV = TABLES.pop("nav")


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
            "write text, empty where there is none",
            file=file,
            field=column.name,
        )
    return pd.Series(values.astype(object).to_numpy(), name=column.name, dtype=object)


# -- units, in radians, metres, seconds, pixels, microtesla

Dimension = Literal["angle", "length", "speed", "acceleration", "rate", "pixel", "time", "field"]

UNITS: dict[Dimension, dict[str, float]] = {
    "angle": {"deg": math.radians(1), "rad": 1.0, "deg-e7": math.radians(1e-7)},
    "length": {"m": 1.0, "cm": 0.01, "mm": 0.001, "km": 1000.0, "ft": 0.3048},
    "speed": {"m/s": 1.0, "cm/s": 0.01, "km/h": 1 / 3.6, "ft/s": 0.3048, "kn": 1852 / 3600},
    "acceleration": {"m/s2": 1.0, "g": STANDARD_GRAVITY, "mg": 1e-3 * STANDARD_GRAVITY, "ft/s2": 0.3048},
    "rate": {"rad/s": 1.0, "deg/s": math.radians(1), "mrad/s": 1e-3, "deg/h": math.radians(1) / 3600},
    # A proportion counts from 0 at the left or upper edge to 1 at the other.
    "pixel": {"px": 1.0, "proportion-of-width": math.nan, "proportion-of-height": math.nan},
    # To microtesla.
    "field": {"uT": 1.0, "nT": 1e-3, "T": 1e6, "G": 100.0, "mG": 0.1},
    "time": {"s": 1.0, "ms": 1e-3, "us": 1e-6},
}


def other_units(dimension: Dimension) -> dict[str, float]:
    """The units of a dimension that are not the one that is used inside, with what takes a value to that one.

    Examples
    --------
    >>> sorted(other_units("rate"))
    ['deg/h', 'deg/s', 'mrad/s']
    """
    return {unit: to for unit, to in UNITS[dimension].items() if to != 1}


def factor(unit: str, dimension: Dimension, width_px: float = math.nan, height_px: float = math.nan) -> float:
    """What to multiply by; the size of the image is only needed for proportions of it.

    Raises
    ------
    ValueError
        ``"problem; fix"`` where the unit is not one, or not one of this dimension.
    """
    if unit not in UNITS[dimension]:
        known = ", ".join(UNITS[dimension])
        elsewhere = [name for name, units in UNITS.items() if unit in units]
        what = (
            f"{unit!r} is a unit of {elsewhere[0]}, not of {dimension}"
            if elsewhere
            else f"{unit!r} is not a unit"
        )
        raise ValueError(f"{what}; use one of {known}")
    if unit == "proportion-of-width":
        return width_px
    if unit == "proportion-of-height":
        return height_px
    return UNITS[dimension][unit]
