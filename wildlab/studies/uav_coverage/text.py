"""What the report on rows over enclosures says, as the computed numbers have it."""

from __future__ import annotations

import numpy as np
import pandas as pd

from wildlab.evaluation.runs import Interval, mean_interval
from wildlab.reporting.text import percent
from wildlab.studies.uav_coverage.trial import (
    DOWN,
    LOOKS,
    LOW,
    LOW_CLOSE,
    LOW_FASTER,
    SIGMAS,
    SPACINGS,
    YAW,
)

METHOD = rf"""Rows are laid over each enclosure along its length, evenly spaced, no further apart than
stated, and the enclosures are visited in the order of the shortest way. The platform keeps its height above
ground as far as it can climb and sink. It stops and turns on the spot at the end of each row. The camera's
attitude is the gimbal's; yaw swings at an even rate.

A node of the land is seen where an image shows it with nothing before it on the exact line of sight, no
further than {LOOKS.furthest:.0f} m away, and sharply. An image is sharp where the camera turns and moves by
less than {percent(LOOKS.blur_share, 0)} of an animal's length of {LOOKS.size} m during the {
    1e3
    * LOOKS.exposure:.0f} ms that a microbolometer takes. There are no trees, as in F's model. What is planned
counts for the claims. Probability of detection is F (5.8) with (5.9), $r$ = {LOOKS.range_scale:.0f} m, and
looks are taken for independent, which those of one pass are not: it is the most to be hoped for.

Each draw has its own land, of the size and relief of F's map, and its own errors of the pose. For these the
plan keeps a margin of {SIGMAS:.0f} standard deviations: what lies so far inside a sharp image is *surely*
seen, and the flight with errors is asked how much of that it showed. Animals walk as F (4.5) has it, at
random within their fence; one is found when an image shows the node nearest to it."""
#: What the cases are called.
NAMES = {
    DOWN: "60 m, rows 25 m, down",
    YAW: "60 m, rows 25 m, yaw",
    LOW: "30 m, rows 25 m, yaw",
    LOW_CLOSE: "30 m, rows 10 m, yaw",
    LOW_FASTER: "30 m, rows 25 m, yaw twice as fast",
}
#: Share of what is surely to be seen that a flight has to show.
HELD = 0.95


def mean(spread: pd.DataFrame, subject: str, name: str) -> float:
    """Over the draws."""
    return float(spread[subject, name].mean())


def between(found: Interval | None, digits: int = 1, lowest: float = 0.0, highest: float = 1.0) -> str:
    """A mean's 95 % interval of shares in brackets, or nothing of one draw."""
    if found is None:
        return ""
    low, high = max(found.low, lowest), min(found.high, highest)
    return f" ({percent(low, digits)} to {percent(high, digits)})"


def interval(spread: pd.DataFrame, subject: str, name: str) -> Interval | None:
    """Student's interval of the mean over the draws; None of one draw."""
    values = spread[subject, name]
    return mean_interval(values) if len(values) > 1 else None


def share_words(spread: pd.DataFrame, subject: str, name: str) -> str:
    """A mean share and its interval."""
    return f"{percent(mean(spread, subject, name))}{between(interval(spread, subject, name))}"


def summary(spread: pd.DataFrame) -> list[str]:
    """Three sentences on what the trials give, one row for each draw."""
    ratio = spread[YAW, "ground"] / spread[DOWN, "ground"]
    more = "more" if ratio.mean() > 1 else "less"
    inside = mean(spread, YAW, "seen") - mean(spread, DOWN, "seen")
    small = abs(inside) < 0.01
    of_that = (
        "but hardly any of the difference lies within the enclosures"
        if small and ratio.mean() > 1.1
        else f"and {percent(abs(inside))} {'more' if inside > 0 else 'less'} of the enclosures"
    )
    lost = mean(spread, YAW, "seen") - mean(spread, LOW, "seen")
    back = mean(spread, LOW_CLOSE, "seen") - mean(spread, LOW, "seen")
    faster = mean(spread, LOW_FASTER, "seen") - mean(spread, LOW, "seen")
    low = (
        f"At half the height the same rows and swings leave {percent(1 - mean(spread, LOW, 'seen'))} of the "
        f"enclosures unseen; rows 10 m apart {_back(back)}, swings twice as fast {_back(faster)}."
        if lost > 0.005
        else "At half the height the same rows see "
        + ("as much of the enclosures." if lost > -0.005 else f"{percent(-lost)} more of the enclosures.")
    )
    worst = min(float(spread[name, "held"].min()) for name in NAMES)
    kept = "held" if worst >= HELD else "did not always hold"
    return [
        f"A camera that turns about yaw sees {percent(abs(ratio.mean() - 1), 0)} {more} ground than one that "
        f"looks straight down from the same rows, {of_that}.",
        low,
        f"What a plan says is surely seen {kept} with errors of the pose: in the worst of "
        f"{len(spread) * len(NAMES)} flights {percent(worst)} of it was seen.",
    ]


def _back(gained: float) -> str:
    return f"bring {percent(gained)} back" if gained > 0.0005 else "bring nothing back"


def rows_table(spread: pd.DataFrame) -> pd.DataFrame:
    """One line for each case: means over the draws."""
    lines = []
    for name, said in NAMES.items():
        lines.append(
            {
                "case": said,
                "enclosures seen": share_words(spread, name, "seen"),
                "ground seen (ha)": f"{mean(spread, name, 'ground') / 1e4:.1f}",
                "outside (ha)": f"{mean(spread, name, 'outside') / 1e4:.1f}",
                "in sight (s)": f"{mean(spread, name, 'in_sight'):.1f}",
                "sharp images": percent(mean(spread, name, "sharp")),
                "time (min)": f"{mean(spread, name, 'time') / 60:.0f}",
            }
        )
    return pd.DataFrame(lines)


def held_table(spread: pd.DataFrame) -> pd.DataFrame:
    """What is surely planned, and how much of it flights showed."""
    return pd.DataFrame(
        [
            {
                "case": said,
                "margin (px)": f"{mean(spread, name, 'margin'):.0f}",
                "surely seen": percent(mean(spread, name, "sure")),
                "of that shown": share_words(spread, name, "held"),
                "least of all draws": percent(float(spread[name, "held"].min())),
                "without a margin": share_words(spread, name, "kept"),
            }
            for name, said in NAMES.items()
        ]
    )


def held_words(spread: pd.DataFrame) -> str:
    """Whether what is surely planned is seen, and what the margin costs."""
    worst = {name: float(spread[name, "held"].min()) for name in NAMES}
    short = [NAMES[name] for name, value in worst.items() if not value >= HELD]
    verdict = (
        f"In every draw of every case at least {percent(HELD, 0)} of it was seen"
        if not short
        else f"Less than {percent(HELD, 0)} of it was seen in some draw of: {'; '.join(short)}"
    )
    least = min(NAMES, key=lambda name: mean(spread, name, "sure"))
    sure, shown = mean(spread, least, "sure"), mean(spread, least, "flown")
    return (
        "A plan is worth what a flight shows of it. Position and attitude are off as the twin's autopilot "
        f"is, and the plan counts as surely seen only what lies {SIGMAS:.0f} standard deviations inside an "
        f"image. {verdict}. The margin has its price: {percent(sure)} of the enclosures are surely seen in "
        f"the case {NAMES[least]}, where the flights showed {percent(shown)}."
    )


def moving_words(spread: pd.DataFrame) -> str:
    """Row distance against time and animals that are missed."""
    first, last = (f"rows-{one:.0f}m" for one in (SPACINGS[0], SPACINGS[-1]))
    gained = 1 - mean(spread, last, "time") / mean(spread, first, "time")
    more = mean(spread, last, "missed") - mean(spread, first, "missed")
    return (
        f"With the camera down from 60 m, rows {SPACINGS[-1]:.0f} m apart instead of {SPACINGS[0]:.0f} m "
        f"save {percent(gained, 0)} of the time. Of animals that walk at random within their fence, "
        f"{share_words(spread, first, 'missed')} are never in an image with the closer rows, and "
        f"{share_words(spread, last, 'missed')} with the wider ones"
        f"{'' if more > 0 else ', which is no more'}."
    )


def rate_words(rate: float, differences: dict[str, float]) -> str:
    """Whether the images that are looked at are enough: seen with these, less seen with half as many."""
    worst = max(differences, key=lambda name: abs(differences[name]))
    much = abs(differences[worst])
    verdict = "half as many would do" if much <= 0.01 else "half as many would leave some out"
    return (
        f"{rate:g} images a second were looked at; {verdict}: of {len(differences)} plans tried the share of "
        f"the enclosures that is seen changes most for {NAMES.get(worst, worst)}, by {percent(much, 2)}."
    )


def median_age(ages: np.ndarray) -> float:
    """Median of what is known, minutes; NaN where nothing is."""
    known = ages[np.isfinite(ages)]
    return float(np.median(known)) / 60 if len(known) else float("nan")
