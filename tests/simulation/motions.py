"""What several tests of the simulation fly: trajectories with wind, control errors and gusts."""

import numpy as np

from wildlab.simulation.courses import (
    ControlErrors,
    Laps,
    filleted_course,
    laps_path,
    loiter_path,
    shape_corners,
    twin_trajectory,
)
from wildlab.simulation.parameters import load_twin
from wildlab.simulation.trajectory import band_limited_disturbance, fixed_wing_trajectory

WIND = np.array([4.0, -3.0, 0.0])
LAPS_WIND = np.array([-3.2, -3.2, 0.0])  # 4.5 m/s from the north-east
ALTITUDE = [[0.0, 200.0], [100.0, 200.0], [160.0, 300.0]]


def restless_loiter(turn="clockwise"):
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


def restless_laps(shape):
    """A course with wind, drift, climb, control errors and gusts, all on: its trajectory."""
    rng = np.random.default_rng(5)
    course = filleted_course(shape_corners(shape, 500.0, 400.0), 80.0)
    laps = Laps(course, 19.5, 400.0, wind=LAPS_WIND[:2], drift=(0.5, -0.3), start=0.2)
    errors = ControlErrors(*(band_limited_disturbance(sd, 20.0, 120.0, rng) for sd in (3.0, 3.0, 2.0)))
    path = laps_path(laps, ALTITUDE, errors)
    gusts = tuple(band_limited_disturbance(np.radians(sd), 2.0, 9.0, rng) for sd in (1.5, 1.0, 1.0))
    return fixed_wing_trajectory(path, wind=LAPS_WIND, trim_pitch=np.radians(2.0), gusts=gusts)


def flown(name):
    """The trajectory of a packaged twin."""
    return twin_trajectory(load_twin(name), np.random.default_rng(1))
