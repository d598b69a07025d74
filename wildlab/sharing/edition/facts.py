"""What is known of a flight, as plain values, from the numbers that its reports recorded."""

from __future__ import annotations

import math
import statistics
from collections.abc import Iterable
from typing import NamedTuple

from wildlab.analysis.overviews.overview import ALARMS, TROUBLES
from wildlab.analysis.overviews.verdict import causes_told, doubted, error_left, possible_gain
from wildlab.reporting.own_flights import OwnFlight

NAN = math.nan
#: Reports that tell how good something was, beside the overview.
PARTS = ("georeferencing", "tracking", "navigation")
#: What moves so far, and so far above the ground, flies: no mast of a boat or a car is as high, m.
FLYING = 30.0
_TROUBLES = dict(
    zip(
        (trouble.replace(" ", "-") for trouble in TROUBLES),
        ("poses", "jumps", "satellites", "few_satellites", "unsure", "shaken", "inertial"),
        strict=True,
    )
)


class Alarm(NamedTuple):
    """Something very wrong: a key of `ALARMS`, the worst of it (m, degrees or m/s^2), and how often."""

    what: str
    size: float
    often: int


class Gain(NamedTuple):
    """One thing to fix, as `wildlab.analysis.overviews.verdict.Gain`: ``value`` of ``of``."""

    key: str
    causes: tuple[str, ...]
    value: float
    of: float
    share: float


class Facts(NamedTuple):
    """All that the page follows from. Numbers that are not known are NaN.

    Attributes
    ----------
    twin
        Whether nobody flew it.
    verdict
        A key of `wildlab.analysis.overviews.verdict.Verdict`; None where the flight was not looked over.
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

    alarms = tuple(Alarm(what, value("alarm", what), count("alarm", what)) for what in ALARMS)
    troubles = {_TROUBLES[s]: v for (name, s) in numbers if name == "trouble" and s in _TROUBLES
                for v in [value(name, s)]}  # fmt: skip
    tracks = _leading_tracks(flight)
    possible = possible_gain({key: entry for key, entry in numbers.items() if entry["value"] is not None})
    uncertain = None
    if possible is not None:
        share = possible.value / possible.of if possible.of > 0 else 0.0
        uncertain = Gain("possible", causes_told(numbers), possible.value, possible.of, share)
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
        possible=uncertain,
        failed=tuple(about for about in ("overview", *PARTS) if about in failed),
        doubted=doubted(numbers),
        flown=value("height_above_ground") >= FLYING and value("path_length") >= FLYING,
    )


def _gains(flight: OwnFlight) -> tuple[Gain, ...]:
    """What the overview ranked, with the metres or counts behind each."""
    overview = flight.report("overview")
    found: list[Gain] = []
    if overview is None:
        return ()
    for (name, key), entry in overview.numbers.items():
        if name != "gain_share" or entry["value"] is None:
            continue
        if key in ("cause", "far_out"):
            gained = flight.value("gain", "winner" if key == "cause" else "without-far-out")
            far_out = flight.value("horizontal_error_mean", "without-far-out")
            left = error_left(flight.numbers) if key == "cause" else far_out
            value, of = (NAN, NAN) if gained is None or left is None else (gained, gained + left)
        else:
            lost = overview.numbers.get(("lost", key))
            value, of = (NAN, NAN) if lost is None else (float(lost["value"]), float(lost["n"]))
        causes = causes_told(flight.numbers) if key == "cause" else ()
        found.append(Gain(key, causes, value, of, float(entry["value"])))
    return tuple(sorted(found, key=lambda one: -one.share))


def _leading_tracks(flight: OwnFlight) -> list[tuple[float, float]]:
    """Error and sureness of each track of the filter that the report speaks of."""
    report = flight.report("tracking")
    if report is None:
        return []
    from wildlab.analysis.tracks.judged import LEADING
    from wildlab.reporting.tracking import band_name

    rows = [(subject, entry) for (name, subject), entry in report.numbers.items() if name == "rmse"]
    best = next((subject for name, subject in report.numbers if name == LEADING), "ekf")
    found = []
    for subject, entry in rows:
        if subject.rsplit("/", 1)[-1] != best or entry["value"] is None:
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
