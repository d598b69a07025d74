"""What a sighting's poses state and are off by, and how its flight was flown: premises of comparisons."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from wildlab.analysis.navigation_errors import AXES, PLACES, NavigationErrors, errors_against
from wildlab.analysis.navigation_inputs import VELOCITY
from wildlab.analysis.track import Sighting
from wildlab.evaluation.track_errors import SLOWEST_M_S
from wildlab.flight.clocks import poses_at
from wildlab.flight.store import Flight
from wildlab.geometry.frames import matrix_to_euler, wrap
from wildlab.geometry.uncertainty import ground_jacobians

#: A time without detections that is longer is a pause, s.
PAUSE_S = 2.0
#: From this bank on an airframe turns, rad.
TURNING = np.radians(20.0)
#: Columns of `wildlab.analysis.navigation_errors.NavigationErrors` that are a pose's, and their names.
_POSE = [0, 1, 2, 6, 7, 8]
NAMES = (*PLACES, *AXES)


def pauses(seen: Sighting) -> list[NDArray[np.intp]]:
    """Rows of the frames of each pause, from the first to the last without a detection.

    Parameters
    ----------
    seen
        From `wildlab.analysis.track.sighting`.

    Returns
    -------
    list of (K,) arrays
        In order of time; empty where no two detections are further apart than `PAUSE_S`.
    """
    rows = np.flatnonzero(seen.seen)
    long = np.flatnonzero(np.diff(seen.times[rows]) > PAUSE_S)
    return [np.arange(rows[i] + 1, rows[i + 1]) for i in long]


def pose_numbers(own: NavigationErrors) -> dict[str, float]:
    """What poses state of themselves and how far they are off; m and degrees.

    Parameters
    ----------
    own
        Errors of a nav source against the true poses of the camera's airframe, at the frames:
        ``errors_against(flight.nav["truth"], flight.nav[source], seen.times)``.

    Returns
    -------
    dict
        ``mean_sd_north`` to ``mean_sd_yaw``, means of what is stated, and ``rms_north`` to ``rms_yaw``.
    """
    numbers = {}
    for i, name in zip(_POSE, NAMES, strict=True):
        numbers[f"mean_sd_{name}"] = shown(name, mean(own.sd[:, i]))
        numbers[f"rms_{name}"] = shown(name, rms(own.error[:, i]))
    return numbers


def premise_numbers(flight: Flight, seen: Sighting, source: str, own: NavigationErrors) -> dict[str, float]:
    """What sentences on the poses speak of; degrees.

    Parameters
    ----------
    flight
        With the nav sources ``autopilot`` and ``source``.
    seen
        With the poses of that source.
    own
        As for `pose_numbers`.

    Returns
    -------
    dict
        ``sd_spread``: the range that nine of ten of a stated deviation lie in over its median, of the
        coordinate or angle that changes most. ``difference_roll`` to ``difference_yaw``: RMS against the
        autopilot; ``outside_...``: share beyond two deviations. ``difference_turning``, ``..._straight`` and
        ``rms_turning``, ``..._straight``: roll's, against autopilot and truth, while the airframe turns and
        not. ``shift_px``: RMS over detections and both axes of what the pose's error moves the target by in
        the image; ``largest_shift_px``: the farthest that it does.
    """
    sd = own.sd[np.isfinite(own.sd[:, 0])][:, _POSE]
    low, middle, high = np.quantile(sd, (0.05, 0.5, 0.95), axis=0)
    numbers = {"sd_spread": float(((high - low) / middle).max())}
    beside = errors_against(flight.nav["autopilot"], flight.nav[source], seen.times)
    for i, name in enumerate(AXES, 6):
        off = beside.error[:, i]
        beyond = np.where(np.isfinite(off), np.abs(off) > 2 * beside.sd[:, i], np.nan)
        numbers[f"difference_{name}"] = shown(name, rms(off))
        numbers[f"outside_{name}"] = mean(beyond)
    turns = np.abs(matrix_to_euler(seen.poses.R_nb)[:, 0]) > TURNING
    for word, rows in (("turning", turns), ("straight", ~turns)):
        numbers[f"difference_{word}"] = shown("roll", rms(beside.error[rows, 6]))
        numbers[f"rms_{word}"] = shown("roll", rms(own.error[rows, 6]))
    rows = np.flatnonzero(seen.seen)
    J = ground_jacobians(seen.poses.take(rows), seen.uv[rows], seen.plane_down[rows])
    shift = np.linalg.solve(J.pixel, J.pose @ own.error[rows][:, _POSE, None])
    far = np.hypot(*shift[:, :, 0].T)
    return numbers | {"shift_px": rms(shift.ravel()), "largest_shift_px": float(np.nanmax(far))}


def flight_numbers(flight: Flight, seen: Sighting) -> dict[str, float]:
    """How a twin was flown, and over what.

    Parameters
    ----------
    flight
        With the nav source ``truth`` and inertial samples.
    seen
        What its camera saw.

    Returns
    -------
    dict
        ``detections``, ``pauses``; shares of the frames in which the airframe is ``turning`` and the target
        ``moving`` faster than `SLOWEST_M_S`; ``crab`` (deg), RMS of heading minus course on straight legs;
        ``settled``, for how long (s) there were inertial samples when the target was first seen.
    """
    nav = flight.nav["truth"]
    p, R, _ = poses_at(nav, seen.times)
    roll, _, yaw = matrix_to_euler(R).T
    north, east = (np.interp(seen.times, nav["time_s"], nav[name]) for name in VELOCITY[:2])
    turns = np.abs(roll) > TURNING
    crab = wrap(yaw - np.arctan2(east, north))[~turns & np.isfinite(p[:, 0])]
    return {
        "detections": float(seen.seen.sum()),
        "pauses": float(len(pauses(seen))),
        "turning": float(turns.mean()),
        "moving": mean(np.hypot(*seen.truth[:, 2:].T) > SLOWEST_M_S),
        "crab": float(np.degrees(rms(crab))),
        "settled": float(seen.times[0] - flight.table("imu")["time_s"].iloc[0]),
    }


def shown(name: str, value: float) -> float:
    """A number of a pose for a reader: angles (by their name) in degrees, coordinates as they are."""
    return float(np.degrees(value)) if name in AXES else value


def mean(values: ArrayLike) -> float:
    """Mean of the known values; NaN where there is none."""
    array = np.asarray(values, float)
    known = array[np.isfinite(array)]
    return float(known.mean()) if len(known) else float("nan")


def rms(values: ArrayLike) -> float:
    """Root mean square of the known values; NaN where there is none."""
    return float(np.sqrt(mean(np.square(np.asarray(values, float)))))
