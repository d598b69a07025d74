"""What the report on planning by information says, as the computed numbers have it."""

from __future__ import annotations

import numpy as np
import pandas as pd

from wildlab.evaluation.runs import Interval, share_interval
from wildlab.evaluation.shares import paired_difference
from wildlab.planning.planner import Horizon
from wildlab.reporting.text import percent, percent_between
from wildlab.studies.information_planning.trial import (
    AHEAD,
    BUDGET_S,
    CHANCE,
    FIXED,
    GREEDY,
    INFORMATION,
    ROWS,
    SEARCHERS,
    STOPPING,
    STOPS_BEYOND,
    SURVEY,
    SWING,
    Tuned,
)

#: What each planner is called.
NAMES = {
    INFORMATION: "by information",
    FIXED: "by information, camera down",
    ROWS: "rows, camera down",
    SWING: "rows, camera from side to side",
    CHANCE: "random walk",
}
#: In how many worlds the planner by information has to be sooner: ours, F names no number.
WANTED = 0.7
COLUMNS = {
    "planner": "planner",
    "half": "half are found (min)",
    "all": "all are found (min)",
    "missed": "not all found",
    "covered": "ground seen by then",
    "sooner": "by information is sooner",
}

_METHOD = r"""Each world is drawn from its seed: rolling
land like that of F's map, two enclosures of the sizes of
the twin's, and the animals in them, which walk at random and turn at the fence. All planners fly
the same multicopter with the same camera from the same corner, at the same speed and height above
the ground, and take an image every second. An animal in an image is found with the probability of F
(5.8)-(5.9), if the ground does not hide it; the same luck for all planners. An image counts only
where the camera has come to rest. Through 180 degrees the platform turns for as long as the twin gives
for a turn, through less in proportion; meanwhile it stands still and takes no image. That holds for all
planners, and the one by information knows it: what comes after a turn counts less, as all that is learnt
later does. The twin means that time for any turn at a pattern's corners; what comes of that, for turns
beyond 30 degrees, stands beside it. An enclosure whose animals are all found is left, whoever plans:
their number is known (F 5.1). A time of animals that were not all found counts as the whole budget.

The planner by information keeps a matrix for each cell of 10 m, adds to it by F (5.10) what the two
angles of (5.7) tell, from the Jacobian derived anew, and lets it wear off by (5.5) with the walk of the
animals on the ground's two axes. At each decision it weighs headings and angles of the gimbal over some
steps of three seconds (a beam search over F's horizon) and flies the first. Candidate looks take lines of
sight for clear, what was looked at is added with the ground that hides. F's objective (5.6) sees nothing
beyond its horizon; here what is left to know further away counts too, less the further it is.

Settings of both kinds of rows, of the planner whose camera is free and of the one whose camera is fixed
were each chosen on the worlds of seeds 1001 to 1016, by the mean time until all are found; the worlds of
the report were not looked at for that. SETTINGS
F prints neither (5.9)'s reach nor the angles' standard
deviation.

Searching and going back (F 5.3.3, 5.3.4): before each leg F (5.2)-(5.3) chooses between the next way point
of the rows and an animal that is known. Each animal has a Kalman filter for a random walk. It is lost where
the trace of its covariance is beyond a limit, or where images of its estimated position would nearly surely
have shown it; the limit and what the search is worth are chosen.

The greedy choice is asked for in each world: the animals of an enclosure were last seen at random times,
and the search would go on at a random way point. Choosing by F (5.2)-(5.3) every second is compared with
the shortest order of the same goals, which is found by trying all."""


def _settings(horizon: Horizon, sd: float) -> str:
    return (
        f"{horizon.steps} steps ahead, of which the {horizon.beam} best are followed up, {sd:g} rad for the "
        f"angles' standard deviation, and what is learnt a step later counts {horizon.fades:g} of what is "
        "learnt now"
    )


def method(tuned: Tuned | None = None) -> str:
    """How it was done, with the settings of both planners by information."""
    t = tuned or Tuned()
    free, down = _settings(t.horizon, t.sd), _settings(t.down_horizon, t.down_sd)
    same = "the camera that is fixed: " + ("the same" if free == down else down)
    rows = f"Rows are {t.rows:g} m apart with the camera down, {t.swing_rows:g} m from side to side"
    return _METHOD.replace("SETTINGS", f"{rows}. The free camera: {free}; {same}.")


def sooner_share(
    spread: pd.DataFrame, other: str, name: str = "all_found", one: str = INFORMATION
) -> Interval:
    """In which share of the worlds a planner is sooner than another, with its 95 % interval."""
    own, others = (spread[who, name].to_numpy(float) for who in (one, other))
    return share_interval(int((own < others).sum()), int((~np.isnan(own + others)).sum()))


def minutes(seconds: float) -> str:
    """Seconds as minutes with a decimal."""
    return f"{seconds / 60:.1f}".replace("-", "−")


def wanted_words(share: Interval) -> str:
    """Whether a share reaches what was asked for."""
    if share.low >= WANTED:
        return f"at least the {100 * WANTED:.0f} % that we ask for"
    if share.high < WANTED:
        return f"below the {100 * WANTED:.0f} % that we ask for"
    side = "above" if share.estimate >= WANTED else "below"
    return f"{side} the {100 * WANTED:.0f} % that we ask for, but so few worlds do not settle it"


def summary(spread: pd.DataFrame) -> list[str]:
    """Three sentences on what the worlds gave."""
    swing, down = sooner_share(spread, SWING), sooner_share(spread, ROWS)
    return [
        f"Planning by information, whose camera may look anywhere, finds all animals sooner than rows whose "
        f"camera looks from side to side in {percent_between(swing)} of {len(spread)} worlds, "
        f"{wanted_words(swing)}; than rows with the camera straight down in {percent_between(down)}, "
        f"{wanted_words(down)}.",
        f"On the median world all are found {when_words(spread, INFORMATION)}, in rows from side to side "
        f"{when_words(spread, SWING)}, in rows with the camera down {when_words(spread, ROWS)}.",
        why_words(spread),
    ]


def when_words(spread: pd.DataFrame, who: str) -> str:
    """When all are found on the median world; a search that ends before that has no such time."""
    middle = float(spread[who, "all_found"].median())
    if middle >= BUDGET_S - 1e-6:
        return f"not within the {BUDGET_S / 60:.0f} minutes"
    return f"after {minutes(middle)} minutes"


def median_words(seconds: pd.Series) -> str:
    """A median in minutes; of searches that ended before it only that."""
    middle = float(seconds.median())
    return f"over {BUDGET_S / 60:.0f}" if middle >= BUDGET_S - 1e-6 else minutes(middle)


def why_words(spread: pd.DataFrame) -> str:
    """What the gain is due to: the gimbal that may look anywhere, or the choice of the way."""
    fixed = sooner_share(spread, ROWS, one=FIXED)
    said = {
        "sooner": "With both cameras fixed straight down, such planning still is sooner than rows, in",
        "later": "With both cameras fixed straight down, such planning is sooner than rows only in",
        "open": "With both cameras straight down it is not settled which is sooner: such planning is in",
    }[_side(fixed)]
    return f"{said} {percent_between(fixed)}."


def turns_words(spread: pd.DataFrame) -> str:
    """What is left of the shares where a turn takes the whole time."""
    one = STOPPING[INFORMATION]
    shares = {who: sooner_share(spread, STOPPING[who], one=one) for who in (ROWS, SWING)}
    said = "; ".join(f"than {NAMES[who]} in {percent_between(share)}" for who, share in shares.items())
    missed = int((spread[one, "share_found"] < 1).sum())
    return (
        f"Where any turn beyond {np.degrees(STOPS_BEYOND):.0f} degrees takes as long as one round, by "
        f"information is sooner {said}, of {len(spread)} worlds; all are found "
        f"{when_words(spread, one)} on the median world, and not all in {missed}. The settings are those "
        "chosen for turns in proportion."
    )


def _side(share: Interval) -> str:
    return "sooner" if share.low > 0.5 else "later" if share.high < 0.5 else "open"


def table(spread: pd.DataFrame) -> pd.DataFrame:
    """Each planner in a row, with the columns of `COLUMNS`."""
    rows = []
    for who in SEARCHERS:
        missed = int((spread[who, "share_found"] < 1).sum())
        rows.append(
            {
                "planner": NAMES[who],
                "half": median_words(spread[who, "half_found"]),
                "all": median_words(spread[who, "all_found"]),
                "missed": f"{missed} of {len(spread)}",
                "covered": percent(float(spread[who, "covered"].median())),
                "sooner": "" if who == INFORMATION else percent_between(sooner_share(spread, who)),
            }
        )
    return pd.DataFrame(rows)


def differences(spread: pd.DataFrame) -> str:
    """By how much sooner all are found, world by world; a search that ended before has no such time."""
    said = []
    for other in (ROWS, SWING, CHANCE):
        ended = [int((spread[who, "share_found"] < 1).sum()) for who in (other, INFORMATION)]
        apart = paired_difference(spread[other, "all_found"], spread[INFORMATION, "all_found"])
        if apart is not None:
            said.append(
                f"{NAMES[other]}: {minutes(apart.estimate)} min "
                f"({minutes(apart.low)} to {minutes(apart.high)}){_ended_words(*ended)}"
            )
    if not said:
        return "Of one world there is no mean difference."
    return "How much sooner all are found by information, mean over worlds: " + "; ".join(said) + "."


def _ended_words(other: int, own: int) -> str:
    """What searches that ended with the budget do to a mean difference."""
    if not other and not own:
        return ""
    if not own:
        return f", at least, as {other} of the rows' or walks' searches ended before all were found"
    return f", where {other} of its searches and {own} of those by information ended before all were found"


def cost_words(spread: pd.DataFrame, cost: pd.DataFrame) -> str:
    """What planning costs, as `timing.planning_cost` has measured it."""
    weighed = float(spread[INFORMATION, "weighed"].median())
    ms, load = 1e3 * cost["decision"], cost["load"]
    return (
        f"A decision weighs {weighed:.0f} candidate steps and takes {ms.median():.1f} ms of processor time "
        f"({ms.min():.1f} to {ms.max():.1f} over {len(cost)} worlds) on the machine that made this report, "
        f"with what it adds of the images, without the world and the camera. That is "
        f"{percent(float(load.median()), 2)} of one core ({percent(float(load.min()), 2)} to "
        f"{percent(float(load.max()), 2)}). Rows weigh none."
    )


def greedy_words(spread: pd.DataFrame) -> str:
    """What choosing by the present situation costs."""
    greedy, ahead = (spread[who, "tour_time"].to_numpy(float) for who in (GREEDY, AHEAD))
    longer = greedy / ahead - 1
    turns = spread[GREEDY, "broken_off"].dropna()
    turned = share_interval(int((turns > 0).sum()), len(turns))
    given_up = int(np.isinf(greedy).sum())
    more = f" In {given_up} it did not come to an end." if given_up else ""
    return (
        f"Choosing by F (5.3) every second takes {percent(float(np.median(longer)))} longer than the "
        f"shortest order of the same goals on the median world, and turns round on the way to a goal in "
        f"{percent_between(turned)} of the worlds.{more}"
    )


def survey_words(spread: pd.DataFrame) -> str:
    """What comes of searching in rows and going back, until every enclosure is done."""
    count = len(spread)
    whole = share_interval(int(spread[SURVEY, "all_positioned"].sum()), count)
    means = {
        name: float(spread[SURVEY, name].mean())
        for name in ("revisits", "lost_by_covariance", "lost_by_search")
    }
    most = percent(float(spread[SURVEY, "most_known"].mean()))
    return (
        f"In rows with F's high-level planner every enclosure has had all its animals known at once within "
        f"{BUDGET_S / 60:.0f} minutes in {percent_between(whole)} of {count} worlds; at best {most} of the "
        f"animals are known, on the mean. A search goes back {means['revisits']:.1f} times; "
        f"{means['lost_by_covariance']:.1f} times an animal is lost because its covariance is beyond the "
        f"limit, {means['lost_by_search']:.1f} times because it was not found where it should be."
    )


LIMITS = [
    "F described this planner and did not build it: there are no numbers to agree with, only sentences.",
    "Nobody flies in wind here, the platform turns on the spot and loses no time by braking, and the pose is "
    "known: what pose errors cost is not in the times.",
    "Detections are drawn by F (5.8)-(5.9), not found in images; there are no false alarms, and animals are "
    "told apart.",
    "Trees are not in the ground model, as in F.",
    f"A search ends after {BUDGET_S / 60:.0f} minutes; a longer one would move the times of planners that "
    "missed animals.",
    "How far the camera finds animals (5.9) is chosen: one that finds them from further away favours looks "
    "to the side.",
]
