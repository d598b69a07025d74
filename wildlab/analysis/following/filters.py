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

from functools import partial

import numpy as np

from wildlab.analysis.following.consider_parameters import errors_of, spread_of
from wildlab.analysis.following.expected import predict_scan, sensor_of
from wildlab.analysis.following.initiation import place_of
from wildlab.analysis.following.noise_model import NoiseModel, TargetModel
from wildlab.analysis.scans import Scans
from wildlab.errors import WildlabError
from wildlab.geometry.frames import Array
from wildlab.tracking.filters import run_coloured, run_imm, run_unscented, thin
from wildlab.tracking.motion import Motion, white_acceleration
from wildlab.tracking.records import Start, Track
from wildlab.tracking.run import Ends, run_filter
from wildlab.tracking.smoothing import run_smoothed, smooth

#: What the name of a filter ends with whose estimates know later detections too, and those that can.
SMOOTHED = "-smoothed"
SMOOTHABLE = tuple(f"{name}{SMOOTHED}" for name in ("ekf", "schmidt", "ukf", "thinned"))
NAMES = ("ekf", "ukf", "imm", "coloured", "schmidt", "thinned")
#: The two motions of ``imm``: as lively as the target is believed to be, and a third of it; each lasts so
#: long, s.
CALM, STAY_S = 1 / 3, 30.0


def motion_of(targets: TargetModel, share: float = 1.0) -> Motion:
    """Constant velocity with white acceleration."""
    return partial(white_acceleration, density=share * targets.density)


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


def white_noise(scans: Scans, sds: Array) -> Array:
    """(N, m, m) of one detection a look, or (m, m): its own where it has one."""
    return np.diag(np.asarray(sds, float) ** 2)


def choose(
    scans: Scans,
    seen: Array,
    beliefs: NoiseModel,
    targets: TargetModel,
    begin: Start,
    *,
    gate: bool = True,
    ends: Ends | None = None,
) -> Track:
    """The filter with white noise, which chooses the nearest of ``seen`` (N, K, m), in its gate or of all.

    ``ends`` as in `run_filter`.
    """
    sensor = sensor_of(scans, np.zeros_like(scans.platform))
    return run_filter(
        scans.times, seen, white_noise(scans, beliefs.white), sensor, motion_of(targets), begin,
        gate_probability=targets.gate_probability if gate else 1.0, ends=ends,
    )  # fmt: skip


def follow_with(
    name: str,
    scans: Scans,
    own: Array,
    first: Track,
    beliefs: NoiseModel,
    targets: TargetModel,
    begin: Start,
) -> Track:
    """One filter on the detections (N, m) that the white one, ``first``, chose.

    Raises
    ------
    WildlabError
        Where there is no such filter, or the detections cannot go through it.
    """
    base = name.removesuffix(SMOOTHED)
    why = possible(scans, beliefs).get(base, "there is no such filter")
    if why:
        able = ", ".join(one for one, reason in possible(scans, beliefs).items() if not reason)
        raise WildlabError(
            f"the filter {name!r} cannot follow by the sensor {scans.sensor!r}: {why}",
            f"use one of {able}",
            field="--filter",
        )
    motion, smoothed = motion_of(targets), name != base
    sensor = sensor_of(scans, np.zeros_like(scans.platform))
    white = white_noise(scans, beliefs.white)
    if base == "ekf":
        return without_innovations(smooth(first, motion)) if smoothed else first
    if base == "ukf":
        track = run_unscented(scans.times, own, white, sensor, motion, begin)
        return without_innovations(smooth(track, motion)) if smoothed else track
    if base == "imm":
        both = [motion_of(targets, CALM), motion]
        return run_imm(scans.times, own, white, sensor, both, (STAY_S, STAY_S), begin).track
    if base == "coloured":
        return _coloured(scans, own, beliefs, motion, begin)
    run = run_smoothed if smoothed else run_filter
    if base == "thinned":
        kept = thin(scans.times, beliefs.thinning_s, first.used)[:, None]
        track = run(scans.times, np.where(kept, own, np.nan), white, sensor, motion, begin)
    else:
        errors = errors_of(scans, beliefs)
        # An error of the clock moves the target by what the filter with white noise says it moves.
        drift = np.nan_to_num(first.x[:, 2:4] - scans.platform_velocity)
        noise = white_noise(scans, beliefs.noise)
        track = run(scans.times, own, noise, sensor_of(scans, drift), motion, begin, pose=errors)
    return without_innovations(track) if smoothed else track


def without_innovations(track: Track) -> Track:
    """A smoothed track: its innovations are the filter's, and not counted twice."""
    nothing = np.full_like(track.nis, np.nan)
    return track._replace(
        innovation=np.full_like(track.innovation, np.nan), S=np.full_like(track.S, np.nan), nis=nothing
    )


def _coloured(scans: Scans, own: Array, beliefs: NoiseModel, motion: Motion, begin: Start) -> Track:
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
    R_w = np.where(whole[:, None, None], total, driving)
    return run_coloured(scans.times, positions, R_w, motion, begin, F_c=np.eye(2) * F_c, longest_gap=gap)


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
