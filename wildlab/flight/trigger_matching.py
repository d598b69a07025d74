"""Images and the records of their triggers: which belongs to which, by the pattern of their times."""

from __future__ import annotations

from bisect import bisect_left
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from wildlab.errors import WildlabError
from wildlab.flight.clock_fitting import fit_clock

Array = NDArray[np.float64]
Index = NDArray[np.intp]

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

    trigger: Index
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
    best: list[tuple[float, Index]] = []
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


def _settle(s: Array, t: Array, offset: float, near: float) -> tuple[float, Index]:
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


def _pair(at: Array, t: Array, near: float) -> Index:
    """Pairs (K, 2) in order of time, no further apart than `near`, most and nearest first."""
    low, high = np.searchsorted(t, at - near), np.searchsorted(t, at + near, side="right")
    # Best sums so far by the last trigger used: triggers and sums both rise along the lists.
    ends: list[int] = []
    sums: list[float] = []
    heads: list[int] = []
    chain: list[tuple[int, int, int]] = []
    for i in range(len(at)):
        new = []
        for j in range(int(low[i]), int(high[i])):
            before = bisect_left(ends, j) - 1
            worth = 2.0 - ((t[j] - at[i]) / near) ** 2 + (sums[before] if before >= 0 else 0.0)
            new.append((j, worth, heads[before] if before >= 0 else -1))
        for j, worth, head in new:
            place = bisect_left(ends, j)
            if place > 0 and sums[place - 1] >= worth:
                continue
            last = place
            while last < len(ends) and sums[last] <= worth:
                last += 1
            if place < len(ends) and ends[place] == j and sums[place] > worth:
                continue
            chain.append((i, j, head))
            ends[place:last] = [j]
            sums[place:last] = [worth]
            heads[place:last] = [len(chain) - 1]
    pairs = []
    head = heads[-1] if heads else -1
    while head >= 0:
        i, j, head = chain[head]
        pairs.append((i, j))
    return np.array(pairs[::-1], np.intp).reshape(-1, 2)
