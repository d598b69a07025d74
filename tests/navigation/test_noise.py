"""Noise in the units of data sheets, and what a flight's own motion adds to it."""

import numpy as np
import pytest

from wildlab.navigation.noise import STIM300, ImuNoise, from_data_sheet, with_axis_errors
from wildlab.navigation.timeline import Imu
from wildlab.simulation.sensors import gauss_markov


def test_data_sheet_units():
    assert STIM300.velocity_random_walk * np.sqrt(3600) == pytest.approx(0.07)
    assert np.degrees(STIM300.angle_random_walk) * np.sqrt(3600) == pytest.approx(0.15)
    assert np.degrees(STIM300.gyro_bias_sd) * 3600 == pytest.approx(0.3)
    sheet = from_data_sheet(
        velocity_random_walk=0.6,
        angle_random_walk_deg=6,
        accelerometer_bias=0.1,
        gyro_bias_deg=3600,
        bias_time=50,
    )
    assert sheet == pytest.approx(ImuNoise(0.01, np.radians(0.1), 0.1, 50, np.radians(1), 50))


def test_axis_errors_have_the_density_of_the_motion():
    """For motion that is of first order the density is known: the error's variance times twice its time."""
    times = np.arange(0, 2000, 0.02)
    rng = np.random.default_rng(0)
    force = gauss_markov(len(times), 0.02, 3.0, np.full(3, 0.5), rng) - np.array([0, 0, 9.81])
    rate = gauss_markov(len(times), 0.02, 0.4, np.full(3, 0.2), rng)
    noise = with_axis_errors(ImuNoise(0, 0, 1, 2, 3, 4), Imu(times, force, rate), 0.01, 0.02)
    assert noise.velocity_random_walk == pytest.approx(0.01 * 3.0 * np.sqrt(2 * 0.5), rel=0.1)
    assert noise.angle_random_walk == pytest.approx(0.02 * 0.4 * np.sqrt(2 * 0.2), rel=0.1)
    assert noise[2:] == (1, 2, 3, 4)
    sheet = ImuNoise(0.3, 0.4, 1, 2, 3, 4)
    assert with_axis_errors(sheet, Imu(times, force, rate), 0.0, 0.0) == pytest.approx(sheet)
