"""All boats of a harbour at once, clutter left in: many targets on public data (H 3.3, 3.4, 8.2)."""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np
import pandas as pd

from wildlab.evaluation.identities import Identities
from wildlab.flight.store import Flight
from wildlab.reporting.many_tracks import rms_error
from wildlab.reporting.report import Report
from wildlab.studies.autoferry_many.tuning import MODES, Tuned, anees_of, follow_mode, gospa_of
from wildlab.studies.page import Facts
from wildlab.studies.protocol import Study


def row_of(lives: Identities | None, case: str, mode: str) -> dict[str, object]:
    """One scenario by one mode."""
    if lives is None:
        return {"case": case, "mode": mode}
    seen = [life for life in lives.targets.values() if life.visible]
    return {
        "case": case,
        "mode": mode,
        "gospa": gospa_of(lives),
        "rmse": rms_error(lives),
        "tracked": 100 * float(np.mean([life.tracked for life in seen])) if seen else np.nan,
        "swaps": lives.swaps,
        "breaks": lives.breaks,
        "anees": anees_of(lives),
    }


def judge_all(flights: Mapping[str, Flight], tuned: Mapping[str, Tuned]) -> pd.DataFrame:
    """Every scenario by every mode with its settings."""
    return pd.DataFrame(
        [
            row_of(follow_mode(flight, mode, tuned[mode].settings), case, mode)
            for mode in MODES
            for case, flight in flights.items()
        ]
    )


def medians(rows: pd.DataFrame, first: str) -> pd.DataFrame:
    """For each mode, over the scenarios that nothing was tuned on.

    Returns
    -------
    DataFrame
        ``mode``; medians of ``gospa`` and of how much boats are ``tracked`` (%); how many ``changes`` of a
        boat's track there are in all; ``of`` how many scenarios.
    """
    elsewhere = rows[rows["case"] != first].dropna(subset=["gospa"])
    found = [
        {
            "mode": mode,
            "gospa": own["gospa"].median(),
            "tracked": own["tracked"].median(),
            "changes": own[["swaps", "breaks"]].to_numpy(float).sum(),
            "of": len(own),
        }
        for mode, own in elsewhere.groupby("mode", sort=False)
    ]
    return pd.DataFrame(found, columns=["mode", "gospa", "tracked", "changes", "of"])


def record_scores(report: Report, rows: pd.DataFrame, middle: pd.DataFrame) -> None:
    """The numbers, for ``metrics.json``."""
    each = (
        ("gospa", "gospa", "m"), ("rmse", "rmse", "m"), ("swaps", "swaps", "1"), ("breaks", "breaks", "1"),
        ("mean_nees_by_two", "anees", "1"),
    )  # fmt: skip
    for _, one in rows.iterrows():
        for name, column, unit in each:
            report.metric(name, f"{one['case']}/{one['mode']}", one[column], unit)
    middles = (
        ("gospa_median", "gospa", "m"),
        ("tracked_median", "tracked", "%"),
        ("track_changes", "changes", "1"),
    )
    for _, one in middle.iterrows():
        for name, column, unit in middles:
            report.metric(name, f"elsewhere/{one['mode']}", one[column], unit, n=int(one["of"]))


def values(middle: pd.DataFrame) -> dict[str, float]:
    """``tracked`` (%) and ``changes`` by lidar and radar for the page's answer; NaN where not known."""
    both = middle[middle["mode"] == "both"]
    found = {name: float(both[name].iloc[0]) if len(both) else np.nan for name in ("tracked", "changes")}
    # Whole numbers are shown as such.
    return {name: int(value) if value.is_integer() else value for name, value in found.items()}


#: Boats that have a track in so many of the scans (%) are followed nearly all the time, or most of it.
NEARLY_ALL, MOST = 90.0, 50.0


def answer(facts: Facts) -> list[str]:
    """How much boats are tracked by lidar and radar where nothing was tuned, and how often tracks change."""
    tracked, changes = (facts.value("elsewhere/both", name) for name in ("tracked_median", "track_changes"))
    if math.isnan(tracked + changes):
        return ["boats-unknown"]
    if tracked < MOST:
        return ["boats-lost"]
    return ["boats-tracked" if tracked >= NEARLY_ALL and not changes else "boats-partly"]


STUDY = Study("autoferry-many", answer=answer)
