"""Synchronisation against motions whose pose is known, and mounts that belong to one source of poses."""

from dataclasses import replace
from typing import Any

import numpy as np
import pandas as pd
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.analysis.survey_twin import Survey, simulate
from wildlab.analysis.georeference import observe
from wildlab.errors import WildlabError
from wildlab.flight.checks.known_points import sightings
from wildlab.flight.clocks import (
    MAX_GAP_S,
    covariance_columns,
    covariances,
    frame_poses,
    frame_times,
    gimbal_angles,
    gimbal_at,
    longest_gap,
    pose_finder,
    poses_at,
    truth_at,
)
from wildlab.flight.manifest import replace_in_manifest
from wildlab.flight.store import Flight
from wildlab.geometry.frames import Array, matrix_to_quaternion, rotation_vector_to_matrix

component = st.floats(-1.5, 1.5)
vectors = st.tuples(component, component, component).map(np.array)


def _still(stamps: list[float]) -> pd.DataFrame:
    """A body at 5 m + the time in each direction, that does not turn."""
    return _turning(np.zeros(3), np.ones(3), np.array(stamps), np.zeros(3))


def _known(nav: pd.DataFrame, times: list[float], **more: Any) -> list[bool]:
    p, R, _ = poses_at(nav, times, **more)
    known = np.isfinite(p).all(axis=1)
    assert (known == np.isfinite(R).all(axis=(1, 2))).all()
    return known.tolist()


def test_outside_in_gaps_and_beside_nan_there_is_no_pose():
    nav = _still([0.0, 0.5, 5.0, 5.5])
    times = [-0.01, 0.0, 0.25, 0.5, 0.6, 4.9, 5.0, 5.5, 5.51, np.nan]
    known = [False, True, True, True, False, False, True, True, False, False]
    assert _known(nav, times, max_gap_s=1.0) == known
    p, _, _ = poses_at(nav, [0.6], max_gap_s=5.0)
    np.testing.assert_allclose(p, [[5.6, 5.6, 5.6]])
    nav = _still([0.0, 1.0, 2.0, 3.0])
    nav.loc[1, ["north_m", "q_x"]] = np.nan
    assert _known(nav, [0.0, 0.5, 1.0, 1.5, 2.0, 2.5]) == [True, False, False, False, True, True]
    assert _known(_still([2.0]), [1.0, 2.0, 3.0]) == [False, True, False]


@pytest.mark.parametrize("find", [lambda nav: poses_at(nav, [0.5]), pose_finder])
def test_repeated_stamps_and_no_poses_are_refused(find):
    with pytest.raises(WildlabError, match="do not increase"):
        find(_still([0.0, 1.0, 1.0]))
    with pytest.raises(WildlabError, match="empty"):
        find(_still([2.0]).iloc[:0])


def _turning(rate: Array, velocity: Array, stamps: Array, start: Array) -> pd.DataFrame:
    """A body that moves straight and turns at a constant rate about an axis fixed in it."""
    R = rotation_vector_to_matrix(start[None]) @ rotation_vector_to_matrix(stamps[:, None] * rate)
    q = matrix_to_quaternion(R)
    q[1::2] *= -1  # q and -q are the same attitude: interpolation must not notice
    p = 5.0 + stamps[:, None] * velocity
    return pd.DataFrame(
        np.column_stack([stamps, p, q]),
        columns=["time_s", "north_m", "east_m", "down_m", "q_w", "q_x", "q_y", "q_z"],
    )


@given(vectors, vectors, vectors, st.lists(st.floats(0.0, 4.0), min_size=1, max_size=10))
def test_constant_rate_is_met_exactly(rate, velocity, start, times):
    nav = _turning(rate, velocity, np.array([0.0, 0.4, 0.9, 1.7, 2.5, 3.1, 4.0]), start)
    p, R, covariance = poses_at(nav, times)
    t = np.array(times)[:, None]
    expected = rotation_vector_to_matrix(start[None]) @ rotation_vector_to_matrix(t * rate)
    np.testing.assert_allclose(p, 5.0 + t * velocity, atol=1e-12)
    np.testing.assert_allclose(R, expected, atol=1e-7)
    assert covariance is None


def test_poses_that_belong_to_frames_are_not_interpolated():
    nav = _turning(np.ones(3), np.ones(3), np.array([0.0, 0.0, 7.0]), np.zeros(3)).assign(
        frame_id=["b", "a", "c"]
    )
    p, R, _ = poses_at(nav, frame_ids=["c", "b", "x", "c"])
    np.testing.assert_allclose(p[:, 0], [12.0, 5.0, np.nan, 12.0])
    assert list(np.isfinite(R[:, 0, 0])) == [True, True, False, True]
    # A finder does not look at times.
    np.testing.assert_array_equal(pose_finder(nav, ["c", "b", "x", "c"])(np.zeros(4))[0], p)
    with pytest.raises(WildlabError, match="no times are given"):
        poses_at(nav.drop(columns="frame_id"), frame_ids=["c"])


def test_covariance_between_two_stamps(make_flight):
    nav = make_flight().nav["autopilot"].copy()
    nav.loc[1, "cov_03"] = 0.01
    nav.loc[1, "cov_00"] = 8.0
    _, _, P = poses_at(nav, [0.25, 0.5])
    assert P.shape == (2, 6, 6)
    assert P[0, 0, 0] == pytest.approx(6.0)
    assert P[1, 3, 0] == P[1, 0, 3] == pytest.approx(0.01)
    assert P[0, 3, 0] == P[0, 0, 3] == pytest.approx(0.005)


def test_covariance_columns_are_the_upper_triangle():
    root = np.random.default_rng(0).normal(size=(4, 6, 6))
    P = root @ root.transpose(0, 2, 1)
    columns = covariance_columns(P)
    np.testing.assert_array_equal(columns["cov_25"], P[:, 2, 5])
    back = covariances(columns)
    assert back is not None
    np.testing.assert_allclose(back, P)


def test_the_clock_of_the_camera(make_flight):
    flight = make_flight(clocks={"camera_offset_s": -0.5})
    np.testing.assert_allclose(frame_times(flight), [0.5, 1.75, 7.5])
    p, R, P = frame_poses(flight)
    np.testing.assert_allclose(p[:, 0], 20 * np.array([0.5, 1.75, 7.5]))
    yaw = np.arctan2(R[:, 1, 0], R[:, 0, 0])
    np.testing.assert_allclose(yaw, 0.1 * np.array([0.5, 1.75, 7.5]), atol=1e-12)
    assert P is not None


def test_gimbal_from_frames_from_its_log_or_fixed(make_flight):
    flight = make_flight(mount={"pan_deg": 10.0, "tilt_deg": 20.0}, clocks={"camera_offset_s": 1.0})
    np.testing.assert_allclose(np.degrees(gimbal_angles(flight)), [[10.0] * 3, [20.0] * 3])
    # the log runs through +-180 deg between 2 s and 3 s
    flight.tables["gimbal"] = pd.DataFrame(
        {
            "time_s": [2.0, 3.0, 4.0],
            "pan_rad": np.radians([170.0, -170.0, -170.0]),
            "tilt_rad": [0.0, 0.5, 1.0],
        }
    )
    pan, tilt = gimbal_angles(flight)
    np.testing.assert_allclose(np.degrees(pan), [170.0, -170.0, np.nan])
    np.testing.assert_allclose(np.degrees(gimbal_at(flight.gimbal, [2.25])), [[175.0], [np.degrees(0.125)]])
    np.testing.assert_allclose(tilt, [0.0, 0.625, np.nan])
    flight.tables["frames"] = flight.tables["frames"].assign(pan_rad=[0.1, 0.2, 0.3], tilt_rad=0.0)
    np.testing.assert_allclose(gimbal_angles(flight)[0], [0.1, 0.2, 0.3])


def test_truth_of_fixed_and_moving_targets(make_flight):
    truth = make_flight().tables["truth"]
    names, p = truth_at(truth, [0.0, 5.0, 11.0], offset_s=1.0)
    assert names == ["buoy", "boat"]
    np.testing.assert_allclose(p[0], [[50.0, 5.0, 0.0]] * 3)
    np.testing.assert_allclose(p[1], [[np.nan] * 3, [40.0, 4.0, 0.0], [100.0, 10.0, 0.0]])
    names, p = truth_at(truth.sort_values("target_id", kind="stable"), [5.0], offset_s=1.0)
    assert names == ["boat", "buoy"] and p[1, 0].tolist() == [50.0, 5.0, 0.0]
    names, p = truth_at(truth.iloc[:0], [0.0])
    assert names == []
    assert p.shape == (0, 1, 3)


def test_a_slow_log_is_bridged_at_its_own_rate_but_not_over_a_missing_sample():
    """A GPS that writes every two seconds explains gaps of two seconds, not one of four."""
    stamps = np.array([0.0, 2.0, 4.0, 6.0, 10.0, 12.0])
    truth = pd.DataFrame(
        {"target_id": "boat", "time_s": stamps, "north_m": stamps, "east_m": -stamps, "down_m": 0.0}
    )
    names, where = truth_at(truth, [1.0, 5.0, 8.0, 11.0])
    assert names == ["boat"]
    assert np.allclose(where[0, [0, 1, 3], 0], [1.0, 5.0, 11.0])
    assert np.isnan(where[0, 2]).all()
    assert longest_gap(stamps) == 3.0
    assert longest_gap(np.arange(0, 5, 0.1)) == MAX_GAP_S


@given(vectors, vectors, vectors, st.lists(st.floats(-1.0, 7.0), min_size=1, max_size=5))
def test_a_finder_finds_what_is_found_at_once(rate, velocity, start, times):
    nav = _turning(rate, velocity, np.array([0.0, 0.5, 1.0, 3.0, 3.5, 6.0]), start)
    nav.loc[1, "q_x"] = np.nan
    p, R = pose_finder(nav)(times)
    p_once, R_once, _ = poses_at(nav, times)
    np.testing.assert_array_equal(p, p_once)
    np.testing.assert_array_equal(R, R_once)


def two_sources(poses: str) -> Flight:
    """A survey whose camera has a log of its own beside the vehicle's."""
    flight = simulate(Survey(images=6))
    manifest = replace_in_manifest(flight.manifest, {"mount": {"poses": poses}})
    return replace(
        flight, manifest=manifest, nav={"camera": flight.nav["logged"], "vehicle": flight.nav["logged"]}
    )


def test_the_mount_is_used_on_its_own_poses_and_refused_on_others():
    flight = two_sources("camera")
    assert len(observe(flight, "camera").table)
    with pytest.raises(WildlabError, match="'vehicle' are used") as caught:
        observe(flight, "vehicle")
    assert caught.value.field == "mount.poses"
    both = two_sources("")
    assert len(observe(both, "camera").table) == len(observe(both, "vehicle").table)


def test_sense_is_not_asked_of_a_mount_on_other_poses():
    flight = two_sources("camera")
    assert sightings(flight, "camera") is not None and sightings(flight, "vehicle") is None
