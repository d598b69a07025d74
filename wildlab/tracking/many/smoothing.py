"""Back over the tracks of many targets once the flight is over: what was seen later tells of what was before.

Which measurements were of which target stays as it was taken at the time, and the covariance knows nothing
of what was taken wrongly: among many false measurements it is too small. Kinds of hull stay merged; targets
that may also go calmly are smoothed by the lively motion.

Errors that last, ``o``, stay considered and are not estimated. An estimate is corrected by what the smoother
changed at the next row, ``x^s_k = x_k + G (x^s_k+1 - x_k+1|k)``, with the ``G`` of Rauch, Tung and Striebel's
for the joint state. With ``e`` for truth minus estimate, the smoothed error is ``A e_k + B o_k`` and what is
new, of covariance ``N``, and the three follow one row back: as in `wildlab.tracking.smoothing`, but from the
moments before and after a measurement in place of its gain.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import eigh

from wildlab.tracking.many.run import Shown
from wildlab.tracking.maritime import white_acceleration
from wildlab.tracking.schmidt import fade

Array = NDArray[np.float64]


def smooth_many(
    shown: Sequence[Shown], density: float, lasting_s: Sequence[float] = ()
) -> list[tuple[Array, Array]]:
    """Smoothed estimates of all tracks at all scans.

    Where a track was not shown for a while, it is smoothed on either side by itself: what its filter learnt
    meanwhile is not known here.

    Parameters
    ----------
    shown
        From `run_many`.
    density
        `ManyTargetModel.density` that it was run with.
    lasting_s
        As `run_many` was given; behind it `wildlab.tracking.many.target_model.own_lasting` of its sensors.

    Returns
    -------
    list of x, P
        For each scan (N, 4) and (N, 4, 4), in the order of its ``identity``.
    """
    after = [(one.x.copy(), one.P.copy()) for one in shown]
    rows: dict[int, list[tuple[int, int]]] = {}
    for scan, one in enumerate(shown):
        for place, identity in enumerate(one.identity.tolist()):
            rows.setdefault(identity, []).append((scan, place))
    for where in rows.values():
        scans = np.array([scan for scan, _ in where])
        for part in np.split(np.arange(len(where)), np.flatnonzero(np.diff(scans) > 1) + 1):
            mine = [where[k] for k in part]
            times = [shown[scan].time for scan, _ in mine]
            x, P, C = (
                np.array([getattr(shown[scan], name)[place] for scan, place in mine]) for name in "xPC"
            )
            x, P = smooth_considering(times, x, P, C, density, lasting_s)
            for (scan, place), mean, covariance in zip(mine, x, P, strict=True):
                after[scan][0][place], after[scan][1][place] = mean, covariance
    return after


def smooth_considering(
    times: Sequence[float], x: Array, P: Array, C: Array, density: float, lasting_s: Sequence[float] = ()
) -> tuple[Array, Array]:
    """Back over one track.

    Parameters
    ----------
    times
        (N,) s, in order.
    x, P, C
        (N, 4), (N, 4, 4) and (N, 4, k) with all measurements up to then.
    density, lasting_s
        As in `smooth_many`.

    Returns
    -------
    x, P
        With all measurements. Without shared errors those of Rauch, Tung and Striebel.
    """
    after, spread = x.copy(), P.copy()
    # The smoothed error is A e + B o and what later measurements and motion add, of covariance N.
    A, B, N = np.eye(4), np.zeros_like(C[-1]), np.zeros((4, 4))
    for row in range(len(times) - 2, -1, -1):
        dt = times[row + 1] - times[row]
        F, Q = white_acceleration(dt, density)
        left = np.array([fade(dt, float(one)) for one in lasting_s])
        P_ahead, C_ahead = F @ P[row] @ F.T + Q, F @ C[row] * left
        # The best gain leaves the error after a measurement uncorrelated with the innovation, so with the
        # error before it has its own covariance in common; no more than there was, where mixtures grow.
        size, axes = eigh(P[row + 1], P_ahead)
        axes = P_ahead @ axes
        common = (axes * np.minimum(size, 1)) @ axes.T
        of_state, of_errors = _regress(common, C[row + 1], P_ahead, C_ahead)
        N = N + A @ _positive(P[row + 1] - of_state @ common - of_errors @ C[row + 1].T) @ A.T
        G, _ = _regress(P[row] @ F.T, C[row] * left, P_ahead, C_ahead)
        after[row] = x[row] + G @ (after[row + 1] - F @ x[row])
        by_motion, by_change = G @ (A @ of_state - np.eye(4)), G @ (A @ of_errors + B)
        N = G @ N @ G.T + by_motion @ Q @ by_motion.T + (by_change * (1 - left**2)) @ by_change.T
        A, B = np.eye(4) + by_motion @ F, by_change * left
        both = A @ C[row] @ B.T
        smoothed = A @ P[row] @ A.T + both + both.T + B @ B.T + N
        spread[row] = (smoothed + smoothed.T) / 2
    return after, spread


def _positive(covariance: Array) -> Array:
    """Without the directions in which it is below zero."""
    values, axes = np.linalg.eigh((covariance + covariance.T) / 2)
    return np.asarray((axes * np.maximum(values, 0.0)) @ axes.T)


def _regress(by_state: Array, by_errors: Array, P: Array, C: Array) -> tuple[Array, Array]:
    """Coefficients (n, 4) and (n, k) of a state's error and of errors of variance one, with covariances
    ``P`` and ``C`` of their own, from the covariances (n, 4) and (n, k) with both."""
    of_state = np.asarray(np.linalg.solve(P - C @ C.T, (by_state - by_errors @ C.T).T).T, float)
    return of_state, by_errors - of_state @ C
