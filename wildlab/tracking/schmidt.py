"""The Schmidt-Kalman filter, H 7.4: the errors of the pose are not estimated, but reckoned with.

Beside the target's covariance ``P`` (n, n) the filter keeps its cross-covariance ``C`` (n, 6) with the errors
of the pose, whose own covariance ``P^o`` (6, 6) comes anew from the navigation filter at every frame.

With ``F^o = I`` H (7.32) keeps ``C`` from frame to frame while ``P^o`` changes. Where ``P^o`` grows that is
the model of an error with a random walk, and sound. Where it shrinks, ``[P C; C' P^o]`` may stop being a
covariance: the pose's error would be more closely tied to the target's than it is to itself, and ``P`` can
turn negative. Two ways lead from one frame to the next:

``"kept"``
    The thesis's: ``C`` stays, the error is a constant bias.
``"scaled"``
    The error keeps its value counted in standard deviations: ``C -> C Phi'`` with
    ``Phi = (P^o_new P^o_old^-1)^(1/2)``, for which ``Phi P^o_old Phi' = P^o_new``. The joint covariance is
    carried by a congruence and stays a covariance; a ``P^o`` that returns to what it was brings ``C`` back,
    and an unchanged one leaves it alone. It does not depend on the units of the pose's errors.

After either, `limit_cross` brings every canonical correlation of target and pose above one down to one, which
is the condition for ``[P C; C' P^o]`` to be a covariance, and leaves ``C`` untouched where there is none. It
is this that keeps the filter sound for any sequence of ``P^o``: the Joseph form (7.37) takes a joint
covariance to a joint covariance whatever the gain, and adds ``K R K'``, so ``P`` stays positive definite.

Beyond the thesis, the bias may fade: ``C`` is multiplied by ``exp(-dt / correlation_time)``, as for a
first-order process whose variance is kept at ``P^o``. Infinity is the thesis's constant bias; zero forgets
``C`` at once and is the covariance inflation of H (7.40)-(7.41).
"""

from __future__ import annotations

from typing import Literal, NamedTuple

import numpy as np

from wildlab.geometry.frames import Array

Change = Literal["kept", "scaled"]

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
        What becomes of ``C`` when the covariance changes, see the module.
    """

    covariance: Array
    correlation_time: float = np.inf
    change: Change = "kept"


class SchmidtUpdate(NamedTuple):
    """What a measurement did: new estimate and cross-covariance, and what the measurement was judged by."""

    x: Array  # (n,)
    P: Array  # (n, n)
    C: Array  # (n, 6)
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
        Prior estimate (n,), covariance (n, n) and cross-covariance (n, 6).
    P_pose
        (6, 6).
    innovation, H, H_pose, R
        (m,), (m, n), (m, 6), (m, m), at ``x`` and the nominal pose.
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


def scale_cross(C: Array, before: Array, after: Array) -> Array:
    """``C Phi'`` with ``Phi = (after before^-1)^(1/2)`` for covariances (6, 6) of the pose."""
    root, inverse = _root(before)
    values, vectors = np.linalg.eigh(inverse @ after @ inverse.T)
    grown = (vectors * np.sqrt(np.maximum(values, 0))) @ vectors.T
    return np.asarray(C @ (root @ grown @ inverse).T)


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
