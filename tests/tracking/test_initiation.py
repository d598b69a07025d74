"""Starts whose covariance is that of their errors, and rays that do not meet."""

from collections import defaultdict

import numpy as np
import pytest
from scipy.stats import chi2

from tests.tracking.poses import disturbed, posed
from wildlab.errors import WildlabError
from wildlab.geometry.frames import euler_to_matrix
from wildlab.tracking import measurement as m
from wildlab.tracking.combined import SensorMeasurements, merge
from wildlab.tracking.consider_parameters import consider
from wildlab.tracking.considering import considering
from wildlab.tracking.initiation import start_from_measurement, start_from_position, start_from_rays
from wildlab.tracking.noise import own_noise
from wildlab.tracking.platforms import bearings, measured_from, polar, ranges_bearings
from wildlab.tracking.predictions import POSE as POSE_ERRORS
from wildlab.tracking.rays import intersect_rays
from wildlab.tracking.run import Start, run_filter

RUNS = 400
POSE = (20.0, -30.0, 120.0, 0.1, -0.15, 0.6, (0.0, 0.02, 0.0), (0.1, 0.0, 0.2))
RAE = ("range", "azimuth", "elevation")


def assert_consistent(errors, covariances, size):
    """Mean NEES inside its 95 % band, for errors (RUNS, n) of which ``size`` directions are uncertain."""
    nees = np.einsum("ri,rij,rj->r", errors, np.linalg.pinv(covariances, hermitian=True), errors)
    low, high = chi2.ppf([0.025, 0.975], size * len(errors)) / len(errors)
    assert low < nees.mean() < high


def wrong_by(rng, sds):
    return {name: rng.normal() * sd for name, sd in sds.items()}


def sighted(kind, target, error):
    """A sensor that believes itself where it is not, and what it measured of the target, without noise."""
    error = defaultdict(float, error)
    platform = [20.0 + error["platform_north"], -30.0 + error["platform_east"]]
    if kind == "range-bearing":
        z = m.predict_range_bearing(target, platform, 0.4 + error["heading"]).z
        z = z + np.array([error["range_bias"], error["bearing_bias"]])
        return ranges_bearings([20.0, -30.0], 0.4), z, [1.0, 0.01]
    if kind == "position":
        turn = -error["heading"]
        R = euler_to_matrix(0.0, 0.0, turn)[:2, :2]
        return measured_from([20.0, -30.0]), [20.0, -30.0] + R @ (target - platform), [2.0, 1.0]
    believed = posed(POSE)
    true = disturbed(believed, np.array([error[name] for name in POSE_ERRORS]))
    if kind == "pixel":
        return m.pixels(believed, 2.0), m.predict_pixel(target, true, 2.0).z, [2.0, 3.0]
    if kind == "camera angles":
        z = m.predict_azimuth_elevation(target, true, 2.0).z
        return m.azimuths_elevations(believed, 2.0), z, [0.003, 0.003]
    elements = {"polar": RAE, "slant": RAE[:2], "angles": RAE[1:]}[kind]
    there = polar(true.p_nb, true.R_nb, 2.0, elements)
    sds = {"range": 1.0, "azimuth": 0.01, "elevation": 0.005}
    return (
        polar(believed.p_nb, believed.R_nb, 2.0, elements),
        there.predict(0, target).z,
        [sds[e] for e in elements],
    )


TILTED = {"platform_north": 1.0, "platform_east": 2.0, "platform_down": 1.0,
          "roll": 0.004, "pitch": 0.003, "heading": 0.01}  # fmt: skip
LEVEL = {"platform_north": 1.0, "heading": 0.01}


@pytest.mark.parametrize(
    ("kind", "sds"),
    [
        ("range-bearing", LEVEL | {"range_bias": 2.0, "bearing_bias": 0.005}),
        ("range-bearing", {}),
        ("position", LEVEL),
        ("pixel", TILTED),
        ("camera angles", TILTED),
        ("polar", TILTED),
        ("slant", TILTED),
        ("angles", TILTED),
    ],
)
def test_covariance_of_a_start_is_that_of_its_errors(kind, sds, rng):
    """State and considered errors together: the start knows what they have in common."""
    target, v = np.array([95.0, 40.0]), np.array([2.0, -1.0])
    errors, covariances = [], []
    for _ in range(RUNS):
        error = wrong_by(rng, sds)
        sensor, z, sd = sighted(kind, target, error)
        z = z + rng.normal(size=len(sd)) * sd
        pose = consider(sds) if sds else None
        if pose is not None:
            sensor = considering(sensor, pose.names)
        nothing = np.full(len(sd), np.nan)
        start = start_from_measurement(
            [0.0, 1.0], [nothing, z], np.diag(np.square(sd)), sensor, velocity=v, sd_velocity=0.5, pose=pose
        )
        assert start.row == 1 and start.time == 1.0
        truth = np.array([*target, *(v + rng.normal(0, 0.5, 2))])
        if pose is None:
            errors.append(truth - start.x)
            covariances.append(start.P)
        else:
            errors.append([*(truth - start.x), *(error[name] for name in pose.names)])
            covariances.append(np.block([[start.P, start.C], [start.C.T, pose.covariance]]))
    assert_consistent(np.array(errors), np.array(covariances), 4 + len(sds))
    assert_consistent(np.array(errors)[:, :2], np.array(covariances)[:, :2, :2], 2)


@pytest.mark.slow
def test_a_start_that_knows_its_errors_keeps_the_filter_honest():
    """The same heading is wrong in the start and in every bearing after it."""
    rng, pose = np.random.default_rng(2), consider({"heading": 0.01})
    times, last = np.arange(15.0), {True: [], False: []}
    platform = np.column_stack([np.zeros(15), 2.0 * times])
    sensor, R = considering(ranges_bearings(platform, 0.0), pose.names), np.diag([1.0, 1e-6])
    for _ in range(RUNS // 2):
        truth = np.array([300.0, 50.0])
        z = m.predict_range_bearing(truth, platform, 0.0).z - [0.0, 0.01 * rng.normal()]
        z += rng.normal(size=(15, 2)) * np.sqrt(np.diag(R))
        start = start_from_measurement(times, z, R, sensor, n=2, pose=pose)
        for knows, found in last.items():
            begin = start if knows else start._replace(C=None)
            track = run_filter(times, z, R, sensor, lambda dt: (np.eye(2), 0 * np.eye(2)), begin, pose=pose)
            found.append((truth - track.x[-1], track.P[-1]))
    e, P = (np.array(part) for part in zip(*last[True], strict=True))
    assert_consistent(e, P, 2)
    e, P = (np.array(part) for part in zip(*last[False], strict=True))
    assert np.mean(np.einsum("ri,rij,rj->r", e, np.linalg.inv(P), e)) > 2.4


@pytest.mark.slow
def test_start_from_bearings_alone():
    """A platform goes by a target that moves as it is supposed to, with a heading that is off."""
    rng, pose, sd_velocity = (
        np.random.default_rng(4),
        consider({"heading": 0.005}, correlation_time=30.0),
        0.2,
    )
    times = np.arange(40.0)
    platform = np.column_stack([5 * times - 50, np.zeros(40)])
    sensor = considering(bearings(platform, 0.0), pose.names)
    errors, covariances = [], []
    for _ in range(RUNS // 2):
        v = rng.normal(0, sd_velocity, 2)
        truth = np.column_stack([np.tile([60.0, 180.0], (40, 1)) + np.outer(times, v), np.tile(v, (40, 1))])
        heading = 0.005 * rng.normal()
        wrong = []
        for _ in times:
            wrong.append(heading)
            heading = np.exp(-1 / 30) * heading + 0.005 * np.sqrt(1 - np.exp(-2 / 30)) * rng.normal()
        offset = truth[:, :2] - platform
        z = (np.arctan2(offset[:, 1], offset[:, 0]) - wrong + 0.003 * rng.normal(size=40))[:, None]
        start = start_from_rays(
            times, z, [[0.003**2]], sensor, pose=pose, sd_velocity=sd_velocity, least_crossing=0.6
        )
        assert 10 < start.row < 39 and start.time == times[start.row]
        e = truth[start.row] - start.x
        errors.append([*e, wrong[start.row]])
        covariances.append(np.block([[start.P, start.C], [start.C.T, pose.covariance]]))
    assert_consistent(np.array(errors), np.array(covariances), 5)


def test_start_from_rays_of_a_camera_and_of_several_sensors():
    target = np.array([95.0, 40.0])
    one, z_one, _ = sighted("pixel", target, {})
    other = bearings([-100.0, 100.0], 0.0)
    z_other = np.array([np.arctan2(40.0 - 100, 95.0 + 100)])
    both = merge([
        SensorMeasurements([0.0, 2.0], [z_one, z_one], 4 * np.eye(2), one),
        SensorMeasurements([1.0], [z_other], [[1e-4]], other),
    ])  # fmt: skip
    start = start_from_rays(both.times, both.measurements, both.R, both.sensor, n=2)
    np.testing.assert_allclose(start.x, target, atol=1e-6)
    assert start.row == 1
    np.testing.assert_allclose(start_from_measurement(*both[:4], n=6).x, [*target, 0, 0, 0, 0], atol=1e-6)


@pytest.mark.parametrize("d", [2, 3])
def test_rays_meet_as_well_as_they_say(d):
    rng, r = np.random.default_rng(9), 12
    sds = {"platform_north": 1.0, "heading": 0.004} | (
        {"pitch": 0.003, "platform_down": 2.0} if d == 3 else {}
    )
    pose = consider(sds)
    R_nb = np.array([euler_to_matrix(0.1, 0.05, 0.2 * i) for i in range(r)])
    o = np.column_stack([np.linspace(-100, 100, r), 20 * np.sin(np.arange(r)), np.full(r, -90.0)])[:, :d]
    p = np.array([30.0, 220.0, -5.0])[:d]
    errors, covariances, misfits = [], [], []
    for _ in range(RUNS):
        error = wrong_by(rng, sds)
        dp = np.array([error["platform_north"], 0.0, error.get("platform_down", 0.0)])[:d]
        line = p - (o + dp)
        if d == 2:
            azimuth = np.arctan2(line[:, 1], line[:, 0]) - error["heading"] + rng.normal(0, 0.003, r)
            seen = np.column_stack([np.cos(azimuth), np.sin(azimuth)])
        else:
            turn = euler_to_matrix(0.0, error["pitch"], error["heading"])
            in_body = np.einsum("ij,rkj,rk->ri", turn.T, R_nb, line)
            in_body /= np.linalg.norm(in_body, axis=1, keepdims=True)
            seen = np.einsum("rij,rj->ri", R_nb, in_body)
            noise = rng.normal(0, 0.003, (r, 3))
            seen = seen + noise - np.sum(noise * seen, axis=1, keepdims=True) * seen
        found = intersect_rays(
            o, seen * rng.uniform(0.1, 5, (r, 1)), 0.003, pose=pose, R_nb=R_nb if d == 3 else None
        )
        errors.append([*(p - found.position), *(error[name] for name in pose.names)])
        covariances.append(np.block([[found.covariance, found.cross], [found.cross.T, pose.covariance]]))
        misfits.append(found.misfit)
    assert_consistent(np.array(errors), np.array(covariances), d + len(sds))
    if d == 2:  # what errors have in common shows as misfit only where rays differ
        alone = [intersect_rays(o, p - o + 0 * rng.normal(size=o.shape), 0.003).misfit]
        assert alone[0] == pytest.approx(0.0, abs=1e-12)
    assert np.mean(misfits) > (d - 1) * r - d - 1


def test_rays_without_errors_meet_exactly():
    o = np.array([[0.0, 0.0, -50.0], [80.0, 0.0, -60.0], [0.0, 90.0, -40.0], [np.nan, 0, 0]])
    p = np.array([40.0, 30.0, -3.0])
    found = intersect_rays(o, p - o, 0.01)
    np.testing.assert_allclose(found.position, p, atol=1e-9)
    assert 0 < found.angle < np.pi / 2 and found.cross.shape == (3, 0)
    # Two rays at right angles: across each, its own error times its length.
    square = intersect_rays([[0.0, 0.0], [100.0, -50.0]], [[1.0, 0.0], [0.0, 1.0]], [0.01, 0.02])
    np.testing.assert_allclose(square.covariance, np.diag([(50 * 0.02) ** 2, (100 * 0.01) ** 2]), atol=1e-12)


def test_position_and_velocity_as_they_are_given():
    start = start_from_position(
        3.0,
        [1.0, 2.0],
        np.eye(2),
        n=6,
        velocity=[4.0, 5.0],
        sd_velocity=[[2.0, 1.0], [1.0, 2.0]],
        sd_acceleration=3.0,
    )
    np.testing.assert_array_equal(start.x, [1, 2, 4, 5, 0, 0])
    np.testing.assert_array_equal(start.P[2:4, 2:4], [[2, 1], [1, 2]])
    assert start.P[5, 5] == 9.0 and start.row == -1
    assert start_from_position(0.0, [1.0, 2.0], np.eye(2), n=2).P.shape == (2, 2)


FIXED, TIMES, BEARINGS = bearings([0.0, 0.0], 0.0), [0.0, 1.0, 2.0], [[0.1], [0.1], [0.1]]
NOWHERE = np.full((3, 2), np.nan)


def intersect(directions, **more):
    return intersect_rays([[0.0, 0.0], [0.0, 100.0]], directions, 0.01, **more)


def filter_with_cross_covariance():
    start = Start(0.0, np.zeros(2), np.eye(2), C=np.zeros((2, 3)))
    sensor, pose = considering(FIXED, ["heading"]), consider({"heading": 1})
    run_filter(TIMES, BEARINGS, [[1e-4]], sensor, lambda dt: (np.eye(2), np.eye(2)), start, pose=pose)


@pytest.mark.parametrize(
    ("act", "words"),
    [
        (lambda: start_from_rays(TIMES, BEARINGS, [[1e-4]], FIXED), "parallel"),
        (lambda: start_from_rays(TIMES, [[0.1], [np.nan], [np.nan]], [[1e-4]], FIXED), "1 ray"),
        (lambda: start_from_rays(TIMES, NOWHERE[:, :1], [[1e-4]], FIXED), "0 rays"),
        (lambda: start_from_rays(TIMES, np.zeros((3, 2)), np.eye(2), m.positions()), "no rays"),
        (lambda: start_from_measurement(TIMES, BEARINGS, [[1e-4]], FIXED), "no measurement"),
        (lambda: start_from_measurement(TIMES, NOWHERE, np.eye(2), m.positions()), "no measurement"),
        (lambda: intersect([[-1.0, -0.5], [1.0, -0.5]]), "behind"),
        (lambda: intersect([[1.0, 0.5], [1.0, -0.5]], pose=consider({"clock": 1.0})), "clock"),
        (lambda: intersect(np.zeros((3, 2))), "directions"),
        (filter_with_cross_covariance, "cross-covariance"),
    ],
)
def test_what_cannot_be_a_start_is_said(act, words):
    with pytest.raises(WildlabError, match=words):
        act()


def test_a_detections_own_noise():
    own = np.tile(np.diag([4.0, 9.0]), (3, 2, 1, 1))
    own[1, 0], own[2, 1] = np.nan, np.diag([1.0, 0.0])
    R = own_noise(own, np.eye(2))
    np.testing.assert_array_equal(R[1, 0], np.eye(2))
    np.testing.assert_array_equal(R[2, 1], np.eye(2))
    np.testing.assert_array_equal(R[0], own[0])
    with pytest.raises(WildlabError, match="covariances"):
        own_noise(own, np.eye(3))
