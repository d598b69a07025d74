"""What the tracker is told of the harbour: drawn at random, chosen on one scenario, used on the others."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
import pandas as pd

from wildlab.analysis.tracks.many import score_identities, track_jointly
from wildlab.analysis.tracks.noise_model import SensorTuning
from wildlab.evaluation.identities import Identities
from wildlab.flight.store import Flight
from wildlab.flight.tracking_settings import (
    HullPart,
    ManySensorPart,
    ManyTargetsPart,
    NoisePart,
    SensorPart,
    Settings,
    TargetsPart,
)
from wildlab.reporting.many_tracks import LARGEST, SMALLEST, rms_error
from wildlab.reporting.report import Report
from wildlab.studies.autoferry import tune_sensor

#: The ways to look: by one sensor, by both, and with the cameras too.
MODES: dict[str, tuple[str, ...]] = {
    "radar": ("radar",),
    "lidar": ("lidar",),
    "both": ("lidar", "radar"),
    "cameras": ("lidar", "radar", "ir", "eo"),
}
#: At whose looks it is judged: those of the cameras are many more, and would weigh most.
JUDGED_AT = ("lidar", "radar")
#: How far away a boat is asked for, m: as far as the radar sees, or the lidar a boat of its size.
RADAR_REACH_M = 200.0
LIDAR_REACH_M = {"havfruen": 105.0, "gunnerus": 125.0, "jet-boat": 70.0}
#: Of a boat whose size is not known, m.
USUAL_REACH_M = 105.0
#: A boat of which nothing is known, and the ship among them.
BOAT_LENGTH_M, BOAT_BEAM_M, SHIP_LENGTH_M, SHIP_BEAM_M = 6.0, 2.5, 28.0, 8.0
#: Nothing in a harbour is faster, m/s.
FASTEST_M_S = 10.0


def scale(rng: np.random.Generator, low: float, high: float) -> float:
    """A random number between two above zero, evenly over their logarithm."""
    return float(np.exp(rng.uniform(np.log(low), np.log(high))))


def even(rng: np.random.Generator, low: float, high: float) -> float:
    """A random number between two others."""
    return float(rng.uniform(low, high))


class Tuned(NamedTuple):
    """One draw, and where it was tuned its mean GOSPA, m, and the mean NEES / 2 of its tracks, the truth
    taken for exact."""

    number: int
    settings: Settings
    gospa: float
    anees: float


def reach_of(flight: Flight, mode: str) -> dict[str, float]:
    """Metres by target up to which it is asked for."""
    truth = flight.table("truth")
    names = [str(name) for name in truth["target_id"].unique()]
    if "radar" in MODES[mode]:
        return dict.fromkeys(names, RADAR_REACH_M)
    return {
        name: next((reach for key, reach in LIDAR_REACH_M.items() if key in name.lower()), USUAL_REACH_M)
        for name in names
    }


def errors_of(flight: Flight) -> dict[str, SensorTuning]:
    """Of each sensor, as one scenario tells: its clock, and how its errors last from scan to scan."""
    return {sensor: tune_sensor(flight, sensor) for sensor in MODES["cameras"]}


def draw(rng: np.random.Generator, errors: Mapping[str, SensorTuning]) -> Settings:
    """Everything that the tracker is told, from ranges that are wide and mean something.

    Scales are drawn evenly over their logarithm, shares and distances evenly.

    Parameters
    ----------
    errors
        From `errors_of`.
    """
    targets = ManyTargetsPart(
        hulls=(
            HullPart(name="boat", length_m=BOAT_LENGTH_M, beam_m=BOAT_BEAM_M, share=0.6),
            HullPart(name="ship", length_m=SHIP_LENGTH_M, beam_m=SHIP_BEAM_M, share=0.4),
        ),
        lifetime_s=scale(rng, 20, 200),
        birth=scale(rng, 0.03, 0.3),
        visible_s=scale(rng, 5, 60),
        hidden_s=scale(rng, 3, 40),
        gate=even(rng, 2.5, 4.5),
        confirmed=float(rng.choice([0.9, 0.95, 0.98, 0.99])),
        hits=int(rng.choice([3, 4, 5])),
        shown=even(rng, 0.2, 0.9),
        forgotten=0.02,
        lost_m=SHIP_LENGTH_M,
        fastest_m_s=FASTEST_M_S,
        moves_m=even(rng, 4, 12),
        over_s=even(rng, 8, 20),
        apart_m=5.0,
    )
    side = scale(rng, 0.3, 2.5), scale(rng, 1, 7)
    lidar = ManySensorPart(
        detection=even(rng, 0.6, 0.9),
        clutter_per_m2=scale(rng, 5e-7, 2e-5),
        near_m=even(rng, 5, 20),
        far_m=even(rng, 105, 140),
        patience_s=even(rng, 3, 9),
        several=True,
        rough_m=(0.0, scale(rng, 0.7, 4)),
        along_m=(0.0, scale(rng, 3, 9)),
        near_side_m=side,
        near_end_m=(side[0] * even(rng, 1, 3), side[1] * even(rng, 1, 4)),
    )
    radar = ManySensorPart(
        detection=even(rng, 0.75, 0.95),
        clutter_per_m2=scale(rng, 2e-6, 5e-5),
        near_m=even(rng, 5, 20),
        far_m=RADAR_REACH_M,
        patience_s=even(rng, 4, 10),
        rough_m=(0.0, scale(rng, 0.7, 4)),
        along_m=(0.0, scale(rng, 1, 6)),
        near_side_m=(0.0, 0.0),
        near_end_m=(0.0, 0.0),
    )
    noise = {
        "lidar": NoisePart(position_m=scale(rng, 0.7, 2.5)),
        "radar": NoisePart(position_m=scale(rng, 1.5, 4)),
        "ir": NoisePart(azimuth_deg=scale(rng, 1, 6)),
        "eo": NoisePart(azimuth_deg=scale(rng, 1, 6)),
    }
    parts = {"lidar": lidar, "radar": radar, "ir": _camera(rng), "eo": _camera(rng)}
    # Errors of a bearing are those of the ship's heading and of the part of the hull that stands out.
    thinning = {name: scale(rng, 0.5, 5) for name in ("ir", "eo")}
    return Settings(
        targets=TargetsPart(
            acceleration_m_s_sqrt_s=float(np.sqrt(scale(rng, 0.01, 0.3))),
            start_speed_m_s=even(rng, 2, 5),
            many=targets,
        ),
        sensors={
            name: SensorPart(
                clock_offset_s=errors[name].offset_s,
                noise=noise[name],
                thinning_s=thinning.get(name),
                many=part,
                # Of bearings scans are thinned instead.
                correlation=None if name in thinning else errors[name].next_correlation,
                correlation_time_s=None if name in thinning else errors[name].correlation_time_s,
            )
            for name, part in parts.items()
        },
    )


def _camera(rng: np.random.Generator) -> ManySensorPart:
    """It sees all around, as far as the radar or less far."""
    return ManySensorPart(
        detection=even(rng, 0.3, 0.9),
        clutter_per_rad=scale(rng, 0.05, 3),
        far_m=even(rng, 100, RADAR_REACH_M),
        patience_s=even(rng, 3, 10),
        rough_m=(0.0, scale(rng, 0.7, 4)),
        along_m=(0.0, scale(rng, 3, 9)),
    )


def gospa_of(lives: Identities | None) -> float:
    """Mean over the looks, m; infinite where there is nothing to compare."""
    return float(np.mean([one.distance for one in lives.gospa])) if lives is not None else np.inf


def follow_mode(flight: Flight, mode: str, settings: Settings) -> Identities | None:
    """A scenario by the sensors of a mode, beside its true boats."""
    return score_identities(
        track_jointly(flight, settings=settings, sensors=MODES[mode]), reach_of(flight, mode), JUDGED_AT
    )


def anees_of(lives: Identities | None) -> float:
    """Mean NEES / 2 over tracks, each by its NEES; NaN where there is none.

    The truth is taken for exact, so that no draw is preferred for what somebody assumed of the truth.
    """
    on = [one for one in (lives.tracks.values() if lives else ()) if np.isfinite(one.anees)]
    values = [one.anees_alone / 2 for one in on]
    return float(np.average(values, weights=[one.compared for one in on])) if on else np.nan


def tune(flight: Flight, draws: int, seed: int) -> dict[str, Tuned]:
    """Draw settings, and choose those of each mode by how the tracker does with them on one scenario.

    Those go first with which errors are as large as the tracks say, and among them those with a small GOSPA:
    GOSPA alone prefers tracks that are too sure of themselves, which lose their boat elsewhere.

    Parameters
    ----------
    draws
        How many.

    Returns
    -------
    The best, by mode.
    """
    errors = errors_of(flight)
    found: dict[str, list[Tuned]] = {mode: [] for mode in MODES}
    for number, rng in enumerate(np.random.default_rng(seed).spawn(draws), start=1):
        settings = draw(rng, errors)
        for mode, tuned in found.items():
            lives = follow_mode(flight, mode, settings)
            tuned.append(Tuned(number, settings, gospa_of(lives), anees_of(lives)))
    return {mode: min(tuned, key=order) for mode, tuned in found.items()}


def order(one: Tuned) -> tuple[bool, float, int]:
    """What draws are chosen by: first those whose errors are as large as the tracks say, then by GOSPA."""
    return not SMALLEST <= one.anees <= LARGEST, one.gospa, one.number


def row_of(lives: Identities | None, case: str, mode: str) -> dict[str, object]:
    """One scenario by one mode."""
    if lives is None:
        return {"case": case, "mode": mode}
    seen = [life for life in lives.targets.values() if life.visible]
    return {
        "case": case,
        "mode": mode,
        "gospa": gospa_of(lives),
        "rmse": rms_error(lives),
        "tracked": 100 * float(np.mean([life.tracked for life in seen])) if seen else np.nan,
        "swaps": lives.swaps,
        "breaks": lives.breaks,
        "anees": anees_of(lives),
    }


def judge_all(flights: Mapping[str, Flight], tuned: Mapping[str, Tuned]) -> pd.DataFrame:
    """Every scenario by every mode with its settings."""
    return pd.DataFrame(
        [
            row_of(follow_mode(flight, mode, tuned[mode].settings), case, mode)
            for mode in MODES
            for case, flight in flights.items()
        ]
    )


def medians(rows: pd.DataFrame, first: str) -> pd.DataFrame:
    """For each mode, over the scenarios that nothing was tuned on.

    Returns
    -------
    DataFrame
        ``mode``; medians of ``gospa`` and of how much boats are ``tracked`` (%); how many ``changes`` of a
        boat's track there are in all; ``of`` how many scenarios.
    """
    elsewhere = rows[rows["case"] != first].dropna(subset=["gospa"])
    found = [
        {
            "mode": mode,
            "gospa": own["gospa"].median(),
            "tracked": own["tracked"].median(),
            "changes": own[["swaps", "breaks"]].to_numpy(float).sum(),
            "of": len(own),
        }
        for mode, own in elsewhere.groupby("mode", sort=False)
    ]
    return pd.DataFrame(found, columns=["mode", "gospa", "tracked", "changes", "of"])


def record_scores(report: Report, rows: pd.DataFrame, middle: pd.DataFrame) -> None:
    """The numbers, for ``metrics.json``."""
    each = (
        ("gospa", "gospa", "m"), ("rmse", "rmse", "m"), ("swaps", "swaps", "1"), ("breaks", "breaks", "1"),
        ("mean_nees_by_two", "anees", "1"),
    )  # fmt: skip
    for _, one in rows.iterrows():
        for name, column, unit in each:
            report.metric(name, f"{one['case']}/{one['mode']}", one[column], unit)
    middles = (
        ("gospa_median", "gospa", "m"),
        ("tracked_median", "tracked", "%"),
        ("track_changes", "changes", "1"),
    )
    for _, one in middle.iterrows():
        for name, column, unit in middles:
            report.metric(name, f"elsewhere/{one['mode']}", one[column], unit, n=int(one["of"]))


def values(middle: pd.DataFrame) -> dict[str, float]:
    """``tracked`` (%) and ``changes`` by lidar and radar for the page's answer; NaN where not known."""
    both = middle[middle["mode"] == "both"]
    found = {name: float(both[name].iloc[0]) if len(both) else np.nan for name in ("tracked", "changes")}
    # Whole numbers are shown as such.
    return {name: int(value) if value.is_integer() else value for name, value in found.items()}
