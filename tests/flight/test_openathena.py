"""The two shipped recipes on the real data: counts, recovered azimuths, and errors known from elsewhere."""

import tomllib
from collections.abc import Callable
from pathlib import Path

import cv2
import numpy as np
import pandas as pd
import pytest

from wildlab.errors import WildlabError
from wildlab.files import sha256
from wildlab.flight.checks.check import check_flight, usable_for
from wildlab.flight.clocks import frame_poses
from wildlab.flight.files import dump_toml
from wildlab.flight.importing import import_flight
from wildlab.flight.store import Flight, load_flight
from wildlab.geometry.camera_poses import camera_pose
from wildlab.geometry.frames import matrix_to_euler
from wildlab.paths import DATA

RECIPES = DATA / "recipes"
NED = ["north_m", "east_m", "down_m"]


def _import(name: str, source: Path, into: Path) -> Flight:
    before = {path: (path.stat().st_mtime_ns, sha256(path)) for path in source.iterdir()}
    import_flight(RECIPES / f"{name}.toml", source, into)
    assert {path: (path.stat().st_mtime_ns, sha256(path)) for path in source.iterdir()} == before
    flight = load_flight(into)
    for one in flight.manifest.sources:
        assert one.sha256 == before[source / one.file][1]
        assert one.what
    return flight


@pytest.fixture(scope="module")
def f1(shared_data: Callable[..., Path], tmp_path_factory: pytest.TempPathFactory) -> Flight:
    source = shared_data("georeferencing", "openathena-f1")
    return _import("openathena-f1", source, tmp_path_factory.mktemp("f1") / "flight")


@pytest.fixture(scope="module")
def published(shared_data: Callable[..., Path], tmp_path_factory: pytest.TempPathFactory) -> Flight:
    source = shared_data("georeferencing", "openathena")
    return _import("openathena", source, tmp_path_factory.mktemp("published") / "flight")


def _of(flight: Flight, source: str) -> pd.DataFrame:
    detections = flight.table("detections")
    return detections[detections["source"] == source].reset_index(drop=True)


def _ground(flight: Flight, plane_down: np.ndarray) -> np.ndarray:
    """Clicks on a horizontal plane, by OpenCV and a division."""
    clicks, camera = _of(flight, "click"), flight.manifest.geometry_camera()
    frame = pd.Index(flight.table("frames")["frame_id"]).get_indexer(clicks["frame_id"])
    p_nb, R_nb, _ = frame_poses(flight)
    p, R = camera_pose(flight.manifest.geometry_mount(), p_nb[frame], R_nb[frame])
    uv = clicks[["u_px", "v_px"]].to_numpy()[:, None]
    xy = cv2.undistortPoints(uv, camera.matrix, np.array(camera.distortion))[:, 0]
    ray = np.einsum("nij,nj->ni", R, np.column_stack([xy, np.ones(len(xy))]))
    return np.asarray(p + ray * ((plane_down - p[:, 2]) / ray[:, 2])[:, None])


def test_one_flight_as_plain_tables(f1):
    clicks = _of(f1, "click")
    assert len(f1.table("frames")) == len(f1.nav["logged"]) == 41
    assert len(clicks) == 157
    assert (clicks["target_id"] != "").sum() == 103
    assert f1.table("truth")["target_id"].nunique() == len(f1.table("truth")) == 53
    assert list(_of(f1, "openathena")["detection_id"]) == list(clicks["detection_id"])
    assert {one.level for one in check_flight(f1)} == {"note"}
    assert [use.usable for use in usable_for(f1)] == [True, False, False]
    height_above_ground = clicks["plane_down_m"].mean() - f1.nav["logged"]["down_m"].mean()
    assert height_above_ground == pytest.approx(55, abs=2)


def test_errors_against_the_named_markers(f1):
    clicks, truth = _of(f1, "click"), f1.table("truth").set_index("target_id")
    marker = truth.reindex(clicks["target_id"])[NED].to_numpy()
    labelled = (clicks["target_id"] != "").to_numpy()
    error = np.linalg.norm((_ground(f1, marker[:, 2]) - marker)[labelled, :2], axis=1)
    assert len(error) == 103
    assert error.mean() == pytest.approx(2.80, abs=0.01)
    answers = _of(f1, "openathena")[NED].to_numpy()
    assert np.linalg.norm((answers - marker)[labelled, :2], axis=1).mean() == pytest.approx(8.0, abs=0.1)


def test_four_flights_as_published(published):
    clicks = _of(published, "click")
    assert len(published.table("frames")) == len(published.nav["logged"]) == 98
    assert len(clicks) == len(_of(published, "openathena")) == 441
    assert published.table("truth")["target_id"].nunique() == len(published.table("truth")) == 53
    groups = published.table("frames")["group"]
    assert groups.value_counts().to_dict() == {"55m": 41, "70m": 3, "86m": 10, "106m": 44}
    down = published.nav["logged"]["down_m"]
    ground = clicks["plane_down_m"].median()
    for group, height in (("55m", 55), ("70m", 70), ("86m", 86), ("106m", 106)):
        assert ground - down[groups == group].mean() == pytest.approx(height, abs=4)
    assert {one.level for one in check_flight(published)} == {"note"}


def test_the_recovered_azimuths(f1, published):
    """The first flight is among the four, with the azimuths that others recovered from the same rays."""
    _, R_one, _ = frame_poses(f1)
    _, R_four, _ = frame_poses(published)
    chosen = (published.table("frames")["group"] == "55m").to_numpy()
    turn = np.degrees(matrix_to_euler(R_four[chosen]) - matrix_to_euler(R_one))
    turn = (turn + 180) % 360 - 180
    assert np.abs(turn[:, 2]).max() < 0.1
    assert np.abs(turn[:, :2]).max() < 1e-6
    clicks = _of(published, "click").iloc[:157]
    np.testing.assert_allclose(clicks[["u_px", "v_px"]], _of(f1, "click")[["u_px", "v_px"]], atol=0.01)


def test_bearings_that_do_not_agree_are_refused(shared_data, tmp_path):
    """Without the turn for rays past nadir, those of one photo stand half a circle apart."""
    source = shared_data("georeferencing", "openathena")
    recipe = tomllib.loads((RECIPES / "openathena.toml").read_text(encoding="utf-8"))
    del recipe["poses"]["logged"]["attitude"]["yaw_from_bearing"]["past_nadir"]
    (tmp_path / "recipe.toml").write_text(dump_toml(recipe), encoding="utf-8")
    with pytest.raises(WildlabError, match=r"yaw is 1\d\d deg"):
        import_flight(tmp_path / "recipe.toml", source, tmp_path / "flight")
    assert not (tmp_path / "flight").exists()
