"""What the report on tracking animals says, as the computed numbers have it."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np
import pandas as pd

from wildlab.analysis.animals.follow import STATION_S
from wildlab.analysis.animals.measures import OUT_OF_SIGHT
from wildlab.evaluation.runs import Interval, share_interval
from wildlab.evaluation.shares import Check
from wildlab.reporting.text import percent
from wildlab.studies.wildlife_tracking.intervals import (
    FEWEST,
    changed_words,
    mean_share_words,
    positive_interval,
    positive_words,
)
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
and only up to when the shorter of the two searches ended.

Intervals are of 95 %, by Student's distribution over worlds. Means of what cannot be negative have theirs on
the logarithm of the mean, so that they end above zero: of three worlds they are wide, of fewer than {FEWEST}
there are none. Differences between two filters or searches can be negative, and are taken world by world."""

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


def summary(spread: pd.DataFrame) -> list[str]:
    """Three sentences on what the worlds gave."""

    def off(platform: str, name: str) -> str:
        return positive_words(spread[f"{platform}-{NEGATIVE}", name], 0, "m")

    shown = "; ".join(_seen_words(spread, one) for one in PLATFORMS)
    return [
        f"In a lap {shown}.",
        f"Once animals are out of sight, their tracks are off by {off(GONDOLA, 'rmse')} where the gondola "
        f"looks and by {off(UAV, 'rmse')} where the multicopter does (RMS distance, mean over worlds); "
        f"tracks that had not taken another animal's detection by {off(GONDOLA, 'rmse_own')} and "
        f"{off(UAV, 'rmse_own')}.",
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
    "anees": "ANEES (2 is right)",
    "beyond": "outside the 95 % ellipse",
    "right": "track back in the next lap",
    "tracks": "tracks",
}
CAPTION = (
    "Means over worlds with their 95 % intervals, of animals that were detected and are out of sight. Off: "
    "RMS distance of the track from the animal. Said: standard deviation that the track states, each way; "
    "off is expected to be 1.4 times of it. ANEES is of both coordinates together: 2 where the covariance is "
    "right, more where tracks are too sure; half of it, NEES / 2, is right at 1. Track back: animals of all "
    "worlds together."
)
OWN_COLUMNS = {
    "platform": "from",
    "filter": "by",
    "own_share": "own tracks",
    "rmse_own": "off (m)",
    "anees_own": "ANEES (2 is right)",
}
OWN_CAPTION = (
    "The same of own tracks alone: those that had not taken another animal's detection by then, and which "
    "share of all they are."
)


def _by_filter(spread: pd.DataFrame, names: Mapping[str, Callable[[pd.Series], str]]) -> pd.DataFrame:
    return pd.DataFrame(
        {"platform": words, "filter": NAMES[one]}
        | {name: say(spread[f"{platform}-{one}", name]) for name, say in names.items()}
        for platform, words in PLATFORMS.items()
        for one in FILTERS
    )


def table(spread: pd.DataFrame) -> pd.DataFrame:
    """One row for each platform and filter."""
    found = _by_filter(
        spread,
        dict.fromkeys(("rmse", "sd", "anees", "tracks"), positive_words) | {"beyond": mean_share_words},
    )
    found["right"] = [right_words(spread, f"{platform}-{one}") for platform in PLATFORMS for one in FILTERS]
    return found[list(COLUMNS)]


def own_table(spread: pd.DataFrame) -> pd.DataFrame:
    """The same of tracks that had not taken another animal's detection."""
    return _by_filter(
        spread, {"own_share": mean_share_words, "rmse_own": positive_words, "anees_own": positive_words}
    )


def consistency_words(spread: pd.DataFrame) -> str:
    """Whether tracks are as far off as they say: all of them, and those of one animal alone."""
    said = []
    for platform, words in PLATFORMS.items():
        subject = f"{platform}-{NEGATIVE}"
        every, own = (spread[subject, name] for name in ("anees", "anees_own"))
        of_every, of_own = positive_interval(every), positive_interval(own)
        if of_every is None or of_own is None:
            continue
        said.append(
            f"From the {words} it is {positive_words(every)}, {_verdict(of_every)}; of tracks that had not "
            f"taken another animal's detection {positive_words(own)}, {_verdict(of_own)}."
        )
    if not said:
        return (
            "Too few worlds have animals out of sight whose tracks can be judged: whether tracks are as far "
            "off as they say is not known."
        )
    return f"ANEES is 2 where tracks are as far off as they say. {' '.join(said)}"


def _verdict(found: Interval) -> str:
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


def rule_words(checks: Mapping[str, Check], claims: Sequence[Mapping[str, Any]]) -> str:
    """By which rule claims are decided that count animals of all worlds together; empty where none does.

    Parameters
    ----------
    checks
        By the claim's id.
    claims
        With their ``id`` and ``threshold``.
    """
    said = []
    for above, side, other in ((True, "above", "below"), (False, "below", "above")):
        pooled = [
            one
            for one in claims
            if one["id"] in checks and checks[one["id"]].pooled and checks[one["id"]].above == above
        ]
        if not pooled:
            continue
        units = " and ".join(dict.fromkeys(checks[one["id"]].unit for one in pooled))
        limits = " and ".join(dict.fromkeys(percent(float(one["threshold"]), 0) for one in pooled))
        said.append(
            f"Claims under which {units} are counted, of all worlds together, are decided by another rule: "
            f"such a claim holds where the 95 % interval of their share lies wholly {side} its threshold, "
            f"{limits}, does not hold where it lies wholly {other}, and is undecided where the threshold is "
            "in it. It may hold though most of them are not so."
        )
    return " ".join(said)


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
