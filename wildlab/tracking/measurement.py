"""What a sensor should see of a target on a horizontal plane, and how that changes with target and pose.

A `Sensor` belongs to one run: it knows the pose of every row, and takes a row and a position of the target
to a `Prediction`. Derivatives are taken with respect to the target's position (north, east; the sensors of H
6.7 see no velocity, but `positions_or_velocities` does) and to the six errors of the pose: ``dp`` in n and
``da`` in b with ``p = p_hat + dp``, ``q = q_hat * dq(da)``, ``da`` four times the modified Rodrigues
parameters (H 7.15-7.17, 7.44-7.45), which is a rotation vector to first order.

A target that a sensor cannot see (in or behind the plane of the lens, or where an angle is not defined) has a
prediction of NaN, and a filter leaves the measurement out. There is no mirror image.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from wildlab.errors import WildlabError
from wildlab.geometry.camera import Camera, distortion_jacobian, normalise, project
from wildlab.geometry.camera_poses import CameraPoses
from wildlab.geometry.frames import Array, skew, wrap


class Prediction(NamedTuple):
    """Expected measurement and its derivatives; leading axes as the input's."""

    z: Array  # (..., m)
    H_position: Array  # (..., m, 2) north and east of the target; (..., m, 4) where velocity is seen too
    H_pose: Array  # (..., m, 6) with respect to the errors of the pose


class Sensor(NamedTuple):
    """A sensor on its way: ``predict(row, position)`` for a row of the run and the target's (2,) north, east.

    ``angles`` (m,) says which elements are angles, whose differences are wrapped. ``rows`` is for how many
    rows it was made; None: for any number. ``states`` is how many of the first states it is given: 4 are
    position and velocity.
    """

    predict: Callable[[int, Array], Prediction]
    angles: tuple[bool, ...]
    rows: int | None = None
    states: int = 2


def difference(z: ArrayLike, predicted: ArrayLike, angles: tuple[bool, ...]) -> Array:
    """Innovation (..., m): measurement minus prediction, angles wrapped (H 6.11)."""
    gap = np.asarray(z, float) - np.asarray(predicted, float)
    return np.where(np.asarray(angles), wrap(gap), gap)


def on_state(H_position: Array, n: int) -> Array:
    """Derivative with respect to all ``n`` states: zeros behind those that the sensor sees, H (6.7)."""
    H = np.zeros((*H_position.shape[:-1], n))
    H[..., : H_position.shape[-1]] = H_position
    return H


def check_states(sensor: Sensor, n: int) -> None:
    """Refuse a sensor that sees more than the ``n`` states of a motion model."""
    if sensor.states > n:
        raise WildlabError(
            f"a sensor of {sensor.states} states for a motion model of {n}",
            "use a model with velocity, as constant_velocity",
            field="sensor",
        )


# --- what is seen, for any number of poses


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


def predict_azimuth_elevation(position: ArrayLike, poses: CameraPoses, plane_down: ArrayLike) -> Prediction:
    """Azimuth ``atan2(y, x)`` and elevation ``atan(z / hypot(x, y))`` in c, H (6.9), radians.

    The print's one-argument arctangent cannot tell a target from the one opposite; the two-argument one can.
    NaN behind the camera and exactly on its axis, where the azimuth is not defined.
    """
    inner = target_in_camera(position, poses, plane_down)
    x, y, z = np.moveaxis(inner.z, -1, 0)
    level2 = x * x + y * y
    seen = (z > 0) & (level2 > 0)
    level2, z = np.where(seen, level2, np.nan), np.where(seen, z, np.nan)
    level, range2 = np.sqrt(level2), level2 + z * z
    J = np.zeros((*level.shape, 2, 3))
    J[..., 0, 0], J[..., 0, 1] = -y / level2, x / level2
    J[..., 1, 0], J[..., 1, 1] = -z * x / (level * range2), -z * y / (level * range2)
    J[..., 1, 2] = level / range2
    angles = np.stack([np.arctan2(y + 0 * z, x), np.arctan2(z, level)], axis=-1)
    return _through(J, angles, inner)


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


# --- sensors of a run


def positions() -> Sensor:
    """Georeferenced positions (north, east), H (6.3). They have no pose left that could be wrong.

    Returns
    -------
    Sensor
        Of (2,) metres in n, for any number of rows.
    """

    def predict(row: int, position: Array) -> Prediction:
        return Prediction(np.array(position, float), np.eye(2), np.zeros((2, 6)))

    return Sensor(predict, (False, False))


def positions_or_velocities(is_velocity: ArrayLike) -> Sensor:
    """Positions in some rows, velocities in others: what optical flow gives (H 5.30) feeds a track.

    Parameters
    ----------
    is_velocity
        (N,) bool: which rows are velocities.

    Returns
    -------
    Sensor
        Of (2,) north and east in n, metres or metres a second; for N rows, and for motion models with
        velocity. What the pose does to a velocity is in the covariance that comes with it
        (`wildlab.geometry.flow_uncertainty`), so derivatives for the pose are zero.

    Raises
    ------
    WildlabError
        Where there is not one value for each row.

    Examples
    --------
    >>> sensor = positions_or_velocities([False, True])
    >>> sensor.predict(1, np.array([10.0, 20.0, 3.0, -1.0])).z.tolist()
    [3.0, -1.0]
    """
    kinds = np.asarray(is_velocity, bool)
    if kinds.ndim != 1:
        raise WildlabError(
            f"kinds of the shape {kinds.shape}", "give one for each row, (N,)", field="is_velocity"
        )

    def predict(row: int, state: Array) -> Prediction:
        first = 2 if kinds[row] else 0
        H = np.eye(4)[first : first + 2]
        return Prediction(np.array(state[first : first + 2], float), H, np.zeros((2, 6)))

    return Sensor(predict, (False, False), len(kinds), states=4)


def _row(values: ArrayLike, row: int, base: int) -> Array:
    """Row of (N, ...), or the one value of all rows; ``base`` is the number of axes of a single value."""
    a = np.asarray(values, float)
    return np.asarray(a[row] if a.ndim > base else a)


def _camera_rows(poses: CameraPoses, plane_down: ArrayLike) -> int | None:
    """How many rows a camera over a plane has; None where both are the same for all rows."""
    planes = np.shape(plane_down)
    if planes:
        poses.require_rows(planes, "plane_down")
    rows = poses.rows or planes
    return rows[0] if rows else None


def _platform_rows(platform: ArrayLike, yaw: ArrayLike) -> int | None:
    """How many rows a platform has; None where it is the same for all rows."""
    numbers = {len(np.asarray(a)) for a, base in ((platform, 1), (yaw, 0)) if np.ndim(a) > base}
    if len(numbers) > 1:
        raise WildlabError(
            f"{np.shape(platform)} positions and {np.shape(yaw)} yaws", "give one of each for each row",
            field="yaw",
        )  # fmt: skip
    return numbers.pop() if numbers else None


def pixels(poses: CameraPoses, plane_down: ArrayLike) -> Sensor:
    """Pixels (u, v) of a target on a horizontal plane, H (6.4).

    Parameters
    ----------
    poses
        Of the camera, one for each of N rows, or one for all.
    plane_down
        Down coordinate in n of the plane that the target is on, m: a scalar, or (N,).

    Returns
    -------
    Sensor
        Of (2,) pixels, NaN for a target that is not in front of the camera; for N rows, or for any number
        where pose and plane are the same for all.

    Raises
    ------
    WildlabError
        Where there is another number of planes than of poses.
    """

    def predict(row: int, position: Array) -> Prediction:
        return predict_pixel(position, poses.take(row), _row(plane_down, row, 0))

    return Sensor(predict, (False, False), _camera_rows(poses, plane_down))


def azimuths_elevations(poses: CameraPoses, plane_down: ArrayLike) -> Sensor:
    """Azimuth and elevation in c of a target on a horizontal plane, H (6.9).

    Measurements for it come from `wildlab.tracking.measurement.azimuth_elevation_of_pixel`.

    Parameters
    ----------
    poses
        Of the camera, one for each of N rows, or one for all.
    plane_down
        Down coordinate in n of the plane that the target is on, m: a scalar, or (N,).

    Returns
    -------
    Sensor
        Of (2,) azimuth and elevation, rad, NaN for a target that is not in front of the camera or lies on
        its axis; for N rows, or for any number where pose and plane are the same for all. Differences of the
        azimuth are wrapped.

    Raises
    ------
    WildlabError
        Where there is another number of planes than of poses.
    """

    def predict(row: int, position: Array) -> Prediction:
        return predict_azimuth_elevation(position, poses.take(row), _row(plane_down, row, 0))

    return Sensor(predict, (True, False), _camera_rows(poses, plane_down))


def ranges_bearings(platform: ArrayLike, yaw: ArrayLike) -> Sensor:
    """Range and bearing of a target, seen from a level platform.

    Parameters
    ----------
    platform
        (N, 2) north, east of the sensor in n, m; or (2,) for all rows.
    yaw
        (N,) or a scalar: of the platform, rad clockwise from north; zero where bearings are measured from
        north.

    Returns
    -------
    Sensor
        Of (2,) range, m, and bearing, rad clockwise from the bow; NaN at zero range. For N rows, or for any
        number where position and yaw are the same for all. Differences of the bearing are wrapped.

    Raises
    ------
    WildlabError
        Where both have rows, and not equally many.
    """

    def predict(row: int, position: Array) -> Prediction:
        return predict_range_bearing(position, _row(platform, row, 1), _row(yaw, row, 0))

    return Sensor(predict, (False, True), _platform_rows(platform, yaw))


def bearings(platform: ArrayLike, yaw: ArrayLike) -> Sensor:
    """Bearing alone of a target, seen from a level platform.

    Parameters
    ----------
    platform
        (N, 2) north, east of the sensor in n, m; or (2,) for all rows.
    yaw
        (N,) or a scalar: of the platform, rad clockwise from north; zero where bearings are measured from
        north.

    Returns
    -------
    Sensor
        Of (1,) bearing, as `ranges_bearings`; measurements for it are (N, 1).

    Raises
    ------
    WildlabError
        Where both have rows, and not equally many.
    """

    def predict(row: int, position: Array) -> Prediction:
        both = predict_range_bearing(position, _row(platform, row, 1), _row(yaw, row, 0))
        return Prediction(both.z[1:], both.H_position[1:], both.H_pose[1:])

    return Sensor(predict, (True,), _platform_rows(platform, yaw))
