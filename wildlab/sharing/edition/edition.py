"""The page for partners: one A4 sheet in plain words about one flight, and what it means for the next."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import NamedTuple

from wildlab.analysis.overviews.verdict import Verdict
from wildlab.messages.catalogue import Language, load_language, of_unflown, say
from wildlab.messages.message import Day, Message, Value, length
from wildlab.reporting.page import POLICY
from wildlab.reporting.text import escape, inline
from wildlab.sharing.edition.facts import Facts
from wildlab.sharing.edition.picture import IN_STEPS, MapPicture, picture_html
from wildlab.sharing.edition.sentences import Story, tell

#: Signs of the verdicts, so that their colour is not all that tells them: a tick, a mark, a cross, a dash.
SIGNS = {"good": "✓", "warn": "!", "bad": "✕", "neutral": "–"}

_Say = Callable[[Value], str]

#: On paper one A4 sheet, on a phone one column, bright and dark.
STYLE = """:root { --ink: #18222d; --dim: #4f5b68; --line: #d5dbe1; --back: #fff;
  --ground: #e9f1ef; --way: #55626f; --seen: #b04a00; --true: #18222d; --blue: #00609b;
  --good: #0b6b43; --warn: #8f4d00; --bad: #a3201a; --neutral: #4f5b68; --on: #fff }
* { box-sizing: border-box }
html { -webkit-text-size-adjust: 100%; text-size-adjust: 100%; background: var(--back) }
body { margin: 0 auto; max-width: 60rem; padding: 1.6rem 1.4rem 2rem; color: var(--ink);
  background: var(--back);
  font: 17px/1.5 system-ui, -apple-system, "Segoe UI", Roboto, "Noto Sans", "DejaVu Sans", sans-serif;
  overflow-wrap: break-word }
h1 { font-size: 1.9rem; line-height: 1.15; letter-spacing: -.012em; margin: .1rem 0 1rem; text-wrap: balance }
h2 { font-size: 1.06rem; line-height: 1.25; margin: 0 0 .35rem }
p, ul, ol, figure { margin: 0; padding: 0 }
.kicker { color: var(--dim); font-size: .9rem }
.twin { border: 2px dashed var(--warn); border-radius: .5rem; padding: .4rem .8rem; margin: 0 0 .9rem;
  font-weight: 600 }
.verdict { display: grid; grid-template-columns: auto 1fr; gap: .1rem 1rem; align-items: center;
  border-radius: .7rem; padding: .95rem 1.2rem; color: var(--on); background: var(--level) }
.sign { grid-row: 1 / span 3; width: 3rem; height: 3rem; border: 3px solid var(--on); border-radius: 50%;
  font-size: 1.7rem; line-height: 2.65rem; text-align: center; font-weight: 700 }
.word { font-size: 1.5rem; line-height: 1.2; font-weight: 700 }
.verdict .next { font-weight: 600 }
.good { --level: var(--good) } .warn { --level: var(--warn) }
.bad { --level: var(--bad) } .neutral { --level: var(--neutral) }
.top { display: grid; grid-template-columns: minmax(0, 1.75fr) minmax(0, 1fr); gap: 1.4rem; margin: 1.2rem 0 }
.top.alone { grid-template-columns: 1fr }
.tiles { list-style: none; display: flex; flex-direction: column; gap: .7rem }
.alone .tiles { flex-flow: row wrap } .alone .tiles li { flex: 1 1 10rem }
.tiles li { border-left: 4px solid var(--line); padding: .1rem 0 .1rem .8rem }
.tiles b { display: block; font-size: 1.6rem; line-height: 1.2; font-variant-numeric: tabular-nums }
.tiles span { display: block; color: var(--dim); font-size: .92rem; line-height: 1.35 }
figure svg, figure img { display: block; width: 100%; height: auto }
figure img { border-radius: .5rem }
figcaption { color: var(--dim); font-size: .88rem; line-height: 1.4; margin-top: .35rem }
.legend { list-style: none; display: flex; flex-wrap: wrap; gap: .1rem 1.1rem; color: var(--ink) }
.legend i { display: inline-block; width: .75rem; height: .75rem; border-radius: 50%; margin-right: .4rem;
  vertical-align: -1px }
.legend .way { height: .25rem; width: 1.3rem; border-radius: 1px; background: var(--way);
  vertical-align: 3px }
.legend .start { border: 2px solid var(--way) }
.legend .median, .legend .about { border: 2px solid var(--blue) }
.legend .p90 { border: 2px dashed var(--blue) }
.legend .seen { background: var(--seen) } .legend .true { background: var(--true) }
svg text { font: 600 17px system-ui, -apple-system, "Segoe UI", Roboto, "DejaVu Sans", sans-serif;
  fill: var(--ink) }
svg .mid { text-anchor: middle }
svg .ground { fill: var(--ground) } svg .way { fill: none; stroke: var(--way); stroke-width: 2.2;
  stroke-linejoin: round }
svg .seen { fill: var(--seen); fill-opacity: .75 } svg .true { fill: var(--true); stroke: var(--ground);
  stroke-width: .8 }
svg .start { fill: var(--back); stroke: var(--way); stroke-width: 2.5 }
svg .scale, svg .cross { fill: none; stroke: var(--ink); stroke-width: 2.5 }
svg .lead { stroke: var(--dim); stroke-width: 1.2; stroke-dasharray: 3 3 }
svg .north { fill: var(--ink) }
svg .ring { stroke: var(--blue); stroke-width: 2.5; fill: var(--blue); fill-opacity: .16 }
svg .p90 { stroke-dasharray: 8 5; fill-opacity: .08 }
svg .whole { fill: none; stroke: var(--blue); stroke-width: 2.5 } svg .part { fill: var(--blue) }
.parts { display: grid; grid-template-columns: 1fr 1fr; gap: 1.1rem 1.6rem }
section { border-top: 3px solid var(--line); padding-top: .6rem }
section.do { border-color: var(--blue) }
section ul, section ol { padding-left: 1.3rem }
section li { margin: .3rem 0 }
.more { color: var(--dim); font-size: .92rem; padding-left: 1.3rem }
.place { border-top: 3px solid var(--line); margin-top: 1.1rem; padding-top: .6rem }
footer { margin-top: 1rem; color: var(--dim); font-size: .84rem }
@media screen and (prefers-color-scheme: dark) {
  :root { --ink: #e8edf2; --dim: #aab5c0; --line: #3a4651; --back: #12181f;
    --ground: #1c2a2b; --way: #97a6b4; --seen: #ffa257; --true: #f2f5f8; --blue: #62b8ea;
    --good: #7fd6a8; --warn: #f2b063; --bad: #ff9d94; --neutral: #b4bfca; --on: #12181f }
}
@media screen and (max-width: 44rem) {
  body { padding: 1rem .9rem 1.6rem; font-size: 16px }
  h1 { font-size: 1.5rem; margin-bottom: .8rem }
  .verdict { padding: .8rem .9rem; gap: .1rem .8rem }
  .sign { width: 2.4rem; height: 2.4rem; line-height: 2.1rem; font-size: 1.35rem; align-self: start }
  .word { font-size: 1.25rem }
  .top, .parts { grid-template-columns: 1fr; gap: 1rem }
  .tiles { display: grid; grid-template-columns: 1fr 1fr; gap: .7rem .9rem }
  .tiles b { font-size: 1.35rem }
}
@page { size: A4; margin: 10mm 13mm }
@media print {
  html { font-size: 9pt }
  body { max-width: none; padding: 0; font-size: 1rem; line-height: 1.3 }
  h1 { font-size: 1.7rem; margin-bottom: 2.5mm }
  .verdict, .legend i, svg { print-color-adjust: exact; -webkit-print-color-adjust: exact }
  .verdict { padding: 2.6mm 4mm }
  .top { margin: 3mm 0; gap: 6mm }
  .top:not(.alone) { grid-template-columns: 86mm 1fr }
  figure svg, figure img { max-height: 64.5mm; width: auto; max-width: 100% }
  .parts { gap: 2.5mm 6mm }
  section { padding-top: 1.2mm }
  section li { margin: .6mm 0 }
  .tiles { gap: 2.2mm }
  section, .verdict, figure { break-inside: avoid }
  .twin { margin-bottom: 2mm; padding: 1mm 3mm }
  .place { margin-top: 2.5mm; padding-top: 1.2mm }
  footer { margin-top: 1.5mm }
}"""


class Place(NamedTuple):
    """What is told of a place: that it is withheld, or a generalised one.

    Attributes
    ----------
    uncertainty_m
        How far off it may be shown, m.
    middle_deg
        Latitude and longitude of the point that is told; None where it is withheld.
    """

    uncertainty_m: float = 0.0
    middle_deg: tuple[float, float] | None = None


def edition_html(
    facts: Facts,
    *,
    name: str,
    place: Place,
    day: Day | None = None,
    picture: MapPicture | None = None,
    language: str | Path | Language = "en",
) -> str:
    """The page.

    Parameters
    ----------
    facts
        From `wildlab.sharing.edition.facts.facts_of`.
    name
        What the flight is called on the page.
    place
        How exactly places are shown.
    day
        When it was flown; None where that is not to be said.
    picture
        A map from points; None for a drawing of the numbers.
    language
        A code, the path of a file of texts, or texts that were loaded.

    Returns
    -------
    str
        HTML that asks nobody for anything and runs nothing.

    Raises
    ------
    WildlabError
        If the language cannot be used.
    """
    words = language if isinstance(language, Language) else load_language(language)
    words = words if facts.flown else of_unflown(words)
    story = tell(facts)
    level = Verdict(facts.verdict or Verdict.UNJUDGED).colour

    def said(one: Value) -> str:
        return inline(say(words, one))

    kicker = [said(Message("page.kicker")), escape(name), *([said(day)] if day is not None else [])]
    drawn = picture_html(picture, facts, words)
    # What a step is taken as is said where steps are.
    told = [value for one in story.measured for value in one.values.values() if isinstance(value, Message)]
    steps = IN_STEPS in drawn or any(value.key.startswith("steps.") for value in told)
    footer = f"{said(Message('page.footer'))} {said(Message('page.footer_steps')) if steps else ''}"
    body = [
        f'<header><p class="kicker">{" · ".join(kicker)}</p>',
        f"<h1>{said(Message('page.question'))}</h1></header>",
        "<main>",
        f'<p class="twin">{said(Message("page.twin"))}</p>' if facts.twin else "",
        f'<div class="verdict {level}"><span class="sign" aria-hidden="true">{SIGNS[level]}</span>',
        f'<p class="word">{said(story.verdict)}</p><p>{said(story.why)}</p>',
        f'<p class="next">{said(Message("page.next"))}: {said(story.next)}</p></div>',
        f'<div class="top{"" if drawn else " alone"}">{drawn}{_tiles(story, said)}</div>',
        '<div class="parts">',
        _section(said, "heading.trusted" if story.trusted else "heading.measured", story.measured),
        _section(said, "heading.wrong", story.wrong),
        _section(said, "heading.advice", story.advice or (Message("next.nothing"),), ranked=True),
        _section(said, "heading.unknown", story.unknown),
        "</div>",
        f'<p class="place">{_place(place, words, said)}</p>',
        "</main>",
        f"<footer><p>{footer} {_untranslated(words, said)}</p></footer>",
    ]
    title = escape(say(words, Message("page.title", {"name": name})))
    return (
        f'<!doctype html>\n<html lang="{escape(words.code)}">\n<head>\n<meta charset="utf-8">\n'
        '<meta name="viewport" content="width=device-width, initial-scale=1">\n'
        '<meta name="color-scheme" content="light dark">\n'
        f'<meta http-equiv="Content-Security-Policy" content="{POLICY}">\n'
        '<meta name="referrer" content="no-referrer">\n'
        f"<title>{title}</title>\n<style>\n{STYLE}\n</style>\n</head>\n<body>\n"
        + "\n".join(part for part in body if part)
        + "\n</body>\n</html>\n"
    )


def _tiles(story: Story, said: _Say) -> str:
    if not story.tiles:
        return ""
    items = "".join(
        f"<li><b>{said(value)}</b><span>{said(label)}</span></li>" for value, label in story.tiles
    )
    return f'<ul class="tiles">{items}</ul>'


def _section(said: _Say, heading: str, items: Sequence[Message], *, ranked: bool = False) -> str:
    more = [one for one in items if one.key == "page.more"]
    kept = [one for one in items if one.key != "page.more"]
    tag = "ol" if ranked and len(kept) > 1 else "ul"
    listed = "".join(f"<li>{said(one)}</li>" for one in kept)
    below = "".join(f'<p class="more">{said(one)}</p>' for one in more)
    name = "do" if ranked else "tell"
    return (
        f'<section class="{name}"><h2>{said(Message(heading))}</h2><{tag}>{listed}</{tag}>{below}</section>'
    )


def _place(place: Place, words: Language, said: _Say) -> str:
    if place.middle_deg is None:
        return said(Message("place.withheld"))
    latitude, longitude = place.middle_deg
    values: dict[str, Value] = {
        "latitude": _side(latitude, "north", "south", words),
        "longitude": _side(longitude, "east", "west", words),
        "uncertainty": length(place.uncertainty_m),
    }
    return said(Message("place.generalised", values))


def _side(value: float, positive: str, negative: str, words: Language) -> Message:
    """A coordinate with the letter of its side: all its digits, since these say how coarse it is."""
    digits = f"{abs(value):.6f}".rstrip("0").rstrip(".").replace(".", str(words.texts["format.decimal"]))
    return Message(f"format.{positive if value >= 0 else negative}", {"degrees": digits})


def _untranslated(words: Language, said: _Say) -> str:
    return said(Message("page.untranslated", {}, len(words.missing))) if words.missing else ""
