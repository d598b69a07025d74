"""A circle over the ground, flown at a steady airspeed through a steady wind."""

from __future__ import annotations

from collections.abc import Callable
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from wildlab.geometry.frames import Array
from wildlab.simulation.disturbances import Disturbance, no_disturbance
from wildlab.simulation.trajectory import FlightPath, Signal

Turn = Literal["clockwise", "counter-clockwise"]


def loiter_path(
    centre: ArrayLike,
    radius: float,
    altitude: float,
    airspeed: float,
    *,
    wind: ArrayLike = (0.0, 0.0),
    turn: Turn = "clockwise",
    start_angle: float = 0.0,
    radius_error: Disturbance | None = None,
    altitude_error: Disturbance | None = None,
) -> FlightPath:
    """A circle over the ground, flown at a steady airspeed through a steady wind.

    The ground speed on the nominal circle solves the wind triangle exactly, so the bank and the crab angle
    vary around the loop; the control errors then move the airframe off the circle by a few metres, and its
    airspeed off the nominal one in the same proportion.

    Parameters
    ----------
    centre
        North and east of the centre, m.
    radius, altitude
        Metres; the altitude above the origin of n.
    airspeed
        m/s, above the speed of the wind.
    wind
        Velocity of the air over the ground, north and east, m/s.
    start_angle
        Bearing of the airframe from the centre at time 0, rad, from north towards east.

    Raises
    ------
    ValueError
        Where the wind is as fast as the airframe, or the radius is not positive.
    """
    c = np.asarray(centre, float)
    w = np.asarray(wind, float)
    if not np.hypot(*w) < airspeed or not radius > 0:
        raise ValueError("the airspeed must exceed the wind, and the radius zero")
    off_radius, off_altitude = radius_error or no_disturbance(), altitude_error or no_disturbance()
    sense = 1.0 if turn == "clockwise" else -1.0

    def rate(angle: Array) -> tuple[Array, Array]:
        """Angular rate around the centre, and its derivative with respect to the angle."""
        outward, along = _outward(angle), sense * _clockwise(angle)
        tail, cross = along @ w, outward @ w
        through_air = np.sqrt(airspeed**2 - cross**2)
        slope = -sense * cross - cross * (_clockwise(angle) @ w) / through_air
        return sense * (tail + through_air) / radius, sense * slope / radius

    angle_at = _solve_angle(rate, sense, start_angle)

    def path(times: Array) -> tuple[Array, Array, Array]:
        t = np.asarray(times, float)
        angle = angle_at(t)
        spin, slope = rate(angle)
        spin_rate = slope * spin
        outward, clockwise = _outward(angle), _clockwise(angle)
        r, r1, r2 = radius + off_radius(t), off_radius(t, 1), off_radius(t, 2)
        p, v, a = (np.empty((len(t), 3)) for _ in range(3))
        p[:, :2] = c + r[:, None] * outward
        v[:, :2] = r1[:, None] * outward + (r * spin)[:, None] * clockwise
        a[:, :2] = (r2 - r * spin**2)[:, None] * outward
        a[:, :2] += (2 * r1 * spin + r * spin_rate)[:, None] * clockwise
        p[:, 2] = -altitude - off_altitude(t)
        v[:, 2], a[:, 2] = -off_altitude(t, 1), -off_altitude(t, 2)
        return p, v, a

    return path


def _outward(angle: Array) -> Array:
    return np.stack([np.cos(angle), np.sin(angle)], axis=-1)


def _clockwise(angle: Array) -> Array:
    return np.stack([-np.sin(angle), np.cos(angle)], axis=-1)


def _solve_angle(rate: Callable[[Array], tuple[Array, Array]], sense: float, start_angle: float) -> Signal:
    """Solve d(angle)/dt = rate(angle), the rate being periodic in the angle, to rounding error.

    The time as a function of the angle is an integral of a periodic function: a Fourier series, exact to
    rounding with a few dozen terms. Newton's method turns it round. An integrator of differential equations
    would leave an error of its own in every derivative.
    """
    count = 1024
    turned = 2 * np.pi * np.arange(count) / count  # how far around since the start, always increasing
    spectrum = np.fft.rfft(1.0 / np.abs(rate(start_angle + sense * turned)[0])) / count
    mean = spectrum[0].real  # s per rad
    k = np.arange(1, count // 2)
    series = 2 * spectrum[1:-1] / (1j * k)
    strong = np.flatnonzero(np.abs(series) > 1e-17 * mean)
    series = series[: strong[-1] + 1] if len(strong) else series[:1]

    def time_of(x: Array) -> Array:
        z = np.exp(1j * x)
        total = np.zeros_like(z)
        for term in series[::-1]:  # Horner
            total = (total + term) * z
        return np.asarray(mean * x + (total - series.sum()).real)

    def angle_at(times: Array) -> Array:
        t = np.asarray(times, float)
        x = t / mean
        for _ in range(50):
            step = (time_of(x) - t) * np.abs(rate(start_angle + sense * x)[0])
            x = x - step
            if not np.any(np.abs(step) > 1e-12 * (1 + np.abs(x))):
                break
        return np.asarray(start_angle + sense * x)

    return angle_at
