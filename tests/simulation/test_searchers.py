"""What searches for animals: rows over enclosures, a gondola on its cable, a gimbal that swings."""

import numpy as np
import pytest

from tests.simulation.test_twins import marks, with_values, without_errors
from wildlab.flight.clocks import gimbal_angles
from wildlab.geometry.camera_poses import Mount, camera_pose
from wildlab.geometry.frames import matrix_to_euler
from wildlab.geometry.georeference import pixel_to_plane
from wildlab.geometry.viewsheds import lines_clear
from wildlab.simulation.courses import Laps, leg_headings, rows, survey_course, twin_trajectory
from wildlab.simulation.landscape import twin_land
from wildlab.simulation.onboard_sensors import gimbal_angles as true_angles
from wildlab.simulation.parameters import load_twin
from wildlab.simulation.target_motion import animal_paths
from wildlab.simulation.trajectory import attitude_along, specific_forces
from wildlab.simulation.twins import simulate, simulate_twin

NAMES = ["uav-search-low", "uav-tracking", "gondola"]
#: Published in F 7.5: altitude and distance between rows, m.
PATTERNS = {"uav-search": (60, 25), "uav-search-low": (30, 10), "uav-tracking": (50, None)}


@pytest.fixture(scope="module", params=NAMES)
def named(request):
    return request.param, load_twin(request.param), simulate_twin(request.param, 2)


def level(twin):
    """The twin over level ground."""
    return twin.model_copy(update={"land": None})


def places_of(flight, twin, times):
    """Where the animal of each detection was (N, 3)."""
    walks = animal_paths(twin, 2)
    names = flight.detections["target_id"]
    return np.concatenate([walks[name]([time]) for name, time in zip(names, times, strict=True)])


def above_ground(twin, position):
    """Heights over the land below, m."""
    return -position[:, 2] - twin_land(twin).heights_at(position[:, :2])


def test_a_multicopter_leans_just_as_its_thrust_must():
    twin = level(with_values(without_errors(load_twin("uav-search")), flight__trim_pitch=0.0))
    trajectory = twin_trajectory(twin, np.random.default_rng(1))
    motion = trajectory(np.linspace(0, 2000, 5000))
    force = specific_forces(motion, twin.place.gravity.si)
    assert np.abs(force[:, :2]).max() < 1e-9  # all of it along z of the body
    lean = np.degrees(np.arccos(motion.R_nb[:, 2, 2]))
    # A reversal at 5 m/s within the turning time of 4 s: twice the speed times the peak of a B-spline of
    # degree six, 0.511 per interval, of which 2.1 are a turning time.
    steepest = np.degrees(np.arctan(2 * 5.0 * 0.5110 * 2.1 / 4.0 / twin.place.gravity.si))
    assert 0.9 * steepest < lean.max() < steepest
    assert np.median(lean) < 0.01
    # In steady flight it has its trim, nose down.
    trajectory = twin_trajectory(without_errors(load_twin("uav-search")), np.random.default_rng(1))
    angles = np.degrees(matrix_to_euler(attitude_along(trajectory)(np.linspace(0, 2000, 5000))))
    assert np.median(angles[:, 1]) == pytest.approx(-4.0, abs=0.01)


def test_a_gondola_hangs_level_and_goes_round_clockwise_at_its_speed():
    twin = without_errors(load_twin("gondola"))
    trajectory = twin_trajectory(twin, np.random.default_rng(1))
    t = np.arange(0, 1800, 0.5)
    motion = trajectory(t)
    p, v = motion.position, motion.velocity
    assert np.hypot(v[:, 0], v[:, 1]) == pytest.approx(1.5, abs=0.01)
    above = above_ground(twin, p)
    # A cable is smooth over the seconds that a turn takes, the ground is not.
    assert above.min() == pytest.approx(3.0, abs=0.7)
    assert above.max() == pytest.approx(20.0, abs=0.7)
    assert np.ptp(p[:, 2]) > 20.0, "the ground goes up and down"
    roll, pitch, yaw = matrix_to_euler(motion.R_nb).T
    assert np.abs(roll).max() < 1e-12
    assert np.abs(pitch).max() < 1e-12
    course = np.arctan2(v[:, 1], v[:, 0])
    assert np.degrees(np.abs(np.angle(np.exp(1j * (yaw - course)))).max()) < 1.0
    turned = np.unwrap(yaw)
    assert turned[-1] - turned[0] == pytest.approx(2 * np.pi, abs=0.1)  # once round, to the right
    assert np.linalg.norm(p[-1, :2] - p[0, :2]) < 50  # about thirty minutes for a lap


@pytest.mark.parametrize("distance", [7.0, 400.0])
def test_no_point_within_a_fence_is_further_from_a_row_than_half_their_distance(distance):
    for enclosure in load_twin("uav-search").enclosures.values():
        ends = rows(enclosure, distance).reshape(-1, 2, 2)
        along = np.diff(ends, axis=1)[:, 0]
        assert np.linalg.norm(along, axis=1) == pytest.approx(enclosure.length.number)
        assert (np.sum(along[1:] * along[:-1], axis=1) < 0).all()  # to and fro
        side = along[0, ::-1] * [-1, 1] / np.linalg.norm(along[0])
        across = np.sort((ends[:, 0] - [enclosure.north.number, enclosure.east.number]) @ side)
        assert (np.diff(across) <= distance + 1e-9).all()
        half = enclosure.width.number / 2
        assert across[0] + half <= distance / 2 + 1e-9
        assert half - across[-1] <= distance / 2 + 1e-9


def test_a_survey_visits_every_row_once_and_comes_back():
    enclosures = list(load_twin("uav-search").enclosures.values())
    course = survey_course(enclosures, 25.0)
    assert course[0] == pytest.approx(course[-1])
    wanted = np.concatenate([rows(enclosure, 25.0) for enclosure in enclosures])
    assert np.array_equal(np.unique(course.round(6), axis=0), np.unique(wanted.round(6), axis=0))
    step = np.linalg.norm(np.diff(course, axis=0), axis=1)
    lengths = sorted(enclosure.length.number for enclosure in enclosures)
    flown = step[np.isclose(step[:, None], lengths).any(axis=1)]
    assert len(flown) == len(wanted) // 2


def test_heading_is_that_of_the_leg_and_turns_at_corners():
    square = np.array([[0.0, 0.0], [100.0, 0.0], [100.0, 100.0], [0.0, 100.0], [0.0, 0.0]])
    heading = leg_headings(Laps(square, 5.0, 200.0, roll_time=2.0))
    turned = np.degrees(heading([10.0, 30.0, 50.0, 70.0, 90.0, 170.0]) - heading([10.0]))
    assert turned == pytest.approx([0, 90, 180, 270, 360, 720], abs=1e-6)
    assert np.sin(heading([10.0])) == pytest.approx(0.0, abs=1e-9)
    t = np.linspace(15, 25, 200)
    assert (np.diff(heading(t)) >= -1e-12).all()  # round the corner without overshoot
    tenths = np.interp(np.radians([9, 81]), heading(t) - heading([10.0]), t)
    assert np.diff(tenths) == pytest.approx(2.0, rel=0.1)


@pytest.mark.parametrize(("name", "pattern"), PATTERNS.items())
def test_altitude_and_rows_are_those_printed(name, pattern):
    twin = load_twin(name)
    trajectory = twin_trajectory(twin, np.random.default_rng(2))
    motion = trajectory(np.arange(0, twin.flight.duration.si, 1.0))
    p, v = motion.position, motion.velocity
    above = above_ground(twin, p)
    assert above.mean() == pytest.approx(pattern[0], abs=0.5)
    # What is shorter than the way over which the autopilot averages the ground is flown over.
    assert np.abs(above - pattern[0]).max() < 8.0
    assert np.abs(v[:, 2]).max() < 4.0, "a multicopter climbs and sinks so fast"
    assert np.abs(motion.acceleration).max() < 3.0
    assert np.hypot(v[:, 0], v[:, 1]).max() < 1.3 * twin.flight.airspeed.number
    if pattern[1] is not None:
        assert twin.survey.row_distance.number == pattern[1]
        assert twin.survey.row_distance.status == "published"


def test_a_gimbal_swings_evenly_between_its_limits():
    gimbal = load_twin("gondola").gimbal
    t = np.arange(0, 60, 0.001)
    pan, tilt = true_angles(gimbal, t)
    assert np.degrees([pan.min(), pan.max()]) == pytest.approx([-60, 60], abs=0.01)
    assert tilt == pytest.approx(0.0)
    pace = np.abs(np.diff(np.degrees(pan))) / 0.001
    assert np.median(pace) == pytest.approx(4 * 60 / 6, rel=0.2)  # there and back twice the swing in a period
    assert np.abs(np.diff(pace)).max() < 1.0  # and no jolt


def test_marks_are_on_the_animals_through_pose_and_gimbal(named):
    """But for what the gimbal's log rounds off where it turns, some hundredths of a degree; on level land."""
    _, twin, _ = named
    exact = level(with_values(twin, camera__marking_sd=0.0, gimbal__noise=0.0))
    flight = simulate(exact.model_copy(update={"tolerance": None}), 2)
    uv, times, p_nb, R_nb = marks(flight)
    row = flight.frames.set_index("frame_id").index.get_indexer(flight.detections["frame_id"])
    pose = camera_pose(
        flight.manifest.geometry_mount(), p_nb, R_nb, *(one[row] for one in gimbal_angles(flight))
    )
    ground = pixel_to_plane(flight.manifest.geometry_camera(), uv, *pose, -0.7)
    at = places_of(flight, exact, times)
    off = np.linalg.norm(ground - at, axis=1)
    assert np.median(off) < 0.01
    assert off.max() < 0.002 * np.linalg.norm(at - p_nb, axis=1).max()
    # A mount without the gimbal would miss by metres.
    wrong = pixel_to_plane(
        flight.manifest.geometry_camera(), uv, *camera_pose(Mount("down"), p_nb, R_nb), -0.7
    )
    assert np.nanmedian(np.linalg.norm(wrong - at, axis=1)) > 1.0
    assert (flight.detections["plane_down_m"] == 0.0).all()


def test_marks_are_of_animals_that_stand_on_the_land_and_that_no_hill_hides(named):
    _, twin, flight = named
    land = twin_land(twin)
    assert flight.terrain is land
    truth = flight.truth
    at = truth[["north_m", "east_m"]].to_numpy(float)
    assert np.allclose(-truth["down_m"] - land.heights_at(at), twin.animals.height.si, atol=1e-6)
    _, times, p_nb, _ = marks(flight)
    where = places_of(flight, twin, times)
    # From the airframe, some decimetres from the lens.
    assert lines_clear(land, where, p_nb).mean() > 0.999
    under = -land.heights_at(p_nb[:, :2])
    assert np.allclose(flight.detections["plane_down_m"], under, atol=0.3)
