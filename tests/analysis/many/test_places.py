"""Detections as places: by their formula, with covariances that errors drawn at random have."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from tests.analysis.robots import believed, boat, robot, robot_flight
from wildlab.analysis.georeference import georeference, observe
from wildlab.analysis.tracks.ground_positions import PlacedScans, _of_ranges, place_scans, view_of
from wildlab.analysis.tracks.scans import Scans, scans_of
from wildlab.flight.store import Flight
from wildlab.geometry.camera import Camera
from wildlab.geometry.camera_poses import CameraPoses, Mount
from wildlab.geometry.frames import euler_to_matrix
from wildlab.geometry.georeference import georeference_pixels
from wildlab.simulation.twins import simulate_twin
from wildlab.tracking.target_model import Scan

NOISE = "[sensors.radar.noise]\nrange_m = 2.0\nazimuth_deg = 1.5\n"


def places(flight: Flight, text: str = "", sensor: str = "radar", source: str | None = None) -> PlacedScans:
    scans, belief = believed(flight, text, sensor, source)
    return place_scans(flight, scans, belief, 0, source)


def test_ranges_and_bearings_lie_where_the_boat_is():
    found = places(robot_flight(range_sd=1e-9, bearing_sd_deg=1e-9))
    assert len(found.scans) > 200 and found.without == 0
    for scan in found.scans[::40]:
        assert np.allclose(scan.platform, robot(np.array([scan.time]))[0], atol=0.01)
        assert np.allclose(scan.z, boat(np.array([scan.time])), atol=0.02)
        assert scan.sees is None


def test_covariances_are_those_of_errors_drawn_at_random():
    scan = places(robot_flight(seconds=30.0), NOISE).scans[20]
    off = scan.z[0] - scan.platform
    rng = np.random.default_rng(0)
    distance = np.hypot(*off) + rng.normal(0, 2.0, 200_000)
    azimuth = np.arctan2(off[1], off[0]) + rng.normal(0, np.radians(1.5), 200_000)
    drawn = np.cov(np.stack([distance * np.cos(azimuth), distance * np.sin(azimuth)]))
    assert np.allclose(scan.R[0], drawn, atol=0.03 * np.trace(drawn))


def test_a_range_no_longer_than_the_drop_tells_no_place():
    """From 100 m up: below that it is noise, and just above it along the line of sight nobody knows much."""
    scans: Any = SimpleNamespace(
        detections=np.array([[[99.0, 0.3], [100.0, 0.3], [100.001, 0.3], [125.0, 0.3]]]),
        drop=np.array([100.0]),
        platform=np.zeros((1, 2)),
    )
    beliefs: Any = SimpleNamespace(noise=np.array([0.5, 0.01]))
    z, R = _of_ranges(scans, beliefs)
    assert np.isnan(z[0, :2]).all() and np.isnan(R[0, :2]).all()
    assert np.linalg.norm(z[0, 3]) == pytest.approx(75.0)
    toward = np.array([np.cos(0.3), np.sin(0.3)])
    along = np.sqrt(np.einsum("i,mij,j->m", toward, R[0, 2:], toward))
    assert np.allclose(along, [0.5 * 100.001 / np.sqrt(100.001**2 - 1e4), 0.5 * 125 / 75])


def test_a_slant_range_tells_less_of_the_place_on_the_level():
    """50 m to what lies 30 m below is 40 m on the level, which change by 5 m where the range does by 4 m."""
    flight = robot_flight(seconds=30.0)
    scans, belief = believed(flight, NOISE)
    scans.detections[..., 0] = 50.0
    high = scans._replace(drop=np.full(len(scans.times), 30.0))
    scan = place_scans(flight, high, belief, 0, None).scans[20]
    off = scan.z[0] - scan.platform
    towards = np.array([off / 40, [-off[1] / 40, off[0] / 40]])
    assert np.hypot(*off) == pytest.approx(40.0)
    assert np.allclose(towards @ scan.R[0] @ towards.T, np.diag([2.5, 40 * np.radians(1.5)]) ** 2)


def test_positions_are_taken_as_they_are():
    noise = "[sensors.radar.noise]\nposition_m = 1.5\n"
    found = places(robot_flight(kind="position", clutter=2, labelled=False), noise)
    assert np.allclose(found.scans[0].R, 1.5**2 * np.eye(2))
    assert {len(one.z) for one in found.scans} == {3}
    assert found.area(100.0) == pytest.approx(np.pi * 100.0**2)
    assert set(found.named) == {frozenset()}
    assert set(places(robot_flight(kind="position"), noise).named) == {frozenset({"boat"})}


@pytest.mark.slow
def test_pixels_are_where_georeferencing_puts_them():
    flight = simulate_twin("large-ship", 1)
    scans = scans_of(flight, str(flight.table("detections")["source"].iloc[0]), 0.0, "autopilot")
    found = places(flight, "", scans.sensor, "autopilot")
    points = georeference(observe(flight, "autopilot"), np.random.default_rng(0))
    points = points.set_index("detection_id")
    rows = np.flatnonzero(np.isfinite(scans.platform).all(axis=1))
    for scan, row in list(zip(found.scans, rows, strict=True))[::50]:
        ids = [one for one in scans.ids[row] if one]
        assert np.allclose(scan.z, points.loc[ids, ["north_m", "east_m"]].to_numpy(float))
        whole = scan.R + scan.shared @ np.swapaxes(scan.shared, 1, 2)
        assert np.allclose(whole[:, 0, 1], points.loc[ids, "cov_ne"].to_numpy(float), rtol=1e-4)


def looking(R_nb: np.ndarray, north_east: tuple[float, float], plane: float) -> Scans:
    """One image without a detection, from 60 m above zero."""
    camera, at = Camera(640, 512, 700.0, 700.0, 320.0, 256.0), np.array([north_east])
    poses = CameraPoses(camera, Mount("down"), np.insert(at, 2, -60.0, axis=1), R_nb[None])
    return Scans("eye", "pixel", np.zeros(1), np.zeros((1, 0, 2)), at, np.zeros((1, 2)), poses=poses,
                 plane_down=np.array([plane]))  # fmt: skip


@pytest.mark.parametrize("tilt_deg", [10.0, 60.0, 85.0])
def test_an_image_shows_what_lies_under_its_pixels(tilt_deg):
    """Also where its upper edge looks past the horizon: rays of pixels are the truth."""
    scans = looking(euler_to_matrix(0.0, np.radians(tilt_deg), 0.0), (5.0, -8.0), 3.0)
    sees = view_of(scans, 0)
    assert sees is not None and scans.poses is not None
    rng = np.random.default_rng(0)
    uv = rng.uniform((-300, -300), (940, 812), (2000, 2))
    ground = georeference_pixels(scans.poses.take(np.zeros(len(uv), int)), uv, np.full(len(uv), 3.0))
    met = np.isfinite(ground).all(axis=1)
    inside = (uv >= 0).all(axis=1) & (uv <= (640, 512)).all(axis=1)
    assert met.sum() > 200 and np.array_equal(sees(ground[met, :2]), inside[met])
    assert not sees(np.array([[-5000.0, -8.0]])).any(), "behind the camera"


def test_how_much_ground_an_image_covers():
    """Straight down from 60 m: 640 x 512 pixels of 60 / 700 m."""
    nothing = np.zeros((0, 2)), np.zeros((0, 2, 2))
    look = Scan(0.0, 0, np.zeros(2), *nothing, view_of(looking(np.eye(3), (0.0, 0.0), 0.0), 0))
    found = PlacedScans("eye", "pixel", [look], [frozenset()], 1.0, 0)
    assert found.area(50.0) == pytest.approx(640 * 512 * (60 / 700) ** 2, rel=0.02)
