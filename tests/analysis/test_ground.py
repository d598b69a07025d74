"""Detections on terrain: marks on hills are found where they are, and every ray is accounted for."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pandas as pd
from scipy.ndimage import gaussian_filter

from tests.analysis.building import manifest_of, poses_table, surveyed
from wildlab.analysis.accuracy import judge_accuracy
from wildlab.analysis.georeference import georeference, observe
from wildlab.analysis.tracks.pixels import read_pixels
from wildlab.flight.checks.check import check_flight
from wildlab.flight.clocks import truth_deviations
from wildlab.flight.store import Flight
from wildlab.geometry.camera import Camera
from wildlab.geometry.camera_poses import CameraPoses
from wildlab.geometry.frames import euler_to_matrix, rotation_vector_to_matrix
from wildlab.geometry.georeference import Terrain, pixels_to_terrain
from wildlab.simulation.twins import simulate_twin

MANIFEST = manifest_of(
    Camera(640, 512, 700.0, 700.0, 320.0, 256.0),
    time={"kind": "sequence"},
    origin={"latitude_deg": 61.0, "longitude_deg": 15.0, "height_m": 300.0},
    mount={"looks": "down", "tilt_deg": 40.0},
    uncertainty={"pixel_px": 1.0, "position_horizontal_m": 1.0, "position_vertical_m": 1.0,
                 "tilt_deg": 0.5, "heading_deg": 1.0, "plane_height_m": 0.3},
)  # fmt: skip


def hills(seed: int = 0) -> Terrain:
    height = 40 * 14 * gaussian_filter(np.random.default_rng(seed).normal(size=(150, 150)), 12)
    return Terrain(height.astype(np.float32), -450.0, -450.0, 6.0)


def holed() -> Terrain:
    height = hills().height.copy()
    height[60:95, 60:] = np.nan
    return replace(hills(), height=height)


def flown(noise: float = 0.0, per_image: int = 6) -> Flight:
    """Marks on hills in 25 images, poses wrong by noise times what is stated."""
    ground, n = hills(), 25
    rng = np.random.default_rng(5)
    at = rng.uniform(-120, 120, (n, 2))
    p = np.column_stack([at, -(ground.heights_at(at) + 80)])
    R = euler_to_matrix(np.zeros(n), np.zeros(n), rng.uniform(-3, 3, n))
    poses = CameraPoses(MANIFEST.geometry_camera(), MANIFEST.geometry_mount(), p, R)
    rows, marks = [], []
    for i in range(n):
        uv = rng.uniform([20, 20], [620, 490], (per_image, 2))
        points = pixels_to_terrain(poses.take(np.full(per_image, i)), uv, ground).points
        for k in np.flatnonzero(np.isfinite(points[:, 0])):
            rows.append((f"d{i}-{k}", f"f{i}", "pixel", *uv[k], f"m{i}-{k}"))
            marks.append(points[k])
    logged_p = p + noise * rng.normal(0, 1.0, p.shape)
    turn = rng.normal(0, 1, (n, 3)) * np.radians([0.5, 0.5, 1.0]) * noise
    nav = poses_table(np.arange(float(n)), logged_p, R @ rotation_vector_to_matrix(turn))
    nav["frame_id"] = [f"f{i}" for i in range(n)]
    names = ["detection_id", "frame_id", "kind", "u_px", "v_px", "target_id"]
    detections = pd.DataFrame(rows, columns=names).assign(source="click")
    detections[["u_px", "v_px"]] += noise * rng.normal(0, 1.0, (len(rows), 2))
    truth = surveyed(detections["target_id"].tolist(), np.array(marks))
    tables = {"frames": nav[["frame_id", "time_s"]].copy(), "detections": detections, "truth": truth}
    return Flight(MANIFEST, {"logged": nav}, tables, None, ground)


def test_with_exact_poses_points_are_the_marks():
    flight = flown()
    seen = observe(flight)
    points = georeference(seen, np.random.default_rng(0))
    marks = flight.table("truth")[["north_m", "east_m", "down_m"]].to_numpy()
    np.testing.assert_allclose(points[["north_m", "east_m", "down_m"]].to_numpy(), marks, atol=1e-6)
    assert pixels_to_terrain(seen.poses, seen.uv, seen.terrain).counts() == {"met the ground": len(points)}


def test_a_ray_without_ground_is_no_sighting():
    flight = flown()
    flight.tables["detections"]["target_id"] = "m0-0"
    flight.terrain = holed()
    lost = np.isnan(observe(flight).plane_down)
    found = read_pixels(flight, "logged")
    assert lost.any() and np.isnan(found.positions[:, 0]).any()
    frames = flight.table("detections")["frame_id"].to_numpy()
    whole = {f for f in set(frames) if lost[frames == f].all()}
    rows = flight.table("frames")["frame_id"].isin(whole).to_numpy()
    assert np.isnan(found.uv[rows]).all() and np.isnan(found.positions[rows]).all()


def test_a_check_holds_the_survey_against_the_map():
    flight, ground = flown(), hills()

    def findings(height: np.ndarray, words: str) -> list[str]:
        flight.terrain = replace(ground, height=height)
        return [one.level for one in check_flight(flight) if words in one.sentence and one.level != "note"]

    assert findings(ground.height, "known points") == []
    assert findings(ground.height + 25, "25.0 m below") == ["warning"]
    assert set(findings(ground.height + 500, "100 %")) == {"problem"}
    assert findings(ground.height[:60], "beyond the border") == ["warning"]
    assert findings(ground.height[:60], "a hole") == []
    # A hole is no border: the map reaches, and knows nothing there.
    holed = ground.height.copy()
    holed[60:] = np.nan
    assert findings(holed, "a hole") == ["warning"]
    assert findings(holed, "beyond the border") == []


def test_what_the_truth_states_of_itself_counts_for_the_ellipses(monkeypatch):
    """By the median of its rows, of which one may be of a bad fix. The cause is not looked for."""
    monkeypatch.setattr("wildlab.analysis.accuracy.diagnose", lambda *_: None)
    flight = simulate_twin("large-ship", 1)
    found = {}
    for sd, worst in ((0.0, 0.0), (100.0, 1e4)):
        truth = flight.table("truth").assign(sd_horizontal_m=sd)
        truth.loc[truth.index[0], "sd_horizontal_m"] = worst
        observations = observe(replace(flight, tables={**flight.tables, "truth": truth}), "autopilot")
        found[sd] = judge_accuracy(observations, np.random.default_rng(0)).ellipses
    stated = truth_deviations(replace(flight, tables={**flight.tables, "truth": truth}), truth["target_id"])
    assert set(stated) == {100.0}
    assert found[0.0].coverage.estimate < 0.9 and found[0.0].factor.estimate > 1
    assert found[100.0].coverage.estimate == 1 and found[100.0].factor.estimate < 0.5
