"""The wall of the front page: one card for each study that was run and each flight that was evaluated."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

from wildlab.reporting.flight_status import Standing, standing
from wildlab.reporting.front.glimpse import Glimpse
from wildlab.reporting.front.ratios import drawable, plot, ticks
from wildlab.reporting.own_flights import OwnFlight, address, verdict_pill
from wildlab.reporting.page import PILLS, TAGS
from wildlab.reporting.status import FIRST_LOOK, Number, StudyStatus
from wildlab.reporting.text import escape, inline

STYLE = """.wall{display:grid;grid-template-columns:repeat(auto-fill,minmax(min(17.5rem,100%),1fr));
gap:1.1rem;
margin:1rem 0}
.card{position:relative;display:flex;flex-direction:column;border:1px solid var(--line);border-radius:.7rem;
overflow:hidden;background:var(--bg)}
.card:hover{border-color:var(--blue)}
.card .thumb{display:block;width:100%;aspect-ratio:16/10;object-fit:contain;background:var(--plate);
border-bottom:1px solid var(--line);padding:.35rem}
.card h3{margin:.75rem 1rem .2rem;font-size:1.05rem;line-height:1.25}
.card h3 a{color:inherit;text-decoration:none}.card h3 a::after{content:"";position:absolute;inset:0}
.card h3 a:focus-visible{outline:0}.card:focus-within{outline:2px solid var(--blue);outline-offset:2px}
.card p{margin:0 1rem .5rem;font-size:.94rem;line-height:1.42}
.card .strip{margin:auto .8rem 0}.card .strip .ticks{font-size:.72rem}
.card .verd{margin:.5rem 1rem 0;font-size:.88rem}
.card .verd .pill{font-weight:600;margin-right:.45rem}.card .tag-line{margin:.2rem 1rem .8rem;
color:var(--dim);
font-size:.82rem}
.card .rest a{position:relative;z-index:1}.card .rest{margin-top:auto;color:var(--dim);font-size:.88rem}
@media screen and (max-width:36rem){.card{display:grid;grid-template-columns:7.5rem minmax(0,1fr)}
.card>*{grid-column:1/-1}.card>.thumb{grid-column:1;height:100%;aspect-ratio:auto;min-height:5.5rem;
max-height:8rem;border:0}.card>.thumb+h3{grid-column:2;margin-left:.6rem}
.card p:first-of-type{margin-top:.3rem}}
@media print{.wall{display:block}.card{display:inline-flex;width:31.6%;margin:0 .6% 3mm;vertical-align:top;
break-inside:avoid}.card .thumb{padding:1mm}.card h3{font-size:9.5pt}.card p,.card .verd{font-size:8pt}
.card .tag-line,.card p.rest{font-size:7.5pt}.card .ticks .near{display:none}}"""


class Card(NamedTuple):
    """One card.

    Attributes
    ----------
    title, sentence
        Plain text; a sentence may be "".
    folder
        Of the report; "" where there is none to open.
    verdict
        HTML, in words.
    tag
        What it was run on.
    numbers
        Published ones that the strip shows.
    picture, alt
        A ``data:`` address and what it shows, or "".
    rest
        What is said where there is no strip, as HTML.
    """

    title: str
    sentence: str
    folder: str
    verdict: str
    tag: str
    numbers: Sequence[Number] = ()
    picture: str = ""
    alt: str = ""
    rest: str = ""


def study_card(one: StudyStatus, glimpse: Glimpse) -> Card:
    """The card of a study that was run, or tried."""
    study = one.study
    failed = one.state not in ("done", FIRST_LOOK)
    sentence = (one.reason or f"Run it again: `wildlab run {study.name}`") if failed else glimpse.sentence
    return Card(
        title=study.title,
        sentence=sentence,
        folder=study.name if one.has_report else "",
        verdict=_pill("failed" if one.state == "failed" else one.state, "no")
        if failed
        else _said(verdict_words(one)),
        tag=study_tag(one),
        numbers=() if failed else drawable(one.counted),
        picture="" if failed else glimpse.picture,
        alt=glimpse.alt,
        rest="" if failed else _without_strip(one),
    )


def _said(word: Standing) -> str:
    return f"{_pill(word.word, PILLS[word.level])}<span>{escape(word.reason)}</span>"


def _pill(words: str, kind: str) -> str:
    return f'<span class="pill {kind}">{escape(words)}</span>'


def study_tag(one: StudyStatus) -> str:
    """What a study was run on, in few words."""
    kind = one.study.kind
    if kind == "twin":
        return f"{one.seeds} simulated flights" if one.seeds and one.seeds > 1 else "simulated flight"
    return "logged flight" if kind == "logged" else TAGS["computed"]


def verdict_words(one: StudyStatus) -> Standing:
    """What a study's numbers and claims come to, as its report says it; a first look comes to nothing yet."""
    if one.state == FIRST_LOOK:
        return Standing("first look", f"{one.first_look}: not counted yet.", "warn")
    compared = [n.compared for n in one.counted if n.compared is not None]
    return standing(compared, (c.verdict for c in one.claims if not c.own))


def _without_strip(one: StudyStatus) -> str:
    if drawable(one.counted):
        return ""
    if not one.counted:
        return "No published number of it is compared."
    if all(n.compared and n.compared.reproduction == "not judged" for n in one.counted):
        return "Its published numbers are not judged."
    return "Its published numbers have no ratio: they are signed, or zero."


def flight_card(flight: OwnFlight, glimpse: Glimpse) -> Card:
    """The card of a flight that somebody evaluated."""
    first = flight.reports[0]
    return Card(
        title=flight.name,
        sentence=glimpse.sentence
        if first.state == "done"
        else f"Its {first.about} report {_state(first.state)}.",
        folder=first.folder,
        verdict=verdict_pill(flight),
        tag=TAGS.get(flight.kind, flight.kind),
        picture=glimpse.picture if first.state != "damaged" else "",
        alt=glimpse.alt,
        rest=_links(flight),
    )


def _links(flight: OwnFlight) -> str:
    """All of its reports, as HTML."""
    items = [
        f'<a href="{address(one.folder)}">{escape(one.about)}</a>'
        + ("" if one.state == "done" else f" ({escape(one.state)})")
        for one in flight.reports
    ]
    return f"Reports: {', '.join(items)}"


def _state(state: str) -> str:
    return {"failed": "did not finish", "damaged": "is not as it was written"}.get(state, "was broken off")


def card_html(card: Card) -> str:
    """A card as HTML; the whole of it opens the report."""
    title = escape(card.title)
    if card.folder:
        title = f'<a href="{address(card.folder)}">{title}</a>'
    parts = []
    if card.picture:
        alt = card.alt or f"The first picture of: {card.title}"
        parts.append(f'<img class="thumb" alt="{escape(alt)}" src="{card.picture}">')
    parts.append(f"<h3>{title}</h3>")
    if card.sentence:
        parts.append(f"<p>{inline(card.sentence)}</p>")
    if card.numbers:
        parts.append(
            f'<div class="strip">{plot(card.numbers, alt=_spoken(card.numbers))}{ticks(few=True)}</div>'
        )
    elif card.rest:
        parts.append(f'<p class="rest">{card.rest}</p>')
    parts.append(f'<p class="verd">{card.verdict}</p><p class="tag-line">{escape(card.tag)}</p>')
    return f'<article class="card">{"".join(parts)}</article>'


def _spoken(numbers: Sequence[Number]) -> str:
    ratios = sorted(one.ratio for one in numbers if one.ratio is not None)
    middle = ratios[len(ratios) // 2]
    if len(ratios) == 1:
        return f"One number, ours {middle:.2f} times the published one."
    return (
        f"{len(ratios)} numbers, ours over the published ones: from {ratios[0]:.2f} to {ratios[-1]:.2f}, "
        f"the middle one {middle:.2f}."
    )
