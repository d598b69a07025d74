"""What the report on tracking animals says, as the computed numbers have it."""

from __future__ import annotations

import numpy as np
import pandas as pd

from wildlab.evaluation.runs import Interval, mean_interval, mean_share_interval, share_interval
from wildlab.reporting.text import percent
from wildlab.studies.wildlife_tracking.timing import middle_ratio
from wildlab.studies.wildlife_tracking.trial import (
    FILTERS,
    GATE,
    GONDOLA,
    KALMAN,
    NEGATIVE,
    OUT_OF_SIGHT,
    PARTICLES,
    POSITIVE,
    RATES,
    REVISITS,
    ROWS,
    UAV,
    VISITS,
)

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
are looked at, of the multicopter {RATES[UAV]:g}: so many that neighbouring images still touch. The camera is
off its plan by the errors that the twin's autopilot has, correlated in time; detections have the twin's
noise, and each is put on the terrain from where the camera is *said* to be. None of
these detections is false.

Each animal that is detected has {PARTICLES} particles (F 4.2.1), which walk as animals do and stay inside the
fence they began in; they are resampled by their effective number (F (4.14), two thirds), systematically. F's
modified nearest neighbour (F 4.3.1) gives each detection to its closest track within a gate of
{100 * GATE:.0f} %, so that a track may take several, and what no track takes starts one. Nothing is ever lost
here but on visits. An image without a detection of a track lowers the weight of its particles that the image
would have shown, by one minus the probability of a detection: the footprint is the one that the told pose
has, with what the terrain hides. The Kalman filter has the same rule of association and neither fences nor
images without detections.

An animal counts as out of sight once it has not been detected for {OUT_OF_SIGHT:g} s. Then, every 20 s, the
track that its latest detection was given to is held against where it is. Tracks that were given another
animal's detection are part of that; what the filter alone is worth is read from those that never were.

The search with visits (F 5.3): before each second the multicopter chooses by F (5.2) and (5.3) between the
next way point and the tracks, with $\alpha$ = {VISITS.alpha:g} and $c$ = {VISITS.c:g} m². A track is worth a
visit once the trace of its covariance is beyond {VISITS.worth_m2:g} m². An animal that
{VISITS.patience:g} s of scanning about its place do not find is lost. An enclosure is done as soon as it has
as many tracks as animals live there, which F takes as known; its rows are then left out."""

LIMITS = [
    "The thesis prints no number of its simulations of tracking, nor how fast animals walk, and all that a "
    "lap later shows follows from that: half a metre in each second, chosen, spreads an animal by 21 m a way "
    "in half an hour.",
    "Animals walk independently, and start anywhere in their enclosure. Those of a herd go together, which "
    "makes them harder to tell apart.",
    "But in the rendered frames there are no false detections and no trees.",
    "The multicopter turns on the spot and at once where its tracks steer it; its battery is not asked for.",
    "The covariance of a detection takes the ground about it as level.",
]


def _mean(values: pd.Series, digits: int = 1) -> str:
    known = values[np.isfinite(values)].to_numpy(float)
    if not len(known):
        return "–"
    if len(known) < 2:
        return f"{known[0]:.{digits}f}"
    found = mean_interval(known)
    text = f"{found.estimate:.{digits}f} ({found.low:.{digits}f} to {found.high:.{digits}f})"
    return text.replace("-", "−")


def _mean_share(values: pd.Series) -> str:
    """A mean of shares in per cent, with an interval that ends at none and at all."""
    if len(values) < 2:
        return f"{100 * values.iloc[0]:.0f} %"
    found = mean_share_interval(values.to_numpy(float))
    return f"{100 * found.estimate:.0f} ({100 * found.low:.0f} to {100 * found.high:.0f}) %"


def right_share(spread: pd.DataFrame, subject: str) -> Interval | None:
    """Share of the animals seen again a lap later that got their track back; None where none was seen."""
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
    """Mean over worlds of the first less the second, with its interval; None of one world."""
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
        value = float((spread[first, name] - spread[second, name]).iloc[0])
        return f"{'lower' if value < 0 else 'higher'} by {abs(value):.2f} m in the one world"
    if found.low > 0 or found.high < 0:
        low, high = sorted((abs(found.low), abs(found.high)))
        way = "lower" if found.high < 0 else "higher"
        return f"{way} by {abs(found.estimate):.2f} m ({low:.2f} to {high:.2f})"
    return (
        f"not different for certain ({_signed(found.estimate)} m, "
        f"{_signed(found.low)} to {_signed(found.high)})"
    )


def _signed(value: float) -> str:
    text = f"{value:.2f}"
    return "0.00" if float(text) == 0 else text.replace("-", "−")


def summary(spread: pd.DataFrame) -> list[str]:
    """Three sentences on what the worlds gave."""
    seen = {one: spread[one, "seen_share"].mean() for one in PLATFORMS}
    view = {one: spread[one, "in_view"].median() for one in PLATFORMS}
    ours = {one: f"{one}-{NEGATIVE}" for one in PLATFORMS}
    return [
        f"In a lap the gondola shows {percent(seen[GONDOLA])} of the animals, each of these for "
        f"{view[GONDOLA]:.1f} s in the median; the multicopter shows {percent(seen[UAV])}, for "
        f"{view[UAV]:.0f} s.",
        f"Out of sight they are known to {_mean(spread[ours[GONDOLA], 'rmse'], 0)} m from the gondola and to "
        f"{_mean(spread[ours[UAV], 'rmse'], 0)} m from the multicopter (RMS distance, mean over worlds); "
        f"tracks that never took another animal's detection to "
        f"{_mean(spread[ours[GONDOLA], 'rmse_own'], 0)} m and {_mean(spread[ours[UAV], 'rmse_own'], 0)} m.",
        f"A lap later, of the animals seen again from the gondola {right_words(spread, ours[GONDOLA])} get "
        f"their track back, from the multicopter {right_words(spread, ours[UAV])}.",
    ]


COLUMNS = {
    "platform": "from",
    "filter": "by",
    "rmse": "off (m)",
    "sd": "said (m)",
    "anees": "ANEES",
    "rmse_own": "off, own tracks (m)",
    "anees_own": "ANEES, own tracks",
    "right": "track back a lap later",
    "tracks": "tracks",
}
CAPTION = (
    "Means over worlds with their 95 % intervals, of animals out of sight. Off: RMS distance of the track "
    "from the animal. Said: standard deviation that the track states, each way; off is expected to be 1.4 "
    "times of it. ANEES: 2 where the covariance is right. Own tracks: those that never took another animal's "
    "detection."
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
            f"From the {words} the ANEES is {_mean(every)}, {_verdict(every)}; of tracks that never took "
            f"another animal's detection {_mean(own)}, {_verdict(own)}."
        )
    return " ".join(said) or "One world says nothing of whether tracks are as far off as they say."


def _verdict(values: pd.Series) -> str:
    found = mean_interval(values.to_numpy(float))
    if found.low > 2:
        return f"{found.estimate / 2:.1f} times what it should be: too sure of itself"
    if found.high < 2:
        return f"{found.estimate / 2:.2f} times what it should be: too cautious"
    return "not different from 2 for certain"


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


def later_words(spread: pd.DataFrame) -> str:
    """How well animals are known when they are seen again a lap later."""
    said = []
    for platform, words in PLATFORMS.items():
        subject = f"{platform}-{NEGATIVE}"
        sd = spread[subject, "sd_later"].dropna()
        if not len(sd):
            said.append(f"From the {words} no animal is seen again a lap later.")
            continue
        alone = spread[platform, "by_fence_alone"].median()
        said.append(
            f"From the {words} the track of an animal that is seen again a lap later states "
            f"{sd.median():.0f} m each way (median); its fence alone would tell {alone:.0f} m. "
            f"Of these animals {right_words(spread, subject)} get their track back."
        )
    return " ".join(said)


SEARCH_COLUMNS = {
    "search": "search",
    "minutes": "time (min)",
    "visits": "visits",
    "given_up": "given up",
    "rmse": "off (m)",
    "sd": "said (m)",
    "done": "enclosures called done",
    "found": "animals found",
}
SEARCH_CAPTION = (
    "Means over worlds with their 95 % intervals. Off and said are of animals out of sight, as above. A "
    "search ends when all enclosures are called done, or all rows are flown."
)


def search_table(spread: pd.DataFrame) -> pd.DataFrame:
    """One row for each kind of search."""
    rows = []
    for subject, words in SEARCHES.items():
        rows.append(
            {"search": words}
            | {k: _mean(spread[subject, k]) for k in ("minutes", "visits", "given_up", "rmse", "sd")}
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
        time = (
            f" The search takes {abs(found.estimate):.1f} min {'longer' if found.estimate > 0 else 'less'} "
            f"({_signed(found.low)} to {_signed(found.high)})."
            if sure
            else f" That the search takes another time is not certain ({_signed(found.low)} to "
            f"{_signed(found.high)} min)."
        )
    missed = 1 - spread[REVISITS, "animals_share"].mean()
    early = (
        " Enclosures are called done by their number of tracks, where two of one animal count twice: when "
        f"the search ended, {percent(missed)} of the animals had not been found."
        if missed > 0
        else ""
    )
    return (
        f"With visits the stated standard deviation of animals out of sight is "
        f"{changed_words(spread, 'sd', REVISITS, ROWS)}, and their RMS distance is "
        f"{changed_words(spread, 'rmse', REVISITS, ROWS)}.{time}{early}"
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
