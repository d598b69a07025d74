"""Steps of the Kalman filter, H (3.5) and (3.7), as functions without a state of their own; and of the
Schmidt-Kalman filter, H 7.4: the errors of the pose are considered, not estimated.

Beside the target's covariance ``P`` (n, n) the filter keeps its cross-covariance ``C`` (n, 6) with the errors
of the pose, whose own covariance ``P^o`` (6, 6) comes anew from the navigation filter at every frame. Nothing
here asks for six: a heading, a bias of the range, a clock or a focal length are no different. What a filter
needs of each error is its standard deviation, how long it lasts, and how the measurement depends on it.

With ``F^o = I`` H (7.32) keeps ``C`` from frame to frame while ``P^o`` changes. Where ``P^o`` grows that is
the model of an error with a random walk, and sound. Where it shrinks, ``[P C; C' P^o]`` stops being a
covariance as soon as the target is known about as well as the pose lets it be, which is soon: ``S`` and ``P``
turn negative within a few frames. So ``C -> C Phi'`` with ``Phi = (P^o_new P^o_old^-1)^(1/2)``: the thesis's
constant bias, which keeps its value, counted in standard deviations, when the navigation filter thinks anew
of its size. That leaves ``C`` alone while ``P^o`` does, as the thesis has it, and does not depend on the
units of the pose's errors. ``P^o_new - Phi P^o_old Phi'`` is zero, so what becomes of the joint covariance is
a congruence; and the Joseph form (7.37) takes a joint covariance to a joint covariance whatever the gain, and
adds ``K R K'``, so ``P`` stays positive definite. `limit_cross` guards against what rounding, or a ``P^o``
without variance in some direction, could still do.

Beyond the thesis, the bias may fade: ``C`` is multiplied by ``exp(-dt / correlation_time)``, as for a
first-order process whose variance is kept at ``P^o``. Infinity is the thesis's constant bias; zero forgets
``C`` at once and is the covariance inflation of H (7.40)-(7.41).

Errors have names. ``platform_north``, ``platform_east``, ``platform_down``
    m, of the platform's position in n.
``roll``, ``pitch``, ``heading``
    rad, of its attitude about the axes of b, or those that the sensor's derivatives are for. ``attitude`` is
    all three, ``tilt`` the first two.
``<element>_bias``
    Of what a sensor measures, in the element's own unit: ``range_bias``, ``bearing_bias``, ``u_bias``.
``clock``
    s, what the measurement's stamp is too early by.
``focal``
    No unit: the true focal length is the calibrated one times one plus the error.

An error is what is to be added to the known value for the true one. It fades as a first-order process of its
own correlation time, whose variance stays what the covariance says: ``C -> C M'`` with ``M`` diagonal. Errors
that are correlated with each other have one correlation time.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from wildlab.errors import WildlabError
from wildlab.geometry.compilation import compiled
from wildlab.geometry.covariances import check_covariance
from wildlab.geometry.frames import Array
from wildlab.tracking.sensors import POSE, Sensor

#: Variances below this share of the largest, in units in which all are one, count as zero: rounding.
NEGLIGIBLE = 1e-12
#: Where canonical correlations end: one, less what rounding could add.
LARGEST_CORRELATION = 1 - 1e-9


class Update(NamedTuple):
    """What a measurement did; ``C`` where errors are considered."""

    x: Array  # (..., n)
    P: Array  # (..., n, n)
    innovation: Array  # (..., m)
    S: Array  # (..., m, m)
    gain: Array  # (..., n, m)
    C: Array = np.empty((0, 0))  # (n, k)


def predict(x: Array, P: Array, F: Array, Q: Array) -> tuple[Array, Array]:
    """Prior estimate (..., n) and covariance (..., n, n), H (3.5a)-(3.5b); any leading axes."""
    prior = F @ P @ np.swapaxes(F, -1, -2) + Q
    return _times(F, x), (prior + np.swapaxes(prior, -1, -2)) / 2


def update(x: Array, P: Array, z: Array, H: Array, R: Array) -> Update:
    """Posterior after a measurement ``z`` (..., m) = H x + noise with covariance ``R``.

    H (3.5c)-(3.5h), Joseph form.
    """
    return correct(x, P, z - _times(H, x), H, R)


def correct(x: Array, P: Array, innovation: Array, H: Array, R: Array) -> Update:
    """Posterior of the extended filter, H (3.7d)-(3.7h), Joseph form; any leading axes.

    Parameters
    ----------
    innovation
        (..., m) measurement minus prediction, angles wrapped.
    H
        (..., m, n) derivative of the prediction at ``x``.
    R
        (..., m, m).
    """
    S = H @ P @ np.swapaxes(H, -1, -2) + R
    gain = np.asarray(np.swapaxes(np.linalg.solve(S, H @ P), -1, -2), float)
    kept = np.eye(x.shape[-1]) - gain @ H
    posterior = kept @ P @ np.swapaxes(kept, -1, -2) + gain @ R @ np.swapaxes(gain, -1, -2)
    posterior = (posterior + np.swapaxes(posterior, -1, -2)) / 2
    return Update(x + _times(gain, innovation), posterior, innovation, S, gain)


def _times(matrix: Array, vector: Array) -> Array:
    return np.asarray((matrix @ vector[..., None])[..., 0])


def spread_of_prediction(P: Array, C: Array, P_pose: Array, H: Array, H_pose: Array) -> Array:
    """Covariance (m, m) of the predicted measurement, H (7.34) without ``R``."""
    cross = H @ C @ H_pose.T
    S = H @ P @ H.T + cross + cross.T + H_pose @ P_pose @ H_pose.T
    return np.asarray((S + S.T) / 2)


def update_schmidt(
    x: Array, P: Array, C: Array, P_pose: Array, innovation: Array, H: Array, H_pose: Array, R: Array
) -> Update:
    """Posterior with the pose's errors considered and not estimated, H (7.34)-(7.38).

    Parameters
    ----------
    x, P, C
        Prior estimate (n,), covariance (n, n) and cross-covariance (n, k) with k errors.
    P_pose
        (k, k).
    innovation, H, H_pose, R
        (m,), (m, n), (m, k), (m, m), at ``x`` and the nominal pose.
    """
    S = spread_of_prediction(P, C, P_pose, H, H_pose) + R
    gain = np.asarray(np.linalg.solve(S, H @ P + H_pose @ C.T).T, float)
    kept = np.eye(len(x)) - gain @ H
    # The target's rows of (7.37), multiplied out as a whole: symmetric and positive by construction.
    both = np.block([[P, C], [C.T, P_pose]])
    rows = np.hstack([kept, -gain @ H_pose])
    posterior = rows @ both @ rows.T + gain @ R @ gain.T
    C_new = kept @ C - gain @ H_pose @ P_pose
    return Update(x + gain @ innovation, (posterior + posterior.T) / 2, innovation, S, gain, C_new)


def fade(dt: float, correlation_time: float) -> float:
    """What is left of a correlation after ``dt`` seconds; nothing with a correlation time of zero."""
    return 0.0 if correlation_time == 0 else float(np.exp(-dt / correlation_time))


@compiled
def root_of_covariance(covariance: Array) -> tuple[Array, Array]:
    """``A`` (k, r) with ``A A'`` the covariance, and its left inverse; directions without variance left out.

    By way of correlations, so that metres and radians weigh alike.
    """
    n = len(covariance)
    sd, inverse, scaled = np.empty(n), np.empty(n), np.empty((n, n))
    for i in range(n):
        sd[i] = np.sqrt(max(covariance[i, i], 0.0))
        inverse[i] = 1 / sd[i] if sd[i] > 0 else 0.0
    for i in range(n):
        for j in range(n):
            scaled[i, j] = covariance[i, j] * (inverse[i] * inverse[j])
    values, vectors = np.linalg.eigh(scaled)
    there = values > NEGLIGIBLE * max(values[-1], NEGLIGIBLE)
    lengths, vectors = np.sqrt(values[there]), np.ascontiguousarray(vectors[:, there])
    return sd.reshape(-1, 1) * vectors * lengths, np.ascontiguousarray((vectors / lengths).T) * inverse


def transition_of_pose(before: Array, after: Array) -> Array:
    """``Phi`` (k, k), see the module, from the pose's covariance before to that after."""
    return np.asarray(transitions_of_pose(np.stack([before, after]))[1])


def _without_noise(values: Array) -> Array:
    """Eigenvalues (..., n), ascending, of which those that are rounding beside the largest are zero.

    A pose that has lost its variance in some direction leaves 1e-16 there, and the root of that is 1e-8: on
    each processor another one.
    """
    return np.where(values > NEGLIGIBLE * values[..., -1:], np.maximum(values, 0), 0.0)


def transitions_of_pose(covariances: Array) -> Array:
    """``Phi`` (N, k, k) from each row's predecessor to it; rows of NaN are passed over, with the identity.

    All rows together: directions without variance are not left out but have a length of zero.
    """
    phi = np.tile(np.eye(covariances.shape[-1]), (len(covariances), 1, 1))
    known = np.flatnonzero(np.isfinite(covariances).all(axis=(1, 2)))
    rows, before, after = known[1:], covariances[known[:-1]], covariances[known[1:]]
    differ = (before != after).any(axis=(1, 2))
    before, after = before[differ], after[differ]
    sd = np.sqrt(np.maximum(np.diagonal(before, axis1=1, axis2=2), 0))
    per_sd = np.divide(1, sd, out=np.zeros_like(sd), where=sd > 0)
    values, vectors = np.linalg.eigh(before * per_sd[:, :, None] * per_sd[:, None, :])
    there = values > NEGLIGIBLE * np.maximum(values[:, -1:], NEGLIGIBLE)
    lengths = np.sqrt(np.where(there, values, 0))
    per_length = np.divide(1, lengths, out=np.zeros_like(lengths), where=there)
    root = sd[:, :, None] * vectors * lengths[:, None, :]
    inverse = np.swapaxes(vectors * per_length[:, None, :], 1, 2) * per_sd[:, None, :]
    kept, axes = np.linalg.eigh(inverse @ after @ np.swapaxes(inverse, 1, 2))
    kept = np.sqrt(_without_noise(kept))
    phi[rows[differ]] = root @ (axes * kept[:, None, :]) @ np.swapaxes(axes, 1, 2) @ inverse
    return phi


@compiled
def limit_cross(C: Array, P: Array, P_pose: Array) -> tuple[Array, bool]:
    """``C`` with no canonical correlation above one, and whether there was any; contiguous arrays.

    The nearest cross-covariance, in units of both covariances, with which ``[P C; C' P_pose]`` is one.
    """
    if not np.any(C):
        return C, False
    root, inverse = root_of_covariance(P)
    root_pose, inverse_pose = root_of_covariance(P_pose)
    if root.shape[1] == 0 or root_pose.shape[1] == 0:
        return np.zeros_like(C), True
    u, correlations, w = np.linalg.svd(inverse @ C @ np.ascontiguousarray(inverse_pose.T), False)
    lost = root.shape[1] < len(P) or root_pose.shape[1] < len(P_pose)
    too_high = correlations[0] > LARGEST_CORRELATION
    if not (too_high or lost):
        return C, False
    limited = (
        root @ np.ascontiguousarray(u * np.minimum(correlations, LARGEST_CORRELATION)) @ w
        @ np.ascontiguousarray(root_pose.T)
    )  # fmt: skip
    changed = bool(np.any(np.abs(limited - C) > 1e-9 * np.abs(C)))
    return limited, too_high or changed


#: One name for several.
TOGETHER = {"attitude": POSE[3:], "tilt": POSE[3:5], "platform_position": POSE[:3]}


class Considered(NamedTuple):
    """Named errors with what is known of them, for `run_filter` and the other filters.

    Attributes
    ----------
    names
        (k,) of the errors, see `wildlab.tracking.kalman`.
    covariance
        (N, k, k) at each of N measurements, or (k, k) for all; units of the errors squared.
    correlation_time
        s over which each fades, (k,) or one for all. Infinity is H's constant bias, zero H (7.40)-(7.41).
    shared
        (k,) whether targets of the same sensor have the error in common. A filter follows one target and does
        not look at it; who compares or joins targets does.
    """

    names: tuple[str, ...]
    covariance: Array
    correlation_time: float | tuple[float, ...] = np.inf
    shared: tuple[bool, ...] = ()


def consider_all(*several: Considered) -> Considered:
    """Several sets of errors as one, those of one uncorrelated with those of another.

    Parameters
    ----------
    several
        Errors of different names: a pose's with its covariance from the navigation filter, and others.

    Returns
    -------
    Considered

    Raises
    ------
    WildlabError
        Where a name comes twice, numbers of rows differ, or there is nothing.
    """
    names = tuple(name for one in several for name in one.names)
    twice = sorted({name for name in names if names.count(name) > 1})
    lengths = {len(one.covariance) for one in several if np.ndim(one.covariance) == 3}
    if not several or twice or len(lengths) > 1:
        raise WildlabError(
            f"{', '.join(twice)} twice" if twice else f"rows of {sorted(lengths)} and {len(several)} sets",
            "give each once, with equal rows", field="considered",
        )  # fmt: skip
    k = len(names)
    covariance = np.zeros((*((lengths.pop(),) if lengths else ()), k, k))
    first = 0
    for one in several:
        last = first + len(one.names)
        covariance[..., first:last, first:last] = one.covariance
        first = last
    times = tuple(
        float(time) for one in several for time in np.broadcast_to(one.correlation_time, len(one.names))
    )
    shared = tuple(flag for one in several for flag in (one.shared or (True,) * len(one.names)))
    return Considered(names, covariance, times, shared)


class Errors(NamedTuple):
    """Considered errors as a filter of N rows works with them."""

    covariance: Array  # (N, k, k), NaN where it is not known
    phi: Array  # (N, k, k) from the row known before, see `transitions_of_pose`
    times: Array  # (k,) correlation times
    columns: list[int]  # of ``H_pose``

    def carry(self, C: Array, F: Array, row: int, dt: float) -> Array:
        """Cross-covariance (n, k) taken to a row, ``F C Psi'``."""
        return np.asarray(F @ C @ self.phi[row].T * self.left(dt))

    def left(self, dt: float) -> Array:
        """Diagonal (k,) of ``M``, see the module: what is left of the errors after ``dt`` seconds."""
        return np.array([fade(dt, time) for time in self.times.tolist()])

    def transition(self, row: int, dt: float) -> Array:
        """``Psi`` (k, k) of the errors themselves, from the row before."""
        return np.asarray(self.left(dt)[:, None] * self.phi[row])


def errors_of(pose: Considered | None, sensor: Sensor, n_rows: int) -> Errors | None:
    """Considered errors ready for a filter, or None.

    Raises
    ------
    WildlabError
        For a covariance of another shape, or that is none; a correlation time below zero; or an error that
        the sensor's prediction has no derivative for.
    """
    if pose is None:
        return None
    k, P = len(pose.names), np.asarray(pose.covariance, float)
    if P.shape == (k, k):
        P = np.tile(P, (n_rows, 1, 1))
    if P.shape != (n_rows, k, k):
        raise WildlabError(
            f"shape {P.shape} for {n_rows} rows of measurements",
            f"give one ({k}, {k}) covariance for each measurement", field="pose.covariance",
        )  # fmt: skip
    unknown = [name for name in pose.names if name not in sensor.considers]
    if unknown:
        raise WildlabError(
            f"what is measured has no derivative for {', '.join(unknown)}",
            f"consider some of {', '.join(sensor.considers)}, or add columns with `considering`",
            field="pose.names",
        )
    times = np.asarray(pose.correlation_time, float)
    if times.shape not in ((), (k,)) or not (times >= 0).all():
        raise WildlabError(
            f"correlation times {pose.correlation_time} for {k} errors",
            "give one, or one each, in seconds", field="pose.correlation_time",
        )  # fmt: skip
    check_covariance(P[np.isfinite(P).all(axis=(1, 2))], "pose.covariance")
    columns = [sensor.considers.index(name) for name in pose.names]
    times = np.broadcast_to(times, k)
    apart: NDArray[np.bool_] = times[:, None] != times
    if (np.nan_to_num(P)[:, apart] != 0).any():
        raise WildlabError(
            "errors of different correlation times are correlated",
            "give those that are correlated one time",
            field="pose.correlation_time",
        )
    return Errors(P, transitions_of_pose(P), times, columns)
