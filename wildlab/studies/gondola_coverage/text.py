"""What the report on the camera of a gondola says, as the computed numbers have it."""

from __future__ import annotations

import pandas as pd

from wildlab.evaluation.runs import share_interval
from wildlab.reporting.text import percent
from wildlab.studies.coverage_words import (
    difference_words,
    larger_errors_words,
    least_words,
    mean,
    with_interval,
    worst_words,
)
from wildlab.studies.gondola_coverage.trial import (
    ADAPT,
    CABIN,
    DECISIONS,
    DOWN,
    KNOWN,
    LEAST,
    NEAR,
    ROLL,
    STRATEGIES,
    YAW,
    YAW_LIMIT,
)
from wildlab.studies.uav_coverage.trial import LOOKS, SIGMAS

METHOD = rf"""The gondola goes along the twin's cable at its speed, 3 to 20 m above the ground (F 8.2). Of
each strategy the camera's attitude is worked out for every image: straight down; about yaw to
{YAW_LIMIT:.0f} degrees on either side with a fixed pitch; about roll, the camera straight down in the
middle; about roll adaptively, turning round at the limit, or from {LEAST:.0f} degrees on where the view is
not wholly within the enclosures. All swing at the same rate, that of the twin's gimbal. The adaptive one
decides {DECISIONS:.0f} times a second, whatever the camera's rate, and knows its view every {KNOWN:g} s.

F Algorithm 2 cannot be run as printed: two limits that it compares with are never set, both comparisons are
for one direction only, and a set is compared with a size. It is mended as its prose says
(`wildlab.planning.gimbal`).

A node of the land is seen where an image shows it with nothing before it on the exact line of sight, no
further than {LOOKS.furthest:.0f} m away, and sharply: the camera turns and moves by less than
{percent(LOOKS.blur_share, 0)} of an animal's length of {LOOKS.size} m during {1e3 * LOOKS.exposure:.0f} ms.
There are no trees, as in F's model. *Near* is within {NEAR:.0f} m of the cable.

Each draw has its own land, of the size and relief of F's map, its own phase of the swing (the adaptive
strategy begins in its narrowest swing), and its own errors: the cabin is known to {CABIN} m and the attitude
as the twin's autopilot knows it. What lies {SIGMAS:.0f} standard deviations of these inside a sharp image is
*surely* seen, and the ride with errors is asked how much of that it showed. That margin is of the very
distribution that the errors are drawn from, and which images are sharp is the plan's: what is held up is
the reckoning, not the size of the errors."""


def name_of(strategy: str) -> str:
    """A strategy as a reader says it."""
    if strategy in YAW:
        return f"yaw, pitch {YAW[strategy]:.0f} deg".replace("-", "\N{MINUS SIGN}")
    if strategy in ROLL:
        return f"roll, {ROLL[strategy]:.0f} deg"
    if strategy in ADAPT:
        return f"adaptive, {ADAPT[strategy]:.0f} deg"
    return "straight down"


def outside(spread: pd.DataFrame, subject: str) -> pd.Series:
    """Share of the ground that is seen that lies outside of the enclosures, of each draw."""
    return spread[subject, "outside"] / spread[subject, "ground"]


def share_words(spread: pd.DataFrame, subject: str, name: str) -> str:
    """A mean share, and its interval over the draws."""
    return with_interval(spread[subject, name])


def best(spread: pd.DataFrame, name: str) -> str:
    """The strategy with the largest mean."""
    return max(STRATEGIES, key=lambda one: mean(spread, one, name))


def lap_words(percent_of_lap: float) -> str:
    """How far the gondola went, at a sentence's end; nothing where it went all the way round."""
    return "" if percent_of_lap == 100 else f" on {percent_of_lap:g} % of the lap"


def summary(spread: pd.DataFrame, percent_of_lap: float) -> list[str]:
    """Three sentences on what the trials give, one row for each draw."""
    most, near = best(spread, "seen"), best(spread, "near")
    least = min(STRATEGIES, key=lambda one: outside(spread, one).mean())
    return [
        f"Most of the enclosures is seen with {name_of(most)}: {share_words(spread, most, 'seen')}, "
        f"against {share_words(spread, DOWN, 'seen')} with the camera straight down"
        f"{lap_words(percent_of_lap)}.",
        f"Least beside the enclosures is seen with {name_of(least)}, "
        f"{with_interval(outside(spread, least))} of what it sees; within {NEAR:.0f} m of the cable most is "
        f"seen with {name_of(near)}, {share_words(spread, near, 'near')} of that ground.",
        worst_words(spread, STRATEGIES, "rides"),
    ]


def table(spread: pd.DataFrame) -> pd.DataFrame:
    """One line for each strategy: means over the draws."""
    return pd.DataFrame(
        [
            {
                "strategy": name_of(one),
                "enclosures seen": share_words(spread, one, "seen"),
                "near the cable": share_words(spread, one, "near"),
                "ground seen (ha)": f"{mean(spread, one, 'ground') / 1e4:.1f}",
                "of that outside": with_interval(outside(spread, one)),
                "in sight (s)": f"{mean(spread, one, 'in_sight'):.1f}",
                "only blurred": share_words(spread, one, "only_blurred"),
            }
            for one in STRATEGIES
        ]
    )


def held_table(spread: pd.DataFrame) -> pd.DataFrame:
    """What is surely planned, and how much of it rides showed."""
    return pd.DataFrame(
        [
            {
                "strategy": name_of(one),
                "surely, of what is seen": share_words(spread, one, "sure"),
                "of that shown": share_words(spread, one, "held"),
                "least of all draws": least_words(spread[one, "held"]),
            }
            for one in STRATEGIES
        ]
    )


def strategies_words(spread: pd.DataFrame) -> str:
    """What moving the camera gains, and what the adaptive strategy saves."""
    pairs = [
        (ROLL[plain], outside(spread, one), outside(spread, plain))
        for one, plain in zip(ADAPT, ROLL, strict=True)
    ]
    saved = "; ".join(
        f"{with_interval(a)} for {with_interval(b)} at {limit:.0f} degrees" for limit, a, b in pairs
    )
    fewer = sum(a.mean() < b.mean() for _, a, b in pairs)
    adaptive, roll = "adaptive-60", "roll-60"
    more = spread[adaptive, "seen"] - spread[roll, "seen"]
    often = int((more > 0).sum())
    share = share_interval(often, int(more.notna().sum()))
    return (
        "Of what a strategy sees, a smaller share lies outside of the enclosures where it is adaptive at "
        f"{fewer} of {len(pairs)} limits ({saved}, adaptive for plain). At 60 degrees it sees "
        f"{difference_words(more)} of the enclosures than a plain swing; it "
        f"sees more in {percent(share.estimate, 0)} of the draws ({percent(share.low, 0)} to "
        f"{percent(share.high, 0)})."
    )


def near_words(spread: pd.DataFrame) -> str:
    """Which strategy sees most near the cable, and what each pitch of those that turn about yaw gives."""
    first = best(spread, "near")
    rest = max((one for one in STRATEGIES if one not in YAW), key=lambda one: mean(spread, one, "near"))
    above = [one for one in YAW if mean(spread, one, "near") > mean(spread, rest, "near")]
    each = "; ".join(f"{name_of(one)}, {share_words(spread, one, 'near')}" for one in YAW)
    return (
        f"Within {NEAR:.0f} m of the cable {name_of(first)} sees most, {share_words(spread, first, 'near')}. "
        f"F does not say which pitch is low. Those that turn about yaw: {each}; {len(above)} of {len(YAW)} "
        f"see more there than {name_of(rest)}, the best of the others, "
        f"{share_words(spread, rest, 'near')}."
    )


def sensitivity_words(held: dict[str, tuple[float, float]], factor: float) -> str:
    """What is seen of what is surely planned with errors as planned for and larger, by strategy."""
    return larger_errors_words({name_of(one): pair for one, pair in held.items()}, factor)


def rate_words(rate: float, differences: dict[str, float]) -> str:
    """How much of what is seen hangs on how many images are looked at: less half as many."""
    worst = max(differences, key=lambda one: abs(differences[one]))
    much = abs(differences[worst])
    sense = "less" if differences[worst] > 0 else "more"
    verdict = (
        "that hardly matters"
        if much <= 0.01
        else "differences between strategies that are no larger hang on it"
    )
    return (
        f"{rate:g} images a second were looked at; the gimbal moves as it does without them. With half as "
        f"many, {percent(much, 2)} {sense} of the enclosures is seen with {name_of(worst)}, which differs "
        f"most of {len(differences)} that were tried: {verdict}."
    )
