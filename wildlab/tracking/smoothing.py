"""Back over a track: estimates that know later measurements too, for flights that are over.

Each estimate is corrected by what the smoother changed at the next row, as by Rauch, Tung and Striebel,

``x^s_k = x_k + G (x^s_k+1 - x_k+1|k)``,

but with the ``G`` that is best for the joint covariance of target and considered errors, which are not
estimated and last. With ``e`` for truth minus estimate and ``o`` for the errors,
``e^s_k+1 = A e_k+1|k + B o_k+1 + n``, where ``n`` has the covariance ``N`` and is independent of what was
before: so the correction ``d = (I - A) e - B o - n`` has a known covariance with ``e_k``, ``G`` is that
over the covariance of ``d``, and ``A``, ``B`` and ``N`` follow one row back. The smoothed covariance is
never above the filter's, and without considered errors it is Rauch, Tung and Striebel's.

What a measurement did is known by the moments before and after it. The best gain leaves the error after a
measurement uncorrelated with the innovation, so with the error before it has its own covariance in common; no
more than there was, where mixtures grow.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import reduce
from itertools import pairwise

import numpy as np

from wildlab.errors import WildlabError
from wildlab.geometry.frames import Array
from wildlab.tracking.kalman import Errors, root_of_covariance
from wildlab.tracking.motion import Motion
from wildlab.tracking.run import Track

#: Variances below this share of those that there were count as zero: rounding.
NEGLIGIBLE = 1e-10


def smooth(track: Track, motion: Motion, errors: Errors | None = None) -> Track:
    """Go back over the track of a filter: `run_filter` or `run_unscented`.

    Parameters
    ----------
    track
        Its estimates at the times of all measurements, as they are where no ``output_times`` were asked for.
    motion
        The one that the filter had.
    errors
        Those that it considered (`wildlab.tracking.kalman.errors_of`); left out: none.

    Returns
    -------
    Track
        The same with smoothed ``x`` and ``P``; NaN before the start.

    Raises
    ------
    WildlabError
        For a track whose times are not those of its measurements.

    Examples
    --------
    A target at rest: all that is known at the end was true at the beginning.

    >>> import numpy as np
    >>> from wildlab.tracking.motion import rest
    >>> from wildlab.tracking.run import Start, run_filter
    >>> from wildlab.tracking.sensors import positions
    >>> start = Start(time=0.0, x=np.zeros(2), P=100.0 * np.eye(2))
    >>> track = run_filter([0.0, 1.0], [[1.0, 0.0], [3.0, 0.0]], np.eye(2), positions(), rest, start)
    >>> smooth(track, rest).x[:, 0].round(2).tolist()
    [1.99, 1.99]
    """
    if len(track.times) != len(track.nis):
        raise WildlabError(
            f"estimates at {len(track.times)} times of {len(track.nis)} measurements",
            "give it at the measurements' times", field="track",
        )  # fmt: skip
    x, P = track.x.copy(), track.P.copy()
    begun = np.flatnonzero(np.isfinite(x).all(axis=1))
    times, instant = np.unique(track.times[begun], return_inverse=True)
    # Of several rows at an instant the last has what all of them tell.
    rows = begun[np.searchsorted(track.times[begun], times, side="right") - 1]
    C, of_rows = np.zeros((len(rows), x.shape[1], 0)), lasting_errors((), len(rows))
    if errors is not None:
        phi = [reduce(np.matmul, errors.phi[a + 1 : b + 1][::-1]) for a, b in pairwise([-1, *rows])]
        C, known = track.C[rows], known_before(errors.covariance)
        of_rows = errors._replace(covariance=known[rows], phi=np.array(phi))
    smoothed = smooth_moments(times, x[rows], P[rows], C, motion, of_rows)
    x[begun], P[begun] = (part[instant] for part in smoothed)
    return track._replace(x=x, P=P)


def lasting_errors(correlation_times: Sequence[float], rows: int) -> Errors:
    """Errors (k,) of variance one, for as long as they last, at so many rows."""
    k = len(correlation_times)
    unit = np.broadcast_to(np.eye(k), (rows, k, k))
    return Errors(unit, unit, np.asarray(correlation_times, float), [])


def smooth_moments(
    times: Array, x: Array, P: Array, C: Array, motion: Motion, errors: Errors
) -> tuple[Array, Array]:
    """Back over the moments of one track.

    Parameters
    ----------
    times
        (N,) s, in order.
    x, P, C
        (N, n), (N, n, n) and (N, n, k) after each row's measurement.
    motion
        The one that the filter had.
    errors
        The k errors at each row.

    Returns
    -------
    x, P
        With all measurements.
    """
    after, spread = x.copy(), P.copy()
    n, known = x.shape[1], errors.covariance
    A, B, N = np.eye(n), np.zeros(C.shape[1:]), np.zeros((n, n))
    for row in range(len(times) - 2, -1, -1):
        dt = float(times[row + 1] - times[row])
        F, Q = motion(dt)
        psi = errors.transition(row + 1, dt)
        ahead = _joint(F @ P[row] @ F.T + Q, F @ C[row] @ psi.T, known[row + 1])
        sd = np.sqrt(np.maximum(np.diag(ahead), 0))
        # What is left after the measurement of the errors before it.
        root, inverse = root_of_covariance(ahead[:n, :n])
        size, axes = np.linalg.eigh(inverse @ P[row + 1] @ inverse.T)
        cross = np.hstack([(root @ axes * np.minimum(size, 1)) @ axes.T @ root.T, C[row + 1]])
        kept = _over(cross, ahead, sd)
        values, axes = np.linalg.eigh(P[row + 1] - kept @ cross.T)
        N = N + A @ (axes * np.maximum(values, 0)) @ axes.T @ A.T
        A, B = A @ kept[:, :n], A @ kept[:, n:] + B
        D = np.hstack([np.eye(n) - A, -B])
        G = _over(np.hstack([P[row] @ F.T, C[row] @ psi.T]) @ D.T, D @ ahead @ D.T + N, sd[:n])
        after[row] = x[row] + G @ (after[row + 1] - F @ x[row])
        grown = known[row + 1] - psi @ known[row] @ psi.T
        by_noise, by_errors = G @ (A - np.eye(n)), G @ B
        N = by_noise @ Q @ by_noise.T + by_errors @ grown @ by_errors.T + G @ N @ G.T
        A, B = np.eye(n) + by_noise @ F, by_errors @ psi
        both = np.hstack([A, B])
        smoothed = both @ _joint(P[row], C[row], known[row]) @ both.T + N
        spread[row] = (smoothed + smoothed.T) / 2
    return after, spread


def _joint(P: Array, C: Array, P_errors: Array) -> Array:
    return np.block([[P, C], [C.T, P_errors]])


def _over(cross: Array, covariance: Array, sd: Array) -> Array:
    """``cross covariance^-1``; directions whose variances are nothing beside ``sd`` squared are left out."""
    unit = np.divide(1, sd, out=np.zeros_like(sd), where=sd > 0)
    values, vectors = np.linalg.eigh((covariance + covariance.T) / 2 * np.outer(unit, unit))
    inverse = np.divide(1, values, out=np.zeros_like(values), where=values > NEGLIGIBLE)
    return np.asarray(((cross * unit) @ vectors * inverse) @ vectors.T * unit, float)


def known_before(covariance: Array) -> Array:
    """(N, k, k) with the one before where there is none, and the first that is known before that."""
    known = np.asarray(np.isfinite(covariance).all(axis=(1, 2)))
    if not known.any():
        return np.zeros_like(covariance)
    last = np.maximum.accumulate(np.where(known, np.arange(len(known)), -1))
    return covariance[np.where(last < 0, int(np.argmax(known)), last)]
