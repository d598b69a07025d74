"""The study of crossing vessels: known mistakes, and claims that turn with numbers."""

import numpy as np
import pandas as pd
import pytest

from tests.studies.claims import checks_of, turn
from wildlab.analysis.georeference import observe
from wildlab.simulation.twins import simulate_twin
from wildlab.studies import crossing_vessels as study
from wildlab.studies.crossing_vessels import (
    DISTANCE,
    FEATURES,
    LOOKS,
    TOLD_SD,
    Bank,
    Crossing,
    ImageDetections,
    all_numbers,
    apart_times,
    distances_of,
    dressed,
    gather,
    join,
    photograph,
    run_bank,
    swapped,
    wrong_of,
)
from wildlab.studies.rules import load_rules

INTERVAL = 0.5


@pytest.fixture(scope="module")
def flight():
    return simulate_twin("crossing-vessels", 6, ("imu", "gnss"))


@pytest.fixture(scope="module")
def flown(flight):
    """Of a third of the detections, about the crossing."""
    whole = gather(flight)
    kept = (whole.times >= 200) & (whole.times <= 500)
    rows = kept[np.unique(whole.detections.image, return_inverse=True)[1]]
    seen = whole.detections
    some = seen._replace(image=seen.image[rows], positions=seen.positions[rows])
    crossing = Crossing(some, whole.boat[rows], whole.times[kept], whole.truth[:, kept])
    looks = photograph("crossing-vessels", 6, flight, 2)
    appearance = dressed(crossing, looks, 6)
    banks = {DISTANCE: run_bank(crossing.detections), FEATURES: run_bank(crossing.detections, appearance)}
    return study.Flown(crossing, looks, appearance, banks)


def passing(images=600, closest=0.0, noise=0.0, seed=0):
    """Two that run past each other, east and west, seen in every image; the first is south by ``closest``."""
    when = np.arange(images)
    east = (when - images / 2) * 1.0
    truth = np.array(
        [np.column_stack([np.zeros(images), east]), np.column_stack([np.full(images, closest), -east])]
    )
    rng = np.random.default_rng(seed)
    z = truth.transpose(1, 0, 2).reshape(-1, 2) + rng.normal(0, noise, (2 * images, 2))
    looks = ImageDetections(np.repeat(when, 2), z, INTERVAL)
    return Crossing(looks, np.tile([0, 1], images), when * INTERVAL, truth)


def looking(crossing, separation):
    return separation * crossing.boat[:, None] * TOLD_SD


def test_two_far_apart_are_two_tracks_without_a_mistake():
    crossing = passing(closest=400, noise=5)
    bank = run_bank(crossing.detections)
    assert len(bank.started) == 2
    assert not wrong_of(crossing, bank.track, bank.started).any()
    own, nearest = distances_of(crossing, bank)
    assert np.nanmax(own) < 30
    assert np.array_equal(own, nearest, equal_nan=True)
    assert np.isnan(own[:, 0]).all()
    assert swapped(crossing, wrong_of(crossing, bank.track, bank.started)) == (False, False)


def reversing():
    """Two that come near and turn back, which by distance alone looks as if they had passed."""
    crossing = passing()
    half = len(crossing.times) // 2
    z = crossing.detections.positions.reshape(-1, 2, 2).copy()
    truth = crossing.truth.copy()
    z[half:], truth[:, half:] = z[half:, ::-1], truth[::-1, half:]
    return crossing._replace(detections=crossing.detections._replace(positions=z.reshape(-1, 2)), truth=truth)


def test_who_turns_back_is_swapped_by_distance_and_not_by_looks():
    crossing = reversing()
    alone = run_bank(crossing.detections)
    assert swapped(crossing, wrong_of(crossing, alone.track, alone.started)) == (True, True)
    wrong = wrong_of(crossing, alone.track, alone.started)
    assert 0.4 < wrong.mean() < 0.6
    assert not wrong[: len(wrong) // 2 - 20].any()
    told_apart = run_bank(crossing.detections, looking(crossing, 20.0))
    assert not wrong_of(crossing, told_apart.track, told_apart.started).any()


@pytest.mark.parametrize(
    ("from_s", "to_s", "found"),
    [
        (300, 420, (True, False)),  # and then each is on its own again
        (470, 600, (False, True)),
        (300, 600, (True, True)),
        (300, 350, (False, False)),  # less than half of the two minutes
        (0, 290, (False, False)),
    ],
)
def test_a_swap_is_looked_for_just_after_the_crossing_and_at_the_end(from_s, to_s, found):
    """They meet in the middle of ten minutes; a crossed bank between two times."""
    crossing = passing(images=1200)
    when = np.repeat(crossing.times, 2)
    crossed = (when >= from_s) & (when < to_s)
    taken = np.where(crossed, 1 - crossing.boat, crossing.boat)
    empty = np.empty((1200, 2, 4))
    bank = Bank(taken, np.array([0, 1]), np.arange(1200), empty, np.empty((1200, 2, 4, 4)))
    assert swapped(crossing, wrong_of(crossing, bank.track, bank.started)) == found
    one_side = bank._replace(track=np.where(crossing.boat == 0, taken, crossing.boat))
    assert swapped(crossing, wrong_of(crossing, one_side.track, one_side.started)) == (False, False), (
        "one of the two is no exchange"
    )


def test_detections_are_those_of_the_flight_in_order(flight):
    crossing, seen = gather(flight), observe(flight, "autopilot")
    assert np.bincount(crossing.boat).tolist() == [1535, 865]
    numbers, counts = np.unique(crossing.detections.image, return_counts=True)
    assert (counts == 2).sum() == 349
    assert (np.diff(crossing.detections.image) >= 0).all()
    assert len(crossing.times) == len(numbers)
    assert crossing.detections.interval == pytest.approx(1 / 7.5, rel=0.01)
    at = np.searchsorted(numbers, crossing.detections.image)
    off = np.linalg.norm(crossing.detections.positions - crossing.truth[crossing.boat, at], axis=1)
    assert np.median(off) < 25
    assert len(seen.uv) == len(crossing.boat)


def test_rendered_looks_are_of_the_vessels(flown):
    long, short = flown.looks
    assert long.shape[1] == short.shape[1] == 3
    assert 1 <= len(long) <= 2
    # Of 11 m by a third of it, and of 7 m: hulls fill most of their boxes.
    for pool, length in ((long, 11.0), (short, 7.0)):
        assert np.all(np.exp(pool[:, 0]) > 0.5 * length**2 / 3)
        assert np.all(np.exp(pool[:, 0]) < 2.5 * length**2 / 3)


def test_detections_are_dressed_from_their_own_vessel():
    crossing = passing(images=50)
    looks = [np.array([[1.0, 1, 1], [2, 2, 2]]), np.empty((0, 3))]
    found = dressed(crossing, looks, 3)
    own = found[crossing.boat == 0]
    assert set(own[:, 0]) == {1.0, 2.0}
    assert (own == own[:, :1]).all(), "the features of one image stay together"
    assert np.isnan(found[crossing.boat == 1]).all()


@pytest.mark.slow
def test_numbers_are_those_of_the_tracks(flown):
    numbers = all_numbers(flown)
    assert all(load_rules("crossing-vessels").unit_of(name) for _, name in numbers)
    seen = np.bincount(flown.crossing.boat)
    for rule, bank in flown.banks.items():
        wrong = wrong_of(flown.crossing, bank.track, bank.started)
        assert numbers[rule, "wrong"] == wrong.sum()
        assert numbers[rule, "wrong_rate_boat_1"] == wrong[flown.crossing.boat == 0].sum() / seen[0]
        assert numbers[rule, "wrong_rate_boat_2"] == wrong[flown.crossing.boat == 1].sum() / seen[1]
        own, nearest = distances_of(flown.crossing, bank)
        assert numbers[rule, "near_share"] == min(np.mean(one[np.isfinite(one)] < 20) for one in own)
        assert numbers[rule, "any_near_share"] >= numbers[rule, "near_share"]
        assert (nearest[np.isfinite(own)] <= own[np.isfinite(own)]).all()


def spread_of(numbers):
    """Forty flights alike."""
    return pd.DataFrame([numbers] * 40)


GOOD = {
    (DISTANCE, "swapped"): 1.0, (DISTANCE, "swapped_at_end"): 1.0, (FEATURES, "swapped"): 0.0,
    (DISTANCE, "any_near_share"): 0.8, (FEATURES, "near_share"): 0.8,
    (DISTANCE, "wrong"): 1800.0, (FEATURES, "wrong"): 5.0,
    (DISTANCE, "wrong_rate_boat_1"): 0.8, (DISTANCE, "wrong_rate_boat_2"): 0.6,
    (FEATURES, "wrong_rate_boat_1"): 0.0, (FEATURES, "wrong_rate_boat_2"): 0.0,
    (LOOKS, "separation_size"): 9.0, (LOOKS, "separation_intensity"): 3.0, (LOOKS, "separation_hu"): 1.0,
    (LOOKS, "closest"): 3.0,
}  # fmt: skip
BAD = {
    (DISTANCE, "swapped"): 0.0, (DISTANCE, "swapped_at_end"): 0.0, (FEATURES, "swapped"): 1.0,
    (DISTANCE, "any_near_share"): 0.2, (FEATURES, "near_share"): 0.2,
    (DISTANCE, "wrong"): 5.0, (FEATURES, "wrong"): 1800.0,
    (DISTANCE, "wrong_rate_boat_1"): 0.0, (DISTANCE, "wrong_rate_boat_2"): 0.0,
    (FEATURES, "wrong_rate_boat_1"): 0.0, (FEATURES, "wrong_rate_boat_2"): 0.9,
    (LOOKS, "separation_size"): 2.5, (LOOKS, "separation_intensity"): 1.0, (LOOKS, "separation_hu"): 3.0,
}  # fmt: skip


def test_claims_turn_with_the_numbers():
    good, bad = (checks_of("crossing-vessels", spread_of(one)) for one in (GOOD, GOOD | BAD))
    assert turn("crossing-vessels", good, bad)


def test_premises_turn_with_the_numbers():
    def met(changes):
        checks = checks_of("crossing-vessels", spread_of(GOOD | changes))
        return {key for key, check in checks.items() if check.premise is not None and check.premise.all()}

    crossed = {"swap-without-features", "no-swap-with-features", "most-correct-in-contrast"}
    after_swap = {"never-recovers", "accurate-though-swapped"}
    assert met({}) == crossed | after_swap
    assert met({(LOOKS, "closest"): 18.0}) == after_swap
    assert met({(DISTANCE, "swapped"): 0.0}) == crossed


def test_one_state_goes_by_time_and_by_what_both_share():
    """They pass each other unseen; and side by side, shaken together."""
    past = passing(images=120, noise=1.0)
    unseen = (past.detections.image < 50) | (past.detections.image > 70)
    whole = np.unique(past.detections.image[unseen])
    parts = past.detections.image[unseen], past.detections.positions[unseen], INTERVAL
    past = Crossing(ImageDetections(*parts), past.boat[unseen], past.times[whole], past.truth[:, whole])
    found = join(past, looking(past, 0.0), "gnn")
    assert not any(found["gnn", f"wrong_{name}"] for name in ("independent", "shared", "features"))
    beside = passing(images=400, closest=9.0)
    rng = np.random.default_rng(5)
    z = np.tile([[0.0, 0.0], [9.0, 0.0]], (400, 1)) + rng.normal(0, 1, (800, 2))
    z += rng.normal(0, 10, (400, 2)).repeat(2, axis=0)
    beside = beside._replace(detections=beside.detections._replace(positions=z))
    found = join(beside, looking(beside, 20.0), "jpda")
    assert found["jpda", "wrong_features"] == 0 and found["jpda", "wrong_shared"] < 20
    assert found["jpda", "wrong_independent"] > 100


def test_two_are_apart_up_to_just_before_they_meet_and_from_just_after():
    crossing = passing(images=600)
    until, since = apart_times(crossing)
    # They close at 2 m an image and meet at the 300th, half a second each: 35 m are 17.5 images.
    assert until == (300 - 18) * INTERVAL and since == (300 + 18) * INTERVAL
    together = crossing._replace(truth=np.zeros_like(crossing.truth))
    assert apart_times(together) == (0.0, 599 * INTERVAL)
