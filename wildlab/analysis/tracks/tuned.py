"""What one flight teaches about sensors and targets, for another one to be judged by: against truth, or by
noise and liveliness under which its own innovations are likeliest.
"""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from scipy.optimize import minimize

from wildlab.analysis.tracks.inputs import SensorInputs, read_inputs
from wildlab.analysis.tracks.noise_model import Against, TargetModel, Tuned, of_flight, of_targets
from wildlab.analysis.tracks.sensor_tuning import FEWEST, SensorTuning, tune
from wildlab.analysis.tracks.tracks import choose
from wildlab.errors import WildlabError
from wildlab.flight.checksums import checksums_of
from wildlab.flight.store import Flight
from wildlab.flight.tracking_settings import Settings
from wildlab.geometry.frames import Array
from wildlab.tracking.records import Start
from wildlab.tracking.run import run_filter
from wildlab.tracking.sensors import Merged, cut

#: Looks of a sensor that are gone over: enough to tell, and few enough to go over often.
MOST_LOOKS = 600
#: How far, as a factor, noise and liveliness may be from what was believed before.
FARTHEST = 100.0
EVALUATIONS = 80


class _Case(NamedTuple):
    """One track by one sensor: looks as filters take them, what is measured at each, and where it starts."""

    sensor: str
    merged: Merged
    own: Array
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
    inputs = read_inputs(flight, settings=settings, sensors=sensors, source=source)
    targets, cases = inputs.targets, list[_Case]()
    for sensor, one in inputs.sensors.items():
        mine = [case for truth in one.truths for case in _cases(sensor, one, truth.target, targets)]
        used = sum(int(np.isfinite(case.own[:, 0]).sum()) for case in mine)
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
        sds = {
            name: inputs.sensors[name].noise.noise * float(factor)
            for name, factor in zip(names, np.exp(logs[1:]), strict=True)
        }
        return -sum(_log_likelihood(one, lively, sds[one.sensor]) for one in cases)

    first = np.zeros(1 + len(names))
    simplex = np.vstack([first, 0.7 * np.eye(len(first))])
    found = minimize(
        cost, first, method="Nelder-Mead",
        options={"initial_simplex": simplex, "maxfev": EVALUATIONS, "xatol": 0.01, "fatol": 0.05},
    )  # fmt: skip
    factors = np.exp(found.x)
    tunings = {}
    for name, factor in zip(names, factors[1:], strict=True):
        scans, noise = inputs.sensors[name][:2]
        sds = noise.noise * factor
        n = sum(int(np.isfinite(one.own[:, 0]).sum()) for one in cases if one.sensor == name)
        interval = scans.interval_s
        tunings[name] = SensorTuning(
            name, scans.kind, noise.offset_s, np.nan, np.nan, float(sds[0]), 0.0, max(interval, 1e-3),
            0.0, 0.0, 0.0, noise.range_m, noise.range_sd_m, interval, n, tuple(sds.tolist()),
        )  # fmt: skip
    return tunings, float(targets.density * factors[0])


def _cases(sensor: str, one: SensorInputs, target: str, targets: TargetModel) -> list[_Case]:
    chosen = choose({sensor: one}, target, targets)
    own = chosen.own.copy()
    own[MOST_LOOKS:] = np.nan
    found = []
    for piece in chosen.pieces:
        mine = own[piece.rows]
        used = np.flatnonzero(np.isfinite(mine[:, 0]))
        rows = slice(0, max(int(used[-1]) + 1 if len(used) else 0, piece.begin.row + 1))
        merged = cut(chosen.merged, slice(piece.first, piece.first + rows.stop))
        found.append(_Case(sensor, merged, mine[rows], piece.begin))
    return found


def _log_likelihood(case: _Case, targets: TargetModel, sds: Array) -> float:
    merged = case.merged
    track = run_filter(merged.times, case.own, np.diag(sds**2), merged.sensor, targets.motion(), case.begin)
    used = np.isfinite(track.nis)
    log_det = np.linalg.slogdet(track.S[used])[1]
    return float(-(track.nis[used] + log_det).sum() / 2)


def tuned_text(tuned: Tuned) -> str:
    """As text, which a notebook is given."""
    sensors = {name: one._asdict() for name, one in tuned.sensors.items()}
    return json.dumps(
        {"flight": tuned.flight, "against": tuned.against, "sensors": sensors, "density": tuned.density}
    )


def read_tuned(text: str) -> Tuned | None:
    """What `tuned_text` wrote; None of an empty text."""
    if not text:
        return None
    data: Mapping[str, Any] = json.loads(text)
    sensors = {
        name: SensorTuning(**{**one, "own_sds": tuple(one["own_sds"])})
        for name, one in data["sensors"].items()
    }
    return Tuned(data["flight"], data["against"], sensors, data["density"])


def tune_flight(
    flight: Flight,
    sensors: Sequence[str],
    settings: Settings | None = None,
    against: Against | None = None,
    source: str | None = None,
) -> Tuned:
    """Tune sensors on a flight: against truth where it has any, else by the likelihood of innovations.

    Raises
    ------
    WildlabError
        Where truth is asked for and not there, or the flight shows too little of a sensor.
    """
    has_truth = flight.truth is not None and len(flight.truth) > 0
    if against == "truth" and not has_truth:
        raise WildlabError(
            f"the flight {flight.name!r} has no truth to tune against",
            "tune by its innovations (--against innovations), or on another flight",
            file=flight.folder,
            field="--against",
        )
    if against == "innovations" or not has_truth:
        found, density = tune_by_innovations(flight, sensors, settings, source)
        return Tuned(flight.name, "innovations", found, density)
    reach = of_targets(of_flight(flight, settings).targets)[0].reach
    found = {sensor: tune(flight, sensor, reach, source) for sensor in sensors}
    return Tuned(flight.name, "truth", found)


#: Fewest detections alike, stamp and values, by which two flights are one, and their share of the smaller.
ALIKE, SHARE = 5, 0.05
_VALUES = ("u_px", "v_px", "range_m", "azimuth_rad", "elevation_rad", "north_m", "east_m", "down_m",
           "v_north_m_s", "v_east_m_s")  # fmt: skip


def refuse_same(flight: Flight, other: Flight) -> None:
    """Refuse to tune on the flight that is judged: one that shares detections with it, whatever its name, its
    folder, or how much of it was imported.

    Raises
    ------
    WildlabError
        Where it is.
    """
    same = False
    if flight.folder is not None and other.folder is not None:
        mine, its = checksums_of(flight.folder), checksums_of(other.folder)
        same = "detections.parquet" in mine and mine["detections.parquet"] == its.get("detections.parquet")
    both = _as_measured(flight), _as_measured(other)
    alike = sum((both[0] & both[1]).values())
    if same or alike >= max(ALIKE, SHARE * min(map(Counter.total, both))):
        raise WildlabError(
            f"this is the flight that is judged, or part of it: {alike} of its detections have the same "
            "stamps and values, and nothing is tuned where it is judged",
            "tune on another flight",
            file=other.folder,
            field="--tune",
        )


def _as_measured(flight: Flight) -> Counter[tuple[object, ...]]:
    """Detections by sensor, UTC to the millisecond, and values as they were measured."""
    seen, frames = flight.detections, flight.frames
    if seen is None or not len(seen):
        return Counter()
    times = np.full(len(seen), np.nan)
    if frames is not None and "time_s" in frames and "frame_id" in seen:
        by_frame = frames.drop_duplicates("frame_id").set_index("frame_id")["time_s"]
        times = seen["frame_id"].map(by_frame).to_numpy(float)
    epoch = flight.manifest.time.epoch
    began = epoch.timestamp() if epoch is not None else 0.0
    # Places match only where they are counted from the same origin; ranges, bearings and pixels in any case.
    values = np.round(seen.reindex(columns=list(_VALUES)).to_numpy(float), 6) + 0.0
    known = np.asarray(np.isfinite(values).any(axis=1))
    stamps = np.where(np.isfinite(times), np.round(began + times, 3), -1.0)
    rows = zip(seen["source"], stamps, map(bytes, values), strict=True)
    return Counter(row for row, good in zip(rows, known, strict=True) if good)
