"""The worked example of `data/recipes/README.md`, as it stands there, and with its camera in a file."""

import re
import tomllib
from datetime import UTC, datetime
from pathlib import Path

import numpy as np
import pytest

from wildlab.errors import WildlabError
from wildlab.files import sha256
from wildlab.flight.calibration_files import CameraFile, read_camera, write_calibration
from wildlab.flight.checks.check import check_flight, usable_for
from wildlab.flight.clocks import frame_poses, frame_times, truth_at
from wildlab.flight.files import check_model, dump_toml
from wildlab.flight.importing import import_flight
from wildlab.flight.recipes import Recipe
from wildlab.flight.schema import UNITS
from wildlab.flight.store import load_flight
from wildlab.geometry.camera_poses import camera_pose
from wildlab.geometry.georeference import pixel_to_plane
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


def test_the_example_is_a_flight_that_puts_the_boat_where_it_was(example, monkeypatch):
    monkeypatch.setattr("wildlab.flight.checks.check.FEWEST_SCANS", 1)  # it is a short one
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

    _, boat = truth_at(flight.table("truth"), frame_times(flight))
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


CONTENT = tomllib.loads("""
board = {pattern = "chessboard", columns = 9, rows = 6, spacing_m = 0.025}
evidence = {images = 30, views = 28, points = 1512, lens = "k1", rms_px = 0.3, covered = 0.9}
covariance = [[4.0]]
parameter = [{name = "k1", value = -0.1, sd = 0.01, low = -0.12, high = -0.08}]
view = [{name = "a.png", rms_px = 0.3, inverted = true}]

[camera]
name = "Tau2"
width_px = 640
height_px = 512
fx_px = 1159.2
fy_px = 1167.8
cx_px = 313.0
cy_px = 265.0
k1 = -0.1
""")


@pytest.fixture
def folder(example):
    """The example of the recipes' README, its camera in a file."""
    recipe = (example / "recipe.toml").read_text(encoding="utf-8")
    recipe = re.sub(r"\[camera\].*?\n\n", "", recipe, count=1, flags=re.DOTALL)
    (example / "recipe.toml").write_text(f'camera = "camera.toml"\n{recipe}', encoding="utf-8")
    write_calibration(CameraFile.model_validate(CONTENT), example / "camera.toml")
    return example


def test_it_comes_back_as_it_was_written(folder):
    assert read_camera(folder / "camera.toml") == CameraFile.model_validate(CONTENT)


def test_a_recipe_takes_one_that_is_written_by_hand(folder):
    (folder / "camera.toml").write_text(dump_toml({"camera": CONTENT["camera"]}))
    import_flight(folder / "recipe.toml", None, folder / "flight")
    assert load_flight(folder / "flight").manifest.camera.fx_px == 1159.2


def test_a_recipe_takes_it(folder):
    import_flight(folder / "recipe.toml", None, folder / "flight")
    manifest = load_flight(folder / "flight").manifest
    camera = manifest.geometry_camera()
    assert (camera.fx, camera.cy, camera.distortion[0]) == (1159.2, 265.0, -0.1)
    assert manifest.camera.name == "Tau2"
    hashes = {source.file: source.sha256 for source in manifest.sources}
    assert hashes["camera.toml"] == sha256(folder / "camera.toml")


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("fx_px = 1159.2", "fx_px = -1.0", "is -1 px"),
        ("[[4.0]]", "[[4.0, 1.0]]", "covariance"),
        ("cy_px", "cz_px", "camera.cz_px"),
        ("format = 1", "format = 2", "camera.toml, format"),
        ("[board]", "[board", "is not valid TOML"),
    ],
)
def test_a_wrong_one_is_a_sentence(folder, old, new, said):
    path = folder / "camera.toml"
    path.write_text(path.read_text().replace(old, new))
    with pytest.raises(WildlabError) as error:
        import_flight(folder / "recipe.toml", None, folder / "flight")
    assert said in str(error.value) and not (folder / "flight").exists()
