"""What a flight comes to, and each report on it: one verdict from numbers, which every page quotes."""

from __future__ import annotations

from collections.abc import Mapping
from enum import StrEnum
from typing import Any, NamedTuple

from wildlab.evaluation.ellipses import is_overconfident
from wildlab.evaluation.runs import Interval

#: Share of the error, of the data or of the time below which nothing is worth mending.
WORTH = 0.1
#: Share of points without a position beyond which the others tell nothing.
MANY_LOST = 0.2
#: Fewer points than this say little about a flight.
FEW_POINTS = 10

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
    if doubted or any(map(is_overconfident, found.excess)) or Verdict.LOOK in found.parts:
        return Verdict.LOOK
    sound = found.judged > found.parts.count(Verdict.UNJUDGED) or Verdict.SOUND in found.parts
    return Verdict.SOUND if sound else Verdict.UNJUDGED


def parts_of(numbers: Numbers) -> dict[str, Verdict]:
    """What the reports on a flight came to, by what they are about; those that recorded it.

    Parameters
    ----------
    numbers
        From `wildlab.analysis.overviews.recommendations.numbers_of`.

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
