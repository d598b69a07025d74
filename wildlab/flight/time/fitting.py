"""One clock against another: a rate and an offset from pairs of stamps, with what is left over."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from wildlab.errors import WildlabError

Array = NDArray[np.float64]


class ClockFit(NamedTuple):
    """``reference = reference_0 + rate (own - own_0)``.

    Attributes
    ----------
    own_0, reference_0
        s; the middle of the pairs, so that rate and offset hardly have to do with each other.
    rate
        Seconds of the reference for a second of the clock.
    residual
        (N,) s, reference minus fit, NaN where a stamp was missing.
    used
        (N,) pairs that the fit rests on; the others are outliers.
    spread_s
        Robust standard deviation of the residuals used.
    """

    own_0: float
    reference_0: float
    rate: float
    residual: Array
    used: NDArray[np.bool_]
    spread_s: float

    def to_reference(self, own: ArrayLike) -> Array:
        """Stamps (...) of the clock, s, as the reference has them."""
        return np.asarray(self.reference_0 + self.rate * (np.asarray(own, float) - self.own_0))

    @property
    def offset_s(self) -> float:
        """The reference's time at the clock's zero, s."""
        return float(self.to_reference(0.0))


def fit_clock(own: ArrayLike, reference: ArrayLike) -> ClockFit:
    """Rate and offset of a clock from pairs of stamps, robust against outliers.

    Parameters
    ----------
    own
        (N,) s by the clock; NaN is left out.
    reference
        (N,) s by the reference, at the same instants.

    Returns
    -------
    ClockFit

    Raises
    ------
    WildlabError
        Where there is no pair.
    """
    x, y = np.asarray(own, float), np.asarray(reference, float)
    known = np.isfinite(x) & np.isfinite(y)
    if not known.any():
        problem = "no stamp of one clock goes with one of the other"
        raise WildlabError(problem, "state the offset", field="time")
    x_0, y_0 = float(np.median(x[known])), float(np.median(y[known]))
    dx, dy = x[known] - x_0, y[known] - y_0
    rate, offset = 1.0, float(np.median(dy - dx))
    used = np.ones(len(dx), bool)
    if np.ptp(dx) > 0 and len(dx) > 2:
        for _ in range(20):
            A = np.column_stack([np.ones(used.sum()), dx[used]])
            (offset, rate), *_ = np.linalg.lstsq(A, dy[used], rcond=None)
            left = dy - offset - rate * dx
            spread = 1.4826 * float(np.median(np.abs(left - np.median(left))))
            kept = np.abs(left - np.median(left)) <= max(4 * spread, 1e-6)
            if (kept == used).all() or kept.sum() < 3:
                break
            used = kept
    residual = np.full(len(x), np.nan)
    residual[known] = dy - offset - rate * dx
    every = np.zeros(len(x), bool)
    every[np.flatnonzero(known)[used]] = True
    left = residual[every]
    spread = 1.4826 * float(np.median(np.abs(left - np.median(left))))
    return ClockFit(x_0, y_0 + float(offset), float(rate), residual, every, spread)
