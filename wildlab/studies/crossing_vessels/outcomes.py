"""What the flights give: claims of H 6.4.4, and tables of how each rule of association fares."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from wildlab.evaluation.shares import Check
from wildlab.studies.crossing_vessels.rendered import CrossingTracks, Rendering
from wildlab.studies.crossing_vessels.spotted import Counted
from wildlab.studies.crossing_vessels.trial import DISTANCE, FEATURES, LOOKS, SUBJECTS
from wildlab.studies.crossing_vessels.trial import reacquisition as again
from wildlab.studies.crossing_vessels.trial.crossing import TUNING
from wildlab.studies.crossing_vessels.trial.joint import JOINT

Array = NDArray[np.float64]


def check_claims(runs: pd.DataFrame) -> dict[str, Check]:
    """What the flights give for each claim of H 6.4.4, by the claim's id.

    Parameters
    ----------
    runs
        What `trial` gives, one row for each flight.
    """

    def of(subject: str, name: str) -> Array:
        return runs[subject, name].to_numpy(float)

    def worse(subject: str) -> Array:
        """The larger share of wrong associations of the two vessels."""
        return np.maximum(*(of(subject, f"wrong_rate_boat_{n}") for n in (1, 2)))

    met = of(LOOKS, "closest") < TUNING.measurement
    swapped = of(DISTANCE, "swapped") > 0
    size, intensity, hu = (of(LOOKS, f"separation_{name}") for name in ("size", "intensity", "hu"))
    wrong, wrong_without = of(FEATURES, "wrong"), of(DISTANCE, "wrong")
    return {
        "swap-without-features": Check(true=swapped, premise=met),
        "never-recovers": Check(true=of(DISTANCE, "swapped_at_end") > 0, premise=swapped),
        "accurate-though-swapped": Check(true=of(DISTANCE, "any_near_share") > 0.5, premise=swapped),
        "size-best": Check(true=(size > intensity) & (size > hu)),
        "intensity-differs": Check(measured=intensity, above=True),
        "hu-similar": Check(measured=hu),
        "no-swap-with-features": Check(true=of(FEATURES, "swapped") == 0, premise=met),
        "mostly-within-20-m": Check(true=of(FEATURES, "near_share") > 0.5),
        "most-correct-in-contrast": Check(
            true=(worse(FEATURES) < 0.5) & (worse(DISTANCE) >= 0.5), premise=met
        ),
        "fewer-wrong": Check(
            true=wrong < wrong_without, first=wrong, second=wrong_without, unit="detections"
        ),
    }


def rules_table(runs: pd.DataFrame, names: Mapping[str, str]) -> pd.DataFrame:
    """One row for each rule: the flights swapped (%), and medians over flights."""
    medians = ("wrong", "unassigned", "tracks", "swaps", "breaks", "mae", "gospa", "anees")
    return pd.DataFrame(
        [
            {"rule": names[rule], "swapped": 100 * float(runs[rule, "swapped"].mean())}
            | {name: float(runs[rule, name].median()) if (rule, name) in runs else np.nan for name in medians}
            for rule in (*SUBJECTS, JOINT)
        ]
    )


def reacquired_shares(runs: pd.DataFrame, subject: str, name: str) -> Array:
    """(n,) of the tracks of each flight that could be reacquired or were, which share was; NaN for none.

    Tracks that are rightly new do not count.
    """
    parts = {one: runs[subject, one].to_numpy(float) for one in ("found_right", "found_wrong", "not_found")}
    total = sum(parts.values())
    return np.where(total > 0, parts[name] / np.where(total > 0, total, 1.0), np.nan)


def reacquisition_table(runs: pd.DataFrame, names: Mapping[str, str]) -> pd.DataFrame:
    """One row for each way: mean shares of tracks (%), and flights (%) with none wrong, of those with any."""
    rows = []
    for way in again.WAYS:
        shares = {
            name: pd.Series(reacquired_shares(runs, way, name)).dropna()
            for name in ("found_right", "found_wrong", "not_found")
        }
        none_wrong = 100 * float((shares["found_wrong"] == 0).mean())
        means = {name: 100 * float(one.mean()) for name, one in shares.items()}
        rows.append({"way": names[way], **means, "none_wrong": none_wrong})
    return pd.DataFrame(rows)


def detected_table(flights: Sequence[Rendering]) -> pd.DataFrame:
    """What the detector makes of both vessels in rendered frames, a row for each flight."""
    rows = []
    for one in flights:
        near: Counted = one.near
        counts = {name: getattr(near, name) for name in ("whole", "found", "joined", "missed")}
        rows.append({"flight": str(one.seed), **counts, "false": near.false + one.sea.false})
    return pd.DataFrame(rows)


def rendered_table(flights: Sequence[Rendering], names: Mapping[str, str]) -> pd.DataFrame:
    """One row for each rule: flights swapped, and detections wrong (%), drawn and from rendered frames."""

    def row(rule: str) -> dict[str, object]:
        cells: dict[str, object] = {"rule": names[rule]}
        for way in ("drawn", "frames", "inside"):
            tracks: list[CrossingTracks] = [getattr(one, way) for one in flights]
            found = [one.by_rule[rule] for one in tracks]
            own = sum(one.own or 0 for one in found)
            cells[f"{way}_swapped"] = sum(one.swapped for one in found)
            cells[f"{way}_wrong"] = 100 * sum(one.wrong or 0 for one in found) / own if own else np.nan
        return cells

    return pd.DataFrame([row(rule) for rule in (*SUBJECTS, JOINT)])
