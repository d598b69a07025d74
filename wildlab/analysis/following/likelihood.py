"""Noise and liveliness under which a flight's own innovations are likeliest: a tuning without any truth."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from scipy.optimize import minimize

from wildlab.analysis.following.expected import sensor_of
from wildlab.analysis.following.filters import motion_of, white_noise
from wildlab.analysis.following.noise_model import NoiseModel, TargetModel, of_flight, of_sensor, of_targets
from wildlab.analysis.following.reinitialisation import part_of
from wildlab.analysis.following.sensor_tracks import choose_in_pieces
from wildlab.analysis.following.sensor_tuning import FEWEST, SensorTuning
from wildlab.analysis.following.target_identity import identified, targets_of
from wildlab.analysis.scans import Scans, scans_of
from wildlab.errors import WildlabError
from wildlab.flight.following import Settings
from wildlab.flight.store import Flight
from wildlab.geometry.frames import Array
from wildlab.tracking.records import Start
from wildlab.tracking.run import run_filter

#: Looks of a sensor that are gone over: enough to tell, and few enough to go over often.
MOST_LOOKS = 600
#: How far, as a factor, noise and liveliness may be from what was believed before.
FARTHEST = 100.0
EVALUATIONS = 80


class _Case(NamedTuple):
    """One target by one sensor: what it is measured by, row by row, and where it starts."""

    sensor: str
    scans: Scans
    own: Array
    beliefs: NoiseModel
    begin: Start


def tune_by_innovations(
    flight: Flight, sensors: Sequence[str], settings: Settings | None = None, source: str | None = None
) -> tuple[dict[str, SensorTuning], float]:
    """For each sensor a factor on its noise, and the liveliness of the targets, together.

    Detections are those that the filter lets in with what it believes before. Errors that last are in all
    detections alike; innovations do not show them, and nothing is said of them.

    Returns
    -------
    Tunings by sensor, their clocks as they are; and the acceleration density, m/s per root second.

    Raises
    ------
    WildlabError
        Where fewer than `FEWEST` detections of a sensor can be followed.
    """
    told = of_flight(flight, settings)
    targets, _ = of_targets(told.targets)
    cases: list[_Case] = []
    for sensor in sensors:
        mine = _cases(flight, sensor, told, targets, source)
        used = sum(int(np.isfinite(one.own[:, 0]).sum()) for one in mine)
        if used < FEWEST:
            raise WildlabError(
                f"only {used} detections of {sensor!r} can be followed",
                "tune on a flight on which the sensor saw a target for longer",
                file=flight.folder,
                field="detections",
            )
        cases += mine
    names = list(dict.fromkeys(one.sensor for one in cases))

    def cost(logs: Array) -> float:
        if np.abs(logs).max() > np.log(FARTHEST):
            return float("inf")
        lively = targets._replace(density=targets.density * float(np.exp(logs[0])))
        factor = dict(zip(names, np.exp(logs[1:]), strict=True))
        return -sum(_log_likelihood(one, lively, float(factor[one.sensor])) for one in cases)

    first = np.zeros(1 + len(names))
    simplex = np.vstack([first, 0.7 * np.eye(len(first))])
    found = minimize(
        cost, first, method="Nelder-Mead",
        options={"initial_simplex": simplex, "maxfev": EVALUATIONS, "xatol": 0.01, "fatol": 0.05},
    )  # fmt: skip
    factors = np.exp(found.x)
    tunings = {}
    for name, factor in zip(names, factors[1:], strict=True):
        mine = [one for one in cases if one.sensor == name]
        sds = mine[0].beliefs.noise * factor
        n = sum(int(np.isfinite(one.own[:, 0]).sum()) for one in mine)
        kind, interval = mine[0].scans.kind, mine[0].scans.interval_s
        tunings[name] = SensorTuning(
            name, kind, mine[0].beliefs.offset_s, np.nan, np.nan, float(sds[0]), 0.0, max(interval, 1e-3),
            0.0, 0.0, 0.0, mine[0].beliefs.range_m, mine[0].beliefs.range_sd_m, interval, n,
            tuple(sds.tolist()),
        )  # fmt: skip
    return tunings, float(targets.density * factors[0])


def _cases(
    flight: Flight, sensor: str, told: Settings, targets: TargetModel, source: str | None
) -> list[_Case]:
    looks = identified(scans_of(flight, sensor, 0.0, source), targets)
    beliefs, _ = of_sensor(flight, looks, told)
    if beliefs.offset_s:
        looks = identified(scans_of(flight, sensor, beliefs.offset_s, source), targets)
    found = []
    truths = targets_of(flight, looks)
    for truth in truths:
        others = [one for one in truths if one.target != truth.target]
        seen, pieces, first = choose_in_pieces(looks, truth, beliefs, targets, others)
        if first is None:
            continue
        rows = np.arange(len(seen))
        own = np.where(first.used[:, None], seen[rows, np.maximum(first.chosen, 0)], np.nan)
        own[MOST_LOOKS:] = np.nan
        found += [
            _Case(sensor, part_of(looks, one.rows), own[one.rows], beliefs, one.begin) for one in pieces
        ]
    return found


def _log_likelihood(case: _Case, targets: TargetModel, factor: float) -> float:
    last = int(np.flatnonzero(np.isfinite(case.own[:, 0]))[-1]) + 1 if np.isfinite(case.own).any() else 0
    rows = slice(0, max(last, case.begin.row + 1))
    n = len(case.scans.times)
    sensor = sensor_of(case.scans, np.zeros((n, 2)))._replace(rows=None)
    track = run_filter(
        case.scans.times[rows],
        case.own[rows],
        white_noise(case.scans, case.beliefs.noise * factor),
        sensor,
        motion_of(targets),
        case.begin,
    )
    used = np.isfinite(track.nis)
    log_det = np.linalg.slogdet(track.S[used])[1]
    return float(-(track.nis[used] + log_det).sum() / 2)
