"""How often the rule for published numbers gives each answer, where it is known how true a twin is."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike, NDArray

from wildlab.evaluation.order_statistics import median_interval, prediction_interval
from wildlab.evaluation.replication import (
    KINDS,
    Closeness,
    Comparison,
    Compatibility,
    compare_flight,
    power_of,
)

Array = NDArray[np.float64]

#: The answers that are counted.
ANSWERS = (
    *(Closeness.CLOSE, Closeness.NOT_CLOSE, Closeness.CANNOT_TELL),
    *(Compatibility.WITHIN, Compatibility.OUTSIDE, Compatibility.NO_POWER),
)


def operating_characteristics(
    flights: int = 100,
    *,
    factors: Sequence[float] = (1.0, 1.2, 1.5, 2.0),
    independent: int = 20,
    trials: int = 400,
    seed: int = 1,
) -> pd.DataFrame:
    """How often each answer is given, by simulation of the rule itself.

    A flight has ``independent`` independent errors of two coordinates, as one of some minutes whose errors
    last for tens of seconds. The errors of the twin's flights are so many times those of the published
    flight; of a rate, so many times the odds of a miss.

    Parameters
    ----------
    flights
        Of the twin.
    factors
        Of the twin's errors.
    independent
        Values of a flight.
    trials
        For each kind and factor.
    seed
        Of the random numbers.

    Returns
    -------
    DataFrame
        Columns ``kind``, ``factor``, and one for each answer with its probability: ``close``, ``not close``,
        ``cannot tell``, ``within``, ``outside``, ``no power``.
    """
    rng = np.random.default_rng(seed)
    rows = []
    for kind in KINDS:
        for factor in factors:
            ours = _flights(rng, kind, (trials, flights), independent, factor)
            theirs = _flights(rng, kind, (trials,), independent, 1.0)
            found = [
                compare_values(kind, values, float(one)) for values, one in zip(ours, theirs, strict=True)
            ]
            told = [(one.closeness, one.compatibility) for one in found]
            shares = {answer.value: float(np.mean([answer in one for one in told])) for answer in ANSWERS}
            rows.append({"kind": kind, "factor": factor} | shares)
    return pd.DataFrame(rows)


def compare_values(kind: str, values: ArrayLike, published: float, rounding: float = 0.0) -> Comparison:
    """`compare_flight` with what (N,) ``values``, one of each of our flights, give."""
    centre, predicted = median_interval(values), prediction_interval(values)
    known = not math.isnan(predicted[0])
    return compare_flight(
        kind,
        float(np.nanmedian(np.asarray(values, float))),
        published,
        rounding,
        centre=None if math.isnan(centre[0]) else centre,
        predicted=predicted if known else None,
        power=power_of(values, kind) if known else None,
    )


def _flights(
    rng: np.random.Generator, kind: str, shape: tuple[int, ...], independent: int, factor: float
) -> Array:
    """Figures of flights, whose errors have the deviation ``factor``; of a rate, a share of 0.8
    of five images for each independent error whose odds are divided by it."""
    if kind == "rate":
        images = 5 * independent
        return np.asarray(rng.binomial(images, 4 / (4 + factor), shape) / images)
    if kind == "signed mean":
        return np.asarray(factor * np.abs(rng.standard_normal(shape)) / math.sqrt(independent))
    if kind == "error size":
        return np.asarray(factor * rng.rayleigh(1.0, (independent, *shape)).mean(axis=0))
    worth = independent - 1 if kind == "standard deviation" else 2 * independent
    mean = rng.chisquare(worth, shape) / worth
    return np.asarray(factor * np.sqrt(mean) if kind == "standard deviation" else factor**2 * mean)
