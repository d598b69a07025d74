"""What a real detector changes: the tracking claims on detections drawn and rendered, of the same flights."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from wildlab.evaluation.intervals import mean_interval, mean_share_interval
from wildlab.evaluation.shares import Check, Decision, decide
from wildlab.reporting.charts.drawing import draw_dots, finish, name_rows
from wildlab.reporting.charts.forms import draw_marks, draw_picture
from wildlab.reporting.figures import BLUE, VERMILLION, new_figure
from wildlab.simulation.scene.flights import corner_of
from wildlab.studies.end_to_end import trial
from wildlab.studies.end_to_end.trial import (
    DRAWN,
    KINDS,
    MARGIN,
    PIXEL_UNITS,
    RENDERED,
    FlightPair,
    tracked_filters,
)
from wildlab.studies.linear_vs_nonlinear.trial import UNITS
from wildlab.studies.page import Facts
from wildlab.studies.protocol import Study

#: Of the detections' numbers: shares, shown in per cent, and decimals of the others.
SHARES = ("detection_rate", "ellipse_coverage_90")
DECIMALS = {"false_alarms_per_image": 3}


def interval_text(values: pd.Series, scale: float = 1.0, decimals: int = 1, *, share: bool = False) -> str:
    """Mean over flights with its 95 % interval, that of a ``share`` within 0 and 1; alone of one flight.

    Examples
    --------
    >>> interval_text(pd.Series([1.0, 2.0, 3.0]))
    '2.0 (−0.5 to 4.5)'
    """
    found = mean_share_interval(values) if share else mean_interval(values)
    mean, low, high = (f"{scale * end:.{decimals}f}".replace("-", "\N{MINUS SIGN}") for end in found)
    return mean if np.isnan(found.low) else f"{mean} ({low} to {high})"


def detections_table(runs: pd.DataFrame, names: Mapping[str, str]) -> pd.DataFrame:
    """The detections themselves, drawn and rendered: means over flights with intervals, shares in per cent.

    ``names`` says what each quantity is called.
    """
    rows = []
    for name in (one for one in PIXEL_UNITS if one != "images"):
        share = name in SHARES
        row = {"quantity": names[name]}
        for kind in KINDS:
            known = (kind, name) in runs
            decimals = 0 if share else DECIMALS.get(name, 2)
            row[kind] = (
                interval_text(runs[kind, name], 100.0 if share else 1.0, decimals, share=share)
                if known
                else ""
            )
        rows.append(row)
    return pd.DataFrame(rows)


def decision_text(decision: Decision) -> str:
    """A verdict with what it is by.

    Examples
    --------
    >>> decision_text(decide([True, True, False]))
    'undecided: 2 of 3'
    """
    return f"{decision.verdict}: {decision.true} of {decision.met}" if decision.met else decision.verdict


def verdicts_table(
    checks: Mapping[str, Mapping[str, Mapping[str, Check]]], claims: Mapping[str, Sequence[Mapping[str, Any]]]
) -> pd.DataFrame:
    """Every claim with its verdict by either kind of detections.

    Parameters
    ----------
    checks
        By kind, case and the claim's id.
    claims
        Of each case, as `wildlab.reporting.published.load_claims` gives them.

    Returns
    -------
    DataFrame
        ``claim``, ``source``; for each kind the ``verdict_`` and, under its own name, that with its counts;
        ``flights``, on how many the claim comes out otherwise.
    """
    rows = []
    for case, several in claims.items():
        for claim in several:
            threshold = None if "threshold" not in claim else float(claim["threshold"])
            row: dict[str, Any] = {"claim": claim["text"], "source": claim["source"]}
            true = {}
            for kind in KINDS:
                check = checks[kind][case][claim["id"]]
                true[kind] = check.holds(threshold)
                decision = decide(true[kind], check.premise)
                row |= {f"verdict_{kind}": decision.verdict, kind: decision_text(decision)}
            row["flights"] = int((true[DRAWN] != true[RENDERED]).sum())
            rows.append(row)
    return pd.DataFrame(rows)


def count_turned(verdicts: pd.DataFrame) -> int:
    """How many claims have another verdict by the rendered detections than by the drawn ones."""
    return int((verdicts[f"verdict_{DRAWN}"] != verdicts[f"verdict_{RENDERED}"]).sum())


def frame(pair: FlightPair) -> Figure:
    """A frame about the vessel, with what is drawn, what is found and where its outline's centre is."""
    rows = np.flatnonzero(pair.marks.found)
    row = int(rows[len(rows) // 2])
    exposure = int(pair.marks.exposure[row])
    window = pair.camera.flight.window(exposure, MARGIN)
    _, counts = pair.camera.image(exposure, window)
    fig, ax = new_figure(5.2, 4.2)
    draw_picture(ax, counts, limits=None)
    marks = {"drawn": pair.drawn_uv[row], "found": pair.marks.uv[row], "centre": pair.marks.centre[row]}
    draw_marks(ax, {name: at - corner_of(window) for name, at in marks.items()})
    return finish(fig, "")


def track_errors(runs: pd.DataFrame, names: Mapping[str, str]) -> Figure:
    """Mean distance of each filter on each flight, with both kinds of detections."""
    fig, ax = new_figure(5.6, 3.0)
    filters = tracked_filters(runs)
    for row, who in enumerate(filters):
        drawn, rendered = (runs[f"{kind}-{who}", "mae"].to_numpy(float) for kind in (DRAWN, RENDERED))
        y = row + 0.5 * ((np.arange(len(drawn)) + 0.5) / len(drawn) - 0.5)
        ax.hlines(y, drawn, rendered, color="0.75", lw=1)
        draw_dots(ax, drawn, y, VERMILLION, "drawn", size=5, marker="x", mec=VERMILLION, alpha=1.0)
        draw_dots(ax, rendered, y, BLUE, "rendered", marker="o", alpha=1.0)
    name_rows(ax, [names[who] for who in filters])
    ax.set_xlim(left=0)
    return finish(fig, "", "mean distance from the truth (m)")


def answer(facts: Facts) -> list[str]:
    """Whether tracks change, then how many claims do."""
    if math.isnan(sum(facts.value(f"{kind}-kf", "mae") for kind in trial.KINDS)):
        return ["unknown"]
    return [f"tracks-{facts.choose('tracks-alike', 'alike', 'differ')}", "claims"]


STUDY = Study("end-to-end", trial.trial, trial.check_claims, (UNITS | PIXEL_UNITS).get, answer)
