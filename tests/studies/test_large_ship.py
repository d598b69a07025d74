"""The study of the large ship: what is computed of a few images, and that its words turn with its numbers."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest

from wildlab.geometry.georeference import georeference_pixels
from wildlab.reporting.published import load_claims, load_published
from wildlab.studies.large_ship import STUDY, charts, text
from wildlab.studies.large_ship.claims import check_claims, scatter_left
from wildlab.studies.large_ship.readings import BOX, readings_of, readings_table, shots_as_boxes
from wildlab.studies.large_ship.trial import (
    DETECTOR,
    NEAR_M,
    SLIVER,
    START_S,
    UNITS,
    WITH,
    WITHOUT,
    centres_of,
    errors_of,
    follow_both,
    merged_times,
    numbers_of,
    photograph,
    time_to_rest,
)


@pytest.fixture(scope="module")
def taken():
    return photograph("large-ship", 2, 30)


@pytest.fixture(scope="module")
def tracked(taken):
    return follow_both(taken)


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
    assert np.array_equal(one.seen, other.seen)
    still = ~tracked[WITH].marks.moved
    assert np.array_equal(one.uv[still], other.uv[still], equal_nan=True)
    assert one.times[0] == 0
    assert np.diff(one.times).max() < 3.5, "30 images at 10 Hz; no pause of a lap is left"


def test_numbers_are_those_of_the_positions(taken, tracked, numbers):
    seen = tracked[WITH].seen
    points = georeference_pixels(seen.poses, seen.uv, seen.plane_down)[:, :2]
    off = (seen.truth[:, :2] - points)[seen.seen]
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
    bodies = np.array([taken.camera.flight.bodies(int(marks.exposure[k]))[0].centre(0.0) for k in inside])
    assert np.allclose(points, bodies[:, :2], atol=1e-6)
    # The receiver is some metres ahead of the ship's middle and a few metres wrong itself.
    truth = np.nanmean(tracked[WITH].seen.truth[:, :2], axis=0)
    assert 2 < np.hypot(*(truth - bodies[:, :2].mean(axis=0))) < 12


def test_distances_from_the_middle_leave_the_receiver_out(taken, tracked, numbers):
    """About where the rendered ship's centre lies, not the log of the receiver ahead of it."""
    one = tracked[WITH]
    middle, known = centres_of(taken, one), one.seen.seen
    rows = [int(row) for row in one.marks.exposure]
    bodies = [taken.camera.flight.bodies(row)[0].centre(0.0) for row in rows]
    assert np.allclose(middle, np.array(bodies)[:, :2])
    apart = middle - one.seen.truth[:, :2]
    assert numbers[DETECTOR, "receiver_off"] == pytest.approx(np.nanmean(np.linalg.norm(apart, axis=1)))
    points = one.seen.positions[known]
    off = np.linalg.norm(points - middle[known], axis=1)
    for limit in NEAR_M:
        assert numbers[WITH, f"share_near_{limit}"] == pytest.approx((off < limit).mean())
    # What the mean is off from both origins differs by what lies between these.
    mean = (middle[known] - points).mean(axis=0)
    assert numbers[WITH, "centre_error_of_mean"] == pytest.approx(np.linalg.norm(mean))
    assert np.linalg.norm(mean - apart[known].mean(axis=0)) == pytest.approx(numbers[WITH, "error_of_mean"])
    late = one.seen.times >= START_S
    tracked_off = np.linalg.norm(middle - one.track.x[:, :2], axis=1)[late]
    assert numbers[WITH, "centre_mae_after_start"] == pytest.approx(tracked_off.mean())
    assert numbers[WITH, "centre_error_true_poses"] < numbers[WITH, "error_true_poses"] + np.linalg.norm(
        apart[known].mean(axis=0)
    )


def test_slivers_are_counted_apart(taken, tracked, numbers):
    marks = taken.marks(np.nan)
    clear = marks.share >= SLIVER
    assert numbers[DETECTOR, "rate_beyond_sliver"] == pytest.approx(marks.found[clear].mean())
    best = int(np.argmax(np.where(marks.found, marks.share, -1.0)))
    shots = list(taken.shots)
    shots[best] = shots[best]._replace(judged=shots[best].judged._replace(found={}))
    blind = numbers_of(taken._replace(shots=shots), tracked)
    assert blind[DETECTOR, "largest_missed"] == marks.share[best] > SLIVER
    assert blind[DETECTOR, "rate_beyond_sliver"] < numbers[DETECTOR, "rate_beyond_sliver"]


def test_moving_brings_centres_nearer(numbers):
    assert numbers[WITH, "pixel_error"] < numbers[WITHOUT, "pixel_error"]
    assert numbers[DETECTOR, "share_cut"] > 0.5
    assert 0 < numbers[DETECTOR, "share_moved"] < 1
    assert numbers[DETECTOR, "detection_rate"] > 0.8


def test_every_recorded_number_is_computed_and_every_published_one_has_a_subject(numbers):
    assert {name for _, name in numbers} <= set(UNITS)
    printed = load_published("large-ship")
    assert {(subject, name) for name, subject in printed[["name", "subject"]].to_numpy()} <= set(numbers)
    assert all(STUDY.metric_of(*key) is not None for key in numbers)


def test_published_differences_are_those_of_the_table():
    printed = load_published("large-ship").set_index(["name", "subject"])["value"].to_dict()
    for subject in (WITH, WITHOUT):
        pairs = zip(text.POSITIONS["reference"], text.POSITIONS[subject], strict=True)
        apart = [reference - value for reference, value in pairs]
        assert [printed[f"mean_{axis}", subject] for axis in ("north", "east")] == pytest.approx(apart)
        assert printed["error_of_mean", subject] == pytest.approx(np.hypot(*apart), abs=0.06)
        sds = [printed[f"sd_{axis}", subject] for axis in ("north", "east")]
        assert printed["sd_both", subject] == pytest.approx(np.hypot(*sds), abs=0.06)
    table = text.printed_table(printed)
    assert table["compared"].tolist() == ["1.8 and 3.0", "4.2 and 6.7", "as printed", "as printed"]
    assert table["reference"].tolist() == ["6.6", "16.4", "x", "x"]


def test_only_what_no_turn_of_the_scene_changes_is_judged():
    """A turn of the whole scene changes deviations north and east, and leaves their sum as it is."""
    printed = load_published("large-ship")
    turned = printed["name"].str.contains("_north|_east")
    assert turned.sum() == 8
    assert (printed["unjudged"].str.len() > 0).equals(turned)


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
    thresholds = {claim["id"]: claim.get("threshold") for claim in load_claims("large-ship")}

    def held(changes):
        checks = check_claims(spread_of(numbers, changes))
        assert set(checks) == set(thresholds)
        return {
            key: bool(check.holds(None if thresholds[key] is None else float(thresholds[key])).all())
            for key, check in checks.items()
        }

    assert all(held(good).values())
    assert not any(held(bad).values())
    assert float(thresholds["mainly-navigation"]) == pytest.approx(text.HALF_OF_VARIANCE)
    assert float(thresholds["high-success-rate"]) == pytest.approx(text.MISSED)
    near = check_claims(
        spread_of(numbers, good | {(WITH, "share_near_5"): 0.1, (WITHOUT, "share_near_5"): 0.2})
    )
    held_at = {limit: near["more-near-centre"].holds(float(limit)).all() for limit in NEAR_M[:2]}
    assert held_at == {5: False, 10: True}, "each limit has shares of its own"
    stated = float(thresholds["more-near-centre"])
    assert [stated / 2, stated, 2 * stated] == list(NEAR_M)
    never = check_claims(
        spread_of(numbers, {(WITH, "time_to_rest"): np.nan, (WITHOUT, "time_to_rest"): np.nan})
    )
    assert not never["rest-sooner"].premise.any(), "of a ship that never rests nothing is sooner"
    assert not never["mainly-navigation"].reaches(1.4), "what is left above all is no reduction"


def test_words_turn_with_the_numbers(numbers):
    near = {(WITH, "mae_after_start"): 5.0, (WITHOUT, "mae_after_start"): 9.0}
    far = {(WITH, "mae_after_start"): 9.0, (WITHOUT, "mae_after_start"): 5.0}
    assert "nearer on 3 of 3 flights" in " ".join(text.summary(spread_of(numbers, near)))
    assert "nearer on 0 of 3 flights" in " ".join(text.summary(spread_of(numbers, far)))
    calm = {(WITH, "sd_both"): 5.0, (WITHOUT, "sd_both"): 9.0}
    assert "scatter less" in text.summary(spread_of(numbers, calm))[0]
    wild = {(WITH, "sd_both"): 9.0, (WITHOUT, "sd_both"): 5.0}
    assert "scatter no less" in text.summary(spread_of(numbers, wild))[0]
    poses = {(who, "sd_true_poses"): 1.0 for who in (WITH, WITHOUT)} | calm
    assert "from the poses, as the thesis has it" in text.cause_words(spread_of(numbers, poses))
    parts = {(who, "sd_true_poses"): 9.0 for who in (WITH, WITHOUT)} | calm
    assert "the thesis puts it down to the poses" in text.cause_words(spread_of(numbers, parts))
    small = {(WITH, "ellipse_coverage_90"): 0.4, (WITHOUT, "ellipse_coverage_90"): 0.95}
    small[DETECTOR, "share_in_pieces"] = 0.2
    assert "large is too small: adjusted. In 20 %" in text.ellipse_words(spread_of(numbers, small))
    fine = {(who, "ellipse_coverage_90"): 0.9 for who in (WITH, WITHOUT)} | {(DETECTOR, "share_in_pieces"): 0}
    assert text.ellipse_words(spread_of(numbers, fine)).endswith("states of it is too small.")
    apart = pd.concat(
        [spread_of(numbers, fine | {(WITH, "ellipse_coverage_90"): x}).head(1) for x in (0.2, 1.0)]
    )
    said = text.ellipse_words(apart)
    assert "60 % in the image (0 to 100: 90 % lies within)" in said
    assert "do not show that" in said, "two flights that far apart show nothing"
    assert "One flight cannot tell" in text.ellipse_words(spread_of(numbers, fine).head(1))
    rest = {(WITH, "time_to_rest"): 12.0, (WITHOUT, "time_to_rest"): np.nan}
    assert "adjusted after 12 s; not adjusted never (median)" in text.rest_words(spread_of(numbers, rest))
    one_only = {(WITH, "sd_true_poses"): 3.2, (WITHOUT, "sd_true_poses"): 8.3}
    mixed = spread_of(numbers, calm | one_only)  # 0.64 and 0.92: the claim takes the larger
    assert scatter_left(mixed) == pytest.approx(8.3 / 9)
    assert "the thesis puts it down to the poses" in text.cause_words(mixed)
    low = spread_of(numbers, calm | {(who, "sd_true_poses"): 1.0 for who in (WITH, WITHOUT)})
    assert "as the thesis has it" in text.cause_words(low)
    assert "So on 3 of 6 flights" in text.cause_words(pd.concat([mixed, low]))
    alarm = {(DETECTOR, "images"): 10.0, (DETECTOR, "false_alarms_per_image"): 0.1}
    assert "with 3 false alarms" in text.detected_words(spread_of(numbers, alarm))


def test_the_rate_of_detections_has_its_interval_over_flights(numbers):
    rows = [
        spread_of(numbers, {(DETECTOR, "detection_rate"): rate, (DETECTOR, "rate_beyond_sliver"): 1.0}).head(
            1
        )
        for rate in (0.94, 0.97, 1.0)
    ]
    said = text.detected_words(pd.concat(rows))
    assert "In 97.0 % (95 % interval 89.5 to 100.0 %, over flights)" in said
    assert "missed on 1 of 3 flights by the first count, on 3 by the second" in said
    assert "in 100.0 % (on each of 3 flights)" in said, "no interval without width"
    assert "In 94.0 % (one flight)" in text.detected_words(rows[0])
    known = {(DETECTOR, "largest_missed"): 0.004}
    assert "what is missed shows 0.4 % of the ship at most" in text.detected_words(spread_of(numbers, known))
    none = spread_of(numbers, {(DETECTOR, "largest_missed"): np.nan})
    assert "at most" not in text.detected_words(none)


def test_both_origins_are_said(numbers):
    changes = {(who, "mae_after_start"): 13.9 for who in (WITH, WITHOUT)}
    changes |= {(WITH, "centre_mae_after_start"): 9.1, (DETECTOR, "receiver_off"): 6.3}
    published = {("mae_after_start", who): 9.96 for who in (WITH, WITHOUT)}
    said = text.origin_words(spread_of(numbers, changes), published)
    assert "is 6.3 m from the ship's middle" in said
    assert "adjusted 13.9 m from the receiver and 9.1 m from the middle (published 9.96 m" in said
    means = {(WITH, "centre_error_of_mean"): 5.4, (WITH, "centre_error_true_poses"): 2.6}
    assert "from the ship's middle, 5.4 m and" in text.summary(spread_of(numbers, means))[2]
    assert "2.6 m of 5.4 m from the ship's middle" in text.cause_words(spread_of(numbers, means))


def test_rendering_fewer_images_is_a_limit():
    assert text.shown_words(2, 441, 1) == "2 simulated flights, all of their 441 images rendered"
    assert text.limits(441, 1) == text.LIMITS
    assert "Of the 90 images one in 4 is rendered" in text.limits(90, 4)[-1]


def test_each_reading_is_held_against_the_track_of_the_same_images_and_noise():
    plain, half = "as it stands, not adjusted", "every second of these images, not adjusted"
    rows = [
        ("as it stands, adjusted", WITH, plain, 6.0), (plain, WITHOUT, plain, 5.0),
        ("a of (4.7) half of the axis", WITH, plain, 4.0),
        ("every second of these images, adjusted", WITH, half, 7.0), (half, WITHOUT, half, 9.0),
    ]  # fmt: skip
    table = pd.DataFrame(rows, columns=["reading", "subject", "beside", "mae_after_start"])
    assert "2 of 3 readings" in text.readings_words(table), "7 m is nearer than its own 9 m, not than 5 m"
    swapped = table.assign(mae_after_start=[6.0, 5.0, 4.0, 4.5, 3.0])
    assert "1 of 3 readings" in text.readings_words(swapped)


def test_readings_change_one_thing_each(taken, tracked, numbers):
    table = readings_table(taken, readings_of(taken))
    assert table["reading"].is_unique
    subjects = table.set_index("reading")["subject"]
    assert (subjects[table["beside"]] == WITHOUT).all(), "each stands beside a track without the adjustment"
    for row, subject in ((0, WITH), (1, WITHOUT)):
        assert table["mae"].iloc[row] == pytest.approx(numbers[subject, "mae"])
    told = table.set_index("reading")["pixel_error"]
    assert len(set(told.round(9))) > 5
    said = text.readings_words(table)
    best = table[table["subject"] == WITH]["mae_after_start"].min()
    assert f"from {best:.1f} m" in said
    worse = table.assign(mae_after_start=np.where(table["subject"] == WITH, 50.0, 1.0))
    assert "0 of " in text.readings_words(worse)
    boxes = shots_as_boxes(taken.shots)
    assert np.allclose(boxes[0].detections.axes, BOX * taken.shots[0].detections.axes)


def test_figures_say_what_they_show(taken, tracked):
    for shown in (charts.images_shown(taken), charts.positions_shown(tracked), charts.track_shown(tracked)):
        _, name, alt, caption = shown
        assert name.startswith("fig-6-")
        assert "Counterpart of H figure" in caption
        assert len(alt) > 40
    swapped = {WITH: tracked[WITHOUT], WITHOUT: tracked[WITH]}
    titles = [
        charts.track_shown(one)[0].axes[0].get_title(loc="left").split(": ")[1] for one in (tracked, swapped)
    ]
    assert {title.split(",")[0] for title in titles} == {"adjusted", "not adjusted"}
