"""A bank of filters: with one target the single filter; what starts and continues a track."""

from __future__ import annotations

from functools import partial

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from wildlab.studies.crossing_vessels import (
    ACCELERATION,
    MEASURED_M,
    TOLD_SD,
    VELOCITY_0,
    ImageDetections,
    feature_distances,
    image_features,
    run_bank,
)
from wildlab.tracking.motion import constant_velocity, in_steps
from wildlab.tracking.run import Start, run_filter
from wildlab.tracking.sensors import positions

INTERVAL = 0.5


def test_of_one_target_it_is_the_single_filter():
    """One target with pauses: the states are those of `run_filter`, started on the first detection."""
    rng = np.random.default_rng(4)
    image = np.array([3, 4, 5, 6, 7, 9, 10, 40, 41, 90])
    z = np.column_stack([0.1 * image, -0.2 * image]) + rng.normal(0, 10, (len(image), 2))
    bank = run_bank(ImageDetections(image, z, INTERVAL))
    assert bank.track.tolist() == [0] * len(image)
    assert np.isnan(bank.x[0]).all()
    motion = partial(
        in_steps,
        motion=partial(constant_velocity, sd_acceleration=ACCELERATION),
        longest=1.001 * INTERVAL,
    )
    first = Start(
        image[0] * INTERVAL,
        np.r_[z[0], 0, 0],
        np.diag([MEASURED_M**2] * 2 + [VELOCITY_0**2] * 2),
    )
    R = MEASURED_M**2 * np.eye(2)
    single = run_filter(image[1:] * INTERVAL, z[1:], R, positions(), motion, first)
    assert np.allclose(bank.x[1:, 0], single.x, atol=1e-9)
    assert np.allclose(bank.P[1:, 0], single.P, atol=1e-9)


def test_a_single_detection_starts_nothing_and_neither_do_two_far_apart():
    for image, z in (([1], [[0, 0]]), ([1, 3], [[0, 0], [0, 0]]), ([1, 2], [[0, 0], [500, 0]])):
        bank = run_bank(ImageDetections(np.array(image), np.array(z, float), INTERVAL))
        assert (bank.track == -1).all()
        assert len(bank.started) == 0


def test_two_in_one_image_do_not_go_to_one_track():
    """The second finds the only gate taken: with its like in the next image it starts a track of its own."""
    image = np.array([1, 2, 3, 3, 4, 4])
    z = np.array([[0, 0], [0, 0], [0, 0], [20, 0], [0, 0], [20, 0]], float)
    bank = run_bank(ImageDetections(image, z, INTERVAL))
    assert bank.track.tolist() == [0, 0, 0, 1, 0, 1]
    assert bank.started.tolist() == [0, 3]
    assert np.isnan(bank.x[:3, 1]).all() and np.isfinite(bank.x[3, 1]).all()


def test_what_looks_alike_goes_together_and_the_gate_is_of_the_distance_alone():
    """Two tracks that keep the mean of two first looks each; then both detections lie between the two."""
    image = np.array([1, 1, 2, 2, 3, 3])
    z = np.array([[0, 0], [40, 0], [0, 0], [40, 0], [18, 0], [22, 0]], float)
    size = np.array([TOLD_SD[0], 0, 0])
    looks = np.outer([0.0, 10, 2, 12, 11, 1], size)
    assert run_bank(ImageDetections(image, z, INTERVAL)).track.tolist() == [0, 1, 0, 1, 0, 1]
    assert run_bank(ImageDetections(image, z, INTERVAL), looks).track.tolist() == [0, 1, 0, 1, 1, 0]
    far = z + np.array([[0.0, 0]] * 4 + [[0, 500]] * 2)
    assert run_bank(ImageDetections(image, far, INTERVAL), looks).track[4:].tolist() == [-1, -1]
    # What is kept is the mean, 1 and 11, as uncertain as half of a look.
    alike = np.outer([0.0, 10, 2, 12, 6.06, 6], size)
    assert run_bank(ImageDetections(image, z, INTERVAL), alike).track[4:].tolist() == [1, 0]
    assert run_bank(ImageDetections(image, z, INTERVAL), alike / 1.5**0.25).track[4:].tolist() == [0, 1]


values = arrays(np.float64, (3, 2), elements=st.floats(-50, 50))


@given(values, values)
def test_it_is_the_sum_of_its_features(measured, stored):
    sd = np.array([2.0, 0.5])
    found = feature_distances(measured, stored, sd)
    for i, new in enumerate(measured):
        for j, old in enumerate(stored):
            expected = sum(((a - b) / s) ** 2 for a, b, s in zip(new, old, sd, strict=True))
            assert found[i, j] == pytest.approx(expected)


def test_size_on_the_ground_does_not_depend_on_the_distance():
    near = image_features([400.0], [10.0], [[0.2] + [0.0] * 6], 0.25)
    far = image_features([100.0], [10.0], [[0.2]], 0.5)
    assert np.allclose(near, far)
    assert np.allclose(near, [[np.log(25), 10, np.log(0.2)]])
    assert np.isnan(image_features([0.0], [1.0], [[0.0]], 1.0)).tolist() == [[True, False, True]]
