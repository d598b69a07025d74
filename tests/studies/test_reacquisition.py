"""Tracks of crossing vessels that are found again: known outcomes."""

import numpy as np
import pandas as pd
import pytest

from wildlab.studies.crossing_vessels import reacquired_shares, reacquisition_table
from wildlab.studies.crossing_vessels.trial import (
    REACQUIRED_UNITS,
    TUNING,
    WAYS,
    Outcome,
    again_numbers,
    outcome,
    owners,
)
from wildlab.tracking.association import Appearance
from wildlab.tracking.many.bank import Bank, Looks

INTERVAL = 0.5
WITHOUT, WITH, GUESSED_WITHOUT, GUESSED_WITH = WAYS


def bank_of(boats, spans, identity, alive=()):
    """A bank whose tracks have detections of these boats in these images, and those detections."""
    rows = sorted(
        (image, track, boat)
        for track, (boat, (first, last)) in enumerate(zip(boats, spans, strict=True))
        for image in range(first, last + 1)
    )
    image, track, boat = np.array(rows).T
    count = len(boats)
    started = np.array([int(np.argmax(track == number)) for number in range(count)])
    ended = np.array([-1 if number in alive else last + 9 for number, (_, last) in enumerate(spans)])
    nothing = np.empty((0, count, 4)), np.empty((0, count, 4, 4))
    believed = np.ones(count, bool)
    return image, boat, Bank(track, started, np.unique(image), *nothing, np.array(identity), ended, believed)


@pytest.mark.parametrize(
    ("boats", "identity", "expected"),
    [
        ([0, 0, 0], [0, 0, 0], Outcome(2, 0, 0)),
        ([0, 0, 0], [0, 1, 2], Outcome(0, 0, 2)),
        ([0, 1, 0], [0, 1, 0], Outcome(1, 0, 0)),
        ([0, 1, 0], [0, 0, 0], Outcome(0, 2, 0)),
        # The second is new to begin with, and then its own identity is another's: what counts is the last.
        ([0, 1, 1], [0, 0, 0], Outcome(1, 1, 0)),
        # Once the first was taken by the other vessel's, nothing of the vessel's own is left to be found.
        ([0, 1, 0], [0, 0, 2], Outcome(0, 1, 0)),
    ],
)
def test_outcomes_one_after_the_other(boats, identity, expected):
    spans = [(0, 5), (20, 25), (40, 45)]
    assert outcome(*bank_of(boats, spans, identity)) == expected


def test_what_lives_on_or_was_still_detected_cannot_be_found():
    spans = [(0, 5), (5, 25)]
    assert outcome(*bank_of([0, 0], spans, [0, 1])) == Outcome(0, 0, 0)
    spans = [(0, 5), (6, 25)]
    assert outcome(*bank_of([0, 0], spans, [0, 1])) == Outcome(0, 0, 1)
    assert outcome(*bank_of([0, 0], spans, [0, 1], alive=(0, 1))) == Outcome(0, 0, 0)


def test_a_track_is_of_whom_most_of_its_detections_are():
    assert owners(np.array([1, 0, 0]), np.zeros(3, int), 1).tolist() == [0]
    assert owners(np.array([1, 0]), np.zeros(2, int), 1).tolist() == [1]
    assert owners(np.array([0, 1, 1]), np.array([0, -1, 0]), 1).tolist() == [0], "of none do not count"


def laps(count=6, apart=0.0, noise=2.0, after=60):
    """Two vessels so far apart, for ten images of each minute in view, one some images after the other."""
    rng = np.random.default_rng(0)
    starts = [(120 * lap + after * boat, boat) for lap in range(count) for boat in (0, 1)]
    rows = np.array(sorted((at + image, boat) for at, boat in starts for image in range(10)))
    image, boat = rows.T
    z = np.column_stack([apart * boat, np.zeros(len(boat))]) + rng.normal(0, noise, (len(boat), 2))
    return Looks(image, z, INTERVAL), boat


def test_far_apart_all_are_found_by_place_and_near_each_other_by_looks_alone():
    sure = TUNING._replace(measurement=2.0)
    looks, boat = laps(apart=2000.0)
    same = Appearance(np.zeros((len(boat), 1)), np.ones(1), np.ones(1))
    numbers = again_numbers(looks, boat, same, sure)
    assert {name for _, name in numbers} == set(REACQUIRED_UNITS) and {way for way, _ in numbers} == set(WAYS)
    for way in WAYS:
        assert [numbers[way, name] for name in REACQUIRED_UNITS] == [10, 0, 0]
    looks, boat = laps()
    told = Appearance(20.0 * boat[:, None].astype(float), np.ones(1), np.ones(1))
    numbers = again_numbers(looks, boat, told, sure)
    assert [numbers[WITH, name] for name in REACQUIRED_UNITS] == [10, 0, 0]
    assert numbers[WITHOUT, "found_wrong"] == 11, "whoever comes by is taken for who came by before"


def test_two_that_come_back_beside_each_other_are_guessed_or_stay_new():
    looks, boat = laps(apart=30.0, after=0)
    told = Appearance(20.0 * boat[:, None].astype(float), np.ones(1), np.ones(1))
    numbers = again_numbers(looks, boat, told, TUNING._replace(measurement=2.0))
    assert numbers[WITHOUT, "not_found"] > 5
    taken = [numbers[way, "found_right"] + numbers[way, "found_wrong"] for way in (WITHOUT, GUESSED_WITHOUT)]
    assert taken[1] > taken[0]
    assert numbers[WITH, "found_right"] == numbers[GUESSED_WITH, "found_right"] == 10


def spread_of(*flights):
    """Flights with (right, wrong, missed) by each way."""
    return pd.DataFrame(
        [
            {
                (way, name): float(one)
                for way, found in flight.items()
                for name, one in zip(REACQUIRED_UNITS, found, strict=True)
            }
            for flight in flights
        ]
    )


GOOD = {WITHOUT: (1, 0, 9), WITH: (10, 0, 0), GUESSED_WITHOUT: (7, 3, 0), GUESSED_WITH: (9, 1, 0)}
BAD = {WITHOUT: (9, 0, 1), WITH: (1, 2, 7), GUESSED_WITHOUT: (9, 0, 1), GUESSED_WITH: (1, 1, 8)}


def test_shares_are_of_tracks_that_had_something_to_find():
    runs = spread_of(GOOD, {way: (0, 0, 0) for way in WAYS}, BAD)
    right, guessed = reacquired_shares(runs, WITH, "found_right"), (GUESSED_WITHOUT, "found_wrong")
    assert np.array_equal(right, [1.0, np.nan, 0.1], equal_nan=True)
    assert np.array_equal(reacquired_shares(runs, *guessed), [0.3, np.nan, 0.0], equal_nan=True)


def test_flights_with_nothing_to_find_count_nowhere():
    """Half of eight flights have a track to find."""
    nothing = {way: (0, 0, 0) for way in WAYS}
    table = reacquisition_table(spread_of(GOOD, BAD, GOOD, BAD, *[nothing] * 4), {way: way for way in WAYS})
    row = table.set_index("way").loc[WITH]
    assert (row["found_right"], row["found_wrong"]) == (pytest.approx(55.0), pytest.approx(10.0))
    assert row["none_wrong"] == 50.0
