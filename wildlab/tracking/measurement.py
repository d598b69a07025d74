"""Sensors of a run: positions, and cameras over a plane.

What a target should look like is in `wildlab.tracking.predictions`, what a sensor is to a filter in
`wildlab.tracking.sensors`.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import ArrayLike

from wildlab.errors import WildlabError
from wildlab.geometry.camera import project
from wildlab.geometry.camera_poses import CameraPoses
from wildlab.geometry.frames import Array
from wildlab.geometry.georeference import intersect_plane, pixel_rays
from wildlab.tracking.platforms import bearings as bearings
from wildlab.tracking.platforms import ranges_bearings as ranges_bearings
from wildlab.tracking.predictions import Prediction as Prediction
from wildlab.tracking.predictions import azimuth_elevation_of_pixel as azimuth_elevation_of_pixel
from wildlab.tracking.predictions import predict_azimuth_elevation as predict_azimuth_elevation
from wildlab.tracking.predictions import predict_pixel as predict_pixel
from wildlab.tracking.predictions import predict_range_bearing as predict_range_bearing
from wildlab.tracking.predictions import target_in_camera as target_in_camera
from wildlab.tracking.sensors import Locate, Ray, row_of
from wildlab.tracking.sensors import Sensor as Sensor
from wildlab.tracking.sensors import check_states as check_states
from wildlab.tracking.sensors import difference as difference
from wildlab.tracking.sensors import on_state as on_state


def positions() -> Sensor:
    """Georeferenced positions (north, east), H (6.3). They have no pose left that could be wrong.

    Returns
    -------
    Sensor
        Of (2,) metres in n, for any number of rows.
    """

    def predict(row: int, position: Array) -> Prediction:
        return Prediction(np.array(position, float), np.eye(2), np.zeros((2, 6)))

    return Sensor(
        predict, (False, False), elements=("north", "east"), locate=lambda row, z: np.array(z[:2], float)
    )


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
        return Prediction(np.array(state[..., first : first + 2], float), H, np.zeros((2, 6)))

    def locate(row: int, z: Array) -> Array:
        return np.full(2, np.nan) if kinds[row] else np.array(z, float)

    return Sensor(predict, (False, False), len(kinds), 4, ("north", "east"), locate=locate)


def _camera_rows(poses: CameraPoses, plane_down: ArrayLike) -> int | None:
    """How many rows a camera over a plane has; None where both are the same for all rows."""
    planes = np.shape(plane_down)
    if planes:
        poses.require_rows(planes, "plane_down")
    rows = poses.rows or planes
    return rows[0] if rows else None


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
        return predict_pixel(position, poses.take(row), row_of(plane_down, row, 0))

    ray, locate = _by_pixel(poses, plane_down, lambda z: z)
    return Sensor(
        predict, (False, False), _camera_rows(poses, plane_down), elements=("u", "v"), ray=ray, locate=locate
    )


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
        return predict_azimuth_elevation(position, poses.take(row), row_of(plane_down, row, 0))

    def pixel(z: Array) -> Array:
        """Back to where it was seen, by way of the ideal camera."""
        level = np.cos(z[1])
        ray = np.array([level * np.cos(z[0]), level * np.sin(z[0]), np.sin(z[1])])
        return np.asarray(project(poses.camera, ray))

    ray, locate = _by_pixel(poses, plane_down, pixel)
    return Sensor(
        predict, (True, False), _camera_rows(poses, plane_down), elements=("azimuth", "elevation"), ray=ray,
        locate=locate,
    )  # fmt: skip


def _by_pixel(
    poses: CameraPoses, plane_down: ArrayLike, pixel: Callable[[Array], Array]
) -> tuple[Ray, Locate]:
    """Rays of a camera, and where they meet the plane."""

    def ray(row: int, z: Array) -> tuple[Array, Array]:
        pose = poses.take(row)
        return pose.p_nc, np.asarray(pixel_rays(pose.camera, pixel(z), pose.R_nc))

    def locate(row: int, z: Array) -> Array:
        origin, direction = ray(row, z)
        return np.asarray(intersect_plane(direction, origin, row_of(plane_down, row, 0))[..., :2])

    return ray, locate
