"""Where a filter starts: from a position, from a measurement that speaks of one, or from several rays."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from wildlab.errors import WildlabError
from wildlab.geometry.frames import Array
from wildlab.tracking.consider_parameters import Considers, Errors, errors_of
from wildlab.tracking.inputs import check_rows, checked
from wildlab.tracking.rays import LEAST_CROSSING, largest_angle, meeting_point, near_parallel
from wildlab.tracking.records import FilterInputs, Start
from wildlab.tracking.sensors import Sensor, angles_at, check_states, difference, on_state

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
    time: float,
    position: ArrayLike,
    covariance: ArrayLike,
    *,
    n: int = 4,
    velocity: ArrayLike = (0.0, 0.0),
    sd_velocity: ArrayLike = 0.0,
    sd_acceleration: float = 0.0,
    row: int = -1,
) -> Start:
    """Start on a position that is known with a covariance, and a velocity if there is one.

    Parameters
    ----------
    time
        s.
    position, covariance
        (2,) north, east in n, m, and (2, 2).
    n
        Number of states: 2, 4 or 6.
    velocity
        (2,) m/s, as optical flow or a Doppler measurement gives it; zero where nothing is known.
    sd_velocity
        m/s, a number for both axes, or the velocity's covariance (2, 2).
    sd_acceleration
        m/s^2, with six states.
    row
        The measurement that the position was made from; -1: none.

    Returns
    -------
    Start
    """
    x, P = np.zeros(6), np.zeros((6, 6))
    spread = np.asarray(sd_velocity, float)
    x[:2], x[2:4] = position, velocity
    P[:2, :2] = covariance
    P[2:4, 2:4] = spread if spread.ndim == 2 else spread**2 * np.eye(2)
    P[4:, 4:] = sd_acceleration**2 * np.eye(2)
    return Start(float(time), x[:n], P[:n, :n], row)


def start_from_measurement(
    times: ArrayLike,
    measurements: ArrayLike,
    R: ArrayLike,
    sensor: Sensor,
    *,
    n: int = 4,
    velocity: ArrayLike = (0.0, 0.0),
    sd_velocity: ArrayLike = 0.0,
    sd_acceleration: float = 0.0,
    pose: Considers | None = None,
) -> Start:
    """Start on the first measurement that speaks of a position: a pixel over a plane, a range with a bearing.

    The covariance is what the measurement's noise and the considered errors make of the position, by the
    sensor's own derivatives; and the start knows what it has in common with those errors.

    Parameters
    ----------
    times, measurements, R, sensor
        As `run_filter` takes them. Of several detections in a frame the first is taken.
    n, velocity, sd_velocity, sd_acceleration
        As in `start_from_position`.
    pose
        Errors to consider, as the filter will have them.

    Returns
    -------
    Start
        At the time of that row, which is not used again.

    Raises
    ------
    WildlabError
        Where no measurement gives a position, and as `run_filter`.

    Examples
    --------
    >>> from wildlab.tracking import ranges_bearings
    >>> sensor = ranges_bearings([0.0, 0.0], 0.0)
    >>> start = start_from_measurement([0.0], [[100.0, 0.0]], np.diag([4.0, 1e-4]), sensor, n=2)
    >>> start.x.tolist(), np.diag(start.P).round(3).tolist()
    ([100.0, 0.0], [4.0, 1.0])
    """
    given = checked(times, measurements, R, 1.0, None, sensor.sizes)
    check_rows(sensor.rows, len(given.times), "sensor")
    check_states(sensor, n)
    errors = errors_of(pose, sensor, len(given.times))
    where = sensor.locate
    for row in range(len(given.times)):
        z, noise = _first_detection(given, row)
        known = errors is None or np.isfinite(errors.covariance[row]).all()
        near = np.full(2, np.nan)
        if where is not None and known and np.isfinite(z).all():
            near = where(row, z)
        if np.isfinite(near).all():
            begin = start_from_position(
                given.times[row], near, np.zeros((2, 2)), n=n, velocity=velocity, sd_velocity=sd_velocity,
                sd_acceleration=sd_acceleration, row=row,
            )  # fmt: skip
            found = _fit(begin, np.array([row]), z[None], noise[None], given.times, sensor, errors)
            if found is not None:
                return found
    raise WildlabError(
        "no measurement gives a position to start from",
        "check poses and plane, or start from several rays, or give the filter a start of its own",
        field="measurements",
    )


def start_from_rays(
    times: ArrayLike,
    measurements: ArrayLike,
    R: ArrayLike,
    sensor: Sensor,
    *,
    n: int = 4,
    velocity: ArrayLike = (0.0, 0.0),
    sd_velocity: ArrayLike = 0.0,
    sd_acceleration: float = 0.0,
    pose: Considers | None = None,
    least_crossing: float = LEAST_CROSSING,
) -> Start:
    """Start where the first rays meet that cross: bearings alone, H 6.3.3.

    The most likely position, and velocity, given all rays up to the first that crosses another at
    ``least_crossing``. The target keeps its velocity between them; how well that is known beforehand says
    how much the rays may disagree, and goes into the covariance.

    Parameters
    ----------
    times, measurements, R, sensor
        As `run_filter` takes them; of a sensor whose measurements are directions. Of several detections in a
        frame the first is taken.
    n, velocity, sd_velocity, sd_acceleration
        As in `start_from_position`.
    pose
        Errors to consider, as the filter will have them.
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
    check_states(sensor, n)
    errors = errors_of(pose, sensor, len(given.times))
    if sensor.ray is None:
        raise WildlabError(
            f"a sensor of {' and '.join(sensor.elements) or 'something else'} has no rays",
            "use start_from_measurement", field="sensor",
        )  # fmt: skip
    rows: list[int] = []
    seen, noises, origins, directions = list[Array](), list[Array](), list[Array](), list[Array]()
    widest = 0.0
    for row in range(len(given.times)):
        z, noise = _first_detection(given, row)
        if not np.isfinite(z).all() or (errors is not None and not np.isfinite(errors.covariance[row]).all()):
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
        raise near_parallel(len(rows), widest, least_crossing)
    middle = meeting_point(np.array(origins), np.array(directions))
    begin = start_from_position(
        given.times[rows[-1]], middle, np.zeros((2, 2)), n=n, velocity=velocity, sd_velocity=sd_velocity,
        sd_acceleration=sd_acceleration, row=rows[-1],
    )  # fmt: skip
    found = _fit(begin, np.array(rows), np.array(seen), np.array(noises), given.times, sensor, errors)
    if found is None:
        raise WildlabError(
            f"{len(rows)} rays do not settle on one place",
            "check noise and poses, or give a start of your own",
            field="measurements",
        )  # fmt: skip
    return found


def _first_detection(given: FilterInputs, row: int) -> tuple[Array, Array]:
    """(m,) and (m, m) of the first detection of a row; NaN where there is none."""
    there = np.isfinite(given.z[row]).all(axis=1)
    first = int(np.argmax(there))
    return given.z[row, first], given.R[row, first]


def _fit(
    begin: Start,
    rows: NDArray[np.intp],
    z: Array,
    R: Array,
    times: Array,
    sensor: Sensor,
    errors: Errors | None,
) -> Start | None:
    """Most likely state given measurements (r, m), nothing else of the position, and the velocity's prior.

    None where a prediction is NaN on the way or the iteration does not settle.
    """
    n, m, r = len(begin.x), z.shape[1], len(rows)
    moving = min(n, 4)
    prior = begin.P[2:moving, 2:moving]
    free = [0, 1, *(2 + np.flatnonzero(np.diag(prior) > 0))]  # a velocity that is known is not looked for
    x = begin.x.copy()
    known = (
        np.linalg.inv(prior[np.ix_(prior.diagonal() > 0, prior.diagonal() > 0)]) if len(free) > 2 else None
    )
    by_errors = _correlated(errors, rows, times) if errors is not None else None
    for _ in range(STEPS):
        gaps, H_all, H_errors = np.empty((r, m)), np.empty((r, m, n)), []
        for i, row in enumerate(rows):
            dt = times[row] - begin.time
            F = np.eye(n)
            if n >= 4:
                F[0, 2] = F[1, 3] = dt
            seen = sensor.predict(int(row), (F @ x)[: sensor.states])
            gaps[i] = difference(z[i], seen.z, angles_at(sensor, int(row)))
            H_all[i] = on_state(seen.H_position, n) @ F
            H_errors.append(np.zeros((m, 0)) if errors is None else errors.of(seen.H_pose))
        if not (np.isfinite(gaps).all() and np.isfinite(H_all).all()):
            return None
        V = np.zeros((r * m, r * m))
        for i in range(r):
            V[i * m : (i + 1) * m, i * m : (i + 1) * m] = R[i]
        if by_errors is not None:
            wide = _diagonal(H_errors)
            V += wide @ by_errors @ wide.T
        H = H_all.reshape(r * m, n)[:, free]
        weighed = np.linalg.solve(V, H)
        information = H.T @ weighed
        pull = weighed.T @ gaps.ravel()
        if known is not None:
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
    C = None
    if errors is not None and by_errors is not None:
        C = np.zeros((n, errors.k))
        last = by_errors[:, (r - 1) * errors.k :]
        C[free] = -P @ weighed.T @ _diagonal(H_errors) @ last
    return begin._replace(x=x, P=P_all, C=C)


def _diagonal(blocks: list[Array]) -> Array:
    """(r m, r k) with the blocks (m, k) on the diagonal."""
    m, k = blocks[0].shape
    whole = np.zeros((len(blocks) * m, len(blocks) * k))
    for i, block in enumerate(blocks):
        whole[i * m : (i + 1) * m, i * k : (i + 1) * k] = block
    return whole


def _correlated(errors: Errors, rows: NDArray[np.intp], times: Array) -> Array:
    """Covariance (r k, r k) of the considered errors at several rows."""
    k, r = errors.k, len(rows)
    whole = np.zeros((r * k, r * k))
    for i in range(r):
        block = errors.covariance[rows[i]]
        whole[i * k : (i + 1) * k, i * k : (i + 1) * k] = block
        for j in range(i + 1, r):
            for row in range(rows[j - 1] + 1, rows[j] + 1):
                block = errors.transition(row, times[row] - times[row - 1]) @ block
            whole[j * k : (j + 1) * k, i * k : (i + 1) * k] = block
            whole[i * k : (i + 1) * k, j * k : (j + 1) * k] = block.T
    return whole
