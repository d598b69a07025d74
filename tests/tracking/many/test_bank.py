"""A bank of filters: with one target the single filter; what starts, confirms, ends and continues a track."""

from __future__ import annotations

from functools import partial
from types import MappingProxyType

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.stats import chi2

from tests.tracking.poses import GENERATORS
from wildlab.errors import WildlabError
from wildlab.geometry.covariances import gate_threshold
from wildlab.tracking.association import (
    DISTANCE,
    FEATURES,
    RULES,
    STATE,
    VETO,
    Appearance,
    associate,
    feature_distances,
    global_nearest,
    limits_of,
)
from wildlab.tracking.kalman import predict, update
from wildlab.tracking.many.bank import Life, Looks, Tuning, compare_looks, nobody, run_bank
from wildlab.tracking.motion import constant_velocity, in_steps
from wildlab.tracking.run import Start, run_filter
from wildlab.tracking.sensors import positions

INTERVAL = 0.5
TUNING = Tuning(17.5, 0.2, 5.0, gate_threshold(0.99, 2), 5.0)


def test_of_one_target_it_is_the_single_filter(rng):
    """One target with pauses: the states are those of `run_filter`, started on the first detection."""
    image = np.array([3, 4, 5, 6, 7, 9, 10, 40, 41, 90])
    z = np.column_stack([0.1 * image, -0.2 * image]) + rng.normal(0, 10, (len(image), 2))
    bank = run_bank(Looks(image, z, INTERVAL), TUNING)
    assert bank.track.tolist() == [0] * len(image)
    assert np.isnan(bank.x[0]).all()
    motion = partial(
        in_steps,
        motion=partial(constant_velocity, sd_acceleration=TUNING.acceleration),
        longest=1.001 * INTERVAL,
    )
    first = Start(
        image[0] * INTERVAL,
        np.r_[z[0], 0, 0],
        np.diag([TUNING.measurement**2] * 2 + [TUNING.velocity_0**2] * 2),
    )
    R = TUNING.measurement**2 * np.eye(2)
    single = run_filter(image[1:] * INTERVAL, z[1:], R, positions(), motion, first)
    assert np.allclose(bank.x[1:, 0], single.x, atol=1e-9)
    assert np.allclose(bank.P[1:, 0], single.P, atol=1e-9)


def test_a_single_detection_starts_nothing_and_neither_do_two_far_apart():
    for image, z in (([1], [[0, 0]]), ([1, 3], [[0, 0], [0, 0]]), ([1, 2], [[0, 0], [500, 0]])):
        bank = run_bank(Looks(np.array(image), np.array(z, float), INTERVAL), TUNING)
        assert (bank.track == -1).all()
        assert len(bank.started) == 0


def test_two_in_one_image_do_not_go_to_one_track():
    """The second finds the only gate taken: with its like in the next image it starts a track of its own."""
    image = np.array([1, 2, 3, 3, 4, 4])
    z = np.array([[0, 0], [0, 0], [0, 0], [20, 0], [0, 0], [20, 0]], float)
    bank = run_bank(Looks(image, z, INTERVAL), TUNING)
    assert bank.track.tolist() == [0, 0, 0, 1, 0, 1]
    assert bank.started.tolist() == [0, 3]
    assert np.isnan(bank.x[:3, 1]).all() and np.isfinite(bank.x[3, 1]).all()


def test_each_rule_by_hand():
    d = np.array([[2.0, 1.0], [1.0, 2.0]])
    f = np.array([[0.0, 50.0], [50.0, 0.0]])

    def by(rule: str, features: np.ndarray | None, count: int = 1) -> list[int]:
        looks = Appearance(np.zeros((2, count)), np.ones(count), np.ones(count))
        limits = limits_of(rule, TUNING.gate, TUNING.veto_probability, looks)
        return associate(d, features, rule, limits).track.tolist()

    assert by(DISTANCE, None) == by(DISTANCE, f) == [1, 0]
    assert by(FEATURES, f) == [0, 1]
    assert by(VETO, f) == [-1, -1]
    assert by(VETO, 0.1 * f) == global_nearest(d, 9.21).track.tolist()
    assert by(VETO, 0.22 * f) == [-1, -1], "11 is above 10.8, of one"
    assert by(VETO, 0.22 * f, 2) == [1, 0], "and below 13.8, of two"


def test_features_in_the_state_are_a_filter_of_the_whole_state(rng):
    """Places and two features, one of them now and then not known, through one filter of six elements.

    Its innovation squared lets in or keeps out what the bank does, which keeps the two parts apart; what it
    keeps out moves neither the place nor the looks.
    """
    image = np.r_[0, np.arange(1, 119, 2)]  # with an image between any two, nothing else can start
    z = np.column_stack([0.3 * image, 0.0 * image]) + rng.normal(0, 20, (60, 2))
    sd, true = np.array([0.1, 8.0]), np.array([3.0, 50.0])
    features = true + sd * rng.normal(0, 1.6, (60, 2))
    features[5::7, 1] = np.nan
    looks = Appearance(features, sd, np.array([1.0, 0.4]))
    bank = run_bank(Looks(image, z, INTERVAL), TUNING, STATE, looks)
    alone = run_bank(Looks(image[:2], z[:2], INTERVAL), TUNING)
    x = np.r_[alone.x[1, 0], features[:2].mean(axis=0)]
    P = np.zeros((6, 6))
    P[:4, :4], P[4:, 4:] = alone.P[1, 0], np.diag(sd**2 / 2)
    F, Q = np.eye(6), np.zeros((6, 6))
    motion = partial(constant_velocity, sd_acceleration=TUNING.acceleration)
    F[:4, :4], Q[:4, :4] = in_steps(2 * INTERVAL, motion, 1.001 * INTERVAL)
    H = np.zeros((4, 6))
    H[:2, :2] = H[2:, 4:] = np.eye(2)
    noise = np.diag(np.r_[[TUNING.measurement**2] * 2, sd**2])
    took, outside = [], 0
    for k in range(2, len(image)):
        x, P = predict(x, P, F, Q)
        seen = np.r_[z[k], features[k]]
        known = np.isfinite(seen)
        G, R = H[known], noise[np.ix_(known, known)]
        left, S = seen[known] - G @ x, G @ P @ G.T + R
        inside = left @ np.linalg.solve(S, left) <= gate_threshold(0.99, int(known.sum()))
        outside += left[:2] @ np.linalg.solve(S[:2, :2], left[:2]) <= TUNING.gate and not inside
        took.append(inside)
        if inside:
            done = update(x, P, seen[known], G, R)
            x, P = done.x, done.P
        assert np.allclose(bank.x[k, 0], x[:4], atol=1e-8) and np.allclose(bank.P[k, 0], P[:4, :4], atol=1e-8)
    assert (bank.track[2:] == 0).tolist() == took
    assert 0 < outside < 20, "some that are near enough do not look like it"


def test_a_gate_lets_in_as_many_with_features_as_without(rng):
    """Of chi-square numbers, however many features count or are known; and a large gate stays finite."""
    weights = np.array([1.0, 0.0, 3.0])
    looks = Appearance(np.zeros((1, 3)), np.ones(3), weights)
    place = (rng.normal(size=(40000, 2)) ** 2).sum(axis=1)
    for known in ([1, 1, 1], [1, 1, 0], [0, 1, 0]):
        features = rng.normal(size=(40000, 3)) * np.where(np.array(known) > 0, 1.0, np.nan)
        # A track with very many detections: what it knows of a feature is certain.
        alive = nobody(3)._replace(total=np.zeros((1, 3)), known=np.full((1, 3), 1e9))
        limits = limits_of(STATE, TUNING.gate, 0.999, looks)
        inside = place + compare_looks(features, alive, looks, STATE, TUNING.gate)[:, 0] <= limits.gate
        assert inside.mean() == pytest.approx(0.99, abs=0.002), known
    assert limits_of(STATE, 76.0, 0.999, looks).gate == pytest.approx(chi2.isf(np.exp(-38.0), 4))
    assert limits_of(STATE, np.inf, 0.999, looks).gate == np.inf
    veto = limits_of(VETO, TUNING.gate, 0.99, looks)
    squares = feature_distances(rng.normal(size=(40000, 3)), np.zeros((1, 3)), np.ones(3), looks.used)
    assert (squares <= veto.alike).mean() == pytest.approx(0.99, abs=0.002)
    none = Appearance(np.zeros((1, 1)), np.ones(1), np.zeros(1))
    assert limits_of(VETO, TUNING.gate, 0.99, none).alike == np.inf


def test_weights_are_of_features_that_are_weighed_in_alone():
    alive = nobody(1)._replace(stored=np.zeros((1, 1)), total=np.zeros((1, 1)), known=np.full((1, 1), 2.0))
    looks = Appearance(np.zeros((1, 1)), np.ones(1), np.array([9.0]))
    seen = {rule: compare_looks(np.array([[3.0]]), alive, looks, rule, 9.21) for rule in RULES[1:]}
    assert np.allclose([seen[rule] for rule in (FEATURES, VETO, STATE)], [[[54.0]], [[6.0]], [[6.0]]])


@pytest.mark.parametrize(
    ("looks", "rule", "words"),
    [
        (Looks(np.array([1, 0]), np.zeros((2, 2)), INTERVAL), DISTANCE, "not in the order"),
        (Looks(np.array([0, 1]), np.full((2, 2), np.nan), INTERVAL), DISTANCE, "not in the order"),
        (Looks(np.array([0, 1]), np.zeros((2, 2)), INTERVAL), "nearest", "no rule 'nearest'"),
        (Looks(np.array([0, 1]), np.zeros((2, 2)), INTERVAL), VETO, "needs what detections look like"),
    ],
)
def test_what_is_refused(looks, rule, words):
    with pytest.raises(WildlabError, match=words):
        run_bank(looks, TUNING, rule)


SHARP = Tuning(5.0, 0.2, 5.0, gate_threshold(0.99, 2), 5.0)
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
    return run_bank(looks, SHARP._replace(life=life), *more)


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
    plain = run_bank(looks, SHARP, rule, appearance)
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
    free = run_bank(looks, SHARP)
    alive = follow(looks, Life(max_sd=1e6))
    assert np.array_equal(free.x, alive.x, equal_nan=True)
    before = run_bank(first(looks, 10), SHARP)
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
    fast = SHARP._replace(life=AGE, max_speed=100.0)
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
    assert run_bank(looks, SHARP).believed.all()


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


@settings(max_examples=15, deadline=None)
@given(
    GENERATORS, st.sampled_from(RULES), st.sampled_from([Life(), Life(max_age=8.0), Life(max_absence=3.0)])
)
def test_compiled_images_are_those_that_are_written_out(rng, rule, life):
    """Two targets seen now and then with clutter: with the loop over quiet images and without it."""
    image = np.sort(np.r_[np.repeat(np.arange(40), 2), rng.integers(0, 120, 30)])
    owner = np.arange(len(image)) % 2
    looks = Looks(image, 200.0 * owner[:, None] + rng.normal(0, 12, (len(image), 2)), INTERVAL)
    known = np.where(
        rng.random((len(image), 2)) < 0.9, rng.normal(0, 1, (len(image), 2)) + 3 * owner[:, None], np.nan
    )
    appearance = Appearance(known, np.ones(2), np.array([1.0, 0.5]))
    tuning = TUNING._replace(life=life)
    compiled = run_bank(looks, tuning, rule, appearance)
    everywhere = {int(one): lambda places: np.ones(len(places), bool) for one in range(121)}
    written = run_bank(looks._replace(sees=everywhere), tuning, rule, appearance)
    for name in SAME:
        assert np.allclose(getattr(compiled, name), getattr(written, name), rtol=1e-9, equal_nan=True), name
