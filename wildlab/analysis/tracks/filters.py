"""The filters that follow one target by one sensor: the same detections to each, other beliefs of errors.

``ekf`` (``kf`` where positions are measured)
    Errors are new at every look, H (3.5), (3.7).
``ukf``, ``imm``
    The same by sigma points; and with two motions, a calm one and a lively one, H 3.2.3.
``coloured``
    Errors of successive looks are alike, and the filter works on differences of positions, H 7.2.2.
``schmidt``
    Platform, clock or range are wrong by something that lasts, considered and not estimated, H 7.4.
``thinned``
    As the first, on detections so far apart that their errors hardly have to do with each other.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from wildlab.analysis.tracks.initiation import place_of
from wildlab.analysis.tracks.noise_model import NoiseModel, TargetModel, errors_of, spread_of
from wildlab.analysis.tracks.scans import Scans, predict_scan
from wildlab.errors import WildlabError
from wildlab.geometry.frames import Array
from wildlab.tracking.consider_parameters import Considered
from wildlab.tracking.filters import run_coloured, run_imm, run_unscented, thin
from wildlab.tracking.motion import Motion, rest
from wildlab.tracking.records import Start, Track
from wildlab.tracking.run import run_filter
from wildlab.tracking.sensors import Merged, Sensor
from wildlab.tracking.smoothing import run_smoothed, smooth

#: What the name of a filter ends with whose estimates know later detections too, and those that can.
SMOOTHED = "-smoothed"
SMOOTHABLE = tuple(f"{name}{SMOOTHED}" for name in ("ekf", "schmidt", "ukf", "thinned"))
NAMES = ("ekf", "ukf", "imm", "coloured", "schmidt", "thinned")
#: The two motions of ``imm``: as lively as the target is believed to be, and a third of it; each lasts so
#: long, s.
CALM, STAY_S = 1 / 3, 30.0


def possible(scans: Scans, beliefs: NoiseModel) -> dict[str, str]:
    """Filters that a sensor's detections can go through: ``""``, or why they cannot."""
    considered = errors_of(scans, beliefs) is not None
    placed = "range" in scans.elements or scans.kind in ("position", "pixel")
    return {
        **dict.fromkeys(("ekf", "ukf", "imm"), ""),
        "coloured": "" if placed else f"a {scans.kind} is no position, and only those are differenced",
        "schmidt": "" if considered else "nothing is said of errors that last, and poses have no covariance",
        "thinned": ""
        if np.isfinite(beliefs.thinning_s)
        else "nothing is said of how long errors last (thinning_s)",
    }


class Measured(NamedTuple):
    """A target's detections: looks ``merged`` with white noise, its ``own`` (N, m), the track ``first`` that
    the filter with white noise made of them, and where it begins."""

    merged: Merged
    own: Array
    first: Track
    begin: Start


def run_named(
    name: str,
    measured: Measured,
    targets: TargetModel,
    considering: tuple[Merged, Considered] | None,
    alone: tuple[Scans, NoiseModel, slice] | None,
) -> Track | None:
    """One filter on the detections that the white one chose.

    Parameters
    ----------
    considering
        The same detections with what is new at each, and the errors that are considered beside it.
    alone
        Of one sensor its looks, what is believed of it, and which looks these are. None: there are several.

    Returns
    -------
    Track
        None where several sensors have nothing to consider.

    Raises
    ------
    WildlabError
        Where there is no such filter, or the detections of the one sensor cannot go through it.
    """
    base = name.removesuffix(SMOOTHED)
    base, smoothed = "ekf" if base == "kf" else base, name.endswith(SMOOTHED)
    if alone is not None:
        able = possible(*alone[:2])
        if why := able.get(base, "there is no such filter"):
            raise WildlabError(
                f"the filter {name!r} cannot follow by the sensor {alone[0].sensor!r}: {why}",
                f"use one of {', '.join(one for one, reason in able.items() if not reason)}",
                field="--filter",
            )
    (times, _, R, sensor, *_), own, first, begin = measured
    R, motion = R if R.ndim == 3 else R[:, 0], targets.motion()
    run = run_smoothed if smoothed else run_filter
    if base == "coloured" and alone is not None:
        return _coloured(*alone, own, motion, begin)
    if base == "imm":
        both = [targets.motion(CALM), motion]
        return run_imm(times, own, R, sensor, both, (STAY_S, STAY_S), begin).track
    if base in ("ekf", "ukf"):
        if base == "ekf":
            track = first
        elif targets.start_speed_m_s:
            track = run_unscented(times, own, R, sensor, motion, begin)
        else:
            track = _unscented_at_rest(times, own, R, sensor, begin)
        track = smooth(track, motion) if smoothed else track
    elif base == "thinned" and alone is not None:
        kept = thin(times, alone[1].thinning_s, first.used)[:, None]
        track = run(times, np.where(kept, own, np.nan), R, sensor, motion, begin)
    elif considering is not None:
        track = run(*considering[0][:4], motion, begin, pose=considering[1])
    else:
        return None
    if not smoothed:
        return track
    # The innovations of a smoothed track are the filter's, and not counted twice.
    innovation, S, nis = (np.full_like(one, np.nan) for one in (track.innovation, track.S, track.nis))
    return track._replace(innovation=innovation, S=S, nis=nis)


def _unscented_at_rest(times: Array, own: Array, R: Array, sensor: Sensor, begin: Start) -> Track:
    """Sigma points of the place alone: a speed that is known to be zero has no spread."""
    start = begin._replace(x=begin.x[:2], P=begin.P[:2, :2])
    track = run_unscented(times, own, R, sensor, rest, start)
    x, P = np.zeros((len(times), 4)), np.zeros((len(times), 4, 4))
    x[:, :2], P[:, :2, :2] = track.x, track.P
    gone: NDArray[np.bool_] = np.asarray(~np.isfinite(track.x).all(axis=1))
    x[gone], P[gone] = np.nan, np.nan
    return track._replace(x=x, P=P)


def _coloured(
    scans: Scans, beliefs: NoiseModel, rows: slice, seen: Array, motion: Motion, begin: Start
) -> Track:
    own = np.full((len(scans.times), seen.shape[-1]), np.nan)
    own[rows] = seen
    positions, R = _positions(scans, own, beliefs)
    gap, F_c = beliefs.longest_gap_s, beliefs.fading
    used = np.flatnonzero(np.isfinite(positions[:, 0]))
    # Behind a gap the measurement itself is used, and its error is the whole one.
    whole = np.ones(len(scans.times), bool)
    whole[used[1:]] = np.diff(scans.times[used]) > gap
    if beliefs.lasting is None:
        lasting = _lasting(scans, positions, beliefs)
        total = R + lasting
        driving = (1 + F_c**2) * total - 2 * F_c * lasting
    else:
        total, driving = R, (1 + F_c**2 - 2 * F_c * beliefs.lasting) * R
    R_w = np.where(whole[:, None, None], total, driving)[rows]
    return run_coloured(
        scans.times[rows], positions[rows], R_w, motion, begin, F_c=np.eye(2) * F_c, longest_gap=gap
    )


def _positions(scans: Scans, own: Array, beliefs: NoiseModel) -> tuple[Array, Array]:
    """North and east (N, 2) of measurements (N, m), and the covariances (N, 2, 2) that white noise gives."""
    n = len(own)
    if scans.kind == "position":
        return own, np.tile(np.diag(beliefs.white**2), (n, 1, 1))
    places, R = np.full((n, 2), np.nan), np.full((n, 2, 2), np.nan)
    bare = beliefs._replace(considered=())
    alone = scans if scans.poses is None else scans._replace(
        poses=type(scans.poses)(scans.poses.camera, scans.poses.mount, scans.poses.p_nb, scans.poses.R_nb,
                                scans.poses.pan, scans.poses.tilt)
    )  # fmt: skip
    for row in np.flatnonzero(np.isfinite(own).all(axis=1)):
        found = place_of(alone, int(row), own[row], bare)
        if found is not None:
            places[row], R[row] = found
    return places, R


def _lasting(scans: Scans, positions: Array, beliefs: NoiseModel) -> Array:
    """(N, 2, 2) what considered errors do to positions."""
    expected = predict_scan(scans, positions, np.zeros_like(positions))
    inverse = np.linalg.pinv(np.nan_to_num(expected.H_position[..., :2]))
    spread = spread_of(scans, beliefs, np.nan_to_num(expected.H_pose))
    if spread is None:
        return np.zeros((len(positions), 2, 2))
    return np.asarray(inverse @ np.nan_to_num(spread) @ np.swapaxes(inverse, 1, 2))
