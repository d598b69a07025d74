"""Sentences on tracks of one target that follow from their numbers: how sure a filter is of itself, how two
filters compare, and how typical the flight is that the figures show."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike

from wildlab.evaluation.shares import FAILS, HOLDS, MOSTLY, MOSTLY_NOT, NO_PREMISE, UNDECIDED

#: A ratio of errors nearer to one than this is called "about as large as".
ALIKE = 1.2
#: A drawn flight between these quantiles of all flights is called typical.
TYPICAL = (0.25, 0.75)


def stated_words(nees: float) -> str:
    """What a mean NEES of two degrees of freedom says of a filter: its errors beside what it states.

    Examples
    --------
    >>> stated_words(18.0), stated_words(2.1), stated_words(0.5)
    ('3.0 times as large as it states', 'about as large as it states', '0.50 of what it states')
    >>> stated_words(float("nan"))
    'not known'
    """
    factor = float(np.sqrt(nees / 2))
    if np.isnan(factor):
        return "not known"
    if factor > ALIKE:
        return f"{factor:.1f} times as large as it states"
    if factor < 1 / ALIKE:
        return f"{factor:.2f} of what it states"
    return "about as large as it states"


def surprise_words(nees: float, nis: float) -> str:
    """Errors of the track and surprises at the detections beside what a filter states, in a sentence's end.

    Parameters
    ----------
    nees, nis
        Means, two degrees of freedom each: 2 where the filter is right.

    Examples
    --------
    >>> surprise_words(18.0, 2.0).partition(",")[0]
    'errors are 3.0 times as large as it states'
    """
    errors = f"errors are {stated_words(nees)}"
    if not np.isfinite([nees, nis]).all():
        return errors
    bad = nees > 2 * ALIKE**2
    if nis > 2 * ALIKE**2:
        seen = "single detections show it, too" if bad else "single detections would suggest larger ones"
        return f"{errors}, and {seen}: they fall farther from where they are expected than it states"
    if nis < 2 / ALIKE**2:
        seen = "single detections do not show it" if bad else "single detections are no worse"
        return f"{errors}, and {seen}: they fall nearer to where they are expected than it states"
    seen = "single detections do not show it" if bad else "single detections agree"
    return f"{errors}, and {seen}: they fall about where they are expected"


def claim_words(verdict: str, share: float | None, flights: int) -> str:
    """On how many flights something is true, after "which is so".

    Examples
    --------
    >>> claim_words("holds", 0.98, 200)
    'on nearly all of 200 flights (98 %)'
    >>> claim_words("holds", 1.0, 1)
    'on 1 of 1 flights, which decides nothing'
    """
    much = {
        HOLDS: "on nearly all",
        MOSTLY: "on most",
        UNDECIDED: "on about half",
        MOSTLY_NOT: "on fewer than half",
        FAILS: "on hardly any",
    }
    if verdict == NO_PREMISE or share is None:
        return f"not tested: {flights} flights lack what it is about"
    if verdict == UNDECIDED or flights == 1:
        return f"on {share * flights:.0f} of {flights} flights, which decides nothing"
    return f"{much[verdict]} of {flights} flights ({100 * share:.0f} %)"


def accuracy_words(names: Mapping[str, str], mae: pd.DataFrame) -> str:
    """Which of two filters is nearer to the truth, and by how much, on how many flights.

    Parameters
    ----------
    names
        Words for the two, by column.
    mae
        (flights, 2) mean distances, metres.

    Examples
    --------
    >>> accuracy_words({"a": "A", "b": "B"}, pd.DataFrame({"a": [10.0, 11.0], "b": [12.0, 12.0]}))
    'A is nearer to the truth on 2 of 2 flights, by 1.5 m on average'
    """
    (one, first), (two, second) = names.items()
    apart = (mae[two] - mae[one]).dropna().to_numpy()
    if not len(apart):
        return f"which of {first} and {second} is nearer to the truth is not known"
    nearer, mean = int((apart > 0).sum()), float(apart.mean())
    if nearer * 2 >= len(apart):
        who, count = first, nearer
    else:
        who, count, mean = second, len(apart) - nearer, -mean
    by = f"by {mean:.1f} m on average" if mean >= 0 else f"and yet {-mean:.1f} m farther on average"
    return f"{who} is nearer to the truth on {count} of {len(apart)} flights, {by}"


def typical_words(values: ArrayLike) -> str:
    """How the flight that the figures show, the first of ``values`` (N,), compares with the others.

    Examples
    --------
    >>> typical_words([5.0, 4.0, 6.0, 3.0, 7.0])
    'typical: 2 of the 4 others have a smaller one'
    """
    array = np.asarray(values, float)
    others = array[1:][np.isfinite(array[1:])]
    if not np.isfinite(array[0]):
        return "not known"
    if not len(others):
        return "the only one"
    smaller = int((others < array[0]).sum())
    share = smaller / len(others)
    low, high = TYPICAL
    word = "typical" if low <= share <= high else "not typical"
    return f"{word}: {smaller} of the {len(others)} others have a smaller one"
