"""Views of a flat board: its projection with derivatives, and a start for an estimate from homographies.

The board lies in its own frame, z = 0. A view is a pose ``(rotation (3, 3), translation (3,))`` that takes a
point of the board to c. `wildlab.geometry.intrinsics` estimates camera and views together.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from wildlab.geometry.camera import Camera, distort, distortion_jacobian, normalise
from wildlab.geometry.frames import Array

#: Intrinsic parameters, in the order of the derivatives.
INTRINSICS = ("fx", "fy", "cx", "cy", "skew", "k1", "k2", "p1", "p2", "k3")


class Views(NamedTuple):
    """Poses of V views of a board: ``rotation`` (V, 3, 3) and ``translation`` (V, 3), from the board to c."""

    rotation: Array
    translation: Array


class Projected(NamedTuple):
    """Pixels (V, M, 2) of the board's points, their derivatives by intrinsics (V, M, 2, 10), and by the pose
    of their view (V, M, 2, 6): a small rotation in c (rad), then the translation."""

    uv: Array
    by_intrinsics: Array
    by_pose: Array


def camera_of(theta: ArrayLike, width: int, height: int) -> Camera:
    """A camera from its ten parameters.

    Parameters
    ----------
    theta
        (10,) in the order of `INTRINSICS`.
    width, height
        Of the image, pixels.

    Returns
    -------
    Camera
    """
    fx, fy, cx, cy, skew, k1, k2, p1, p2, k3 = (float(one) for one in np.asarray(theta, float))
    return Camera(width, height, fx, fy, cx, cy, skew, (k1, k2, p1, p2, k3))


def parameters_of(camera: Camera) -> Array:
    """The ten parameters of a camera, the inverse of `camera_of`.

    Parameters
    ----------
    camera
        The camera.

    Returns
    -------
    (10,) in the order of `INTRINSICS`.
    """
    return np.array([camera.fx, camera.fy, camera.cx, camera.cy, camera.skew, *camera.distortion])


def project_board(theta: ArrayLike, views: Views, board: ArrayLike) -> Projected:
    """The board's points in each view, F (2.20), with derivatives.

    Parameters
    ----------
    theta
        (10,) intrinsic parameters in the order of `INTRINSICS`.
    views
        Poses of the board.
    board
        (M, 3) metres in the frame of the board.

    Returns
    -------
    Projected
        NaN for points in or behind the plane of the lens.
    """
    theta, board = np.asarray(theta, float), np.asarray(board, float)
    turned = np.einsum("vij,mj->vmi", views.rotation, board)
    p = turned + views.translation[:, None]
    z = np.where(p[..., 2] > 0, p[..., 2], np.nan)
    xy = p[..., :2] / z[..., None]
    x, y = xy[..., 0], xy[..., 1]
    ideal = distort(xy, theta[5:])
    A = np.array([[theta[0], theta[4]], [0.0, theta[1]]])
    uv = ideal @ A.T + theta[2:4]

    r2 = x * x + y * y
    zero, one = np.zeros_like(x), np.ones_like(x)
    linear = [
        np.stack([ideal[..., 0], zero], -1),
        np.stack([zero, ideal[..., 1]], -1),
        np.stack([one, zero], -1),
        np.stack([zero, one], -1),
        np.stack([ideal[..., 1], zero], -1),
    ]
    bent = [
        xy * r2[..., None],
        xy * (r2 * r2)[..., None],
        np.stack([2 * x * y, r2 + 2 * y * y], -1),
        np.stack([r2 + 2 * x * x, 2 * x * y], -1),
        xy * (r2**3)[..., None],
    ]
    by_intrinsics = np.stack([*linear, *(one @ A.T for one in bent)], axis=-1)

    by_point = np.zeros((*x.shape, 2, 3))
    by_point[..., 0, 0] = by_point[..., 1, 1] = 1 / z
    by_point[..., :, 2] = -xy / z[..., None]
    by_point = A @ distortion_jacobian(xy, theta[5:]) @ by_point
    turn = np.zeros((*x.shape, 3, 3))  # derivative of a small rotation: -[turned]x
    a, b, c = np.moveaxis(turned, -1, 0)
    turn[..., 0, 1], turn[..., 0, 2] = c, -b
    turn[..., 1, 0], turn[..., 1, 2] = -c, a
    turn[..., 2, 0], turn[..., 2, 1] = b, -a
    return Projected(uv, by_intrinsics, np.concatenate([by_point @ turn, by_point], axis=-1))


def homography(board: ArrayLike, xy: ArrayLike) -> Array:
    """The homography (3, 3) from a flat board to the image, by the normalised linear method.

    Parameters
    ----------
    board
        (M, 2), at least four points, not on a line.
    xy
        (M, 2) in the image.

    Returns
    -------
    (3, 3), its last element not fixed.
    """
    source, s = _centred(np.asarray(board, float))
    target, t = _centred(np.asarray(xy, float))
    ones, zeros = np.ones((len(source), 1)), np.zeros((len(source), 3))
    homogeneous = np.hstack([source, ones])
    A = np.vstack(
        [
            np.hstack([homogeneous, zeros, -target[:, :1] * homogeneous]),
            np.hstack([zeros, homogeneous, -target[:, 1:] * homogeneous]),
        ]
    )
    H = np.linalg.svd(A)[2][-1].reshape(3, 3)
    return np.asarray(np.linalg.inv(t) @ H @ s)


def _centred(points: Array) -> tuple[Array, Array]:
    """Points about their middle with a mean distance of sqrt(2), and the (3, 3) that does so."""
    middle = points.mean(axis=0)
    scale = np.sqrt(2) / max(float(np.linalg.norm(points - middle, axis=1).mean()), 1e-12)
    T = np.array([[scale, 0, -scale * middle[0]], [0, scale, -scale * middle[1]], [0, 0, 1.0]])
    return (points - middle) * scale, T


def start_camera(board: Array, uv: Array, width: int, height: int) -> Camera:
    """A first camera without distortion: focal lengths by Zhang's conditions, principal point in the middle.

    Parameters
    ----------
    board
        (M, 3), flat.
    uv
        (V, M, 2) pixels; NaN where a point is not seen.
    width, height
        Of the image, pixels.

    Returns
    -------
    Camera
        Its focal length is the image's width where the views do not tell it.
    """
    middle = np.array([(width - 1) / 2, (height - 1) / 2])
    rows, values = [], []
    for one in uv:
        seen = np.isfinite(one).all(axis=1)
        H = homography(board[seen, :2], one[seen] - middle)
        H = H / np.linalg.norm(H, axis=0).mean()
        for a, b in ((H[:, 0], H[:, 1]), (H[:, 0] + H[:, 1], H[:, 0] - H[:, 1])):
            # Columns of a rotation are at right angles, and so are their sum and difference.
            rows.append([a[0] * b[0], a[1] * b[1]])
            values.append(-a[2] * b[2])
    inverse = np.linalg.lstsq(np.array(rows), np.array(values), rcond=None)[0]
    usable = np.isfinite(inverse).all() and (inverse > 0).all()
    fx, fy = 1 / np.sqrt(inverse) if usable else (float(width), float(width))
    if not (0.1 * width < fx < 100 * width and 0.1 * width < fy < 100 * width):
        fx = fy = float(width)
    return Camera(width, height, float(fx), float(fy), float(middle[0]), float(middle[1]))


def start_views(camera: Camera, board: Array, uv: Array) -> Views:
    """Poses of the views from their homographies through a camera.

    Parameters
    ----------
    camera
        Its intrinsic parameters.
    board
        (M, 3), flat.
    uv
        (V, M, 2) pixels; NaN where a point is not seen.

    Returns
    -------
    Views
    """
    rotations, translations = [], []
    for one in uv:
        xy = normalise(camera, one)
        seen = np.isfinite(xy).all(axis=1)
        H = homography(board[seen, :2], xy[seen])
        H = H / np.sqrt(np.linalg.norm(H[:, 0]) * np.linalg.norm(H[:, 1]))
        middle = H @ np.append(board[seen, :2].mean(axis=0), 1.0)
        H = H * np.sign(middle[2])  # the board is before the lens
        U, _, V = np.linalg.svd(np.column_stack([H[:, 0], H[:, 1], np.cross(H[:, 0], H[:, 1])]))
        rotations.append(U @ V if np.linalg.det(U @ V) > 0 else U @ np.diag([1.0, 1.0, -1.0]) @ V)
        translations.append(H[:, 2])
    return Views(np.array(rotations), np.array(translations))
