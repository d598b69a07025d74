"""How an airframe moves: smooth paths over the ground, and the attitude that flies them.

A path is a function of time that gives position, velocity and acceleration in closed form. The attitude
follows from it by the physics of a coordinated turn, so that inertial sensors can be simulated from the same
motion without contradiction. Frame n counts as inertial, as in H 5.2.2: the Earth's rotation is left out.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike
from scipy.spatial.transform import Rotation

from wildlab.geometry.frames import Array, euler_to_matrix
from wildlab.simulation.sines import sum_of_sines

#: Times (N,) in s -> position, velocity, acceleration in n, (N, 3) each, in m, m/s, m/s^2.
FlightPath = Callable[[Array], tuple[Array, Array, Array]]
#: Times (N,) in s -> something of shape (N, ...).
Signal = Callable[[Array], Array]

GRAVITY = 9.81  # m/s^2, where nothing better is known

Turn = Literal["clockwise", "counter-clockwise"]

_SINES = 16  # enough that a wander does not visibly repeat, few enough to be cheap


@dataclass(frozen=True)
class Motion:
    """What an airframe does at N times.

    Attributes
    ----------
    times
        (N,) s.
    position, velocity, acceleration
        Of b in n, (N, 3), in m, m/s and m/s^2.
    R_nb
        (N, 3, 3).
    """

    times: Array
    position: Array
    velocity: Array
    acceleration: Array
    R_nb: Array


@dataclass(frozen=True)
class Wander:
    """A sum of sines: a smooth signal with all its derivatives. (K,) each; rad/s, rad."""

    amplitudes: Array
    frequencies: Array
    phases: Array

    def __call__(self, times: ArrayLike, derivative: int = 0) -> Array:
        """The signal or one of its derivatives with respect to time. (N,) s -> (N,)."""
        strength = self.amplitudes * self.frequencies**derivative
        phases = self.phases + derivative * np.pi / 2
        return sum_of_sines(np.asarray(times, float), strength, self.frequencies, phases)


def no_wander() -> Wander:
    """The signal that is zero."""
    return Wander(np.zeros(1), np.ones(1), np.zeros(1))


def random_wander(
    sd: float, shortest_period: float, longest_period: float, rng: np.random.Generator
) -> Wander:
    """A random smooth signal, as an autopilot's control errors are: it never jumps, and never quite repeats.

    Sixteen sines of equal power with random phases, one in each of sixteen equal parts (in log frequency) of
    the band. The mean square over a long time is ``sd`` squared for every draw.

    Parameters
    ----------
    sd
        Standard deviation, in whatever unit the signal has.
    shortest_period, longest_period
        The band, s.
    """
    slots = (np.arange(_SINES) + rng.random(_SINES)) / _SINES
    periods = longest_period * (shortest_period / longest_period) ** slots
    phases = rng.uniform(0.0, 2 * np.pi, _SINES)
    return Wander(np.full(_SINES, sd * np.sqrt(2.0 / _SINES)), 2 * np.pi / periods, phases)


def loiter(
    centre: ArrayLike,
    radius: float,
    altitude: float,
    airspeed: float,
    *,
    wind: ArrayLike = (0.0, 0.0),
    turn: Turn = "clockwise",
    start_angle: float = 0.0,
    radius_wander: Wander | None = None,
    altitude_wander: Wander | None = None,
) -> FlightPath:
    """A circle over the ground, flown at a steady airspeed through a steady wind.

    The ground speed on the nominal circle solves the wind triangle exactly, so the bank and the crab angle
    vary around the loop; the wanders then move the airframe off the circle by a few metres, and its airspeed
    off the nominal one in the same proportion.

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
    off_radius, off_altitude = radius_wander or no_wander(), altitude_wander or no_wander()
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


def coordinated_attitude(
    velocity: ArrayLike,
    acceleration: ArrayLike,
    *,
    wind: ArrayLike = (0.0, 0.0, 0.0),
    trim_pitch: float = 0.0,
    gravity: float = GRAVITY,
) -> Array:
    """The attitude in which a fixed wing flies a path: nose into the oncoming air, banked into the turn.

    Coordinated flight: no sideslip and no specific force along y of the body, so that in still air a level
    circle has ``tan(bank) = speed^2 / (gravity * radius)``. ``trim_pitch`` (rad) is the angle of attack.

    Parameters
    ----------
    velocity, acceleration
        Of b in n, (N, 3), m/s and m/s^2.
    wind
        Velocity of the air in n, (3,), m/s.

    Returns
    -------
    ``R_nb`` (N, 3, 3).
    """
    through_air = np.asarray(velocity, float) - np.asarray(wind, float)
    force = np.asarray(acceleration, float) - np.array([0.0, 0.0, gravity])
    x = through_air / np.linalg.norm(through_air, axis=-1, keepdims=True)
    y = np.cross(x, force)
    y /= np.linalg.norm(y, axis=-1, keepdims=True)
    R = np.stack([x, y, np.cross(x, y)], axis=-1)
    return np.asarray(R @ euler_to_matrix(0.0, trim_pitch, 0.0))


def attitude_of(
    path: FlightPath,
    *,
    wind: ArrayLike = (0.0, 0.0, 0.0),
    trim_pitch: float = 0.0,
    gravity: float = GRAVITY,
    sway: tuple[Wander, Wander, Wander] | None = None,
) -> Signal:
    """Attitude along a path as a function of time: coordinated flight, and the airframe's sway about it.

    ``sway`` are small roll, pitch and yaw (rad) about the body's own axes, as gusts and control leave them.
    Returns a function (N,) s -> ``R_nb`` (N, 3, 3).
    """

    def attitude(times: Array) -> Array:
        t = np.asarray(times, float)
        _, v, a = path(t)
        R = coordinated_attitude(v, a, wind=wind, trim_pitch=trim_pitch, gravity=gravity)
        return R if sway is None else np.asarray(R @ euler_to_matrix(*(part(t) for part in sway)))

    return attitude


def leaning_attitude(
    path: FlightPath,
    heading: Signal,
    *,
    trim_pitch: float = 0.0,
    gravity: float = GRAVITY,
    sway: tuple[Wander, Wander, Wander] | None = None,
) -> Signal:
    """Attitude of what leans no more than its own acceleration asks for, whichever way its nose points.

    A multicopter's thrust points along its specific force, so it leans forward to go faster and sideways to
    turn. With an infinite ``gravity`` it does not lean: a gondola that hangs, and only sways.

    Parameters
    ----------
    heading
        Where the nose points, times (N,) s -> (N,) rad.
    trim_pitch
        Pitch in steady motion, rad: below zero for a multicopter that leans against the air.
    sway
        As for :func:`attitude_of`.

    Returns a function (N,) s -> ``R_nb`` (N, 3, 3).
    """

    def attitude(times: Array) -> Array:
        t = np.asarray(times, float)
        _, _, a = path(t)
        z = np.array([0.0, 0.0, 1.0]) - a / gravity
        z /= np.linalg.norm(z, axis=-1, keepdims=True)
        nose = heading(t)
        ahead = np.stack([np.cos(nose), np.sin(nose), np.zeros(len(t))], axis=-1)
        y = np.cross(z, ahead)
        y /= np.linalg.norm(y, axis=-1, keepdims=True)
        R = np.stack([np.cross(y, z), y, z], axis=-1) @ euler_to_matrix(0.0, trim_pitch, 0.0)
        return np.asarray(R if sway is None else R @ euler_to_matrix(*(part(t) for part in sway)))

    return attitude


def move(path: FlightPath, attitude: Signal, times: ArrayLike) -> Motion:
    """The motion at given times, (N,) s."""
    t = np.asarray(times, float)
    p, v, a = path(t)
    return Motion(t, p, v, a, attitude(t))


def angular_rates(attitude: Signal, times: ArrayLike, step: float = 0.01) -> Array:
    """Angular rate of b against n, in b. (N,) s -> (N, 3) rad/s.

    By a central difference of fourth order of the attitude, which is known in closed form: for motion with
    periods of two seconds and more the error is below 1e-8 of the rate's own size.
    """
    t = np.asarray(times, float)

    def mean_rate(h: float) -> Array:
        turn = np.swapaxes(attitude(t - h), -1, -2) @ attitude(t + h)
        return np.asarray(Rotation.from_matrix(turn).as_rotvec() / (2 * h))

    return (4 * mean_rate(step) - mean_rate(2 * step)) / 3


def specific_forces(motion: Motion, gravity: float = GRAVITY) -> Array:
    """What ideal accelerometers feel, in b. (N, 3) m/s^2."""
    force = motion.acceleration - np.array([0.0, 0.0, gravity])
    return np.asarray((np.swapaxes(motion.R_nb, -1, -2) @ force[..., None])[..., 0])
