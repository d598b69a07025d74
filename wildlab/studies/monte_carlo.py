"""Parts of a report on many simulated flights: published beside ours, and the verdicts on claims."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np
import pandas as pd

from wildlab.errors import WildlabError
from wildlab.evaluation.intervals import LEVEL, Interval, median_interval, share_interval
from wildlab.evaluation.replication import power_of
from wildlab.evaluation.shares import (
    FITTED,
    NO_PREMISE,
    UNDECIDABLE,
    Check,
    decide_check,
    paired_difference,
)
from wildlab.messages.quantities import number, percent
from wildlab.reporting.published import (
    SHARE_OF_IMAGES,
    bounds_of,
    quantity_kind,
    size_name,
)
from wildlab.reporting.report import Report
from wildlab.studies.rules import keys_of

#: Headings of the table that `decide_claims` gives.
CLAIM_COLUMNS = {
    "claim": "claim",
    "source": "where",
    "verdict": "verdict",
    "share": "how often true",
    "difference": "difference, mean",
    "premise": "premise",
    "threshold": "at half and twice the threshold",
}
#: By how much a threshold is varied.
TIMES = {"half": 0.5, "twice": 2.0}
#: What stands over the claims.
CLAIMS_EXPLAINED = (
    "A claim holds where the 95 % interval of the share of flights on which it is true lies at or above "
    "90 %, on most flights above 50 %; likewise it fails below 50 % and does not hold below 10 %. Where the "
    "interval has 50 % in it, it is undecided. A vague word has a threshold, which is ours: the verdicts at "
    "half and at twice of it stand beside, where what is measured can be on either side of them. "
    "Differences are means over flights, with their 95 % interval."
)


def record_spread(
    report: Report, unit_of: Callable[[str], str | None], spread: pd.DataFrame, n: Mapping[str, int]
) -> None:
    """Record medians over flights, as their range what `bounds_of` gives, and the flights below the print.

    A signed mean that is published is recorded by its size as well, which is what it is compared by where
    the thesis does not define its sign.

    Parameters
    ----------
    unit_of
        The unit of a number by its name; None where it is not recorded.
    spread
        Columns (subject, name), one row for each flight; a flight on which a quantity was not computed has
        NaN.
    n
        How many observations stand behind each subject, where that is known.
    """
    for subject, name in keys_of(spread):
        unit = unit_of(name)
        if unit is None:
            continue
        values, printed = spread[subject, name], report.printed(name, subject)
        if printed is not None and printed["kind"] == SHARE_OF_IMAGES:
            share, images = pooled_share(spread, subject, name)
            if images:
                centre = share_interval(min(share.estimate, 1.0) * images, images, LEVEL)
                report.metric(
                    name, subject, share.estimate, unit, n=images, low=share.low, high=share.high,
                    flights=int(values.notna().sum()), centre_low=centre.low, centre_high=centre.high,
                )  # fmt: skip
                continue
        _record(report, name, subject, values, unit, n.get(subject))
        if printed is not None and quantity_kind(name) == "signed mean" and len(values) > 1:
            _record(report, size_name(name), subject, values.abs(), unit, n.get(subject))


def pooled_share(spread: pd.DataFrame, subject: str, name: str) -> tuple[Interval, int]:
    """A share of all images of all flights, with its 95 % interval, and how many images there are.

    Parameters
    ----------
    spread
        One row for each flight; besides the share of each flight it has how many ``images`` there were.
    subject, name
        Of the share. Of a mean count the interval is that of a share, and ends at one.

    Returns
    -------
    (share, images)
        The share is NaN where there is no image.
    """
    images, rate = (spread[subject, one].to_numpy(float) for one in ("images", name))
    known = np.isfinite(rate) & (images > 0)
    count, of = round(float((images * rate)[known].sum())), round(float(images[known].sum()))
    if not of:
        return Interval(np.nan, np.nan, np.nan), 0
    share = share_interval(min(count, of), of)
    return share._replace(estimate=count / of), of


def _record(
    report: Report,
    name: str,
    subject: str,
    values: pd.Series,
    unit: str,
    n: int | None,
) -> None:
    low, high = bounds_of(values)
    centre_low, centre_high = median_interval(values)
    kind = quantity_kind(name)
    report.metric(
        name,
        subject,
        values.median(),
        unit,
        n=n,
        low=low,
        high=high,
        flights=int(np.isfinite(values).sum()),
        centre_low=centre_low,
        centre_high=centre_high,
        power=power_of(values / 100 if kind == "rate" and unit == "%" else values, kind) if kind else None,
    )


def decide_claims(
    report: Report, claims: Sequence[Mapping[str, Any]], checks: Mapping[str, Check]
) -> pd.DataFrame:
    """Record the verdict on each claim, and return them as a table of `CLAIM_COLUMNS`.

    A claim that ``needs`` what no simulated flight has cannot be decided; it asks for no check.

    Parameters
    ----------
    claims
        As `wildlab.reporting.published.load_claims` gives them, with the thresholds of vague words.
    checks
        By the claim's id what the flights give for it.

    Raises
    ------
    WildlabError
        If a claim has no check, or a check needs a threshold that is not stated.
    """
    rows = []
    for claim in claims:
        text = claim["text"] + (" (Ours, not the thesis's.)" if claim.get("own") else "")
        if "needs" in claim:
            report.claim(claim["id"], claim["text"], UNDECIDABLE)
            undecidable = {
                "share": f"needs {claim['needs']}",
                "difference": "",
                "premise": "",
                "threshold": "",
            }
            rows.append({"claim": text, "source": claim["source"], "verdict": UNDECIDABLE} | undecidable)
            continue
        if claim["id"] not in checks:
            raise WildlabError(
                f"nothing was computed for the claim {claim['id']!r}",
                "give it a check whose numbers every flight has, or take it out of data/published",
                field=report.study,
            )
        check = checks[claim["id"]]
        threshold = None if "threshold" not in claim else float(claim["threshold"])
        found = decide_check(check, threshold)
        at = {}
        if threshold is not None and found.verdict != NO_PREMISE:
            at = {
                key: decide_check(check, times * threshold).verdict
                for key, times in TIMES.items()
                if check.reaches(times * threshold)
            }
        apart = None
        if check.first is not None and check.second is not None:
            apart = paired_difference(check.first, check.second)
        share = found.share
        report.claim(
            claim["id"],
            claim["text"],
            FITTED if claim.get("fitted") else found.verdict,
            fraction=None if share is None else share.estimate,
            low=None if share is None else share.low,
            high=None if share is None else share.high,
            seeds=found.flights,
            # Images together, and a calculation, are of no number of flights.
            met=None if check.calculated or (check.pooled and check.pooled.of) else found.met,
            half=at.get("half"),
            twice=at.get("twice"),
            difference=None if apart is None else apart.estimate,
            difference_low=None if apart is None else apart.low,
            difference_high=None if apart is None else apart.high,
        )
        rows.append(
            {
                "claim": text,
                "source": claim["source"],
                "verdict": f"{FITTED} ({claim['fitted']})" if claim.get("fitted") else found.verdict,
                "share": _share_words(found, check),
                "difference": ""
                if apart is None
                else interval_words(apart, 1 if abs(apart.estimate) >= 10 else 2, check.unit),
                "premise": _premise_words(claim.get("premise", ""), check, found),
                "threshold": _threshold_words(threshold, at, claim.get("reason", "")),
            }
        )
    return pd.DataFrame(rows)


def _share_words(found: Any, check: Check) -> str:
    if check.calculated and check.measured is not None:
        least, most = f"{check.measured.min():.3g}", f"{check.measured.max():.3g}"
        apart = f"{least} to {most}" if least != most else least
        return f"a calculation: {apart} {check.unit}".rstrip()
    if check.pooled is not None and check.pooled.of:
        count, of = check.pooled
        ends = share_interval(count, of)[1:]
        return f"{count} of {of} {check.unit or 'images'} ({percent(ends[0])} to {percent(ends[1])})"
    if found.share is None:
        return f"{found.met} of {found.flights} flights meet the premise"
    low, high = (100 * end for end in found.share[1:])
    told = f"{found.true} of {found.met}"
    beyond = f", of {found.flights} flights in all" if found.met < found.flights else ""
    return f"{told} ({low:.0f} to {high:.0f} %){beyond}"


def interval_words(found: Interval, digits: int, unit: str = "", least: float = -np.inf) -> str:
    """A number with its interval, which ends at ``least``; alone where it has none.

    Examples
    --------
    >>> interval_words(Interval(2.0, -0.5, 4.5), 1, "m"), interval_words(Interval(2.0, np.nan, np.nan), 1)
    ('2.0 (−0.5 to 4.5) m', '2.0')
    """
    ends = [number(max(end, least), digits) for end in found[1:]]
    around = f" ({ends[0]} to {ends[1]})" if np.isfinite(found.low) else ""
    return f"{number(found.estimate, digits)}{around} {unit}".rstrip()


def _premise_words(premise: str, check: Check, found: Any) -> str:
    if not premise:
        return ""
    if check.premise is None:
        return premise
    return f"{premise}: {found.met} of {found.flights} flights"


def _threshold_words(threshold: float | None, at: Mapping[str, str], reason: str) -> str:
    if threshold is None:
        return ""
    why = f" ({reason})" if reason else ""
    if not at:
        return f"{threshold:g}{why}"
    beside = ", ".join(f"at {TIMES[key] * threshold:g} {verdict}" for key, verdict in at.items())
    return f"{beside}; taken: {threshold:g}{why}"
