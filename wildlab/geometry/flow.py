"""Optical flow of what lies on a plane, of the camera's own motion, and the target's velocity: H 5.4.

Flow is in px/s: H's definition 5.2 has it as a displacement in px, and (5.18) as a derivative. Taken by the
letter, (5.30) would give metres an image and not metres a second; `flow_between` divides by the time between
the images. Where on the way from one image to the other pixel and pose belong, H does not say (but for the
gimbal: its mean orientation); here it is half way, for pixel and pose, which leaves an error of second order
in that time.

How wrong a velocity may be follows from all that it is computed from, to first order.
"""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike
from scipy.linalg import block_diag

from wildlab.geometry.camera import Camera, normalise, normalise_jacobian
from wildlab.geometry.camera_poses import CameraPoses, Mount
from wildlab.geometry.frames import (
    Array,
    euler_to_matrix,
    matrix_to_rotation_vector,
    rotation_vector_to_matrix,
    skew,
    wrap,
)
from wildlab.geometry.georeference import georeference_pixels, matching


class CameraMotion(NamedTuple):
    """How the airframe moves, and its gimbal. One row for each pose, or one for all.

    Attributes
    ----------
    velocity
        (N, 3) of b over the ground, in n, m/s.
    rates
        (N, 3) angular velocity of b against n, in b, rad/s.
    gimbal_rates
        (N, 2) of pan and tilt, rad/s; None where the gimbal stands still.
    """

    velocity: Array
    rates: Array
    gimbal_rates: Array | None = None


class Twist(NamedTuple):
    """Velocity (N, 3) m/s and angular velocity (N, 3) rad/s of n against c, in c: `v_cn` and `w_cn` of H."""

    velocity: Array
    rates: Array


def gimbal_axes(mount: Mount, pan: ArrayLike | None = None) -> Array:
    """Axes in b about which pan and tilt turn the camera, H (5.27).

    The base of the gimbal is turned against b by the mount's misalignment, which (5.27) leaves out.

    Parameters
    ----------
    mount
        Of the camera.
    pan
        (N,) rad, in place of the mount's own where the gimbal moves.

    Returns
    -------
    (3, 2), or (N, 3, 2): multiplied by the rates of pan and tilt, the angular velocity of m against b, in b.

    Examples
    --------
    >>> gimbal_axes(Mount("down")).tolist()
    [[0.0, 0.0], [0.0, 1.0], [1.0, 0.0]]
    """
    roll, lean, turn = mount.misalignment
    base = euler_to_matrix(roll, lean, turn)
    panned = base @ euler_to_matrix(0.0, 0.0, mount.pan if pan is None else pan)
    about_z = np.broadcast_to(base[:, 2], panned.shape[:-1])
    return np.stack([about_z, panned[..., :, 1]], axis=-1)


def camera_rates(poses: CameraPoses, motion: CameraMotion) -> Array:
    """Angular velocity of the camera against n, in b: `w_nb + w_bc` of H (5.26).

    Parameters
    ----------
    poses
        Of the camera.
    motion
        Of the airframe and the gimbal.

    Returns
    -------
    (N, 3) or (3,) rad/s, in b.
    """
    rates = np.asarray(motion.rates, float)
    if motion.gimbal_rates is None:
        return rates
    axes = gimbal_axes(poses.mount, poses.pan)
    return np.asarray(rates + np.einsum("...ij,...j->...i", axes, np.asarray(motion.gimbal_rates, float)))


def lens_velocity(poses: CameraPoses, motion: CameraMotion) -> Array:
    """Velocity of the lens over the ground, in n, (N, 3) or (3,) m/s.

    H (5.25) takes that of b; where the lens is elsewhere, the airframe's turning moves it too.

    Parameters
    ----------
    poses
        Of the camera.
    motion
        Of the airframe.

    Returns
    -------
    (N, 3) or (3,) m/s, in n.
    """
    around = np.cross(np.asarray(motion.rates, float), poses.lever_arm)
    turned = np.einsum("...ij,...j->...i", poses.R_nb, around)
    return np.asarray(np.asarray(motion.velocity, float) + turned)


def camera_twist(poses: CameraPoses, motion: CameraMotion) -> Twist:
    """Motion of n as the camera has it, H (5.25), (5.26).

    Parameters
    ----------
    poses
        Of the camera.
    motion
        Of the airframe and the gimbal.

    Returns
    -------
    Twist
    """
    velocity = np.einsum("...ji,...j->...i", poses.R_nc, lens_velocity(poses, motion))
    rates = np.einsum("...ji,...j->...i", poses.R_bc, camera_rates(poses, motion))
    return Twist(-velocity, -rates)


def flow_matrix(poses: CameraPoses, uv: ArrayLike, plane_down: ArrayLike) -> Array:
    """How a pixel moves as the point that it shows moves and turns about the camera: H (5.21), (5.22).

    The print has one focal length and counts pixels from the principal point. Here the camera has its own
    two, its skew and its distortion.

    Parameters
    ----------
    poses
        The camera, with a pose for each pixel or one for all.
    uv
        (N, 2) pixels.
    plane_down
        Down coordinate of the plane that they show, m, scalar or (N,).

    Returns
    -------
    (N, 2, 6), px/m and px/rad: multiplied by linear and angular velocity in c, the flow in px/s. NaN where
    the ray does not meet the plane.

    Raises
    ------
    WildlabError
        Where there is another number of poses, or of planes, than of pixels.

    Examples
    --------
    Below a camera with a focal length of 1000 px, 100 m high, 1 m/s is 10 px/s:

    >>> from wildlab.geometry.camera import Camera
    >>> camera = Camera(640, 512, 1000.0, 1000.0, 320.0, 256.0)
    >>> poses = CameraPoses(camera, Mount("down"), np.array([0.0, 0.0, -100.0]), np.eye(3))
    >>> print(flow_matrix(poses, [[320.0, 256.0]], 0.0)[0].round(6) + 0.0)
    [[   10.     0.     0.     0.  1000.     0.]
     [    0.    10.     0. -1000.     0.     0.]]
    """
    point = _seen_points(poses, uv, plane_down)
    z = point[..., 2]
    xy = point[..., :2] / z[..., None]
    B = np.concatenate([np.broadcast_to(np.eye(2), (*xy.shape, 2)), -xy[..., None]], axis=-1)
    by_xy = np.concatenate([B, -B @ skew(point)], axis=-1) / z[..., None, None]
    return np.asarray(np.linalg.solve(normalise_jacobian(poses.camera, xy), by_xy))


def _seen_points(poses: CameraPoses, uv: ArrayLike, plane_down: ArrayLike) -> Array:
    """Points on the plane as the camera has them, (N, 3) m in c."""
    ground = georeference_pixels(poses, uv, plane_down)
    return np.asarray(np.einsum("...ji,...j->...i", poses.R_nc, ground - poses.p_nc))


def camera_flow(poses: CameraPoses, motion: CameraMotion, uv: ArrayLike, plane_down: ArrayLike) -> Array:
    """Flow that the camera's own motion makes of what lies still on a plane: H (5.24).

    Parameters
    ----------
    poses
        The camera, with a pose for each pixel or one for all.
    motion
        Of airframe and gimbal at these poses.
    uv
        (N, 2) pixels.
    plane_down
        Down coordinate of the plane, m, scalar or (N,).

    Returns
    -------
    (N, 2) px/s; NaN where the ray does not meet the plane.

    Raises
    ------
    WildlabError
        Where there is another number of poses, or of planes, than of pixels.
    """
    return _made_by(flow_matrix(poses, uv, plane_down), camera_twist(poses, motion))


def _made_by(by_twist: Array, twist: Twist) -> Array:
    return np.asarray(np.einsum("...ij,...j->...i", by_twist, np.concatenate(twist, axis=-1)))


def target_velocity(
    poses: CameraPoses, motion: CameraMotion, uv: ArrayLike, flow: ArrayLike, plane_down: ArrayLike
) -> Array:
    """Velocity over a horizontal plane of what has that flow: H (5.30).

    Parameters
    ----------
    poses
        The camera half way between two images, for each pixel or one for all.
    motion
        Of airframe and gimbal there.
    uv
        (N, 2) pixels, half way too.
    flow
        (N, 2) px/s, as it was measured.
    plane_down
        Down coordinate of the plane that the target moves on, m, scalar or (N,).

    Returns
    -------
    (N, 2) north and east, m/s; NaN where the ray does not meet the plane.

    Raises
    ------
    WildlabError
        Where there is another number of poses, of planes or of flows than of pixels.

    Examples
    --------
    What does not move in the image moves with the camera:

    >>> from wildlab.geometry.camera import Camera
    >>> camera = Camera(640, 512, 1000.0, 1000.0, 320.0, 256.0)
    >>> poses = CameraPoses(camera, Mount("down"), np.array([0.0, 0.0, -100.0]), np.eye(3))
    >>> motion = CameraMotion(np.array([18.0, 1.0, 0.0]), np.zeros(3))
    >>> print(target_velocity(poses, motion, [[320.0, 256.0]], [[0.0, 0.0]], 0.0).round(6))
    [[18.  1.]]
    """
    pixels, planes = matching(poses, uv, plane_down)
    v, w = lens_velocity(poses, motion), _turned(poses.R_nb, camera_rates(poses, motion))
    moved = np.asarray(flow, float)
    return _over_plane(poses.camera, pixels, moved, poses.p_nc, poses.R_nc, v, w, planes)


def _over_plane(
    camera: Camera, uv: Array, flow: Array, p_nc: Array, R_nc: Array, v: Array, w: Array, plane: Array
) -> Array:
    """The velocity on the plane, from velocity and rates of the lens in n; axes are broadcast.

    With the ray ``d`` (depth 1), its depth ``h = drop / d_z`` and ``d'`` by which it turns, all in n, what is
    seen moves by ``v + h d'``, slid along the ray onto the plane: H (5.30) without an inverse.
    """
    xy = normalise(camera, uv)
    slide = np.einsum("...ij,...j->...i", normalise_jacobian(camera, xy), flow)
    ray = _turned(R_nc, np.concatenate([xy, np.ones((*xy.shape[:-1], 1))], axis=-1))
    turning = np.cross(w, ray) + _turned(R_nc[..., :2], slide)
    drop = plane - p_nc[..., 2]
    with np.errstate(divide="ignore", invalid="ignore"):
        steep = np.where((ray[..., 2] > 0) & (drop > 0), ray[..., 2], np.nan)[..., None]
        moved = v + drop[..., None] / steep * turning
        return np.asarray(moved[..., :2] - moved[..., 2:] * ray[..., :2] / steep)


def _turned(R: Array, vectors: Array) -> Array:
    return np.asarray(np.einsum("...ij,...j->...i", R, vectors))


def flow_between(uv_first: ArrayLike, uv_second: ArrayLike, interval: float) -> tuple[Array, Array]:
    """Pixels half way between two images, (N, 2), and their flow, (N, 2) px/s.

    Parameters
    ----------
    uv_first, uv_second
        (N, 2) pixels of the same points in both.
    interval
        From the first to the second, s.

    Returns
    -------
    (middle, flow)

    Examples
    --------
    >>> middle, flow = flow_between([[10.0, 20.0]], [[12.0, 20.0]], 0.1)
    >>> print(middle, flow)
    [[11. 20.]] [[20.  0.]]
    """
    here, there = np.asarray(uv_first, float), np.asarray(uv_second, float)
    return (here + there) / 2, (there - here) / interval


def motion_between(
    first: CameraPoses, second: CameraPoses, interval: float, velocity: ArrayLike | None = None
) -> tuple[CameraPoses, CameraMotion]:
    """Pose half way between two images, and the motion from the one to the other.

    Parameters
    ----------
    first, second
        One camera at either image: as many rows, or none.
    interval
        From the first to the second, s.
    velocity
        (N, 3) of b in n, m/s, where it is known better than from two positions.

    Returns
    -------
    (poses, motion)
        Means of positions and gimbal angles, half of the rotation between the attitudes; differences over
        the interval. The covariance is the first's.

    """
    turn = matrix_to_rotation_vector(np.swapaxes(first.R_nb, -1, -2) @ second.R_nb)
    half = first.R_nb @ rotation_vector_to_matrix(turn / 2)
    rates = np.zeros((*first.rows, 2))
    angles: list[Array | None] = [None, None]
    for column, (before, after) in enumerate(((first.pan, second.pan), (first.tilt, second.tilt))):
        if before is not None and after is not None:
            change = wrap(after - before)
            angles[column] = np.asarray(before + change / 2)
            rates[..., column] = change / interval
    moved = (second.p_nb - first.p_nb) / interval if velocity is None else np.asarray(velocity, float)
    poses = replace(first, p_nb=(first.p_nb + second.p_nb) / 2, R_nb=half, pan=angles[0], tilt=angles[1])
    return poses, CameraMotion(moved, turn / interval, rates)


class FlowErrors(NamedTuple):
    """Covariances of what a velocity is computed from. SI units and radians.

    Attributes
    ----------
    pixel, flow
        (2, 2) of where the feature is, px^2, and of its flow, (px/s)^2; of each feature on its own.
    pose
        (6, 6): position in n, rotation vector in b.
    mount
        (3, 3): rotation vector in m, after pan and tilt.
    velocity
        (3, 3) of the airframe's velocity in n, (m/s)^2.
    rates
        (3, 3) of its angular velocity in b, (rad/s)^2.
    gimbal_rates
        (2, 2) of pan and tilt, (rad/s)^2.
    plane
        Variance of the plane's height, m^2.
    interval
        Variance of the time between the images over its square: flow is a displacement over that time.
    """

    pixel: Array
    flow: Array
    pose: Array
    mount: Array
    velocity: Array
    rates: Array
    gimbal_rates: Array
    plane: float
    interval: float = 0.0

    def covariances(self) -> tuple[Array, Array]:
        """(4, 4) of what each feature has for itself, and (19, 19) of what all have in common."""
        parts = [np.atleast_2d(np.asarray(one, float)) for one in self]
        return block_diag(*parts[:2]), block_diag(*parts[2:])


class Velocity(NamedTuple):
    """A velocity over the plane, north and east: ``value`` (2,) m/s, ``covariance`` (2, 2)."""

    value: Array
    covariance: Array


#: How many errors of each kind `velocity_jacobian` has: of pixel and flow, position and attitude, mount,
#: velocity and rates, rates of the gimbal, plane, and logarithm of the interval; in this order.
_SIZES = (2, 2, 3, 3, 3, 3, 3, 2, 1, 1)
#: What is tried of each, either way.
_STEPS = np.repeat([1e-3, 1e-3, 1e-3, 1e-5, 1e-5, 1e-3, 1e-5, 1e-5, 1e-3, 1e-5], _SIZES)
#: Errors of each feature of its own; the others are shared.
_OWN = 4


def velocity_jacobian(
    poses: CameraPoses, motion: CameraMotion, uv: ArrayLike, flow: ArrayLike, plane_down: ArrayLike
) -> Array:
    """Derivatives of `target_velocity` by the errors of `FlowErrors`, in their order, by central differences.

    Parameters
    ----------
    poses, motion, uv, flow, plane_down
        As there; one pose, N pixels.

    Returns
    -------
    (N, 2, 23)
        Rows of rays that miss the plane are NaN.
    """
    errors = np.concatenate([np.diag(_STEPS), -np.diag(_STEPS)])
    kinds = np.split(errors, np.cumsum(_SIZES)[:-1], axis=1)
    pixel, flowing, p, turn, swing, v, rates, gimbal, plane, interval = kinds
    pan_tilt = np.zeros(2) if motion.gimbal_rates is None else np.asarray(motion.gimbal_rates, float)
    R_nb = poses.R_nb @ rotation_vector_to_matrix(turn)
    spin = np.asarray(motion.rates, float) + rates
    all_rates = spin + (pan_tilt + gimbal) @ gimbal_axes(poses.mount, poses.pan).T
    found = _over_plane(
        poses.camera,
        np.asarray(uv, float) + pixel[:, None],
        (np.asarray(flow, float) + flowing[:, None]) * np.exp(-interval)[:, None],
        (poses.p_nb + p + R_nb @ poses.lever_arm)[:, None],
        (R_nb @ poses.R_bm @ rotation_vector_to_matrix(swing) @ poses.R_mc)[:, None],
        (np.asarray(motion.velocity, float) + v + _turned(R_nb, np.cross(spin, poses.lever_arm)))[:, None],
        _turned(R_nb, all_rates)[:, None],
        np.asarray(plane_down, float) + plane,
    )
    ahead, back = np.split(found, 2)
    return np.moveaxis(ahead - back, 0, -1) / (2 * _STEPS)


def mean_velocity(
    poses: CameraPoses,
    motion: CameraMotion,
    uv: ArrayLike,
    flow: ArrayLike,
    plane_down: ArrayLike,
    errors: FlowErrors,
) -> Velocity:
    """One velocity from all features of a target in one pair of images: their mean.

    Errors of pixels and flows are those of each feature, and average out; those of pose, motion, plane and
    interval are the same for all, and do not.

    Parameters
    ----------
    poses, motion, uv, flow, plane_down
        As for `wildlab.geometry.flow.target_velocity`, of one pair: one pose, N pixels.
    errors
        Each given once.

    Returns
    -------
    Velocity
        NaN where no ray meets the plane.
    """
    pixels = np.asarray(uv, float)
    velocities = target_velocity(poses, motion, pixels, flow, plane_down)
    there = np.isfinite(velocities).all(axis=1)
    if not there.any():
        return Velocity(np.full(2, np.nan), np.full((2, 2), np.nan))
    J = velocity_jacobian(poses, motion, pixels, flow, plane_down)[there]
    own, shared = errors.covariances()
    middle, each = J[..., _OWN:].mean(axis=0), J[..., :_OWN]
    alone = (each @ own @ np.swapaxes(each, 1, 2)).mean(axis=0) / len(J)
    return Velocity(velocities[there].mean(axis=0), alone + middle @ shared @ middle.T)
