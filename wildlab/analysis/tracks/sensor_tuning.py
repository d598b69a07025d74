"""What one flight with truth says of a sensor: how late its clock is, how large its errors are and how long
they last. Meant for one flight, to be used unchanged on others.

Where no detection says what it is of, the one nearest to a target, within reach, is taken for its own.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np
from scipy.optimize import curve_fit, nnls

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
from wildlab.errors import WildlabError
from wildlab.evaluation.whiteness import effective_sample_size
from wildlab.flight.store import Flight
from wildlab.geometry.frames import Array

#: Offsets tried, s: the largest known delays are three.
OFFSETS_S = np.arange(-5.0, 2.001, 0.05)
#: Longest lag at which errors are compared, s; a flight of two minutes has only few pairs further apart.
LONGEST_LAG_S = 30.0
#: Fewest errors from which anything is estimated.
FEWEST = 20
#: Half of chi-square's 95 % point with one degree of freedom: how far a log-likelihood may lie below its top.
DROP = 1.92
#: Errors that last are put down to these together, each group with one standard deviation.
GROUPS = (("platform_north", "platform_east"), ("clock",), ("heading",), ("range_bias",), ("roll", "pitch"))


class SensorTuning(NamedTuple):
    """One sensor, as a flight with truth shows it.

    Attributes
    ----------
    offset_s, offset_low_s, offset_high_s
        What to add to the stamps, with a 95 % interval for as many errors as the correlated ones are worth;
        low and high are NaN where the clock was not tuned and is as it was stated.
        A hull seen ahead of or behind its antenna is in it too: on a straight course nothing tells the two
        apart.
    sd
        Of the error of each element, m or rad, standing part included.
    share, correlation_time_s
        The autocorrelation of the errors: ``share * exp(-lag / correlation_time_s)`` beyond lag zero.
    position_sd_m, clock_sd_s, heading_sd_rad
        What the part of the variance that stays from scan to scan is put down to.
    range_m, range_sd_m
        How far away what the sensor saw was: all that is known of the distance at a first bearing.
    interval_s
        Usual time between scans.
    n
        Errors it is from.
    own_sds
        Of each element, where they are of several units; ``sd`` is then in metres across the line of sight.
    range_bias_sd_m, tilt_sd_rad
        As ``heading_sd_rad``, for sensors that measure ranges, and for cameras (about each level axis).
    """

    sensor: str
    kind: str
    offset_s: float
    offset_low_s: float
    offset_high_s: float
    sd: float
    share: float
    correlation_time_s: float
    position_sd_m: float
    clock_sd_s: float
    heading_sd_rad: float
    range_m: float
    range_sd_m: float
    interval_s: float
    n: int
    own_sds: tuple[float, ...] = ()
    range_bias_sd_m: float = 0.0
    tilt_sd_rad: float = 0.0

    @property
    def clock_tuned(self) -> bool:
        """Whether the offset is an estimate."""
        return bool(np.isfinite(self.offset_low_s))

    @property
    def sds(self) -> Array:
        """(m,) standard deviation of the error of each element, standing part included."""
        return np.array(self.own_sds or (self.sd,) * (1 if self.kind == "bearing" else 2))

    @property
    def considered(self) -> dict[str, float]:
        """Standard deviations of errors that last, by name, m, s or rad; those that are zero too."""
        sds = (self.position_sd_m, self.clock_sd_s, self.heading_sd_rad, self.range_bias_sd_m,
               self.tilt_sd_rad)  # fmt: skip
        return {name: sd for group, sd in zip(GROUPS, sds, strict=True) for name in group}

    @property
    def next_correlation(self) -> float:
        """Correlation of the errors of two successive scans."""
        return float(self.share * np.exp(-self.interval_s / self.correlation_time_s))

    @property
    def fading(self) -> float:
        """What is left of the correlated part from one scan to the next: ``F_c`` of H (7.5)."""
        return float(np.exp(-self.interval_s / self.correlation_time_s))

    @property
    def driving_sd(self) -> float:
        """Standard deviation of ``e_2 - F_c e_1`` of successive errors: the root of ``R_w``, H (7.5)."""
        F_c = self.fading
        return float(self.sd * np.sqrt(1 + F_c**2 - 2 * F_c * self.next_correlation))

    @property
    def thinning_s(self) -> float:
        """Lag from which errors are correlated by less than 1/e; nought where they never are by more."""
        return float(max(0.0, self.correlation_time_s * (1 + np.log(max(self.share, 1e-9)))))


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
    alike = len(UNITS_OF[scans.kind]) == 1 and "elevation" not in scans.elements
    own = () if alike else tuple(np.sqrt(np.mean(known**2, axis=0)).tolist())
    sds = np.array(own) if own else np.full(known.shape[1], float(np.sqrt(np.mean(known**2))))
    # Correlated errors are worth fewer: the sum of squares says less than it seems to.
    worth = sum(_worth(one.error) for one in errors)
    low, high = float("nan"), float("nan")
    near = offsets[(costs - costs[best]) / (2 * sd**2) * worth / n <= DROP]
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


#: Units of the elements of a measurement, by kind.
UNITS_OF = {
    "position": ("m",), "bearing": ("rad",), "range-bearing": ("m", "rad"), "pixel": ("px",),
    "velocity": ("m/s",),
}  # fmt: skip


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


def _worth(error: Array) -> float:
    known = error[np.isfinite(error[:, 0])]
    if len(known) < 4:
        return float(len(known))
    return max([1.0, *(effective_sample_size(column, len(known) - 1) for column in known.T)])


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
        return np.asarray(share * np.exp(-lag / time))

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
