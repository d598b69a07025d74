"""The ledger, ``reports/ledger.html``: every published number and claim, and what became of it here."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from datetime import UTC, datetime
from functools import lru_cache
from urllib.parse import quote

from wildlab.evaluation.characteristics import operating_characteristics
from wildlab.evaluation.replication import KINDS
from wildlab.evaluation.shares import HOLDS, MOSTLY, SHARE_VERDICTS, expected_wrong
from wildlab.reporting.cases import Case
from wildlab.reporting.counts import PREDICTED, counted, groups_table
from wildlab.reporting.ledger_tables import claims_table, flights_of, numbers_table, summed_up
from wildlab.reporting.page import TAGS, first_look_notice, page
from wildlab.reporting.status import FIRST_LOOK, StudyStatus
from wildlab.reporting.tables import table_html
from wildlab.reporting.text import escape, inline, prose

EXPLANATION = """
Two questions are asked of a published number. **Close?** The 90 % confidence interval of the median of our
flights lies within the margin of it (**close**), beside it (**not close**), or across its border (**cannot
tell**). The margins are the same for all studies: {margins}. Of a signed mean this is not asked.

**Within 90 %?** The published flight's number lies in the 90 % prediction interval of one more flight like
ours (**within**) or not (**outside**), after Patil, Peng and Leek (2016). Fewer than 19 flights have no
such interval (**too few flights**). Where the interval would as likely as not hold a flight with errors
half as large as ours, "within" would say nothing (**no power**). One true twin in ten is outside by chance.

An exact **calculation** is close where it is within what the rounding of the published result and of its
published inputs leaves open; else it is said by how much it is off. The tables of a thesis that contradict
themselves where they are rounded to nearest are granted one in the last digit. A **mean of runs** is judged
by both standard errors, a **share of images** by the interval of all our images. A signed mean whose sign
the thesis does not define is compared by its size. **Fitted**: something of our twin was chosen by that
number; it is compared, and counted apart. A number that is published twice for one flight is counted once.
A number that says nothing without what the thesis leaves out is **not judged**.

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
        _characteristics(),
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
    counts = counted(studies)
    if counts.of:
        found = counts.groups[PREDICTED]
        words = f"{PREDICTED}, are close{_waiting(found.all - counts.of)}"
        tiles.append((f"{found.close['close']} / {counts.of}", words))
        outside = found.compatible["outside"]
        asked = sum(found.compatible.values()) - found.compatible["too few flights"]
        tiles.append(
            (f"{outside} / {asked}", f"of them outside of 90 %; {found.chance:.1f} expected by chance")
        )
    claims = [one for study in done for one in study.claims if one.verdict in SHARE_VERDICTS]
    theirs = [one for one in claims if not one.own]
    waiting = sum(not one.own for study in studies for one in study.claims) - len(theirs)
    if theirs or waiting:
        holding, mostly = (sum(one.verdict == verdict for one in theirs) for verdict in (HOLDS, MOSTLY))
        words = f"claims of the theses hold; {mostly} more on most flights{_waiting(waiting)}"
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
    parts.append(groups_table(counted(studies)))
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
    return f"<section><h2>What this covers</h2>{''.join(parts)}</section>" if any(parts) else ""


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
    if one.state == "damaged":
        words = f"{inline(one.reason)}. {inline(f'Run it again: {run}')}"
        return f'<p><span class="pill no">damaged</span> {words}</p>'
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
    margins = "; ".join(
        f"{kind}, a factor of {one.factor:.2f}" + (" of the odds" if one.odds else "")
        for kind, one in KINDS.items()
        if one.factor
    )
    text = EXPLANATION.format(margins=margins)
    return f'<details id="rule"><summary>How to read this</summary>{prose(text)}</details>'


@lru_cache(maxsize=1)
def _characteristics() -> str:
    """How often the rule gives each answer, folded away."""
    frame = operating_characteristics(trials=200)
    body = table_html(frame, {"factor": "our errors (times)"}, 2)
    return (
        '<details id="characteristics"><summary>How often each answer is right</summary><p>Probability of '
        "each answer where the errors of our 100 flights are so many times those of the published flight, by "
        "simulation of the rule; a flight has 20 independent errors. <code>wildlab list --rule</code> gives "
        'it.</p><div class="scroll" role="region" tabindex="0" aria-label="Operating characteristics">'
        f"{body}</div></details>"
    )
