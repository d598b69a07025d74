"""Which of two detections belongs to the tracked target: three ways to ask, by Monte Carlo, H 6.4.3.

Two targets at rest are seen in every image of a short flight, from poses that are known with white errors.
One of them, the main object, is tracked, and the detection with the smaller normalised innovation squared is
taken for its own. That distance is computed from georeferenced positions (H 6.2.3), from pixels (6.8), from
azimuth and elevation (6.11), or from pixels and angles together, as H 6.4.3 proposes at its end: there the
two distances are added, so that where they disagree the surer one decides.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from wildlab.errors import WildlabError
from wildlab.flight.store import Flight
from wildlab.geometry.camera import in_image
from wildlab.geometry.camera_poses import CameraPoses
from wildlab.geometry.frames import Array, euler_to_matrix, matrix_to_euler, quaternion_to_matrix
from wildlab.geometry.georeference import ground_to_pixel, pixel_to_plane
from wildlab.geometry.mount import Mount
from wildlab.tracking.association import innovation_squared
from wildlab.tracking.kalman import correct, predict
from wildlab.tracking.motion import constant_velocity
from wildlab.tracking.sensors import (
    azimuth_elevation_of_pixel,
    difference,
    on_state,
    predict_pixel,
    target_in_camera,
)

#: The three forms of H table 6.6, in its order.
FORMS = ("position", "pixels", "angles")
#: What a detection is associated by: a form, or pixels and angles together.
GATES = (*FORMS, "both")

#: H 6.4.3: 141 images at 10 Hz; the second target 10 m north and 15 m east of the main one, each displaced
#: by 10 m per axis; 50 iterations of the filter before, on the true position with 10 m of noise per axis.
IMAGES, RATE_HZ, WARM_UP = 141, 10.0, 50
APART, DISPLACED_M, WARM_UP_M = (10.0, 15.0), 10.0, 10.0
#: H table 6.4: standard deviations of north, east, down (m), roll, pitch, yaw, pan and tilt (rad); pixels.
POSE_SD = np.array([2.0, 2.0, 5.0, *np.radians([1.0, 1.0, 2.0, 1.0, 1.0])])
PIXEL_SD = 2.0
#: H table 6.5: start, and noise of the measurements as the filters assume it.
START_P = np.diag([10.0**2, 10.0**2, 20.0, 20.0])
R_FORM = {
    "position": np.diag([10.0**2, 10.0**2]),
    "pixels": np.diag([360.0, 160.0]),
    "angles": np.diag(np.radians([6.0, 3.0]) ** 2),
}

#: Not printed. Process noise of H (6.1), m/s^2: that of the slow vessel of H 6.4.2, beside the same 10 m of
#: noise. The iterations before association begins are as far apart as the images.
SD_ACCELERATION = 0.01

#: Normal draws of a run: targets, start, warm-up, poses and pixels.
_DRAWS = (4, 2, 2 * WARM_UP, 8 * IMAGES, 4 * IMAGES)


@dataclass(frozen=True)
class Overflight:
    """True poses of `IMAGES` images over the middle between the targets, the origin of n.

    Attributes
    ----------
    poses
        T rows; the camera looks down where pan and tilt are zero.
    time_s
        (T,).
    euler
        (T, 3) rad, roll, pitch, yaw of the poses, to which the noise is added.
    """

    poses: CameraPoses
    time_s: Array
    euler: Array


class Gated(NamedTuple):
    """What happened in N runs of T images; gates in the order of `GATES`, the main object first."""

    right: NDArray[np.bool_]  # (4, N, T)
    nis: Array  # (4, N, T, 2)
    estimate: Array  # (4, N, T, 2) north, east after the update
    measured: Array  # (N, T, 2, 2) georeferenced detections
    targets: Array  # (N, 2, 2) true positions


class GatingScene(NamedTuple):
    """Draws of N runs as things: targets (N, 2, 2), warm-up, detected pixels, and poses as they are known."""

    targets: Array
    start: Array  # (N, 2)
    warm_up: Array  # (N, WARM_UP, 2)
    pixels: Array  # (N, T, 2, 2)
    poses: CameraPoses  # (N, T) rows


def overflight(flight: Flight) -> Overflight:
    """The stretch of a twin's true trajectory that passes over the origin of n with the targets in view.

    Of all stretches of 141 images at 10 Hz in which every image shows the origin, the one whose farthest
    image (horizontally) is nearest to it. A camera that looks straight down from 100 m has a point in view
    for five seconds, not for fourteen: so the gimbal, which H table 6.4 says there was, keeps pan zero and
    tilts forwards and backwards after the targets.

    Raises
    ------
    WildlabError
        If the flight has no true poses, or no stretch of them that has the origin in view.
    """
    if "truth" not in flight.nav:
        raise WildlabError("the flight has no true poses", "use a twin", file=flight.folder, field="nav")
    nav = flight.nav["truth"]
    known = nav["time_s"].to_numpy(float)
    ticks = np.arange(np.ceil(known[0] * RATE_HZ), np.floor(known[-1] * RATE_HZ) + 1) / RATE_HZ
    rows = np.searchsorted(known, ticks - 1e-6)
    p = nav[["north_m", "east_m", "down_m"]].to_numpy(float)[rows]
    R_nb = quaternion_to_matrix(nav[["q_w", "q_x", "q_y", "q_z"]].to_numpy(float)[rows])
    camera = flight.manifest.geometry_camera()
    tilt = _tilt_to_origin(p, R_nb)
    part = _stretch(CameraPoses(camera, Mount(), p, R_nb, np.zeros(len(p)), tilt))
    euler = matrix_to_euler(R_nb[part])
    poses = CameraPoses(camera, Mount(), p[part], euler_to_matrix(*euler.T), np.zeros(IMAGES), tilt[part])
    return Overflight(poses, ticks[part], euler)


def _stretch(seen: CameraPoses) -> slice:
    """See `overflight`."""
    p = seen.p_nb
    shown = in_image(seen.camera, ground_to_pixel(seen.camera, np.zeros(3), seen.p_nc, seen.R_nc))
    away = np.where(shown, np.hypot(p[:, 0], p[:, 1]), np.inf)
    windows = np.lib.stride_tricks.sliding_window_view(away, min(IMAGES, len(away)))
    first = int(np.argmin(windows.max(axis=1)))
    if len(p) < IMAGES or np.isinf(windows[first]).any():
        fix = "use a flight that passes over the origin, as large-ship does"
        raise WildlabError("nowhere does the flight have the origin of n in view for 14 s", fix, field="nav")
    return slice(first, first + IMAGES)


def _tilt_to_origin(p: Array, R_nb: Array) -> Array:
    """Tilt (T,) with which a camera that looks down has the origin of n on the line across its axis."""
    to_origin = np.einsum("tji,tj->ti", R_nb, -p)
    return np.asarray(np.arctan2(to_origin[:, 0], to_origin[:, 2]))


def streams(seed: int, runs: int) -> list[np.random.SeedSequence]:
    """An independent stream for each run; a run's does not depend on how many there are."""
    return np.random.SeedSequence(seed).spawn(runs)


def draw_scene(over: Overflight, runs: list[np.random.SeedSequence]) -> GatingScene:
    """Targets, detections and known poses of runs, with the noise of H table 6.4."""
    normal = np.stack([np.random.default_rng(run).standard_normal(sum(_DRAWS)) for run in runs])
    around, start, warm_up, pose, pixel = np.split(normal, np.cumsum(_DRAWS)[:-1], axis=1)
    N, T = len(runs), IMAGES
    half = np.array(APART) / 2
    targets = np.stack([-half, half]) + DISPLACED_M * around.reshape(N, 2, 2)
    at_sea = np.concatenate([targets, np.zeros((N, 2, 1))], axis=-1)
    exact = over.poses
    true = ground_to_pixel(exact.camera, at_sea[:, None], exact.p_nc[:, None], exact.R_nc[:, None])
    off = POSE_SD * pose.reshape(N, T, 8)
    euler = over.euler + off[..., 3:6]
    pan, tilt = (0.0 if angle is None else angle for angle in (exact.pan, exact.tilt))
    known = replace(
        exact,
        p_nb=exact.p_nb + off[..., :3],
        R_nb=euler_to_matrix(*np.moveaxis(euler, -1, 0)),
        pan=pan + off[..., 6],
        tilt=tilt + off[..., 7],
    )
    main = targets[:, 0]
    return GatingScene(
        targets,
        main + np.sqrt(START_P[0, 0]) * start,
        main[:, None] + WARM_UP_M * warm_up.reshape(N, WARM_UP, 2),
        true + PIXEL_SD * pixel.reshape(N, T, 2, 2),
        known,
    )


def gate(over: Overflight, runs: list[np.random.SeedSequence], *, assigned: bool = False) -> Gated:
    """Every image of every run, associated by each of `GATES`. Keeps everything: for some 1000 runs.

    What updates the track is not published: the main object's own measurement, or the one ``assigned``.
    """
    return _gate(draw_scene(over, runs), assigned=assigned)


class Outcome(NamedTuple):
    """What became of each of N runs, per cent of its images."""

    rate: Array  # (4, N) associated rightly, gates in the order of `GATES`
    mistakes: Array  # (3, N) wrong by pixels alone, by angles alone, by both
    same_images: NDArray[np.bool_]  # (N,) whether pixels and angles are wrong in exactly the same images


def outcomes(
    over: Overflight, readings: Mapping[str, bool], runs: int, seed: int, chunk: int = 500
) -> dict[str, Outcome]:
    """What became of each run by each reading, on the same draws.

    Parameters
    ----------
    over
        The flight, from `overflight`.
    readings
        By name, whether the assigned measurement updates the track; see `gate`.
    runs, seed
        How many, and of their streams; see `streams`.
    chunk
        Runs held in memory at a time; the numbers do not depend on it.

    Returns
    -------
    dict
        By the names of ``readings``.
    """
    sources = streams(seed, runs)
    parts: dict[str, list[Outcome]] = {name: [] for name in readings}
    for first in range(0, runs, chunk):
        scene = draw_scene(over, sources[first : first + chunk])
        for name, assigned in readings.items():
            parts[name].append(_outcome(_gate(scene, assigned=assigned)))
    return {
        name: Outcome(*(np.concatenate(values, axis=-1) for values in zip(*some, strict=True)))
        for name, some in parts.items()
    }


def _outcome(done: Gated) -> Outcome:
    pixels, angles = (~done.right[GATES.index(form)] for form in ("pixels", "angles"))
    apart = np.stack([pixels & ~angles, angles & ~pixels, pixels & angles])
    same = (pixels == angles).all(axis=-1)
    return Outcome(100 * done.right.sum(axis=-1) / IMAGES, 100 * apart.sum(axis=-1) / IMAGES, same)


def _warm_up(scene: GatingScene) -> tuple[Array, Array]:
    """State (N, 4) and covariance (4, 4) after the iterations on positions: the same for all three forms."""
    x = np.concatenate([scene.start, np.zeros_like(scene.start)], axis=-1)
    P = START_P
    H, R = on_state(np.eye(2), 4), R_FORM["position"]
    F, Q = constant_velocity(1 / RATE_HZ, SD_ACCELERATION)
    for k in range(WARM_UP):
        x, P = predict(x, P, F, Q)
        step = correct(x, P, scene.warm_up[:, k] - x[:, :2], H, R)
        x, P = step.x, step.P
    return x, P


def expected(form: str, position: Array, poses: CameraPoses) -> tuple[Array, Array]:
    """Measurements (N, 2) of targets at (N, 2) north and east, H (6.3), (6.4), (6.9), and their derivatives.

    NaN of a target in or behind the plane of the lens, and of an azimuth on its axis.
    """
    if form == "position":
        return position, np.broadcast_to(np.eye(2), (*position.shape, 2))
    if form == "pixels":
        return predict_pixel(position, poses, 0.0)[:2]
    inner = target_in_camera(position, poses, 0.0)
    level2 = (inner.z[..., :2] ** 2).sum(axis=-1)
    seen = (inner.z[..., 2] > 0) & (level2 > 0)
    x, y, z = np.moveaxis(np.where(seen[..., None], inner.z, np.nan), -1, 0)
    level, range2 = np.sqrt(level2), level2 + z * z
    azimuth = np.stack([-y, x, 0 * z], axis=-1) / level2[..., None]
    elevation = np.stack([-z * x / level, -z * y / level, level], axis=-1) / range2[..., None]
    slopes = np.stack([azimuth, elevation], axis=-2) @ inner.H_position
    return np.stack([np.arctan2(y, x), np.arctan2(z, level)], axis=-1), slopes


def _gate(scene: GatingScene, *, assigned: bool) -> Gated:
    poses, pixels = scene.poses, scene.pixels
    lens = poses.p_nc[:, :, None], poses.R_nc[:, :, None]
    ground = pixel_to_plane(poses.camera, pixels, *lens, 0.0)[..., :2]
    angles = azimuth_elevation_of_pixel(poses.camera, pixels)
    measured = dict(zip(FORMS, (ground, pixels, angles), strict=True))
    F, Q = constant_velocity(1 / RATE_HZ, SD_ACCELERATION)
    N, T = pixels.shape[:2]
    right = np.empty((len(GATES), N, T), bool)
    nis, estimate = np.empty((len(GATES), N, T, 2)), np.empty((len(GATES), N, T, 2))
    for row, by in enumerate(GATES):
        forms = ("pixels", "angles") if by == "both" else (by,)
        # H 6.3.2: pixels are used in the update and angles for gating.
        update = "position" if by == "position" else "pixels"
        x, P = _warm_up(scene)
        P = np.tile(P, (N, 1, 1))
        for t in range(T):
            x, P = predict(x, P, F, Q)
            here, d = poses.take((slice(None), t)), np.zeros((N, 2))
            with np.errstate(divide="ignore", invalid="ignore"):
                for form in forms:
                    h, H = expected(form, x[:, :2], here)
                    S = H @ P[:, :2, :2] @ np.swapaxes(H, -1, -2) + R_FORM[form]
                    v = difference(measured[form][:, t], h[:, None], (form == "angles", False))
                    d += innovation_squared(v, S[:, None])
                nearest = np.where(np.isfinite(d), d, np.inf).argmin(axis=1)
                known = np.isfinite(d).any(axis=1)
                z = measured[update][np.arange(N), t, nearest if assigned else 0]
                h, H = expected(update, x[:, :2], here)
                gap = z - h
                step = correct(x, P, gap, on_state(H, 4), R_FORM[update])
            used = np.asarray(np.isfinite(gap).all(axis=1) & (known | (not assigned)))
            x, P = np.where(used[:, None], step.x, x), np.where(used[:, None, None], step.P, P)
            right[row, :, t], nis[row, :, t], estimate[row, :, t] = known & (nearest == 0), d, x[:, :2]
    return Gated(right, nis, estimate, ground, scene.targets)
