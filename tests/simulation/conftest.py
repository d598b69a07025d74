"""What several tests of the simulation fly."""

from __future__ import annotations

import numpy as np
import pytest

from wildlab.simulation.trajectory import attitude_of, loiter, random_wander

WIND = np.array([4.0, -3.0, 0.0])


def _restless_loiter(turn="clockwise"):
    """A loiter with wind, wander and sway, all on: (path, attitude)."""
    rng = np.random.default_rng(7)
    path = loiter(
        (30.0, -50.0),
        160.0,
        350.0,
        19.5,
        wind=WIND[:2],
        turn=turn,
        start_angle=0.3,
        radius_wander=random_wander(3.0, 20.0, 120.0, rng),
        altitude_wander=random_wander(2.0, 20.0, 120.0, rng),
    )
    sway = tuple(random_wander(np.radians(sd), 2.0, 9.0, rng) for sd in (1.5, 1.0, 1.0))
    return path, attitude_of(path, wind=WIND, trim_pitch=np.radians(2.0), sway=sway)


@pytest.fixture
def restless_loiter():
    """The function that makes such a flight."""
    return _restless_loiter
