"""Sensors on board of a recipe: inertial samples, satellite positions, magnetic field, gimbal angles."""

from __future__ import annotations

from dataclasses import dataclass

import pandas as pd

from wildlab.flight.recipe.model import Recipe
from wildlab.flight.recipe.parts import Stamp
from wildlab.flight.recipe.poses import LocalFrame, RawPosition, read_position, read_velocity
from wildlab.flight.recipe.raw import Array, Nanoseconds, RawFiles, RawTable, numbers, plain_numbers, times


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
            ned = places.ned(self.position, "gnss")
            columns |= dict(zip(("north_m", "east_m", "down_m"), ned.T, strict=True))
        return pd.DataFrame(columns | self.columns)


def read_sensors(recipe: Recipe, raw: RawFiles) -> dict[str, SensorRows]:
    """Those of `imu`, `gnss`, `magnetometer` and `gimbal` that the recipe has.

    Raises
    ------
    WildlabError
        Where a column is missing, a cell is not a number or not a time, or no row counts.
    """
    found = {}
    if recipe.imu is not None:
        found["imu"] = _imu(recipe, raw)
    if recipe.gnss is not None:
        found["gnss"] = _gnss(recipe, raw)
    if recipe.magnetometer is not None:
        magnetometer = recipe.magnetometer
        rows = raw.series(magnetometer, "magnetometer")
        columns = {
            f"field_{a}_ut": numbers(rows, getattr(magnetometer.field, a), "field", f"magnetometer.field.{a}")
            for a in "xyz"
        }
        stamps = _stamps(rows, magnetometer.time, recipe, "magnetometer.time")
        found["magnetometer"] = SensorRows(columns, stamps)
    if recipe.gimbal is not None:
        block = recipe.gimbal
        rows = raw.series(block, "gimbal")
        columns = {
            f"{name}_rad": numbers(rows, angle, "angle", f"gimbal.{name}")
            for name, angle in (("pan", block.pan), ("tilt", block.tilt))
        }
        found["gimbal"] = SensorRows(columns, _stamps(rows, block.time, recipe, "gimbal.time"))
    return found


def _stamps(rows: RawTable, time: Stamp, recipe: Recipe, part: str) -> Nanoseconds:
    return times(rows, time, part, recipe.time.zone, recipe.time.epoch)


def _imu(recipe: Recipe, raw: RawFiles) -> SensorRows:
    block = recipe.imu
    if block is None:
        raise ValueError("a recipe without imu")
    rows = raw.series(block, "imu")
    columns = {}
    for axis in "xyz":
        force, rate = getattr(block.force, axis), getattr(block.rate, axis)
        columns[f"f_{axis}_m_s2"] = numbers(rows, force, "acceleration", f"imu.force.{axis}")
        columns[f"w_{axis}_rad_s"] = numbers(rows, rate, "rate", f"imu.rate.{axis}")
    return SensorRows(columns, _stamps(rows, block.time, recipe, "imu.time"))


def _gnss(recipe: Recipe, raw: RawFiles) -> SensorRows:
    block = recipe.gnss
    if block is None:
        raise ValueError("a recipe without gnss")
    rows = raw.series(block, "gnss")
    columns: dict[str, Array] = {}
    if block.velocity is not None:
        velocity = read_velocity(rows, block.velocity, "gnss.velocity")
        columns |= dict(zip(("v_north_m_s", "v_east_m_s", "v_down_m_s"), velocity.T, strict=True))
    for name, quantity in (("horizontal", block.sd_horizontal), ("vertical", block.sd_vertical)):
        if quantity is not None:
            part = f"gnss.sd_{name}"
            columns[f"sd_{name}_m"] = numbers(rows, quantity, "length", part, may_be_empty=True)
    if block.sd_velocity is not None:
        sd = numbers(rows, block.sd_velocity, "speed", "gnss.sd_velocity", may_be_empty=True)
        columns["sd_velocity_m_s"] = sd
    for name, column in (("satellites", block.satellites), ("fix", block.fix)):
        if column is not None:
            columns[name] = plain_numbers(rows, column, f"gnss.{name}", may_be_empty=True)
    position = read_position(rows, block.position, "gnss.position")
    return SensorRows(columns, _stamps(rows, block.time, recipe, "gnss.time"), position)
