"""All boats of a harbour at once, clutter left in: many targets on public data (H 3.3, 3.4, 8.2)."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from wildlab.analysis.tracks.many import ManyTracks, score_identities, track_jointly
from wildlab.evaluation.identities import Identities
from wildlab.flight.store import Flight
from wildlab.flight.tracking_settings import Settings
from wildlab.reporting.charts.drawing import finish
from wildlab.reporting.charts.forms import Values, draw_rows
from wildlab.reporting.figures import BLUE, ORANGE, new_figure
from wildlab.reporting.many_tracks import rms_error
from wildlab.reporting.report import Report
from wildlab.studies.autoferry_many.stone_soup import Choice, draw_choice, installed, run_stone_soup
from wildlab.studies.autoferry_many.tuning import (
    MODES,
    RADAR_REACH_M,
    Tuned,
    anees_of,
    follow_mode,
    gospa_of,
    order,
    reach_of,
)
from wildlab.studies.page import Facts
from wildlab.studies.protocol import Study

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
        "swaps": lives.swaps,
        "breaks": lives.breaks,
        "anees": anees_of(lives),
    }


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


def record_scores(report: Report, rows: pd.DataFrame, middle: pd.DataFrame) -> None:
    """The numbers, for ``metrics.json``."""
    for _, one in rows[rows["rank"] == 1].iterrows():
        subject = f"{one['case']}/{one['mode']}"
        for name, column, unit in (
            ("gospa", "gospa", "m"), ("rmse", "rmse", "m"), ("swaps", "swaps", "1"),
            ("breaks", "breaks", "1"), ("mean_nees_by_two", "anees", "1"),
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


NAME = "Stone Soup's JPDA"
#: It takes seconds for each draw, and as long for each of the best in each scenario: of few draws the best
#: one of so many is used elsewhere, of many the best `BEST`.
MOST_DRAWS, FOR_EACH = 40, 8
#: By sensor, between which distances it may see no farther, m: as our tracker's.
FAR_M = {"lidar": (105.0, 140.0), "radar": (RADAR_REACH_M, RADAR_REACH_M)}


class Drawn(NamedTuple):
    """One draw for Stone Soup, and what became of it where it was tuned."""

    number: int
    choice: Choice
    lives: Identities | None

    @property
    def gospa(self) -> float:
        """As `gospa_of`."""
        return gospa_of(self.lives)

    @property
    def anees(self) -> float:
        """As `anees_of`."""
        return anees_of(self.lives)


def position_modes() -> list[str]:
    """The ways to look whose sensors all tell places: the others need more than its standard parts."""
    return [mode for mode, sensors in MODES.items() if set(sensors) <= set(FAR_M)]


def replace_tracks(followed: ManyTracks, choice: Choice) -> ManyTracks:
    """What our tracker was given, with what Stone Soup shows in place of ours: same looks, same truths."""
    names = [one.name for one in followed.sensors]
    return followed._replace(shown=run_stone_soup(followed.scans, names, choice))


def judge_stone_soup(
    flights: Mapping[str, Flight], settings: Mapping[str, Settings], draws: int, seed: int
) -> pd.DataFrame:
    """Draw what Stone Soup is told, choose on the first scenario, and use the best draws on all.

    Parameters
    ----------
    settings
        By mode, those of our tracker: its clocks are used, and which detections have a place.
    draws
        How many; no more than `MOST_DRAWS` are taken.

    Returns
    -------
    DataFrame
        As `judge_all`; without rows where Stone Soup is not installed.
    """
    rows: list[dict[str, object]] = []
    if not installed():
        return pd.DataFrame(columns=["case", "mode", "rank", "draw", "gospa", "tuned_gospa"])
    first = next(iter(flights))
    generators = np.random.default_rng(seed).spawn(min(draws, MOST_DRAWS))
    choices = [draw_choice(rng, FAR_M) for rng in generators]
    for mode in position_modes():
        given = {
            case: track_jointly(flight, settings=settings[mode], sensors=MODES[mode])
            for case, flight in flights.items()
        }
        reach = {case: reach_of(flight, mode) for case, flight in flights.items()}
        drawn = []
        for number, choice in enumerate(choices, start=1):
            print(f"\r{NAME}, {mode}: {number} of {len(choices)} draws", end="", flush=True)
            drawn.append(
                Drawn(number, choice, score_identities(replace_tracks(given[first], choice), reach[first]))
            )
        print(flush=True)
        drawn.sort(key=order)
        best = drawn[: min(BEST, -(-len(drawn) // FOR_EACH))]
        for rank, one in enumerate(best, start=1):
            print(f"\r{NAME}, {mode}: {rank} of {len(best)} on the others", end="", flush=True)
            for case in flights:
                own = case == first
                lives = (
                    one.lives
                    if own
                    else score_identities(replace_tracks(given[case], one.choice), reach[case])
                )
                rows.append(
                    row_of(lives, case, mode) | {"rank": rank, "draw": one.number, "tuned_gospa": one.gospa}
                )
        print(flush=True)
    return pd.DataFrame(rows)


def settings_of(tuned: Mapping[str, list[Tuned]]) -> dict[str, Settings]:
    """Our best draw of each mode."""
    return {mode: several[0].settings for mode, several in tuned.items()}


def compared(rows: pd.DataFrame, theirs: pd.DataFrame, first: str) -> pd.DataFrame:
    """For each mode both medians where nothing was tuned, and in how many scenarios whose GOSPA is smaller.

    Returns
    -------
    DataFrame
        ``mode``; ``ours``, ``theirs`` of the best draws, each with ``_least`` and ``_most`` of the best few,
        ``draws_ours`` and ``draws_theirs`` how many these are; in how many scenarios ours is ``smaller``,
        ``of`` how many with both.
    """
    mine, other = (medians(one, first) for one in (rows, theirs))
    if not len(mine) or not len(other):
        return pd.DataFrame()
    table = mine.merge(other, on="mode", suffixes=("_ours", "_theirs"))
    found = []
    for _, one in table.iterrows():
        gap = _gaps(rows, theirs, first, str(one["mode"]))
        found.append(
            {
                "mode": one["mode"],
                "ours": one["best_ours"],
                "ours_least": one["least_ours"],
                "ours_most": one["most_ours"],
                "theirs": one["best_theirs"],
                "theirs_least": one["least_theirs"],
                "theirs_most": one["most_theirs"],
                "draws_ours": one["draws_ours"],
                "draws_theirs": one["draws_theirs"],
                "smaller": int((gap < 0).sum()),
                "of": len(gap),
            }
        )
    return pd.DataFrame(found)


def _gaps(rows: pd.DataFrame, theirs: pd.DataFrame, first: str, mode: str) -> pd.Series:
    """Our GOSPA without theirs, m, by scenario that nothing was tuned on."""
    mine, other = (
        one[(one["rank"] == 1) & (one["mode"] == mode) & (one["case"] != first)].set_index("case")["gospa"]
        for one in (rows, theirs)
    )
    # To the hundredth, as the page says them: equal there is equal.
    gap: pd.Series = (mine.round(2) - other.round(2)).dropna()
    return gap


def gospa_chart(
    rows: pd.DataFrame, theirs: pd.DataFrame, first: str, names: Mapping[str, str]
) -> Figure | None:
    """GOSPA of both in every scenario by every mode: the best draw, and a line over the best few; None
    without Stone Soup."""
    modes = [mode for mode in dict.fromkeys(rows["mode"]) if (theirs["mode"] == mode).any()]
    if not modes:
        return None
    cases = list(dict.fromkeys(rows["case"]))
    fig, axes = new_figure(
        6.0, 1.5 + 0.36 * len(cases) * len(modes), rows=len(modes), sharex=True, squeeze=False
    )
    called = [f"{one} (tuned here)" if one == first else one for one in cases]
    for ax, mode in zip(axes[:, 0], modes, strict=True):
        series = {}
        for table, name, tint, mark in ((rows, "wildlab", BLUE, "o"), (theirs, NAME, ORANGE, "s")):
            own = table[table["mode"] == mode].groupby("case")["gospa"].agg(["min", "max"]).reindex(cases)
            best = (
                table[(table["mode"] == mode) & (table["rank"] == 1)]
                .set_index("case")["gospa"]
                .reindex(cases)
            )
            series[name] = Values(best, own.T, tint, mark)
        draw_rows(ax, called, series, 0.3)
        ax.set_title(names[mode])
    axes[-1, 0].set_xlim(left=0)
    return finish(fig, "", "mean GOSPA (m), smaller is better")


def record_stone_soup(report: Report, rows: pd.DataFrame, theirs: pd.DataFrame, first: str) -> None:
    """Record Stone Soup's GOSPA in every scenario, and where nothing was tuned its medians and in how many
    scenarios our GOSPA is smaller."""
    for _, one in theirs[theirs["rank"] == 1].iterrows():
        report.metric("gospa_stone_soup", f"{one['case']}/{one['mode']}", one["gospa"], "m")
    for _, one in compared(rows, theirs, first).iterrows():
        report.metric(
            "gospa_median_stone_soup", f"elsewhere/{one['mode']}", one["theirs"], "m", n=int(one["of"]),
            low=one["theirs_least"], high=one["theirs_most"],
        )  # fmt: skip
        report.metric("scenarios_ahead", f"elsewhere/{one['mode']}", one["smaller"], "1", n=int(one["of"]))


#: Where nothing was tuned, by lidar and radar together.
_BOTH = "elsewhere/both"
#: Boats that have a track in so many of the scans (%) are followed nearly all the time, or most of it.
NEARLY_ALL, MOST = 90.0, 50.0


def answer(facts: Facts) -> list[str]:
    """How much boats are tracked and how often their tracks change, then how Stone Soup compares."""
    ahead = facts.value(_BOTH, "scenarios_ahead")
    return [f"boats-{_boats(facts)}", "peer-missing" if math.isnan(ahead) else "peer-compared"]


def _boats(facts: Facts) -> str:
    tracked, changes = (facts.value(_BOTH, name) for name in ("tracked_median", "track_changes"))
    if math.isnan(tracked + changes):
        return "unknown"
    if tracked < MOST:
        return "lost"
    return "tracked" if tracked >= NEARLY_ALL and not changes else "partly"


STUDY = Study("autoferry-many", answer=answer)
