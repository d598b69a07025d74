"""What the report on boats followed by a ferry's sensors says: every sentence follows from the numbers."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import pandas as pd

from wildlab.flight.store import Flight
from wildlab.studies.autoferry.boats import BOATS
from wildlab.studies.autoferry.comparison import (
    IDEAL,
    MOSTLY,
    PRICE,
    WHITES,
    share_interval,
    stays,
)

#: What names one track: sensor, target and flight.
KEYS = ["sensor", "target", "case"]
SENSOR_WORDS = {"lidar": "lidar", "radar": "radar", "ir": "thermal camera", "eo": "colour camera"}
FILTER_WORDS = {
    "kf": "white noise",
    "ekf": "white noise",
    "coloured": "differenced",
    "schmidt": "Schmidt",
    "thinned": "thinned",
}
#: What the outcomes of a track are called; see `comparison.OUTCOMES`.
OUTCOME_WORDS = {
    "gained": "gained",
    "too dear": "gained, but too dear",
    "both inside": "honest with both",
    "neither inside": "honest with neither",
    "spoilt": "spoilt",
    "lost": "lost",
}
#: Elements of a measurement, by kind: what its mean NIS should be.
ELEMENTS = {"position": 2, "bearing": 1}
RULE = (
    f"A track stays with its boat where it is within {BOATS.size_m:g} m of it in at least "
    f"{100 * MOSTLY:.0f} % of the "
    "scans in which the sensor saw something near the boat's true place; else it is lost."
)


def case_of(flight: Flight) -> str:
    """``scenario-3`` for ``autoferry-3``; other flights keep their name."""
    return flight.name.replace("autoferry-", "scenario-").lower()


def named(sensors: Sequence[Any]) -> str:
    """Sensors in words: "lidar, radar and thermal camera"."""
    words = [SENSOR_WORDS.get(str(one), str(one)) for one in sensors]
    return f"{', '.join(words[:-1])} and {words[-1]}" if len(words) > 1 else "".join(words)


def of_all(k: int, n: int) -> str:
    """A count with its denominator and, as a share, its 95 % interval (Wilson): "3 of 16 (7 to 43 %)"."""
    low, high = share_interval(k, n)
    return f"{k} of {n} ({100 * low:.0f} to {100 * high:.0f} %)" if n else "0 of 0"


def judged_on(cases: Sequence[str], first: str) -> str:
    """Which scenarios the numbers are of; ``first`` is the one that everything is tuned on."""
    others = [case for case in cases if case != first]
    if not others:
        return f"{first.replace('-', ' ')}, which everything is tuned on: nothing is held out"
    return f"{len(others)} scenario{'s' if len(others) > 1 else ''} that nothing is tuned on"


# --- the headline


def counts_of(found: pd.DataFrame) -> dict[str, int]:
    """How many tracks there are, and how many have each outcome; see `comparison.outcomes`."""
    counts = found["outcome"].value_counts()
    return {"tracks": len(found)} | {str(name): int(k) for name, k in counts.items()}


def headline(found: pd.DataFrame, fixed: str, where: str) -> str:
    """What one filter, held fixed, gains and spoils, and what is lost; a sentence."""
    if found.empty:
        alone = "no sensor alone keeps more than half of its tracks with their boats"
        return f"On {where}, {alone}: nothing can be gained."
    counts = counts_of(found)
    n, gained, spoilt, lost = (counts.get(name, 0) for name in ("tracks", "gained", "spoilt", "lost"))
    by = named(list(dict.fromkeys(found["sensor"])))
    low, high = share_interval(gained, gained + spoilt)
    if low > 0.5:
        said = "helps more often than it harms"
    elif high < 0.5:
        said = "harms more often than it helps"
    else:
        said = "neither clearly helps nor clearly harms"
    return (
        f"On {where}, one filter throughout ({FILTER_WORDS[fixed]}) {said}: compared with white noise, "
        f"{gained} of {n} tracks by {by} turned honest about their error, {spoilt} turned dishonest, and "
        f"{lost} got lost."
    )


def error_words(found: pd.DataFrame) -> str:
    """How far off the tracks that stay typically are, by sensor; a sentence, empty where none stays."""
    parts = []
    for sensor, rows in found.groupby("sensor", sort=False):
        kept = rows[rows["stays"]]
        if len(kept):
            parts.append(
                f"{kept['rmse'].median():.0f} metres with the {named([sensor])} "
                f"({len(kept)} of {len(rows)} tracks stay)"
            )
    return f"A track that stays with its boat is typically off by {' and '.join(parts)}." if parts else ""


def use_words(use: pd.DataFrame) -> str:
    """Which sensors alone are of no use for locating boats, and which are, with their counts; a sentence."""
    useless = use[~use["of_use"]]
    if useless.empty:
        return "Each sensor alone keeps more than half of its tracks with their boats."
    counts = " and ".join(
        f"the {named([row['sensor']])} keeps {row['kept']} of {row['tracks']} tracks with their boats"
        + (f" (off by {row['rmse']:.0f} metres in the median)" if np.isfinite(row["rmse"]) else "")
        for _, row in useless.iterrows()
    )
    alone = "alone is" if len(useless) == 1 else "are each alone"
    who = named(useless["sensor"].tolist())
    return f"The {who} {alone} of no use for locating boats: with its best filter, {counts}."


def tiles(found: pd.DataFrame) -> list[tuple[str, str]]:
    """The numbers to remember."""
    if found.empty:
        return [("0", "tracks that a filter could be judged on")]
    n = len(found)
    shown = []
    for sensor, rows in found.groupby("sensor", sort=False):
        kept = rows.loc[rows["stays"], "rmse"]
        about = f"median error of the {len(kept)} of {len(rows)} tracks by {named([sensor])} that stay"
        shown.append((f"{kept.median():.0f} m" if len(kept) else "—", about))
    gained, lost = (int((found["outcome"] == name).sum()) for name in ("gained", "lost"))
    low, high = share_interval(gained, n)
    share = f"{100 * low:.0f} to {100 * high:.0f} %"
    shown.append((f"{gained} of {n}", f"tracks become honest about their error; 95 % interval {share}"))
    return [*shown, (f"{lost} of {n}", "tracks are lost, whatever the filter says of them")]


def nees_title(found: pd.DataFrame, fixed: str) -> str:
    """In how many tracks the mean NEES is in its band, with the fixed filter and with white noise."""
    inside, white = int(found["inside"].sum()), int(found["inside_white"].sum())
    said = f"{inside} with {FILTER_WORDS[fixed]}, {white} with white noise"
    return f"Tracks of {len(found)} that stay and know their error:\n{said}"


def chosen_words(fixed: str, first: str) -> str:
    """How the filter was chosen that is held fixed."""
    return (
        f"The filter is chosen on {first.replace('-', ' ')} alone, as all tuning is: of differenced, Schmidt "
        f"and thinned the one whose mean NEES lies nearest {IDEAL:g} there, at most {100 * (PRICE - 1):.0f} "
        f"% less accurate. That is: {FILTER_WORDS[fixed]}."
    )


def hindsight_words(hind: pd.DataFrame, fixed: pd.DataFrame) -> str:
    """What choosing the filter for each track afterwards would gain, said to be hindsight; a sentence."""
    gained, n = int(hind["gained"].sum()), len(hind)
    counts = {name: sum(name in some for some in hind["filters"]) for name in FILTER_WORDS}
    by = ", ".join(f"{FILTER_WORDS[name]} {k}" for name, k in counts.items() if k)
    several = int((hind["filters"].map(len) > 1).sum())
    by += f"; {several} with more than one" if several else ""
    held = int((fixed["outcome"] == "gained").sum())
    return (
        f"With hindsight: had the best of the others been known for each track, {gained} of {n} would gain"
        + (f" ({by})" if by else "")
        + f", where the one filter has {held} of {len(fixed)}. "
        "Nobody can choose so before the truth is known."
    )


# --- what did not stay, and what stands behind the verdicts


def strays(found: pd.DataFrame) -> str:
    """How many tracks do not stay with their boat, which, and what another threshold would say."""
    lost = found[found["outcome"] == "lost"]
    named_ones = []
    for _, row in lost.iterrows():
        share = row["share_with_target"]
        near = "never seen"
        if np.isfinite(share):
            near = f"near it in {100 * share:.0f} % of {row['seen']} scans"
        white = "" if not row["stays_white"] else ", but kept with white noise"
        named_ones.append(
            f"{row['target']} by {named([row['sensor']])} in "
            f"{str(row['case']).replace('-', ' ')} ({near}{white})"
        )
    n = len(found)
    other = {share: n - int(stays(found, share).sum()) for share in (0.5, 0.95)}
    threshold = ", ".join(f"{k} at {100 * share:.0f} %" for share, k in other.items())
    behind = f" Lost at other shares of the scans: {threshold}."
    if not named_ones:
        return f"none of {n} tracks is lost.{behind}"
    are = "is" if len(lost) == 1 else "are"
    return f"{len(lost)} of {n} tracks {are} lost: {'; '.join(named_ones)}.{behind}"


def drawn_words(found: pd.DataFrame, case: str, boat: str) -> str:
    """What became of the boat that is drawn, and how many tracks fared alike: whether it is typical."""
    mine = found[(found["case"] == case) & (found["target"] == boat)]
    parts = []
    for sensor, rows in mine.groupby("sensor", sort=False):
        outcome, same = str(rows["outcome"].iloc[0]), found[found["sensor"] == sensor]
        alike = int((same["outcome"] == outcome).sum())
        parts.append(f"{named([sensor])}: {OUTCOME_WORDS[outcome]} ({alike} of {len(same)} tracks)")
    return (
        f"With the filter held fixed, {'; '.join(parts)}." if parts else "It was tuned on, and is not judged."
    )


def remarks(tracks: pd.DataFrame) -> list[str]:
    """What stands behind the verdicts, with the numbers that say so; ``tracks`` are those of kept cases."""
    white = tracks[tracks["filter"].isin(WHITES)]
    said = []
    for kind, rows in white.groupby("kind", sort=False):
        right, middle = ELEMENTS[str(kind)], float(rows["anis"].median())
        below, above = (rows["anis"] < rows["nis_low"]).sum(), (rows["anis"] > rows["nis_high"]).sum()
        said.append(
            f"With white noise assumed, the mean NIS of a {kind} is {middle:.2f} in the median, where "
            f"{right} is right; in {below} of {len(rows)} tracks it is below its band (the noise assumed is "
            f"larger than what changes from one detection to the next) and in {above} above (it is smaller)."
        )
    differenced = tracks[(tracks["filter"] == "coloured") & tracks["rmse"].notna()]
    if len(differenced):
        lag1 = differenced[["lag1_autocorrelation_north", "lag1_autocorrelation_east"]]
        bound = 1.96 / np.sqrt(differenced["detections"])
        negative, positive = (lag1.min(axis=1) < -bound).sum(), (lag1.max(axis=1) > bound).sum()
        said.append(
            f"Of {len(differenced)} differenced tracks, neighbouring innovations are correlated negatively "
            f"in {negative} "
            f"(more was differenced than lasts) and positively in {positive} (less was)."
        )
    thinned = tracks[(tracks["filter"] == "thinned") & tracks["rmse"].notna()].merge(
        white, on=KEYS, suffixes=("", "_white")
    )
    if len(thinned):
        poorer = (thinned["rmse"] > thinned["rmse_white"]).sum()
        said.append(
            f"Thinned tracks are less accurate than those of all detections in {poorer} of {len(thinned)} "
            "cases."
        )
    return said


def claims_caption(tracks: pd.DataFrame, kept: pd.DataFrame) -> str:
    """Which tracks the claims are decided on, with their number."""
    all_cases, kept_ones = (len(some.drop_duplicates(KEYS)) for some in (tracks, kept))
    return (
        f"Decided on the {kept_ones} of {all_cases} cases whose track stays with its boat with white noise; "
        "what follows something else says nothing of how a filter takes its errors. Differencing is for "
        "positions."
    )


def offsets_caption(again: pd.DataFrame, first: str) -> str:
    """How far the clock offsets that scenarios ask for lie apart, by sensor; ``first`` is the one used."""
    spread = again.set_index("sensor").apply(np.ptp, axis=1)
    parts = "; ".join(f"{sensor}: within {value:.1f} s of each other" for sensor, value in spread.items())
    what = "The clock offset (s) that each scenario alone would ask for"
    return f"{what}; only that of {first.replace('-', ' ')} is used. {parts}."


def limits(use: pd.DataFrame, truth_sd: float) -> list[str]:
    """What the report does not tell; ``truth_sd`` m, from one true place to the next."""
    said = [
        "No detection says what it is of. Tracks start on the first detection near a boat's true place; "
        "what they follow later may be another boat, the wake or the shore.",
        "The ferry's own heading and its error are not published, nor how good the boats' receivers are. "
        f"From one to the next their positions are wrong by up to {truth_sd:.2g} m (SD of each axis, "
        "estimated); slower errors are unknown, and count as the tracks'.",
        "A detection is of the side of the hull that is seen, the truth is of an antenna. On a straight "
        "course that cannot "
        "be told from a late clock.",
        "Clutter is not followed, and tracks are not taken up again once they are lost.",
    ]
    useless = use.loc[~use["of_use"], "sensor"].tolist()
    if useless:
        said.append(f"What the {named(useless)} would add to the others: each sensor is alone here.")
    return said


def map_counts(case: str, tracks: pd.DataFrame, drawn: Mapping[str, str]) -> str:
    """How many tracks of a flight stay with their boat, by sensor; ``drawn`` is the filter of each kind."""
    rows = tracks[(tracks["case"] == case) & (tracks["filter"] == tracks["kind"].map(drawn))]
    kept = pd.Series(stays(rows), rows.index).groupby(rows["sensor"], sort=False).agg(["sum", "size"])
    return ", ".join(f"{named([sensor])} {row['sum']} of {row['size']}" for sensor, row in kept.iterrows())


def signed(value: float, decimals: int = 2) -> str:
    """With a true minus."""
    return f"{value:.{decimals}f}".replace("-", "−")


def method_text(first: str) -> str:
    """How it was computed; ``first`` is the flight everything was tuned on."""
    return rf"""
Each boat is followed by each sensor on its own: constant velocity with white acceleration
(${BOATS.density:.2f}$ m/s per root second: a boat at 2.5 m/s may turn by a right angle in 20 s), the
nearest detection in a {100 * BOATS.gate_probability:.0f} % gate, a track dropped after
{BOATS.patience_s:g} s without one. Positions go through the linear filter,
bearings through the extended one, started at the mean distance that {first} shows. All filters of a track get
the same detections, those that the filter with white noise let in.

Tuning, on {first} alone: the detection nearest to a boat within {BOATS.reach_m:g} m or
{np.degrees(BOATS.reach_rad):g}° is taken for its own. The clock offset is the one with the least sum of
squared errors. $\sigma$ is their root mean square, standing part included; their autocorrelation is fitted by
$c\, e^{{-t/\tau}}$. Differencing takes $F_c = e^{{-T/\tau}}$ and the variance that $e_2 - F_c e_1$ then has
(H (7.5)-(7.12)); after more than a second, or one and a half scans, the position itself is used. The Schmidt
filter considers position, clock and heading, each with the variance that non-negative least squares gives it,
fading with $\tau$; the rest is white. Thinning keeps detections so far apart that their errors are correlated
by less than $1/e$.

NEES is of the position, truth minus estimate, with the truth's variance where it is stated; the filter is
chosen with the truth taken for exact. A mean NEES
is honest where it lies in the 95 % interval of the mean of as many independent chi-square values as the
correlated ones are worth, overconfident above it. {RULE} A filter gains on a track that stays where its mean
NEES is in that interval, that of white noise is not, and its error is at most {100 * (PRICE - 1):.0f} %
larger. Behind a count stands the 95 % interval of its share (Wilson), as if tracks were independent of each
other.
"""
