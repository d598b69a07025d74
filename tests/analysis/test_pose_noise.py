"""Pose noise from a followed target whose positions are known comes back, and refusals."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from wildlab.analysis.pose_noise import APART_S, covariance_of, estimate_from_sighting
from wildlab.analysis.tracks.pixels import PixelMeasurements, read_pixels
from wildlab.evaluation.pose_noise import KINDS
from wildlab.flight.store import Flight
from wildlab.geometry.frames import rotation_vector_to_matrix
from wildlab.geometry.georeference import georeference_pixels
from wildlab.simulation.twins import simulate_twin


@pytest.fixture(scope="module")
def flight() -> Flight:
    return simulate_twin("drifting-vessel-eight", 1, ("imu", "gnss"))


@pytest.fixture(scope="module")
def exact(flight: Flight) -> PixelMeasurements:
    """The true poses, which state 1 m and 2 deg, and the positions that they give, for the truth."""
    seen = read_pixels(flight, "truth")
    P = np.tile(np.diag(np.square([1.0] * 3 + [np.radians(2.0)] * 3)), (len(seen.times), 1, 1))
    truth = seen.truth.copy()
    truth[:, :2] = seen.positions
    return seen._replace(poses=replace(seen.poses, covariance=P), truth=truth)


def disturbed(exact: PixelMeasurements, degrees: float) -> PixelMeasurements:
    """The same with roll and pitch errors of the airframe, new in each image."""
    rng = np.random.default_rng(1)
    turn = np.column_stack([rng.normal(0, np.radians(degrees), (len(exact.times), 2)), 0 * exact.times])
    poses = replace(exact.poses, R_nb=exact.poses.R_nb @ rotation_vector_to_matrix(turn))
    positions = georeference_pixels(poses, exact.uv, exact.plane_down)[:, :2]
    return exact._replace(poses=poses, positions=positions)


@pytest.mark.parametrize("degrees", [0.5, 1.0, 3.0])
def test_errors_of_attitude_come_back_whatever_the_poses_state(flight, exact, degrees):
    found = estimate_from_sighting(flight, disturbed(exact, degrees))
    assert np.degrees(found.sd["tilt"]) == pytest.approx(degrees, rel=0.2)
    assert found.factor["tilt"] < 1.2


def test_what_a_target_cannot_tell_stays_where_the_poses_put_it(flight, exact):
    """Position and pixel beside a degree of tilt from hundreds of metres."""
    found = estimate_from_sighting(flight, disturbed(exact, 3.0))
    assert found.sd["position_horizontal"] == pytest.approx(1.0, rel=0.5)
    assert found.factor["position_horizontal"] > 2


def test_one_image_in_a_while_is_enough(flight, exact):
    seen = disturbed(exact, 1.0)
    kept, last = np.zeros(len(seen.times), bool), -1
    for row in np.flatnonzero(seen.detected):
        slot = int((seen.times[row] - seen.times[0]) // APART_S)
        kept[row], last = slot != last, slot
    few = seen._replace(positions=np.where(kept[:, None], seen.positions, np.nan))
    assert estimate_from_sighting(flight, few).sd == estimate_from_sighting(flight, seen).sd
    assert kept.sum() < 0.3 * seen.detected.sum()


def test_the_covariance_is_that_of_the_deviations(flight, exact):
    found = estimate_from_sighting(flight, exact)
    level, vertical, tilt, yaw, _ = (found.sd[kind] for kind in KINDS)
    expected = np.square([level, level, vertical, tilt, tilt, yaw])
    np.testing.assert_allclose(covariance_of(found), np.diag(expected))
