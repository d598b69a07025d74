"""Places that are visited again and again, and areas that several aircraft share (F 5.2, 8.4)."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from wildlab.errors import WildlabError
from wildlab.geometry.frames import Array
from wildlab.planning.areas import check_area


class Call(NamedTuple):
    """A visit to a place.

    Attributes
    ----------
    place
        Its row.
    arrives
        When, s from the start.
    late
        How long after it was due, s; negative for early.
    """

    place: int
    arrives: float
    late: float


def border_course(corners: ArrayLike, start: ArrayLike | None = None) -> Array:
    """Once round a border, over the fence itself: what the camera shows lies on both sides of it.

    Parameters
    ----------
    corners
        (K, 2) metres, not closed.
    start
        (2,) metres: one begins at the corner nearest to it; None begins at the first.

    Returns
    -------
    (K + 1, 2) metres, closed

    Raises
    ------
    WildlabError
        Where the polygon is none.

    Examples
    --------
    >>> border_course([[0, 0], [10, 0], [10, 5]], start=[9, 6])[[0, -1]].tolist()
    [[10.0, 5.0], [10.0, 5.0]]
    """
    fence = check_area(corners)
    if start is not None:
        first = int(np.argmin(np.linalg.norm(fence - np.asarray(start, float), axis=1)))
        fence = np.roll(fence, -first, axis=0)
    return np.concatenate([fence, fence[:1]])


def plan_calls(
    places: ArrayLike, every: ArrayLike, start: ArrayLike, *, speed: float, stay: float, horizon: float
) -> list[Call]:
    """Visits to places of interest, each as often as is asked for where that can be.

    Next is the place that would be most overdue when one arrives, measured in its own interval: one that is
    asked for twice as often is visited about twice as often where there is not time for all. All are due for
    the first time when their interval has passed.

    Parameters
    ----------
    places
        (N, 2) metres.
    every
        (N,) how often each is asked for, s between visits.
    start
        (2,) where the aircraft is, metres.
    speed
        Over the ground, m/s.
    stay
        At each place, s.
    horizon
        How long to plan for, s.

    Returns
    -------
    list of Call
        In order; empty where there is no place.

    Raises
    ------
    WildlabError
        Where intervals and places do not go together, or speed or intervals are not above zero.
    """
    at, wanted = np.reshape(np.asarray(places, float), (-1, 2)), np.asarray(every, float).ravel()
    if len(wanted) != len(at):
        raise WildlabError(
            f"{len(wanted)} intervals for {len(at)} places", "give one for each place", field="every"
        )
    if not (speed > 0 and stay >= 0 and (wanted > 0).all()):
        raise WildlabError(
            f"a speed of {speed:g} m/s, a stay of {stay:g} s, intervals from {wanted.min(initial=0):g} s",
            "give numbers above zero",
            field="every",
        )
    here, now, last = np.asarray(start, float), 0.0, np.zeros(len(at))
    calls: list[Call] = []
    previous = -1
    while len(at):
        arrival = now + np.linalg.norm(at - here, axis=1) / speed
        overdue = (arrival - last) / wanted
        if len(at) > 1 and previous >= 0:
            overdue[previous] = -np.inf  # one that was just left is not gone back to
        one = int(np.argmax(overdue))
        when = max(float(arrival[one]), now)
        if when > horizon or (len(at) == 1 and calls and stay <= 0):
            break
        calls.append(Call(one, when, float(when - last[one] - wanted[one])))
        here, now, last[one], previous = at[one], when + stay, when, one
    return calls


def longest_gaps(calls: Sequence[Call], places: int, horizon: float) -> Array:
    """The longest time between two visits to each place, or from the start, or to the end.

    Parameters
    ----------
    calls
        In order.
    places
        How many there are.
    horizon
        The end, s.

    Returns
    -------
    (N,) s
    """
    gaps = np.zeros(places)
    for place in range(places):
        times = [0.0, *(one.arrives for one in calls if one.place == place), horizon]
        gaps[place] = float(np.diff(times).max())
    return gaps


def share_rows(rows: ArrayLike, aircraft: int) -> NDArray[np.intp]:
    """Rows of a pattern for several aircraft: neighbours stay together, and the longest part is shortest.

    Parameters
    ----------
    rows
        (R, 2, 2) metres, in the order flown.
    aircraft
        How many.

    Returns
    -------
    (R,) whose each row is, from 0, never falling

    Raises
    ------
    WildlabError
        Where there is no aircraft.

    Examples
    --------
    >>> share_rows([[[0, 0], [9, 0]], [[9, 1], [0, 1]], [[0, 2], [9, 2]], [[9, 3], [0, 3]]], 2).tolist()
    [0, 0, 1, 1]
    """
    if aircraft < 1:
        raise WildlabError(f"{aircraft} aircraft", "give one at least", field="aircraft")
    ends = np.reshape(np.asarray(rows, float), (-1, 2, 2))
    if not len(ends):
        return np.zeros(0, np.intp)
    own = np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1)
    between = np.append(np.linalg.norm(ends[1:, 0] - ends[:-1, 1], axis=1), 0.0)

    def cut(most: float) -> NDArray[np.intp]:
        """The fewest parts none of which is longer than ``most``."""
        whose, length = np.zeros(len(own), np.intp), own[0]
        for row in range(1, len(own)):
            length += between[row - 1] + own[row]
            whose[row] = whose[row - 1]
            if length > most:
                whose[row], length = whose[row] + 1, own[row]
        return whose

    low, high = float(own.max()), float(own.sum() + between.sum())
    for _ in range(60):
        middle = (low + high) / 2
        low, high = (low, middle) if cut(middle)[-1] < aircraft else (middle, high)
    return cut(high * (1 + 1e-12))
