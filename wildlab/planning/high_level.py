"""Search on, or go back to an animal that is known: the high-level planner of F 5.3.1.

It takes estimates as they are: positions (m, 2) north and east, m, and covariances (m, 2, 2), m^2, of the
animals that are known. The objective (5.2) is here, the rule by which an enclosure is done, and
both rules by which an animal that was known is lost.
"""

from __future__ import annotations

from itertools import permutations
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from wildlab.errors import WildlabError
from wildlab.geometry.frames import Array, Mask

#: What `best_goal` gives where the search for new animals is worth more: F's m + 1.
SEARCH = -1


def utilities(
    positions: ArrayLike,
    covariances: ArrayLike,
    platform: ArrayLike,
    way_point: ArrayLike | None,
    *,
    alpha: float,
    c: float,
) -> Array:
    """What each goal is worth for what it costs, F (5.2).

    The print's exponent of Tr(P) is not readable as anything but the design parameter that its text calls
    alpha, and its C is the text's c.

    Parameters
    ----------
    positions, covariances
        Of the animals that are known, (m, 2) m and (m, 2, 2) m^2.
    platform
        (2,) m.
    way_point
        (2,) the next one of the search, m; None where the search is over.
    alpha
        How much more an animal is worth that is known worse.
    c
        What the search is worth, in the unit of Tr(P)^alpha.

    Returns
    -------
    (m + 1,) the last one is that of the search; infinite for a goal that is reached, none for no way point.

    Examples
    --------
    >>> print(utilities([[30.0, 40.0]], [50 * np.eye(2)], [0.0, 0.0], [0.0, 10.0], alpha=1.0, c=30.0))
    [2. 3.]
    """
    at, here = np.asarray(positions, float).reshape(-1, 2), np.asarray(platform, float)
    spread = np.trace(np.asarray(covariances, float).reshape(-1, 2, 2), axis1=1, axis2=2) ** alpha
    with np.errstate(divide="ignore"):
        known = spread / np.hypot(*(at - here).T)
        if way_point is None:
            return np.append(known, -np.inf)
        return np.append(known, np.divide(c, np.hypot(*(np.asarray(way_point, float) - here))))


def best_goal(
    positions: ArrayLike,
    covariances: ArrayLike,
    platform: ArrayLike,
    way_point: ArrayLike | None,
    *,
    alpha: float,
    c: float,
) -> int:
    """Which animal to go back to, or `SEARCH`, by F (5.3): the greatest of `utilities` as things stand now.

    Parameters
    ----------
    positions, covariances, platform, way_point, alpha, c
        As `utilities` has them.

    Returns
    -------
    int

    Raises
    ------
    WildlabError
        Where there is neither an animal nor a way point.
    """
    worth = utilities(positions, covariances, platform, way_point, alpha=alpha, c=c)
    if worth.max() == -np.inf:
        raise WildlabError("there is no goal left", "end the search when all is done (all_positioned)")
    k = int(np.argmax(worth))
    return SEARCH if k == len(worth) - 1 else k


def all_positioned(known: ArrayLike, live: ArrayLike) -> Mask:
    """Which enclosures are done: as many animals are known at once as live there, F 5.3.

    Parameters
    ----------
    known
        (E,) animals with an estimate that is not lost.
    live
        (E,) that live there, which F takes as known.

    Returns
    -------
    (E,) bool; the search ends where all are.
    """
    return np.asarray(np.asarray(known) >= np.asarray(live))


def lost_by_covariance(covariances: ArrayLike, limit: float) -> Mask:
    """Which animals are lost because too little is known of them, F 5.3: Tr(P) beyond a limit.

    Parameters
    ----------
    covariances
        (m, 2, 2) m^2.
    limit
        Of the trace, m^2; F prints none.

    Returns
    -------
    (m,) bool.
    """
    P = np.asarray(covariances, float).reshape(-1, 2, 2)
    return np.asarray(np.trace(P, axis1=1, axis2=2) > limit)


def lost_by_search(missed: ArrayLike, doubt: float) -> Mask:
    """Which animals are lost because they were not where they should be, F 5.3.4.

    Parameters
    ----------
    missed
        (m,) probability that all images of the estimated position and what lies about it would have missed an
        animal that is there: the product of 1 - P_D (5.8) since it was last found.
    doubt
        Below this one no longer believes in it.

    Returns
    -------
    (m,) bool.
    """
    return np.asarray(np.asarray(missed, float) < doubt)


class Tour(NamedTuple):
    """A way to a number of goals.

    Attributes
    ----------
    path
        (T, 2) m.
    time
        s until the last goal was reached.
    order
        Goals in the order in which they were reached, `SEARCH` for the way point.
    broken_off
        How often it turned to another goal before the one it was flying to was reached: the zigzag of F
        figure 5.4.
    """

    path: Array
    time: float
    order: tuple[int, ...]
    broken_off: int


def greedy_tour(
    positions: ArrayLike,
    covariances: ArrayLike,
    platform: ArrayLike,
    way_point: ArrayLike,
    *,
    alpha: float,
    c: float,
    speed: float,
    walk: float,
    interval: float = 1.0,
    longest: float = 3600.0,
) -> Tour:
    """What comes of choosing anew by F (5.3) all the time, until each animal and the way point were visited.

    A goal that was reached is taken out: by the letter of (5.2) it would be worth more than all others for as
    long as the platform is there, and it would stay for good.

    Parameters
    ----------
    positions, covariances, platform, way_point, alpha, c
        As `utilities` has them. An animal that is reached counts as found where it was expected.
    speed
        Of the platform, m/s.
    walk
        By how much variances grow, each way, m^2/s.
    interval
        Between choices, s.
    longest
        After which it is given up, s.

    Returns
    -------
    Tour
        Its time is infinite where it was given up.
    """
    at = np.asarray(positions, float).reshape(-1, 2)
    P = np.array(covariances, float).reshape(-1, 2, 2)
    here, end = np.asarray(platform, float).copy(), np.asarray(way_point, float)
    path, order = [here.copy()], list[int]()
    time, broken_off, last = 0.0, 0, None
    while len(order) < len(at) + 1 and time < longest:
        there = np.array([one for one in range(len(at)) if one not in order], int)
        goal = best_goal(at[there], P[there], here, None if SEARCH in order else end, alpha=alpha, c=c)
        goal = SEARCH if goal == SEARCH else int(there[goal])
        broken_off += last is not None and goal != last
        aim = end if goal == SEARCH else at[goal]
        away = float(np.hypot(*(aim - here)))
        P += walk * interval * np.eye(2)
        if away <= speed * interval:
            here, last = aim.copy(), None
            time += away / speed
            order.append(goal)
        else:
            here += (aim - here) * (speed * interval / away)
            last, time = goal, time + interval
        path.append(here.copy())
    whole = len(order) == len(at) + 1
    return Tour(np.array(path), time if whole else np.inf, tuple(order), broken_off)


def shortest_tour(positions: ArrayLike, platform: ArrayLike, way_point: ArrayLike, speed: float) -> Tour:
    """The quickest way to the same goals, by trying all orders: what a look ahead would have done.

    Parameters
    ----------
    positions
        (m, 2) m, of no more than eight animals.
    platform, way_point
        (2,) m.
    speed
        m/s.

    Returns
    -------
    Tour

    Raises
    ------
    WildlabError
        Where there are more animals than can be tried.
    """
    at = np.asarray(positions, float).reshape(-1, 2)
    if len(at) > 8:
        raise WildlabError(f"{len(at)} animals have too many orders to try them all", "give eight at most")
    goals = np.concatenate([at, np.asarray(way_point, float)[None]])
    orders = np.array(list(permutations(range(len(goals)))))
    ways = np.concatenate(
        [np.broadcast_to(np.asarray(platform, float), (len(orders), 1, 2)), goals[orders]], axis=1
    )
    lengths = np.linalg.norm(np.diff(ways, axis=1), axis=-1).sum(axis=1)
    best = int(np.argmin(lengths))
    order = tuple(SEARCH if one == len(at) else int(one) for one in orders[best])
    return Tour(ways[best], float(lengths[best]) / speed, order, 0)
