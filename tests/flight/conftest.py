"""A small flight that is right in every respect, for tests that make one thing wrong."""

from __future__ import annotations

import copy
from collections.abc import Callable
from typing import Any

import numpy as np
import pandas as pd
import pytest

from wildlab.flight.manifest import make_manifest
from wildlab.flight.schema import COVARIANCE_COLUMNS
from wildlab.flight.store import Flight

MANIFEST: dict[str, Any] = {
    "name": "small-flight",
    "kind": "logged",
    "origin": {"latitude_deg": 63.4, "longitude_deg": 10.4, "height_m": 40.0},
    "platform": {"name": "X8"},
    "camera": {
        "name": "Tau2",
        "width_px": 640,
        "height_px": 512,
        "fx_px": 1100.0,
        "fy_px": 1100.0,
        "cx_px": 320.0,
        "cy_px": 256.0,
    },
    "time": {"kind": "utc", "epoch": "2024-07-25T04:05:57Z"},
}


@pytest.fixture
def manifest_data() -> dict[str, Any]:
    return copy.deepcopy(MANIFEST)


@pytest.fixture
def make_flight() -> Callable[..., Flight]:
    """``make_flight(clocks={"camera_offset_s": 0.5})``: the small flight, its manifest changed."""

    def make(**changes: Any) -> Flight:
        times = np.arange(0.0, 10.0, 0.5)
        n = len(times)
        nav = pd.DataFrame(
            {
                "time_s": times,
                "north_m": 20.0 * times,
                "east_m": -3.0 * times,
                "down_m": np.full(n, -100.0),
                "q_w": np.cos(0.05 * times),
                "q_x": np.zeros(n),
                "q_y": np.zeros(n),
                "q_z": np.sin(0.05 * times),
            }
        )
        covariance = pd.DataFrame(0.0, index=range(n), columns=list(COVARIANCE_COLUMNS))
        for i, sd in enumerate([2.0, 2.0, 3.0, 0.02, 0.02, 0.04]):
            covariance[f"cov_{i}{i}"] = sd**2
        frames = pd.DataFrame({"frame_id": ["A", "B", "C"], "time_s": [1.0, 2.25, 8.0]})
        detections = pd.DataFrame(
            {
                "detection_id": ["1", "2", "3"],
                "frame_id": ["A", "A", "C"],
                "source": "click",
                "kind": "pixel",
                "u_px": [10.0, 600.0, 320.0],
                "v_px": [20.0, 500.0, 256.0],
                "target_id": ["buoy", "", "boat"],
                "plane_down_m": 0.0,
            }
        )
        truth = pd.DataFrame(
            {
                "target_id": ["buoy", "boat", "boat"],
                "time_s": [np.nan, 0.0, 10.0],
                "north_m": [50.0, 0.0, 100.0],
                "east_m": [5.0, 0.0, 10.0],
                "down_m": [0.0, 0.0, 0.0],
            }
        )
        return Flight(
            make_manifest({**copy.deepcopy(MANIFEST), **changes}),
            {"autopilot": pd.concat([nav, covariance], axis=1)},
            {"frames": frames, "detections": detections, "truth": truth},
        )

    return make
