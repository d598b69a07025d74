"""Errors that are considered, and several sensors in one track: what each does alone, and together."""

from functools import partial

import numpy as np
import pytest

from tests.tracking.full_filter import beside, full_filter
from tests.tracking.level_sensors import bearings, consider, ranges_bearings
from tests.tracking.poses import overflight
from tests.tracking.test_schmidt import growing
from wildlab.errors import WildlabError
from wildlab.tracking import sensors as m
from wildlab.tracking import sensors as p
from wildlab.tracking.kalman import Considered, consider_all, errors_of
from wildlab.tracking.motion import constant_velocity, white_acceleration
from wildlab.tracking.run import Start, run_filter
from wildlab.tracking.sensors import SensorMeasurements, combined, merge, renamed

CV = partial(constant_velocity, sd_acceleration=0.2)
START = Start(0.0, np.zeros(4), np.diag([25.0, 25.0, 9.0, 9.0]))


def test_the_order_of_errors_does_not_matter():
    times, uv, poses, _ = overflight(50)
    sensor, P = m.pixels(poses, 0.0), growing(50)
    one = run_filter(times, uv, 4 * np.eye(2), sensor, CV, START, pose=Considered(p.POSE, P, 8.0))
    order = [5, 0, 3, 1, 2, 4]
    mixed = Considered(tuple(p.POSE[i] for i in order), P[:, order][:, :, order], 8.0)
    again = run_filter(times, uv, 4 * np.eye(2), sensor, CV, START, pose=mixed)
    np.testing.assert_allclose(again.x, one.x, rtol=1e-8, atol=1e-8)
    np.testing.assert_allclose(again.P, one.P, rtol=1e-7, atol=1e-8)


def test_each_has_its_own_correlation_time(rng):
    """Against the full filter of target and errors, with the gain of the errors put to zero."""
    times = np.cumsum(rng.uniform(0.1, 1, 40))
    platform = np.column_stack([30 * np.sin(times / 5), 10 * times]) - 200
    z = np.column_stack([rng.normal(300, 20, 40), rng.normal(0.7, 0.1, 40)])
    sensor = ranges_bearings(platform, 0.2)
    pose = consider(
        {"heading": 0.02, "platform_east": 3.0, "platform_north": 0.4},
        {"heading": 5.0, "platform_north": 0.0},
    )
    R = np.diag([4.0, 1e-4])
    track = run_filter(times, z, R, sensor, CV, START, pose=pose)

    def look(row, x):
        seen = sensor.predict(row, x[:2])
        H = np.hstack([m.on_state(seen.H_position, 4), seen.H_pose[:, [5, 1, 0]]])
        return m.difference(z[row], seen.z, sensor.angles), H

    def move(_, dt):
        left = np.diag([np.exp(-dt / 5.0), 1.0, 0.0])
        return tuple(map(beside, CV(dt), (left, pose.covariance - left @ pose.covariance @ left.T)))

    start = Start(0.0, np.zeros(7), beside(START.P, pose.covariance))
    for row, (x, P, _) in enumerate(full_filter(times, R, look, move, start, estimated=4)):
        np.testing.assert_allclose(track.x[row], x[:4], rtol=1e-8, atol=1e-8)
        np.testing.assert_allclose(track.P[row], P[:4, :4], rtol=1e-8, atol=1e-10)


def test_correlated_errors_of_different_times_are_refused():
    sensor, P = ranges_bearings([0.0, 0.0], 0.0), np.array([[4.0, 1.0], [1.0, 4.0]])
    pose = Considered(("platform_north", "platform_east"), P, (5.0, np.inf))
    start = Start(0.0, np.zeros(4), np.eye(4))
    with pytest.raises(WildlabError, match=r"^pose.correlation_time: .*correlated"):
        run_filter([1.0], [[9.0, 0.0]], np.eye(2), sensor, CV, start, pose=pose)


def test_sets_of_errors_join_and_split():
    pose = Considered(p.POSE, np.tile(np.diag(np.arange(1.0, 7)), (5, 1, 1)), 4.0)
    both = consider_all(pose, Considered(("clock", "range_bias"), np.diag([0.01, 1.0]), shared=(True, False)))
    assert both.names == (*p.POSE, "clock", "range_bias")
    assert both.covariance.shape == (5, 8, 8)
    assert both.correlation_time == (4.0,) * 6 + (np.inf,) * 2
    assert both.shared == (True,) * 7 + (False,)
    np.testing.assert_allclose(np.diag(both.covariance[3]), [1, 2, 3, 4, 5, 6, 0.01, 1])
    assert renamed(bearings([0.0, 0.0], 0.0), {"heading": "mast"}).considers[-1] == "mast"


@pytest.mark.parametrize(
    ("act", "words"),
    [
        (lambda: consider_all(consider({"a": 1.0}), consider({"a": 1.0})), "a twice"),
        (lambda: consider_all(), "0 sets"),
        (
            lambda: errors_of(consider({"clock": 1.0}), bearings([0, 0], 0.0), 3),
            "clock",
        ),
        (
            lambda: errors_of(consider({"heading": 1.0}, {"heading": -1.0}), bearings([0, 0], 0.0), 3),
            "correlation times",
        ),
        (
            lambda: errors_of(Considered(("heading",), -np.eye(1)), bearings([0, 0], 0.0), 3),
            r"covariance\[0\]: ",
        ),
    ],
)
def test_refusals(act, words):
    with pytest.raises(WildlabError, match=words):
        act()


WA = partial(white_acceleration, density=0.3)
THERE = Start(0.0, np.array([50.0, 60.0, 0.0, 0.0]), np.diag([100.0, 100.0, 9.0, 9.0]))
FAR = np.array([-80.0, 10.0])


def crew(seed=0, n=20):
    """A radar, a mast that sees bearings, and positions, each at its own times; one instant is shared."""
    rng = np.random.default_rng(seed)
    truth = np.array([50.0, 60.0])
    times = [np.sort(rng.uniform(0, 30, n)) for _ in range(3)]
    times[1][4] = times[0][4]
    times[1].sort()
    radar = p.predict_range_bearing(np.tile(truth, (n, 1)), np.zeros(2), 0.3).z + rng.normal(
        0, [1, 0.01], (n, 2)
    )
    mast = p.predict_range_bearing(np.tile(truth, (n, 1)), FAR, 0.0).z[:, 1:] + rng.normal(0, 0.02, (n, 1))
    fixes = truth + rng.normal(0, 3, (n, 2))
    return [
        SensorMeasurements(times[0], radar, np.diag([1.0, 1e-4]), ranges_bearings([0.0, 0.0], 0.3)),
        SensorMeasurements(times[1], mast, [[4e-4]], bearings(np.tile(FAR, (n, 1)), 0.0)),
        SensorMeasurements(times[2], fixes, 9 * np.eye(2), m.positions()),
    ]


def one_after_the_other(merged, parts, pose=None):
    """Each row by a run of its own sensor alone, handed on: states and NIS."""
    start, x, nis = THERE, [], []
    for row, (which, own) in enumerate(zip(merged.which, merged.rows, strict=True)):
        part = parts[which]
        single = run_filter(
            part.times[own : own + 1], part.measurements[own : own + 1], part.R,
            part.sensor._replace(
                rows=None, predict=lambda _, state, p=part, k=own: p.sensor.predict(int(k), state)
            ),
            WA, start,
        )  # fmt: skip
        x.append(single.x[-1])
        nis.append(single.nis[-1])
        start = Start(merged.times[row], single.x[-1], single.P[-1])
    return np.array(x), np.array(nis)


def test_rows_are_filtered_each_by_its_sensor():
    parts = crew()
    merged = merge(parts)
    assert merged.measurements.shape == (60, 1, 2) and (np.diff(merged.times) >= 0).all()
    mast = merged.which == 1
    assert np.isnan(merged.measurements[mast, :, 1]).all() and np.isfinite(merged.measurements[~mast]).all()
    track = run_filter(*merged[:4], WA, THERE)
    x, nis = one_after_the_other(merged, parts)
    same = np.append(np.diff(merged.times) > 0, True)  # at one instant: the state after both
    np.testing.assert_allclose(track.x[same], x[same], atol=1e-9)
    np.testing.assert_allclose(track.nis, nis, atol=1e-9)
    assert np.isnan(track.innovation[mast, 1]).all() and np.isnan(track.S[mast][:, 1]).all()
    assert np.isfinite(track.S[mast][:, 0, 0]).all() and track.used.all()


def test_the_gate_is_as_wide_as_the_row_has_elements():
    radar, mast = ranges_bearings([0.0, 0.0], 0.0), bearings([0.0, 0.0], 0.0)
    sensor = combined([radar, mast], [0, 1])
    start = Start(0.0, np.array([100.0, 0.0]), 1e-12 * np.eye(2))

    def used(sd):
        z, R = np.array([[100.0, 0.01 * sd], [0.01 * sd, np.nan]]), np.diag([1.0, 1e-4])
        R = np.array([R, np.diag([1e-4, np.nan])])
        return run_filter([1.0, 2.0], z, R, sensor, still, start, gate_probability=0.95).used.tolist()

    assert used(1.9) == [True, True]
    assert used(2.2) == [True, False]  # 1.96 of one element, 2.45 of two
    assert used(2.5) == [False, False]


def still(dt):
    return np.eye(2), np.zeros((2, 2))


def test_errors_are_shared_by_name_and_apart_by_another():
    """Two sensors on one mast: one compass for both, or one for each."""
    masts = [bearings([0.0, 0.0], 0.0), bearings([0.0, 0.0], 0.0)]
    times, z, R = np.arange(6.0), np.full((6, 1), 0.3), [[1e-6]]
    start, which = Start(0.0, np.array([100.0, 31.0]), 1e2 * np.eye(2)), np.arange(6) % 2

    def spread(own):
        sensors = [renamed(one, {"heading": f"heading {i}"}) if own else one for i, one in enumerate(masts)]
        sensor = combined(sensors, which)
        names = ["heading 0", "heading 1"] if own else ["heading"]
        pose = consider(dict.fromkeys(names, 0.02))
        return run_filter(times, z, R, sensor, still, start, pose=pose)

    shared, apart = spread(False), spread(True)
    # With a compass each the direction is averaged, and known better.
    across = np.array([-np.sin(0.3), np.cos(0.3)])
    assert across @ apart.P[-1] @ across < 0.6 * (across @ shared.P[-1] @ across)
