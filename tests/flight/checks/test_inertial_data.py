"""Means over intervals of inertial samples, against closed forms."""

from __future__ import annotations

import numpy as np
import pandas as pd
from hypothesis import given
from hypothesis import strategies as st

from wildlab.flight.checks.inertial_data import FORCE, RATE, Inertial, samples

TIMES = np.cumsum(np.concatenate([[2.0], 0.01 + 0.005 * np.sin(np.arange(400))]))


def ramps(offset: float, slope: float) -> Inertial:
    """Columns ``(k + 1) (offset + slope t)``: forces k = 0 to 2, rates k = 3 to 5."""
    columns = {name: (k + 1) * (offset + slope * TIMES) for k, name in enumerate((*FORCE, *RATE))}
    return Inertial(TIMES, columns)


@given(st.floats(-10, 10), st.floats(-5, 5), st.floats(2.01, 4.0), st.floats(0.1, 1.5))
def test_the_mean_of_a_ramp_is_its_value_in_the_middle(offset, slope, start, length):
    imu, end = ramps(offset, slope), start + length
    begin, stop = TIMES[[np.searchsorted(TIMES, at) for at in (start, end)]]
    middle = offset + slope * (begin + stop) / 2
    for asked, factors in (
        (imu.mean_force, [1, 2, 3]),
        (imu.mean_rate, [4, 5, 6]),
        (imu.mean_force, [1, 2, 3]),
    ):
        found = asked(np.array([begin, 0.0, begin]), np.array([stop, stop, 99.0]))
        np.testing.assert_allclose(found[0], middle * np.array(factors), atol=1e-9)
        assert np.isnan(found[1:]).all()


def test_sizes_and_mean_of_forces():
    imu = ramps(1.0, 0.5)
    ramp = 1.0 + 0.5 * TIMES
    np.testing.assert_allclose(imu.sizes_of_forces(), np.sqrt(1 + 4 + 9) * ramp)
    np.testing.assert_allclose(imu.mean_of_forces(), ramp.mean() * np.array([1, 2, 3]))


def test_samples_without_a_number_are_left_out():
    class Flight:
        imu = pd.DataFrame({"time_s": TIMES, **{name: 1.0 + 0 * TIMES for name in (*FORCE, *RATE)}})

    Flight.imu.loc[5, "w_y_rad_s"] = np.nan
    found = samples(Flight())
    assert found is not None and len(found.times) == len(TIMES) - 1 and TIMES[5] not in found.times
    Flight.imu.loc[7, "time_s"] = TIMES[3]
    assert samples(Flight()) is None
