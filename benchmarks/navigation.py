"""Twenty-five minutes at 250 Hz with two antennas at 10 Hz: the compiled filters, and the plain ones.

The plain filters get a hundredth of the flight, and their time is multiplied.
"""

from __future__ import annotations

import numpy as np

from benchmarks.timing import best_of
from wildlab.geometry.frames import matrix_to_quaternion
from wildlab.geometry.gravity import local_earth
from wildlab.navigation import mekf, observer, plain, plain_observer
from wildlab.navigation.aiding import Aiding, positions
from wildlab.navigation.mekf import Start
from wildlab.navigation.noise import STIM300
from wildlab.navigation.timeline import Imu
from wildlab.simulation.trajectory import angular_rates, attitude_of, loiter, move, specific_forces

DURATION, RATE, FRACTION = 1500.0, 250, 100
ORIGIN = (1.11, 0.17, 40.0)
LEVERS = np.array([[0.6, 0.0, -0.2], [-0.9, 0.0, -0.1]])


def flight() -> tuple[Imu, Start, list[Aiding], Aiding]:
    """Ideal sensors on a loiter: what they say does not matter to the clock."""
    earth = local_earth(ORIGIN[0], ORIGIN[2])
    times = np.arange(0, DURATION, 1 / RATE)
    path = loiter((0.0, 0.0), 160.0, 350.0, 20.0)
    attitude = attitude_of(path, gravity=earth.gravity)
    motion = move(path, attitude, times)
    imu = Imu(times, specific_forces(motion, earth.gravity), angular_rates(attitude, times))
    fixes = slice(5, None, RATE // 10)
    antennas = [motion.position[fixes] + motion.R_nb[fixes] @ lever for lever in LEVERS]
    aiding = [positions(times[fixes], p, 0.02, lever) for p, lever in zip(antennas, LEVERS, strict=True)]
    second = observer.baseline_reference(times[fixes], *antennas, *LEVERS)
    q = matrix_to_quaternion(motion.R_nb[0])
    state = np.concatenate([motion.position[0], motion.velocity[0], q, np.zeros(6)])
    return imu, Start(0.0, state, np.diag(np.repeat([1.0, 0.1, 1e-3, 1e-4, 1e-6], 3))), aiding, second


def run() -> tuple[str, list[tuple[str, float, float, str]]]:
    """Title and rows (what, seconds, ratio to the plain one, what is wanted)."""
    imu, start, aiding, second = flight()
    earth = local_earth(ORIGIN[0], ORIGIN[2])
    camera = np.arange(0.05, DURATION, 0.1)
    few = camera[camera < DURATION / FRACTION]
    short = Imu(*(part[: len(imu.times) // FRACTION] for part in imu))
    options = {"gate": 1e-4, "max_gap": 0.1, "gap_acceleration": 5.0, "gap_rate": 0.5}

    def plain_mekf() -> object:
        ready = mekf.prepare(short, start, STIM300, aiding, few, **options)
        line, measured = ready.line, ready.measured
        return plain.mekf(line, measured, earth.as_array(), *ready[5:10], ready.gate, 5.0)

    def plain_observe() -> object:
        ready = observer.prepare(short, start, ORIGIN, [*aiding, second], observer.Gains(), few, 0.1)
        return plain_observer.observer(ready)

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
    return f"{DURATION / 60:.0f} minutes of IMU at {RATE} Hz, two antennas at 10 Hz", rows
