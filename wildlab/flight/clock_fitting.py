"""Scales of time and zones, and one clock against another: rate and offset from pairs of stamps, through
them or, where these can only be late, under them; which image belongs to which trigger, by their pattern."""

from __future__ import annotations

import re
import zoneinfo
from datetime import UTC, datetime, timedelta, timezone, tzinfo
from typing import NamedTuple

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike
from scipy.optimize import linprog
from scipy.sparse import coo_array
from scipy.sparse.csgraph import min_weight_full_bipartite_matching

from wildlab.errors import WildlabError
from wildlab.geometry.frames import Array, Indices, Mask

#: First and last stamp, s.
Span = tuple[float, float]

#: Stamps are numbers of this resolution at best: s since 1970 in 64 bits.
RESOLUTION_S = 1e-6
#: Residuals beyond so many standard deviations are outliers.
REACH = 3.0
#: Fewer pairs than this are all believed.
FEW = 6


class ClockFit(NamedTuple):
    """``reference = reference_0 + rate (own - own_0)``.

    Attributes
    ----------
    own_0, reference_0
        s; the middle of the pairs used, so that rate and offset hardly have to do with each other.
    rate
        Seconds of the reference for a second of the clock.
    used
        (N,) pairs that the fit rests on; the others are outliers.
    rate_sd
        Standard deviation of ``rate``; infinite where the pairs do not tell.
    """

    own_0: float
    reference_0: float
    rate: float
    used: Mask
    rate_sd: float = np.inf

    def to_reference(self, own: ArrayLike) -> Array:
        """Stamps (...) of the clock, s, as the reference has them."""
        return self.reference_0 + self.rate * (np.asarray(own, float) - self.own_0)

    @property
    def offset_s(self) -> float:
        """The reference's time at the clock's zero, s."""
        return float(self.to_reference(0.0))


def fit_clock(
    own: ArrayLike, reference: ArrayLike, late: bool = False, resolution_s: float = RESOLUTION_S
) -> ClockFit:
    """Rate and offset of a clock from pairs of stamps, robust against outliers.

    Parameters
    ----------
    own
        (N,) s by the clock; NaN is left out.
    reference
        (N,) s by the reference, at the same instants.
    late
        Stamps of the reference can only be late, as times of receipt are: the line goes under them, not
        through them. The least delay of all stays in the offset; nothing in the stamps tells it. Where they
        jitter to both sides besides, the line lies low by up to three standard deviations of that jitter,
        and what is stated does not hold it.
    resolution_s
        How coarse either stamp is, s, as where a loop takes them: pairs that differ by less are not outliers,
        even where most happen to fall on one line.

    Returns
    -------
    ClockFit
        Robust start: median of slopes between pairs half the log apart (Siegel and Theil's idea: right with
        up to 29 % of outliers here and there, 25 % side by side), then those within three standard
        deviations. Standard deviations allow for residuals that go together from one pair to the next.

    Raises
    ------
    WildlabError
        Where there is no pair.

    Examples
    --------
    >>> own = np.arange(100.0)
    >>> fit = fit_clock(own, 5.0 + 1.1 * own)
    >>> round(fit.rate, 9), round(fit.offset_s, 9)
    (1.1, 5.0)
    """
    x, y = np.asarray(own, float), np.asarray(reference, float)
    known = np.isfinite(x) & np.isfinite(y)
    if not known.any():
        problem = "no stamps of both clocks go together"
        raise WildlabError(problem, "state the offset", field="time")
    x_0, y_0 = float(np.median(x[known])), float(np.median(y[known]))
    dx, dy = x[known] - x_0, y[known] - y_0
    at_0, rate = _start(dx, dy)
    line = _under(dx, dy, at_0, rate) if late else _through(dx, dy, at_0, rate, resolution_s)
    at_0, rate, used, rate_sd = line
    middle = float(dx[used].mean())
    every = np.zeros(len(x), bool)
    every[np.flatnonzero(known)[used]] = True
    return ClockFit(x_0 + middle, y_0 + at_0 + rate * middle, rate, every, rate_sd)


def _start(dx: Array, dy: Array) -> tuple[float, float]:
    """Height at zero and slope, by medians."""
    order = np.argsort(dx, kind="stable")
    half = len(order) // 2
    first, second = order[:half], order[len(order) - half :]
    run = dx[second] - dx[first]
    apart = run > 0
    rate = float(np.median((dy[second] - dy[first])[apart] / run[apart])) if apart.sum() > 1 else 1.0
    return float(np.median(dy - rate * dx)), rate


def _through(dx: Array, dy: Array, at_0: float, rate: float, resolution_s: float) -> _Line:
    """The line through the points, and what is known of it."""
    turns = len(dx) > 2 and bool(np.ptp(dx) > 0)
    used = np.ones(len(dx), bool)
    for _ in range(50):
        before = used
        far = np.abs(dy - at_0 - rate * dx)
        # Of a handful none is in the minority, and half of all stamps are right where any are.
        if len(dx) >= FEW:
            used = far <= max(REACH * 1.4826 * float(np.median(far)), resolution_s)
        if turns:
            rate, at_0 = np.polyfit(dx[used], dy[used], 1)
        else:
            at_0 = float(np.mean((dy - rate * dx)[used]))
        if (used == before).all():
            break
    left = (dy - at_0 - rate * dx)[used]
    return float(at_0), float(rate), used, _rate_sd(dx[used], left) if turns else np.inf


def _under(dx: Array, dy: Array, at_0: float, rate: float) -> _Line:
    """The line under the points, and what is known of it."""
    # Far outliers first: they would be the whole line.
    left = dy - at_0 - rate * dx
    low = float(np.quantile(left, 0.05)) if len(left) > 20 else -np.inf
    kept = left >= 2 * low - 2 * RESOLUTION_S if low < 0 else np.ones(len(left), bool)
    above_0, slope, slope_sd = lower_line(dx[kept], left[kept])
    used = kept & (left - above_0 - slope * dx >= -1e-6)
    return at_0 + above_0, rate + slope, used, slope_sd


#: Height at zero, slope, the points that it rests on, and the standard deviation of the slope.
_Line = tuple[float, float, Mask, float]


def _scale(left: Array) -> float:
    left = left[np.isfinite(left)]
    return 1.4826 * float(np.median(np.abs(left - np.median(left)))) if len(left) else np.nan


def _rate_sd(dx: Array, left: Array) -> float:
    """Standard deviation of the slope, from residuals (N,)."""
    n = len(left)
    if n < 4 or np.ptp(dx) == 0:
        return np.inf
    spread = max(float(np.sqrt((left**2).sum() / (n - 2))), RESOLUTION_S / np.sqrt(12))
    in_order = left[np.argsort(dx, kind="stable")]
    power = float((in_order**2).sum())
    together = float((in_order[1:] * in_order[:-1]).sum()) / power if power > 0 and n > 10 else 0.0
    # Residuals of a first-order Gauss-Markov process count for fewer than there are.
    more = np.sqrt((1 + np.clip(together, 0, 0.98)) / (1 - np.clip(together, 0, 0.98)))
    return float(spread * more / np.sqrt(n)) / float(np.std(dx))


#: A rate is another than 1 where it is so many of its standard deviations away.
TOLD_APART = 5.0
#: Receipts before the middle one by more than so many robust standard deviations (and 1 s) are wrong.
WRONG = 5.0
#: Fewer pairs do not tell how well they tell a rate.
FEW_FOR_RATE = 10
#: Standard deviation of a quartz's rate.
USUAL = 1e-4
#: A clock that is further from the other's rate is none.
SLOWEST, FASTEST = 0.5, 2.0


def fit_steady(
    own: ArrayLike, reference: ArrayLike, late: bool = False, resolution_s: float = RESOLUTION_S
) -> ClockFit:
    """As `fit_clock`, with a rate near 1 where the pairs cannot tell it from 1.

    What they say of it is then weighed against what a quartz does.

    Parameters
    ----------
    own, reference, late, resolution_s
        Of `fit_clock`.

    Returns
    -------
    ClockFit

    Raises
    ------
    WildlabError
        Where there is no pair.
    """
    fit = fit_clock(own, reference, late, resolution_s)
    told = int(fit.used.sum()) >= FEW_FOR_RATE and np.isfinite(fit.rate_sd)
    if told and abs(fit.rate - 1.0) > TOLD_APART * fit.rate_sd and SLOWEST < fit.rate < FASTEST:
        return fit
    turned = float(np.clip(fit.rate - 1.0, -1.0, 1.0))
    rate = 1.0 + (turned * USUAL**2 / (USUAL**2 + fit.rate_sd**2) if told else 0.0)
    x, y = np.asarray(own, float), np.asarray(reference, float)
    used = fit.used
    middle = float(np.mean(x[used]))
    apart = y - middle - rate * (x - middle)
    if late:
        # Among few pairs `fit_clock` believes all.
        believed = used & (apart >= np.nanmedian(apart) - max(WRONG * _scale(apart), 1.0))
        used = believed if believed.any() else used
        offset = float(apart[used].min())
    else:
        offset = float(np.median(apart[used]))
    return ClockFit(middle, middle + offset, rate, used, fit.rate_sd)


#: What the line may rest on: so many of the lowest in each of so many stretches.
STRETCHES, LOWEST = 200, 12
#: Stamps under the line are early, and outliers, where it rises by so many of its own standard deviations
#: without them; so often is it tried what the next two that it rests on hide. Fewer stamps are all believed:
#: among them the least delays are too far apart to tell.
EARLY, PEELS, FEW_STAMPS = 10.0, 10, 60


def lower_line(x: Array, y: Array) -> tuple[float, float, float]:
    """The line under the points that has the least sum of distances above it; a few far below are left out.

    How well it is known follows from how close together the lowest distances lie: where the density of
    delays at no delay is f, the least of N is off by 1 / (N f).

    Parameters
    ----------
    x, y
        (N,) each, finite; ``y`` about zero.

    Returns
    -------
    Height at zero, slope, and the standard deviation of the slope, infinite where there are fewer than four
    points.
    """
    A, near = np.column_stack([np.ones(len(x)), x]), np.arange(len(x))
    if len(x) > STRETCHES * LOWEST:
        stretch = np.minimum(((x - x.min()) / np.ptp(x) * STRETCHES).astype(int), STRETCHES - 1)
        near = pd.Series(y).groupby(stretch).nsmallest(LOWEST).index.get_level_values(1).to_numpy()
    middle = A.mean(axis=0)

    def under(rows: Indices) -> Array:
        aim = A[rows].mean(axis=0)  # between them: else it has no bound
        return np.array(linprog(-aim, A[rows], y[rows], bounds=(None, None)).x, float)

    line = first = best = under(near)
    kept = near
    for peel in range(1, 1 + min(PEELS, len(x) // FEW_STAMPS)):
        kept = kept[np.argsort(y[kept] - A[kept] @ line)[2:]]
        line = under(kept)
        # Without outliers each round lifts the line by about the distance between neighbours.
        if middle @ (line - first) > (EARLY + 2 * peel) * max(2 * _spacing(y - A @ line), 1e-7):
            best = line
    above, unsure = y - A @ best, 1.0
    if best is not first:
        # What went with the outliers and is none comes back; where some are early, others may be by less.
        best, unsure = under(near[above[near] >= -6 * _spacing(above)]), 3.0
        above = y - A @ best
    spacing = _spacing(above) if np.ptp(x) > 0 else np.inf
    # A least value is as far off, in the mean, as it spreads; a line has two ends to find, and half of the
    # points for each.
    return float(best[0]), float(best[1]), unsure * 2.3 * spacing / max(float(np.std(x)), 1e-300)


def _spacing(above: Array) -> float:
    """How far apart the least distances above a line lie, infinite where there are fewer than four."""
    # The two that the line rests on say nothing; a handful above them tells how dense delays are there.
    lowest = np.sort(above[above >= -1e-9])[2:]
    if len(lowest) < 2:
        return np.inf
    many = min(int(np.clip(round(np.sqrt(len(lowest))), 2, 30)), len(lowest))
    # The same from the fifth alone, which is more where small delays are rare.
    return float(max(lowest[many - 1] / many, 0.25 * lowest[min(4, len(lowest) - 1)]))


#: Stamps of images may count in steps of so many seconds.
RESOLUTIONS = (1.0, 0.1, 0.01)
#: How far an image may be from its trigger (s) beside the step of its stamps, and what share of the time
#: between two triggers at most.
NEAR_S, SHARE = 0.5, 0.4
#: So many offsets are tried in full, those under which most pairs are near each other.
TRIED = 24
#: Pairs of an image and a trigger that are looked at for that, at most.
MOST_PAIRS = 4_000_000
#: By so many images a match has to be better than the next one to be certain.
AHEAD = 3.0
#: A rate is used while matching where it is known so well, and is 1 where it is not.
RATE_SD = 1e-4


class TriggerMatch(NamedTuple):
    """Images and triggers brought together.

    Attributes
    ----------
    trigger
        (N,) the trigger of each image, counted from 0; -1 where it has none.
    images_left, triggers_left
        How many have no partner.
    certain
        Whether no other offset does nearly as well. Evenly timed images of which some are missing fit at
        many offsets.
    """

    trigger: Indices
    images_left: int
    triggers_left: int
    certain: bool


def match_triggers(image_stamps: ArrayLike, trigger_times: ArrayLike) -> TriggerMatch:
    """Which image is of which trigger, by the pattern of intervals; the clocks may be hours apart.

    Parameters
    ----------
    image_stamps
        (N,) s by the camera's clock, in any order and in steps of a second or finer; NaN has no partner.
        Images of one stamp are taken to be in the order of time.
    trigger_times
        (M,) s by the log's clock; NaN has no partner.

    Returns
    -------
    TriggerMatch
        Pairs keep the order of time. Under each offset that brings many together, the pairs are those of the
        least distances (a heaviest increasing sequence); the offset is that which explains most images best.

    Raises
    ------
    WildlabError
        Where there is no image or no trigger with a time.

    Examples
    --------
    >>> match = match_triggers([7200.0, 7203.0, 7209.0], [1.0, 2.1, 5.2, 11.1])
    >>> match.trigger.tolist(), match.triggers_left
    ([1, 2, 3], 1)
    """
    stamps, times = np.asarray(image_stamps, float), np.asarray(trigger_times, float)
    images, triggers = (
        order[np.isfinite(of[order])]
        for of, order in ((one, np.argsort(one, kind="stable")) for one in (stamps, times))
    )
    if not len(images) or not len(triggers):
        what = "image" if not len(images) else "trigger"
        raise WildlabError(f"no {what} has a time", "state the offset of the camera's clock", field="time")
    s, t = stamps[images], times[triggers]
    apart = np.diff(t)
    usual = float(np.median(apart[apart > 0])) if (apart > 0).any() else np.inf
    near = max(_resolution(s), min(NEAR_S, SHARE * usual))
    best: list[tuple[float, Indices]] = []
    for offset in _offsets(s, t, near):
        score, pairs = _settle(s, t, offset, near)
        if not any(np.array_equal(pairs, other) for _, other in best):
            best.append((score, pairs))
    best.sort(key=lambda one: -one[0])
    (most, pairs), *rivals = best
    index = np.full(len(stamps), -1, np.intp)
    index[images[pairs[:, 0]]] = triggers[pairs[:, 1]]
    left = len(stamps) - len(pairs), len(times) - len(pairs)
    # What one image more is worth; where all have a partner, any other offset leaves some without.
    least = most - AHEAD * most / len(pairs)
    rivalled = any(score > least and len(other) > len(pairs) - AHEAD for score, other in rivals)
    return TriggerMatch(index, *left, len(pairs) > 1 and (left == (0, 0) or not rivalled))


def _resolution(stamps: Array) -> float:
    """Step of stamps (N,), s; 0 where they have none that shows."""
    for step in RESOLUTIONS:
        if len(stamps) > 2 and np.abs(stamps / step - np.round(stamps / step)).max() < 1e-3:
            return step
    return 0.0


def _offsets(s: Array, t: Array, near: float) -> list[float]:
    """Offsets under which most pairs are near each other, best first."""
    # Every so manieth image is enough to find them; together they have the whole pattern.
    every = int(np.ceil(len(s) * len(t) / MOST_PAIRS))
    apart = np.sort((t[None, :] - s[::every, None]).ravel())
    reach = np.searchsorted(apart, apart + near, side="right") - np.arange(len(apart))
    found: list[float] = []
    for k in np.argsort(-reach, kind="stable")[: 2000 * TRIED]:
        middle = float(np.median(apart[k : k + reach[k]]))
        if all(abs(middle - other) > near / 2 for other in found):
            found.append(middle)
            if len(found) == TRIED:
                break
    return found


def _settle(s: Array, t: Array, offset: float, near: float) -> tuple[float, Indices]:
    """How much the pairs near an offset explain, and these, (K, 2)."""
    at, pairs = s + offset, np.zeros((0, 2), np.intp)
    for _ in range(4):
        found = _pair(at, t, near)
        if np.array_equal(found, pairs):
            break
        pairs = found
        fit = fit_clock(s[pairs[:, 0]], t[pairs[:, 1]])
        if fit.rate_sd < RATE_SD:
            at = fit.to_reference(s)
        else:
            at = s + float(np.median(t[pairs[:, 1]] - s[pairs[:, 0]]))
    left = t[pairs[:, 1]] - at[pairs[:, 0]]
    # Against anything within reach, each pair that is known to its spread gains the logarithm of the ratio.
    spread = max(float(np.sqrt(np.mean(left**2))), 1e-3)
    return len(pairs) * float(np.log(np.e * near / spread)), pairs


def _pair(at: Array, t: Array, near: float) -> Indices:
    """Pairs (K, 2) in order of time, no further apart than `near`, most and nearest first."""
    low, high = np.searchsorted(t, at - near), np.searchsorted(t, at + near, side="right")
    image = np.repeat(np.arange(len(at)), high - low)
    trigger = np.concatenate([np.empty(0, np.intp), *map(np.arange, low, high)])
    # No image has to have a trigger: each may take a place of its own behind all of them instead.
    cost = np.r_[1.0 + ((t[trigger] - at[image]) / near) ** 2, np.full(len(at), 3.0)]
    places = np.r_[image, np.arange(len(at))], np.r_[trigger, len(t) + np.arange(len(at))]
    row, place = min_weight_full_bipartite_matching(coo_array((cost, places)).tocsr())
    paired = place < len(t)
    # On a line nearest pairs need not cross.
    return np.column_stack([row[paired], np.sort(place[paired])]).astype(np.intp)


# -- scales of time, and zones


#: 1980-01-06, when both were alike, in s since 1970.
GPS_START_S = 315964800.0
WEEK_S = 604800.0
#: First days on which UTC was one second further behind GPS time (IERS Bulletin C); none is announced since.
LEAP_DAYS = (
    *("1981-07-01", "1982-07-01", "1983-07-01", "1985-07-01", "1988-01-01", "1990-01-01", "1991-01-01"),
    *("1992-07-01", "1993-07-01", "1994-07-01", "1996-01-01", "1997-07-01", "1999-01-01", "2006-01-01"),
    *("2009-01-01", "2012-07-01", "2015-07-01", "2017-01-01"),
)
#: The same in s since 1970, UTC.
_STARTS = np.array([datetime.fromisoformat(day).replace(tzinfo=UTC).timestamp() for day in LEAP_DAYS])


def gps_to_utc(gps_s: ArrayLike) -> Array:
    """UTC in s since 1970 of GPS time (...) in s since 6 January 1980.

    Parameters
    ----------
    gps_s
        (...) s: weeks times 604800, and the time of week.

    Returns
    -------
    (...) s since 1970

    Examples
    --------
    >>> from datetime import UTC, datetime
    >>> datetime.fromtimestamp(float(gps_to_utc(1867 * 604800 + 16)), UTC).isoformat()
    '2015-10-17T23:59:59+00:00'
    """
    counted = np.asarray(gps_s, float) + GPS_START_S
    # A leap second begins where GPS time, too, is ahead by it.
    behind = np.searchsorted(_STARTS + np.arange(1, len(_STARTS) + 1), counted, side="right")
    return np.where(np.isnan(counted), np.nan, counted - behind)


def week_to_utc(week: ArrayLike, time_of_week_s: ArrayLike) -> Array:
    """UTC in s since 1970 of a GPS week (...) and the s since it began (...)."""
    return gps_to_utc(np.asarray(week, float) * WEEK_S + np.asarray(time_of_week_s, float))


def find_zone(text: str, field: str = "zone") -> tzinfo:
    """A time zone by its IANA name, or as a fixed offset such as ``+02:00``.

    Parameters
    ----------
    text
        As a person gives it.
    field
        Who asks, for messages.

    Returns
    -------
    tzinfo

    Raises
    ------
    WildlabError
        Where it is neither.

    Examples
    --------
    >>> find_zone("-03:30").utcoffset(None)
    datetime.timedelta(days=-1, seconds=73800)
    """
    fixed = re.fullmatch(r"([+-])(0[0-9]|1[0-4]):([0-5][0-9])", text)
    if fixed:
        size = timedelta(hours=int(fixed[2]), minutes=int(fixed[3]))
        return timezone(-size if fixed[1] == "-" else size)
    try:
        return zoneinfo.ZoneInfo(text)
    except (zoneinfo.ZoneInfoNotFoundError, ValueError, OSError):
        raise WildlabError(
            f"{text[:60]!r} is not a time zone",
            "write UTC, Europe/Oslo, or +02:00",
            field=field,
        ) from None


def wall_to_utc(wall_s: ArrayLike, zone: str) -> Array:
    """UTC of wall clocks, s since 1970.

    Parameters
    ----------
    wall_s
        (...) what the clock showed, in s since 1970 as if it were UTC; NaN stays NaN. Of an hour that a zone
        has twice, the first is taken.
    zone
        As of `find_zone`.

    Returns
    -------
    (...)

    Raises
    ------
    WildlabError
        Where the zone is none.

    Examples
    --------
    >>> float(wall_to_utc(1718191800.0, "Europe/Oslo"))
    1718184600.0
    """
    found = find_zone(zone)
    wall = np.asarray(wall_s, float)

    def shift(one: float) -> float:
        if not np.isfinite(one):
            return np.nan
        try:
            there = datetime.fromtimestamp(one, UTC).replace(tzinfo=found)
            return (there.utcoffset() or timedelta()).total_seconds()
        except (ValueError, OverflowError, OSError):
            return np.nan

    ahead = np.array([shift(float(one)) for one in wall.ravel()]).reshape(wall.shape)
    return np.asarray(wall - ahead)
