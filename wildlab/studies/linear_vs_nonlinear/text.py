"""The words of the report on tracking on the ground and in the image, each from the numbers it states."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import pandas as pd

from wildlab.studies.linear_vs_nonlinear.trial import PUBLISHED
from wildlab.studies.track_text import accuracy_words, claim_words, surprise_words, typical_words


def summary(spread: pd.DataFrame, claims: Mapping[str, Mapping[str, Any]], vessel: str) -> list[str]:
    """What came out, in three sentences.

    Parameters
    ----------
    spread
        What `trial.numbers_of` gives, one row for each flight, the drawn one first.
    claims
        Verdicts by the claim's id, as ``metrics.json`` has them.
    vessel
        What was tracked: "fast".

    Returns
    -------
    list of str
    """
    n, middle = len(spread), spread.median()
    kf, ekf = (middle[who, "mae"] for who in PUBLISHED)
    mae = pd.DataFrame({who: spread[who, "mae"] for who in PUBLISHED})
    nearer = accuracy_words({"kf": "The linear filter", "ekf": "The extended filter"}, mae)
    similar = claims["kf-ekf-similar"]
    alike = claim_words(similar["verdict"], similar["fraction"], n)
    over = "on one flight" if n == 1 else f"in the middle of {n} flights"
    return [
        f"Tracked on the ground, a {vessel} vessel is found {kf:.1f} metres from where it is on average, "
        f"tracked in the image {ekf:.1f} metres ({over}).",
        f"{nearer}. That the two are equally accurate is so {alike}.",
        "Of the linear filter "
        + surprise_words(middle["kf", "nees"], middle["kf", "nis"])
        + "; of the extended filter "
        + surprise_words(middle["ekf", "nees"], middle["ekf", "nis"])
        + ".",
    ]


def drawn_words(spread: pd.DataFrame) -> str:
    """How typical the flight of the figures is, by its linear filter's mean error."""
    said = typical_words(spread["kf", "mae"])
    return f"In the linear filter's mean error the flight of the figures is {said}."


def unscented_words(spread: pd.DataFrame) -> str:
    """What linearising the camera costs: the unscented beside the extended filter."""
    apart = spread["ukf", "mae"] - spread["ekf", "mae"]

    def metres(value: float) -> str:
        shown = f"{value:+.2f}"
        return "0.00" if float(shown) == 0 else shown.replace("-", "−")

    between = ""
    if len(apart) > 1:
        low, high = metres(apart.min()), metres(apart.max())
        between = f" in the middle, {low} to {high} m over {len(apart)} flights"
    return (
        "An unscented filter has no Jacobian. Its mean error less the extended filter's is "
        f"{metres(apart.median())} m{between}: that is what linearising the camera costs."
    )
