"""Are error ellipses honest, and what do several sightings of the same thing say?

How often ellipses hold the truth and how much larger they should be; what averaging sightings gains, and how
far they lie apart.
"""

from __future__ import annotations

from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from wildlab.evaluation.intervals import (
    FEWEST,
    PROBABILITY,
    Interval,
    block_mean,
    widening,
)
from wildlab.geometry.covariances import chi2_quantile
from wildlab.geometry.robust import student_scale

Array = NDArray[np.float64]
Word = Literal["honest", "too small", "too large", "undecided", "too few"]

#: A factor nearer to one than this, either way, is of no consequence: 90 % ellipses of normal errors then
#: hold 87 to 93 %. From the second on it matters.
CLOSE, CLEAR = 1.06, 1.15
#: From so many times the length that errors need on, ellipses are worth a look.
LONG = 2.0
#: Honest is said only where the factor is also known to lie between these.
WIDEST = (1 / 1.5, 1.5)
#: Which share of the truth ellipses promise to hold, and how often blocks are drawn for the factor.
STATED, DRAWS = 0.9, 500
#: Mean of the logarithm of a chi-square with two degrees of freedom: log 2 less Euler's constant.
_MEAN_LOG = float(np.log(2) - np.euler_gamma)
#: Squared errors below this have no logarithm worth the name: a millionth of a standard deviation.
_LEAST = 1e-12


class EllipseVerdict(NamedTuple):
    """What ellipses are worth.

    Attributes
    ----------
    word
        ``honest``, ``too small``, ``too large``, ``undecided``, or ``too few`` blocks to tell.
    coverage
        Share of the ellipses that hold the truth, with its interval.
    factor
        What to multiply their axes by so that they hold it as often as they say, with its interval. Its high
        end is no lower than that of a factor which all errors tell, not the largest alone.
    n
        How many there are.
    """

    word: Word
    coverage: Interval
    factor: Interval
    n: int


def judge_ellipses(
    errors: ArrayLike,
    covariances: ArrayLike,
    blocks: ArrayLike,
    rng: np.random.Generator,
) -> EllipseVerdict:
    """Hold the 90 % ellipses of errors against the errors.

    Parameters
    ----------
    errors
        (N, 2) north-east, m.
    covariances
        (N, 2, 2) m^2; rows with NaN, here or in the errors, are left out.
    blocks
        (N,) which points are drawn together.
    rng
        Draws blocks with replacement, for the interval of the factor.

    Returns
    -------
    EllipseVerdict

    Examples
    --------
    >>> rng = np.random.default_rng(0)
    >>> e = rng.normal(0, 3.0, (300, 2))
    >>> verdict = judge_ellipses(e, np.tile(np.eye(2), (300, 1, 1)), np.arange(300) // 10, rng)
    >>> verdict.word, round(verdict.factor.estimate)
    ('too small', 3)
    """
    e, P = np.asarray(errors, float), np.asarray(covariances, float)
    keep = np.isfinite(e).all(axis=1) & np.isfinite(P).all(axis=(1, 2))
    nan = float("nan")
    if not keep.any():
        return EllipseVerdict("too few", Interval(nan, nan, nan), Interval(nan, nan, nan), 0)
    e, P, group = e[keep], P[keep], np.unique(np.asarray(blocks)[keep], return_inverse=True)[1]
    squared = np.einsum("ni,ni->n", e, np.linalg.solve(P, e[..., None])[..., 0])
    bound = chi2_quantile(STATED, 2)
    held = block_mean((squared <= bound).astype(float), group)
    # Student's interval does not know that a share ends at one.
    coverage = Interval(held.estimate, max(held.low, 0.0), min(held.high, 1.0))
    size = float(np.sqrt(np.quantile(squared, STATED) / bound))
    count = int(group.max()) + 1
    if count < FEWEST:
        return EllipseVerdict("too few", coverage, Interval(size, nan, nan), len(e))
    members = [squared[group == g] for g in range(count)]
    drawn = [
        np.quantile(np.concatenate([members[g] for g in rng.integers(0, count, count)]), STATED)
        for _ in range(DRAWS)
    ]
    ends = np.sqrt(np.quantile(drawn, [(1 - PROBABILITY) / 2, (1 + PROBABILITY) / 2]) / bound)
    logarithms = np.log(np.maximum(squared, _LEAST))
    ends = size * (ends / size) ** widening(logarithms, group)
    # No draw holds an error larger than was seen: six honest ellipses hold the truth all, half the time.
    # By the mean logarithm of all squared errors, were they normal.
    most = np.exp((block_mean(logarithms, group).high - _MEAN_LOG) / 2)
    factor = Interval(size, float(ends[0]), max(float(ends[1]), float(most)))
    return EllipseVerdict(_word(factor), coverage, factor, len(e))


def is_overconfident(factor: Interval) -> bool:
    """Whether errors exceed those predicted by more than chance, and by more than matters.

    Parameters
    ----------
    factor
        Errors over those predicted, with its interval; NaN where it was not measured.

    Returns
    -------
    bool
    """
    return bool((factor.low > 1 and factor.estimate > CLEAR) or factor.low > CLOSE)


def is_conservative(factor: Interval) -> bool:
    """Whether those predicted exceed errors by more than chance, and by so much that a search is wasted.

    Parameters
    ----------
    factor
        As for `is_overconfident`.

    Returns
    -------
    bool
        Ellipses that are `LONG` times as long as they need be have four times the area.
    """
    return bool(factor.high < 1 / LONG)


def _word(factor: Interval) -> Word:
    if is_overconfident(factor):
        return "too small"
    if (factor.high < 1 and factor.estimate < 1 / CLEAR) or factor.high < 1 / CLOSE:
        return "too large"
    close = 1 / CLOSE <= factor.estimate <= CLOSE
    return "honest" if close and WIDEST[0] < factor.low and factor.high < WIDEST[1] else "undecided"


class Spread(NamedTuple):
    """How far sightings of the same thing lie apart, where nobody knows where it is.

    Attributes
    ----------
    sd
        Robust standard deviation of one sighting about the middle of its thing, m per axis.
    consistent
        Ratio of that spread to what the ellipses say, one where they are honest; NaN without ellipses.
    things, sightings
        What it rests on.
    """

    sd: float
    consistent: float
    things: int
    sightings: int


def spread_of_sightings(
    positions: ArrayLike, thing: ArrayLike, image: ArrayLike, covariances: ArrayLike | None = None
) -> Spread | None:
    """Spread of sightings of the same things from different images.

    A thing seen in n images scatters about its own middle by ``sqrt((n - 1) / n)`` of the standard deviation;
    that is put right. What all images share is not seen.

    Parameters
    ----------
    positions
        (N, 2) north-east, m; rows with NaN are left out.
    thing, image
        (N,) names; "" is a thing that is not known.
    covariances
        (N, 2, 2) m^2, what the ellipses say.

    Returns
    -------
    Spread or None
        None where nothing was seen in two images.

    Examples
    --------
    >>> rng = np.random.default_rng(0)
    >>> things, images = np.repeat(np.arange(50), 6), np.tile(np.arange(6), 50)
    >>> found = spread_of_sightings(rng.normal(0, 3.0, (300, 2)), things, images)
    >>> bool(abs(found.sd - 3.0) < 0.3)
    True
    """
    p, names, images = (
        np.asarray(positions, float),
        np.asarray(thing).astype(str),
        np.asarray(image).astype(str),
    )
    keep = np.isfinite(p).all(axis=1) & (names != "")
    apart, scaled, things = [], [], 0
    for name in np.unique(names[keep]):
        rows = np.flatnonzero(keep & (names == name))
        n = len(np.unique(images[rows]))
        if n < 2:
            continue
        things += 1
        d = (p[rows] - p[rows].mean(axis=0)) * np.sqrt(n / (n - 1))
        apart.append((d**2).sum(axis=1))
        if covariances is not None:
            P = np.asarray(covariances, float)[rows]
            scaled.append(np.einsum("ni,ni->n", d, np.linalg.solve(P, d[..., None])[..., 0]))
    if not things:
        return None
    squared = np.concatenate(apart)
    ratio = student_scale(np.concatenate(scaled)) if scaled else float("nan")
    return Spread(student_scale(squared), ratio, things, len(squared))
