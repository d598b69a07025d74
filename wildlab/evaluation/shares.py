"""Is a sentence true of flights? What a share of simulated flights, and its interval, allows to be said.

A sentence that is true of some flights and not of others has a share, which so many simulated flights give
with a 95 % interval (Wilson's, `share_interval`). The verdict is by the interval, so that few flights decide
little: of twenty, even all of them leave open whether it is nine in ten.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from wildlab.errors import WildlabError
from wildlab.evaluation.intervals import Interval, mean_interval, share_interval

if TYPE_CHECKING:
    pass

Array = NDArray[np.float64]

HOLDS, MOSTLY, UNDECIDED = "holds", "holds on most flights", "undecided"
MOSTLY_NOT, FAILS = "fails on most flights", "does not hold"
#: The twin lacks what the sentence is about.
NO_PREMISE = "premise not met"
#: No flight here could decide it.
UNDECIDABLE = "cannot be decided"
#: Of a claim that the simulated flights were made to meet.
FITTED = "not judged: fitted"
#: From the most to the least true.
SHARE_VERDICTS = (HOLDS, MOSTLY, UNDECIDED, MOSTLY_NOT, FAILS)
#: Shares of all flights between the verdicts.
ALMOST_ALL, HALF, ALMOST_NONE = 0.9, 0.5, 0.1
#: Largest probability of a wrong verdict, worked out for 35 flights and more.
WRONG = 0.035


class Pooled(NamedTuple):
    """In how many images of all flights together something is so."""

    so: int
    of: int


@dataclass(frozen=True)
class Check:
    """What simulated flights give for a sentence.

    Attributes
    ----------
    true
        (N,) bool: of which flights it is true. None where a threshold decides, which the sentence's author
        has to name: then ``measured`` is held against it.
    measured
        (N,), what the threshold is for, in its unit. A flight without one (NaN) counts as not true, so that
        what failed is not left out; where no flight has one, nothing is decided.
    above
        Whether the sentence is true above the threshold; else it is below.
    premise
        (N,) bool: which flights have what the sentence is about; None means all.
    pooled
        Images of all flights together, where the threshold is for their share: few images of a flight cannot
        tell it. ``measured`` is then each flight's own share.
    calculated
        Whether ``measured`` follows from the parameters alone, so that flights add nothing to it.
    first, second
        (N,), what a comparison compares, in ``unit``: the paired difference is shown. Where something is
        pooled, ``unit`` is what is counted; images where it is empty.
    by_threshold
        Of which flights it is true, (N,) bool by the threshold, where that says what is counted: a share of
        what lies within a limit has no single measure to hold against the limit.
    reach
        What the measure can be where the sentence says anything: an F1 is from 0 to 1, and a ratio above 1
        is no decrease. A threshold beyond it decides nothing (`reaches`).
    """

    true: NDArray[np.bool_] | None = None
    measured: Array | None = None
    above: bool = False
    premise: NDArray[np.bool_] | None = None
    pooled: Pooled | None = None
    calculated: bool = False
    first: Array | None = None
    second: Array | None = None
    unit: str = ""
    by_threshold: Mapping[float, NDArray[np.bool_]] | None = None
    reach: tuple[float, float] = (-np.inf, np.inf)

    def holds(self, threshold: float | None = None) -> NDArray[np.bool_]:
        """(N,) bool: of which flights the sentence is true, with that threshold.

        Raises
        ------
        WildlabError
            If it needs a threshold and there is none, has no use for one, or nothing was counted by this one.
        """
        if self.by_threshold is not None:
            if threshold is None or threshold not in self.by_threshold:
                raise WildlabError(
                    f"nothing was counted for the threshold {threshold}",
                    f"use one of {', '.join(f'{one:g}' for one in self.by_threshold)}",
                )
            return self.by_threshold[threshold]
        if self.true is not None and self.measured is None:
            return self.true
        if self.measured is None or threshold is None:
            raise WildlabError(
                "a claim has a measure and no threshold, or neither",
                "state the threshold with the claim, or give the flights of which it is true",
            )
        with np.errstate(invalid="ignore"):
            beyond = self.measured > threshold if self.above else self.measured < threshold
        return beyond if self.true is None else beyond & self.true

    def reaches(self, threshold: float) -> bool:
        """Whether the measure can be on either side of a threshold; else that alone gives the answer.

        Examples
        --------
        >>> f1 = Check(measured=np.array([0.8]), above=True, reach=(0, 1))
        >>> f1.reaches(0.7), f1.reaches(1.4)
        (True, False)
        """
        low, high = self.reach
        return low <= threshold < high if self.above else low < threshold <= high

    def __len__(self) -> int:
        if self.by_threshold is not None:
            return len(next(iter(self.by_threshold.values())))
        return len(self.true if self.true is not None else np.asarray(self.measured))


class Decision(NamedTuple):
    """What the flights say of a sentence.

    Attributes
    ----------
    verdict
        One of `SHARE_VERDICTS`, or `NO_PREMISE`.
    share
        Of the flights that meet the premise, with its interval; None where too few do.
    true, met, flights
        Of how many it is true, how many meet the premise, how many there are.
    """

    verdict: str
    share: Interval | None
    true: int
    met: int
    flights: int


def share_verdict(share: Interval) -> str:
    """The verdict on a sentence by the interval of its share.

    Parameters
    ----------
    share
        From `wildlab.evaluation.intervals.share_interval`.

    Returns
    -------
    str
        One of `SHARE_VERDICTS`.

    Examples
    --------
    >>> share_verdict(share_interval(196, 200)), share_verdict(share_interval(20, 20))
    ('holds', 'holds on most flights')
    """
    if share.low >= ALMOST_ALL:
        return HOLDS
    if share.low > HALF:
        return MOSTLY
    if share.high <= ALMOST_NONE:
        return FAILS
    if share.high < HALF:
        return MOSTLY_NOT
    return UNDECIDED


def decide(true: ArrayLike, premise: ArrayLike | None = None) -> Decision:
    """Decide a sentence on simulated flights.

    Parameters
    ----------
    true
        (N,) bool: of which flights it is true.
    premise
        (N,) bool: which flights have what the sentence is about; all where it is None. The share is that of
        these flights. Where not even half of the flights have it, the sentence is not judged.

    Returns
    -------
    Decision

    Raises
    ------
    WildlabError
        Where there is no flight, or not one premise for each.

    Examples
    --------
    >>> decide([True] * 95 + [False] * 5).verdict
    'holds on most flights'
    """
    yes = np.asarray(true, bool)
    met = np.ones(len(yes), bool) if premise is None else np.asarray(premise, bool)
    if not len(yes) or met.shape != yes.shape:
        raise WildlabError(
            f"{len(yes)} flights and premises of the shape {met.shape}",
            "give one or more flights, and one premise for each",
        )
    count, of = int((yes & met).sum()), int(met.sum())
    if 2 * of < len(yes):
        return Decision(NO_PREMISE, None, count, of, len(yes))
    share = share_interval(count, of)
    return Decision(share_verdict(share), share, count, of, len(yes))


def decide_check(check: Check, threshold: float | None = None) -> Decision:
    """Decide a sentence by its check: by flights (`decide`), by all images together, or as a calculation.

    By all images together it holds where the 95 % interval of their share lies on the true side of the
    threshold, does not hold where it lies on the other, and is undecided where the threshold is inside: there
    are too few images. A calculation holds or does not.

    Parameters
    ----------
    check
        What the flights give.
    threshold
        Of the sentence, where it has one.

    Returns
    -------
    Decision
        ``share`` is None but of flights.

    Raises
    ------
    WildlabError
        As `decide` and `Check.holds`; or where images are pooled without a threshold.

    Examples
    --------
    >>> rates = np.zeros(6)
    >>> decide_check(Check(measured=rates, pooled=Pooled(0, 48)), 0.0086).verdict
    'undecided'
    """
    flights = len(check)
    if check.pooled is not None:
        if threshold is None:
            raise WildlabError("images are pooled and no threshold is stated", "state it with the claim")
        if not check.pooled.of:
            return Decision(NO_PREMISE, None, 0, 0, flights)
        share = share_interval(*check.pooled)
        under, over = share.high <= threshold, share.low > threshold
        yes, no = (over, under) if check.above else (under, over)
        return Decision(HOLDS if yes else FAILS if no else UNDECIDED, None, 0, flights, flights)
    true = check.holds(threshold)
    if check.measured is not None and not np.isfinite(check.measured).any():
        return Decision(NO_PREMISE, None, 0, 0, flights)
    if check.calculated:
        verdict = HOLDS if true.all() else UNDECIDED if true.any() else FAILS
        return Decision(verdict, None, int(true.sum()), flights, flights)
    return decide(true, check.premise)


def paired_difference(first: ArrayLike, second: ArrayLike) -> Interval | None:
    """Mean of ``first - second`` over flights that have both, with Student's interval.

    Parameters
    ----------
    first, second
        (N,), one number of each flight; NaN where a flight has none.

    Returns
    -------
    Interval or None
        None where fewer than two flights have both.

    Examples
    --------
    >>> round(paired_difference([3.0, 4.0, 5.0], [2.0, 2.0, 2.0]).estimate, 1)
    2.0
    """
    apart = np.asarray(first, float) - np.asarray(second, float)
    return mean_interval(apart) if np.isfinite(apart).sum() > 1 else None


def expected_wrong(tested: int) -> float:
    """How many verdicts chance makes wrong, at most and on average.

    A verdict is wrong where the share of all such flights lies on the other side of the border that the
    verdict says it does not cross. Wilson's interval crosses a border wrongly with a probability of no more
    than `WRONG`, which is reached where the share of all flights is the border itself.

    Parameters
    ----------
    tested
        How many sentences were decided on simulated flights.

    Returns
    -------
    float
        An upper bound of the mean: sentences that are clearly true or false hardly count. Those of one study
        share their flights, so wrong ones come together.

    Examples
    --------
    >>> round(expected_wrong(100), 1)
    3.5
    """
    return WRONG * tested
