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
from wildlab.reporting.text import POLICY, mark_up, read_style, render
from wildlab.sharing.edition_story import Facts, tell
from wildlab.sharing.tiers import Cell

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
    seen, begin = _known_points(picture.seen), _known_points(picture.path)[:1]
    # No point that is kilometres off, of whatever it is, shrinks the rest; nor does one who walked elsewhere.
    near = np.concatenate([_usual(one) for one in (_known_points(picture.path), seen) if len(one)])
    low, high = near.min(axis=0), near.max(axis=0)
    size = np.maximum(high - low, 5.0)
    scale = float((np.array([HEIGHT - FOOT - 2 * MARGIN, WIDTH - 2 * MARGIN]) / size).min())

    def place(points: Array) -> Array:
        offset = (np.asarray(points, float).reshape(-1, 2) - (low + high) / 2) * scale
        return np.stack([WIDTH / 2 + offset[:, 1], (HEIGHT - FOOT) / 2 - offset[:, 0]], axis=1)

    dots = {"seen": (_dots(place(seen)), 4.2), "true": (_dots(place(_known_points(picture.truth))), 3.0)}
    keys = [("way", "path"), ("start", "start")] * bool(len(begin)) + [("seen", "seen")] * bool(len(seen))
    keys += [("true", "truth")] * bool(len(dots["true"][0]))
    values: dict[str, Value] = {"way": length(float(size[1]))}
    if len(seen):
        values["seen"] = number(len(seen))
    bar = nice_length(0.42 * WIDTH / scale)
    return render(
        "edition-map",
        size=(WIDTH, HEIGHT, HEIGHT - FOOT),
        alt=say(language, Message("picture.map_alt" if len(seen) else "picture.map_alt_way", values)),
        way=_line(place(picture.path)),
        dots=dots,
        start=place(begin),
        bar=(MARGIN, HEIGHT - 24.0, bar * scale, say(language, length(bar))),
        legend=[(name, say(language, Message(f"picture.{key}"))) for name, key in keys],
        caption=say(language, Message("picture.map")),
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
        known = math.isfinite(x) and math.isfinite(y)
        parts.append(f"{pen}{x:.1f} {y:.1f}" if known else "")
        pen = "L" if known else "M"
    return "".join(parts)


def _thinned(points: Array, most: int) -> Array:
    return points[:: max(1, -(-len(points) // most))]


def _dots(points: Array) -> Array:
    """Points inside of the picture, no more than can be told apart."""
    inside = ((points > 4) & (points < [WIDTH - 4, HEIGHT - FOOT - 4])).all(axis=1)
    return _thinned(points[inside], MOST_DOTS)


#: Signs of the verdicts, so that their colour is not all that tells them: a tick, a mark, a cross, a dash.
SIGNS = {"good": "✓", "warn": "!", "bad": "✕", "neutral": "–"}


def edition_html(
    facts: Facts,
    *,
    name: str,
    place: Cell | None,
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
        The cell that is told; None where it is withheld.
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


def _place(cell: Cell | None, words: Language) -> Message:
    if cell is None:
        return Message("place.withheld")
    values: dict[str, Value] = {
        "latitude": _side(cell.latitude_deg, "north", "south", words),
        "longitude": _side(cell.longitude_deg, "east", "west", words),
        "uncertainty": length(cell.uncertainty_m),
    }
    return Message("place.generalised", values)


def _side(value: float, positive: str, negative: str, words: Language) -> Message:
    """A coordinate with the letter of its side: all its digits, since these say how coarse it is."""
    digits = f"{abs(value):.6f}".rstrip("0").rstrip(".").replace(".", str(words.texts["format.decimal"]))
    return Message(f"format.{positive if value >= 0 else negative}", {"degrees": digits})
