"""Thor 75 and X-8 through their recipes: counts, rates, ranges, what the logs hide, and no false alarm."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import scipy.io
from scipy.spatial.transform import Rotation

from tests.sound_logs import NED, QUATERNION
from tests.sound_logs import VELOCITY as SPEED
from wildlab.files import sha256
from wildlab.flight.catalog import read_catalog
from wildlab.flight.checks.check import check_flight, usable_for
from wildlab.flight.checks.inertial import samples as inertial_samples
from wildlab.flight.clocks import gnss_times
from wildlab.flight.importing import import_flight
from wildlab.flight.schema import FORCE, RATE
from wildlab.flight.store import Flight, load_flight
from wildlab.paths import DATA

THOR = "thor_flight75_WaypointTracker_150squareWaypointNew_2012_10_10.mat"


def at_rest(flight: Flight, begin: float, end: float) -> tuple[float, np.ndarray]:
    """Size of the mean force, m/s2, and mean rates, rad/s."""
    imu = flight.table("imu")
    still = imu[imu["time_s"].between(begin, end)]
    return float(np.linalg.norm(still[list(FORCE)].mean())), still[list(RATE)].mean().to_numpy()


def test_thor_is_the_log_where_it_changes(thor, shared_data):
    """Samples but for the first, of zeros; fixes where GPS_TOW changes, but for one without a satellite."""
    log = scipy.io.loadmat(shared_data("logs", "umn_thor75", THOR), simplify_cells=True)["flight_data"]
    changed = np.flatnonzero(np.diff(log["GPS_TOW"])) + 1
    assert len(changed) == 674
    changed = changed[log["satVisible"][changed] > 0]
    gnss, nav = thor.table("gnss"), thor.nav["onboard"]
    np.testing.assert_allclose(gnss["time_s"], log["time"][changed], atol=1e-6)
    np.testing.assert_allclose(gnss["v_east_m_s"], log["ve"][changed])
    np.testing.assert_allclose(thor.table("imu")["time_s"], log["time"][1:], atol=1e-6)
    np.testing.assert_allclose(gnss_times(thor), gnss["time_s"] - 0.04)
    # valid from 24.8 s, but for two seconds in a turn without satellites
    assert nav["time_s"].iloc[0] == pytest.approx(24.8, abs=0.01)
    assert np.diff(nav["time_s"]).max() == pytest.approx(2.02, abs=0.01)


def _import(recipe: str, source: Path, into: Path) -> Flight:
    def state() -> dict[Path, tuple[int, str]]:
        return {path: (path.stat().st_mtime_ns, sha256(path)) for path in source.iterdir()}

    before = state()
    import_flight(DATA / "recipes" / f"{recipe}.toml", source, into)
    assert state() == before
    flight = load_flight(into)
    (used,) = flight.manifest.sources
    assert used.sha256 == before[source / used.file][1]
    assert read_catalog()[recipe].files[0].sha256 == used.sha256
    return flight


@pytest.fixture(scope="module")
def thor(shared_data: Callable[..., Path], tmp_path_factory: pytest.TempPathFactory) -> Flight:
    folder = tmp_path_factory.mktemp("thor") / "flight"
    return _import("umn-thor75", shared_data("logs", "umn_thor75"), folder)


@pytest.fixture(scope="module")
def x8(shared_data: Callable[..., Path], tmp_path_factory: pytest.TempPathFactory) -> Flight:
    folder = tmp_path_factory.mktemp("x8") / "flight"
    return _import("inertialnav-x8", shared_data("logs", "inertialnav_x8"), folder)


def _gyro_fits(flight: Flight, begin: float, end: float) -> np.ndarray:
    """Correlation of the rates with those of the onboard attitude, each axis, while flying."""
    (nav,) = flight.nav.values()
    nav = nav[nav["time_s"].between(begin, end)].iloc[::10]
    t, R = nav["time_s"].to_numpy(), Rotation.from_quat(nav[QUATERNION].to_numpy(), scalar_first=True)
    turned = (R[:-1].inv() * R[1:]).as_rotvec() / np.diff(t)[:, None]
    rate = inertial_samples(flight).mean(RATE, t[:-1], t[1:])
    good = np.isfinite(rate).all(axis=1)
    return np.array([np.corrcoef(rate[good, i], turned[good, i])[0, 1] for i in range(3)])


def test_thor_ranges(thor):
    gnss, nav = thor.table("gnss"), thor.nav["onboard"]
    for table in (gnss, nav):
        assert np.abs(table[NED].to_numpy()).max() < 400  # degrees and radians both ended up there
    assert np.hypot(gnss[SPEED[0]], gnss[SPEED[1]]).max() == pytest.approx(26.4, abs=0.5)
    assert gnss["down_m"].min() == pytest.approx(-74, abs=2)
    # away from the start, where the receiver was still settling
    assert nav.loc[nav["time_s"] > 60, "down_m"].max() < 2
    assert at_rest(thor, 640, 690)[0] == pytest.approx(9.81, abs=0.1)
    assert (_gyro_fits(thor, 212, 579) > [0.98, 0.97, 0.88]).all()


def test_thor_has_the_raw_sensor(thor):
    """With the biases back, every sample is a whole number of the sensor's steps: 0.05 deg/s and 3.33 mg."""
    imu = thor.table("imu")
    for columns, step in ((RATE, np.radians(0.05)), (FORCE, 0.00333 * 9.814)):
        steps = imu[list(columns)].to_numpy() / step
        assert np.abs(steps - np.round(steps)).max() < 1e-3


def test_x8_ranges(x8):
    gnss, nav = x8.table("gnss"), x8.nav["onboard"]
    assert len(gnss) == 3049  # 3050 less the one that is logged twice
    assert np.diff(gnss["time_s"]).max() < 0.6  # the hole of 2.5 s is in the receiver's own stamps alone
    # The attitude ends 0.22 s after the last position, latency taken off.
    assert nav["time_s"].iloc[-1] == pytest.approx(gnss_times(x8)[-1], abs=0.02)
    assert np.hypot(gnss[SPEED[0]], gnss[SPEED[1]]).max() == pytest.approx(32.15, abs=0.1)
    assert np.abs(gnss[NED[:2]].to_numpy()).max() < 300
    force, rates = at_rest(x8, 20, 45)
    assert force == pytest.approx(9.65, abs=0.05) and np.abs(rates).max() < 0.005
    assert (_gyro_fits(x8, 280, 590) > 0.99).all()
    # attitudes through the vertical stay a rotation each
    R = Rotation.from_quat(nav[QUATERNION].to_numpy(), scalar_first=True)
    assert np.degrees((R[:-1].inv() * R[1:]).magnitude()).max() < 20


def test_x8_velocity_is_that_of_its_positions(x8):
    """The course in degrees, the vertical downwards: else speeds and positions would disagree."""
    gnss = x8.table("gnss")
    v = gnss[SPEED].to_numpy()
    moved = np.diff(gnss[NED].to_numpy(), axis=0)[5:]
    meant = ((v[1:] + v[:-1]) / 2 * np.diff(gnss["time_s"])[:, None])[5:]
    for i in range(3):
        assert np.corrcoef(moved[:, i], meant[:, i])[0, 1] > 0.95
    assert np.polyfit(meant.ravel(), moved.ravel(), 1)[0] == pytest.approx(1, abs=0.06)


@pytest.mark.parametrize("name", ["thor", "x8"])
def test_no_false_alarm(name, request):
    flight: Flight = request.getfixturevalue(name)
    found = check_flight(flight)
    assert [one for one in found if one.table in ("imu", "gnss", "nav/onboard")] == []
    said = [one.field for one in found if one.level != "note"]
    assert said == []  # that the heights of the X-8 are above sea level changes no result: a note
    assert [use.usable for use in usable_for(flight)] == [False, False, True]
