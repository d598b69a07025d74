"""Starts against a flight whose pose is known."""

import numpy as np
import pytest

from tests.navigation.flights import GRAVITY, LEVERS, fixes, fly
from wildlab.errors import WildlabError
from wildlab.geometry.frames import (
    euler_to_matrix,
    matrix_to_euler,
    matrix_to_rotation_vector,
    quaternion_to_matrix,
)  # fmt: skip
from wildlab.navigation.alignment import (
    align_at_rest,
    align_from_baseline,
    align_from_course,
    attitude_from_directions,
    find_rest,
)  # fmt: skip
from wildlab.navigation.strapdown import ImuSamples


@pytest.fixture(scope="module")
def flight():
    return fly(140.0)


def turned_wrong(start, R):
    return np.linalg.norm(matrix_to_rotation_vector(quaternion_to_matrix(start.state[6:10]).T @ R))


def test_directions_give_the_attitude_back():
    rng = np.random.default_rng(0)
    for _ in range(20):
        R = euler_to_matrix(*rng.uniform(-3, 3, 3))
        first, second = rng.standard_normal((2, 3))
        found = attitude_from_directions(first, 2.0 * R @ first, second, R @ (3 * second + 0.5 * first))
        assert np.abs(found - R).max() < 1e-12


def test_the_baseline_gives_pose_and_velocity_in_flight_and_in_a_turn(flight):
    motion = flight.motion
    antennas = fixes(flight, np.random.default_rng(1), sd=1e-6)
    for begin in (10.0, 110.0):
        late = motion.times >= begin
        imu = ImuSamples(*(part[late] for part in flight.imu))
        start = align_from_baseline(
            imu, antennas[0].times, antennas[0].value, antennas[1].value, *LEVERS, gravity=GRAVITY
        )
        row = int(np.argmin(np.abs(motion.times - start.time)))
        assert 0 <= start.time - begin < 0.3
        assert turned_wrong(start, motion.R_nb[row]) < 0.05  # what level_sd says
        assert np.abs(start.state[:3] - motion.position[row]).max() < 0.05
        assert np.abs(start.state[3:6] - motion.velocity[row]).max() < 0.3
        # 2 cm over a baseline of 1.5 m, about the level's own vertical.
        down_b = motion.R_nb[row].T @ [0, 0, 1]
        heading_sd = np.sqrt(down_b @ start.covariance[6:9, 6:9] @ down_b)
        assert heading_sd == pytest.approx(0.02 / np.linalg.norm(LEVERS[1] - LEVERS[0]), rel=0.05)


def test_the_course_gives_the_heading(flight):
    motion = flight.motion
    rows = np.arange(500, len(motion.times), 100)
    late = motion.times > 100  # in a turn, where levelling without the acceleration would be 0.37 rad wrong
    imu = ImuSamples(*(part[late] for part in flight.imu))
    start = align_from_course(
        imu, motion.times[rows], motion.position[rows], motion.velocity[rows], gravity=GRAVITY
    )
    row = int(np.argmin(np.abs(motion.times - start.time)))
    assert turned_wrong(start, motion.R_nb[row]) < 0.06
    with pytest.raises(WildlabError, match=r"50\.0 m/s"):
        align_from_course(
            imu,
            motion.times[rows],
            motion.position[rows],
            motion.velocity[rows],
            gravity=GRAVITY,
            min_speed=50.0,
        )


def test_a_start_on_the_ground_finds_its_heading_from_the_roll_out():
    """At rest for 60 s, turned by 70 deg, then off along the nose; the gyros have a bias of 0.3 deg/s."""
    times = np.arange(0, 100, 0.01)
    yaw = 0.5 + 1.2 * np.clip((times - 60) / 10, 0, 1)
    speed = np.clip(times - 75, 0, 10)
    R = euler_to_matrix(0.02, 0.1, yaw)
    heading = np.stack([np.cos(yaw), np.sin(yaw), np.zeros_like(yaw)], axis=-1)
    acceleration = heading * ((times > 75) & (times < 85))[:, None]
    f = np.einsum("kji,kj->ki", R, acceleration - [0, 0, GRAVITY])
    w = np.einsum("kji,j->ki", R, [0, 0, 1.0]) * (0.12 * ((times > 60) & (times < 70)))[:, None]
    bias = np.array([0.004, -0.003, 0.005])
    imu = ImuSamples(times, f, w + bias)
    t = np.arange(0.5, 99, 1.0)
    v = np.array([np.interp(t, times, column) for column in (heading * speed[:, None]).T]).T
    start = align_at_rest(imu, t, np.zeros((len(t), 3)), v, rest=(5.0, 55.0), gravity=GRAVITY)
    roll, pitch, found = matrix_to_euler(quaternion_to_matrix(start.state[6:10]))
    assert (roll, pitch, found) == pytest.approx((0.02, 0.1, 0.5), abs=2e-3)
    assert start.state[13:] == pytest.approx(bias, abs=1e-6)
    with pytest.raises(WildlabError, match="0 fixes"):
        align_at_rest(imu, t, np.zeros((len(t), 3)), 0 * v, rest=(5.0, 55.0), gravity=GRAVITY)


def standing_and_flying(rests, end=100.0):
    """Sensors that rest in these intervals (s) and are moved about in between; a take-off at 80 s."""
    rng = np.random.default_rng(4)
    times = np.arange(3.0, end, 0.02)
    still = np.any([(times >= begin) & (times < until) for begin, until in rests], axis=0)
    size = np.where(still, 1.0, 20.0)[:, None]
    f = [0.0, 0.0, -9.8] + 0.03 * size * rng.standard_normal((len(times), 3))
    w = [0.02, 0.0, 0.0] + 0.005 * size * rng.standard_normal((len(times), 3))
    t = np.arange(3.5, end, 1.0)
    v = np.zeros((len(t), 3))
    v[t > 80, 0] = 15.0
    return ImuSamples(times, f, w), t, v


def test_the_last_rest_before_the_take_off_is_found():
    rests = [(10.0, 30.0), (45.0, 65.0), (70.0, 74.0), (85.0, 99.0)]
    begin, end = find_rest(*standing_and_flying(rests))
    assert (begin, end) == (45.0, 65.0)  # 4 s are too short, and what lies behind the take-off is no start
    assert find_rest(*standing_and_flying(rests), longest=5.0) == (60.0, 65.0)
    assert find_rest(*standing_and_flying([(40.0, 45.0)])) is None


def test_what_glides_evenly_is_not_at_rest():
    imu, t, v = standing_and_flying([(10.0, 30.0), (40.0, 60.0)])
    v[(t > 40) & (t < 60), 1] = 3.0
    assert find_rest(imu, t, v) == (10.0, 30.0)
    assert find_rest(imu, t, v + np.array([9.0, 0.0, 0.0])) is None  # flying from the first fix on
