"""Which part of a hull is seen: from its near side, longer along its heading, the same wherever north is."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.tracking.many.test_run import BOTH, LONG, SHIP
from wildlab.tracking.multitarget_tracks import begin
from wildlab.tracking.target_model import (
    STEERS_M_S,
    Gathered,
    gather,
    hull_noise,
    near_side,
    on_one_hull,
)


def turned(angle: float) -> np.ndarray:
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[c, -s], [s, c]])


def test_a_hull_is_longer_along_its_heading():
    sensor = LONG._replace(rough_m=(0.0, 1.5), along_m=(0.0, 6.0))
    fast = np.array([[[0.0, 0.0, 50.0, 0.0]] * 2])
    assert np.allclose(hull_noise(fast, sensor)[0, 1], np.diag([1.5**2 + 6.0**2, 1.5**2]), rtol=1e-3)
    assert np.allclose(hull_noise(fast, sensor)[0, 0], 0)
    # At rest it may lie either way: half of it along each axis. At the limit, half of that is its course's.
    assert np.allclose(hull_noise(0 * fast, sensor)[0, 1], (1.5**2 + 18.0) * np.eye(2))
    slow = np.array([[[0.0, 0.0, STEERS_M_S, 0.0]] * 2])
    assert np.allclose(hull_noise(slow, sensor)[0, 1], np.diag([1.5**2 + 27.0, 1.5**2 + 9.0]))


@given(st.floats(-np.pi, np.pi), st.integers(0, 1000))
def test_it_is_the_same_wherever_north_is(angle, seed):
    rng, T = np.random.default_rng(seed), turned(angle)
    x, platform = rng.normal(0, 5, (3, 2, 4)), rng.normal(0, 50, 2)
    rotated = np.concatenate([x[..., :2] @ T.T, x[..., 2:] @ T.T], axis=-1)
    assert np.allclose(hull_noise(rotated, LONG), T @ hull_noise(x, LONG) @ T.T)
    assert np.allclose(near_side(rotated, T @ platform, LONG), near_side(x, platform, LONG) @ T.T)


def test_what_is_seen_lies_towards_the_platform_and_not_beyond_its_half():
    x = np.array([[[10.0, 0.0, 1.0, 0.0]] * 2, [[0.0, -4.0, 1.0, 0.0]] * 2, [[0.0, 0.0, 1.0, 0.0]] * 2])
    found = near_side(x, np.zeros(2), LONG)
    assert np.allclose(found[0], [[0, 0], [-3, 0]]) and np.allclose(found[1], [[0, 0], [0, 2]])
    assert np.allclose(found[2], 0)


def test_the_near_side_of_a_ship_is_that_of_an_ellipse():
    """Its side from abeam, its end from ahead or astern; else, as of one at rest, a mean of squares."""
    ship = LONG._replace(near_side_m=(0.0, 3.0), near_end_m=(0.0, 12.0))

    def seen(v: list[float]) -> float:
        x = np.array([[[100.0, 0.0, *v]] * 2])
        return float(-near_side(x, np.zeros(2), ship)[0, 1, 0])

    steers = 9 / (9 + STEERS_M_S**2)
    for v, cosine in (([3.0, 0.0], 1.0), ([-3.0, 0.0], 1.0), ([0.0, 3.0], 0.0), ([1.8, 2.4], 0.6)):
        along = steers * cosine**2 + (1 - steers) / 2
        assert np.isclose(seen(v), np.sqrt(along * 144 + (1 - along) * 9))
    assert np.isclose(seen([0.0, 0.0]), np.sqrt((144 + 9) / 2))


def gathered(z: np.ndarray, likely: float | list[float], kinds: list[float], **changes: Any) -> Gathered:
    """Measurements (M, m) with one sure track at the origin, as likely of the ship as told."""
    likelihood = np.zeros((1, 2, len(z)))
    likelihood[0, 1] = likely
    sensor = LONG._replace(several=True, **changes)
    m = z.shape[1]
    J = np.arange(2.0 * m * len(z)).reshape(len(z), m, 2)
    R = np.tile(np.eye(m), (len(z), 1, 1))
    return gather(
        z, R, J, np.zeros((1, 2)), np.array([kinds]), np.array([True]), likelihood, sensor, BOTH.hulls
    )


def along(*north: float, likely: float, clutter: float = 1e-5) -> Gathered:
    """Of places along a line through a track whose kinds are as probable as each other."""
    return gathered(np.array([[one, 0.0] for one in north]), likely, [0.5, 0.5], clutter=clutter)


def test_parts_of_a_hull_count_as_they_are_likely():
    """The stern, seen now and then, does not pull a track aft whose superstructure is seen always."""
    z = np.array([[0.0, 1.0], [-20.0, 0.0], [300.0, 0.0]])
    found = gathered(z, [0.03, 0.01, 0.0], [0.1, 0.9])
    assert np.allclose(found.z, [[300.0, 0.0], [-5.0, 0.75]]) and len(found.R) == 2
    # What they share is numbered: 0 to 3 of the first, 4 to 7 of the second, 8 to 11 of the third.
    assert np.allclose(found.shared, [[[8, 9], [10, 11]], [[1, 2], [3, 4]]])
    spread = 0.75 * np.outer([5, 0.25], [5, 0.25]) + 0.25 * np.outer([-15, -0.75], [-15, -0.75])
    assert np.allclose(found.R[1], np.eye(2) + spread)
    # What no gate takes is of the hull all the same, each part alike.
    z[1] = [-10.0, 0.0]
    assert np.allclose(gathered(z, 0.0, [0.1, 0.9]).z, [[300.0, 0.0], [-5.0, 0.5]])


def test_each_further_measurement_tells_of_a_ship_and_the_first_does_not():
    """On its hull they are three times as dense as clutter; the first one any target has."""
    clutter = 1 / (3 * SHIP.length_m * SHIP.beam_m)
    assert np.allclose(along(0.0, likely=0.01, clutter=clutter).kinds, [[1 / 2, 1 / 2]])
    assert np.allclose(along(-5.0, 5.0, likely=0.01, clutter=clutter).kinds, [[1 / 4, 3 / 4]])
    assert np.allclose(along(-5.0, 0.0, 5.0, likely=0.01, clutter=clutter).kinds, [[1 / 10, 9 / 10]])


def test_what_is_farther_apart_than_a_ship_is_long_is_not_one():
    """All of it lies in the gate of the one track."""
    assert np.allclose(along(-14.5, 14.5, likely=0.01).z, [[0.0, 0.0]])
    apart = along(-15.5, 15.5, likely=0.01)
    assert len(apart.z) == 2 and np.allclose(apart.kinds, 0.5)


def test_bearings_of_one_hull_are_not_merged():
    """The mean of two on either side of south would be north."""
    z = np.array([[np.pi - 0.01], [0.01 - np.pi]])
    found = gathered(z, 1.0, [0.1, 0.9], bearings=True)
    assert np.array_equal(found.z, z) and np.array_equal(found.kinds, [[0.1, 0.9]])


def test_a_new_track_is_where_its_measurement_would_be_seen():
    z, platform = np.array([[60.0, 5.0], [-20.0, 80.0]]), np.array([3.0, -9.0])
    R = np.tile(np.eye(2), (2, 1, 1))
    tracks = begin(z, R, 2.0, platform, (LONG,), 0, BOTH, 7, np.zeros((2, 2, 0)))
    seen = tracks.x[..., :2] + near_side(tracks.x, platform, LONG)
    assert np.allclose(seen, z[:, None], atol=0.05) and not np.allclose(tracks.x[:, 1, :2], z, atol=1.0)
    assert tracks.identity.tolist() == [7, 8] and np.allclose(tracks.kinds, [0.6, 0.4])
    assert np.allclose(tracks.P[:, 1, :2, :2], (1 + 1.0**2 + 6.0**2 / 2) * np.eye(2))


@pytest.mark.parametrize(
    ("other", "one"),
    [
        ([20.0, 2.0, 3.0, 0.2], True),
        ([35.0, 0.0, 3.0, 0.0], False),  # too far ahead
        ([10.0, 7.0, 3.0, 0.0], False),  # abreast
        ([20.0, 0.0, 1.0, 0.0], False),  # slower
    ],
)
def test_two_ends_of_one_hull_and_two_ships(other, one):
    assert on_one_hull([0.0, 0.0, 3.0, 0.0], other, SHIP) == one
    assert not on_one_hull([0.0, 0.0, 0.1, 0.0], [5.0, 0.0, 0.1, 0.0], SHIP), "at rest nobody knows the line"
