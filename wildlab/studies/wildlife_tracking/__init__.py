"""Animals that walk, tracked by a particle filter from a gondola and a multicopter: F 4, 5.3, 7.5, 8.3."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from time import process_time

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import ArrayLike, NDArray

from wildlab.analysis.animals.tracking import FollowedAnimals, Known, Patrolled, follow
from wildlab.evaluation.intervals import Interval, mean_interval, mean_share_interval, share_interval
from wildlab.evaluation.shares import Check, Pooled, columns_of
from wildlab.geometry.frames import Array
from wildlab.messages.quantities import number, percent_between
from wildlab.reporting.charts.drawing import draw_dots, draw_way, finish
from wildlab.reporting.charts.forms import draw_fences, fit_map, spread_points
from wildlab.reporting.figures import (
    BLUE,
    GREY,
    INK,
    ORANGE,
    VERMILLION,
    ellipse,
    map_axes,
    new_figure,
)
from wildlab.studies.page import Facts, Shown
from wildlab.studies.protocol import Study
from wildlab.studies.wildlife_tracking import trial
from wildlab.studies.wildlife_tracking.trial import (
    FILTERS,
    GONDOLA,
    KALMAN,
    NEGATIVE,
    POSITIVE,
    REVISITS,
    ROWS,
    UAV,
    Runs,
    World,
    draw_world,
    follower_of,
)

#: Numbers of `searches_table` and their units; those without one are shares.
_OF_SEARCH = {"minutes": "min", "turns": "", "visits": "", "given_up": "", "rmse": "m", "sd": "m"}
_SHARES = ("done", "animals_share")

#: From how many worlds on a mean of what cannot be negative has an interval: of two its ends lie a factor of
#: up to a hundred thousand apart.
FEWEST = 3


def positive_interval(values: ArrayLike) -> Interval | None:
    r"""Mean over worlds of what cannot be negative, with an interval of 95 % that is not negative either.

    Student's interval with its half width :math:`h` is taken on the logarithm of the mean :math:`m`, whose
    standard deviation is that of the mean over the mean (delta method): from :math:`m\,e^{-h/m}` to
    :math:`m\,e^{h/m}`. Values may be zero. Where they hardly spread it is Student's interval. Of
    few worlds with skewed values no such interval holds the mean as often as it says: of 5 log-normal ones
    nine times in ten, and of a count that is 0.2 in the mean two times in three; of 40 worlds it does.

    Parameters
    ----------
    values
        (N,), one of each world, none below zero, in any unit; NaN are left out.

    Returns
    -------
    Interval or None
        In the unit of the values; None where fewer than `FEWEST` are known.

    Examples
    --------
    >>> [round(x, 2) for x in positive_interval([1.0, 2.0, 3.0])]
    [2.0, 0.58, 6.93]
    >>> positive_interval([1.0, 2.0]) is None
    True
    """
    array = np.asarray(values, float)
    known = array[np.isfinite(array)]
    if len(known) < FEWEST:
        return None
    mean, _, high = mean_interval(known)
    if mean == 0:
        return Interval(mean, mean, mean)
    factor = float(np.exp((high - mean) / mean))
    return Interval(mean, mean / factor, mean * factor)


def positive_cell(values: pd.Series, digits: int = 1, unit: str = "") -> str:
    """Such a mean and its interval, where it has one, as a table shows it.

    Examples
    --------
    >>> positive_cell(pd.Series([1.0, 2.0, 3.0]), unit="m"), positive_cell(pd.Series([1.0, 2.0, np.nan]))
    ('2.0 m (0.6 to 6.9)', '1.5')
    """
    middle = f"{number(values.mean(), digits)} {unit}".rstrip()
    found = positive_interval(values)
    if found is None or found.low == found.high:
        return middle
    return f"{middle} ({number(found.low, digits)} to {number(found.high, digits)})"


def count_cell(count: int, of: int) -> str:
    """A count, with the interval of its share.

    Examples
    --------
    >>> count_cell(8, 10), count_cell(0, 0)
    ('8 of 10 (49 to 94 %)', 'none of 0')
    """
    if not of:
        return "none of 0"
    found = share_interval(count, of)
    return f"{count} of {of} ({100 * found.low:.0f} to {100 * found.high:.0f} %)"


def tracks_table(runs: pd.DataFrame, names: Mapping[str, str]) -> pd.DataFrame:
    """Means over worlds of animals out of sight, a row for each platform and filter."""
    rows = []
    for one in (f"{platform}-{each}" for platform in (GONDOLA, UAV) for each in FILTERS):
        cells = {name: positive_cell(runs[one, name]) for name in ("rmse", "sd", "anees")}
        right = count_cell(int(runs[one, "right"].sum()), int(runs[one, "later"].sum()))
        rows.append({"filter": names[one], **cells, "right": right})
    return pd.DataFrame(rows)


def searches_table(runs: pd.DataFrame, quantities: Mapping[str, str]) -> pd.DataFrame:
    """Means over worlds of searches with and without visits to known animals, a row for each number."""
    cells = {name: {one: positive_cell(runs[one, name], unit=unit) for one in (REVISITS, ROWS)}
             for name, unit in _OF_SEARCH.items()}  # fmt: skip
    cells |= {
        name: {one: percent_between(mean_share_interval(runs[one, name]), 0) for one in (REVISITS, ROWS)}
        for name in _SHARES
    }
    return pd.DataFrame([{"what": quantities[name]} | row for name, row in cells.items()])


#: Images of each world that are timed, and worlds at most: so many that a claim can hold.
IMAGES, TIMED = 600, 40


def processor_ratio(seeds: Iterable[int], second: str) -> Array:
    """How many times the Kalman filter's processor time the particle filter takes, on the same images.

    Parameters
    ----------
    seeds
        Of the worlds; the first `TIMED` are taken.
    second
        The twin of the multicopter.

    Returns
    -------
    ndarray
        (N,), one of each world; without the negative update, so that both look at the same images.
    """
    ratios = []
    for seed in list(seeds)[:TIMED]:
        world = draw_world(UAV, second, seed)
        images, spent = world.images.first(IMAGES), []
        for name in (POSITIVE, KALMAN):
            follower = follower_of(name, world, seed)
            began = process_time()
            follow(images, world.land, world.detector, follower, world.motion)
            spent.append(process_time() - began)
        ratios.append(spent[0] / spent[1])
    return np.array(ratios)


def check_claims(runs: pd.DataFrame, cost: Array | None = None) -> dict[str, Check]:
    """What the worlds give for each claim, by the claim's id.

    Parameters
    ----------
    runs
        What `trial.trial` gives, one row for each world.
    cost
        (N,) how many times as much of the processor the particle filter takes as the Kalman filter; the
        claim on it is left out where it is None.
    """

    of = columns_of(runs)

    def wrong(platform: str) -> Check:
        later, right = of(f"{platform}-{NEGATIVE}", "later"), of(f"{platform}-{NEGATIVE}", "right")
        with np.errstate(invalid="ignore"):
            each = (later - right) / later
        pooled = Pooled(int(np.nansum(later - right)), int(np.nansum(later)))
        return Check(measured=each, above=True, pooled=pooled, reach=(0, 1), unit="animals seen again")

    def lower(name: str, first: str, second: str) -> Check:
        one, other = of(first, name), of(second, name)
        # A world in which there is nothing to compare says neither.
        return Check.smaller(one, other, "m", premise=np.isfinite(one) & np.isfinite(other))

    def known(values: Array, *, above: bool = False, most: float = np.inf) -> Check:
        return Check(measured=values, above=above, premise=np.isfinite(values), reach=(0, most))

    def large(platform: str) -> Check:
        return Check(
            measured=of(f"{platform}-{NEGATIVE}", "sd_later") / of(platform, "by_fence_alone"),
            above=True,
            premise=np.isfinite(of(f"{platform}-{NEGATIVE}", "sd_later")),
            reach=(0, np.inf),
        )

    off = [
        of(f"{one}-{NEGATIVE}", "rmse") / (np.sqrt(2) * of(one, "by_fence_alone")) for one in (GONDOLA, UAV)
    ]
    found = {
        "particle-filter-performs-well": known(np.maximum(*off)),
        "small-part-at-once": known(of(UAV, "at_once"), most=1),
        "falls-on-revisit": known(of(REVISITS, "fall")),
        "grows-between": known(of(REVISITS, "grew"), above=True, most=1),
        "couple-of-seconds": known(of(GONDOLA, "in_view")),
        "very-large-a-lap-later": large(GONDOLA),
        "hard-to-associate": wrong(GONDOLA),
        "same-problem-uav": wrong(UAV),
        "visits-keep-known": lower("rmse", REVISITS, ROWS),
    }
    for platform in (GONDOLA, UAV):
        one, other = f"{platform}-{NEGATIVE}", f"{platform}-{POSITIVE}"
        found[f"negative-lowers-uncertainty-{platform}"] = lower("sd", one, other)
        found[f"negative-lowers-error-{platform}"] = lower("rmse", one, other)
        found[f"closer-than-kalman-{platform}"] = lower("rmse", one, f"{platform}-{KALMAN}")
    if cost is not None:
        found["dearer-than-ekf"] = Check(measured=cost, above=True, reach=(0, np.inf))
    return found


#: Probability that the drawn ellipses hold, as in F figure 4.1.
HELD = 0.95
#: So many images after a visit has found its animal is the last of the maps of it.
AFTER = 60


def figures(runs: Runs, table: pd.DataFrame, names: Mapping[str, str]) -> list[Shown]:
    """All figures of the page; that of a visit only where the world has one.

    Parameters
    ----------
    runs
        Of the world shown.
    table
        Of all worlds.
    names
        Words for platforms.
    """
    gondola = runs.worlds[GONDOLA], runs.followed[GONDOLA, NEGATIVE]
    multicopter = runs.worlds[UAV], runs.followed[UAV, NEGATIVE]
    found = {
        "fig-7-19b": tracks_map(*gondola, 1.0),
        "fig-7-19a": tracks_map(*gondola, 0.5),
        "fig-7-13": tracks_map(*multicopter, 1.0),
        "negative": negative_differences(table, names),
        "fig-7-14": visit_maps(runs.worlds[UAV], runs.patrolled[REVISITS]),
    }
    return [Shown(fig, name) for name, fig in found.items() if fig is not None]


def tracks_map(world: World, followed: FollowedAnimals, share: float) -> Figure:
    """Animals, tracks and the path up to a share of the first lap."""
    fig, ax = new_figure(5.9, 5.2)
    times = world.images.times
    known = _at(followed.known, times, share * world.lap)
    places = world.images.truth[known.image]
    seen = np.isin(np.arange(len(places)), [one.animal for one in followed.found if one.image <= known.image])
    way = world.images.poses.p_nc[: known.image + 1, :2]
    _ground(ax, world, way)
    _tracks(ax, known, np.ones(len(known.mean), bool), BLUE, "track of an animal")
    for name, which, fill in (
        ("animal, detected", seen, VERMILLION), ("animal, not detected yet", ~seen, "none")
    ):  # fmt: skip
        ax.plot(*places[which, ::-1].T, "o", ms=4.5, mec=INK, mew=0.9, mfc=fill, label=name)
    # Whatever an ellipse reaches to.
    fit_map(ax, np.concatenate([*world.fences, way]), 25.0)
    map_axes(ax)
    return finish(fig, "")


def _at(known: list[Known], times: Array, time: float) -> Known:
    return known[int(np.argmin([abs(times[one.image] - time) for one in known]))]


def _ground(ax: Axes, world: World, way: Array) -> None:
    draw_fences(ax, world.fences)
    ax.plot([], [], color=INK, label="fence of an enclosure")
    draw_way(ax, way, GREY, "path so far", width=1.0)
    ax.plot(*way[-1, 1::-1], "^", color=INK, ms=7, label="the camera now")


def _tracks(
    ax: Axes, known: Known, which: NDArray[np.bool_], color: str, name: str, width: float = 1.3
) -> None:
    for mean, covariance in zip(known.mean[which], known.covariance[which], strict=True):
        ellipse(ax, mean[::-1], covariance[::-1, ::-1], HELD, color=color, lw=width)
    ax.plot([], [], color=color, lw=width, label=name)


def visit_rows(flown: Patrolled) -> tuple[int, int] | None:
    """Of the visit after which the covariance fell furthest: its first image, and that which found it.

    None where no visit found its animal.
    """
    best: tuple[float, int, int] | None = None
    for one in flown.found:
        if flown.goal[one.image] != one.track or not np.isfinite(one.before):
            continue
        first = one.image
        while first > 0 and flown.goal[first - 1] == one.track:
            first -= 1
        if best is None or one.before - one.after > best[0]:
            best = (one.before - one.after, first, one.image)
    return None if best is None else best[1:]


def visit_maps(world: World, flown: Patrolled) -> Figure | None:
    """Before a visit, as it finds its animal, and when the search goes on (F figures 5.4 and 7.14)."""
    rows = visit_rows(flown)
    if rows is None:
        return None
    first, found = rows
    track = int(flown.goal[found])
    later = min(found + AFTER, len(flown.times) - 1)
    waited = f"{flown.times[later] - flown.times[found]:.0f} s later"
    fig, axes = new_figure(5.9, 9.0, rows=3)
    middle = flown.known[found].mean[flown.known[found].identity == track][0]
    for ax, row, what in zip(
        axes, (max(first - 1, 0), found, later), ("Before the visit", "Seen again", waited), strict=True
    ):
        known = flown.known[row]
        mine = known.identity == track
        _ground(ax, world, flown.p_nc[: row + 1, :2])
        _tracks(ax, known, mine, VERMILLION, "track of the animal visited", 2.0)
        _tracks(ax, known, ~mine, BLUE, "other tracks")
        own = known.covariance[mine]
        sd = float(np.sqrt(np.trace(own[-1]) / 2)) if len(own) else np.nan
        ax.set(xlim=(middle[1] - 160, middle[1] + 160), ylim=(middle[0] - 95, middle[0] + 95))
        map_axes(ax, scale_bar=ax is axes[-1], east="east (m)" if ax is axes[-1] else "")
        ax.set_title(f"{what}: SD {sd:.1f} m")
    return finish(fig, "")


def negative_differences(runs: pd.DataFrame, names: Mapping[str, str]) -> Figure:
    """What the negative update changes, world by world."""
    fig, axes = new_figure(5.9, 3.8, columns=2, sharey=True)
    platforms = {GONDOLA: BLUE, UAV: ORANGE}
    for ax, name, label in zip(axes, ("sd", "rmse"), ("Predicted SD", "RMS error"), strict=True):
        for place, (platform, color) in enumerate(platforms.items()):
            one, other = f"{platform}-{NEGATIVE}", f"{platform}-{POSITIVE}"
            values = (runs[one, name] - runs[other, name]).dropna().to_numpy(float)
            draw_dots(ax, place + spread_points(len(values), 0.16), values, color, size=8)
            if len(values) > 1:
                found = mean_interval(values)
                bar = [[found.estimate - found.low], [found.high - found.estimate]]
                ax.errorbar(place + 0.3, found.estimate, bar, fmt="D", color=INK, ms=5, capsize=4)
        ax.axhline(0, color=GREY, lw=1.0)
        ax.set(title=label, xlim=(-0.5, 1.6), xticks=[0, 1], xticklabels=[names[one] for one in platforms])
    return finish(fig, "", ylabel="with less without (m)")


#: The particle filter of each platform.
_FILTERS = (f"{GONDOLA}-{NEGATIVE}", f"{UAV}-{NEGATIVE}")


def answer(facts: Facts) -> list[str]:
    """Errors out of sight and whether they are as predicted, then how many tracks are found a lap later."""
    return [f"known-{_consistency(facts)}", f"lap-{_reacquired(facts)}"]


def _consistency(facts: Facts) -> str:
    if any(math.isnan(facts.value(one, name)) for one in _FILTERS for name in ("rmse", "anees")):
        return "unknown"
    if all(facts.value(one, "anees", "centre_low") > 2 for one in _FILTERS):
        return "overconfident"
    if all(facts.value(one, "anees", "centre_high") < 2 for one in _FILTERS):
        return "conservative"
    return "open"


def _reacquired(facts: Facts) -> str:
    if any(math.isnan(facts.value(one, "right_share")) for one in _FILTERS):
        return "unknown"
    found = {facts.outcome(claim) for claim in ("hard-to-associate", "same-problem-uav")}
    return "hard" if found == {"holds"} else "easy" if found == {"fails"} else "open"


STUDY = Study("wildlife-tracking", trial.trial, check_claims, trial.RECORDED.get, answer)
