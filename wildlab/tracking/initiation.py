"""Where a filter starts: on a position, or where several rays meet."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from wildlab.errors import WildlabError
from wildlab.geometry.frames import Array
from wildlab.tracking.run import FilterInputs, Start, check_rows, checked
from wildlab.tracking.sensors import Sensor, angles_at, difference, on_state

#: rad. Rays that cross at less are near parallel: an error of them is some ten times as long along them.
LEAST_CROSSING = float(np.radians(5.0))
#: Steps of the Gauss-Newton iteration, and by how much of a standard deviation the last may still move.
STEPS, STILL = 50, 1e-6


def start_from_first(
    times: ArrayLike,
    positions: ArrayLike,
    sd_position: float,
    sd_velocity: float = 0.0,
    n: int = 4,
    **more: float,
) -> Start:
    """Start on the first georeferenced position, with zero speed (H 6.2.4, 6.3.3).

    Parameters
    ----------
    times
        (N,) s.
    positions
        (N, 2) or (N, 3): north, east in n, m, and what is not looked at; the first row with a time and
        without NaN is taken.
    sd_position, sd_velocity
        m and m/s, the same north and east.
    n
        Number of states: 2, 4 or 6.
    more
        ``sd_acceleration``, m/s^2, with six states; zero where it is left out. No other name is looked at.

    Returns
    -------
    Start
        At the time of that row, which is not used again, with a diagonal ``P`` (n, n).

    Raises
    ------
    WildlabError
        Without any position.
    """
    t, p = np.asarray(times, float), np.asarray(positions, float)[:, :2]
    there = np.flatnonzero(np.isfinite(p).all(axis=1) & np.isfinite(t))
    if not len(there):
        raise WildlabError(
            "no measurement gives a position to start from",
            "check poses and plane, or give the filter a start of its own",
            field="positions",
        )
    row = int(there[0])
    sd = np.repeat([sd_position, sd_velocity, more.get("sd_acceleration", 0.0)], 2)[:n]
    x = np.zeros(n)
    x[:2] = p[row]
    return Start(float(t[row]), x, np.diag(sd**2), row)


def start_from_position(
    time: float, position: ArrayLike, covariance: ArrayLike, sd_velocity: float, row: int = -1
) -> Start:
    """Start at rest on a position that is known with a covariance.

    Parameters
    ----------
    time
        s.
    position, covariance
        (2,) north and east, m in n, and (2, 2), m^2.
    sd_velocity
        m/s, the same north and east.
    row
        The measurement that the position was made from; -1: none.

    Returns
    -------
    Start
        Of the state ``[pN, pE, vN, vE]``; position and velocity uncorrelated.
    """
    x, P = np.zeros(4), np.zeros((4, 4))
    x[:2], P[:2, :2], P[2:, 2:] = position, covariance, sd_velocity**2 * np.eye(2)
    return Start(float(time), x, P, row)


def start_from_rays(
    times: ArrayLike,
    measurements: ArrayLike,
    R: ArrayLike,
    sensor: Sensor,
    *,
    sd_velocity: float,
    least_crossing: float = LEAST_CROSSING,
) -> Start:
    """Start where the first rays meet that cross: bearings alone, H 6.3.3.

    The most likely position and velocity, given all rays up to the first that crosses another at
    ``least_crossing``. The target keeps its velocity between them; how well that is known beforehand says
    how much the rays may disagree, and goes into the covariance.

    Parameters
    ----------
    times, measurements, R, sensor
        As `run_filter` takes them; of a sensor whose measurements are directions. Of several detections in a
        frame the first is taken.
    sd_velocity
        m/s, of each axis of the velocity, which is zero in the mean.
    least_crossing
        rad, at which rays are far enough from parallel.

    Returns
    -------
    Start
        At the time of the last of those rays; none of them is used again.

    Raises
    ------
    WildlabError
        Where all rays are near parallel, meet behind the platform, or do not settle on a place; for a sensor
        without rays; and as `run_filter`.
    """
    given = checked(times, measurements, R, 1.0, None, sensor.sizes)
    check_rows(sensor.rows, len(given.times), "sensor")
    if sensor.ray is None:
        raise WildlabError(
            f"a sensor of {' and '.join(sensor.elements) or 'something else'} has no rays",
            "start on a position", field="sensor",
        )  # fmt: skip
    rows: list[int] = []
    seen, noises, origins, directions = list[Array](), list[Array](), list[Array](), list[Array]()
    widest = 0.0
    for row in range(len(given.times)):
        z, noise = _first_detection(given, row)
        if not np.isfinite(z).all():
            continue
        origin, direction = sensor.ray(row, z)
        if not (np.isfinite(origin).all() and np.isfinite(direction).all()):
            continue
        rows.append(row)
        seen.append(z)
        noises.append(noise)
        origins.append(origin[:2])
        directions.append(direction[:2])
        widest = largest_angle(np.array(directions))
        if widest >= least_crossing:
            break
    if widest < least_crossing:
        raise WildlabError(
            f"{len(rows)} rays are near parallel: they cross at {np.degrees(widest):.2g} degrees at most, "
            f"and {np.degrees(least_crossing):.2g} are needed",
            "move across the line of sight, give more of the flight, or give the filter a start of its own",
            field="rays",
        )
    middle = meeting_point(np.array(origins), np.array(directions))
    begin = start_from_position(given.times[rows[-1]], middle, np.zeros((2, 2)), sd_velocity, rows[-1])
    found = _fit(begin, np.array(rows), np.array(seen), np.array(noises), given.times, sensor)
    if found is None:
        raise WildlabError(
            f"{len(rows)} rays do not settle on one place",
            "check noise and poses, or give a start of your own",
            field="measurements",
        )
    return found


def meeting_point(origins: Array, directions: Array) -> Array:
    """The point with the least squares of distances (m) from all lines, (d,)."""
    unit = directions / np.linalg.norm(directions, axis=1, keepdims=True)
    away = np.eye(origins.shape[1]) - unit[:, :, None] * unit[:, None, :]
    return np.asarray(np.linalg.solve(away.sum(axis=0), np.einsum("rij,rj->i", away, origins)))


def largest_angle(directions: Array) -> float:
    """Largest angle (rad) between the lines of directions (r, d), seen from the two that are far apart."""
    if len(directions) < 2:
        return 0.0
    unit = directions / np.linalg.norm(directions, axis=1, keepdims=True)
    cosine = np.abs(unit @ unit[0])
    cosine = np.abs(unit @ unit[int(np.argmin(cosine))])
    return float(np.arccos(np.clip(cosine.min(), 0.0, 1.0)))


def _first_detection(given: FilterInputs, row: int) -> tuple[Array, Array]:
    """(m,) and (m, m) of the first detection of a row; NaN where there is none."""
    there = np.isfinite(given.z[row]).all(axis=1)
    first = int(np.argmax(there))
    return given.z[row, first], given.R[row, first]


def _fit(
    begin: Start, rows: NDArray[np.intp], z: Array, R: Array, times: Array, sensor: Sensor
) -> Start | None:
    """Most likely state given measurements (r, m), nothing else of the position, and the velocity's prior.

    None where a prediction is NaN on the way or the iteration does not settle.
    """
    m, r = z.shape[1], len(rows)
    # A velocity that is known is not looked for.
    free = [0, 1, *(2 + np.flatnonzero(np.diag(begin.P)[2:] > 0))]
    known = np.linalg.inv(begin.P[np.ix_(free[2:], free[2:])])
    V = np.zeros((r * m, r * m))
    for i in range(r):
        V[i * m : (i + 1) * m, i * m : (i + 1) * m] = R[i]
    x = begin.x.copy()
    for _ in range(STEPS):
        gaps, H_all = np.empty((r, m)), np.empty((r, m, 4))
        for i, row in enumerate(rows):
            F = np.eye(4)
            F[0, 2] = F[1, 3] = times[row] - begin.time
            seen = sensor.predict(int(row), (F @ x)[: sensor.states])
            gaps[i] = difference(z[i], seen.z, angles_at(sensor, int(row)))
            H_all[i] = on_state(seen.H_position, 4) @ F
        if not (np.isfinite(gaps).all() and np.isfinite(H_all).all()):
            return None
        H = H_all.reshape(r * m, 4)[:, free]
        weighed = np.linalg.solve(V, H)
        information = H.T @ weighed
        pull = weighed.T @ gaps.ravel()
        information[2:, 2:] += known
        pull[2:] += known @ (begin.x - x)[free[2:]]
        if np.linalg.cond(information / np.sqrt(np.outer(np.diag(information), np.diag(information)))) > 1e12:
            return None
        P = np.linalg.inv(information)
        step = P @ pull
        x[free] += step
        if np.all(np.abs(step) <= STILL * np.sqrt(np.diag(P))):
            break
    else:
        return None
    P_all = begin.P.copy()
    P_all[np.ix_(free, free)] = (P + P.T) / 2
    return begin._replace(x=x, P=P_all)
