"""How the tracker did on the scenarios, as tables and in words."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import pandas as pd

from wildlab.evaluation.identities import Identities
from wildlab.flight.store import Flight
from wildlab.reporting.many_tracks import LARGEST, SMALLEST, caption_of_gospa, rms_error
from wildlab.reporting.report import Report
from wildlab.studies.autoferry_many.tuning import (
    MODES,
    RADAR_REACH_M,
    Tuned,
    anees_of,
    follow_mode,
    gospa_of,
)

#: How many of the best draws are used, to show how much the choice among them matters.
BEST = 5
MODE_WORDS = {"radar": "radar alone", "lidar": "lidar alone", "both": "both", "cameras": "both and cameras"}
HEADINGS = {
    "case": "scenario", "mode": "by", "gospa": "GOSPA (m)", "rmse": "RMS error (m)", "tracked": "tracked (%)",
    "confirm": "confirmed within (s)", "swaps": "swaps", "breaks": "breaks", "false": "false a minute",
    "anees": "mean NEES / 2", "anees_with": "with the truth's error",
}  # fmt: skip


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


def judge_cameras(flights: Mapping[str, Flight], tuned: Mapping[str, list[Tuned]]) -> pd.DataFrame:
    """GOSPA with the cameras' bearings and without them, with one and the same settings.

    Returns
    -------
    DataFrame
        ``case``, ``rank`` of the draw among those tuned with cameras, ``with`` and ``without`` (m).
    """
    return pd.DataFrame(
        {
            "case": case,
            "rank": rank,
            "with": gospa_of(follow_mode(flight, "cameras", one.settings)),
            "without": gospa_of(follow_mode(flight, "both", one.settings)),
        }
        for rank, one in enumerate(tuned["cameras"][:BEST], start=1)
        for case, flight in flights.items()
    )


def cameras(rows: pd.DataFrame, first: str) -> str:
    """Whether the cameras help where nothing was tuned; "" where there is one scenario only."""
    own = rows[rows["case"] != first]
    if not len(own):
        return ""
    change = (own["with"] - own["without"]).dropna()
    if not len(change):
        return ""
    middle = float(change.median())
    word = (
        f"{abs(middle):.1f} m {'larger' if middle > 0 else 'smaller'}"
        if abs(middle) >= 0.05
        else "no different"
    )
    return (
        f"With the cameras' bearings and the same settings GOSPA is smaller in {int((change < 0).sum())} of "
        f"{len(change)} pairs of one of {own.loc[change.index, 'case'].nunique()} scenarios and one of the "
        "best draws, and in the "
        f"median {word} "
        f"({change.min():+.1f} to {change.max():+.1f} m)."
    )


def medians(rows: pd.DataFrame, first: str) -> pd.DataFrame:
    """For each mode the median GOSPA of the scenarios that nothing was tuned on: of the best draw, and the
    smallest and largest of the best few."""
    elsewhere = rows[rows["case"] != first]
    found = []
    for mode, own in elsewhere.dropna(subset=["gospa"]).groupby("mode", sort=False):
        by_rank = own.groupby("rank")["gospa"].median()
        found.append(
            {
                "mode": mode,
                "best": by_rank.loc[1],
                "least": by_rank.min(),
                "most": by_rank.max(),
                "of": own["case"].nunique(),
                "draws": len(by_rank),
            }
        )
    return pd.DataFrame(found)


def spread_table(rows: pd.DataFrame, first: str) -> pd.DataFrame:
    """GOSPA of every scenario with each of the best draws, the best first."""
    found = []
    for (mode, rank), own in rows.groupby(["mode", "rank"], sort=False):
        del rank
        one = own.iloc[0]
        row = {"by": mode, "draw": str(int(one["draw"])), f"{first} (tuned here)": one["tuned_gospa"]}
        found.append(
            row
            | {case: value for case, value in zip(own["case"], own["gospa"], strict=True) if case != first}
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


def headline(rows: pd.DataFrame, middle: pd.DataFrame, first: str) -> list[str]:
    """The answer in sentences."""
    if not len(middle):
        return ["There is one scenario only, on which everything was tuned: nothing can be judged."]
    parts = [
        f"{MODE_WORDS[one['mode']]} {one['best']:.1f} m ({one['least']:.1f} to {one['most']:.1f} with the "
        f"{one['draws']:.0f} best draws)"
        for _, one in middle.iterrows()
    ]
    own = rows[(rows["rank"] == 1) & (rows["case"] != first)]
    said = [
        f"Tuned on {first} alone, the tracker's GOSPA on {middle['of'].max():.0f} other scenarios is, in the "
        f"median, {'; '.join(parts)}. By lidar alone it is asked for the boats in its reach only, else for "
        f"all within {RADAR_REACH_M:g} m."
    ]
    swaps, breaks = int(own["swaps"].sum()), int(own["breaks"].sum())
    said.append(
        f"With the best draws, summed over the ways to look, tracks went over to another boat {swaps} "
        f"{'time' if swaps == 1 else 'times'}, and a boat got a new track {breaks} "
        f"{'time' if breaks == 1 else 'times'}."
    )
    said += [followed_share(own), fusion(own)]
    return [one for one in said if one]


def followed_share(own: pd.DataFrame) -> str:
    """How much of the time boats have a track at all, with both sensors; "" without that mode."""
    share = own.loc[own["mode"] == "both", "tracked"].dropna()
    if not len(share):
        return ""
    low, high = f"{share.min():.0f}", f"{share.max():.0f}"
    said = high if low == high else f"{low} to {high}"
    of = "the scenario" if len(share) == 1 else f"each of {len(share)} scenarios"
    return (
        f"With both sensors boats have a track at {said} % of the looks at which they are within reach, in "
        f"the mean over the boats of {of}."
    )


def fusion(own: pd.DataFrame) -> str:
    """Whether both sensors are better than the radar alone, scenario by scenario; "" without these two."""
    wide = own.pivot_table(index="case", columns="mode", values="gospa", sort=False)
    if not {"both", "radar"} <= set(wide):
        return ""
    better = int((wide["both"] < wide["radar"]).sum())
    return (
        f"Both sensors together have a smaller GOSPA than the radar alone, asked for boats as far away, in "
        f"{better} of {len(wide)} scenarios."
    )


def doubts(own: pd.DataFrame) -> str:
    """Of how many scenarios and modes errors are as large as tracks say."""
    fits = own["anees"].between(SMALLEST, LARGEST)
    return (
        f"Errors are as large as the tracks say, within a factor of {LARGEST:g} of their squares, in "
        f"{int(fits.sum())} of {len(own)} scenarios and modes."
    )


def spread(middle: pd.DataFrame, draws: int) -> str:
    """How far the best draws lie apart where nothing was tuned, in a sentence for each mode."""
    return " ".join(
        f"By {MODE_WORDS[one['mode']]}, the best {one['draws']:.0f} of {draws} draws have medians between "
        f"{one['least']:.2f} and {one['most']:.2f} m."
        for _, one in middle.iterrows()
    )


def caption() -> str:
    """What the columns of the table of scenarios mean."""
    return (
        f"{caption_of_gospa()} Boats are asked for up to {RADAR_REACH_M:g} m with the radar, and as far as "
        "the lidar sees one of their size without it. Tracked: share of the looks at which a boat is asked "
        "for and has a track, mean over the boats. Confirmed within: median over the boats that were. "
        "Mean NEES / 2 is 1 where errors are as large as the tracks say, with the truth taken for exact and "
        "with the error that the truth's own positions tell. Swaps: tracks that go over to "
        "another boat. Breaks: boats that get a new track."
    )


def caption_of_spread(first: str) -> str:
    """What the table of the best draws shows."""
    return (
        f"Mean GOSPA (m) with each of the draws that are best on {first}: first those whose errors are "
        "there as large as the tracks say, then by GOSPA."
    )


def limits() -> list[str]:
    """What the study does not say."""
    return [
        "Other boats are about whose places nobody published: a track on one of them counts as false.",
        "The antenna of a boat is not its middle, and nothing says where on the hull it is.",
        "Bearings move tracks, and neither begin nor confirm one: where the cameras looked is not logged. It "
        "is judged at the looks of the lidar and the radar only.",
    ]


METHOD = (
    "Joint integrated probabilistic data association with visibility and two kinds of hull, see "
    "`wildlab.tracking.many`. Settings are drawn at random from wide ranges "
    "(`wildlab.studies.autoferry_many.tuning.draw`), and for each way to look the one is taken that has the "
    "smallest mean GOSPA on the first scenario, of those whose mean NEES / 2 there lies between "
    f"{SMALLEST:g} and {LARGEST:g}, if any does: GOSPA alone prefers tracks that are too sure. Scales are "
    "drawn evenly over their logarithm. Stamps are moved, and errors of lidar and radar last, as the study "
    "`autoferry` finds on the same scenario. The truth is taken for exact in the choice."
)
