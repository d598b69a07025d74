"""Published numbers and claims beside ours: how many of how many, and tables of the ledger and of reports."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from typing import NamedTuple

from markupsafe import Markup

from wildlab.evaluation.intervals import LEVEL, false_outside
from wildlab.evaluation.replication import SIZES, Closeness, Compatibility
from wildlab.evaluation.shares import FAILS, HOLDS, MOSTLY, MOSTLY_NOT, UNDECIDED
from wildlab.messages.catalogue import fill, load_texts, words_of
from wildlab.messages.quantities import NOTHING, number, unit_words
from wildlab.names import listed
from wildlab.reporting.published import (
    CALCULATED,
    MANY,
    MEAN_OF_RUNS,
    ONE_FLIGHT,
    SHARE_OF_IMAGES,
    quantity_kind,
    spread_key,
)
from wildlab.reporting.status import FIRST_LOOK, MISSING, Claim, Number, StudyStatus
from wildlab.reporting.text import dim, mark_up, pill, render, table

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


def count_answers(studies: Sequence[StudyStatus]) -> Counts:
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


def groups_table(counts: Counts) -> Markup:
    """The answers by group, as HTML; "" where none was given."""
    rows = [(group, one) for group, one in counts.groups.items() if one.close or one.compatible]
    if not rows:
        return Markup()
    answers = [*CLOSE, *COMPATIBLE]
    cells = [
        (
            group,
            one.all,
            *((one.close | one.compatible)[answer] or NOTHING for answer in answers),
            f"{one.chance:.1f}" if one.chance else NOTHING,
            one.unjudged + one.waiting or NOTHING,
        )
        for group, one in rows
    ]
    heads = ["published numbers", "all", *answers, "outside by chance", "no answer"]
    return table(heads, cells, "Published numbers by kind")


#: A longer table is folded away behind a line that sums it up.
LONGEST = 12
#: Answers and verdicts, and the colour of each: for, in part, against; what is not here decides nothing.
PILLS = {
    Closeness.CLOSE: "yes",
    Closeness.NOT_CLOSE: "no",
    Compatibility.WITHIN: "yes",
    Compatibility.OUTSIDE: "no",
    HOLDS: "yes",
    MOSTLY: "part",
    UNDECIDED: "part",
    MOSTLY_NOT: "no",
    FAILS: "no",
    FIRST_LOOK: "part",
}
#: The axis of every strip: ratios to the printed number from 1/8 to 8, logarithmic, and its width in pixels.
WIDEST, WIDTH = 8.0, 160.0
_MARGIN = 8.0


def numbers_table(one: StudyStatus) -> Markup:
    """The published numbers of a study beside ours; nothing where there are none."""
    if not one.numbers:
        return Markup()
    heads = ["quantity", "published"]
    if one.ran:
        heads += ["here", "ratio, or difference", _strip_heading(one), "flights below", "close? within 90 %?"]
    rows = [_ledger_row(number, ran=one.ran) for number in one.numbers]
    return table(heads, rows, f"Published numbers of {one.study.name}", text=(0, 6))


def summed_up(one: StudyStatus) -> str:
    """The verdicts of a study's numbers in a line."""
    count = len(one.counted)
    numbers = f"{count} published number{'s' * (count > 1)}"
    if one.state == FIRST_LOOK:
        return f"{numbers} beside a first look"
    if one.state != "done":
        return f"{numbers} waiting for it"
    fitted = [n for n in one.counted if n.fitted]
    parts = [tally(n for n in one.counted if not n.fitted).words]
    parts += [f"{len(fitted)} fitted: {tally(fitted).words}"] if fitted else []
    again = len(one.numbers) - count
    parts += [f"{again} more, not counted again"] if again else []
    return f"{numbers}: {'; '.join(part for part in parts if part)}"


def _strip_heading(one: StudyStatus) -> Markup:
    over = f"{one.seeds} {flights_of(one)}" if one.seeds and one.seeds > 1 else "here"
    fewest = min((n.over for n in one.numbers if n.over is not None), default=MANY)
    band = spread_key(fewest) if any(has_band(n) for n in one.numbers) else ""
    return render("strip-heading", over=over, band=band)


def flights_of(one: StudyStatus) -> str:
    """What a study is computed over: simulated flights, or runs that fly nothing."""
    return "runs" if one.study.kind == "computed" else "flights"


def has_band(n: Number) -> bool:
    # Of a share of images the bounds are those of its interval, of a calculation those of rounded inputs.
    return n.low is not None and n.high is not None and n.kind not in (SHARE_OF_IMAGES, CALCULATED)


def _ledger_row(n: Number, *, ran: bool) -> list[object]:
    size = ", by size" if n.by_size else ""
    quantity = f"{n.name.replace('_', ' ')}{size}, {n.subject}"
    unit = f" {n.unit}" if n.unit else ""
    cells: list[object] = [_with_source(quantity, n.source), f"{number(n.published, n.digits)}{unit}"]
    if ran and n.here is None:
        return [*cells, f"{MISSING} ({n.reason})" if n.reason else MISSING]
    if ran:
        below = NOTHING if n.below is None else f"{100 * n.below:.0f} %"
        here = f"{number(n.here, n.digits + 1)}{unit}"
        cells += [here, _ratio(n, unit), strip(n), below, _answers(n) + " " + dim(_why(n))]
    return cells


def _with_source(text: str, source: str) -> Markup:
    """A quantity or a claim, and where it is printed."""
    where = Markup(' <span class="dim source">{}</span>').format(source) if source else ""
    return Markup("{}{}").format(text, where)


def _ratio(n: Number, unit: str) -> str:
    if n.ratio is not None or n.here is None:
        return number(n.ratio, 2)
    off = n.here - n.published
    return f"{'+' if off > 0 else '−' if off < 0 else ''}{number(abs(off), n.digits + 1)}{unit}"


def _answers(n: Number) -> Markup:
    """Both answers, or once what a number waits for; what is not asked of it is left out."""
    near, inside = n.answers
    asked = [near] if near == inside else [one for one in (near, inside) if one != "not judged"]
    return Markup(" ").join(pill(one, PILLS.get(one, "")) for one in asked)


def _why(n: Number) -> str:
    """What the answers rest on, and whether the number is fitted or counted elsewhere."""
    parts = ["fitted: " + n.fitted if n.fitted else "", n.reason, "counted once" if n.again else ""]
    return "; ".join(part for part in parts if part)


def place(ratio: float, width: float = WIDTH, margin: float = _MARGIN) -> float:
    """Where a ratio lies on an axis of this width; what lies beyond its ends is put at them."""
    share = (math.log(ratio) / math.log(WIDEST) + 1) / 2 if ratio > 0 else 0.0
    return margin + min(max(share, 0.0), 1.0) * (width - 2 * margin)


def strip(n: Number) -> Markup | str:
    """Ours as a ratio to the printed number, on the axis that all numbers share: ours filled, the printed
    number hollow and in the middle, the spread over flights a band. An arrow stands for what lies beyond."""
    if n.ratio is None or n.published <= 0:
        return NOTHING
    words = [
        f"published {number(n.published, n.digits)}",
        f"here {number(n.here, n.digits + 1)}",
        f"ratio {n.ratio:.2f}",
    ]
    band = None
    if has_band(n):
        band = place(n.low / n.published), place(n.high / n.published)  # type: ignore[operator]
        bounds = spread_key(n.over or MANY).replace("%", "percent")
        words.append(f"{bounds} {number(n.low, n.digits + 1)} to {number(n.high, n.digits + 1)}")
    return render(
        "strip",
        alt=", ".join(words),
        width=WIDTH,
        ticks=[place(ratio) for ratio in (0.25, 0.5, 2, 4)],
        band=band,
        at=place(n.ratio),
        beyond=0 if 1 / WIDEST <= n.ratio <= WIDEST else -1 if n.ratio < 1 else 1,
    )


def claims_table(claims: list[Claim], flights: str = "flights", study: str = "") -> Markup:
    """Claims of a study, the verdict on each, and on how many flights it is true; "" where there are none."""
    if not claims:
        return Markup()
    rows = [
        (
            _with_source(one.text + (" (ours, not the thesis's)" if one.own else ""), one.source),
            # The verdict stands beside the claim: on a phone the last column may be out of sight.
            pill(one.verdict, PILLS.get(one.verdict, "")),
            _tested_on(one, flights),
        )
        for one in claims
    ]
    return table(["claim", "verdict", "true on"], rows, f"Claims of {study}", text=(0, 1), wide=True)


def _tested_on(one: Claim, flights: str) -> str:
    if one.fraction is None:
        return f"{one.met} of {one.seeds} {flights} meet the premise" if one.met is not None else ""
    share = f"{100 * one.fraction:.0f} %"
    if one.low is not None and one.high is not None:
        share += f" ({100 * one.low:.0f} to {100 * one.high:.0f})"
    of = one.seeds if one.met is None else one.met
    if of is None:
        return f"{share} of {flights}"
    beyond = f" that meet the premise, of {one.seeds}" if one.seeds and of < one.seeds else ""
    return f"{share} of {of} {flights}{beyond}"


#: A sign and a colour for each answer, so that neither tells alone.
SIGNS: Mapping[str, tuple[str, str]] = {
    Closeness.CLOSE: ("✓", "yes"),
    Closeness.NOT_CLOSE: ("✗", "no"),
    Closeness.CANNOT_TELL: ("?", "part"),
    Compatibility.WITHIN: ("✓", "yes"),
    Compatibility.OUTSIDE: ("✗", "no"),
    Compatibility.TOO_FEW: ("?", "part"),
    Compatibility.NO_POWER: ("?", "part"),
}


def published_table(
    numbers: Sequence[Number], subjects: Mapping[str, str], quantities: Mapping[str, str]
) -> Markup:
    """A row for each published number; "" where there are none.

    Parameters
    ----------
    numbers
        From `wildlab.reporting.published.compared_number`, in the order of the table.
    subjects, quantities
        Words for their subjects and names; what has none goes by its name.
    """
    if not numbers:
        return Markup()
    shown = "published ○, here ●" + (", range ▬" if any(map(has_band, numbers)) else "")
    return table(
        ["", "", "published", "here", shown, "close", "within"],
        [_report_row(one, subjects, quantities) for one in numbers],
        "Published numbers and ours",
        text=(0, 1, 5, 6),
        many=True,
    )


def effects_table(rows: Sequence[tuple[str, str, str, str, str]]) -> Markup:
    """A row for each claim: its text and source, the verdict, on how much it is true, and the difference.

    Parameters
    ----------
    rows
        Text, source, verdict, share and difference of each, in words; the last columns are left out where no
        claim has anything in them.
    """
    filled = max((2 + (2 if one[4] else 1 if one[3] else 0) for one in rows), default=2)
    cells = [
        (_with_source(text, source), pill(verdict, PILLS.get(verdict, "")), *map(mark_up, effects))[:filled]
        for text, source, verdict, *effects in rows
    ]
    heads = ("claim", "verdict", "true on", "difference")[:filled]
    return table(heads, cells, "Claims", text=range(4), wide=True, many=True)


def caption_of(numbers: Sequence[Number]) -> str:
    """What *close* and *within* mean for the kinds of numbers that there are, and where these are from."""
    texts = load_texts("published").answers
    kinds = list(dict.fromkeys(one.kind for one in numbers))
    said = [texts[kind.replace(" ", "-")] for kind in kinds]
    return " ".join([*said, texts["signs"], fill(texts["sources"], {}, {"sources": sources_of(numbers)})])


def sources_of(numbers: Sequence[Number]) -> str:
    """The tables that the published numbers are from: "H table 7.5 and H table 7.6"."""
    return listed(list(dict.fromkeys(one.source for one in numbers)))


def _report_row(
    one: Number, subjects: Mapping[str, str], quantities: Mapping[str, str]
) -> tuple[object, ...]:
    unit = unit_words(one.unit).strip()
    quantity = words_of(quantities, one.name) + (f" ({unit})" if unit else "")
    near, inside = one.answers
    return (
        mark_up(words_of(subjects, one.subject)),
        mark_up(quantity + (", size" if one.by_size else "")),
        number(one.published, one.digits),
        number(one.here, one.digits + 1),
        strip(one),
        _sign(near) + (" fitted" if one.fitted else ""),
        _sign(inside) + (dim(" counted elsewhere") if one.again else ""),
    )


def _sign(answer: str) -> Markup:
    if answer not in SIGNS:
        return dim(answer) if answer != Closeness.NOT_JUDGED else Markup(NOTHING)  # noqa: S704 - a dash
    sign, colour = SIGNS[answer]
    return Markup('<span class="pill {}" role="img" aria-label="{}">{}</span>').format(colour, answer, sign)
