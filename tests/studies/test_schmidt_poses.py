"""Pose noise from a followed target whose positions are known comes back; numbers of poses and flights."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from scipy.spatial.transform import Rotation

from wildlab.analysis.navigate import PUBLISHED_LIKE, NavigationErrors, errors_against, navigate_mekf
from wildlab.analysis.tracks.pixels import PixelMeasurements, read_pixels
from wildlab.flight.store import Flight
from wildlab.geometry.camera import project
from wildlab.geometry.frames import euler_to_matrix, rotation_vector_to_matrix
from wildlab.geometry.georeference import georeference_pixels
from wildlab.simulation.twins import simulate_twin
from wildlab.studies.schmidt import (
    APART_S,
    TURNING,
    estimated_covariance,
    flight_numbers,
    pauses,
    pose_numbers,
    premise_numbers,
)


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
    found = estimated_covariance(flight, disturbed(exact, degrees))
    assert np.degrees(np.sqrt(np.diag(found)[3:5])) == pytest.approx(degrees, rel=0.2)


def test_what_a_target_cannot_tell_stays_where_the_poses_put_it(flight, exact):
    """Position and pixel beside a degree of tilt from hundreds of metres."""
    found = estimated_covariance(flight, disturbed(exact, 3.0))
    assert np.sqrt(np.diag(found)[:2]) == pytest.approx(1.0, rel=0.5)


def test_one_image_in_a_while_is_enough(flight, exact):
    seen = disturbed(exact, 1.0)
    kept, last = np.zeros(len(seen.times), bool), -1
    for row in np.flatnonzero(seen.detected):
        slot = int((seen.times[row] - seen.times[0]) // APART_S)
        kept[row], last = slot != last, slot
    few = seen._replace(positions=np.where(kept[:, None], seen.positions, np.nan))
    assert np.array_equal(estimated_covariance(flight, few), estimated_covariance(flight, seen))
    assert kept.sum() < 0.3 * seen.detected.sum()


@pytest.fixture(scope="module")
def fast() -> Flight:
    one = simulate_twin("fast-vessel", 3)
    one.nav["mekf"] = navigate_mekf(one, tuning=PUBLISHED_LIKE).nav
    return one


@pytest.fixture(scope="module")
def fast_seen(fast: Flight) -> PixelMeasurements:
    return read_pixels(fast, "mekf")


@pytest.fixture(scope="module")
def own(fast: Flight, fast_seen: PixelMeasurements) -> NavigationErrors:
    return errors_against(fast.nav["truth"], fast.nav["mekf"], fast_seen.times)


def test_numbers_of_poses_are_in_metres_and_degrees():
    error, sd = np.zeros((4, 9)), np.ones((4, 9))
    error[:, 0], error[:, 6], sd[:, 8] = [1, -1, 1, np.nan], np.radians(3.0), np.radians(2.0)
    found = pose_numbers(NavigationErrors(np.arange(4.0), error, sd, {}))
    assert found["rms_north"] == 1.0 and found["rms_roll"] == pytest.approx(3.0) and found["rms_down"] == 0.0
    assert found["mean_sd_yaw"] == pytest.approx(2.0) and found["mean_sd_east"] == 1.0


def test_errors_of_the_pose_move_the_target_in_the_image(fast, fast_seen, own):
    """Against projecting it once with the poses and once with the true ones."""
    rows = np.flatnonzero(fast_seen.detected)
    true = read_pixels(fast, "truth").poses.take(rows)
    target = np.column_stack([fast_seen.positions[rows], fast_seen.plane_down[rows]])
    uv = [
        project(poses.camera, np.einsum("nji,nj->ni", poses.R_nc, target - poses.p_nc))
        for poses in (true, fast_seen.poses.take(rows))
    ]
    expected = np.sqrt(np.mean((uv[0] - uv[1]) ** 2))
    found = premise_numbers(fast, fast_seen, "mekf", own)
    assert found["shift_px"] == pytest.approx(expected, rel=0.05)
    assert found["largest_shift_px"] == pytest.approx(np.hypot(*(uv[0] - uv[1]).T).max(), rel=0.05)


def test_how_a_flight_was_flown(fast, fast_seen):
    found = flight_numbers(fast, fast_seen)
    assert found["detections"] == 264 and found["pauses"] == len(pauses(fast_seen)) and found["moving"] == 1
    assert found["settled"] == pytest.approx(fast_seen.times[0] - fast.table("imu")["time_s"].min())
    level = flown(fast, fast_seen, roll=0.0, heading=0.3, course=0.1)
    assert (level["turning"], level["crab"]) == (0.0, pytest.approx(np.degrees(0.2)))
    assert flown(fast, fast_seen, roll=1.1 * TURNING, heading=0.0, course=0.0)["turning"] == 1.0
    north = flown(fast, fast_seen, roll=0.0, heading=3.1, course=-3.1)
    assert north["crab"] == pytest.approx(np.degrees(2 * np.pi - 6.2))


def flown(
    flight: Flight, seen: PixelMeasurements, roll: float, heading: float, course: float
) -> dict[str, float]:
    """`flight_numbers` of an airframe that does the same all the time."""
    truth = flight.nav["truth"].copy()
    q = Rotation.from_matrix(euler_to_matrix(roll, 0.0, heading)).as_quat(scalar_first=True).ravel()
    truth[["q_w", "q_x", "q_y", "q_z"]] = q
    truth["v_north_m_s"], truth["v_east_m_s"] = 20 * np.cos(course), 20 * np.sin(course)
    nav: dict[str, pd.DataFrame] = flight.nav | {"truth": truth}
    return flight_numbers(Flight(flight.manifest, nav, flight.tables), seen)
