"""The twins with vessels: counts and grouping as printed, marks on them, truth as its receiver logs it."""

import numpy as np
import pytest

from tests.simulation.test_twins import assert_in_image, marks, with_values
from wildlab.geometry.camera_poses import camera_pose
from wildlab.geometry.frames import matrix_to_euler, quaternion_to_matrix
from wildlab.geometry.georeference import pixel_to_plane
from wildlab.simulation.camera_detections import Exposures, exposure_times
from wildlab.simulation.courses import twin_trajectory
from wildlab.simulation.error_models import stream
from wildlab.simulation.manifest import as_flown
from wildlab.simulation.parameters import load_twin
from wildlab.simulation.target_motion import target_outline, target_path, truth_table, way_along
from wildlab.simulation.twins import OPTIONAL_TABLES, simulate, simulate_twin

#: Twin, detections, segments (None: not printed), tracking period in s, seconds per fix of the truth.
FLIGHTS = [
    ("slow-vessel", 3635, None, 2940, 2.0),
    ("fast-vessel", 264, 3, 180, 1.0),
    ("drifting-vessel", 2200, None, 1500, 2.0),
    ("drifting-vessel-eight", 2400, None, 1500, 2.0),
    ("slow-vessel-eight", 600, 10, 750, 1.0),
]
NAMES = [flight[0] for flight in FLIGHTS]
POSITION = ["north_m", "east_m", "down_m"]
SPEED = ["v_north_m_s", "v_east_m_s", "v_down_m_s"]


@pytest.fixture(scope="module", params=NAMES)
def named(request):
    return request.param, simulate_twin(request.param, 2, without=OPTIONAL_TABLES)


def unspoiled(twin):
    """The twin whose camera and detector do not err, is as stated, and does not turn against the airframe."""
    exact = with_values(twin, camera__marking_sd=0.0, camera__latency=0.0)
    return exact.model_copy(update={"camera_sway": None, "tolerance": None})


def ground_of(flight, plane_down):
    """When each detection was exposed, and where it is on the plane by the true pose."""
    uv, at, *pose = marks(flight)
    m = flight.manifest
    # The log has every exposure but for rounding in the fifteenth digit.
    return at, pixel_to_plane(m.geometry_camera(), uv, *camera_pose(m.geometry_mount(), *pose), plane_down)


@pytest.mark.parametrize(("name", "count", "segments", "period", "fix"), FLIGHTS)
def test_counts_and_grouping_are_those_printed(name, count, segments, period, fix):
    flight = simulate_twin(name, 11, without=OPTIONAL_TABLES)
    d, frames, truth = flight.detections, flight.frames, flight.truth
    assert len(d) == count
    assert d["frame_id"].is_unique  # no more than one detection in an image
    assert d["detection_id"].is_unique
    assert d["frame_id"].is_monotonic_increasing
    assert_in_image(d)
    assert (d["source"] == "detector").all()
    assert (d["target_id"] == "vessel").all()
    assert np.diff(frames["time_s"]) == pytest.approx(1 / 7.5)
    assert np.ptp(frames["time_s"]) == pytest.approx(period, abs=0.2)
    gaps = np.diff(frames.set_index("frame_id").loc[d["frame_id"], "time_s"])
    if segments is not None:
        assert (gaps > 20).sum() + 1 == segments
        assert (gaps > 5).sum() + 1 == segments  # nothing in between
    else:
        assert (gaps > 5).sum() + 1 >= 40  # many different periods
    assert np.diff(truth["time_s"]) == pytest.approx(fix)


def test_the_true_pose_puts_unspoiled_marks_on_the_vessel(named):
    name, _ = named
    twin = unspoiled(load_twin(name))
    flight = simulate(twin, 2, without=OPTIONAL_TABLES)
    at, ground = ground_of(flight, -twin.target.height.si)
    assert np.abs(ground - target_path(twin.target, 2)(at)).max() < 1e-6
    # and the truth in the flight is where the receiver says that is: metres off, no more
    logged = np.stack(
        [np.interp(at, flight.truth["time_s"], flight.truth[axis]) for axis in POSITION], axis=-1
    )
    off = np.linalg.norm((ground - logged)[:, :2], axis=1)
    assert 0.3 < off.mean() < 6.0


def test_speeds_and_altitudes_are_those_printed(named):
    name, flight = named
    truth = flight.nav["truth"]
    t, height = truth["time_s"].to_numpy(), -truth["down_m"].to_numpy()
    printed = {
        "slow-vessel": (200, 300),
        "fast-vessel": (350, 350),
        "drifting-vessel": (200, 300),
        "drifting-vessel-eight": (200, 300),
        "slow-vessel-eight": (300, 300),
    }[name]
    early, late = height[t < 700], height[t > 0.78 * t[-1]]
    assert early.mean() == pytest.approx(printed[0], abs=3)
    assert late.mean() == pytest.approx(printed[1], abs=3)
    assert height.std() < 4 or printed[0] != printed[1]
    ground_speed = np.linalg.norm(truth[SPEED].to_numpy()[:, :2], axis=1)
    if name == "slow-vessel-eight":  # H 7.5.4: about 15 m/s upwind and about 24 m/s downwind
        assert np.quantile(ground_speed, [0.01, 0.99]) == pytest.approx(
            [15, 24], abs=1.2
        )  # control adds half
    bank = np.degrees(np.abs(matrix_to_euler(quaternion_to_matrix(truth.filter(like="q_").to_numpy()))[:, 0]))
    assert 30 < bank.max() < 50


def test_vessels_move_as_printed():
    period = np.arange(0.0, 1500.0)
    for seed in range(5):
        way = np.diff(target_path(load_twin("drifting-vessel-eight").target, seed)(period[[0, -1]]), axis=0)
        assert np.linalg.norm(way) == pytest.approx(200, abs=30)  # approximately 200 m
        fast = target_path(load_twin("fast-vessel").target, seed)(period[:540])
        speed = np.linalg.norm(np.diff(fast, axis=0), axis=1)
        assert 5 < speed.min() < speed.max() < 17
        course = np.degrees(np.unwrap(np.arctan2(*np.diff(fast, axis=0).T[1::-1])))
        assert course.std() < 6  # it tried to hold its course


def test_a_receivers_log_errs_as_its_parameters_say():
    target = load_twin("slow-vessel").target
    off = []
    for seed in range(60):
        log = truth_table(target, 1500.0, seed)
        behind = np.array([np.cos(np.radians(60)), np.sin(np.radians(60)), 0.0])
        true = target_path(target, seed)(log["time_s"].to_numpy())
        off.append(log[POSITION].to_numpy() - true + behind)
    error = np.array(off)
    assert error.shape[1] == 751
    # 60 flights of two and a half independent errors each.
    assert np.sqrt((error**2).mean(axis=(0, 1))) == pytest.approx(
        [1.51, 1.51, 2.53], rel=5 / np.sqrt(2 * 120)
    )
    lagged = (error[:, :-75] * error[:, 75:]).mean(axis=(0, 1)) / (error**2).mean(axis=(0, 1))
    assert lagged == pytest.approx([np.exp(-0.5)] * 3, abs=0.15)


def test_two_vessels_cross_and_are_seen_as_printed():
    twin = load_twin("crossing-vessels")
    flight = simulate(twin, 19, without=OPTIONAL_TABLES)
    d, truth = flight.detections, flight.truth
    assert d.groupby("target_id").size().to_dict() == {"boat 1": 1535, "boat 2": 865}
    assert not d.duplicated(["frame_id", "target_id"]).any()
    assert d["frame_id"].duplicated().sum() == 349  # images with both
    assert d["detection_id"].is_unique
    assert_in_image(d)
    assert np.ptp(flight.frames["time_s"]) == pytest.approx(19 * 60, abs=0.2)
    # They meet about four minutes into the tracking period, and move at about 1 m/s.
    begin = flight.frames["time_s"].iloc[0]
    t = np.arange(begin, begin + 1140)
    one, two = (target_path(target, 19)(t) for target in twin.targets)
    apart = np.linalg.norm(one - two, axis=1)
    assert apart.min() < 25
    assert 120 < np.argmin(apart) < 360
    assert apart[-1] > 200
    for path in (one, two):
        assert np.linalg.norm(np.diff(path, axis=0), axis=1).mean() == pytest.approx(1.0, abs=0.1)
    assert list(truth["target_id"].unique()) == ["boat 1", "boat 2"]
    for _, log in truth.groupby("target_id"):
        assert np.diff(log["time_s"]) == pytest.approx(1.0)


def test_marks_of_two_vessels_are_on_the_one_they_name():
    twin = unspoiled(load_twin("crossing-vessels"))
    flight = simulate(twin, 3, without=OPTIONAL_TABLES)
    at, ground = ground_of(flight, 0.0)
    for target in twin.targets:
        its = (flight.detections["target_id"] == target.identifier.text).to_numpy()
        assert np.abs(ground[its] - target_path(target, 3)(at[its])).max() < 1e-6


def test_the_subset_is_1250_detections_in_succession():
    flight = simulate_twin("slow-vessel", 1, without=OPTIONAL_TABLES)
    group = flight.frames.set_index("frame_id")["group"]
    inside = group.loc[flight.detections["frame_id"]].to_numpy() == "subset"
    assert inside.sum() == 1250
    assert np.flatnonzero(inside)[0] == 2000
    assert np.diff(np.flatnonzero(inside)).max() == 1
    assert set(group) == {"", "subset"}


def test_a_vessel_that_was_faster_comes_up_from_behind_and_drifts_on():
    motion = load_twin("slow-vessel").target.motion
    early, slow, slowing = motion.early_speed.si, motion.speed.si, motion.slowing_time.si
    t = np.arange(0.0, 1500.0, 0.01)
    speed = np.gradient(way_along(motion, t), t)
    assert speed[1] == pytest.approx(early, rel=1e-3)
    at = np.searchsorted(t, slowing)
    assert speed[at] == pytest.approx(slow + (early - slow) / np.e, rel=1e-3)
    assert speed[-1] == pytest.approx(slow)
    assert way_along(motion, [1500.0]) == pytest.approx([slow * 1500.0])
    steady = motion.model_copy(update={"early_speed": None, "slowing_time": None})
    assert way_along(steady, t) == pytest.approx(slow * t)


@pytest.fixture(scope="module")
def twin():
    return load_twin("large-ship")


@pytest.fixture(scope="module")
def flight():
    return simulate_twin("large-ship", 3)


def test_five_segments_of_441_images_and_438_detections(flight):
    frames, d = flight.frames, flight.detections
    assert len(frames) == 441
    assert frames["group"].unique().tolist() == [f"segment-{i}" for i in range(1, 6)]
    assert len(d) == 438
    assert d["frame_id"].is_unique
    assert set(d["frame_id"]) < set(frames["frame_id"])
    assert_in_image(d)
    length = frames.groupby("group")["time_s"].agg(np.ptp)
    assert length.sum() == pytest.approx(45, abs=2)  # a period of 45 s
    # Only a part was visible in the majority of the images, the whole in some.
    assert 0.7 < d["touches_border"].mean() < 1.0


def test_the_three_misses_show_least_of_the_ship(twin, flight):
    without = set(flight.frames["frame_id"]) - set(flight.detections["frame_id"])
    all_found = simulate(with_values(twin, target__observations=441), 3).detections
    missed = all_found[all_found["frame_id"].isin(without)]
    assert len(missed) == 3
    assert missed["area_px"].max() <= flight.detections["area_px"].min()
    assert flight.detections["area_px"].min() < 0.2 * flight.detections["area_px"].max()


def test_blobs_are_of_the_ship_seen_through_the_true_mount(twin):
    exact = simulate(with_values(twin, camera__marking_sd=0.0), 4).detections
    trajectory = twin_trajectory(twin, stream(4, "trajectory"))
    true = trajectory(exposure_times(twin))
    view = Exposures(as_flown(twin, 4), true)
    image = exact["frame_id"].str[1:].astype(int).to_numpy() - 1
    corners = target_outline(twin.target, 4)(true.times)
    polygon = np.stack([view.pixels(corners[:, i]) for i in range(4)], axis=1)[image]
    centre = view.pixels(target_path(twin.target, 4)(true.times))[image]
    uv = exact[["u_px", "v_px"]].to_numpy()
    whole = exact["touches_border"].to_numpy() == 0
    inside = ((polygon >= 0) & (polygon <= [640, 512])).all(axis=(1, 2))
    assert np.array_equal(whole, inside)
    # Perspective makes the nearer half larger: by 4 tan(tilt) length^2 / 12 focal length / altitude^2, 33 px
    # for 15 deg. The edge of the image does more.
    assert np.linalg.norm(uv - centre, axis=1)[whole].max() < 33
    assert np.median(np.linalg.norm(uv - centre, axis=1)[~whole]) > 50
    # Seen from 100 m, somewhat obliquely: 70 m by 14 m in pixels of 100 m / 764.7.
    scale = 764.7 / 100
    assert exact["area_px"].to_numpy()[whole] == pytest.approx(70 * 14 * scale**2, rel=0.25)
    assert exact["area_px"].max() < 1.25 * 70 * 14 * scale**2


def test_the_outline_has_the_ships_size_and_bow(twin):
    corners = target_outline(twin.target, 1)(np.array([0.0, 30.0]))
    side = np.linalg.norm(np.diff(corners, axis=1), axis=2)
    assert side == pytest.approx(np.tile([70.0, 14.0, 70.0], (2, 1)))
    assert corners.mean(axis=1) == pytest.approx(target_path(twin.target, 1)(np.array([0.0, 30.0])))
    bow = corners[:, [0, 3]].mean(axis=1) - corners.mean(axis=1)
    assert bow == pytest.approx(np.tile([-35.0, 0.0, 0.0], (2, 1)), abs=1e-9)  # course 180 deg
