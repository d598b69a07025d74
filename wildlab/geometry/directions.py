"""How well, and how differently, cameras know the direction of a pixel, apart from a turn of the camera.

A turn is no fault of a lens: whoever calibrates the mount takes it up (H 5.3.2). So what is left is what the
intrinsic parameters do to the picture, in pixels, whatever they are called.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from wildlab.geometry.board_views import Views, parameters_of, project_board
from wildlab.geometry.camera import Camera, normalise
from wildlab.geometry.frames import Array
from wildlab.geometry.intrinsics import Intrinsics, free_columns

#: Columns and rows of the raster over which the turn is taken off.
RASTER = (33, 25)


def direction_sd(found: Intrinsics, uv: ArrayLike) -> Array:
    """How far off the estimate puts what is seen in a fixed direction, apart from a turn of the whole camera.

    The turn is the one that takes up most over the image: a calibration of the mount does the same.

    Parameters
    ----------
    found
        From `calibrate_camera`.
    uv
        (N, 2) pixels.

    Returns
    -------
    (N,) root of the summed variances of both axes, pixels; NaN where the lens sees nothing.
    """
    J, K = _by_direction(found, image_raster(found.camera))
    seen = np.isfinite(J).all(axis=(1, 2))
    turn = np.linalg.lstsq(K[seen].reshape(-1, 3), J[seen].reshape(-1, J.shape[-1]), rcond=None)[0]
    J, K = _by_direction(found, np.asarray(uv, float))
    left = J - K @ turn
    return np.asarray(np.sqrt(np.einsum("nip,pq,niq->n", left, found.covariance, left)))


def _by_direction(found: Intrinsics, uv: Array) -> tuple[Array, Array]:
    """How pixels (N, 2) of fixed directions move with the estimate, (N, 2, P), and a turn, (N, 2, 3)."""
    xy = normalise(found.camera, uv)
    rays = np.column_stack([xy, np.ones(len(xy))])
    at = project_board(parameters_of(found.camera), Views(np.eye(3)[None], np.zeros((1, 3))), rays)
    return at.by_intrinsics[0] @ free_columns(found.names), at.by_pose[0, ..., :3]


def image_raster(camera: Camera) -> Array:
    """Pixels in even rows and columns over the image, its borders included.

    Parameters
    ----------
    camera
        Of the image.

    Returns
    -------
    (825, 2) pixels.
    """
    columns, rows = RASTER
    u, v = np.meshgrid(np.linspace(0, camera.width, columns), np.linspace(0, camera.height, rows))
    return np.column_stack([u.ravel(), v.ravel()])


def direction_differences(one: Camera, other: Camera) -> Array:
    """How differently two cameras read the pixels of an image, apart from a turn of the whole camera.

    Parameters
    ----------
    one, other
        Of the same image.

    Returns
    -------
    (825, 2) pixels of the first, at `image_raster`; NaN where one of them sees nothing.

    Examples
    --------
    A principal point that is 5 px off is nearly a turn, and does little else:

    >>> near = Camera(640, 512, 1000.0, 1000.0, 320.0, 256.0)
    >>> bool(np.abs(direction_differences(near, Camera(640, 512, 1000.0, 1000.0, 325.0, 256.0))).max() < 0.5)
    True
    """
    uv = image_raster(one)
    ideal = normalise(other, uv)
    x, y = ideal.T
    scale = np.array([one.fx, one.fy])
    apart = (normalise(one, uv) - ideal) * scale
    # How a small turn about each axis of c moves a direction, in the same pixels.
    turns = np.stack([[-x * y, 1 + x * x, -y], [-(1 + y * y), x * y, x]]).transpose(2, 0, 1)
    turns = turns * scale[None, :, None]
    seen = np.isfinite(apart).all(axis=1)
    turn = np.linalg.lstsq(turns[seen].reshape(-1, 3), apart[seen].reshape(-1), rcond=None)[0]
    return np.asarray(apart - turns @ turn)
