"""Tracks of a bank that are confirmed, end, and are found again (H 3.4)."""

from __future__ import annotations

from types import MappingProxyType

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.tracking.poses import GENERATORS
from wildlab.errors import WildlabError
from wildlab.geometry.validation import gate_threshold
from wildlab.tracking.many.bank import Looks, Tuning, run_bank
from wildlab.tracking.many.bank_life import Life
from wildlab.tracking.many.bank_rules import DISTANCE, FEATURES, VETO, Appearance

INTERVAL = 0.5
TUNING = Tuning(5.0, 0.2, 5.0, gate_threshold(0.99, 2), 5.0)
#: A track ends after 5 s of absence, seconds of any kind, or at 30 m.
ABSENCE, AGE, SD = Life(max_absence=5.0), Life(max_age=5.0), Life(max_sd=30.0)
#: In view twice for ten images, and in between not for a minute.
COMES_BACK = np.r_[0:10, 130:140]
SAME = ("track", "started", "images", "x", "P")


def still(images, places=((0.0, 0.0),), noise=0.5, seed=0):
    """Vessels at rest, each detected in the images that are given for it; and whose each detection is."""
    rng, rows = np.random.default_rng(seed), []
    for owner, (place, seen) in enumerate(zip(places, images, strict=True)):
        rows += [(image, owner, *(np.array(place) + rng.normal(0, noise, 2))) for image in seen]
    table = np.array(sorted(rows))
    return Looks(table[:, 0].astype(int), table[:, 2:], INTERVAL), table[:, 1].astype(int)


def looking(owner, apart=20.0):
    """As many spreads apart as that."""
    return Appearance(apart * owner[:, None].astype(float), np.ones(1), np.ones(1))


def follow(looks, life, *more):
    """The bank whose tracks live like that."""
    return run_bank(looks, TUNING._replace(life=life), *more)


def first(looks, images):
    """What was seen before that image."""
    until = looks.image < images
    return Looks(looks.image[until], looks.positions[until], INTERVAL)


def never(places):
    return np.zeros(len(places), bool)


@settings(max_examples=20, deadline=None)
@given(GENERATORS, st.sampled_from([DISTANCE, FEATURES, VETO]))
def test_a_life_that_ends_nothing_changes_no_digit(rng, rule):
    """By default all tracks live for ever; limits that nobody reaches and counts leave it at that."""
    image = np.sort(rng.integers(0, 60, 80))
    looks = Looks(image, rng.normal(0, 60, (80, 2)), INTERVAL)
    appearance = Appearance(rng.normal(0, 2, (80, 1)), np.ones(1), np.ones(1))
    plain = run_bank(looks, TUNING, rule, appearance)
    counted = follow(looks, Life(1e9, 1e9, 1e9), rule, appearance)
    for name in SAME:
        assert np.array_equal(getattr(plain, name), getattr(counted, name), equal_nan=True), name
    for bank in (plain, counted):
        assert (bank.identity == np.arange(len(bank.started))).all()
        assert (bank.ended == -1).all() and bank.believed.all()


@pytest.mark.parametrize("life", [ABSENCE, AGE, SD])
def test_one_that_vanishes_and_comes_back_keeps_its_identity(life):
    looks, owner = still([COMES_BACK])
    bank = follow(looks, life)
    assert bank.track.tolist() == [0] * 10 + [1] * 10
    assert bank.ended.tolist() == [130, -1]
    assert bank.identity.tolist() == [0, 0]
    assert np.isnan(bank.x[10:, 0]).all() and np.isfinite(bank.x[1:10, 0]).all()
    assert np.isnan(bank.x[:11, 1]).all() and np.isfinite(bank.x[11:, 1]).all()
    other = np.where(np.arange(20) < 10, 0, 1)
    assert follow(looks, life, VETO, looking(owner)).identity.tolist() == [0, 0]
    assert follow(looks, life, VETO, looking(other)).identity.tolist() == [0, 1], "others in its place"


@pytest.mark.parametrize(
    ("life", "last"), [(ABSENCE, 11), (AGE, 10), (Life(max_age=0.6), 1), (Life(max_absence=0.6), 2)]
)
def test_a_track_lives_up_to_its_limit_and_no_longer(life, last):
    """Detected up to image 9 and again so many images later: absence counts those in between alone."""
    for pause, ends in ((last, False), (last + 1, True)):
        looks, _ = still([np.r_[0:10, 9 + pause, 10 + pause]])
        bank = follow(looks, life)
        assert (bank.ended[0] >= 0) == ends, pause


def test_the_largest_deviation_of_all_directions_ends_a_track():
    looks, _ = still([np.r_[0:10, 40, 41]])
    free = run_bank(looks, TUNING)
    alive = follow(looks, Life(max_sd=1e6))
    assert np.array_equal(free.x, alive.x, equal_nan=True)
    before = run_bank(first(looks, 10), TUNING)
    F = np.eye(4)
    F[[0, 1], [2, 3]] = 31 * INTERVAL
    grown = np.sqrt((F @ before.P[-1, 0] @ F.T)[0, 0])
    assert follow(looks, Life(max_sd=0.9 * grown)).ended[0] == 40
    assert follow(looks, Life(max_sd=1.2 * grown)).ended[0] == -1


def test_what_is_not_looked_at_is_not_absent():
    """A minute in which no image shows the place ends nothing by absence, and by age it does."""
    looks, _ = still([COMES_BACK])
    blind = looks._replace(sees=MappingProxyType(dict.fromkeys(range(10, 130), never)))
    assert follow(blind, ABSENCE).ended.tolist() == [-1]
    assert follow(blind, AGE).ended[0] == 130
    # Ten images that look are 5 s, which are allowed; eleven are not.
    for open_, ended in ((10, -1), (11, 130)):
        partly = dict.fromkeys(range(10, 130 - open_), never)
        assert follow(looks._replace(sees=partly), ABSENCE).ended[0] == ended


def test_views_are_asked_where_the_track_is_by_then():
    """It goes east at 4 m/s; views show what lies east of 60 m, where it is from image 30 on."""
    image = np.r_[0:20, 60]
    z = np.column_stack([np.zeros(21), 2.0 * image])
    asked = []

    def east(places):
        asked.append(places[0, 1])
        return places[:, 1] > 61

    looks = Looks(image, z, INTERVAL, dict.fromkeys(range(20, 60), east))
    # Images 31 to 59 show it: 14.5 s.
    assert follow(looks, Life(max_absence=14.4)).ended[0] == 60
    assert np.allclose(asked, 2.0 * np.arange(20, 60), atol=1.0)
    assert follow(looks, Life(max_absence=14.6)).ended[0] == -1


def test_two_look_alikes_are_not_guessed_and_two_that_differ_are_told_apart():
    """Both vanish; one comes back half way between the two."""
    looks, owner = still([np.r_[0:10], np.r_[0:10, 130:140]], [(0, 0), (30, 0)])
    between = looks._replace(positions=np.where(looks.image[:, None] > 100, [15.0, 0.0], looks.positions))
    assert follow(between, AGE).identity.tolist() == [0, 1, 2]
    same = follow(between, AGE, VETO, looking(owner, 0.0))
    assert same.identity.tolist() == [0, 1, 2]
    told = follow(between, AGE, VETO, looking(owner))
    assert told.identity.tolist() == [0, 1, 1]
    guessed = follow(between, AGE._replace(likelier=1.0 + 1e-9))
    assert guessed.identity[2] in (0, 1)
    # Looks count only where the rule goes by them.
    assert follow(between, AGE, DISTANCE, looking(owner)).identity.tolist() == [0, 1, 2]


def test_who_comes_back_from_too_far_is_another_one():
    """In a minute at most 300 m, and both places are known to some metres."""
    for east, identity in ((290.0, 0), (350.0, 1)):
        looks, _ = still([COMES_BACK])
        z = looks.positions + np.where(looks.image[:, None] > 100, [0.0, east], 0.0)
        assert follow(looks._replace(positions=z), AGE).identity[1] == identity


def test_who_was_detected_beside_its_first_detection_is_another_one():
    """In one image they are two; where one comes after the other they may be one that is fast."""
    fast = TUNING._replace(life=AGE, max_speed=100.0)
    for begins, identity in ((20, 1), (21, 0)):
        looks, owner = still([np.arange(21), np.r_[begins:31], [50]], [(0, 0), (60, 0), (900, 0)])
        bank = run_bank(looks, fast, FEATURES, looking(owner, 0.0))
        assert bank.ended.tolist() == [31 + 19, 50]
        assert bank.identity.tolist() == [0, identity]


@pytest.mark.parametrize(
    ("images", "identity", "ends"),
    [
        (132, [0, 1], -1),  # as far as was seen then
        (160, [0, 0], -1),  # or when the flight ends
        (302, [0, 0, 0], 300),
    ],
)
def test_who_is_new_to_begin_with_is_compared_once_more_when_it_ends(images, identity, ends):
    """Its first two looks are odd ones, and on the whole it looks as before."""
    looks = first(still([np.r_[0:10, 130:160, 300:302]])[0], images)
    odd = np.where((looks.image >= 130) & (looks.image < 132), 56.0, 50.0)[:, None]
    bank = follow(looks, AGE, FEATURES, Appearance(odd, np.ones(1), np.ones(1)))
    assert bank.identity.tolist() == identity and bank.ended[1] == ends


def going(*parts):
    """Vessels without noise, east at a speed: (images, place north and east at the first, m/s) of each."""
    rows = [
        (image, owner, north, east + speed * INTERVAL * (image - images[0]))
        for owner, (images, (north, east), speed) in enumerate(parts)
        for image in images
    ]
    table = np.array(sorted(rows))
    return Looks(table[:, 0].astype(int), table[:, 2:], INTERVAL), table[:, 1].astype(int)


def test_reach_is_from_where_it_was_detected_last():
    """200 m on its way it vanishes for 20 s: it may have gone on, stayed or turned."""
    for back, identity in ((280, 0), (200, 0), (140, 0), (40, 1), (360, 1)):
        looks, _ = going((range(100), (0, 0), 4.0), (range(140, 150), (0, back), 0.0))
        assert follow(looks, AGE).identity.tolist() == [0, identity], back


@pytest.mark.parametrize(
    ("hits", "believed"), [((2, 3, 4), True), ((2, 6), False), ((2, 4, 6), True), ((), False)]
)
def test_a_start_is_confirmed_by_m_of_the_next_n(hits, believed):
    """Two images begin it, of the next five three must have a detection; another is there all along."""
    looks, owner = still([np.r_[0, 1, np.array(hits, int)], np.arange(30)], [(0, 0), (900, 0)])
    bank = follow(looks, Life(confirm=(3, 5)))
    own = bank.track[owner == 0][0]
    assert bank.believed[own] == believed
    assert (bank.ended[own] >= 0) != believed
    assert bank.believed[1 - own]
    assert run_bank(looks, TUNING).believed.all()


def test_a_start_is_dropped_as_soon_as_m_cannot_be_reached():
    looks, owner = still([[0, 1], np.arange(30)], [(0, 0), (900, 0)])
    bank = follow(looks, Life(confirm=(3, 5)))
    own = bank.track[owner == 0][0]
    assert bank.ended[own] == 4, "after images 2, 3 and 4 without a detection"
    assert np.isfinite(bank.x[3, own]).all() and np.isnan(bank.x[4, own]).all()
    # Images that do not look at it do not count.
    blind = dict.fromkeys(range(2, 12), lambda places: places[:, 0] > 450)
    assert follow(looks._replace(sees=blind), Life(confirm=(3, 5))).ended[own] == 14


def test_an_impossible_confirmation_is_refused():
    looks, _ = still([COMES_BACK])
    with pytest.raises(WildlabError, match="6 of 5 scans"):
        follow(looks, Life(confirm=(6, 5)))
