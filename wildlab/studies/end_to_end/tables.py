"""Drawn and rendered detections side by side: themselves, their tracks, and the claims they decide."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import pandas as pd

from wildlab.evaluation.runs import mean_interval, mean_share_interval
from wildlab.evaluation.shares import Check, Decision, decide
from wildlab.studies.end_to_end.trial import DRAWN, KINDS, PIXEL_UNITS, RENDERED, tracked_filters

#: Of the detections' numbers: shares, shown in per cent, and decimals of the others.
SHARES = ("detection_rate", "ellipse_coverage_90", "ground_coverage_90_true_poses", "ground_coverage_90")
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


def tracks_table(runs: pd.DataFrame, names: Mapping[str, str]) -> pd.DataFrame:
    """Each filter's mean distance, NEES and NIS with both kinds: medians over flights."""
    middle = runs.median()
    return pd.DataFrame(
        [
            {"filter": names[who]}
            | {
                f"{name}_{kind}": float(middle[f"{kind}-{who}", name])
                for name in ("mae", "nees", "nis")
                for kind in KINDS
            }
            for who in tracked_filters(runs)
        ]
    )


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
