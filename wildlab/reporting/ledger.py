"""The ledger, ``reports/ledger.html``: every published number and claim, and what became of it here."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Sequence
from datetime import UTC, datetime
from urllib.parse import quote

from wildlab.evaluation.printed import (
    AGREES,
    BY_DEVIATION,
    DIFFERS,
    MARGINS,
    NOT_JUDGED,
    POSSIBLE,
    TOO_VAGUE,
    WIDEST_FACTOR,
)
from wildlab.evaluation.shares import HOLDS, MOSTLY, SHARE_VERDICTS, expected_wrong
from wildlab.reporting.cases import Case
from wildlab.reporting.ledger_tables import claims_table, flights_of, numbers_table, summed_up
from wildlab.reporting.page import TAGS, first_look_notice, page
from wildlab.reporting.published import CALCULATED
from wildlab.reporting.status import FIRST_LOOK, MISSING, Number, StudyStatus
from wildlab.reporting.text import NOTHING, escape, inline, prose

EXPLANATION = """
A printed number is one of four. An exact **calculation** agrees within what rounding leaves open. A **mean
of runs** is compared with our mean, by both standard errors and a stated tolerance. A **share of images** is
compared with the share of all our images: it agrees where the whole 95 % interval of ours is within the
margin of a rate, differs where none of it is, and is too vague to tell where a part is. **One flight's**
figure is a single draw, which our simulated flights are held against:

**agrees** when the median of our flights is within the margin of it; **possible** when it is not, and the
printed number lies in the middle 90 % of our flights (of fewer than 30: between the lowest and the highest);
**too vague to tell** when that is so, and this middle is wider than a factor of {widest:g}; **differs** when
it lies outside. The margins are the same for all studies: {margins}. A signed mean whose sign the thesis does
not define is compared by its size. A number that is listed beside several tunings is counted once. What a
simulated flight was fitted to is **not judged** by it, number or claim; nor is a number that says nothing
without what the thesis leaves out.

A **claim** is a sentence of a thesis. It **holds** when the 95 % interval of the share of flights on which it
is true lies at or above 90 %, **holds on most flights** above 50 %, and **fails on most flights** or **does
not hold** likewise below 50 % and 10 %; where the interval contains 50 % it is **undecided**. A claim on how
often something happens in images holds, or does not, where the interval of the share of all images lies on
one side of its threshold; else it is undecided. Where the
simulated flights lack what the sentence is about, its **premise is not met** and it is not judged. That a
share is 95 % **holds** where the interval has 95 % in it and is narrow; where it is wide, that is
**undecided**.

A **first look** comes from fewer flights than the study's own. Its numbers are shown and count as nothing
until the full ones are in.

The flights of the theses were never published. A **twin** is a simulated flight built from what the thesis
prints about the real one; a **logged** flight is a real one from a public source.
"""
_STYLE = """.contents{columns:2 22rem;column-gap:2.4rem;max-width:none;font-size:.92rem}
.contents li{break-inside:avoid}.contents span{display:block;font-size:.85rem}
@media print{.contents{columns:2}}"""
_JUDGED = (AGREES, POSSIBLE, TOO_VAGUE, DIFFERS)
_ORDER = (*_JUDGED, NOT_JUDGED)


def ledger_page(studies: Iterable[StudyStatus], *, code: str = "", cases: Sequence[Case] = ()) -> str:
    """The whole page.

    Parameters
    ----------
    studies
        All of them, run or not.
    code
        Which code it was put together by, as HTML.
    cases
        Those of the theses, studied here or not.
    """
    studies = list(studies)
    body = [
        "<header><h1>Ledger</h1>",
        '<p class="sub">Published numbers and claims of the two theses, and what became of them here.</p>',
        "</header>",
        _tiles(studies),
        _contents(studies),
        _coverage(studies, cases),
        *(_section(one) for one in studies),
        _explanation(),
    ]
    made = datetime.now(UTC).strftime("%Y-%m-%d %H:%M UTC")
    made += f", {code}" if code else ""
    footer = f"<p>Put together {made}. Each report says which code and data it came from.</p>"
    way = '<a href="index.html">wildlab</a> › ledger'
    return page(title="wildlab ledger", body="\n".join(body), kicker=way, footer=footer, style=_STYLE)


def _contents(studies: list[StudyStatus]) -> str:
    """Each study, and what became of it in a line."""
    items = "".join(
        f'<li><a href="#{escape(quote(one.study.name))}">{escape(one.study.title)}</a> '
        f'<span class="dim">{escape(_in_short(one))}</span></li>'
        for one in studies
    )
    return (
        f'<nav aria-label="Contents"><h2>Contents</h2><ul class="contents">{items}</ul></nav>'
        if items
        else ""
    )


def _in_short(one: StudyStatus) -> str:
    if not one.ran or one.state == FIRST_LOOK:
        return one.state
    return (
        summed_up(one) if one.counted else f"{len(one.claims)} claims" if one.claims else "no number in print"
    )


def _tiles(studies: list[StudyStatus]) -> str:
    done = [study for study in studies if study.state == "done"]
    failed = sum(study.state == "failed" for study in studies)
    looks = sum(study.state == FIRST_LOOK for study in studies)
    studied = "studies done" + (f", {looks} at a first look" if looks else "")
    studied += f", {failed} failed" if failed else ""
    tiles = [(f"{len(done)} / {len(studies)}", studied)]
    # What waits for its study is in no denominator.
    numbers = [one for study in done for one in study.counted if one.verdict in _JUDGED]
    waiting = sum(len(study.counted) for study in studies) - len(numbers)
    if numbers or waiting:
        agree = sum(one.verdict == AGREES for one in numbers)
        tiles.append((f"{agree} / {len(numbers)}", f"published numbers agree{_waiting(waiting)}"))
    claims = [one for study in done for one in study.claims if one.verdict in SHARE_VERDICTS]
    theirs = [one for one in claims if not one.own]
    waiting = sum(not one.own for study in studies for one in study.claims) - len(theirs)
    if theirs or waiting:
        holding = sum(one.verdict in (HOLDS, MOSTLY) for one in theirs)
        words = f"claims of the theses hold, on nearly all flights or on most{_waiting(waiting)}"
        tiles.append((f"{holding} / {len(theirs)}", words))
    if any(study.study.kind == "logged" for study in studies):
        logged = sum(study.study.kind == "logged" for study in done)
        tiles.append((str(logged), "done on logged flights"))
    return f'<ul class="tiles">{"".join(f"<li><b>{v}</b><span>{t}</span></li>" for v, t in tiles)}</ul>'


def _waiting(count: int) -> str:
    """How many have no verdict: their study has not been run, or not in full, or says why it gives none."""
    return f"; {count} without a verdict" if count else ""


def _coverage(studies: list[StudyStatus], cases: Sequence[Case]) -> str:
    """What all this is about: cases with and without a study, numbers by kind, claims, chance."""
    parts = []
    if cases:
        there = {study.study.case for study in studies}
        open_ones = [case for case in cases if case.id not in there]
        built = len(cases) - len(open_ones)
        items = "".join(
            f"<li>{escape(case.section)} <code>{escape(case.id)}</code>: {escape(case.shows)}</li>"
            for case in open_ones
        )
        parts.append(
            f"<p>{len(cases)} case studies are counted in the two theses; {built} of them "
            f"{'has' if built == 1 else 'have'} a study here.</p>"
        )
        if open_ones:
            parts.append(
                f'<details class="plain"><summary>{len(open_ones)} without one</summary>'
                f"<ul>{items}</ul></details>"
            )
    rows = [
        (kind, Counter(one.verdict for one in numbers))
        for kind, numbers in _by_kind(studies).items()
        if numbers
    ]
    if rows:
        columns = [v for v in (*_ORDER, MISSING, FIRST_LOOK) if any(counts[v] for _, counts in rows)]
        heads = "".join(f'<th scope="col">{escape(column)}</th>' for column in ("all", *columns))
        body = "".join(
            f'<tr><th scope="row" class="text">{escape(kind)}</th><td>{sum(counts.values())}</td>'
            + "".join(f"<td>{counts[column] or NOTHING}</td>" for column in columns)
            + "</tr>"
            for kind, counts in rows
        )
        parts.append(
            '<div class="scroll" role="region" tabindex="0" aria-label="Published numbers by kind"><table>'
            f'<thead><tr><th scope="col" class="text">published numbers</th>{heads}</tr></thead>'
            f"<tbody>{body}</tbody></table></div>"
        )
    claims = [one for study in studies if study.state == "done" for one in study.claims]
    decided = [one for one in claims if one.verdict in SHARE_VERDICTS and one.fraction is not None]
    if decided:
        own = sum(one.own for one in decided)
        parts.append(
            f"<p>{len(decided)} claims were decided by the share of flights or runs on which they are true"
            + (f", {len(decided) - own} of the theses and {own} of ours, not counted above" if own else "")
            + ". If each lay just at the border of its verdict, chance would make at most "
            f"{expected_wrong(len(decided)):.1f} of these verdicts wrong on average; most lie further from "
            "it. Claims of one study share their flights.</p>"
        )
    return f"<section><h2>What this covers</h2>{''.join(parts)}</section>" if parts else ""


def _by_kind(studies: list[StudyStatus]) -> dict[str, list[Number]]:
    """Counted numbers by what they are, and by what they are held against."""
    found: dict[str, list[Number]] = {}
    for study in studies:
        for one in study.counted:
            on = {"twin": ", on simulated flights", "logged": ", on logged flights"}.get(study.study.kind, "")
            words = one.kind if one.kind == CALCULATED else f"{one.kind}{on}"
            found.setdefault(words, []).append(one)
    return found


def _section(one: StudyStatus) -> str:
    study = one.study
    tag = f'<span class="tag {study.kind}">{escape(_tag(one))}</span>'
    answers = f" · {escape(study.section)}" if study.section else ""
    parts = [
        f'<section><h2 id="{escape(study.name)}">{escape(study.title)}</h2>',
        f'<p class="sub">{tag}<code>{escape(study.name)}</code>{answers}</p>',
        _state(one),
        numbers_table(one),
        claims_table(one.claims, flights_of(one), study.name),
    ]
    if one.has_report:
        words = "Open the report" if one.ran else "See what went wrong"
        parts.append(f'<p><a href="{escape(study.name)}/report.html">{words}</a></p>')
    return "\n".join([*(part for part in parts if part), "</section>"])


def _tag(one: StudyStatus) -> str:
    study = one.study
    if study.kind == "twin":
        flights = f", {one.seeds} flights" if one.seeds and one.seeds > 1 else ""
        return f"twin: {study.twin}{flights}"
    if study.kind == "logged":
        return f"logged: {one.flight or study.dataset or study.recipe}"
    return TAGS["computed"]


def _state(one: StudyStatus) -> str:
    run = f"`wildlab run {one.study.name}`"
    if one.state == "failed":
        return f'<p><span class="pill no">failed</span> {inline(one.reason)}</p>'
    if one.state == "broken off":
        return f'<p><span class="pill part">broken off</span> {inline(f"Run it again: {run}")}</p>'
    if one.state == FIRST_LOOK:
        return first_look_notice(one.first_look, f"wildlab run {one.study.name}")
    if one.state == "not run":
        fetch = (
            f"Get its data with `wildlab fetch {one.study.dataset}`, then run it: "
            if one.study.dataset
            else ""
        )
        return f'<p><span class="pill">not run yet</span> {inline(fetch + run)}</p>'
    return ""


def _explanation() -> str:
    margins = "; ".join(_margin_words(kind, *margin) for kind, margin in MARGINS.items())
    text = EXPLANATION.format(margins=margins, widest=WIDEST_FACTOR)
    return f"<details><summary>How to read this</summary>{prose(text)}</details>"


def _margin_words(kind: str, factor: float | None, difference: float | None) -> str:
    if factor is not None:
        return f"{kind}, a factor of {factor:g}"
    return f"{kind}, {difference:g}" + (
        f" of the size of the errors, or {BY_DEVIATION:g} of their standard deviation where that is printed"
        if kind == "signed mean"
        else ""
    )
