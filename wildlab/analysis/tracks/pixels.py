"""One target of a flight through the tracking filters of H 6 and 7, and the tracks beside the truth.

`PixelMeasurements` are of one camera and target, with the poses of one navigation source: the filters see
the same detections, and a comparison of sources is one of these.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import partial
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from wildlab.analysis.georeference import camera_poses, observe
from wildlab.errors import WildlabError
from wildlab.evaluation.consistency import (
    autocorrelation,
    average,
    chi_square_interval,
    share_inside,
    whiten,
    worth_of_errors,
)
from wildlab.evaluation.errors import summarise_track, track_errors
from wildlab.flight.clocks import frame_times, truth_at
from wildlab.flight.store import Flight
from wildlab.geometry.camera_poses import CameraPoses
from wildlab.geometry.frames import Array
from wildlab.geometry.georeference import georeference_pixels
from wildlab.tracking.batch import BatchCamera, run_batch
from wildlab.tracking.kalman import Considered
from wildlab.tracking.motion import Motion, constant_velocity
from wildlab.tracking.run import Start, Track, start_from_first
from wildlab.tracking.sensors import POSE, Sensor, pixels

#: The velocity of the truth is taken over this time: from one fix of a single-frequency receiver to the next,
#: a course means little.
TRUTH_VELOCITY_OVER_S = 10.0


class PixelMeasurements(NamedTuple):
    """N frames of one camera, from the first to the last that shows the target.

    Frames without a detection, or without a pose, have NaN; they are there because the process noise of H
    (6.2) depends on how time is cut, and the thesis cut it by images.

    Attributes
    ----------
    times
        (N,) s, in order.
    uv
        (N, 2) pixels.
    positions
        (N, 2) the same on the ground: north and east, m.
    poses
        The camera's, one a frame, with their covariance where the source states one.
    plane_down
        (N,) m, filled in between detections.
    truth
        (N, 4) north, east, and velocity; NaN where it is not known.
    """

    times: Array
    uv: Array
    positions: Array
    poses: CameraPoses
    plane_down: Array
    truth: Array

    @property
    def detected(self) -> NDArray[np.bool_]:
        """(N,) whether the frame has a detection that lies on the ground."""
        return np.asarray(np.isfinite(self.positions).all(axis=1))

    @property
    def sensor(self) -> Sensor:
        """For the readable filters of `wildlab.tracking.run`."""
        return pixels(self.poses, self.plane_down)


class CvTuning(NamedTuple):
    """How H tunes a filter with constant velocity: standard deviations, per axis.

    ``acceleration`` m/s^2 (H 6.2), ``position_0`` m and ``velocity_0`` m/s at the start, ``measurement`` in
    metres on the ground, ``pixel`` in pixels.
    """

    acceleration: float
    position_0: float
    velocity_0: float
    measurement: float
    pixel: float

    @property
    def motion(self) -> Motion:
        """The motion model, H (6.1)-(6.2)."""
        return partial(constant_velocity, sd_acceleration=self.acceleration)


def read_pixels(flight: Flight, source: str, target: str | None = None) -> PixelMeasurements:
    """What the camera saw of a target, with the poses of a ``nav`` source.

    Parameters
    ----------
    flight
        With frames, pixel detections and poses.
    source
        Name of the ``nav`` table.
    target
        May be left out where the detections name one only.

    Returns
    -------
    PixelMeasurements

    Raises
    ------
    WildlabError
        Where there is no such target or several to choose from, or none of its detections has a pose.

    Examples
    --------
    >>> from wildlab.simulation.twins import simulate_twin
    >>> seen = read_pixels(simulate_twin("large-ship", 1), "autopilot")
    >>> seen.uv.shape == (len(seen.times), 2)
    True
    """
    seen = observe(flight, source)
    names = sorted(set(seen.table["target_id"]))
    if target is None and len(names) != 1:
        raise WildlabError(
            f"the detections name {len(names)} targets", f"choose one of {', '.join(names)}", field="target"
        )
    name = names[0] if target is None else target
    if name not in names:
        raise WildlabError(
            f"no detection names the target {name!r}", f"choose one of {', '.join(names)}", field="target"
        )
    seen = seen.take((seen.table["target_id"] == name).to_numpy())
    stamps = frame_times(flight)
    order = np.argsort(stamps, kind="stable")
    place = np.empty(len(order), int)
    place[order] = np.arange(len(order))
    row = place[flight.frame_rows(seen.table["frame_id"])]
    first, last = int(row.min()), int(row.max()) + 1
    taken = order[first:last]
    times = stamps[taken]
    poses = camera_poses(flight, source, times, taken)
    uv = np.full((len(times), 2), np.nan)
    # Over terrain a ray that meets no ground is no measurement: its plane would be invented.
    met = np.isfinite(seen.plane_down) if seen.terrain is not None else np.ones(len(row), bool)
    uv[row - first] = np.where(met[:, None], seen.uv, np.nan)
    plane = np.full(len(times), np.nan)
    plane[row - first] = seen.plane_down
    known = np.isfinite(plane)
    if not known.any():
        raise WildlabError(
            "how high the target lies is not known", "give plane_down_m", field="detections.plane_down_m"
        )
    plane = np.interp(times, times[known], plane[known])
    positions = georeference_pixels(poses, uv, plane)[:, :2]
    if not np.isfinite(positions).any():
        raise WildlabError(
            "none of the detections lies on the ground", "does the source cover the flight?", field="nav"
        )
    return PixelMeasurements(times, uv, positions, poses, plane, truth_states(flight, name, times))


def truth_states(flight: Flight, target: str, times: ArrayLike) -> Array:
    """(N, 4) north, east and velocity of a target as its own log has them; NaN where it has not."""
    at = np.asarray(times, float)
    if flight.truth is None:
        return np.full((len(at), 4), np.nan)
    rows = flight.truth[flight.truth["target_id"] == target]
    if rows.empty:
        return np.full((len(at), 4), np.nan)
    offset, half = flight.manifest.clocks.truth_offset_s, TRUTH_VELOCITY_OVER_S / 2

    def where(t: Array) -> Array:
        return truth_at(rows, t, offset_s=offset)[1][0, :, :2]

    return np.hstack([where(at), (where(at + half) - where(at - half)) / (2 * half)])


def start(seen: PixelMeasurements, tuning: CvTuning, n: int = 4, **more: float) -> Start:
    """On the first georeferenced detection, with zero speed (H 6.2.4, 6.3.3); see `start_from_first`."""
    return start_from_first(seen.times, seen.positions, tuning.position_0, tuning.velocity_0, n, **more)


def track_positions(seen: PixelMeasurements, tuning: CvTuning) -> Track:
    """The Kalman filter on georeferenced detections, H 6.2.

    Parameters
    ----------
    seen
        From `read_pixels`.
    tuning
        Its ``pixel`` is not used.

    Returns
    -------
    Track
        (N, 4) states north, east, and velocities; innovations in metres.

    Examples
    --------
    >>> from wildlab.simulation.twins import simulate_twin
    >>> seen = read_pixels(simulate_twin("large-ship", 1), "autopilot")
    >>> track = track_positions(seen, CvTuning(0.1, 10.0, 5.0, 10.0, 2.0))
    >>> track.x.shape == (len(seen.times), 4)
    True
    """
    return _compiled(seen, tuning, seen.positions, tuning.measurement)


def track_pixels(seen: PixelMeasurements, tuning: CvTuning) -> Track:
    """The extended Kalman filter on pixels, H 6.3; poses are taken as true.

    Parameters
    ----------
    seen
        From `read_pixels`.
    tuning
        Its ``measurement`` is not used.

    Returns
    -------
    Track
        (N, 4) states as from `track_positions`; innovations in pixels.
    """
    return _compiled(seen, tuning, seen.uv, tuning.pixel, BatchCamera(seen.poses, seen.plane_down))


def track_schmidt(
    seen: PixelMeasurements,
    tuning: CvTuning,
    covariance: ArrayLike | None = None,
) -> Track:
    """The Schmidt-Kalman filter on pixels, H 7.4.

    Parameters
    ----------
    seen
        From `read_pixels`.
    tuning
        Its ``measurement`` is not used.
    covariance
        (N, 6, 6) of the poses in place of that which the source states.

    Returns
    -------
    Track
        As from `track_pixels`.

    Raises
    ------
    WildlabError
        Where there is no covariance of the poses.
    """
    own = seen.poses.covariance if covariance is None else np.asarray(covariance, float)
    if own is None:
        raise WildlabError(
            "the poses have no covariance", "use those of the MEKF: navigate_mekf(flight)", field="nav"
        )
    view = BatchCamera(seen.poses, seen.plane_down)
    return _compiled(seen, tuning, seen.uv, tuning.pixel, view, Considered(POSE, own))


#: The filters of H by name: on pixels with the poses' uncertainty considered, on pixels, on the ground.
FILTERS: dict[str, Callable[[PixelMeasurements, CvTuning], Track]] = {
    "schmidt": track_schmidt,
    "ekf": track_pixels,
    "kf": track_positions,
}


def _compiled(
    seen: PixelMeasurements,
    tuning: CvTuning,
    z: Array,
    sd: float,
    view: BatchCamera | None = None,
    pose: Considered | None = None,
) -> Track:
    """One run of the compiled filters, which a test holds against the readable ones; ``sd`` is that of z."""
    R, begin = np.eye(2) * sd**2, start(seen, tuning)
    return run_batch(seen.times, z[None], R, tuning.motion, begin, view=view, pose=pose)[0]


class Scored(NamedTuple):
    """A track beside the truth: NEES of the position at every frame, NIS at every detection, and numbers.

    ``numbers`` by name: ``mean_north``, ``mean_east``, ``mae``, ``rmse`` (m; truth minus estimate),
    ``rmse_speed`` (m/s), ``rmse_course`` (rad), ``nees`` and ``nis`` (means), ``fraction_nees_inside``,
    ``fraction_nis_inside`` (of the 95 % bounds of one run), ``lag1_autocorrelation_north``, ``..._east`` (of
    the innovations; ``..._u``, ``..._v`` in pixels).
    """

    nees: Array
    nis: Array
    numbers: dict[str, float]


def evaluate_track(
    seen: PixelMeasurements, track: Track, axes: tuple[str, str] = ("north", "east")
) -> Scored:
    """Compare a track with the truth at every frame since its start, as the thesis does.

    The truth is taken for exact, as in H 7.5; where it comes from a receiver of its own, that receiver's
    error counts as the filter's.

    Besides means over the track there are ``error_at_end`` (m), of the last frame at which the target's place
    is known; ``p95_measured`` (m), below which the distance is at 95 % of the frames
    with a detection; and ``nees_band_low``, ``nees_band_high``: the 95 % band of the mean NEES of a
    consistent filter, for as many independent values as this one's are worth.

    Parameters
    ----------
    seen
        From `read_pixels`.
    track
        What a filter made of it.
    axes
        What the innovation's two elements are called.

    Returns
    -------
    Scored
    """
    state = track.x[:, :4]
    errors = track_errors(seen.truth, state)
    white = whiten(errors.position, track.P[:, :2, :2])
    values = (white**2).sum(axis=1)
    summary = summarise_track(errors)
    bounds = chi_square_interval(2)
    numbers = {
        "mean_north": summary.mean_north,
        "mean_east": summary.mean_east,
        "mae": summary.mae,
        "rmse_speed": summary.rmse_speed,
        "rmse_course": summary.rmse_course,
        "nees": float(np.nanmean(values)),
        "nis": float(np.nanmean(track.nis)),
        "fraction_nees_inside": share_inside(values, bounds),
        "fraction_nis_inside": share_inside(track.nis, bounds),
    }
    distance = np.hypot(*(seen.truth - state)[:, :2].T)
    known, measured = np.flatnonzero(np.isfinite(values)), np.isfinite(distance) & seen.detected
    band = average(values, 2, worth_of_errors(white))
    numbers |= {
        "error_at_end": float(distance[known[-1]]) if len(known) else math.nan,
        "p95_measured": float(np.quantile(distance[measured], 0.95)) if measured.any() else math.nan,
        "nees_band_low": band.low,
        "nees_band_high": band.high,
    }
    innovation = track.innovation[np.isfinite(track.innovation).all(axis=1)]
    for i, axis in enumerate(axes):
        numbers[f"lag1_autocorrelation_{axis}"] = float(autocorrelation(innovation[:, i], 1)[1])
    return Scored(values, track.nis, numbers)


def evaluate_measurements(seen: PixelMeasurements) -> dict[str, float]:
    """The georeferenced detections themselves: mean error (truth minus measurement) and mean distance, m.

    Also the autocorrelation of their errors from one detection to the next.

    Parameters
    ----------
    seen
        From `read_pixels`.

    Returns
    -------
    dict
        By name.
    """
    e = (seen.truth[:, :2] - seen.positions)[seen.detected]
    return {
        "mean_north": float(np.nanmean(e[:, 0])),
        "mean_east": float(np.nanmean(e[:, 1])),
        "mae_georeferenced": float(np.nanmean(np.hypot(*e.T))),
        **{
            f"lag1_autocorrelation_{axis}": float(autocorrelation(column[np.isfinite(column)], 1)[1])
            for axis, column in zip(("north", "east"), e.T, strict=True)
        },
    }
