"""When vessels have to be seen again, beside closed forms, filterpy, and vessels that move at random."""

from __future__ import annotations

import numpy as np
import pytest
from filterpy.common import Q_continuous_white_noise
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.refused import refused
from wildlab.geometry.camera import Camera
from wildlab.geometry.mount import Mount
from wildlab.geometry.uncertainty import PoseErrors
from wildlab.planning.sea import (
    FOREVER,
    Vessels,
    error_by_bank,
    plan_visits,
    predicted,
    reach_of,
    time_until_lost,
)

CAMERA = Camera(640, 512, 1000.0, 1000.0, 320.0, 256.0)


def fleet(count, seed=1, spread=1500.0, acceleration=0.002):
    rng = np.random.default_rng(seed)
    P = np.tile(np.diag([9.0, 9.0, 0.04, 0.04]), (count, 1, 1))
    return Vessels(
        rng.uniform(-spread, spread, (count, 2)), rng.normal(0, 2, (count, 2)), P,
        np.full(count, acceleration),
    )  # fmt: skip


def plan(vessels, **changed):
    given = {
        "speed": 20.0, "reach": 60.0, "leg": 150.0, "turn_time": 8.0, "horizon": 1200.0,
        "seen": 16.0 * np.eye(2),
    } | changed  # fmt: skip
    return plan_visits(vessels, [0.0, 0.0], **given)


def test_covariances_grow_as_others_have_them():
    half = np.random.default_rng(2).normal(size=(4, 4))
    P, t, q = half @ half.T, 7.0, 0.3
    F = np.eye(4)
    F[0, 2] = F[1, 3] = t
    block = Q_continuous_white_noise(2, t, q)
    Q = np.kron(block, np.eye(2))
    assert np.allclose(predicted(P[None], t, q)[0], F @ P @ F.T + Q)
    two = predicted(predicted(P[None], 3.0, q), 4.0, q)
    assert np.allclose(two[0], predicted(P[None], 7.0, q)[0]), "in steps or at once"


@settings(max_examples=50, deadline=None)
@given(st.integers(0, 10**6), st.floats(5, 300))
def test_at_the_deadline_the_ellipse_just_fits(seed, reach):
    vessels = fleet(3, seed)
    due = time_until_lost(vessels, reach)
    for row, t in enumerate(due):
        at = reach_of(predicted(vessels.covariance[row : row + 1], t, vessels.acceleration[row]))[0]
        if t == 0:
            assert at > reach
        else:
            assert at == pytest.approx(reach, rel=1e-6)


def test_a_vessel_that_lies_still_is_never_lost():
    still = fleet(1, acceleration=0.0)._replace(covariance=np.diag([4.0, 4.0, 0.0, 0.0])[None])
    assert time_until_lost(still, 50.0).tolist() == [FOREVER]


def test_in_a_turn_a_point_is_known_less():
    angles = np.radians(1.0) ** 2 * np.eye(3)
    pose = np.zeros((6, 6))
    pose[3:, 3:] = angles
    errors = PoseErrors(np.zeros((2, 2)), pose, np.zeros((3, 3)), 0.0)
    bank = np.radians([0.0, 15.0, 25.0, 40.0])
    found = error_by_bank(CAMERA, Mount("down"), 100.0, errors, bank)
    # Straight down a degree moves the point by height times a degree; aside by one over the cosine squared.
    expected = np.sqrt(-2 * np.log(0.1)) * 100 * np.radians(1.0) / np.cos(bank) ** 2
    assert found == pytest.approx(expected, rel=2e-3)
    assert np.isnan(error_by_bank(CAMERA, Mount("down"), 100.0, errors, [np.radians(120.0)])).all()


def test_passes_are_level_legs_over_where_the_vessel_is_then():
    vessels = fleet(4)
    visits = plan(vessels)
    assert {one.vessel for one in visits} == {0, 1, 2, 3}
    last_end, last_time = np.zeros(2), 0.0
    for one in visits:
        middle = (one.start + one.end) / 2
        t = (one.begins + one.ends) / 2
        assert middle == pytest.approx(vessels.position[one.vessel] + t * vessels.velocity[one.vessel])
        assert np.linalg.norm(one.end - one.start) == pytest.approx(150.0)
        assert one.ends - one.begins == pytest.approx(150.0 / 20.0)
        assert one.begins >= last_time + 8.0 - 1e-6, "there is time to turn"
        # Flown at the speed that there is, but for a vessel so near that the leg alone takes longer.
        assert np.linalg.norm(middle - last_end) <= 20.0 * (t - last_time - 8.0) + 1e-6
        last_end, last_time = one.end, one.ends


def test_vessels_that_are_visited_in_time_are_seen_as_often_as_is_said():
    """Vessels that move at random, looked for where the plan expects them when it expects them."""
    rng, reach, hits = np.random.default_rng(5), 60.0, []
    for seed in range(60):
        vessels = fleet(3, seed, spread=600.0)
        first = {one.vessel: one for one in plan(vessels, horizon=240.0)[::-1]}
        for row, one in first.items():
            t = (one.begins + one.ends) / 2
            if one.slack < 0:
                continue
            P = predicted(vessels.covariance[row : row + 1], t, vessels.acceleration[row])[0]
            off = rng.multivariate_normal(np.zeros(4), P)[:2]
            hits.append(np.abs(off).max() <= reach)
    assert len(hits) > 80 and np.mean(hits) >= 0.9


def test_what_cannot_be_flown_is_refused():
    with refused("speed"):
        plan(fleet(2), speed=0.5)
    with refused("above zero"):
        time_until_lost(fleet(1), 0.0)
    assert plan(fleet(0)) == []


def test_the_most_urgent_is_not_left_to_the_last():
    vessels = fleet(3, spread=300.0)
    sure = np.tile(np.diag([1.0, 1.0, 1e-6, 1e-6]), (3, 1, 1))
    sure[2] = np.diag([100.0, 100.0, 1.0, 1.0])
    visits = plan(vessels._replace(covariance=sure))
    assert visits[0].vessel == 2 and visits[0].slack > 0
