"""Detections on the water: where they are, with ellipses from pixel, pose, and the height of what was found.

The centre of what a camera sees of a vessel is not on the water but some way up. How far is not in the image;
a share of its length says how much it may be.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from wildlab.detection.border import direction
from wildlab.detection.detections import Detections
from wildlab.geometry.camera_poses import CameraPoses
from wildlab.geometry.frames import Array
from wildlab.geometry.georeference import georeference_pixels
from wildlab.geometry.uncertainty import PoseErrors, ground_covariance

#: Standard deviation of the height of a visible centre above the water, as a share of the object's length:
#: half of a freeboard of a tenth. Chosen.
RISE = 0.05


class Located(NamedTuple):
    """Detections on the water.

    Attributes
    ----------
    points
        (N, 3) m in n; NaN where the ray does not meet the water.
    covariance
        (N, 2, 2) north-east, m^2.
    length
        (N,) of the major axis on the water, m.
    method
        (N,) as of `wildlab.geometry.uncertainty.ground_covariance`.
    """

    points: Array
    covariance: Array
    length: Array
    method: NDArray[np.str_]


def locate(
    detections: Detections,
    poses: CameraPoses,
    pose_covariance: Array,
    mount_covariance: Array,
    plane_down: float = 0.0,
    plane_variance: float = 0.0,
    rise: float = RISE,
) -> Located:
    """Put the detections of one image on the water, H (5.13), with their ellipses.

    Parameters
    ----------
    detections
        Of one image.
    poses
        The camera and its one pose.
    pose_covariance
        (6, 6) position in n, rotation vector in b; m and rad, squared.
    mount_covariance
        (3, 3) rotation vector in m, rad^2.
    plane_down, plane_variance
        Of the water, m and m^2.
    rise
        Standard deviation of the height of what was found, as a share of its length.

    Returns
    -------
    Located
    """
    points = georeference_pixels(poses, detections.uv, plane_down)
    if not len(detections):
        none = np.empty((0, 2, 2))
        return Located(points, none, np.empty(0), np.empty(0, np.str_))
    half = np.array([direction(angle) for angle in detections.orientation]) * detections.axes[:, :1] / 2
    ends = [georeference_pixels(poses, detections.uv + sign * half, plane_down) for sign in (-1, 1)]
    length = np.linalg.norm(ends[1] - ends[0], axis=1)
    height = np.nan_to_num(rise * length) ** 2 + plane_variance
    errors = PoseErrors(detections.covariance, pose_covariance, mount_covariance, height)
    found = ground_covariance(poses, detections.uv, plane_down, errors, np.random.default_rng(0))
    return Located(points, found.covariance, length, found.method)
