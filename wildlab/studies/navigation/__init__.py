"""Position, velocity and attitude from inertial samples and satellites: H 5.5, 7.3, 7.5.3, 7.5.4."""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np
import pandas as pd

from wildlab.analysis.navigation_errors import AXES, TUNINGS, unit_of
from wildlab.analysis.overviews.verdict import Evidence, Verdict, verdict_of
from wildlab.studies.navigation import trial
from wildlab.studies.page import Facts
from wildlab.studies.protocol import Metric, Study

#: A difference of so many predicted ones is more than the filter can account for.
OVERCONFIDENT = 2.0
#: Errors up to so many times as large, or as small, as predicted are near to what is predicted.
NEAR = 1.5
#: NEES of three coordinates, on average, of a consistent filter.
IDEAL_NEES = 3.0
_ATTITUDE = tuple(f"{of}_{axis}" for of in ("rms", "mean_sd") for axis in AXES)


def _metric(subject: str, name: str) -> Metric:
    return Metric(name, subject, unit_of(name))


def attitude_of(found: Mapping[str, float]) -> tuple[float, float]:
    """RMS error or difference, and predicted deviation, of all three axes together, degrees.

    Parameters
    ----------
    found
        ``rms_...`` and ``mean_sd_...`` of each axis, degrees.
    """
    rms, sd = (float(np.linalg.norm([found[f"{of}_{axis}"] for axis in AXES])) for of in ("rms", "mean_sd"))
    return rms, sd


def verdict_of_attitude(found: Mapping[str, float]) -> Verdict:
    """What a flight's attitude comes to: up to `OVERCONFIDENT` times what is predicted, nothing is shown."""
    rms, sd = attitude_of(found)
    return verdict_of(Evidence(troubled=int(rms > OVERCONFIDENT * sd)))


def level_of(runs: pd.DataFrame) -> int:
    """The verdict on simulated flights as a number: many are compared with published ones, and not judged."""
    if len(runs) > 1:
        return Verdict.UNJUDGED.level
    return verdict_of_attitude({name: runs["mekf", name].iloc[0] for name in _ATTITUDE}).level


def answer(facts: Facts) -> list[str]:
    """How large errors of attitude are by what the filter predicts, and whether positions are consistent."""
    return [f"attitude-{_attitude(facts)}", f"position-{_position(facts)}"]


def _attitude(facts: Facts) -> str:
    """By the axis whose errors are largest by what is predicted: a good axis does not make up for it."""
    times = {
        axis: facts.value("mekf", f"rms_{axis}") / facts.value("mekf", f"mean_sd_{axis}") for axis in AXES
    }
    if any(math.isnan(one) for one in times.values()):
        return "unknown"
    worst = max(times, key=lambda axis: times[axis])
    return f"overconfident-{worst}" if times[worst] > OVERCONFIDENT else "fits"


def _position(facts: Facts) -> str:
    nees, low, high = (
        facts.value("mekf", "nees_position", end) for end in ("value", "centre_low", "centre_high")
    )
    if math.isnan(nees):
        return "unknown"
    if math.isnan(low + high):
        return "few"
    if low > IDEAL_NEES or high < IDEAL_NEES:
        return "overconfident" if low > IDEAL_NEES else "conservative"
    return "near" if low >= IDEAL_NEES / NEAR**2 and high <= IDEAL_NEES * NEAR**2 else "unclear"


STUDY = Study("navigation", ("mekf", *TUNINGS), trial.trial, trial.check_claims, _metric, answer)
