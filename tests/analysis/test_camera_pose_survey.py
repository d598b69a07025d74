"""A survey whose poses are attitudes of the camera, through the commands: its ellipses hold what they say.

Pinhole and errors are written here: rotations about the level axes and the vertical.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from click.testing import CliRunner
from scipy.spatial.transform import Rotation

from wildlab.analysis.accuracy import used_deviations
from wildlab.analysis.georeference import observe
from wildlab.cli import wildlab
from wildlab.flight.store import load_flight

PHOTOS, FOCAL, MIDDLE = 1000, 1500.0, np.array([1000.0, 750.0])
RECIPE = """name = "survey"
platform = { name = "made up" }
origin = { latitude_deg = 60.0, longitude_deg = 10.0, height_m = 0.0 }
camera = { name = "made up", width_px = 2000, height_px = 1500, fx_px = 1500.0, fy_px = 1500.0, cx_px = 1000.0, cy_px = 750.0 }
mount = { looks = "forward" }
time = { kind = "sequence" }
frames = { file = "photos.csv", id = "photo" }

[poses.log]
file = "photos.csv"
position.north = { column = "north", unit = "m" }
position.east = { column = "east", unit = "m" }
position.down = { column = "down", unit = "m" }
attitude.roll = { value = 0.0, unit = "deg" }
attitude.pitch = { column = "pitch", unit = "deg" }
attitude.yaw = { column = "yaw", unit = "deg" }
SPREADS

[[detections]]
source = "click"
file = "clicks.csv"
frame = "photo"
target = "mark"
pixel = { u = { column = "u", unit = "px" }, v = { column = "v", unit = "px" } }

[[truth]]
file = "marks.csv"
id = "mark"
position.north = { column = "north", unit = "m" }
position.east = { column = "east", unit = "m" }
position.down = { column = "down", unit = "m" }
"""  # noqa: E501
SPREADS = (
    "spreads = { horizontal = { value = 0.5, unit = 'm' }, vertical = { value = 0.8, unit = 'm' }, %s }\n"
)
LINES = {
    "tilt and heading": SPREADS
    % "tilt = { value = 1.0, unit = 'deg' }, heading = { value = 1.0, unit = 'deg' }",
    "roll, pitch and yaw": SPREADS
    % ", ".join(f"{name} = {{ value = 1.0, unit = 'deg' }}" for name in ("roll", "pitch", "yaw")),
    "uncertainty": "[uncertainty]\nposition_horizontal_m = 0.5\nposition_vertical_m = 0.8\npixel_px = 2.0\n"
    "plane_height_m = 1.0\ntilt_deg = 0.6\nheading_deg = 3.0\n",
    "nothing": "",
}
#: Horizontal, vertical (m), tilt, heading (deg): what is stated, and what nobody states is taken to be.
TRUE = {
    "tilt and heading": (0.5, 0.8, 1.0, 1.0),
    "roll, pitch and yaw": (0.5, 0.8, 1.0, 1.0),
    "uncertainty": (0.5, 0.8, 0.6, 3.0),
    "nothing": (2.0, 3.0, 1.0, 2.0),
}


def axes_of(pitch: np.ndarray, yaw: np.ndarray) -> np.ndarray:
    """Right, down and forward of the image in north, east, down, (n, 3, 3) columns."""
    return Rotation.from_euler("ZYX", np.column_stack([yaw, pitch, 0 * yaw])).as_matrix()[..., [1, 2, 0]]


def write_survey(folder: Path, kind: str, pitch_deg: float) -> pd.DataFrame:
    """A photo and a click each; returns the marks, by photo."""
    rng, n = np.random.default_rng(3), PHOTOS
    horizontal, vertical, tilt, heading = TRUE[kind]
    pitch, yaw = np.full(n, np.radians(pitch_deg)), rng.uniform(-np.pi, np.pi, n)
    logged = np.column_stack([rng.uniform(-200, 200, (n, 2)), rng.uniform(-80, -50, n)])
    where = logged + rng.normal(size=(n, 3)) * [horizontal, horizontal, vertical]
    turned, tilted = np.zeros((2, n, 3))
    turned[:, 2] = np.radians(heading) * rng.normal(size=n)
    tilted[:, :2] = np.radians(tilt) * rng.normal(size=(n, 2))
    turn = Rotation.from_rotvec(turned) * Rotation.from_rotvec(tilted)
    uv = rng.uniform([200, 200], [1800, 1300], (n, 2))
    in_camera = np.column_stack([(uv - MIDDLE) / FOCAL, np.ones(n)])
    rays = turn.apply(np.einsum("nij,nj->ni", axes_of(pitch, yaw), in_camera))
    marks = where - rays * (where[:, 2:] / rays[:, 2:])
    marks[:, 2] = rng.normal(0, 1.0, n)  # the survey's height, not the ground's
    names = [f"P{i:04d}" for i in range(n)]
    ned = ["north", "east", "down"]
    photos = pd.DataFrame(logged, columns=ned).assign(photo=names, pitch=pitch_deg, yaw=np.degrees(yaw))
    clicks = pd.DataFrame(uv + rng.normal(0, 2.0, (n, 2)), columns=["u", "v"]).assign(photo=names, mark=names)
    truth = pd.DataFrame(marks, columns=ned).assign(mark=names)
    for name, table in (("photos", photos), ("clicks", clicks), ("marks", truth)):
        table.to_csv(folder / f"{name}.csv", index=False)
    (folder / "recipe.toml").write_text(RECIPE.replace("SPREADS", LINES[kind]))
    return truth.set_index("mark")


@pytest.mark.parametrize(
    ("kind", "pitch_deg"),
    [
        ("tilt and heading", -90.0),
        pytest.param("roll, pitch and yaw", -50.0, marks=pytest.mark.slow),
        pytest.param("uncertainty", -90.0, marks=pytest.mark.slow),
        pytest.param("nothing", -90.0, marks=pytest.mark.slow),
    ],
)
def test_ellipses_through_import_and_georeference(tmp_path, kind, pitch_deg):
    marks = write_survey(tmp_path, kind, pitch_deg)
    recipe, flight_folder, points_file = (tmp_path / name for name in ("recipe.toml", "flight", "points.csv"))
    for call in (
        ["import", recipe, "--out", flight_folder],
        ["georeference", flight_folder, "--out", points_file],
    ):
        ran = CliRunner().invoke(wildlab, list(map(str, call)))
        assert ran.exit_code == 0, ran.output
    points = pd.read_csv(points_file)
    true = marks.loc[points["frame_id"], ["north", "east"]].to_numpy()
    off = points[["north_m", "east_m"]].to_numpy() - true
    C = points[["cov_nn", "cov_ne", "cov_ne", "cov_ee"]].to_numpy().reshape(-1, 2, 2)
    share = (np.einsum("ni,nij,nj->n", off, np.linalg.inv(C), off) <= -2 * np.log(0.1)).mean()
    assert len(off) == PHOTOS and 0.87 <= share <= 0.93
    flight = load_flight(flight_folder)
    used = used_deviations(observe(flight))
    assert np.allclose([used["tilt_deg"], used["heading_deg"]], TRUE[kind][2:])
