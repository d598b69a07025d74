"""Logged flights: the pose from IMU and GPS against the one that was computed on board.

The latency of the GPS is the one under which its own measurements are likeliest. The noise is that of data
sheets, with one freedom: which temperature drift stands behind the biases was settled with the comparison in
sight, next to the likelihood's own optimum. All figures of a flight are from one setting.
"""

import numpy as np
import pytest

from tests.navigation.logs import thor75, x8
from wildlab.geometry.frames import (
    euler_errors_to_body,
    matrix_to_euler,
    matrix_to_rotation_vector,
    quaternion_to_matrix,
)  # fmt: skip
from wildlab.geometry.gravity import local_earth
from wildlab.navigation.aiding import positions, velocities
from wildlab.navigation.mekf import REJECTED, log_likelihood, run_mekf
from wildlab.navigation.noise import ImuNoise, with_axis_errors
from wildlab.navigation.observer import field_reference, run_observer
from wildlab.navigation.start import start_at_rest
from wildlab.navigation.timeline import Imu

LATENCIES = np.arange(0.0, 0.45, 0.05)


def between(log, begin, end):
    return (log.imu.times >= begin) & (log.imu.times < end)


def noise_in(log, sheet, errors, begin, end):
    return with_axis_errors(sheet, Imu(*(part[between(log, begin, end)] for part in log.imu)), *errors)


def aiding_of(log, latency, position_sd, velocity_sd):
    return [
        positions(log.times, log.p_n, position_sd, latency=latency),
        velocities(log.times, log.v_n, velocity_sd, latency=latency),
    ]


def navigate(log, noise, rest, airborne, position_sd, velocity_sd):
    """The MEKF with the likeliest latency; also the start and the aiding, for the observer."""
    earth = local_earth(log.origin[0], log.origin[2])

    def run(latency):
        start = start_at_rest(
            log.imu,
            log.times - latency,
            log.p_n,
            log.v_n,
            rest=rest,
            gravity=earth.gravity,
            gyro_bias_sd=0.005,
        )
        aiding = aiding_of(log, latency, position_sd, velocity_sd)
        return run_mekf(log.imu, start, noise, earth, aiding, max_gap=0.2), start, aiding

    likely = [log_likelihood(run(latency)[0].innovations, airborne) for latency in LATENCIES]
    latency = float(LATENCIES[int(np.argmax(likely))])
    return *run(latency), latency


def euler_errors(found, log, part):
    off = matrix_to_euler(quaternion_to_matrix(found.quaternion[part])) - matrix_to_euler(log.onboard[part])
    return np.degrees((off + np.pi) % (2 * np.pi) - np.pi)


def rms(errors):
    return np.sqrt((errors**2).mean(axis=0))


def euler_sd(found, part):
    """Mean estimated standard deviations of roll, pitch and yaw, deg."""
    angles = matrix_to_euler(quaternion_to_matrix(found.quaternion[part]))
    to_euler = np.linalg.inv(euler_errors_to_body(angles[:, 0], angles[:, 1]))
    spread = np.einsum("kij,kjl,kil->ki", to_euler, found.covariance[part, 6:9, 6:9], to_euler)
    return np.degrees(np.sqrt(spread)).mean(axis=0)


# ADIS16405: 2 deg/sqrt(h) and 0.2 m/s/sqrt(h); biases move by 0.01 deg/s and 0.3 mg per kelvin, of which
# thirty are allowed for; that this takes minutes is an assumption. Scale factors 1 %, axes to frame 0.5 deg.
ADIS16405 = ImuNoise(0.2 / 60, np.radians(2.0) / 60, 0.3e-3 * 9.81 * 30, 300.0, np.radians(0.01) * 30, 300.0)
ADIS16405_AXES = (float(np.hypot(0.01, np.radians(0.5))),) * 2
THOR_AIRBORNE = (212.0, 579.0)


@pytest.fixture(scope="module")
def thor(shared_data):
    log = thor75(shared_data("logs", "umn_thor75"))
    noise = noise_in(log, ADIS16405, ADIS16405_AXES, *THOR_AIRBORNE)
    return log, navigate(log, noise, (125.0, 155.0), THOR_AIRBORNE[0], (2.5, 2.5, 5.0), (0.2, 0.2, 0.4))


def test_thor_attitude_from_imu_and_gps_alone(thor):
    log, (found, _, _, latency) = thor
    whole = between(log, *THOR_AIRBORNE)
    # Standing on the runway, where GPS shows no heading, ours and the onboard one are 20 deg apart. They come
    # together in the first minute in the air.
    settled = between(log, THOR_AIRBORNE[0] + 60, THOR_AIRBORNE[1])
    error, sd = rms(euler_errors(found, log, settled)), euler_sd(found, settled)
    print(f"latency {latency:.2f} s; after a minute: rms {error.round(2)} deg, sd {sd.round(2)} deg")
    all_of_it = rms(euler_errors(found, log, whole))
    print(f"whole flight: rms {all_of_it.round(2)} deg, sd {euler_sd(found, whole).round(2)} deg")
    assert (error <= [1.0, 0.6, 2.0]).all()
    assert (sd < 2 * error).all()
    assert (error < 2 * sd).all()
    assert (all_of_it <= [1.0, 0.6, 2.5]).all()
    assert (found.innovations.verdict == REJECTED).mean() < 0.02


def test_thor_takes_off_along_its_nose(thor):
    """Whose heading is right at the start: rolling on the runway, an airframe goes where it points."""
    log, (found, _, _, latency) = thor
    speed = np.hypot(log.v_n[:, 0], log.v_n[:, 1])
    first = int(np.flatnonzero((speed > 10) & (log.times > 200))[0])
    row = int(np.argmin(np.abs(log.imu.times - (log.times[first] - latency))))
    course = np.arctan2(log.v_n[first, 1], log.v_n[first, 0])
    yaw = [matrix_to_euler(R)[2] for R in (quaternion_to_matrix(found.quaternion[row]), log.onboard[row])]
    ours, onboard = np.degrees(np.abs(np.angle(np.exp(1j * (np.array(yaw) - course)))))
    print(f"off the course of the take-off roll: ours {ours:.1f} deg, onboard {onboard:.1f} deg")
    assert ours < 5.0


def test_thor_observer_with_magnetometer(thor):
    """Hard iron from a sphere through the field as it was measured in the air; inclination of the place."""
    log, (_, start, aiding, _) = thor
    airborne = between(log, *THOR_AIRBORNE)
    m = log.field[airborne]
    fit = np.linalg.lstsq(np.column_stack([2 * m, np.ones(len(m))]), (m**2).sum(axis=1), rcond=None)[0]
    dip, declination = np.radians(72.0), np.radians(0.4)  # Minnesota in 2012
    field_n = [np.cos(dip) * np.cos(declination), np.cos(dip) * np.sin(declination), np.sin(dip)]
    second = field_reference(log.imu.times, log.field - fit[:3], field_n)
    found = run_observer(log.imu, start, log.origin, [*aiding, second])
    error = rms(euler_errors(found, log, airborne))
    print(f"observer: rms {error.round(2)} deg")
    assert (error <= [2.0, 1.2, 4.0]).all()


# MPU-6000: 0.005 deg/s/sqrt(Hz), 400 ug/sqrt(Hz); biases over temperature after calibration, by order of
# size; scale factors and cross-axis sensitivity 3 % and 2 % as delivered, of which calibration leaves about a
# third.
MPU6000 = ImuNoise(400e-6 * 9.81, np.radians(0.005), 0.2, 300.0, np.radians(0.5), 300.0)
MPU6000_AXES = (0.012, 0.012)
X8_CALM, X8_AEROBATIC = (320.0, 410.0), (410.0, 515.0)


def test_x8_goes_through_loops_and_rolls(shared_data):
    log = x8(shared_data("logs", "inertialnav_x8"))
    noise = noise_in(log, MPU6000, MPU6000_AXES, 255.0, 580.0)
    found, _, _, latency = navigate(log, noise, (80.0, 180.0), 255.0, (2.5, 2.5, 5.0), (0.3, 0.3, 0.5))
    assert np.isfinite(found.quaternion[log.imu.times >= 140]).all()
    print(f"latency {latency:.2f} s")
    R = quaternion_to_matrix(found.quaternion)
    turned = np.degrees(
        np.linalg.norm(matrix_to_rotation_vector(np.swapaxes(log.onboard, -1, -2)[7000:] @ R[7000:]), axis=1)
    )
    t = log.imu.times[7000:]
    for name, (begin, end), limit in (("calm", X8_CALM, 6.0), ("aerobatic", X8_AEROBATIC, 12.0)):
        off = turned[(t >= begin) & (t < end)]
        print(f"{name}: attitude {np.sqrt((off**2).mean()):.1f} deg rms, {off.max():.1f} deg at most")
        assert np.sqrt((off**2).mean()) < limit
    assert np.abs(log.onboard[:, 2, 0]).max() > 0.95  # near the vertical
    assert (log.onboard[:, 2, 2]).min() < -0.9  # and on its back
    # Through the vertical without a jump: from sample to sample the attitude turns as the gyros say.
    flown = np.flatnonzero(between(log, *X8_AEROBATIC))[1:]
    step = matrix_to_rotation_vector(np.swapaxes(R[flown - 1], -1, -2) @ R[flown])
    dt = np.diff(log.imu.times)[flown - 1, None]
    mean_rate = (log.imu.angular_rate[flown] + log.imu.angular_rate[flown - 1]) / 2
    jump = np.linalg.norm(step - dt * (mean_rate - found.gyro_bias[flown]), axis=1)
    print(f"largest correction {np.degrees(jump).max():.2f} deg")
    assert np.degrees(jump).max() < 5.0
    inside = between(log, 255.0, 575.0)
    fixes = (log.times > 255) & (log.times < 575)
    valid = log.times[fixes] - latency
    p = np.stack([np.interp(valid, log.imu.times, column) for column in found.position.T], axis=-1)
    assert np.percentile(np.linalg.norm(p - log.p_n[fixes], axis=1), 95) < 6.0
    assert np.degrees(np.sqrt(found.covariance[inside, 6:9, 6:9].trace(axis1=1, axis2=2))).max() < 12.0
