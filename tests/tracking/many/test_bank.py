"""A bank of filters: with one target it is the single filter; what starts a track, and what is refused."""

from __future__ import annotations

from functools import partial

import numpy as np
import pytest

from wildlab.errors import WildlabError
from wildlab.geometry.validation import gate_threshold
from wildlab.tracking.many.assignment import global_nearest
from wildlab.tracking.many.bank import (
    DISTANCE,
    FEATURES,
    VETO,
    Appearance,
    Looks,
    Tuning,
    associate,
    run_bank,
)
from wildlab.tracking.measurement import positions
from wildlab.tracking.motion import constant_velocity, in_steps
from wildlab.tracking.run import Start, run_filter

INTERVAL = 0.5
TUNING = Tuning(17.5, 0.2, 5.0, gate_threshold(0.99, 2), 5.0)


def test_of_one_target_it_is_the_single_filter():
    """One target with pauses: the states are those of `run_filter`, started on the first detection."""
    rng = np.random.default_rng(4)
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


def test_what_a_veto_has_left_starts_nothing():
    """Other looks in the gate of a track that took nothing are not a new target (H 3.3)."""
    image, z = np.arange(6), np.zeros((6, 2))
    strange = np.array([0, 0, 0, 90, 90, 90], float)[:, None]
    looks = Appearance(strange, np.ones(1), np.ones(1))
    bank = run_bank(Looks(image, z, INTERVAL), TUNING, VETO, looks)
    assert bank.track.tolist() == [0, 0, 0, -1, -1, -1]
    assert run_bank(Looks(image, z, INTERVAL), TUNING, FEATURES, looks).track.tolist() == [0] * 6


def test_each_rule_by_hand():
    d = np.array([[2.0, 1.0], [1.0, 2.0]])
    f = np.array([[0.0, 50.0], [50.0, 0.0]])
    assert associate(d, None, DISTANCE, TUNING, 1).track.tolist() == [1, 0]
    assert associate(d, f, DISTANCE, TUNING, 1).track.tolist() == [1, 0]
    assert associate(d, f, FEATURES, TUNING, 1).track.tolist() == [0, 1]
    assert associate(d, f, VETO, TUNING, 1).track.tolist() == [-1, -1]
    assert associate(d, 0.1 * f, VETO, TUNING, 1).track.tolist() == global_nearest(d, 9.21).track.tolist()
    assert associate(d, 0.22 * f, VETO, TUNING, 1).track.tolist() == [-1, -1], "11 is above 10.8, of one"
    assert associate(d, 0.22 * f, VETO, TUNING, 2).track.tolist() == [1, 0], "and below 13.8, of two"


def test_no_detections_are_no_tracks():
    bank = run_bank(Looks(np.empty(0, int), np.empty((0, 2)), INTERVAL), TUNING)
    assert bank.x.shape == (0, 0, 4)
    assert len(bank.started) == 0


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
