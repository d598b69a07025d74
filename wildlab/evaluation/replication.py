"""A published number and ours: is it close, and is it compatible with our flights?

**Close?** is a test of equivalence (two one-sided tests): the 90 % confidence interval of our centre lies
within the margin of the published number ("close"), beside it ("not close"), or across its border ("cannot
tell").

**Compatible?** asks whether the published flight could be one of ours: whether its number lies in the 90 %
prediction interval of one more flight like ours (Patil, Peng & Leek 2016, doi:10.1177/1745691616646366), by
order statistics, so that the level is exact for any distribution: "within" or "outside". Fewer than 19
flights have no such interval. Where the interval would also hold more than half of the flights of a twin
half as large, "within" would say nothing: "no power".

Margins are fixed by the kind of quantity, once for all studies:

================== ============================================================ =======================
kind               what it is                                                   margin
================== ============================================================ =======================
error size         a mean, root mean square or quantile of distances            factor 1.25
standard deviation of errors, or as a filter reports it                         factor 1.25
NEES or NIS        mean of a normalised square: 25 % of its root                factor 1.25 squared
rate               a probability                                                factor 1.25 of its odds
signed mean        of one coordinate's errors: near zero it has no scale        only compatible or not
================== ============================================================ =======================

A published number stands for the interval that is rounded to it, so that its rounding adds to every margin.
Of an exact calculation that rounding, with that of the published inputs, is the whole margin; flights do
not enter.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from enum import StrEnum
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from wildlab.errors import WildlabError
from wildlab.evaluation.intervals import finite_sorted, median_interval, prediction_interval

if TYPE_CHECKING:
    import pandas as pd

Array = NDArray[np.float64]

#: Below this probability of noticing a twin of twice the errors, "within" says nothing.
LEAST_POWER = 0.5
#: Half the width of a 90 % interval, in standard errors.
_Z = 1.6448536269514722
#: A hair of slack: 5.45 - 5.3 is 0.1500000000000004.
_SLACK = 1e-9


class Closeness(StrEnum):
    """Whether our centre is near a published number."""

    CLOSE = "close"
    NOT_CLOSE = "not close"
    CANNOT_TELL = "cannot tell"
    NOT_JUDGED = "not judged"


class Compatibility(StrEnum):
    """Whether a published number could be that of one more flight like ours."""

    WITHIN = "within"
    OUTSIDE = "outside"
    TOO_FEW = "too few flights"
    NO_POWER = "no power"
    NOT_JUDGED = "not judged"


class Reproduction(StrEnum):
    """What both answers come to, for counts."""

    REPRODUCED = "reproduced"
    OPEN = "open"
    CONTRADICTED = "contradicted"
    NOT_JUDGED = "not judged"


class QuantityKind(NamedTuple):
    """A kind of quantity: its margin, a ``factor`` (0: none), whether that is of its ``odds``, and with which
    ``power`` of the errors' size it grows."""

    factor: float
    odds: bool = False
    power: int = 1


KINDS = {
    "error size": QuantityKind(1.25),
    "standard deviation": QuantityKind(1.25),
    "NEES or NIS": QuantityKind(1.25**2, power=2),
    "rate": QuantityKind(1.25, odds=True),
    "signed mean": QuantityKind(0.0),
}
#: Kinds whose numbers the front page counts where they are predicted for a flight.
SIZES = ("error size", "standard deviation", "NEES or NIS")


@dataclass(frozen=True)
class Comparison:
    """A published number and ours.

    Attributes
    ----------
    closeness, compatibility
        The two answers.
    ratio
        Ours to the published one; None where one of them is not above zero, and of a signed mean.
    reason
        Why it is not judged, or what the answer rests on.
    fitted
        What of ours was chosen by this number; "" where nothing was.
    """

    closeness: Closeness
    compatibility: Compatibility
    ratio: float | None
    reason: str = ""
    fitted: str = ""

    @property
    def reproduction(self) -> Reproduction:
        """What both answers come to."""
        return reproduction(self.closeness, self.compatibility)

    @property
    def words(self) -> str:
        """Both answers: ``"close, within"``; of what only one is asked, that one."""
        told = [one for one in (self.closeness, self.compatibility) if one != "not judged"]
        return ", ".join([*told, *(["fitted"] if self.fitted else [])]) if told else "not judged"


def reproduction(closeness: str, compatibility: str) -> Reproduction:
    """What both answers come to.

    Parameters
    ----------
    closeness, compatibility
        Members of the two enums, or their values.

    Returns
    -------
    Reproduction
        Contradicted where it is outside and not shown to be close, or a calculation that is not close;
        reproduced where it is close and not outside; open where one answer leaves the other open.

    Examples
    --------
    >>> str(reproduction("close", "within")), str(reproduction("cannot tell", "within"))
    ('reproduced', 'open')
    """
    close, outside = closeness == Closeness.CLOSE, compatibility == Compatibility.OUTSIDE
    if closeness == compatibility == "not judged":
        return Reproduction.NOT_JUDGED
    if close:
        return Reproduction.OPEN if outside else Reproduction.REPRODUCED
    if outside or (closeness == Closeness.NOT_CLOSE and compatibility == Compatibility.NOT_JUDGED):
        return Reproduction.CONTRADICTED
    if closeness == Closeness.NOT_JUDGED and compatibility == Compatibility.WITHIN:
        return Reproduction.REPRODUCED
    return Reproduction.OPEN


def not_judged(reason: str) -> Comparison:
    """A comparison that comes to nothing, and why."""
    nothing = Closeness.NOT_JUDGED, Compatibility.NOT_JUDGED
    return Comparison(*nothing, None, reason)


def power_of(values: ArrayLike, kind: str) -> float:
    """The probability of "outside" for a published flight whose errors are half as large as ours.

    Parameters
    ----------
    values
        (N,), one of each flight.
    kind
        A key of `KINDS`.

    Returns
    -------
    float
        NaN where there is no prediction interval.
    """
    known = finite_sorted(values)
    low, high = prediction_interval(known)
    if math.isnan(low):
        return math.nan
    half = known / 2 ** KINDS[kind].power
    if KINDS[kind].odds:
        half = known / (2 - known)  # of half the odds
    return float(np.mean((half < low) | (half > high)))


def propagate_rounding(
    function: Callable[[Array], ArrayLike], inputs: ArrayLike, rounding: ArrayLike
) -> tuple[Array, Array]:
    """Bounds of a calculation over what its published inputs were rounded from.

    Parameters
    ----------
    function
        Of (K,) inputs; gives (M,) or one result.
    inputs
        (K,), as published.
    rounding
        (K,), what that leaves open of each to each side.

    Returns
    -------
    (low, high)
        Each as the result. Each input is moved alone, and what the moves do is added up: exact where the
        result is a sum of functions of one input, else to first order.

    Examples
    --------
    >>> low, high = propagate_rounding(lambda x: x[0] + 2 * x[1], [1.0, 1.0], [0.5, 0.05])
    >>> round(float(low), 2), round(float(high), 2)
    (2.4, 3.6)
    """
    given, half = np.asarray(inputs, float), np.diag(np.asarray(rounding, float))
    middle = np.asarray(function(given), float)
    ends = np.array([[np.asarray(function(given + sign * row)) - middle for sign in (-1, 1)] for row in half])
    return middle + ends.min(axis=1).clip(max=0).sum(axis=0), middle + ends.max(axis=1).clip(min=0).sum(
        axis=0
    )


def compare_calculation(
    here: float,
    published: float,
    rounding: float,
    *,
    inputs: tuple[float, float] | None = None,
    error: float | None = None,
) -> Comparison:
    """An exact calculation and the published result; flights do not enter.

    Parameters
    ----------
    here, published
        In the same unit.
    rounding
        What the rounding of the published result leaves open to each side, in that unit.
    inputs
        Bounds of our result, over what the published inputs are rounded from. It is close where some of them
        gives the published result.
    error
        Standard error of ours, where it is calculated by simulation: then the 90 % interval has to lie within
        the rounding for "close", and beside it for "not close".

    Returns
    -------
    Comparison

    Examples
    --------
    >>> str(compare_calculation(5.24, 5.3, 0.05).closeness)
    'not close'
    >>> str(compare_calculation(5.24, 5.3, 0.05, inputs=(5.21, 5.26)).closeness)
    'close'
    """
    low, high = (here, here) if inputs is None else inputs
    allowed = (published - rounding - (high - here), published + rounding + (here - low))
    chance = _Z * error if error is not None else 0.0
    near = _closeness((here - chance, here + chance), allowed)
    off = here - published
    reason = f"tolerance {rounding:g}" + (f", inputs {low:.4g} to {high:.4g}" if inputs else "")
    if near is Closeness.NOT_CLOSE:
        reason += f", {abs(off / published):.1%} off".replace("%", " %") if published else f", {off:.3g} off"
    return Comparison(near, Compatibility.NOT_JUDGED, _ratio(here, published), reason)


def compare_mean(
    here: float, published: float, rounding: float, error: float | None, published_error: float | None
) -> Comparison:
    """Our mean probability over runs and a published mean over other runs.

    Parameters
    ----------
    here, published
        Mean probabilities, 0 to 1.
    rounding
        Of the published one, to each side.
    error, published_error
        Standard error of each mean; None where it is not known.

    Returns
    -------
    Comparison
        Compatible is, within what chance explains of the difference of two such means, 90 %.

    Examples
    --------
    >>> compare_mean(0.9600, 0.9664, 0.00005, 0.0008, 0.0008).words
    'close, outside'
    """
    if error is None or published_error is None:
        return not_judged("a standard error is not known")
    near = _closeness(
        (here - _Z * error, here + _Z * error), _margin("rate", published - rounding, published + rounding)
    )
    chance = _Z * math.hypot(error, published_error)
    inside = abs(here - published) <= rounding + chance + _SLACK
    compatible = Compatibility.WITHIN if inside else Compatibility.OUTSIDE
    reason = f"chance {100 * chance:.2g} %"
    return Comparison(near, compatible, _ratio(here, published), reason)


def compare_flight(
    kind: str,
    here: float,
    published: float,
    rounding: float = 0.0,
    *,
    share: tuple[float, float] | None = None,
    centre: tuple[float, float] | None = None,
    predicted: tuple[float, float] | None = None,
    power: float | None = None,
) -> Comparison:
    """One published flight and ours.

    Parameters
    ----------
    kind
        A key of `KINDS`.
    here
        The median of our flights.
    published
        Of the published flight.
    rounding
        What rounding leaves open of it, to each side.
    share
        Of a published share of so many images, its 90 % interval: what is close is counted from its ends.
    centre
        90 % confidence interval of our median (`median_interval`), or of the share of all our images.
    predicted
        90 % prediction interval (`prediction_interval`).
    power
        `power_of` our flights; None counts as enough.

    Returns
    -------
    Comparison

    Raises
    ------
    WildlabError
        If the kind is not known.

    Examples
    --------
    >>> compare_flight("error size", 8.2, 8.0, centre=(7.9, 8.5), predicted=(6.0, 11.0)).words
    'close, within'
    >>> compare_flight("error size", 4.4, 10.25, centre=(4.2, 4.6), predicted=(3.0, 6.4)).words
    'not close, outside'
    """
    if kind not in KINDS:
        raise WildlabError(f"no margin for {kind!r}", f"use one of: {', '.join(KINDS)}", field="kind")
    signed = kind == "signed mean"
    ratio = None if signed else _ratio(here, published)
    if not signed and published + rounding <= 0:
        return not_judged("a ratio needs numbers above zero")
    near = Closeness.NOT_JUDGED
    if not signed:
        allowed = _margin(kind, *(share or (published - rounding, published + rounding)))
        near = Closeness.CANNOT_TELL if centre is None else _closeness(centre, allowed)
    reason = "" if power is None else f"power {power:.2f}"
    if predicted is None:
        compatible = Compatibility.TOO_FEW
    elif published + rounding < predicted[0] - _SLACK or published - rounding > predicted[1] + _SLACK:
        compatible = Compatibility.OUTSIDE
    else:
        weak = power is not None and power < LEAST_POWER
        compatible = Compatibility.NO_POWER if weak else Compatibility.WITHIN
    return Comparison(near, compatible, ratio, reason)


def _margin(kind: str, low: float, high: float) -> tuple[float, float]:
    """What is close to a published number, its bounds in the unit of the number, which lies between two."""
    factor, odds, _ = KINDS[kind]
    if not odds:
        return low / factor, high * factor
    low, high = max(low, 0.0), min(high, 1.0)
    return low / (low + factor * (1 - low)), factor * high / (factor * high + 1 - high)


def _closeness(interval: tuple[float, float], allowed: tuple[float, float]) -> Closeness:
    low, high = interval
    least, most = allowed[0] - _SLACK, allowed[1] + _SLACK
    if low >= least and high <= most:
        return Closeness.CLOSE
    return Closeness.NOT_CLOSE if high < least or low > most else Closeness.CANNOT_TELL


def _ratio(a: float, b: float) -> float | None:
    return a / b if a > 0 and b > 0 else None


#: The answers that are counted.
ANSWERS = (
    *(Closeness.CLOSE, Closeness.NOT_CLOSE, Closeness.CANNOT_TELL),
    *(Compatibility.WITHIN, Compatibility.OUTSIDE, Compatibility.NO_POWER),
)


#: Flights of the twin, by how much its errors are larger than those of the published flight, and how many
#: independent errors a flight has.
FLIGHTS, ERROR_FACTORS, INDEPENDENT = 100, (1.0, 1.2, 1.5, 2.0), 20


def operating_characteristics(trials: int) -> pd.DataFrame:
    """How often each answer is given, by simulation of the rule itself.

    A flight has `INDEPENDENT` errors of two coordinates, as one of some minutes whose errors
    last for tens of seconds. The errors of the twin's flights are so many times those of the published
    flight; of a rate, so many times the odds of a miss.

    Parameters
    ----------
    trials
        For each kind and factor.

    Returns
    -------
    DataFrame
        Columns ``kind``, ``factor``, and one for each answer with its probability: ``close``, ``not close``,
        ``cannot tell``, ``within``, ``outside``, ``no power``.
    """
    rng = np.random.default_rng(1)
    rows = []
    for kind in KINDS:
        for factor in ERROR_FACTORS:
            ours, theirs = _flights(rng, kind, (trials, FLIGHTS), factor), _flights(rng, kind, (trials,), 1.0)
            found = [_compare_values(kind, *one) for one in zip(ours, theirs, strict=True)]
            told = [(one.closeness, one.compatibility) for one in found]
            shares = {answer.value: float(np.mean([answer in one for one in told])) for answer in ANSWERS}
            rows.append({"kind": kind, "factor": factor} | shares)
    import pandas as pd  # who lists the studies needs none

    return pd.DataFrame(rows)


def _compare_values(kind: str, values: Array, published: float) -> Comparison:
    """`compare_flight` with what (N,) ``values``, one of each of our flights, give."""
    centre, predicted = median_interval(values), prediction_interval(values)
    known = not math.isnan(predicted[0])
    return compare_flight(
        kind,
        float(np.median(values)),
        float(published),
        centre=None if math.isnan(centre[0]) else centre,
        predicted=predicted if known else None,
        power=power_of(values, kind) if known else None,
    )


def _flights(rng: np.random.Generator, kind: str, shape: tuple[int, ...], factor: float) -> Array:
    """Figures of flights, whose errors have the deviation ``factor``; of a rate, a share of 0.8
    of five images for each independent error whose odds are divided by it."""
    if kind == "rate":
        images = 5 * INDEPENDENT
        return np.asarray(rng.binomial(images, 4 / (4 + factor), shape) / images)
    if kind == "signed mean":
        return np.asarray(factor * np.abs(rng.standard_normal(shape)) / math.sqrt(INDEPENDENT))
    if kind == "error size":
        return np.asarray(factor * rng.rayleigh(1.0, (INDEPENDENT, *shape)).mean(axis=0))
    worth = INDEPENDENT - 1 if kind == "standard deviation" else 2 * INDEPENDENT
    mean = rng.chisquare(worth, shape) / worth
    return np.asarray(factor * np.sqrt(mean) if kind == "standard deviation" else factor**2 * mean)
