"""How the tracker did on the scenarios: a row each, medians, and what is recorded."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import pandas as pd

from wildlab.evaluation.identities import Identities
from wildlab.flight.store import Flight
from wildlab.reporting.many_tracks import rms_error
from wildlab.reporting.report import Report
from wildlab.studies.autoferry_many.tuning import MODES, Tuned, anees_of, follow_mode, gospa_of

#: How many of the best draws are used, to show how much the choice among them matters.
BEST = 5


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
        "confirm": _middle([life.time_to_confirm for life in seen]),
        "swaps": lives.swaps,
        "breaks": lives.breaks,
        "false": lives.false_tracks_per_minute,
        "anees": anees_of(lives),
        "anees_with": anees_of(lives, alone=False),
    }


def _middle(times: list[float]) -> float:
    """Median of the boats that were followed; NaN where none was."""
    known = [one for one in times if np.isfinite(one)]
    return float(np.median(known)) if known else float("nan")


def judge_all(flights: Mapping[str, Flight], tuned: Mapping[str, list[Tuned]]) -> pd.DataFrame:
    """Every scenario by every mode with each of the best draws; ``rank`` from 1."""
    rows = []
    for mode in MODES:
        for rank, one in enumerate(tuned[mode][:BEST], start=1):
            for case, flight in flights.items():
                rows.append(
                    row_of(follow_mode(flight, mode, one.settings), case, mode)
                    | {"rank": rank, "draw": one.number, "tuned_gospa": one.gospa}
                )
    return pd.DataFrame(rows)


def medians(rows: pd.DataFrame, first: str) -> pd.DataFrame:
    """For each mode the median GOSPA of the scenarios that nothing was tuned on: of the best draw, and the
    smallest and largest of the best few.

    Of the best draw there is also how much boats are ``tracked`` (%), on the median, and how many ``changes``
    of a boat's track there are in all: NaN where that was not counted.
    """
    elsewhere = rows[rows["case"] != first]
    found = []
    for mode, own in elsewhere.dropna(subset=["gospa"]).groupby("mode", sort=False):
        by_rank = own.groupby("rank")["gospa"].median()
        best = own[own["rank"] == 1].reindex(columns=["tracked", "swaps", "breaks"])
        found.append(
            {
                "mode": mode,
                "best": by_rank.loc[1],
                "least": by_rank.min(),
                "most": by_rank.max(),
                "of": own["case"].nunique(),
                "draws": len(by_rank),
                "tracked": best["tracked"].astype(float).quantile(),
                "changes": best[["swaps", "breaks"]].to_numpy(float).sum(),
            }
        )
    return pd.DataFrame(found)


def record(report: Report, rows: pd.DataFrame, middle: pd.DataFrame) -> None:
    """The numbers, for ``metrics.json``."""
    for _, one in rows[rows["rank"] == 1].iterrows():
        subject = f"{one['case']}/{one['mode']}"
        for name, column, unit in (
            ("gospa", "gospa", "m"), ("rmse", "rmse", "m"), ("swaps", "swaps", "1"),
            ("breaks", "breaks", "1"), ("false_tracks_per_minute", "false", "1/min"),
            ("mean_nees_by_two", "anees", "1"), ("mean_nees_by_two_with_truth", "anees_with", "1"),
        ):  # fmt: skip
            report.metric(name, subject, one[column], unit)
    for _, one in middle.iterrows():
        report.metric(
            "gospa_median", f"elsewhere/{one['mode']}", one["best"], "m", n=int(one["of"]), low=one["least"],
            high=one["most"],
        )  # fmt: skip
        for name, column, unit in (("tracked_median", "tracked", "%"), ("track_changes", "changes", "1")):
            report.metric(name, f"elsewhere/{one['mode']}", one[column], unit, n=int(one["of"]))


def scenarios_table(rows: pd.DataFrame, theirs: pd.DataFrame, names: Mapping[str, str]) -> pd.DataFrame:
    """The best draw in every scenario by every mode, with Stone Soup's GOSPA as ``theirs``; NaN without."""
    best = rows[rows["rank"] == 1]
    other = theirs[theirs["rank"] == 1].set_index(["case", "mode"])["gospa"]
    keys = pd.MultiIndex.from_frame(best[["case", "mode"]])
    return best.assign(theirs=other.reindex(keys).to_numpy(float), mode=best["mode"].map(names))


def values(recorded: Mapping[tuple[str, str], Mapping[str, Any]]) -> dict[str, float]:
    """Numbers of the page's answer by lidar and radar where nothing was tuned; NaN where not recorded.

    Returns
    -------
    dict
        ``tracked`` (%), ``changes`` of a boat's track, in how many scenarios the GOSPA is smaller than Stone
        Soup's (``ahead``), ``of`` how many.
    """

    def of(name: str, what: str = "value") -> float:
        found = recorded.get((name, "elsewhere/both"), {}).get(what)
        # Whole numbers are shown as such.
        return float("nan") if found is None else int(found) if float(found).is_integer() else float(found)

    return {
        "tracked": of("tracked_median"),
        "changes": of("track_changes"),
        "ahead": of("scenarios_ahead"),
        "of": of("scenarios_ahead", "n"),
    }
