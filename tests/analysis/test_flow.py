"""Velocities of pairs of images by a flight's own tables; features are projected, not found."""

from dataclasses import replace

import numpy as np
import pytest

from tests.analysis.conftest import changed
from wildlab.analysis.flow import (
    USUAL_MOTION,
    FramePair,
    Reading,
    flow_errors,
    pair_velocities,
)
from wildlab.analysis.georeference import assumed_deviations, assumed_pose_covariance
from wildlab.detection.flow import Matches
from wildlab.geometry.frames import euler_to_matrix
from wildlab.geometry.georeference import ground_to_pixel
from wildlab.simulation.parameters import load_twin
from wildlab.simulation.scene.flights import SceneFlight
from wildlab.simulation.twins import simulate_twin

TWIN = "gimballed-ship"
SHIP = np.array([[20.0, 4.0, 0.0], [-20.0, 3.0, 0.0], [0.0, -6.0, 0.0], [10.0, 0.0, 0.0]])


@pytest.fixture(scope="module")
def flight():
    return simulate_twin(TWIN, 3)


@pytest.fixture(scope="module")
def seen():
    return SceneFlight(load_twin(TWIN), 3)


def pairs_of(seen, velocity=(0.0, 0.0), rows=range(10, 140, 13), down=0.0):
    """Exact features of something that moves from where it is at each pair's first image."""
    ship = SHIP + np.array([0.0, 0.0, down])
    found = []
    for row in rows:
        moved = np.append(velocity, 0.0) * (seen.times[row + 1] - seen.times[row])
        one, two = seen.poses.take(row), seen.poses.take(row + 1)
        first = ground_to_pixel(seen.poses.camera, ship, one.p_nc, one.R_nc)
        second = ground_to_pixel(seen.poses.camera, ship + moved, two.p_nc, two.R_nc)
        found.append(FramePair(row, row + 1, Matches(first, second, 0.1)))
    return found


def true_reading(seen, **changes):
    """Nothing of the log but what is true, and the gimbal's angles."""
    given = {"source": "truth", "times": seen.times, "camera": seen.poses.camera, "mount": seen.poses.mount}
    return Reading(**(given | changes))


def quiet(flight, seen):
    """The flight with a gimbal whose log is exact at the exposures."""
    gimbal = flight.gimbal.iloc[: len(seen.times)].assign(
        time_s=seen.times, pan_rad=seen.poses.pan, tilt_rad=seen.poses.tilt
    )
    return changed(flight, gimbal=gimbal)


def speeds(table):
    return table[["v_north_m_s", "v_east_m_s"]].to_numpy()


def test_with_true_poses_the_velocity_is_the_true_one(flight, seen):
    for velocity in ((0.0, 0.0), (4.0, -3.0)):
        found = speeds(pair_velocities(quiet(flight, seen), pairs_of(seen, velocity), true_reading(seen)))
        assert np.allclose(found, velocity, atol=0.15)
        assert np.allclose(found.mean(axis=0), velocity, atol=0.05)


def test_a_deck_is_seen_on_its_own_plane(flight, seen):
    pairs = pairs_of(seen, down=-30.0)
    table = pair_velocities(quiet(flight, seen), pairs, true_reading(seen, plane_down=-30.0))
    assert np.allclose(table[["flow_u", "flow_v"]], table[["camera_u", "camera_v"]], atol=1.0)
    assert np.allclose(speeds(table), 0.0, atol=0.15)
    flat = pair_velocities(quiet(flight, seen), pairs, true_reading(seen))
    assert not np.allclose(speeds(flat), 0.0, atol=0.5)


def test_what_is_stated_of_a_flight_is_what_its_velocities_are_held_to(flight, seen):
    stated = assumed_deviations(flight)
    pose = replace(seen.poses.take(40), R_nb=euler_to_matrix(0.3, 0.2, 1.1), covariance=None)
    found = flow_errors(flight, pose, 0.2, 0.25)
    assert np.allclose(found.pose, assumed_pose_covariance(pose.R_nb, stated))
    assert np.allclose(found.pixel, 0.04 * np.eye(2))
    assert np.allclose(found.flow, 0.8**2 * np.eye(2)), "0.2 px in a quarter of a second are 0.8 px/s"
    usual = {name: np.radians(USUAL_MOTION[name]) ** 2 for name in ("rate_deg_s", "gimbal_rate_deg_s")}
    assert np.allclose(found.rates, usual["rate_deg_s"] * np.eye(3))
    assert np.allclose(found.gimbal_rates, usual["gimbal_rate_deg_s"] * np.eye(2))
    tables = {name: table for name, table in flight.tables.items() if name != "gimbal"}
    assert not flow_errors(replace(flight, tables=tables), pose, 0.2, 0.25).gimbal_rates.any()
    known = np.diag(np.arange(1.0, 7.0))
    assert np.array_equal(flow_errors(flight, replace(pose, covariance=known), 0.2, 0.25).pose, known)


def test_the_log_alone_says_about_as_much_as_it_claims(flight, seen):
    table = pair_velocities(flight, pairs_of(seen), Reading("autopilot"))
    off = speeds(table)
    sd = np.sqrt(table[["cov_nn", "cov_ee"]].to_numpy())
    assert np.isfinite(off).all()
    assert 0.3 < np.sqrt(((off / sd) ** 2).mean()) < 3
    better = pair_velocities(quiet(flight, seen), pairs_of(seen), true_reading(seen))
    assert np.abs(speeds(better)).mean() < np.abs(off).mean() / 5
