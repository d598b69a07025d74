"""How a camera is turned on its airframe, from points whose places a motion-capture system knows (H 5.3.2).

H (5.15) puts each clicked pixel onto the plane of the points, through the pose of the airframe and a trial of
the three angles; H (5.16)-(5.17) choose the angles that bring it nearest to the point. This is `calibrate`
with every point counting alike.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from wildlab.errors import WildlabError
from wildlab.geometry.calibration import calibrate
from wildlab.geometry.camera_poses import CameraPoses
from wildlab.geometry.corrections import Calibration, apply_calibration
from wildlab.geometry.frames import Array
from wildlab.geometry.georeference import georeference_pixels
from wildlab.geometry.mount import Mount

#: H 5.3.2: three points in every image, for three angles.
FEWEST_POINTS = 3


class Mounting(NamedTuple):
    """A mount found from known points.

    Attributes
    ----------
    mount
        With the misalignment found.
    calibration
        The angles on top of the mount that it began with, with their covariance.
    residuals
        (N, 2) metres, north and east: where the pixels fall with that mount, less where the points are.
    range
        Mean distance of the lens from the points, metres.
    """

    mount: Mount
    calibration: Calibration
    residuals: Array
    range: float

    @property
    def error(self) -> float:
        """Mean distance of the points from where their pixels fall, metres (0.0229 m in H 5.6.1)."""
        return float(np.nanmean(np.linalg.norm(self.residuals, axis=1)))

    def error_at(self, range: float) -> float:
        """The same at another distance, metres, if it is all from the camera's orientation (H 5.6.1)."""
        return self.error * range / self.range


def mounting_from_points(
    poses: CameraPoses, uv: ArrayLike, known_points: ArrayLike, image: Sequence[object] | np.ndarray
) -> Mounting:
    """The misalignment that brings pixels onto known points, H (5.15)-(5.17).

    Parameters
    ----------
    poses
        Of the airframe at each of the N pixels, with the mount to begin with.
    uv
        (N, 2) pixels of the points.
    known_points
        (N, 3) metres in n; their down coordinate is the plane each pixel is cut with.
    image
        (N,) which image each pixel belongs to.

    Returns
    -------
    Mounting

    Raises
    ------
    WildlabError
        Where no image has three points, or the angles cannot be told apart.

    Examples
    --------
    >>> from wildlab.geometry import Camera, ground_to_pixel
    >>> points = np.array([[x, y, 0.0] for x in (-0.2, 0, 0.2) for y in (-0.2, 0, 0.2)])
    >>> camera, p, level = Camera(640, 512, 1160.0, 1160.0, 313.0, 265.0), np.array([0, 0, -1.2]), np.eye(3)
    >>> turned = CameraPoses(camera, Mount(misalignment=(0.03, 0.07, -0.03)), p, level)
    >>> uv = ground_to_pixel(camera, points, turned.p_nc, turned.R_nc)
    >>> found = mounting_from_points(CameraPoses(camera, Mount(), p, level), uv, points, np.zeros(9))
    >>> print(np.round(found.mount.misalignment, 6), round(found.error, 6))
    [ 0.03  0.07 -0.03] 0.0
    """
    uv, known = np.asarray(uv, float), np.asarray(known_points, float)
    most = int(np.unique(np.asarray(image), return_counts=True)[1].max())
    if most < FEWEST_POINTS:
        raise WildlabError(
            f"no image has more than {most} known points, and {FEWEST_POINTS} are needed for three angles",
            "click more points of the board in each image",
        )
    found = calibrate(lambda _: poses, uv, known, image)
    if found.undetermined:
        name, others = next(iter(found.undetermined.items()))
        raise WildlabError(
            f"{name} cannot be told apart from {' and '.join(others) or 'nothing at all'}",
            "take points from several sides, some far from the middle of the image",
        )
    mount = apply_calibration(found, poses.mount)
    turned = replace(poses, mount=mount)
    ground = georeference_pixels(turned, uv, known[:, 2])
    distance = np.linalg.norm(np.broadcast_to(turned.p_nc, known.shape) - known, axis=1)
    return Mounting(mount, found, ground[:, :2] - known[:, :2], float(distance.mean()))
