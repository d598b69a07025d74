"""The study of the large ship: what is computed of a few images."""

import numpy as np
import pandas as pd
import pytest

from tests.studies.claims import checks_of, turn
from wildlab.geometry.georeference import georeference_pixels
from wildlab.reporting.published import load_claims, load_published
from wildlab.studies.large_ship import (
    DETECTOR,
    NEAR_M,
    START_S,
    WITH,
    WITHOUT,
    errors_of,
    merged_times,
    numbers_of,
    photograph,
    time_to_rest,
    track_both,
)
from wildlab.studies.rules import load_rules

#: Means of H table 6.1, m, north and east, about an origin that is not printed: of receiver and detections.
REFERENCE, POSITIONS = (6.6, 16.4), {WITH: (4.8, 12.2), WITHOUT: (3.6, 9.7)}


@pytest.fixture(scope="module")
def taken():
    return photograph("large-ship", 2, 30)


@pytest.fixture(scope="module")
def tracked(taken):
    return track_both(taken)


@pytest.fixture(scope="module")
def numbers(taken, tracked):
    return numbers_of(taken, tracked)


def spread_of(numbers, changes=None):
    """Three flights alike, with some numbers changed."""
    row = dict(numbers) | (changes or {})
    return pd.DataFrame([row] * 3)


def test_segments_are_joined_without_a_pause():
    times = np.array([10.0, 10.5, 11.0, 80.0, 80.5, 200.0])
    groups = np.array(["a", "a", "a", "b", "b", "c"], object)
    assert merged_times(times, groups).tolist() == [0.0, 0.5, 1.0, 1.5, 2.0, 2.5]


def test_the_time_to_rest_is_from_when_on_it_stays_slow():
    times = np.arange(4.0)
    assert time_to_rest(times, np.array([0.1, 0.2, 0.3, 0.1])) == 0.0
    assert time_to_rest(times, np.array([5.0, 0.2, 5.0, 0.1])) == 3.0
    assert np.isnan(time_to_rest(times, np.array([0.1, 0.2, 0.3, 5.0])))
    assert np.isnan(time_to_rest(times, np.array([0.1, 0.2, 0.3, np.nan])))


def test_the_ship_is_as_long_as_printed_from_the_printed_height(taken):
    stated = taken.flight.manifest.geometry_camera()
    assert taken.length == pytest.approx(70 * stated.fx / 100, rel=0.01)


def test_both_tracks_are_of_the_same_images(taken, tracked):
    one, other = tracked[WITH].seen, tracked[WITHOUT].seen
    assert np.array_equal(one.times, other.times)
    assert np.array_equal(one.detected, other.detected)
    still = ~tracked[WITH].marks.moved
    assert np.array_equal(one.uv[still], other.uv[still], equal_nan=True)
    assert one.times[0] == 0
    assert np.diff(one.times).max() < 3.5, "30 images at 10 Hz; no pause of a lap is left"


def test_numbers_are_those_of_the_positions(taken, tracked, numbers):
    seen = tracked[WITH].seen
    points = georeference_pixels(seen.poses, seen.uv, seen.plane_down)[:, :2]
    off = (seen.truth[:, :2] - points)[seen.detected]
    assert numbers[WITH, "mean_north"] == pytest.approx(off[:, 0].mean())
    assert numbers[WITH, "error_of_mean"] == pytest.approx(np.linalg.norm(off.mean(axis=0)))
    assert numbers[WITH, "sd_both"] ** 2 == pytest.approx(
        numbers[WITH, "sd_north"] ** 2 + numbers[WITH, "sd_east"] ** 2
    )
    distance = np.linalg.norm(errors_of(tracked[WITH])[1], axis=1)
    assert numbers[WITH, "mae"] == pytest.approx(distance.mean())
    late = tracked[WITH].seen.times >= START_S
    assert numbers[WITH, "mae_after_start"] == pytest.approx(distance[late].mean())


def test_exact_centres_and_poses_put_the_ship_where_it_is(taken, tracked):
    marks = taken.marks()
    inside = [k for k, shot in enumerate(taken.shots) if shot.seen]
    exact = taken.camera.flight.poses.take(marks.exposure[inside])
    seen = np.array([taken.shots[k].seen[0].uv for k in inside])
    points = georeference_pixels(exact, seen, np.zeros(len(seen)))[:, :2]
    bodies = np.array([taken.camera.flight.bodies(int(marks.exposure[k]))[0].centre for k in inside])
    assert np.allclose(points, bodies[:, :2], atol=1e-6)
    # The receiver is some metres ahead of the ship's middle and a few metres wrong itself.
    truth = np.nanmean(tracked[WITH].seen.truth[:, :2], axis=0)
    assert 2 < np.hypot(*(truth - bodies[:, :2].mean(axis=0))) < 12


def test_moving_brings_centres_nearer(numbers):
    assert numbers[WITH, "pixel_error"] < numbers[WITHOUT, "pixel_error"]
    assert numbers[DETECTOR, "share_cut"] > 0.5
    assert 0 < numbers[DETECTOR, "share_moved"] < 1
    assert numbers[DETECTOR, "detection_rate"] > 0.8


def test_every_number_is_recorded_and_every_published_one_computed(numbers):
    assert all(load_rules("large-ship").unit_of(name) for _, name in numbers)
    printed = load_published("large-ship")
    assert {(subject, name) for name, subject in printed[["name", "subject"]].to_numpy()} <= set(numbers)


def test_claims_follow_the_numbers(numbers):
    good = {
        (WITH, "error_of_mean"): 4.0, (WITHOUT, "error_of_mean"): 7.0,
        (WITH, "sd_north"): 9.0, (WITHOUT, "sd_north"): 8.0,
        (WITH, "sd_east"): 9.0, (WITHOUT, "sd_east"): 8.0,
        (WITH, "sd_true_poses"): 1.0, (WITHOUT, "sd_true_poses"): 1.0,
        (WITH, "share_near_10"): 0.6, (WITHOUT, "share_near_10"): 0.5,
        (WITH, "mae_after_start"): 9.0, (WITHOUT, "mae_after_start"): 12.0,
        (WITH, "time_to_rest"): 9.0, (WITHOUT, "time_to_rest"): np.nan,
        (WITH, "speed_after_start"): 0.2, (WITHOUT, "speed_after_start"): 0.2,
        (DETECTOR, "share_cut"): 0.9, (DETECTOR, "share_moved"): 0.7,
        (DETECTOR, "share_within_5_m"): 0.9, (DETECTOR, "detection_rate"): 1.0,
    }  # fmt: skip
    swapped = {}
    for (subject, name), value in good.items():
        other = {WITH: WITHOUT, WITHOUT: WITH, DETECTOR: DETECTOR}[subject]
        swapped[other, name] = value
    bad = swapped | {
        (WITH, "sd_true_poses"): 12.0, (WITH, "speed_after_start"): 2.0, (DETECTOR, "share_cut"): 0.1,
        (DETECTOR, "share_moved"): 1.0, (DETECTOR, "share_within_5_m"): 0.1,
        (DETECTOR, "detection_rate"): 0.5,
    }  # fmt: skip
    checks = [checks_of("large-ship", spread_of(numbers, one)) for one in (good, bad)]
    assert turn("large-ship", *checks)
    near = checks_of(
        "large-ship", spread_of(numbers, good | {(WITH, "share_near_5"): 0.1, (WITHOUT, "share_near_5"): 0.2})
    )
    held_at = {limit: near["more-near-centre"].holds(float(limit)).all() for limit in NEAR_M[:2]}
    assert held_at == {5: False, 10: True}, "each limit has shares of its own"
    (stated,) = (one["threshold"] for one in load_claims("large-ship") if one["id"] == "more-near-centre")
    assert [stated / 2, stated, 2 * stated] == list(NEAR_M)
    never = checks_of(
        "large-ship", spread_of(numbers, {(WITH, "time_to_rest"): np.nan, (WITHOUT, "time_to_rest"): np.nan})
    )
    assert not never["rest-sooner"].premise.any(), "of a ship that never rests nothing is sooner"
    assert not never["mainly-navigation"].reaches(1.4), "what is left above all is no reduction"


def test_what_scatters_is_that_of_the_worse_of_both(numbers):
    both = {(WITH, "sd_both"): 5.0, (WITHOUT, "sd_both"): 9.0}
    both |= {(WITH, "sd_true_poses"): 3.2, (WITHOUT, "sd_true_poses"): 8.3}
    checks = checks_of("large-ship", spread_of(numbers, both))
    assert checks["mainly-navigation"].measured == pytest.approx(8.3 / 9)
