"""How far a track is from the truth: position, along and across its course, speed and course.

All errors are truth minus estimate, as H (3.11) has them (`consistency.ERROR_CONVENTION`).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from wildlab.errors import WildlabError
from wildlab.geometry.frames import wrap

Array = NDArray[np.float64]

#: A target slower than this has no course worth comparing: positions a few centimetres wrong, a second apart,
#: turn it about.
SLOWEST_M_S = 0.2


class TrackErrors(NamedTuple):
    """Errors of N estimates, truth minus estimate; NaN where truth or estimate is not known.

    ``position`` (N, 2) north and east, metres. ``along`` and ``across`` (N,) of the true course, metres:
    positive where the truth is ahead of the estimate, and to its right. ``speed`` (N,) m/s. ``course`` (N,)
    radians in (-pi, pi]. ``no_truth`` and ``no_estimate`` (N,): rows that cannot be compared, and why.
    """

    position: Array
    along: Array
    across: Array
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
    ahead = np.where(moves[:, None], t[:, 2:] / np.where(moves, speed, 1.0)[:, None], np.nan)
    along = np.sum(position * ahead, axis=1)
    across = position[:, 1] * ahead[:, 0] - position[:, 0] * ahead[:, 1]
    estimated_speed = np.hypot(x[:, 2], x[:, 3])
    # `wrap` gives [-pi, pi); the negative of the negative is in (-pi, pi].
    course = -wrap(np.arctan2(x[:, 3], x[:, 2]) - np.arctan2(t[:, 3], t[:, 2]))
    course[~(moves & (estimated_speed > 0))] = np.nan
    return TrackErrors(
        position,
        along,
        across,
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
    rmse_north: float
    rmse_east: float
    mean_along: float
    mean_across: float
    rmse_along: float
    rmse_across: float
    mean_speed: float
    rmse_speed: float
    mean_course: float
    rmse_course: float


def summarise_track(errors: TrackErrors) -> TrackSummary:
    """One line about a track.

    Parameters
    ----------
    errors
        From `wildlab.evaluation.track_errors.track_errors`: m, m/s and rad, truth minus estimate.

    Returns
    -------
    TrackSummary
        Of the position over the ``n`` rows that have both a truth and an estimate; along, across, speed and
        course each over the rows where it is known. NaN where there is no row.
    """
    known = ~(errors.no_truth | errors.no_estimate)
    e = errors.position[known]
    distance = np.hypot(*e.T)
    # The mean of a direction is that of its unit vectors.
    turn = errors.course[np.isfinite(errors.course)]
    mean_course = float(np.angle(np.mean(np.exp(1j * turn)))) if len(turn) else float("nan")
    return TrackSummary(
        int(known.sum()),
        int(errors.no_truth.sum()),
        int(errors.no_estimate.sum()),
        _mean(e[:, 0]),
        _mean(e[:, 1]),
        _mean(distance),
        _root_mean_square(distance),
        _root_mean_square(e[:, 0]),
        _root_mean_square(e[:, 1]),
        _mean(errors.along),
        _mean(errors.across),
        _root_mean_square(errors.along),
        _root_mean_square(errors.across),
        _mean(errors.speed),
        _root_mean_square(errors.speed),
        mean_course,
        _root_mean_square(errors.course),
    )


def _mean(values: Array) -> float:
    known = values[np.isfinite(values)]
    return float(known.mean()) if len(known) else float("nan")


def _root_mean_square(values: Array) -> float:
    return float(np.sqrt(_mean(values**2)))
