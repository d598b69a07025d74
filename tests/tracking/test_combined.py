"""Several sensors in one track: what each does alone, and the same whatever else is there."""

from functools import partial

import numpy as np
import pytest

from wildlab.errors import WildlabError
from wildlab.tracking import measurement as m
from wildlab.tracking.combined import Seen, combined, merge
from wildlab.tracking.considered import consider
from wildlab.tracking.considering import considering, renamed
from wildlab.tracking.following import follow
from wildlab.tracking.maritime import white_acceleration
from wildlab.tracking.platforms import bearings, polar, ranges_bearings
from wildlab.tracking.run import Start, run_filter

WA = partial(white_acceleration, density=0.3)
START = Start(0.0, np.array([50.0, 60.0, 0.0, 0.0]), np.diag([100.0, 100.0, 9.0, 9.0]))
FAR = np.array([-80.0, 10.0])


def crew(seed=0, n=20):
    """A radar, a mast that sees bearings, and positions, each at its own times; one instant is shared."""
    rng = np.random.default_rng(seed)
    truth = np.array([50.0, 60.0])
    times = [np.sort(rng.uniform(0, 30, n)) for _ in range(3)]
    times[1][4] = times[0][4]
    times[1].sort()
    radar = m.predict_range_bearing(np.tile(truth, (n, 1)), np.zeros(2), 0.3).z + rng.normal(
        0, [1, 0.01], (n, 2)
    )
    mast = m.predict_range_bearing(np.tile(truth, (n, 1)), FAR, 0.0).z[:, 1:] + rng.normal(0, 0.02, (n, 1))
    fixes = truth + rng.normal(0, 3, (n, 2))
    return [
        Seen(times[0], radar, np.diag([1.0, 1e-4]), ranges_bearings([0.0, 0.0], 0.3)),
        Seen(times[1], mast, [[4e-4]], bearings(np.tile(FAR, (n, 1)), 0.0)),
        Seen(times[2], fixes, 9 * np.eye(2), m.positions()),
    ]


def one_after_the_other(merged, parts, pose=None):
    """Each row by a run of its own sensor alone, handed on: states and NIS."""
    start, x, nis = START, [], []
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
    assert merged.measurements.shape == (60, 2) and (np.diff(merged.times) >= 0).all()
    mast = merged.which == 1
    assert np.isnan(merged.measurements[mast, 1]).all() and np.isfinite(merged.measurements[~mast]).all()
    track = run_filter(*merged[:4], WA, START)
    x, nis = one_after_the_other(merged, parts)
    same = np.append(np.diff(merged.times) > 0, True)  # at one instant: the state after both
    np.testing.assert_allclose(track.x[same], x[same], atol=1e-9)
    np.testing.assert_allclose(track.nis, nis, atol=1e-9)
    assert np.isnan(track.innovation[mast, 1]).all() and np.isnan(track.S[mast][:, 1]).all()
    assert np.isfinite(track.S[mast][:, 0, 0]).all() and track.used.all()


@pytest.mark.parametrize("name", ["ekf", "ukf", "imm", "smoothed"])
def test_what_stands_in_the_place_of_what_is_not_measured_does_not_matter(name):
    times, z, R, sensor, *_ = merge(crew(1))
    mast = np.isnan(z[:, 1])
    other, noise = z.copy(), R.copy()
    other[mast, 1], noise[mast, 1, 1] = 77.0, 5.0
    more = {"mean_stay": [5.0, 5.0]} if name == "imm" else {}
    motion = [WA, partial(WA, density=1.0)] if name == "imm" else WA
    one = follow(name, times, z, R, sensor, motion, START, gate_probability=0.99, **more)
    two = follow(name, times, other, noise, sensor, motion, START, gate_probability=0.99, **more)
    for ours, theirs in zip(one, two, strict=True):
        np.testing.assert_array_equal(ours, theirs)
    truth = [50.0, 60.0]
    assert np.linalg.norm(one.x[-1, :2] - truth) < 4 * np.sqrt(np.trace(one.P[-1, :2, :2]))


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


@pytest.mark.parametrize(
    ("act", "words"),
    [
        (lambda: combined([m.positions()], [0, 1]), "rows of the sensors"),
        (lambda: combined([], []), "index of a sensor"),
        (lambda: combined([bearings(np.zeros((3, 2)), 0.0)], [0, 0]), "3 rows"),
        (lambda: combined([combined([m.positions()], [0])], [0]), "combined"),
        (lambda: merge([]), "no sensor"),
        (lambda: merge([Seen([0.0], [[1.0]], np.eye(2), m.positions())]), "measurements of sensor 0"),
        (lambda: merge([Seen([0.0], [[1.0, 2.0]], np.eye(3), m.positions())]), "R of the shape"),
    ],
)
def test_refusals(act, words):
    with pytest.raises(WildlabError, match=words):
        act()


def test_coloured_differences_one_sensor_at_a_time():
    merged = merge(crew())
    with pytest.raises(WildlabError, match="several sensors"):
        follow("coloured", *merged[:4], WA, START)
    short = combined([m.positions()], np.zeros(3, int))
    with pytest.raises(WildlabError, match="3 rows"):
        run_filter([0.0, 1.0], np.zeros((2, 2)), np.eye(2), short, WA, START)


def test_considering_after_combining():
    both = combined([ranges_bearings([0.0, 0.0], 0.0), polar([0.0, 0, -9], np.eye(3), 0.0)], [0, 1])
    sensor = considering(both, ["heading", "clock"], velocity=[1.0, 2.0])
    assert sensor.considers == ("heading", "clock") and sensor.sizes.tolist() == [2, 3]
    seen = sensor.predict(1, np.array([30.0, 40.0]))
    np.testing.assert_allclose(seen.H_pose[:, 1], seen.H_position @ [1.0, 2.0])
