"""A published number and what a run recorded for it: which of the comparisons is theirs, and what it says.

A signed mean whose sign the thesis does not define is compared by its size. A run records that size, too, as
``size_of_<name>`` (`size_name`): the median of sizes is not the size of the median.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from wildlab.evaluation.printed import (
    NOT_JUDGED,
    Comparison,
    compare_calculation,
    compare_flight,
    compare_mean,
    compare_share,
)
from wildlab.reporting.published import CALCULATED, MEAN_OF_RUNS, SHARE_OF_IMAGES, SIZES, quantity_kind

#: What a run recorded, by name and subject: entries of ``metrics.json``.
Recorded = Mapping[tuple[str, str], Mapping[str, Any]]


def size_name(name: str) -> str:
    """The metric that holds the size of a signed mean.

    Examples
    --------
    >>> size_name("mean_north")
    'size_of_mean_north'
    """
    return f"size_of_{name}"


def error_name(name: str) -> str:
    """The metric that holds the standard error of a mean of runs.

    Examples
    --------
    >>> error_name("success_rate")
    'success_rate_se'
    """
    return f"{name}_se"


MINUS = "\u2212"


def recorded_for(row: Mapping[str, Any], ours: Recorded) -> Mapping[str, Any]:
    """What a run recorded for a published number: empty where nothing, sizes where it is compared by size."""
    name, subject = str(row["name"]), str(row["subject"])
    found = ours.get((name, subject), {})
    if not row["by_size"] or found.get("value") is None:
        return found
    sizes = ours.get((size_name(name), subject))
    if sizes is not None:
        return sizes
    # One flight has no spread, and its size needs no record of its own.
    return {**found, "value": abs(found["value"]), "low": None, "high": None, "below": None}


def judge(
    row: Mapping[str, Any], ours: Recorded, printed: Mapping[tuple[str, str], float]
) -> Comparison | None:
    """Compare a published number with what a run recorded.

    Parameters
    ----------
    row
        A row of `wildlab.reporting.published.load_published`.
    ours
        What the run recorded.
    printed
        All published numbers of the study: the sizes of errors that signed means are compared with.

    Returns
    -------
    Comparison or None
        None where the run has no number for it.
    """
    name, subject = str(row["name"]), str(row["subject"])
    found = recorded_for(row, ours)
    here = found.get("value")
    if here is None:
        return None
    value = abs(float(row["value"])) if row["by_size"] else float(row["value"])
    if row["unjudged"]:
        return Comparison(NOT_JUDGED, None, here - value, None, str(row["unjudged"]))
    within = None if math.isnan(row["within"]) else float(row["within"])
    if row["kind"] == CALCULATED:
        return compare_calculation(here, value, within)
    if row["kind"] == MEAN_OF_RUNS:
        error = ours.get((error_name(name), subject), {}).get("value")
        theirs = None
        if error is not None and found.get("n") and not math.isnan(row["runs"]):
            # Nobody prints it: single runs are taken to vary there as they do here.
            theirs = error * math.sqrt(found["n"] / row["runs"])
        return compare_mean(here, value, error, theirs, within or 0.0)
    if row["fitted"]:
        # Of a signed mean near zero a ratio says nothing.
        ratio = here / value if here > 0 and value > 0 and quantity_kind(name) != "signed mean" else None
        return Comparison(NOT_JUDGED, ratio, here - value, None, str(row["fitted"]))
    if row["kind"] == SHARE_OF_IMAGES:
        return compare_share(here, value, found.get("low"), found.get("high"))
    kind = quantity_kind(name)
    if not kind:
        return Comparison(NOT_JUDGED, None, here - value, None, "no margin is fixed for this quantity")
    # A rate's margin is a share of one.
    unit = 100.0 if kind == "rate" and row["unit"] == "%" else 1.0
    low, high = found.get("low"), found.get("high")
    size = next((printed[key] for one in SIZES if (key := (one, subject)) in printed), None)
    deviation = printed.get((name.replace("mean_", "sd_", 1), subject)) if kind == "signed mean" else None
    compared = compare_flight(
        kind,
        here / unit,
        value / unit,
        None if low is None else low / unit,
        None if high is None else high / unit,
        size=size,
        deviation=deviation,
    )
    return Comparison(compared.verdict, compared.ratio, here - value, compared.spread, compared.reason)


def comparison_words(compared: Comparison) -> str:
    """Our number beside the printed one: ``"1.21"`` times it, or where no ratio says anything ``"+3.25"``.

    Parameters
    ----------
    compared
        From `judge`.

    Returns
    -------
    str
    """
    if compared.ratio is not None:
        return f"{compared.ratio:.2f}"
    off = compared.difference
    size = f"{abs(off):.2f}" if abs(off) >= 0.005 or not off else f"{abs(off):.1g}"
    return f"{'+' if off > 0 else MINUS if off < 0 else ''}{size}"
