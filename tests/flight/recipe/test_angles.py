"""Angles of raw tables: what can be no radians is refused."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from wildlab.errors import WildlabError
from wildlab.flight.recipe.parts import Quantity
from wildlab.flight.recipe.raw import RawTable, numbers


def angles(part: str, values: list[float], unit: str = "rad") -> np.ndarray:
    column = np.array(values)
    table = RawTable(Path("log.csv"), ("a",), {"a": column}, np.arange(2, 2 + len(column)))
    return numbers(table, Quantity(column="a", unit=unit), "angle", part, may_be_empty=True)


@pytest.mark.parametrize(
    ("part", "values"),
    [
        ("poses.log.attitude.roll", [0.1, 3.0, 7.5]),
        ("poses.log.attitude.yaw", [0.2, 1.0, 359.0, 3.0]),
        ("poses.log.attitude.yaw", [90.0, 91.0, 92.0]),
        ("poses.log.attitude.yaw", [np.nan, -178.0, np.nan, 179.0]),
        ("detections.azimuth", [1.0, 200.0, 30.0]),
    ],
)
def test_degrees_that_are_said_to_be_radians_are_refused_with_what_to_write(part, values):
    with pytest.raises(WildlabError, match="no angle") as caught:
        angles(part, values)
    assert caught.value.fix == 'write unit = "deg", if they are in degrees'
    assert caught.value.field == f"a (in [{part}])"
    assert np.allclose(angles(part, values, "deg"), np.radians(values), equal_nan=True)


def test_an_angle_may_be_counted_on_over_whole_turns():
    turns = np.linspace(0.3, 40.0, 500)
    assert np.array_equal(angles("poses.log.attitude.yaw", turns.tolist()), turns)
    wrapped = [3.1, -3.1, 3.0, 6.2, 0.1]
    assert np.array_equal(angles("poses.log.attitude.yaw", wrapped), wrapped)
    assert np.isnan(angles("poses.log.attitude.yaw", [np.nan, np.nan])).all()
