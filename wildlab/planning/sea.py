"""Vessels that are tracked: when each has to be seen again, and passes in level flight that do it (H 8.2).

A track that is not updated grows. Once its ellipse is wider than what the camera shows, flying to where the
vessel should be may show nothing. A pass is a straight leg over that place: in a turn the way from the camera
to the sea is longer, and every error of the angles moves the point further.
"""

from __future__ import annotations

from itertools import permutations
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from wildlab.errors import WildlabError
from wildlab.geometry.camera import Camera
from wildlab.geometry.camera_poses import CameraPoses
from wildlab.geometry.frames import Array, euler_to_matrix
from wildlab.geometry.mount import Mount
from wildlab.geometry.uncertainty import PoseErrors, ground_covariance

#: Seconds beyond which no deadline is asked for.
FOREVER = 86400.0
#: Orders are tried out for so many vessels at a time: the most urgent ones.
AT_A_TIME = 4


class Vessels(NamedTuple):
    """Tracked vessels of constant velocity.

    Attributes
    ----------
    position, velocity
        (M, 2) north and east, m and m/s.
    covariance
        (M, 4, 4) of north, east and their rates.
    acceleration
        (M,) spectral density of their acceleration, m^2/s^3.
    """

    position: Array
    velocity: Array
    covariance: Array
    acceleration: Array


class Visit(NamedTuple):
    """A level pass over where a vessel is expected.

    Attributes
    ----------
    vessel
        Its row.
    begins, ends
        Times of the level leg, s from now.
    start, end
        (2,) its ends, north and east, m.
    slack
        How long the vessel's ellipse would still have been within what the camera shows, s; negative where
        the pass is too late.
    """

    vessel: int
    begins: float
    ends: float
    start: Array
    end: Array
    slack: float


def predicted(covariance: ArrayLike, seconds: ArrayLike, acceleration: ArrayLike) -> Array:
    """Covariance of constant velocity some time later.

    Parameters
    ----------
    covariance
        (M, 4, 4) of north, east and their rates.
    seconds, acceleration
        (M,) or one for all: time, s, and spectral density of the acceleration, m^2/s^3.

    Returns
    -------
    (M, 4, 4)
    """
    P, t, q = np.asarray(covariance, float), np.asarray(seconds, float), np.asarray(acceleration, float)
    F = np.broadcast_to(np.eye(4), P.shape).copy()
    F[:, [0, 1], [2, 3]] = np.reshape(t, (-1, 1))
    t, q = np.broadcast_to(t, len(P)), np.broadcast_to(q, len(P))
    blocks = np.stack([[t**3 / 3, t**2 / 2], [t**2 / 2, t]])  # (2, 2, M)
    Q = np.einsum("ijm,kl->mikjl", blocks * q, np.eye(2)).reshape(-1, 4, 4)
    return np.asarray(F @ P @ F.transpose(0, 2, 1) + Q)


def reach_of(covariance: ArrayLike, probability: float = 0.9) -> Array:
    """Longer half axis of the ellipse that holds a vessel.

    Parameters
    ----------
    covariance
        (M, 4, 4) or (M, 2, 2).
    probability
        Of the ellipse.

    Returns
    -------
    (M,) metres
    """
    P = np.asarray(covariance, float)[:, :2, :2]
    return np.asarray(np.sqrt(-2 * np.log(1 - probability) * np.linalg.eigvalsh(P)[:, -1]))


def time_until_lost(vessels: Vessels, reach: float, probability: float = 0.9) -> Array:
    """For how long a vessel's ellipse stays within what the camera shows.

    Parameters
    ----------
    vessels
        M of them.
    reach
        Half the narrower side of what the camera shows of the sea, m.
    probability
        Of the ellipse.

    Returns
    -------
    (M,) s; 0 where it is wider now, and `FOREVER` where it is not within a day.

    Raises
    ------
    WildlabError
        Where the camera shows nothing.

    Examples
    --------
    >>> P = np.diag([4.0, 4.0, 0.25, 0.25])[None]
    >>> print(np.round(time_until_lost(Vessels(np.zeros((1, 2)), np.zeros((1, 2)), P, np.zeros(1)), 50.0), 1))
    [46.4]
    """
    if not reach > 0:
        raise WildlabError(
            f"a camera that shows {reach:g} m each way", "give metres above zero", field="reach"
        )
    low, high = np.zeros(len(vessels.position)), np.full(len(vessels.position), FOREVER)

    def within(t: Array) -> NDArray[np.bool_]:
        return reach_of(predicted(vessels.covariance, t, vessels.acceleration), probability) <= reach

    never, now = within(high), within(low)
    for _ in range(60):
        middle = (low + high) / 2
        inside = within(middle)
        low, high = np.where(inside, middle, low), np.where(inside, high, middle)
    return np.where(never, FOREVER, np.where(now, low, 0.0))


def error_by_bank(
    camera: Camera, mount: Mount, height: float, errors: PoseErrors, bank: ArrayLike, probability: float = 0.9
) -> Array:
    """How far a point in the middle of the image may be off, by the bank of the aircraft (H 5.3.1, 8.2).

    Parameters
    ----------
    camera, mount
        As for `wildlab.geometry.CameraPoses`.
    height
        Above the sea, m.
    errors
        Covariances of pixel, pose, mount and plane.
    bank
        (N,) roll angles, rad.
    probability
        Of the ellipse.

    Returns
    -------
    (N,) longer half axis of the ellipse on the sea, m; NaN where the ray does not come down.
    """
    roll = np.atleast_1d(np.asarray(bank, float))
    poses = CameraPoses(
        camera, mount, np.tile([0.0, 0.0, -height], (len(roll), 1)), euler_to_matrix(roll, 0.0, 0.0)
    )
    middle = np.tile([camera.cx, camera.cy], (len(roll), 1))
    found = ground_covariance(poses, middle, 0.0, errors, np.random.default_rng(0)).covariance
    known = np.isfinite(found).all(axis=(1, 2))
    out = np.full(len(roll), np.nan)
    out[known] = reach_of(found[known], probability)
    return out


def plan_visits(
    vessels: Vessels,
    start: ArrayLike,
    *,
    speed: float,
    reach: float,
    leg: float,
    turn_time: float,
    horizon: float,
    seen: ArrayLike,
    probability: float = 0.9,
) -> list[Visit]:
    """Level passes over vessels, each before its ellipse outgrows what the camera shows where that can be.

    All orders of the most urgent vessels are tried. Best is that whose smallest slack is largest, then the
    next smallest; its first pass is flown, and what follows is thought over again, as the vessel that was
    seen is known better then. A pass with a negative slack may show nothing: its vessel has to be searched
    for.

    Parameters
    ----------
    vessels
        M of them, now.
    start
        (2,) where the aircraft is, m.
    speed
        Over the sea, m/s: faster than the vessels.
    reach
        Half the narrower side of what the camera shows, m.
    leg
        Length of the straight leg of a pass, m.
    turn_time
        What turning towards the next leg costs at most, s.
    horizon
        How long to plan for, s.
    seen
        (2, 2) covariance of a position that a pass gives, m^2.
    probability
        Of the ellipses.

    Returns
    -------
    list of Visit
        In order.

    Raises
    ------
    WildlabError
        Where the aircraft does not move, or a vessel is faster than it.
    """
    place = np.asarray(start, float)
    fastest = float(np.linalg.norm(vessels.velocity, axis=1).max(initial=0.0))
    if not speed > 0 or fastest >= speed:
        raise WildlabError(
            f"an aircraft at {speed:g} m/s for a vessel at {fastest:g} m/s",
            "give a speed above that of all vessels",
            field="speed",
        )
    visits: list[Visit] = []
    now, R = 0.0, np.asarray(seen, float)
    # Of a vessel that is not seen in time the deadline stays where it was: it becomes more urgent, not less.
    due = time_until_lost(vessels, reach, probability)
    while now < horizon and len(vessels.position):
        urgent = np.argsort(due, kind="stable")[:AT_A_TIME].tolist()
        order = max(
            permutations(urgent),
            key=lambda way: _slacks(vessels, list(way), place, now, due, speed, leg, turn_time),
        )
        row = order[0]
        where, way = vessels.position[row], vessels.velocity[row]
        one = _pass(row, where, way, place, now, due[row], speed, leg, turn_time)
        if one.ends > horizon:
            break
        visits.append(one)
        middle = (one.begins + one.ends) / 2
        vessels = _moved(vessels, middle - now)
        vessels = _updated(vessels, one.vessel, R)
        vessels = _moved(vessels, one.ends - middle)
        now, place = one.ends, one.end
        due[one.vessel] = now + time_until_lost(vessels, reach, probability)[one.vessel]
    return visits


def _pass(
    row: int,
    where: Array,
    v: Array,
    place: Array,
    now: float,
    due: float,
    speed: float,
    leg: float,
    turn: float,
) -> Visit:
    """A level leg over where a vessel will be, flown on straight from where the aircraft is."""
    offset = where - place
    # When it is met, if the middle of the leg is not reached before the turn is flown.
    a, b, c = v @ v - speed**2, offset @ v + speed**2 * turn, offset @ offset - (speed * turn) ** 2
    t = float((-b - np.sqrt(np.maximum(b**2 - a * c, 0.0))) / a)
    t = max(t, turn + leg / 2 / speed)
    target = offset + t * v
    size = float(np.linalg.norm(target))
    along = target / size if size > 1e-9 else np.array([1.0, 0.0])
    half: Array = leg / 2 * along
    middle: Array = place + target
    begins = now + t - leg / 2 / speed
    ends = now + t + leg / 2 / speed
    return Visit(row, begins, ends, middle - half, middle + half, float(due - (now + t)))


def _slacks(
    vessels: Vessels,
    order: list[int],
    place: Array,
    now: float,
    due: Array,
    speed: float,
    leg: float,
    turn: float,
) -> list[float]:
    """The slacks of an order, the smallest first."""
    at, since = place, now
    found: list[float] = []
    for row in order:
        there = vessels.position[row] + (since - now) * vessels.velocity[row]
        one = _pass(row, there, vessels.velocity[row], at, since, due[row], speed, leg, turn)
        found.append(one.slack)
        at, since = one.end, one.ends
    return sorted(found)


def _moved(vessels: Vessels, seconds: float) -> Vessels:
    return vessels._replace(
        position=vessels.position + seconds * vessels.velocity,
        covariance=predicted(vessels.covariance, seconds, vessels.acceleration),
    )


def _updated(vessels: Vessels, row: int, R: Array) -> Vessels:
    """The covariance after a position was seen; where it was cannot be known in a plan."""
    P = vessels.covariance[row]
    K = P[:, :2] @ np.linalg.inv(P[:2, :2] + R)
    left = np.eye(4)
    left[:, :2] -= K
    covariance = vessels.covariance.copy()
    covariance[row] = left @ P @ left.T + K @ R @ K.T
    return vessels._replace(covariance=covariance)
