"""Pages of the folder of reports: ``index.html``, what this is, a flight that moves, a card a case;
``ledger.html``: every published number and claim, and what became of it here; ``flights.html``: the flights
that somebody evaluated; and ``partners.html``.

The flight that moves is a part of a twin, simulated and drawn once by ``tools/front_flight.py``.
"""

from __future__ import annotations

import base64
import binascii
import html
import json
import re
from collections.abc import Iterable, Mapping, Sequence
from datetime import UTC, datetime
from functools import lru_cache, partial
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from markupsafe import Markup

from wildlab.analysis.verdict import Verdict, evidence_of, verdict_of
from wildlab.evaluation.replication import KINDS, operating_characteristics
from wildlab.evaluation.shares import HOLDS, MOSTLY, SHARE_VERDICTS, expected_wrong
from wildlab.messages.catalogue import fill, load_texts
from wildlab.paths import DATA
from wildlab.reporting.published import FIRST_LOOK, Case, StudyStatus
from wildlab.reporting.published_tables import (
    LONGEST,
    PREDICTED,
    claims_table,
    count_answers,
    flights_of,
    groups_table,
    published_table,
    study_verdict,
    summed_up,
    tested_on,
)
from wildlab.reporting.text import PILLS, TAGS, page, prose, read_style, render, table_html

#: The page, beside the ledger.
FLIGHTS = "flights.html"
#: What the verdict follows from, of the overview.
COUNTS = {"problems": "problems", "worth": "worth_fixing", "troubled": "troubled", "judged": "reports_beside"}


class OwnReport(NamedTuple):
    """One report on a flight.

    Attributes
    ----------
    folder
        Its name.
    about
        ``overview``, ``georeferencing``, ``navigation``, ``tracking``, ``many targets``, or the
        folder's name.
    state
        ``done``, ``failed``, ``broken off`` or ``damaged``.
    finished
        When, as ISO 8601; "" where that is not known.
    numbers
        By name and subject; empty where it is not done.
    lacking
        Of an overview: which others could not be made, and why.
    """

    folder: str
    about: str
    state: str
    finished: str
    numbers: Mapping[tuple[str, str], Mapping[str, Any]]
    lacking: tuple[str, ...]

    def of_leading_filter(self, name: str) -> dict[str, Mapping[str, Any]]:
        """A number of every track of the filter that a report on tracking leads with, by subject."""
        from wildlab.analysis.tracks.tracker import LEADING  # takes a while, and few pages need it

        best = next((subject for other, subject in self.numbers if other == LEADING), "ekf")
        return {
            subject: entry
            for (other, subject), entry in self.numbers.items()
            if other == name and subject.endswith(f"/{best}")
        }


class OwnFlight(NamedTuple):
    """A flight with its reports, the overview first; ``kind`` is ``logged`` or ``twin``.

    ``earlier`` are reports that the newest evaluation did not make again, or that are of other tables.
    """

    name: str
    kind: str
    reports: tuple[OwnReport, ...]
    earlier: tuple[OwnReport, ...] = ()

    def report(self, about: str) -> OwnReport | None:
        """The report on something, where there is one."""
        return next((one for one in self.reports if one.about == about), None)

    def number(self, name: str, subject: str) -> Mapping[str, Any] | None:
        """A number of the first report that has it; None where it is in none, or could not be computed."""
        entry = self.numbers.get((name, subject))
        return None if entry is None or entry["value"] is None else entry

    def value(self, name: str, subject: str) -> float | None:
        """Its value alone."""
        entry = self.number(name, subject)
        return None if entry is None else float(entry["value"])

    @property
    def numbers(self) -> dict[tuple[str, str], Mapping[str, Any]]:
        """Those of all its reports; of equal ones that of the first report."""
        return {key: entry for one in reversed(self.reports) for key, entry in one.numbers.items()}

    @property
    def verdict(self) -> Verdict | None:
        """What it comes to; None without an overview that is done."""
        counts = {key: self.value(name, "flight") for key, name in COUNTS.items()}
        # Overviews of before these were computed do not have them.
        counts |= {name: self.value(name, "flight") or 0 for name in ("broken", "alarmed")}
        known = {key: count for key, count in counts.items() if count is not None}
        if len(known) < len(counts):
            return None
        return verdict_of(evidence_of(known, self.numbers))

    @property
    def finished(self) -> str:
        """When the last of its reports was, as ``2026-11-22 10:15 UTC``; "" where that is not known."""
        latest = max((one.finished for one in self.reports), default="")
        return f"{latest[:16].replace('T', ' ')} UTC" if len(latest) >= 16 else ""

    @property
    def length_s(self) -> float:
        """How long it was, s; NaN where that is not known."""
        found = self.value("duration", "flight")
        return float("nan") if found is None else found


def pill_of(flight: OwnFlight) -> tuple[str, str]:
    """The verdict in a word, and the colour that goes with it."""
    word = flight.verdict
    return ("no overview", "") if word is None else (word.value, PILLS[word.colour])


def flights_page(flights: Sequence[OwnFlight], comparison: str = "") -> str:
    """The whole page.

    Parameters
    ----------
    flights
        By name.
    comparison
        Address of the comparison of some of them, where there is one.

    Returns
    -------
    str
        HTML. It names flights and reports, and no place.
    """
    reports = [one for flight in flights for one in (*flight.reports, *flight.earlier)]
    body = render(
        "flights",
        flights=[(one, *pill_of(one), TAGS.get(one.kind, one.kind)) for one in flights],
        judged=sum(one.verdict not in (None, Verdict.UNJUDGED) for one in flights),
        damaged=[one.folder for one in reports if one.state == "damaged"],
        comparison=comparison,
    )
    return page(
        title="Flights evaluated here",
        body=body,
        kicker='<a href="index.html">wildlab</a> › flights',
        footer=f"<p>{datetime.now(UTC):%Y-%m-%d %H:%M} UTC</p>",
    )


#: The pages beside it: the ledger, and how to share.
LEDGER, PARTNERS = "ledger.html", "partners.html"
#: Cards of own flights at most, the newest first.
MOST_FLIGHTS = 4
#: Numbers of the moving picture, which lies beside it; share of a normal distribution that its ellipses hold.
FLIGHT, PROBABILITY = DATA / "front-flight.json", 0.9
#: Width of a small picture, pixels; how well it is kept, of 100; most pixels of one that is read.
WIDE, QUALITY, MOST_PIXELS = 440, 60, 40_000_000
_SUMMARY = re.compile(r'<section\b[^>]*\bclass="summary\b[^>]*>(.*?)</section>', re.S)
_BOLD = re.compile(r"<b>(.*?)</b>", re.S)
_PICTURE = re.compile(r'<img\b[^>]*\bsrc="data:image/png;base64,([A-Za-z0-9+/=\s]+)"[^>]*>')
_ALT = re.compile(r'\balt="([^"]*)"')
_HEADING = re.compile(r"<h1\b[^>]*>(.*?)</h1>", re.S)
_TAG = re.compile(r"<[^>]+>")


class Glimpse(NamedTuple):
    """Of a report, as plain text: heading, the summary's first sentence, its first picture as a ``data:``
    address and what that shows. What it does not have is ""."""

    title: str = ""
    sentence: str = ""
    picture: str = ""
    alt: str = ""


def read_glimpse(report: Path) -> Glimpse:
    """What a card shows of a report; of one that cannot be read, nothing.

    Parameters
    ----------
    report
        ``report.html``.

    Returns
    -------
    Glimpse
    """
    try:
        state = report.stat()
    except OSError:
        return Glimpse()
    return _read(report, state.st_mtime_ns, state.st_size)


@lru_cache(maxsize=512)
def _read(report: Path, changed: int, size: int) -> Glimpse:
    """Kept as long as the file is the same: the page is put together several times in a run."""
    try:
        whole = report.read_text(encoding="utf-8")
    except (OSError, ValueError):
        return Glimpse()
    heading, summary, picture = _HEADING.search(whole), _SUMMARY.search(whole), _PICTURE.search(whole)
    bold = _BOLD.search(summary[1]) if summary else None
    small = smaller(picture[1]) if picture else ""
    alt = _ALT.search(picture[0]) if picture and small else None
    return Glimpse(
        _plain_text(heading[1]) if heading else "",
        _plain_text(bold[1]) if bold else "",
        small,
        _plain_text(alt[1]) if alt else "",
    )


def _plain_text(text: str) -> str:
    return " ".join(html.unescape(_TAG.sub("", text)).split())


def smaller(png: str) -> str:
    """A PNG, as base64, made as wide as a card, as a ``data:`` address of a WebP; "" where it is none."""
    import cv2  # takes a while, and a page without pictures does not need it

    try:
        content = base64.b64decode(png)
    except (ValueError, binascii.Error):
        return ""
    # How large it says it is stands in its first bytes: it is read before that much memory is asked for.
    if content[:8] != b"\x89PNG\r\n\x1a\n" or len(content) < 24:
        return ""
    width, height = (int.from_bytes(content[at : at + 4], "big") for at in (16, 20))
    if not 0 < width * height <= MOST_PIXELS:
        return ""
    try:
        picture = cv2.imdecode(np.frombuffer(content, np.uint8), cv2.IMREAD_COLOR)
        if picture is None:
            return ""
        tall = max(1, min(round(height * WIDE / width), 2 * WIDE))
        small = cv2.resize(picture, (WIDE, tall), interpolation=cv2.INTER_AREA)
        written, webp = cv2.imencode(".webp", small, [cv2.IMWRITE_WEBP_QUALITY, QUALITY])
    except cv2.error:
        return ""
    return f"data:image/webp;base64,{base64.b64encode(webp.tobytes()).decode('ascii')}" if written else ""


class Answer(NamedTuple):
    """What became of one study or flight: what it is called on its card, its report's folder ("" where there
    is none), the verdict and its colour, and what it is of where that is not all."""

    name: str
    folder: str
    word: str
    pill: str
    note: str = ""


class Card(NamedTuple):
    """One card.

    Attributes
    ----------
    title, sentence, tag
        Plain text: what is asked, what was found ("" where that is not known), and on what.
    answers
        One for each report that it opens.
    picture, alt
        A ``data:`` address and what it shows, or "".
    """

    title: str
    sentence: str
    tag: str
    answers: Sequence[Answer]
    picture: str = ""
    alt: str = ""


def case_cards(studies: Iterable[tuple[StudyStatus, Glimpse]], cases: Sequence[Case] = ()) -> list[Card]:
    """A card for each case: the studies of one case, on different twins, share it.

    Parameters
    ----------
    studies
        Those that were run or tried, each with what its report shows.
    cases
        Of the theses.
    """
    shows = {case.id: case.shows for case in cases}
    by_case: dict[str, list[tuple[StudyStatus, Glimpse]]] = {}
    for one, glimpse in studies:
        by_case.setdefault(one.study.case or one.study.name, []).append((one, glimpse))
    return [_case_card(shows.get(case, ""), some) for case, some in by_case.items()]


def _case_card(shows: str, some: Sequence[tuple[StudyStatus, Glimpse]]) -> Card:
    first, alone = some[0][0], len(some) == 1
    seen = [glimpse for one, glimpse in some if one.ran]
    pictured = next((glimpse for glimpse in seen if glimpse.picture), Glimpse())
    answer = seen[0].sentence if seen else first.reason
    return Card(
        title=first.study.title if alone or not shows else shows,
        sentence=answer if alone else "",
        tag="; ".join(dict.fromkeys(study_tag(one) for one, _ in some)),
        answers=[_answer(one, alone=alone) for one, _ in some],
        picture=pictured.picture,
        alt=pictured.alt,
    )


def _answer(one: StudyStatus, *, alone: bool) -> Answer:
    study = one.study
    name = "report" if alone else (study.twin or study.dataset or study.name).replace("-", " ")
    folder = study.name if one.has_report else ""
    if not one.ran:
        return Answer(name, folder, one.state, "no")
    found = study_verdict(one)
    return Answer(name, folder, found.word, PILLS[found.level], one.first_look)


def study_tag(one: StudyStatus) -> str:
    """What a study was run on, in few words."""
    kind = one.study.kind
    if kind == "twin":
        return f"{one.seeds} simulated flights" if one.seeds and one.seeds > 1 else "simulated flight"
    return "logged flight" if kind == "logged" else TAGS["computed"]


def flight_card(flight: OwnFlight, glimpse: Glimpse) -> Card:
    """The card of a flight that somebody evaluated; the first report bears its verdict."""
    first, (word, pill) = flight.reports[0], pill_of(flight)
    return Card(
        title=flight.name,
        sentence=glimpse.sentence if first.state == "done" else f"{first.about}: {first.state}",
        tag=TAGS.get(flight.kind, flight.kind),
        answers=[
            Answer(
                one.about,
                one.folder,
                word if one is first else "",
                pill,
                "" if one.state == "done" else one.state,
            )
            for one in flight.reports
        ],
        picture=glimpse.picture if first.state != "damaged" else "",
        alt=glimpse.alt,
    )


def front_page(
    studies: Sequence[StudyStatus],
    *,
    study_cards: Sequence[Card] = (),
    flight_cards: Sequence[Card] = (),
    flights: int = 0,
    cases: int = 0,
    learn: Sequence[tuple[str, str]] = (),
    checkout: bool = True,
    code: str = "",
) -> str:
    """The whole page.

    Parameters
    ----------
    studies
        All of them, run or not.
    study_cards, flight_cards
        Of cases that were run or tried; of own flights, the newest first.
    flights
        How many own flights there are.
    cases
        How many cases the theses have; 0 where that is not known.
    learn
        Titles of tutorials and reference, with the address of those whose page is there, else "".
    checkout
        Whether this is a checkout, whose ``make`` writes these pages.
    code
        Which code it was put together by, as HTML.
    """
    states = [one.state for one in studies]
    body = render(
        "front",
        moving=Markup(FLIGHT.with_suffix(".svg").read_text("utf-8")),  # noqa: S704 - ours
        flight=json.loads(FLIGHT.read_text("utf-8")),
        probability=PROBABILITY,
        done=states.count("done"),
        looks=states.count(FIRST_LOOK),
        damaged=states.count("damaged"),
        studies=len(studies),
        cases=cases,
        flights=flights,
        flight_cards=flight_cards[:MOST_FLIGHTS],
        study_cards=study_cards,
        waiting=[one.study for one in studies if one.state == "not run"],
        learn=learn,
        checkout=checkout,
        # How many studies are done is said above.
        counts=_tiles(studies)[1:],
        pages={"flights": FLIGHTS, "partners": PARTNERS, "ledger": LEDGER},
    )
    made = datetime.now(UTC).strftime("%Y-%m-%d %H:%M UTC") + (f", {code}" if code else "")
    style = read_style("front")
    footer = f"<p>{made}. This page works offline.</p>"
    return page(title="wildlab", body=body, kicker="wildlab", footer=footer, style=style)


def partners_page(reports: Sequence[str]) -> str:
    """``reports/partners.html``: how a partner gets a report that gives no place away.

    Parameters
    ----------
    reports
        Folders of the reports that are there to be shared; may be empty.
    """
    # A name may hold what would end a span of code.
    example = (reports[0] if reports else "tuesday-overview").replace("`", "")
    way = '<a href="index.html">wildlab</a> › for partners'
    body = render("partners", reports=reports, example=example)
    return page(title="A copy that is safe to send", body=body, kicker=way)


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
        studies=[(one, study_tag(one), _in_short(one)) for one in studies],
        summed_up=summed_up,
        numbers_table=partial(published_table, ledger=True),
        claims_table=_claims,
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


def _claims(one: StudyStatus) -> Markup:
    rows = [
        (
            claim.text + (" (ours, not the thesis's)" if claim.own else ""),
            claim.source,
            claim.verdict,
            tested_on(claim, flights_of(one)),
            "",
        )
        for claim in one.claims
    ]
    return claims_table(rows) if rows else Markup()


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
    found = count_answers(studies).get(PREDICTED)
    if found and found.judged:
        words = f"{PREDICTED}, are close{_waiting(found.all - found.judged)}"
        tiles.append((f"{found.close['close']} / {found.judged}", words))
        asked = sum(found.compatible.values()) - found.compatible["too few flights"]
        words = f"of them outside of 90 %; {found.chance:.1f} expected by chance"
        tiles.append((f"{found.compatible['outside']} / {asked}", words))
    theirs = [one for study in done for one in study.claims if one.verdict in SHARE_VERDICTS and not one.own]
    waiting = sum(not one.own for study in studies for one in study.claims) - len(theirs)
    if theirs or waiting:
        holding, mostly = (sum(one.verdict == verdict for one in theirs) for verdict in (HOLDS, MOSTLY))
        words = f"claims of the theses hold; {mostly} more on most flights{_waiting(waiting)}"
        tiles.append((f"{holding} / {len(theirs)}", words))
    return tiles


def _waiting(count: int) -> str:
    """How many have no verdict: their study has not been run, or not in full, or says why it gives none."""
    return f"; {count} without a verdict" if count else ""


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
