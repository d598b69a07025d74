"""When a mistake is named: the one rule by which all pairs are judged, and what follows from a mistake.

A pair is two things that say the same, as the velocity of a receiver and the change of its positions. How
far they are apart is a number, the misfit, on the whole flight and on each half of it. Where they are apart,
usual mistakes (`wildlab.flight.checks.mistakes`) are undone one after the other, and the one that brings them
together is named. What a named mistake explains elsewhere in the flight is not reported beside it.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Generic, NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray

from wildlab.errors import WildlabError
from wildlab.flight.checks.findings import POSITION, QUATERNION, Finding, Level
from wildlab.flight.manifest import replace_in_manifest
from wildlab.flight.store import Flight
from wildlab.geometry.frames import Array, matrix_to_quaternion, quaternion_to_matrix

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
#: Causes that are in one table alone, or in the stamps: nothing about another table explains them.
LEAP, APART = "leap of the position", "little time in common"

#: From values to those without a mistake; None where they cannot be that mistake.
Change = Callable[[Array], Array | None]
Correction = Callable[[Flight], Flight | None]
#: Misfits of the whole and of each half, (2, 3), in units of what noise is expected: with small constant
#: errors allowed for, as every flight has them, and (second row) without. NaN where a half is too small.
Misfit = Array


@dataclass(frozen=True)
class Mistake(Generic[T]):
    """A usual mistake.

    Attributes
    ----------
    cause
        What it is, in a few words.
    said
        A clause: what is so, and what the recipe says.
    fix
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
    fix: str
    undo: Callable[[T], T | None]
    fitted: bool = False
    corrections: tuple[Correction, ...] = ()
    about: str = ""

    def within(self, part: str, undo: Callable[[S], S | None], *corrections: Correction) -> Mistake[S]:
        """The same mistake in a part of something larger, which ``undo`` takes; "" names no part."""
        of = f"{part}: " if part else ""
        return Mistake(f"{of}{self.cause}", f"{of}{self.said}", self.fix, undo, corrections=corrections)


class Named(NamedTuple, Generic[T]):
    """A mistake that explains a misfit, and the misfit before and after it is undone."""

    mistake: Mistake[T]
    undone: T
    before: float
    after: float


def undo_in(change: Change, *fields: str) -> Callable[[T], T | None]:
    """A change of some fields of a dataclass; None where it is of one of them."""

    def undo(given: Any) -> Any:
        done = {name: change(getattr(given, name)) for name in fields}
        return None if any(value is None for value in done.values()) else replace(given, **done)

    return undo


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
    best = min((one.after for one in found), default=0.0)
    alike = [one for one in found if one.after <= ALIKE * best]
    return sorted(alike, key=lambda one: (one.mistake.fitted, one.after))[:MOST_NAMED]


def blame(
    level: Level,
    table: str,
    field: str,
    code: str,
    mistakes: Sequence[Mistake[Any]],
    facts: Mapping[str, Any],
    corrections: Sequence[Correction] | None = None,
) -> Finding:
    """The finding that names mistakes: ``named`` and ``ways`` of its text say what and the remedy."""
    if corrections is None:
        corrections = [correct for one in mistakes for correct in one.corrections]
    stated = {
        "named": [one.said for one in mistakes],
        "ways": f"{'; or '.join(one.fix for one in mistakes)}, and import again",
        **facts,
    }
    return Finding(
        level, table, field, code, stated, tuple(one.cause for one in mistakes), tuple(corrections)
    )


def alternate(n: int, length: int) -> NDArray[np.bool_]:
    """Every other stretch of so many of n rows: errors that drift are then the same in both halves."""
    return np.asarray(np.arange(n) // length % 2 == 0)


def crosswise(
    half: NDArray[np.bool_], left: Callable[[NDArray[np.bool_], NDArray[np.bool_]], tuple[float, ...]]
) -> Misfit:
    """Misfits (2, 3) of the whole by a fit to the whole, and of either half (N,) by one to the other.

    ``left`` takes the rows that are fitted and those that are judged.
    """
    everything = half | True
    parts = ((everything, everything), (half, ~half), (~half, half))
    return np.array([left(fit, judged) for fit, judged in parts]).T


# -- corrections of a flight


def change_columns(table: str, names: Sequence[str], change: Change) -> Correction:
    """Correct columns (N, K) of one table, ``"nav/x"`` or another; None where they cannot be that mistake."""

    def correct(flight: Flight) -> Flight | None:
        source = table.removeprefix("nav/")
        part, tables = ("nav", flight.nav) if source != table else ("tables", flight.tables)
        data = tables[source]
        values = change(data[list(names)].to_numpy(float))
        if values is None:
            return None
        changed = data.assign(**dict(zip(names, np.asarray(values).T, strict=True)))
        return replace(flight, **{part: {**tables, source: changed}})  # type: ignore[arg-type]

    return correct


def change_attitude(source: str, undo: Change) -> Correction:
    """Correct the attitudes ``R_nb`` of one nav source."""

    def change(q: Array) -> Array | None:
        R = undo(quaternion_to_matrix(q))
        return None if R is None else matrix_to_quaternion(R)

    return change_columns(f"nav/{source}", QUATERNION, change)


def change_place(table: str, undo: Change) -> Correction:
    """Correct the positions of one table."""
    return change_columns(table, POSITION, undo)


def raise_by(table: str, metres: float) -> Correction:
    """Correct the heights of one table by a constant."""
    return change_place(table, lambda p: p - np.array([0.0, 0.0, metres]))


def shift_poses(source: str, by: float) -> Correction:
    """Shift the stamps of one nav source by so many seconds."""
    return change_columns(f"nav/{source}", ["time_s"], lambda t: t + by)


def state(parts: dict[str, Any]) -> Correction:
    """State parts of the manifest."""
    return lambda flight: replace(flight, manifest=replace_in_manifest(flight.manifest, parts))


def shift_clock(name: str, by: float) -> Correction:
    """Add seconds to one of the offsets of ``[clocks]``."""
    return lambda flight: state({"clocks": {name: getattr(flight.manifest.clocks, name) + by}})(flight)


def report_alone(
    flight: Flight, found: Sequence[Finding], again: Callable[[Flight], list[Finding]]
) -> list[Finding]:
    """The findings less those that vanish where another one's mistake is corrected.

    Parameters
    ----------
    flight
        That they are of.
    found
        All findings.
    again
        Gives all findings of a corrected flight.

    Returns
    -------
    list of Finding
        The mistake whose correction leaves the fewest findings and brings no new ones; then, in the same way,
        what is still found with it. Notes stay as they were.
    """
    notes = [one for one in found if one.level == "note"]
    others = [one for one in found if one.level != "note"]
    # Of what nothing explains about a whole table, the first: another pair says the same of it.
    first = {one.table: one for one in reversed(others) if not one.field and not one.causes}
    once = [one for one in others if one.field or one.causes or one is first[one.table]]
    return [*_explained(flight, once, again), *notes]


def _explained(
    flight: Flight, found: list[Finding], again: Callable[[Flight], list[Finding]]
) -> list[Finding]:
    if len(found) < 2:
        return found

    def about(some: Sequence[Finding]) -> set[tuple[str, str]]:
        return {(one.table, one.field) for one in some}

    def unexplained(one: Finding) -> bool:
        return LEAP in one.causes or APART in one.causes

    kept = [one for one in found if unexplained(one)]
    best: tuple[Finding, Flight, list[Finding]] | None = None
    # Of corrections that explain as much, the one whose finding names fewer mistakes says more.
    for one in sorted(found, key=lambda one: len(one.causes)):
        for correct in one.corrections:
            try:
                corrected = correct(flight)
                left = [] if corrected is None else again(corrected)
            except (WildlabError, ValueError):
                continue
            left = kept + [x for x in left if x.level != "note" and not unexplained(x)]
            if corrected is None or about([one]) & about(left) or about(left) - about(found):
                continue
            if best is None or len(left) < len(best[2]):
                best = one, corrected, left
            if not left:
                break
        if best is not None and not best[2]:
            break
    if best is None or len(best[2]) >= len(found) - 1:
        return found
    return [best[0], *_explained(best[1], best[2], again)]
