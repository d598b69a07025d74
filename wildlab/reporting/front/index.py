"""``reports/index.html``: what this is, a flight that moves, where to go, every study, every number."""

from __future__ import annotations

from collections.abc import Sequence
from datetime import UTC, datetime
from typing import NamedTuple

from wildlab.reporting.animation import animated_flight, pausable
from wildlab.reporting.animation.drawing import PAUSE_STYLE
from wildlab.reporting.front import cards, numbers, ratios
from wildlab.reporting.front.cards import Card, card_html
from wildlab.reporting.front.flight import PROBABILITY, FrontFlight
from wildlab.reporting.front.numbers import LEDGER, numbers_section
from wildlab.reporting.own_flights import BEGIN
from wildlab.reporting.own_flights import PAGE as FLIGHTS
from wildlab.reporting.page import page
from wildlab.reporting.status import FIRST_LOOK, StudyStatus
from wildlab.reporting.text import escape, inline, percent

#: The page beside it that says how to share.
PARTNERS = "partners.html"
#: Cards of own flights at most, the newest first, and bytes that all small pictures may take.
MOST_FLIGHTS, MOST_PICTURES = 12, 1_200_000
#: Bytes that the moving picture may take.
MOST_MOVING = 300_000

STYLE = f"""body{{max-width:68rem}}
.top{{display:grid;grid-template-columns:minmax(0,5fr) minmax(0,6fr);gap:2rem;align-items:center}}
.top h1{{font-size:2.15rem;margin-top:.2rem}}.lead{{font-size:1.1rem}}.top figure{{margin:0}}
.doors{{display:grid;grid-template-columns:3fr 3fr 3fr 2fr;gap:.8rem;margin:1.8rem 0 0;padding:0;
list-style:none;
max-width:none}}
.doors li{{margin:0}}.doors a{{display:block;height:100%;border:1px solid var(--line);border-radius:.7rem;
padding:.85rem 1rem;text-decoration:none;color:var(--ink);background:var(--soft)}}
.doors a:hover{{border-color:var(--blue)}}.doors b{{display:block;font-size:1.1rem}}
.doors span{{display:block;color:var(--dim);font-size:.88rem;line-height:1.35}}
.doors .small{{background:none}}.doors .small b{{font-size:1rem}}
.empty{{border:1px dashed var(--line);border-radius:.7rem;padding:.9rem 1.1rem;max-width:none}}
{ratios.STYLE}
{cards.STYLE}
{numbers.STYLE}
{PAUSE_STYLE}
@media(max-width:46rem){{.top{{grid-template-columns:minmax(0,1fr);gap:1rem}}.top h1{{font-size:1.65rem}}
.doors{{grid-template-columns:1fr 1fr}}}}
@media print{{.top{{grid-template-columns:1fr 1fr}}.doors a{{break-inside:avoid}}
.doors{{grid-template-columns:repeat(4,1fr)}}}}"""


class Learn(NamedTuple):
    """Something to learn from: its title, and its address, "" where its page is not there yet."""

    title: str
    address: str


def front_page(
    studies: Sequence[StudyStatus],
    flight: FrontFlight,
    *,
    study_cards: Sequence[Card] = (),
    flight_cards: Sequence[Card] = (),
    flights: int = 0,
    cases: int = 0,
    learn: Sequence[Learn] = (),
    again: str = "",
    code: str = "",
) -> str:
    """The whole page.

    Parameters
    ----------
    studies
        All of them, run or not.
    flight
        What moves beside the heading.
    study_cards, flight_cards
        Of studies that were run or tried; of own flights, the newest first.
    flights
        How many own flights there are.
    cases
        How many cases the theses have; 0 where that is not known.
    learn
        Tutorials and reference, whether their pages are there or not.
    again
        How pages to learn from are made, as text with code marks.
    code
        Which code it was put together by, as HTML.
    """
    body = [
        _top(flight),
        _doors(studies, flights, cases, learn),
        _flights(flight_cards, flights),
        _theses(studies, _affordable(study_cards, flight_cards)),
        numbers_section(studies),
        _learn(learn, again),
    ]
    made = datetime.now(UTC).strftime("%Y-%m-%d %H:%M UTC") + (f", {code}" if code else "")
    footer = (
        f"<p>Put together {made}, on this computer. No part of this page asks the network for anything.</p>"
    )
    return page(title="wildlab", body="\n".join(body), kicker="wildlab", footer=footer, style=STYLE)


def flight_words(flight: FrontFlight) -> str:
    """What the moving picture shows, from its own arrays."""
    return (
        f"A simulated flight, {flight.height:.0f} m up, {flight.seconds:.0f} s of it. Each dot is "
        f"where one image "
        f"puts the vessel: {flight.off:.0f} m off in the middle case of {flight.images}. The blue "
        f"ellipse should "
        f"hold the vessel, a cross, {percent(PROBABILITY, 0)} of the time; here it does "
        f"{percent(flight.held, 0)}."
    )


def _top(flight: FrontFlight) -> str:
    alt = (
        f"Map of a simulated flight. An aircraft flies for {flight.seconds:.0f} seconds at "
        f"{flight.height:.0f} metres over a vessel. "
        "The outline of its camera's image sweeps over the water; where the vessel is seen, a dot "
        "lands on the map; "
        "an ellipse around the estimate is as large as the filter takes its error to be. A cross "
        "shows where the "
        "vessel truly is."
    )
    drawn = pausable(animated_flight(flight.shown, alt=alt, probability=PROBABILITY, most_bytes=MOST_MOVING))
    return (
        '<header class="top"><div><h1>Seen from the air: where is it, and how far off may that be?</h1>'
        '<p class="lead">A small aircraft films boats or animals from the air. wildlab works out '
        "where they were, "
        "says how far off that may be, and checks itself against flights where the answer is known.</p></div>"
        f"<figure>{drawn}<figcaption>{escape(flight_words(flight))}</figcaption></figure></header>"
    )


def _doors(studies: Sequence[StudyStatus], flights: int, cases: int, learn: Sequence[Learn]) -> str:
    done = sum(one.state == "done" for one in studies)
    looks = sum(one.state == FIRST_LOOK for one in studies)
    theses = f"{len(studies)} studies" + (f", for {cases} cases of two theses" if cases else "")
    ran = [f"{done} done"] if done or not looks else []
    ran += [f"{looks} at a first look"] if looks else []
    damaged = sum(one.state == "damaged" for one in studies)
    ran += [f"{damaged} damaged and not counted"] if damaged else []
    mine = f"{flights} flight{'s' * (flights > 1)} evaluated here" if flights else "none yet: how to begin"
    ready = sum(bool(one.address) for one in learn)
    pages = f"{ready} page{'s' * (ready != 1)} to read" if ready else "tutorials, the reference"
    items = [
        ("#theses", "The theses", f"{theses}; {', '.join(ran)}", ""),
        (FLIGHTS if flights else "#flights", "My flights", mine, ""),
        (PARTNERS, "For partners", "a copy of a report that is safe to send", ""),
        ("#learn", "Learn", pages, ' class="small"'),
    ]
    return (
        '<nav aria-label="Where to go"><ul class="doors">'
        + "".join(
            f'<li><a href="{address}"{small}><b>{title}</b><span>{escape(words)}</span></a></li>'
            for address, title, words, small in items
        )
        + "</ul></nav>"
    )


def _flights(shown: Sequence[Card], flights: int) -> str:
    if not shown:
        return f'<section><h2 id="flights">My flights</h2><p class="empty">{BEGIN}</p></section>'
    rest = flights - min(len(shown), MOST_FLIGHTS)
    more = f"All {flights} of them in a table" if rest > 0 else "The same in a table"
    return (
        f'<section><h2 id="flights">My flights</h2><div class="wall">'
        f"{''.join(card_html(one) for one in shown[:MOST_FLIGHTS])}</div>"
        f'<p><a href="{FLIGHTS}">{more}</a></p></section>'
    )


def _affordable(study_cards: Sequence[Card], flight_cards: Sequence[Card]) -> list[Card]:
    """The studies' cards, pictures left out once all of them would take too much."""
    left = MOST_PICTURES - sum(len(one.picture) for one in flight_cards[:MOST_FLIGHTS])
    kept = []
    for one in study_cards:
        left -= len(one.picture)
        kept.append(one if left >= 0 else one._replace(picture=""))
    return kept


def _theses(studies: Sequence[StudyStatus], shown: Sequence[Card]) -> str:
    waiting = [one for one in studies if one.state == "not run"]
    parts = ['<section><h2 id="theses">What the theses asked, and what came out here</h2>']
    if any(one.numbers for one in shown):
        parts.append(
            "<p>Each card opens a report. Its strip shows our numbers divided by the published ones: "
            f"the shaded middle is within a factor of {ratios.CLOSE:g}. "
            f'<a href="{LEDGER}#rule">What is close, and what within</a>.</p>'
        )
        parts.append(ratios.legend(n for one in shown for n in one.numbers))
    if shown:
        parts.append(f'<div class="wall">{"".join(card_html(one) for one in shown)}</div>')
    if waiting:
        items = "".join(
            f"<li>{escape(one.study.title)} {inline(_first(one) + f'`wildlab run {one.study.name}`')}</li>"
            for one in waiting
        )
        all_ = len(waiting) == len(studies)
        lead = "None was run yet. `make reports` runs all that need no download" if all_ else "Not run yet"
        parts.append(
            f'<details class="plain"{" open" * all_}><summary>{inline(lead)}: {len(waiting)}</summary>'
            f"<ul>{items}</ul></details>"
        )
    parts.append(f'<p><a href="{LEDGER}">Every number and claim in tables</a></p></section>')
    return "".join(parts)


def _first(one: StudyStatus) -> str:
    """What has to be done before a study can be run, with code marks."""
    return f"`wildlab fetch {one.study.dataset}`, then " if one.study.dataset else ""


def _learn(learn: Sequence[Learn], again: str) -> str:
    items = "".join(
        f'<li><a href="{escape(one.address)}">{escape(one.title)}</a></li>'
        if one.address
        else f'<li class="dim">{escape(one.title)}</li>'
        for one in learn
    )
    missing = f"<p>{inline(again)}</p>" if again and not all(one.address for one in learn) else ""
    return f'<section><h2 id="learn">Learn</h2>{f"<ul>{items}</ul>" if items else ""}{missing}</section>'
