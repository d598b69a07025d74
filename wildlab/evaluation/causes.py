"""Which constant error is behind those of a flight? Nested models, compared on images they have not seen.

Blocks of images in time order are put into folds, many times over; each model is fitted to all folds but one
and predicts that one. Its held-out error at a point is the mean over the rounds. Models share the points,
so they are compared point by point: the gain of one over another is the mean difference of their held-out
errors, and its standard error comes from the blocks. Rounds are no independent repetitions (they share most
of what they are fitted to), so their spread is not used for that. The simplest model that is no more than
one standard error of that difference behind the best one wins (Breiman et al. 1984).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from wildlab.evaluation.blocks import PROBABILITY, Labels, block_mean, standard_error
from wildlab.evaluation.runs import Interval
from wildlab.geometry.robust import fit_linear

Array = NDArray[np.float64]

#: Folds of one round, and rounds.
FOLDS, ROUNDS = 5, 10


class Linear(NamedTuple):
    """A model about its estimate from all points.

    Attributes
    ----------
    J, r
        (M, 2, P) derivatives and (M, 2) residuals, whitened, of the points it is estimated from.
    values
        (P,) the estimate.
    place
        Takes P parameters and gives the errors (N, 2) m, north-east; NaN where a ray misses the ground.
    used
        (N,) which points these M are; all where left out.
    """

    J: Array
    r: Array
    values: Array
    place: Callable[[Array], Array]
    used: NDArray[np.bool_] | None = None


def draw_folds(blocks: Labels, rng: np.random.Generator, folds: int = FOLDS) -> Labels:
    """Fold (N,) of each point: whole blocks (N,), as evenly as they go."""
    labels, index = np.unique(blocks, return_inverse=True)
    fold = rng.permutation(len(labels)) % min(folds, len(labels))
    return np.asarray(fold[index])


def held_out(model: Linear, rounds: Sequence[Labels]) -> Array:
    """Errors (R, N, 2) of every point, each placed by parameters that its fold had no part in.

    The fits are steps from the estimate of all points with its derivatives, for these hardly move; the points
    are then placed without linearising. Points that no estimate rests on are placed like the others.

    Parameters
    ----------
    model
        The model.
    rounds
        R times the fold (N,) of each point.

    Returns
    -------
    (R, N, 2) m, north-east

    Examples
    --------
    >>> r = np.array([[1.0, 0.0], [1.2, 0.0], [0.8, 0.0]])
    >>> shift = Linear(np.tile(-np.eye(2), (3, 1, 1)), r - 1.0, np.array([1.0, 1.0]), lambda x: r - x)
    >>> held_out(shift, [np.array([0, 1, 2])])[0, 1].round(1).tolist()  # the mean of the others is 0.9
    [0.3, 0.0]
    """
    if not model.J.shape[-1]:
        return np.repeat(model.place(model.values)[None], len(rounds), axis=0)
    out = np.empty((len(rounds), len(rounds[0]), 2))
    used = np.ones(out.shape[1], bool) if model.used is None else model.used
    for i, folds in enumerate(rounds):
        for fold in np.unique(folds):
            unseen = folds == fold
            seen = ~unseen[used]
            step = fit_linear(model.J[seen], model.r[seen]).x
            out[i, unseen] = model.place(model.values + step)[unseen]
    return out


class Gain(NamedTuple):
    """What taking a cause off gained on images it was not estimated from.

    Attributes
    ----------
    without, with_
        Mean error without and with it, m, and of the latter the value of each round.
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

    def widened(self, by: float) -> Gain:
        """The same with an interval that is so many times as long."""
        estimate, low, high = self.gain.estimate, self.gain.low, self.gain.high
        return self._replace(
            gain=Interval(estimate, estimate - by * (estimate - low), estimate + by * (high - estimate))
        )


class Ranked(NamedTuple):
    """Models by their held-out errors.

    Attributes
    ----------
    means
        (M,) mean held-out error, m.
    behind
        (M,) how far each is behind the best, m.
    errors
        (M,) standard error of that.
    best, winner
        Numbers of the best model and of the simplest one within one standard error of it.
    rivals
        Those within one standard error of the best that are neither the winner nor hold all that it holds.
    """

    means: Array
    behind: Array
    errors: Array
    best: int
    winner: int
    rivals: tuple[int, ...]


def gain_of(without: Array, with_: Array, blocks: Labels, probability: float = PROBABILITY) -> Gain:
    """Gain of held-out errors (R, N, 2) over errors (N, 2) without the cause, by blocks (N,).

    Parameters
    ----------
    without
        (N, 2) m.
    with_
        (R, N, 2) m, from `held_out`.
    blocks
        (N,).
    probability
        Of the interval.

    Returns
    -------
    Gain
        Of the points that both have.
    """
    before, after = np.hypot(*without.T), distances(with_)
    both = np.isfinite(before) & np.isfinite(after)
    difference = np.where(both, before - after, np.nan)
    gain = block_mean(difference, blocks, probability)
    return Gain(float(before[both].mean()), float(after[both].mean()), gain)


def distances(errors: Array) -> Array:
    """Mean distance (N,) over the rounds of held-out errors (R, N, 2); NaN where a round lost the point."""
    return np.asarray(np.hypot(errors[..., 0], errors[..., 1]).mean(axis=0))


def rank_models(held: Sequence[Array], contents: Sequence[frozenset[str]], blocks: Labels) -> Ranked:
    """Rank models by held-out distances.

    Parameters
    ----------
    held
        For each of M models (N,) m, from `distances`. A point that a model loses counts as the worst that any
        model makes of it, or the worst that this model makes of any point: losing points must not pay.
    contents
        For each model, its parameters.
    blocks
        (N,).

    Returns
    -------
    Ranked

    Examples
    --------
    >>> near, far = np.array([1.0, 1.1, 0.9]), np.array([2.0, 2.1, 1.9])
    >>> rank_models([far, near, near], [frozenset(), frozenset("a"), frozenset("ab")], np.arange(3)).winner
    1
    """
    table = np.stack(held)
    kept = np.isfinite(table).any(axis=0)
    table, group = table[:, kept], np.asarray(blocks)[kept]
    worst = np.fmax(np.nanmax(table, axis=1, keepdims=True), np.nanmax(table, axis=0))
    table = np.where(np.isfinite(table), table, worst)
    means = table.mean(axis=1)
    best = int(means.argmin())
    behind = means - means[best]
    errors = np.array([standard_error(row - table[best], group) for row in table])
    near = [m for m in range(len(means)) if m == best or behind[m] <= errors[m]]
    winner = min(near, key=lambda m: (len(contents[m]), means[m]))
    rivals = tuple(
        m for m in near if m != winner and contents[winner] and not contents[winner] <= contents[m]
    )
    return Ranked(means, behind, errors, best, winner, rivals)
