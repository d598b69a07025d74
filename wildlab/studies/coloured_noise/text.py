"""The words of the report on noise that is correlated in time, each from the numbers it states."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import pandas as pd

from wildlab.studies.track_text import accuracy_words, claim_words, stated_words, typical_words


def summary(spread: pd.DataFrame, claims: Mapping[str, Mapping[str, Any]]) -> list[str]:
    """What came out, in three sentences.

    Parameters
    ----------
    spread
        What the trial gives, one row for each flight, the drawn one first.
    claims
        Verdicts by the claim's id, as ``metrics.json`` has them.

    Returns
    -------
    list of str
    """
    n, middle = len(spread), spread.median()

    def said(claim: str) -> str:
        return claim_words(claims[claim]["verdict"], claims[claim]["fraction"], n)

    mae = pd.DataFrame({who: spread[who, "mae"] for who in ("cv", "coloured")})
    price = accuracy_words({"cv": "the benchmark", "coloured": "differencing"}, mae)
    singer = pd.DataFrame({who: spread[who, "mae"] for who in ("cv", "singer")})
    gain = accuracy_words({"cv": "the benchmark", "singer": "Singer's model"}, singer)
    return [
        "A filter that is told nothing of errors that last is off by "
        f"{middle['cv', 'mae']:.1f} m on average, and its errors are {stated_words(middle['cv', 'nees'])}; "
        f"with differenced measurements it is {middle['coloured', 'mae']:.1f} m, and they are "
        f"{stated_words(middle['coloured', 'nees'])}. The mean NEES of the latter is within the band of a "
        f"mean {said('differencing-consistent')}.",
        f"Of the benchmark and differencing, {price}.",
        f"Of the benchmark and Singer's model, {gain}.",
    ]


def correlation_words(lag: Mapping[str, float]) -> str:
    """The larger of the two autocorrelations at lag one, without and with differencing: ``lag`` by filter."""
    before, after = lag["cv"], lag["coloured"]
    change = f"{before / after:.1f} times less" if after < before else "no less"
    return (
        f"At lag one the larger of the two autocorrelations is {before:.2f} with constant velocity and "
        f"{after:.2f} with differenced measurements, {change} (medians of magnitudes)."
    )


def drawn_words(spread: pd.DataFrame) -> str:
    """How typical the flight of the figures is, by the benchmark's mean error."""
    return f"In the benchmark's mean error the flight of the figures is {typical_words(spread['cv', 'mae'])}."
