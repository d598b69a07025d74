"""A target of a flight through the filters: the compiled path against the readable one, and wrong use."""

import numpy as np
import pytest

from wildlab.errors import WildlabError
from wildlab.flight.store import Flight
from wildlab.pipeline.navigate import PUBLISHED_LIKE, navigate_mekf
from wildlab.pipeline.track import (
    CvTuning,
    Sighting,
    evaluate_measurements,
    evaluate_track,
    follow_pixels,
    follow_positions,
    follow_schmidt,
    sighting,
    start,
)
from wildlab.simulation.parameters import load_twin
from wildlab.simulation.twins import simulate, simulate_twin
from wildlab.tracking.measurement import positions
from wildlab.tracking.run import run_filter
from wildlab.tracking.schmidt import PoseUncertainty

TUNING = CvTuning(acceleration=0.05, position_0=10, velocity_0=10, measurement=7, pixel=30)


@pytest.fixture(scope="module")
def flight() -> Flight:
    one = simulate_twin("fast-vessel", 3)
    one.nav["mekf"] = navigate_mekf(one, tuning=PUBLISHED_LIKE).nav
    return one


@pytest.fixture(scope="module")
def seen(flight: Flight) -> Sighting:
    return sighting(flight, "mekf")


def test_the_truth_of_a_sighting_is_that_of_its_target(flight: Flight, seen: Sighting) -> None:
    assert flight.truth is not None and flight.truth["target_id"].nunique() == 1
    for column, name in enumerate(("north_m", "east_m")):
        known = np.interp(seen.times, flight.truth["time_s"], flight.truth[name])
        inside = (seen.times >= flight.truth["time_s"].min()) & (seen.times <= flight.truth["time_s"].max())
        np.testing.assert_allclose(seen.truth[inside, column], known[inside], atol=0.5)
        # Its velocity sums up to its way.
        steps = seen.truth[inside, 2 + column][:-1] * np.diff(seen.times[inside])
        assert steps.sum() == pytest.approx(known[inside][-1] - known[inside][0], rel=0.1, abs=2.0)


def test_the_sighting_holds_every_frame_between_first_and_last_detection(
    flight: Flight, seen: Sighting
) -> None:
    assert seen.seen.sum() == len(flight.table("detections"))
    assert seen.seen[0] and seen.seen[-1]
    assert np.median(np.diff(seen.times)) == pytest.approx(1 / 7.5, rel=0.02)


def test_a_detection_seen_from_the_true_pose_lies_on_the_target() -> None:
    # Only the detector's pixels and the error of the receiver on the target are left, where the camera is
    # what is said of it and does not turn against the airframe.
    exact = load_twin("fast-vessel").model_copy(update={"tolerance": None, "camera_sway": None})
    flight = simulate(exact, 3, ("imu", "gnss"))
    assert evaluate_measurements(sighting(flight, "truth"))["mae_georeferenced"] < 4.0


def test_the_compiled_filters_are_the_readable_ones(seen: Sighting) -> None:
    begin, pixel_noise = start(seen, TUNING), np.eye(2) * TUNING.pixel**2
    assert seen.poses.covariance is not None
    pose = PoseUncertainty(seen.poses.covariance)
    pairs = [
        (
            follow_positions(seen, TUNING),
            run_filter(
                seen.times,
                seen.positions,
                np.eye(2) * TUNING.measurement**2,
                positions(),
                TUNING.motion,
                begin,
            ),
        ),
        (
            follow_pixels(seen, TUNING),
            run_filter(seen.times, seen.uv, pixel_noise, seen.sensor, TUNING.motion, begin),
        ),
        (
            follow_schmidt(seen, TUNING),
            run_filter(seen.times, seen.uv, pixel_noise, seen.sensor, TUNING.motion, begin, pose=pose),
        ),
    ]
    for compiled, readable in pairs:
        np.testing.assert_allclose(compiled.x, readable.x, rtol=1e-7, atol=1e-6)
        np.testing.assert_allclose(compiled.P, readable.P, rtol=1e-6, atol=1e-6)
        np.testing.assert_allclose(compiled.nis, readable.nis, rtol=1e-6, atol=1e-8)
        np.testing.assert_array_equal(compiled.used, readable.used)


def test_without_pose_uncertainty_schmidt_is_the_extended_filter(seen: Sighting) -> None:
    none = np.zeros((len(seen.times), 6, 6))
    np.testing.assert_allclose(
        follow_schmidt(seen, TUNING, none).x, follow_pixels(seen, TUNING).x, rtol=1e-9, atol=1e-7
    )


def test_the_numbers_are_those_of_the_track(seen: Sighting) -> None:
    track = follow_positions(seen, TUNING)
    scored = evaluate_track(seen, track)
    e = seen.truth[:, :2] - track.x[:, :2]
    assert scored.numbers["mae"] == pytest.approx(np.nanmean(np.hypot(*e.T)))
    assert scored.numbers["mean_north"] == pytest.approx(np.nanmean(e[:, 0]))
    one = np.array([row @ np.linalg.solve(P[:2, :2], row) for row, P in zip(e, track.P, strict=True)])
    np.testing.assert_allclose(scored.nees, one, rtol=1e-9)


def test_a_target_that_nothing_names_is_refused(flight: Flight) -> None:
    with pytest.raises(WildlabError, match="'whale'"):
        sighting(flight, "truth", "whale")


def test_several_targets_are_a_choice(flight: Flight) -> None:
    two = simulate_twin("crossing-vessels", 1, ("imu", "gnss"))
    with pytest.raises(WildlabError, match="2 targets"):
        sighting(two, "autopilot")


def test_poses_without_covariance_are_no_input_for_schmidt(flight: Flight) -> None:
    with pytest.raises(WildlabError, match="no covariance"):
        follow_schmidt(sighting(flight, "autopilot"), TUNING)
