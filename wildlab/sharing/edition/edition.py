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
from wildlab.sharing.edition.picture import IN_STEPS, ImagePicture, MapPicture, picture_html
from wildlab.sharing.edition.sentences import Story, tell
from wildlab.sharing.edition.style import STYLE

#: Signs of the verdicts, so that their colour is not all that tells them: a tick, a mark, a cross, a dash.
SIGNS = {"good": "✓", "warn": "!", "bad": "✕", "neutral": "–"}

_Say = Callable[[Value], str]


class Place(NamedTuple):
    """How exactly places are shown: ``withheld``, ``generalised`` or ``exact``.

    Attributes
    ----------
    kind
        One of these.
    uncertainty_m
        Of a generalised place, how far off it may be shown, m.
    note
        More on it, in any words; "" for nothing.
    middle_deg
        Latitude and longitude of the point that is told for a generalised place; without it no place is
        told, and the page says what it says of one that is withheld.
    """

    kind: str
    uncertainty_m: float = 0.0
    note: str = ""
    middle_deg: tuple[float, float] | None = None


def edition_html(
    facts: Facts,
    *,
    name: str,
    place: Place,
    day: Day | None = None,
    picture: MapPicture | ImagePicture | None = None,
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
        A map from points, or an image; None for a drawing of the numbers.
    language
        A code, the path of a file of texts, or texts that were loaded.

    Returns
    -------
    str
        HTML that asks nobody for anything and runs nothing.

    Raises
    ------
    WildlabError
        If the language or the picture cannot be used.
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
    note = f" {escape(place.note)}" if place.note else ""
    if place.kind != "generalised":
        return said(Message(f"place.{place.kind}")) + note
    if place.middle_deg is None:
        return said(Message("place.withheld")) + note
    latitude, longitude = place.middle_deg
    values: dict[str, Value] = {
        "latitude": _side(latitude, "north", "south", words),
        "longitude": _side(longitude, "east", "west", words),
        "uncertainty": length(place.uncertainty_m),
    }
    return said(Message("place.generalised", values)) + note


def _side(value: float, positive: str, negative: str, words: Language) -> Message:
    """A coordinate with the letter of its side: all its digits, since these say how coarse it is."""
    digits = f"{abs(value):.6f}".rstrip("0").rstrip(".").replace(".", str(words.texts["format.decimal"]))
    return Message(f"format.{positive if value >= 0 else negative}", {"degrees": digits})


def _untranslated(words: Language, said: _Say) -> str:
    return said(Message("page.untranslated", {}, len(words.missing))) if words.missing else ""
