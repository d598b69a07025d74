"""A search that its tracks steer: rows alone, visits, animals that are not there any more."""

from __future__ import annotations

import numpy as np
import pytest

from wildlab.geometry.camera import Camera
from wildlab.geometry.terrain import Terrain
from wildlab.pipeline.animals.follow import Particles
from wildlab.pipeline.animals.images import Detector
from wildlab.pipeline.animals.revisit import Aircraft, Patrolled, Visits, patrol
from wildlab.pipeline.plans.flown import ExecutionErrors
from wildlab.planning.areas import inside_of, rectangle
from wildlab.planning.gimbal import look_down
from wildlab.planning.high_level import SEARCH
from wildlab.tracking.particles import Rules, walk_of
from wildlab.tracking.particles.herd import Moves

FLAT = Terrain(np.zeros((101, 101), np.float32), north=-500.0, east=-500.0, step=10.0)
FENCE = rectangle(0.0, 0.0, 300.0, 300.0, 0.0)
AIRCRAFT = Aircraft(
    Camera(640, 480, 600.0, 600.0, 320.0, 240.0), look_down, 50.0, 5.0,
    ExecutionErrors(0.1, 0.1, 300.0, 0.001, 0.001, 0.001, 60.0), Detector(1.0, 1.0, 0.0, 0.7),
)  # fmt: skip
ROWS = np.array([[-100.0, -100.0], [100.0, -100.0], [100.0, 100.0], [-100.0, 100.0]])
TIMES = np.arange(0.0, 600.0)
VISITS = Visits(alpha=1.0, c=5.0, worth_m2=20.0, patience=10.0)


def flown(places: np.ndarray, visits: Visits, lives: int) -> Patrolled:
    """Animals that stand at places (A, 2), or walk where there are times."""

    def rules(moves: Moves) -> Rules:
        return Rules(moves, particles=300, scheme="systematic")

    truth = np.broadcast_to(places, (len(TIMES), *places.shape[-2:]))
    follower = Particles(walk_of(0.5, 1.0), [inside_of(FENCE)], np.random.default_rng(1), rules)
    return patrol(
        FLAT, AIRCRAFT, ROWS, np.zeros(4, int), np.array([lives]), TIMES, truth, follower, visits,
        np.random.default_rng(2),
    )  # fmt: skip


def test_rows_alone_reach_every_way_point_and_end() -> None:
    done = flown(np.array([[0.0, -100.0]]), VISITS._replace(worth_m2=np.inf), lives=2)
    assert (done.goal == SEARCH).all()
    length = 600.0
    assert done.times[-1] == pytest.approx(length / AIRCRAFT.speed, abs=4)
    for point in ROWS:
        assert np.linalg.norm(done.p_nc[:, :2] - point, axis=1).min() < 1e-6
    assert done.p_nc[:, 2] == pytest.approx(-50.0)
    assert np.isinf(done.done).all() and not done.given_up


def test_a_known_animal_is_gone_back_to_and_found_again() -> None:
    done = flown(np.array([[-60.0, -100.0]]), VISITS, lives=2)
    visits = done.goal != SEARCH
    assert visits.any() and (done.goal[visits] == 1).all()
    back = [one for one in done.found if one.away > 20 and np.isfinite(one.away)]
    assert back and all(one.after < one.before / 2 for one in back)
    assert all(done.goal[one.image] == 1 for one in back)


def test_a_choice_is_the_greatest_of_f_5_2() -> None:
    done = flown(np.array([[-60.0, -100.0]]), VISITS, lives=2)
    reached = 0
    for k in range(1, len(done.times)):
        known = done.known[k - 1]
        here = done.p_nc[k - 1, :2]
        while reached < 4 and np.linalg.norm(here - ROWS[reached]) < 1e-6 and done.goal[k - 1] == SEARCH:
            reached += 1
        if reached == 4:
            break
        spread = np.trace(known.covariance, axis1=1, axis2=2)
        worth = np.where(spread >= 20, spread / np.linalg.norm(known.mean - here, axis=1), 0.0)
        search = VISITS.c / np.linalg.norm(ROWS[reached] - here)
        assert (done.goal[k] != SEARCH) == bool(len(worth) and worth.max() > search)


def test_an_enclosure_with_all_its_animals_is_left() -> None:
    done = flown(np.array([[-60.0, -100.0], [40.0, -100.0]]), VISITS._replace(worth_m2=np.inf), lives=2)
    assert np.isfinite(done.done).all()
    assert done.times[-1] < done.done[0] + 2 and done.times[-1] < 60


def test_a_search_ends_once_its_patience_does() -> None:
    there = np.full((len(TIMES), 1, 2), [-60.0, -100.0])
    there[25:] = [140.0, 140.0]  # seen once, then across the field at once
    done = flown(there, VISITS, lives=3)
    first = int(np.flatnonzero(done.goal == 1)[0])
    ends = first + int(np.argmax(done.goal[first:] != 1))
    # On the way over a field of 300 m at 5 m/s, and then patience; images that miss it move where it may be.
    assert 1 in done.given_up and ends - first < 60 + VISITS.patience + 2
    assert ends < len(done.goal)  # and then flies on


def test_what_is_seen_as_patience_ends_is_not_given_up() -> None:
    there = np.full((len(TIMES), 1, 2), [-60.0, -100.0])
    whole = flown(there, VISITS._replace(patience=0.0), lives=2)
    assert (whole.goal == 1).any() and not whole.given_up
