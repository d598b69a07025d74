"""From logs to poses with covariance: recipe, import, filters, against the attitude found on board.

Inertial sensor and GPS alone; noise from the recipe, and nothing tuned to the attitude that is compared with.
The onboard attitudes are estimates too.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from wildlab.flight.clocks import covariances, gnss_times, poses_at
from wildlab.flight.recipe.importing import import_flight
from wildlab.flight.store import Flight, load_flight
from wildlab.geometry.frames import (
    matrix_to_euler,
    matrix_to_rotation_vector,
    rotation_vector_to_matrix,
    wrap,
)
from wildlab.paths import DATA
from wildlab.pipeline.navigate import Navigated, likelihoods_of_latency
from wildlab.pipeline.navigation_errors import corrections, navigate_all

#: In the air, by speed and height.
THOR_AIRBORNE = (212.0, 579.0)


def loaded(recipe: str, source: Path, into: Path) -> tuple[Flight, dict[str, Navigated]]:
    import_flight(DATA / "recipes" / f"{recipe}.toml", source, into)
    flight = load_flight(into)
    return flight, navigate_all(flight, flight.table("imu")["time_s"].to_numpy())


@pytest.fixture(scope="module")
def thor(shared_data: Callable[..., Path], tmp_path_factory: pytest.TempPathFactory):
    return loaded("umn-thor75", shared_data("logs", "umn_thor75"), tmp_path_factory.mktemp("thor") / "flight")


@pytest.fixture(scope="module")
def x8(shared_data: Callable[..., Path], tmp_path_factory: pytest.TempPathFactory):
    source = shared_data("logs", "inertialnav_x8")
    return loaded("inertialnav-x8", source, tmp_path_factory.mktemp("x8") / "flight")


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


def rms(values: np.ndarray) -> np.ndarray:
    return np.sqrt((values**2).mean(axis=0))


def test_thor_in_the_air(thor) -> None:
    flight, found = thor
    off = rms(euler_differences(flight, found["mekf"], *THOR_AIRBORNE))
    sd = euler_deviations(found["mekf"], *THOR_AIRBORNE)
    print(f"filter: {off.round(2)} deg, it states {sd.round(2)} deg")
    assert (off <= [1.0, 0.6, 2.0]).all()
    assert (sd < 2 * off).all()
    assert (off < 2 * sd).all()
    innovations = found["mekf"].innovations
    assert set(innovations["source"]) == {"position", "velocity"}
    assert (innovations["verdict"] == 0).mean() < 0.02
    assert found["mekf"].signs == ()


def test_thor_by_the_observer(thor) -> None:
    """With the magnetic field as its second vector, and accelerometers calibrated by the filter's bias."""
    flight, found = thor
    off = rms(euler_differences(flight, found["observer"], *THOR_AIRBORNE))
    print(f"observer: {off.round(2)} deg")
    assert (off <= [2.0, 1.2, 4.0]).all()


def test_thor_has_the_latency_that_its_own_fixes_make_likeliest(thor) -> None:
    flight, _ = thor
    latencies = np.arange(0.0, 0.13, 0.01)
    likeliest = latencies[np.argmax(likelihoods_of_latency(flight, latencies))]
    assert flight.manifest.gnss.latency_s == pytest.approx(likeliest, abs=0.011)


def test_thor_takes_off_along_its_nose(thor) -> None:
    """Whose heading is right at the start: rolling on the runway, an airframe goes where it points."""
    flight, found = thor
    fixes, times = flight.table("gnss"), gnss_times(flight)
    v = fixes[["v_north_m_s", "v_east_m_s"]].to_numpy()
    first = int(np.flatnonzero((np.hypot(*v.T) > 10) & (times > 200))[0])
    course = np.arctan2(v[first, 1], v[first, 0])
    yaw = matrix_to_euler(poses_at(found["mekf"].nav, times[[first]])[1])[0, 2]
    assert abs(np.degrees(np.angle(np.exp(1j * (yaw - course))))) < 3.0


def test_x8_through_loops_and_rolls(x8) -> None:
    flight, found = x8
    nav = found["mekf"].nav
    times = nav["time_s"].to_numpy()
    ours, onboard = poses_at(nav, times)[1], poses_at(flight.nav["onboard"], times)[1]
    known = np.isfinite(onboard[:, 0, 0])
    for begin, end, limit in ((320, 410, 8.0), (410, 515, 12.0)):
        part = (times > begin) & (times < end) & known
        turned = np.degrees(
            np.linalg.norm(matrix_to_rotation_vector(np.swapaxes(onboard[part], 1, 2) @ ours[part]), axis=1)
        )
        print(f"{begin} to {end} s: {rms(turned):.1f} deg rms, {turned.max():.1f} deg at most")
        assert rms(turned) < limit
    aerobatic = (times > 410) & (times < 515) & known
    assert np.abs(onboard[aerobatic, 2, 0]).max() > 0.95  # near the vertical
    assert onboard[aerobatic, 2, 2].min() < -0.9  # and on its back
    # Through the vertical without a jump: from sample to sample the attitude turns as the gyros say.
    jump = np.degrees(corrections(flight, found["mekf"])[aerobatic[1:]])
    print(f"largest correction {jump.max():.2f} deg")
    assert jump.max() < 5.0


def test_x8_stays_where_its_receiver_is(x8) -> None:
    flight, found = x8
    t = gnss_times(flight)
    flying = (t > 255) & (t < 575)
    p = poses_at(found["mekf"].nav, t[flying])[0]
    off = np.linalg.norm(p - flight.table("gnss")[["north_m", "east_m", "down_m"]].to_numpy()[flying], axis=1)
    assert np.percentile(off, 95) < 6.0
    # At every sample there is an estimate, and the filter never says that it has no idea of its attitude.
    samples, nav = flight.table("imu")["time_s"].between(255, 575), found["mekf"].nav
    during = nav[nav["time_s"].between(255, 575)]
    assert len(during) == samples.sum()
    P = covariances(during)
    assert P is not None
    assert np.degrees(np.sqrt(P[:, 3:, 3:].trace(axis1=1, axis2=2))).max() < 12.0
