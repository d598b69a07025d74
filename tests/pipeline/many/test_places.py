"""Detections as places: by their formula, with covariances that errors drawn at random have."""

from __future__ import annotations

import numpy as np
import pytest

from tests.pipeline.robots import boat, robot, robot_flight
from wildlab.errors import WildlabError
from wildlab.flight.store import Flight
from wildlab.pipeline.following.beliefs import of_flight, of_sensor
from wildlab.pipeline.many.places import Places, places_of
from wildlab.pipeline.scans import scans_of
from wildlab.simulation.twins import simulate_twin


def places(flight: Flight, sensor: str = "radar", source: str | None = None) -> Places:
    scans = scans_of(flight, sensor, 0.0, source)
    belief, _ = of_sensor(flight, scans, of_flight(flight))
    return places_of(flight, scans, belief, 0, source)


def test_ranges_and_bearings_lie_where_the_boat_is() -> None:
    found = places(robot_flight(range_sd=1e-9, bearing_sd_deg=1e-9))
    assert len(found.scans) > 200 and found.without == 0
    for scan in found.scans[::40]:
        assert np.allclose(scan.platform, robot(np.array([scan.time]))[0], atol=0.01)
        assert np.allclose(scan.z, boat(np.array([scan.time])), atol=0.02)
        assert scan.view is None


def test_covariances_are_those_of_errors_drawn_at_random() -> None:
    noise = {"sensors": {"radar": {"noise": {"range_m": 2.0, "azimuth_deg": 1.5}}}}
    flight = robot_flight(seconds=30.0, manifest=noise)
    scan = places(flight).scans[20]
    off = scan.z[0] - scan.platform
    rng = np.random.default_rng(0)
    distance = np.hypot(*off) + rng.normal(0, 2.0, 200_000)
    azimuth = np.arctan2(off[1], off[0]) + rng.normal(0, np.radians(1.5), 200_000)
    drawn = np.cov(np.stack([distance * np.cos(azimuth), distance * np.sin(azimuth)]))
    assert np.allclose(scan.R[0], drawn, atol=0.03 * np.trace(drawn))


def test_positions_are_taken_as_they_are() -> None:
    noise = {"sensors": {"radar": {"noise": {"position_m": 1.5}}}}
    found = places(robot_flight(kind="position", clutter=2, labelled=False, manifest=noise))
    assert np.allclose(found.scans[0].R, 1.5**2 * np.eye(2))
    assert {len(one.z) for one in found.scans} == {3}
    assert [len(ids) for ids in found.ids] == [3] * len(found.scans)


@pytest.mark.slow
def test_pixels_are_where_georeferencing_puts_them_and_images_show_a_part_of_the_ground() -> None:
    flight = simulate_twin("large-ship", 1)
    name = str(flight.table("detections")["source"].iloc[0])
    found = places(flight, name, "autopilot")
    from wildlab.pipeline.georeference import georeference, observe

    points = georeference(flight, observe(flight, "autopilot"), np.random.default_rng(0))
    points = points.set_index("detection_id")
    for scan, ids in list(zip(found.scans, found.ids, strict=True))[::50]:
        if ids:
            assert np.allclose(scan.z, points.loc[ids, ["north_m", "east_m"]].to_numpy(float))
            assert np.allclose(scan.R[:, 0, 1], points.loc[ids, "cov_ne"].to_numpy(float))
    views = [one.view for one in found.scans if one.view is not None]
    assert views and 100 < found.area(1e9) < 1e6


@pytest.mark.parametrize("kind", ["bearing", "velocity"])
def test_what_tells_no_place_is_refused(kind: str) -> None:
    flight = robot_flight(kind=kind)
    scans = scans_of(flight, "radar")
    belief, _ = of_sensor(flight, scans, of_flight(flight))
    with pytest.raises(WildlabError, match="tells no place alone"):
        places_of(flight, scans, belief, 0, None)
