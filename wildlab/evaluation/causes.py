"""Which constant error is behind those of a flight? Nested models, compared by their likelihood.

Pose errors wander, so that a constant is compared with noise that is correlated in time:
`wildlab.evaluation.correlated_errors`. Models are ordered by Schwarz's criterion under that covariance, and
what taking one off gains is measured on blocks of images in time order, each placed by parameters from the
others. The likelihood hangs on the noise that is estimated, and models with other clocks see other samples of
the log's noise: so a model wins that is the simplest within the odds of the best and no part of which places
unseen images as well, and any other that does so is one that the data do not separate from it.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.special import fdtrc, stdtr

from wildlab.evaluation.correlated_errors import (
    Covariance,
    Places,
    PosePoints,
    WanderNoise,
    fit_generalised,
)
from wildlab.evaluation.intervals import Interval, Labels, block_mean
from wildlab.evaluation.outliers import ODDS
from wildlab.geometry.covariances import chi2_beyond

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

#: Probability that any of the models tried is taken for a cause where nothing is constantly wrong: one flight
#: in a thousand, as for what is far out (`wildlab.evaluation.outliers`).
CHANCE = 0.001
#: How much less a score has to be for odds of `ODDS`.
MARGIN = 2 * np.log(ODDS)


class Linear(NamedTuple):
    """A model about its estimate from all points.

    Attributes
    ----------
    J, r
        (M, 2, P) derivatives and (M, 2) residuals, m, of the points it is estimated from.
    values
        (P,) the estimate.
    place
        Takes P parameters and gives the errors (N, 2) m, north-east; NaN where a ray misses the ground.
        Where places are not known, positions instead of errors.
    """

    J: Array
    r: Array
    values: Array
    place: Callable[[Array], Array]


class Fold(NamedTuple):
    """Points that are left out together.

    Attributes
    ----------
    unseen
        (N,) bool.
    seen
        (M,) bool, which of the points that models are estimated from are not left out.
    covariance
        Of the errors of these.
    """

    unseen: Mask
    seen: Mask
    covariance: Covariance


def leave_out(
    groups: Labels, used: Mask, points: PosePoints, noise: WanderNoise, places: Places | None = None
) -> list[Fold]:
    """Each group of points left out in turn.

    Parameters
    ----------
    groups
        (N,) which points are left out together.
    used
        (N,) bool, M points that models are estimated from.
    points
        These M.
    noise
        Of their poses and pixels.
    places
        Of these M, where errors of their places are not negligible.

    Returns
    -------
    list of Fold
    """
    folds = []
    for group in np.unique(groups):
        unseen = np.asarray(groups == group)
        seen = ~unseen[used]
        of = None if places is None else places.take(seen)
        if seen.any():
            folds.append(Fold(unseen, seen, Covariance(points.take(seen), noise, of)))
    return folds


def held_out(
    model: Linear, folds: Sequence[Fold], used: Mask, places: NDArray[np.generic] | None = None
) -> Array:
    """Errors (N, 2) of every point, each placed by parameters that its fold had no part in.

    The fits are steps from the estimate of all points with its derivatives, for these hardly move; the points
    are then placed without linearising. Where places are not known, a point's error is the distance to the
    mean of the same thing in the other folds.

    Parameters
    ----------
    model
        The model.
    folds
        From `leave_out`.
    used
        (N,) bool, the points it is estimated from.
    places
        (N,) which place each is of, where places are not known.

    Returns
    -------
    (N, 2) m, north-east; NaN for what is not left out or not seen elsewhere
    """
    out = np.full((len(used), 2), np.nan)
    for fold in folds:
        step = fit_generalised(model.J[fold.seen], model.r[fold.seen], fold.covariance).x
        found = model.place(model.values + step)
        if places is not None:
            others = np.zeros(len(used), bool)
            others[used] = fold.seen
            found = found - mean_of_others(found, places, others)
        out[fold.unseen] = found[fold.unseen]
    return out


def mean_of_others(positions: Array, places: NDArray[np.generic], others: Mask) -> Array:
    """(N, 2) mean of the positions (N, 2) that are of the same place and among ``others`` (N,); else NaN."""
    of = np.unique(places, return_inverse=True)[1]
    good = others & np.isfinite(positions).all(axis=1)
    count = np.bincount(of[good], minlength=int(of.max()) + 1).astype(float)
    count[count == 0] = np.nan
    sums = [np.bincount(of[good], weights=axis[good], minlength=len(count)) for axis in positions.T]
    return np.asarray((np.stack(sums, axis=-1) / count[:, None])[of])


class Gain(NamedTuple):
    """What taking a cause off gained on images it was not estimated from.

    Attributes
    ----------
    without, with_
        Mean error without and with it, m.
    gain
        Without minus with, with its interval from the blocks.
    """

    without: float
    with_: float
    gain: Interval

    @property
    def counts(self) -> bool:
        """Whether the interval lies above zero."""
        return bool(self.gain.low > 0)


def gain_of(without: Array, with_: Array, blocks: Labels) -> Gain:
    """Gain of held-out errors (N, 2) over errors (N, 2) without the cause, by blocks (N,).

    Parameters
    ----------
    without, with_
        (N, 2) m.
    blocks
        (N,).

    Returns
    -------
    Gain
        Of the points that both have; NaN where none is.
    """
    before, after = np.hypot(*without.T), np.hypot(*with_.T)
    both = np.isfinite(before) & np.isfinite(after)
    if not both.any():
        nan = float("nan")
        return Gain(nan, nan, Interval(nan, nan, nan))
    gain = block_mean(np.where(both, before - after, np.nan), blocks)
    return Gain(float(before[both].mean()), float(after[both].mean()), gain)


class Ranked(NamedTuple):
    """Models by their likelihood.

    Attributes
    ----------
    scores
        (M,) Schwarz's criterion: deviance, and the logarithm of the number of images for each parameter.
    winner
        Number of the simplest model within the odds of the best, or of the part of it that has the least
        held-out errors.
    rivals
        Those of no more parameters that do not hold the winner, and are within its odds or have held-out
        errors that are not larger for certain.
    """

    scores: Array
    winner: int
    rivals: tuple[int, ...]


def rank_models(
    deviances: Sequence[float],
    contents: Sequence[frozenset[str]],
    images: int,
    alike: Mapping[str, str] | None = None,
    held: Sequence[Array] = (),
    blocks: Labels | Sequence[int] = (),
) -> Ranked:
    """Rank models by their likelihood, their number of parameters and their held-out errors.

    Parameters
    ----------
    deviances
        For each of M models, squared length of its residuals in units of their covariance.
    contents
        For each model, its parameters.
    images
        How many images they were fitted to.
    alike
        Parameters that correct the same as another one, by name: models that differ in these alone are no
        rivals.
    held, blocks
        For each model, its held-out errors (N, 2), and the blocks (N,) of these; left out, the likelihood
        alone decides.

    Returns
    -------
    Ranked

    Examples
    --------
    >>> rank_models([90.0, 40.0, 39.0], [frozenset(), frozenset("a"), frozenset("ab")], 40).winner
    1
    >>> rank_models([90.0, 40.0, 42.0], [frozenset(), frozenset("a"), frozenset("b")], 40).rivals
    (2,)
    """
    scores = np.asarray(deviances, float) + np.log(images) * np.array([len(one) for one in contents])
    near = np.flatnonzero(scores <= scores.min() + MARGIN).tolist()
    winner = int(min(near, key=lambda m: (len(contents[m]), scores[m])))

    def gain(of: int, over: int) -> Gain:
        return gain_of(held[over], held[of], np.asarray(blocks, np.intp))

    while held:
        parts = [m for m, one in enumerate(contents) if one and one < contents[winner]]
        gains = {m: gain(m, winner).gain.estimate for m in parts}
        if not gains or not max(gains.values()) >= 0:
            break
        winner = max(gains, key=lambda m: gains[m])
    effects = [frozenset((alike or {}).get(name, name) for name in one) for one in contents]
    rivals = tuple(
        m
        for m in range(len(contents))
        if m != winner and contents[m] and contents[winner]
        and len(contents[m]) <= len(contents[winner]) and not effects[m] <= effects[winner]
        and (scores[m] <= scores[winner] + MARGIN or (held and not gain(winner, m).counts))
    )  # fmt: skip
    return Ranked(scores, winner, rivals)


def told_parameters(x: Array, sd: Array, freedom: Array, images: int) -> Mask:
    """Which of P parameters are told from zero at the odds that a model needs to win.

    Parameters
    ----------
    x, sd, freedom
        (P,) estimates, their standard deviations and the degrees of freedom of these: a likelihood takes the
        noise for known.
    images
        How many images they were estimated from.

    Returns
    -------
    (P,) bool
    """
    chance = chi2_beyond(MARGIN + np.log(images), 1)
    return np.asarray(2 * stdtr(freedom, -np.abs(x / sd)) <= chance)


def chance_of(wald: float, parameters: int, freedom: float, tried: int) -> float:
    """Probability that any of what was tried is so far from zero where there is no constant error.

    Parameters
    ----------
    wald
        Wald's statistic of the estimate.
    parameters
        How many it has.
    freedom
        Degrees of freedom of the noise.
    tried
        Models that were tried.

    Returns
    -------
    float
        By the F distribution and Bonferroni's bound.
    """
    if not parameters:
        return 1.0
    return min(1.0, tried * float(fdtrc(parameters, freedom, wald / parameters)))
