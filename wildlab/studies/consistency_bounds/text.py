"""The words of the report on consistency bounds, each from the numbers it states."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import ArrayLike

from wildlab.evaluation.runs import Interval, share_interval
from wildlab.evaluation.shares import FAILS, HOLDS, UNDECIDED

#: What share of a consistent filter's values lies within its 95 % bounds.
RIGHT = 0.95
#: An interval of the share that is wider than this decides nothing.
WIDEST = 0.05


def summary(
    honest: Mapping[str, float], overconfident: Mapping[str, float], again: int, printed: int
) -> list[str]:
    """What came out, in three sentences.

    Parameters
    ----------
    honest, overconfident
        Shares of values within the bounds, by the bounds' name.
    again, printed
        How many of the printed bounds come out again, and how many there are.

    Returns
    -------
    list of str
    """
    one, other = honest["nees-1-run"], overconfident["nees-1-run"]
    apart = one - other
    tell = (
        "so that the limits tell the two apart."
        if apart > 0.1
        else "so that one run's limits hardly tell the two apart."
    )
    return [
        "A tracking filter that is honest about its own uncertainty stays within the thesis's limits "
        f"{100 * one:.0f} times in 100, where {100 * RIGHT:.0f} is right.",
        f"A filter that takes its measurements for twice as good as they are does so {100 * other:.0f} times "
        f"in 100, {tell}",
        f"{again} of the {printed} limits printed in the thesis come out again.",
    ]


def one_run(values: Mapping[str, ArrayLike], bounds: tuple[float, float], seconds: float) -> tuple[str, str]:
    """Title and alternative text of NEES over one run.

    Parameters
    ----------
    values
        (steps,) of the run that is drawn, by filter: "honest", "overconfident".
    bounds
        That 95 % of a consistent filter's values lie in.
    seconds
        How long the run is.

    Returns
    -------
    tuple of str
    """
    low, high = bounds
    above = {name: int((np.asarray(one) > high).sum()) for name, one in values.items()}
    below = {name: int((np.asarray(one) < low).sum()) for name, one in values.items()}
    steps = len(np.asarray(values["honest"]))
    over, fair = above["overconfident"], above["honest"]
    title = f"One run: above the limit {over} times if overconfident, {fair} if honest"
    alt = (
        f"NEES of one run over {seconds:.0f} seconds, {steps} steps, with limits of {low:.2f} and "
        f"{high:.2f}. "
        + " ".join(
            f"The {name} filter is above them at {above[name]} steps and below them at {below[name]}."
            for name in values
        )
    )
    return title, alt


def fifty_runs(values: Mapping[str, ArrayLike], bounds: tuple[float, float], share: float) -> tuple[str, str]:
    """Title and alternative text of NIS, the mean of 50 runs; as `one_run`.

    ``share``: of all means of 50 overconfident runs that lie within the bounds.
    """
    low, high = bounds
    middle = {name: float(np.median(np.asarray(one))) for name, one in values.items()}
    inside = {
        name: float(((np.asarray(one) >= low) & (np.asarray(one) <= high)).mean())
        for name, one in values.items()
    }
    title = f"50 runs: the overconfident one is inside {100 * share:.0f} % of the time"
    alt = f"NIS averaged over 50 runs, with limits of {low:.1f} and {high:.1f}. " + " ".join(
        f"The {name} filter has {middle[name]:.1f} in the middle and is inside {100 * inside[name]:.0f} % of "
        "the time."
        for name in values
    )
    return title, alt


def decide(inside: ArrayLike) -> tuple[str, Interval]:
    """Whether 95 % of independent values lie within their bounds.

    Parameters
    ----------
    inside
        (runs,) bool, one value of each run: neighbouring steps of a run share their error.

    Returns
    -------
    tuple
        The verdict: "holds" where the interval of the share has 95 % in it and is narrow enough to say so,
        "undecided" where it is not, else "does not hold"; and the interval.
    """
    values = np.asarray(inside, bool)
    found = share_interval(int(values.sum()), len(values))
    if not found.low <= RIGHT <= found.high:
        return FAILS, found
    return (HOLDS if found.high - found.low <= WIDEST else UNDECIDED), found
