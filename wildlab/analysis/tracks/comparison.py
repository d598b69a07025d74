"""Targets of the ferry followed by each sensor on its own with the filters that the study compares: a flight
in, a table out.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
import pandas as pd

from wildlab.analysis.tracks.inputs import SensorInputs
from wildlab.analysis.tracks.judged import mean_of
from wildlab.analysis.tracks.noise_model import TargetModel, from_tuning
from wildlab.analysis.tracks.scans import scans_of, truths_at
from wildlab.analysis.tracks.sensor_tuning import SensorTuning
from wildlab.analysis.tracks.tracks import SensorTrack, track_target
from wildlab.evaluation.consistency import chi_square_interval, position_nees, share_inside
from wildlab.evaluation.track_errors import summarise_track, track_errors
from wildlab.evaluation.whiteness import autocorrelation
from wildlab.flight.store import Flight

#: The filters that a study holds against each other, by kind of detection.
FILTERS = {
    "position": ("kf", "coloured", "schmidt", "thinned"),
    "bearing": ("ekf", "schmidt", "thinned"),
}
#: The filter that the others are held against, by kind of detection.
WHITE = {kind: names[0] for kind, names in FILTERS.items()}


def follow_flight(
    flight: Flight, tunings: Mapping[str, SensorTuning], targets: TargetModel
) -> list[SensorTrack]:
    """Every target with truth, by every sensor that has a tuning, with every filter of the study.

    Raises
    ------
    WildlabError
        Where the flight lacks a sensor, poses or truth.
    """
    found = []
    for sensor, tuning in tunings.items():
        scans = scans_of(flight, sensor, tuning.offset_s)
        one = SensorInputs(scans, from_tuning(tuning), truths_at(flight, scans.times))
        for truth in one.truths:
            found += track_target({sensor: one}, truth.target, targets, FILTERS[scans.kind])
    return found


#: Numbers of a row of `table`, with their units.
COLUMNS = {
    "rmse": "m",
    "mae": "m",
    "anees": "1",
    "anees_alone": "1",
    "anis": "1",
    "lag1_autocorrelation_north": "1",
    "lag1_autocorrelation_east": "1",
    "lag1_autocorrelation": "1",
    "fraction_nees_inside": "1",
    "share_followed": "1",
    "share_with_target": "1",
}


def table(followed: Sequence[SensorTrack], size_m: float = float("nan")) -> pd.DataFrame:
    """One row for each track, its columns those of `COLUMNS` and:

    ``sensor``, ``kind``, ``target``, ``filter``; ``detections`` used; ``compared``, scans with a track and
    truth; ``nees_low`` and ``nees_high``, the 95 % interval of the mean NEES of a consistent filter, for as
    many values as the correlated ones are worth; ``nis_low`` and ``nis_high`` likewise. ``anees`` is of the
    position, 2 is right, with the truth's own error where it is stated, and ``anees_alone`` with the truth
    taken for exact; ``anis`` is of the detections that were let in, 2 or 1 is right, by the elements of
    a measurement. ``share_followed``: of the scans with truth, those that have a track. ``seen``: scans in
    which the sensor saw something near the target's true place, and ``share_with_target``: in how many of
    them a track is nearer to it than ``size_m``; NaN where that is.
    """
    return pd.DataFrame([_row(one, size_m) for one in followed])


def _row(one: SensorTrack, size_m: float) -> dict[str, object]:
    summary = summarise_track(track_errors(one.estimate + one.error, one.estimate))
    m = one.innovation.shape[1]
    used = one.innovation[np.isfinite(one.nis)]
    lag1 = [float(autocorrelation(column, 1)[1]) if len(used) > 2 else np.nan for column in used.T]
    nees, nis = mean_of(one.nees, 2), mean_of(one.nis, m)
    alone = position_nees(one.error[:, :2], one.covariance[:, :2, :2])
    on = np.isfinite(one.error[:, 0])
    there = np.hypot(*one.error[:, :2].T) < size_m  # NaN, where there is no track, is not there
    return {
        "sensor": one.sensor,
        "kind": "position" if m == 2 else "bearing",
        "target": one.target,
        "filter": one.filter,
        "detections": len(used),
        "compared": summary.n,
        "rmse": summary.rmse,
        "mae": summary.mae,
        "anees": nees.mean,
        "anees_alone": mean_of(alone, 2).mean,
        "nees_low": nees.low,
        "nees_high": nees.high,
        "anis": nis.mean,
        "nis_low": nis.low,
        "nis_high": nis.high,
        "lag1_autocorrelation_north": lag1[0] if m == 2 else np.nan,
        "lag1_autocorrelation_east": lag1[1] if m == 2 else np.nan,
        "lag1_autocorrelation": lag1[0] if m == 1 else np.nan,
        "fraction_nees_inside": share_inside(one.nees, chi_square_interval(2)),
        "share_followed": float(on.sum() / one.known.sum()) if one.known.any() else np.nan,
        "seen": int(one.near.sum()),
        "share_with_target": float(there[one.near].mean()) if one.near.any() and size_m > 0 else np.nan,
    }
