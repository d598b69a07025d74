"""The ledger, ``reports/ledger.html``: every published number and claim, and what became of it here."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from datetime import UTC, datetime
from functools import lru_cache

from markupsafe import Markup

from wildlab.evaluation.replication import KINDS, operating_characteristics
from wildlab.evaluation.shares import HOLDS, MOSTLY, SHARE_VERDICTS, expected_wrong
from wildlab.messages.catalogue import fill, load_texts
from wildlab.reporting.page import TAGS, page
from wildlab.reporting.published_tables import (
    LONGEST,
    PREDICTED,
    claims_table,
    count_answers,
    flights_of,
    groups_table,
    numbers_table,
    summed_up,
)
from wildlab.reporting.status import FIRST_LOOK, Case, StudyStatus
from wildlab.reporting.text import prose, read_style, render, table_html


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
    claims = [one for study in studies if study.state == "done" for one in study.claims]
    decided = [one for one in claims if one.verdict in SHARE_VERDICTS and one.fraction is not None]
    there = {study.study.case for study in studies}
    body = render(
        "ledger",
        tiles=_tiles(studies),
        studies=[(one, _tag(one), _in_short(one)) for one in studies],
        summed_up=summed_up,
        numbers_table=numbers_table,
        claims_table=lambda one: claims_table(one.claims, flights_of(one), one.study.name),
        longest=LONGEST,
        cases=cases,
        open_cases=[case for case in cases if case.id not in there],
        groups=groups_table(count_answers(studies)),
        decided=len(decided),
        own=sum(one.own for one in decided),
        wrong=expected_wrong(len(decided)) if decided else 0.0,
        rule=_rule(),
        characteristics=_characteristics(),
    )
    made = datetime.now(UTC).strftime("%Y-%m-%d %H:%M UTC") + (f", {code}" if code else "")
    way = '<a href="index.html">wildlab</a> › ledger'
    footer = f"<p>{made}. Each report says which code and data it came from.</p>"
    return page(title="wildlab ledger", body=body, kicker=way, footer=footer, style=read_style("ledger"))


def _in_short(one: StudyStatus) -> str:
    """What became of a study in a line."""
    if not one.ran or one.state == FIRST_LOOK:
        return one.state
    return (
        summed_up(one) if one.counted else f"{len(one.claims)} claims" if one.claims else "no number in print"
    )


def _tiles(studies: Sequence[StudyStatus]) -> list[tuple[str, str]]:
    done = [study for study in studies if study.state == "done"]
    states = [study.state for study in studies]
    studied = "studies done"
    for state, words in ((FIRST_LOOK, "at a first look"), ("failed", "failed")):
        studied += f", {states.count(state)} {words}" if state in states else ""
    tiles = [(f"{len(done)} / {len(studies)}", studied)]
    # What waits for its study is in no denominator.
    counts = count_answers(studies)
    if counts.of:
        found = counts.groups[PREDICTED]
        words = f"{PREDICTED}, are close{_waiting(found.all - counts.of)}"
        tiles.append((f"{found.close['close']} / {counts.of}", words))
        asked = sum(found.compatible.values()) - found.compatible["too few flights"]
        words = f"of them outside of 90 %; {found.chance:.1f} expected by chance"
        tiles.append((f"{found.compatible['outside']} / {asked}", words))
    theirs = [one for study in done for one in study.claims if one.verdict in SHARE_VERDICTS and not one.own]
    waiting = sum(not one.own for study in studies for one in study.claims) - len(theirs)
    if theirs or waiting:
        holding, mostly = (sum(one.verdict == verdict for one in theirs) for verdict in (HOLDS, MOSTLY))
        words = f"claims of the theses hold; {mostly} more on most flights{_waiting(waiting)}"
        tiles.append((f"{holding} / {len(theirs)}", words))
    if any(study.study.kind == "logged" for study in studies):
        logged = sum(study.study.kind == "logged" for study in done)
        tiles.append((str(logged), "done on logged flights"))
    return tiles


def _waiting(count: int) -> str:
    """How many have no verdict: their study has not been run, or not in full, or says why it gives none."""
    return f"; {count} without a verdict" if count else ""


def _tag(one: StudyStatus) -> str:
    study = one.study
    if study.kind == "twin":
        flights = f", {one.seeds} flights" if one.seeds and one.seeds > 1 else ""
        return f"twin: {study.twin}{flights}"
    if study.kind == "logged":
        return f"logged: {one.flight or study.dataset or study.recipe}"
    return TAGS["computed"]


def _rule() -> Markup:
    margins = "; ".join(
        f"{kind}, a factor of {one.factor:.2f}" + (" of the odds" if one.odds else "")
        for kind, one in KINDS.items()
        if one.factor
    )
    return Markup(prose(fill(load_texts("ledger").method, {}, {"margins": margins})))  # noqa: S704 - escaped


@lru_cache(maxsize=1)
def _characteristics() -> Markup:
    """How often the rule gives each answer."""
    frame = operating_characteristics(trials=200)
    return table_html(frame, {"factor": "our errors (times)"}, 2, "Operating characteristics")
