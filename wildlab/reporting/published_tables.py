"""Published numbers and claims beside ours: how many of how many, and tables."""

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
    FIRST_LOOK,
    MANY,
    MEAN_OF_RUNS,
    MISSING,
    ONE_FLIGHT,
    SHARE_OF_IMAGES,
    Claim,
    Number,
    Standing,
    StudyStatus,
    quantity_kind,
    spread_key,
    standing,
)
from wildlab.reporting.text import dim, mark_up, pill, render, table

#: What tiles count: predicted for a flight that nothing of ours was fitted to; then the others.
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
    def judged(self) -> int:
        """How many have an answer."""
        return self.all - self.unjudged - self.waiting

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


def count_answers(studies: Iterable[StudyStatus]) -> dict[str, Tally]:
    """All published numbers, each counted once, by `GROUPS`; only studies that are done give answers."""
    numbers = [one for study in studies for one in study.counted]
    groups = {group: [one for one in numbers if group_of(one) == group] for group in GROUPS}
    return {group: tally(those) for group, those in groups.items() if those}


def groups_table(counts: Mapping[str, Tally]) -> Markup:
    """The answers by group, as HTML; "" where none was given."""
    rows = [(group, one) for group, one in counts.items() if one.close or one.compatible]
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
#: A sign and a colour for each answer, so that neither tells alone.
SIGNS: Mapping[str, tuple[str, str]] = {
    Closeness.CLOSE: ("✓", "yes"),
    Closeness.NOT_CLOSE: ("✗", "no"),
    Compatibility.WITHIN: ("✓", "yes"),
    Compatibility.OUTSIDE: ("✗", "no"),
    **dict.fromkeys((Closeness.CANNOT_TELL, Compatibility.TOO_FEW, Compatibility.NO_POWER), ("?", "part")),
}
#: Colours of verdicts on claims; what is not here decides nothing.
PILLS: Mapping[str, str] = {
    HOLDS: "yes", FAILS: "no", MOSTLY_NOT: "no", **dict.fromkeys((MOSTLY, UNDECIDED, FIRST_LOOK), "part"),
}  # fmt: skip
#: The axis of every strip: ratios to the printed number from 1/8 to 8, logarithmic, and its width in pixels.
WIDEST, WIDTH = 8.0, 160.0
_MARGIN = 8.0


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


def published_table(
    numbers: Sequence[Number],
    subjects: Mapping[str, str] | None = None,
    quantities: Mapping[str, str] | None = None,
    *,
    ledger: bool = False,
) -> Markup:
    """A row for each published number beside ours; "" where there are none.

    Parameters
    ----------
    numbers
        From `wildlab.reporting.published.compared_number`, in the order of the table.
    subjects, quantities
        Words for their subjects and names; what has none goes by its name.
    ledger
        Whether each says where it is printed, and what its answers rest on.
    """
    if not numbers:
        return Markup()
    shown = "published ○, here ●" + (", range ▬" if any(map(has_band, numbers)) else "")
    rows = [_row(one, subjects or {}, quantities or {}, ledger=ledger) for one in numbers]
    heads = ["", "", "published", "here", shown, "close", "within"]
    return table(heads, rows, "Published numbers and ours", text=(0, 1, 5, 6), many=True)


def _row(
    one: Number, subjects: Mapping[str, str], quantities: Mapping[str, str], *, ledger: bool
) -> tuple[object, ...]:
    unit = unit_words(one.unit).strip()
    quantity = words_of(quantities, one.name) + (f" ({unit})" if unit else "")
    quantity += ", size" if one.by_size else ""
    cells = (
        mark_up(words_of(subjects, one.subject)),
        with_source(quantity, one.source if ledger else ""),
        number(one.published, one.digits),
    )
    if one.here is None:
        return (*cells, f"{MISSING} ({one.reason})" if one.reason else MISSING)
    near, inside = (_sign(answer) for answer in one.answers)
    why = one.reason if ledger else ""
    notes = [f"fitted: {one.fitted}" if ledger else "fitted"] if one.fitted else []
    notes += [*filter(None, [why]), *(["counted elsewhere"] if one.again else [])]
    return (
        *cells, number(one.here, one.digits + 1), strip(one), near, inside + dim(f" {'; '.join(notes)}"),
    )  # fmt: skip


def _sign(answer: str) -> Markup:
    if answer not in SIGNS:
        return dim(answer) if answer != Closeness.NOT_JUDGED else Markup(NOTHING)  # noqa: S704 - a dash
    sign, colour = SIGNS[answer]
    return Markup('<span class="pill {}" role="img" aria-label="{}">{}</span>').format(colour, answer, sign)


def flights_of(one: StudyStatus) -> str:
    """What a study is computed over: simulated flights, or runs that fly nothing."""
    return "runs" if one.study.kind == "computed" else "flights"


def has_band(n: Number) -> bool:
    # Of a share of images the bounds are those of its interval, of a calculation those of rounded inputs.
    return n.low is not None and n.high is not None and n.kind not in (SHARE_OF_IMAGES, CALCULATED)


def with_source(text: str, source: str) -> Markup:
    """A quantity or a claim, and where it is printed."""
    where = Markup(' <span class="dim source">{}</span>').format(source) if source else ""
    return Markup("{}{}").format(mark_up(text), where)


def place(ratio: float) -> float:
    """Where a ratio lies on the axis; what lies beyond its ends is put at them."""
    share = (math.log(ratio) / math.log(WIDEST) + 1) / 2 if ratio > 0 else 0.0
    return _MARGIN + min(max(share, 0.0), 1.0) * (WIDTH - 2 * _MARGIN)


def strip(n: Number) -> Markup | str:
    """Ours as a ratio to the printed number, on the axis that all numbers share: ours filled, the printed
    number hollow and in the middle, the spread over flights a band. An arrow stands for what lies beyond."""
    if n.ratio is None or n.published <= 0:
        return NOTHING
    words = [f"here {number(n.here, n.digits + 1)}", f"ratio {n.ratio:.2f}"]
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


def tested_on(one: Claim, flights: str) -> str:
    """On how many flights a claim is true."""
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


def claims_table(rows: Sequence[tuple[str, str, str, str, str]]) -> Markup:
    """A row for each claim: its text and source, the verdict, on how much it is true, and the difference.

    Parameters
    ----------
    rows
        Text, source, verdict, share and difference of each, in words; the last columns are left out where no
        claim has anything in them.
    """
    filled = max((2 + (2 if one[4] else 1 if one[3] else 0) for one in rows), default=2)
    cells = [
        (with_source(text, source), pill(verdict, PILLS.get(verdict, "")), *map(mark_up, effects))[:filled]
        for text, source, verdict, *effects in rows
    ]
    heads = ("claim", "verdict", "how often true", "difference")[:filled]
    return table(heads, cells, "Claims", text=range(4), wide=True, many=True)


def caption_of(numbers: Sequence[Number]) -> str:
    """What *close* and *within* mean for the kinds of numbers that there are, and where these are from."""
    texts = load_texts("published").answers
    said = [texts[kind.replace(" ", "-")] for kind in dict.fromkeys(one.kind for one in numbers)]
    sources = listed(list(dict.fromkeys(one.source for one in numbers)))
    return " ".join([*said, texts["signs"], fill(texts["sources"], {}, {"sources": sources})])


def study_verdict(one: StudyStatus) -> Standing:
    """What a study's numbers and claims come to, as its report says it; a first look comes to nothing yet."""
    if one.state == FIRST_LOOK:
        return Standing("first look", f"{one.first_look}: not counted yet.", "warn")
    compared = [n.compared for n in one.counted if n.compared is not None]
    return standing(compared, (c.verdict for c in one.claims if not c.own))
