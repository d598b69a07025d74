"""A clock against times of receipt, which can be late and never early.

What is received is late by the way and by what waited before it. The true line of one clock against the other
runs along the lower edge of what was received, not through its middle. The edge is the line below all pairs
that is nearest to them in the mean: it lies along that side of their lower convex hull which spans their mean
(Moon, Skelly and Towsley, 1999). What the quickest message took on its way cannot be known from it.
"""

from __future__ import annotations

from itertools import pairwise

import numpy as np
from numpy.typing import ArrayLike, NDArray

from wildlab.flight.time.fitting import ClockFit, fit_clock

Array = NDArray[np.float64]

#: So many stretches of the log have their earliest receipt looked for, each of at least so many pairs.
STRETCHES, LEAST = 50, 8
#: A rate is taken to be another than 1 where it is so many of its standard errors away.
TOLD_APART = 4.0
#: A clock that is further from the other's rate is none.
SLOWEST, FASTEST = 0.5, 2.0


def fit_receipts(own: ArrayLike, received: ArrayLike) -> ClockFit:
    """Rate and offset of a clock from stamps and their times of receipt, along the lower edge.

    Parameters
    ----------
    own
        (N,) s by the clock; NaN is left out.
    received
        (N,) s by the receiver, late by an unknown time each. Single ones that are too early are outliers.

    Returns
    -------
    ClockFit
        Its residuals are how late each was; the rate is 1 where the pairs cannot tell it from 1.

    Raises
    ------
    WildlabError
        Where there is no pair.
    """
    x, y = np.asarray(own, float), np.asarray(received, float)
    pairs = fit_clock(x, y)
    known = np.flatnonzero(np.isfinite(x) & np.isfinite(y))
    known = known[np.argsort(x[known], kind="stable")]
    x_0 = pairs.own_0
    dx = x[known] - x_0
    base = float(np.median(y[known] - x[known]))
    late = y[known] - x[known] - base
    slope, told, kept = _earliest(dx, late)
    if told and SLOWEST < 1 + slope < FASTEST:
        slope, offset = _edge(dx[kept], late[kept])
    else:
        slope, offset = 0.0, float(late[kept].min())
    residual = np.full(len(x), np.nan)
    residual[known] = late - offset - slope * dx
    used = np.zeros(len(x), bool)
    used[known[kept]] = True
    left = residual[used]
    spread = 1.4826 * float(np.median(np.abs(left - np.median(left))))
    return ClockFit(x_0, x_0 + base + offset, 1.0 + slope, residual, used, spread)


def _earliest(dx: Array, late: Array) -> tuple[float, bool, NDArray[np.bool_]]:
    """Slope of a line through the earliest of each stretch, whether it is told from 0, and which pairs are
    not far below it."""
    count = min(STRETCHES, len(dx) // LEAST)
    every = np.ones(len(dx), bool)
    if count < 4 or np.ptp(dx) <= 0:
        # Too few for a rate. What is early by far more than all others lie apart is an outlier.
        spread = float(np.subtract(*np.percentile(late, [75, 25])))
        kept = late >= np.median(late) - max(10 * spread, 1.0)
        return 0.0, False, kept if kept.any() else every
    edges = np.linspace(0, len(dx), count + 1).astype(int)
    rows = np.array([a + int(np.argmin(late[a:b])) for a, b in pairwise(edges.tolist())])
    fit = fit_clock(dx[rows], late[rows] + dx[rows])
    left = late - (fit.to_reference(dx) - dx)
    slope, at = fit.rate - 1.0, dx[rows][fit.used]
    error = fit.spread_s / max(float(np.sqrt(((at - at.mean()) ** 2).sum())), 1e-9)
    return slope, abs(slope) > TOLD_APART * error, left >= -max(6 * fit.spread_s, 1e-3)


def _edge(dx: Array, late: Array) -> tuple[float, float]:
    """Slope and offset of the side of the lower convex hull that spans the mean; `dx` (N,) ascending."""
    hull: list[tuple[float, float]] = []
    for x, y in zip(dx.tolist(), late.tolist(), strict=True):
        if hull and hull[-1][0] == x:
            if hull[-1][1] <= y:
                continue
            hull.pop()
        while len(hull) > 1:
            (x_1, y_1), (x_2, y_2) = hull[-2], hull[-1]
            if (y_2 - y_1) * (x - x_1) < (y - y_1) * (x_2 - x_1):
                break
            hull.pop()
        hull.append((x, y))
    corners = np.array(hull)
    if len(corners) < 2:
        return 0.0, float(corners[0, 1])
    at = int(np.clip(np.searchsorted(corners[:, 0], dx.mean()), 1, len(corners) - 1))
    (x_1, y_1), (x_2, y_2) = corners[at - 1], corners[at]
    slope = float((y_2 - y_1) / (x_2 - x_1))
    return slope, float(y_1 - slope * x_1)


def fit_pairs(own: ArrayLike, reference: ArrayLike) -> ClockFit:
    """As `fit_clock`, with a rate of 1 where the pairs cannot tell it from 1: a short log says little of it.

    Parameters
    ----------
    own, reference
        (N,) s at the same instants.

    Returns
    -------
    ClockFit

    Raises
    ------
    WildlabError
        Where there is no pair.
    """
    x, y = np.asarray(own, float), np.asarray(reference, float)
    fit = fit_clock(x, y)
    at = x[fit.used]
    error = fit.spread_s / max(float(np.sqrt(((at - at.mean()) ** 2).sum())), 1e-9)
    told = abs(fit.rate - 1.0) > TOLD_APART * error and len(at) >= 2 * LEAST
    if told and SLOWEST < fit.rate < FASTEST:
        return fit
    left = y - x
    middle = float(np.median(left[fit.used]))
    residual = left - middle
    spread = 1.4826 * float(np.median(np.abs(residual[fit.used])))
    return ClockFit(fit.own_0, fit.own_0 + middle, 1.0, residual, fit.used, spread)
