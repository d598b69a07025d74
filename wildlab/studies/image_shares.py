"""Shares of images over all flights together: the few of one flight cannot tell a rate near one or zero."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import pandas as pd

from wildlab.errors import WildlabError
from wildlab.evaluation.runs import Interval, share_interval
from wildlab.reporting.report import Report
from wildlab.reporting.text import percent
from wildlab.reporting.verdicts import judge

#: Headings of the table that `shares_beside_published` gives.
SHARE_COLUMNS = {
    "of": "share",
    "published": "published",
    "here": "here, all images together",
    "images": "images",
    "verdict": "verdict",
}


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


def shares_beside_published(report: Report, names: Mapping[tuple[str, str], str]) -> pd.DataFrame:
    """Published shares of images beside those of all our images, with their 95 % intervals.

    Parameters
    ----------
    report
        What `record_spread` has recorded in.
    names
        Words for each share, by (name, subject).

    Returns
    -------
    DataFrame
        One row for each share, with the columns of `SHARE_COLUMNS`.

    Raises
    ------
    WildlabError
        If one of them is not published.
    """
    rows = []
    for (name, subject), words in names.items():
        row = report.printed(name, subject)
        if row is None:
            raise WildlabError(f"{name} of {subject} is not published", "leave it out of the table")
        found = report.recorded[name, subject]
        compared = judge(row, report.recorded)
        interval = [found[one] for one in ("value", "low", "high")]
        known = all(one is not None for one in interval)
        rows.append(
            {
                "of": words,
                "published": percent(row["value"]),
                "here": "{} ({} to {})".format(*map(percent, interval)) if known else "",
                "images": found["n"],
                "verdict": "" if compared is None else compared.words,
            }
        )
    return pd.DataFrame(rows)
