"""Stone Soup's joint probabilistic data association and our tracker: same scans, tuning and scores."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from wildlab.analysis.tracks.many import ManyTracks, judged
from wildlab.analysis.tracks.tracker import track
from wildlab.evaluation.identities import Identities
from wildlab.flight.store import Flight
from wildlab.flight.tracking_settings import Settings
from wildlab.reporting.figures import BLUE, ORANGE, new_figure
from wildlab.reporting.report import Report
from wildlab.studies.autoferry_many.scores import BEST, medians, row_of
from wildlab.studies.autoferry_many.stone_soup import Choice, draw_choice, installed, run_stone_soup
from wildlab.studies.autoferry_many.tuning import (
    MODES,
    RADAR_REACH_M,
    Tuned,
    anees_of,
    gospa_of,
    order,
    reach_of,
)

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
            case: track(flight, "joint", settings=settings[mode], sensors=MODES[mode])
            for case, flight in flights.items()
        }
        reach = {case: reach_of(flight, mode) for case, flight in flights.items()}
        drawn = []
        for number, choice in enumerate(choices, start=1):
            print(f"\r{NAME}, {mode}: {number} of {len(choices)} draws", end="", flush=True)
            drawn.append(Drawn(number, choice, judged(replace_tracks(given[first], choice), reach[first])))
        print(flush=True)
        drawn.sort(key=order)
        best = drawn[: min(BEST, -(-len(drawn) // FOR_EACH))]
        for rank, one in enumerate(best, start=1):
            print(f"\r{NAME}, {mode}: {rank} of {len(best)} on the others", end="", flush=True)
            for case in flights:
                own = case == first
                lives = one.lives if own else judged(replace_tracks(given[case], one.choice), reach[case])
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
    fig, axes = new_figure(6.0, 1.5 + 0.36 * len(cases) * len(modes), rows=len(modes), sharex=True)
    both = ((rows, "wildlab", BLUE, -0.15, "o"), (theirs, NAME, ORANGE, 0.15, "s"))
    for ax, mode in zip(np.atleast_1d(axes), modes, strict=True):
        for table, name, tint, shift, mark in both:
            for place, case in enumerate(cases):
                own = table[(table["mode"] == mode) & (table["case"] == case)]
                ax.plot([own["gospa"].min(), own["gospa"].max()], [place + shift] * 2, color=tint, lw=1.5)
                best = own.loc[own["rank"] == 1, "gospa"]
                ax.plot(best, [place + shift] * len(best), mark, color=tint, ms=6, label=name)
        ax.set_yticks(range(len(cases)), [f"{one} (tuned here)" if one == first else one for one in cases])
        ax.set_ylim(len(cases) - 0.5, -0.5)
        ax.set_title(names[mode])
    last = np.atleast_1d(axes)[-1]
    last.set_xlabel("mean GOSPA (m), smaller is better")
    last.set_xlim(left=0)
    handles, labels = last.get_legend_handles_labels()
    once = dict(zip(labels, handles, strict=True))
    fig.legend(once.values(), once.keys(), loc="outside lower center", ncols=2)
    return fig


def record(report: Report, rows: pd.DataFrame, theirs: pd.DataFrame, first: str) -> None:
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
