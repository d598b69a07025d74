"""What the study of vessel detection computes."""

import numpy as np
import pandas as pd
import pytest

from tests.studies.claims import checks_of
from wildlab.detection.floating import FloatingObjects, FloatingThresholds, find_objects
from wildlab.evaluation.intervals import share_interval
from wildlab.evaluation.shares import FAILS, HOLDS, UNDECIDED, decide_check
from wildlab.geometry.camera import Camera
from wildlab.geometry.camera_poses import R_MC_DOWN
from wildlab.reporting.published import load_claims, load_published
from wildlab.simulation.scene.flights import IDEAL, expose, sensor_of
from wildlab.simulation.scene.render import EVEN, Scene, rectangle, render
from wildlab.studies.rules import load_rules
from wildlab.studies.vessel_detection import (
    BOATS,
    CUT,
    SEA,
    SHIP,
    WHOLE,
    Image,
    judge,
    numbers_of,
    tally,
    trial,
)

CAMERA = Camera(160, 128, 290.0, 290.0, 79.5, 63.5)


def image_of(*bodies, subject=WHOLE):
    view = render(Scene(EVEN, bodies), CAMERA, [0.0, 0.0, -60.0], R_MC_DOWN)
    counts = expose(view.kelvin, IDEAL, sensor_of(IDEAL, (128, 160), np.random.default_rng(1)), None)
    return Image(subject, view, counts)


def judged(image):
    return judge(image.view, find_objects(image.counts))


def test_what_is_found_and_missed_is_told_by_shared_pixels():
    two = image_of(rectangle(10, 5, 12.0).at(0, -9), rectangle(10, 5, 12.0).at(0, 9))
    assert {number: len(rows) for number, rows in judged(two).found.items()} == {1: 1, 2: 1}
    assert judged(two).false == 0
    cold = image_of(rectangle(10, 5, 12.0).at(0, -9), rectangle(10, 5, 0.5).at(0, 9))
    assert [bool(judged(cold).found[number]) for number in (1, 2)] == [True, False]
    assert judged(cold).merged == set()


def test_two_that_touch_are_one_blob_and_the_smaller_is_merged():
    both = judged(image_of(rectangle(10, 8, 12.0).at(0, -4), rectangle(10, 4, 12.0).at(0, 2.0)))
    assert len(both.found[1]) == 1
    assert both.found[2] == []
    assert both.merged == {2}


def test_a_detection_of_nothing_is_a_false_alarm():
    image = image_of(rectangle(10, 5, 12.0))
    found = find_objects(image.counts)
    elsewhere = FloatingObjects(found.detections, np.roll(found.labels, 40, axis=1))
    assert judge(image.view, elsewhere).false == 1
    assert judge(image.view, elsewhere).found == {1: []}


def test_rates_are_of_images_in_which_all_was_found():
    good, half = (
        image_of(rectangle(10, 5, 12.0).at(0, -9), rectangle(10, 5, excess).at(0, 9))
        for excess in (12.0, 0.5)
    )
    numbers = numbers_of(*tally([good, good, half, image_of(subject=SEA)], FloatingThresholds()))
    assert np.isclose(numbers[WHOLE, "detection_rate"], 2 / 3)
    assert numbers[WHOLE, "missed"] == 1
    assert numbers[WHOLE, "largest_share_missed"] == 1.0
    assert numbers[BOATS, "images"] == 4
    assert numbers[SEA, "false_alarms_per_image"] == 0
    assert np.isnan(numbers[SHIP, "detection_rate"])


def spread_of(**changes):
    numbers = {
        (subject, name): value
        for subject in (SHIP, WHOLE, CUT)
        for name, value in {
            "images": 10.0,
            "detection_rate": 1.0,
            "false_alarms_per_image": 0.0,
            "missed": 0.0,
            "largest_share_missed": np.nan,
            "images_with_false": 0.0,
            "images_with_missed": 0.0,
            "ellipse_coverage_90": 0.9,
        }.items()
    }
    numbers |= {(one, "images"): 30.0 for one in (BOATS, SEA)}
    numbers |= {(one, "false_alarms_per_image"): 0.0 for one in (BOATS, SEA)}
    numbers |= {(one, "images_with_false"): 0.0 for one in (BOATS, SEA)}
    for key, value in changes.items():
        subject, name = key.split("__")
        numbers[{"ship": SHIP, "whole": WHOLE, "cut": CUT, "boats": BOATS, "sea": SEA}[subject], name] = value
    return pd.DataFrame([numbers] * 40)


CLAIMS = {claim["id"]: claim for claim in load_claims("vessel-detection")}


def decided(**changes):
    """The verdict on each claim that is judged by images, by its own threshold."""
    checks = checks_of("vessel-detection", spread_of(**changes))
    assert set(checks) == set(CLAIMS)
    return {
        name: decide_check(check, float(CLAIMS[name]["threshold"])).verdict
        for name, check in checks.items()
        if check.pooled is not None
    }


def test_claims_are_judged_by_all_images_together():
    # 40 flights; what is judged by 441 or 4903 images cannot be told by 400.
    few = decided()
    assert few["near-perfect"] == HOLDS
    assert few["ship-without-false-alarm"] == few["whole-always-found"] == UNDECIDED
    many = decided(ship__images=12.0, whole__images=125.0, sea__images=110.0)
    assert set(many.values()) == {HOLDS}
    bad = {f"{one}__images_with_{what}": 2.0 for one, what in (("ship", "false"), ("sea", "false"))}
    assert set(decided(**bad, whole__images_with_missed=2.0).values()) == {FAILS}
    assert decided(ship__images_with_missed=2.0)["near-perfect"] == FAILS


def test_what_is_missed_is_a_small_part_or_not():
    assert not checks_of("vessel-detection", spread_of())["only-small-parts-missed"].premise.any()
    for share, small in ((0.02, True), (0.8, False)):
        check = checks_of("vessel-detection", spread_of(ship__missed=1.0, ship__largest_share_missed=share))
        assert check["only-small-parts-missed"].premise.all()
        assert (check["only-small-parts-missed"].holds(0.1) == small).all()


def test_an_image_with_one_boat_whole_and_one_cut_counts_by_the_whole_one():
    both = image_of(rectangle(10, 5, 12.0), rectangle(10, 5, 0.5).at(0, 16.5))
    assert sorted(seen.share < 1 for seen in both.view.seen) == [False, True]
    numbers = numbers_of(*tally([both], FloatingThresholds()))
    assert (numbers[WHOLE, "detection_rate"], numbers[WHOLE, "missed"]) == (1.0, 0)
    cut = numbers_of(*tally([both._replace(subject=CUT)], FloatingThresholds()))
    assert (cut[CUT, "detection_rate"], cut[CUT, "images_with_missed"]) == (0.0, 1)


@pytest.mark.slow
def test_a_trial_has_what_is_published_and_the_same_twice():
    given = {"twin": "large-ship", "second": "crossing-vessels", "images": 3}
    one = trial(5, **given)
    assert one[SHIP, "images"] == 3
    for row in load_published("vessel-detection").itertuples():
        assert np.isfinite(one[row.subject, row.name])
        assert load_rules("vessel-detection").unit_of(row.name) is not None
    assert 0 <= one[SHIP, "detection_rate"] <= 1


def test_one_in_a_hundred_is_not_none_however_many_flights_have_none():
    spread = pd.concat([spread_of()[:36], spread_of(ship__images_with_false=1.0)[:4]], ignore_index=True)
    check = checks_of("vessel-detection", spread)["ship-without-false-alarm"]
    assert check.pooled == (4, 400) and (check.measured == 0).mean() == 0.9
    assert decide_check(check, 0.00864).verdict == UNDECIDED
    assert decide_check(check, 0.001).verdict == FAILS


def test_thresholds_of_none_are_what_the_printed_images_leave_open():
    for claim, count, images in (
        ("ship-without-false-alarm", 0, 441), ("whole-always-found", 0, 4903),
        ("no-blob-in-empty-images", 15, 27866),
    ):  # fmt: skip
        assert float(CLAIMS[claim]["threshold"]) == pytest.approx(
            share_interval(count, images).high, rel=0.01
        )
