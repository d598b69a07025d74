"""Sections of the report on a flight's tracks: what is shown, in which order."""

from __future__ import annotations

import numpy as np
import pandas as pd

from wildlab.analysis.following.follow import TrackingResult
from wildlab.analysis.following.judged import Apart, leading_filter, verdict
from wildlab.analysis.following.tuned import Tuned
from wildlab.analysis.overviews.verdict import VERDICT_LEVEL
from wildlab.flight.store import Flight
from wildlab.reporting import tracking as words
from wildlab.reporting import tracking_reinitialisation as anew
from wildlab.reporting.charts import following as charts
from wildlab.reporting.charts.beside import beside_plain_shown
from wildlab.reporting.report import Report

#: Targets by sensors that are drawn; the table has all.
MOST_DRAWN = 4


def head_section(
    report: Report, followed: TrackingResult, rows: pd.DataFrame, pairs: list[Apart], tuned: Tuned | None
) -> None:
    """Title and summary."""
    targets, sensors = rows["target"].nunique(), len(followed.scans)
    title = (
        "Does a track know how wrong it is?" if followed.truth else "Are the tracks surprised as they expect?"
    )
    of = "1 target" if targets == 1 else f"{targets} targets"
    by = "1 sensor" if sensors == 1 else f"{sensors} sensors"
    ways = "" if sensors == 1 else ", each alone and all together"
    report.head(title, f"{of} followed by {by}{ways}")
    said, verdict = words.summary(rows, pairs, tuned)
    report.summary(said, level=verdict.colour, verdict=(verdict.value, words.reason_of(rows)))
    report.metric(VERDICT_LEVEL, "tracking", verdict.level, "1")
    if followed.notes:
        report.points(followed.notes)


def tracks_section(report: Report, followed: TrackingResult, rows: pd.DataFrame) -> None:
    """The table of all tracks."""
    intro = (
        "The mean NEES compares the errors of a track with what its filter says of them: 2 is right, more is "
        "overconfident. The mean NIS does so for how far detections fall from where they are expected: the "
        "number of elements of a detection is right. Both have the band in which a consistent filter's mean "
        "lies, for as many independent values as the correlated ones are worth."
    )
    report.section("Every track", intro)
    table = words.tracks_table(rows)
    truth = (
        " Compared, with RMS, NEES and inside: looks at which the target was seen; unseen: the others. "
        "Inside: share of looks whose NEES is in the band of single values, with its interval."
        if followed.truth
        else ""
    )
    report.table(
        table,
        columns=words.columns_of(table),
        digits={"compared": 0, "rmse": 2, "rmse_without": 2, "lag1": 2},
        caption="Bands: where the mean of a consistent filter lies with 95 %. Lag 1: autocorrelation of "
        "innovations from one detection to the next, of the element where it is largest; near zero is right. "
        f"Used: detections.{truth}",
    )
    anew.record(report, rows)
    again = anew.anew_table(followed, rows)
    if len(again):
        report.text(
            "Tracks that became too uncertain ended, and the next detection started another. All filters of "
            "a target start anew together."
        )
        report.table(
            again,
            columns=anew.HEADINGS,
            digits={"anew": 0, "seen": 0, "ended": 1},
            caption="Looks without a track: from the first start to the end of the last track; they are in "
            "no error, NEES or NIS. In sight: looks at which the target was seen all the same.",
        )


def pictures_section(
    report: Report, flight: Flight, followed: TrackingResult, rows: pd.DataFrame, source: str | None
) -> None:
    """Maps, and squares, errors and whiteness over time."""
    shown = rows[rows["detections"] > 0]
    if not len(shown):
        return
    name = leading_filter(rows)
    name_of_nav, nav = flight.pose_source(source)
    platforms = {name_of_nav: nav[["north_m", "east_m"]].to_numpy(float)}
    report.section("Where it went", f"Tracks with {words.filter_words(name)}.")
    for target in list(dict.fromkeys(shown["target"]))[:MOST_DRAWN]:
        truth = np.empty((0, 2))
        if flight.truth is not None:
            truth = flight.truth.loc[flight.truth["target_id"] == target, ["north_m", "east_m"]].to_numpy(
                float
            )
        report.figures([charts.map_shown(followed, target, name, truth, platforms)])
    report.section("Moment by moment")
    pairs = list(dict.fromkeys(zip(shown["sensor"], shown["target"], strict=True)))
    for sensor, target in pairs[:MOST_DRAWN]:
        mine = [one for one in followed.tracks if (one.sensor, one.target) == (sensor, target)]
        figures = [charts.squares_shown(mine, rows, "nis")]
        if any(np.isfinite(one.nees).any() for one in mine):
            beside = beside_plain_shown(mine)
            figures = [
                charts.errors_shown(mine, rows),
                *([beside] if beside else []),
                charts.squares_shown(mine, rows, "nees"),
                *figures,
            ]
        if sensor in followed.scans and (
            white := charts.whiteness_shown(mine, followed.scans[sensor].elements)
        ):
            figures.append(white)
        for i in range(0, len(figures), 2):
            report.figures(figures[i : i + 2])
    if len(pairs) > MOST_DRAWN:
        report.text(f"Drawn are {MOST_DRAWN} of {len(pairs)} pairs of sensor and target; the table has all.")


def apart_section(report: Report, pairs: list[Apart]) -> None:
    """Two sensors against each other."""
    if not pairs:
        return
    report.section(
        "One sensor against another",
        "How far apart two sensors put the same target. The mean square is in units of what both tracks "
        "state: 2 is right where their errors have nothing to do with each other. Both assume the same "
        "motion and may stand on one platform, whose errors they share: that makes it smaller.",
    )
    table = pd.DataFrame(
        [
            {
                "target": one.target,
                "sensors": f"{one.one}, {one.other}",
                "filter": words.filter_words(one.filter),
                "rms": one.rms,
                "squares": f"{one.squares.mean:.2f} ({one.squares.low:.2f} to {one.squares.high:.2f})",
                "verdict": verdict(one.squares),
            }
            for one in pairs
        ]
    )
    headings = {"target": "target", "sensors": "sensors", "filter": "filter", "rms": "apart, RMS (m)",
                "squares": "mean square (95 % band)", "verdict": "verdict"}  # fmt: skip
    report.table(table, columns=headings, digits={"rms": 1})


def told_section(report: Report, followed: TrackingResult, tuned: Tuned | None) -> None:
    """What the filters were told, and by whom."""
    intro = words.assumed_sentence(followed.said)
    if tuned is not None:
        how = "truth" if tuned.against == "truth" else "innovations"
        intro += f" Tuned on: {tuned.flight}, against its {how}. Judged on: this flight."
    report.section("What the filters were told", intro)
    headings = {"of": "of", "what": "what", "value": "value", "source": "from"}
    report.table(words.said_table(followed.said), columns=headings)


def end_section(report: Report, followed: TrackingResult) -> None:
    """What the page does not tell, and how it was computed."""
    limits = [
        "Where the truth has no standard deviation of its own, its error counts as the filter's.",
        "All filters of a target get the same detections: those that the filter with white noise let in. "
        "What it wrongly left out, none has.",
    ]
    if not followed.truth:
        limits[0] = (
            "Errors that last, of a heading for instance, are in all detections alike: innovations do not "
            "show them."
        )
    report.limits(limits)
    report.method(
        "Constant velocity with white acceleration. Detections that name their target are its own; else a "
        "track starts on the first detection within reach of its true place and takes the nearest in its "
        "gate; without truth and names all are of one target. The extended filter (EKF) takes errors for "
        "new at every look, H (3.5) and (3.7); the one for coloured noise works on differences of "
        "positions, H 7.2.2; the Schmidt filter considers errors that last without estimating them, H "
        f"7.4. Smoothed estimates know later detections too.\n\n{anew.METHOD}\n\n"
        "Errors are judged at looks at which the target was seen: where a detection is its own by name, "
        "lies within reach of its true place, or was taken. The others say how fast a track strays; their "
        "error is a number of its own. Fewer than five detections are not judged. NEES is of the position, "
        "truth minus estimate, the truth's own variance added to the filter's. A "
        "mean is consistent inside of the 95 % interval of the mean of as many independent values as its "
        "correlated ones are worth, overconfident above and too cautious below; an error that is the same "
        "throughout is one value. Shares have Wilson's interval for as many. Innovations are whitened by "
        "their own covariance before they are correlated."
    )
