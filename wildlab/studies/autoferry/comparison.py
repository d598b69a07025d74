"""One filter held fixed against the one that takes errors for white: what it gains where nothing was tuned.

A filter gains on a track where it keeps the track with its boat, is at most a tenth less accurate, and has a
mean NEES in the band of a consistent filter that the white one's is outside of. Each track has exactly one of
`OUTCOMES`, so that no denominator shrinks: lost tracks are counted, and apart.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike, NDArray

from wildlab.analysis.tracks.inputs import SensorInputs
from wildlab.analysis.tracks.noise_model import SensorTuning, TargetModel, noise_of_tuning
from wildlab.analysis.tracks.scans import scans_of, truths_at
from wildlab.analysis.tracks.scores import score_track, seen_of
from wildlab.analysis.tracks.single_target import SensorTrack, track_target
from wildlab.evaluation.consistency import position_nees
from wildlab.flight.store import Flight
from wildlab.geometry.frames import Array

#: Degrees of freedom of the NEES of a position, and so what its mean should be.
IDEAL = 2.0
#: How much larger the error of a filter may be that is to count as better for its consistency.
PRICE = 1.1
#: A track stays with its boat ("mostly tracked", as multi-target trackers are judged) where it is near it in
#: at least this share of the scans in which the sensor saw something there; else it is lost.
MOSTLY = 0.8
#: The filters that are held against each other, by kind of detection, first the one with white noise.
FILTERS = {
    "position": ("kf", "coloured", "schmidt", "thinned"),
    "bearing": ("ekf", "schmidt", "thinned"),
}
WHITES = tuple(names[0] for names in FILTERS.values())
#: Columns of `tracks_table`, as they are recorded, with their units.
COMPARED = {
    "rmse": "m", "mae": "m", "anees": "1", "anees_alone": "1", "anis": "1", "lag1_autocorrelation": "1",
    "fraction_nees_inside": "1", "share_followed": "1", "share_with_target": "1",
}  # fmt: skip
_NAMES = {"nees": "anees", "nis": "anis", "lag1": "lag1_autocorrelation", "inside": "fraction_nees_inside",
          "followed": "share_followed"}  # fmt: skip
#: What became of a track with a filter, beside the white one's: it enters its band at the price allowed, or
#: at a higher one; both are in; neither is; it leaves it; or the track is lost.
OUTCOMES = ("gained", "too dear", "both inside", "neither inside", "spoilt", "lost")
_COUNTED = ("gained", "spoilt", "lost")
#: What names one track.
KEYS = ["sensor", "target", "case"]


def follow_flight(
    flight: Flight, tunings: Mapping[str, SensorTuning], targets: TargetModel
) -> list[SensorTrack]:
    """Every target with truth, by every sensor that has a tuning, with each of `FILTERS`."""
    found = []
    for sensor, tuning in tunings.items():
        scans = scans_of(flight, sensor, tuning.offset_s)
        one = SensorInputs(scans, noise_of_tuning(tuning), truths_at(flight, scans.times))
        for truth in one.truths:
            found += track_target({sensor: one}, truth.target, targets, FILTERS[scans.kind])
    return found


def tracks_table(followed: Sequence[SensorTrack], size_m: float = np.nan) -> pd.DataFrame:
    """`wildlab.analysis.tracks.scores.score_tracks`, with the names of `COMPARED`.

    ``anees_alone`` takes the truth for exact; ``share_with_target`` is the share of the scans in which the
    sensor saw something near the boat in which the track is nearer to it than ``size_m``.
    """
    rows = []
    for one in followed:
        kind, seen = "bearing" if one.innovation.shape[1] == 1 else "position", seen_of(one)
        alone = position_nees(one.error[seen, :2], one.covariance[seen, :2, :2])
        there = np.hypot(*one.error[:, :2].T) < size_m  # NaN, where there is no track, is not there
        rows.append(
            score_track(one, kind)
            | {
                "anees_alone": alone[np.isfinite(alone)].mean() if np.isfinite(alone).any() else np.nan,
                "share_with_target": there[one.near].mean() if one.near.any() and size_m > 0 else np.nan,
            }
        )
    return pd.DataFrame(rows).rename(columns=_NAMES)


def off_ideal(anees: ArrayLike) -> Array:
    """By what factor a mean NEES is too large or too small, as a logarithm: 0 is ideal."""
    return np.abs(np.log(np.asarray(anees, float) / IDEAL))


def stays(table: pd.DataFrame, mostly: float = MOSTLY) -> NDArray[np.bool_]:
    """Which tracks stay with their boat, by the rows of `tracks_table`; see `MOSTLY`.

    One that never began, or whose boat the sensor never saw, does not.
    """
    return np.asarray(table["share_with_target"] >= mostly, bool)


def consistent(table: pd.DataFrame) -> NDArray[np.bool_]:
    """Which tracks have their mean NEES in its 95 % band.

    That is the band of a mean of as many independent values as the track's correlated ones are worth.
    """
    return np.asarray((table["anees"] >= table["nees_low"]) & (table["anees"] <= table["nees_high"]), bool)


def beside_white(table: pd.DataFrame, keys: Sequence[str]) -> pd.DataFrame:
    """Every track of another filter beside the same one of the filter with white noise.

    Parameters
    ----------
    table
        Rows of `tracks_table`, of one flight or many.
    keys
        Columns that name a case: what was followed, by what, when.

    Returns
    -------
    The rows of the other filters, with the columns of the white one as ``*_white``, ``rmse_ratio`` and
    ``nearer`` (whether the mean NEES is nearer its ideal). Cases without a track are left out.
    """
    known = table[np.isfinite(table["rmse"]) & np.isfinite(table["anees"])]
    white = known[known["filter"].isin(WHITES)]
    both = known[~known["filter"].isin(WHITES)].merge(white, on=list(keys), suffixes=("", "_white"))
    compared: pd.DataFrame = both.assign(
        rmse_ratio=both["rmse"] / both["rmse_white"],
        nearer=off_ideal(both["anees"]) < off_ideal(both["anees_white"]),
    )
    return compared


def outcomes(table: pd.DataFrame, keys: Sequence[str], fixed: str) -> pd.DataFrame:
    """What one filter does to every case, beside the filter with white noise.

    Parameters
    ----------
    table
        Rows of `tracks_table`.
    keys
        Columns that name a case.
    fixed
        Name of the filter; cases of a kind of detection that it is not for are left out.

    Returns
    -------
    One row for each case: ``outcome`` (of `OUTCOMES`), and the columns of the two filters' rows, the white
    one's as ``*_white``.
    """
    kinds = [kind for kind, names in FILTERS.items() if fixed in names]
    rows = table[table["kind"].isin(kinds)]
    white = rows[rows["filter"].isin(WHITES)]
    both = rows[rows["filter"] == fixed].merge(white, on=list(keys), suffixes=("", "_white"), how="left")
    behind = both[[name for name in both if str(name).endswith("_white")]]
    before = behind.rename(columns=lambda name: str(name).removesuffix("_white"))
    kept, inside, inside_white = stays(both), consistent(both), consistent(before)
    ratio = both["rmse"] / both["rmse_white"]
    outcome = np.select(
        [~kept, inside & inside_white, inside & (ratio <= PRICE), inside, inside_white],
        ["lost", "both inside", "gained", "too dear", "spoilt"],
        "neither inside",
    )
    found: pd.DataFrame = both.assign(outcome=outcome)
    return found


class Held(NamedTuple):
    """One filter held fixed, and what became of the tracks.

    Attributes
    ----------
    fixed
        The filter, from `choose_filter`.
    judged
        Tracks of the flights that nothing was tuned on; of the only one where there is one.
    use, found
        From `of_use`, and of the sensors that are of use from `outcomes`.
    """

    fixed: str
    judged: pd.DataFrame
    use: pd.DataFrame
    found: pd.DataFrame

    @property
    def counts(self) -> dict[str, int]:
        """How many tracks there are, and how many gained, were spoilt or lost."""
        outcome = self.found["outcome"]
        return {"tracks": len(outcome)} | {name: int((outcome == name).sum()) for name in _COUNTED}


def hold_fixed(tracks: pd.DataFrame, first: str) -> Held:
    """Choose a filter on the flight ``first``, and judge it on the others."""
    own = tracks["case"] == first
    fixed = choose_filter(tracks[own], KEYS)
    judged = tracks if own.all() else tracks[~own]
    use = of_use(judged)
    useful = judged[judged["sensor"].isin(use.loc[use["of_use"], "sensor"])]
    return Held(fixed, judged, use, outcomes(useful, KEYS, fixed))


def choose_filter(table: pd.DataFrame, keys: Sequence[str]) -> str:
    """The filter to hold fixed, from the flight that everything is tuned on and nothing else.

    Of those for positions other than the white one, the one whose mean NEES, the truth taken for exact, lies
    nearest its ideal (mean of `off_ideal`) among those that are, in the median, within `PRICE`; among all
    where none is. Tracks that the white filter loses are left out.

    Parameters
    ----------
    table
        Rows of `tracks_table` of that flight.
    keys
        Columns that name a case.
    """
    both = beside_white(kept_cases(table, keys), keys)
    both = both[both["kind"] == "position"]
    if both.empty:
        return FILTERS["position"][1]
    off = pd.Series(off_ideal(both["anees_alone"]), both.index).groupby(both["filter"], sort=False).mean()
    cheap = both.groupby("filter", sort=False)["rmse_ratio"].median() <= PRICE
    return str((off[cheap] if cheap.any() else off).idxmin())


def kept_cases(table: pd.DataFrame, keys: Sequence[str]) -> pd.DataFrame:
    """The rows, of all filters, of the cases whose track stays with its boat with white noise.

    What follows something else says nothing of how a filter takes its errors.
    """
    white = table[table["filter"].isin(WHITES)]
    kept = white.loc[stays(white), list(keys)]
    return table.merge(kept, on=list(keys))


def of_use(table: pd.DataFrame) -> pd.DataFrame:
    """Whether each sensor alone locates boats: a filter keeps more than half of its tracks with them.

    Returns
    -------
    One row for each sensor, in the order of the table: ``sensor``, ``filter`` (the one that keeps most),
    ``kept``, ``tracks``, ``of_use``.
    """
    rows = []
    for sensor, group in table.groupby("sensor", sort=False):
        kept = pd.Series(stays(group), group.index).groupby(group["filter"], sort=False).sum()
        best = str(kept.idxmax())
        of, most = int((group["filter"] == best).sum()), int(kept.max())
        rows.append((str(sensor), best, most, of, 2 * most > of))
    return pd.DataFrame(rows, columns=["sensor", "filter", "kept", "tracks", "of_use"])


def check_claims(table: pd.DataFrame, keys: Sequence[str]) -> dict[str, NDArray[np.bool_]]:
    """In which cases each claim of H 7.5 is true, by the claim's id; cases without a track are left out.

    Means over time are held against the band of a mean of as many independent values as theirs are worth.
    """
    both = beside_white(table, keys)
    differenced, considered = both[both["filter"] == "coloured"], both[both["filter"] == "schmidt"]
    white = table[table["filter"].isin(WHITES) & np.isfinite(table["anees"])]
    checks = {
        "white-noise-overconfident": white["anees"] > white["nees_high"],
        "white-noise-nis-within": (white["anis"] >= white["nis_low"]) & (white["anis"] <= white["nis_high"]),
        "white-noise-nis-low": white["anis"] < white["nis_low"],
        "differencing-whitens": abs(differenced["lag1_autocorrelation"])
        < abs(differenced["lag1_autocorrelation_white"]),
        "differencing-nearer-ideal": differenced["nearer"],
        "differencing-costs-accuracy": differenced["rmse_ratio"] > 1,
        "schmidt-nearer-ideal": considered["nearer"],
        "schmidt-as-accurate": considered["rmse_ratio"] <= 1,
    }
    return {claim: np.asarray(true, bool) for claim, true in checks.items()}
