"""How well tracks know animals that are out of sight, and what became of animals that came back into it."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from wildlab.analysis.animals.follow import Found, Known
from wildlab.analysis.animals.revisit import Patrolled
from wildlab.geometry.frames import Array
from wildlab.geometry.quantiles import chi2_quantile
from wildlab.planning.high_level import SEARCH

#: An animal is out of sight once it has not been detected for so long, s. Chosen.
OUT_OF_SIGHT = 30.0


class OutOfSight(NamedTuple):
    """Animals with a track at a time when they were not detected for a while; N of them, at all stations.

    Attributes
    ----------
    off
        (N, 2) m, the track's mean from the animal.
    covariance
        (N, 2, 2) m^2, the track's.
    own
        (N,) bool: whether the track had not been given another animal's detection by then.
    """

    off: Array
    covariance: Array
    own: NDArray[np.bool_]

    @property
    def nees(self) -> Array:
        """(N,) squared distances in units of the covariance; 2 on average where it is right."""
        solved = np.linalg.solve(self.covariance, self.off[..., None])[..., 0]
        return np.asarray(np.einsum("ni,ni->n", self.off, solved))


def out_of_sight(
    known: list[Known], found: list[Found], times: Array, truth: Array, until: ArrayLike = np.inf
) -> OutOfSight:
    """Where tracks are and animals are, once these were not detected for `OUT_OF_SIGHT`.

    An animal's track is the one that its latest detection was given to.

    Parameters
    ----------
    known, found
        Of the tracks.
    times, truth
        (T,) s and (T, A, 2) m.
    until
        (A,) s up to when an animal counts, or one time for all.

    Returns
    -------
    OutOfSight
    """
    animals = truth.shape[1]
    counts = np.broadcast_to(np.asarray(until, float), animals)
    own, seen_at = np.zeros(animals, np.int64), np.full(animals, np.inf)
    off, covariance, pure, row = list[Array](), list[Array](), list[bool](), 0
    first, mixed = dict[int, int](), set[int]()
    for one in known:
        while row < len(found) and found[row].image <= one.image:
            if first.setdefault(found[row].track, found[row].animal) != found[row].animal:
                mixed.add(found[row].track)
            if found[row].animal >= 0:
                own[found[row].animal], seen_at[found[row].animal] = found[row].track, times[found[row].image]
            row += 1
        at = {int(name): k for k, name in enumerate(one.identity)}
        time = times[one.image]
        for animal in np.flatnonzero((time - seen_at > OUT_OF_SIGHT) & (time <= counts)):
            k = at.get(int(own[animal]))
            if k is not None:
                off.append(one.mean[k] - truth[one.image, animal])
                covariance.append(one.covariance[k])
                pure.append(int(own[animal]) not in mixed)
    return OutOfSight(
        np.array(off).reshape(-1, 2), np.array(covariance).reshape(-1, 2, 2), np.array(pure, bool)
    )  # fmt: skip


def sight_numbers(away: OutOfSight) -> dict[str, float]:
    """How well animals out of sight are known, by name; NaN where there was none.

    ``rmse`` and ``sd`` in m (`sd` for one axis), ``anees``, ``beyond``: the share outside the ellipse that
    should hold 95 %; the same of tracks of one animal alone, ``own``, and the share of these.
    """
    names = ("rmse", "sd", "anees", "beyond", "rmse_own", "anees_own", "own_share")
    if not len(away.off):
        return dict.fromkeys(names, np.nan)
    squares, mine, nees = (away.off**2).sum(axis=1), away.own, away.nees
    trace = np.trace(away.covariance, axis1=1, axis2=2)
    return {
        "rmse": float(np.sqrt(squares.mean())),
        "sd": float(np.sqrt(trace.mean() / 2)),
        "anees": float(nees.mean()),
        "beyond": float((nees > chi2_quantile(0.95, 2)).mean()),
        "rmse_own": float(np.sqrt(squares[mine].mean())) if mine.any() else np.nan,
        "anees_own": float(nees[mine].mean()) if mine.any() else np.nan,
        "own_share": float(mine.mean()),
    }


def next_lap(found: list[Found], times: Array, lap: float) -> list[Found]:
    """Of each animal that was detected in the first lap, its first detection in the second."""
    seen: set[int] = set()
    back: dict[int, Found] = {}
    for one in found:
        if times[one.image] < lap:
            seen.add(one.animal)
        elif one.animal in seen:
            back.setdefault(one.animal, one)
    return [one for animal, one in sorted(back.items()) if animal >= 0]


def found_on_visits(flown: Patrolled) -> list[Found]:
    """Detections that gave an animal's track back to it while that track was flown to."""
    return [
        one for one in flown.found
        if flown.goal[one.image] == one.track == one.own and OUT_OF_SIGHT < one.away < np.inf
    ]  # fmt: skip


def turns(flown: Patrolled) -> int:
    """How often a search turned to a track, from its rows or from another track."""
    goal = np.append(SEARCH, flown.goal)
    return int(((goal[1:] != goal[:-1]) & (goal[1:] != SEARCH)).sum())
