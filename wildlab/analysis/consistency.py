"""Mean NEES and NIS of one run beside what a consistent filter's would be, for values that are correlated.

Neighbouring moments of one run share their error. A mean over them is worth fewer independent values than it
has, and its interval is wider (`wildlab.evaluation.whiteness.effective_sample_size`).
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from wildlab.analysis.navigation_errors import BLOCKS, NavigationErrors
from wildlab.evaluation.consistency import Average, average
from wildlab.evaluation.whiteness import effective_sample_size

Array = NDArray[np.float64]


class Series(NamedTuple):
    """NEES or NIS (N,) of one run over its times (N,), s, with ``dof`` degrees of freedom; NaN: none.

    ``worth``: at most so many independent values, where the errors themselves say so: one that lasts is one,
    however much its square wavers.
    """

    name: str
    dof: float
    times: Array
    values: Array
    worth: float = np.inf


def worth(values: ArrayLike) -> float:
    """How many independent values those of one run (N,) are worth for their mean; NaN are left out.

    Parameters
    ----------
    values
        (N,) in the order of time.

    Returns
    -------
    float
        From 1 to N, or 0 where there is none.

    Examples
    --------
    >>> worth([2.0, 1.0, float("nan")])
    2.0
    """
    array = np.asarray(values, float)
    known = array[np.isfinite(array)]
    if len(known) < 4 or np.ptp(known) == 0:
        return float(len(known))
    return float(np.clip(effective_sample_size(known, len(known) - 1), 1.0, len(known)))


def mean_of_runs(runs: Sequence[Series]) -> Average:
    """Mean of the same quantity over independent runs, and the 95 % interval of a consistent filter's.

    Parameters
    ----------
    runs
        One series for each run; degrees of freedom that differ are averaged over the values.

    Returns
    -------
    Average
        ``worth`` is the sum of what each run is worth.

    Examples
    --------
    >>> run = Series("NEES", 2, np.arange(3.0), np.array([1.0, 2.0, 3.0]))
    >>> mean = mean_of_runs([run, run])
    >>> mean.mean, mean.n, mean.worth, mean.inside
    (2.0, 6, 6.0, True)
    """
    values = np.concatenate([np.asarray(run.values, float) for run in runs])
    known = np.array([np.isfinite(run.values).sum() for run in runs])
    dof = float(np.average([run.dof for run in runs], weights=known)) if known.any() else runs[0].dof
    return average(values, dof, sum(min(worth(run.values), run.worth) for run in runs))


def navigation_series(errors: NavigationErrors, begin: float = -np.inf, end: float = np.inf) -> list[Series]:
    """NEES of position, velocity and attitude, three degrees of freedom each, of a part of a flight.

    Parameters
    ----------
    errors
        Against a reference that is the truth: else it is the difference of two estimates that is scored.
    begin, end
        s.

    Returns
    -------
    list of Series
        Those blocks that have values.

    Examples
    --------
    >>> nothing = np.full((2, 9), np.nan)
    >>> blocks = {"position": np.array([3.0, 2.0]), "velocity": nothing[:, 0], "attitude": nothing[:, 0]}
    >>> [s.name for s in navigation_series(NavigationErrors(np.arange(2.0), nothing, nothing, blocks))]
    ['NEES position']
    """
    part = (errors.times >= begin) & (errors.times < end)
    all_blocks = [Series(f"NEES {name}", 3, errors.times[part], errors.nees[name][part]) for name in BLOCKS]
    return [one for one in all_blocks if np.isfinite(one.values).any()]
