"""What one flight with truth says of a sensor: how late its clock is, how large its errors are and how long
they last. Meant for one flight, to be used unchanged on others.

No detection says what it is of: the one nearest to a target, within `REACH`, is taken for its own.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import curve_fit, nnls

from wildlab.errors import WildlabError
from wildlab.evaluation.whiteness import effective_sample_size
from wildlab.flight.store import Flight
from wildlab.pipeline.scans import Scans, Truth, scans_of, truths_at
from wildlab.tracking.maritime import CLOCK, EAST, NORTH, YAW, predict_bearing, predict_position
from wildlab.tracking.measurement import Prediction, difference

Array = NDArray[np.float64]

#: Detections further from a target than this (m, rad) are not its own. A ship of 30 m is seen up to 15 m from
#: its antenna and a few metres wrong; from 200 m, the mean distance and more, that is five degrees.
REACH = {"position": 20.0, "bearing": np.radians(5.0)}
#: Offsets tried, s: the largest known delays are three.
OFFSETS_S = np.arange(-5.0, 2.001, 0.05)
#: Longest lag at which errors are compared, s; a flight of two minutes has only few pairs further apart.
LONGEST_LAG_S = 30.0
#: Fewest errors from which anything is estimated.
FEWEST = 20
#: Half of chi-square's 95 % point with one degree of freedom: how far a log-likelihood may lie below its top.
DROP = 1.92


class SensorTuning(NamedTuple):
    """One sensor, as a flight with truth shows it.

    Attributes
    ----------
    offset_s, offset_low_s, offset_high_s
        What to add to the stamps, with a 95 % interval for as many errors as the correlated ones are worth.
        A hull seen ahead of or behind its antenna is in it too: on a straight course nothing tells the two
        apart.
    sd
        Of the error of each element, m or rad, standing part included.
    share, correlation_time_s
        The autocorrelation of the errors: ``share * exp(-lag / correlation_time_s)`` beyond lag zero.
    position_sd_m, clock_sd_s, yaw_sd_rad
        What the part of the variance that stays from scan to scan is put down to.
    range_m, range_sd_m
        How far away what the sensor saw was: all that is known of the distance at a first bearing.
    interval_s
        Usual time between scans.
    n
        Errors it is from.
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
    yaw_sd_rad: float
    range_m: float
    range_sd_m: float
    interval_s: float
    n: int

    @property
    def pose_covariance(self) -> Array:
        """(6, 6) of the considered errors, as `wildlab.tracking.maritime` orders them."""
        variance = np.zeros(6)
        variance[[NORTH, EAST]] = self.position_sd_m**2
        variance[CLOCK], variance[YAW] = self.clock_sd_s**2, self.yaw_sd_rad**2
        return np.diag(variance)

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
    def white_sd(self) -> float:
        """Standard deviation of what is new at every scan, beside errors that are considered."""
        return float(self.sd * np.sqrt(1 - self.next_correlation))

    @property
    def thinning_s(self) -> float:
        """Lag from which errors are correlated by less than 1/e; nought where they never are by more."""
        return float(max(0.0, self.correlation_time_s * (1 + np.log(max(self.share, 1e-9)))))


class _Errors(NamedTuple):
    """Nearest detections of one target: errors (N, m), NaN where there is none within reach."""

    times: Array
    error: Array
    truth: Truth
    scans: Scans


def tune(flight: Flight, sensor: str) -> SensorTuning:
    """Estimate everything of a sensor from one flight with truth.

    Raises
    ------
    WildlabError
        Where fewer than `FEWEST` detections lie near a target.
    """
    costs = np.array([_cost(_errors_of(flight, scans_of(flight, sensor, float(o)))) for o in OFFSETS_S])
    best = int(np.argmin(costs))
    offset = float(OFFSETS_S[best])
    scans = scans_of(flight, sensor, offset)
    errors = _errors_of(flight, scans)
    known = np.concatenate([one.error[np.isfinite(one.error[:, 0])] for one in errors])
    n = len(known)
    if n < FEWEST:
        raise WildlabError(
            f"only {n} detections of {sensor!r} lie near a target with truth",
            "tune on a flight on which the sensor saw a target",
            file=flight.folder,
            field="detections",
        )
    sd = float(np.sqrt(np.mean(known**2)))
    # Correlated errors are worth fewer: the sum of squares says less than it seems to.
    worth = sum(_worth(one.error) for one in errors)
    near = OFFSETS_S[(costs - costs[best]) / (2 * sd**2) * worth / n <= DROP]
    share, correlation_time = _autocorrelation(errors, scans.interval_s)
    considered = _considered(errors, sd, share * np.exp(-scans.interval_s / correlation_time))
    distance = np.concatenate(
        [np.hypot(*(one.truth.position - scans.platform).T)[np.isfinite(one.error[:, 0])] for one in errors]
    )
    return SensorTuning(
        sensor,
        scans.kind,
        offset,
        float(near.min()),
        float(near.max()),
        sd,
        share,
        correlation_time,
        *considered,
        float(distance.mean()),
        float(distance.std()),
        scans.interval_s,
        n,
    )


def predict_scan(scans: Scans, position: Array, velocity: Array) -> Prediction:
    """What every scan should have seen of a target at (N, 2) moving with (N, 2)."""
    predict = predict_position if scans.kind == "position" else predict_bearing
    return predict(position, scans.platform, velocity - scans.platform_velocity)


def errors_near(scans: Scans, truth: Truth) -> tuple[Array, NDArray[np.intp]]:
    """Error (N, m) of the detection nearest to a target at every scan, within `REACH`, and which it is.

    Measured minus expected; NaN and -1 where there is none.
    """
    expected = predict_scan(scans, truth.position, truth.velocity).z
    error = difference(scans.detections, expected[:, None], (scans.kind == "bearing",) * expected.shape[-1])
    size = np.linalg.norm(error, axis=-1)
    size = np.where(np.isfinite(size), size, np.inf)
    best = np.argmin(size, axis=1)
    rows = np.arange(len(best))
    near = size[rows, best] < REACH[scans.kind]
    return np.where(near[:, None], error[rows, best], np.nan), np.where(near, best, -1)


def _errors_of(flight: Flight, scans: Scans) -> list[_Errors]:
    return [
        _Errors(scans.times, errors_near(scans, truth)[0], truth, scans)
        for truth in truths_at(flight, scans.times)
    ]


def _cost(errors: list[_Errors]) -> float:
    """Sum of squared errors, as if every scan had a truth beside it.

    A scan at a target that has no detection within reach costs as much as one at its edge, and one that an
    offset takes out of the truth's time as much as the mean of the others: no offset gains by losing scans.
    """
    squares = [
        np.where(np.isfinite(one.error[:, 0]), np.sum(one.error**2, axis=1), REACH[one.scans.kind] ** 2)[
            np.isfinite(one.truth.position[:, 0])
        ]
        for one in errors
    ]
    known = np.concatenate(squares)
    return float(known.mean() * sum(len(one.times) for one in errors)) if len(known) else float("inf")


def _worth(error: Array) -> float:
    known = error[np.isfinite(error[:, 0])]
    if len(known) < 4:
        return float(len(known))
    return max([1.0, *(effective_sample_size(column, len(known) - 1) for column in known.T)])


def _autocorrelation(errors: list[_Errors], interval: float) -> tuple[float, float]:
    """Share and time of ``share * exp(-lag / time)``, by weighted least squares over the lags.

    Means are left in: a standing error is the most correlated there is.
    """
    step = max(interval, 0.5)
    lags = np.arange(1, int(LONGEST_LAG_S / step) + 1)
    products, squares, pairs = np.zeros(len(lags)), np.zeros(len(lags)), np.zeros(len(lags))
    for one in errors:
        known = np.isfinite(one.error[:, 0])
        t, e = one.times[known], one.error[known]
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


def _considered(errors: list[_Errors], sd: float, share: float) -> tuple[float, float, float]:
    """Position (m), clock (s) and yaw (rad) standard deviations that the correlated variance is put down to.

    Non-negative least squares of the errors' products, less the part that is white, on what a unit of each
    would bring about at every scan.
    """
    columns: list[Array] = []
    wanted: list[Array] = []
    for one in errors:
        known = np.isfinite(one.error[:, 0])
        H = predict_scan(one.scans, one.truth.position, one.truth.velocity).H_pose[known]
        known_H = np.isfinite(H).all(axis=(1, 2))
        H, e = H[known_H], one.error[known][known_H]
        groups = [[NORTH, EAST], [CLOCK], [YAW]]
        columns.append(
            np.stack(
                [(H[..., g] @ np.swapaxes(H[..., g], 1, 2)).reshape(len(H), -1) for g in groups], axis=-1
            )
        )
        white = (1 - share) * sd**2 * np.eye(e.shape[1])
        wanted.append((e[:, :, None] * e[:, None, :] - white).reshape(len(e), -1))
    A = np.concatenate([one.reshape(-1, 3) for one in columns])
    b = np.concatenate([one.ravel() for one in wanted])
    # In units in which each brings about the same, or radians would weigh nothing.
    scale = np.sqrt(np.mean(A**2, axis=0))
    scale[scale == 0] = 1.0
    variance = nnls(A / scale, b)[0] / scale
    position, clock, yaw = np.sqrt(variance)
    return float(position), float(clock), float(yaw)
