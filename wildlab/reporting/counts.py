"""How many of how many, by kind of number: what front page and ledger say in figures."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Sequence
from typing import NamedTuple

from wildlab.evaluation.order_statistics import LEVEL, false_outside
from wildlab.evaluation.replication import SIZES, Closeness, Compatibility
from wildlab.reporting.published import CALCULATED, MEAN_OF_RUNS, ONE_FLIGHT, quantity_kind
from wildlab.reporting.status import FIRST_LOOK, MISSING, Number, StudyStatus
from wildlab.reporting.text import NOTHING, escape

#: What the headline counts: predicted for a flight that nothing of ours was fitted to; then the others.
PREDICTED = "sizes, NEES and NIS, predicted"
SIGNED, PROBABILITIES, CALCULATIONS, FITTED = "signed means", "probabilities", "calculations", "fitted"
GROUPS = (PREDICTED, SIGNED, PROBABILITIES, CALCULATIONS, FITTED)
#: The answers in the order in which they are counted; what is not judged has neither.
CLOSE = (Closeness.CLOSE, Closeness.NOT_CLOSE, Closeness.CANNOT_TELL)
COMPATIBLE = (Compatibility.WITHIN, Compatibility.OUTSIDE, Compatibility.NO_POWER, Compatibility.TOO_FEW)


class Tally(NamedTuple):
    """The answers on some numbers.

    Attributes
    ----------
    all
        How many numbers there are.
    close, compatible
        By answer; only of what was judged.
    chance
        How many "outside" chance alone is expected to give, if every twin were true.
    unjudged, waiting
        Numbers with no answer: for good, or as long as their study has not been run in full.
    """

    all: int
    close: Counter[str]
    compatible: Counter[str]
    chance: float
    unjudged: int
    waiting: int

    @property
    def within(self) -> str:
        """``"5 of 6"`` of those that are asked whether they are within; ``"-"`` where none is."""
        asked = sum(self.compatible.values())
        return f"{self.compatible[Compatibility.WITHIN]} of {asked}" if asked else "-"

    @property
    def words(self) -> str:
        """``"5 close, 1 not close; 6 within, 1 outside (0.7 by chance)"``, without what there is none of."""
        parts = [
            ", ".join(f"{self.close[one]} {one}" for one in CLOSE if self.close[one]),
            ", ".join(
                f"{self.compatible[one]} {one}"
                + (f" ({self.chance:.1f} by chance)" if one is Compatibility.OUTSIDE and self.chance else "")
                for one in COMPATIBLE
                if self.compatible[one]
            ),
            f"{self.unjudged} not judged" if self.unjudged else "",
            f"{self.waiting} {MISSING}" if self.waiting else "",
        ]
        return "; ".join(part for part in parts if part)


def tally(numbers: Iterable[Number]) -> Tally:
    """The answers on some numbers, counted."""
    close: Counter[str] = Counter()
    compatible: Counter[str] = Counter()
    every, unjudged, waiting, chance = 0, 0, 0, 0.0
    for one in numbers:
        every += 1
        near, inside = one.answers
        if one.compared is None or one.waiting:
            waiting += 1
        elif near == inside:  # not judged, both
            unjudged += 1
        else:
            close[near] += near in CLOSE
            compatible[inside] += inside in COMPATIBLE
            if inside in COMPATIBLE and inside != Compatibility.TOO_FEW:
                chance += 1 - LEVEL if one.kind == MEAN_OF_RUNS else false_outside(one.over or 0)
    return Tally(every, close, compatible, chance, unjudged, waiting)


def group_of(number: Number) -> str:
    """The group, of `GROUPS`, in which a number is counted."""
    if number.fitted:
        return FITTED
    if number.kind == CALCULATED:
        return CALCULATIONS
    kind = quantity_kind(number.name)
    if number.kind != ONE_FLIGHT or kind == "rate":
        return PROBABILITIES
    return PREDICTED if kind in SIZES else SIGNED


class Counts(NamedTuple):
    """All published numbers, each counted once, by group; only studies that are done give answers.

    Attributes
    ----------
    groups
        By `GROUPS`; groups without a number are left out.
    flights
        How many published flights the answers on `PREDICTED` are about.
    others
        Why the rest has no answer, and how many for each reason.
    """

    groups: dict[str, Tally]
    flights: int
    others: dict[str, int]

    @property
    def all(self) -> int:
        """How many published numbers there are."""
        return sum(one.all for one in self.groups.values())

    @property
    def of(self) -> int:
        """How many predicted numbers were judged: the denominator of the headline."""
        found = self.groups.get(PREDICTED)
        return found.all - found.unjudged - found.waiting if found else 0


def counted(studies: Sequence[StudyStatus]) -> Counts:
    """Count them."""
    by_group: dict[str, list[Number]] = {group: [] for group in GROUPS}
    others: Counter[str] = Counter()
    flights = set()
    for study in studies:
        for one in study.counted:
            group = group_of(one)
            by_group[group].append(one)
            judged = one.compared is not None and not one.waiting and one.answers[0] != one.answers[1]
            if judged and group == PREDICTED:
                flights.add(study.study.twin or study.study.name)
            elif not judged:
                state = _WAITING.get(study.state, study.state)
                done = "not given by its study yet" if one.waiting else "not judged"
                others[done if study.state == "done" else state] += 1
    groups = {group: tally(numbers) for group, numbers in by_group.items() if numbers}
    return Counts(groups, len(flights), dict(others.most_common()))


_WAITING = {
    FIRST_LOOK: "seen in a first look only, from fewer flights than the study's own",
    "not run": "of studies not run yet",
    "failed": "of studies that failed",
    "broken off": "of studies that were broken off",
    "damaged": "of studies whose report is not as it was written",
}


def groups_table(counts: Counts) -> str:
    """The answers by group, as HTML; "" where none was given."""
    rows = [(group, one) for group, one in counts.groups.items() if one.close or one.compatible]
    if not rows:
        return ""
    heads = "".join(f'<th scope="col">{escape(one)}</th>' for one in ("all", *CLOSE, *COMPATIBLE))
    heads += '<th scope="col">outside by chance</th><th scope="col">no answer</th>'
    body = "".join(
        f'<tr><th scope="row" class="text">{escape(group)}</th><td>{one.all}</td>'
        + "".join(f"<td>{one.close[answer] or NOTHING}</td>" for answer in CLOSE)
        + "".join(f"<td>{one.compatible[answer] or NOTHING}</td>" for answer in COMPATIBLE)
        + f"<td>{f'{one.chance:.1f}' if one.chance else NOTHING}</td>"
        + f"<td>{one.unjudged + one.waiting or NOTHING}</td></tr>"
        for group, one in rows
    )
    return (
        '<div class="scroll" role="region" tabindex="0" aria-label="Published numbers by kind"><table>'
        f'<thead><tr><th scope="col" class="text">published numbers</th>{heads}</tr></thead>'
        f"<tbody>{body}</tbody></table></div>"
    )
