"""Two logged fixed wings with an attitude to compare with, out of the files as they were published."""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

import numpy as np
import scipy.io

from wildlab.geometry.frames import euler_to_matrix, geodetic_to_ned
from wildlab.navigation.timeline import Imu


class Log(NamedTuple):
    """Inertial samples; fixes (times, positions, velocities in n); the onboard attitude and the field (b) at
    the
    inertial samples or, for the field, NaN; the origin of n."""

    imu: Imu
    times: np.ndarray
    p_n: np.ndarray
    v_n: np.ndarray
    onboard: np.ndarray
    field: np.ndarray
    origin: tuple[float, float, float]


def thor75(folder: Path) -> Log:
    """Ultra Stick at 50 Hz with GPS at 1 Hz; the onboard attitude is that of its own filter of IMU and
    GPS."""
    name = "thor_flight75_WaypointTracker_150squareWaypointNew_2012_10_10.mat"
    data = scipy.io.loadmat(folder / name, squeeze_me=True, struct_as_record=False)["flight_data"]

    def columns(*names: str) -> np.ndarray:
        return np.stack([np.asarray(getattr(data, name), float) for name in names], axis=-1)

    t = columns("time")[:, 0]
    fixes = np.flatnonzero(np.diff(columns("GPS_TOW")[:, 0], prepend=0) != 0)
    place = columns("lat", "lon", "alt")[fixes]
    place[:, :2] = np.radians(place[:, :2])
    origin = tuple(float(x) for x in place[len(place) // 2])
    # The magnetometer's y and z point the other way; the field there points north and down.
    field = columns("hx", "hy", "hz") * [1.0, -1.0, -1.0]
    imu = Imu(t, columns("ax", "ay", "az"), columns("p", "q", "r"))
    p_n, v_n = geodetic_to_ned(*place.T, origin), columns("vn", "ve", "vd")[fixes]
    return Log(imu, t[fixes], p_n, v_n, euler_to_matrix(*columns("phi", "theta", "psi").T), field, origin)


def x8(folder: Path) -> Log:
    """Skywalker X-8 at 50 Hz with GPS at 5 Hz: loops and rolls. The onboard attitude is ArduPlane's DCM."""
    data = scipy.io.loadmat(folder / "TestLog2.mat", squeeze_me=True)
    imu, fixes = data["IMU"].astype(float), data["GPS"].astype(float)
    angles = np.radians(data["ATT"][:, 2:5].astype(float))
    place = np.column_stack([np.radians(fixes[:, 6:8]), fixes[:, 9]])
    origin = tuple(float(x) for x in place[0])
    course = np.radians(fixes[:, 11])
    level = fixes[:, 10, None] * np.stack([np.cos(course), np.sin(course)], axis=-1)
    samples = Imu(imu[:, 1] / 1000, imu[:, 5:8], imu[:, 2:5])
    p_n, v_n = geodetic_to_ned(*place.T, origin), np.column_stack([level, fixes[:, 12]])
    nothing = np.full((len(imu), 3), np.nan)
    return Log(samples, fixes[:, 13] / 1000, p_n, v_n, euler_to_matrix(*angles.T), nothing, origin)
