"""A published number and what a run recorded for it: which of the comparisons is theirs, and what it says.

A signed mean whose sign the thesis does not define is compared by its size. A run records that size, too, as
``size_of_<name>`` (`size_name`): the median of sizes is not the size of the median.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

from wildlab.evaluation.order_statistics import LEVEL, prediction_rank
from wildlab.evaluation.replication import (
    Comparison,
    compare_calculation,
    compare_flight,
    compare_mean,
    not_judged,
)
from wildlab.evaluation.runs import share_interval
from wildlab.reporting.published import CALCULATED, MEAN_OF_RUNS, SHARE_OF_IMAGES, quantity_kind
from wildlab.reporting.status import MISSING, Number

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
    spread = dict.fromkeys(("low", "high", "below", "flights", "centre_low", "centre_high", "power"))
    return {**found, **spread, "value": abs(found["value"])}


def judge(row: Mapping[str, Any], ours: Recorded) -> Comparison | None:
    """Compare a published number with what a run recorded.

    Parameters
    ----------
    row
        A row of `wildlab.reporting.published.load_published`.
    ours
        What the run recorded.

    Returns
    -------
    Comparison or None
        None where the run has no number for it. A difference is in the unit of the number.
    """
    name, subject = str(row["name"]), str(row["subject"])
    found = recorded_for(row, ours)
    here = found.get("value")
    if here is None:
        return None
    value = abs(float(row["value"])) if row["by_size"] else float(row["value"])
    if row["unjudged"]:
        return not_judged(here, value, str(row["unjudged"]))
    rounding, known = float(row["rounding"]), ours.get((error_name(name), subject), {})
    error = known.get("value")
    if row["kind"] == CALCULATED and known and error is None:
        return not_judged(here, value, "a standard error is not known")
    if row["kind"] == CALCULATED:
        compared = compare_calculation(here, value, rounding, inputs=_pair(found, "low", "high"), error=error)
        return replace(compared, fitted=str(row["fitted"]))
    kind = "rate" if row["kind"] in (SHARE_OF_IMAGES, MEAN_OF_RUNS) else quantity_kind(name)
    if not kind:
        return not_judged(here, value, "no margin is fixed for this quantity")
    # A rate's margin is of odds.
    unit = 100.0 if kind == "rate" and row["unit"] == "%" else 1.0
    if row["kind"] == MEAN_OF_RUNS:
        theirs = None
        if error is not None and found.get("n") and not math.isnan(row["runs"]):
            # Nobody prints it: single runs are taken to vary there as they do here.
            theirs = error / unit * math.sqrt(found["n"] / row["runs"])
        error = None if error is None else error / unit
        compared = compare_mean(here / unit, value / unit, rounding / unit, error, theirs)
    else:
        flights = found.get("flights") or 0
        # Of a share of images the bounds are those of its interval, not of flights.
        alone = row["kind"] == SHARE_OF_IMAGES or prediction_rank(flights) < 1
        share = None
        if kind == "rate" and not math.isnan(row["runs"]):
            share = share_interval(round(value / unit * row["runs"]), row["runs"], LEVEL)[1:]
        compared = compare_flight(
            kind,
            here / unit,
            value / unit,
            rounding / unit,
            share=share,
            centre=_pair(found, "centre_low", "centre_high", unit),
            predicted=None if alone else _pair(found, "low", "high", unit),
            power=found.get("power"),
        )
    return replace(compared, difference=here - value, fitted=str(row["fitted"]))


def compared_number(row: Mapping[str, Any], ours: Recorded, seeds: int | None, kind: str = "twin") -> Number:
    """A published number beside ours, with both answers.

    Parameters
    ----------
    row, ours
        As `judge` takes them.
    seeds
        How many flights the run is of, where it is of more than one.
    kind
        Of the run: of a twin, the runs of one flight are what its bounds are over.

    Returns
    -------
    Number
        Its ``waiting`` is `MISSING` where the run has none.
    """
    found, compared = recorded_for(row, ours), judge(row, ours)
    over = None
    if found.get("low") is not None:
        over = found["flights"] or seeds or (found["n"] if kind == "twin" else None)
    return Number(
        name=row["name"],
        subject=row["subject"],
        unit=row["unit"],
        source=row["source"],
        published=abs(float(row["value"])) if row["by_size"] else float(row["value"]),
        digits=int(row["digits"]),
        here=found.get("value"),
        low=found.get("low"),
        high=found.get("high"),
        compared=compared,
        waiting=MISSING if compared is None else "",
        reason="" if compared is None else compared.reason,
        kind=row["kind"],
        ratio=None if compared is None else compared.ratio,
        below=found.get("below"),
        power=found.get("power"),
        by_size=bool(row["by_size"]),
        again=bool(row["again"]),
        fitted=row["fitted"],
        over=over,
    )


def _pair(found: Mapping[str, Any], low: str, high: str, unit: float = 1.0) -> tuple[float, float] | None:
    """Two bounds that were recorded; None where one is not known."""
    ends = found.get(low), found.get(high)
    return None if ends[0] is None or ends[1] is None else (ends[0] / unit, ends[1] / unit)
