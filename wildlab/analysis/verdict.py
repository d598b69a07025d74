"""What a flight comes to, and each report on it: one verdict from numbers, and what would gain most."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from enum import StrEnum
from typing import Any, NamedTuple

from wildlab.analysis.georeference import FEW_POINTS
from wildlab.analysis.overview import Gain, Overview
from wildlab.evaluation.ellipses import is_conservative, is_overconfident
from wildlab.evaluation.intervals import Interval

#: Share of the error, of the data or of the time below which nothing is worth mending.
WORTH = 0.1
#: Share of points without a position beyond which the others tell nothing.
MANY_LOST = 0.2

#: Numbers of reports by name and subject, as ``metrics.json`` has them.
Numbers = Mapping[tuple[str, str], Mapping[str, Any]]
#: The metric of what a report comes to, by what it is about: `Verdict.level`.
VERDICT_LEVEL = "verdict_level"
#: The reports whose verdicts are in that of the flight.
PARTS = ("georeferencing", "navigation", "tracking")


class Verdict(StrEnum):
    """The most pressing first; of what nothing could be told, and where nothing presses."""

    ALARM = "went wrong"
    MEND = "mend first"
    FIX = "worth fixing"
    LOOK = "look closer"
    SOUND = "sound"
    UNJUDGED = "not judged"

    @property
    def colour(self) -> str:
        """Of the summary: ``bad``, ``warn``, ``good`` or ``neutral``."""
        return {"SOUND": "good", "UNJUDGED": "neutral", "ALARM": "bad", "MEND": "bad"}.get(self.name, "warn")

    @property
    def level(self) -> int:
        """As a number: 4 where it presses most, 0 for sound, -1 where nothing could be judged."""
        return 4 - list(Verdict).index(self)


class Evidence(NamedTuple):
    """Numbers that a verdict follows from. What was not measured is NaN, and never tells against a flight.

    Attributes
    ----------
    broken, alarmed
        Alarms by which the flight or its poses went wrong for certain, and others.
    problems
        Things in its tables that cannot be used or contradict each other.
    lost
        Share of points without a position.
    gain, possible
        Largest share of the error or of the data that mending one thing gains for certain; may gain.
    troubled
        Things that are wrong along the path, or far out, whose gain is not known.
    points
        Points that were compared with the truth.
    excess
        By what errors exceed those predicted, a factor with its interval; of several filters or ellipses.
    judged
        Reports, or other ways, by which errors could be judged at all.
    parts
        Verdicts of the other reports on the flight.
    """

    broken: int = 0
    alarmed: int = 0
    problems: int = 0
    lost: float = float("nan")
    gain: float = float("nan")
    possible: float = float("nan")
    troubled: int = 0
    points: float = float("nan")
    excess: tuple[Interval, ...] = ()
    judged: int = 0
    parts: tuple[Verdict, ...] = ()


def verdict_of(found: Evidence) -> Verdict:
    """What a flight, or one report on it, comes to.

    Parameters
    ----------
    found
        Of the flight, with the verdicts of its reports; or of one report.

    Returns
    -------
    Verdict

    Examples
    --------
    >>> verdict_of(Evidence(gain=0.2, judged=1)).value, verdict_of(Evidence(problems=1, gain=0.2)).value
    ('worth fixing', 'mend first')
    >>> verdict_of(Evidence(excess=(Interval(1.3, 1.1, 1.6),), judged=1)).value
    'look closer'
    >>> verdict_of(Evidence(judged=1, parts=(Verdict.LOOK,))).value, verdict_of(Evidence()).value
    ('look closer', 'not judged')
    """
    if found.broken or Verdict.ALARM in found.parts:
        return Verdict.ALARM
    if found.problems or found.lost > MANY_LOST or Verdict.MEND in found.parts:
        return Verdict.MEND
    # What is to be looked at before all else is not covered by what is worth fixing.
    if found.alarmed:
        return Verdict.LOOK
    if found.gain >= WORTH or Verdict.FIX in found.parts:
        return Verdict.FIX
    doubted = found.possible >= WORTH or found.troubled or found.points < FEW_POINTS
    doubted |= any(is_overconfident(one) or is_conservative(one) for one in found.excess)
    if doubted or Verdict.LOOK in found.parts:
        return Verdict.LOOK
    sound = found.judged > found.parts.count(Verdict.UNJUDGED) or Verdict.SOUND in found.parts
    return Verdict.SOUND if sound else Verdict.UNJUDGED


def parts_of(numbers: Numbers) -> dict[str, Verdict]:
    """What the reports on a flight came to, by what they are about; those that recorded it.

    Parameters
    ----------
    numbers
        From `wildlab.analysis.verdict.numbers_of`.

    Returns
    -------
    dict
    """
    by_level = {one.level: one for one in Verdict}
    levels = {about: numbers.get((VERDICT_LEVEL, about), {}).get("value") for about in PARTS}
    return {about: by_level[int(level)] for about, level in levels.items() if level is not None}


def evidence_of(counts: Mapping[str, float], numbers: Numbers) -> Evidence:
    """What a flight's verdict follows from.

    Parameters
    ----------
    counts
        ``broken``, ``alarmed``, ``problems``, ``troubled`` and ``judged`` as in `Evidence`, and ``worth``:
        gains of `WORTH` or more.
    numbers
        Of its other reports, as for `parts_of`.

    Returns
    -------
    Evidence
    """
    return Evidence(
        broken=int(counts["broken"]),
        alarmed=int(counts["alarmed"]),
        problems=int(counts["problems"]),
        gain=WORTH if counts["worth"] else float("nan"),
        troubled=int(counts["troubled"]),
        judged=int(counts["judged"]),
        parts=tuple(parts_of(numbers).values()),
    )


#: Share below which a gain is not listed.
LISTED = 0.005
#: How many are listed.
MOST = 3

#: Which parameters of a calibration tell which cause, by the names of their metrics.
CAUSES = {
    "position": ("north_offset", "east_offset"),
    "height": ("down_offset",),
    "boresight": ("boresight_roll", "boresight_tilt", "boresight_pan"),
    "heading": ("heading_offset",),
    "camera's clock": ("clock_offset",),
    "lens": ("focal_offset", "aspect_offset", "centre_u_offset", "centre_v_offset", "radial_offset"),
}


def numbers_of(documents: Iterable[Mapping[str, Any]]) -> dict[tuple[str, str], Mapping[str, Any]]:
    """Numbers of ``metrics.json`` documents by name and subject; the first of equal ones.

    Parameters
    ----------
    documents
        As `wildlab.reporting.metrics.read_metrics` gives them.

    Returns
    -------
    dict
    """
    found: dict[tuple[str, str], Mapping[str, Any]] = {}
    for document in documents:
        for entry in document["metrics"]:
            found.setdefault((entry["name"], entry["subject"]), entry)
    return found


def causes_told(numbers: Numbers) -> tuple[str, ...]:
    """The causes of a calibration that have a parameter told from zero; all of them where none has.

    Parameters
    ----------
    numbers
        From `numbers_of`, with those of the calibration and their intervals.

    Returns
    -------
    tuple of str
        Of `CAUSES`. A parameter without an interval counts as told.

    Examples
    --------
    >>> size = {"value": -1.1, "low": -2.7, "high": 0.5}
    >>> both = {("down_offset", "calibration"): size, ("clock_offset", "calibration"): {**size, "high": -1.0}}
    >>> causes_told(both)
    ("camera's clock",)
    """
    fitted = {name: entry for (name, subject), entry in numbers.items() if subject == "calibration"}

    def told(name: str) -> bool:
        low, high = fitted[name].get("low"), fitted[name].get("high")
        return low is None or high is None or not low <= 0 <= high

    there = [cause for cause, names in CAUSES.items() if fitted.keys() & set(names)]
    named = [cause for cause in there if any(map(told, fitted.keys() & set(CAUSES[cause])))]
    return tuple(named or there)


def gains_of(overview: Overview, numbers: Numbers) -> list[Gain]:
    """Everything that was measured to be worth something, most first.

    Parameters
    ----------
    overview
        Of the flight.
    numbers
        Of its other reports, from `numbers_of`; may be empty.

    Returns
    -------
    list of Gain
    """
    found = [*metric_gains(numbers), *overview.lost]
    return sorted((one for one in found if one.share >= LISTED), key=lambda one: -one.share)


def metric_gains(numbers: Numbers) -> Iterable[Gain]:
    """What taking errors off gains, metres; parameters as of `gains_of`."""
    gain, points = number_of(numbers, "gain", "winner"), numbers.get(("points_far_out", "winner"))
    # Of the points that the gain is of: without those that are far out, where some are.
    far, kept = (number_of(numbers, one, "without-far-out") for one in ("gain", "horizontal_error_mean"))
    left = number_of(numbers, "horizontal_error_mean", "calibrated-pose")
    left = kept if math.isfinite(kept + left) else left
    if math.isfinite(gain + left):
        yield Gain("cause", causes_told(numbers), gain, gain + left, _share(gain, gain + left))
    if points and points["value"] is not None and math.isfinite(far + kept):
        yield Gain("far_out", (), far, far + kept, _share(far, far + kept))


def number_of(numbers: Numbers, name: str, subject: str) -> float:
    """A number of the other reports; NaN where none has it."""
    value = numbers.get((name, subject), {}).get("value")
    return float("nan") if value is None else float(value)


def _share(gain: float, before: float) -> float:
    return gain / before if before > 0 else 0.0


def is_possible(gain_m: float, mean_m: float, *, certain: bool) -> bool:
    """Whether a gain that is not certain is large enough to look closer: the rule of all parts of a flight.

    Parameters
    ----------
    gain_m
        Estimate of what taking a constant error off gains.
    mean_m
        The mean error as logged.
    certain
        Whether the gain is certain.

    Returns
    -------
    bool

    Examples
    --------
    >>> is_possible(0.3, 1.7, certain=False), is_possible(0.1, 1.7, certain=False)
    (True, False)
    """
    return not certain and mean_m > 0 and gain_m >= WORTH * mean_m


def possible_gain(numbers: Numbers) -> Gain | None:
    """What taking a constant error off may gain, where that is not certain; None where it is, or is small.

    Parameters
    ----------
    numbers
        Of the flight's other reports, from `numbers_of`.

    Returns
    -------
    Gain or None
        Of `WORTH` of the mean error as logged, or more.
    """
    gain = number_of(numbers, "gain", "winner")
    before = number_of(numbers, "horizontal_error_mean", "logged-pose")
    certain = ("horizontal_error_mean", "calibrated-pose") in numbers
    if not is_possible(gain, before, certain=certain):
        return None
    return Gain("possible", (), gain, before, gain / before)


def doubted(numbers: Numbers) -> tuple[str, ...]:
    """Which of the other reports ask for something that is not among the gains.

    Parameters
    ----------
    numbers
        From `numbers_of`.

    Returns
    -------
    tuple of str
        Of `wildlab.analysis.verdict.PARTS`.
    """
    told = possible_gain(numbers) is not None
    return tuple(
        about
        for about, verdict in parts_of(numbers).items()
        if verdict.level >= Verdict.LOOK.level
        and not (about == "georeferencing" and (verdict == Verdict.FIX or (verdict == Verdict.LOOK and told)))
    )
