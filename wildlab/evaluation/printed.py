"""A printed number beside ours: how near is near, and what may be concluded.

A printed number is one of four. The result of an exact *calculation* is reached or not, within what rounding
leaves open. A *mean of runs* is compared with our mean, by the standard errors of both. *One flight's* figure
is a single draw: our flights say where such draws fall, and the margin says from which distance on it matters
that theirs fell elsewhere. A *share of images* is compared with the share of all our images together, by its
interval.

The margins are fixed here for each kind of quantity, once for all studies. They are what a figure of one
flight is uncertain by if the flight has `INDEPENDENT` independent values: errors stay alike for tens of
seconds, and a flight takes minutes. Each is the half width of the figure's 95 % band (`tests/evaluation`
work them out), rounded:

==================== ======================================================================= ==========
kind                 what it is                                                              margin
==================== ======================================================================= ==========
error size           a mean, root mean square or quantile of distances                       factor 1.25
standard deviation   of errors, or as a filter states it                                     factor 1.3
NEES or NIS          mean of a normalised square, two degrees of freedom                     factor 1.45
signed mean          of one coordinate's errors: compared with their SD                      0.44 of it
signed mean, no SD   where that is not printed: compared with the size of the errors         0.35 of it
rate                 a share of images or of frames                                          0.02
==================== ======================================================================= ==========

Rates of thousands of frames are known to better than that; for them 0.02 is what makes no difference to
whoever uses the method.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

from wildlab.errors import WildlabError

#: Verdicts on a printed number of which there is one of ours.
AGREES, POSSIBLE, TOO_VAGUE, DIFFERS = "agrees", "possible", "too vague to tell", "differs"
#: Where there is nothing to judge by; a reason goes with it.
NOT_JUDGED = "not judged"

#: Independent values of a flight that the margins stand for.
INDEPENDENT = 20
#: A middle 90 % of our flights that is wider than this factor says too little to tell.
WIDEST_FACTOR = 3.0
#: The same for what is compared by its difference: so many margins.
WIDEST_MARGINS = 5.0
#: Of the normal distribution, for 95 %.
_Z = 1.959963984540054


#: Of a signed mean, in standard deviations of the same coordinate's errors.
BY_DEVIATION = 0.44


class Margin(NamedTuple):
    """How near one flight's figure is near: a ``factor``, or a ``difference`` (of a signed mean, in sizes of
    the printed errors); the other is None."""

    factor: float | None
    difference: float | None


MARGINS = {
    "error size": Margin(1.25, None),
    "standard deviation": Margin(1.3, None),
    "NEES or NIS": Margin(1.45, None),
    "signed mean": Margin(None, 0.35),
    "rate": Margin(None, 0.02),
}


@dataclass(frozen=True)
class Comparison:
    """What a printed number beside ours comes to.

    Attributes
    ----------
    verdict
        One of the words above.
    ratio
        Ours to the printed one; None where one of them is not above zero, and of a signed mean.
    difference
        Ours minus the printed one.
    spread
        The upper bound of our flights to the lower; None where the lower is not above zero, or there is none.
    reason
        Why it is not judged, or what the verdict rests on.
    """

    verdict: str
    ratio: float | None
    difference: float
    spread: float | None = None
    reason: str = ""


def compare_calculation(here: float, printed: float, within: float | None) -> Comparison:
    """An exact calculation beside the printed result.

    Parameters
    ----------
    here, printed
        In the same unit.
    within
        What rounding leaves open, in that unit; None where nobody has said.

    Returns
    -------
    Comparison

    Examples
    --------
    >>> compare_calculation(5.24, 5.3, 0.15).verdict
    'agrees'
    """
    ratio, difference = _ratio(here, printed), here - printed
    if within is None:
        return Comparison(NOT_JUDGED, ratio, difference, reason="no tolerance is stated for it")
    # A hair of slack: 5.45 - 5.3 is 0.1500000000000004.
    verdict = AGREES if abs(difference) <= within + 1e-9 else DIFFERS
    return Comparison(verdict, ratio, difference, reason=f"tolerance {within:g}")


def compare_mean(
    here: float, printed: float, standard_error: float | None, printed_error: float | None, within: float
) -> Comparison:
    """Our mean over runs beside a printed mean over runs.

    It agrees where the difference is no more than the tolerance and what chance explains: 1.96 of both
    standard errors together. How far single runs spread does not enter.

    Parameters
    ----------
    here, printed
        Means, in the same unit.
    standard_error, printed_error
        Of each mean; None where it is not known.
    within
        What may remain between two implementations of the same text, in that unit.

    Returns
    -------
    Comparison

    Examples
    --------
    >>> compare_mean(88.2, 96.64, 0.1, 0.1, 0.5).verdict
    'differs'
    """
    ratio, difference = _ratio(here, printed), here - printed
    if standard_error is None or printed_error is None:
        return Comparison(NOT_JUDGED, ratio, difference, reason="a standard error is not known")
    chance = _Z * math.hypot(standard_error, printed_error)
    verdict = AGREES if abs(difference) <= within + chance + 1e-9 else DIFFERS
    return Comparison(verdict, ratio, difference, reason=f"tolerance {within:g}, chance {chance:.2g}")


def compare_flight(
    kind: str,
    here: float,
    printed: float,
    low: float | None,
    high: float | None,
    *,
    size: float | None = None,
    deviation: float | None = None,
) -> Comparison:
    """Our flights beside one printed flight.

    Agrees: the median of ours is within the margin of the printed value. Possible: it is not, and the printed
    value lies in the middle 90 % of our flights. Too vague to tell: the same, where that middle is wider than
    a factor of three, or five margins. Differs: the printed value lies outside.

    Parameters
    ----------
    kind
        A key of `MARGINS`.
    here
        The median of our flights.
    low, high
        Bounds of the middle 90 % of our flights; None where there is one flight.
    size
        Of the printed errors, in the same unit: what a signed mean is compared with. It is theirs if their
        mean is near zero.
    deviation
        The printed standard deviation of the same coordinate's errors, which serves in its place.

    Returns
    -------
    Comparison

    Raises
    ------
    WildlabError
        If the kind is not known.

    Examples
    --------
    >>> compare_flight("error size", 8.2, 8.0, 7.9, 8.5).verdict
    'agrees'
    >>> compare_flight("error size", 13.8, 8.0, 4.0, 25.0).verdict
    'too vague to tell'
    """
    if kind not in MARGINS:
        raise WildlabError(f"no margin for {kind!r}", f"use one of: {', '.join(MARGINS)}", field="kind")
    factor, share = MARGINS[kind]
    ratio, difference = _ratio(here, printed), here - printed
    known = low is not None and high is not None
    spread = _ratio(high, low) if known else None  # type: ignore[arg-type]
    if factor is not None:
        if printed <= 0 or here <= 0:
            return Comparison(NOT_JUDGED, None, difference, spread, "a ratio needs numbers above zero")
        near = abs(math.log(here / printed)) <= math.log(factor) + 1e-9
        vague = spread is None or spread > WIDEST_FACTOR
        margin = f"a factor of {factor:g}"
    else:
        if kind == "signed mean" and size is None and deviation is None:
            why = "no size of the errors is printed with it"
            return Comparison(NOT_JUDGED, None, difference, spread, why)
        if kind == "signed mean":
            ratio = None  # of a mean near zero it says nothing
            allowed = share * size if deviation is None else BY_DEVIATION * deviation  # type: ignore[operator]
        else:
            allowed = share
        near = abs(difference) <= allowed + 1e-9
        vague = known and high - low > WIDEST_MARGINS * allowed  # type: ignore[operator]
        margin = f"{allowed:.2g}"
    inside = known and low - 1e-9 <= printed <= high + 1e-9  # type: ignore[operator]
    if near:
        return Comparison(AGREES, ratio, difference, spread, f"within {margin}")
    if not known:
        why = f"one flight here, and not within {margin}: it does not say what others would give"
        return Comparison(NOT_JUDGED, ratio, difference, spread, why)
    verdict = DIFFERS if not inside else TOO_VAGUE if vague else POSSIBLE
    return Comparison(verdict, ratio, difference, spread, f"not within {margin}")


def compare_share(here: float, printed: float, low: float | None, high: float | None) -> Comparison:
    """The share of all our images beside the share of all images of the print.

    Agrees: the whole 95 % interval of ours is within the margin of a rate of the printed value. Differs: none
    of it is. Too vague to tell: part of it is, for there are too few images.

    Parameters
    ----------
    here, printed
        Shares, 0 to 1.
    low, high
        Bounds of the interval of ours; None where there is none.

    Returns
    -------
    Comparison

    Examples
    --------
    >>> compare_share(1.0, 0.993, 0.926, 1.0).verdict
    'too vague to tell'
    """
    ratio, difference = _ratio(here, printed), here - printed
    if low is None or high is None:
        return Comparison(NOT_JUDGED, ratio, difference, reason="its interval is not known")
    margin = MARGINS["rate"].difference or 0.0
    least, most = printed - margin - 1e-9, printed + margin + 1e-9
    if low >= least and high <= most:
        verdict = AGREES
    else:
        verdict = DIFFERS if high < least or low > most else TOO_VAGUE
    why = f"interval {100 * low:.1f} to {100 * high:.1f} %, margin {100 * margin:.2g} %"
    return Comparison(verdict, ratio, difference, reason=why)


def _ratio(a: float, b: float) -> float | None:
    return a / b if a > 0 and b > 0 else None
