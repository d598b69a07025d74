"""The page on a flight's tracks: how wrong they are, and whether their filters know.

What the page says follows by rules from `wildlab.analysis.tracks.tracker.score_tracks`; the words lie in
``data/messages/en/tracking.toml``.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pandas as pd

from wildlab.analysis.tracks.noise_model import HERE, GivenValue, Tuned
from wildlab.analysis.tracks.single_target import TOGETHER
from wildlab.analysis.tracks.tracker import (
    CAUTIOUS,
    CONSISTENT,
    LEADING,
    OVERCONFIDENT,
    UNKNOWN,
    SensorPair,
    TrackingResult,
    is_at_rest,
    leading_filter,
    verdict,
)
from wildlab.analysis.verdict import Evidence, Verdict, verdict_of
from wildlab.evaluation.ellipses import CLEAR
from wildlab.flight.store import Flight
from wildlab.messages.catalogue import Message, load_texts
from wildlab.messages.quantities import NOTHING, length, significant
from wildlab.reporting.charts import tracks as charts
from wildlab.reporting.figures import filter_words
from wildlab.reporting.georeferencing import count_problems, show_contradictions
from wildlab.reporting.metrics import band_name
from wildlab.reporting.report import Report, Wording

#: A target tracked by all sensors together may be this many times as far off as by the best one alone.
ALIKE = 1.2
_RECORDED = (
    # metric, column, unit, low, high, n
    ("rmse", "rmse", "m", None, None, "compared"),
    ("rmse_without", "rmse_without", "m", None, None, "without"),
    ("nees", "nees", "1", None, None, "compared"),
    ("nis", "nis", "1", None, None, "detections"),
    ("fraction_nees_inside", "inside", "1", "inside_low", "inside_high", "compared"),
    ("lag1_autocorrelation", "lag1", "1", None, None, "detections"),
    ("share_followed", "followed", "1", None, None, None),
)


# -- what is recorded


def _subject(row: pd.Series) -> str:
    return f"{row['sensor']}/{row['target']}/{row['filter']}".replace(" ", "-")


def record(report: Report, rows: pd.DataFrame) -> None:
    """The numbers of every track, for ``metrics.json``, and which filter the page speaks of."""
    if len(rows):
        report.metric(LEADING, leading_filter(rows), 1, "1")
    for _, row in rows.iterrows():
        subject = _subject(row)
        for name, column, unit, low, high, n in _RECORDED:
            if not np.isfinite(row[column]):
                continue
            if name in ("nees", "nis"):
                # Of a consistent filter; an interval of the value it is not.
                for end in ("low", "high"):
                    if np.isfinite(row[f"{name}_{end}"]):
                        report.metric(band_name(name, end), subject, float(row[f"{name}_{end}"]), "1")
            more = {key: row[of] for key, of in (("n", n), ("low", low), ("high", high)) if of is not None}
            report.metric(name, subject, float(row[column]), unit, **more)


def record_restarts(report: Report, rows: pd.DataFrame) -> None:
    """How often each track was reinitialised, and at how many scans there was none."""
    for _, row in rows[rows["spanned"] > 0].iterrows():
        subject = _subject(row)
        report.metric("started_anew", subject, int(row["restarts"]), "1")
        report.metric("looks_without_track", subject, int(row["untracked"]), "1", n=int(row["spanned"]))


# -- what follows from it


def surprised(rows: pd.DataFrame) -> pd.DataFrame:
    """Tracks whose detections are not where they expect them, whatever their errors: the mean NIS is above
    its band, and by so much that it matters."""
    beyond = np.sqrt(rows["nis"] / rows["dof"]) > CLEAR
    beyond &= rows["nis_verdict"] == OVERCONFIDENT
    return rows[beyond]


def split_together(known: pd.DataFrame) -> tuple[pd.DataFrame, pd.DataFrame]:
    """Tracks of all sensors together, and those that the page speaks of: of one sensor each, if any."""
    alone = known[known["kind"] != TOGETHER]
    return known[known["kind"] == TOGETHER], alone if len(alone) else known


def leading_rows(rows: pd.DataFrame) -> pd.DataFrame:
    """One track of each target by each sensor, of one sensor each if any: that of the filter that leads,
    first those that have one; else, where a sensor's detections cannot go through it, the first."""
    _, alone = split_together(rows[rows["used"] > 0])
    other = alone["filter"] != leading_filter(alone)
    ordered = alone.loc[other.sort_values(kind="stable").index]
    return ordered.drop_duplicates(["sensor", "target"])


def worse_together(rows: pd.DataFrame) -> Message | None:
    """All sensors beside the best one alone, of the target where that is worst; None where no worse."""
    known = rows[rows["compared"] > 0]
    together, alone = split_together(known)
    if len(alone) == len(known):
        return None
    mine = alone[alone["filter"] == leading_filter(alone)]
    together = together[together["filter"] == leading_filter(alone)]
    best = mine.loc[mine.groupby("target")["rmse"].idxmin().dropna()].set_index("target")
    both = together[together["target"].isin(best.index) & together["rmse"].notna()].set_index("target")
    if not len(both):
        return None
    own, least = both["rmse"].to_numpy(float), best["rmse"].reindex(both.index).to_numpy(float)
    worst = int(np.argmax(own / least))
    target = str(both.index[worst])
    if own[worst] <= ALIKE * least[worst]:
        return None
    values = {
        "target": target,
        "sensor": str(best.loc[target, "sensor"]),
        "together": length(float(own[worst])),
        "alone": length(float(least[worst])),
    }
    return Message("worse-together", values)


def judge_tracks(rows: pd.DataFrame, pairs: Sequence[SensorPair], problems: int = 0) -> Verdict:
    """What the tracks come to.

    Parameters
    ----------
    rows
        From `wildlab.analysis.tracks.tracker.score_tracks`.
    pairs
        From `wildlab.analysis.tracks.tracker.compare_sensors`.
    problems
        How many things in the flight contradict each other.

    Returns
    -------
    Verdict
    """
    if problems or not (rows["detections"] > 0).any():
        return Verdict.MEND
    mine = leading_rows(rows)
    if (rows["compared"] > 0).any():
        against = int(mine["verdict"].isin([OVERCONFIDENT, CAUTIOUS]).sum())
        troubled = against + len(surprised(mine)) + (worse_together(rows) is not None)
        # Of tracks that mostly could not be judged a consistent one says little.
        sound = (mine["verdict"] == CONSISTENT).mean() > 0.5
        return verdict_of(Evidence(troubled=troubled, judged=int(sound)))
    used = [one for one in pairs if one.filter == leading_filter(mine)]
    agree = all(verdict(one.squares) == CONSISTENT for one in used)
    against = int(mine["nis_verdict"].isin([OVERCONFIDENT, CAUTIOUS]).sum())
    # Consistent innovations do not show an error that lasts: never sound.
    return verdict_of(Evidence(troubled=against + (not agree)))


def answer(rows: pd.DataFrame, pairs: Sequence[SensorPair]) -> list[Message]:
    """Whether the tracks know how wrong they are, and the most important thing beside it; two at most.

    Parameters
    ----------
    rows, pairs
        As of `judge_tracks`.
    """
    if not (rows["detections"] > 0).any():
        return [Message("one-detection" if (rows["used"] > 0).any() else "no-track")]
    mine = leading_rows(rows)
    with_truth = bool((rows["compared"] > 0).any())
    column, what = ("verdict", "nees") if with_truth else ("nis_verdict", "nis")
    judged = mine[mine[column] != UNKNOWN]
    # Numbers are of the tracks that the verdict is on; where there is none, of all.
    shown = judged if len(judged) else mine
    known = shown.dropna(subset=[what])
    ratio = np.sqrt(known[what] / (2.0 if with_truth else known["dof"]))
    values = {
        "n": len(mine),
        # Where sensors' detections go through different filters, all of them, the most frequent first.
        "filter": " and ".join(
            load_texts("tracking").subjects[str(name)] for name in shown["filter"].value_counts().index
        ),
        "judged": len(judged),
        "rmse": length(float(shown["rmse"].median())) if with_truth else "",
        "times": significant(float(np.median(ratio)) if len(ratio) else np.nan),
        **{key: str(int((mine[column] == word).sum())) for key, word in _COUNTED.items()},
    }
    found = set(judged[column])
    if not found:
        kind = "unknown"
    elif len(found) > 1 or 2 * len(judged) <= len(mine):
        kind = "mixed"
    else:
        kind = next(key for key, word in _COUNTED.items() if word in found)
    first = Message(f"{'errors' if with_truth else 'innovations'}-{kind}", values)
    beside = _beside(rows, mine, pairs, with_truth=with_truth)
    return [first, *([beside] if beside is not None else [])]


_COUNTED = {"consistent": CONSISTENT, "overconfident": OVERCONFIDENT, "conservative": CAUTIOUS}


def _beside(
    rows: pd.DataFrame, mine: pd.DataFrame, pairs: Sequence[SensorPair], *, with_truth: bool
) -> Message | None:
    """The most important thing beside the first sentence."""
    if (worse := worse_together(rows)) is not None:
        return worse
    odd = surprised(mine)
    # Where errors are as predicted, nothing else says so.
    if with_truth and (odd["verdict"] == CONSISTENT).any():
        times = significant(float(np.sqrt((odd["nis"] / odd["dof"]).median())))
        return Message("surprised", {"tracks": len(odd), "n": len(mine), "times": times})
    by_pair = rows.groupby(["sensor", "target"], sort=False)["detections"].max()
    if never := int((~(by_pair > 0)).sum()):
        return Message("never-tracked", {"never": never, "of": len(by_pair)})
    if "restarts" in rows:
        each = rows.drop_duplicates(["sensor", "target"])
        if restarts := int(each["restarts"].sum()):
            gone, scans = int(each["untracked"].sum()), int(each["spanned"].sum())
            return Message("restarted", {"times": restarts, "gone": gone, "looks": scans})
    if not with_truth:
        used = [one for one in pairs if one.filter == mine["filter"].iloc[0]]
        if not used:
            return Message("no-truth")
        one = max(used, key=lambda pair: pair.squares.mean)
        values = {
            "one": one.one,
            "other": one.other,
            "target": one.target,
            "rms": length(one.rms),
            "times": significant(float(np.sqrt(one.squares.mean / 2))),
        }
        return Message("apart", values)
    return None


def reason(rows: pd.DataFrame, problems: int = 0) -> Message:
    """Why the verdict of `judge_tracks` is what it is: what the leading filter's tracks were found to be."""
    if problems:
        return Message("reason-contradictions", {"problems": problems})
    if not (rows["detections"] > 0).any():
        return Message("reason-none")
    mine = leading_rows(rows)
    column = "verdict" if (rows["compared"] > 0).any() else "nis_verdict"
    what = "nees" if column == "verdict" else "nis"
    counts = ", ".join(
        f"{word} ({count})"
        for word in (CONSISTENT, OVERCONFIDENT, CAUTIOUS, UNKNOWN)
        if (count := int((mine[column] == word).sum()))
    )
    return Message(f"reason-{what}", {"counts": counts})


# -- tables


def most_pressing_first(rows: pd.DataFrame) -> pd.DataFrame:
    """Tracks of the filter that the page speaks of first; of these what is overconfident or `surprised`, then
    what is further from consistent, and of alike ones the larger error."""
    if not len(rows):
        return rows
    what = "nees" if (rows["compared"] > 0).any() else "nis"
    verdict = rows["verdict" if what == "nees" else "nis_verdict"]
    odd = rows.index.isin(surprised(rows).index)
    order = pd.DataFrame(
        {
            "other": rows["filter"] != leading_filter(rows),
            "verdict": verdict.map([OVERCONFIDENT, CAUTIOUS, UNKNOWN, CONSISTENT].index).mask(odd, 0),
            "error": -rows["rmse" if what == "nees" else "nis"],
        }
    ).sort_values(["other", "verdict", "error"], kind="stable")
    return rows.loc[order.index]


def tracks_table(rows: pd.DataFrame) -> pd.DataFrame:
    """A row for each track: errors, NEES, NIS, autocorrelation, each beside what it should be."""
    truth = bool((rows["compared"] > 0).any())

    def band(row: pd.Series, what: str) -> str:
        if not np.isfinite(row[what]):
            return NOTHING
        return f"{row[what]:.2f} ({row[f'{what}_low']:.2f} to {row[f'{what}_high']:.2f})"

    shown = []
    for _, row in rows.iterrows():
        one = {
            "track": f"{row['target']}, {row['sensor']}",
            "filter": filter_words(row["filter"]),
            "nis_verdict": row["nis_verdict"],
        }
        if truth:
            one |= {
                "verdict": row["verdict"],
                "compared": row["compared"],
                "rmse": row["rmse"],
                "rmse_without": row["rmse_without"],
                "nees": band(row, "nees"),
            }
        one |= {"nis": band(row, "nis"), "lag1": row["lag1"]}
        shown.append(one)
    return pd.DataFrame(shown)


def restarts_table(rows: pd.DataFrame) -> pd.DataFrame:
    """A row for each target and sensor whose track ended and was reinitialised."""
    again = rows[rows["restarts"] > 0].drop_duplicates(["sensor", "target"])
    return pd.DataFrame(
        [
            {
                "track": f"{row['target']}, {row['sensor']}",
                "anew": row["restarts"],
                "gone": f"{row['untracked']} of {row['spanned']}",
            }
            for _, row in again.iterrows()
        ]
    )


def apart_table(pairs: Sequence[SensorPair]) -> pd.DataFrame:
    """Two sensors against each other, a row for each target and filter."""
    return pd.DataFrame(
        [
            {
                "target": one.target,
                "sensors": f"{one.one}, {one.other}",
                "filter": filter_words(one.filter),
                "rms": one.rms,
                "mean": one.squares.mean,
                "low": one.squares.low,
                "high": one.squares.high,
                "verdict": verdict(one.squares),
            }
            for one in pairs
        ]
    )


def parameters_table(given: Sequence[GivenValue]) -> pd.DataFrame:
    """What filters were given, first what is assumed or estimated on this flight; a name is only text."""
    ordered = sorted(given, key=lambda one: not one.source.startswith(("assumed", HERE)))
    return pd.DataFrame(
        [
            {"of": plain(one.subject), "what": one.what, "value": plain(one.value), "source": one.source}
            for one in ordered
        ]
    )


def count_assumed(given: Sequence[GivenValue]) -> dict[str, str]:
    """How many of the given values are assumed, and estimated on this flight, for captions."""
    counts = {name: sum(one.source.startswith(source) for one in given)
              for name, source in (("values", ""), ("assumed", "assumed"), ("here", HERE))}  # fmt: skip
    return {name: str(count) for name, count in counts.items()}


def plain(text: str) -> str:
    """A name without the signs by which a page sets words bold or as code."""
    return text.replace("*", "∗").replace("`", "ˋ")


# -- the page


def show_tracks(
    report: Report,
    flight: Flight,
    followed: TrackingResult,
    rows: pd.DataFrame,
    pairs: Sequence[SensorPair],
    tuned: Tuned | None = None,
    source: str | None = None,
    amiss: Sequence[str] = (),
) -> None:
    """Write the page.

    Parameters
    ----------
    report
        Is added to.
    flight, followed
        The flight, and its tracks.
    rows, pairs
        From `wildlab.analysis.tracks.tracker`: a row a track, and sensors beside each other.
    tuned
        What another flight taught.
    source
        Name of the poses' ``nav`` table; None for the flight's own.
    amiss
        What does not fit together in the flight: `wildlab.flight.checks.check.sense_sentences`.
    """
    wording, problems = Wording(report, load_texts("tracking")), count_problems(amiss)
    record(report, rows)
    title = wording.texts.subjects["question" if followed.truth else "question-innovations"]
    report.head(title, f"targets: {rows['target'].nunique()}, sensors: {len(followed.scans)}")
    verdict = judge_tracks(rows, pairs, problems)
    wording.summary(answer(rows, pairs), verdict, reason(rows, problems), "tracking")
    show_contradictions(report, amiss)
    if followed.notes:
        report.points(followed.notes)
    wording.table("tracks", tracks_table(most_pressing_first(rows)))
    record_restarts(report, rows)
    _show_figures(report, flight, followed, rows, source)
    limits = ["truth" if followed.truth else "innovations", "same-detections"]
    if any(map(is_at_rest, followed.tracks)):
        limits.append("at-rest")
    if len(rows[["sensor", "target"]].drop_duplicates()) > 1:
        limits.append("drawn")
    report.limits(wording.messages(Message(f"limit-{one}") for one in limits))
    report.section("Details")
    wording.table("restarts", restarts_table(rows))
    wording.table("apart", apart_table(pairs))
    flights = {"tuned": tuned.flight if tuned is not None else "no other flight"}
    wording.table("parameters", parameters_table(followed.given), count_assumed(followed.given) | flights)
    report.method(wording.texts.method)


def _show_figures(
    report: Report, flight: Flight, followed: TrackingResult, rows: pd.DataFrame, source: str | None
) -> None:
    """A map, and squares, errors and whiteness over time, of the most pressing track, of a target that moves
    if any."""
    shown = most_pressing_first(rows[rows["detections"] > 0])
    if not len(shown):
        return
    moving = {one.target for one in followed.tracks if not is_at_rest(one)}
    first = shown.loc[(~shown["target"].isin(moving)).sort_values(kind="stable").index[0]]
    target, sensor = first["target"], first["sensor"]
    name_of_nav, nav = flight.pose_source(source)
    platforms = {name_of_nav: nav[["north_m", "east_m"]].to_numpy(float)}
    truth = np.empty((0, 2))
    if flight.truth is not None:
        mine = flight.truth["target_id"] == target
        truth = flight.truth.loc[mine, ["north_m", "east_m"]].to_numpy(float)
    fig, own, alt, caption = charts.map_shown(followed, target, leading_filter(rows), truth, platforms)
    report.figure(fig, name=own, alt=alt, caption=caption, main=True)
    report.section("Tracks")
    tracks = [one for one in followed.tracks if (one.sensor, one.target) == (sensor, target)]
    figures = [charts.squares_shown(tracks, rows, "nis")]
    if any(np.isfinite(one.nees).any() for one in tracks):
        errors = [charts.errors_shown(tracks, rows), charts.squares_shown(tracks, rows, "nees")]
        figures = [*errors, *figures]
    if sensor in followed.scans and (
        white := charts.whiteness_shown(tracks, followed.scans[sensor].elements)
    ):
        figures.append(white)
    report.figures(figures[:2])
    if figures[2:]:
        report.figures(figures[2:], fold=f"More of {target} by {sensor}")
