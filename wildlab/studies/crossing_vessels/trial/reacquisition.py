"""Tracks that end between two laps: which of them are found again as what they were, H 3.4.2.

A vessel is in view for some seconds of each lap. Where its track ends before it comes back, the next one is a
new track of the same vessel, and is to have the same identity.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from wildlab.tracking.many import appearance as rules
from wildlab.tracking.many.appearance import Appearance
from wildlab.tracking.many.bank import Bank, Life, Looks, Tuning, run_bank

Index = NDArray[np.int64]
#: A track ends so long after its last detection, s: longer than nearly all pauses while a vessel is in view,
#: shorter than those between laps. Chosen.
MAX_AGE_S = 10.0
#: By so much must a kept track be likelier than the others; and so little is hardly more than none. Chosen.
SURE, GUESS = 19.0, 1.0 + 1e-6


class ReacquisitionRule(NamedTuple):
    """How tracks are found again: by which rule, and by which ratio of likelihoods."""

    rule: str
    likelier: float


#: By distance alone and with looks; where it is no guess, and whichever is the likeliest.
WAYS = {
    "again-without-features": ReacquisitionRule(rules.DISTANCE, SURE),
    "again-with-features": ReacquisitionRule(rules.FEATURES, SURE),
    "again-guessed-without-features": ReacquisitionRule(rules.DISTANCE, GUESS),
    "again-guessed-with-features": ReacquisitionRule(rules.FEATURES, GUESS),
}
#: Names of the numbers that are recorded, and their units: tracks, by `Outcome`.
UNITS = {"found_right": "1", "found_wrong": "1", "not_found": "1", "rightly_new": "1"}


class Outcome(NamedTuple):
    """Tracks that began when others had ended.

    Attributes
    ----------
    right, wrong
        Those taken for a track of the same vessel, and of the other one.
    missed
        Those taken for none, although one of the same vessel was kept.
    new
        Those taken for none where none of the same vessel was kept.
    """

    right: int
    wrong: int
    missed: int
    new: int


def owners(boat: Index, track: Index, count: int) -> Index:
    """(T,) whose each track is: of whom most of its detections are, of the first one's where as many.

    Parameters
    ----------
    boat
        (D,) whose each detection is, 0 or 1.
    track
        (D,) the track of each; -1 where it has none.
    count
        Of tracks, each with a detection.

    Examples
    --------
    >>> owners(np.array([1, 0, 0, 1, 0]), np.array([0, 0, 1, 1, 1]), 2).tolist()
    [1, 0]
    """
    found = np.zeros(count, np.int64)
    for number in range(count):
        own = boat[track == number]
        share = own.mean()
        found[number] = own[0] if share == 0.5 else share > 0.5
    return found


def outcome(image: Index, boat: Index, bank: Bank) -> Outcome:
    """How tracks that began when others had ended were taken.

    Parameters
    ----------
    image, boat
        (D,) the image of each detection, and whose it is.
    bank
        Of these detections.
    """
    count = len(bank.started)
    owner = owners(boat, bank.track, count)
    of = [image[bank.track == number] for number in range(count)]
    right, wrong, missed, new = 0, 0, 0, 0
    left = np.ones(count, bool)
    for number in range(count):
        before = np.arange(number)
        same = before[bank.identity[before] == bank.identity[number]]
        kept = [one for one in before[left[before]] if bank.ended[one] >= 0 and of[one][-1] < of[number][0]]
        if len(same):
            left[same[-1]] = False
            right += owner[same[-1]] == owner[number]
            wrong += owner[same[-1]] != owner[number]
        elif kept:
            own = (owner[kept] == owner[number]).any()
            missed, new = missed + int(own), new + int(not own)
    return Outcome(int(right), int(wrong), missed, new)


def again_numbers(
    looks: Looks, boat: Index, appearance: Appearance, tuning: Tuning
) -> dict[tuple[str, str], float]:
    """What `UNITS` names of a flight, by each of `WAYS`.

    Parameters
    ----------
    looks, boat
        All detections, and whose each is.
    appearance
        What they look like.
    tuning
        Of filters and gates; here its tracks end.
    """
    numbers: dict[tuple[str, str], float] = {}
    for subject, way in WAYS.items():
        life = Life(max_age=MAX_AGE_S, likelier=way.likelier)
        bank = run_bank(looks, tuning._replace(life=life), way.rule, appearance)
        found = outcome(looks.image, boat, bank)
        numbers |= {(subject, name): float(one) for name, one in zip(UNITS, found, strict=True)}
    return numbers
