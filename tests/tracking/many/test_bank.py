"""A bank of filters: with one target the single filter; what starts and continues a track."""

from __future__ import annotations

from functools import partial

import numpy as np
import pytest
from scipy.stats import chi2

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
from wildlab.tracking.many.bank import Looks, Tuning, compare_looks, nobody, run_bank
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
        tracks = nobody(3)._replace(total=np.zeros((1, 3)), known=np.full((1, 3), 1e9))
        limits = limits_of(STATE, TUNING.gate, 0.999, looks)
        inside = place + compare_looks(features, tracks, looks, STATE, TUNING.gate)[:, 0] <= limits.gate
        assert inside.mean() == pytest.approx(0.99, abs=0.002), known
    assert limits_of(STATE, 76.0, 0.999, looks).gate == pytest.approx(chi2.isf(np.exp(-38.0), 4))
    assert limits_of(STATE, np.inf, 0.999, looks).gate == np.inf
    veto = limits_of(VETO, TUNING.gate, 0.99, looks)
    squares = feature_distances(rng.normal(size=(40000, 3)), np.zeros((1, 3)), np.ones(3), looks.used)
    assert (squares <= veto.alike).mean() == pytest.approx(0.99, abs=0.002)
    none = Appearance(np.zeros((1, 1)), np.ones(1), np.zeros(1))
    assert limits_of(VETO, TUNING.gate, 0.99, none).alike == np.inf


def test_weights_are_of_features_that_are_weighed_in_alone():
    tracks = nobody(1)._replace(stored=np.zeros((1, 1)), total=np.zeros((1, 1)), known=np.full((1, 1), 2.0))
    looks = Appearance(np.zeros((1, 1)), np.ones(1), np.array([9.0]))
    seen = {rule: compare_looks(np.array([[3.0]]), tracks, looks, rule, 9.21) for rule in RULES[1:]}
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
