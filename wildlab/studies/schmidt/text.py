"""What the reports on the extended and the Schmidt-Kalman filter say, as the computed numbers have it."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import pandas as pd

from wildlab.evaluation.consistency import share_inside
from wildlab.studies.schmidt.trial import BOUNDS, PUBLISHED
from wildlab.studies.track_text import accuracy_words, typical_words

WORDS = {
    "ekf": "Extended",
    "schmidt": "Schmidt",
    "schmidt-data-sheet": "Schmidt, data sheets",
    "schmidt-estimated": "Schmidt, calibrated",
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
    "inside": "in the lenient band (%)",
    "nees": "NEES",
    "nees_predicted": "NEES, pauses",
    "nis": "NIS",
    "mae": "mean error (m)",
    "rmse_speed": "speed, RMS (m/s)",
    "rmse_course": "course, RMS (°)",
}
DIGITS = {"inside": 0, "nees": 1, "nees_predicted": 1, "nis": 2, "mae": 1, "rmse_speed": 2, "rmse_course": 1}
TYPICAL_COLUMNS = {
    "shown": "what",
    "here": "this flight",
    "median": "median of the flights",
    "typical": "is it typical?",
}

METHOD = r"""Both filters have the constant-velocity model of H (6.1) and (6.2) with $\sigma_v = 0.05\
\mathrm{m/s^2}$, start at rest on the first georeferenced detection with 10 m and 10 m/s, and take pixels
with a noise of 30 pixels: the tuning of H 7.5.3, for all three flights. They step to every image, whether
it shows the target or not.

The poses are an MEKF's (H 7.3) on simulated inertial samples and two antennas. The extended filter (H 6.3)
takes them for true. The Schmidt-Kalman filter (H 7.4) keeps the cross-covariance of the target with the
errors of the pose and does not estimate these. As (7.32) stands, the joint covariance stops being one where
the pose's covariance shrinks; here the cross-covariance is then scaled along, which keeps the thesis's
constant bias, counted in standard deviations.

The first pose covariance is that of an MEKF whose noise was chosen so that its mean standard deviations are
those that H prints for the first flight. The second is that of an MEKF given all that the data sheets state
of inertial sensor and receivers: white noise, biases, axes that are off, and the part of GNSS errors that
wanders. The third is constant: the standard deviations under which the errors
of the known target on another flight are most likely, one image a second, with a prior a factor of three wide
about the first.

NEES and mean errors are those at every image from the first to the last detection, also between
measurements; errors are truth minus estimate. Whether a filter is consistent is tested with one value of each
flight, at a moment drawn once for all filters: these are independent, and their mean over N flights has the
interval of H example 3.1 for N runs. Average NEES of single flights, in the claims, are held against the
interval for as many independent values as they are worth: their number over one plus twice the sum of their
autocorrelations. The lenient band is for an average of one flight within the interval of single values,
which an average leaves far less often than 5 % of the time. The course counts where the true speed is above
0.2 m/s."""


def part_of(columns: Mapping[str, str], *names: str, kept: bool = True) -> dict[str, str]:
    """Those columns of a table that are named, or those that are not."""
    return {name: heading for name, heading in columns.items() if (name in names) == kept}


def medians_table(spread: pd.DataFrame) -> pd.DataFrame:
    """Medians over flights, a row for each filter of `WORDS`, with the share of flights within the bounds."""
    names = [name for name in COLUMNS if name not in ("filter", "inside")]
    return pd.DataFrame(
        [
            {"filter": words, "inside": 100 * share_inside(spread[who, "nees"], BOUNDS)}
            | {name: float(spread[who, name].median()) for name in names}
            for who, words in WORDS.items()
        ]
    )


def variant_points(spread: pd.DataFrame) -> list[str]:
    """What the variants come to, a sentence each."""
    share = {who: 100 * share_inside(spread[who, "nees"], BOUNDS) for who in WORDS}
    mae = pd.DataFrame({who: spread[who, "mae"] for who in PUBLISHED})
    both = {who: f"the {WORDS[who]} filter" for who in PUBLISHED}
    nearer = accuracy_words(both | {"ekf": "the extended filter"}, mae)
    return [
        f"{nearer[0].upper()}{nearer[1:]}.",
        f"With the uncertainty in attitude alone {share['schmidt-attitude-only']:.0f} % of the flights pass "
        "the lenient band, with that in position alone "
        f"{share['schmidt-position-only']:.0f} %.",
        "Inflation adds the pose's uncertainty to each image's noise, as if it were new in each (H "
        f"7.40, 7.41): {share['inflation']:.0f} %.",
        "With 60 instead of 30 pixels of noise the extended filter passes on "
        f"{share['ekf-60-pixels']:.0f} %.",
        "If what the navigation filter corrects counts as gone, rather than as a constant bias of a "
        f"new size, the Schmidt filter passes on {share['schmidt-navigated']:.0f} %.",
    ]


#: What the figures of the flight drawn show: words, subject, name, decimals, unit.
DRAWN = (
    ("mean error, extended", "ekf", "mae", 1, "m"),
    ("mean error, Schmidt", "schmidt", "mae", 1, "m"),
    ("speed error, extended", "ekf", "rmse_speed", 2, "m/s"),
    ("speed error, Schmidt", "schmidt", "rmse_speed", 2, "m/s"),
    ("course error, extended", "ekf", "rmse_course", 1, "°"),
    ("course error, Schmidt", "schmidt", "rmse_course", 1, "°"),
    ("time with NEES in the band, extended", "ekf", "fraction_nees_inside", 2, ""),
    ("time with NEES in the band, Schmidt", "schmidt", "fraction_nees_inside", 2, ""),
)


def typical_table(spread: pd.DataFrame) -> pd.DataFrame:
    """The drawn flight, in the first row, among the others: ``shown``, ``here``, ``median``, and ``typical``,
    in words."""
    return pd.DataFrame(
        [
            {
                "shown": words,
                "here": f"{spread[who, name].iloc[0]:.{digits}f} {unit}".rstrip(),
                "median": f"{spread[who, name].median():.{digits}f} {unit}".rstrip(),
                "typical": typical_words(spread[who, name]),
            }
            for words, who, name, digits, unit in DRAWN
        ]
    )


def typical_sentence(table: pd.DataFrame) -> str:
    """Whether the drawn flight is typical in what its figures show; from `typical_table`."""
    odd = table["typical"].str.startswith("not typical")
    if not (odd | table["typical"].str.startswith("typical")).all():
        return "There is no other flight to say whether it is typical."
    if not odd.any():
        return "It is typical in all that its figures show."
    listed = "; ".join(table["shown"][odd])
    whole = "nothing" if odd.all() else f"{(~odd).sum()} of {len(table)} things"
    return f"It is typical in {whole} that its figures show. It is not in: {listed}."


def limits_of(spread: pd.DataFrame, frames: int) -> list[str]:
    """What such a report does not tell; ``frames``, how many the flight drawn has."""
    worth = float(spread["schmidt", "nees_worth"].median())
    return [
        "The flight of the thesis was never published; what of this one is published and what chosen, the "
        "list of its parameters says.",
        "The truth is a single-frequency GPS receiver on the vessel; its own error counts as the filter's, "
        "and on the calibration flight as the pose's.",
        "A covariance says how large errors are, not for how long they last: all three are used as a "
        "constant bias.",
        f"Neighbouring values share their error. An average NEES over the {frames} images of a flight is "
        f"worth {worth:.0f} independent values on the median flight, and its band is as wide as theirs; that "
        "number is itself an estimate from one flight.",
        f"The lenient band, an average between {BOUNDS[0]:.2f} and {BOUNDS[1]:.2f}, lets a filter pass "
        f"that states errors {np.sqrt(2 / BOUNDS[0]):.1f} times too large, or {np.sqrt(BOUNDS[1] / 2):.1f} "
        "times too small.",
        "False alarms and other vessels are left out, as in the thesis.",
    ]
