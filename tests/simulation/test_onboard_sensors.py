"""What sensors on board write down: a unit without errors feels the payload move on the turning Earth."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest
from scipy.spatial.transform import Rotation

from tests.simulation.test_twins import with_values
from wildlab.flight.files import read_toml
from wildlab.geometry.gravity import EARTH_RATE, normal_gravity
from wildlab.simulation.imu import TriadDataSheet, triad_data_sheets
from wildlab.simulation.onboard_sensors import as_mounted, imu_table, mounted_imu, payload_boresight
from wildlab.simulation.parameters import PARTS, TwinParameters, load_twin
from wildlab.simulation.sensor_parameters import Imu
from wildlab.simulation.trajectory import angular_rates, attitude_along, turned
from wildlab.simulation.twin_trajectory import twin_trajectory
from wildlab.simulation.twins import simulate

FORCE, RATE = [f"f_{axis}_m_s2" for axis in "xyz"], [f"w_{axis}_rad_s" for axis in "xyz"]
#: Figures of a data sheet that make an inertial unit err.
ERRORS = [
    f"{triad}_{figure}"
    for triad in ("accelerometer", "gyro")
    for figure in ("random_walk", "bias_stability", "turn_on_bias", "resolution")
] + ["axis_misalignment", "package_misalignment"]


@pytest.fixture(scope="module")
def exact() -> TwinParameters:
    """Twenty seconds of a flight whose inertial unit does not err."""
    errors = {f"imu__{name}": 0.0 for name in ERRORS}
    return with_values(load_twin("static-antenna"), flight__duration=20.0, **errors)


def test_a_unit_without_errors_feels_the_payload_move_on_the_turning_earth(exact):
    """Against the motion, the Earth's rate and gravity by their own formulas (WGS84)."""
    seed = 4
    airframe, boresight = twin_trajectory(exact, np.random.default_rng(0)), payload_boresight(exact, seed)

    def payload(times):
        return turned(airframe(times), boresight)

    table = imu_table(exact, payload, seed)
    motion = payload(table["time_s"].to_numpy())
    R = motion.R_nb
    latitude, height = np.radians(exact.place.latitude.number), exact.place.height.number
    assert 60 < np.degrees(latitude) < 65
    spin = EARTH_RATE * np.array([np.cos(latitude), 0.0, -np.sin(latitude)])
    rate = np.einsum("nij,nj->ni", R, table[RATE].to_numpy())
    against_n = np.einsum("nij,nj->ni", R, angular_rates(attitude_along(payload), motion.times))
    assert np.abs(rate - against_n - spin).max() < 1e-7
    force = np.einsum("nij,nj->ni", R, table[FORCE].to_numpy())
    pull = motion.acceleration + 2 * np.cross(spin, motion.velocity) - force
    assert pull[:, 2] == pytest.approx(normal_gravity(latitude, height - motion.position[:, 2]), abs=2e-6)
    # The plumb line leans towards where n's origin is below: by the distance over the Earth's radius.
    assert pull[:, :2] == pytest.approx(-9.82 / 6371e3 * motion.position[:, :2], abs=1e-6)
    # On the airframe itself, which the payload turns against, it would feel something else.
    assert np.abs(against_n - np.einsum(
        "nij,nj->ni", airframe(motion.times).R_nb, angular_rates(attitude_along(airframe), motion.times)
    )).max() > 1e-4  # fmt: skip


def test_a_flight_has_the_readings_of_the_unit_on_the_payload(exact):
    """Its attitude at the end is the one at the start carried on by its gyros, less the Earth's turning."""
    short = with_values(exact, camera__images=100, camera__recording_start=1.0, target__observations=0)
    flight = simulate(short, 4)
    imu = flight.table("imu")
    w, t = imu[RATE].to_numpy(), imu["time_s"].to_numpy()
    steps = Rotation.from_rotvec((w[1:] + w[:-1]) / 2 * np.diff(t)[:, None])
    truth = flight.nav["truth-payload"]
    q = truth[["q_w", "q_x", "q_y", "q_z"]].to_numpy()
    first, last = Rotation.from_quat(q[[0, -1]], scalar_first=True)
    turn = Rotation.identity()
    for step in steps:
        turn = turn * step
    latitude = np.radians(exact.place.latitude.number)
    spin = EARTH_RATE * np.array([np.cos(latitude), 0.0, -np.sin(latitude)])
    carried = Rotation.from_rotvec(-spin * (t[-1] - t[0])) * first * turn
    assert truth["time_s"].iloc[[0, -1]].to_numpy() == pytest.approx([t[0], t[-1]])
    assert (carried.inv() * last).magnitude() < 2e-5
    assert np.linalg.norm(spin * 20) > 1e-3, "the Earth's turning shows"


def test_the_unit_feels_and_errs_in_its_own_axes_and_is_then_calibrated(exact):
    """Steps of a coarse resolution lie along the axes of the unit, as it is mounted, and not along b."""
    airframe = twin_trajectory(exact, np.random.default_rng(0))
    coarse = with_values(exact, imu__accelerometer_resolution=50.0, imu__gyro_resolution=0.5)
    fine, rough = imu_table(exact, airframe, 4), imu_table(coarse, airframe, 4)
    R_bi, unit = mounted_imu(exact), coarse.imu
    assert R_bi is not None and unit is not None
    expected = Rotation.from_euler("ZYX", [0.25, -5.7, 1.1], degrees=True).as_matrix()
    assert R_bi == pytest.approx(expected, abs=1e-12)
    own = as_mounted(rough, R_bi)
    sizes = unit.accelerometer_resolution.si, unit.gyro_resolution.si
    for columns, step in zip((FORCE, RATE), sizes, strict=True):
        steps = own[columns].to_numpy() / step
        assert steps == pytest.approx(np.round(steps), abs=1e-8)
        calibrated = rough[columns].to_numpy()
        assert calibrated == pytest.approx(fine[columns].to_numpy(), abs=step)
        assert np.abs(calibrated / step - np.round(calibrated / step)).max() > 0.1
        # What the unit gives is the vector of b in its own axes.
        assert as_mounted(fine, R_bi)[columns].to_numpy() == pytest.approx(
            fine[columns].to_numpy() @ expected
        )
    pd.testing.assert_series_equal(own["time_s"], rough["time_s"])


@pytest.mark.parametrize("figure", sorted(Imu.model_fields))
def test_each_figure_of_a_data_sheet_goes_to_its_own_triad(figure):
    imu = Imu.model_validate(read_toml(PARTS / "imu-stim300.toml", "an IMU")["imu"])
    before = triad_data_sheets(imu)
    parameter = getattr(imu, figure)
    if not isinstance(parameter.value, float | int):
        return
    changed = imu.model_copy(update={figure: parameter.model_copy(update={"value": 3 * parameter.value})})
    after = triad_data_sheets(changed)
    moved = {
        (triad, field)
        for triad, old, new in zip(("accelerometer", "gyro"), before, after, strict=True)
        for field in TriadDataSheet._fields
        if getattr(old, field) != getattr(new, field)
    }
    triad, _, rest = figure.partition("_")
    field = {"range": "limit"}.get(rest, rest)
    if figure == "rate":
        expected = set()
    elif triad in ("accelerometer", "gyro"):
        expected = {(triad, field)}
    else:
        expected = {("accelerometer", figure), ("gyro", figure)}
    assert moved == expected
    for which, name in moved:
        index = ("accelerometer", "gyro").index(which)
        assert getattr(after[index], name) == pytest.approx(3 * getattr(before[index], name))
