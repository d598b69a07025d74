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
from wildlab.reporting.georeferencing import FEW
from wildlab.reporting.page import POLICY
from wildlab.reporting.text import escape, mark_up, read_style, render
from wildlab.sharing.edition_story import MEDIAN_DISTANCE, STEP_M, Facts, tell

Array = NDArray[np.float64]

WIDTH, HEIGHT, MARGIN = 480.0, 360.0, 26.0
#: Room below for the bar that tells the scale.
FOOT = 46.0
#: More points of a line, and more dots, than can be told apart at this size.
MOST_POINTS, MOST_DOTS = 600, 400
#: Marks a text of the drawing that counts in steps.
IN_STEPS = 'class="steps"'


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


def map_of(flight: Flight, source: str | None = None) -> MapPicture | None:
    """Way, sightings and true places of a flight, as it is: generalise it before, where that is needed.

    Parameters
    ----------
    flight
        Whatever it lacks.
    source
        Name of its poses; None for the best known ones.

    Returns
    -------
    MapPicture or None
        None where there is nothing to put on it. Without poses there is no way of the aircraft on it.
    """
    overview = look_over(flight, source)
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


def nice_length(most: float) -> float:
    """The largest of 1, 2, 5 times a power of ten that is not above ``most``.

    Parameters
    ----------
    most
        Above 0.

    Returns
    -------
    float
    """
    power = 10.0 ** math.floor(math.log10(most))
    return max(factor * power for factor in (1.0, 2.0, 5.0) if factor * power <= most * (1 + 1e-12))


def picture_html(picture: MapPicture | None, facts: Facts, language: Language) -> str:
    """The picture with its caption, or nothing where there is nothing to draw.

    Parameters
    ----------
    picture
        What to show; None for a drawing of the numbers.
    facts
        Of the flight.
    language
        From `wildlab.messages.catalogue.load_language`.

    Returns
    -------
    str
        A ``<figure>``.
    """
    if picture is not None and len(_known_points(picture.path)) + len(_known_points(picture.seen)) >= 2:
        return _map(picture, language)
    return _drawn(facts, language)


def _figure(drawing: str, caption: str) -> str:
    below = f"<figcaption>{caption}</figcaption>" if caption else ""
    return f"<figure>{drawing}{below}</figure>"


def _svg(content: str, alt: str) -> str:
    return (
        f'<svg viewBox="0 0 {WIDTH:g} {HEIGHT:g}" role="img" aria-label="{escape(alt)}">'
        f"<title>{escape(alt)}</title>{content}</svg>"
    )


def _known_points(points: Array) -> Array:
    points = np.asarray(points, float).reshape(-1, 2)
    return points[np.isfinite(points).all(axis=1)]


def _map(picture: MapPicture, language: Language) -> str:
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
    return _figure(_svg("".join(drawn), alt), caption)


def _usual(points: Array) -> Array:
    """Points without the few that lie far beyond all others."""
    low, high = np.quantile(points, [0.02, 0.98], axis=0)
    room = np.maximum(high - low, 1.0)
    inside = ((points >= low - room) & (points <= high + room)).all(axis=1)
    return np.asarray(points[inside])


def _line(points: Array) -> str:
    keep = points[np.unique(np.linspace(0, len(points) - 1, min(len(points), MOST_POINTS)).astype(int))]
    parts, pen = [], "M"
    for x, y in keep:
        if not (math.isfinite(x) and math.isfinite(y)):
            pen = "M"
            continue
        parts.append(f"{pen}{x:.1f} {y:.1f}")
        pen = "L"
    return "".join(parts)


def _dots(points: Array, name: str, radius: float) -> str:
    inside = points[((points > 4) & (points < [WIDTH - 4, HEIGHT - FOOT - 4])).all(axis=1)]
    keep = (
        inside[np.unique(np.linspace(0, len(inside) - 1, min(len(inside), MOST_DOTS)).astype(int))]
        if len(inside)
        else inside
    )
    return "".join(f'<circle class="{name}" cx="{x:.1f}" cy="{y:.1f}" r="{radius:g}"/>' for x, y in keep)


def _north() -> str:
    x = WIDTH - 24
    return f'<path class="north" d="M{x:g} 14l8 24l-8 -6l-8 6z"/><text class="mid" x="{x:g}" y="55">N</text>'


def _bar(scale: float, language: Language, steps: bool = False) -> str:
    """A bar of a round length; ``scale`` is drawn units for a metre."""
    metres = nice_length(0.42 * WIDTH / scale)
    x, y, wide = MARGIN, HEIGHT - 24.0, metres * scale
    said = say(language, length(metres))
    count = round(metres / STEP_M)
    shows = ""
    if steps and 1 <= count <= 200:
        said += f" ({say(language, Message('steps.some', {}, count))})"
        shows = f" {IN_STEPS}"
    return (
        f'<path class="scale" d="M{x:g} {y - 6:g}v12M{x:g} {y:g}h{wide:.1f}M{x + wide:.1f} {y - 6:g}v12"/>'
        f'<text{shows} x="{x + wide + 10:.1f}" y="{y + 5:g}">{escape(said)}</text>'
    )


def _drawn(facts: Facts, language: Language) -> str:
    """Circles of how far off things are, by the best that is known; else the sightings with a place."""
    if facts.compared >= FEW and facts.error_p90 > 0:
        words = {"median": length(facts.error_median), "p90": length(facts.error_p90)}
        alt, caption = Message("picture.errors_alt", words), Message("picture.errors")
        return _circles([(facts.error_median, "median"), (facts.error_p90, "p90")], alt, caption, language)
    if facts.tracks and facts.track_error > 0:
        alt = Message("picture.track_alt", {"error": length(facts.track_error)})
        return _circles([(facts.track_error, "about")], alt, Message("picture.track"), language)
    if facts.scatter > 0:
        radius = MEDIAN_DISTANCE * facts.scatter
        alt = Message("picture.scatter_alt", {"apart": length(radius)})
        return _circles([(radius, "about")], alt, Message("picture.scatter"), language)
    if facts.seen > 0 and math.isfinite(facts.placed):
        return _share(facts, language)
    return ""


def _circles(rings: list[tuple[float, str]], alt: Message, caption: Message, language: Language) -> str:
    biggest = max(radius for radius, _ in rings)
    scale = ((HEIGHT - FOOT) / 2 - 14) / biggest
    x, y = 0.36 * WIDTH, (HEIGHT - FOOT) / 2
    drawn = [f'<rect class="ground" width="{WIDTH:g}" height="{HEIGHT - FOOT:g}" rx="10"/>']
    last, legend = math.inf, ""
    for radius, key in sorted(rings, reverse=True):
        r = radius * scale
        drawn.append(f'<circle class="ring {key}" cx="{x:g}" cy="{y:g}" r="{r:.1f}"/>')
        # A label beside the upper right of its circle; two of them never on one line.
        at = min(y - 0.82 * r, last if last == math.inf else 1e9)
        at = max(at, 26.0) if last == math.inf else max(at, last + 26.0)
        last = at
        edge = x + math.sqrt(max(0.0, r * r - min(r, abs(y - at)) ** 2))
        said = escape(say(language, length(radius)))
        legend += f'<li><i class="{key}"></i>{escape(say(language, Message(f"picture.{key}")))}</li>'
        drawn.append(f'<path class="lead" d="M{edge:.1f} {at:.1f}H{0.69 * WIDTH:.1f}"/>')
        drawn.append(f'<text x="{0.7 * WIDTH:.1f}" y="{at + 5:.1f}">{said}</text>')
    drawn.append(f'<path class="cross" d="M{x - 9:g} {y:g}h18M{x:g} {y - 9:g}v18"/>')
    drawn.append(_bar(scale, language, steps=True))
    below = f'<ul class="legend">{legend}</ul>{escape(say(language, caption))}'
    return _figure(_svg("".join(drawn), say(language, alt)), below)


def _share(facts: Facts, language: Language) -> str:
    wide = WIDTH - 2 * MARGIN
    part = wide * min(1.0, facts.placed / facts.seen)
    y = HEIGHT / 2 - 30
    drawn = (
        f'<rect class="ground" width="{WIDTH:g}" height="{HEIGHT:g}" rx="10"/>'
        f'<rect class="whole" x="{MARGIN:g}" y="{y:g}" width="{wide:g}" height="60" rx="6"/>'
        f'<rect class="part" x="{MARGIN:g}" y="{y:g}" width="{part:.1f}" height="60" rx="6"/>'
    )
    words = {"placed": number(facts.placed), "seen": number(facts.seen)}
    return _figure(
        _svg(drawn, say(language, Message("picture.share_alt", words))),
        escape(say(language, Message("picture.share"))),
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

    def shown(one: Value) -> Markup:
        return mark_up(say(words, one))

    drawn = picture_html(picture, facts, words)
    # What a step is taken as stands where steps are.
    values = [value for one in story.measured for value in one.values.values() if isinstance(value, Message)]
    steps = IN_STEPS in drawn or any(value.key.startswith("steps.") for value in values)
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
