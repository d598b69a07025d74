"""What the report on the detection of vessels says, as the computed numbers have it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields

import numpy as np
import pandas as pd

from wildlab.detection.thresholds import FloatingThresholds
from wildlab.evaluation.runs import Interval, mean_share_interval, share_interval
from wildlab.reporting.text import percent, percent_between
from wildlab.studies.vessel_detection.trial import BOATS, CUT, SEA, SHIP, WHOLE

NAMES = {
    SHIP: "ship",
    WHOLE: "boats, whole",
    CUT: "boats, cut by the border",
    BOATS: "boats",
    SEA: "empty sea",
}
#: What is published, and what it is called.
SHARES = {
    ("detection_rate", SHIP): "images of the ship, found",
    ("detection_rate", WHOLE): "images with boats wholly in view, all found",
    ("false_alarms_per_image", SHIP): "images of the ship, false alarms",
    ("false_alarms_per_image", BOATS): "images of the second flight, false alarms",
}
#: From which share on something counts as found.
FOUND = 0.9
#: Where the intervals with the two areas overlap at each height.
_CHANCE = "; so few are drawn that not all of this can be told from chance"
#: What the ellipse of a centre should hold.
ELLIPSE = 0.9

METHOD = r"""The seven steps of H 4.3, with the printed threshold of 230 of 255 and the printed smallest
area of 50 pixels, counted before the blob is filled. What H does not print is chosen; the table above
says what, why, and what it changes. A detection of which less than a quarter of the pixels are a
vessel's is a false alarm. Otherwise it is one of the vessel that has most of these: of two that are
found as one, the smaller counts as missed. An image counts as right if all in it are found; where one boat
is whole and the other cut, it counts by the whole one. Intervals of shares of images take the images for
independent, and those of one flight are alike: they are rather too narrow.

Each flight is that of the twin, with its true poses; vessels, sea and sky are rendered in kelvin for
every image that is looked at, blurred, and counted by a camera with noise, a fixed pattern, vignetting
and dead pixels. Labels are exact. The sweeps show single things in small windows of the same camera."""


def pooled(spread: pd.DataFrame, subject: str) -> Interval:
    """Share of all images of a subject in which all is found, over all flights, with its interval."""
    images = spread[subject, "images"].to_numpy(float)
    rate = spread[subject, "detection_rate"].to_numpy(float)
    known = np.isfinite(rate)
    count = round(float((images * rate)[known].sum()))
    return share_interval(count, round(float(images[known].sum())))


def false_alarms(spread: pd.DataFrame, *subjects: str) -> tuple[int, int]:
    """How many false alarms there are, and in how many images."""
    images = sum(spread[one, "images"].to_numpy(float) for one in subjects)
    alarms = sum(
        np.nan_to_num((spread[one, "images"] * spread[one, "false_alarms_per_image"]).to_numpy(float))
        for one in subjects
    )
    return round(float(np.sum(alarms))), round(float(np.sum(images)))


def reach(heights: pd.DataFrame, kind: str, column: str = "found") -> float:
    """Up to which height a kind is found without a gap below, m; 0 for none."""
    own = heights[heights["kind"] == kind].sort_values("height_m")
    good = (own[column] >= FOUND).to_numpy()
    last = 0.0
    for height, fine in zip(own["height_m"], good, strict=True):
        if not fine:
            break
        last = float(height)
    return last


def reach_words(heights: pd.DataFrame, column: str = "found") -> str:
    """Up to which height each kind is found, in one clause."""
    up_to: dict[float, list[str]] = {}
    for kind in dict.fromkeys(heights["kind"]):
        up_to.setdefault(reach(heights, kind, column), []).append(f"a {kind}")
    top = float(heights["height_m"].max())
    parts = []
    for height in sorted(up_to, reverse=True):
        things = " and ".join(up_to[height])
        if height == 0:
            parts.append(f"{things} from none of the heights tried")
        elif height == top:
            parts.append(f"{things} from all heights up to {height:.0f} m")
        else:
            parts.append(f"{things} up to {height:.0f} m")
    return ", ".join(parts)


def summary(spread: pd.DataFrame, heights: pd.DataFrame) -> list[str]:
    """Three sentences on what the trials and the sweeps give."""
    ship, whole = pooled(spread, SHIP), pooled(spread, WHOLE)
    alarms, images = false_alarms(spread, SHIP, BOATS)
    above = share_interval(min(alarms, images), images).high
    false = (
        f"Not one false alarm came in {images} images, which leaves open up to {percent(above)} of them"
        if alarms == 0
        else f"{alarms} false alarm{'s' * (alarms != 1)} came in {images} images"
    )
    return [
        f"In {percent_between(ship)} of the images the ship is found, or the part of it that shows, and in "
        f"{percent_between(whole)} all boats that are wholly in view.",
        f"{false}; the thesis counts 15 in 27866.",
        f"Up to which height smaller things are found, {_needed(heights)} at each: {reach_words(heights)}.",
    ]


def alarmed_words(spread: pd.DataFrame) -> str:
    """How many images were looked at, and in which share of such there is a false alarm, by the interval."""
    some = sum(spread[one, "images_with_false"].sum() for one in (SHIP, BOATS))
    images = false_alarms(spread, SHIP, BOATS)[1]
    return f"{images} images, some in {percent_between(share_interval(round(float(some)), images))} of them"


def flights_words(spread: pd.DataFrame) -> str:
    """How the rates go from flight to flight, with Student's interval of their mean."""
    parts = []
    for subject in (SHIP, WHOLE):
        rates = spread[subject, "detection_rate"].to_numpy(float)
        rates = rates[np.isfinite(rates)]
        if len(rates) < 2 or np.ptp(rates) < 1e-12:
            continue
        mean, low, high = map(percent, mean_share_interval(rates))
        parts.append(f"{NAMES[subject]} {mean} ({low} to {high})")
    if not parts:
        return "The rates are the same on all flights, or these are too few to say how they go over them."
    return f"Flight by flight, with the interval of their mean: {'; '.join(parts)}."


def printed_words(spread: pd.DataFrame) -> str:
    """How many images there are here for what the thesis says of all of its own, where these are fewer."""
    parts = []
    for subject, theirs, what in ((SHIP, 441, "the ship"), (WHOLE, 4903, "boats wholly in view")):
        ours = round(float(spread[subject, "images"].sum()))
        if ours < theirs:
            parts.append(f"{ours} of {what}, and the thesis {theirs}")
    how = (
        "A claim holds where the 95 % interval of the share of all flights' images lies at or below its "
        "threshold, does not hold where it lies above, and is undecided between. The verdicts at half and at "
        "twice of the threshold stand beside."
    )
    if not parts:
        return f"There are as many images here as the thesis has. {how}"
    return (
        f"Here are {'; '.join(parts)}: that none fails among fewer does not say that none "
        f"would among as many. {how}"
    )


def _needed(sweep: pd.DataFrame) -> str:
    """How many of those drawn must be found for nine of ten, and what that leaves open."""
    parts = []
    for draws in sorted({int(one) for one in sweep["draws"]}):
        least = int(np.ceil(FOUND * draws - 1e-9))
        low = share_interval(least, draws).low
        of = f"all {draws} drawn" if least == draws else f"at least {least} of {draws} drawn"
        parts.append(f"{of} (which leaves open a share down to {percent(low)})")
    return " or ".join(parts)


def _draws(sweep: pd.DataFrame) -> str:
    return " or ".join(str(int(one)) for one in sorted(sweep["draws"].unique()))


def missed_words(spread: pd.DataFrame) -> str:
    """What was missed, and how much of it showed."""
    parts = []
    for subject in (SHIP, WHOLE, CUT):
        missed = int(spread[subject, "missed"].sum())
        if not missed:
            images = round(float(spread[subject, "images"].sum()))
            parts.append(f"{NAMES[subject]}: none missed in {images} images")
            continue
        share = float(spread[subject, "largest_share_missed"].max())
        parts.append(
            f"{NAMES[subject]}: {missed} missed, of which up to {percent(share)} of the outline showed"
        )
    merged = int(spread[WHOLE, "merged"].sum())
    joined = f"; {merged} of the whole ones were one blob with the other boat" if merged else ""
    words = "; ".join(parts) + joined + "."
    return words[0].upper() + words[1:]


def _tied(readings: pd.DataFrame, column: str) -> str:
    """All readings that have the least of a column."""
    least = readings[readings[column] <= readings[column].min() + 1e-9]
    return " and ".join(f"“{name}”" for name in least["reading"])


def readings_words(readings: pd.DataFrame) -> str:
    """How far the rates go apart over the readings of what H leaves open."""
    base = readings.iloc[0]
    loud = readings.loc[readings["false"].idxmax()]
    low, high = (
        [percent(getattr(readings[one], end)()) for one in ("ship", "boats")] for end in ("min", "max")
    )
    ship = f"the ship's rate lies between {low[0]} and {high[0]}"
    boats = f"that of whole boats between {low[1]} and {high[1]}"
    apart = f", the least with {_tied(readings, 'boats')}" if readings["boats"].min() < base["boats"] else ""
    ship += f", the least with {_tied(readings, 'ship')}" if readings["ship"].min() < base["ship"] else ""
    noise = (
        f"false alarms come up to {loud['false']:.2g} an image, with “{loud['reading']}”"
        if loud["false"] > base["false"]
        else f"none has more false alarms than the chosen one's {base['false']:.2g} an image"
    )
    return f"Over {len(readings)} readings {ship}, {boats}{apart}; {noise}."


def contrast_words(contrast: pd.DataFrame) -> str:
    """Which contrast each length of vessel needs to be found."""
    parts = []
    for length, own in contrast.groupby("length_m"):
        good = own[own["found"] >= FOUND]["excess_k"]
        needed = f"{good.min():g} K" if len(good) else f"more than {own['excess_k'].max():g} K"
        parts.append(f"{needed} at {length:g} m")
    return (
        f"What a deck must have over the sea for {_needed(contrast)} to be found: " + ", ".join(parts) + "."
    )


def weather_words(weather: pd.DataFrame) -> str:
    """From which wind on an empty sea gives false alarms, with and without the sun in view."""
    parts = []
    for _, own in weather.groupby("glint"):
        glint = float(own["glint"].iloc[0])
        loud = own[own["false"] > 0].sort_values("wind")
        where = f"with a glint of {glint:g} K in view" if glint else "without sun"
        if len(loud):
            worst = own.loc[own["false"].idxmax()]
            parts.append(
                f"{where} there are some from {loud['wind'].iloc[0]:g} m/s of wind on, "
                f"up to {worst['false']:.2g} an image"
            )
        else:
            images = int(own["draws"].sum())
            least = own["draws"].min()
            parts.append(
                f"{where} there are none up to {own['wind'].max():g} m/s of wind, in {images} images, which "
                f"leaves open up to {percent(share_interval(0, images).high)} of them, and at any one wind "
                f"up to {percent(share_interval(0, least).high)}"
            )
    return f"False alarms on an empty sea, {_draws(weather)} images each: {'; '.join(parts)}."


def scaled_words(heights: pd.DataFrame) -> str:
    """What scaling the smallest area with the height does to the heights from which things are found."""
    gained = [
        kind
        for kind in dict.fromkeys(heights["kind"])
        if reach(heights, kind, "scaled") > reach(heights, kind, "found")
    ]
    lost = [
        kind
        for kind in dict.fromkeys(heights["kind"])
        if reach(heights, kind, "scaled") < reach(heights, kind, "found")
    ]
    if not gained and not lost:
        return "Scaled with the height, the smallest area changes none of these heights."
    more = f"a {' and a '.join(gained)} from higher up" if gained else ""
    less = f"a {' and a '.join(lost)} only from lower down" if lost else ""
    both = " and ".join(part for part in (more, less) if part)
    sure = "" if all(_apart(heights, kind) for kind in gained + lost) else _CHANCE
    return f"Scaled with the height, the smallest area finds {both}{sure}."


def _apart(heights: pd.DataFrame, kind: str) -> bool:
    """Whether at some height the intervals with the printed and with the scaled area do not overlap."""
    for _, row in heights[heights["kind"] == kind].iterrows():
        one, other = (
            share_interval(round(row[name] * row["draws"]), int(row["draws"])) for name in ("found", "scaled")
        )
        if one.high < other.low or other.high < one.low:
            return True
    return False


def ellipse_words(spread: pd.DataFrame) -> str:
    """How often the stated 90 % ellipse of a centre holds it, with the interval of the mean over flights."""
    parts = []
    for subject in (SHIP, WHOLE):
        shares = spread[subject, "ellipse_coverage_90"].to_numpy(float)
        if np.isfinite(shares).sum() < 2:
            some = (
                "in no flight" if not np.isfinite(shares).any() else f"{percent(float(np.nanmean(shares)))}"
            )
            parts.append(f"{some} for {NAMES[subject]} (too few flights for an interval)")
            continue
        share, low, high = mean_share_interval(shares)
        word = (
            "too small"
            if high < ELLIPSE
            else "too large"
            if low > ELLIPSE
            else f"{percent(ELLIPSE)} lies within"
        )
        parts.append(f"{percent(share)} ({percent(low)} to {percent(high)}: {word}) for {NAMES[subject]}")
    return (
        "The 90 % ellipse that goes with a centre holds the outline's true centre in "
        + " and ".join(parts)
        + "."
    )


def thresholds_table(
    thresholds: FloatingThresholds, published: Mapping[str, str], chosen: Mapping[str, str]
) -> pd.DataFrame:
    """Every threshold with its value, whose it is, and where it is printed or why it is so."""
    rows = []
    for field in fields(thresholds):
        own = field.name in chosen
        rows.append(
            {
                "name": field.name.replace("_", " "),
                "value": str(getattr(thresholds, field.name)),
                "status": "chosen" if own else "published",
                "reason": chosen[field.name] if own else published[field.name],
            }
        )
    return pd.DataFrame(rows)
