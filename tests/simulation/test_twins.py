"""The twin of H 5.6.1 as a flight. No test here asks for the thesis's results: those are for the report."""

from functools import partial

import numpy as np
import pandas as pd
import pytest

from wildlab.errors import WildlabError
from wildlab.flight.checks.check import check_flight
from wildlab.flight.clocks import frame_times, poses_at
from wildlab.flight.store import load_flight, save_flight
from wildlab.geometry.camera_poses import camera_pose
from wildlab.geometry.frames import (
    euler_to_matrix,
    matrix_to_euler,
    matrix_to_rotation_vector,
    quaternion_to_matrix,
)
from wildlab.geometry.georeference import ground_to_pixel, pixel_to_plane
from wildlab.simulation.courses import loiter_centre, twin_trajectory
from wildlab.simulation.onboard_sensors import payload_boresight
from wildlab.simulation.parameters import load_twin
from wildlab.simulation.trajectory import turned
from wildlab.simulation.twins import OPTIONAL_TABLES, simulate, simulate_twin

#: Most tests need no inertial readings, which take most of the time.
quick = partial(simulate, without=OPTIONAL_TABLES)

QUATERNION = ["q_w", "q_x", "q_y", "q_z"]


def with_values(twin, **changes):
    """The twin with some parameters changed: ``camera__latency=0``."""
    for name, value in changes.items():
        group, key = name.split("__")
        part = getattr(twin, group)
        part = part.model_copy(update={key: getattr(part, key).model_copy(update={"value": value})})
        twin = twin.model_copy(update={group: part})
    return twin


def assert_in_image(detections):
    """Pixels lie in an image of 640 by 512."""
    assert detections["u_px"].between(0, 640).all()
    assert detections["v_px"].between(0, 512).all()


def without_errors(twin):
    """The twin without errors of its control, and without disturbance."""
    names = ("track", "altitude", "roll", "pitch", "yaw")
    return with_values(twin, **{f"flight__{name}_sd": 0.0 for name in names})


def marks(flight):
    """Of each detection its pixel (N, 2), when it was exposed, and the true pose of the airframe then."""
    row = flight.frames.set_index("frame_id").index.get_indexer(flight.detections["frame_id"])
    at = frame_times(flight)[row]
    p_nb, R_nb, _ = poses_at(flight.nav["truth"], at)
    return flight.detections[["u_px", "v_px"]].to_numpy(), at, p_nb, R_nb


@pytest.fixture(scope="module")
def twin():
    return load_twin("static-antenna")


@pytest.fixture(scope="module")
def flight():
    return simulate_twin("static-antenna", 3, without=OPTIONAL_TABLES)


@pytest.fixture(scope="module")
def short(twin):
    """The first seven minutes of it, for what needs inertial readings."""
    return with_values(twin, flight__duration=420.0, camera__images=800, target__observations=40)


@pytest.fixture(scope="module")
def sensed(short):
    return simulate(short, 3)


def every_table(flight):
    return {**{f"nav/{name}": table for name, table in flight.nav.items()}, **flight.tables}


def test_same_seed_same_bytes(short, sensed, tmp_path):
    again = simulate(short, 3)
    for name, table in every_table(sensed).items():
        pd.testing.assert_frame_equal(table, every_table(again)[name], check_exact=True)
    save_flight(sensed, tmp_path / "a")
    save_flight(again, tmp_path / "b")
    files = sorted(path.relative_to(tmp_path / "a") for path in (tmp_path / "a").rglob("*") if path.is_file())
    assert len(files) == 10
    for name in files:
        assert (tmp_path / "a" / name).read_bytes() == (tmp_path / "b" / name).read_bytes(), name


def test_one_sensors_errors_do_not_touch_anothers(short, sensed):
    changed = with_values(short, camera__marking_sd=9.0, onboard_clock__latency=0.0, imu__gyro_range=50.0)
    other = simulate(changed, 3)
    pd.testing.assert_frame_equal(sensed.gnss, other.gnss, check_exact=True)
    for name, table in sensed.nav.items():
        pd.testing.assert_frame_equal(table, other.nav[name], check_exact=True)
    assert sensed.detections["frame_id"].equals(other.detections["frame_id"])
    assert not sensed.detections["u_px"].equals(other.detections["u_px"])
    assert sensed.frames["time_s"].equals(other.frames["time_s"])
    assert not sensed.frames["time_onboard_s"].equals(other.frames["time_onboard_s"])


@pytest.mark.parametrize("seed", [4])
def test_every_seed_has_552_observations_inside_the_image_in_batches(seed):
    flight = simulate_twin("static-antenna", seed, without=["imu", "gnss"])
    d, frames = flight.detections, flight.frames
    assert len(d) == 552
    assert d["frame_id"].is_unique
    assert_in_image(d)
    assert (d["kind"] == "pixel").all()
    assert (d["target_id"] == "antenna").all()
    assert len(frames) == 7990
    assert np.diff(frames["time_s"]) == pytest.approx(1 / 7.5)
    # Seen in a fixed part of each loop, and never in between.
    times = frames.set_index("frame_id").loc[d["frame_id"], "time_s"].to_numpy()
    gaps = np.diff(times)
    batches = (gaps > 20).sum() + 1
    assert 8 <= batches <= 25
    assert ((gaps < 3) | (gaps > 20)).all()


def test_the_true_pose_puts_unspoiled_marks_on_the_antenna(twin):
    exact = with_values(twin, camera__marking_sd=0.0, camera__latency=0.0, camera_sway__share=0.0)
    flight = quick(exact.model_copy(update={"tolerance": None}), 5)
    m = flight.manifest
    uv, _, p_nb, R_nb = marks(flight)
    pose = camera_pose(m.geometry_mount(), p_nb, R_nb)
    ground = pixel_to_plane(m.geometry_camera(), uv, *pose, -2.0)
    assert np.abs(ground - [0.0, 0.0, -2.0]).max() < 1e-6
    assert np.abs(ground_to_pixel(m.geometry_camera(), [0.0, 0.0, -2.0], *pose) - uv).max() < 1e-6
    # and a mount without the misalignment does not
    wrong = pixel_to_plane(
        m.geometry_camera(), uv, *camera_pose(type(m.geometry_mount())(), p_nb, R_nb), -2.0
    )
    assert np.linalg.norm(wrong[:, :2], axis=1).min() > 5.0


def test_marks_scatter_about_the_true_pixels_as_stated(twin):
    known = twin.model_copy(update={"tolerance": None})
    exact, marked = (quick(with_values(known, camera__marking_sd=sd), 6).detections for sd in (0.0, 2.0))
    off = (marked[["u_px", "v_px"]] - exact[["u_px", "v_px"]]).to_numpy()
    assert off.mean(axis=0) == pytest.approx([0, 0], abs=5 * 2 / np.sqrt(552))
    assert off.std(axis=0) == pytest.approx([2, 2], rel=5 / np.sqrt(2 * 552))


def test_the_pair_of_autopilot_logs_differs_by_exactly_the_imus_misalignment(flight):
    with_it, without = flight.nav["autopilot-uncalibrated"], flight.nav["autopilot"]
    same = [name for name in without if name not in QUATERNION]
    pd.testing.assert_frame_equal(with_it[same], without[same], check_exact=True)
    R, R_left_in = (quaternion_to_matrix(table[QUATERNION].to_numpy()) for table in (without, with_it))
    difference = np.swapaxes(R, 1, 2) @ R_left_in
    expected = euler_to_matrix(*np.radians([1.1, -5.7, 0.25]))
    assert np.abs(difference - expected).max() < 1e-14
    # Of a level airframe the IMU reads what H prints.
    assert np.degrees(matrix_to_euler(np.eye(3) @ difference[0])) == pytest.approx([1.1, -5.7, 0.25])


@pytest.mark.slow
def test_autopilot_errors_have_the_stated_size_and_correlation():
    """Over 12 flights: 25 min hold 50 correlation times of attitude, and 5 of position."""
    turns, shifts = [], []
    for seed in range(12):
        flight = simulate_twin("static-antenna", 100 + seed, without=OPTIONAL_TABLES)
        auto, truth = flight.nav["autopilot"], flight.nav["truth"]
        p, R, _ = poses_at(truth, auto["time_s"].to_numpy())
        logged = quaternion_to_matrix(auto[QUATERNION].to_numpy())
        turns.append(np.degrees(matrix_to_rotation_vector(np.swapaxes(logged, 1, 2) @ R)))
        shifts.append(auto[["north_m", "east_m", "down_m"]].to_numpy() - p)
    turn, shift = np.array(turns), np.array(shifts)
    # Over M correlation times the mean square of such a process is known to sqrt(2/M), its root to half that.
    spread = np.sqrt((turn**2).mean(axis=(0, 1)))
    assert spread == pytest.approx([1.0, 1.0, 2.0], rel=4 * np.sqrt(0.5 / (12 * 50)))
    spread = np.sqrt((shift**2).mean(axis=(0, 1)))
    assert spread == pytest.approx([1.5, 1.5, 2.5], rel=4 * np.sqrt(0.5 / (12 * 5)))
    kept = [(turn[:, :-300, i] * turn[:, 300:, i]).mean() / (turn[:, :, i] ** 2).mean() for i in range(3)]
    assert kept == pytest.approx([np.exp(-1)] * 3, abs=4 / np.sqrt(12 * 50))


def test_undisturbed_flight_has_the_target_in_the_middle_on_the_course_asked_for(twin):
    calm = without_errors(twin)
    for changes in ({}, {"loiter__turn": "counter-clockwise"}, {"loiter__course_at_target": 120.0}):
        changed = with_values(calm, **changes)
        trajectory = twin_trajectory(changed, np.random.default_rng(0))
        motion = trajectory(np.arange(0, 120, 0.01))
        flight = quick(with_values(changed, target__observations=1), 0)
        pose = camera_pose(flight.manifest.geometry_mount(), motion.position, motion.R_nb)
        uv = ground_to_pixel(flight.manifest.geometry_camera(), [0.0, 0.0, -2.0], *pose)
        off = np.linalg.norm(uv - [320, 256], axis=1)
        at = np.nanargmin(off)
        assert off[at] < 2.0  # within a hundredth of a second of flight
        course = np.degrees(np.arctan2(motion.velocity[at, 1], motion.velocity[at, 0]))
        assert course == pytest.approx(changed.loiter.course_at_target.number, abs=0.2)
    # The camera looks out of the turn, so the target lies outside of the circle.
    assert np.linalg.norm(loiter_centre(twin)) > twin.loiter.radius.number


def test_the_wind_blows_from_where_it_is_said_to_come(twin):
    blown = with_values(without_errors(twin), flight__wind_from=90.0)
    v = twin_trajectory(blown, np.random.default_rng(0))(np.arange(0.0, 120.0, 0.5)).velocity
    wind = [0.0, -twin.flight.wind_speed.number, 0.0]
    assert np.linalg.norm(v - wind, axis=1) == pytest.approx(twin.flight.airspeed.number)


def test_the_antennas_ride_on_the_payload_as_the_levers_say(sensed):
    truth = sensed.nav["truth-payload"].iloc[::15]  # 37.5 Hz and 10 Hz meet every 0.4 s
    gnss = sensed.gnss.iloc[::4]
    assert gnss["time_s"].to_numpy() == pytest.approx(truth["time_s"].to_numpy())
    R = quaternion_to_matrix(truth[QUATERNION].to_numpy())
    p = truth[["north_m", "east_m", "down_m"]].to_numpy()
    names = [f"{axis}_m" for axis in ("north", "east", "down")]
    for which, arm in (("", [0.5, 0.0, -0.1]), ("second_", [-0.5, 0.0, -0.1])):
        lever = gnss[[f"{which}lever_{axis}_m" for axis in "xyz"]].to_numpy()
        assert (lever == arm).all()
        off = gnss[[which + name for name in names]].to_numpy() - (p + (R @ lever[..., None])[..., 0])
        spread = np.sqrt((off**2).mean(axis=0))
        stated = [np.hypot(0.01, 0.01)] * 2 + [np.hypot(0.015, 0.015)]
        # Half of the variance is correlated over 60 s: 420 s hold at least 3 independent errors of it.
        assert spread == pytest.approx(stated, rel=0.5 * 5 * np.sqrt(0.5 / 7))
        assert gnss["sd_horizontal_m"].iloc[0] == pytest.approx(stated[0])
    speeds = [f"v_{axis}_m_s" for axis in ("north", "east", "down")]
    slip = gnss[speeds].to_numpy() - truth[speeds].to_numpy()
    assert np.sqrt((slip**2).mean(axis=0)) == pytest.approx([0.05] * 3, rel=0.5)  # the lever turns, too


def test_the_payload_turns_against_the_airframe_slowly_by_about_a_degree(twin):
    airframe = twin_trajectory(twin, np.random.default_rng(0))(np.arange(1500.0))
    turns = [
        np.degrees(matrix_to_rotation_vector(np.swapaxes(airframe.R_nb, 1, 2) @ payload.R_nb))
        for payload in (turned(airframe, payload_boresight(twin, seed)) for seed in range(20))
    ]
    turn = np.array(turns)
    # Sixteen sines, the slowest of 600 s: the mean square of a flight is theirs to some 10 %.
    sd = twin.boresight.roll_sd.number
    assert np.sqrt((turn**2).mean(axis=(0, 1))) == pytest.approx([sd] * 3, rel=0.06)
    # deg/s, were all sines in step
    fastest = sd * np.sqrt(2 / 16) * 16 * 2 * np.pi * (1 / 20 - 1 / 600) / np.log(600 / 20)
    assert np.abs(np.diff(turn, axis=1)).max() < fastest


@pytest.mark.parametrize("seed", [-1, 2**63, 1.5, True, "1"])
def test_a_seed_is_a_whole_number_from_zero(seed):
    with pytest.raises(WildlabError, match="not a seed"):
        simulate_twin("static-antenna", seed, without=OPTIONAL_TABLES)


def test_a_target_that_is_not_seen_is_refused(twin):
    with pytest.raises(WildlabError, match="not in 5000"):
        quick(with_values(twin, target__observations=5000), 1)
    with pytest.raises(WildlabError, match="look down"):
        quick(with_values(twin, mount__tilt=120.0), 1)


@pytest.mark.slow
@pytest.mark.parametrize(
    "name",
    [
        "static-antenna",
        "fast-vessel",
        "crossing-vessels",
        "large-ship",
        "uav-search",
        "uav-tracking",
        "gondola",
    ],
)
def test_each_kind_of_twin_is_free_of_problems_as_it_is_read_back(name, tmp_path):
    flight = simulate_twin(name, 4, without=OPTIONAL_TABLES)
    save_flight(flight, tmp_path / name)
    loaded = load_flight(tmp_path / name)
    for table, content in every_table(flight).items():
        pd.testing.assert_frame_equal(every_table(loaded)[table], content, check_exact=True)
    assert loaded.manifest == flight.manifest
    assert [f.sentence for f in check_flight(loaded) if f.level != "note"] == []
