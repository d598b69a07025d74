"""The Schmidt-Kalman filter, H 7.4: the errors of the pose are considered, not estimated.

Beside the target's covariance ``P`` (n, n) the filter keeps its cross-covariance ``C`` (n, 6) with the errors
of the pose, whose own covariance ``P^o`` (6, 6) comes anew from the navigation filter at every frame. Nothing
here asks for six: other errors, by name and in any number, are in `wildlab.tracking.consider_parameters`.

With ``F^o = I`` H (7.32) keeps ``C`` from frame to frame while ``P^o`` changes. Where ``P^o`` grows that is
the model of an error with a random walk, and sound. Where it shrinks, ``[P C; C' P^o]`` stops being a
covariance as soon as the target is known about as well as the pose lets it be, which is soon: ``S`` and ``P``
turn negative within a few frames. So ``C -> C Phi'``, with ``Phi`` from ``P^o_old`` and ``P^o_new`` in their
common axes, in which the one is ``1`` and the other ``lambda``:

``"bias"``
    ``Phi = (P^o_new P^o_old^-1)^(1/2)``, in its axes ``lambda^(1/2)``. The thesis's constant bias: the error
    keeps its value, counted in standard deviations, when the navigation filter thinks anew of its size.
``"navigated"``
    ``min(1, lambda)`` in its axes. Growth is a random walk, with ``C`` kept as in (7.32); shrinkage is what
    an optimal navigation filter does with a measurement, after which the part of its error that is gone has
    nothing to do with what is left. Every rise and fall of ``P^o`` makes the error a little newer.

Either leaves ``C`` alone while ``P^o`` does, as the thesis has it, and neither depends on the units of the
pose's errors. Both guarantee a joint covariance: ``P^o_new - Phi P^o_old Phi'`` is zero in the first and
``lambda - min(1, lambda)^2 >= 0`` in the second, so what becomes of the joint covariance is a congruence plus
a covariance; and the Joseph form (7.37) takes a joint covariance to a joint covariance whatever the gain, and
adds ``K R K'``, so ``P`` stays positive definite. `limit_cross` guards against what rounding, or a ``P^o``
without variance in some direction, could still do.

Beyond the thesis, the bias may fade: ``C`` is multiplied by ``exp(-dt / correlation_time)``, as for a
first-order process whose variance is kept at ``P^o``. Infinity is the thesis's constant bias; zero forgets
``C`` at once and is the covariance inflation of H (7.40)-(7.41).
"""

from __future__ import annotations

from typing import Literal, NamedTuple

import numpy as np

from wildlab.geometry.frames import Array

Change = Literal["bias", "navigated"]

#: Variances below this share of the largest, in units in which all are one, count as zero: rounding.
NEGLIGIBLE = 1e-12
#: Where canonical correlations end: one, less what rounding could add.
LARGEST_CORRELATION = 1 - 1e-9


class PoseUncertainty(NamedTuple):
    """What the navigation filter says of the camera's pose at each of N measurements.

    Attributes
    ----------
    covariance
        (N, 6, 6): position in n (m), attitude error in b (rad), H (7.39).
    correlation_time
        s over which the pose's error fades; infinity is H's constant bias, zero H (7.40)-(7.41).
    change
        What the pose's error does when its covariance changes, see the module.
    """

    covariance: Array
    correlation_time: float = np.inf
    change: Change = "bias"


class SchmidtUpdate(NamedTuple):
    """What a measurement did: new estimate and cross-covariance, and the innovation with its covariance."""

    x: Array  # (n,)
    P: Array  # (n, n)
    C: Array  # (n, k)
    innovation: Array  # (m,)
    S: Array  # (m, m)
    gain: Array  # (n, m)


def spread_of_prediction(P: Array, C: Array, P_pose: Array, H: Array, H_pose: Array) -> Array:
    """Covariance (m, m) of the predicted measurement, H (7.34) without ``R``."""
    cross = H @ C @ H_pose.T
    S = H @ P @ H.T + cross + cross.T + H_pose @ P_pose @ H_pose.T
    return np.asarray((S + S.T) / 2)


def update_schmidt(
    x: Array, P: Array, C: Array, P_pose: Array, innovation: Array, H: Array, H_pose: Array, R: Array
) -> SchmidtUpdate:
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
    return SchmidtUpdate(x + gain @ innovation, (posterior + posterior.T) / 2, C_new, innovation, S, gain)


def fade(dt: float, correlation_time: float) -> float:
    """What is left of a correlation after ``dt`` seconds; nothing with a correlation time of zero."""
    return 0.0 if correlation_time == 0 else float(np.exp(-dt / correlation_time))


def _root(covariance: Array) -> tuple[Array, Array]:
    """``A`` (k, r) with ``A A'`` the covariance, and its left inverse; directions without variance left out.

    By way of correlations, so that metres and radians weigh alike.
    """
    sd = np.sqrt(np.maximum(np.diag(covariance), 0))
    inverse = np.divide(1, sd, out=np.zeros_like(sd), where=sd > 0)
    values, vectors = np.linalg.eigh(covariance * np.outer(inverse, inverse))
    there = values > NEGLIGIBLE * max(float(values[-1]), NEGLIGIBLE)
    lengths, vectors = np.sqrt(values[there]), vectors[:, there]
    return sd[:, None] * vectors * lengths, (vectors / lengths).T * inverse


def transition_of_pose(before: Array, after: Array, change: Change) -> Array:
    """``Phi`` (k, k), see the module, from the pose's covariance before to that after."""
    root, inverse = _root(before)
    values, axes = np.linalg.eigh(inverse @ after @ inverse.T)
    values = _without_noise(values)
    kept = np.sqrt(values) if change == "bias" else np.minimum(values, 1)
    return np.asarray(root @ (axes * kept) @ axes.T @ inverse)


def _without_noise(values: Array) -> Array:
    """Eigenvalues (..., n), ascending, of which those that are rounding beside the largest are zero.

    A pose that has lost its variance in some direction leaves 1e-16 there, and the root of that is 1e-8: on
    each processor another one.
    """
    return np.where(values > NEGLIGIBLE * values[..., -1:], np.maximum(values, 0), 0.0)


def transitions_of_pose(covariances: Array, change: Change) -> Array:
    """``Phi`` (N, k, k) from each row's predecessor to it; rows of NaN are passed over, with the identity.

    Row by row what `transition_of_pose` gives, all rows together: directions without variance are not left
    out but have a length of zero.
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
    kept = _without_noise(kept)
    kept = np.sqrt(kept) if change == "bias" else np.minimum(kept, 1)
    phi[rows[differ]] = root @ (axes * kept[:, None, :]) @ np.swapaxes(axes, 1, 2) @ inverse
    return phi


def limit_cross(C: Array, P: Array, P_pose: Array) -> tuple[Array, bool]:
    """``C`` with no canonical correlation above one, and whether there was any.

    The nearest cross-covariance, in units of both covariances, with which ``[P C; C' P_pose]`` is one.
    """
    root, inverse = _root(P)
    root_pose, inverse_pose = _root(P_pose)
    whitened = inverse @ C @ inverse_pose.T
    u, correlations, v = np.linalg.svd(whitened, full_matrices=False)
    lost = root.shape[1] < len(P) or root_pose.shape[1] < len(P_pose)
    too_high = bool(correlations.size and correlations[0] > LARGEST_CORRELATION)
    if not (too_high or (lost and C.any())):
        return C, False
    limited = root @ (u * np.minimum(correlations, LARGEST_CORRELATION)) @ v @ root_pose.T
    return np.asarray(limited), too_high or not np.allclose(limited, C, rtol=1e-9, atol=0)
