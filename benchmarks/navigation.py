"""Twenty-five minutes at 250 Hz with two antennas at 10 Hz: the compiled filters, and the plain ones.

The plain filters get a hundredth of the flight, and their time is multiplied. So is that of pyins, where it
is installed: in its favour by a tenth or so, for at every step it copies all that it has found so far.
"""

from __future__ import annotations

from collections.abc import Callable
from importlib.util import find_spec

import numpy as np
import pandas as pd

from benchmarks.timing import best_of
from tests.navigation import reference_mekf, reference_observer
from wildlab.geometry.frames import (
    Array,
    local_earth,
    matrix_to_euler,
    matrix_to_quaternion,
    ned_to_geodetic,
    quaternion_to_matrix,
)
from wildlab.navigation import mekf, observer
from wildlab.navigation.aiding import Aiding, positions
from wildlab.navigation.mekf import InitialState
from wildlab.navigation.strapdown import STIM300, ImuSamples
from wildlab.simulation.courses import loiter_path
from wildlab.simulation.trajectory import (
    angular_rates,
    attitude_along,
    fixed_wing_trajectory,
    specific_forces,
)

DURATION, RATE, FRACTION = 1500.0, 250, 100
ORIGIN = (1.11, 0.17, 40.0)
LEVERS = np.array([[0.6, 0.0, -0.2], [-0.9, 0.0, -0.1]])


def flight() -> tuple[ImuSamples, InitialState, list[Aiding], Aiding]:
    """Ideal sensors on a loiter: what they say does not matter to the clock."""
    earth = local_earth(ORIGIN[0], ORIGIN[2])
    times = np.arange(0, DURATION, 1 / RATE)
    path = loiter_path((0.0, 0.0), 160.0, 350.0, 20.0)
    trajectory = fixed_wing_trajectory(path, gravity=earth.gravity)
    motion = trajectory(times)
    rates = angular_rates(attitude_along(trajectory), times)
    imu = ImuSamples(times, specific_forces(motion, earth.gravity), rates)
    fixes = slice(5, None, RATE // 10)
    antennas = [motion.position[fixes] + motion.R_nb[fixes] @ lever for lever in LEVERS]
    aiding = [positions(times[fixes], p, 0.02, lever) for p, lever in zip(antennas, LEVERS, strict=True)]
    second = observer.baseline_reference(times[fixes], *antennas, *LEVERS)
    q = matrix_to_quaternion(motion.R_nb[0])
    state = np.concatenate([motion.position[0], motion.velocity[0], q, np.zeros(6)])
    return imu, InitialState(0.0, state, np.diag(np.repeat([1.0, 0.1, 1e-3, 1e-4, 1e-6], 3))), aiding, second


def pyins_filter(imu: ImuSamples, start: InitialState, aiding: list[Aiding]) -> Callable[[], object]:
    """Its filter with feedback on the same samples and antennas, ready to run."""
    from pyins import filters, inertial_sensor, measurements, strapdown

    def geodetic(p_n: Array) -> Array:
        return ned_to_geodetic(p_n, ORIGIN) * [180 / np.pi, 180 / np.pi, 1.0]

    names = [f"{sensor}_{axis}" for sensor in ("gyro", "accel") for axis in "xyz"]
    samples = pd.DataFrame(np.hstack([imu.angular_rate, imu.specific_force]), imu.times, names)
    increments = strapdown.compute_increments_from_imu(samples, "rate")
    place = ["lat", "lon", "alt"]
    antennas = []
    for number, one in enumerate(aiding):
        # It keeps innovations by the name of the class, so two antennas are two classes.
        kind = type(f"Antenna{number}", (measurements.Position,), {})
        table = pd.DataFrame(geodetic(one.value), one.times, place)
        antennas.append(kind(table, np.sqrt(one.variance[0, 0]), one.lever[0]))
    p, v, q = np.split(start.state[:10], [3, 6])
    angles = np.degrees(matrix_to_euler(quaternion_to_matrix(q)))
    first = pd.Series(
        np.concatenate([geodetic(p), v, angles]),
        [*place, "VN", "VE", "VD", "roll", "pitch", "heading"],
        name=start.time,
    )
    sd = np.sqrt(np.diag(start.covariance))
    tilt, heading = np.degrees(sd[[6, 8]])

    def sensor(sd: float, noise: float, long_run: float, time: float) -> object:
        return inertial_sensor.EstimationModel(sd, noise, long_run * np.sqrt(2 / time))

    force_walk, rate_walk, *biases = STIM300
    accelerometers, gyros = sensor(sd[9], force_walk, *biases[:2]), sensor(sd[12], rate_walk, *biases[2:])
    return lambda: filters.run_feedback_filter(
        first, sd[0], sd[3], tilt, heading, increments, gyros, accelerometers, antennas
    )


def pyins_row(
    baseline: float, imu: ImuSamples, start: InitialState, aiding: list[Aiding]
) -> tuple[str, float, float, str]:
    if not find_spec("pyins"):
        return "EKF, pyins: not installed", float("nan"), float("nan"), ""
    theirs = FRACTION * best_of(pyins_filter(imu, start, aiding), repeats=3)
    what = f"EKF, pyins, output at every sample (1/{FRACTION} of the flight, scaled)"
    return what, theirs, theirs / baseline, ""


def run() -> tuple[str, list[tuple[str, float, float, str]]]:
    """Title and rows (what, seconds, ratio to the plain one, what is wanted)."""
    imu, start, aiding, second = flight()
    earth = local_earth(ORIGIN[0], ORIGIN[2])
    camera = np.arange(0.05, DURATION, 0.1)
    few = camera[camera < DURATION / FRACTION]
    short = ImuSamples(*(part[: len(imu.times) // FRACTION] for part in imu))

    def plain_mekf() -> object:
        ready = mekf.prepare(short, start, STIM300, aiding, few, 0.9999, mekf.OUTAGES)
        return reference_mekf.mekf(ready, earth.as_array(), mekf.OUTAGES.patience)

    def plain_observe() -> object:
        ready = observer.prepare(short, start, ORIGIN, [*aiding, second], observer.Gains(), few, 0.1)
        return reference_observer.observer(ready)

    def estimate() -> object:
        return mekf.run_mekf(imu, start, STIM300, earth, aiding, camera)

    def estimate_everywhere() -> object:
        return mekf.run_mekf(imu, start, STIM300, earth, aiding)

    def observe() -> object:
        return observer.run_observer(imu, start, ORIGIN, [*aiding, second], camera)

    rows = []
    for name, slow, fast, wanted in (
        ("MEKF", plain_mekf, {"at 10 Hz": estimate, "at every sample": estimate_everywhere}, "at most 5 s"),
        ("observer", plain_observe, {"at 10 Hz": observe}, "at most 3 s"),
    ):
        baseline = FRACTION * best_of(slow, repeats=1)
        rows.append((f"{name}, plain numpy", baseline, 1.0, ""))
        for output, call in fast.items():
            own = best_of(call, repeats=2)
            rows.append((f"{name}, wildlab, output {output}", own, own / baseline, wanted))
        if name == "MEKF":
            rows.append(pyins_row(baseline, short, start, aiding))
    return f"{DURATION / 60:.0f} minutes of IMU at {RATE} Hz, two antennas at 10 Hz", rows
