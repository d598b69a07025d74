"""Clocks of a log against UTC, with the rate of a quartz as far as the log is too short to tell another."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from wildlab.flight.time.fitting import RESOLUTION_S, ClockFit, fit_clock

Array = NDArray[np.float64]

#: A rate is another than 1 where it is so many of its standard deviations away.
TOLD_APART = 4.0
#: Receipts before the middle one by more than so many robust standard deviations (and 1 s) are wrong.
EARLY = 5.0
#: Fewer pairs do not tell how well they tell a rate.
FEW = 10
#: Standard deviation of a quartz's rate.
USUAL = 1e-4
#: A clock that is further from the other's rate is none.
SLOWEST, FASTEST = 0.5, 2.0


def fit_steady(
    own: ArrayLike, reference: ArrayLike, late: bool = False, resolution_s: float = RESOLUTION_S
) -> ClockFit:
    """As `fit_clock`, with a rate near 1 where the pairs cannot tell it from 1.

    What they say of it is then weighed against what a quartz does.

    Parameters
    ----------
    own, reference, late, resolution_s
        Of `fit_clock`.

    Returns
    -------
    ClockFit

    Raises
    ------
    WildlabError
        Where there is no pair.
    """
    fit = fit_clock(own, reference, late, resolution_s)
    told = int(fit.used.sum()) >= FEW and np.isfinite(fit.rate_sd)
    if told and abs(fit.rate - 1.0) > TOLD_APART * fit.rate_sd and SLOWEST < fit.rate < FASTEST:
        return fit
    turned = float(np.clip(fit.rate - 1.0, -1.0, 1.0))
    rate = 1.0 + (turned * USUAL**2 / (USUAL**2 + fit.rate_sd**2) if told else 0.0)
    x, y = np.asarray(own, float), np.asarray(reference, float)
    used = fit.used
    middle = float(np.mean(x[used]))
    apart = y - middle - rate * (x - middle)
    if late:
        # Among few pairs `fit_clock` believes all.
        believed = used & (apart >= np.nanmedian(apart) - max(EARLY * _spread(apart), 1.0))
        used = believed if believed.any() else used
        offset = float(apart[used].min())
    else:
        offset = float(np.median(apart[used]))
    residual = apart - offset
    return ClockFit(
        middle,
        middle + offset,
        rate,
        residual,
        np.asarray(used),
        max(_spread(residual[used]), RESOLUTION_S),
        fit.middle_sd_s,
        fit.rate_sd,
        float(x[used].min()),
        float(x[used].max()),
    )


def _spread(values: Array) -> float:
    return 1.4826 * float(np.nanmedian(np.abs(values - np.nanmedian(values))))
