"""What is most worth fixing on a flight, by what was measured: metres gained, or data that would not be lost.

A gain in metres is one that the report on the georeferencing measured on images which a correction was not
estimated from. Data that are lost are counted. Both are put in order by their share: of the error, or of the
data.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from typing import Any, NamedTuple

from wildlab.analysis.overviews.lost import Recovered
from wildlab.analysis.overviews.overview import Overview
from wildlab.analysis.overviews.verdict import WORTH, Numbers, Verdict, parts_of

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


class Gain(NamedTuple):
    """One thing to fix.

    Attributes
    ----------
    key
        ``cause``, ``far_out``, or what is lost: `wildlab.analysis.overviews.lost.Recovered`.
    causes
        Of a constant error, which; else empty.
    value, low, high, unit
        What is gained, with its interval where there is one: metres, or how many.
    of, what
        Of how many, or of how many metres; what they are.
    share
        Of the error or of the data.
    why
        What is known of the reason, as a clause; may be empty.
    """

    key: str
    causes: tuple[str, ...]
    value: float
    low: float
    high: float
    unit: str
    of: float
    what: str
    share: float
    why: str


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
    found = [*_metres(numbers), *(_data(one) for one in overview.lost)]
    return sorted((one for one in found if one.share >= LISTED), key=lambda one: -one.share)


def _metres(numbers: Numbers) -> Iterable[Gain]:
    gain, left = numbers.get(("gain", "winner")), error_left(numbers)
    if gain is not None and left is not None and _known(gain["value"]):
        before = gain["value"] + left
        causes = causes_told(numbers)
        low, high = (math.nan if gain[end] is None else float(gain[end]) for end in ("low", "high"))
        share = gain["value"] / before if before > 0 else 0.0
        yield Gain("cause", causes, gain["value"], low, high, "m", before, "mean error", share, "")
    far = numbers.get(("gain", "without-far-out"))
    rest = numbers.get(("horizontal_error_mean", "without-far-out"))
    points = numbers.get(("points_far_out", "winner"))
    if far and rest and points and _known(far["value"], rest["value"], points["value"]):
        before = far["value"] + rest["value"]
        share = far["value"] / before if before > 0 else 0.0
        why = f"{points['value']:.0f} of {points['n']} points"
        yield Gain("far_out", (), far["value"], math.nan, math.nan, "m", before, "mean error", share, why)


def error_left(numbers: Numbers) -> float | None:
    """The mean error with a cause taken off whose gain is certain, m; None where none is.

    Of the points that the gain is of: without those that are far out, where some are.

    Parameters
    ----------
    numbers
        From `numbers_of`.

    Returns
    -------
    float or None
    """
    left = numbers.get(("horizontal_error_mean", "calibrated-pose"))
    if left is not None:
        left = numbers.get(("horizontal_error_mean", "without-far-out"), left)
    return None if left is None or not _known(left["value"]) else float(left["value"])


def _known(*values: Any) -> bool:
    return all(value is not None and math.isfinite(value) for value in values)


def _data(lost: Recovered) -> Gain:
    nan = math.nan
    return Gain(
        lost.key, (), float(lost.lost), nan, nan, "1", float(lost.of), lost.what, lost.share, lost.why
    )


def error_measured(numbers: Numbers) -> bool:
    """Whether any report beside measured how far off positions on the ground are."""
    return any(name == "horizontal_error_mean" and _known(one["value"]) for (name, _), one in numbers.items())


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
    gain, before = numbers.get(("gain", "winner")), numbers.get(("horizontal_error_mean", "logged-pose"))
    if gain is None or before is None or not _known(gain["value"], before["value"]):
        return None
    certain = ("horizontal_error_mean", "calibrated-pose") in numbers
    if not is_possible(gain["value"], before["value"], certain=certain):
        return None
    low, high = (math.nan if gain[end] is None else float(gain[end]) for end in ("low", "high"))
    value, of = float(gain["value"]), float(before["value"])
    return Gain("possible", (), value, low, high, "m", of, "mean error", value / of, "")


def doubted(numbers: Numbers) -> tuple[str, ...]:
    """Which of the other reports ask for something that is not among the gains.

    Parameters
    ----------
    numbers
        From `numbers_of`.

    Returns
    -------
    tuple of str
        Of `wildlab.analysis.overviews.verdict.PARTS`.
    """
    told = possible_gain(numbers) is not None
    return tuple(
        about
        for about, verdict in parts_of(numbers).items()
        if verdict.level >= Verdict.LOOK.level
        and not (about == "georeferencing" and (verdict == Verdict.FIX or (verdict == Verdict.LOOK and told)))
    )
