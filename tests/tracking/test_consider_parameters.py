"""Errors that are considered, and several sensors in one track: what each does alone, and together."""

from functools import partial

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.tracking.full_filter import beside, full_filter
from tests.tracking.poses import CAMERA, GENERATORS, PIXEL, POSE, disturbed, overflight, posed
from tests.tracking.test_schmidt import growing
from wildlab.errors import WildlabError
from wildlab.geometry.camera import Camera
from wildlab.geometry.camera_poses import CameraPoses
from wildlab.geometry.frames import rotation_vector_to_matrix
from wildlab.geometry.georeference import georeference_pixels
from wildlab.tracking import measurement as m
from wildlab.tracking import predictions as p
from wildlab.tracking.combined import SensorMeasurements, combined, merge
from wildlab.tracking.consider_parameters import Considered, consider, consider_all, errors_of
from wildlab.tracking.considering import considering, renamed
from wildlab.tracking.following import follow
from wildlab.tracking.maritime import white_acceleration
from wildlab.tracking.motion import constant_velocity
from wildlab.tracking.platforms import bearings, measured_from, polar, ranges_bearings
from wildlab.tracking.run import Start, run_filter
from wildlab.tracking.schmidt import PoseUncertainty

CV = partial(constant_velocity, sd_acceleration=0.2)
START = Start(0.0, np.zeros(4), np.diag([25.0, 25.0, 9.0, 9.0]))
SPEED = st.floats(-20, 20)
PLACE = st.tuples(st.floats(20, 500), st.floats(-np.pi, np.pi))


def differences(function, k, step=1e-5):
    """(m, k) central differences at zero."""
    columns = [(function(step * e) - function(-step * e)) / (2 * step) for e in np.eye(k)]
    return np.stack(columns, axis=-1)


@given(POSE, PLACE, st.floats(-0.5, 0.5))
def test_polar_derivatives(pose, place, plane):
    poses = posed(pose)
    position = poses.p_nb[:2] + place[0] * np.array([np.cos(place[1]), np.sin(place[1])])
    seen = p.predict_polar(position, poses.p_nb, poses.R_nb, plane)

    def away(position, pose):
        return m.difference(
            p.predict_polar(position, pose.p_nb, pose.R_nb, plane).z, seen.z, (False, True, False)
        )

    by_pose = differences(lambda error: away(position, disturbed(poses, error)), 6)
    by_target = differences(lambda step: away(position + step, poses), 2)
    np.testing.assert_allclose(seen.H_pose, by_pose, rtol=1e-4, atol=1e-4)
    np.testing.assert_allclose(seen.H_position, by_target, rtol=1e-4, atol=1e-5)
    distance, azimuth, elevation = seen.z
    level = np.cos(elevation) * np.array([np.cos(azimuth), np.sin(azimuth)])
    there = poses.p_nb + distance * poses.R_nb @ np.array([*level, -np.sin(elevation)])
    np.testing.assert_allclose(there, [*position, plane], atol=1e-8)


@given(PLACE, st.tuples(*(SPEED,) * 4), st.floats(-np.pi, np.pi), st.floats(-1, 1), st.booleans())
def test_clock_and_biases_of_ranges_and_bearings(place, speeds, yaw, rate, own):
    """What is measured at the true instant, by a platform that has moved and turned on since the stamp."""
    position = place[0] * np.array([np.cos(place[1]), np.sin(place[1])])
    v, w = np.array(speeds[:2]), np.array(speeds[2:])
    names = ("clock", "bearing_bias", "heading", "range_bias", "platform_east")
    moves = np.array([*w, 0.0, 0.0, 0.0, rate])
    sensor = considering(ranges_bearings(np.zeros(2), yaw), names, moves=moves, velocity=v if own else None)
    seen = sensor.predict(0, np.array([*position, *v])[: sensor.states])
    assert sensor.states == (2 if own else 4)

    def measured(error):
        clock, bearing_bias, heading, range_bias, east = error
        platform = w * clock + np.array([0.0, east])
        z = p.predict_range_bearing(position + v * clock, platform, yaw + rate * clock + heading).z
        return m.difference(z + np.array([range_bias, bearing_bias]), seen.z, (False, True))

    np.testing.assert_allclose(seen.H_pose, differences(measured, 5), rtol=1e-4, atol=1e-4)


@given(POSE, PIXEL, st.tuples(*(SPEED,) * 5), st.tuples(*(st.floats(-0.5, 0.5),) * 3))
def test_clock_and_focal_length_of_pixels(pose, share, speeds, rates):
    poses = posed(pose)
    uv = np.array(share) * [CAMERA.width, CAMERA.height]
    ground = georeference_pixels(poses, uv[None], 0.0)[0, :2]
    if not np.isfinite(ground).all() or np.linalg.norm(ground - poses.p_nb[:2]) > 2000:
        return
    v, moves = np.array(speeds[:2]), np.array([*speeds[2:], *rates])
    sensor = considering(
        m.pixels(poses, 0.0), ("attitude", "focal", "clock", "v_bias"), moves=moves, velocity=v, camera=CAMERA
    )
    seen = sensor.predict(0, ground)

    def measured(error):
        clock = error[4]
        there = disturbed(poses, np.array([*(moves[:3] * clock), 0.0, 0.0, 0.0]))
        turn = rotation_vector_to_matrix(moves[3:] * clock + error[:3])
        f = 1 + error[3]
        camera = Camera(640, 512, CAMERA.fx * f, CAMERA.fy * f, CAMERA.cx, CAMERA.cy)
        wrong = CameraPoses(camera, there.mount, there.p_nb, there.R_nb @ turn)
        return p.predict_pixel(ground + v * clock, wrong, 0.0).z + np.array([0.0, error[5]])

    np.testing.assert_allclose(seen.H_pose, differences(measured, 6, 1e-6), rtol=1e-3, atol=5e-2)


@given(POSE, PIXEL)
def test_focal_length_of_elevations(pose, share):
    """Angles taken out of pixels with a focal length that is wrong."""
    poses = posed(pose)
    uv = np.array(share) * [CAMERA.width, CAMERA.height]
    if np.hypot(*(uv - [CAMERA.cx, CAMERA.cy])) < 5:
        return
    ground = georeference_pixels(poses, uv[None], 0.0)[0, :2]
    if not np.isfinite(ground).all():
        return
    seen = considering(m.azimuths_elevations(poses, 0.0), ["focal"]).predict(0, ground)
    square = Camera(640, 512, 1000.0, 1000.0, 318.0, 250.0)
    azimuth, elevation = seen.z
    ray = np.array([np.cos(azimuth), np.sin(azimuth), np.tan(elevation)])

    def measured(error):
        true = 1000.0 * (1 + error[0])
        pixel = np.array([318.0, 250.0]) + true * ray[:2] / ray[2]
        return m.azimuth_elevation_of_pixel(square, pixel)

    np.testing.assert_allclose(seen.H_pose, differences(measured, 1), atol=1e-6)


def test_the_six_of_a_pose_by_name_are_the_six():
    times, uv, poses, _ = overflight(50)
    sensor, P = m.pixels(poses, 0.0), growing(50)
    old = run_filter(times, uv, 4 * np.eye(2), sensor, CV, START, pose=PoseUncertainty(P, 8.0, "navigated"))
    named = Considered(p.POSE, P, 8.0, "navigated")
    for ours, theirs in zip(
        run_filter(times, uv, 4 * np.eye(2), sensor, CV, START, pose=named), old, strict=True
    ):
        np.testing.assert_array_equal(ours, theirs)
    # In another order, from a sensor that has more.
    order = [5, 0, 3, 1, 2, 4]
    more = considering(sensor, (*p.POSE[::-1], "clock"), velocity=np.zeros(2))
    mixed = Considered(tuple(p.POSE[i] for i in order), P[:, order][:, :, order], 8.0, "navigated")
    again = run_filter(times, uv, 4 * np.eye(2), more, CV, START, pose=mixed)
    np.testing.assert_allclose(again.x, old.x, rtol=1e-8, atol=1e-8)
    np.testing.assert_allclose(again.P, old.P, rtol=1e-7, atol=1e-8)


def test_each_has_its_own_correlation_time(rng):
    """Against the full filter of target and errors, with the gain of the errors put to zero."""
    times = np.cumsum(rng.uniform(0.1, 1, 40))
    platform = np.column_stack([30 * np.sin(times / 5), 10 * times]) - 200
    z = np.column_stack([rng.normal(300, 20, 40), rng.normal(0.7, 0.1, 40)])
    sensor = considering(
        ranges_bearings(platform, 0.2), ("heading", "clock", "range_bias"), moves=np.array([1.0, 2.0])
    )
    pose = consider(
        {"heading": 0.02, "range_bias": 3.0, "clock": 0.4},
        correlation_time={"heading": 5.0, "clock": 0.0},
    )
    R = np.diag([4.0, 1e-4])
    track = run_filter(times, z, R, sensor, CV, START, pose=pose)

    def look(row, x):
        seen = sensor.predict(row, x[:4])
        H = np.hstack([m.on_state(seen.H_position, 4), seen.H_pose[:, [0, 2, 1]]])
        return m.difference(z[row], seen.z, sensor.angles), H

    def move(_, dt):
        left = np.diag([np.exp(-dt / 5.0), 1.0, 0.0])
        return tuple(map(beside, CV(dt), (left, pose.covariance - left @ pose.covariance @ left.T)))

    start = Start(0.0, np.zeros(7), beside(START.P, pose.covariance))
    for row, (x, P, _) in enumerate(full_filter(times, R, look, move, start, estimated=4)):
        np.testing.assert_allclose(track.x[row], x[:4], rtol=1e-8, atol=1e-8)
        np.testing.assert_allclose(track.P[row], P[:4, :4], rtol=1e-8, atol=1e-10)


@given(GENERATORS)
def test_correlated_errors_of_different_times_stay_a_covariance(rng):
    A = rng.normal(size=(3, 3 + int(rng.integers(2)))) * np.array([[1.0], [0.01], [5.0]])
    P = A @ A.T
    times = tuple(rng.choice([0.0, 0.5, 20.0, np.inf], 3))
    sensor = considering(ranges_bearings([0.0, 0.0], 0.0), ("range_bias", "heading", "platform_east"))
    errors = errors_of(Considered(sensor.considers, P, times), sensor, 3)
    left = errors.transition(1, 0.7)
    grown = P - left @ P @ left.T
    sd = np.sqrt(np.diag(P))
    assert np.linalg.eigvalsh(grown / np.outer(sd, sd))[0] > -1e-9
    alone = errors_of(Considered(sensor.considers, np.diag(np.diag(P)), times), sensor, 3).transition(1, 0.7)
    expected = [1.0 if np.isinf(t) else 0.0 if t == 0 else np.exp(-0.7 / t) for t in times]
    np.testing.assert_allclose(alone, np.diag(expected), atol=1e-12)


@pytest.mark.parametrize("name", ["ukf", "imm", "coloured"])
def test_filters_that_widen_their_noise_are_those_that_forget(name):
    """H (7.40)-(7.41): a Schmidt filter whose errors are new at every measurement."""
    times, uv, poses, _ = overflight(40)
    sensor = considering(m.pixels(poses, 0.0), ("attitude", "platform_position"))
    pose = consider({"attitude": 0.01, "platform_position": 1.0}, correlation_time=0.0)
    forgets = run_filter(times, uv, 4 * np.eye(2), sensor, CV, START, pose=pose)
    more = {"imm": {"mean_stay": [9.0, 9.0]}, "coloured": {"longest_gap": 0.0}}.get(name, {})
    motion = [CV, CV] if name == "imm" else CV
    track = follow(name, times, uv, 4 * np.eye(2), sensor, motion, START, pose=pose, **more)
    tolerance = 5e-2 if name == "ukf" else 1e-7
    np.testing.assert_allclose(track.x, forgets.x, atol=tolerance, rtol=tolerance)
    np.testing.assert_allclose(track.P, forgets.P, atol=tolerance, rtol=tolerance)


def test_what_is_left_of_a_bias_in_differences():
    """Positions that share an error which stays: nothing is left. One that is new each time: all, twice."""
    times, z = np.arange(12.0), np.cumsum(np.ones((12, 2)), axis=0)
    start = Start(0.0, np.ones(4), np.eye(4), row=0)
    sensor, R = measured_from([0.0, -50.0]), 0.1 * np.eye(2)

    def with_errors(time):
        pose = consider({"platform_north": 3.0, "platform_east": 3.0}, correlation_time=time)
        return follow("coloured", times, z, R, sensor, CV, start, pose=pose)

    plain = follow("coloured", times, z, R, sensor, CV, start)
    twice = follow("coloured", times, z, R + 18 * np.eye(2), sensor, CV, start)
    np.testing.assert_allclose(with_errors(np.inf).P, plain.P, atol=1e-12)
    np.testing.assert_allclose(with_errors(0.0).P, twice.P, atol=1e-12)


def test_sets_of_errors_join_and_split():
    pose = PoseUncertainty(np.tile(np.diag(np.arange(1.0, 7)), (5, 1, 1)), 4.0, "navigated")
    both = consider_all(pose, consider({"clock": 0.1, "u_bias": np.ones(5)}, shared=["clock"]))
    assert both.names == (*p.POSE, "clock", "u_bias")
    assert both.covariance.shape == (5, 8, 8) and both.change == "navigated"
    assert both.correlation_time == (4.0,) * 6 + (np.inf,) * 2
    assert both.shared == (True,) * 7 + (False,)
    np.testing.assert_allclose(np.diag(both.covariance[3]), [1, 2, 3, 4, 5, 6, 0.01, 1])
    assert renamed(bearings([0.0, 0.0], 0.0), {"heading": "mast"}).considers[-1] == "mast"


@pytest.mark.parametrize(
    ("act", "words"),
    [
        (lambda: consider({"heading": -1.0}), "-1.0 for heading"),
        (lambda: consider({"heading": np.ones((2, 2))}), "rows for heading"),
        (lambda: consider({"a": np.ones(2), "b": np.ones(3)}), r"\[2, 3\]"),
        (lambda: consider({"a": 1.0}, correlation_time={"b": 1.0}), "b has"),
        (lambda: consider_all(consider({"a": 1.0}), consider({"a": 1.0})), "a twice"),
        (lambda: consider_all(), "0 sets"),
        (lambda: considering(bearings([0, 0], 0.0), ["focal"]), "no focal"),
        (
            lambda: considering(bearings(np.zeros((3, 2)), 0.0), ["clock"], moves=np.zeros((4, 2))),
            "4 rows",
        ),
        (
            lambda: errors_of(consider({"clock": 1.0}), bearings([0, 0], 0.0), 3),
            "clock",
        ),
        (
            lambda: errors_of(consider({"heading": 1.0}, correlation_time=-1.0), bearings([0, 0], 0.0), 3),
            "correlation times",
        ),
        (
            lambda: errors_of(Considered(("heading",), -np.eye(1)), bearings([0, 0], 0.0), 3),
            "variance -1",
        ),
        (lambda: polar([0, 0, 0], np.eye(3), 0.0, ("elevation", "range")), "the elements"),
        (lambda: polar(np.zeros((2, 3)), np.zeros((3, 3, 3)), 0.0), "3 rows beside 2"),
    ],
)
def test_refusals(act, words):
    with pytest.raises(WildlabError, match=words):
        act()


def test_what_no_filter_follows():
    run = [np.arange(5.0), np.ones((5, 2)), np.eye(2), ranges_bearings([0.0, 0.0], 0.0), CV, START]
    two = [*run[:4], [CV, CV], START]
    for name, arguments, words in (
        ("magic", run, "'magic'"),
        ("schmidt", run, "no errors"),
        ("imm", run, "motion"),
        ("ekf", two, "2 motion models"),
    ):
        with pytest.raises(WildlabError, match=words):
            follow(name, *arguments)


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
    radar = m.predict_range_bearing(np.tile(truth, (n, 1)), np.zeros(2), 0.3).z + rng.normal(
        0, [1, 0.01], (n, 2)
    )
    mast = m.predict_range_bearing(np.tile(truth, (n, 1)), FAR, 0.0).z[:, 1:] + rng.normal(0, 0.02, (n, 1))
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
    assert merged.measurements.shape == (60, 2) and (np.diff(merged.times) >= 0).all()
    mast = merged.which == 1
    assert np.isnan(merged.measurements[mast, 1]).all() and np.isfinite(merged.measurements[~mast]).all()
    track = run_filter(*merged[:4], WA, THERE)
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
    one = follow(name, times, z, R, sensor, motion, THERE, gate_probability=0.99, **more)
    two = follow(name, times, other, noise, sensor, motion, THERE, gate_probability=0.99, **more)
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
        (
            lambda: merge([SensorMeasurements([0.0], [[1.0]], np.eye(2), m.positions())]),
            "measurements of sensor 0",
        ),
        (
            lambda: merge([SensorMeasurements([0.0], [[1.0, 2.0]], np.eye(3), m.positions())]),
            "R of the shape",
        ),
    ],
)
def test_combinations_that_are_refused(act, words):
    with pytest.raises(WildlabError, match=words):
        act()


def test_coloured_differences_one_sensor_at_a_time():
    merged = merge(crew())
    with pytest.raises(WildlabError, match="several sensors"):
        follow("coloured", *merged[:4], WA, THERE)
    short = combined([m.positions()], np.zeros(3, int))
    with pytest.raises(WildlabError, match="3 rows"):
        run_filter([0.0, 1.0], np.zeros((2, 2)), np.eye(2), short, WA, THERE)


def test_considering_after_combining():
    both = combined([ranges_bearings([0.0, 0.0], 0.0), polar([0.0, 0, -9], np.eye(3), 0.0)], [0, 1])
    sensor = considering(both, ["heading", "clock"], velocity=[1.0, 2.0])
    assert sensor.considers == ("heading", "clock") and sensor.sizes.tolist() == [2, 3]
    seen = sensor.predict(1, np.array([30.0, 40.0]))
    np.testing.assert_allclose(seen.H_pose[:, 1], seen.H_position @ [1.0, 2.0])
