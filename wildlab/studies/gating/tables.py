"""The tables of the report on gating, H 6.4.3, and the numbers that it records."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
import pandas as pd

from wildlab.reporting.report import Report
from wildlab.reporting.spread import bounds_of, range_words, spread_words
from wildlab.studies.gating.monte_carlo import FORMS, GATES, Outcome
from wildlab.studies.gating.readings import DEFAULT, READINGS, subject
from wildlab.studies.gating.text import NAMES, Array, mostly_wrong
from wildlab.studies.gating.variations import claim_margins, standard_error, verdict

#: Runs behind a published success rate, H 6.4.3.
PRINTED_RUNS = 10_000

_RATES_COLUMNS = {
    "form": "gating by",
    "published": "published (%)",
    "here": "here (%)",
    "se": "standard error",
    "difference": "difference",
    "both_se": "its standard error",
    "beyond": "beyond chance",
    "sd": "SD over runs",
}
RATES_DIGITS = {"published": 2, "here": 2, "se": 2, "difference": 2, "both_se": 2, "sd": 1}


def rates_columns(runs: int) -> dict[str, str]:
    """Headings of the table that `rates_table` gives for so many runs."""
    return {**_RATES_COLUMNS, "range": spread_words(runs, "run").heading}


def rates_table(rates: Array, published: Mapping[str, float]) -> pd.DataFrame:
    """A row for each gate by one reading: published and mean success rate, and how far apart they are.

    Parameters
    ----------
    rates
        (4, runs) in per cent.
    published
        Of the three forms, per cent; the gates together have none.

    Returns
    -------
    DataFrame
        ``se`` is the standard error of our mean, ``both_se`` that of the difference: both means' together,
        the published one with our spread between runs over `PRINTED_RUNS`. ``beyond``: whether the difference
        is larger than twice that.
    """
    rows: list[dict[str, object]] = []
    for gate, runs in zip(GATES, rates, strict=True):
        printed = published.get(gate, np.nan)
        sd, se = float(runs.std(ddof=1)), standard_error(runs)
        difference, both = float(runs.mean()) - printed, float(np.hypot(se, sd / np.sqrt(PRINTED_RUNS)))
        known = bool(np.isfinite(printed))
        rows.append(
            {
                "form": NAMES[gate],
                "published": printed,
                "here": runs.mean(),
                "se": se,
                "difference": difference,
                "both_se": both if known else np.nan,
                "beyond": ("yes" if abs(difference) > 2 * both else "no") if known else "",
                "sd": sd,
                "range": range_words(runs, 0),
            }
        )
    return pd.DataFrame(rows)


def readings_rates(outcomes: Mapping[str, Outcome], published: Mapping[str, float]) -> pd.DataFrame:
    """Mean rates of every reading with twice their standard error, as text, below the published ones."""
    rows = [{"track updated with": "published"} | {NAMES[form]: f"{published[form]:.2f}" for form in FORMS}]
    for name, one in outcomes.items():
        cells = {
            NAMES[gate]: f"{runs.mean():.2f} ± {2 * standard_error(runs):.2f}"
            for gate, runs in zip(GATES, one.rate, strict=True)
        }
        rows.append({"track updated with": READINGS[name].short} | cells)
    return pd.DataFrame(rows).fillna("")


def varied_table(varied: pd.DataFrame) -> pd.DataFrame:
    """Success rates of each variation of `wildlab.studies.gating.variations.vary`, in per cent as text.

    In brackets stands the change of each with twice its standard error.
    """
    shown = pd.DataFrame({"changed": varied["variation"]})
    for form in FORMS:
        cells = varied[[form, f"{form}_change", f"{form}_se"]].to_numpy(float)
        words = [f"{rate:.1f} ({change:+.1f} ± {2 * se:.1f})" for rate, change, se in cells]
        shown[f"{NAMES[form]} (%)"] = [f"{cells[0, 0]:.1f}", *(w.replace("-", "−") for w in words[1:])]
    return shown


def claims_table(outcomes: Mapping[str, Outcome], claims: Sequence[Mapping[str, str]]) -> pd.DataFrame:
    """Every claim with its verdict by the default reading, what decides it, and the others' verdicts."""
    margins = {name: claim_margins(one) for name, one in outcomes.items()}
    rows = []
    for claim in claims:
        decides = [one[np.isfinite(one)] for one in margins[DEFAULT][claim["id"]]]
        least = min(decides, key=lambda one: float(one.mean()) if len(one) else 0.0)
        margin = f"{least.mean():+.2f} ± {2 * standard_error(least):.2f}" if len(least) > 1 else ""
        rows.append(
            {
                "id": claim["id"],
                "claim": claim["text"],
                "where": claim["source"],
                "verdict": verdict(margins[DEFAULT][claim["id"]]),
                "margin": margin.replace("-", "−"),
                "runs": len(least),
            }
            | {name: verdict(margins[name][claim["id"]]) for name in outcomes if name != DEFAULT}
        )
    return pd.DataFrame(rows)


def claim_columns() -> dict[str, str]:
    """Headings of the table that `claims_table` gives."""
    first = {"claim": "claim", "where": "where", "verdict": "verdict", "margin": "least margin (points)"}
    others = {name: f"with {one.short}" for name, one in READINGS.items() if name != DEFAULT}
    return first | {"runs": "runs"} | others


def record_rates(report: Report, outcomes: Mapping[str, Outcome]) -> None:
    """Record every mean rate with its standard error, the spread of single runs, and what goes mostly wrong.

    The bounds of the spread are of single runs, so they stand with the median run and not with the mean.
    """
    for name, one in outcomes.items():
        for gate, runs, half in zip(GATES, one.rate, mostly_wrong(one.rate), strict=True):
            of, n = subject(name, gate), len(runs)
            low, high = bounds_of(pd.Series(runs))
            report.metric("success_rate", of, runs.mean(), "%", n=n)
            report.metric("success_rate_se", of, standard_error(runs), "%", n=n)
            report.metric("success_rate_median_run", of, np.median(runs), "%", n=n, low=low, high=high)
            report.metric("runs_mostly_wrong", of, half, "%", n=n)
