"""A target of a flight through the filters: the compiled path against the readable one, and wrong use."""

from __future__ import annotations

import numpy as np
import pytest

from wildlab.analysis.navigate import PUBLISHED_LIKE, navigate_mekf
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
