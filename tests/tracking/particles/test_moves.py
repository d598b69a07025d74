"""Where particles go: as the motion model says, to the places that draw them, and not through the fence."""

from __future__ import annotations

from functools import partial

import numpy as np
import pytest

from wildlab.errors import WildlabError
from wildlab.tracking.motion import constant_position, constant_velocity, in_steps
from wildlab.tracking.particles import (
    Cloud,
    drift,
    moments,
    move,
    move_by_sight,
    start_gaussian,
    start_inside,
    stay_inside,
    walk_of,
)

N = 40_000


def near(covariance, wanted, count=N):
    """Within five errors of a sample covariance of normal numbers."""
    sd = np.sqrt(np.diag(wanted))
    return (
        np.abs(covariance - wanted) <= 5 * np.sqrt((np.outer(sd, sd) ** 2 + wanted**2) / count) + 1e-9
    ).all()


def test_a_cloud_moves_as_its_model_says():
    rng = np.random.default_rng(1)
    start, P = np.array([10.0, 5.0, 1.0, -2.0]), np.diag([9.0, 4.0, 0.25, 1.0])
    motion = partial(constant_velocity, sd_acceleration=0.7)
    F, Q = motion(3.0)
    mean, covariance = moments(move(start_gaussian([start], P, N, rng), motion, 3.0, rng))
    wanted = F @ P @ F.T + Q
    assert (np.abs(mean[0] - F @ start) < 5 * np.sqrt(np.diag(wanted) / N)).all()
    assert near(covariance[0], wanted)


@pytest.mark.parametrize("step", [0.5, 1.0, 3.0])
def test_the_walk_does_not_depend_on_how_often_it_is_predicted(step):
    """It spreads as (4.5) does when (4.5) is taken in its own step, and as (4.5) alone does not."""
    walk, printed = walk_of(0.5, step), partial(constant_position, sd_velocity=0.5)
    _, half_an_hour = walk(1800.0)
    np.testing.assert_allclose(half_an_hour, in_steps(1800.0, printed, step)[1], rtol=1e-9)
    np.testing.assert_allclose(half_an_hour, 600 * walk(3.0)[1], rtol=1e-9)
    assert not np.allclose(printed(3.0)[1], 30 * printed(0.1)[1])


@pytest.mark.parametrize("sd, step", [(-1.0, 1.0), (1.0, 0.0), (np.nan, 1.0), (1.0, np.inf)])
def test_a_walk_without_a_step_is_refused(sd, step):
    with pytest.raises(WildlabError, match="more than zero"):
        walk_of(sd, step)


@pytest.mark.parametrize("dt", [0.1, 60.0, 4000.0])
def test_one_place_draws_as_the_closed_form_says(dt):
    """Ornstein and Uhlenbeck: exact for any step, and a plain walk for a short one."""
    rng, place = np.random.default_rng(2), np.array([50.0, -20.0])
    density, spread = 0.6, 25.0
    after = drift(np.zeros((N, 2)), dt, rng, density=density, places=[place], spread=spread)
    rate = density**2 / (2 * spread**2)
    variance = spread**2 * (1 - np.exp(-2 * rate * dt))
    assert (np.abs(after.mean(axis=0) - place * (1 - np.exp(-rate * dt))) < 5 * np.sqrt(variance / N)).all()
    assert near(np.cov(after.T), variance * np.eye(2))
    if dt == 0.1:
        np.testing.assert_allclose(variance, density**2 * dt, rtol=1e-3)


def test_in_the_long_run_they_are_where_the_places_are():
    """A mixture about its places, each with its share; those who start in it stay in it."""
    rng = np.random.default_rng(4)
    places, shares, spread = np.array([[0.0, 0.0], [0.0, 50.0]]), np.array([0.3, 0.7]), 25.0
    where = places[rng.choice(2, 8000, p=shares)] + spread * rng.standard_normal((8000, 2))
    away = np.zeros((8000, 2))
    for _ in range(400):
        both = np.stack([where, away])
        where, away = drift(both, 30.0, rng, density=1.0, places=places, spread=spread, shares=shares)
    assert abs(where[:, 1].mean() - 35) < 2.0  # 0.3 * 0 + 0.7 * 50
    assert abs(where[:, 1].std() - np.sqrt(25**2 + 0.21 * 50**2)) < 1.5
    assert abs(where[:, 0].std() - 25) < 0.7
    # Started all in one place, they forget it.
    assert abs(away[:, 1].mean() - 35) < 2.0


@pytest.mark.parametrize(
    "wrong",
    [
        {"places": np.zeros((0, 2))},
        {"shares": [1.0]},
        {"shares": [0.0, 0.0]},
        {"spread": 0.0},
        {"density": 0.0},
    ],
)
def test_places_that_do_not_draw_are_refused(wrong):
    told = {"density": 1.0, "places": [[0.0, 0.0], [1.0, 1.0]], "spread": 1.0, "shares": [1.0, 1.0]} | wrong
    with pytest.raises(WildlabError, match=r"place|spread"):
        drift(np.zeros((1, 2)), 1.0, np.random.default_rng(0), **told)


def test_in_sight_they_keep_their_velocity_and_out_of_sight_they_forget_it():
    rng = np.random.default_rng(6)
    start = np.array([[0.0, 0.0, 2.0, 0.0]] * 2)
    cloud = start_gaussian(start, np.diag([1.0, 1.0, 0.01, 0.01]), N, rng)
    motion = partial(constant_velocity, sd_acceleration=0.1)
    after = move_by_sight(
        cloud, [True, False], 10.0, rng, motion=motion, sd_velocity=0.5,
        density=0.5, places=[[0.0, 100.0]], spread=10.0,
    )  # fmt: skip
    mean, covariance = moments(after)
    F, Q = motion(10.0)
    assert np.abs(mean[0] - [20, 0, 2, 0]).max() < 0.2
    assert near(covariance[0], F @ np.diag([1.0, 1.0, 0.01, 0.01]) @ F.T + Q)
    assert np.abs(mean[1, 2:]).max() < 0.02 and near(covariance[1, 2:, 2:], 0.25 * np.eye(2))
    assert abs(mean[1, 0]) < 0.1 and mean[1, 1] > 0.5  # not 20 m on, but towards the place
    np.testing.assert_array_equal(after.w, cloud.w)


def test_nobody_leaves_and_all_of_the_enclosure_is_used():
    def half_disc(places):
        return (np.hypot(places[..., 0], places[..., 1]) < 50) & (places[..., 0] > 0)

    rng = np.random.default_rng(8)
    cloud = start_inside(half_disc, [0, -50], [50, 50], 1, 20_000, rng)
    corner = Cloud(np.full_like(cloud.x, 1.0), cloud.w)
    for _ in range(400):
        cloud = stay_inside(cloud, move(cloud, walk_of(2.0, 1.0), 10.0, rng), half_disc)
        corner = stay_inside(corner, move(corner, walk_of(2.0, 1.0), 10.0, rng), half_disc)
        assert half_disc(cloud.x).all()
    for one in (
        cloud,
        corner,
    ):  # even in the long run, wherever it started: a half disc's middle is 4 r / 3 pi
        mean, covariance = moments(one)
        assert abs(mean[0, 0] - 4 * 50 / (3 * np.pi)) < 0.6 and abs(mean[0, 1]) < 1.0
        assert abs(covariance[0, 1, 1] - 50**2 / 4) < 25


def test_a_velocity_that_led_out_is_given_up():
    before = Cloud(np.array([[[0.0, 0.0, 9.0, 0.0], [0.0, 0.0, 1.0, 0.0]]]), np.full((1, 2), 0.5))
    after = Cloud(np.array([[[9.0, 0.0, 9.0, 0.0], [1.0, 0.0, 1.0, 0.0]]]), np.full((1, 2), 0.5))
    kept = stay_inside(before, after, lambda p: p[..., 0] < 5)
    assert kept.x.tolist() == [[[0, 0, 0, 0], [1, 0, 1, 0]]]
