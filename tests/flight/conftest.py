"""A small flight that is right in every respect, for tests that make one thing wrong."""

import copy
import io
import re
import tomllib
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest

from wildlab.flight.files import dump_toml
from wildlab.flight.importing import import_flight
from wildlab.flight.manifest import make_manifest
from wildlab.flight.schema import COVARIANCE_COLUMNS
from wildlab.flight.store import Flight

MANIFEST: dict[str, Any] = tomllib.loads("""
name = "small-flight"
kind = "logged"
origin = {latitude_deg = 63.4, longitude_deg = 10.4, height_m = 40.0}
platform = {name = "X8"}
time = {kind = "utc", epoch = "2024-07-25T04:05:57Z"}

[camera]
name = "Tau2"
width_px = 640
height_px = 512
fx_px = 1100.0
fy_px = 1100.0
cx_px = 320.0
cy_px = 256.0
""")


def table(text: str) -> pd.DataFrame:
    """A table as its lines have it; what names or sorts is text."""
    texts = dict.fromkeys(("frame_id", "detection_id", "target_id", "source", "kind", "sensor"), str)
    return pd.read_csv(io.StringIO(text), dtype=texts, keep_default_na=False, na_values=["nan"])


def fault(said: str) -> str:
    """What an error matches that says ``"file, field: problem"``; each may have more about it."""
    return ".*".join(map(re.escape, re.split(", |: ", said)))


@pytest.fixture
def manifest_data() -> dict[str, Any]:
    return copy.deepcopy(MANIFEST)


def small_flight(**changes: Any) -> Flight:
    """``small_flight(clocks={"camera_offset_s": 0.5})``: the small flight, its manifest changed."""
    t = np.arange(0.0, 10.0, 0.5)
    nav = pd.DataFrame({"time_s": t, "north_m": 20.0 * t, "east_m": -3.0 * t, "down_m": -100.0})
    nav = nav.assign(q_w=np.cos(0.05 * t), q_x=0.0, q_y=0.0, q_z=np.sin(0.05 * t))
    covariance = pd.DataFrame(0.0, index=range(len(t)), columns=list(COVARIANCE_COLUMNS))
    for i, sd in enumerate([2.0, 2.0, 3.0, 0.02, 0.02, 0.04]):
        covariance[f"cov_{i}{i}"] = sd**2
    tables = {
        "frames": "frame_id,time_s\nA,1.0\nB,2.25\nC,8.0\n",
        "detections": "detection_id,frame_id,u_px,v_px,target_id\n"
        "1,A,10.0,20.0,buoy\n2,A,600.0,500.0,\n3,C,320.0,256.0,boat\n",
        "truth": "target_id,time_s,north_m,east_m\n"
        "buoy,nan,50.0,5.0\nboat,0.0,0.0,0.0\nboat,10.0,100.0,10.0\n",
    }
    made = {name: table(text) for name, text in tables.items()}
    made["detections"] = made["detections"].assign(source="click", kind="pixel", plane_down_m=0.0)
    made["truth"]["down_m"] = 0.0
    manifest = make_manifest({**copy.deepcopy(MANIFEST), **changes})
    return Flight(manifest, {"autopilot": pd.concat([nav, covariance], axis=1)}, made)


@pytest.fixture
def make_flight() -> Callable[..., Flight]:
    return small_flight


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
        """``set("poses.log.position.latitude.unit", "rad")``; TOML makes a table, None takes the key out."""
        here: Any = self.recipe
        *parents, last = dotted.split(".")
        for parent in parents:
            here = here[int(parent)] if isinstance(here, list) else here.setdefault(parent, {})
        key: Any = int(last) if isinstance(here, list) else last
        if value is None:
            del here[key]
        else:
            here[key] = tomllib.loads(value) if isinstance(value, str) and "=" in value else value


RECIPE = """
name = "small"
platform = {name = "X8"}
time = {kind = "utc", epoch = 2024-06-12T09:30:00Z}
frames = {file = "photos.csv", id = "photo", time = {column = "time"}}

[poses.log]
file = "nav.csv"
time = {column = "time"}
attitude = {quaternion = ["qw", "qx", "qy", "qz"], order = "wxyz"}
[poses.log.position]
latitude = {column = "lat", unit = "deg"}
longitude = {column = "lon", unit = "deg"}
height = {column = "height", unit = "m"}

[[detections]]
source = "click"
file = "clicks.csv"
frame = "photo"
target = "what"
pixel = {u = {column = "x", unit = "px"}, v = {column = "y", unit = "px"}}
ground = {height = {value = 40.0, unit = "m"}}

[[truth]]
file = "buoy.csv"
id = "id"
sd_horizontal = {column = "sd", unit = "m"}
[truth.position]
latitude = {column = "lat", unit = "deg"}
longitude = {column = "lon", unit = "deg"}
height = {column = "height", unit = "m"}

[[truth]]
file = "boat.csv"
target = "boat"
time = {column = "t", format = "elapsed"}
[truth.position]
latitude = {column = "lat", unit = "deg"}
longitude = {column = "lon", unit = "deg"}
height = {column = "height", unit = "m"}
"""


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
    recipe = tomllib.loads(RECIPE) | {"camera": copy.deepcopy(MANIFEST["camera"])}
    return Raw(tmp_path, tables, recipe)
