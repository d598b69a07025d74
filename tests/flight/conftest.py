"""A small flight that is right in every respect, for tests that make one thing wrong."""

from __future__ import annotations

import copy
from collections.abc import Callable
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest

from wildlab.flight.manifest import make_manifest
from wildlab.flight.recipe.importing import import_flight
from wildlab.flight.schema import COVARIANCE_COLUMNS
from wildlab.flight.store import Flight
from wildlab.flight.toml import dump_toml

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


@dataclass
class Raw:
    """Plain tables and a recipe for them, to be changed by a test and then imported."""

    folder: Path
    tables: dict[str, str]
    recipe: dict[str, Any]

    @property
    def into(self) -> Path:
        return self.folder / "flight"

    def write(self) -> Path:
        (self.folder / "raw").mkdir(exist_ok=True)
        for name, text in self.tables.items():
            (self.folder / "raw" / name).write_text(text, encoding="utf-8")
        path = self.folder / "recipe.toml"
        path.write_text(dump_toml(self.recipe), encoding="utf-8")
        return path

    def run(self) -> Flight:
        return import_flight(self.write(), self.folder / "raw", self.into)

    def replace(self, table: str, old: str, new: str) -> None:
        assert old in self.tables[table]
        self.tables[table] = self.tables[table].replace(old, new)

    def set(self, dotted: str, value: Any) -> None:
        """``set("poses.log.position.latitude.unit", "rad")``; None takes the key out."""
        here: Any = self.recipe
        *parents, last = dotted.split(".")
        for parent in parents:
            here = here[int(parent)] if isinstance(here, list) else here.setdefault(parent, {})
        if value is None:
            del here[last]
        else:
            here[last] = value


@pytest.fixture
def raw(tmp_path: Path) -> Raw:
    """A right recipe: poses by time at 1 Hz, three photos, three clicks, one fixed and one moving target."""
    nav = "time,lat,lon,height,qw,qx,qy,qz\n"
    for second in range(5):
        nav += f"2024-06-12T09:30:0{second}Z,{63.44 + second * 1e-4:.6f},10.4,140,1,0,0,0\n"
    tables = {
        "nav.csv": nav,
        "photos.csv": "photo,time\nA,2024-06-12T09:30:01.5Z\n"
        "B,2024-06-12T09:30:02.0Z\nC,2024-06-12T09:30:03Z\n",
        "clicks.csv": "photo,x,y,what\nA,10,20,boat\nA,600,500,\nC,320,256,buoy\n",
        "buoy.csv": "id,lat,lon,height,sd\nbuoy,63.44,10.401,40,0.02\n",
        "boat.csv": "t,lat,lon,height\n0,63.44,10.4,40\n4,63.4401,10.4,40\n",
    }
    degrees = {name: {"column": name[:3], "unit": "deg"} for name in ("latitude", "longitude")}
    position = {**degrees, "height": {"column": "height", "unit": "m"}}
    recipe = {
        "name": "small",
        "platform": {"name": "X8"},
        "camera": copy.deepcopy(MANIFEST["camera"]),
        "time": {"kind": "utc", "epoch": datetime(2024, 6, 12, 9, 30, tzinfo=UTC)},
        "frames": {"file": "photos.csv", "id": "photo", "time": {"column": "time"}},
        "poses": {
            "log": {
                "file": "nav.csv",
                "time": {"column": "time"},
                "position": copy.deepcopy(position),
                "attitude": {"quaternion": ["qw", "qx", "qy", "qz"], "order": "wxyz"},
            }
        },
        "detections": [
            {
                "source": "click",
                "file": "clicks.csv",
                "frame": "photo",
                "target": "what",
                "pixel": {"u": {"column": "x", "unit": "px"}, "v": {"column": "y", "unit": "px"}},
                "ground": {"height": {"value": 40.0, "unit": "m"}},
            }
        ],
        "truth": [
            {
                "file": "buoy.csv",
                "id": "id",
                "position": copy.deepcopy(position),
                "sd_horizontal": {"column": "sd", "unit": "m"},
            },
            {
                "file": "boat.csv",
                "target": "boat",
                "time": {"column": "t", "format": "elapsed"},
                "position": copy.deepcopy(position),
            },
        ],
    }
    return Raw(tmp_path, tables, recipe)
