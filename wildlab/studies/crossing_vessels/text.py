"""What the report on crossing vessels says, as the computed numbers have it."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import pandas as pd
from scipy.special import bdtr

from wildlab.evaluation.runs import share_interval
from wildlab.reporting.spread import bounds_of, range_clause, range_words, spread_words
from wildlab.reporting.text import percent
from wildlab.studies.crossing_vessels.trial import (
    DISTANCE,
    FEATURES,
    LOOKS,
    NEAR_M,
    SEPARATIONS,
    STATE,
    VETO,
    curve_subject,
)
from wildlab.studies.crossing_vessels.trial.joint import JOINT, SENSOR, TARGETS

#: H 6.4.4: five of boat 1, none of boat 2.
PUBLISHED_WRONG = 5
NAMES = {
    DISTANCE: "distance alone",
    FEATURES: "distance and features",
    VETO: "distance, features as a veto",
    STATE: "distance and features, both estimated",
    JOINT: "distance, shared by probability (JIPDA)",
}

METHOD = r"""Where and when each vessel is detected comes from the twin, with the printed numbers of
detections. The pixels go to the sea with the poses of an autopilot (H 5.13), and each track is a Kalman
filter with constant velocity (H 6.2) and the printed tuning: $\sigma_v = 0.2$ m/s², measurements of 17.5 m,
starts of 17.5 m and 5 m/s. The thesis gives 0.05 of the height for the 17.5 m, which is a height of 350 m,
and flies at about 300 m; 17.5 m is taken. Noise of the process is held from image to image.

Association is global nearest neighbour (H 3.3.1) within a gate of 99 %: on the squared distance of (3.9), on
its sum with that of the features, or on the distance with a veto of what does not look alike. Or the features
are part of the state (H 6.4.4 has that for later): a Kalman filter estimates what does not change, the gate
of 99 % is on place and features together, and what is outside of it may start a track. A track starts on
detections in two consecutive images, keeps the mean of their features unless it estimates them, and does not
end. The thesis prints
neither weights nor spreads of features. Here all weights are one; a detection's spread is told as 0.1 in the
logarithm of its size in m², 8 counts of intensity and 0.05 in the logarithm of Hu's first moment, about what
rendered images of other flights had.

What a detection looks like is drawn from images of the same flight, rendered and searched with the seven
steps of H 4.3, of the same vessel. An association is wrong where a detection goes to a track that the other
vessel's detection started. Tracks are swapped where more than half of each vessel's detections go wrong,
in the two minutes from when the two are 35 m apart again; at the end, in the last two minutes."""
METHOD += f"""

Beside these rules stands joint integrated probabilistic data association with visibility (H 8.2), by distance
alone and with the same noises; it is told besides that a vessel in view is detected in
{100 * SENSOR.detection:.0f} % of the images, that it is in view for {TARGETS.visible_s:g} s and out of it for
{TARGETS.hidden_s:g} s, and that hardly anything else is detected. Each track is updated with both detections,
weighed by how probable each is. There a vessel's track is the one that is on it most often, and tracks are
swapped where each vessel has the other's from before the crossing."""

LIMITS = [
    "How the vessels looked is not printed: their lengths of 11 m and 7 m, warmth and wakes are chosen, and "
    "how different they look follows from that. The curve over the separation is free of it.",
    "Courses and the angle at which the paths cross are chosen: a small one, so that the two stay together "
    "for long.",
    "Looks are drawn one by one, and in truth those of neighbouring images go together: cut at the border, a "
    "vessel is too small for as long as it is there.",
    "Drawn detections are of the two vessels alone: there is no false alarm among them, and no third vessel.",
]


def counted(count: int, of: int) -> str:
    """A count of so many, with the interval of its share.

    Examples
    --------
    >>> counted(8, 10), counted(98, 4837), counted(0, 0)
    ('8 of 10 (49 to 94 %)', '98 of 4837 (1.7 to 2.5 %)', 'none of 0')
    """
    if not of:
        return "none of 0"
    found = share_interval(count, of)
    ends = 100 * found.low, 100 * found.high
    digits = 0 if round(ends[0]) != round(ends[1]) else 1
    return f"{count} of {of} ({ends[0]:.{digits}f} to {ends[1]:.{digits}f} %)"


def swap_words(spread: pd.DataFrame, subject: str) -> str:
    """On how many flights the tracks were swapped, with the interval where there are several.

    Examples
    --------
    >>> table = pd.DataFrame({("veto", "swapped"): [1.0] + [0.0] * 9})
    >>> swap_words(table, "veto")
    '1 of 10 flights (2 to 40 %)'
    """
    count, n = int(spread[subject, "swapped"].sum()), int(spread[subject, "swapped"].notna().sum())
    if n == 0:
        return "nan flights"
    if n == 1:
        return "the one flight" if count else "no flight of one"
    found = share_interval(count, n)
    return f"{count} of {n} flights ({100 * found.low:.0f} to {100 * found.high:.0f} %)"


def summary(spread: pd.DataFrame) -> list[str]:
    """Three sentences on what `trial.trial` gives, one row for each flight."""
    near = spread[FEATURES, "near_share"]
    wrong = {subject: spread[subject, "wrong"] for subject in (DISTANCE, FEATURES)}
    of = spread[LOOKS, "detections"].median()
    return [
        f"By distance alone the tracks of two vessels that cross are swapped on "
        f"{swap_words(spread, DISTANCE)}; with what the vessels look like, on "
        f"{swap_words(spread, FEATURES)}.",
        f"Of {of:.0f} detections so many go to the wrong track: by distance alone "
        f"{_counted(wrong[DISTANCE])}; with features {_counted(wrong[FEATURES])}. Published are "
        f"{PUBLISHED_WRONG}, on one flight.",
        f"With features the vessel that is followed worse is within {NEAR_M:.0f} m of its track for "
        f"{percent(near.median())} of the images since that began, in the median{_percent_range(near)}.",
    ]


def _counted(values: pd.Series) -> str:
    """A count of each flight: the median and the range, or the one number that all flights have."""
    n, same = len(values), values.min() == values.max()
    if n == 1 or same:
        return f"{values.iloc[0]:.0f}" + (f" on each of {n} flights" if n > 1 else "")
    # A range of nine in ten may hide the one flight on which it all went wrong.
    hidden = values.max() > bounds_of(values)[1]
    most = f", at most {values.max():.0f}" if hidden else ""
    return f"{values.median():.0f} in the median ({range_words(values, 0)} {spread_words(n).on}{most})"


def _percent_range(values: pd.Series) -> str:
    words = range_clause(100 * values, 0)
    return words.replace(" on ", " % on ", 1) if words else ""


def outcome_table(spread: pd.DataFrame) -> pd.DataFrame:
    """One row for each rule: medians over flights, and the flights swapped."""
    columns = ("wrong", "unassigned", "tracks", "swaps", "breaks", "mae", "gospa", "anees")
    rows = []
    for subject, words in NAMES.items():
        middle = {
            name: float(spread[subject, name].median()) if (subject, name) in spread else np.nan
            for name in columns
        }
        rows.append({"rule": words, "swapped": swap_words(spread, subject), **middle})
    return pd.DataFrame(rows)


#: Headings of `outcome_table`.
OUTCOME_COLUMNS = {
    "rule": "association by",
    "swapped": "swapped",
    "wrong": "wrong",
    "unassigned": "to no track",
    "tracks": "tracks",
    "swaps": "swaps",
    "breaks": "breaks",
    "mae": "off (m)",
    "gospa": "GOSPA (m)",
    "anees": "ANEES (2 is honest)",
}
OUTCOME_CAPTION = (
    "Medians over flights. Swaps count each track that goes to another vessel, breaks a vessel that gets a "
    "new track; off is the mean distance of a vessel from the first track that it started; GOSPA has a "
    "cut-off of 35 m and counts vessels in the image. ANEES is of both coordinates of a position together, "
    "so that 2 is honest and more is too sure of itself; half of it, NEES / 2, is honest at 1."
)


def veto_words(spread: pd.DataFrame) -> str:
    """What the veto costs and spares beside features that are weighed in."""
    wrong, other = (float(spread[subject, "wrong"].median()) for subject in (VETO, FEATURES))
    left, kept = (float(spread[subject, "unassigned"].median()) for subject in (VETO, FEATURES))
    if wrong < other:
        compared = f"leaves fewer wrong, {wrong:.0f} in place of {other:.0f}"
    elif wrong > other:
        compared = f"leaves more wrong, {wrong:.0f} in place of {other:.0f}"
    else:
        compared = f"leaves as many wrong, {wrong:.0f}"
    return (
        f"As a veto on what was associated by distance, appearance {compared}; {left:.0f} detections go to "
        f"no track, with features weighed in {kept:.0f} (medians)."
    )


def state_words(spread: pd.DataFrame) -> str:
    """What it changes to estimate features in place of keeping the first ones, on the same flights."""
    middle = {
        name: [float(spread[rule, name].median()) for rule in (STATE, FEATURES)]
        for name in ("wrong", "tracks", "unassigned")
    }
    wrong, tracks, left = middle.values()
    counts = (
        f"With features that are estimated in the state the tracks are swapped on "
        f"{swap_words(spread, STATE)}, with those of the start weighed in on {swap_words(spread, FEATURES)}"
    )
    return (
        f"{counts}{_beside(spread, STATE, FEATURES)} Medians of detections that go to the wrong track: "
        f"{wrong[0]:.0f} and {wrong[1]:.0f}; of those that go to none: {left[0]:.0f} and {left[1]:.0f}; of "
        f"tracks: {tracks[0]:.0f} and {tracks[1]:.0f}."
    )


def looks_words(spread: pd.DataFrame) -> str:
    """How far apart the two look in rendered images."""
    apart = {
        words: float(spread[LOOKS, f"separation_{name}"].median())
        for name, words in (("size", "size"), ("intensity", "intensity"), ("hu", "Hu's first moment"))
    }
    parts = ", ".join(f"{words} {value:.1f}" for words, value in apart.items())
    said = (
        f"In rendered images the means of the two differ by so many spreads within a vessel: {parts} "
        "(medians over flights)."
    )
    known = {words: round(value, 1) for words, value in apart.items() if np.isfinite(value)}
    best = [words for words, value in known.items() if value > 0 and value == max(known.values())]
    if len(best) != 1 or len(known) < len(apart):
        return said
    return f"{said} {best[0][0].upper()}{best[0][1:]} tells them apart best."


def curve_words(spread: pd.DataFrame) -> str:
    """From which separation on a made-up feature serves."""
    swapped = {at: spread[curve_subject(at), "swapped"] for at in SEPARATIONS}
    if any(one.isna().any() for one in swapped.values()):
        return ""
    counts = {at: int(one.sum()) for at, one in swapped.items()}
    none = [at for at in SEPARATIONS if all(counts[further] == 0 for further in SEPARATIONS if further >= at)]
    n = len(spread)
    parts = ", ".join(f"{count} at {at}" for at, count in counts.items())
    first = (
        f"At a difference of {none[0]} and more no flight of {n} is swapped."
        if none
        else f"At {max(SEPARATIONS)} spreads {counts[max(SEPARATIONS)]} of {n} flights are still swapped."
    )
    return (
        "One feature, made up, normal and new in each image, with a known difference between the two vessels "
        f"in units of its spread. Flights swapped: {parts}. {first} {_harm_words(spread)} "
        f"{as_published_words(spread)}"
    )


def joint_words(spread: pd.DataFrame) -> str:
    """Whether sharing detections by probability swaps more or fewer tracks, on the same flights."""
    counts = (
        f"Shared by probability, detections leave the tracks swapped on {swap_words(spread, JOINT)}, given "
        f"to one track each on {swap_words(spread, DISTANCE)}"
    )
    return f"{counts}{_beside(spread, JOINT, DISTANCE)}"


def _beside(spread: pd.DataFrame, one: str, other: str) -> str:
    """How often one rule swaps and the other does not, by a sign test."""
    mine, theirs = (spread[rule, "swapped"].to_numpy(bool) for rule in (one, other))
    more, fewer = int((mine & ~theirs).sum()), int((theirs & ~mine).sum())
    if beyond_chance(more, fewer):
        return f": on {'more' if more > fewer else 'fewer'} of them, beyond chance."
    return "; that one swaps fewer than the other cannot be told."


def _flights(count: int) -> str:
    return "1 flight" if count == 1 else f"{count} flights"


def _harm_words(spread: pd.DataFrame) -> str:
    """What a feature that tells nothing does to swaps and to detections, on the same flights (sign tests)."""
    useless, alone = (spread[one, "swapped"].to_numpy(bool) for one in (curve_subject(0), DISTANCE))
    worse, better = int((useless & ~alone).sum()), int((alone & ~useless).sum())
    counts = f"{_flights(int(useless.sum()))} swapped with it, {int(alone.sum())} without"
    if beyond_chance(worse, better):
        said = f"A feature that tells nothing makes {'more' if worse > better else 'fewer'} flights swap"
    else:
        said = "Whether a feature that tells nothing makes more flights swap cannot be told"
    return f"{said}: {counts}. {_stray_words(spread)}"


def _stray_words(spread: pd.DataFrame) -> str:
    """Of how many detections such a feature makes more go to the wrong track, by the flights that differ."""
    useless, alone = (spread[one, "wrong"].to_numpy(float) for one in (curve_subject(0), DISTANCE))
    more, fewer, n = int((useless > alone).sum()), int((useless < alone).sum()), len(spread)
    medians = f"{np.median(useless):.0f} with it, {np.median(alone):.0f} without (medians)"
    if not more + fewer:
        return f"Detections that go to the wrong track: as many on every flight, {medians}."
    told = "" if beyond_chance(more, fewer) else ", which chance may have done too"
    on = f"more on {more} of {_flights(n)}, fewer on {fewer}{told}"
    return f"Detections that go to the wrong track: {medians}; {on}."


def beyond_chance(one_way: int, other_way: int) -> bool:
    """Whether flights that differ do so more one way than a fair coin would have it, by 5 % (sign test).

    Examples
    --------
    >>> beyond_chance(5, 0), beyond_chance(6, 0), beyond_chance(0, 0)
    (False, True, False)
    """
    either = one_way + other_way
    return bool(either) and bool(2 * bdtr(min(one_way, other_way), either, 0.5) < 0.05)


def as_published_words(spread: pd.DataFrame) -> str:
    """At which separations the median of the wrong detections is no more than the published one."""
    middle = [float(spread[curve_subject(at), "wrong"].median()) for at in SEPARATIONS]
    few = [at for at, count in zip(SEPARATIONS, middle, strict=True) if count <= PUBLISHED_WRONG]
    if not few:
        return f"As few wrong as published, {PUBLISHED_WRONG}, are reached at none of these."
    where = "all of these" if len(few) == len(SEPARATIONS) else ", ".join(map(str, few))
    return f"As few wrong as published, {PUBLISHED_WRONG}, are reached at {where} (median of the flights)."


def end_words(spread: pd.DataFrame) -> str:
    """Whether a swap lasts."""
    swapped = spread[DISTANCE, "swapped"] > 0
    if not swapped.any():
        return "On no flight are the tracks swapped by distance alone, so there is nothing to recover from."
    lasting = int((swapped & (spread[DISTANCE, "swapped_at_end"] > 0)).sum())
    return (
        f"Flights on which distance alone swaps the tracks: {int(swapped.sum())}. Of these {lasting} "
        f"{'ends' if lasting == 1 else 'end'} with them swapped."
    )


def ties_words(spread: pd.DataFrame, printed: Mapping[str, float]) -> str:
    """How flights that are equal to a printed number count to those below it; empty for one flight.

    Parameters
    ----------
    spread
        One row for each flight.
    printed
        By the name of a quantity of `FEATURES`.
    """
    if len(spread) < 2:
        return ""
    ties = {name: int((spread[FEATURES, name] == value).sum()) for name, value in printed.items()}
    parts = [
        f"{name.removeprefix('wrong_rate_').replace('_', ' ')}, {count} of {len(spread)}"
        for name, count in ties.items()
        if count
    ]
    equal = f" Equal to it: {'; '.join(parts)}." if parts else ""
    return f" Flights below the print: one that is equal to it counts half.{equal}"


def drawn_words(seed: int) -> str:
    """How the flight of the figures was chosen."""
    return (
        f"The figures show flight {seed}. The study's own was chosen as one on which distance alone swaps "
        "the tracks, as in the thesis's figure; the table says on how many flights that is so."
    )
