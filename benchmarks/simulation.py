"""Twenty-five minutes at 250 Hz of simulated motion and ideal sensors: compiled, and in readable numpy.

The numpy functions get a hundredth of the flight, and their time is multiplied.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from scipy.spatial.transform import Rotation

from benchmarks.timing import best_of
from wildlab.geometry.frames import Array, Earth, attraction, euler_to_matrix, local_earth
from wildlab.simulation import kernels
from wildlab.simulation.courses import loiter_path
from wildlab.simulation.trajectory import band_limited_disturbance, fixed_wing_trajectory

DURATION, RATE, FRACTION = 1500, 250, 100
WIND = np.array([4.0, -3.0, 0.0])


def sum_of_sines(times: Array, amplitudes: Array, frequencies: Array, phases: Array) -> Array:
    """(N,) s -> a sum of sines and its first two derivatives, (3, N)."""
    angles = np.outer(times, frequencies) + phases
    slopes = amplitudes * frequencies
    return np.stack(
        [np.sin(angles) @ amplitudes, np.cos(angles) @ slopes, -np.sin(angles) @ (slopes * frequencies)]
    )


def coordinated_attitude(
    velocity: Array, acceleration: Array, wind: Array, trim_pitch: float, gravity: float
) -> Array:
    """(N, 3, 3)."""
    x = velocity - wind
    x /= np.linalg.norm(x, axis=-1, keepdims=True)
    y = np.cross(x, acceleration - np.array([0.0, 0.0, gravity]))
    y /= np.linalg.norm(y, axis=-1, keepdims=True)
    R = np.stack([x, y, np.cross(x, y)], axis=-1)
    return np.asarray(R @ euler_to_matrix(0.0, trim_pitch, 0.0))


def body_rates(far_before: Array, before: Array, after: Array, far_after: Array, step: float) -> Array:
    """(N, 3) rad/s."""
    near, far = (
        Rotation.from_matrix(np.swapaxes(first, -1, -2) @ last).as_rotvec()
        for first, last in ((before, after), (far_before, far_after))
    )
    return np.asarray((4 * near / (2 * step) - far / (4 * step)) / 3)


def felt_on_earth(R: Array, p: Array, v: Array, a: Array, earth: Earth, rate: Array) -> tuple[Array, Array]:
    """Specific force and angular rate, (N, 3) each, in b."""
    to_b, turning = np.swapaxes(R, -1, -2), np.array(earth.rate)
    felt = a + 2 * np.cross(turning, v) - attraction(earth, p)
    return np.einsum("nij,nj->ni", to_b, felt), rate + to_b @ turning


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
        calm = coordinated_attitude(v[:n], a[:n], WIND, 0.05, earth.gravity)
        turned = calm @ euler_to_matrix(*out[:, :n])
        rates = body_rates(turned[:-8], turned[2:-6], turned[6:-2], turned[8:], 2 / RATE)
        inside = slice(4, n - 4)
        felt_on_earth(turned[4:-4], p[inside], v[inside], a[inside], earth, rates)

    few = count // FRACTION
    pairs: list[tuple[str, Callable[[], object], Callable[[], object]]] = [
        (
            "sixteen sines with two derivatives",
            lambda: sum_of_sines(times[:few], *sines),
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
