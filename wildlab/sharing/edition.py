"""The partner edition: one flight on one A4 page, in plain words, for somebody who writes no programs.

Facts come out of the flight's reports; which messages they call for is a rule.
"""

from __future__ import annotations

import contextlib
import math
import statistics
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
from markupsafe import Markup
from numpy.typing import NDArray

from wildlab.analysis.accuracy import observe_calibrated
from wildlab.analysis.georeference import FEW_POINTS
from wildlab.analysis.overview import ALARMS, TROUBLES, Alarm, Gain, path_of
from wildlab.analysis.verdict import (
    MOST,
    PARTS,
    WORTH,
    Verdict,
    causes_told,
    doubted,
    metric_gains,
    possible_gain,
)
from wildlab.errors import WildlabError
from wildlab.flight.store import Flight
from wildlab.geometry.georeference import georeference_pixels
from wildlab.messages.catalogue import (
    Day,
    Language,
    Message,
    Quantity,
    Value,
    duration,
    length,
    load_language,
    number,
    of_unflown,
    say,
    share,
)
from wildlab.messages.quantities import nice_length
from wildlab.reporting.front_page import OwnFlight
from wildlab.reporting.metrics import NEAR_THE_BAND, band_name
from wildlab.reporting.text import POLICY, mark_up, read_style, render
from wildlab.sharing.tiers import Cell

NAN = math.nan
#: What moves so far, and so far above the ground, flies: no mast of a boat or a car is as high, m.
FLYING = 30.0
_TROUBLES = dict(
    zip(
        (trouble.replace(" ", "-") for trouble in TROUBLES),
        ("poses", "jumps", "satellites", "few_satellites", "unsure", "shaken", "inertial"),
        strict=True,
    )
)


class Facts(NamedTuple):
    """All that the page follows from. Numbers that are not known are NaN.

    Attributes
    ----------
    twin
        Whether nobody flew it.
    verdict
        A `wildlab.analysis.verdict.Verdict`; None where the flight was not looked over.
    problems
        Things in its records that cannot be used or contradict each other.
    length_s, height_m, area_m2
        Of the flight; above the ground; of the ground that its images show.
    seen, things
        Detections; different things that they name, NaN where not all name one.
    placed
        Detections with a place on the ground; NaN where none is in an image, so that none could have one.
    pictured
        Detections in images; NaN where that was not recorded, and then all are taken to be.
    error_median, error_p90, compared
        Distance from where things were said to be to where they were, m, and of how many points.
    scatter, sightings
        How far apart sightings of the same thing lie, m, each axis, where no true place is known.
    tracks, track_error, track_worst, track_sure
        How many tracks were held against the truth; the median and the largest of their root mean square
        errors, m; the median of the mean squared error over the highest that chance allows for what the
        tracks say of themselves.
    alarms, troubles, gains
        Worst first; trouble and its seconds, longest first; by share.
    possible
        A gain that is not certain.
    doubted
        Reports that ask for a closer look themselves: ``georeferencing``, ``tracking``, ``navigation``.
    failed
        Those of `PARTS`, and ``overview``, that failed.
    far_out, inside
        Points that are outliers; share of true places in the ellipses that should hold `HELD` of them.
    flown
        Whether it is known that the sensors flew. Else they may be a boat's, or stand somewhere.
    """

    twin: bool
    verdict: str | None
    problems: int
    length_s: float
    height_m: float
    area_m2: float
    seen: float
    things: float
    placed: float
    error_median: float
    error_p90: float
    compared: int
    scatter: float
    sightings: int
    tracks: int
    track_error: float
    track_sure: float
    alarms: tuple[Alarm, ...]
    troubles: tuple[tuple[str, float], ...]
    gains: tuple[Gain, ...]
    possible: Gain | None
    failed: tuple[str, ...]
    doubted: tuple[str, ...] = ()
    pictured: float = NAN
    track_worst: float = NAN
    flown: bool = True
    far_out: int = 0
    inside: float = NAN

    @property
    def other_sensors(self) -> bool:
        """Whether all that was detected was so by other sensors than a camera, as a radar."""
        return self.seen > 0 and self.pictured == 0

    @property
    def tracked(self) -> bool:
        """Whether tracks were held against true places."""
        return self.tracks > 0 and math.isfinite(self.track_error)


def facts_of(flight: OwnFlight) -> Facts:
    """What the reports on a flight recorded.

    Parameters
    ----------
    flight
        With the reports that there are, done or not.

    Returns
    -------
    Facts
    """
    numbers = flight.numbers

    def value(name: str, subject: str = "flight") -> float:
        found = flight.value(name, subject)
        return NAN if found is None else found

    def count(name: str, subject: str) -> int:
        entry = flight.number(name, subject)
        return int(entry["n"]) if entry is not None and entry["n"] is not None else 0

    alarms = (Alarm(what, count("alarm", what), NAN, value("alarm", what), NAN) for what in ALARMS)
    troubles = {_TROUBLES[s]: v for (name, s) in numbers if name == "trouble" and s in _TROUBLES
                for v in [value(name, s)]}  # fmt: skip
    tracks = _leading_tracks(flight)
    possible = possible_gain({key: entry for key, entry in numbers.items() if entry["value"] is not None})
    failed = tuple(one.about for one in flight.reports if one.state != "done")
    return Facts(
        twin=flight.kind == "twin",
        verdict=flight.verdict,
        problems=int(flight.value("problems", "flight") or 0),
        length_s=flight.length_s,
        height_m=value("height_above_ground"),
        area_m2=value("area_seen"),
        seen=value("detections"),
        things=value("things_named"),
        placed=value("detections_placed"),
        pictured=value("detections_in_images"),
        error_median=value("horizontal_error_median", "logged-pose"),
        error_p90=value("horizontal_error_p90", "logged-pose"),
        compared=count("horizontal_error_median", "logged-pose"),
        scatter=value("sighting_spread", "logged-pose"),
        sightings=count("sighting_spread", "logged-pose"),
        tracks=len(tracks),
        track_error=_median([error for error, _ in tracks]),
        track_worst=max((error for error, _ in tracks), default=NAN),
        track_sure=_median([sure for _, sure in tracks]),
        alarms=tuple(one for one in alarms if math.isfinite(one.size)),
        troubles=tuple(sorted(troubles.items(), key=lambda one: -one[1])),
        gains=_gains(flight),
        possible=None if possible is None else possible._replace(causes=causes_told(numbers)),
        failed=tuple(about for about in ("overview", *PARTS) if about in failed),
        doubted=doubted(numbers),
        far_out=int(flight.value("points_far_out", "winner") or 0),
        inside=value("ellipse_coverage_90", "logged-pose"),
        flown=value("height_above_ground") >= FLYING and value("path_length") >= FLYING,
    )


def _gains(flight: OwnFlight) -> tuple[Gain, ...]:
    """What the overview ranked, with the metres or counts behind each."""
    overview = flight.report("overview")
    if overview is None:
        return ()
    metres = {gain.key: gain for gain in metric_gains(flight.numbers)}
    found = []
    for (name, key), entry in overview.numbers.items():
        if name == "gain_share" and entry["value"] is not None:
            lost = overview.numbers.get(("lost", key), {"value": NAN, "n": NAN})
            gain = metres.get(key, Gain(key, (), float(lost["value"]), float(lost["n"]), 0.0))
            found.append(gain._replace(share=float(entry["value"])))
    return tuple(sorted(found, key=lambda one: -one.share))


def _leading_tracks(flight: OwnFlight) -> list[tuple[float, float]]:
    """Error and sureness of each track of the filter that the report speaks of."""
    report = flight.report("tracking")
    if report is None:
        return []
    found = []
    for subject, entry in report.of_leading_filter("rmse").items():
        if entry["value"] is None:
            continue
        nees, high = (
            report.numbers.get((name, subject), {}).get("value")
            for name in ("nees", band_name("nees", "high"))
        )
        sure = NAN if nees is None or not high else float(nees) / float(high)
        found.append((float(entry["value"]), sure))
    return found


def _median(values: Iterable[float]) -> float:
    known = [value for value in values if math.isfinite(value)]
    return statistics.median(known) if known else NAN


#: Share of true places that the ellipses should hold, and how much more or less is unlike it.
HELD, UNLIKE_HELD = 0.9, 0.05
#: Of two normal errors of equal spread, the median distance from the middle over that spread.
MEDIAN_DISTANCE = math.sqrt(2 * math.log(2))
#: Troubles by the gain that is had by doing the same.
_SAME_REMEDY = {
    "poses": "time_without_poses",
    "satellites": "time_without_satellites",
    "inertial": "time_without_inertial",
}


class Story(NamedTuple):
    """All that is said of a flight.

    Attributes
    ----------
    verdict, why, next
        In a word or two; what it follows from; what it means for the next flight.
    trusted
        Whether what was measured may be relied on as it is.
    tiles
        The numbers at the top, each with what it is.
    measured, wrong, advice, unknown
        The four lists; advice is ranked, most first. Where there are more than fit, the last text of a list
        says how many.
    """

    verdict: Message
    why: Message
    next: Message
    trusted: bool
    tiles: tuple[tuple[Value, Message], ...]
    measured: tuple[Message, ...]
    wrong: tuple[Message, ...]
    advice: tuple[Message, ...]
    unknown: tuple[Message, ...]


def tell(facts: Facts) -> Story:
    """What a flight's numbers come to.

    Parameters
    ----------
    facts
        From `wildlab.sharing.edition.facts_of`.

    Returns
    -------
    Story
    """
    if not (math.isfinite(facts.error_median) and math.isfinite(facts.error_p90)):
        facts = facts._replace(compared=0)
    advice = _advice(facts)
    return Story(
        Message(f"verdict.{_key(facts)}"),
        _why(facts),
        _next(facts, advice),
        facts.verdict in (Verdict.FIX, Verdict.SOUND) and not facts.doubted and not _too_sure(facts),
        tuple(_tiles(facts)[:4]),
        tuple(_measured(facts)[:MOST]),
        _cut(_wrong(facts)),
        _cut(advice),
        _cut(_unknown(facts)),
    )


def _key(facts: Facts) -> str:
    """The verdict by its texts."""
    return Verdict(facts.verdict or Verdict.UNJUDGED).name.lower()


def _cut(items: Sequence[Message]) -> tuple[Message, ...]:
    """The first of them, and how many more there are: nothing is left out in silence."""
    rest = len(items) - MOST
    return tuple(items) if rest <= 0 else (*items[:MOST], Message("page.more", {}, rest))


def _applying(*rules: tuple[bool, Message]) -> list[Message]:
    """The messages whose condition holds. One with a number that is not known may be among the rules."""
    return [message for applies, message in rules if applies]


def _why(facts: Facts) -> Message:
    verdict, share_worth = facts.verdict, {"share": share(WORTH)}
    worth = [gain for gain in facts.gains if gain.share >= WORTH]
    doubts = [_doubt(facts, one) for one in facts.doubted]
    problems = Message("wrong.problems", {}, facts.problems)
    if verdict in (Verdict.ALARM, Verdict.LOOK) and facts.alarms:
        return _alarm(facts.alarms[0])
    if verdict == Verdict.MEND:
        return doubts[0] if doubts and not facts.problems else problems
    if verdict == Verdict.FIX and worth:
        return Message("why.fix", {"first": _gained(worth[0])}, len(worth))
    if verdict == Verdict.LOOK:
        pressing = [
            _trouble(facts, what, seconds)
            for what, seconds in facts.troubles
            if what == "poses" or (facts.length_s > 0 and seconds >= WORTH * facts.length_s)
        ]
        if facts.possible is not None:
            values = {"gain": length(facts.possible.value), "of": length(facts.possible.of)}
            pressing.append(Message("why.possible", values))
        pressing += [*_applying((_too_sure(facts), Message("wrong.too_sure"))), *doubts]
        return pressing[0] if pressing else Message("why.alarm")
    if verdict == Verdict.SOUND:
        measured = facts.compared > 0 or facts.tracks > 0
        return Message("why.sound" if measured else "why.sound_unmeasured", share_worth)
    if verdict in (Verdict.ALARM, Verdict.FIX):
        return Message("why.alarm")
    return Message("why.failed" if "overview" in facts.failed else "why.unjudged")


def _doubt(facts: Facts, about: str) -> Message:
    """Why one of `PARTS` asks for a closer look."""
    if about == "georeferencing" and facts.far_out:
        return Message("why.doubt_outliers", {"of": number(facts.compared)}, facts.far_out)
    if about == "georeferencing" and abs(facts.inside - HELD) > UNLIKE_HELD:
        return Message("why.doubt_ellipses", {"share": share(facts.inside)})
    return Message(f"why.doubt_{about}")


def _next(facts: Facts, advice: Sequence[Message]) -> Message:
    if facts.verdict in (Verdict.ALARM, Verdict.MEND, Verdict.LOOK):
        return Message(f"next.{_key(facts)}")
    if facts.verdict == Verdict.FIX and facts.gains:
        # The thing itself: the list stands far below.
        return _do(facts.gains[0])
    listed = {"list": Message("heading.advice")}
    if facts.verdict == Verdict.SOUND:
        return Message("next.sound_more", listed) if advice else Message("next.sound")
    return Message("next.unjudged", listed) if advice else Message("next.nothing")


def _tiles(facts: Facts) -> list[tuple[Value, Message]]:
    known, few = math.isfinite, facts.compared < FEW_POINTS
    worst = {"worst": length(facts.track_worst)}
    tracks = Message("tile.tracks", worst) if _unlike(facts) else Message("tile.track")
    pictured = not known(facts.pictured) or facts.pictured == facts.seen
    rules: tuple[tuple[bool, Value, Message], ...] = (
        (not few, length(facts.error_median), Message("tile.error")),
        (few and facts.tracked, length(facts.track_error), tracks),
        (facts.seen > 0, number(facts.seen), Message("tile.seen" if pictured else "tile.detected")),
        (known(facts.length_s), duration(facts.length_s), Message("tile.length")),
        (known(facts.area_m2), Quantity("area", facts.area_m2), Message("tile.area")),
    )
    return [(value, label) for applies, value, label in rules if applies]


def _measured(facts: Facts) -> list[Message]:
    known, few, others = math.isfinite, facts.compared < FEW_POINTS, facts.other_sensors
    named, placed = known(facts.things), not others and facts.seen > 0 and known(facts.placed)
    seen = {"seen": number(facts.seen), "placed": number(facts.placed)}
    off = {"error": length(facts.track_error), "worst": length(facts.track_worst)}
    error = {
        "median": length(facts.error_median),
        "p90": length(facts.error_p90),
        "compared": number(facts.compared),
    }
    scatter = {
        "apart": length(MEDIAN_DISTANCE * facts.scatter),
        "sightings": number(facts.sightings),
    }
    # To the metre.
    height = float(f"{facts.height_m:.0f}")
    area = {"area": Quantity("area", facts.area_m2), "height": length(height)}
    tracked, unlike = facts.tracked, _unlike(facts)
    found = _applying(
        (not few, Message("measured.error", error)),
        (few and known(facts.scatter), Message("measured.scatter", scatter)),
        (tracked and unlike, Message("measured.tracks", {**off, "n": number(facts.tracks)})),
        (tracked and not unlike, Message("measured.track", off, facts.tracks)),
        (others and named, Message("measured.things_detected", seen, facts.things)),
        (others and not named, Message("measured.detected", {}, facts.seen)),
        (placed and named, Message("measured.things", seen, facts.things)),
        (placed and not named, Message("measured.seen", seen, facts.seen)),
        (known(facts.area_m2) and known(facts.height_m), Message("measured.area", area)),
    )
    return found or [Message("measured.nothing")]


def _unlike(facts: Facts) -> bool:
    """Whether some track was farther off than is typical: then the worst is given too."""
    return facts.tracks > 1 and facts.track_worst > facts.track_error


def _alarm(alarm: Alarm) -> Message:
    leans = alarm.what == "leans"
    size = Quantity("angle", math.radians(alarm.size)) if leans else length(alarm.size)
    values = {"size": size, "times": number(alarm.size / 9.81)}
    return Message(f"alarm.{alarm.what}", values, alarm.often)


def _trouble(facts: Facts, what: str, seconds: float) -> Message:
    part = min(1.0, seconds / facts.length_s) if facts.length_s > 0 else NAN
    return Message(f"trouble.{what}", {"time": duration(seconds), "share": share(part)})


def _too_sure(facts: Facts) -> bool:
    return facts.tracks > 0 and facts.track_sure > NEAR_THE_BAND


def _lasting(facts: Facts) -> list[tuple[str, float]]:
    """Troubles that are listed: jumps are instants; an alarm has them, and that it shakes."""
    alarms = {one.what for one in facts.alarms}
    return [
        (what, seconds)
        for what, seconds in facts.troubles
        if seconds >= 1 and not (what == "shaken" and "shakes" in alarms)
    ]


def _wrong(facts: Facts) -> list[Message]:
    sure = _too_sure(facts)
    found = [_alarm(one) for one in facts.alarms]
    found += _applying(
        (facts.problems > 0, Message("wrong.problems", {}, facts.problems)),
        ("georeferencing" in facts.doubted, _doubt(facts, "georeferencing")),
        (sure, Message("wrong.too_sure")),
        (not sure and "tracking" in facts.doubted, Message("why.doubt_tracking")),
        ("navigation" in facts.doubted, Message("why.doubt_navigation")),
    )
    found += [_trouble(facts, what, seconds) for what, seconds in _lasting(facts)]
    # What the verdict has already is not repeated, nor what the troubles have of time.
    gains = facts.gains[1 if facts.verdict == Verdict.FIX else 0 :]
    for gain in gains:
        counted = gain.key.startswith(("images", "detections"))
        if counted or (gain.key in ("cause", "far_out") and gain.share >= WORTH):
            found.append(_gained(gain))
    # Where no trouble has it of the time, the gain does.
    if found := found or [_gained(gain) for gain in gains if gain.share >= WORTH]:
        return found
    if facts.verdict is None:
        return [Message("wrong.unlooked")]
    if facts.verdict in (Verdict.FIX, Verdict.LOOK, Verdict.ALARM, Verdict.MEND):
        return [Message("wrong.above")]
    small = bool(facts.gains) or facts.possible is not None
    return [Message("wrong.small", {"share": share(WORTH)}) if small else Message("wrong.none")]


def _gained(gain: Gain) -> Message:
    """What it is, in a sentence."""
    of = length if gain.key in ("cause", "far_out") else duration if gain.key.startswith("time") else number
    causes = tuple(Message(f"cause.{_cause_key(cause)}") for cause in gain.causes)
    values = {
        "share": share(gain.share),
        "of": of(gain.of),
        "gain": length(gain.value),
        "time": duration(gain.value),
        "causes": causes or Message("cause.any"),
    }
    return Message(f"lost.{gain.key}", values, gain.value)


def _cause_key(cause: str) -> str:
    return cause.replace("'", "").replace(" ", "_")


def _advice(facts: Facts) -> list[Message]:
    """What to do, what comes before all gains first."""
    others, compared = facts.other_sensors, facts.compared
    # Single sightings of other sensors never are.
    unplaced = not compared and "georeferencing" not in facts.failed and not (others and facts.tracked)
    found = [Message(f"do.{one.what}") for one in facts.alarms]
    found += _applying((facts.problems > 0, Message("do.problems", {}, facts.problems)))
    found += [_do(gain) for gain in facts.gains]
    if facts.possible is not None:
        found.append(Message("do.possible", {"gain": length(facts.possible.value)}))
    found += _applying(
        (unplaced, Message("do.known_tracks" if others else "do.known_places")),
        (0 < compared < FEW_POINTS, Message("do.more_places", {"few": number(FEW_POINTS)})),
        (bool(facts.failed), Message("do.failed", {}, len(facts.failed))),
    )
    # What a gain asks for already is not asked for twice.
    asked = {one.key.removeprefix("do.") for one in found}
    found += [
        Message(f"do.trouble_{what}")
        for what, _ in _lasting(facts)
        if not asked & {what, _SAME_REMEDY.get(what, what)}
    ]
    found += _applying(
        (_too_sure(facts) or "tracking" in facts.doubted, Message("do.tracks")),
        ("navigation" in facts.doubted, Message("do.navigation")),
    )
    return found


def _do(gain: Gain) -> Message:
    """What to do about one thing."""
    key = gain.key
    if key == "cause":
        key = f"cause_{_cause_key(gain.causes[0])}" if len(gain.causes) == 1 else "causes"
    return Message(f"do.{key}", {"share": share(gain.share)})


def _unknown(facts: Facts) -> list[Message]:
    few = {"median": length(facts.error_median)}
    unplaced = not facts.compared and "georeferencing" not in facts.failed
    seen = facts.seen > 0
    return [
        *(Message(f"unknown.failed_{part}") for part in facts.failed),
        *_applying(
            (unplaced, Message("unknown.error_sightings" if facts.tracked else "unknown.error")),
            (0 < facts.compared < FEW_POINTS, Message("unknown.few", few, facts.compared)),
            (not seen, Message("unknown.seen")),
            (seen and not math.isfinite(facts.things), Message("unknown.things")),
            (seen, Message("unknown.hidden_detected" if facts.other_sensors else "unknown.hidden")),
            (facts.compared >= FEW_POINTS, Message("unknown.another_day")),
        ),
    ]


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
    source, nothing = next(iter(flight.estimated_sources), None), np.empty((0, 2))
    path = path_of(flight, source)
    way = path.place[:, :2] if path is not None and path.who == f"nav/{source}" else nothing
    seen = nothing
    if source is not None and flight.detections is not None and flight.manifest.camera is not None:
        with contextlib.suppress(WildlabError):
            one, _ = observe_calibrated(flight, source)
            seen = georeference_pixels(one.poses, one.uv, one.plane_down)[:, :2]
    truth = nothing if flight.truth is None else flight.truth[["north_m", "east_m"]].to_numpy(float)
    found = MapPicture(way, seen, truth)
    return found if any(np.isfinite(one).any() for one in found) else None


def _known_points(points: Array) -> Array:
    points = np.asarray(points, float).reshape(-1, 2)
    return points[np.isfinite(points).all(axis=1)]


def picture_html(picture: MapPicture | None, language: Language) -> str:
    """A ``<figure>`` with the map and its caption, or nothing where there is nothing to draw."""
    if picture is None:
        return ""
    way, seen, truth = map(_known_points, picture)
    if len(way) + len(seen) < 2:
        return ""
    begin = way[:1]
    # No point that is kilometres off, of whatever it is, shrinks the rest; nor does one who walked elsewhere.
    near = np.concatenate([_usual(one) for one in (way, seen) if len(one)])
    low, high = near.min(axis=0), near.max(axis=0)
    size = np.maximum(high - low, 5.0)
    scale = float((np.array([HEIGHT - FOOT - 2 * MARGIN, WIDTH - 2 * MARGIN]) / size).min())

    def place(points: Array) -> Array:
        offset = (np.asarray(points, float).reshape(-1, 2) - (low + high) / 2) * scale
        return np.stack([WIDTH / 2 + offset[:, 1], (HEIGHT - FOOT) / 2 - offset[:, 0]], axis=1)

    dots = {"seen": (_dots(place(seen)), 4.2), "true": (_dots(place(truth)), 3.0)}
    keys = [("way", "path"), ("start", "start")] * bool(len(begin)) + [("seen", "seen")] * bool(len(seen))
    keys += [("true", "truth")] * bool(len(dots["true"][0]))
    values = {"way": length(float(size[1]))}
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
        From `wildlab.sharing.edition.facts_of`.
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
            untranslated=Message("page.untranslated", {}, len(words.missing)) if words.missing else "",
        )
        + "\n"
    )


def _place(cell: Cell | None, words: Language) -> Message:
    if cell is None:
        return Message("place.withheld")
    values = {
        "latitude": _side(cell.latitude_deg, "north", "south", words),
        "longitude": _side(cell.longitude_deg, "east", "west", words),
        "uncertainty": length(cell.uncertainty_m),
    }
    return Message("place.generalised", values)


def _side(value: float, positive: str, negative: str, words: Language) -> Message:
    """A coordinate with the letter of its side: all its digits, since these say how coarse it is."""
    digits = f"{abs(value):.6f}".rstrip("0").rstrip(".").replace(".", str(words.texts["format.decimal"]))
    return Message(f"format.{positive if value >= 0 else negative}", {"degrees": digits})
