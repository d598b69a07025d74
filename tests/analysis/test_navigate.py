"""Navigation of a whole flight: poses near the truth, honest errors where something is missing."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

from tests.analysis.conftest import changed, first_seconds
from tests.refused import refused
from wildlab.analysis.navigate import imu_noise, navigate_mekf, navigate_observer
from wildlab.flight.clocks import poses_at
from wildlab.flight.manifest import ImuPart
from wildlab.flight.schema import COVARIANCE_COLUMNS, LEVER_COLUMNS, SECOND_COLUMNS
from wildlab.flight.store import Flight
from wildlab.geometry.frames import matrix_to_rotation_vector
from wildlab.navigation.aiding import earth_field
from wildlab.simulation.twins import simulate_twin


@pytest.fixture(scope="module")
def flight() -> Flight:
    """The first minutes of the static twin's sensors, and its frames in that time."""
    whole = simulate_twin("static-antenna", 3)
    frames = whole.frames[whole.frames["time_s"] < 420.0]
    detections = whole.detections[whole.detections["frame_id"].isin(frames["frame_id"])]
    return changed(first_seconds(whole, 420.0), frames=frames, detections=detections, truth=whole.truth)


def errors(flight: Flight, nav: pd.DataFrame) -> tuple[np.ndarray, np.ndarray]:
    """RMS of position (3,) m and of the attitude's rotation vector (3,) deg, after the first minute."""
    times = nav["time_s"].to_numpy()
    p, R, _ = poses_at(nav, times)
    p_true, R_true, _ = poses_at(flight.nav["truth"], times)
    turn = matrix_to_rotation_vector(np.swapaxes(R_true, 1, 2) @ R)
    late = times > 60.0
    return np.sqrt(((p - p_true)[late] ** 2).mean(0)), np.degrees(np.sqrt((turn[late] ** 2).mean(0)))


@pytest.mark.parametrize("navigate", [navigate_mekf, navigate_observer])
def test_two_antennas_and_an_inertial_sensor_give_the_pose(flight, navigate):
    """Centimetres and about a degree: the airframe's own wandering error of that size is in the sensors."""
    found = navigate(flight, np.arange(0.0, 240.0, 0.2))
    position, attitude = errors(flight, found.nav)
    assert position.max() < 0.15
    assert attitude.max() < 2.5
    assert found.nav["time_s"].is_monotonic_increasing
    assert len(found.biases) == len(found.nav)


def test_the_filter_states_its_covariance_and_its_innovations(flight):
    found = navigate_mekf(flight, np.arange(0.0, 120.0, 1.0))
    assert set(COVARIANCE_COLUMNS) <= set(found.nav.columns)
    assert set(found.innovations["source"]) == {"position", "second position", "velocity"}


def single(flight: Flight) -> Flight:
    """The flight with one antenna."""
    return changed(flight, gnss=flight.gnss.drop(columns=[*SECOND_COLUMNS, *LEVER_COLUMNS[3:]]))


def test_what_the_filter_must_know_is_asked_for(flight):
    bare = replace(flight, manifest=flight.manifest.model_copy(update={"imu": ImuPart()}))
    with refused("not stated", field="imu.velocity_random_walk_m_s_sqrt_h"):
        imu_noise(bare)
    silent = changed(flight, gnss=flight.gnss.drop(columns=["sd_vertical_m"]))
    with refused("satellite positions"):
        navigate_observer(changed(silent, {"uncertainty": {"position_vertical_m": None}}))
    with refused("no table 'imu'"):
        navigate_observer(replace(flight, tables={"gnss": flight.gnss}))


IRON = np.array([8.0, -3.0, 5.0])


def with_field(flight: Flight, **stated: object) -> Flight:
    """The flight with one antenna, and a magnetometer beside iron that turns with the airframe."""
    truth = flight.nav["truth"]
    R = poses_at(truth, truth["time_s"].to_numpy())[1]
    field = 50.0 * np.einsum("kji,j->ki", R, earth_field(0.05, 1.2)) + IRON
    field += np.random.default_rng(1).normal(0, 0.5, field.shape)
    table = pd.DataFrame(field, columns=["field_x_ut", "field_y_ut", "field_z_ut"])
    table["time_s"] = truth["time_s"]
    return changed(single(flight), {"magnetometer": stated}, magnetometer=table)


def test_a_magnetometer_stands_in_for_the_second_antenna():
    """On eights, which bank to both sides. By the course, the observer is off by the crab angle."""
    flight, times = simulate_twin("slow-vessel-eight", 3), np.arange(0.0, 420.0, 0.5)
    stated = {"declination_deg": np.degrees(0.05), "inclination_deg": np.degrees(1.2)}
    known, silent = with_field(flight, **stated), with_field(flight)  # silent: where does the field point?
    by_field, by_course = (errors(one, navigate_observer(one, times).nav)[1][2] for one in (known, silent))
    assert 2 * by_field < by_course
    known.tables["magnetometer"]["field_y_ut"] *= -1
    with refused("gyros"):
        navigate_observer(known, times)


def test_a_flight_that_banks_to_one_side_has_its_iron_stated(flight):
    """A loiter shows too little of the sphere."""
    stated = {"declination_deg": np.degrees(0.05), "inclination_deg": np.degrees(1.2)}
    with refused("hard_iron_ut"):
        navigate_observer(with_field(flight, **stated), [60.0])
    known = with_field(flight, **stated, hard_iron_ut=tuple(IRON))
    assert errors(known, navigate_observer(known, np.arange(0.0, 240.0, 0.5)).nav)[1][2] < 4.0


def test_an_accelerometer_off_by_a_known_bias_is_the_same_as_none(flight):
    off = np.array([0.3, -0.2, 0.1])
    wrong = flight.imu.copy()
    wrong[["f_x_m_s2", "f_y_m_s2", "f_z_m_s2"]] += off
    times = np.arange(0.0, 100.0, 1.0)
    mended = navigate_observer(changed(flight, imu=wrong), times, accelerometer_bias=off)
    pd.testing.assert_frame_equal(mended.nav, navigate_observer(flight, times).nav, rtol=1e-6, atol=1e-6)
