"""What a sensor should see of a target on a horizontal plane, and how that changes with target and pose.

Derivatives are taken with respect to the target's position (north, east) and to the six errors of the pose,
in the order of `POSE`: ``dp`` in n and ``da`` in b with ``p = p_hat + dp``, ``q = q_hat * dq(da)``, ``da``
four times the modified Rodrigues parameters (H 7.15-7.17, 7.44-7.45), a rotation vector to first order.

A target that a sensor cannot see (in or behind the plane of the lens, or where an angle is not defined) has a
prediction of NaN. There is no mirror image.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from wildlab.geometry.camera import Camera, distortion_jacobian, normalise, project
from wildlab.geometry.camera_poses import CameraPoses
from wildlab.geometry.frames import Array, skew, wrap

#: The six errors of a pose: of the position in n (m), and about the axes of b (rad).
POSE = ("platform_north", "platform_east", "platform_down", "roll", "pitch", "heading")


class Prediction(NamedTuple):
    """Expected measurement and its derivatives; leading axes as the input's, or none where all are alike."""

    z: Array  # (..., m)
    H_position: Array  # (..., m, 2) north and east of the target; (..., m, 4) where velocity is seen too
    H_pose: Array  # (..., m, k) with respect to the sensor's named errors: the six of `POSE`, or others


def target_in_camera(position: ArrayLike, poses: CameraPoses, plane_down: ArrayLike) -> Prediction:
    """Target in c, H (6.5), (7.44), with its derivatives. (..., 2) north, east -> (..., 3), NaN nowhere.

    ``plane_down`` is the down coordinate of the target, scalar or (...).
    """
    p = np.asarray(position, float)
    R_nc, R_bc = poses.R_nc, poses.R_bc
    down = np.broadcast_to(np.asarray(plane_down, float), p.shape[:-1])[..., None]
    offset = np.concatenate([p, down], axis=-1) - poses.p_nc
    R_cn = np.swapaxes(R_nc, -1, -2)
    p_c = np.einsum("...ij,...j->...i", R_cn, offset)
    # Seen from b the target stands at R_bc p_c + lever, and b turns about its own origin: H (7.45).
    from_body = np.einsum("...ij,...j->...i", R_bc, p_c) + poses.lever_arm
    by_attitude = np.swapaxes(R_bc, -1, -2) @ skew(from_body)
    R_cn = np.broadcast_to(R_cn, (*p_c.shape, 3))
    return Prediction(p_c, R_cn[..., :2], np.concatenate([-R_cn, by_attitude], axis=-1))


def _through(outer: Array, z: Array, inner: Prediction) -> Prediction:
    """Chain rule: ``outer`` (..., m, k) is the derivative of ``z`` with respect to ``inner.z``."""
    return Prediction(z, outer @ inner.H_position, outer @ inner.H_pose)


def predict_pixel(position: ArrayLike, poses: CameraPoses, plane_down: ArrayLike) -> Prediction:
    """Pixel of a target, H (6.4), (7.42), distortion and skew included; behind the camera NaN.

    Derivatives H (6.7) and those of (7.45).
    """
    camera, inner = poses.camera, target_in_camera(position, poses, plane_down)
    z = np.where(inner.z[..., 2] > 0, inner.z[..., 2], np.nan)
    xy = inner.z[..., :2] / z[..., None]
    J = np.zeros((*xy.shape, 3))
    J[..., 0, 0] = J[..., 1, 1] = 1 / z
    J[..., 2] = -xy / z[..., None]
    if camera.distorts:
        J = distortion_jacobian(xy, camera.distortion) @ J
    return _through(camera.matrix[:2, :2] @ J, project(camera, inner.z), inner)


def azimuth_elevation_of_pixel(camera: Camera, uv: ArrayLike) -> Array:
    """Detected pixels as azimuth and elevation, H (6.10). (..., 2) pixels -> (..., 2) radians.

    The print's ``u`` and ``v`` count from the principal point. On it the azimuth is not defined: NaN.
    """
    x, y = np.moveaxis(normalise(camera, uv), -1, 0)
    level = np.hypot(x, y)
    level = np.where(level > 0, level, np.nan)
    return np.stack([np.arctan2(y, x) + 0 * level, np.arctan2(1.0, level)], axis=-1)


def predict_range_bearing(position: ArrayLike, platform: ArrayLike, yaw: ArrayLike) -> Prediction:
    """Range (m) and bearing (rad, clockwise from the bow) of a target, seen from a level platform.

    Parameters
    ----------
    position
        (..., 2) north, east of the target.
    platform
        (..., 2) north, east of the sensor.
    yaw
        (...) radians from north; zero where bearings are measured from north.

    Returns
    -------
    Prediction with ``H_pose`` for the same six errors as the camera's; on a level platform only north,
    east and the third attitude error (yaw) matter. NaN at zero range.
    """
    offset = np.asarray(position, float) - np.asarray(platform, float)
    north, east = np.moveaxis(offset, -1, 0)
    distance = np.hypot(north, east)
    r = np.where(distance > 0, distance, np.nan)
    H = np.stack(
        [np.stack([north / r, east / r], axis=-1), np.stack([-east / r**2, north / r**2], axis=-1)], axis=-2
    )
    pose = np.zeros((*H.shape[:-1], 6))
    pose[..., :2] = -H
    pose[..., 1, 5] = -1.0
    z = np.stack([r, wrap(np.arctan2(east, north) - np.asarray(yaw, float)) + 0 * r], axis=-1)
    return Prediction(z, H, pose)


def predict_position(position: ArrayLike, platform: ArrayLike) -> Prediction:
    """A target's position as a platform measures it: its own position plus what it sees from there.

    Parameters
    ----------
    position, platform
        (..., 2) north, east of the target and of the platform.

    Returns
    -------
    Prediction of (..., 2): with ``p = p_hat + dp`` the position is measured too far back by ``dp``; with the
    heading too small by a little, turned back about the platform by it.
    """
    p = np.asarray(position, float)
    offset = p - np.asarray(platform, float)
    pose = np.zeros((*offset.shape, 6))
    pose[..., 0, 0] = pose[..., 1, 1] = -1.0
    pose[..., 0, 5], pose[..., 1, 5] = offset[..., 1], -offset[..., 0]
    return Prediction(p, np.broadcast_to(np.eye(2), (*p.shape, 2)), pose)
