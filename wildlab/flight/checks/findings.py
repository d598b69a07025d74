"""What a finding is, usual mistakes, the one rule by which they are named, and what follows from one.

A finding is a code with facts; the words lie in ``data/messages/checks.toml``, once.
"""

from __future__ import annotations

import dataclasses
import re
import tomllib
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache, partial
from itertools import permutations, product
from string import Formatter
from typing import Any, Generic, Literal, TypeVar

import numpy as np
import pandas as pd

from wildlab.errors import WildlabError
from wildlab.flight.manifest import replace_in_manifest
from wildlab.flight.schema import POSITION, QUATERNION, UNITS
from wildlab.flight.store import Flight
from wildlab.geometry.frames import (
    R_NED_ENU,
    Array,
    Indices,
    Mask,
    Origin,
    euler_to_matrix,
    geodetic_to_ned,
    matrix_to_euler,
    matrix_to_quaternion,
    ned_to_geodetic,
    quaternion_to_matrix,
)
from wildlab.names import listed
from wildlab.paths import DATA

Level = Literal["problem", "warning", "note"]

#: Logs print quaternions with few digits: four leave an error of 2e-4 in the norm.
NORM_TOLERANCE = 1e-3

POSE = ["time_s", *POSITION, *QUATERNION]


@dataclass(frozen=True)
class Finding:
    """Something to know about a flight.

    Attributes
    ----------
    level
        ``problem``: what it concerns cannot be used. ``warning``: it can, but look. ``note``: good to know.
    table, field
        ``nav/<source>``, the name of a table, or ``flight.toml``; and what of it.
    code
        Of its text in ``data/messages/checks.toml``.
    facts
        Numbers, names and choices that the text states.
    causes
        The usual mistakes that explain it.
    corrections
        Undo them in a flight, or give None where they cannot (`wildlab.flight.checks.findings`).
    """

    level: Level
    table: str
    field: str
    code: str
    facts: Mapping[str, Any] = dataclasses.field(default_factory=dict, hash=False)
    causes: tuple[str, ...] = ()
    corrections: tuple[Callable[[Flight], Flight | None], ...] = dataclasses.field(
        default=(), compare=False, repr=False
    )

    @property
    def clause(self) -> str:
        """What is so, without place and full stop."""
        return phrase(messages("checks")[self.code]["said"], self.facts)

    @property
    def remedy(self) -> str:
        """What to do, likewise."""
        return phrase(messages("checks")[self.code]["fix"], self.facts)

    @property
    def sentence(self) -> str:
        """What is so, with table and field."""
        return f"{', '.join(filter(None, (self.table, self.field)))}: {self.clause}."

    @property
    def fix(self) -> str:
        """What to do."""
        return f"{self.remedy[:1].upper()}{self.remedy[1:]}."


@cache
def messages(name: str) -> dict[str, Any]:
    """The texts of one file of ``data/messages``."""
    return tomllib.loads((DATA / "messages" / f"{name}.toml").read_text(encoding="utf-8"))


#: ``{name:one|other}`` and ``{name>0:one|other}``; each of both may hold fields.
_CHOICE = re.compile(r"\{(\w+)(>0)?:((?:[^{}|]|\{[^{}]*\})*)\|((?:[^{}|]|\{[^{}]*\})*)\}")


class _Phrase(Formatter):
    def format_field(self, value: Any, format_spec: str) -> str:
        if format_spec in ("and", "or"):
            return listed(value, format_spec)
        if format_spec.startswith("abs"):
            return self.format_field(abs(value), format_spec[3:])
        return number(value) if format_spec == "digits" else str(super().format_field(value, format_spec))


def phrase(text: str, facts: Mapping[str, Any]) -> str:
    """A text with its facts.

    Beside what `str.format` knows, ``{n:frame|frames}`` chooses the first where a number is 1 or a fact is
    so, ``{by>0:late|early}`` where positive; ``{names:and}`` joins a list, ``{by:abs.2f}`` is a size, and
    ``{size:digits}`` has the digits that are worth reading.

    Examples
    --------
    >>> phrase("{n} {n:row|rows} of {names:and}, {off:digits} m", {"n": 2, "names": ["a", "b"], "off": 0.01})
    '2 rows of a and b, 0.01 m'
    """

    def choose(found: re.Match[str]) -> str:
        fact = facts[found[1]]
        return found[3] if (fact > 0 if found[2] else fact == 1) else found[4]

    return _Phrase().vformat(_CHOICE.sub(choose, text), (), facts)


def say(use: str, **facts: Any) -> str:
    """The clause of what a flight can be used for."""
    return phrase(messages("checks")["use"][use], facts)


def number(value: float) -> str:
    """A number with the digits that are worth reading."""
    if value != 0 and abs(value) < 0.095:
        return f"{value:.2g}"
    return f"{value:.0f}" if abs(value) >= 20 else f"{value:.1f}"


def bad_rows(
    bad: Mask,
    level: Level | None,
    table: str,
    field: str,
    code: str,
    facts: Mapping[str, Any] | None = None,
    causes: tuple[str, ...] = (),
) -> Iterator[Finding]:
    """A finding where any row (N,) is bad: how many ``n`` of how many ``of``, and the first, ``row``.

    Without a level it is a problem where all are bad, otherwise a warning. Facts that are columns (N,) or
    (N, K) are given for the first bad row.
    """
    if bad.any():
        row = int(np.argmax(bad))
        counted: dict[str, Any] = {"n": int(bad.sum()), "of": len(bad), "row": row}
        for key, value in (facts or {}).items():
            counted[key] = value[row] if isinstance(value, np.ndarray) else value
        yield Finding(level or ("problem" if bad.all() else "warning"), table, field, code, counted, causes)


def thin(n: int, most: int) -> Indices:
    """At most so many of n rows, evenly."""
    return np.unique(np.linspace(0, n - 1, most).astype(np.intp))


def finite_rows(table: pd.DataFrame, names: Sequence[str]) -> Array:
    """The rows of some columns that hold numbers alone, (N, K)."""
    values = table[[*names]].to_numpy(float)
    return np.asarray(values[np.isfinite(values).all(axis=1)])


def part_of(table: str) -> str:
    """The part of the recipe that a table comes from: ``"poses.x"`` for ``"nav/x"``."""
    return f"poses.{table.removeprefix('nav/')}" if table.startswith("nav/") else table


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
    undone, left
        What `explain` looked at without the mistake, and the misfit that is left.
    """

    cause: str
    said: str
    fix: str
    undo: Callable[[T], T | None]
    fitted: bool = False
    corrections: tuple[Correction, ...] = ()
    about: str = ""
    undone: Any = None
    left: float = 0.0

    def within(self, part: str, undo: Callable[[S], S | None], *corrections: Correction) -> Mistake[S]:
        """The same mistake in a part of something larger, which ``undo`` takes; "" names no part."""
        of = f"{part}: " if part else ""
        return Mistake(f"{of}{self.cause}", f"{of}{self.said}", self.fix, undo, corrections=corrections)


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
) -> list[Mistake[T]]:
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
    list of Mistake
        The best first, with those as good as it; empty where none is far better.
    """
    before = misfit(given)
    if not (before[:, 0] > EXPECTED).any():
        return []  # what is like noise needs no explanation, see `far_better`
    found: list[Mistake[T]] = []
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
            found.append(replace(mistake, undone=undone, left=left))
    best = min((one.left for one in found), default=0.0)
    alike = [one for one in found if one.left <= ALIKE * best]
    return sorted(alike, key=lambda one: (one.fitted, one.left))[:MOST_NAMED]


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


def compare(
    code: str,
    misfit: Callable[[T], Misfit],
    given: T,
    mistakes: Iterable[Mistake[T]],
    state: Callable[[T], dict[str, float]],
    table: str,
    field: str,
    limit: float = np.inf,
    **facts: Any,
) -> Iterator[Finding]:
    """What is found where two things that say the same disagree: a problem that mistakes explain, or a
    warning beyond a limit.

    ``state`` gives facts of what is compared; their names end in ``_then`` where the mistake is undone.
    """
    named = explain(misfit, given, mistakes)
    facts |= state(given) | {"times": misfit(given)[1, 0]}
    if named:
        facts |= {f"{name}_then": value for name, value in state(named[0].undone).items()}
        yield blame("problem", table, field, f"{code}-explained", named, facts)
    elif facts["times"] > limit:
        yield Finding("warning", table, field, f"{code}-unexplained", facts)


def alternate(n: int, length: int) -> Mask:
    """Every other stretch of so many of n rows: errors that drift are then the same in both halves."""
    return np.asarray(np.arange(n) // length % 2 == 0)


def crosswise(n: int, length: int, left: Callable[[Mask, Mask], tuple[float, ...]]) -> Misfit:
    """Misfits (2, 3) of n rows by a fit to all, and of every other stretch of so many by one to the rest.

    ``left`` takes the rows that are fitted and those that are judged.
    """
    half = alternate(n, length)
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


def raise_by(table: str, metres: float) -> Correction:
    """Correct the heights of one table by a constant."""
    return change_columns(table, POSITION, lambda p: p - np.array([0.0, 0.0, metres]))


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


Row = Mapping[str, Any]

FLIP = np.diag([1.0, -1.0, -1.0])
#: What is no scale and no shift of angles.
ATTITUDES: dict[str, Callable[[Array], Array]] = {
    "transposed": lambda R: np.swapaxes(R, -1, -2),
    "flu-enu": lambda R: R_NED_ENU @ R @ FLIP,
    "xyzw": lambda R: quaternion_to_matrix(matrix_to_quaternion(R)[..., [3, 0, 1, 2]]),
    "wxyz": lambda R: quaternion_to_matrix(matrix_to_quaternion(R)[..., [1, 2, 3, 0]]),
}


def rows_of(group: str) -> Iterator[Row]:
    """The rows of a group, each with the texts of its block."""
    for block in messages("mistakes")[group]:
        if "unit" in block:
            units = UNITS[block["unit"]]
            inside = next(unit for unit, factor in units.items() if factor == 1)
            for axes in block.get("rows", [{"axes": 1}]):
                for unit, factor in units.items():
                    for is_in, read, scale in ((unit, inside, factor), (inside, unit, 1 / factor)):
                        if unit != inside:
                            scales = np.where(axes["axes"], scale, 1.0)
                            yield {**block, **axes, "unit": is_in, "read": read, "scale": scales}
        else:
            for row in block.get("rows", [{}]):
                yield {**block, **row}


def change_by(row: Row, unit: Any = 1.0) -> Change:
    """The change of a row, with shifts in a unit; None where a value would be beyond what the row allows."""
    scale, shift = np.array(row.get("scale", 1.0)), np.array(row.get("shift", 0.0)) * unit
    if "of_unit" in row:
        scale = scale * unit
    order = row.get("order")

    def change(read: Array) -> Array | None:
        value = np.asarray((read if order is None else read[..., order]) * scale + shift)
        for name, limited in (("limit_read", read), ("limit", value)):
            if name in row and (np.abs(limited) > row[name]).any():
                return None
        return value

    return change


def mistake(
    row: Row,
    undo: Callable[[T], T | None],
    *corrections: Correction,
    fitted: bool = False,
    **facts: Any,
) -> Mistake[T]:
    """The mistake of a row, or of a group of one row by its name."""
    cause, said, fix = (phrase(row[name], {**row, **facts}) for name in ("cause", "said", "fix"))
    return Mistake(cause, said, fix, undo, fitted, corrections, row.get("about", ""))


def one_row(group: str) -> Row:
    """The row of a group that has one."""
    return next(rows_of(group))


def attitude_mistakes(part: str) -> Iterator[Mistake[Array]]:
    """Mistakes about the attitudes (N, 3, 3) of one nav source; `part` as ``"poses.logged"``."""
    for row in rows_of("attitude"):
        yield mistake(row, ATTITUDES.get(row.get("way", "")) or _by_angles(row), part=part)


def attitudes_in(source: str, label: str, *fields: str) -> Iterator[Mistake[Any]]:
    """The same in fields of something larger, as corrected in one nav source."""
    for one in attitude_mistakes(f"poses.{source}"):
        yield one.within(label, undo_in(one.undo, *fields), change_attitude(source, one.undo))


def _by_angles(row: Row) -> Change:
    exchanged = "order" in row
    change = change_by(row, np.radians(1.0))

    def undo(R: Array) -> Array | None:
        angles = matrix_to_euler(R)
        changed = change(angles)
        # The other angles of the same attitude are those past the vertical: the lower lean is meant.
        other = change(np.pi + angles * [1, -1, 1]) if exchanged else None
        if changed is not None and other is not None:
            lean = [np.abs(np.angle(np.exp(1j * a[..., :1]))) for a in (changed, other)]
            changed = np.where(lean[0] <= lean[1], changed, other)
        return None if changed is None else euler_to_matrix(*np.moveaxis(changed, -1, 0))

    return undo


def change_geodetic(change: Change, p: Array, origin: Origin, to: Origin | None = None) -> Array | None:
    """Positions (N, 3) whose latitude, longitude and height are changed, about another origin or the same."""
    changed = change(ned_to_geodetic(p, origin))
    if changed is None:
        return None
    lat, lon, height = np.moveaxis(changed, -1, 0)
    with np.errstate(invalid="ignore"):
        off_earth = (np.abs(lat) > np.pi / 2).any() or (np.abs(lon) > 2 * np.pi).any()
    return None if off_earth else geodetic_to_ned(lat, lon, height, to or origin)


def place_mistakes(part: str, origin: Origin, local: bool = True) -> Iterator[Mistake[Array]]:
    """Mistakes about one table of positions, as they are undone.

    Parameters
    ----------
    part
        Of the recipe, as ``"poses.logged"``.
    origin
        Of frame n.
    local
        Whether coordinates about the origin count too, beside latitude and longitude.
    """
    for group in ("geodetic", "local", "height", "down"):
        for row in rows_of(group):
            if local or group != "local":
                change = change_by(row)
                plain = group in ("local", "down")
                undo = change if plain else partial(change_geodetic, change, origin=origin)
                yield mistake(row, undo, part=part)


def places_in(table: str, origin: Origin, label: str, *fields: str) -> Iterator[Mistake[Any]]:
    """The same in fields of something larger, as corrected in one table."""
    for one in place_mistakes(part_of(table), origin):
        yield one.within(label, undo_in(one.undo, *fields), change_columns(table, POSITION, one.undo))


def other_axes() -> Iterator[Array]:
    """The 47 ways (3, 3) to exchange axes and turn them round, but for leaving them as they are."""
    for order in permutations(range(3)):
        for signs in product((1, -1), repeat=3):
            M = np.eye(3)[list(order)] * np.array(signs)[:, None]
            if not (np.eye(3) == M).all():
                yield M


def axes_words(M: Array) -> str:
    """``"x is minus y, y is x"`` for a matrix that takes what is read to what is right."""
    said = []
    for i, row in enumerate(np.asarray(M)):
        j = int(np.argmax(np.abs(row)))
        if i != j or row[j] < 0:
            said.append(f"{'xyz'[i]} is {'minus ' if row[j] < 0 else ''}{'xyz'[j]}")
    return ", ".join(said)


def rotations_of_axes() -> list[Array]:
    """The 24 rotations that take axes to axes, (3, 3) each, the identity first."""
    return [np.eye(3), *(M for M in other_axes() if np.linalg.det(M) > 0)]
