"""What the flights say of each sentence of H 7.5.3 and 7.5.4.

A premise is about the flight and its poses, never about what the claim measures.

A time average is held against the band of such an average: as many independent values as it is worth
(`wildlab.analysis.navigation_errors.worth`). Single values are held against the band of single values. What
vague words are taken to mean stands with the claims, in ``data/published/schmidt.toml``.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike, NDArray

from wildlab.analysis.navigation_errors import SETTLING_S
from wildlab.evaluation.consistency import chi_square_interval
from wildlab.evaluation.shares import Check
from wildlab.studies.schmidt.trial import DEGREES, METRES, SOURCE, TUNING, constant

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]

#: Of the time: an airframe turns, and flies straight, in a part that one can speak of.
PART = 0.1
#: An airframe crabs from this angle on, deg; above what tells heading and course apart at all.
CRAB_DEG = 5.0


class Band(NamedTuple):
    """(N,) averages, and the 95 % band (N,) of what a consistent filter's would be."""

    mean: Array
    low: Array
    high: Array

    @property
    def above(self) -> Flags:
        """Which averages are above."""
        return np.asarray(self.mean > self.high)

    @property
    def below(self) -> Flags:
        """Which are below."""
        return np.asarray(self.mean < self.low)

    @property
    def inside(self) -> Flags:
        """Which are neither, and known."""
        return np.asarray((self.mean >= self.low) & (self.mean <= self.high))


def band(spread: pd.DataFrame, who: str, what: str = "nees") -> Band:
    """The time averages of a filter's NEES or NIS on each flight, and their band."""
    worth = np.maximum(spread[who, f"{what}_worth"].to_numpy(float), 1.0)
    limits = np.array([chi_square_interval(2, runs=one) for one in worth])
    return Band(spread[who, what].to_numpy(float), limits[:, 0], limits[:, 1])


def apart(one: ArrayLike, other: ArrayLike) -> Array:
    """By which share of the smaller two positive numbers differ."""
    a, b = np.asarray(one, float), np.asarray(other, float)
    return np.asarray(np.maximum(a, b) / np.minimum(a, b) - 1)


def check_claims(spread: pd.DataFrame) -> dict[str, Check]:
    """What every flight gives for each claim, by the claim's id; a study asks for its own.

    Parameters
    ----------
    spread
        What `trial.summarise` gives, one row for each flight; SI and radians, angles of poses in degrees.
    """

    def of(who: str, name: str) -> Array:
        return spread[who, name].to_numpy(float)

    def smaller(second: str, first: str, name: str, unit: str, premise: Flags | None) -> Check:
        """True where ``second`` has less of it than ``first``."""
        scale = 180 / np.pi if unit == "deg" else 1.0
        return Check.larger(scale * of(first, name), scale * of(second, name), unit, premise)

    def pose(name: str) -> Array:
        return of(SOURCE, name)

    ekf, schmidt, noisier = (band(spread, who) for who in ("ekf", "schmidt", "ekf-60-pixels"))
    nis = {who: band(spread, who, "nis") for who in ("ekf", "schmidt")}
    size = {who: np.hypot(of(who, "mean_north"), of(who, "mean_east")) for who in ("ekf", "schmidt")}
    # What the poses move the target by in the image, against what 30 white pixels leave of a period's mean.
    periods = of("flight", "pauses") + 1
    off = pose("shift_px") > TUNING.pixel / np.sqrt(of("flight", "detections") / periods)
    paused, turning = of("flight", "pauses") >= 1, of("flight", "turning")
    turns = (turning >= PART) & (turning <= 1 - PART)
    moves, drifts = of("flight", "moving") > 0.5, off & paused
    settled = of("flight", "settled") > SETTLING_S
    # Where nothing falls two deviations off, no innovation covariance about the pixel noise is too small.
    far = pose("largest_shift_px") > 2 * TUNING.pixel
    off_yaw, off_others = (
        pose("difference_yaw"),
        np.maximum(pose("difference_roll"), pose("difference_pitch")),
    )
    out_yaw, out_others = pose("outside_yaw"), np.maximum(pose("outside_roll"), pose("outside_pitch"))
    without, half, full = (of(constant(DEGREES[1], metres), "nees") for metres in (0.0, *METRES))
    inside = {who: of(who, "fraction_nees_inside") for who in ("ekf", "schmidt")}
    degrees = [of(constant(one), "fraction_nees_inside") for one in (DEGREES[0], DEGREES[-1])]
    difference = np.maximum(
        apart(of("schmidt-attitude-only", "nees"), schmidt.mean),
        apart(of("schmidt-position-only", "nees"), ekf.mean),
    )
    return {
        # NEES, on average
        "schmidt-nees-inside": Check(true=schmidt.inside),
        "ekf-nees-above": Check(true=ekf.above, premise=off),
        "schmidt-pessimistic": Check(true=schmidt.below),
        "ekf-needs-more-noise": Check(true=ekf.above & ~noisier.above & np.isfinite(noisier.mean)),
        "attitude-makes-the-difference": Check(true=ekf.mean > 2 * schmidt.mean, measured=difference),
        "position-negligible-below": Check(measured=apart(without, half), premise=off),
        "position-matters-from": Check(measured=apart(without, full), above=True, premise=off),
        "schmidt-fits": Check(true=schmidt.inside & nis["schmidt"].inside),
        # NEES, single values
        "ekf-overconfident-between": Check(
            measured=of("ekf", "fraction_above_predicted"), above=True, premise=drifts, reach=(0, 1)
        ),
        "ekf-overconfident-in-every-pause": Check(true=of("ekf", "pauses_above") == 1, premise=drifts),
        "schmidt-inside-mostly": Check(measured=1 - inside["schmidt"]),
        "ekf-hardly-inside": Check(measured=inside["ekf"], premise=off),
        "one-to-two-degrees": Check(measured=1 - np.minimum(*degrees)),
        # Errors
        "schmidt-more-accurate": smaller("schmidt", "ekf", "mae", "m", off),
        "accuracy-comparable": Check(measured=apart(of("schmidt", "mae"), of("ekf", "mae")), premise=off),
        "schmidt-mean-error-smaller": Check.larger(size["ekf"], size["schmidt"], "m", off),
        "ekf-mean-error-smaller": Check.larger(size["schmidt"], size["ekf"], "m", off),
        "ekf-drifts-more": smaller("schmidt", "ekf", "mae_predicted", "m", drifts),
        "ekf-drifts-more-at-first": smaller("schmidt", "ekf", "mae_first_pause", "m", drifts),
        "schmidt-oscillates-less": smaller("schmidt", "ekf", "oscillation", "m", off & turns),
        "speed-better": smaller("schmidt", "ekf", "rmse_speed", "m/s", off),
        "speed-better-at-first": smaller("schmidt", "ekf", "rmse_speed_start", "m/s", drifts),
        "schmidt-speed-lower": smaller("schmidt", "ekf", "mean_speed", "m/s", off),
        "course-better": smaller("schmidt", "ekf", "rmse_course", "deg", off & moves),
        "course-better-at-first": smaller("schmidt", "ekf", "rmse_course_start", "deg", drifts & moves),
        # NIS
        "nis-similar": Check(measured=apart(nis["ekf"].mean, nis["schmidt"].mean)),
        "nis-differs": Check(measured=apart(nis["ekf"].mean, nis["schmidt"].mean), above=True, premise=off),
        "nis-small": Check(measured=np.maximum(nis["ekf"].mean, nis["schmidt"].mean)),
        "nis-mean-inside": Check(true=nis["ekf"].inside & nis["schmidt"].inside),
        "nis-inside": Check(
            measured=1 - np.minimum(of("ekf", "fraction_nis_inside"), of("schmidt", "fraction_nis_inside"))
        ),
        "schmidt-nis-inside-mostly": Check(measured=1 - of("schmidt", "fraction_nis_inside")),
        "nis-of-ekf-larger": smaller("schmidt", "ekf", "nis", "", off),
        "ekf-nis-too-large": Check(measured=of("ekf", "fraction_nis_above"), above=True, premise=far),
        "high-nis-after-pauses": Check(
            measured=np.minimum(of("ekf", "nis_top_after_pauses"), of("schmidt", "nis_top_after_pauses")),
            above=True,
            premise=of("flight", "pauses") >= 2,
            reach=(0, 1),
        ),
        # The poses
        "covariance-constant": Check(measured=pose("sd_spread"), premise=settled),
        "yaw-errors-largest": Check.larger(off_yaw, off_others, "deg"),
        "yaw-errors-outside": Check(
            true=out_yaw > out_others,
            premise=of("flight", "crab") > CRAB_DEG,
            first=100 * out_yaw,
            second=100 * out_others,
            unit="%",
        ),
        "largest-errors-in-turns": Check.larger(
            pose("difference_turning"), pose("difference_straight"), "deg", turns
        ),
    }  # fmt: skip
