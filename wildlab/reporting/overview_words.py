"""What the overview of a flight says: every sentence follows from its numbers."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pandas as pd

from wildlab.analysis.overviews.alarms import Alarm
from wildlab.analysis.overviews.image_coverage import Coverage
from wildlab.analysis.overviews.overview import Issue, Overview, length_of_way, troubled_for
from wildlab.analysis.overviews.recommendations import MOST, Gain
from wildlab.analysis.overviews.verdict import WORTH, Verdict
from wildlab.evaluation.vibration import FINE, HARMFUL, Vibration
from wildlab.reporting.text import listed, metres, percent

_CAUSES = {
    "position": "the position (north and east)",
    "height": "the height",
    "boresight": "the boresight (how the camera sits on the airframe)",
    "heading": "the heading",
    "camera's clock": "the camera's clock",
    "lens": "the lens",
}
_TITLES = {
    "images_without_pose": "Images without a pose",
    "images_without_gimbal": "Images without gimbal angles",
    "detections_off_ground": "Detections whose ray meets no ground",
    "detections_without_truth": "Detections without a truth at their time",
    "time_without_poses": "Time without poses",
    "time_without_satellites": "Time without satellite positions",
    "time_without_inertial": "Time without inertial samples",
    "inertial_samples": "Inertial samples that are missing",
    "far_out": "Points that are far out",
}
_REMEDIES = {
    "cause": "Learn it with `wildlab calibrate` and judge it on another flight with `--calibration`.",
    "far_out": "The report on the georeferencing names the photos, marks and clicks; look at these.",
    "images_without_pose": "Log poses from before the first image until after the last one, and without "
    "pauses; where they are there, look at the clocks.",
    "images_without_gimbal": "Log the gimbal from before the first image until after the last one.",
    "detections_off_ground": "Look at the height of the ground, and at where the camera looks.",
    "detections_without_truth": "Log the targets for as long as images are taken, and name them alike.",
    "time_without_poses": "Log poses for as long as anything is logged, or cut the log to the flight.",
    "time_without_satellites": "Look at the antenna, and at how often the log is written.",
    "time_without_inertial": "Look at how often the log is written, and at the card.",
    "inertial_samples": "Look at how often the log is written, and at the card.",
}


def duration_words(seconds: float) -> str:
    """``37 s``, ``25 min``, ``2 h 5 min``; says so where there is none."""
    if not np.isfinite(seconds):
        return "of unknown length"
    if seconds < 120:
        return f"{seconds:.0f} s"
    minutes = round(seconds / 60)
    return f"{minutes} min" if minutes < 120 else f"{minutes // 60} h {minutes % 60} min"


def length_words(way_m: float) -> str:
    """``840 m``, ``3.4 km``."""
    return f"{way_m:.0f} m" if way_m < 1000 else f"{way_m / 1000:.1f} km"


def area_words(area_m2: float) -> str:
    """``840 m²``, ``3.4 ha``, ``12 km²``."""
    if area_m2 < 1e4:
        return f"{area_m2:.0f} m²"
    return f"{area_m2 / 1e4:.1f} ha" if area_m2 < 1e6 else f"{area_m2 / 1e6:.1f} km²"


def way_of(overview: Overview) -> float:
    """Length of the path over the ground, m; NaN without one."""
    path = overview.path
    if path is None or len(path.times) < 2:
        return float("nan")
    if not path.timed:
        return float(np.linalg.norm(np.diff(path.place[:, :2], axis=0), axis=1).sum())
    return length_of_way(path.times, path.place[:, :2])


def gain_title(gain: Gain) -> str:
    """What it is."""
    if gain.key == "cause":
        what = listed([_CAUSES[cause] for cause in gain.causes]) if gain.causes else "what was fitted"
        return f"A constant error of {what}"
    return _TITLES[gain.key]


def gain_measured(gain: Gain) -> str:
    """What it would gain, with denominator and interval."""
    share = percent(gain.share, 0)
    if gain.key == "cause":
        return (
            f"Taking it off gains {metres(gain.value, gain.low, gain.high)} of a mean error of "
            f"{metres(gain.of)} on images that it was not estimated from: {share} of it."
        )
    if gain.key == "far_out":
        return (
            f"{gain.why} are far out; without them the mean error is {metres(gain.of - gain.value)} "
            f"and not {metres(gain.of)}: {share} less."
        )
    return f"{gain.value:.0f} of {gain.of:.0f} {gain.what} ({share})" + (
        f": {gain.why}." if gain.why else "."
    )


def gain_sentence(gain: Gain) -> str:
    """All of it, for a list."""
    return f"**{gain_title(gain)}.** {gain_measured(gain)} {_REMEDIES[gain.key]}"


def reason_words(
    problems: int, worth: int, troubled: int, judged: int, broken: int, alarmed: int,
    possible: Gain | None = None, doubts: Sequence[str] = (),
) -> str:  # fmt: skip
    """Why the verdict is what it is: what was counted, most pressing first.

    ``possible``: a gain that is not certain, one of those that are ``troubled``; ``doubts``: from
    `wildlab.analysis.overviews.recommendations.doubted`.
    """
    troubled -= possible is not None
    said = [
        f"{count} {one if count == 1 else many}"
        for count, one, many in (
            (broken, "alarm", "alarms"),
            (problems, "problem in its tables", "problems in its tables"),
            (alarmed, "thing to look at before all else", "things to look at before all else"),
            (worth, f"gain of {percent(WORTH, 0)} or more", f"gains of {percent(WORTH, 0)} or more"),
            (troubled, "thing amiss whose gain is not known", "things amiss whose gain is not known"),
        )
        if count
    ]
    if possible is not None:
        said.append(f"georeferencing: a constant error may be {percent(possible.share, 0)} of the mean error")
    if doubts:
        said.append(f"look closer at {listed(list(doubts))}")
    if said:
        return f"{', '.join(said)}."
    if not judged:
        return "No other report could judge this flight."
    return f"{judged} other {'report' if judged == 1 else 'reports'} on it, and nothing in them worth fixing."


def alarm_words(alarm: Alarm, overview: Overview) -> str:
    """One alarm as a clause: how much, and when since the first stamp."""
    begin = min((pace.begin for pace in overview.streams.values() if pace.n), default=0.0)
    at, share = f"{alarm.worst - begin:.0f} s", percent(alarm.share, 1)
    if alarm.what == "jumps":
        if alarm.often == 1:
            return f"the position jumps once, at {at}, by {length_words_fine(alarm.size)}"
        first = f"first at {alarm.first - begin:.0f} s"
        size = length_words_fine(alarm.size)
        return f"the position jumps {alarm.often} times, {first}, by up to {size} at {at}"
    if alarm.what == "leans":
        return (
            f"it leans by {alarm.size:.0f}° at {at} (by more than {alarm.limit:g}° in {share} of the poses)"
        )
    if alarm.what == "shakes":
        return (
            f"it shakes by {alarm.size:.1f} m/s² at {at} (by more than {alarm.limit:g} m/s² in {share} of "
            "the samples)"
        )
    return (
        f"the poses contradict {share} of the satellite positions, by up to "
        f"{length_words_fine(alarm.size)} at {at}"
    )


def length_words_fine(metres: float) -> str:
    """``6.7 m``, ``113 m``, ``3.4 km``."""
    return f"{metres:.1f} m" if metres < 100 else length_words(metres)


def headline(
    overview: Overview,
    word: Verdict,
    gains: Sequence[Gain],
    problems: int,
    measured: bool = True,
    possible: Gain | None = None,
    doubts: Sequence[str] = (),
) -> str:
    """The first sentence: what the flight comes to."""
    if word == Verdict.ALARM:
        return f"Something went wrong on this flight: {alarm_words(overview.alarms[0], overview)}."
    if word == Verdict.MEND and not problems:
        return f"Mend this flight first: {doubt_words(doubts)}."
    if word == Verdict.MEND:
        some = _problem_words(problems)
        return f"Mend this flight first: {some} in it cannot be used or contradict each other."
    worth = [gain for gain in gains if gain.share >= WORTH]
    if word == Verdict.FIX and not worth:
        return "Something is worth fixing: the report on the georeferencing says what."
    if word == Verdict.FIX:
        first = _lower(gain_title(worth[0]))
        more = f", and {len(worth) - 1} more" if len(worth) > 1 else ""
        return f"Something is worth fixing: {first}{more}."
    if word == Verdict.LOOK and overview.alarms:
        return f"Look closer: {alarm_words(overview.alarms[0], overview)}."
    if word == Verdict.LOOK:
        longest = [
            *troubled_for(overview, WORTH),
            *(one for one in overview.troubles if one.what == "no poses"),
        ]
        if longest:
            return f"Look closer: {_lasting(overview, longest[0])}."
        if possible:
            return f"Look closer: {_possible_words(possible)}."
        return f"Look closer: {doubt_words(doubts)}." if doubts else "Look closer."
    if word == Verdict.SOUND and not measured:
        return (
            f"Nothing was measured on this flight that is worth {percent(WORTH, 0)} of its data; how far off "
            "its positions are was not measured."
        )
    if word == Verdict.SOUND:
        return f"Nothing was measured on this flight that is worth {percent(WORTH, 0)} of its error or data."
    return "This flight is shown, not judged: none of the other reports could judge it."


def doubt_words(doubts: Sequence[str]) -> str:
    """Which other reports are not at ease, as a clause."""
    what = "report" if len(doubts) == 1 else "reports"
    asks = "asks" if len(doubts) == 1 else "ask"
    return f"the {what} on {listed(list(doubts))} {asks} for it"


def _problem_words(problems: int) -> str:
    return "one thing" if problems == 1 else f"{problems} things"


def _lasting(overview: Overview, trouble: Issue) -> str:
    share = trouble_share(overview, trouble)
    if trouble.seconds and share.startswith("0 "):
        return f"{trouble.what} for {trouble.seconds:.1f} s"
    return f"{trouble.what} for {share}" + ("" if share == INSTANT else " of the time")


def _possible_words(gain: Gain) -> str:
    return (
        f"taking a constant error off may gain {metres(gain.value, gain.low, gain.high)} of a mean error of "
        f"{metres(gain.of)}, which is not certain; the report on the georeferencing says more"
    )


def _lower(text: str) -> str:
    return f"{text[:1].lower()}{text[1:]}"


def summary_sentences(
    overview: Overview,
    word: Verdict,
    gains: Sequence[Gain],
    problems: int,
    lacking: Sequence[str],
    measured: bool = True,
    possible: Gain | None = None,
    doubts: Sequence[str] = (),
) -> list[str]:
    """The summary: the verdict, its measure, and what could not be judged.

    ``measured``: whether any report measured how far off positions are; ``possible``: a gain that is not
    certain; ``doubts``: other reports that ask for a closer look.
    """
    first = headline(overview, word, gains, problems, measured, possible, doubts)
    said = [first]
    more = [clause for one in overview.alarms if (clause := alarm_words(one, overview)) not in first]
    if more:
        said.append(f"Also: {'; '.join(more)}.")
    if gains:
        what = "" if word == Verdict.FIX else f"The most to gain: {_lower(gain_title(gains[0]))}. "
        said.append(f"{what}{gain_measured(gains[0])}")
    elif word != Verdict.SOUND and not possible:
        said.append("No gain was measured that mending anything would bring.")
    # Jumps are instants and have been said.
    lasting = [one for one in overview.troubles if one.seconds >= 1 and one.what not in first]
    if lasting:
        said.append(f"Along the path: {_lasting(overview, max(lasting, key=lambda one: one.seconds))}.")
    if lacking:
        said.append(f"Not judged: {'; '.join(lacking)}.")
    return said


def subtitle(overview: Overview) -> str:
    """What the flight is, in a line."""
    way = way_of(overview)
    parts = [duration_words(overview.length_s)]
    if np.isfinite(way):
        parts.append(length_words(way))
    if overview.above is not None:
        low, high = np.nanquantile(overview.above[0], [0.05, 0.95]) if _any(overview.above[0]) else (0, 0)
        if height := height_words(low, high):
            parts.append(f"mostly {height} above {overview.above[1]}")
    parts.append(f"poses: {overview.source}" if overview.source else "no poses")
    return ", ".join(parts)


def height_words(low: float, high: float) -> str:
    """Between which heights (m): ``"59 to 61 m"``, ``"60 m"``; nothing where it never left the ground."""
    below, above = round(low), round(high)
    return f"{below} to {above} m" if below != above else f"{above} m" if above else ""


def _any(values: np.ndarray) -> bool:
    return bool(np.isfinite(values).any())


def path_title(overview: Overview) -> str:
    """What is wrong along the path, in a line; where nothing is, of what it was looked for."""
    if not overview.searched:
        return "What may be wrong along the path was not looked at"
    jumps = next((one for one in overview.troubles if one.what == "position jumps"), None)
    if jumps is not None:
        return "Along the path: " + (
            "the position jumps" if len(jumps.spells) == 1 else f"{len(jumps.spells)} jumps"
        )
    if overview.alarms and not overview.troubles:
        return f"Along the path: {_SHORT[overview.alarms[0].what]}"
    if not overview.troubles:
        return f"No gaps, jumps or shaking were found in {listed(list(overview.searched))}"
    worst = max(overview.troubles, key=lambda one: one.seconds)
    if not np.isfinite(overview.length_s) or overview.length_s <= 0 or worst.seconds < 1:
        return f"Along the path: {worst.what}"
    return f"{trouble_share(overview, worst)} of the time: {worst.what}"


#: Alarms in a word or two.
_SHORT = {
    "jumps": "the position jumps",
    "leans": "leans",
    "apart": "poses beside the satellites",
    "shakes": "shakes",
}
#: What lasts for no time.
INSTANT = "an instant"


def trouble_share(overview: Overview, trouble: Issue) -> str:
    """Share of the time; an instant has none."""
    if not trouble.seconds or not overview.length_s > 0:
        return INSTANT
    return percent(min(1.0, trouble.seconds / overview.length_s), 0)


def coverage_sentences(coverage: Coverage, detections: tuple[int, int, int]) -> list[str]:
    """Area, overlap, and which images are not in them."""
    placed, posed = int(coverage.placed.sum()), int(coverage.posed.sum())
    said = [
        f"{placed} of {coverage.images} images have a footprint on {coverage.ground}; together they show "
        f"{area_words(coverage.area_m2)}."
    ]
    if placed:
        said.append(
            f"A place in it is in {coverage.looks:.1f} images in the mean; "
            f"{percent(coverage.twice, 0)} of it is "
            "in two or more."
        )
    if coverage.images > posed:
        said.append(f"{coverage.images - posed} images have no pose or no gimbal angles.")
    if flat := int(coverage.flat.sum()):
        said.append(f"{flat} look too near the horizon to have a footprint.")
    if away := posed - placed - flat:
        said.append(f"The view of {away} leaves the ground that is known.")
    count, images, located = detections
    if count:
        said.append(
            f"{count} detections lie in {images} of {coverage.images} images "
            f"({percent(images / coverage.images, 0)}); {located} have a place on the ground."
        )
    return said


def streams_title(overview: Overview) -> str:
    """How many pauses, and the longest."""
    gaps = [(gap[1] - gap[0], name) for name, pace in overview.streams.items() for gap in pace.gaps]
    if not gaps:
        return "No stream pauses"
    longest, name = max(gaps)
    count = "One pause" if len(gaps) == 1 else f"{len(gaps)} pauses"
    return f"{count}; the longest, of {name}, {longest:.1f} s"


def streams_table(overview: Overview) -> pd.DataFrame:
    """A row for each stream: samples, rate, how much the steps waver, what is missing, pauses."""
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


def shaking_sentence(found: Vibration) -> str:
    """How much it shakes, against the limits."""
    worst = found.worst
    usual, most = float(np.median(worst)), float(worst.max())
    digits = 1 if most >= 1 else 2
    said = f"It shakes by {usual:.{digits}f} m/s² in the median and {most:.{digits}f} m/s² at most"
    above = found.share_above(FINE)
    if above:
        harmful = found.share_above(HARMFUL)
        also = f", and above {HARMFUL:g} in {percent(harmful, 1)}" if harmful else ""
        said += f"; above {FINE:g} in {percent(above, 1)} of the samples{also}"
    return f"{said}."


def shaking_title(found: Vibration) -> str:
    """The verdict by the limits."""
    if found.share_above(HARMFUL):
        return f"It shakes by more than {HARMFUL:g} m/s²"
    if found.share_above(FINE):
        return f"It shakes by more than {FINE:g} m/s² at times"
    return f"It shakes by less than {FINE:g} m/s²"


def bands_title(found: Vibration) -> str:
    """Where most of it is."""
    strongest = int(np.argmax((found.rms**2).sum(axis=1)))
    low, high = found.bands[strongest]
    return f"Most of it is between {low:.0f} and {high:.0f} Hz"


def first_of(gains: Sequence[Gain], possible: Gain | None = None) -> str:
    """What is said above the list."""
    shown = min(MOST, len(gains))
    if not gains:
        if possible:
            return f"No gain is certain. Possible: {_possible_words(possible)}."
        return "Nothing was measured that would gain metres for certain, or bring back data."
    if len(gains) == 1:
        return "One thing. Only what was measured is listed."
    of = f" of {len(gains)}" if len(gains) > shown else ""
    order = "by the share of the error or of the data that each would gain"
    return f"{shown}{of} things, {order}. Only what was measured is listed."
