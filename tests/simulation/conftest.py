"""What several tests of the simulation fly."""

from __future__ import annotations

import numpy as np
import pytest

from wildlab.simulation.attitudes import fixed_wing_trajectory
from wildlab.simulation.disturbances import band_limited_disturbance
from wildlab.simulation.loiter import loiter_path

WIND = np.array([4.0, -3.0, 0.0])


def _restless_loiter(turn="clockwise"):
    """A loiter with wind, control errors and gusts, all on: its trajectory."""
    rng = np.random.default_rng(7)
    path = loiter_path(
        (30.0, -50.0),
        160.0,
        350.0,
        19.5,
        wind=WIND[:2],
        turn=turn,
        start_angle=0.3,
        radius_error=band_limited_disturbance(3.0, 20.0, 120.0, rng),
        altitude_error=band_limited_disturbance(2.0, 20.0, 120.0, rng),
    )
    gusts = tuple(band_limited_disturbance(np.radians(sd), 2.0, 9.0, rng) for sd in (1.5, 1.0, 1.0))
    return fixed_wing_trajectory(path, wind=WIND, trim_pitch=np.radians(2.0), gusts=gusts)


@pytest.fixture
def restless_loiter():
    """The function that makes such a flight."""
    return _restless_loiter
