"""The partner edition: one flight on one A4 page, in plain words, for somebody who writes no programs."""

from __future__ import annotations

import math
from pathlib import Path
from typing import NamedTuple

import numpy as np
from markupsafe import Markup
from numpy.typing import NDArray

from wildlab.analysis.georeference import observe
from wildlab.analysis.overview import look_over
from wildlab.analysis.verdict import Verdict
from wildlab.errors import WildlabError
from wildlab.flight.store import Flight
from wildlab.geometry.georeference import georeference_pixels
from wildlab.messages.catalogue import (
    Day,
    Language,
    Message,
    Value,
    length,
    load_language,
    number,
    of_unflown,
    say,
)
from wildlab.messages.quantities import nice_length
from wildlab.reporting.page import POLICY
from wildlab.reporting.text import escape, mark_up, read_style, render
from wildlab.sharing.edition_story import Facts, tell

Array = NDArray[np.float64]

WIDTH, HEIGHT, MARGIN = 480.0, 360.0, 26.0
#: Room below for the bar that tells the scale.
FOOT = 46.0
#: More points of a line, and more dots, than can be told apart at this size.
MOST_POINTS, MOST_DOTS = 600, 400


class MapPicture(NamedTuple):
    """What is drawn as a map; (N, 2) metres north and east from anywhere, NaN where not known.

    Attributes
    ----------
    path
        The way of the aircraft, in the order of time.
    seen
        Where something was said to be.
    truth
        Where it really was.
    """

    path: Array
    seen: Array
    truth: Array


def map_of(flight: Flight) -> MapPicture | None:
    """Way, sightings and true places of a flight, as it is: generalise it before, where that is needed.

    Parameters
    ----------
    flight
        Whatever it lacks.

    Returns
    -------
    MapPicture or None
        None where there is nothing to put on it. Without poses there is no way of the aircraft on it.
    """
    overview = look_over(flight, None)
    path = overview.path
    flown = path is not None and path.who.startswith("nav/")
    way = path.place[:, :2] if flown and path is not None else np.empty((0, 2))
    found = MapPicture(way, _seen(flight, overview.source), _true(flight))
    return found if any(np.isfinite(one).any() for one in found) else None


def _seen(flight: Flight, source: str | None) -> Array:
    if source is None or flight.detections is None or flight.manifest.camera is None:
        return np.empty((0, 2))
    try:
        seen = observe(flight, source)
    except WildlabError:
        return np.empty((0, 2))
    return georeference_pixels(seen.poses, seen.uv, seen.plane_down)[:, :2]


def _true(flight: Flight) -> Array:
    if flight.truth is None:
        return np.empty((0, 2))
    return flight.truth[["north_m", "east_m"]].to_numpy(float)


def _known_points(points: Array) -> Array:
    points = np.asarray(points, float).reshape(-1, 2)
    return points[np.isfinite(points).all(axis=1)]


def picture_html(picture: MapPicture | None, language: Language) -> str:
    """A ``<figure>`` with the map and its caption, or nothing where there is nothing to draw."""
    if picture is None or len(_known_points(picture.path)) + len(_known_points(picture.seen)) < 2:
        return ""
    seen, truth = _known_points(picture.seen), _known_points(picture.truth)
    path = np.asarray(picture.path, float).reshape(-1, 2)
    # No point that is kilometres off, of whatever it is, shrinks the rest; nor does one who walked elsewhere.
    near = np.concatenate([_usual(one) for one in (_known_points(path), seen) if len(one)])
    low, high = near.min(axis=0), near.max(axis=0)
    size = np.maximum(high - low, 5.0)
    room = np.array([HEIGHT - FOOT - 2 * MARGIN, WIDTH - 2 * MARGIN])
    scale = float((room / size).min())
    middle = (low + high) / 2

    def place(points: Array) -> Array:
        offset = (points - middle) * scale
        return np.stack([WIDTH / 2 + offset[:, 1], (HEIGHT - FOOT) / 2 - offset[:, 0]], axis=1)

    drawn = [f'<rect class="ground" width="{WIDTH:g}" height="{HEIGHT - FOOT:g}" rx="10"/>']
    # An inner picture cuts off what is outside of it.
    way = f'<path class="way" d="{_line(place(path))}"/>'
    drawn.append(f'<svg width="{WIDTH:g}" height="{HEIGHT - FOOT:g}">{way}</svg>')
    true = _dots(place(truth), "true", 3.0)
    drawn += [_dots(place(seen), "seen", 4.2), true]
    begin = _known_points(path)
    if len(begin):
        x, y = place(begin[:1])[0]
        drawn.append(f'<circle class="start" cx="{x:.1f}" cy="{y:.1f}" r="5.5"/>')
    drawn.append(_north())
    drawn.append(_bar(scale, language))
    wide = length(float(size[1]))
    alt = say(
        language,
        Message("picture.map_alt", {"way": wide, "seen": number(len(seen))})
        if len(seen)
        else Message("picture.map_alt_way", {"way": wide}),
    )
    keys = [("way", "path"), ("start", "start")] * bool(len(begin)) + [("seen", "seen")] * bool(len(seen))
    keys += [("true", "truth")] * bool(true)
    legend = "".join(
        f'<li><i class="{name}"></i>{escape(say(language, Message(f"picture.{key}")))}</li>'
        for name, key in keys
    )
    caption = f'<ul class="legend">{legend}</ul>{escape(say(language, Message("picture.map")))}'
    return (
        f'<figure><svg viewBox="0 0 {WIDTH:g} {HEIGHT:g}" role="img" aria-label="{escape(alt)}">'
        f"<title>{escape(alt)}</title>{''.join(drawn)}</svg><figcaption>{caption}</figcaption></figure>"
    )


def _usual(points: Array) -> Array:
    """Points without the few that lie far beyond all others."""
    low, high = np.quantile(points, [0.02, 0.98], axis=0)
    room = np.maximum(high - low, 1.0)
    inside = ((points >= low - room) & (points <= high + room)).all(axis=1)
    return np.asarray(points[inside])


def _line(points: Array) -> str:
    parts, pen = [], "M"
    for x, y in _thinned(points, MOST_POINTS):
        if not (math.isfinite(x) and math.isfinite(y)):
            pen = "M"
            continue
        parts.append(f"{pen}{x:.1f} {y:.1f}")
        pen = "L"
    return "".join(parts)


def _thinned(points: Array, most: int) -> Array:
    return points[:: max(1, -(-len(points) // most))]


def _dots(points: Array, name: str, radius: float) -> str:
    inside = points[((points > 4) & (points < [WIDTH - 4, HEIGHT - FOOT - 4])).all(axis=1)]
    return "".join(
        f'<circle class="{name}" cx="{x:.1f}" cy="{y:.1f}" r="{radius:g}"/>'
        for x, y in _thinned(inside, MOST_DOTS)
    )


def _north() -> str:
    x = WIDTH - 24
    return f'<path class="north" d="M{x:g} 14l8 24l-8 -6l-8 6z"/><text class="mid" x="{x:g}" y="55">N</text>'


def _bar(scale: float, language: Language) -> str:
    """A bar of a round length; ``scale`` is drawn units for a metre."""
    metres = nice_length(0.42 * WIDTH / scale)
    x, y, wide = MARGIN, HEIGHT - 24.0, metres * scale
    return (
        f'<path class="scale" d="M{x:g} {y - 6:g}v12M{x:g} {y:g}h{wide:.1f}M{x + wide:.1f} {y - 6:g}v12"/>'
        f'<text x="{x + wide + 10:.1f}" y="{y + 5:g}">{escape(say(language, length(metres)))}</text>'
    )


#: Signs of the verdicts, so that their colour is not all that tells them: a tick, a mark, a cross, a dash.
SIGNS = {"good": "✓", "warn": "!", "bad": "✕", "neutral": "–"}


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
        From `wildlab.sharing.edition_story.facts_of`.
    name
        What the flight is called on the page.
    place
        How exactly places are shown.
    day
        When it was flown; None where that is not to be said.
    picture
        A map from points.
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

    def shown(one: Value) -> Markup:
        return mark_up(say(words, one))

    drawn = picture_html(picture, words)
    # What a step is taken as stands where steps are.
    values = [value for one in story.measured for value in one.values.values() if isinstance(value, Message)]
    steps = any(value.key.startswith("steps.") for value in values)
    return (
        render(
            "edition",
            language=words.code,
            policy=POLICY,
            style=Markup(read_style("edition")),  # noqa: S704 - ours
            say=lambda key: shown(Message(key)),
            shown=shown,
            title=say(words, Message("page.title", {"name": name})),
            name=name,
            day=day,
            twin=facts.twin,
            level=Verdict(facts.verdict or Verdict.UNJUDGED).colour,
            signs=SIGNS,
            story=story,
            drawn=Markup(drawn),  # noqa: S704 - HTML
            sections=[
                ("tell", "trusted" if story.trusted else "measured", story.measured),
                ("tell", "wrong", story.wrong),
                ("do", "advice", story.advice or (Message("next.nothing"),)),
                ("tell", "unknown", story.unknown),
            ],
            place=shown(_place(place, words)),
            steps=steps,
            untranslated=Message("page.untranslated", {}, len(words.missing)) if words.missing else "",
        )
        + "\n"
    )


def _place(place: Place, words: Language) -> Message:
    if place.middle_deg is None:
        return Message("place.withheld")
    latitude, longitude = place.middle_deg
    values: dict[str, Value] = {
        "latitude": _side(latitude, "north", "south", words),
        "longitude": _side(longitude, "east", "west", words),
        "uncertainty": length(place.uncertainty_m),
    }
    return Message("place.generalised", values)


def _side(value: float, positive: str, negative: str, words: Language) -> Message:
    """A coordinate with the letter of its side: all its digits, since these say how coarse it is."""
    digits = f"{abs(value):.6f}".rstrip("0").rstrip(".").replace(".", str(words.texts["format.decimal"]))
    return Message(f"format.{positive if value >= 0 else negative}", {"degrees": digits})
