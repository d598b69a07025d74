"""The twin of H 6.4.1: counts as printed, blobs where the ship's visible part is, nothing calibrated."""

from __future__ import annotations

import numpy as np
import pytest

from tests.simulation.test_twins import with_values
from wildlab.errors import WildlabError
from wildlab.simulation.as_flown import as_flown
from wildlab.simulation.camera_detections import exposure_times
from wildlab.simulation.camera_view import Exposures
from wildlab.simulation.error_models import stream
from wildlab.simulation.manifest import true_mount
from wildlab.simulation.parameters import load_twin
from wildlab.simulation.target_motion import target_outline, target_path
from wildlab.simulation.twin_trajectory import twin_trajectory
from wildlab.simulation.twins import simulate, simulate_twin


@pytest.fixture(scope="module")
def twin():
    return load_twin("large-ship")


@pytest.fixture(scope="module")
def flight():
    return simulate_twin("large-ship", 3)


@pytest.mark.parametrize("seed", [1, 5])
def test_five_segments_of_441_images_and_438_detections_whatever_the_seed(seed):
    flight = simulate_twin("large-ship", seed)
    frames, d = flight.frames, flight.detections
    assert len(frames) == 441
    assert frames["group"].unique().tolist() == [f"segment-{i}" for i in range(1, 6)]
    assert len(d) == 438
    assert d["frame_id"].is_unique
    assert set(d["frame_id"]) < set(frames["frame_id"])
    assert d["u_px"].between(0, 640).all()
    assert d["v_px"].between(0, 512).all()
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
    with pytest.raises(ValueError, match="no outline"):
        target_outline(load_twin("slow-vessel").target, 1)


def test_nobody_knows_the_misalignment_and_only_the_computer_stamps(twin, flight):
    assert flight.manifest.geometry_mount().misalignment == (0.0, 0.0, 0.0)
    assert np.degrees(true_mount(twin).misalignment) == pytest.approx([1.7, 3.9, -1.9])
    assert set(flight.tables) == {"frames", "detections", "truth"}
    assert list(flight.nav) == ["autopilot", "truth"]
    assert "time_onboard_s" not in flight.frames
    image = flight.frames["frame_id"].str[1:].astype(int).to_numpy() - 1
    late = flight.frames["time_s"].to_numpy() - image / 10
    assert late.min() > 0.005 - 1e-9
    assert late.mean() == pytest.approx(0.055, abs=0.025)  # exponential, and who is late holds up the next
    assert np.diff(flight.nav["autopilot"]["time_s"]) == pytest.approx(0.1)


@pytest.mark.parametrize(
    ("key", "value", "found"),
    [
        ("images", 2000, "not in 2000"),
        ("count", 4, "not 4"),
    ],
)
def test_segments_that_are_not_there_are_refused(twin, key, value, found):
    with pytest.raises(WildlabError, match=found):
        simulate(with_values(twin, **{f"segments__{key}": value}), 1)
