"""Errors of positions and tracks against the truth: how large, how biased, along which axis.

All errors are truth minus estimate, as H (3.11) has them (`consistency.ERROR_CONVENTION`).
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from wildlab.errors import WildlabError
from wildlab.evaluation.intervals import PROBABILITY, widening
from wildlab.geometry.frames import wrap

Array = NDArray[np.float64]


class ErrorSummary(NamedTuple):
    """Horizontal errors of N positions, metres.

    ``mae`` of H tables 5.4-5.7 is ``mean``: the mean of the distance to the truth.
    """

    n: int
    mean: float
    median: float
    p90: float
    max: float
    bias_north: float
    bias_east: float
    sd_north: float
    sd_east: float


def summarise(errors: ArrayLike) -> ErrorSummary:
    """Summary of horizontal errors.

    Parameters
    ----------
    errors
        (N, 2) north, east in n, m; rows with NaN are left out.

    Returns
    -------
    ErrorSummary
        All NaN beside an ``n`` of 0 where no row is left. Biases have the sign of the errors.
    """
    e = np.asarray(errors, float).reshape(-1, 2)
    e = e[np.isfinite(e).all(axis=1)]
    if not len(e):
        return ErrorSummary(0, *[float("nan")] * 8)
    distance = np.hypot(*e.T)
    sd = e.std(axis=0, ddof=1) if len(e) > 1 else np.full(2, np.nan)
    return ErrorSummary(
        len(e),
        *(
            float(x)
            for x in (distance.mean(), np.median(distance), np.quantile(distance, 0.9), distance.max())
        ),
        *(float(x) for x in (*e.mean(axis=0), *sd)),
    )


#: How often images are drawn for an interval.
DRAWS = 1000


def bootstrap_interval(
    statistic: Callable[[Array], float],
    errors: ArrayLike,
    image: ArrayLike,
    rng: np.random.Generator,
) -> tuple[float, float]:
    """Interval for a statistic of errors, by drawing whole images again and again.

    Errors of one image share its pose: drawing single clicks would give intervals that are far too narrow.

    Parameters
    ----------
    statistic
        Takes errors (M, 2) and gives a number. M changes from draw to draw where images have different
        numbers of errors.
    errors
        (N, 2) north, east in n, m; rows with NaN are left out.
    image
        (N,) which image each belongs to. It may name anything that shares its error, a minute of a flight
        for instance.
    rng
        What the images are drawn with: `DRAWS` times as many as there are, with replacement.

    Returns
    -------
    low, high
        Ends of the middle 90 % of the draws, in the unit of the statistic, the further from its value
        the more alike images are that follow each other (`wildlab.evaluation.intervals.widening`); NaN where
        fewer than two images are left.
    """
    e = np.asarray(errors, float).reshape(-1, 2)
    keep = np.isfinite(e).all(axis=1)
    e, group = e[keep], np.unique(np.asarray(image)[keep], return_inverse=True)[1]
    if not len(e) or group.max() < 1:
        return float("nan"), float("nan")
    members = [np.flatnonzero(group == g) for g in range(group.max() + 1)]
    values = []
    for _ in range(DRAWS):
        picked = rng.integers(0, len(members), len(members))
        values.append(statistic(e[np.concatenate([members[g] for g in picked])]))
    whole, wider = statistic(e), widening(np.hypot(*e.T), group)
    low, high = whole + wider * (np.quantile(values, [(1 - PROBABILITY) / 2, (1 + PROBABILITY) / 2]) - whole)
    return float(low), float(high)


#: A target slower than this has no course worth comparing: positions a few centimetres wrong, a second apart,
#: turn it about.
SLOWEST_M_S = 0.2


class TrackErrors(NamedTuple):
    """Errors of N estimates, truth minus estimate; NaN where truth or estimate is not known.

    ``position`` (N, 2) north and east, metres. ``speed`` (N,) m/s. ``course`` (N,) radians in (-pi, pi].
    ``no_truth`` and ``no_estimate`` (N,): rows that cannot be compared, and why.
    """

    position: Array
    speed: Array
    course: Array
    no_truth: NDArray[np.bool_]
    no_estimate: NDArray[np.bool_]


def track_errors(truth: ArrayLike, estimate: ArrayLike) -> TrackErrors:
    """Compare a track with the truth, row by row.

    Parameters
    ----------
    truth
        (N, 4) north, east (m), velocity north, east (m/s) at the times of the estimates; NaN where the truth
        does not say (it ended, or has a gap), velocities alone too.
    estimate
        (N, 4) likewise; NaN where there is no track.

    Returns
    -------
    TrackErrors

    Raises
    ------
    WildlabError
        If the shapes differ or are not (N, 4).
    """
    t, x = np.asarray(truth, float), np.asarray(estimate, float)
    if t.shape != x.shape or t.ndim != 2 or t.shape[1] != 4:
        raise WildlabError(
            f"truth of shape {t.shape} does not go with estimates of shape {x.shape}",
            "give (N, 4) for both: north, east, velocity north, velocity east",
        )
    position = t[:, :2] - x[:, :2]
    speed = np.hypot(t[:, 2], t[:, 3])
    moves = speed > SLOWEST_M_S
    estimated_speed = np.hypot(x[:, 2], x[:, 3])
    # `wrap` gives [-pi, pi); the negative of the negative is in (-pi, pi].
    course = -wrap(np.arctan2(x[:, 3], x[:, 2]) - np.arctan2(t[:, 3], t[:, 2]))
    course[~(moves & (estimated_speed > 0))] = np.nan
    return TrackErrors(
        position,
        speed - estimated_speed,
        course,
        ~np.isfinite(t[:, :2]).all(axis=1),
        ~np.isfinite(x[:, :2]).all(axis=1),
    )


class TrackSummary(NamedTuple):
    """One line about a track; means are of truth minus estimate, metres, m/s and radians.

    ``n`` rows compared; ``no_truth`` and ``no_estimate`` rows that could not be. ``mae`` is the mean
    distance, the "MAE estimated position" of H tables 7.2 and 7.4; ``rmse`` the root of the mean squared
    distance.
    """

    n: int
    no_truth: int
    no_estimate: int
    mean_north: float
    mean_east: float
    mae: float
    rmse: float
    rmse_speed: float
    rmse_course: float


def summarise_track(errors: TrackErrors) -> TrackSummary:
    """One line about a track.

    Parameters
    ----------
    errors
        From `wildlab.evaluation.errors.track_errors`: m, m/s and rad, truth minus estimate.

    Returns
    -------
    TrackSummary
        Of the position over the ``n`` rows that have both a truth and an estimate; speed and course each
        over the rows where it is known. NaN where there is no row.
    """
    known = ~(errors.no_truth | errors.no_estimate)
    e = errors.position[known]
    distance = np.hypot(*e.T)
    return TrackSummary(
        int(known.sum()),
        int(errors.no_truth.sum()),
        int(errors.no_estimate.sum()),
        _mean(e[:, 0]),
        _mean(e[:, 1]),
        _mean(distance),
        _root_mean_square(distance),
        _root_mean_square(errors.speed),
        _root_mean_square(errors.course),
    )


def _mean(values: Array) -> float:
    known = values[np.isfinite(values)]
    return float(known.mean()) if len(known) else float("nan")


def _root_mean_square(values: Array) -> float:
    return float(np.sqrt(_mean(values**2)))
