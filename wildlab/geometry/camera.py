"""The camera: pinhole with skew and Brown distortion, both ways.

A camera takes a point in c to a pixel: normalise (divide by z), distort, scale and shift (H 5.6, F 2.20).
Distortion follows OpenCV's model and order ``k1, k2, p1, p2, k3``, which is F (2.16) with F's
``k1, k2, k4, k3, k5``. Written in numpy rather than handed to ``cv2.projectPoints`` because OpenCV has no
skew and takes one pose per call; OpenCV is the oracle in the tests.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from wildlab.geometry.frames import Array

NO_DISTORTION = (0.0, 0.0, 0.0, 0.0, 0.0)


@dataclass(frozen=True)
class Camera:
    """Intrinsic parameters, all in pixels but for the distortion, which has no unit.

    ``distortion`` is ``(k1, k2, p1, p2, k3)``. Pixel (0, 0) is the centre of the upper left pixel or its
    corner, as the calibration had it: the difference of half a pixel is inside ``cx`` and ``cy``.

    Examples
    --------
    >>> Camera(640, 512, fx=1000.0, fy=1000.0, cx=320.0, cy=256.0).matrix
    array([[1000.,    0.,  320.],
           [   0., 1000.,  256.],
           [   0.,    0.,    1.]])
    """

    width: int
    height: int
    fx: float
    fy: float
    cx: float
    cy: float
    skew: float = 0.0
    distortion: tuple[float, float, float, float, float] = NO_DISTORTION

    @property
    def matrix(self) -> Array:
        """The intrinsic matrix ``A`` (3, 3), H (2.1), with the skew of F (2.15)."""
        return np.array([[self.fx, self.skew, self.cx], [0.0, self.fy, self.cy], [0.0, 0.0, 1.0]])

    @property
    def distorts(self) -> bool:
        """Whether any distortion coefficient differs from zero."""
        return any(self.distortion)


def camera_from_data_sheet(
    width: int, height: int, focal_length: float, sensor_width: float, sensor_height: float
) -> Camera:
    """The theoretical camera of H (2.2), with the principal point in the middle of the image.

    Parameters
    ----------
    width, height
        Of the image, pixels.
    focal_length
        Metres.
    sensor_width, sensor_height
        Of the chip, metres.

    Returns
    -------
    The camera.

    Examples
    --------
    >>> camera = camera_from_data_sheet(640, 512, 0.019, 0.01088, 0.008704)
    >>> round(camera.fx, 1), camera.cx
    (1117.6, 320.0)
    """
    return Camera(
        width,
        height,
        width / sensor_width * focal_length,
        height / sensor_height * focal_length,
        width / 2,
        height / 2,
    )


def distort(xy: ArrayLike, distortion: ArrayLike) -> Array:
    """Distorted normalised coordinates of ideal ones, F (2.16).

    Parameters
    ----------
    xy
        (N, 2), no unit.
    distortion
        ``(k1, k2, p1, p2, k3)``.

    Returns
    -------
    (N, 2), no unit.
    """
    k1, k2, p1, p2, k3 = np.asarray(distortion, float)
    x, y = np.moveaxis(np.asarray(xy, float), -1, 0)
    r2 = x * x + y * y
    radial = 1 + r2 * (k1 + r2 * (k2 + r2 * k3))
    return np.stack(
        [
            x * radial + 2 * p1 * x * y + p2 * (r2 + 2 * x * x),
            y * radial + p1 * (r2 + 2 * y * y) + 2 * p2 * x * y,
        ],
        axis=-1,
    )


def distortion_jacobian(xy: ArrayLike, distortion: ArrayLike) -> Array:
    """Derivative of :func:`distort` with respect to the ideal coordinates.

    Parameters
    ----------
    xy
        Ideal coordinates, (N, 2), no unit.
    distortion
        ``(k1, k2, p1, p2, k3)``.

    Returns
    -------
    (N, 2, 2), no unit.
    """
    k1, k2, p1, p2, k3 = np.asarray(distortion, float)
    x, y = np.moveaxis(np.asarray(xy, float), -1, 0)
    r2 = x * x + y * y
    radial = 1 + r2 * (k1 + r2 * (k2 + r2 * k3))
    slope = 2 * (k1 + r2 * (2 * k2 + r2 * 3 * k3))  # d radial / d r2, times two
    J = np.empty((*x.shape, 2, 2))
    J[..., 0, 0] = radial + slope * x * x + 2 * p1 * y + 6 * p2 * x
    J[..., 0, 1] = J[..., 1, 0] = slope * x * y + 2 * p1 * x + 2 * p2 * y
    J[..., 1, 1] = radial + slope * y * y + 6 * p1 * y + 2 * p2 * x
    return J


def undistort(xy_distorted: ArrayLike, distortion: ArrayLike, tolerance: float = 1e-13) -> Array:
    """Ideal normalised coordinates of distorted ones: the exact inverse of :func:`distort`.

    By Newton's method. OpenCV's fixed-point iteration converges slowly or not at all where the distortion is
    strong; Newton's needs three to five steps. A polynomial folds back on itself at some radius: a point that
    no ideal point inside the fold maps to becomes NaN; so do some close to the fold of lenses stronger than
    any that is sold.

    Parameters
    ----------
    xy_distorted
        (N, 2), no unit.
    distortion
        ``(k1, k2, p1, p2, k3)``.
    tolerance
        Largest remaining difference in distorted coordinates.

    Returns
    -------
    (N, 2).
    """
    target = np.asarray(xy_distorted, float)
    wanted = target.reshape(-1, 2)
    xy, going = wanted.copy(), np.arange(len(wanted))
    with np.errstate(all="ignore"):
        for _ in range(50):
            miss = distort(xy[going], distortion) - wanted[going]
            far = np.abs(miss).max(axis=1) > tolerance
            going, miss = going[far], miss[far]
            if not len(going):
                break
            J, determinant = _with_determinant(xy[going], distortion)
            step = np.stack([J[:, 1, 1], J[:, 0, 0]], axis=1) * miss - J[:, 0, 1:] * miss[:, ::-1]
            step /= determinant[:, None]
            # A long step would leap over the fold of the polynomial.
            xy[going] -= step * np.minimum(1.0, 0.3 / np.linalg.norm(step, axis=1))[:, None]
        J, determinant = _with_determinant(xy, distortion)
        miss = np.abs(distort(xy, distortion) - wanted).max(axis=1)
    good = (determinant > 0) & (J[:, 0, 0] > 0) & (miss <= max(tolerance, 1e-12))
    return np.where(good[:, None], xy, np.nan).reshape(target.shape)


def _with_determinant(xy: Array, distortion: ArrayLike) -> tuple[Array, Array]:
    J = distortion_jacobian(xy, distortion)
    return J, J[:, 0, 0] * J[:, 1, 1] - J[:, 0, 1] ** 2


def undistort_approximately(xy_distorted: ArrayLike, k1: float) -> Array:
    """F's approximate inverse (2.19) of the one-parameter model (2.18).

    Good for a narrow field of view only; :func:`undistort` with ``(k1, 0, 0, 0, 0)`` is the exact one.

    Parameters
    ----------
    xy_distorted
        (N, 2), no unit.
    k1
        The one coefficient.

    Returns
    -------
    (N, 2), no unit.
    """
    xy = np.asarray(xy_distorted, float)
    r2 = np.sum(xy * xy, axis=-1, keepdims=True)
    return np.asarray(xy / (1 + k1 * r2 / (1 + k1 * r2)))


def normalise(camera: Camera, uv: ArrayLike) -> Array:
    """Ideal normalised coordinates ``x/z, y/z`` in c of pixels, F (2.21), exact.

    Parameters
    ----------
    camera
        The intrinsic parameters.
    uv
        (N, 2) pixels.

    Returns
    -------
    (N, 2), no unit; NaN where no direction is seen at that pixel (see :func:`undistort`).

    Examples
    --------
    >>> normalise(Camera(640, 512, 1000.0, 1000.0, 320.0, 256.0), [[320.0, 256.0], [420.0, 256.0]])
    array([[0. , 0. ],
           [0.1, 0. ]])
    """
    xy = np.asarray(uv, float) - (camera.cx, camera.cy)
    xy /= (camera.fx, camera.fy)
    if camera.skew:
        xy[..., 0] -= camera.skew / camera.fx * xy[..., 1]
    return undistort(xy, camera.distortion) if camera.distorts else xy


def normalise_jacobian(camera: Camera, xy: ArrayLike) -> Array:
    """Derivative of :func:`normalise` with respect to the pixel.

    Parameters
    ----------
    camera
        The intrinsic parameters.
    xy
        Ideal normalised coordinates, (N, 2).

    Returns
    -------
    (N, 2, 2), per pixel.
    """
    xy = np.asarray(xy, float)
    scale = camera.matrix[:2, :2]
    if not camera.distorts:
        return np.broadcast_to(np.linalg.inv(scale), (*xy.shape, 2)).copy()
    J = scale @ distortion_jacobian(xy, camera.distortion)
    lost = ~np.isfinite(J).all(axis=(-1, -2))
    J[lost] = np.eye(2)
    inverse = np.linalg.inv(J)
    inverse[lost] = np.nan
    return np.asarray(inverse)


def project(camera: Camera, p_c: ArrayLike) -> Array:
    """Pixels of points in c, H (5.6), F (2.20).

    Parameters
    ----------
    camera
        The intrinsic parameters.
    p_c
        (N, 3) metres in c.

    Returns
    -------
    (N, 2) pixels, which may lie outside the image; NaN for points in or behind the plane of the lens.

    Examples
    --------
    >>> project(Camera(640, 512, 1000.0, 1000.0, 320.0, 256.0), [[1.0, 0.0, 10.0], [1.0, 0.0, -10.0]])
    array([[420., 256.],
           [ nan,  nan]])
    """
    p = np.asarray(p_c, float)
    z = np.where(p[..., 2] > 0, p[..., 2], np.nan)
    xy = p[..., :2] / z[..., None]
    if camera.distorts:
        xy = distort(xy, camera.distortion)
    return np.stack(
        [camera.fx * xy[..., 0] + camera.skew * xy[..., 1] + camera.cx, camera.fy * xy[..., 1] + camera.cy],
        axis=-1,
    )


def in_image(camera: Camera, uv: ArrayLike, border: float = 0.0) -> np.ndarray:
    """Which pixels lie inside the image.

    Parameters
    ----------
    camera
        The intrinsic parameters.
    uv
        (N, 2) pixels.
    border
        How far from the edge they must be, pixels.

    Returns
    -------
    (N,) bool; NaN is outside.
    """
    u, v = np.moveaxis(np.asarray(uv, float), -1, 0)
    with np.errstate(invalid="ignore"):
        return np.asarray(
            (u >= border) & (u <= camera.width - border) & (v >= border) & (v <= camera.height - border)
        )
