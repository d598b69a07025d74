"""The claims of H 6.4.1 on a ship that does not fit into the image, held against what the flights give."""

from __future__ import annotations

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from wildlab.evaluation.shares import Check
from wildlab.studies.large_ship.trial import DETECTOR, NEAR_M, SUBJECTS, WITH, WITHOUT

Array = NDArray[np.float64]


def scatter_left(spread: pd.DataFrame) -> Array:
    """What true poses would leave of a flight's scatter, (flights,): the larger of both kinds of centres.

    Parameters
    ----------
    spread
        What `trial` gives, one row for each flight.
    """
    with np.errstate(divide="ignore", invalid="ignore"):
        left = [
            spread[who, "sd_true_poses"].to_numpy(float) / spread[who, "sd_both"].to_numpy(float)
            for who in SUBJECTS
        ]
    return np.asarray(np.max(left, axis=0))


def check_claims(spread: pd.DataFrame) -> dict[str, Check]:
    """What the flights give for each claim of H 6.4.1, by the claim's id.

    Parameters
    ----------
    spread
        What `trial` gives, one row for each flight.
    """

    def both(name: str) -> tuple[Array, Array]:
        return spread[WITH, name].to_numpy(float), spread[WITHOUT, name].to_numpy(float)

    def of(name: str) -> Array:
        return spread[DETECTOR, name].to_numpy(float)

    north, east = both("sd_north"), both("sd_east")
    shares = {float(limit): both(f"share_near_{limit}") for limit in NEAR_M}
    near, far = shares[NEAR_M[1]]
    rest, rest_without = (np.nan_to_num(times, nan=np.inf) for times in both("time_to_rest"))
    known = np.isfinite(rest) | np.isfinite(rest_without)
    logged = [np.hypot(*pair) for pair in zip(north, east, strict=True)]
    return {
        "mean-nearer": Check.smaller(*both("error_of_mean"), "m"),
        "variance-increases": Check(
            true=(north[0] > north[1]) & (east[0] > east[1]), first=logged[0], second=logged[1], unit="m"
        ),
        "more-near-centre": Check(
            by_threshold={limit: one > other for limit, (one, other) in shares.items()},
            first=near,
            second=far,
        ),
        "mostly-a-part": Check(true=of("share_cut") > 0.5),
        "not-every-image-adjusted": Check(true=of("share_moved") < 1.0),
        "more-accurate-after-start": Check.smaller(*both("mae_after_start"), "m"),
        "within-five-metres": Check(true=of("share_within_5_m") > 0.5),
        "rest-sooner": Check(true=rest < rest_without, premise=known),
        "speed-near-zero": Check(measured=np.max(both("speed_after_start"), axis=0)),
        "mainly-navigation": Check(measured=scatter_left(spread), reach=(0, 1)),
        "high-success-rate": Check(measured=1 - of("detection_rate")),
    }
