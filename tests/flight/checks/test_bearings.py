"""What a radar's bearings count from, by the truth."""

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


def causes(flight: Flight) -> set[str]:
    return {cause for one in check_flight(flight) if one.field == "azimuth_rad" for cause in one.causes}


@pytest.mark.parametrize(
    ("reads", "factor", "cause"),
    [
        (lambda bearing, yaw: bearing - yaw, 1.0, "counts from the bow"),
        (lambda bearing, yaw: 2 * yaw - bearing, 1.0, "to the left"),
        (lambda bearing, yaw: bearing - np.pi / 2, 1.0, "from east"),
        (lambda bearing, yaw: bearing, 0.3048, "in m,"),
        (lambda bearing, yaw: bearing, 1 / 0.3048, "in ft,"),
        (lambda bearing, yaw: bearing, 1.0, None),
    ],
)
def test_what_bearings_count_from_and_ranges_are_in_is_named(make_flight, reads, factor, cause):
    found = causes(radar_flight(make_flight, reads, factor))
    assert len(found) == (cause is not None) and all(cause in one for one in found)
