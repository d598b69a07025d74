"""Noise in the units of data sheets."""

import numpy as np
import pytest

from wildlab.navigation.noise import STIM300, ImuNoise, from_data_sheet


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
