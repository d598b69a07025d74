"""Motion of a body: position, velocity, acceleration and attitude, and the rates and forces that go with it.

A path is a function of time that gives position, velocity and acceleration in closed form (`loiter`,
`waypoint_courses`). The attitude follows from it by the physics of flight (`attitudes`), so that inertial
sensors can be simulated from the same motion without contradiction. Frame n counts as inertial, as in
H 5.2.2: the Earth's rotation is left out.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from wildlab.geometry.frames import USUAL_GRAVITY, Array, euler_to_matrix
from wildlab.simulation import kernels
from wildlab.simulation.error_models import stream
from wildlab.simulation.parameters import TwinParameters

_SINES = 16  # enough that a signal does not visibly repeat, few enough to be cheap


@dataclass(frozen=True)
class Disturbance:
    """A sum of sines: a smooth signal with all its derivatives. (K,) each; rad/s, rad."""

    amplitudes: Array
    frequencies: Array
    phases: Array

    def __call__(self, times: ArrayLike) -> Array:
        """The signal. (N,) s -> (N,)."""
        return np.asarray(self._summed(times, 1)[0])

    def with_derivatives(self, times: ArrayLike) -> Array:
        """The signal and its first two derivatives with respect to time. (N,) s -> (3, N)."""
        return self._summed(times, 3)

    def _summed(self, times: ArrayLike, rows: int) -> Array:
        t = np.ascontiguousarray(times, float)
        out = np.empty((rows, len(t)))
        kernels.sum_of_sines(t, self.amplitudes, self.frequencies, self.phases, out)
        return out


def no_disturbance() -> Disturbance:
    """The signal that is zero."""
    return Disturbance(np.zeros(1), np.ones(1), np.zeros(1))


#: Roll, pitch and yaw (rad) about a body's own axes.
AttitudeDisturbance = tuple[Disturbance, Disturbance, Disturbance]


def band_limited_disturbance(
    sd: float, shortest_period: float, longest_period: float, rng: np.random.Generator
) -> Disturbance:
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
    return Disturbance(np.full(_SINES, sd * np.sqrt(2.0 / _SINES)), 2 * np.pi / periods, phases)


def coordinated_attitude(
    velocity: ArrayLike,
    acceleration: ArrayLike,
    *,
    wind: ArrayLike = (0.0, 0.0, 0.0),
    trim_pitch: float = 0.0,
    gravity: float = USUAL_GRAVITY,
) -> Array:
    """The attitude in which a fixed wing flies a path: nose into the oncoming air, banked into the turn.

    Coordinated flight: no sideslip and no specific force along y of the body, so that in still air a level
    circle has ``tan(bank) = speed^2 / (gravity * radius)``.

    Parameters
    ----------
    velocity, acceleration
        Of b in n, (N, 3), m/s and m/s^2.
    wind
        Velocity of the air in n, (3,), m/s.
    trim_pitch
        Angle of attack, rad: how far the nose is above the oncoming air.
    gravity
        m/s^2.

    Returns
    -------
    ``R_nb`` (N, 3, 3).
    """
    v, a = (np.ascontiguousarray(part, float) for part in (velocity, acceleration))
    R = np.empty((len(v), 3, 3))
    kernels.coordinated_attitude(v, a, np.array(wind, float), float(trim_pitch), float(gravity), R)
    return R


def fixed_wing_trajectory(
    path: FlightPath,
    *,
    wind: ArrayLike = (0.0, 0.0, 0.0),
    trim_pitch: float = 0.0,
    gravity: float = USUAL_GRAVITY,
    gusts: AttitudeDisturbance | None = None,
) -> Trajectory:
    """Motion along a path in coordinated flight, and gusts about it.

    Parameters
    ----------
    path
        Times (N,) s -> position, velocity and acceleration of b in n, (N, 3) m, m/s and m/s^2.
    wind, trim_pitch, gravity
        As for :func:`coordinated_attitude`.
    gusts
        Small roll, pitch and yaw (rad) about the body's own axes, as control leaves them; None is none.

    Returns
    -------
    Times (N,) s -> `Motion`.
    """

    def motion(times: Array) -> Motion:
        t = np.asarray(times, float)
        p, v, a = path(t)
        calm = Motion(
            t, p, v, a, coordinated_attitude(v, a, wind=wind, trim_pitch=trim_pitch, gravity=gravity)
        )
        return calm if gusts is None else turned(calm, gusts)

    return motion


def thrust_aligned_trajectory(
    path: FlightPath,
    heading: Signal,
    *,
    trim_pitch: float = 0.0,
    gravity: float = USUAL_GRAVITY,
    gusts: AttitudeDisturbance | None = None,
) -> Trajectory:
    """Motion of what leans no more than its own acceleration asks for, whichever way its nose points.

    A multicopter's thrust points along its specific force, so it leans forward to go faster and sideways to
    turn.

    Parameters
    ----------
    path
        Times (N,) s -> position, velocity and acceleration of b in n, (N, 3) m, m/s and m/s^2.
    heading
        Where the nose points, times (N,) s -> (N,) rad, from north towards east.
    trim_pitch
        Pitch in steady motion, rad: below zero for a multicopter that leans against the air.
    gravity
        m/s^2. With an infinite one it does not lean: a gondola that hangs level but for gusts.
    gusts
        As for :func:`fixed_wing_trajectory`.

    Returns
    -------
    Times (N,) s -> `Motion`.
    """

    def motion(times: Array) -> Motion:
        t = np.asarray(times, float)
        p, v, a = path(t)
        z = np.array([0.0, 0.0, 1.0]) - a / gravity
        z /= np.linalg.norm(z, axis=-1, keepdims=True)
        nose = heading(t)
        ahead = np.stack([np.cos(nose), np.sin(nose), np.zeros(len(t))], axis=-1)
        y = np.cross(z, ahead)
        y /= np.linalg.norm(y, axis=-1, keepdims=True)
        R = np.stack([np.cross(y, z), y, z], axis=-1) @ euler_to_matrix(0.0, trim_pitch, 0.0)
        calm = Motion(t, p, v, a, R)
        return calm if gusts is None else turned(calm, gusts)

    return motion


#: Samples of the bank per second, Hz: many within the two seconds that an airframe takes to roll.
_RATE = 10.0


def recent_change(values: ArrayLike, step: float, memory: float) -> Array:
    """How much a signal has changed lately: its standard deviation over an exponentially fading past.

    It is zero while the signal stands still. After a jump it rises to half of the jump, at 0.7 of the memory,
    and fades with half the rate of the memory.

    Parameters
    ----------
    values
        (N,) samples; before the first one the signal stood still.
    step
        Time between two, s.
    memory
        Time in which the weight of a sample falls to 1/e, s.

    Returns
    -------
    (N,), in the unit of the values.

    Examples
    --------
    >>> recent_change([0.0, 0.0, 1.0], 0.1, 10.0)[:2]
    array([0., 0.])
    """
    from scipy.signal import lfilter  # brings scipy.stats along, which takes long

    x = np.asarray(values, float)
    kept = np.exp(-step / memory)
    off = x - x[0]  # the filters start at rest
    mean, square = (lfilter([1 - kept], [1.0, -kept], moment) for moment in (off, off**2))
    return np.asarray(np.sqrt(np.maximum(square - mean**2, 0.0)))


def camera_sway(twin: TwinParameters, trajectory: Trajectory, seed: int) -> Signal | None:
    """Small angles of the camera against the airframe: a smooth error whose size follows the bank's changes.

    About each axis it is ``share`` times `recent_change` of the bank times a band-limited signal of unit
    standard deviation, all three independent.

    Parameters
    ----------
    twin
        Its ``camera_sway``.
    trajectory
        Of the airframe.
    seed
        Of the flight.

    Returns
    -------
    Times (N,) s within the flight -> (N, 3) rad, roll, pitch and yaw about the airframe's axes; None of a
    twin without such an error.
    """
    sway = twin.camera_sway
    if sway is None:
        return None
    grid = np.arange(int(twin.flight.duration.si * _RATE) + 2) / _RATE
    R = trajectory(grid).R_nb
    size = sway.share.si * recent_change(np.arctan2(R[:, 2, 1], R[:, 2, 2]), 1 / _RATE, sway.memory.si)
    rng = stream(seed, "camera sway")
    band = (sway.shortest_period.si, sway.longest_period.si)
    axes = [band_limited_disturbance(1.0, *band, rng) for _ in range(3)]

    def angles(times: Array) -> Array:
        t = np.asarray(times, float)
        return np.asarray(np.interp(t, grid, size)[:, None] * np.stack([axis(t) for axis in axes], axis=-1))

    return angles


def camera_motion(twin: TwinParameters, trajectory: Trajectory, times: Array, seed: int) -> Motion:
    """The airframe's motion as it would be if the camera were fixed to it: its own, turned by `camera_sway`.

    Parameters
    ----------
    twin, trajectory, seed
        As for `camera_sway`.
    times
        Of the exposures, (N,) s.
    """
    motion = trajectory(times)
    sway = camera_sway(twin, trajectory, seed)
    if sway is None:
        return motion
    roll, pitch, yaw = (np.ascontiguousarray(angle) for angle in sway(times).T)
    R = np.empty_like(motion.R_nb)
    kernels.turn(np.ascontiguousarray(motion.R_nb), roll, pitch, yaw, R)
    return replace(motion, R_nb=R)


#: Times (N,) in s -> position, velocity, acceleration in n, (N, 3) each, in m, m/s, m/s^2.
FlightPath = Callable[[Array], tuple[Array, Array, Array]]
#: Times (N,) in s -> something of shape (N, ...).
Signal = Callable[[Array], Array]


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


#: Times (N,) in s -> the motion at these times.
Trajectory = Callable[[Array], Motion]


def turned(motion: Motion, disturbance: AttitudeDisturbance) -> Motion:
    """The motion of a body in the same place, turned about the axes of the first one by small angles."""
    R = np.empty_like(motion.R_nb)
    roll, pitch, yaw = (angle(motion.times) for angle in disturbance)
    kernels.turn(np.ascontiguousarray(motion.R_nb), roll, pitch, yaw, R)
    return replace(motion, R_nb=R)


def attitude_along(trajectory: Trajectory) -> Signal:
    """Of a trajectory the attitude alone.

    Parameters
    ----------
    trajectory
        Times (N,) s -> `Motion`.

    Returns
    -------
    Times (N,) s -> ``R_nb`` (N, 3, 3).
    """
    return lambda times: trajectory(times).R_nb


def angular_rates(attitude: Signal, times: ArrayLike, step: float = 0.01) -> Array:
    """Angular rate of b against n, in b.

    By a central difference of fourth order of the attitude, which is known in closed form: for motion with
    periods of two seconds and more the error is below 1e-8 of the rate's own size.

    Parameters
    ----------
    attitude
        Times (N,) s -> ``R_nb`` (N, 3, 3); asked up to two steps before and after each time.
    times
        (N,) s.
    step
        Of the difference, s.

    Returns
    -------
    (N, 3) rad/s, in b.
    """
    t = np.asarray(times, float)
    rates = np.empty((len(t), 3))
    R = [np.ascontiguousarray(attitude(t + steps * step)) for steps in (-2, -1, 1, 2)]
    kernels.body_rates(R[0], R[1], R[2], R[3], step, rates)
    return rates


def specific_forces(motion: Motion, gravity: float = USUAL_GRAVITY) -> Array:
    """What ideal accelerometers feel: the acceleration less gravity.

    Parameters
    ----------
    motion
        Of b at N times.
    gravity
        m/s^2, straight down in n.

    Returns
    -------
    (N, 3) m/s^2, in b.
    """
    force = motion.acceleration - np.array([0.0, 0.0, gravity])
    return np.asarray((np.swapaxes(motion.R_nb, -1, -2) @ force[..., None])[..., 0])
