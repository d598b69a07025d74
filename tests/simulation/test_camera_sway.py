"""The camera turns against the airframe after changes of bank, and only the camera does."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest

from tests.simulation.test_twins import with_values
from wildlab.geometry.frames import matrix_to_rotation_vector
from wildlab.simulation.camera_sway import camera_motion, camera_sway, recent_change
from wildlab.simulation.error_models import stream
from wildlab.simulation.parameters import load_twin
from wildlab.simulation.sensor_parameters import CameraSway
from wildlab.simulation.twin_trajectory import twin_trajectory
from wildlab.simulation.twins import OPTIONAL_TABLES, simulate

STEP, MEMORY = 0.01, 10.0


def test_the_change_is_the_weighted_standard_deviation():
    x = np.random.default_rng(1).normal(2.0, 1.0, 400).cumsum()
    weight = np.exp(-STEP / MEMORY) ** np.arange(399, -1, -1) * (1 - np.exp(-STEP / MEMORY))
    weight[0] += 1 - weight.sum()  # before, it stood where it begins
    expected = np.sqrt(weight @ x**2 - (weight @ x) ** 2)
    assert recent_change(x, STEP, MEMORY)[-1] == pytest.approx(expected, rel=1e-9)


def test_what_stands_still_or_is_moved_or_scaled():
    x = np.random.default_rng(2).normal(size=500)
    change = recent_change(x, STEP, MEMORY)
    assert (recent_change(np.full(50, 0.7), STEP, MEMORY) == 0).all()
    assert recent_change(3 * x - 8, STEP, MEMORY) == pytest.approx(3 * change)
    assert recent_change([], STEP, MEMORY).shape == (0,)


@pytest.mark.parametrize(("step", "memory"), [(0.0, 1.0), (1.0, 0.0), (-1.0, 1.0)])
def test_time_goes_forward(step, memory):
    with pytest.raises(ValueError, match="positive"):
        recent_change([1.0], step, memory)


def test_each_axis_errs_by_its_share_of_the_change():
    """Over 40 flights, each with hundreds of independent errors: the sines have periods of 1 to 15 s."""
    twin = load_twin("slow-vessel-eight")
    share = twin.camera_sway.share.number
    trajectory = twin_trajectory(twin, stream(3, "trajectory"))
    times = np.arange(120.0, 880.0, 0.5)
    grid = np.arange(0.0, 880.0, 0.1)
    R = trajectory(grid).R_nb
    bank = np.arctan2(R[:, 2, 1], R[:, 2, 2])
    size = np.interp(times, grid, recent_change(bank, 0.1, twin.camera_sway.memory.number))
    angles = np.array([camera_sway(twin, trajectory, seed)(times) for seed in range(40)])
    in_units = angles / (share * size[:, None])
    assert np.sqrt((in_units**2).mean(axis=(0, 1))) == pytest.approx([1.0] * 3, rel=0.03)
    # Axes do not know of each other.
    together = np.corrcoef(in_units.reshape(-1, 3).T)
    assert np.abs(together - np.eye(3)).max() < 0.05


def test_the_camera_is_turned_by_those_angles_and_stays_in_its_place():
    twin = load_twin("slow-vessel-eight")
    trajectory = twin_trajectory(twin, stream(3, "trajectory"))
    times = np.arange(120.0, 300.0, 0.5)
    airframe, camera = trajectory(times), camera_motion(twin, trajectory, times, 3)
    turn = matrix_to_rotation_vector(np.swapaxes(airframe.R_nb, 1, 2) @ camera.R_nb)
    assert turn == pytest.approx(camera_sway(twin, trajectory, 3)(times), abs=2e-3)  # small angles
    assert (airframe.position == camera.position).all()
    assert np.abs(turn).max() > np.radians(1.0)


def test_no_navigation_system_feels_the_camera_sway():
    twin = load_twin("slow-vessel-eight")
    calm, restless = (
        simulate(with_values(twin, camera_sway__share=share), 5, without=OPTIONAL_TABLES)
        for share in (0.0, 0.2)
    )
    for name, table in calm.nav.items():
        pd.testing.assert_frame_equal(table, restless.nav[name], check_exact=True)
    pd.testing.assert_frame_equal(calm.truth, restless.truth, check_exact=True)
    assert calm.manifest == restless.manifest
    both = calm.detections.merge(restless.detections, on="frame_id")
    moved = np.hypot(both["u_px_x"] - both["u_px_y"], both["v_px_x"] - both["v_px_y"])
    assert moved.median() > 5.0


def test_a_twin_without_sway_has_its_camera_fixed():
    twin = load_twin("large-ship")
    trajectory = twin_trajectory(twin, stream(1, "trajectory"))
    assert twin.camera_sway is None
    assert camera_sway(twin, trajectory, 1) is None
    times = np.arange(10.0)
    assert (camera_motion(twin, trajectory, times, 1).R_nb == trajectory(times).R_nb).all()


def test_a_band_the_wrong_way_round_is_named():
    sway = load_twin("fast-vessel").camera_sway.model_dump()
    sway["shortest_period"], sway["longest_period"] = sway["longest_period"], sway["shortest_period"]
    with pytest.raises(ValueError, match="shortest_period"):
        CameraSway.model_validate(sway)
