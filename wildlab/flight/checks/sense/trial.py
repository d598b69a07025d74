"""When a mistake is named: the one rule by which all pairs are judged.

A pair is two things that say the same, as the velocity of a receiver and the change of its positions. How
far they are apart is a number, the misfit, on the whole flight and on each half of it. Where they are apart,
usual mistakes are undone one after the other, and the one that brings them together is named.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Generic, NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray

from wildlab.flight.store import Flight

Array = NDArray[np.float64]
T = TypeVar("T")
S = TypeVar("S")

#: A mistake is named where undoing it divides a misfit by this, on the whole and on either half. Of twenty
#: values, the median of the size moves by a fifth from one half to the other: chance does not halve it twice.
FAR_BETTER = 2.0
#: Where only the whole can be looked at, or nothing is allowed for (see `Misfit`), it has to be clearer.
FAR_BETTER_ALONE = 4.0
#: Where both ways to count fall, so much on their geometric mean: as where one falls threefold and one stays.
BOTH = 3**0.5
#: What is expected of noise is no misfit: less of it, as by a smaller unit, proves nothing.
EXPECTED = 1.0
#: Where nothing is allowed for, misfits below this (times what is expected) are no wrong meaning.
USUAL = 3.0
#: What is left has to be like noise, at most so many times what is expected: else something else is wrong as
#: well, or instead. A fall by this factor counts all the same: what is expected may be stated too small.
LIKE_NOISE, FALL = 3.0, 8.0
#: Two that come within this factor of each other explain it equally well, and are both named.
ALIKE = 1.6
#: More than so many names are no help.
MOST_NAMED = 3
#: Misfits are in units of what noise is expected. What lies below this is not told apart.
NOTHING = 0.02


@dataclass(frozen=True)
class Mistake(Generic[T]):
    """A usual mistake.

    Attributes
    ----------
    cause
        What it is, in a few words.
    said
        A clause: what is so, and what the recipe says.
    write
        What to write, and where.
    undo
        Gives the same as it would be without the mistake; None where it cannot be that mistake.
    fitted
        Whether a number was chosen to make it fit.
    corrections
        What undoes it in a flight, the likeliest first; see `Finding`.
    about
        ``height`` where positions are wrong in that alone.
    """

    cause: str
    said: str
    write: str
    undo: Callable[[T], T | None]
    fitted: bool = False
    corrections: tuple[Callable[[Flight], Flight | None], ...] = ()
    about: str = ""

    def within(
        self, part: str, undo: Callable[[S], S | None], *corrections: Callable[[Flight], Flight | None]
    ) -> Mistake[S]:
        """The same mistake in a part of something larger, which ``undo`` takes; "" names no part."""
        of = f"{part}: " if part else ""
        return Mistake(f"{of}{self.cause}", f"{of}{self.said}", self.write, undo, corrections=corrections)


#: Misfits of the whole and of each half, (2, 3), in units of what noise is expected: with small constant
#: errors allowed for, as every flight has them, and (second row) without. NaN where a half is too small.
Misfit = Array


def corrections_of(named: Iterable[Named[T]]) -> tuple[Callable[[Flight], Flight | None], ...]:
    """All corrections of mistakes that are named together."""
    return tuple(correct for one in named for correct in one.mistake.corrections)


class Named(NamedTuple, Generic[T]):
    """A mistake that explains a misfit, and the misfit before and after it is undone."""

    mistake: Mistake[T]
    undone: T
    before: float
    after: float


def far_better(before: Misfit, after: Misfit, *, fitted: bool = False) -> bool:
    """Whether misfits fell by far, in one of the two ways to count them, and grew in neither.

    Where no number was fitted, a fall that is clear in both taken together counts too.

    Examples
    --------
    >>> before, after = np.array([[9.0, 8.0, 9.5]] * 2), np.array([[1.0, 1.2, 0.9]] * 2)
    >>> far_better(before, after)
    True
    >>> after[:, 1] = 7.0
    >>> far_better(before, after)
    False
    """
    with np.errstate(invalid="ignore"):
        ratio = np.maximum(before, NOTHING) / np.maximum(after, NOTHING)
    if not np.isfinite(after[:, 0]).all() or not (ratio[:, 0] > 1 / ALIKE).all():
        return False
    if after[0, 0] > LIKE_NOISE and ratio[0, 0] < FALL:
        return False
    alone = np.isnan(ratio[:, 1:]).any(axis=1)
    needed = np.where(alone, FAR_BETTER_ALONE, [FAR_BETTER, FAR_BETTER_ALONE])
    clear = np.where(alone, ratio[:, 0], ratio.min(axis=1)) >= needed
    clear &= before[:, 0] > [EXPECTED, USUAL]
    both = np.sqrt(ratio.prod(axis=0))
    in_both = not fitted and not alone.any() and before[:, 0].max() > EXPECTED and (both >= BOTH).all()
    return bool(clear.any() or in_both)


def explain(
    misfit: Callable[[T], Misfit],
    given: T,
    mistakes: Iterable[Mistake[T]],
    glance: Callable[[T], Array] | None = None,
) -> list[Named[T]]:
    """The mistakes that explain best why a pair disagrees.

    Parameters
    ----------
    misfit
        See `Misfit`.
    given
        What disagrees.
    mistakes
        Those to try. Of those that explain it alike, those without a fitted number come first.
    glance
        Gives the first column of the misfit alone, (2,), where that is quicker.

    Returns
    -------
    list of Named
        The best first, with those as good as it; empty where none is far better.
    """
    before = misfit(given)
    if not (before[:, 0] > EXPECTED).any():
        return []  # what is like noise needs no explanation, see `far_better`
    found: list[Named[T]] = []
    for mistake in mistakes:
        undone = mistake.undo(given)
        if undone is None:
            continue
        if glance is not None:
            with np.errstate(invalid="ignore"):
                ratio = before[:, 0] / np.maximum(glance(undone), NOTHING)
            if not (ratio >= FAR_BETTER).any():
                continue
        after = misfit(undone)
        if far_better(before, after, fitted=mistake.fitted):
            left = float(np.sqrt(np.prod(np.maximum(after[:, 0], NOTHING))))
            found.append(Named(mistake, undone, float(before[0, 0]), left))
    if not found:
        return []
    best = min(one.after for one in found)
    alike = sorted(
        (one for one in found if one.after <= ALIKE * best), key=lambda one: (one.mistake.fitted, one.after)
    )
    return alike[:MOST_NAMED]


def halves_of(groups: NDArray[np.intp]) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    """Rows of every other group (N,), and the rest: errors that drift are then the same in both."""
    first = np.searchsorted(np.unique(groups), groups) % 2 == 0
    return first, ~first


def robust_scale(size: Array) -> float:
    """Standard deviation per axis of errors in two dimensions, from the median of their sizes (N,)."""
    return float(np.median(size)) / 1.1774 if len(size) else float("nan")
