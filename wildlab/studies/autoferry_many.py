"""What the tracker is told of the harbour: drawn at random, chosen on one scenario, used on the others."""

from __future__ import annotations

from collections.abc import Mapping
from functools import reduce
from typing import Any, NamedTuple

import numpy as np
import pandas as pd

from wildlab.analysis.tracks.many import score_identities, track_jointly
from wildlab.analysis.tracks.noise_model import SensorTuning
from wildlab.evaluation.identities import Identities
from wildlab.flight.files import check_model, read_toml
from wildlab.flight.manifest import Settings
from wildlab.flight.store import Flight
from wildlab.paths import DATA
from wildlab.reporting.many_tracks import LARGEST, SMALLEST, rms_error
from wildlab.reporting.report import Report
from wildlab.studies.autoferry import tune_sensor
from wildlab.studies.page import record_spread

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
    """Everything that the tracker is told, from the ranges of ``data/drawn_settings.toml``.

    Parameters
    ----------
    errors
        From `errors_of`.
    """
    ranges = read_toml(DATA / "drawn_settings.toml", "what settings are drawn from")
    told: dict[str, Any] = ranges["same"]
    for path, how in ranges["drawn"].items():
        *parts, name = path.split(".")
        reduce(lambda part, one: part.setdefault(one, {}), parts, told)[name] = _drawn(rng, how)
    hull = told["sensors"]["lidar"]["many"]
    hull["near_end_m"] = np.multiply(hull["near_side_m"], hull["near_end_m"]).tolist()
    for name, sensor in told["sensors"].items():
        sensor["clock_offset_s"] = errors[name].offset_s
        # Of bearings scans are thinned instead.
        if "thinning_s" not in sensor:
            sensor["correlation"] = errors[name].next_correlation
            sensor["correlation_time_s"] = errors[name].correlation_time_s
    return check_model(Settings, told, None)


def _drawn(rng: np.random.Generator, how: Any) -> Any:
    if isinstance(how, list):
        return [_drawn(rng, one) for one in how]
    if not isinstance(how, dict):
        return how
    (kind, values), *_ = how.items()
    if kind == "of":
        return np.asarray(rng.choice(values)).item()
    return float(np.exp(rng.uniform(*np.log(values))) if kind == "log" else rng.uniform(*values))


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


#: Medians over scenarios, by name: of which number of each, and its unit.
MEDIANS = {"gospa_median": ("gospa", "m"), "tracked_median": ("tracked", "%")}


def over_scenarios(rows: pd.DataFrame, first: str) -> pd.DataFrame:
    """What each mode gives on each scenario but the first, on which everything was tuned.

    Returns
    -------
    DataFrame
        Columns (``elsewhere/`` and the mode, a name of `MEDIANS`), a row for each scenario.
    """
    by_mode = rows.pivot(index="case", columns="mode").drop(index=first)
    return pd.DataFrame(
        {
            (f"elsewhere/{mode}", name): by_mode[column, mode]
            for mode in rows["mode"].unique()
            for name, (column, _) in MEDIANS.items()
        }
    )


def record_scores(report: Report, rows: pd.DataFrame, first: str) -> dict[str, int]:
    """Record the numbers of each scenario; and by mode, of all but the first, medians (`MEDIANS`) with the
    lowest and the highest, and how often a boat's track changes.

    Returns
    -------
    dict
        These changes.
    """
    each = (
        ("gospa", "gospa", "m"), ("rmse", "rmse", "m"), ("swaps", "swaps", "1"), ("breaks", "breaks", "1"),
        ("mean_nees_by_two", "anees", "1"),
    )  # fmt: skip
    for _, one in rows.iterrows():
        for name, column, unit in each:
            report.metric(name, f"{one['case']}/{one['mode']}", one[column], unit)
    units = {name: unit for name, (_, unit) in MEDIANS.items()}
    record_spread(report, units.get, over_scenarios(rows, first), {})
    changes = {}
    for mode, own in rows.groupby("mode", sort=False):
        seen = own.loc[own["case"] != first, ["swaps", "breaks"]].dropna()
        changes[str(mode)] = int(seen.to_numpy().sum())
        report.metric("track_changes", f"elsewhere/{mode}", changes[str(mode)], "1", n=len(seen))
    return changes
