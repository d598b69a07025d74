"""Filters of positions and velocities against filterpy and the loop by hand; what every filter refuses."""

from dataclasses import replace
from functools import partial

import numpy as np
import pytest
from filterpy.kalman import KalmanFilter
from scipy.stats import chi2

from tests.tracking.level_sensors import ranges_bearings
from tests.tracking.poses import overflight, turned
from wildlab.errors import WildlabError
from wildlab.tracking import sensors as m
from wildlab.tracking.batch import BatchCamera, run_batch
from wildlab.tracking.filters import run_coloured, run_imm, run_unscented
from wildlab.tracking.kalman import Considered, predict, update
from wildlab.tracking.motion import (
    constant_velocity,
    in_steps,
    random_walk,
    rest,
)
from wildlab.tracking.run import Start, run_filter, start_from_first


def test_predict_and_update_agree_with_filterpy_over_random_models(rng):
    for _ in range(20):
        n, m = rng.integers(1, 6), rng.integers(1, 4)

        def spread(k):
            A = rng.normal(size=(k, k))
            return A @ A.T + 0.1 * np.eye(k)

        F, H = rng.normal(size=(n, n)), rng.normal(size=(m, n))
        Q, R, x, P = spread(n), spread(m), rng.normal(size=n), spread(n)
        oracle = KalmanFilter(dim_x=n, dim_z=m)
        oracle.F, oracle.H, oracle.Q, oracle.R, oracle.x, oracle.P = F, H, Q, R, x.copy(), P.copy()
        for z in rng.normal(size=(5, m)):
            oracle.predict()
            oracle.update(z)
            x, P = predict(x, P, F, Q)
            step = update(x, P, z, H, R)
            x, P = step.x, step.P
            assert np.allclose(x, oracle.x, rtol=1e-10, atol=1e-10)
            assert np.allclose(P, oracle.P, rtol=1e-10, atol=1e-10)
            assert np.allclose(step.S, oracle.S)
            assert np.allclose(step.innovation, oracle.y)


def test_at_rest_the_filter_is_the_weighted_mean(rng):
    A = rng.normal(size=(30, 2, 2))
    R = A @ np.swapaxes(A, 1, 2) + 0.2 * np.eye(2)
    z = rng.normal(size=(30, 2))
    information = np.linalg.inv(R)
    P = np.linalg.inv(information.sum(axis=0))
    mean = P @ np.einsum("nij,nj->i", information, z)
    start = Start(0.0, z[0], R[0], 0)
    filtered = run_filter(np.arange(len(z)), z, R, m.positions(), rest, start)
    assert np.allclose(filtered.x[-1], mean)
    assert np.allclose(filtered.P[-1], P)


CV = partial(constant_velocity, sd_acceleration=0.2)
R2 = 9.0 * np.eye(2)
PIXELS = 4.0 * np.eye(2)
START = Start(0.0, np.zeros(4), np.diag([100.0, 100.0, 25.0, 25.0]))


def walk_of(n=40, seed=0):
    rng = np.random.default_rng(seed)
    times = np.cumsum(rng.uniform(0.05, 2.0, n))
    return times, np.cumsum(rng.normal(0, 2, (n, 2)), axis=0)


def test_estimates_between_measurements_are_predictions_from_the_last():
    times, z = walk_of()
    asked = np.sort(np.concatenate([times, times[:-1] + 0.03, [times[-1] + 100, -1.0]]))
    track = run_filter(times, z, R2, m.positions(), CV, START, output_times=asked)
    plain = run_filter(times, z, R2, m.positions(), CV, START)
    assert np.isnan(track.x[0]).all()  # before the start
    at = np.searchsorted(asked, times)
    assert np.allclose(track.x[at], plain.x)
    F, Q = CV(0.03)
    assert np.allclose(track.x[at[:-1] + 1], plain.x[:-1] @ F.T)
    assert np.allclose(track.P[at[:-1] + 1], F @ plain.P[:-1] @ F.T + Q)
    assert np.allclose(track.P[-1], np.add(*[CV(100)[0] @ plain.P[-1] @ CV(100)[0].T, CV(100)[1]]))


def test_start_on_the_first_position_is_not_counted_twice():
    times, z = walk_of()
    z[0] = np.nan
    start = start_from_first(times, z, 3.0, 2.0)
    assert start.row == 1
    assert np.array_equal(start.x, [*z[1], 0, 0])
    assert np.array_equal(start.P, np.diag([9.0, 9, 4, 4]))
    track = run_filter(times, z, R2, m.positions(), CV, start)
    assert np.isnan(track.x[0]).all()
    assert np.array_equal(track.x[1], start.x)
    assert np.isnan(track.nis[:2]).all()
    assert track.used.tolist() == [False] + [True] * (len(z) - 1)
    six = start_from_first(times, z, 3.0, 2.0, n=6, sd_acceleration=0.5)
    assert np.array_equal(np.diag(six.P), [9, 9, 4, 4, 0.25, 0.25])
    with pytest.raises(WildlabError, match="no measurement"):
        start_from_first(times, z * np.nan, 3.0)


def test_two_measurements_at_once_are_both_used():
    times, z = walk_of(6)
    times[3] = times[2]
    track = run_filter(times, z, R2, m.positions(), CV, START)
    assert track.used.all()
    one = (z[2] + z[3]) / 2
    mean = run_filter(
        np.delete(times, 3), np.vstack([z[:2], one, z[4:]]),
        np.stack([R2, R2, R2 / 2, R2, R2]), m.positions(), CV, START,
    )  # fmt: skip
    assert np.allclose(track.x[-1], mean.x[-1])
    assert np.allclose(track.P[-1], mean.P[-1])
    assert np.allclose(track.x[2], track.x[3])  # asked at the same time, the same answer


def test_detections_that_are_missing_change_nothing():
    times, z = walk_of()
    motion = partial(in_steps, motion=partial(random_walk, density=1.0), longest=0.1)
    start = Start(0.0, np.zeros(2), 25 * np.eye(2))
    gaps = np.arange(len(z)) % 3 == 1
    z[gaps, 0] = np.nan
    noise = np.tile(R2, (len(z), 1, 1))
    noise[5] = np.nan  # neither is a measurement of unknown covariance one
    gaps[5] = True
    track = run_filter(times, z, noise, m.positions(), motion, start)
    kept = run_filter(times[~gaps], z[~gaps], R2, m.positions(), motion, start, output_times=times)
    assert np.array_equal(track.used, ~gaps)
    assert np.isnan(track.innovation[gaps]).all()
    assert np.isnan(track.S[gaps]).all()
    assert (track.chosen[gaps] == -1).all()
    assert np.allclose(track.x, kept.x)
    assert np.allclose(track.P, kept.P)


def test_a_target_behind_the_camera_is_not_updated():
    times, uv, poses, _ = overflight(20)
    p_nb = poses.p_nb.copy()
    p_nb[9] = np.nan  # here nobody knows where the camera is
    poses = turned(replace(poses, p_nb=p_nb), 7)  # and here it looks up
    start = Start(times[0], np.zeros(4), np.diag([25.0, 25, 4, 4]))
    track = run_filter(times, uv, PIXELS, m.pixels(poses, 0.0), CV, start)
    assert not track.used[[7, 9]].any()
    assert np.isnan(track.nis[[7, 9]]).all()
    assert track.used.sum() == 18
    assert np.isfinite(track.x).all()
    for row in (7, 9):
        F, Q = CV(times[row] - times[row - 1])
        assert np.allclose(track.x[row], F @ track.x[row - 1])
        assert np.allclose(track.P[row], F @ track.P[row - 1] @ F.T + Q)


def test_of_several_detections_the_nearest_is_used(rng):
    times, uv, poses, _ = overflight(30)
    both = np.stack([uv + rng.uniform(60, 200, (30, 1)) * rng.choice([-1, 1], (30, 2)), uv], axis=1)
    order = rng.integers(0, 2, 30)
    both = np.take_along_axis(both, np.stack([order, 1 - order], axis=1)[..., None], axis=1)
    start = Start(times[0], np.zeros(4), np.diag([9.0, 9, 4, 4]))
    sensor = m.pixels(poses, 0.0)
    track = run_filter(times, both, PIXELS, sensor, CV, start)
    assert np.array_equal(track.chosen, 1 - order)
    alone = run_filter(times, uv, PIXELS, sensor, CV, start)
    assert np.allclose(track.x, alone.x)
    both[4] = np.nan
    both[5, track.chosen[5]] = np.nan
    gated = run_filter(times, both, PIXELS, sensor, CV, start, gate_probability=0.999)
    assert gated.chosen[4] == -1
    assert gated.chosen[5] == 1 - track.chosen[5]
    assert gated.used.sum() == 28


@pytest.mark.parametrize("probability", [0.5, 0.95, 0.999])
def test_the_gate_stands_at_the_chi_square_of_its_probability(probability):
    """A measurement a hair inside is used and one a hair outside is not; 1 lets everything in."""
    start = Start(0.0, np.zeros(2), np.eye(2))
    limit = chi2.ppf(probability, 2)
    for factor, given, used in ((0.999, probability, True), (1.001, probability, False), (9.0, 1.0, True)):
        z = np.array([[np.sqrt(2.0 * limit * factor), 0.0]])  # S is two: one of the start, one of R
        track = run_filter([0.0], z, np.eye(2), m.positions(), rest, start, gate_probability=given)
        assert track.nis[0] == pytest.approx(limit * factor)
        assert bool(track.used[0]) is used
        assert np.isfinite(track.innovation[0]).all() and track.chosen[0] == 0


def _but(row, value, values):
    """The values, one of which is another."""
    out = np.array(values)
    out[row] = value
    return out


TIMES, Z = walk_of(5)
NOISE = np.tile(R2, (5, 1, 1))


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ({"times": _but(3, 0.0, TIMES)}, "times: row 3"),
        ({"output_times": [2.0, 1.0]}, "output_times: row 1"),
        ({"R": _but(2, np.diag([1.0, -1.0]), NOISE)}, "R of row 2"),
        ({"R": _but(2, [[1.0, 0.5], [0.0, 1.0]], NOISE)}, "R of row 2"),
        ({"motion": lambda dt: (np.eye(4), -9000.0 * np.eye(4))}, "S of row 0"),
    ],
)
def test_what_cannot_be_filtered_names_the_row(given, words):
    usual = {
        "times": TIMES,
        "measurements": Z,
        "R": R2,
        "sensor": m.positions(),
        "motion": CV,
        "start": START,
    }
    with pytest.raises(WildlabError, match=words):
        run_filter(**(usual | given))


def test_covariance_stays_one_over_many_precise_updates():
    rng, n = np.random.default_rng(0), 5000
    times = np.cumsum(rng.uniform(0, 0.2, n))
    track = run_filter(times, rng.normal(0, 1, (n, 2)), 1e-4 * R2, m.positions(), CV, START)
    assert np.array_equal(track.P, np.swapaxes(track.P, 1, 2))
    assert np.linalg.eigvalsh(track.P).min() > 0


N, R = 5, np.eye(2)
INSTANTS, NOTHING = 0.5 * np.arange(N), np.zeros((N, 2))
KNOWN = Start(0.0, np.zeros(4), 9.0 * np.eye(4))


def by_kalman(start=KNOWN, **options):
    return run_filter(INSTANTS, NOTHING, R, m.positions(), CV, start, **options)


def by_coloured(start=KNOWN, **options):
    return run_coloured(INSTANTS, NOTHING, R, CV, start, **options)


def by_unscented(start=KNOWN, **options):
    return run_unscented(INSTANTS, NOTHING, R, m.positions(), CV, start, **options)


def by_imm(start=KNOWN, **options):
    return run_imm(INSTANTS, NOTHING, R, m.positions(), [CV, CV], [5.0, 5.0], start, **options)


def by_batch(start=KNOWN, **options):
    return run_batch(INSTANTS, np.tile(NOTHING, (3, 1, 1)), R, CV, start, **options)


FILTERS = [by_kalman, by_coloured, by_unscented, by_imm, by_batch]


@pytest.mark.parametrize("wrong", [0.0, 1.0001, np.nan])
def test_a_gate_is_a_probability(wrong):
    with pytest.raises(WildlabError, match=r"^gate_probability: "):
        by_kalman(gate_probability=wrong)


def spoilt(value, at=(1, 1)):
    P = 9.0 * np.eye(4)
    P[at] = value
    return P


@pytest.mark.parametrize("run", FILTERS)
@pytest.mark.parametrize(
    ("start", "message"),
    [
        (KNOWN._replace(x=np.array([0, 0, np.nan, 0])), r"^start\.x: row 2"),
        (KNOWN._replace(P=spoilt(np.nan)), r"^start\.P: "),
        (KNOWN._replace(P=spoilt(0.5, (0, 3))), r"^start\.P: "),
        (KNOWN._replace(P=spoilt(-4.0, (2, 2))), r"^start\.P: "),
        (
            KNOWN._replace(P=spoilt(10.0, (0, 1)) + spoilt(10.0, (1, 0)) - 9 * np.eye(4)),
            r"^start\.P: .* negative",
        ),
    ],
)
def test_a_start_is_finite_and_has_a_covariance(run, start, message):
    with pytest.raises(WildlabError, match=message):
        run(start)


def test_a_start_may_be_sure_of_some_states():
    known = np.diag([4.0, 4.0, 0.0, 0.0])
    for run in FILTERS[:2]:
        assert np.isfinite(run(KNOWN._replace(P=known)).x).all()
    correlated = np.outer([1.0, 2.0, 3.0, 1e6], [1.0, 2.0, 3.0, 1e6])  # rounding may push it below zero
    assert np.isfinite(by_kalman(KNOWN._replace(P=correlated)).x).all()


def test_a_pose_for_each_measurement():
    _, _, poses, _ = overflight(N + 1)
    for sensor in (
        m.pixels(poses, 0.0),
        ranges_bearings(np.zeros((N + 1, 2)), np.zeros(N + 1)),
    ):
        with pytest.raises(WildlabError, match=r"^sensor: 6 rows"):
            run_filter(INSTANTS, NOTHING, R, sensor, CV, KNOWN)
    sensor = m.pixels(poses, 0.0)
    for run in (
        lambda: run_unscented(INSTANTS, NOTHING, R, sensor, CV, KNOWN),
        lambda: run_imm(INSTANTS, NOTHING, R, sensor, [CV, CV], [5.0, 5.0], KNOWN),
    ):
        with pytest.raises(WildlabError, match=r"^sensor: 6 rows"):
            run()


def test_a_camera_pose_for_each_row_of_many_runs():
    _, _, poses, _ = overflight(N + 1)
    many = np.tile(NOTHING, (3, 1, 1))
    with pytest.raises(WildlabError, match=r"^measurements: 5 rows"):
        run_batch(INSTANTS, many, R, CV, KNOWN, view=BatchCamera(poses, 0.0))
    with pytest.raises(WildlabError, match=r"^view\.plane_down: 4 rows"):
        run_batch(INSTANTS, many, R, CV, KNOWN, view=BatchCamera(poses.take(slice(N)), np.zeros(N - 1)))
    with pytest.raises(WildlabError, match=r"^plane_down: "):
        m.pixels(poses, np.zeros(N))


def test_a_pose_covariance_for_each_measurement():
    pose = Considered(m.POSE, np.tile(np.eye(6), (N + 1, 1, 1)))
    for run in (by_kalman, by_batch):
        with pytest.raises(WildlabError, match=r"^pose\.covariance: "):
            run(pose=pose)
