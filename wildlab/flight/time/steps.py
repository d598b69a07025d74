"""Clocks that were set anew while they ran, and counters that begin again at nought."""

from __future__ import annotations

from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from wildlab.errors import WildlabError
from wildlab.flight.time.fitting import ClockFit, fit_clock

Array = NDArray[np.float64]

#: A step is one where it is so many of its standard deviations, no less than the jitter, and so many seconds.
STEP, LEAST_STEP_S = 8.0, 0.05
#: A running median over so many pairs takes wrong stamps out before steps are looked for, and keeps steps;
#: a stretch between two steps has as many pairs at least.
SMOOTHED = 15


class Stretch(NamedTuple):
    """Pairs ``first`` to ``last`` (included) of a clock between two steps, and its fit there."""

    first: int
    last: int
    fit: ClockFit


def unwrap_counter(stamps: ArrayLike, period: float) -> Array:
    """Stamps (N,) of a counter that begins again after a period, without its leaps.

    Parameters
    ----------
    stamps
        (N,) in the order in which they were written; NaN stays NaN.
    period
        After which it begins again, in the same unit: 2**32 for microseconds in 32 bits.

    Returns
    -------
    (N,)
        Only a leap by more than half a period is taken for one: a clock that was started anew stays so, and
        stamps that go a little back stay where they are.

    Examples
    --------
    >>> unwrap_counter([98.0, 99.0, 1.0, 0.0, 2.0], 100.0).tolist()
    [98.0, 99.0, 101.0, 100.0, 102.0]
    """
    out = np.array(stamps, float)
    known = np.isfinite(out)
    out[known] = np.unwrap(out[known], period=period)
    return out


def fit_stretches(own: ArrayLike, reference: ArrayLike, late: bool = False) -> list[Stretch]:
    """Rate and offset of a clock that may have been set anew in the middle: one fit for each stretch.

    Parameters
    ----------
    own, reference, late
        As for `fit_clock`, in the order in which they were written.

    Returns
    -------
    Stretches in order, together all pairs; one alone where there is no step.

    Raises
    ------
    WildlabError
        Where there is no pair.
    """
    x, y = np.asarray(own, float), np.asarray(reference, float)
    rows = np.flatnonzero(np.isfinite(x) & np.isfinite(y))
    if not len(rows):
        problem = "no stamp of one clock goes with one of the other"
        raise WildlabError(problem, "state the offset", field="time")
    # Against the reference, which does not stop: what the clock lacks to it.
    t, lack = y[rows] - y[rows[0]], (y - x)[rows] - (y - x)[rows[0]]
    cuts = _cuts(t, _running_median(t, lack), _jitter(lack))
    edges = [0, *(int(rows[c]) for c in cuts), len(x)]
    return [Stretch(a, b - 1, fit_clock(x[a:b], y[a:b], late)) for a, b in pairwise(edges)]


def step_sentences(stretches: list[Stretch], what: str = "the clock") -> list[str]:
    """What steps a clock made, a clause for each.

    Parameters
    ----------
    stretches
        From `fit_stretches`.
    what
        The clock.

    Returns
    -------
    One less than there are stretches.
    """
    said = []
    for before, after in pairwise(stretches):
        at = after.fit.first_s
        # How much later the clock would have to say the same time.
        by = float(before.fit.to_reference(at) - after.fit.to_reference(at)) / before.fit.rate
        way = "forward" if by > 0 else "back"
        amount = f"{abs(by):.3g}" if abs(by) < 100 else f"{abs(by):.0f}"
        said.append(f"{what} was set {way} by {amount} s before its stamp {at:.1f} s")
    return said


def _jitter(lack: Array) -> float:
    """Scatter from one pair to the next, which steps do not touch."""
    apart = np.diff(lack)
    return 1.4826 * float(np.median(np.abs(apart - np.median(apart)))) / np.sqrt(2) if len(apart) else 0.0


def _running_median(t: Array, lack: Array) -> Array:
    if len(lack) < 2 * SMOOTHED:
        return lack
    # Without the slope that most of it has: a few steps do not decide that.
    far = max(len(lack) // 20, SMOOTHED)
    run = t[far:] - t[:-far]
    slope = float(np.median((lack[far:] - lack[:-far])[run > 0] / run[run > 0])) if (run > 0).any() else 0.0
    half = SMOOTHED // 2
    level = np.pad(lack - slope * t, half, mode="reflect")
    windows = np.lib.stride_tricks.sliding_window_view(level, SMOOTHED)
    return np.asarray(np.median(windows, axis=1) + slope * t)


def _cuts(t: Array, lack: Array, jitter: float, first: int = 0) -> list[int]:
    """Where a straight line of `lack` over `t` breaks with a step: rows that a new stretch begins at."""
    n = len(t)
    if n < 2 * SMOOTHED or np.ptp(t) == 0:
        return []
    # About the middle, for the sums of squares below.
    x, y = (t - t.mean()) / np.ptp(t), lack - lack.mean()
    sums = np.cumsum([np.ones(n), x, y, x * x, x * y, y * y], axis=1)
    at = np.arange(SMOOTHED, n - SMOOTHED + 1)
    left = _misfit(sums[:, at - 1])
    right = _misfit(sums[:, -1:] - sums[:, at - 1])
    best = int(at[np.argmin(left + right)])
    parts = [np.polyfit(x[a:b], y[a:b], 1) for a, b in ((0, best), (best, n))]
    between = (x[best - 1] + x[best]) / 2
    step = float(np.polyval(parts[1], between) - np.polyval(parts[0], between))
    # At its end a line through N points is known to 2 / sqrt(N) of their scatter.
    sd = 2 * jitter * float(np.sqrt(1 / best + 1 / (n - best)))
    if abs(step) < max(STEP * sd, jitter, LEAST_STEP_S):
        return []
    # The largest single leap nearby is where it was.
    near = np.arange(max(best - SMOOTHED, 1), min(best + SMOOTHED, n))
    best = int(near[np.argmax(np.abs(np.diff(y))[near - 1])])
    return [
        *_cuts(t[:best], lack[:best], jitter, first),
        first + best,
        *_cuts(t[best:], lack[best:], jitter, first + best),
    ]


def _misfit(sums: Array) -> Array:
    """Squares left over by a line, from the sums of 1, x, y, xx, xy, yy."""
    n, sx, sy, sxx, sxy, syy = sums
    xx, xy, yy = sxx - sx * sx / n, sxy - sx * sy / n, syy - sy * sy / n
    return np.asarray(yy - np.divide(xy * xy, xx, out=np.zeros_like(xx), where=xx > 1e-12))
