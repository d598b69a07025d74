"""Maximum likelihood of what innovations have in them, by Fisher scoring.

A filter that is told the truth about its noise has innovations of zero mean, white, and of the covariances it
says; so their likelihood is the product of normal densities (Bar-Shalom, Estimation with Applications to
Tracking and Navigation, 5.5), and what the filter is told may be chosen by it.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from wildlab.geometry.frames import Array

#: From parameters (K,) to innovations (E, m) and their covariances (E, m, m), of the same E measurements.
Filter = Callable[[Array], tuple[Array, Array]]
#: For the differences by which slopes are found, of parameters that are logarithms.
STEP = 1e-3
#: No parameter moves further in one iteration: by a factor of four.
LARGEST = 1.4


class Fit(NamedTuple):
    """The parameters that make innovations likeliest.

    Attributes
    ----------
    parameters
        (K,); those that were not free as they were given.
    sd
        (K,) by the information that the innovations have on them (Cramer and Rao); NaN where not free, or at
        a bound.
    log_likelihood
        Up to a constant.
    runs
        How often the filter was run.
    """

    parameters: Array
    sd: Array
    log_likelihood: float
    runs: int


def gaussian_log_likelihood(innovation: ArrayLike, S: ArrayLike) -> float:
    """Log likelihood of innovations (E, m) with covariances S (E, m, m), without its constant.

    Minus infinity where it is none: a filter may get lost under a parameter that is only tried.

    Examples
    --------
    >>> bool(gaussian_log_likelihood([[2.0]], [[[4.0]]]) == -0.5 * (1 + np.log(4)))
    True
    """
    y, spread = np.asarray(innovation, float), np.asarray(S, float)
    if not (np.isfinite(y).all() and np.isfinite(spread).all()):
        return -np.inf
    sign, size = np.linalg.slogdet(spread)
    if (sign <= 0).any():
        return -np.inf
    return -0.5 * float((np.linalg.solve(spread, y[..., None])[..., 0] * y).sum() + size.sum())


def maximise(
    run: Filter, start: ArrayLike, free: ArrayLike, low: ArrayLike, high: ArrayLike,
    enough: float = 0.1, iterations: int = 12,
) -> Fit:  # fmt: skip
    """The parameters under which a filter's innovations are likeliest.

    Parameters
    ----------
    run
        The filter. Innovations and covariances must be smooth in the parameters: no gate.
    start
        (K,) to begin with, within the bounds. Logarithms, where what they stand for is positive.
    free
        (F,) which of them may move.
    low, high
        (K,) bounds.
    enough
        It ends where an iteration adds less than this to the log likelihood.
    iterations
        It ends after so many anyway.

    Returns
    -------
    Fit
    """
    bottom, top = np.asarray(low, float), np.asarray(high, float)
    p, moving = np.asarray(start, float).copy(), np.asarray(free, int)
    y, S = run(p)
    best, runs, damping = gaussian_log_likelihood(y, S), 1, 1e-2
    information, at_work = np.zeros((0, 0)), moving[:0]
    for _ in range(iterations):
        slope, information = _score(run, p, moving, y, S)
        runs += len(moving)
        if not (np.isfinite(slope).all() and np.isfinite(information).all()):  # it is lost, or next to it
            at_work = moving[:0]
            break
        # Against a bound it cannot go further: the others move without it.
        stuck = ((p[moving] <= bottom[moving]) & (slope <= 0)) | ((p[moving] >= top[moving]) & (slope >= 0))
        at_work, slope = moving[~stuck], slope[~stuck]
        information = information[np.ix_(~stuck, ~stuck)]
        gain = 0.0
        while len(at_work) and damping < 1e6:
            damped = information + damping * np.diag(np.diagonal(information) + 1e-3)
            step = np.clip(np.linalg.solve(damped, slope), -LARGEST, LARGEST)
            tried = p.copy()
            tried[at_work] = np.clip(p[at_work] + step, bottom[at_work], top[at_work])
            y_tried, S_tried = run(tried)
            runs += 1
            found = gaussian_log_likelihood(y_tried, S_tried)
            if found > best:
                gain, p, y, S, best, damping = found - best, tried, y_tried, S_tried, found, damping / 8
                break
            damping = max(8 * damping, 1e-2)
        if gain < enough:
            break
    sd = np.full(len(p), np.nan)
    if len(at_work):
        sd[at_work] = np.sqrt(np.maximum(np.diagonal(np.linalg.pinv(information)), 0.0))
    return Fit(p, sd, best, runs)


def _score(run: Filter, p: Array, moving: NDArray[np.int64], y: Array, S: Array) -> tuple[Array, Array]:
    """Slope (F,) of the log likelihood, and the information (F, F), which is that slope's covariance."""
    inverse = np.linalg.inv(S)
    turned, spread, slope = [], [], []
    weighed = np.einsum("eij,ej->ei", inverse, y)
    dy = []
    for index in moving:
        q = p.copy()
        q[index] += STEP
        y_q, S_q = run(q)
        d_y, d_S = (y_q - y) / STEP, (S_q - S) / STEP
        relative = inverse @ d_S
        dy.append(d_y)
        turned.append(np.einsum("eij,ej->ei", inverse, d_y))
        spread.append(relative)
        slope.append(
            -np.sum(d_y * weighed)
            + 0.5 * np.einsum("ei,eij,ej->", weighed, d_S, weighed)
            - 0.5 * np.trace(relative, axis1=1, axis2=2).sum()
        )
    size = len(moving)
    information = np.zeros((size, size))
    for a in range(size):
        for b in range(a + 1):
            of_size = 0.5 * np.einsum("eij,eji->", spread[a], spread[b])
            information[a, b] = information[b, a] = float(np.sum(dy[a] * turned[b]) + of_size)
    return np.array(slope, float), information
