"""Other filters with the arguments of `wildlab.tracking.run.run_filter`: differenced measurements, whose
noise is correlated in time (H (7.5)-(7.12)), sigma points by
filterpy, and several motion models (H 3.2.3). Poses are taken as true.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.linalg import expm

from wildlab.errors import WildlabError
from wildlab.geometry.frames import Array
from wildlab.tracking.association import Nearest, nearest_detection
from wildlab.tracking.kalman import correct, predict
from wildlab.tracking.motion import Motion
from wildlab.tracking.run import (
    Start,
    State,
    Track,
    check_sensor,
    check_start,
    checked,
    record,
    single_detection,
    step_through,
)
from wildlab.tracking.sensors import Sensor, angles_at, difference, on_state


class Differenced(NamedTuple):
    """The model of H (7.7)-(7.12) over one interval between two measurements.

    ``y = z_2 - F_c z_1 = H x_1 + noise R`` and ``x_2 = F x_1 + T y + noise Q``, noises uncorrelated.
    """

    H: Array  # (m, n) the print's H*
    R: Array  # (m, m)
    F: Array  # (n, n) the print's F*
    Q: Array  # (n, n) the print's Q*
    T: Array  # (n, m)


def difference_model(F: Array, Q: Array, H: Array, F_c: Array, R_w: Array) -> Differenced:
    """H (7.7)-(7.12) for a motion (F, Q) from one measurement to the next."""
    H_star = H @ F - F_c @ H
    R = H @ Q @ H.T + R_w
    T = np.asarray(np.linalg.solve(R, H @ Q).T, float)
    # Q - Q H' R^-1 H Q, in the form that cannot turn negative.
    kept = np.eye(len(F)) - T @ H
    return Differenced(H_star, R, F - T @ H_star, kept @ Q @ kept.T + T @ R_w @ T.T, T)


def run_coloured(
    times: ArrayLike,
    positions: ArrayLike,
    R_w: ArrayLike,
    motion: Motion,
    start: Start,
    *,
    F_c: ArrayLike | None = None,
    longest_gap: float = 1.0,
    output_times: ArrayLike | None = None,
) -> Track:
    """Filter on differences of successive positions, H 7.2.2.

    The difference to the next measurement updates the estimate at the earlier of the two, over the time
    between them, and only then is the estimate taken to the later one. A measurement that follows the last
    used one by more than ``longest_gap`` is used directly, with ``R_w`` as white noise. NaN is passed
    over: the next is held against the last used one.

    The innovation, ``S`` and NIS of a row are those of its difference (or of the measurement, after a gap).

    Parameters
    ----------
    times
        (N,) s, in order.
    positions
        (N, 2) north, east in n, m; rows of NaN are frames without a detection.
    R_w
        (2, 2) or (N, 2, 2), m^2: of the noise that drives the correlated one, H (7.5).
    motion
        From `wildlab.tracking.motion`, of n states.
    start
        ``x`` (n,) and ``P`` (n, n). Its row is the first measurement of a difference.
    F_c
        (2, 2), the correlated noise's transition from one measurement to the next; identity in H, and where
        it is left out.
    longest_gap
        s, H 7.2.2.
    output_times
        (M,) s, in order; the measurements' own when not given.

    Returns
    -------
    Track

    Raises
    ------
    WildlabError
        As `wildlab.tracking.run.run_filter`; and for several detections in a frame.
    """
    given = single_detection(checked(times, positions, R_w, 1.0, output_times))
    check_start(start)
    H, F_c = np.eye(2, len(start.x)), np.eye(2) if F_c is None else np.asarray(F_c, float)
    last = start.row if start.row >= 0 and np.isfinite(given.z[start.row]).all() else -1

    def step(row: int, state: State, track: Track) -> State:
        nonlocal last
        then, x, P = state
        now, z, R = float(given.times[row]), given.z[row, 0], given.R[row, 0]
        if not np.isfinite(z).all():
            return state
        direct = last < 0 or now - given.times[last] > longest_gap
        F, Q = motion(now - then)
        prior, spread = predict(x, P, F, Q)
        model = difference_model(F, Q, H, F_c, R)
        if direct:
            found, H_now, P_now = z - prior[:2], H, spread
        else:
            found, H_now, P_now, R = (
                z - prior[:2] - F_c @ (given.z[last, 0] - x[:2]), model.H, P, model.R
            )  # fmt: skip
        best = nearest_detection(
            found[None], np.zeros(2), H_now @ P_now @ H_now.T, R[None], (False, False), row
        )
        if best is None:
            return state
        record(track, row, best.innovation, best.S, best.nis, 0, True)
        last = row
        if direct:
            done = correct(prior, spread, best.innovation, H, R)
            return now, done.x, done.P
        done = correct(x, P, best.innovation, model.H, model.R)
        _, P_new = predict(done.x, done.P, model.F, model.Q)
        left = best.innovation - model.H @ (done.x - x)
        return now, F @ done.x + model.T @ left, P_new

    return step_through(given, start, motion, step)


def thin(times: ArrayLike, interval: float, usable: ArrayLike | None = None) -> NDArray[np.bool_]:
    """Which of N measurements, in order of time, to keep so that no two are closer than ``interval``.

    The first is kept, then the first at least ``interval`` after the last kept.

    Parameters
    ----------
    times
        (N,) s, in order. Rows without a time are not kept.
    interval
        s.
    usable
        (N,) bool: rows that are not are neither kept nor counted. All are when it is left out.

    Returns
    -------
    (N,) bool: the rows to keep.
    """
    t = np.asarray(times, float)
    ready = np.isfinite(t) if usable is None else np.isfinite(t) & np.asarray(usable, bool)
    kept, last = np.zeros(len(t), bool), -np.inf
    for row in np.flatnonzero(ready):
        if t[row] - last >= interval * (1 - 1e-9):
            kept[row], last = True, t[row]
    return kept


def run_unscented(
    times: ArrayLike,
    measurements: ArrayLike,
    R: ArrayLike,
    sensor: Sensor,
    motion: Motion,
    start: Start,
    *,
    output_times: ArrayLike | None = None,
) -> Track:
    """Unscented Kalman filter, on one detection per row.

    Sigma points at ``sqrt(n)`` standard deviations, all of one weight and none in the middle (alpha 1, beta
    0, kappa 0: the cubature rule). No weight is negative, so no covariance can be; a larger beta is for
    points close to the middle, and would count the bend twice here. A row is left out when any point is
    behind the camera.

    Parameters
    ----------
    times
        (N,) s, in order.
    measurements
        (N, m) in the sensor's units; rows of NaN are frames without a detection.
    R
        (m, m) or (N, m, m), in the sensor's units squared.
    sensor
        From `wildlab.tracking.sensors`, with a pose for each row.
    motion
        From `wildlab.tracking.motion`, of n states.
    start
        ``x`` (n,) and ``P`` (n, n), positive definite but for states that are known: sigma points need its
        root.
    output_times
        (M,) s, in order; the measurements' own when not given.

    Returns
    -------
    Track

    Raises
    ------
    WildlabError
        Naming field and row: shapes that do not fit each other, times missing or out of order, several
        detections in a frame, an ``R`` that is not positive definite, a start that is not finite or whose
        ``P`` is no covariance, poses of another length than the measurements.
    numpy.linalg.LinAlgError
        For a covariance that is not positive definite among the states that have a variance.
    """
    # Imported here, for it brings scipy.stats along, which takes longer than all else that is imported.
    from filterpy.kalman import MerweScaledSigmaPoints, UnscentedKalmanFilter

    given = single_detection(checked(times, measurements, R, 1.0, output_times, sensor.sizes))
    check_sensor(sensor, start, len(given.times))
    n, m = len(start.x), given.z.shape[2]
    angles = sensor.angles
    wrapped = any(angles) if sensor.row_angles is None else bool(sensor.row_angles.any())

    def mean(points: Array, weights: Array) -> Array:
        """Angles are averaged as differences from the first, which is the middle one."""
        return np.asarray(points[0] + weights @ difference(points, points[0], angles))

    def residual(a: Array, b: Array) -> Array:
        return difference(a, b, angles)

    ukf = UnscentedKalmanFilter(
        n, m, 1.0, hx=None, fx=None, points=MerweScaledSigmaPoints(n, 1.0, 0.0, 0.0, sqrt_method=_root),
        z_mean_fn=mean if wrapped else None, residual_z=residual,
    )  # fmt: skip

    def step(row: int, state: State, track: Track) -> State:
        nonlocal angles
        angles = angles_at(sensor, row)
        then, ukf.x, ukf.P = state
        F, ukf.Q = motion(given.times[row] - then)
        ukf.predict(fx=lambda x, dt: F @ x)
        prior = given.times[row], ukf.x.copy(), (ukf.P + ukf.P.T) / 2
        if not np.isfinite(given.z[row, 0]).all():
            return prior
        seen = sensor.predict(row, ukf.sigmas_f[:, : sensor.states]).z
        if not np.isfinite(seen).all():
            return prior
        points = iter(seen)
        ukf.update(given.z[row, 0], R=given.R[row, 0], hx=lambda x: next(points))
        nis = float(ukf.y @ np.linalg.solve(ukf.S, ukf.y))
        record(track, row, ukf.y, ukf.S, nis, 0, True)
        return given.times[row], ukf.x, (ukf.P + ukf.P.T) / 2

    return step_through(given, start, motion, step)


def _root(P: Array) -> Array:
    """Upper root (n, n) of a covariance; zero for states without variance, as speeds of targets at rest."""
    there, root = np.ix_(*2 * (np.diag(P) > 0,)), np.zeros_like(P)
    root[there] = np.linalg.cholesky(P[there]).T
    return root


#: A mode that fits this much worse than the best keeps so small a share, and can come back.
LEAST_LIKELIHOOD = 1e-100


def run_imm(
    times: ArrayLike,
    measurements: ArrayLike,
    R: ArrayLike,
    sensor: Sensor,
    motions: Sequence[Motion],
    mean_stay: Sequence[float],
    start: Start,
) -> Track:
    """Interacting multiple models over extended filters, H 3.2.3.

    All models start alike and equally probable. Innovation, ``S`` and NIS are the mixture's.

    Parameters
    ----------
    times
        (N,) s, in order.
    measurements
        (N, m) in the sensor's units; rows of NaN are frames without a detection.
    R
        (m, m) or (N, m, m), in the sensor's units squared.
    sensor
        From `wildlab.tracking.sensors`, with a pose for each row.
    motions
        K >= 2 models of the same n states.
    mean_stay
        (K,) s that each lasts on average; it is left for each of the others alike. The probabilities of
        switching over a step follow from it for any step.
    start
        ``x`` (n,) and ``P`` (n, n), see `wildlab.tracking.run.Start`.

    Returns
    -------
    Track
        The mixture's.

    Raises
    ------
    WildlabError
        As `wildlab.tracking.run.run_filter`; several detections in a frame; fewer than two models, or not
        one ``mean_stay`` above zero for each.
    """
    given = single_detection(checked(times, measurements, R, 1.0, None, sensor.sizes))
    check_sensor(sensor, start, len(given.times))
    K, stay = len(motions), np.asarray(mean_stay, float)
    if K < 2 or stay.shape != (K,) or not (stay > 0).all():
        raise WildlabError(
            f"{K} motion models and mean_stay {tuple(mean_stay)}",
            "give two models or more, and how long each lasts",
            field="mean_stay",
        )
    rates = np.tile(1 / stay[:, None] / (K - 1), (1, K))
    np.fill_diagonal(rates, -1 / stay)
    xs, Ps = [np.asarray(start.x, float)] * K, [np.asarray(start.P, float)] * K
    weights = np.full(K, 1 / K)

    def mixed(means: Sequence[Array], covariances: Sequence[Array], shares: Array) -> tuple[Array, Array]:
        centre = np.tensordot(shares, means, 1)
        off = np.asarray(means) - centre
        spread = np.asarray(covariances) + off[:, :, None] * off[:, None, :]
        return np.asarray(centre), np.asarray(np.tensordot(shares, spread, 1))

    def compare(row: int, x: Array, P: Array) -> tuple[Nearest, Array] | None:
        """What this mode makes of a row, with its ``H``; None where its target would not be seen."""
        expected, R_now = sensor.predict(row, x[: sensor.states]), given.R[row, 0]
        if not all(np.isfinite(part).all() for part in (expected.z, expected.H_position, R_now)):
            return None
        H = on_state(expected.H_position, len(x))
        angles = angles_at(sensor, row)
        near = nearest_detection(given.z[row], expected.z, H @ P @ H.T, R_now[None], angles, row)
        return None if near is None else (near, H)

    def step(row: int, state: State, track: Track) -> State:
        nonlocal xs, Ps, weights
        dt = given.times[row] - state[0]
        joint = weights[:, None] * expm(rates * dt)
        weights = joint.sum(axis=0)
        begun = [mixed(xs, Ps, shares) for shares in (joint / weights).T]
        prior = [predict(*one, *motion(dt)) for one, motion in zip(begun, motions, strict=True)]
        xs, Ps = [x for x, _ in prior], [P for _, P in prior]
        found = [one for one in (compare(row, *mode) for mode in prior) if one is not None]
        if len(found) == K:
            middle = found[0][0].innovation  # angles: the others' are near it, on the same side of the wrap
            gaps = [middle + difference(one.innovation, middle, angles_at(sensor, row)) for one, _ in found]
            innovation, S = mixed(gaps, [one.S for one, _ in found], weights)
            nis = float(innovation @ np.linalg.solve(S, innovation))
            record(track, row, innovation, S, nis, 0, True)
            logs = np.array([-(one.nis + np.linalg.slogdet(2 * np.pi * one.S)[1]) / 2 for one, _ in found])
            weights = weights * np.maximum(np.exp(logs - logs.max()), LEAST_LIKELIHOOD)
            weights = weights / weights.sum()
            after = [
                correct(*mode, one.innovation, H, given.R[row, 0])
                for mode, (one, H) in zip(prior, found, strict=True)
            ]
            xs, Ps = [one.x for one in after], [one.P for one in after]
        x, P = mixed(xs, Ps, weights)
        return given.times[row], x, (P + P.T) / 2

    return step_through(given, start, motions[0], step)
