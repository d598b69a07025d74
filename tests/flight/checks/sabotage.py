"""Wrong meanings: what a wrong line of a recipe would have made of a flight.

Each is a function from flight to flight, written from the recipe's side and without the functions that the
checks undo mistakes with.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pandas as pd
from scipy.spatial.transform import Rotation

from wildlab.flight.manifest import replace_in_manifest
from wildlab.flight.store import Flight

NED = ["north_m", "east_m", "down_m"]
QUATERNION = ["q_w", "q_x", "q_y", "q_z"]
Change = Callable[[Flight], Flight]


def with_table(flight: Flight, table: str, change: Callable[[pd.DataFrame], pd.DataFrame]) -> Flight:
    nav, tables = dict(flight.nav), dict(flight.tables)
    if table.startswith("nav/"):
        nav[table[4:]] = change(nav[table[4:]].copy())
    else:
        tables[table] = change(tables[table].copy())
    return Flight(flight.manifest, nav, tables, None)


def manifest_of(flight: Flight, **parts: dict[str, Any]) -> Flight:
    return Flight(replace_in_manifest(flight.manifest, parts), flight.nav, flight.tables, None)


def of_columns(table: str, names: list[str], change: Callable[[np.ndarray], Any]) -> Change:
    """Columns (N, K) of one table as the recipe would have read them."""

    def apply(flight: Flight) -> Flight:
        def rows(data: pd.DataFrame) -> pd.DataFrame:
            data[names] = change(data[names].to_numpy(float))
            return data

        return with_table(flight, table, rows)

    return apply


def columns(table: str, names: list[str], matrix: Any) -> Change:
    return of_columns(table, names, lambda values: values @ np.asarray(matrix, float).T)


def euler(table: str, change: Callable[[np.ndarray], np.ndarray]) -> Change:
    """Roll, pitch, yaw (degrees, (N, 3)) as the recipe would have read them."""

    def turned(q: np.ndarray) -> np.ndarray:
        angles = Rotation.from_quat(q, scalar_first=True).as_euler("ZYX", degrees=True)[:, ::-1]
        read = Rotation.from_euler("ZYX", change(angles)[:, ::-1], degrees=True)
        return np.asarray(read.as_quat(scalar_first=True, canonical=True))

    return of_columns(table, QUATERNION, turned)


def shift(table: str, seconds: float) -> Change:
    return of_columns(table, ["time_s"], lambda t: t + seconds)
