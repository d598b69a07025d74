"""The offset of a camera's clock, on twins whose stamps were shifted by a known amount."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import cv2
import numpy as np
import pandas as pd
import pytest
from click.testing import CliRunner, Result

from tests.analysis.conftest import changed
from tests.refused import refused
from wildlab.analysis.camera import (
    clock_from_images,
    clock_from_motions,
    clock_from_points,
    image_motions,
)
from wildlab.cli import wildlab
from wildlab.errors import WildlabError
from wildlab.flight.clocks import poses_at
from wildlab.flight.readers.frames import Frame
from wildlab.flight.store import Flight, load_flight, save_flight
from wildlab.geometry.camera_poses import CameraPoses
from wildlab.simulation.twins import simulate_twin


def late(flight: Flight, shift: float) -> Flight:
    """The same flight by a camera whose stamps are early by so many seconds."""
    frames = flight.table("frames")
    return changed(flight, frames=frames.assign(time_s=frames["time_s"] - shift))


@pytest.fixture(scope="module")
def tracking() -> Flight:
    """Static and moving points under a gimballed camera, a twelfth of 1800 sightings."""
    flight = simulate_twin("uav-tracking", 1)
    return changed(flight, detections=flight.table("detections").iloc[::12].reset_index(drop=True))


@pytest.fixture(scope="module")
def antenna() -> Flight:
    return simulate_twin("static-antenna", 1)


@pytest.mark.slow
def test_within_20_ms_from_known_points(tracking):
    shift = -14.05
    found = clock_from_points(late(tracking, shift), "autopilot")
    offset, sd = found.numbers["offset_s"], found.numbers["sd_s"]
    assert offset == pytest.approx(shift, abs=0.020)
    assert sd < 0.020 and abs(offset - shift) < 4 * sd
    assert found.numbers["certain"]


@pytest.mark.slow
def test_a_wandering_attitude_beside_a_turned_camera_hardly_moves_it(antenna):
    """One degree for half a minute at 350 m, in the noise of the diagnosis."""
    found = clock_from_points(late(antenna, 0.8), "autopilot-uncalibrated")
    offset, sd = found.numbers["offset_s"], found.numbers["sd_s"]
    assert found.numbers["certain"]
    assert sd < 0.02 and abs(offset - 0.8) < 3 * sd
    # An offset that the manifest states is part of the one that is found.
    stated = changed(late(antenna, 0.8), {"clocks": {"camera_offset_s": 0.5}})
    true = clock_from_points(stated, "truth")
    assert true.numbers["offset_s"] == pytest.approx(0.8, abs=0.020)


@pytest.mark.slow
def test_what_cannot_be_estimated_is_refused(tracking):
    nobody = changed(tracking, truth=tracking.table("truth").head(0))
    for flight in (nobody, late(tracking, 1e6)):
        with refused("fewer than 4"):
            clock_from_points(flight, "autopilot")


def over_land(flight: Flight, first: int, count: int) -> Iterator[Frame]:
    """Images of level ground with a texture, as the true poses have it."""
    rng = np.random.default_rng(7)
    side, cell = 2048, 1.0
    ground = np.zeros((side, side), np.float32)
    for octave in (4, 8, 16, 64):
        small = rng.normal(0, 1, (side // octave, side // octave)).astype(np.float32)
        ground += cv2.resize(small, (side, side), interpolation=cv2.INTER_CUBIC)
    frames, camera = flight.table("frames"), flight.manifest.geometry_camera()
    p, R, _ = poses_at(flight.nav["truth"], frames["time_s"].to_numpy(float)[first : first + count])
    poses = CameraPoses(camera, flight.manifest.geometry_mount(), p, R)
    middle = poses.p_nc[:, :2].mean(axis=0)
    for k in range(count):
        # Column and row of the texture -> north, east -> pixel.
        plane = np.array([[0, cell, middle[0] - side / 2 * cell], [cell, 0, middle[1] - side / 2 * cell]])
        to_n = np.vstack([plane, [0, 0, 0], [0, 0, 1]])
        to_c = poses.R_nc[k].T @ np.hstack([np.eye(3), -poses.p_nc[k][:, None]])
        H = camera.matrix @ to_c @ to_n
        seen = cv2.warpPerspective(ground, H, (camera.width, camera.height), borderMode=cv2.BORDER_REFLECT)
        noisy = 120 + 30 * seen + rng.normal(0, 2, seen.shape)
        grey = np.clip(noisy, 0, 255).astype(np.uint8)
        name = f"{frames['frame_id'].iloc[first + k]}.png"
        yield Frame(name, None, grey, "grey", "white-hot", np.ones(grey.shape, bool))


@pytest.mark.slow
def test_from_the_motion_of_images(antenna):
    found = clock_from_images(late(antenna, 1.3), over_land(antenna, 3000, 160), "autopilot")
    assert found.numbers["certain"], found.facts
    assert found.numbers["offset_s"] == pytest.approx(1.3, abs=0.030)
    assert found.numbers["gain"] == pytest.approx(1.0, abs=0.3)


@pytest.mark.slow
def test_from_attitudes_where_there_is_no_gyro(antenna):
    bare = replace(antenna, tables={k: v for k, v in antenna.tables.items() if k != "imu"})
    bare = late(bare, -4.2)
    camera = antenna.manifest.geometry_camera()
    pairs, motion = image_motions(over_land(antenna, 3000, 160), antenna, camera)
    assert len(pairs) == 159 and np.isfinite(motion).all(axis=1).mean() > 0.95
    found = clock_from_motions(bare, pairs, motion, "autopilot")
    assert found.numbers["certain"] and found.numbers["offset_s"] == pytest.approx(-4.2, abs=0.040)


@pytest.mark.slow
def test_images_that_show_nothing_but_the_sensor_cannot_tell(antenna):
    still = pd.DataFrame(antenna.table("frames")).iloc[3000:3040]
    rng = np.random.default_rng(1)
    pattern = rng.normal(120, 30, (512, 640))

    def frames() -> Iterator[Frame]:
        for name in still["frame_id"]:
            grey = np.clip(pattern + rng.normal(0, 2, pattern.shape), 0, 255).astype(np.uint8)
            yield Frame(f"{name}.png", None, grey, "grey", "unknown", np.ones(grey.shape, bool))

    found = clock_from_images(antenna, frames(), "autopilot")
    assert not found.numbers["certain"]
    with refused("0 of 0"):
        clock_from_images(antenna, iter(()), "autopilot")


def test_repeated_stamps_of_the_gyro_change_nothing(antenna):
    pairs = np.arange(3000, 3100)[:, None] + [0, 1]
    motion = np.random.default_rng(2).normal(0, 0.01, (100, 3))
    repeated = changed(antenna, imu=antenna.imu.loc[antenna.imu.index.repeat(2)].reset_index(drop=True))
    one, two = (clock_from_motions(each, pairs, motion, "autopilot") for each in (antenna, repeated))
    assert one.numbers["offset_s"] == two.numbers["offset_s"]


@pytest.mark.slow
def test_the_command_sets_the_offset(tracking, tmp_path):
    folder = tmp_path / "flight"
    save_flight(late(tracking, 0.25), folder)

    def run(*options: str) -> Result:
        return CliRunner().invoke(wildlab, ["clock", str(folder), *options])

    assert run("--source", "autopilot", "--set").exit_code == 0
    assert load_flight(folder).manifest.clocks.camera_offset_s == pytest.approx(0.25, abs=0.020)
    assert run("--offset", "0.5", "--set").exit_code == 0
    assert load_flight(folder).manifest.clocks.camera_offset_s == 0.5
    assert isinstance(run("--offset", "1", "--images", str(tmp_path)).exception, WildlabError)
