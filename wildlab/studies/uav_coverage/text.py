"""What the report on rows over enclosures says, as the computed numbers have it."""

from __future__ import annotations

import numpy as np
import pandas as pd

from wildlab.reporting.text import percent
from wildlab.studies.coverage_words import (
    HELD,
    difference_words,
    larger_errors_words,
    least_words,
    mean,
    with_interval,
    worst_words,
)
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
seen, and the flight with errors is asked how much of that it showed. That margin is of the very
distribution that the errors are drawn from, and which images are sharp is the plan's: what is held up is
the reckoning, not the size of the errors.

Animals walk as F (4.5) has it, at random within their fence; one is found when an image shows the node
nearest to it. The same animals are counted once more as if each stood still where it begins: what is
missed of those is ground in no image."""
#: What the cases are called.
NAMES = {
    DOWN: "60 m, rows 25 m, down",
    YAW: "60 m, rows 25 m, yaw",
    LOW: "30 m, rows 25 m, yaw",
    LOW_CLOSE: "30 m, rows 10 m, yaw",
    LOW_FASTER: "30 m, rows 25 m, yaw twice as fast",
}


def share_words(spread: pd.DataFrame, subject: str, name: str) -> str:
    """A mean share and its interval."""
    return with_interval(spread[subject, name])


def summary(spread: pd.DataFrame) -> list[str]:
    """Three sentences on what the trials give, one row for each draw."""
    wider = spread[YAW, "ground"] / spread[DOWN, "ground"] - 1
    inside = spread[YAW, "seen"] - spread[DOWN, "seen"]
    small = abs(inside.mean()) < 0.01
    of_that = (
        "but hardly any of the difference lies within the enclosures"
        if small and wider.mean() > 0.1
        else f"and {difference_words(inside)} of the enclosures"
    )
    low = spread[LOW, "seen"]
    lost = float((spread[YAW, "seen"] - low).mean())
    half = (
        f"At half the height the same rows and swings leave {with_interval(1 - low)} of the "
        f"enclosures unseen; rows 10 m apart {_back(spread[LOW_CLOSE, 'seen'] - low)}, swings twice as fast "
        f"{_back(spread[LOW_FASTER, 'seen'] - low)}."
        if lost > 0.005
        else "At half the height the same rows see "
        + (
            "as much of the enclosures."
            if lost > -0.005
            else f"{difference_words(low - spread[YAW, 'seen'])} of the enclosures."
        )
    )
    return [
        f"A camera that turns about yaw sees {difference_words(wider, 'more ground', 'less ground', 0)} than "
        f"one that looks straight down from the same rows, {of_that}.",
        half,
        worst_words(spread, NAMES, "flights"),
    ]


def _back(gained: pd.Series) -> str:
    return (
        f"bring {with_interval(gained, lowest=-1.0)} back" if gained.mean() > 0.0005 else "bring nothing back"
    )


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
                "sharp images": share_words(spread, name, "sharp"),
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
                "surely seen": share_words(spread, name, "sure"),
                "of that shown": share_words(spread, name, "held"),
                "least of all draws": least_words(spread[name, "held"]),
                "without a margin": share_words(spread, name, "kept"),
            }
            for name, said in NAMES.items()
        ]
    )


def held_words(spread: pd.DataFrame) -> str:
    """Whether what is surely planned is seen, and what the margin costs."""
    worst = {name: float(spread[name, "held"].min()) for name in NAMES}
    none = {name: int(spread[name, "held"].isna().sum()) for name in NAMES}
    short = [NAMES[name] for name, value in worst.items() if value < HELD]
    verdict = (
        f"Less than {percent(HELD, 0)} of it was seen in some draw of: {'; '.join(short)}"
        if short
        else f"In every draw of every case at least {percent(HELD, 0)} of it was seen"
        if not sum(none.values())
        else "Whether it was seen cannot be said"
        if np.isnan(list(worst.values())).all()
        else f"Wherever there was some, at least {percent(HELD, 0)} of it was seen"
    )
    left = "; ".join(f"{NAMES[name]}, in {count} of {len(spread)}" for name, count in none.items() if count)
    nothing = f" Nothing at all was surely to be seen in some draws of: {left}." if left else ""
    least = min(NAMES, key=lambda name: mean(spread, name, "sure"))
    return (
        "A plan is worth what a flight shows of it. Position and attitude are off as the twin's autopilot "
        f"is, and the plan counts as surely seen only what lies {SIGMAS:.0f} standard deviations inside an "
        f"image. {verdict}.{nothing} The margin has its price: {share_words(spread, least, 'sure')} of the "
        f"enclosures are surely seen in the case {NAMES[least]}, where the flights showed "
        f"{share_words(spread, least, 'flown')}."
    )


def sensitivity_words(held: dict[str, tuple[float, float]], factor: float) -> str:
    """What is left of surely seen where errors are larger than planned for: by case, as planned and so."""
    return larger_errors_words({NAMES[name]: pair for name, pair in held.items()}, factor)


def moving_words(spread: pd.DataFrame) -> str:
    """Row distance against time, ground in no image, and what moving adds to what is missed."""
    first, last = (f"rows-{one:.0f}m" for one in (SPACINGS[0], SPACINGS[-1]))
    gained = 1 - spread[last, "time"] / spread[first, "time"]
    more = mean(spread, last, "missed") - mean(spread, first, "missed")
    return (
        f"With the camera down from 60 m, rows {SPACINGS[-1]:.0f} m apart instead of {SPACINGS[0]:.0f} m "
        f"save {with_interval(gained, 0, -np.inf)} of the time. Of animals that walk at random within their "
        f"fence, {share_words(spread, first, 'missed')} are never in an image with the closer rows, and "
        f"{share_words(spread, last, 'missed')} with the wider ones"
        f"{'' if more > 0 else ', which is no more'}. Two things are in this. The closer rows leave "
        f"{share_words(spread, first, 'unseen')} of the ground in no image, and the wider ones "
        f"{share_words(spread, last, 'unseen')}. And animals move: {_by_moving(spread, first)} with the "
        f"closer rows, {_by_moving(spread, last)} with the wider ones."
    )


def _by_moving(spread: pd.DataFrame, rows: str) -> str:
    """Animals that walk against the same ones standing still."""
    added = spread[rows, "missed"] - spread[rows, "missed_still"]
    if abs(added.mean()) < 0.0005:
        return "as many are missed as if they stood still"
    return f"{difference_words(added, 'more are missed', 'fewer are missed')} than if they stood still"


def rows_apart_table(spread: pd.DataFrame) -> pd.DataFrame:
    """One line for each row distance: ground and animals."""
    lines = []
    for spacing in SPACINGS:
        rows = f"rows-{spacing:.0f}m"
        added = spread[rows, "missed"] - spread[rows, "missed_still"]
        lines.append(
            {
                "rows apart": f"{spacing:.0f} m",
                "time (min)": f"{mean(spread, rows, 'time') / 60:.0f}",
                "ground in no image": share_words(spread, rows, "unseen"),
                "missed, standing still": share_words(spread, rows, "missed_still"),
                "missed, walking": share_words(spread, rows, "missed"),
                "by walking": with_interval(added, lowest=-1.0),
            }
        )
    return pd.DataFrame(lines)


def rate_words(rate: float, differences: dict[str, float]) -> str:
    """Whether the images that are looked at are enough: seen with these, less seen with half as many."""
    worst = max(differences, key=lambda name: abs(differences[name]))
    much = abs(differences[worst])
    verdict = "half as many would do" if much <= 0.01 else "half as many would leave some out"
    return (
        f"{rate:g} images a second were looked at; {verdict}: of {len(differences)} plans tried the share of "
        f"the enclosures that is seen changes most for {NAMES.get(worst, worst)}, by {percent(much, 2)}."
    )


def age_words(ages: np.ndarray) -> str:
    """Of what was seen: half was last seen no longer ago than this."""
    known = ages[np.isfinite(ages)]
    if not len(known):
        return "nothing was seen"
    return f"half of what was seen was seen in the last {np.ceil(np.median(known) / 60):.0f} min"


def gap_words(gaps: np.ndarray) -> str:
    """Of what was seen: half goes unseen at least for so long."""
    known = gaps[np.isfinite(gaps)]
    if not len(known):
        return "nothing was seen"
    return f"half of what was seen goes unseen for {np.floor(np.median(known) / 60):.0f} min or longer"


def capital(said: str) -> str:
    """As the first words of a title."""
    return said[:1].upper() + said[1:]
