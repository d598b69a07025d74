"""Back over a track: estimates that know later measurements too, for flights that are over.

Rauch, Tung and Striebel's smoother for the filters that take poses as true. With errors that are considered
it would be wrong: it takes the filter's gain for the best one, and what is considered lasts. With them each
estimate is corrected by what the smoother changed at the next row,

``x^s_k = x_k + G (x^s_k+1 - x_k+1|k)``,

as there, but with the ``G`` that is best for the joint covariance of target and considered errors, whatever
gains the filter had. With ``e`` for truth minus estimate and ``o`` for the errors,
``e^s_k+1 = A e_k+1|k + B o_k+1 + n``, where ``n`` has the covariance ``N`` and is independent of what was
before: so the correction ``d = (I - A) e - B o - n`` has a known covariance with ``e_k``, ``G`` is that
over the covariance of ``d``, and ``A``, ``B`` and ``N`` follow one row back. The smoothed covariance is
never above the filter's, and without considered errors it is Rauch, Tung and Striebel's.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from wildlab.errors import WildlabError
from wildlab.geometry.frames import Array
from wildlab.tracking.kalman import Considered, Errors, errors_of
from wildlab.tracking.motion import Motion
from wildlab.tracking.run import Start, Step, Track, run_filter
from wildlab.tracking.sensors import Sensor

#: Variances of a correction below this share of the prediction's count as zero: rounding.
NEGLIGIBLE = 1e-10


def smooth(track: Track, motion: Motion) -> Track:
    """Go back over the track of a filter that took poses as true: `run_filter` or `run_unscented`.

    Parameters
    ----------
    track
        Its estimates at the times of all measurements, as they are where no ``output_times`` were asked for.
        With errors considered use `run_smoothed`, which needs more than a track has.
    motion
        The one that the filter had.

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
    >>> from wildlab.tracking import Start, positions, rest, run_filter
    >>> start = Start(time=0.0, x=np.zeros(2), P=100.0 * np.eye(2))
    >>> track = run_filter([0.0, 1.0], [[1.0, 0.0], [3.0, 0.0]], np.eye(2), positions(), rest, start)
    >>> smooth(track, rest).x[:, 0].round(2).tolist()
    [1.99, 1.99]
    """
    if len(track.times) != len(track.nis):
        raise WildlabError(
            f"estimates at {len(track.times)} times of {len(track.nis)} measurements",
            "give it at the measurements' times, or use run_smoothed", field="track",
        )  # fmt: skip
    x, P = track.x.copy(), track.P.copy()
    begun = np.flatnonzero(np.isfinite(x).all(axis=1))
    for row in begun[:-1][::-1]:
        F, Q = motion(float(track.times[row + 1] - track.times[row]))
        prior = F @ track.x[row], F @ track.P[row] @ F.T + Q
        x[row], P[row] = _back(track.x[row], track.P[row], F, *prior, x[row + 1], P[row + 1])
    return track._replace(x=x, P=P)


def run_smoothed(
    times: ArrayLike,
    measurements: ArrayLike,
    R: ArrayLike,
    sensor: Sensor,
    motion: Motion,
    start: Start,
    *,
    pose: Considered | None = None,
) -> Track:
    """`run_filter`, and back over what it found.

    Parameters
    ----------
    times, measurements, R, sensor, motion, start, pose
        As in `run_filter`.

    Returns
    -------
    Track
        Smoothed ``x`` and ``P``; innovation, ``S`` and NIS of every row are the filter's.

    Raises
    ------
    WildlabError
        As `run_filter`.
    """
    steps = list[Step]()
    track = run_filter(times, measurements, R, sensor, motion, start, pose=pose, steps=steps)
    errors = errors_of(pose, sensor, len(track.times))
    if errors is None:
        return smooth(track, motion)
    nodes = _smooth_considered(steps, errors)
    x, P = track.x.copy(), track.P.copy()
    node_times = np.array([one.time for one in steps])
    last = np.searchsorted(node_times, track.times, "right") - 1
    for out in np.flatnonzero((last >= 0) & (node_times[last] == track.times)):
        x[out], P[out] = nodes[last[out]].x, nodes[last[out]].P
    return track._replace(x=x, P=P)


class _Node(NamedTuple):
    """A row, smoothed; and ``A``, ``B``, ``N`` of the module, as they act on the prediction to it."""

    x: Array  # (n,)
    P: Array
    A: Array  # (n, n)
    B: Array  # (n, k)
    N: Array
    psi: Array  # (k, k) from the row before
    P_errors: Array  # (k, k)


def _back(
    x: Array, P: Array, F: Array, x_prior: Array, P_prior: Array, x_next: Array, P_next: Array
) -> tuple[Array, Array]:
    """One step of Rauch, Tung and Striebel's smoother."""
    gain = _over(P @ F.T, P_prior)
    smoothed = P + gain @ (P_next - P_prior) @ gain.T
    return x + gain @ (x_next - x_prior), (smoothed + smoothed.T) / 2


def _over(cross: Array, covariance: Array) -> Array:
    """``cross covariance^-1``; directions without variance are left out."""
    try:
        np.linalg.cholesky(covariance)
        return np.asarray(np.linalg.solve(covariance, cross.T).T, float)
    except np.linalg.LinAlgError:
        return _over_known(cross, covariance, np.sqrt(np.maximum(np.diag(covariance), 0)))


def _over_known(cross: Array, covariance: Array, sd: Array) -> Array:
    """The same, where variances are nothing beside ``sd`` (n,) squared."""
    unit = np.divide(1, sd, out=np.zeros_like(sd), where=sd > 0)
    values, vectors = np.linalg.eigh(covariance * np.outer(unit, unit))
    inverse = np.divide(1, values, out=np.zeros_like(values), where=values > NEGLIGIBLE)
    return np.asarray(((cross * unit) @ vectors * inverse) @ vectors.T * unit, float)


def _smooth_considered(steps: Sequence[Step], errors: Errors) -> list[_Node]:
    """The smoother of the module."""
    n, k = len(steps[0].x), len(errors.times)
    known, unmoved = known_before(errors.covariance), np.eye(n)
    A, B, N = _updated(steps[-1], unmoved, np.zeros((n, k)), np.zeros((n, n)))
    x, P = steps[-1].x, steps[-1].P
    nodes = []
    for before, after in zip([None, *steps[:-1]][::-1], steps[::-1], strict=True):
        dt = 0.0 if before is None else after.time - before.time
        psi = errors.transition(after.row, dt)
        nodes.append(_Node(x, P, A, B, N, psi, known[after.row]))
        if before is None:
            break
        P_errors = known[before.row]
        gain = _best_gain(before.P @ after.F.T, before.C @ psi.T, after.P_prior, after.C_prior, nodes[-1])
        x = before.x + gain @ (x - after.x_prior)
        grown = known[after.row] - psi @ P_errors @ psi.T
        by_noise, by_errors = gain @ (A - unmoved), gain @ B
        N = by_noise @ after.Q @ by_noise.T + by_errors @ grown @ by_errors.T + gain @ N @ gain.T
        A, B, N = _updated(before, unmoved + by_noise @ after.F, by_errors @ psi, N)
        rows = np.hstack([A, B])
        P = rows @ _joint(before.P_prior, before.C_prior, P_errors) @ rows.T + N
        P = (P + P.T) / 2
    return nodes[::-1]


def _updated(step: Step, A: Array, B: Array, N: Array) -> tuple[Array, Array, Array]:
    """``A``, ``B``, ``N`` on what was before a row's measurement, from those on what is behind it."""
    if step.gain is None or step.H is None or step.H_errors is None or step.R is None:
        return A, B, N
    by_gain = A @ step.gain
    return A - by_gain @ step.H, B - by_gain @ step.H_errors, N + by_gain @ step.R @ by_gain.T


def _joint(P: Array, C: Array, P_errors: Array) -> Array:
    return np.block([[P, C], [C.T, P_errors]])


def _best_gain(by_state: Array, by_errors: Array, P_prior: Array, C_prior: Array, node: _Node) -> Array:
    """``G`` of the module, from the covariances of ``e_k`` with ``e_k+1|k`` and with ``o``."""
    D = np.hstack([np.eye(len(P_prior)) - node.A, -node.B])
    spread = D @ _joint(P_prior, C_prior, node.P_errors) @ D.T + node.N
    cross = np.hstack([by_state, by_errors]) @ D.T
    return _over_known(cross, (spread + spread.T) / 2, np.sqrt(np.maximum(np.diag(P_prior), 0)))


def known_before(covariance: Array) -> Array:
    """(N, k, k) with the one before where there is none, and the first that is known before that."""
    known = np.asarray(np.isfinite(covariance).all(axis=(1, 2)))
    if not known.any():
        return np.zeros_like(covariance)
    last = np.maximum.accumulate(np.where(known, np.arange(len(known)), -1))
    return covariance[np.where(last < 0, int(np.argmax(known)), last)]
