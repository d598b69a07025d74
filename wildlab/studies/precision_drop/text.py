"""What the report on the precision drop says, as the computed numbers have it."""

from __future__ import annotations

import numpy as np
import pandas as pd

from wildlab.evaluation.matching import group_draws, percentile
from wildlab.evaluation.runs import Interval, mean_interval, mean_share_interval, share_interval
from wildlab.reporting.text import percent, percent_between
from wildlab.studies.precision_drop.trial import COUNTS, FEW_PX, FOUND, HORIZON, MEAN, SINGLE

METHOD = r"""The six steps of H 4.4.2 on images of 640 x 360 pixels, with the printed limits of hue,
saturation and value, the printed smallest area of 50 pixels, and the printed borders of 30 pixels at the
sides and 60 above and below. Of each image the largest region is taken.

Each flight is that of the twin. Ground and tarpaulin are rendered in colour from its true poses, one image
after the other, until enough was found; images in which the tarpaulin lies further than ten pixels beyond the
borders are left out, for nothing of it could be accepted. Its middle is known exactly. What was found is put
on the ground by H (5.13), with the poses that the autopilot states at the computer's stamps; the mean of the
positions is where one would drop. A detection whose pixel is not on the tarpaulin is a false alarm, and so is
one in an image without it.

Images with the horizon are rendered apart, whatever the twin's camera sees. They show ground and sky from
100 m, the horizon level and anywhere in the upper half, and no tarpaulin. Intervals of shares of images take
the images for independent, and those of one flight are alike: they are rather too narrow."""
#: What the detector's ellipses are to hold.
ELLIPSE = 0.9
#: From which share of the detections on their mean is worth about as many independent ones.
NEARLY_ALL = 0.7


def pooled(spread: pd.DataFrame, count: str, of: str) -> Interval:
    """Share of images over all flights, with its interval; both are names of numbers of what was found."""
    numbers = (round(float(spread[FOUND, name].sum())) for name in (count, of))
    return share_interval(*numbers)


def worth(spread: pd.DataFrame) -> float:
    """How many independent detections the mean of a flight is worth: mean squares of errors, divided."""
    single, mean = (spread[one].to_numpy(float) for one in ((SINGLE, "rms_error"), (MEAN, "error")))
    return float((single**2).mean() / (mean**2).mean())


def worth_interval(spread: pd.DataFrame) -> tuple[float, float] | None:
    """95 % interval of `worth`, from flights drawn with replacement; None of too few."""
    weights = group_draws(len(spread))
    if weights is None:
        return None
    single, mean = (spread[one].to_numpy(float) ** 2 for one in ((SINGLE, "rms_error"), (MEAN, "error")))
    drawn = (weights @ single) / (weights @ mean)
    return percentile(drawn, 2.5), percentile(drawn, 97.5)


def common(spread: pd.DataFrame) -> float:
    """Share of the mean square error that the mean of all detections of a flight keeps."""
    return 1 / worth(spread)


def summary(spread: pd.DataFrame) -> list[str]:
    """Three sentences on what the trial gives, one row for each flight."""
    rate = pooled(spread, "right", "should")
    false = round(float(spread[FOUND, "false"].sum()))
    images = round(float(spread[FOUND, "images"].sum()))
    single, mean = float(spread[SINGLE, "median_error"].median()), float(spread[MEAN, "error"].median())
    count = float(spread[MEAN, "detections"].median())
    alarms = "nothing else was found" if not false else f"something else was found in {false}"
    much = "much better" if mean < single / 2 else "better" if mean < 0.9 * single else "hardly better"
    many = worth(spread)
    within = worth_interval(spread)
    between = "" if within is None else f" ({within[0]:.1f} to {within[1]:.1f})"
    ones = f"independent one{'s' * (many >= 1.5)}"
    shared = (
        f"as independent errors are: their mean is worth about that many{between}."
        if many > NEARLY_ALL * count
        else f"alike: their mean is worth about {max(many, 1):.0f}{between} {ones}."
    )
    return [
        f"By its colour the tarpaulin is found in {percent_between(rate)} of the images that have it inside "
        f"the borders. In the {images} images that were looked at, {alarms}.",
        f"A single position is typically {single:.1f} metres off, the mean of {count:.0f} is {mean:.1f} "
        f"metres off, which is {much if mean < single else 'no better'}.",
        f"The errors of {count:.0f} detections are {shared}",
    ]


def mean_words(spread: pd.DataFrame) -> str:
    """How the error of the mean falls with more detections, beside what independent ones would give."""
    known = [count for count in COUNTS if spread[MEAN, f"after_{count}"].notna().all()]
    if not known:
        return ""
    first, last = known[0], known[-1]
    error = {count: float(spread[MEAN, f"after_{count}"].median()) for count in (first, last)}
    errors = mean_interval(spread[MEAN, "error"])
    over = "" if np.isnan(errors.low) else f" (mean over flights {_span(errors)})"
    if worth(spread) > NEARLY_ALL * last:
        why = "That is what independent errors would give"
    else:
        why = (
            f"Were their errors independent, {last} would lower it to "
            f"{error[first] / np.sqrt(last / first):.1f} m. {percent(min(common(spread), 1.0))} of the mean "
            "square error of single positions is still in their mean. Which of "
            "the errors that last over a flight it comes from is not computed here"
        )
    return (
        f"After {first} detection{'s' * (first > 1)} the median flight is {error[first]:.1f} m off, after "
        f"{last} {error[last]:.1f} m{over}. {why}."
    )


def _span(found: Interval) -> str:
    # A distance is not below zero, which Student's interval of few flights may be.
    return f"{found.estimate:.1f} m, {max(found.low, 0.0):.1f} to {found.high:.1f} m"


def pixel_words(spread: pd.DataFrame) -> str:
    """How well the centre is found, what that is on the ground, and whether the ellipses know it."""
    error, off = (float(spread[FOUND, name].median()) for name in ("pixel_error", "off_centre"))
    few = float(spread[FOUND, "few_pixels"].median())
    share = float(spread[FOUND, "area_share"].median())
    seen = (
        f"What is found covers {percent(share)} of the tarpaulin on the median flight; "
        if share < 1
        else "All of the tarpaulin is found; "
    )
    return (
        f"{seen}its centre is {error:.2f} px from that of the tarpaulin on average, and the mean of these "
        f"differences is {off:.2f} px. {FEW_PX:.0f} px are {few:.1f} m on the ground. The detector's own "
        f"ellipses ({percent(ELLIPSE)}) hold the true centre in {_coverage(spread)}."
    )


def _coverage(spread: pd.DataFrame) -> str:
    """In which share of a flight's images an ellipse holds the centre, and what that says of it."""
    shares = spread[FOUND, "ellipse_coverage_90"]
    if len(spread) < 2:
        return f"{percent(float(shares.mean()))} of the images of the one flight"
    found = mean_share_interval(shares)
    known = (
        "wider than the errors ask for"
        if found.low > ELLIPSE
        else "too narrow"
        if found.high < ELLIPSE
        else "not told from right"
    )
    return f"{percent_between(found)} of a flight's images, on the mean: they are {known}"


def horizon_words(spread: pd.DataFrame) -> str:
    """What the borders do against a blue sky."""
    images = float(spread[HORIZON, "images"].sum())
    count = {
        name: round(float((spread[HORIZON, name] * spread[HORIZON, "images"]).sum()))
        for name in ("alarms_with_borders", "alarms_without_borders")
    }
    every, kept = count["alarms_without_borders"], count["alarms_with_borders"]
    if not every:
        return f"No sky of {images:.0f} images with the horizon is blue enough to be found."
    flights = int((spread[HORIZON, "alarms_without_borders"] > 0).sum())
    share = share_interval(kept, every)
    return (
        f"Of {images:.0f} images with the horizon, {every} have a sky that is as blue as the tarpaulin "
        f"({flights} of {len(spread)} flights; how blue skies are is chosen). The borders let {kept} of "
        f"these through, {percent_between(share)}."
    )
