"""Velocities of pairs of images by a flight's own tables; features are projected, not found."""

import numpy as np
import pytest

from tests.analysis.conftest import changed
from wildlab.detection.flow import Matches
from wildlab.geometry.georeference import ground_to_pixel
from wildlab.simulation.parameters import load_twin
from wildlab.simulation.scene.flights import SceneFlight
from wildlab.simulation.twins import simulate_twin
from wildlab.studies.optical_flow_velocity import (
    FramePair,
    Reading,
    pair_velocities,
)

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


def test_the_log_alone_says_about_as_much_as_it_claims(flight, seen):
    table = pair_velocities(flight, pairs_of(seen), Reading("autopilot"))
    off = speeds(table)
    sd = np.sqrt(table[["cov_nn", "cov_ee"]].to_numpy())
    assert np.isfinite(off).all()
    assert 0.3 < np.sqrt(((off / sd) ** 2).mean()) < 3
    better = pair_velocities(quiet(flight, seen), pairs_of(seen), true_reading(seen))
    assert np.abs(speeds(better)).mean() < np.abs(off).mean() / 5
