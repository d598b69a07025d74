"""Stone Soup's joint probabilistic data association beside our tracker: same scans, tuning and judge."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
import pandas as pd

from wildlab.analysis.many.follow import ManyTracks, judged, track_targets
from wildlab.evaluation.identities import Identities
from wildlab.flight.following import Settings
from wildlab.flight.store import Flight
from wildlab.reporting.charts.drawing import Shown
from wildlab.reporting.figures import BLUE, ORANGE, new_figure
from wildlab.reporting.report import Report
from wildlab.studies.autoferry_many.judged import BEST, HEADINGS, MODE_WORDS, medians, row_of
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
#: Medians of GOSPA that others reached with Stone Soup's JPDA on these scenarios, tuned on scenario 2, m.
ELSEWHERE_M = {"radar": 9.0, "lidar": 5.9, "both": 11.5}
ELSEWHERE_ON = frozenset({"scenario-3", "scenario-5", "scenario-13", "scenario-17"})
#: Its columns in the table of scenarios.
COLUMN = {"theirs": "Stone Soup's (m)"}
MISSING = (
    f"{NAME} is not beside our tracker: the library is not installed here. In a checkout, "
    "`pip install '.[oracles]'` brings it; then run this study again."
)


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


def modes_beside() -> list[str]:
    """The ways to look whose sensors all tell places: the others need more than its standard parts."""
    return [mode for mode, sensors in MODES.items() if set(sensors) <= set(FAR_M)]


def follow_beside(followed: ManyTracks, choice: Choice) -> ManyTracks:
    """What our tracker was given, with what Stone Soup shows in place of ours: same looks, same truths."""
    names = [one.name for one in followed.sensors]
    return followed._replace(shown=run_stone_soup(followed.scans, names, choice))


def judge_beside(
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
    for mode in modes_beside():
        given = {
            case: track_targets(flight, settings=settings[mode], sensors=MODES[mode])
            for case, flight in flights.items()
        }
        reach = {case: reach_of(flight, mode) for case, flight in flights.items()}
        drawn = []
        for number, choice in enumerate(choices, start=1):
            print(f"\r{NAME}, {mode}: {number} of {len(choices)} draws", end="", flush=True)
            drawn.append(Drawn(number, choice, judged(follow_beside(given[first], choice), reach[first])))
        print(flush=True)
        drawn.sort(key=order)
        best = drawn[: min(BEST, -(-len(drawn) // FOR_EACH))]
        for rank, one in enumerate(best, start=1):
            print(f"\r{NAME}, {mode}: {rank} of {len(best)} on the others", end="", flush=True)
            for case in flights:
                own = case == first
                lives = one.lives if own else judged(follow_beside(given[case], one.choice), reach[case])
                rows.append(
                    row_of(lives, case, mode) | {"rank": rank, "draw": one.number, "tuned_gospa": one.gospa}
                )
        print(flush=True)
    return pd.DataFrame(rows)


def settings_of(tuned: Mapping[str, list[Tuned]]) -> dict[str, Settings]:
    """Our best draw of each mode."""
    return {mode: several[0].settings for mode, several in tuned.items()}


def with_theirs(best: pd.DataFrame, theirs: pd.DataFrame) -> tuple[pd.DataFrame, dict[str, str]]:
    """Our table of scenarios with Stone Soup's GOSPA in a column after ours, and its headings."""
    if not len(theirs):
        return best, HEADINGS
    other = theirs[theirs["rank"] == 1].set_index(["case", "mode"])["gospa"]
    keys = pd.MultiIndex.from_frame(best[["case", "mode"]])
    headings: dict[str, str] = {}
    for name, words in HEADINGS.items():
        headings |= {name: words} | (COLUMN if name == "gospa" else {})
    return best.assign(theirs=other.reindex(keys).to_numpy()), headings


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


def sentences(table: pd.DataFrame) -> list[str]:
    """Who is nearer to the truth, by how much and how often; from `compared`."""
    if not len(table):
        return []
    parts = [
        f"{MODE_WORDS[one['mode']]} {_apart(one['ours'] - one['theirs'])} ({one['ours']:.1f} and "
        f"{one['theirs']:.1f} m), smaller in {one['smaller']} of {one['of']} scenarios"
        for _, one in table.iterrows()
    ]
    return [f"Beside {NAME} on the same scans, our tracker's median GOSPA is, by {'; by '.join(parts)}."]


def _apart(gap: float) -> str:
    """ "1.2 m smaller"."""
    if round(abs(gap), 1) == 0:
        return "as large to a tenth of a metre"
    return f"{abs(gap):.1f} m {'smaller' if gap < 0 else 'larger'}"


def tuning(draws: int) -> str:
    """What each was tuned by."""
    taken = min(draws, MOST_DRAWS)
    return f"Each is tuned on the first scenario alone: ours by {draws} random draws, {NAME} by {taken}."


def spread(table: pd.DataFrame) -> list[str]:
    """Whether the medians of the best draws of both reach over each other, in a sentence for each mode."""
    said = []
    for _, one in table.iterrows():
        apart = one["ours_most"] < one["theirs_least"] or one["theirs_most"] < one["ours_least"]
        said.append(
            f"By {MODE_WORDS[one['mode']]}, the medians of {_best(one, 'ours')} of ours and of "
            f"{_best(one, 'theirs')} of {NAME} {'lie apart' if apart else 'overlap'}."
        )
    return said


def _best(one: pd.Series, who: str) -> str:
    """ "the best draw", "the best 5 draws"."""
    count = int(one[f"draws_{who}"])
    return "the best draw" if count == 1 else f"the best {count} draws"


def elsewhere(table: pd.DataFrame, cases: frozenset[str]) -> str:
    """How these medians of Stone Soup differ from those that others reached; "" on other scenarios."""
    known = [one for _, one in table.iterrows() if one["mode"] in ELSEWHERE_M] if len(table) else []
    if cases != ELSEWHERE_ON or not known:
        return ""
    parts = [
        f"by {MODE_WORDS[one['mode']]} {ELSEWHERE_M[one['mode']]:.1f} m, here "
        f"{_apart(one['theirs'] - ELSEWHERE_M[one['mode']])}"
        for one in known
    ]
    return (
        f"Others who followed the same boats with {NAME}, with settings of their own, reached medians of: "
        f"{'; '.join(parts)}."
    )


def chart(rows: pd.DataFrame, theirs: pd.DataFrame, first: str) -> Shown:
    """GOSPA of both in every scenario by every mode: the best draw, and a line over the best few."""
    modes = [mode for mode in dict.fromkeys(rows["mode"]) if (theirs["mode"] == mode).any()]
    cases = list(dict.fromkeys(rows["case"]))
    fig, axes = new_figure(6.0, 1.5 + 0.36 * len(cases) * len(modes), rows=len(modes), sharex=True)
    both = ((rows, "ours", BLUE, -0.15, "o"), (theirs, NAME, ORANGE, 0.15, "s"))
    for ax, mode in zip(np.atleast_1d(axes), modes, strict=True):
        for table, name, tint, shift, mark in both:
            for place, case in enumerate(cases):
                own = table[(table["mode"] == mode) & (table["case"] == case)]
                ax.plot([own["gospa"].min(), own["gospa"].max()], [place + shift] * 2, color=tint, lw=1.5)
                best = own.loc[own["rank"] == 1, "gospa"]
                ax.plot(best, [place + shift] * len(best), mark, color=tint, ms=6, label=name)
        ax.set_yticks(range(len(cases)), [f"{one} (tuned here)" if one == first else one for one in cases])
        ax.set_ylim(len(cases) - 0.5, -0.5)
        ax.set_title(f"By {MODE_WORDS[mode]}")
    last = np.atleast_1d(axes)[-1]
    last.set_xlabel("mean GOSPA (m), smaller is better")
    last.set_xlim(left=0)
    handles, labels = last.get_legend_handles_labels()
    once = dict(zip(labels, handles, strict=True))
    fig.legend(once.values(), once.keys(), loc="outside lower center", ncols=2)
    ways = ", by ".join(MODE_WORDS[mode] for mode in modes)
    alt = f"Mean GOSPA of our tracker and of {NAME} in {len(cases)} scenarios, by {ways}."
    few = [int(table["rank"].max()) for table in (rows, theirs)]
    caption = (
        f"Marks are each tracker's best draw; lines reach over the best {few[0]} of ours and {few[1]} of "
        f"{NAME}."
    )
    return fig, "beside", alt, caption


def show(report: Report, rows: pd.DataFrame, theirs: pd.DataFrame, first: str, draws: int) -> None:
    """The section of the page, and the numbers for ``metrics.json``."""
    table = compared(rows, theirs, first)
    if not len(theirs):
        report.section(f"Beside {NAME}", MISSING)
        return
    _record(report, theirs, table)
    if not len(table):
        report.section(f"Beside {NAME}", "There is no scenario that nothing was tuned on.")
        return
    cases = frozenset(str(case) for case in rows["case"] if case != first)
    report.section(f"Beside {NAME}", tuning(draws))
    fig, name, alt, caption = chart(rows, theirs, first)
    report.figure(fig, name=name, alt=" ".join([alt, *sentences(table)]), caption=caption)
    report.table(_medians_table(table), caption=_caption(table))
    report.points(one for one in [*spread(table), elsewhere(table, cases)] if one)


def _medians_table(table: pd.DataFrame) -> pd.DataFrame:
    def reach(one: pd.Series, who: str) -> str:
        best = f"{one[who]:.2f}"
        if one[f"draws_{who}"] == 1:
            return best
        return f"{best} ({one[f'{who}_least']:.2f} to {one[f'{who}_most']:.2f})"

    return pd.DataFrame(
        [
            {
                "by": MODE_WORDS[one["mode"]],
                "ours (m)": reach(one, "ours"),
                f"{NAME} (m)": reach(one, "theirs"),
                "ours smaller in": f"{one['smaller']} of {one['of']}",
            }
            for _, one in table.iterrows()
        ]
    )


def _caption(table: pd.DataFrame) -> str:
    return (
        f"Median GOSPA of the {int(table['of'].max())} scenarios on which nothing was tuned, with the best "
        f"draw, and the smallest and largest with {_best(table.iloc[0], 'ours')} of ours and "
        f"{_best(table.iloc[0], 'theirs')} of {NAME}."
    )


def _record(report: Report, theirs: pd.DataFrame, table: pd.DataFrame) -> None:
    for _, one in theirs[theirs["rank"] == 1].iterrows():
        report.metric("gospa_stone_soup", f"{one['case']}/{one['mode']}", one["gospa"], "m")
    for _, one in table.iterrows():
        report.metric(
            "gospa_median_stone_soup", f"elsewhere/{one['mode']}", one["theirs"], "m", n=int(one["of"]),
            low=one["theirs_least"], high=one["theirs_most"],
        )  # fmt: skip


METHOD = (
    f"{NAME} (`wildlab.studies.autoferry_many.stone_soup`) is made of its standard parts: constant velocity, "
    "positions with normal errors, exact joint probabilities, tracks that begin after some measurements and "
    "end by time or covariance. It is given the same scans in the order of time, stamps moved alike, "
    "and uses them as far out. Where a draw says so, its tracks are shown once they have moved, by the rule "
    "of ours. They are judged as ours are. It has no existence, no visibility and no hulls, and takes no "
    "bearings."
)
