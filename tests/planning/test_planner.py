"""The receding-horizon planner: its compiled sums against plain ones, and what it does in plain worlds."""

from __future__ import annotations

import numpy as np
import pytest

from tests.planning.ground import FLAT, bearing_information, with_wall
from wildlab.geometry.georeference import Terrain
from wildlab.planning.legs import (
    Flying,
    Leg,
    PatternPlanner,
    Platform,
    RandomWalk,
    SearchSensor,
    heading_change,
    look_attitude,
    turn_between,
)
from wildlab.planning.planner import (
    Horizon,
    InformationPlanner,
    detection_probability,
    gains_of_steps,
    initial_information,
    inverse_traces,
)

SENSOR = SearchSensor((0.3, 0.2), sd=0.2, reach=80.0, nearest=5.0)
FLYING = Flying(5.0, 50.0)
DOWN = Platform(np.zeros(2), 0.0, look_attitude(0.0, 0.0, 0.0))


def grid(north: tuple[float, float], east: tuple[float, float]) -> np.ndarray:
    axes = np.meshgrid(np.arange(*north, 10.0), np.arange(*east, 10.0), indexing="ij")
    return np.column_stack([axes[0].ravel(), axes[1].ravel(), np.zeros(axes[0].size)])


def planner(points: np.ndarray, terrain: Terrain = FLAT, **horizon) -> InformationPlanner:
    Y = initial_information(len(points), [60.0, 60.0, 1.0])
    return InformationPlanner(points, Y, terrain, SENSOR, FLYING, Horizon(**horizon))


@pytest.fixture(scope="module")
def legs():
    """Legs over a grid, with every kind of image: sideways, ahead, not at rest."""
    rng = np.random.default_rng(3)
    made = []
    for _ in range(6):
        heading, side, ahead = rng.uniform(-np.pi, np.pi), rng.uniform(-0.8, 0.8), rng.uniform(0, 0.8)
        p = np.column_stack([rng.uniform(-60, 60, (3, 2)), rng.uniform(-70, -40, 3)])
        rest = rng.random(3) < 0.7
        made.append(Leg(p, look_attitude(heading, side, ahead)[None], rest, heading, np.arange(1.0, 4.0)))
    return made


def plain(Y: np.ndarray, points: np.ndarray, leg: Leg) -> np.ndarray:
    for p, counts in zip(leg.p_nc, leg.counts, strict=True):
        if counts:
            found = detection_probability(points, p, leg.R_nc[0], SENSOR)
            Y = Y + found[:, None, None] * bearing_information(points, p, SENSOR)  # F (5.10)
    return Y


def left_to_know(Y: np.ndarray, weights: np.ndarray | float = 1.0) -> float:
    """F (5.6)."""
    return float(np.sum(weights * inverse_traces(Y)))


def test_compiled_sums_are_the_plain_ones(legs):
    one = planner(grid((-80, 80), (-80, 80)))
    Y = one.Y.copy()
    for leg in legs:
        one.add(leg)
        Y = plain(Y, one.points, leg)
    one.wait(0.7)
    Y = np.linalg.inv(np.linalg.inv(Y) + np.diag([0.7, 0.7, 0.0]))  # F (5.5)
    np.testing.assert_allclose(one.Y, Y, rtol=1e-9, atol=1e-15)
    assert one.left == pytest.approx(inverse_traces(Y), rel=1e-9)


def test_gains_of_candidates_are_differences_of_the_objective(legs):
    one = planner(grid((-80, 80), (-80, 80)))
    one.add(legs[0])
    one.weights[::3] = 0.5
    cams = np.stack([leg.p_nc for leg in legs])
    R = np.stack([leg.R_nc for leg in legs])
    counts = np.stack([leg.counts for leg in legs])[:, None]
    reach = one._reach(cams, R).max(axis=1) + 120.0
    gains = gains_of_steps(
        one.Y[None], one.left[None], one.weights, one.points, np.zeros(6, np.int64), cams, R, counts, reach,
        np.array([0.3, 0.2]), SENSOR.sd, SENSOR.reach, SENSOR.nearest,
    )  # fmt: skip
    for leg, gain in zip(legs, gains[:, 0], strict=True):
        expected = one.weights @ one.left - left_to_know(plain(one.Y, one.points, leg), one.weights)
        assert gain == pytest.approx(expected, rel=1e-9, abs=1e-6)
    assert gains.max() > 100


def test_where_nothing_counts_it_does_not_go():
    """Two fields alike, to the east and the west beyond the first step; one of them counts for nothing."""
    east, west = grid((-60, 60), (150, 260)), grid((-60, 60), (-250, -140))
    for side in (1.0, -1.0):
        one = planner(np.concatenate([east, west]), turns=(-np.pi / 2, np.pi / 2), steps=1, beyond=1.0)
        one.weights[one.points[:, 1] * side < 0] = 0.0
        assert side * one.choose(DOWN).leg.p_nc[-1, 1] > 10


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_it_looks_aside_where_that_shows_more(side):
    """A strip beside the way: the middle of the image lies on it, and a camera that is fixed tells less."""
    strip = grid((-50, 50), (30, 60)) * [1.0, side, 1.0]
    looks = ((0.0, 0.0), (0.6, 0.0), (-0.6, 0.0))
    free = planner(strip, looks=looks, turns=(0.0,), steps=1, beyond=0.0).choose(DOWN)
    fixed = planner(strip, turns=(0.0,), steps=1, beyond=0.0).choose(DOWN)
    view = free.leg.R_nc[0, :, 2]
    middle = free.leg.p_nc[-1] - view * free.leg.p_nc[-1, 2] / view[2]
    assert abs(view[1]) > 0.1 and 20 < side * middle[1] < 70
    assert free.gain > 1.5 * fixed.gain


def test_what_is_learnt_later_counts_less():
    """A little at hand to the west, much in the east that only the second step shows."""
    points = np.concatenate([grid((-5, 15), (-90, -70)), grid((-60, 60), (120, 240))])
    given = {"turns": (-np.pi / 2, np.pi / 2), "looks": ((0.0, 0.0), (0.0, 0.9)), "steps": 3, "beam": 50}
    patient = planner(points, beyond=0.0, fades=1.0, **given).choose(DOWN)
    hasty = planner(points, beyond=0.0, fades=1e-3, **given).choose(DOWN)
    assert patient.leg.p_nc[-1, 1] > 10 and hasty.leg.p_nc[-1, 1] < -10


def test_what_a_step_learns_is_not_counted_again_beyond_it():
    """Where what is left counts twice, it would rather leave it, and looks where there is nothing."""
    points = grid((-80, 80), (20, 120))
    given = {"turns": (0.0, np.pi / 2), "looks": ((0.0, 0.0), (0.6, 0.0)), "steps": 1, "fades": 1.0}
    calm = planner(points, beyond=2.0, **given).choose(DOWN)
    keen = planner(points, beyond=0.0, **given).choose(DOWN)
    assert calm.gain == 0 and keen.gain > 1000


def test_a_wall_hides_what_is_behind_it():
    walled = with_wall(30, 45.0)
    behind = grid((-50, 50), (40, 60))
    free = planner(behind, walled, looks=((0.7, 0.0),), turns=(0.0,), steps=1, beyond=0.0).choose(DOWN)
    assert free.gain > 1000
    one = planner(behind, walled)  # what was flown is never taken for clear
    before = one.weights @ one.left
    one.add(free.leg)
    assert before - one.weights @ one.left < 0.2 * free.gain


def test_images_count_from_when_the_camera_is_at_rest():
    flying = Flying(5.0, 50.0, slew=np.radians(60))
    assert flying.ready(np.radians([0, 50, 90, 170, 200])).tolist() == [
        [True, True, True], [True, True, True], [False, True, True], [False, False, True], [False] * 3,
    ]  # fmt: skip
    assert turn_between(look_attitude(0.3, 0.0, 0.0), look_attitude(1.5, 0.0, 0.0)) == pytest.approx(1.2)
    assert turn_between(look_attitude(0.3, -0.2, 0.0), look_attitude(0.3, 0.5, 0.0)) == pytest.approx(0.7)


def test_turns_take_time_in_proportion():
    flying = Flying(5.0, 50.0, turn_time=4.0)
    turns = np.radians([0, 20, 45, -90, 180])
    assert flying.turning(turns) == pytest.approx([0, 4 / 9, 1, 2, 4])
    assert flying.taken_at([2.0, 0.0, 1.0]).tolist() == [3, 4, 6]
    # While the platform turns, the gimbal turns too: at 60 deg/s, 170 deg are done after three seconds.
    assert flying.ready(np.radians(170), 2.0).all() and not flying.ready(np.radians(170)).all()
    assert heading_change(np.radians([170, 0]), np.radians([-170, 270])) == pytest.approx(
        np.radians([20, 90])
    )


def test_all_who_turn_wait_as_long():
    """East from a heading north, by each planner: 2 s of turning before the first image."""
    flying = Flying(5.0, 50.0, turn_time=4.0)
    points = grid((-50, 50), (150, 250))
    Y = initial_information(len(points), [60.0, 60.0, 1.0])
    horizon = Horizon(turns=(np.pi / 2,))
    by_information = InformationPlanner(points, Y, FLAT, SENSOR, flying, horizon).choose(DOWN).leg
    rows = PatternPlanner([[0.0, 100.0]], FLAT, flying).choose(DOWN)
    far = np.array([[-5.0, 200.0], [5.0, 200.0], [5.0, 210.0], [-5.0, 210.0]])
    by_chance = RandomWalk([far], FLAT, flying, np.random.default_rng(1)).choose(DOWN)
    for leg in (by_information, rows, by_chance):
        assert leg.heading == pytest.approx(np.pi / 2, abs=0.1)
        assert leg.at == pytest.approx([3, 4, 5], abs=0.1)
    # A corner on the way is waited at, not before.
    corner = PatternPlanner([[7.0, 0.0], [7.0, 50.0]], FLAT, flying).choose(DOWN)
    assert corner.at == pytest.approx([1, 4, 5])
    round_trip = PatternPlanner([[1.0, 0.0], [1.0, 1.0], [-50.0, 1.0]], FLAT, flying).choose(DOWN)
    assert round_trip.at == pytest.approx([5, 6, 7])


def test_way_points_are_visited_in_their_order_and_once():
    flying = Flying(5.0, 50.0, images=4)
    pattern = PatternPlanner([[10.0, 0.0], [10.0, 12.0], [30.0, 12.0]], FLAT, flying)
    leg = pattern.choose(DOWN)
    assert leg.p_nc[:, :2].tolist() == [[5, 0], [10, 0], [10, 5], [10, 10]]
    assert pattern.visited == 1 and leg.heading == pytest.approx(np.pi / 2)
    # A turn of 90 deg takes 1.5 s, and an image comes every second.
    assert leg.counts.tolist() == [True, True, False, True]
    elsewhere = Platform(np.array([10.0, 2.0]), 0.0, leg.R_nc[-1])
    back = pattern.choose(elsewhere)
    assert back.p_nc[0, :2].tolist() == [10, 7] and pattern.visited == 2
    assert not pattern.done
    pattern.choose(back.end)
    last = pattern.choose(back.end)
    assert pattern.done and (pattern.choose(last.end).p_nc[:, :2] == last.p_nc[-1, :2]).all()


def test_a_pattern_turns_the_camera_from_side_to_side():
    pattern = PatternPlanner([[100.0, 0.0]], FLAT, FLYING, sides=[0.4, -0.4])
    leg = pattern.choose(DOWN)
    assert leg.R_nc[:, 1, 2] == pytest.approx(np.sin([0.4, -0.4, 0.4]))
    assert pattern.choose(leg.end).R_nc[0, 1, 2] == pytest.approx(-np.sin(0.4))


def test_a_random_walk_stays_in_its_areas_and_repeats_with_its_generator():
    area = np.array([[0.0, 0.0], [100.0, 0.0], [100.0, 80.0], [0.0, 80.0]])
    ways = []
    for seed in (1, 1, 2):
        walk, at = RandomWalk([area], FLAT, FLYING, np.random.default_rng(seed)), DOWN
        way = [(at := walk.choose(at).end).north_east for _ in range(200)]
        ways.append(np.array(way))
    assert (ways[0] == ways[1]).all() and not (ways[0] == ways[2]).all()
    assert (ways[0] > -15.1).all() and (ways[0] < [115.1, 95.1]).all()
    assert np.ptp(ways[0], axis=0).min() > 50
