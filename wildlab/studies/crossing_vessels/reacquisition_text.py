"""What the report says of tracks that end between laps and are found again, as the numbers have it."""

from __future__ import annotations

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from wildlab.evaluation.runs import mean_share_interval
from wildlab.studies.crossing_vessels.text import beyond_chance, counted
from wildlab.studies.crossing_vessels.trial.crossing import TUNING
from wildlab.studies.crossing_vessels.trial.reacquisition import MAX_AGE_S, SURE, UNITS, WAYS

Array = NDArray[np.float64]
WITHOUT, WITH, GUESSED_WITHOUT, GUESSED_WITH = WAYS
NAMES = {
    WITHOUT: "distance alone",
    WITH: "distance and features",
    GUESSED_WITHOUT: "distance alone, guessed",
    GUESSED_WITH: "distance and features, guessed",
}
RIGHT, WRONG, MISSED, NEW = UNITS

EXPLAINED = (
    f"Here a track ends {MAX_AGE_S:g} s after its last detection, so that a vessel that comes back in the "
    "next lap begins a new one. What had ended is kept with its last state, the mean of its features and its "
    "identity (H 3.4.2), and a new track is compared with it: its place must be within reach at "
    f"{TUNING.max_speed:g} m/s, within a gate of {100 * -np.expm1(-TUNING.gate / 2):.0f} % of both places, "
    f"and with features their distance within {100 * TUNING.veto_probability:.1f} % of chi-square. How "
    "likely a kept track is follows from where the filter expects it by now and from its looks. Its identity "
    f"is taken where it is {SURE:g} times as likely as each other one; or else the track stays new, and with "
    "features is compared once more when it ends. Looks are drawn from the same images for all laps: a "
    "vessel that looks different from lap to lap may be found less often."
)


def shares(spread: pd.DataFrame, subject: str, name: str) -> Array:
    """(n,) of the tracks of each flight that could be found again or were, which share was; NaN for none.

    Tracks that are rightly new do not count.
    """
    parts = {one: spread[subject, one].to_numpy(float) for one in (RIGHT, WRONG, MISSED)}
    total = sum(parts.values())
    return np.where(total > 0, parts[name] / np.where(total > 0, total, 1.0), np.nan)


def share_words(values: Array) -> str:
    """A mean share over flights, with its 95 % interval where they differ.

    Examples
    --------
    >>> share_words(np.array([0.9, 1.0, 1.0]))
    '96.7 % (82.3 to 100.0 %)'
    >>> share_words(np.array([1.0, 1.0, 1.0]))
    '100.0 % on each of 3 flights'
    """
    known = values[np.isfinite(values)]
    if not len(known):
        return "none to find"
    if (known == known[0]).all():
        # Flights that are all alike have no spread to take an interval from.
        return f"{100 * known[0]:.1f} %" + (f" on each of {len(known)} flights" if len(known) > 1 else "")
    found = mean_share_interval(known)
    return f"{100 * found.estimate:.1f} % ({100 * found.low:.1f} to {100 * found.high:.1f} %)"


def again_table(spread: pd.DataFrame) -> pd.DataFrame:
    """One row for each way: shares of tracks, and flights, with intervals over flights."""
    rows = [
        {
            "way": words,
            **{name: share_words(shares(spread, subject, name)) for name in (RIGHT, WRONG, MISSED)},
            "none wrong": _flights(shares(spread, subject, WRONG), 0.0),
            "all right": _flights(shares(spread, subject, RIGHT), 1.0),
        }
        for subject, words in NAMES.items()
    ]
    return pd.DataFrame(rows)


def _flights(values: Array, wanted: float) -> str:
    """Of the flights that have a share, so many have this one."""
    known = values[np.isfinite(values)]
    return counted(int((known == wanted).sum()), len(known))


#: Headings of `again_table`.
AGAIN_COLUMNS = {
    "way": "found again by",
    RIGHT: "right",
    WRONG: "wrong",
    MISSED: "not at all",
    "none wrong": "flights with none wrong",
    "all right": "flights with all right",
}


def caption(spread: pd.DataFrame) -> str:
    """What the table counts, and of how many tracks."""
    of = sum(spread[WITH, name].to_numpy(float) for name in (RIGHT, WRONG, MISSED))
    new = {words: int(spread[subject, NEW].sum()) for subject, words in NAMES.items()}
    fresh = ", ".join(f"{words} {count}" for words, count in new.items() if count)
    return (
        f"Tracks that began when one of the same vessel was kept, or that took another's identity: "
        f"{np.median(of):.0f} on a flight, in the median, with features. A track is of the vessel that most "
        "of its detections are of. Shares are means over flights, with the 95 % interval of that mean; "
        "flights with Wilson's. Guessed: the likeliest is taken, however little it leads. Tracks rightly "
        f"taken for none, on all flights: {fresh or 'none'}."
    )


def again_words(spread: pd.DataFrame) -> str:
    """How many are found again, what looks add, and what is bought by not guessing."""
    right = {one: share_words(shares(spread, one, RIGHT)) for one in (WITHOUT, WITH)}
    return (
        "Of the tracks that a vessel begins when it comes back, so many get the identity that it had: by "
        f"distance alone {right[WITHOUT]}, with what the vessels look like {right[WITH]}. "
        f"{_looks_words(spread)} {_guess_words(spread)}"
    )


def _differ(spread: pd.DataFrame, subject: str, other: str, name: str) -> tuple[int, int, bool]:
    """On how many flights a share is larger, on how many smaller, and whether that is beyond chance."""
    one, two = (shares(spread, which, name) for which in (subject, other))
    more, fewer = int((one > two).sum()), int((one < two).sum())
    return more, fewer, beyond_chance(more, fewer)


def _looks_words(spread: pd.DataFrame) -> str:
    more, fewer, told = _differ(spread, WITH, WITHOUT, RIGHT)
    known = int(np.isfinite(shares(spread, WITH, RIGHT) - shares(spread, WITHOUT, RIGHT)).sum())
    if not known:
        return "On no flight is there anything to find again by both."
    counts = f"with features the share is larger on {more} of {known}, smaller on {fewer}"
    if not told:
        return f"Flight by flight {counts}, which chance may have done too."
    return f"Flight by flight {counts}: looks {'help' if more > fewer else 'do harm'}, beyond chance."


def _guess_words(spread: pd.DataFrame) -> str:
    """What is right and wrong where the likeliest is taken, however little it leads."""
    parts = []
    for words, careful, guessed in (
        ("By distance alone", WITHOUT, GUESSED_WITHOUT),
        ("With features", WITH, GUESSED_WITH),
    ):
        if not np.isfinite(shares(spread, guessed, RIGHT)).any():
            continue
        more, fewer, told = _differ(spread, guessed, careful, WRONG)
        wrong = {one: share_words(shares(spread, one, WRONG)) for one in (careful, guessed)}
        if told:
            how = f"{'more' if more > fewer else 'less'} is wrong, beyond chance"
        else:
            how = "that guessing makes more wrong cannot be told"
        parts.append(
            f"{words} a guess is right for {share_words(shares(spread, guessed, RIGHT))} and wrong for "
            f"{wrong[guessed]}; without guessing {wrong[careful]} are wrong: {how}."
        )
    return " ".join(["To guess is to take the likeliest, however little it leads.", *parts])
