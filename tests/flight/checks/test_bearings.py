"""What a radar's bearings count from, told from the truth."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pandas as pd
import pytest

from wildlab.flight.checks.check import check_flight
from wildlab.flight.store import Flight


def radar_flight(
    make: Callable[..., Flight], reads: Callable[[np.ndarray, np.ndarray], np.ndarray], factor: float = 1.0
) -> Flight:
    """A boat that turns by 150 deg and sees a buoy and clutter; ``reads``: of true bearing and yaw, rad, and
    ranges are multiplied by ``factor``."""
    rng = np.random.default_rng(4)
    t = np.arange(0.0, 100.0)
    yaw = np.radians(20 + 1.5 * t)
    nav = pd.DataFrame(
        {"time_s": t, "north_m": 2.0 * t, "east_m": 0.0, "down_m": 0.0, "q_x": 0.0, "q_y": 0.0}
    )
    flight = make()
    flight.nav.clear()
    flight.nav["gps"] = nav.assign(q_w=np.cos(yaw / 2), q_z=np.sin(yaw / 2))
    flight.tables["frames"] = pd.DataFrame({"frame_id": [f"l{k}" for k in range(100)], "time_s": t})
    flight.tables["truth"] = pd.DataFrame(
        {"target_id": ["buoy"], "time_s": [np.nan], "north_m": 100.0, "east_m": 300.0, "down_m": 0.0}
    )
    to_buoy = np.arctan2(300.0, 100.0 - 2.0 * t) + rng.normal(0, np.radians(0.3), 100)
    distance = np.hypot(300.0, 100.0 - 2.0 * t) + rng.normal(0, 2.0, 100)
    seen = [
        pd.DataFrame(
            {
                "frame_id": flight.tables["frames"]["frame_id"],
                "azimuth_rad": reads(bearing, yaw),
                "range_m": factor * r,
            }
        )
        for bearing, r in ((to_buoy, distance), (rng.uniform(-np.pi, np.pi, 100), np.full(100, 300.0)))
    ]
    detections = pd.concat(seen, ignore_index=True)
    flight.tables["detections"] = detections.assign(
        detection_id=[str(k) for k in range(200)], source="radar", kind="range-bearing"
    )
    return flight


def said(flight: Flight) -> list[str]:
    return [f"{one.sentence} {one.fix}" for one in check_flight(flight) if one.field == "azimuth_rad"]


@pytest.mark.parametrize(
    ("reads", "cause"),
    [
        (lambda bearing, yaw: bearing - yaw, 'counts_from = "bow"'),
        (lambda bearing, yaw: 2 * yaw - bearing, "counts from the bow to the left"),
        (lambda bearing, yaw: bearing - np.pi / 2, "it counts from east"),
    ],
)
def test_what_bearings_count_from_is_named(
    make_flight: Callable[..., Flight],
    reads: Callable[[np.ndarray, np.ndarray], np.ndarray],
    cause: str,
) -> None:
    (sentence,) = said(radar_flight(make_flight, reads))
    assert cause in sentence
    assert "; then it is 5" in sentence  # half are clutter


def test_true_bearings_are_no_finding(make_flight: Callable[..., Flight]) -> None:
    assert said(radar_flight(make_flight, lambda bearing, yaw: bearing)) == []


@pytest.mark.parametrize(
    ("factor", "cause"),
    [
        (0.3048, "the range is in m, and was read as ft"),
        (1 / 0.3048, "the range is in ft, and was read as m"),
    ],
)
def test_a_range_in_another_unit_is_named(
    make_flight: Callable[..., Flight], factor: float, cause: str
) -> None:
    flight = radar_flight(make_flight, lambda bearing, yaw: bearing, factor)
    (sentence,) = said(flight)
    assert cause in sentence
    assert said(radar_flight(make_flight, lambda bearing, yaw: bearing)) == []
