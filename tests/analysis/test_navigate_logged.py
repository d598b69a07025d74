"""From logs to poses with covariance: recipe, import, filters, against the attitude found on board.

Inertial sensor and GPS alone; noise from the recipe, and nothing tuned to the attitude that is compared with.
The onboard attitudes are estimates too.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from wildlab.analysis.navigate import (
    Navigated,
    navigate_mekf,
)
from wildlab.flight.clocks import covariances, poses_at
from wildlab.flight.importing import import_flight
from wildlab.flight.store import Flight, load_flight
from wildlab.geometry.frames import (
    matrix_to_euler,
    matrix_to_rotation_vector,
    rotation_vector_to_matrix,
    wrap,
)
from wildlab.paths import DATA
from wildlab.studies.navigation import navigate_all

#: In the air, by speed and height.
THOR_AIRBORNE = (212.0, 579.0)


def loaded(recipe: str, source: Path, into: Path) -> tuple[Flight, np.ndarray]:
    """The flight, and times of its inertial samples."""
    import_flight(DATA / "recipes" / f"{recipe}.toml", source, into)
    flight = load_flight(into)
    return flight, flight.table("imu")["time_s"].to_numpy()


@pytest.fixture(scope="module")
def thor(shared_data: Callable[..., Path], tmp_path_factory: pytest.TempPathFactory):
    source = shared_data("logs", "umn_thor75")
    flight, times = loaded("umn-thor75", source, tmp_path_factory.mktemp("thor") / "flight")
    return flight, navigate_all(flight, times)


def euler_differences(flight: Flight, found: Navigated, begin: float, end: float) -> np.ndarray:
    """Of roll, pitch and yaw from those on board, deg, (K, 3)."""
    times = found.nav["time_s"].to_numpy()
    times = times[(times >= begin) & (times < end)]
    ours, onboard = (poses_at(nav, times)[1] for nav in (found.nav, flight.nav["onboard"]))
    known = np.isfinite(onboard[:, 0, 0])
    assert known.mean() > 0.99
    off = matrix_to_euler(ours[known]) - matrix_to_euler(onboard[known])
    return np.degrees(wrap(off))


def euler_deviations(found: Navigated, begin: float, end: float) -> np.ndarray:
    """Mean standard deviations of roll, pitch and yaw that the filter states, deg, (3,)."""
    nav = found.nav[found.nav["time_s"].between(begin, end)]
    P = covariances(nav)
    assert P is not None
    R, h = poses_at(nav, nav["time_s"].to_numpy())[1], 1e-6
    near = [matrix_to_euler(R @ rotation_vector_to_matrix(h * axis)) for axis in np.eye(3)]
    to_euler = wrap(np.stack(near, axis=-1) - matrix_to_euler(R)[..., None]) / h
    spread = np.einsum("kij,kjl,kil->ki", to_euler, P[:, 3:, 3:], to_euler)
    return np.degrees(np.sqrt(spread)).mean(axis=0)


def corrections(flight: Flight, found: Navigated) -> np.ndarray:
    """What turned the estimate from one row to the next besides the gyros, rad, (M - 1,).

    Zero but for what measurements correct. Meant for estimates at all inertial samples: across the vertical,
    where Euler angles jump, this does not.
    """
    imu, times = flight.table("imu"), found.nav["time_s"].to_numpy(float)
    rows = np.searchsorted(imu["time_s"].to_numpy(float), times)
    rate = imu[[f"w_{axis}_rad_s" for axis in "xyz"]].to_numpy(float)[rows]
    bias = found.biases[[f"gyro_{axis}_rad_s" for axis in "xyz"]].to_numpy(float)
    felt = (rate[1:] + rate[:-1]) / 2 - bias[1:]
    attitude = Rotation.from_quat(found.nav[["q_w", "q_x", "q_y", "q_z"]].to_numpy(float), scalar_first=True)
    turned = (attitude[:-1].inv() * attitude[1:]).as_rotvec()
    return np.linalg.norm(turned - felt * np.diff(times)[:, None], axis=1)


def rms(values: np.ndarray) -> np.ndarray:
    return np.sqrt((values**2).mean(axis=0))


@pytest.mark.slow
def test_thor_in_the_air(thor):
    flight, found = thor
    mekf = found["mekf"]
    off = rms(euler_differences(flight, mekf, *THOR_AIRBORNE))
    sd = euler_deviations(mekf, *THOR_AIRBORNE)
    assert (off <= [1.0, 0.6, 2.0]).all()
    assert (sd < 2 * off).all()
    assert (off < 2 * sd).all()
    innovations = mekf.innovations
    assert set(innovations["source"]) == {"position", "velocity"}
    assert (innovations["verdict"] == 0).mean() < 0.02
    assert mekf.signs == ()


def test_thor_by_the_observer(thor):
    """With the magnetic field as its second vector, and accelerometers calibrated by the filter's bias."""
    flight, found = thor
    off = rms(euler_differences(flight, found["observer"], *THOR_AIRBORNE))
    assert (off <= [2.0, 1.2, 4.0]).all()


def test_x8_through_loops_and_rolls(shared_data, tmp_path):
    source = shared_data("logs", "inertialnav_x8")
    flight, samples = loaded("inertialnav-x8", source, tmp_path / "flight")
    found = navigate_mekf(flight, samples)
    nav = found.nav
    times = nav["time_s"].to_numpy()
    ours, onboard = poses_at(nav, times)[1], poses_at(flight.nav["onboard"], times)[1]
    known = np.isfinite(onboard[:, 0, 0])
    for begin, end, limit in ((320, 410, 8.0), (410, 515, 12.0)):
        part = (times > begin) & (times < end) & known
        turned = np.degrees(
            np.linalg.norm(matrix_to_rotation_vector(np.swapaxes(onboard[part], 1, 2) @ ours[part]), axis=1)
        )
        assert rms(turned) < limit
    aerobatic = (times > 410) & (times < 515) & known
    assert np.abs(onboard[aerobatic, 2, 0]).max() > 0.95  # near the vertical
    assert onboard[aerobatic, 2, 2].min() < -0.9  # and on its back
    # Through the vertical without a jump: from sample to sample the attitude turns as the gyros say.
    jump = np.degrees(corrections(flight, found)[aerobatic[1:]])
    assert jump.max() < 5.0
