"""Words and tables of the reports that set the extended against the Schmidt-Kalman filter."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike

WORDS = {
    "ekf": "Extended",
    "schmidt": "Schmidt",
    "schmidt-navigated": "Schmidt, error renewed",
    "inflation": "Inflated noise",
    "schmidt-attitude-only": "Schmidt, attitude only",
    "schmidt-position-only": "Schmidt, position only",
    "ekf-60-pixels": "Extended, 60 px",
}
OTHER_WORDS = {"ukf": "Unscented", "imm": "Two motion models (IMM)"}
#: The quantities of H tables 7.5 to 7.7.
QUANTITIES = {
    "mean_north": "mean north (m)",
    "mean_east": "mean east (m)",
    "mae": "mean error (m)",
    "nees": "mean NEES",
    "nis": "mean NIS",
}
COLUMNS = {
    "filter": "filter",
    "inside": "flights within (%)",
    "nees": "NEES",
    "nees_predicted": "NEES, pauses",
    "nis": "NIS",
    "mae": "mean error (m)",
    "rmse_speed": "speed, RMS (m/s)",
    "rmse_course": "course, RMS (°)",
}
DIGITS = {"inside": 0, "nees": 1, "nees_predicted": 1, "nis": 2, "mae": 1, "rmse_speed": 2, "rmse_course": 1}

METHOD = r"""Both filters have the constant-velocity model of H (6.1) and (6.2) with $\sigma_v = 0.05\
\mathrm{m/s^2}$, start at rest on the first georeferenced detection with 10 m and 10 m/s, and take pixels
with a noise of 30 pixels: the tuning of H 7.5.3, for all three flights. They step to every image, whether
it shows the target or not.

The poses are an MEKF's (H 7.3) on simulated inertial samples and two antennas. The extended filter (H 6.3)
takes them for true. The Schmidt-Kalman filter (H 7.4) keeps the cross-covariance of the target with the
errors of the pose and does not estimate these. As (7.32) stands, the joint covariance stops being one where
the pose's covariance shrinks; here the cross-covariance is then scaled along, which keeps the thesis's
constant bias, counted in standard deviations.

NEES and mean errors are those at every image from the first to the last detection, also between
measurements; errors are truth minus estimate. The course counts where the true speed is above 0.2 m/s."""


def times_too_small(nees: float) -> str:
    """How far off a filter is for what it says, from its mean NEES with two degrees of freedom."""
    return f"{np.sqrt(nees / 2):.1f} times"


def medians_table(spread: pd.DataFrame, share: Mapping[str, float]) -> pd.DataFrame:
    """Medians over flights, a row for each filter of `WORDS`, with the share of flights within the bounds."""
    names = [name for name in COLUMNS if name not in ("filter", "inside")]
    return pd.DataFrame(
        [
            {"filter": words, "inside": 100 * share[who]}
            | {name: float(spread[who, name].median()) for name in names}
            for who, words in WORDS.items()
        ]
    )


def pose_sd_words(covariance: ArrayLike) -> str:
    """The mean standard deviations that poses (N, 6, 6) state, in words."""
    sd = np.nanmean(np.sqrt(np.diagonal(np.asarray(covariance, float), axis1=1, axis2=2)), axis=0)
    where = ", ".join(f"{100 * one:.0f}" for one in sd[:3])
    angles = ", ".join(f"{np.degrees(one):.1f}" for one in sd[3:])
    return f"{where} cm (north, east, down) and {angles}° (roll, pitch, yaw)"
