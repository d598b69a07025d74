"""Shares and what is surely planned, in the words of the studies of rows and of gimbals."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike, NDArray

from wildlab.evaluation.runs import mean_interval
from wildlab.reporting.text import percent

#: Share of what is surely to be seen that a flight has to show.
HELD = 0.95


def mean(spread: pd.DataFrame, subject: str, name: str) -> float:
    """Over the draws."""
    return float(spread[subject, name].mean())


def with_interval(values: ArrayLike, digits: int = 1, lowest: float = 0.0, highest: float = 1.0) -> str:
    """Mean of shares in per cent, and Student's 95 % interval over the draws where they differ.

    Examples
    --------
    >>> with_interval([0.5, 0.6]), with_interval([0.5, 0.5])
    ('55.0 % (0 to 100 %)', '50.0 %')
    """
    found, low, high = mean_interval(values)
    said = _signed(found, digits)
    if np.isnan(low):
        return said
    ends = [_signed(float(np.clip(one, lowest, highest)), digits) for one in (low, high)]
    return said if ends[0] == ends[1] else f"{said} ({ends[0].removesuffix(' %')} to {ends[1]})"


def _signed(share: float, digits: int) -> str:
    """In per cent, with a minus where there is one."""
    return percent(share, digits) if not share < 0 else f"\N{MINUS SIGN}{100 * -share:.{digits}f} %"


def difference_words(values: ArrayLike, more: str = "more", less: str = "less", digits: int = 1) -> str:
    """How much more or less: a mean of paired differences of shares, with its interval in the same sense.

    Examples
    --------
    >>> difference_words([-0.2, -0.2])
    '20.0 % less'
    >>> difference_words([0.0, 0.0])
    'no more'
    """
    array = np.asarray(values, float)
    mean_of = mean_interval(array).estimate
    if mean_of == 0:
        return f"no {more}"
    sense = 1.0 if mean_of > 0 else -1.0
    said = with_interval(sense * array, digits, -np.inf, np.inf)
    size, _, ends = said.partition(" (")
    return f"{size} {more if sense > 0 else less}" + (f" ({ends}" if ends else "")


def held_of(spread: pd.DataFrame, subjects: Iterable[str]) -> NDArray[np.float64]:
    """Shares of what is surely planned that were seen, of all draws; NaN where nothing is surely planned."""
    return np.concatenate([spread[one, "held"].to_numpy(float) for one in subjects])


def worst_words(spread: pd.DataFrame, subjects: Iterable[str], flights: str) -> str:
    """Whether what was surely planned was seen in every flight: by the worst, and how many had none such.

    ``flights`` is what they are called: "flights" or "rides".
    """
    held = held_of(spread, subjects)
    judged = held[np.isfinite(held)]
    none = len(held) - len(judged)
    if not len(judged):
        return f"Nothing was surely to be seen in any of {none} {flights}: whether they hold cannot be said."
    kept = "held" if judged.min() >= HELD else "did not always hold"
    left = f" In {none} more nothing was surely to be seen, and they say nothing." if none else ""
    return (
        f"What a plan says is surely seen {kept} with errors of the pose: in the worst of {len(judged)} "
        f"{flights} {percent(float(judged.min()))} of it was seen.{left}"
    )


def least_words(values: ArrayLike) -> str:
    """The least of all draws, and in how many of them there was nothing to hold.

    Examples
    --------
    >>> least_words([0.98, float("nan")]), least_words([float("nan")])
    ('98.0 %; nothing planned in 1 of 2', 'nothing planned in 1 of 1')
    """
    array = np.asarray(values, float)
    none = int((~np.isfinite(array)).sum())
    left = f"nothing planned in {none} of {len(array)}" if none else ""
    if none == len(array):
        return left
    return percent(float(np.nanmin(array))) + (f"; {left}" if left else "")


def larger_errors_words(held: dict[str, tuple[float, float]], factor: float) -> str:
    """What is seen of what was surely planned where errors are larger than the plan allows for, of one draw.

    ``held`` is, by the name of a plan, the share that is seen with the errors planned for, and with errors
    ``factor`` times as large. NaN where nothing is surely planned.
    """
    known = {name: pair for name, pair in held.items() if np.isfinite(pair).all()}
    if not known:
        return "Nothing is surely planned on the first draw, so larger errors cannot be tried on it."
    said = "; ".join(f"{name}, {percent(then)} for {percent(now)}" for name, (now, then) in known.items())
    short = sum(then < HELD for _, then in known.values())
    return (
        f"The margin allows for errors as large as they are drawn. Were they {factor:g} times as large, the "
        f"first draw would show of what was surely planned: {said}. That is less than {percent(HELD, 0)} in "
        f"{short} of {len(known)}."
    )
