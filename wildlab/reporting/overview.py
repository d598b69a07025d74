"""The overview of a flight: what happened on it, what is worth fixing, and what was recorded.

What is said follows by rules from numbers; the words lie in ``data/messages/en/overview.toml``.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from typing import NamedTuple

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from wildlab.analysis.overview import (
    Alarm,
    Gain,
    Issue,
    Overview,
    length_of_way,
    troubled_for,
)
from wildlab.analysis.verdict import (
    MOST,
    WORTH,
    Numbers,
    Verdict,
    doubted,
    evidence_of,
    number_of,
    possible_gain,
    verdict_of,
)
from wildlab.messages import quantities
from wildlab.messages.catalogue import Message, load_texts
from wildlab.messages.quantities import metres, number, percent_of
from wildlab.names import listed
from wildlab.reporting.charts import flights as charts
from wildlab.reporting.georeferencing import (
    count_problems,
    show_advice,
    show_contradictions,
    span,
    words_of_causes,
)
from wildlab.reporting.report import Report, Wording

#: Subject of what is recorded of the whole flight.
FLIGHT = "flight"
_MOTION = {"height": "height (m)", "speed": "speed (m/s)"}
_UNITS = {"jumps": "m", "leans": "deg", "apart": "m", "shakes": "m/s^2"}


class Judged(NamedTuple):
    """What the overview's sentences follow from.

    Attributes
    ----------
    overview, gains
        The flight, and what is worth fixing, most first.
    problems
        Things in its tables that cannot be used or contradict each other.
    verdict
        Of the flight.
    possible
        A gain that is not certain.
    doubts
        Other reports that ask for a closer look.
    judged, error
        How many other reports there are; how far off a position typically is by them, m, or NaN.
    """

    overview: Overview
    gains: Sequence[Gain]
    problems: int
    verdict: Verdict
    possible: Gain | None = None
    doubts: Sequence[str] = ()
    judged: int = 0
    error: float = float("nan")


# -- what follows from the numbers


def way_of(overview: Overview) -> float:
    """Length of the path over the ground, m; NaN without one."""
    path = overview.path
    if path is None or len(path.times) < 2:
        return float("nan")
    if not path.timed:
        return float(np.linalg.norm(np.diff(path.place[:, :2], axis=0), axis=1).sum())
    return length_of_way(path.times, path.place[:, :2])


def gain_message(gain: Gain) -> Message:
    """What fixing one thing gains, and how."""
    values = {"share": percent_of(gain.share)}
    if gain.key in ("cause", "far_out"):
        values |= {"left": metres(gain.of - gain.value), "error": metres(gain.of)}
        values |= {"causes": words_of_causes(gain.causes) if gain.causes else "–"}
        return Message("gain-cause" if gain.key == "cause" else "gain-outliers", values)
    counts = {"lost": f"{gain.value:.0f}", "of": f"{gain.of:.0f}"}
    return Message(f"gain-{gain.key.replace('_', '-')}", values | counts)


def alarm_message(alarm: Alarm, overview: Overview) -> Message:
    """One alarm: how much, and when since the first stamp."""
    begin = min((pace.begin for pace in overview.streams.values() if pace.n), default=0.0)
    size = quantities.length(alarm.size) if _UNITS[alarm.what] == "m" else f"{alarm.size:.1f}"
    values = {
        "size": size,
        "at": f"{alarm.worst - begin:.0f}",
        "share": percent_of(alarm.share),
        "times": alarm.often,
    }
    once = "-once" if alarm.what == "jumps" and alarm.often == 1 else ""
    return Message(f"alarm-{alarm.what}{once}", values)


def issue_message(issue: Issue, overview: Overview) -> Message:
    """One thing that is wrong along the path, and for how long."""
    instant = issue.seconds < 1 or not overview.length_s > 0
    share = "" if instant else percent_of(min(1.0, issue.seconds / overview.length_s))
    return Message(f"issue{'-instant' if instant else ''}", {"what": issue.what, "share": share})


def pressing(found: Judged) -> list[Message]:
    """All that asks for something, the most pressing first; each has a remedy."""
    overview = found.overview
    lasting = [one for one in overview.troubles if one.seconds >= 1]
    said = [alarm_message(one, overview) for one in overview.alarms]
    if found.problems:
        said.append(Message("problems", {"problems": found.problems}))
    # What is far out may come of what contradicts itself, or of a constant error that is not certain.
    unsure = found.problems > 0 or found.possible is not None
    gains = [gain for gain in found.gains if not (unsure and gain.key == "far_out")]
    said += [gain_message(gain) for gain in sorted(gains, key=lambda gain: -gain.share)]
    if lasting and found.verdict != Verdict.SOUND:
        said.append(issue_message(max(lasting, key=lambda one: one.seconds), overview))
    if found.possible is not None:
        said.append(Message("possible", {"share": percent_of(found.possible.share)}))
    if found.doubts:
        said.append(Message("doubts", {"reports": listed(list(found.doubts))}))
    return said


def answer(found: Judged) -> list[Message]:
    """What the flight comes to and how far off its positions are; and the most pressing thing."""
    length = found.overview.length_s
    values = {
        "verdict": found.verdict.value.capitalize(),
        "length": f" of {quantities.duration(length)}" if np.isfinite(length) else "",
        "error": metres(found.error),
    }
    known = "opening" if np.isfinite(found.error) else "opening-unmeasured"
    return [Message(known, values), *pressing(found)[:1]]


def reason(found: Judged, counts: Mapping[str, int]) -> Message:
    """Why the verdict is what it is: the most pressing of what was counted."""
    overview = found.overview
    if overview.alarms:
        return Message("reason-alarms", {"count": len(overview.alarms)})
    if found.problems:
        return Message("reason-problems", {"count": found.problems})
    if counts["worth"]:
        return Message("reason-worth", {"count": counts["worth"], "share": percent_of(WORTH)})
    if found.doubts:
        return Message("reason-doubts", {"reports": listed(list(found.doubts))})
    if counts["troubled"]:
        return Message("reason-troubled", {"what": listed(troubles_of(overview, found.possible))})
    if found.verdict == Verdict.UNJUDGED:
        return Message("reason-unjudged")
    return Message("reason-sound", {"count": found.judged})


def advice(found: Judged) -> list[Message]:
    """What to do, the most pressing first, `MOST` at most."""
    said = pressing(found)[:MOST]
    return [Message(f"{re.sub('-(once|instant)$', '', one.key)}-remedy", one.values) for one in said]


def limits(overview: Overview, lacking: Sequence[str]) -> list[Message]:
    """What the report does not tell; five at most."""
    said = [Message("limit-lacking", {"what": one}) for one in lacking[:2]]
    if overview.path is not None and overview.path.who == "truth":
        said.append(Message("limit-target"))
    if overview.above is not None and not overview.flight.terrain:
        said.append(Message("limit-level"))
    return [*said, Message("limit-measured")]


# -- what is recorded


def troubles_of(overview: Overview, possible: Gain | None) -> list[str]:
    """What is wrong on a flight with a gain that is not known, by name."""
    long = troubled_for(overview, WORTH)
    paused = [one for one in overview.troubles if one.what == "no poses" and one not in long]
    uncertain = [] if possible is None else ["a constant error that is not certain"]
    return [*(one.what for one in (*long, *paused)), *uncertain]


def counts_of(
    overview: Overview,
    gains: Sequence[Gain],
    problems: int,
    judged: int,
    possible: Gain | None,
) -> dict[str, int]:
    """What is counted on the flight beside the verdicts of its reports, and recorded."""
    return {
        "problems": problems,
        "worth": sum(gain.share >= WORTH for gain in gains),
        "troubled": len(troubles_of(overview, possible)),
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
    note("path_length", way_of(overview), "m")
    if overview.above is not None and np.isfinite(overview.above[0]).any():
        above = overview.above[0]
        low, high = np.nanquantile(above, [0.05, 0.95])
        report.metric("height_above_ground", FLIGHT, float(np.nanmedian(above)), "m", low=low, high=high)
    for name, pace in overview.streams.items() if overview.series else ():
        if pace.n and pace.even and np.isfinite(pace.rate_hz):
            report.metric("rate", name, pace.rate_hz, "Hz", n=pace.n)
        if pace.n:
            report.metric("paused", name, pace.paused_s, "s", n=len(pace.gaps))
    frames = 0 if overview.flight.frames is None else len(overview.flight.frames)
    if frames and overview.source:
        note("images_with_pose", 1 - _without_pose(overview) / frames, "1", frames)
    if overview.coverage is not None and overview.coverage.placed.any():
        note("area_seen", overview.coverage.area_m2, "m^2", int(overview.coverage.placed.sum()))
    seen, images, placed = overview.detections
    in_images = overview.detections_in_images
    for name, count, n, told in (
        ("detections", seen, seen, seen),
        ("detections_in_images", in_images, seen, seen),
        ("detections_placed", placed, in_images, seen and in_images),
        ("images_with_detections", images, frames, seen and frames),
        ("things_named", things_named(overview), seen, seen and things_named(overview)),
    ):
        if told:
            note(name, count, "1", n)
    if overview.vibration is not None:
        worst = overview.vibration[0].max(axis=1)
        note("shaking_max", float(worst.max()), "m/s^2", len(worst))
    for trouble in overview.troubles:
        report.metric("trouble", trouble.what.replace(" ", "-"), trouble.seconds, "s", n=len(trouble.spells))
    for alarm in overview.alarms:
        report.metric("alarm", alarm.what, alarm.size, _UNITS[alarm.what], n=alarm.often)
    for gain in gains:
        report.metric("gain_share", gain.key, gain.share, "1")
    for lost in overview.lost:
        report.metric("lost", lost.key, lost.value, "1", n=int(lost.of))


def _without_pose(overview: Overview) -> int:
    """How many images have no pose."""
    return next((int(one.value) for one in overview.lost if one.key == "images_without_pose"), 0)


def things_named(overview: Overview) -> int:
    """How many different things the detections name; 0 where one of them names none."""
    detections = overview.flight.detections
    if detections is None or "target_id" not in detections:
        return 0
    names = detections["target_id"].fillna("").astype(str)
    return 0 if (names == "").any() else int(names.nunique())


# -- tables


def streams_table(overview: Overview) -> pd.DataFrame:
    """A row for each stream: samples, rate, half the width of the middle 90 % of the steps, pauses."""
    rows = []
    for name, pace in overview.streams.items():
        even = pace.even and np.isfinite(pace.rate_hz)
        rows.append(
            {
                "stream": name,
                "n": pace.n,
                "rate": pace.rate_hz if even else np.nan,
                "wavering": 1e3 * pace.wavering_s if even else np.nan,
                "missing": 100 * pace.missing_share if even else np.nan,
                "pauses": len(pace.gaps),
                "paused": pace.paused_s,
                "longest": float(np.diff(pace.gaps, axis=1).max()) if len(pace.gaps) else np.nan,
                "unordered": pace.unordered,
            }
        )
    return pd.DataFrame(rows)


def coverage_table(overview: Overview) -> pd.DataFrame:
    """Images by whether they have a footprint on the ground, and why not; no rows without images."""
    coverage, names = overview.coverage, load_texts("overview").quantities
    if coverage is None:
        return pd.DataFrame(columns=["what", "images"])
    placed, posed, flat = (int(one.sum()) for one in (coverage.placed, coverage.posed, coverage.flat))
    counts = {
        "images": len(coverage.posed),
        "footprint": placed,
        "no-pose": len(coverage.posed) - posed,
        "flat": flat,
        "away": posed - placed - flat,
        "with-detections": overview.detections[1],
    }
    return pd.DataFrame([{"what": names[key], "images": count} for key, count in counts.items()])


# -- the page


def subtitle(overview: Overview) -> str:
    """What the flight is, in a line."""
    parts, way = [quantities.duration(overview.length_s)], way_of(overview)
    if np.isfinite(way):
        parts.append(quantities.way_length(way))
    if overview.above is not None and np.isfinite(overview.above[0]).any():
        low, high = np.nanquantile(overview.above[0], [0.05, 0.95])
        if high > 0.5:
            parts.append(f"mostly {span([low, high])} m above {overview.above[1]}")
    parts.append(f"poses: {overview.source}" if overview.source else "no poses")
    return ", ".join(parts)


def tiles(overview: Overview) -> list[tuple[str, str]]:
    """The few numbers to remember."""
    names, found = load_texts("overview").subjects, []
    way = way_of(overview)
    if np.isfinite(overview.length_s):
        found.append((quantities.duration(overview.length_s), names["tile-duration"]))
    elif np.isfinite(way):
        found.append((quantities.way_length(way), names["tile-way"]))
    frames = overview.flight.frames
    if frames is not None and len(frames):
        posed = len(frames) - _without_pose(overview) if overview.source else 0
        found.append((f"{posed} / {len(frames)}", names["tile-posed"]))
    if overview.coverage is not None and overview.coverage.placed.any():
        found.append((quantities.area(overview.coverage.area_m2), names["tile-area"]))
    seen, _, placed = overview.detections
    if seen:
        pixels = overview.detections_in_images
        # A radar's are put nowhere by a camera's ray: that none is on the ground would say nothing.
        on_ground = (f"{placed} / {pixels}", names["tile-placed"])
        found.append(on_ground if pixels else (str(seen), names["tile-detections"]))
    elif overview.vibration is not None:
        found.append((f"{number(overview.vibration[0].max())} m/s²", names["tile-shaking"]))
    return found or [("0", names["tile-nothing"])]


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
        From `wildlab.analysis.overview.look_over`.
    gains, numbers
        From `wildlab.analysis.verdict`, and the numbers of the other reports behind them.
    amiss
        What cannot be used, and what does not fit together, in sentences.
    lacking
        Which reports could not be made, and why: clauses.
    judged
        How many of the other reports there are.
    """
    wording = Wording(report, load_texts("overview"))
    problems = count_problems(amiss)
    possible = possible_gain(numbers)
    counts = counts_of(overview, gains, problems, judged, possible)
    word = verdict_of(evidence_of(counts, numbers))
    error = number_of(numbers, "horizontal_error_median", "logged-pose")
    found = Judged(overview, gains, problems, word, possible, doubted(numbers), judged, error)
    report.head(wording.texts.subjects["question"], subtitle(overview))
    wording.summary(answer(found), word, reason(found, counts))
    report.tiles(tiles(overview))
    show_advice(report, wording.messages(advice(found)))
    show_contradictions(report, amiss)
    _show_figures(wording, overview)
    record(report, overview, gains, counts)
    report.limits(wording.messages(limits(overview, lacking)))
    report.section("Details")
    wording.table("coverage", coverage_table(overview))
    if overview.flight.manifest.time.kind == "utc":
        wording.table("streams", streams_table(overview))
    report.method(wording.texts.method)


def _show_figures(wording: Wording, overview: Overview) -> None:
    """Map and coverage; streams, motion, satellites and shaking folded away."""
    begin = min((pace.begin for pace in overview.streams.values() if pace.n), default=0.0)
    clock = charts.Clock(begin, overview.length_s)
    report, path, coverage = wording.report, overview.path, overview.coverage
    if path is not None:
        key = ("path", "path-trouble", "path-troubles")[min(len(overview.troubles), 2)]
        wording.figure(key, charts.path_chart(path, overview.troubles), "path", main=True)
    if coverage is not None and coverage.placed.any():
        report.section("Where it flew, and what it saw")
        wording.figure("coverage", charts.coverage_chart(coverage, path))
    row = [wording.captioned(key, fig) for key, fig in _figures_over_time(overview, clock)]
    for i in range(0, len(row), 2):
        report.figures(
            row[i : i + 2], fold="; ".join(wording.texts.figures[one[1]].title for one in row[i : i + 2])
        )


def _figures_over_time(overview: Overview, clock: charts.Clock) -> Iterator[tuple[str, Figure]]:
    named = {name: pace for name, pace in overview.streams.items() if pace.n}
    if named and overview.flight.manifest.time.kind == "utc":
        yield "streams", charts.streams_chart(named, clock)
    series, path = overview.series, overview.path
    motion = {label: dict(series[key]) for key, label in _MOTION.items() if series.get(key)}
    if overview.above is not None and path is not None and "height (m)" in motion:
        motion["height (m)"]["ground"] = path.times, -path.place[:, 2] - overview.above[0]
    attitude = series.get("attitude") or {}
    for axis, label in enumerate(charts.ANGLES if attitude else ()):
        motion[label] = {name: (times, angles[:, axis]) for name, (times, angles) in attitude.items()}
    if motion:
        yield "motion", charts.strips(motion, clock)
    if overview.vibration is not None:
        vibration, times = overview.vibration
        yield "shaking", charts.shaking_chart(vibration, times, clock)
