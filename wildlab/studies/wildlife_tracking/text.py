"""What the report on tracking animals says, as the computed numbers have it."""

from __future__ import annotations

import numpy as np
import pandas as pd

from wildlab.evaluation.runs import Interval, mean_interval, mean_share_interval, share_interval
from wildlab.pipeline.animals.follow import STATION_S
from wildlab.pipeline.animals.measures import OUT_OF_SIGHT
from wildlab.reporting.text import NOTHING, number, percent
from wildlab.studies.wildlife_tracking.timing import middle_ratio
from wildlab.studies.wildlife_tracking.trial import (
    EVERY,
    FILTERS,
    GATE,
    GONDOLA,
    KALMAN,
    NEGATIVE,
    PARTICLES,
    PATROL_S,
    POSITIVE,
    RATES,
    REVISITS,
    ROWS,
    UAV,
    VISITS,
    World,
)
from wildlab.tracking.particles.steps import LEAST_EFFECTIVE

#: What the platforms and the filters are called.
PLATFORMS = {GONDOLA: "gondola", UAV: "multicopter"}
NAMES = {
    NEGATIVE: "particle filter",
    POSITIVE: "particle filter, detections alone",
    KALMAN: "Kalman filter",
}
SEARCHES = {REVISITS: "rows and visits", ROWS: "rows alone"}

METHOD = rf"""Each world is drawn from its seed: land of the size and relief of F's map, and the twin's
five enclosures with five animals in each, which walk as F (4.5) has it, a velocity drawn anew each second,
and stay inside. The gondola goes two laps with the adaptive roll rotation of F 5.4.2, the multicopter flies
its rows twice with the camera rolling from side to side. Of the gondola {RATES[GONDOLA]:g} images a second
are looked at, of the multicopter {RATES[UAV]:g}: the camera turns by about an image's width from one to the
next. It is off its plan by the errors that the twin's autopilot has, correlated in time; detections have the
twin's noise, and each is put on the terrain from where the camera is *said* to be. None of
these detections is false.

Each animal that is detected has {PARTICLES} particles (F 4.2.1), which walk as animals do and stay inside the
fence they began in; they are resampled by their effective number (F (4.14), two thirds), systematically. F's
modified nearest neighbour (F 4.3.1) gives each detection to its closest track within a gate of
{100 * GATE:.0f} %, so that a track may take several, and what no track takes starts one. Nothing is ever lost
here but on visits. An image without a detection of a track lowers the weight of its particles that the image
would have shown, by one minus the probability of a detection: the footprint is the one that the told pose
has, with what the terrain hides. The Kalman filter has the same rule of association and neither fences nor
images without detections.

An animal counts as out of sight once it has been detected and then not for {OUT_OF_SIGHT:g} s. Then, every
{STATION_S:g} s, on searches every {EVERY * PATROL_S:g} s, the track that its latest detection was given to is
held against where it is. Tracks that were given another animal's detection are part of that; what the filter
alone is worth is read from those that had not been by then.

The second lap tells of the first: of each animal that was detected in the first lap, the first detection in
the second is looked at. It gets its track back where that is given to the track that its detection before was
given to.

Where a detection leaves a cloud with fewer than {LEAST_EFFECTIVE:g} particles' worth of weight, the cloud is
drawn anew about it, as a Kalman filter would have it: F resamples, and what one particle becomes by that
knows nothing of its error.

The search with visits (F 5.3): before each second the multicopter chooses by F (5.2) and (5.3) between the
next way point and the tracks, with $\alpha$ = {VISITS.alpha:g} and $c$ = {VISITS.c:g} m². A track is worth a
visit once the trace of its covariance is beyond {VISITS.worth_m2:g} m². An animal that
{VISITS.patience:g} s of scanning from where it should be do not find is lost. An enclosure is done as soon as
it has as many tracks as animals live there, which F takes as known; its rows are then left out, and its
animals are not visited any more. So animals count in the comparison only while their enclosure is searched,
and only up to when the shorter of the two searches ended."""

LIMITS = [
    "The thesis prints no result of its simulations of tracking. F's figure 7.13 is planned while it flies; "
    "ours shows rows.",
    "The filters take the errors of every image as new ones; those of the pose last for a minute and more.",
    "Animals of one world are counted as if each had its own luck; two that take each other's tracks have "
    "not.",
    "Animals walk independently, and start anywhere in their enclosure. Those of a herd go together, which "
    "makes them harder to tell apart.",
    "There are no false detections and no trees, except in the rendered frames.",
    "The multicopter turns on the spot and at once where its tracks steer it; its battery is not asked for.",
    "The covariance of a detection takes the ground about it as level.",
]


def walk_limit(world: World) -> str:
    """What the chosen walk of the animals makes of a lap."""
    spread = float(np.sqrt(world.motion(world.lap)[1][0, 0]))
    return (
        "How fast animals walk is not printed, and what the second lap shows follows from it: by the walk "
        f"that is chosen an animal is {spread:.0f} m away, each way, after a lap of "
        f"{world.lap / 60:.0f} minutes (standard deviation, without its fence)."
    )


def _mean(values: pd.Series, digits: int = 1) -> str:
    """A mean over worlds with its interval; of fewer than two known ones without."""
    known = values[np.isfinite(values)].to_numpy(float)
    if not len(known):
        return NOTHING
    if len(known) < 2:
        return f"{known[0]:.{digits}f}" + (f" (1 of {len(values)} worlds)" if len(values) > 1 else "")
    found = mean_interval(known)
    middle, low, high = (number(one, digits) for one in (found.estimate, found.low, found.high))
    return f"{middle} ({low} to {high})"


def _mean_share(values: pd.Series) -> str:
    """A mean of shares in per cent, with an interval that ends at none and at all."""
    known = values[np.isfinite(values)].to_numpy(float)
    if not len(known):
        return NOTHING
    if len(known) < 2:
        return f"{100 * known[0]:.0f} %"
    found = mean_share_interval(known)
    return f"{100 * found.estimate:.0f} ({100 * found.low:.0f} to {100 * found.high:.0f}) %"


def right_share(spread: pd.DataFrame, subject: str) -> Interval | None:
    """Share of the animals detected in both laps that got their track back; None where none was seen."""
    later = int(spread[subject, "later"].sum())
    return share_interval(int(spread[subject, "right"].sum()), later) if later else None


def right_words(spread: pd.DataFrame, subject: str) -> str:
    """That share in words, with what it is of.

    Examples
    --------
    >>> table = pd.DataFrame({("a", "later"): [6.0, 4.0], ("a", "right"): [4.0, 1.0]})
    >>> right_words(table, "a")
    '5 of 10 (24 to 76 %)'
    """
    found = right_share(spread, subject)
    if found is None:
        return "none seen again"
    later, right = int(spread[subject, "later"].sum()), int(spread[subject, "right"].sum())
    return f"{right} of {later} ({100 * found.low:.0f} to {100 * found.high:.0f} %)"


def difference(spread: pd.DataFrame, name: str, first: str, second: str) -> Interval | None:
    """Mean over worlds of the first less the second, with its interval; None of fewer than two known."""
    both = (spread[first, name] - spread[second, name]).to_numpy(float)
    both = both[np.isfinite(both)]
    return mean_interval(both) if len(both) > 1 else None


def changed_words(spread: pd.DataFrame, name: str, first: str, second: str) -> str:
    """By how much a number of metres differs, and whether that is more than chance.

    Examples
    --------
    >>> table = pd.DataFrame({("a", "sd"): [9.0, 9.5, 8.7], ("b", "sd"): [10.0, 10.4, 9.8]})
    >>> changed_words(table, "sd", "a", "b")
    'lower by 1.00 m (0.75 to 1.25)'
    """
    found = difference(spread, name, first, second)
    if found is None:
        known = (spread[first, name] - spread[second, name]).dropna()
        if not len(known):
            return "not known in any world"
        value = float(known.iloc[0])
        if number(value, 2) == "0.00":
            return "the same in the one world"
        return f"{'lower' if value < 0 else 'higher'} by {abs(value):.2f} m in the one world"
    if number(found.low, 2) == number(found.high, 2) == "0.00":
        return "the same to a centimetre"
    if found.low > 0 or found.high < 0:
        low, high = sorted((abs(found.low), abs(found.high)))
        way = "lower" if found.high < 0 else "higher"
        return f"{way} by {abs(found.estimate):.2f} m ({low:.2f} to {high:.2f})"
    return (
        f"changed by {number(found.estimate, 2)} m, which chance may have done too "
        f"({number(found.low, 2)} to {number(found.high, 2)})"
    )


def summary(spread: pd.DataFrame) -> list[str]:
    """Three sentences on what the worlds gave."""
    ours = {one: f"{one}-{NEGATIVE}" for one in PLATFORMS}
    shown = "; ".join(_seen_words(spread, one) for one in PLATFORMS)
    return [
        f"In a lap {shown}.",
        f"Animals that were detected and are out of sight are known to "
        f"{_mean(spread[ours[GONDOLA], 'rmse'], 0)} m from the gondola and to "
        f"{_mean(spread[ours[UAV], 'rmse'], 0)} m from the multicopter (RMS distance, mean over worlds); by "
        f"tracks that had not taken another animal's detection to "
        f"{_mean(spread[ours[GONDOLA], 'rmse_own'], 0)} m and {_mean(spread[ours[UAV], 'rmse_own'], 0)} m.",
        " ".join(_back_words(spread, one) for one in PLATFORMS),
    ]


def _seen_words(spread: pd.DataFrame, platform: str) -> str:
    share, seconds = spread[platform, "seen_share"].mean(), spread[platform, "in_view"].median()
    each = f", each of these for {seconds:.1f} s in the median" if np.isfinite(seconds) else ""
    return f"the {PLATFORMS[platform]} shows {percent(share)} of the animals{each}"


def _back_words(spread: pd.DataFrame, platform: str) -> str:
    subject, words = f"{platform}-{NEGATIVE}", PLATFORMS[platform]
    if right_share(spread, subject) is None:
        return f"From the {words} no animal is detected in both laps."
    return (
        f"Of the animals detected from the {words} in both laps, {right_words(spread, subject)} get their "
        "track back."
    )


COLUMNS = {
    "platform": "from",
    "filter": "by",
    "rmse": "off (m)",
    "sd": "said (m)",
    "anees": "ANEES",
    "beyond": "outside the 95 % ellipse",
    "rmse_own": "off, own tracks (m)",
    "anees_own": "ANEES, own tracks",
    "own_share": "own tracks",
    "right": "track back in the next lap",
    "tracks": "tracks",
}
CAPTION = (
    "Means over worlds with their 95 % intervals, of animals that were detected and are out of sight. Off: "
    "RMS distance of the track from the animal. Said: standard deviation that the track states, each way; "
    "off is expected to be 1.4 times of it. ANEES: 2 where the covariance is right. Own tracks: those that "
    "had not taken another animal's detection by then. Track back: animals of all worlds together."
)


def table(spread: pd.DataFrame) -> pd.DataFrame:
    """One row for each platform and filter."""
    rows = []
    for platform, words in PLATFORMS.items():
        for one in FILTERS:
            subject = f"{platform}-{one}"
            rows.append(
                {"platform": words, "filter": NAMES[one]}
                | {k: _mean(spread[subject, k]) for k in ("rmse", "sd", "anees", "rmse_own", "anees_own")}
                | {k: _mean_share(spread[subject, k]) for k in ("beyond", "own_share")}
                | {"right": right_words(spread, subject), "tracks": _mean(spread[subject, "tracks"])}
            )
    return pd.DataFrame(rows)


def consistency_words(spread: pd.DataFrame) -> str:
    """Whether tracks are as far off as they say: all of them, and those of one animal alone."""
    said = []
    for platform, words in PLATFORMS.items():
        subject = f"{platform}-{NEGATIVE}"
        every, own = (spread[subject, name].dropna() for name in ("anees", "anees_own"))
        if len(every) < 2 or len(own) < 2:
            continue
        said.append(
            f"From the {words} the ANEES is {_mean(every)}, {_verdict(every)}; of tracks that had not taken "
            f"another animal's detection {_mean(own)}, {_verdict(own)}."
        )
    return " ".join(said) or "So few worlds say nothing of whether tracks are as far off as they say."


def _verdict(values: pd.Series) -> str:
    found = mean_interval(values.to_numpy(float))
    if found.low > 2:
        return f"{found.estimate / 2:.1f} times what it should be: too sure of itself"
    if found.high < 2:
        return f"{found.estimate / 2:.2f} times what it should be: too cautious"
    return "from which 2 is not told apart"


def negative_words(spread: pd.DataFrame) -> str:
    """What images without a detection change."""
    said = []
    for platform, words in PLATFORMS.items():
        one, other = f"{platform}-{NEGATIVE}", f"{platform}-{POSITIVE}"
        said.append(
            f"From the {words}, with the images that show nothing of an animal its stated standard deviation "
            f"is {changed_words(spread, 'sd', one, other)}, and its RMS distance is "
            f"{changed_words(spread, 'rmse', one, other)}."
        )
    return " ".join(said)


def later_words(spread: pd.DataFrame, platform: str) -> str:
    """How well animals are known when they are detected again in the next lap."""
    subject, words = f"{platform}-{NEGATIVE}", PLATFORMS[platform]
    sd = spread[subject, "sd_later"].dropna()
    if right_share(spread, subject) is None or not len(sd):
        return f"From the {words} no animal is detected in both laps."
    alone = spread[platform, "by_fence_alone"].median()
    return (
        f"Just before an animal is detected again in the next lap its track states {sd.median():.0f} m each "
        f"way (median); its fence alone would tell {alone:.0f} m. {_back_words(spread, platform)}"
    )


SEARCH_COLUMNS = {
    "search": "search",
    "minutes": "time (min)",
    "turns": "turns to an animal",
    "visits": "found by that",
    "given_up": "given up",
    "rmse": "off (m)",
    "sd": "said (m)",
    "done": "enclosures called done",
    "found": "animals found",
}
SEARCH_CAPTION = (
    "Means over worlds with their 95 % intervals. Off and said are of animals out of sight while their "
    "enclosure is searched, up to when the shorter search ended. A search ends when all enclosures are "
    "called done, all rows are flown, or after the time of two laps."
)


def search_table(spread: pd.DataFrame) -> pd.DataFrame:
    """One row for each kind of search."""
    rows = []
    for subject, words in SEARCHES.items():
        rows.append(
            {"search": words}
            | {k: _mean(spread[subject, k]) for k in ("minutes", "turns", "visits", "given_up", "rmse", "sd")}
            | {
                "done": _mean_share(spread[subject, "done"]),
                "found": _mean_share(spread[subject, "animals_share"]),
            }
        )
    return pd.DataFrame(rows)


def search_words(spread: pd.DataFrame) -> str:
    """What visits change."""
    longer = (spread[REVISITS, "minutes"] - spread[ROWS, "minutes"]).to_numpy(float)
    time = ""
    if len(longer) > 1:
        found = mean_interval(longer)
        sure = found.low > 0 or found.high < 0
        low, high = sorted((abs(found.low), abs(found.high)))
        time = (
            f" The search takes {abs(found.estimate):.1f} min {'longer' if found.estimate > 0 else 'less'} "
            f"({low:.1f} to {high:.1f})."
            if sure
            else f" That the search takes another time is not certain ({number(found.low, 2)} to "
            f"{number(found.high, 2)} min)."
        )
    return (
        f"While an enclosure is searched, with visits the RMS distance of its animals out of sight is "
        f"{changed_words(spread, 'rmse', REVISITS, ROWS)}, and the stated standard deviation is "
        f"{changed_words(spread, 'sd', REVISITS, ROWS)}.{time}{_early_words(spread)}"
    )


def _early_words(spread: pd.DataFrame) -> str:
    """Whether animals were missed where every enclosure was called done: that is of counting by tracks."""
    whole = spread[REVISITS, "done"] == 1
    if not whole.any():
        return ""
    missed = 1 - float(spread[REVISITS, "animals_share"].to_numpy(float)[whole.to_numpy()].mean())
    if not missed > 0:
        return ""
    return (
        f" In the worlds where all enclosures were called done ({int(whole.sum())} of {len(spread)}), "
        f"{percent(missed)} of the animals had not been found by then: two tracks of one animal count as two."
    )


def cost_words(cost: pd.DataFrame, spread: pd.DataFrame) -> str:
    """What both filters take of the processor, and how many more images negative information asks for."""
    ratio = middle_ratio(cost)
    worlds = f"median of {len(cost)} worlds" if len(cost) > 1 else "one world"
    more = (spread[f"{UAV}-{NEGATIVE}", "looks"] / spread[f"{UAV}-{POSITIVE}", "looks"]).median()
    return (
        f"For the same images the particle filter takes {ratio:.1f} times the processor time of the Kalman "
        f"filter ({worlds}, on the machine that made this report): it is "
        f"{'dearer' if ratio > 1 else 'no dearer'}. With the images that show nothing of an animal it looks "
        f"at {more:.1f} times as many of the multicopter's images."
    )
