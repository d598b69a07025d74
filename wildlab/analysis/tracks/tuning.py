"""What flights teach about sensors and targets, for another one to be judged by.

Against truth: how late a sensor's clock is, how large its errors are, how long they last and what of. Noise
and errors that last are found together, by products of errors of each target (`fit_noise`); an error beyond
`GROSS` times what errors usually are teaches nothing.
Where no detection says what it is of, the one nearest to a target, within reach, is taken for its own.

Without truth: noise and liveliness under which a flight's own innovations are likeliest.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
from numpy.typing import NDArray
from scipy.optimize import minimize, nnls
from scipy.stats import t as student_t

from wildlab.analysis.tracks.noise_model import (
    GROUPS,
    MEDIAN_OF_NORMAL,
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
    errors_near,
    predict_scan,
    scans_of,
    truths_at,
)
from wildlab.analysis.tracks.single_target import choose
from wildlab.analysis.tracks.tracker import read_inputs
from wildlab.errors import WildlabError
from wildlab.evaluation.consistency import worth, worth_of_errors
from wildlab.flight.manifest import Settings
from wildlab.flight.store import Flight
from wildlab.geometry.frames import Array
from wildlab.tracking.run import Start, run_filter
from wildlab.tracking.sensors import Merged, head

#: Offsets tried, s: the largest known delays are three; at first each so many, then those about the best.
OFFSETS_S, COARSE = np.arange(-5.0, 2.001, 0.05), 5
#: Beyond so many standard deviations an error is gross.
GROSS = 5.0
#: Errors that parameters are fitted to, at most, of each target.
MOST_ERRORS = 2000
#: Lags of two errors, and for how long errors may last, s: none, and each so many times the one before.
LAG_STEP = 1.2
LAGS_S = np.array([0.0, *0.05 * LAG_STEP ** np.arange(68)])
#: White noise is no smaller than this, beside what errors usually are: a filter has to bear it.
LEAST_WHITE = 0.1
#: Fewest errors from which anything is estimated.
FEWEST = 20


class Noise(NamedTuple):
    """What errors are made of.

    Attributes
    ----------
    white
        (m,) standard deviation of each element that is new at every scan.
    lasting
        (k,) of each error of `SLOTS` that fades from scan to scan.
    time_s
        How long these last.
    """

    white: Array
    lasting: Array
    time_s: float


class Errors(NamedTuple):
    """Of one target: times (N,), errors (N, m), and what a unit of each error that lasts does to them
    (N, m, k). NaN where nothing is known, infinite where the target is missed."""

    times: Array
    error: Array
    H: Array

    @property
    def known(self) -> NDArray[np.bool_]:
        """(N,) where there is an error."""
        return np.asarray(np.isfinite(self.error).all(axis=1) & np.isfinite(self.H).all(axis=(1, 2)))

    def only(self, rows: NDArray[np.bool_] | slice) -> Errors:
        """Some of them."""
        return Errors(*(part[rows] for part in self))


def tune(
    flights: Sequence[Flight], sensor: str, reach_of: Callable[[str], float], source: str | None = None
) -> SensorTuning:
    """Estimate everything of a sensor from flights with truth, with one clock for all of them.

    Parameters
    ----------
    reach_of
        By kind: detections further from a target than this (m, or rad of bearings and pixels) are not its
        own, where they do not say what they are of.
    source
        Name of the ``nav`` table, where a flight has it; may be left out where there is one beside the
        truth's.

    Raises
    ------
    WildlabError
        Where fewer than `FEWEST` detections lie near a target, or the clock is further off than is looked.
    """
    seen = [_Seen(one, sensor, reach_of, source if source in one.nav else None) for one in flights]
    # Poses that belong to frames stay with them, whatever the clock says.
    found = _tuned(seen, np.zeros(1) if any(one.fixed for one in seen) else OFFSETS_S)
    if found.offset_s not in OFFSETS_S[[0, -1]]:
        return found
    if found.offset_low_s <= 0 <= found.offset_high_s:
        # Nothing here tells the time, as where nothing moves.
        return _tuned(seen, np.zeros(1))
    raise WildlabError(
        f"the stamps of {sensor!r} fit the truth best with {found.offset_s:+.1f} s added, and further is not "
        "looked: its clock is further off, or the truth is of something else",
        f"correct the clock of {sensor!r} or of the truth first (`wildlab check` compares them), then tune",
        file=flights[0].folder,
        field="time_s",
    )


#: Between two flights, s: nothing lasts for so long.
APART_S = 1e7


class _Seen:
    """What a sensor saw on a flight with truth, by its stamps with an offset."""

    def __init__(
        self, flight: Flight, sensor: str, reach_of: Callable[[str], float], source: str | None
    ) -> None:
        self.flight, self.sensor, self.source = flight, sensor, source
        scans = self.scans(0.0)
        self.reach, self.interval_s = reach_of(scans.kind), scans.interval_s
        if scans.labelled:
            # What saw nothing teaches nothing then, and of a camera's images these are most.
            frames = flight.table("frames")
            mine = frames["frame_id"].isin(flight.table("detections")["frame_id"])
            self.flight = replace(flight, tables=flight.tables | {"frames": frames[mine]})
        self.fixed = "frame_id" in flight.pose_source(source)[1]
        self.at_rest = bool(flight.table("truth")["time_s"].isna().all())

    def scans(self, offset: float) -> Scans:
        return scans_of(self.flight, self.sensor, offset, self.source)

    def errors(self, offset: float) -> tuple[list[Errors], list[Array]]:
        """Of each target, and how far away it was, m."""
        scans = self.scans(offset)
        truths = truths_at(self.flight, scans.times)
        distances = [np.hypot(*(truth.position - scans.platform).T) for truth in truths]
        return _errors_of(scans, truths, self.reach), distances


def _tuned(seen: Sequence[_Seen], offsets: Array) -> SensorTuning:
    """The tuning with the best of some offsets; of one alone its interval is NaN."""

    def errors_at(offset: float) -> tuple[list[Errors], list[Array]]:
        found, away = list[Errors](), list[Array]()
        for number, each in enumerate(seen):
            errors, distances = each.errors(offset)
            found += [one._replace(times=one.times + APART_S * number) for one in errors]
            away += distances
        return found, away

    offset, low, high = float(offsets[np.argmin(np.abs(offsets))]), float("nan"), float("nan")
    if len(offsets) > 1:
        at_rest = all(one.at_rest for one in seen)
        offset, low, high = _clock(lambda shift: errors_at(shift)[0], offsets, offset, at_rest)
    scans, (errors, away) = seen[0].scans(offset), errors_at(offset)
    n, m = sum(int(one.known.sum()) for one in errors), scans.detections.shape[-1]
    if n < FEWEST:
        raise WildlabError(
            f"only {n} detections of {scans.sensor!r} lie near a target with truth",
            "tune on a flight on which the sensor saw a target",
            file=seen[0].flight.folder,
            field="detections",
        )
    noise = fit_noise(errors, _groups(scans), scans.elements)
    H = np.concatenate([one.H[one.known] for one in errors])
    lasting = variance_of(H, noise).mean(axis=0)
    total = noise.white**2 + lasting
    distance = np.concatenate([far[one.known] for far, one in zip(away, errors, strict=True)])
    alike = len({NOISE_OF[name] for name in scans.elements}) == 1
    by_group = [noise.lasting[group[0]] if group else 0.0 for group in _groups(scans, every=True)]
    position, clock, heading, range_bias, tilt = (float(sd) for sd in by_group)
    return SensorTuning(
        scans.sensor, scans.kind, offset, low, high, float(np.sqrt(total.mean())),
        float((lasting / total).mean()), noise.time_s, position, clock, heading, float(distance.mean()),
        float(distance.std()), seen[0].interval_s, n, tuple(noise.white.tolist()),
        () if alike and m > 1 else tuple(np.sqrt(total).tolist()), range_bias, tilt,
    )  # fmt: skip


def _groups(scans: Scans, every: bool = False) -> list[list[int]]:
    """Places among the errors of the scans' kind of each of `GROUPS`; those that it has, or every one."""
    slots = SLOTS[scans.kind]
    found = [[slots.index(name) for name in group if name in slots] for group in GROUPS]
    return [group for group in found if group or every]


def _clock(
    errors_at: Callable[[float], list[Errors]], offsets: Array, now: float, at_rest: bool
) -> tuple[float, float, float]:
    """The offset with least squares, and its 95 % interval.

    It is taken where the interval leaves out the clock as it is. Of targets ``at_rest`` a clock shows by how
    the platform moves alone, and so do the platform's errors: there, the best offset of either half of the
    targets (of one: of its time) must also be likelier to the other half. Else the clock stays, and the
    interval holds that, too.
    """
    best, where = now, offsets[::COARSE]
    for _ in range(2):
        errors = errors_at(best)
        scale = _scale([one.error for one in errors])
        number = _independent(errors, scale, at_rest)
        found = {o: number * _halves(errors_at(o), scale) / 2 for o in sorted({*where.tolist(), now})}
        best = min(found, key=lambda one: found[one].sum())
        at = int(np.argmin(np.abs(offsets - best)))
        where = offsets[max(at - 4 * COARSE, 0) : at + 4 * COARSE + 1]
    tried, costs = np.array(list(found)), np.array(list(found.values()))
    whole = costs.sum(axis=1)
    # As Student's t has it: of few independent errors their size is known badly, too.
    drop = float(student_t.ppf(0.975, max(number.sum() - 1, 1.0))) ** 2 / 2
    near, half = tried[whole <= whole.min() + drop], float(np.diff(offsets[:2])[0]) / 2
    low, high = float(near.min()) - half, float(near.max()) + half
    of_other = costs[costs.argmin(axis=0)[::-1], [0, 1]]
    agreed = not at_rest or (found[now] > of_other).all()
    if agreed and whole[tried == now] > whole.min() + drop:
        return best, low, high
    return now, min(low, now), max(high, now)


def _scale(errors: Sequence[Array]) -> Array:
    """(m,) spread of errors (N, m) about zero, by their medians."""
    size = np.abs(np.concatenate(errors))
    size = size[np.isfinite(size).all(axis=1)]
    return (
        np.maximum(np.median(size, axis=0) / MEDIAN_OF_NORMAL, 1e-9) if len(size) else np.ones(size.shape[1])
    )


def _halved(errors: list[Errors]) -> tuple[list[Errors], list[Errors]]:
    """Either half of the targets, or of the time of one alone."""
    if len(errors) > 1:
        return errors[::2], errors[1::2]
    middle = int(np.searchsorted(errors[0].times, np.median(errors[0].times)))
    return [errors[0].only(slice(middle))], [errors[0].only(slice(middle, None))]


def _independent(errors: list[Errors], scale: Array, together: bool) -> Array:
    """(2,) how many independent errors those of either half are worth: each target's by themselves, or all
    one after the other. Those that are missed count like the others."""
    known = [one.error[one.known] for one in errors]
    if together:
        order = np.argsort(np.concatenate([one.times[one.known] for one in errors]), kind="stable")
        known = [np.concatenate(known)[order]]
    # About their mean for what changes, and about zero for what does not: a constant error is one.
    each = [min(max(map(worth, one.T)), worth_of_errors(one / scale)) for one in known if len(one)]
    share = float(sum(each) / max(sum(map(len, known)), 1))
    return np.array(
        [share * sum((~np.isnan(one.error)).all(axis=1).sum() for one in half) for half in _halved(errors)]
    )


def _halves(errors: list[Errors], scale: Array) -> Array:
    """(2,) mean square of errors in units of their scale, of either half; gross ones count as at `GROSS`.

    None gains by scans that an offset takes out of the truth's time.
    """
    found = []
    for half in _halved(errors):
        error = np.concatenate([one.error for one in half])
        squares = np.minimum((error[~np.isnan(error).any(axis=1)] / scale) ** 2, GROSS**2).sum(axis=1)
        found.append(squares.mean() if len(squares) else 0.0)
    return np.array(found)


def _errors_of(scans: Scans, truths: Sequence[Truth], reach: float) -> list[Errors]:
    """Of each target. One without a name that is missed where it should be seen counts as far off, or an
    offset would gain by losing it."""
    found = []
    for truth in truths:
        error = errors_near(scans, truth, reach)[0]
        if not scans.labelled:
            missed = np.isnan(error) & np.isfinite(truth.position[:, :1])
            error = np.where(missed, np.inf, error)
        found.append(Errors(scans.times, error, predict_scan(scans, truth.position, truth.velocity).H_pose))
    return found


def fit_noise(errors: Sequence[Errors], groups: Sequence[list[int]], elements: Sequence[str]) -> Noise:
    """The noise that products of errors fit best, one standard deviation for each of the groups of errors
    that last and for elements of a kind.

    Of two errors of a target, the mean of the product is ``H lasting**2 H' exp(-lag / time_s)``, and the
    white variance more where both are one and the same. For a given time that is linear in the variances,
    none of which is negative. Lags count alike on a logarithmic scale, so that what lasts for a second and
    what lasts throughout are both seen. How errors are distributed plays no part, as it does not for a linear
    filter.

    Parameters
    ----------
    errors
        Of each target.
    groups
        Of errors that last, by their place in ``H``.
    elements
        Names of the m elements of a measurement.
    """
    kinds = list(dict.fromkeys(NOISE_OF[name] for name in elements))
    kind = np.array([kinds.index(NOISE_OF[name]) for name in elements])
    spreads = _scale([one.error for one in errors])
    scale = np.array([np.sqrt(np.mean(spreads[kind == number] ** 2)) for number in range(len(kinds))])[kind]
    some = [
        one.only(good).only(slice(MOST_ERRORS))
        for one, good in zip(errors, _plausible(errors, scale, groups), strict=True)
    ]
    found = _fit(some, [np.broadcast_to(scale, one.error.shape) for one in some], groups, kind)
    # Errors weigh as they are expected to be: a place a metre off turns the bearing of a near look far.
    alike = (kind[:, None] == kind) / (kind[:, None] == kind).sum(axis=0)
    for _ in range(2):
        sizes = [np.sqrt((variance_of(one.H, found) + found.white**2) @ alike) for one in some]
        found = _fit(some, sizes, groups, kind)
    return found


def _plausible(
    errors: Sequence[Errors], scale: Array, groups: Sequence[list[int]]
) -> list[NDArray[np.bool_]]:
    """Which errors of each target are not gross: `GROSS` times what is usual, whatever they may come of."""
    least = [np.abs(one.error) / scale for one in errors]
    for group in groups:
        with np.errstate(divide="ignore", invalid="ignore"):
            causes = [np.abs(one.error) / np.linalg.norm(one.H[..., group], axis=-1) for one in errors]
        causes = [np.where(np.isfinite(one), one, np.inf) for one in causes]
        every = np.concatenate(causes)
        for element in range(len(scale)):
            known = every[np.isfinite(every[:, element]), element]
            usual = np.median(known) / MEDIAN_OF_NORMAL if len(known) else 1.0
            for one, cause in zip(least, causes, strict=True):
                one[:, element] = np.fmin(one[:, element], cause[:, element] / max(usual, 1e-12))
    return [one.known & (off < GROSS).all(axis=1) for one, off in zip(errors, least, strict=True)]


def _fit(
    errors: Sequence[Errors], sizes: Sequence[Array], groups: Sequence[list[int]], kind: NDArray[np.intp]
) -> Noise:
    """The noise of errors that are as large as ``sizes`` (N, m), of elements of the ``kind`` (m,)."""
    m, kinds = len(kind), int(kind.max()) + 1
    count = kinds + len(groups)
    gram, product = np.zeros((len(LAGS_S), count, count)), np.zeros((len(LAGS_S), count))
    gaps = [np.zeros(0)]
    for (t, error, H), size in zip(errors, sizes, strict=True):
        e, H, apart = error / size, H / size[..., None], 0
        gaps.append(np.diff(t))
        while apart < len(t):
            i, j = slice(0, len(t) - apart), slice(apart, None)
            pairs = np.zeros((len(t) - apart, m, m, count))
            for column, group in enumerate(groups, start=kinds):
                pairs[..., column] = H[i][..., group] @ np.swapaxes(H[j][..., group], 1, 2)
            if not apart:
                pairs[:, range(m), range(m), kind] = 1 / size**2
            # The nearest lag, the first of which is none.
            place = np.searchsorted(LAGS_S[1:] * LAG_STEP**-0.5, t[j] - t[i], side="right")
            np.add.at(gram, place, np.einsum("nabc,nabd->ncd", pairs, pairs))
            np.add.at(product, place, np.einsum("nabc,na,nb->nc", pairs, e[i], e[j]))
            apart = max(apart + 1, apart * 3 // 2)
    # What lasts no longer than from one error to the next is white.
    every = np.concatenate(gaps)
    shortest = 2 * float(np.median(every)) if len(every) else 0.0
    tries = [(*_variances(gram, product, time_s), float(time_s)) for time_s in LAGS_S[shortest < LAGS_S]]
    _, variances, time_s = min(tries, key=lambda one: one[0])
    lasting = np.zeros(errors[0].H.shape[-1])
    for group, variance in zip(groups, variances[kinds:], strict=True):
        lasting[group] = np.sqrt(variance)
    usual = np.sqrt(np.median(np.concatenate([size**2 for size in sizes]), axis=0))
    return Noise(np.maximum(np.sqrt(variances[:kinds])[kind], LEAST_WHITE * usual), lasting, time_s)


def _variances(gram: Array, product: Array, time_s: float) -> tuple[float, Array]:
    """What is left of the squares of products by lag, up to a constant, and the variances that leave least,
    where errors last so long."""
    fades = np.exp(-LAGS_S / time_s)
    G, b = np.einsum("l,lcd->cd", fades**2, gram), fades @ product
    unit = np.sqrt(np.diag(G))
    unit[unit == 0] = 1.0
    G, b = G / unit[:, None] / unit, b / unit
    root = np.linalg.cholesky(G + 1e-9 * np.eye(len(b)))
    found, _ = nnls(root.T, np.linalg.solve(root, b))
    return float(found @ G @ found - 2 * b @ found), found / unit


def variance_of(H: Array, noise: Noise) -> Array:
    """(N, m) what errors that last add to those with derivatives (N, m, k)."""
    return np.asarray(np.einsum("nik,k->ni", H**2, noise.lasting**2))


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
    flights: Sequence[Flight],
    sensors: Sequence[str],
    settings: Settings | None = None,
    source: str | None = None,
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
    each = [
        read_inputs(one, settings=settings, sensors=sensors, source=source if source in one.nav else None)
        for one in flights
    ]
    inputs, targets = each[0], each[0].targets
    names, cases = list(inputs.sensors), list[_Case]()
    for sensor in names:
        seen = [one.sensors[sensor] for one in each]
        mine = [
            case
            for one in seen
            for truth in one.truths
            for case in _cases(sensor, one, truth.target, targets)
        ]
        used = sum(_count(case) for case in mine)
        if used < FEWEST:
            raise WildlabError(
                f"only {used} detections of {sensor!r} can be followed",
                "tune on a longer flight",
                file=flights[0].folder,
                field="detections",
            )
        cases += mine

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
            tuple(sds.tolist()),
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
    data: Any = json.loads(text)
    lists = ("own_sds", "white_sds")
    sensors = {
        name: SensorTuning(**one | {key: tuple(one[key]) for key in lists})
        for name, one in data["sensors"].items()
    }
    return Tuned(data["flight"], data["against"], sensors, data["density"])


def tune_flights(
    flights: Sequence[Flight],
    sensors: Sequence[str],
    settings: Settings | None = None,
    against: Against | None = None,
    source: str | None = None,
) -> Tuned:
    """Tune sensors on flights: against truth where all have any, else by the likelihood of innovations.

    Raises
    ------
    WildlabError
        Where truth is asked for and not there, or the flights show too little of a sensor.
    """
    names = ", ".join(one.name for one in flights)
    without = [one for one in flights if one.truth is None or not len(one.truth)]
    if against == "truth" and without:
        raise WildlabError(
            f"the flight {without[0].name!r} has no truth to tune against",
            "use --against innovations, or another flight",
            file=without[0].folder,
            field="--against",
        )
    if against == "innovations" or without:
        found, density = tune_by_innovations(flights, sensors, settings, source)
        return Tuned(names, "innovations", found, density)
    reach = model_targets(settings_of(flights[0], settings).targets)[0].reach
    return Tuned(names, "truth", {sensor: tune(flights, sensor, reach, source) for sensor in sensors})


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
