"""A circle over the ground, flown at a steady airspeed through a steady wind."""

from __future__ import annotations

from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from wildlab.geometry.frames import Array
from wildlab.simulation import kernels
from wildlab.simulation.disturbances import Disturbance, no_disturbance
from wildlab.simulation.plain import rate_on_circle
from wildlab.simulation.trajectory import FlightPath

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
        North and east of the centre, (2,) m.
    radius, altitude
        Metres; the altitude above the origin of n.
    airspeed
        m/s, above the speed of the wind.
    wind
        Velocity of the air over the ground, north and east, (2,) m/s.
    turn
        Which way round, seen from above.
    start_angle
        Bearing of the airframe from the centre at time 0, rad, from north towards east.
    radius_error, altitude_error
        Control errors, m: how far outside of the circle, and how far above the altitude, it is; None is none.

    Returns
    -------
    Times (N,) s -> position, velocity and acceleration of b in n, (N, 3) m, m/s and m/s^2.

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
    circle = tuple(float(part) for part in (radius, airspeed, *w, sense, start_angle))
    times_of_angles = _times_of_angles(circle)

    def path(times: Array) -> tuple[Array, Array, Array]:
        t = np.ascontiguousarray(times, float)
        angles = np.empty(len(t))
        kernels.angles_on_circle(t, circle, *times_of_angles, angles)
        p, v, a = (np.empty((len(t), 3)) for _ in range(3))
        kernels.circle_motion(angles, circle, off_radius.with_derivatives(t), p, v, a)
        p[:, :2] += c
        off = off_altitude.with_derivatives(t)
        p[:, 2], v[:, 2], a[:, 2] = -altitude - off[0], -off[1], -off[2]
        return p, v, a

    return path


def _times_of_angles(circle: tuple[float, ...]) -> tuple[float, Array, Array]:
    """The time to turn through an angle x, as ``mean x + Re sum_k series_k (exp(i k x) - 1)``.

    The rate is periodic in the angle, so its inverse has an integral that is a Fourier series: exact to
    rounding with a few dozen terms. An integrator of differential equations would leave an error of its own
    in every derivative.

    Returns
    -------
    The mean, s per rad, and the real and imaginary parts of the series, (K,) s.
    """
    *_, sense, start = circle
    count = 1024
    turned = 2 * np.pi * np.arange(count) / count  # how far around since the start, always increasing
    spectrum = np.fft.rfft(1.0 / np.abs(rate_on_circle(start + sense * turned, circle)[0])) / count
    mean = float(spectrum[0].real)
    series = 2 * spectrum[1:-1] / (1j * np.arange(1, count // 2))
    strong = np.flatnonzero(np.abs(series) > 1e-17 * mean)
    series = series[: strong[-1] + 1] if len(strong) else series[:1]
    return mean, np.ascontiguousarray(series.real), np.ascontiguousarray(series.imag)
