"""A target of a flight through the filters: the compiled path against the readable one, and wrong use."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest
from scipy.spatial.transform import Rotation

from wildlab.analysis.navigate import PUBLISHED_LIKE, NavigationErrors, errors_against, navigate_mekf
from wildlab.analysis.pose_noise import (
    TURNING,
    flight_numbers,
    pauses,
    pose_numbers,
    premise_numbers,
)
from wildlab.analysis.tracks.pixels import (
    CvTuning,
    PixelMeasurements,
    evaluate_measurements,
    evaluate_track,
    read_pixels,
    start,
    track_pixels,
    track_positions,
    track_schmidt,
)
from wildlab.flight.store import Flight
from wildlab.geometry.camera import project
from wildlab.geometry.frames import euler_to_matrix
from wildlab.simulation.parameters import load_twin
from wildlab.simulation.twins import simulate, simulate_twin
from wildlab.tracking.kalman import Considered
from wildlab.tracking.run import run_filter
from wildlab.tracking.sensors import POSE, positions

TUNING = CvTuning(acceleration=0.05, position_0=10, velocity_0=10, measurement=7, pixel=30)


@pytest.fixture(scope="module")
def flight() -> Flight:
    one = simulate_twin("fast-vessel", 3)
    one.nav["mekf"] = navigate_mekf(one, tuning=PUBLISHED_LIKE).nav
    return one


@pytest.fixture(scope="module")
def seen(flight: Flight) -> PixelMeasurements:
    return read_pixels(flight, "mekf")


def test_the_truth_of_a_sighting_is_that_of_its_target(flight, seen):
    truth = flight.table("truth")
    assert truth["target_id"].nunique() == 1
    inside = (seen.times >= truth["time_s"].min()) & (seen.times <= truth["time_s"].max())
    for column, name in enumerate(("north_m", "east_m")):
        known = np.interp(seen.times, truth["time_s"], truth[name])
        np.testing.assert_allclose(seen.truth[inside, column], known[inside], atol=0.5)
        # Its velocity sums up to its way.
        steps = seen.truth[inside, 2 + column][:-1] * np.diff(seen.times[inside])
        assert steps.sum() == pytest.approx(known[inside][-1] - known[inside][0], rel=0.1, abs=2.0)


def test_the_sighting_holds_every_frame_between_first_and_last_detection(flight, seen):
    assert seen.detected.sum() == len(flight.table("detections"))
    assert seen.detected[0] and seen.detected[-1]
    assert np.median(np.diff(seen.times)) == pytest.approx(1 / 7.5, rel=0.02)


def test_a_detection_seen_from_the_true_pose_lies_on_the_target():
    # Only the detector's pixels and the error of the receiver on the target are left, where the camera is
    # what is said of it and does not turn against the airframe.
    exact = load_twin("fast-vessel").model_copy(update={"tolerance": None, "camera_sway": None})
    flight = simulate(exact, 3, ("imu", "gnss"))
    assert evaluate_measurements(read_pixels(flight, "truth"))["mae_georeferenced"] < 4.0


def test_the_compiled_filters_are_the_readable_ones(seen):
    begin, assert_close = start(seen, TUNING), np.testing.assert_allclose
    of_pixel = seen.uv, np.eye(2) * TUNING.pixel**2, seen.sensor
    of_place = seen.positions, np.eye(2) * TUNING.measurement**2, positions()
    for follow, measured, pose in (
        (track_positions, of_place, None),
        (track_pixels, of_pixel, None),
        (track_schmidt, of_pixel, Considered(POSE, seen.poses.covariance)),
    ):
        compiled = follow(seen, TUNING)
        readable = run_filter(seen.times, *measured, TUNING.motion, begin, pose=pose)
        assert_close(compiled.x, readable.x, rtol=1e-7, atol=1e-6)
        assert_close(compiled.P, readable.P, rtol=1e-6, atol=1e-6)
        assert_close(compiled.nis, readable.nis, rtol=1e-6, atol=1e-8)
        np.testing.assert_array_equal(compiled.used, readable.used)


def test_without_pose_uncertainty_schmidt_is_the_extended_filter(seen):
    none = np.zeros((len(seen.times), 6, 6))
    np.testing.assert_allclose(
        track_schmidt(seen, TUNING, none).x, track_pixels(seen, TUNING).x, rtol=1e-9, atol=1e-7
    )


def test_the_numbers_are_those_of_the_track(seen):
    track = track_positions(seen, TUNING)
    scored = evaluate_track(seen, track)
    e = seen.truth[:, :2] - track.x[:, :2]
    assert scored.numbers["mae"] == pytest.approx(np.nanmean(np.hypot(*e.T)))
    assert scored.numbers["mean_north"] == pytest.approx(np.nanmean(e[:, 0]))
    one = np.array([row @ np.linalg.solve(P[:2, :2], row) for row, P in zip(e, track.P, strict=True)])
    np.testing.assert_allclose(scored.nees, one, rtol=1e-9)


# --- what poses state and are off by, and how the flight was flown -----------------------------------------


@pytest.fixture(scope="module")
def own(flight: Flight, seen: PixelMeasurements) -> NavigationErrors:
    return errors_against(flight.nav["truth"], flight.nav["mekf"], seen.times)


def test_numbers_of_poses_are_in_metres_and_degrees():
    error, sd = np.zeros((4, 9)), np.ones((4, 9))
    error[:, 0], error[:, 6], sd[:, 8] = [1, -1, 1, np.nan], np.radians(3.0), np.radians(2.0)
    found = pose_numbers(NavigationErrors(np.arange(4.0), error, sd, {}))
    assert found["rms_north"] == 1.0 and found["rms_roll"] == pytest.approx(3.0) and found["rms_down"] == 0.0
    assert found["mean_sd_yaw"] == pytest.approx(2.0) and found["mean_sd_east"] == 1.0


def test_errors_of_the_pose_move_the_target_in_the_image(flight, seen, own):
    """Against projecting it once with the poses and once with the true ones."""
    rows = np.flatnonzero(seen.detected)
    true = read_pixels(flight, "truth").poses.take(rows)
    target = np.column_stack([seen.positions[rows], seen.plane_down[rows]])
    uv = [
        project(poses.camera, np.einsum("nji,nj->ni", poses.R_nc, target - poses.p_nc))
        for poses in (true, seen.poses.take(rows))
    ]
    expected = np.sqrt(np.mean((uv[0] - uv[1]) ** 2))
    found = premise_numbers(flight, seen, "mekf", own)
    assert found["shift_px"] == pytest.approx(expected, rel=0.05)
    assert found["largest_shift_px"] == pytest.approx(np.hypot(*(uv[0] - uv[1]).T).max(), rel=0.05)


def test_how_a_flight_was_flown(flight, seen):
    found = flight_numbers(flight, seen)
    assert found["detections"] == 264 and found["pauses"] == len(pauses(seen)) and found["moving"] == 1
    assert found["settled"] == pytest.approx(seen.times[0] - flight.table("imu")["time_s"].min())
    level = flown(flight, seen, roll=0.0, heading=0.3, course=0.1)
    assert (level["turning"], level["crab"]) == (0.0, pytest.approx(np.degrees(0.2)))
    assert flown(flight, seen, roll=1.1 * TURNING, heading=0.0, course=0.0)["turning"] == 1.0
    north = flown(flight, seen, roll=0.0, heading=3.1, course=-3.1)
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
