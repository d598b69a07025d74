"""What the reports on the extended and the Schmidt-Kalman filter say, as the computed numbers have it."""

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


def variant_points(spread: pd.DataFrame, share: Mapping[str, float]) -> list[str]:
    """What the variants come to, a sentence each, from numbers over flights and shares within the bounds."""
    closer = spread["ekf", "mae"] - spread["schmidt", "mae"]
    return [
        f"On average the Schmidt filter's mean error is {abs(closer.mean()):.1f} m "
        f"{'smaller' if closer.mean() > 0 else 'larger'} than the extended filter's; it is smaller on "
        f"{100 * (closer > 0).mean():.0f} % of the flights.",
        f"With the uncertainty in attitude alone {100 * share['schmidt-attitude-only']:.0f} % of the "
        "flights are within the bounds, with that in position alone "
        f"{100 * share['schmidt-position-only']:.0f} %.",
        "Inflation adds the pose's uncertainty to each image's noise, as if it were new in each (H "
        f"7.40, 7.41): {100 * share['inflation']:.0f} %.",
        "With 60 instead of 30 pixels of noise the extended filter is within on "
        f"{100 * share['ekf-60-pixels']:.0f} %.",
        "If what the navigation filter corrects counts as gone, rather than as a constant bias of a "
        f"new size, the Schmidt filter is within on {100 * share['schmidt-navigated']:.0f} %.",
    ]


def limits_of(covariance: ArrayLike) -> list[str]:
    """What such a report does not tell; ``covariance`` (N, 6, 6) of the poses of the flight drawn."""
    return [
        "The flight of the thesis was never published; this one is like it in everything that is "
        "printed, and chosen in the rest.",
        "The truth is a single-frequency GPS receiver on the vessel; its own error of some metres "
        "counts as the filter's.",
        "The covariance of the poses comes from an MEKF with a tuning that meets the mean deviations "
        "printed in H 7.5.3, not from a data sheet. On this flight they are "
        f"{pose_sd_words(covariance)}. "
        "With another covariance the NEES would be another.",
        "The time average of NEES is compared with the bounds of a single value, as the thesis does. "
        "Neighbouring values share their error, so an average over one flight is worth few "
        "independent ones.",
        "False alarms and other vessels are left out, as in the thesis.",
    ]
