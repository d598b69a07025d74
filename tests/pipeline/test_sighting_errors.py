"""What poses state and are off by, and how a flight was flown, against what was put in."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest

from wildlab.flight.store import Flight
from wildlab.geometry.camera import project
from wildlab.geometry.frames import euler_to_matrix
from wildlab.pipeline.navigate import PUBLISHED_LIKE, navigate_mekf
from wildlab.pipeline.navigation_errors import Errors, errors_against
from wildlab.pipeline.sighting_errors import (
    PAUSE_S,
    TURNING,
    flight_numbers,
    mean,
    pauses,
    pose_numbers,
    premise_numbers,
    rms,
)
from wildlab.pipeline.track import Sighting, sighting
from wildlab.simulation.twins import simulate_twin


@pytest.fixture(scope="module")
def flight() -> Flight:
    found = simulate_twin("fast-vessel", 3)
    found.nav["mekf"] = navigate_mekf(found, tuning=PUBLISHED_LIKE).nav
    return found


@pytest.fixture(scope="module")
def seen(flight: Flight) -> Sighting:
    return sighting(flight, "mekf")


@pytest.fixture(scope="module")
def own(flight: Flight, seen: Sighting) -> Errors:
    return errors_against(flight.nav["truth"], flight.nav["mekf"], seen.times)


def test_pauses_are_where_nothing_is_seen_for_long(seen: Sighting) -> None:
    found = pauses(seen)
    assert found
    for rows in found:
        assert not seen.seen[rows].any() and seen.seen[rows[0] - 1] and seen.seen[rows[-1] + 1]
        assert seen.times[rows[-1] + 1] - seen.times[rows[0] - 1] > PAUSE_S
    others = np.setdiff1d(np.flatnonzero(~seen.seen), np.concatenate(found))
    assert len(others) and np.isin(others - 1, np.flatnonzero(seen.seen)).any()


def test_means_and_roots_leave_out_what_is_not_known() -> None:
    assert mean([1.0, np.nan, 3.0]) == 2.0 and rms(np.array([3.0, np.nan, 4.0])) == np.sqrt(12.5)
    assert np.isnan(mean([])) and np.isnan(rms(np.array([np.nan])))


def test_numbers_of_poses_are_in_metres_and_degrees() -> None:
    error, sd = np.zeros((4, 9)), np.ones((4, 9))
    error[:, 0], error[:, 6], sd[:, 8] = [1, -1, 1, np.nan], np.radians(3.0), np.radians(2.0)
    found = pose_numbers(Errors(np.arange(4.0), error, sd, {}))
    assert found["rms_north"] == 1.0 and found["rms_roll"] == pytest.approx(3.0) and found["rms_down"] == 0.0
    assert found["mean_sd_yaw"] == pytest.approx(2.0) and found["mean_sd_east"] == 1.0


def test_errors_of_the_pose_move_the_target_in_the_image(flight: Flight, seen: Sighting, own: Errors) -> None:
    """Against projecting it once with the poses and once with the true ones."""
    rows = np.flatnonzero(seen.seen)
    true = sighting(flight, "truth").poses.take(rows)
    target = np.column_stack([seen.positions[rows], seen.plane_down[rows]])
    uv = [
        project(poses.camera, np.einsum("nji,nj->ni", poses.R_nc, target - poses.p_nc))
        for poses in (true, seen.poses.take(rows))
    ]
    expected = np.sqrt(np.mean((uv[0] - uv[1]) ** 2))
    found = premise_numbers(flight, seen, "mekf", own)
    assert found["shift_px"] == pytest.approx(expected, rel=0.05)
    assert found["largest_shift_px"] == pytest.approx(np.hypot(*(uv[0] - uv[1]).T).max(), rel=0.05)


def test_an_autopilot_that_agrees_has_no_differences(flight: Flight, seen: Sighting, own: Errors) -> None:
    same = Flight(flight.manifest, flight.nav | {"autopilot": flight.nav["mekf"]}, flight.tables)
    found = premise_numbers(same, seen, "mekf", own)
    for name in ("difference_roll", "difference_yaw", "outside_pitch", "difference_turning"):
        assert found[name] == pytest.approx(0, abs=1e-6), name
    real = premise_numbers(flight, seen, "mekf", own)
    beside = errors_against(flight.nav["autopilot"], flight.nav["mekf"], seen.times)
    for i, axis in enumerate(("roll", "pitch", "yaw"), 6):
        known = np.isfinite(beside.error[:, i])
        ratio = np.abs(beside.error[known, i]) / beside.sd[known, i]
        assert real[f"outside_{axis}"] == np.mean(ratio > 2)
        assert np.mean(ratio > 0.5) > 0.1, "or the factor would not matter"
    inside = sorted([real["difference_turning"], real["difference_straight"]])
    assert inside[0] <= real["difference_roll"] <= inside[1]


def test_a_deviation_that_changes_has_a_spread(flight: Flight, seen: Sighting, own: Errors) -> None:
    even = own._replace(sd=np.ones_like(own.sd))
    rising = own._replace(sd=even.sd * np.linspace(1, 3, len(own.times))[:, None] ** (np.arange(9) == 7))
    assert premise_numbers(flight, seen, "mekf", even)["sd_spread"] == 0
    assert premise_numbers(flight, seen, "mekf", rising)["sd_spread"] == pytest.approx(0.9, rel=0.01)


def test_how_a_flight_was_flown(flight: Flight, seen: Sighting) -> None:
    found = flight_numbers(flight, seen)
    assert found["detections"] == 264 and found["pauses"] == len(pauses(seen)) and found["moving"] == 1
    assert found["settled"] == pytest.approx(seen.times[0] - flight.table("imu")["time_s"].min())
    level = flown(flight, seen, roll=0.0, heading=0.3, course=0.1)
    assert (level["turning"], level["crab"]) == (0.0, pytest.approx(np.degrees(0.2)))
    assert flown(flight, seen, roll=1.1 * TURNING, heading=0.0, course=0.0)["turning"] == 1.0
    north = flown(flight, seen, roll=0.0, heading=3.1, course=-3.1)
    assert north["crab"] == pytest.approx(np.degrees(2 * np.pi - 6.2))


def flown(flight: Flight, seen: Sighting, roll: float, heading: float, course: float) -> dict[str, float]:
    """`flight_numbers` of an airframe that does the same all the time."""
    from scipy.spatial.transform import Rotation

    truth = flight.nav["truth"].copy()
    q = Rotation.from_matrix(euler_to_matrix(roll, 0.0, heading)).as_quat(scalar_first=True).ravel()
    truth[["q_w", "q_x", "q_y", "q_z"]] = q
    truth["v_north_m_s"], truth["v_east_m_s"] = 20 * np.cos(course), 20 * np.sin(course)
    nav: dict[str, pd.DataFrame] = flight.nav | {"truth": truth}
    return flight_numbers(Flight(flight.manifest, nav, flight.tables), seen)
