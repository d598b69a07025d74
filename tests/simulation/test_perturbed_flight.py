"""What sensors really are differs from flight to flight, within its tolerance, and no filter is told."""

from __future__ import annotations

import re
import tomllib
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

import wildlab
from tests.simulation.test_twins import marks, with_values
from wildlab.flight.store import save_flight
from wildlab.geometry.camera_poses import camera_pose
from wildlab.geometry.georeference import ground_to_pixel
from wildlab.simulation.manifest import as_flown, true_mount, twin_manifest
from wildlab.simulation.parameters import each_parameter, load_twin
from wildlab.simulation.twins import OPTIONAL_TABLES, simulate

SEEDS = range(400)
#: Noise densities and SDs of biases of the payload.
NOISE = ["imu.gyro_random_walk", "imu.accelerometer_random_walk", "gnss.horizontal_noise",
         "gnss.vertical_noise", "gnss.horizontal_correlated_sd", "gnss.vertical_correlated_sd",
         "gnss.velocity_noise", "camera.marking_sd"]  # fmt: skip
BIAS = ["imu.gyro_bias_stability", "imu.gyro_turn_on_bias", "imu.accelerometer_bias_stability",
        "imu.accelerometer_turn_on_bias"]  # fmt: skip
OPTICS = ["camera.fx", "camera.fy", "camera.cx", "camera.cy"]
ANGLES = [f"mount.misalignment_{name}" for name in ("roll", "tilt", "pan")]


def numbers(twin) -> dict[str, float]:
    return {
        f"{group}.{name}": p.number for group, name, p in each_parameter(twin) if not isinstance(p.value, str)
    }


@pytest.fixture(scope="module")
def stated():
    return load_twin("static-antenna")


@pytest.fixture(scope="module")
def drawn(stated):
    return pd.DataFrame([numbers(as_flown(stated, seed)) for seed in SEEDS])


def without_tolerance(twin):
    return twin.model_copy(update={"tolerance": None})


def test_only_noise_biases_optics_and_mount_are_drawn(stated, drawn):
    sheet = numbers(stated)
    moved = {name for name in drawn if (drawn[name] != sheet[name]).any()}
    assert moved == {*NOISE, *BIAS, *OPTICS, *ANGLES}


def test_noise_and_biases_fill_their_tolerance_evenly(stated, drawn):
    sheet = numbers(stated)
    for names, within in ((NOISE, stated.tolerance.noise.number), (BIAS, stated.tolerance.bias.number)):
        for name in names:
            factor = (drawn[name] / sheet[name]).to_numpy()
            assert factor.min() >= 1 - within and factor.max() <= 1 + within, name
            # An even spread has an SD of its half-width over the root of three.
            assert factor.std() == pytest.approx(within / np.sqrt(3), rel=5 * 0.45 / np.sqrt(len(SEEDS)))
            assert factor.mean() == pytest.approx(1.0, abs=5 * within / np.sqrt(3 * len(SEEDS)))


def test_optics_and_mount_err_normally_by_their_standard_deviations(stated, drawn):
    sheet, tolerance = numbers(stated), stated.tolerance
    expected = {name: tolerance.focal_length.number * sheet[name] for name in OPTICS[:2]}
    expected |= dict.fromkeys(OPTICS[2:], tolerance.principal_point.number)
    expected |= dict.fromkeys(ANGLES, tolerance.mount.number)
    for name, sd in expected.items():
        off = (drawn[name] - sheet[name]).to_numpy()
        assert off.std() == pytest.approx(sd, rel=5 / np.sqrt(2 * len(SEEDS))), name
        assert abs(off.mean()) < 5 * sd / np.sqrt(len(SEEDS)), name


def test_what_is_drawn_is_drawn_apart(stated, drawn):
    """No two of them go together: a noisier gyro says nothing of the accelerometer beside it."""
    together = np.corrcoef(drawn[[*NOISE, *BIAS, *OPTICS, *ANGLES]].to_numpy().T)
    assert np.abs(together - np.eye(len(together))).max() < 5 / np.sqrt(len(SEEDS))


@pytest.mark.parametrize("name", ["static-antenna", "large-ship", "uav-search"])
def test_no_file_of_a_flight_gives_away_what_was_drawn(name, tmp_path):
    """Nothing that a filter may read differs from that of a flight whose sensors are as stated."""
    twin = load_twin(name)
    flight, exact = (simulate(one, 7, without=["imu"]) for one in (twin, without_tolerance(twin)))
    assert flight.manifest == exact.manifest == twin_manifest(twin, 7)
    for table in {**flight.nav, **flight.tables}:
        one, other = (
            flight.nav.get(table, flight.tables.get(table)),
            exact.nav.get(table, exact.tables.get(table)),
        )
        assert list(one) == list(other)
        for column in one:
            if column.startswith(("sd_", "cov_", "lever_", "second_lever_")):
                assert one[column].equals(other[column]), f"{table}.{column}"
    save_flight(flight, tmp_path / "flight")
    toml = tomllib.loads((tmp_path / "flight" / "flight.toml").read_text(encoding="utf-8"))
    said = set(floats_in(toml))
    sheet, real = numbers(twin), numbers(as_flown(twin, 7))
    secrets = {real[key] for key in real if real[key] != sheet[key]}
    assert secrets
    assert not said & secrets


def floats_in(content):
    """All numbers of nested tables and lists."""
    if isinstance(content, dict | list):
        for part in content.values() if isinstance(content, dict) else content:
            yield from floats_in(part)
    elif isinstance(content, float):
        yield content


def test_only_the_simulation_asks_what_was_drawn():
    """Filters, navigation and the tables between them never import it."""
    package = Path(wildlab.__file__).parent
    imported = re.compile(r"^\s*(?:from|import) .*\bas_flown\b", re.MULTILINE)
    asking = {
        path.relative_to(package).parts[0]
        for path in package.rglob("*.py")
        if imported.search(path.read_text(encoding="utf-8"))
    }
    assert asking == {"simulation"}


def test_the_camera_that_took_the_images_is_the_one_drawn(stated):
    """Marks without noise lie where the real camera sees the antenna, and not where the stated one would."""
    exact = with_values(stated, camera__marking_sd=0.0, camera__latency=0.0)
    twin = exact.model_copy(update={"camera_sway": None})
    flight = simulate(twin, 5, without=OPTIONAL_TABLES)
    uv, _, *pose = marks(flight)
    real, told = as_flown(twin, 5), flight.manifest
    seen, expected = (
        ground_to_pixel(camera, [0.0, 0.0, -2.0], *camera_pose(mount, *pose))
        for camera, mount in (
            (twin_manifest(real, 5).geometry_camera(), true_mount(real)),
            (told.geometry_camera(), told.geometry_mount()),
        )
    )
    assert np.abs(seen - uv).max() < 1e-6
    assert np.abs(expected - uv).max() > 1.0
