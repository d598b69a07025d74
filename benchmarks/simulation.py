"""Twenty-five minutes at 250 Hz of simulated motion and ideal sensors: compiled, and in readable numpy.

The numpy functions get a hundredth of the flight, and their time is multiplied.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from benchmarks.timing import best_of
from tests.simulation import plain_kernels as plain
from wildlab.geometry.frames import euler_to_matrix
from wildlab.geometry.gravity import local_earth
from wildlab.simulation import fixed_wing_trajectory, kernels, loiter_path
from wildlab.simulation.trajectory import band_limited_disturbance

DURATION, RATE, FRACTION = 1500, 250, 100
WIND = np.array([4.0, -3.0, 0.0])


def run() -> tuple[str, list[tuple[str, float, float, str]]]:
    """Title and rows (what, seconds, ratio to the plain one, what is wanted)."""
    rng = np.random.default_rng(1)
    times = np.arange(DURATION * RATE) / RATE
    count = len(times)
    path = loiter_path((0.0, 0.0), 160.0, 350.0, 20.0, wind=WIND[:2])
    motion = fixed_wing_trajectory(path, wind=WIND)(times)
    p, v, a = motion.position, motion.velocity, motion.acceleration
    gust = band_limited_disturbance(0.02, 2.0, 9.0, rng)
    sines = (gust.amplitudes, gust.frequencies, gust.phases)
    earth = local_earth(1.11, 40.0)
    out, rate, force, attitude = (
        np.empty(shape) for shape in ((3, count), (count, 3), (count, 3), (count, 3, 3))
    )

    def sensed() -> None:
        kernels.coordinated_attitude(v, a, WIND, 0.05, earth.gravity, attitude)
        kernels.turn(attitude, out[0], out[1], out[2], attitude)
        kernels.body_rates(attitude[:-8], attitude[2:-6], attitude[6:-2], attitude[8:], 2 / RATE, rate[4:-4])
        kernels.felt_on_earth(attitude, p, v, a, earth.as_array(), force, rate)

    def plain_sensed(n: int) -> None:
        calm = plain.coordinated_attitude(v[:n], a[:n], WIND, 0.05, earth.gravity)
        turned = calm @ euler_to_matrix(*out[:, :n])
        rates = plain.body_rates(turned[:-8], turned[2:-6], turned[6:-2], turned[8:], 2 / RATE)
        inside = slice(4, n - 4)
        plain.felt_on_earth(turned[4:-4], p[inside], v[inside], a[inside], earth, rates)

    few = count // FRACTION
    pairs: list[tuple[str, Callable[[], object], Callable[[], object]]] = [
        (
            "sixteen sines with two derivatives",
            lambda: plain.sum_of_sines(times[:few], *sines),
            lambda: kernels.sum_of_sines(times, *sines, out),
        ),
        ("attitude, angular rate and specific force", lambda: plain_sensed(few), sensed),
    ]
    rows = []
    for what, slow, fast in pairs:
        theirs, ours = FRACTION * best_of(slow, repeats=5), best_of(fast, repeats=5)
        rows.append((f"{what}, numpy (1/{FRACTION} of the flight, scaled)", theirs, 1.0, ""))
        rows.append((f"{what}, compiled", ours, ours / theirs, "below 1"))
    return f"A simulated flight of {DURATION // 60} min at {RATE} Hz, one core", rows
