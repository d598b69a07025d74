"""What `kernels` computes, written out in numpy: to read, and to test the compiled functions against.

The same arguments in the same order, but results are returned.
"""

from __future__ import annotations

import numpy as np
from scipy.signal import lfilter
from scipy.spatial.transform import Rotation

from wildlab.geometry.frames import Array, euler_to_matrix
from wildlab.geometry.gravity import Earth, attraction


def sum_of_sines(times: Array, amplitudes: Array, frequencies: Array, phases: Array) -> Array:
    """(N,) s -> a sum of sines and its first two derivatives, (3, N)."""
    angles = np.outer(times, frequencies) + phases
    slopes = amplitudes * frequencies
    return np.stack(
        [np.sin(angles) @ amplitudes, np.cos(angles) @ slopes, -np.sin(angles) @ (slopes * frequencies)]
    )


def _directions(angles: Array) -> tuple[Array, Array]:
    """Unit vectors away from the centre of a circle, and clockwise round it; (N, 2) each."""
    c, s = np.cos(angles), np.sin(angles)
    return np.stack([c, s], axis=-1), np.stack([-s, c], axis=-1)


def rate_on_circle(angles: Array, circle: tuple[float, ...]) -> tuple[Array, Array]:
    """Angular rate around the centre by the wind triangle, and its derivative with respect to the angle."""
    radius, airspeed, north, east, sense, _ = circle
    outward, clockwise = _directions(angles)
    tail, cross = sense * clockwise @ [north, east], outward @ [north, east]
    through_air = np.sqrt(airspeed**2 - cross**2)
    slope = -sense * cross - cross * (clockwise @ [north, east]) / through_air
    return sense * (tail + through_air) / radius, sense * slope / radius


def angles_on_circle(
    times: Array, circle: tuple[float, ...], mean: float, real: Array, imaginary: Array
) -> Array:
    """By halving, as the time increases with the angle."""
    *_, sense, start = circle
    series = real + 1j * imaginary
    harmonics = np.arange(1, len(series) + 1)
    width = 2 * np.abs(series).sum() / mean
    low, high = times / mean - width, times / mean + width
    for _ in range(70):
        x = (low + high) / 2
        early = mean * x + ((np.exp(1j * np.outer(x, harmonics)) - 1) @ series).real < times
        low, high = np.where(early, x, low), np.where(early, high, x)
    return np.asarray(start + sense * (low + high) / 2)


def circle_motion(angles: Array, circle: tuple[float, ...], off_circle: Array) -> tuple[Array, Array, Array]:
    """Position, velocity and acceleration about the centre, (N, 2) each."""
    spin, slope = rate_on_circle(angles, circle)
    outward, clockwise = _directions(angles)
    r, r1, r2 = circle[0] + off_circle[0], off_circle[1], off_circle[2]
    p = r[:, None] * outward
    v = r1[:, None] * outward + (r * spin)[:, None] * clockwise
    a = (r2 - r * spin**2)[:, None] * outward + (2 * r1 * spin + r * slope * spin)[:, None] * clockwise
    return p, v, a


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


def gauss_markov(draws: Array, sd: Array, kept: Array) -> Array:
    """(N, K), in the stationary distribution from the first on."""
    drive = draws * sd
    drive[1:] *= np.sqrt(1 - kept**2)
    columns = [lfilter([1.0], [1.0, -a], column) for a, column in zip(kept, drive.T, strict=True)]
    return np.stack(columns, axis=-1)


def read_triad(
    true: Array, axes: Array, turn_on: Array, drift: Array, noise: Array, density: float, limits: Array
) -> Array:
    """(N, 3)."""
    limit, resolution = limits
    reading = true @ axes.T + turn_on + drift + density * noise
    return np.clip(np.round(reading / resolution) * resolution if resolution else reading, -limit, limit)
