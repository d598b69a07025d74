"""The worked example of `data/recipes/README.md`, imported exactly as it stands there."""

from __future__ import annotations

import re
import tomllib
from datetime import UTC, datetime
from pathlib import Path

import numpy as np
import pytest

from wildlab.files import sha256
from wildlab.flight.checks.check import check_flight, usable_for
from wildlab.flight.clocks import frame_poses, frame_times, truth_at
from wildlab.flight.files import check_model
from wildlab.flight.recipe.importing import import_flight
from wildlab.flight.recipe.model import Recipe
from wildlab.flight.store import load_flight
from wildlab.flight.units import UNITS
from wildlab.geometry.georeference import pixel_to_plane
from wildlab.geometry.mount import camera_pose
from wildlab.paths import DATA

README = (DATA / "recipes" / "README.md").read_text(encoding="utf-8")


@pytest.fixture
def example(tmp_path: Path) -> Path:
    """A folder with the four tables and the recipe."""
    tables = re.findall(r"`(\w+\.csv)`,.*?```csv\n(.*?)```", README, re.DOTALL)
    assert [name for name, _ in tables] == ["nav.csv", "photos.csv", "clicks.csv", "boat.csv"]
    for name, text in tables:
        (tmp_path / name).write_text(text, encoding="utf-8")
    recipe, *_ = re.findall(r"```toml\n(.*?)```", README, re.DOTALL)
    (tmp_path / "recipe.toml").write_text(recipe, encoding="utf-8")
    return tmp_path


def test_the_example_is_a_flight_that_puts_the_boat_where_it_was(example):
    before = {path.name: path.read_bytes() for path in example.iterdir()}
    import_flight(example / "recipe.toml", None, example / "flight")
    flight = load_flight(example / "flight")
    assert {path.name: path.read_bytes() for path in example.iterdir() if path.is_file()} == before

    manifest = flight.manifest
    assert manifest.time.epoch == datetime(2024, 6, 12, 9, 30, tzinfo=UTC)
    assert manifest.clocks.camera_offset_s == 0.2
    assert {source.file: source.what for source in manifest.sources} == {
        "photos.csv": "",
        "nav.csv": "pose as the autopilot logged it",
        "boat.csv": "GPS of the boat",
        "clicks.csv": "",
    }
    for source in manifest.sources:
        assert source.sha256 == sha256(example / source.file)

    # stamps as the camera had them (11:30 in Oslo is 9:30 in UTC), the offset only on top of them
    np.testing.assert_allclose(flight.table("frames")["time_s"], [1.0, 1.7, 2.4])
    np.testing.assert_allclose(frame_times(flight), [1.2, 1.9, 2.6])
    p, R, _ = frame_poses(flight)
    np.testing.assert_allclose(p, [[-16, 0, -100], [-2, 0, -100], [12, 0, -100]], atol=0.02)

    _, boat = truth_at(flight.table("truth"), frame_times(flight), max_gap_s=2.0)
    np.testing.assert_allclose(boat[0], [[-2.6, 15, 0], [-1.2, 15, 0], [0.2, 15, 0]], atol=0.02)
    p_nc, R_nc = camera_pose(manifest.geometry_mount(), p, R)
    detections = flight.table("detections")
    ground = pixel_to_plane(
        manifest.geometry_camera(),
        detections[["u_px", "v_px"]].to_numpy(),
        p_nc,
        R_nc,
        detections["plane_down_m"].to_numpy(),
    )
    np.testing.assert_allclose(ground, boat[0], atol=0.05)

    assert [one.level for one in check_flight(flight)] == ["note"]
    assert [use.usable for use in usable_for(flight)] == [True, True, False]


def test_every_unit_is_in_the_readme():
    for dimension, units in UNITS.items():
        (row,) = re.findall(rf"^\| {dimension} \| (.*) \|$", README, re.MULTILINE)
        assert set(re.findall(r"`([^`]+)`", row)) == set(units)


def test_the_other_parts_of_the_readme_are_what_a_recipe_may_say():
    """All of them put behind the example make a recipe."""
    parts = re.findall(r"```toml\n(.*?)```", README, re.DOTALL)
    assert len(parts) == 7
    data = tomllib.loads("\n".join(parts))
    data["time"]["epoch"] = datetime(2024, 6, 12, tzinfo=UTC)  # since the times of the parts count from it
    recipe = check_model(Recipe, data, None)
    assert recipe.imu.force.z.negate
    assert recipe.gnss.lever_arm_m == (-0.4, 0.0, -0.1)
    assert recipe.magnetometer.field.z.unit == "mG"
    assert set(recipe.tables) == {"log", "gps"}
    assert recipe.detections[-1].counts_from == "bow"
