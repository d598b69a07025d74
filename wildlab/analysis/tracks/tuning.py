"""What one flight teaches about sensors and targets, for another one to be judged by.

Against truth: how late a sensor's clock is, how large its errors are and how long they last; where no
detection says what it is of, the one nearest to a target, within reach, is taken for its own. Without truth:
noise and liveliness under which a flight's own innovations are likeliest.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
from scipy.optimize import curve_fit, minimize, nnls

from wildlab.analysis.tracks.noise_model import (
    GROUPS,
    NOISE_OF,
    Against,
    SensorInputs,
    SensorTuning,
    TargetModel,
    Tuned,
    model_targets,
    settings_of,
)
from wildlab.analysis.tracks.scans import (
    SLOTS,
    Scans,
    Truth,
    across,
    errors_near,
    predict_scan,
    scans_of,
    truths_at,
)
from wildlab.analysis.tracks.single_target import choose
from wildlab.analysis.tracks.tracker import read_inputs, worth
from wildlab.errors import WildlabError
from wildlab.flight.manifest import Settings
from wildlab.flight.store import Flight
from wildlab.geometry.frames import Array
from wildlab.tracking.run import Start, run_filter
from wildlab.tracking.sensors import Merged, head

#: Offsets tried, s: the largest known delays are three.
OFFSETS_S = np.arange(-5.0, 2.001, 0.05)
#: Longest lag at which errors are compared, s; a flight of two minutes has only few pairs further apart.
LONGEST_LAG_S = 30.0
#: Fewest errors from which anything is estimated.
FEWEST = 20
#: Half of chi-square's 95 % point with one degree of freedom: how far a log-likelihood may lie below its top.
DROP = 1.92


class _Errors(NamedTuple):
    """Detections of one target: errors (N, m), NaN where there is none, and the same in one unit."""

    times: Array
    error: Array
    sized: Array
    truth: Truth
    scans: Scans


def tune(
    flight: Flight, sensor: str, reach_of: Callable[[str], float], source: str | None = None
) -> SensorTuning:
    """Estimate everything of a sensor from one flight with truth.

    Parameters
    ----------
    reach_of
        By kind: detections further from a target than this (m, or rad of bearings and pixels) are not its
        own, where they do not say what they are of.
    source
        Name of the ``nav`` table; may be left out where there is one beside the truth's.

    Raises
    ------
    WildlabError
        Where fewer than `FEWEST` detections lie near a target, or the clock is further off than is looked.
    """
    reach = reach_of(scans_of(flight, sensor, 0.0, source).kind)
    # Poses that belong to frames stay with them, whatever the clock says.
    fixed = "frame_id" in flight.pose_source(source)[1]
    found = _tuned(flight, sensor, reach, source, np.zeros(1) if fixed else OFFSETS_S)
    if found.offset_s not in OFFSETS_S[[0, -1]]:
        return found
    if found.offset_low_s <= 0 <= found.offset_high_s:
        # Nothing here tells the time, as where nothing moves.
        return _tuned(flight, sensor, reach, source, np.zeros(1))
    raise WildlabError(
        f"the stamps of {sensor!r} fit the truth best with {found.offset_s:+.1f} s added, and further is not "
        "looked: its clock is further off, or the truth is of something else",
        f"correct the clock of {sensor!r} or of the truth first (`wildlab check` compares them), then tune",
        file=flight.folder,
        field="time_s",
    )


def _tuned(flight: Flight, sensor: str, reach: float, source: str | None, offsets: Array) -> SensorTuning:
    """The tuning with the best of some offsets; of one alone its interval is NaN."""

    def errors_at(offset: float) -> list[_Errors]:
        return _errors_of(flight, scans_of(flight, sensor, offset, source), reach)

    costs = np.array([_cost(errors_at(float(o)), reach) for o in offsets])
    best = int(np.argmin(costs))
    offset = float(offsets[best])
    errors = errors_at(offset)
    scans = errors[0].scans if errors else scans_of(flight, sensor, offset, source)
    known = np.concatenate([one.error[np.isfinite(one.error[:, 0])] for one in errors])
    n = len(known)
    if n < FEWEST:
        raise WildlabError(
            f"only {n} detections of {sensor!r} lie near a target with truth",
            "tune on a flight on which the sensor saw a target",
            file=flight.folder,
            field="detections",
        )
    sized = np.concatenate([one.sized[np.isfinite(one.error[:, 0])] for one in errors])
    sd = float(np.sqrt(np.mean(sized**2)))
    alike = len({NOISE_OF[name] for name in scans.elements}) == 1
    own = () if alike else tuple(np.sqrt(np.mean(known**2, axis=0)).tolist())
    sds = np.array(own) if own else np.full(known.shape[1], float(np.sqrt(np.mean(known**2))))
    # Correlated errors are worth fewer: the sum of squares says less than it seems to.
    counted = [one.error for one in errors if np.isfinite(one.error[:, 0]).any()]
    independent = sum(max([1.0, *map(worth, error.T)]) for error in counted)
    low, high = float("nan"), float("nan")
    near = offsets[(costs - costs[best]) / (2 * sd**2) * independent / n <= DROP]
    if len(offsets) > 1:
        low, high = float(near.min()), float(near.max())
    share, correlation_time = _autocorrelation(errors, sds if own else np.ones(1), scans.interval_s)
    lasting = _considered(errors, sds, share * np.exp(-scans.interval_s / correlation_time))
    position, clock, heading, range_bias, tilt = lasting
    distance = np.concatenate(
        [np.hypot(*(one.truth.position - scans.platform).T)[np.isfinite(one.error[:, 0])] for one in errors]
    )
    return SensorTuning(
        sensor,
        scans.kind,
        offset,
        low,
        high,
        float(sds[0]) if not own else sd,
        share,
        correlation_time,
        position,
        clock,
        heading,
        float(distance.mean()),
        float(distance.std()),
        scans.interval_s,
        n,
        own,
        range_bias,
        tilt,
    )


def _errors_of(flight: Flight, scans: Scans, reach: float) -> list[_Errors]:
    found = []
    for truth in truths_at(flight, scans.times):
        error = errors_near(scans, truth, reach)[0]
        expected = predict_scan(scans, truth.position, truth.velocity).z
        found.append(_Errors(scans.times, error, across(scans, error[:, None], expected)[:, 0], truth, scans))
    return found


def _cost(errors: list[_Errors], reach: float) -> float:
    """Sum of squared errors, as if every scan had a truth beside it.

    A scan at a target that has no detection within reach costs as much as one at its edge, and one that an
    offset takes out of the truth's time as much as the mean of the others: no offset gains by losing scans.
    Detections that say what they are of are not lost by being far off.
    """
    squares = []
    for one in errors:
        missing = np.nan if one.scans.labelled else reach**2
        size = np.where(np.isfinite(one.error[:, 0]), np.sum(one.sized**2, axis=1), missing)
        squares.append(size[np.isfinite(one.truth.position[:, 0]) & np.isfinite(size)])
    known = np.concatenate(squares) if squares else np.empty(0)
    return float(known.mean() * sum(len(one.times) for one in errors)) if len(known) else float("inf")


def _autocorrelation(errors: list[_Errors], sds: Array, interval: float) -> tuple[float, float]:
    """Share and time of ``share * exp(-lag / time)``, by weighted least squares over the lags.

    Means are left in: a standing error is the most correlated there is.
    """
    step = max(interval, 0.5)
    lags = np.arange(1, int(LONGEST_LAG_S / step) + 1)
    products, squares, pairs = np.zeros(len(lags)), np.zeros(len(lags)), np.zeros(len(lags))
    for one in errors:
        known = np.isfinite(one.error[:, 0])
        t, e = one.times[known], one.error[known] / sds
        lag = np.rint((t[None, :] - t[:, None]) / step).astype(int)
        dot, size = e @ e.T, np.sum(e**2, axis=1)
        mean = (size[None, :] + size[:, None]) / 2
        for i, k in enumerate(lags):
            both = lag == k
            products[i] += dot[both].sum()
            squares[i] += mean[both].sum()
            pairs[i] += both.sum()
    used = pairs > 0
    r = products[used] / squares[used]
    # Short lags are known better: the error of a correlation goes with 1 - r^2.
    doubt = np.maximum(1 - r**2, 0.05) / np.sqrt(pairs[used])

    def model(lag: Array, share: float, time: float) -> Array:
        return share * np.exp(-lag / time)

    found, _ = curve_fit(
        model,
        lags[used] * step,
        r,
        p0=(0.8, 10.0),
        sigma=doubt,
        bounds=((0.0, step / 3), (1.0, 20 * LONGEST_LAG_S)),
    )
    return float(found[0]), float(found[1])


def _considered(errors: Sequence[_Errors], sds: Array, share: float) -> list[float]:
    """Standard deviations (m, s, rad) that the correlated variance is put down to, for each of `GROUPS`.

    Non-negative least squares of the errors' products, less the part that is white, on what a unit of each
    would bring about at every scan; all elements in units of their own standard deviation.
    """
    slots = SLOTS[errors[0].scans.kind]
    groups = [[slots.index(name) for name in group if name in slots] for group in GROUPS]
    used = [group for group in groups if group]
    columns: list[Array] = []
    wanted: list[Array] = []
    for one in errors:
        known = np.isfinite(one.error[:, 0])
        H = predict_scan(one.scans, one.truth.position, one.truth.velocity).H_pose[known] / sds[:, None]
        known_H = np.isfinite(H).all(axis=(1, 2))
        H, e = H[known_H], one.error[known][known_H] / sds
        columns.append(
            np.stack([(H[..., g] @ np.swapaxes(H[..., g], 1, 2)).reshape(len(H), -1) for g in used], axis=-1)
        )
        white = (1 - share) * np.eye(e.shape[1])
        wanted.append((e[:, :, None] * e[:, None, :] - white).reshape(len(e), -1))
    A = np.concatenate([one.reshape(-1, len(used)) for one in columns])
    b = np.concatenate([one.ravel() for one in wanted])
    # In units in which each brings about the same, or radians would weigh nothing.
    scale = np.sqrt(np.mean(A**2, axis=0))
    scale[scale == 0] = 1.0
    variances = iter(nnls(A / scale, b)[0] / scale)
    return [float(np.sqrt(next(variances))) if group else 0.0 for group in groups]


#: Looks of a sensor that are gone over: enough to tell, and few enough to go over often.
MOST_LOOKS = 600
#: How far, as a factor, noise and liveliness may be from what was believed before.
FARTHEST = 100.0
EVALUATIONS = 80


class _Case(NamedTuple):
    """One track by one sensor: scans as filters take them, what is measured at each, and where it starts."""

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
        used = sum(_count(case) for case in mine)
        if used < FEWEST:
            raise WildlabError(
                f"only {used} detections of {sensor!r} can be followed",
                "tune on a longer flight",
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
        n = sum(_count(one) for one in cases if one.sensor == name)
        interval = scans.interval_s
        tunings[name] = SensorTuning(
            name, scans.kind, noise.offset_s, np.nan, np.nan, float(sds[0]), 0.0, max(interval, 1e-3),
            0.0, 0.0, 0.0, noise.range_m, noise.range_sd_m, interval, n, tuple(sds.tolist()),
        )  # fmt: skip
    return tunings, float(targets.density * factors[0])


def _count(case: _Case) -> int:
    return int(np.isfinite(case.own[:, 0]).sum())


def _cases(sensor: str, one: SensorInputs, target: str, targets: TargetModel) -> list[_Case]:
    chosen = choose({sensor: one}, target, targets)
    found = []
    for piece in chosen.pieces:
        inside = piece.inside(min(len(chosen.own), MOST_LOOKS))
        own = np.where(inside[:, None], chosen.own[: len(inside)], np.nan)
        used = np.flatnonzero(np.isfinite(own[:, 0]))
        count = max([1, piece.begin.row + 1, *(used[-1:] + 1)])
        if count <= len(own):
            found.append(_Case(sensor, head(chosen.merged, count), own[:count], piece.begin))
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
            "use --against innovations, or another flight",
            file=flight.folder,
            field="--against",
        )
    if against == "innovations" or not has_truth:
        found, density = tune_by_innovations(flight, sensors, settings, source)
        return Tuned(flight.name, "innovations", found, density)
    reach = model_targets(settings_of(flight, settings).targets)[0].reach
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
    both = _as_measured(flight), _as_measured(other)
    alike = len(both[0].merge(both[1]))
    if alike >= max(ALIKE, SHARE * min(map(len, both))):
        raise WildlabError(
            f"this is the flight that is judged: {alike} of its detections have the same "
            "stamps and values, and nothing is tuned where it is judged",
            "tune on another flight",
            file=other.folder,
            field="--tune",
        )


def _as_measured(flight: Flight) -> pd.DataFrame:
    """Different detections by sensor, UTC to the millisecond, and values as they were measured."""
    seen, frames, epoch = flight.detections, flight.frames, flight.manifest.time.epoch
    if seen is None or frames is None:
        return pd.DataFrame(columns=["source", "utc", *_VALUES])
    stamps = frames.drop_duplicates("frame_id").set_index("frame_id")["time_s"]
    times = seen["frame_id"].map(stamps).to_numpy(float) + (0.0 if epoch is None else epoch.timestamp())
    # Places match only where they are counted from the same origin; ranges, bearings and pixels in any case.
    values = seen.reindex(columns=list(_VALUES)).astype(float).round(6).dropna(how="all")
    return values.assign(source=seen["source"], utc=pd.Series(times, seen.index).round(3)).drop_duplicates()
