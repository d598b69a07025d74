"""How a satellite receiver errs, found from the innovations of the filter that takes its fixes.

A receiver filters its own fixes: what is wrong with one is still wrong with the next, and a filter that takes
them as white believes them more than they deserve (Groves, Principles of GNSS, Inertial, and Multisensor
Integrated Navigation Systems, 14.2). Beside the white noise stands an error of first order, or, where the
receiver smooths, of second order; how large, how long and whether at all is chosen by the likelihood of
the innovations, less what more parameters would gain by chance (Schwarz). No reference has a part in it.

A filter whose noise is right has innovations of zero mean, white, and of the covariances it says; so their
likelihood is the product of normal densities (Bar-Shalom, Estimation with Applications to Tracking and
Navigation, 5.5). It is maximised by Fisher scoring.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from wildlab.geometry.frames import Array
from wildlab.navigation.aiding import Aiding, GaussMarkov

#: From parameters (K,) to innovations (E, m) and their covariances (E, m, m), of the same E measurements.
Filter = Callable[[Array], tuple[Array, Array]]
#: For the differences by which slopes are found, of parameters that are logarithms.
STEP = 1e-3
#: No parameter moves further in one iteration: by a factor of four.
LONGEST_STEP = 1.4


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
            step = np.clip(np.linalg.solve(damped, slope), -LONGEST_STEP, LONGEST_STEP)
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


#: A source has so many parameters: `SourceNoise`, one after the other.
SIZE = 6
#: Which of them are free, by the order of the Gauss-Markov error; 0 is white noise alone.
FREE = {0: (0, 1), 1: (0, 1, 2, 3, 4), 2: (0, 1, 2, 3, 4, 5)}
#: Limits of what may be found, in units of what is stated.
SMALLEST, LARGEST = 0.003, 30.0


class SourceNoise(NamedTuple):
    """How the positions or the velocities of a receiver err.

    Attributes
    ----------
    white_level, white_vertical
        Factors on the stated standard deviations of each measurement: what is white of them.
    sd_level, sd_vertical
        Standard deviation per axis of a Gauss-Markov error beside it, m or m/s; 0 where there is none.
    time, rate_time
        Of that error, s; see `GaussMarkov`.
    """

    white_level: float = 1.0
    white_vertical: float = 1.0
    sd_level: float = 0.0
    sd_vertical: float = 0.0
    time: float = np.inf
    rate_time: float = 0.0

    @property
    def order(self) -> int:
        """Of the Gauss-Markov error, 0 where there is none."""
        return 0 if max(self.sd_level, self.sd_vertical) == 0 else 2 if self.rate_time > 0 else 1


class ReceiverNoise(NamedTuple):
    """How a receiver errs: its positions, and its velocities where the filter takes them."""

    position: SourceNoise = SourceNoise()
    velocity: SourceNoise = SourceNoise()


class Candidate(NamedTuple):
    """One model that was tried.

    Attributes
    ----------
    noise
        With the likeliest parameters.
    sd
        (12,) standard deviations of their logarithms, positions first; NaN where not free.
    parameters
        How many were free.
    log_likelihood
        Up to a constant that all candidates share.
    score
        That, less what so many parameters gain by chance; the largest wins.
    runs
        How often the filter was run for it.
    """

    noise: ReceiverNoise
    sd: Array
    parameters: int
    log_likelihood: float
    score: float
    runs: int


def tell(source: Aiding, noise: SourceNoise) -> Aiding:
    """A source of aiding with this noise in place of its own.

    Parameters
    ----------
    source
        Positions or velocities, with the standard deviations that are stated.
    noise
        What to take.

    Returns
    -------
    Aiding
    """
    factor = np.array([noise.white_level, noise.white_level, noise.white_vertical])
    wander = None
    if noise.order:
        sd = np.array([noise.sd_level, noise.sd_level, noise.sd_vertical])
        wander = GaussMarkov(sd, noise.time, noise.rate_time)
    return source._replace(variance=source.variance * factor**2, gauss_markov=wander)


#: Runs the filter with a noise: innovations (E, m) and their covariances (E, m, m).
Trial = Callable[[ReceiverNoise], tuple[Array, Array]]


class Scale(NamedTuple):
    """What is stated, from which a search begins.

    Attributes
    ----------
    position, velocity
        (2,) stated standard deviations, level and vertical, m and m/s; no velocity: None.
    interval, duration
        Between fixes, and of the part of the flight that is looked at, s.
    """

    position: Array
    velocity: Array | None
    interval: float
    duration: float


def choose(run: Trial, scale: Scale, enough: float = 1.0) -> list[Candidate]:
    """Models of a receiver's noise from the simplest on, each with its likeliest parameters.

    What is stated; white noise of another size; positions with an error of second order, and of first where
    that may do; then velocities with one of first order.

    Parameters
    ----------
    run
        The filter.
    scale
        Where to begin.
    enough
        As for `scoring.maximise`.

    Returns
    -------
    list of Candidate
        In the order in which they were tried, what is stated first; the one with the largest ``score`` is to
        be used.
    """
    stated, low, high = _limits(scale)
    y, S = run(ReceiverNoise())
    with_velocity = scale.velocity is not None
    tried = [
        _judge(Fit(stated, np.full(2 * SIZE, np.nan), gaussian_log_likelihood(y, S), 1), (0, 0), 0, y.size)
    ]

    def fit(start: Array, orders: tuple[int, int]) -> Candidate:
        free = [*FREE[orders[0]], *(SIZE + i for i in FREE[orders[1]] if with_velocity)]
        found = maximise(lambda p: run(_noise(p, orders)), start, free, low, high, enough)
        return _judge(found, orders, len(free), y.size)

    def better(candidate: Candidate, than: Candidate) -> bool:
        tried.append(candidate)
        return candidate.score > than.score

    orders = (0, 0)
    plain = fit(stated, orders)
    best = plain if better(plain, tried[0]) else tried[0]
    begin = _parameters(plain.noise, stated)
    begin[:5] = [np.log(0.2), np.log(0.2), *np.log(scale.position), np.log(min(100.0, scale.duration / 2))]
    second = fit(np.clip(begin, low, high), (2, 0))
    paid = better(second, best)
    if paid:
        best, orders = second, (2, 0)
    # Where what drives it is forgotten from fix to fix, or there is little to tell, a parameter less does.
    if not paid or second.noise.position.rate_time <= scale.interval:
        first = fit(_parameters(second.noise, stated), (1, 0))
        if better(first, best):
            best, orders = first, (1, 0)
    if scale.velocity is not None:
        begin = _parameters(best.noise if orders[0] else plain.noise, stated)
        white = begin[SIZE : SIZE + 2] + np.log(scale.velocity)
        begin[SIZE : SIZE + 2] += np.log(0.7)
        begin[SIZE + 2 : SIZE + 5] = [*(white + np.log(0.7)), np.log(5 * scale.interval)]
        better(fit(np.clip(begin, low, high), (orders[0], 1)), best)
    return tried


def _judge(found: Fit, orders: tuple[int, int], free: int, n: int) -> Candidate:
    noise = _noise(found.parameters, orders) if free else ReceiverNoise()
    score = found.log_likelihood - free / 2 * np.log(n)
    return Candidate(noise, found.sd, free, found.log_likelihood, float(score), found.runs)


def _noise(parameters: Array, orders: tuple[int, int]) -> ReceiverNoise:
    """From logarithms (12,), of which those that an order does not have are ignored."""
    parts = []
    for first, order in ((0, orders[0]), (SIZE, orders[1])):
        values = np.exp(parameters[first : first + SIZE])
        kept = [float(values[i]) if i in FREE[order] else SourceNoise()[i] for i in range(SIZE)]
        parts.append(SourceNoise(*kept))
    return ReceiverNoise(*parts)


def _parameters(noise: ReceiverNoise, stated: Array) -> Array:
    """Logarithms (12,), with those of ``stated`` where the noise has none."""
    values = np.array([*noise.position, *noise.velocity], float)
    usable = (values > 0) & np.isfinite(values)
    return np.where(usable, np.log(np.where(usable, values, 1.0)), stated)


def _limits(scale: Scale) -> tuple[Array, Array, Array]:
    """Where to begin, and the bounds, logarithms (12,) each."""
    stated, low, high = [], [], []
    for sd in (scale.position, np.ones(2) if scale.velocity is None else scale.velocity):
        stated += [0.0, 0.0, *np.log(sd), np.log(scale.duration / 4), np.log(scale.interval)]
        low += [np.log(SMALLEST)] * 2 + [*np.log(SMALLEST * sd), np.log(scale.interval / 2)]
        low.append(np.log(scale.interval / 10))
        high += [np.log(LARGEST)] * 2 + [*np.log(LARGEST * sd)] + [np.log(scale.duration)] * 2
    return np.array(stated), np.array(low), np.array(high)
