"""The first words of a report on navigation, each from the numbers it states."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import pandas as pd

from wildlab.analysis.navigation_errors import AXES
from wildlab.analysis.overviews.verdict import Evidence, Verdict, verdict_of

#: A difference that is so many times what the filter states is more than it can answer for.
TOO_SURE = 2.0
#: The height that errors of roll and pitch are spread out from, m.
HEIGHT = 300.0


def middle_flight(spread: pd.DataFrame) -> dict[str, float]:
    """Medians over flights of the filter's numbers: what is said first holds for the middle one of many.

    Parameters
    ----------
    spread
        One row for each flight; columns are (subject, name).

    Returns
    -------
    dict
        Of the subject ``mekf``, by name.
    """
    columns: list[Any] = list(spread)
    names = [name for who, name in columns if who == "mekf"]
    return {name: float(spread["mekf", name].median()) for name in names}


def summary(
    found: Mapping[str, float],
    part: str,
    true: bool,
    flights: int = 1,
    receiver: Mapping[str, float] | None = None,
) -> tuple[list[str], Verdict, str]:
    """Sentences on how far off the filter's attitude is, the verdict, and its reason.

    Parameters
    ----------
    found
        ``rms_...`` and ``mean_sd_...`` of each axis, degrees.
    part
        Of the flight, in words.
    true
        Whether it is held against the truth, or against another estimate.
    flights
        Of how many ``found`` are the medians.
    receiver
        As ``found``, with the receiver's noise that was found on the flight; None where none was.

    Returns
    -------
    list of str, Verdict, str
        Of many flights there is no reason: what they come to is how they stand to the printed numbers.
    """
    off, stated = _off_and_stated(found)
    aside = HEIGHT * np.radians(np.hypot(found["rms_roll"], found["rms_pitch"]))
    too_sure = off > TOO_SURE * stated
    if true:
        last = "The filter says how sure it is, and that can be checked; the observer does not say."
    elif too_sure:
        last = "The filter is surer of itself than this difference allows. Neither of the two is the truth."
    else:
        last = "Neither of the two is the truth: what both get wrong in the same way goes unseen."
    other = []
    if receiver is not None:
        beside = _off_and_stated(receiver)
        other = [
            f"With the receiver's noise found on this flight it is {beside[0]:.2f} degrees, and by its own "
            f"account {beside[1]:.2f}."
        ]
    sentences = [
        f"The filter's attitude is {off:.2f} degrees from "
        f"{'the truth' if true else 'the one found on board'}, all three axes together, {part}"
        f"{_over(flights)}; by its own account it would be {stated:.2f}.",
        *other,
        f"Seen straight down from {HEIGHT:.0f} metres, its differences in roll and pitch move a point by "
        f"{aside:.1f} metres.",
        last,
    ]
    if flights > 1:
        return sentences, Verdict.UNJUDGED, ""
    against = "the truth" if true else "the attitude found on board"
    reason = f"From {against} it differs by {off / stated:.1f} times what it states."
    # What is told apart here is no test: up to twice what is stated, one flight does not show it wrong.
    return sentences, verdict_of(Evidence(troubled=int(too_sure))), reason


def _off_and_stated(found: Mapping[str, float]) -> tuple[float, float]:
    """RMS and stated deviation of all three axes together, degrees."""
    rms, sd = (float(np.linalg.norm([found[f"{of}_{axis}"] for axis in AXES])) for of in ("rms", "mean_sd"))
    return rms, sd


def tiles(found: Mapping[str, float], true: bool, flights: int = 1) -> list[tuple[str, str]]:
    """A tile for each axis: the RMS, and what the filter states; parameters as for `summary`."""
    decimals, what = (2, "error") if true else (1, "difference")
    return [
        (
            f"{found[f'rms_{axis}']:.{decimals}f}°",
            f"RMS {axis} {what} of the filter; it states {found[f'mean_sd_{axis}']:.{decimals}f}°"
            f"{_over(flights)}",
        )
        for axis in AXES
    ]


def _over(flights: int) -> str:
    return f", median of {flights} flights" if flights > 1 else ""
