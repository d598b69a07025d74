"""The overview of a flight: what is shown, in which order, and the numbers that are recorded of it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from wildlab.analysis.overviews.alarms import APART_M, APART_SD, APART_SHARE, JUMP, JUMP_M, LEANT_DEG
from wildlab.analysis.overviews.image_coverage import FLATTEST
from wildlab.analysis.overviews.overview import Overview, troubled_for
from wildlab.analysis.overviews.recommendations import (
    LISTED,
    MOST,
    Gain,
    doubted,
    error_measured,
    possible_gain,
)
from wildlab.analysis.overviews.verdict import WORTH, Numbers, evidence_of, verdict_of
from wildlab.evaluation.vibration import FLOOR_HZ, HARMFUL, SMOOTH_HZ
from wildlab.flight.clocks import MAX_GAP_S, USUAL_STEPS
from wildlab.reporting import overview_sections as sections
from wildlab.reporting import overview_words as words
from wildlab.reporting.arrange import ADVICE
from wildlab.reporting.charts import overview as charts
from wildlab.reporting.georeferencing import show_contradictions
from wildlab.reporting.report import Report

#: Subject of what is recorded of the whole flight.
FLIGHT = "flight"


def show_overview(
    report: Report, overview: Overview, gains: Sequence[Gain], numbers: Numbers, amiss: Sequence[str],
    lacking: Sequence[str], judged: int,
) -> None:  # fmt: skip
    """Write the whole report.

    Parameters
    ----------
    report
        Is added to.
    overview
        From `wildlab.analysis.overviews.overview.look_over`.
    gains, numbers
        From `wildlab.analysis.overviews.recommendations`, and the numbers of the other reports behind them.
    amiss
        What does not fit together: `wildlab.flight.checks.sense.sense.sense_sentences`.
    lacking
        Which reports could not be made, and why: clauses.
    judged
        How many of the other reports there are.
    """
    problems = overview.problems + sum(one.startswith("problem") for one in amiss)
    possible = possible_gain(numbers)
    doubts = doubted(numbers)
    counts = counts_of(overview, gains, problems, judged, possible)
    word = verdict_of(evidence_of(counts, numbers))
    shown = overview.flight.manifest.locations.sensitivity == "open"
    report.head("What happened on this flight, and what is worth fixing?", words.subtitle(overview))
    measured = error_measured(numbers)
    said = words.summary_sentences(overview, word, gains, problems, lacking, measured, possible, doubts)
    reason = words.reason_words(**counts, possible=possible, doubts=doubts)
    report.summary(said, level=word.colour, verdict=(word.value, reason))
    report.tiles(sections.tiles(overview))
    report.section("Most worth fixing", words.first_of(gains, possible), part=ADVICE)
    if gains:
        report.points([words.gain_sentence(gain) for gain in gains[:MOST]], ordered=True)
    if overview.problems:
        count = "One problem" if overview.problems == 1 else f"{overview.problems} problems"
        report.alert(f"{count} in its tables", ["`wildlab check` on the flight's folder says which."])
    show_contradictions(report, amiss, shown=shown)
    begin = min((pace.begin for pace in overview.streams.values() if pace.n), default=0.0)
    clock = charts.Clock(begin, overview.length_s)
    sections.places_section(report, overview)
    sections.streams_section(report, overview, clock)
    sections.motion_section(report, overview, clock)
    sections.satellites_section(report, overview, clock)
    sections.shaking_section(report, overview, clock)
    sections.clocks_section(report, overview, numbers)
    record(report, overview, gains, counts)
    report.limits(limits(overview, lacking))
    report.method(METHOD)


def counts_of(
    overview: Overview,
    gains: Sequence[Gain],
    problems: int,
    judged: int,
    possible: Gain | None,
) -> dict[str, int]:
    """What is counted on the flight beside the verdicts of its reports, and recorded."""
    long = troubled_for(overview, WORTH)
    paused = [one for one in overview.troubles if one.what == "no poses" and one not in long]
    return {
        "problems": problems,
        "worth": sum(gain.share >= WORTH for gain in gains),
        "troubled": len(long) + len(paused) + (possible is not None),
        "judged": judged,
        "broken": sum(one.broken for one in overview.alarms),
        "alarmed": sum(not one.broken for one in overview.alarms),
    }


def record(report: Report, overview: Overview, gains: Sequence[Gain], counts: Mapping[str, int]) -> None:
    """The numbers of the overview, for other tools: comparisons and the list of flights read them."""

    def note(name: str, value: float, unit: str, n: int | None = None) -> None:
        if np.isfinite(value):
            report.metric(name, FLIGHT, value, unit, n=n)

    named = {"worth": "worth_fixing", "judged": "reports_beside"}
    for name, count in counts.items():
        note(named.get(name, name), count, "1")
    note("duration", overview.length_s, "s")
    note("path_length", words.way_of(overview), "m")
    if overview.above is not None and np.isfinite(overview.above[0]).any():
        above = overview.above[0]
        low, high = np.nanquantile(above, [0.05, 0.95])
        report.metric("height_above_ground", FLIGHT, float(np.nanmedian(above)), "m", low=low, high=high)
    for name, pace in overview.streams.items():
        if not pace.n or not overview.series:
            continue
        if pace.even and np.isfinite(pace.rate_hz):
            report.metric("rate", name, pace.rate_hz, "Hz", n=pace.n)
        report.metric("paused", name, pace.paused_s, "s", n=len(pace.gaps))
    frames = overview.flight.frames
    if frames is not None and len(frames) and overview.source:
        without = next((one.lost for one in overview.lost if one.key == "images_without_pose"), 0)
        note("images_with_pose", 1 - without / len(frames), "1", len(frames))
    if overview.coverage is not None and overview.coverage.placed.any():
        note("area_seen", overview.coverage.area_m2, "m^2", int(overview.coverage.placed.sum()))
        note("images_per_place", overview.coverage.looks, "1")
    seen, images, placed = overview.detections
    if seen:
        note("detections", seen, "1", seen)
        in_images = overview.detections_in_images
        note("detections_in_images", in_images, "1", seen)
        if in_images:
            note("detections_placed", placed, "1", seen)
        if frames is not None and len(frames):
            note("images_with_detections", images, "1", len(frames))
        things = things_named(overview)
        if things:
            note("things_named", things, "1", seen)
    if overview.vibration is not None:
        found = overview.vibration[0]
        note("shaking_median", float(np.median(found.worst)), "m/s^2", len(found.worst))
        note("shaking_max", float(found.worst.max()), "m/s^2", len(found.worst))
    for trouble in overview.troubles:
        report.metric("trouble", trouble.what.replace(" ", "-"), trouble.seconds, "s", n=len(trouble.spells))
    units = {"jumps": "m", "leans": "deg", "apart": "m", "shakes": "m/s^2"}
    for alarm in overview.alarms:
        report.metric("alarm", alarm.what, alarm.size, units[alarm.what], n=alarm.often)
    for gain in gains:
        report.metric("gain_share", gain.key, gain.share, "1")
    for lost in overview.lost:
        report.metric("lost", lost.key, lost.lost, "1", n=lost.of)


def things_named(overview: Overview) -> int:
    """How many different things the detections name; 0 where one of them names none."""
    detections = overview.flight.detections
    if detections is None or "target_id" not in detections:
        return 0
    names = detections["target_id"].fillna("").astype(str)
    return 0 if (names == "").any() else int(names.nunique())


def limits(overview: Overview, lacking: Sequence[str]) -> list[str]:
    """What the report does not tell."""
    said = [f"What is not judged here: {one}." for one in lacking]
    said.append("What was not measured is in no list above, however much it may matter.")
    if any(gain.who == "truth" for gain in filter(None, [overview.path])):
        said.append("Where the aircraft was: the map shows the first target.")
    if overview.above is not None and not overview.flight.terrain:
        said.append("Heights above the real ground: it is taken to be level.")
    return said


METHOD = f"""
Stamps are those of the tables, with the offsets of the manifest. A pause is a step longer than
{MAX_GAP_S:g} s and than {USUAL_STEPS:g} usual steps. Poses jump where a step is off by more than {JUMP:g}
times the usual difference, and {JUMP_M:g} m, from what the stated speeds before and after it make of it;
without speeds, from both the step before and the step after.

What comes before all gains: jumps; an airframe that leans by more than {LEANT_DEG:g}°; shaking beyond
{HARMFUL:g} m/s²; poses more than {APART_M:g} m, and {APART_SD:g} stated standard deviations, beside more than
{100 * APART_SHARE:g} % of the satellite positions.

Shaking is measured as ArduPilot does for its VIBE message: the specific force less its own low pass of
{FLOOR_HZ:g} Hz, squared, smoothed below {SMOOTH_HZ:g} Hz, and the root of that. By band it is Welch's
spectrum of the whole flight.

A footprint is the border of an image on the ground. The area of all together is counted in cells whose centre
lies in at least one. An image whose border comes within {np.degrees(FLATTEST):g}° of the horizon has none.

The list of what is most worth fixing has gains in metres from the report on the georeferencing, measured on
images that the correction was not estimated from, and data that are lost; from a share of
{100 * LISTED:g} % on, and as worth fixing from {100 * WORTH:g} % on.
"""
