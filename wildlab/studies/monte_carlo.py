"""Parts of a report on many simulated flights: published beside reproduced, and the verdicts on claims."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike

from wildlab.reporting.published import load_claims
from wildlab.reporting.report import Report
from wildlab.reporting.spread import bounds_of, range_words, spread_words
from wildlab.studies.protocol import Study

#: Share of the flights on which a claim must be true to hold, and below which it does not.
HOLDS, FAILS = 0.9, 0.5

#: Decimals of the table that `beside_published` gives, headings of that of `decide_claims`.
PUBLISHED_DIGITS = dict.fromkeys(("published", "here", "difference", "drawn"), 2)
CLAIM_COLUMNS = {"claim": "claim", "source": "where", "verdict": "verdict", "share": "flights (%)"}


def published_columns(n: int) -> dict[str, str]:
    """Headings of the table that `beside_published` gives for ``n`` flights."""
    if n < 2:
        return {
            "subject": "pose",
            "quantity": "quantity (m)",
            "published": "published",
            "here": "here, one flight",
            "difference": "difference",
        }
    return {
        "subject": "pose",
        "quantity": "quantity (m)",
        "published": "published",
        "here": "here, median",
        "difference": "difference",
        "range": spread_words(n).heading,
        "inside": "published inside",
        "drawn": "flight drawn",
    }


def record_spread(report: Report, study: Study, spread: pd.DataFrame, n: Mapping[str, int]) -> None:
    """Record medians over flights, and as their range what `bounds_of` gives.

    A quantity that only the flight drawn has, which stands first, is recorded from that one alone.

    Parameters
    ----------
    study
        It says what each column is called.
    spread
        Columns (subject, name), one row for each flight; a flight on which a quantity was not computed has
        NaN.
    n
        How many observations stand behind each subject, where that is known.
    """
    columns: Any = spread.columns
    for key in columns:
        named = None if study.metric_of is None else study.metric_of(*key)
        if named is None:
            continue
        name, subject, unit = named
        values = spread[key]
        if len(values) > 1 and values.notna().sum() == 1 and np.isfinite(values.iloc[0]):
            report.metric(name, subject, values.iloc[0], unit, n=1)
            continue
        low, high = bounds_of(values)
        report.metric(name, subject, values.median(), unit, n=n.get(subject), low=low, high=high)


def beside_published(
    published: Mapping[tuple[str, str], float],
    spread: pd.DataFrame,
    subjects: Mapping[str, str],
    names: Sequence[str],
) -> pd.DataFrame:
    """Published numbers beside the median over flights, the bounds of their spread, and the first flight.

    Parameters
    ----------
    published
        Values by (subject, name).
    spread
        One row for each flight, the drawn one first; columns are (subject, name).
    subjects
        Words for each subject.
    names
        Which quantities, in order.
    """
    rows = []
    for subject, words in subjects.items():
        for name in names:
            values, printed = spread[subject, name], published[subject, name]
            low, high = bounds_of(values)
            rows.append(
                {
                    "subject": words,
                    "quantity": {"mae": "mean error"}.get(name, name.replace("_", " ").replace("sd", "SD")),
                    "published": printed,
                    "here": values.median(),
                    "difference": values.median() - printed,
                    "range": range_words(values),
                    "inside": "yes" if low <= printed <= high else "no",
                    "drawn": values.iloc[0],
                }
            )
    return pd.DataFrame(rows)


def decide_claims(report: Report, study: str, checks: Mapping[str, ArrayLike]) -> pd.DataFrame:
    """Record the verdict on each published claim of a study, and return them as a table.

    ``checks`` says for each claim's id on which flights it is true, (seeds,) bool. A claim holds where it is
    true on 90 % of the flights, and does not below half of them; in between it cannot be decided.
    """
    rows = []
    for claim in load_claims(study):
        true = np.asarray(checks[claim["id"]], bool)
        share = float(true.mean())
        verdict = "holds" if share >= HOLDS else "does not hold" if share < FAILS else "cannot be decided"
        report.claim(claim["id"], claim["text"], verdict, fraction=share, seeds=len(true))
        rows.append(
            {"claim": claim["text"], "source": claim["source"], "verdict": verdict, "share": 100 * share}
        )
    return pd.DataFrame(rows)
