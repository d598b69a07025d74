"""How a target may move: transition ``F`` and process noise ``Q`` over a time step.

A motion model is a function of the step (seconds) that gives ``(F, Q)``; a filter asks it anew for every
interval, so measurements may come at any times. Fix the parameters with `functools.partial`::

    motion = partial(constant_velocity, sd_acceleration=0.05)

States are ordered position, velocity, acceleration: ``[pN, pE]``, ``[pN, pE, vN, vE]``, ``[pN, pE, vN, vE,
aN, aE]``, in metres and seconds. A step of zero gives ``F = I`` and ``Q = 0`` in every model.

Two families behave differently where an interval is cut in two. `random_walk`, `white_acceleration` and
`singer` are continuous in time: two steps amount to one. H (6.1), F (4.5) and F (4.6) hold their noise
constant over a step, and one long step is far more uncertain than many short ones: predict as often as the
camera takes pictures, by giving the filter also the frames without a detection, or by `in_steps`.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from scipy.linalg import expm

from wildlab.errors import WildlabError
from wildlab.geometry.frames import Array

#: ``dt -> (F, Q)``, (n, n) each.
Motion = Callable[[float], tuple[Array, Array]]


def _both(axis: Array) -> Array:
    """North and east move alike and independently."""
    both = np.zeros((2 * len(axis), 2 * len(axis)))
    both[::2, ::2] = both[1::2, 1::2] = axis
    return both


def rest(dt: float) -> tuple[Array, Array]:
    """A target that does not move, state ``[pN, pE]`` (H 5.6.1).

    Parameters
    ----------
    dt
        s.

    Returns
    -------
    F, Q
        (2, 2) each, the identity and zero.

    Raises
    ------
    WildlabError
        For a step that is negative or not finite.
    """
    _check_step(dt)
    return np.eye(2), np.zeros((2, 2))


def random_walk(dt: float, density: float) -> tuple[Array, Array]:
    """Position driven by white velocity, state ``[pN, pE]``: ``Q = density^2 dt``.

    The random walk that F 4.1.2 means, for any step.

    Parameters
    ----------
    dt
        s.
    density
        m/sqrt(s): the standard deviation that grows in a second, the same north and east.

    Returns
    -------
    F, Q
        (2, 2) each, ``Q`` in m^2.

    Raises
    ------
    WildlabError
        For a step that is negative or not finite.
    """
    _check_step(dt)
    return np.eye(2), density**2 * dt * np.eye(2)


def constant_velocity(dt: float, sd_acceleration: float) -> tuple[Array, Array]:
    """H (6.1)-(6.2): an acceleration (m/s^2) drawn anew for each step and held over it.

    State ``[pN, pE, vN, vE]``. ``Q`` has rank two.

    Parameters
    ----------
    dt
        s.
    sd_acceleration
        Standard deviation of that acceleration, m/s^2, the same north and east.

    Returns
    -------
    F, Q
        (4, 4) each, in m and s.

    Raises
    ------
    WildlabError
        For a step that is negative or not finite.
    """
    _check_step(dt)
    gamma = np.array([dt * dt / 2, dt])
    return _both(np.array([[1.0, dt], [0.0, 1.0]])), _both(sd_acceleration**2 * np.outer(gamma, gamma))


def white_acceleration(dt: float, density: float) -> tuple[Array, Array]:
    """Velocity driven by white acceleration, state ``[pN, pE, vN, vE]``.

    Continuous in time: two steps amount to one, so that sensors of different rates assume the same boat.

    Parameters
    ----------
    dt
        s, not negative.
    density
        m/s per square root of a second: the standard deviation of each axis of the velocity that grows in a
        second.

    Returns
    -------
    F, Q
        (4, 4) each, in m and s.

    Raises
    ------
    WildlabError
        For a step that is negative or not finite.
    """
    F, _ = constant_velocity(dt, 0.0)
    Q = density**2 * np.array([[dt**3 / 3, dt**2 / 2], [dt**2 / 2, dt]])
    return F, np.asarray(np.kron(Q, np.eye(2)), float)


def singer_variance(max_acceleration: float, p_max: float, p_zero: float) -> float:
    """Variance of the acceleration (m/s^2)^2, H (7.2)."""
    return max_acceleration**2 / 3 * (1 + 4 * p_max - p_zero)


def singer(dt: float, alpha: float, variance: float) -> tuple[Array, Array]:
    """Singer's model, H (7.1)-(7.3): acceleration as a first-order Markov process.

    State ``[pN, pE, vN, vE, aN, aE]``.

    Parameters
    ----------
    dt
        s.
    alpha
        Inverse of the manoeuvre's time constant, 1/s; zero is constant acceleration without noise.
    variance
        Stationary variance of the acceleration, (m/s^2)^2, see `singer_variance`.

    Returns
    -------
    F, Q
        (6, 6) each, in m and s.

    Raises
    ------
    WildlabError
        For a step that is negative or not finite.
    """
    _check_step(dt)
    # In units of the step (T^2, T, 1) all numbers are near one, and only a = alpha T is left of the model.
    # A step long against 1/alpha is doubled up from a short one: the exponential of -A would overflow.
    doublings = max(0, int(np.ceil(np.log2(alpha * dt)))) if alpha * dt > 1 else 0
    h = dt / 2**doublings
    A = np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [0.0, 0.0, -alpha * h]])
    loan = np.zeros((6, 6))  # Van Loan's block matrix
    loan[:3, :3], loan[3:, 3:], loan[2, 5] = -A, A.T, 2 * alpha * variance * h
    exponential = expm(loan)
    units = np.array([h * h, h, 1.0])
    F = np.triu(exponential[3:, 3:].T)
    Q = np.outer(units, units) * (F @ exponential[:3, 3:])
    F = F * h ** np.array([[0, 1, 2], [0, 0, 1], [0, 0, 0]])  # back to SI
    for _ in range(doublings):
        F, Q = F @ F, F @ Q @ F.T + Q
    return _both(F), _both((Q + Q.T) / 2)


def in_steps(dt: float, motion: Motion, longest: float) -> tuple[Array, Array]:
    """A motion model taken in equal steps of at most ``longest`` seconds each.

    For models that hold their noise over a step, where the measurements pause: what the filter would have
    got to by predicting at the camera's rate.

    Parameters
    ----------
    dt
        The whole step, s.
    motion
        The model that is asked for one of the equal steps.
    longest
        s, above zero.

    Returns
    -------
    F, Q
        (n, n) each, over the whole step, in the order and units of ``motion``.

    Raises
    ------
    WildlabError
        For a step that is negative or not finite, or a ``longest`` that is not above zero.
    """
    _check_step(dt)
    if not longest > 0:
        raise WildlabError(
            f"a step of at most {longest} s", "give a positive length of step", field="longest"
        )
    left = max(1, int(np.ceil(dt / longest * (1 - 1e-12))))
    F, Q = motion(dt / left)
    F_all, Q_all = np.eye(len(F)), np.zeros_like(Q)
    while left:  # by squaring: steps already taken, then as many more
        if left & 1:
            F_all, Q_all = F @ F_all, F @ Q_all @ F.T + Q
        F, Q, left = F @ F, F @ Q @ F.T + Q, left >> 1
    return F_all, (Q_all + Q_all.T) / 2


def _check_step(dt: float) -> None:
    if not (0 <= dt < np.inf):
        raise WildlabError(f"a time step of {dt} s", "sort the times", field="dt")
