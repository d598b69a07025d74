"""Constant corrections to what a camera's poses are made of: mount, position, clock and lens (H 5.3.2).

`wildlab.geometry.calibration` estimates them.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from wildlab.geometry.camera import Camera, normalise
from wildlab.geometry.camera_poses import CameraPoses, Mount
from wildlab.geometry.covariances import NamedEstimates
from wildlab.geometry.frames import Array, euler_to_matrix, matrix_to_euler
from wildlab.geometry.georeference import georeference_pixels
from wildlab.geometry.uncertainty import ground_jacobians

#: Every parameter that can be estimated, in the order in which they are kept when the data cannot carry all;
#: with the size an error of it would usually have (radians, seconds, metres, shares, pixels, k1). A
#: parameter, or a combination, that the data determine no better than that is not worth fitting.
PARAMETERS: dict[str, float] = {
    "roll": np.radians(3.0),
    "tilt": np.radians(3.0),
    "pan": np.radians(3.0),
    "heading": np.radians(3.0),
    "clock": 0.5,
    "down": 5.0,
    "north": 5.0,
    "east": 5.0,
    "focal": 0.02,
    "aspect": 0.02,
    "centre_u": 20.0,
    "centre_v": 20.0,
    "radial": 0.03,
}
#: How large a correction can plausibly be, either way, in the same units. An estimate beyond is no correction
#: but a sign that something else is wrong (a wrong import, another lens, parameters that the geometry
#: confuses): a mount is turned by hand, a compass misses the declination (30 degrees at most where people
#: fly), barometers and satellite fixes drift by tens of metres (a geoid is taken off on import), focal
#: lengths of a wrong data sheet or another focus differ by some 10 %, and pixels are nearly square. A k1 of
#: 0.3 moves points at 45 degrees from the axis by 30 %: beyond is a fisheye, which k1 does not describe.
BOUNDS: dict[str, float] = {
    "roll": np.radians(15.0),
    "tilt": np.radians(15.0),
    "pan": np.radians(30.0),
    "heading": np.radians(30.0),
    "clock": 30.0,
    "down": 30.0,
    "north": 30.0,
    "east": 30.0,
    "focal": 0.15,
    "aspect": 0.05,
    "centre_u": 200.0,
    "centre_v": 200.0,
    "radial": 0.3,
}
#: Logarithm of the largest factor by which focal lengths are changed, whatever is estimated.
MOST_FOCAL = 10.0
BORESIGHT = ("roll", "tilt", "pan")
#: Seconds either way over which the derivative by the clock is taken. Between two samples of a log the slope
#: is mostly their noise, and it goes together with the noise of the pose that lies between them.
CLOCK_STEP = 0.2

#: Poses at the times of N pixels, shifted by so many seconds.
PosesAt = Callable[[float], CameraPoses]


@dataclass(frozen=True)
class Calibration(NamedEstimates):
    """An estimate of some of :data:`PARAMETERS`.

    Attributes
    ----------
    names
        The parameters estimated.
    values
        Corrections (P,), radians, seconds, metres, shares, pixels, k1: roll, tilt and pan turn the camera's
        base on the airframe, ``heading`` turns that about the vertical, ``clock`` is to be added to the
        camera's stamps, ``north``/``east``/``down`` to the logged position, ``centre_u``/``centre_v`` to the
        principal point, ``radial`` to k1. Both focal lengths are multiplied by ``exp(focal)``, and their
        ratio (that of columns over that of rows) by ``exp(aspect)``.
    covariance
        (P, P); clicks of one image count as one draw of the image's error.
    undetermined
        Asked for and not estimated, with the parameters each could not be told apart from (none: it has no
        effect that shows).
    n_points, n_images, n_draws
        What it rests on; no draws: not known.
    freedom
        (P,) degrees of freedom of the variances; left out, those of the draws.
    """

    names: tuple[str, ...]
    values: Array
    covariance: Array
    undetermined: dict[str, tuple[str, ...]]
    n_points: int
    n_images: int
    n_draws: int = 0
    freedom: Array | None = None

    @classmethod
    def in_sizes(cls, names: tuple[str, ...], sizes: Array) -> Calibration:
        """Corrections to try, without a covariance; ``sizes`` (P,) are in units of :data:`PARAMETERS`."""
        values = sizes * np.array([PARAMETERS[name] for name in names])
        return cls(names, values, np.zeros((len(names),) * 2), {}, 0, 0)

    def freedom_of(self, name: str) -> float:
        """Degrees of freedom of a variance."""
        if self.freedom is not None and name in self.names:
            return float(self.freedom[self.names.index(name)])
        return self.n_draws - 1 if self.n_draws > 1 else 1e9


def apply_calibration(calibration: Calibration, mount: Mount) -> Mount:
    """The mount with the estimated angles on top of its own misalignment.

    Parameters
    ----------
    calibration
        The estimate.
    mount
        The one it was estimated with.

    Returns
    -------
    The mount, otherwise unchanged.
    """
    angles = [calibration.value(name) for name in BORESIGHT]
    turned = euler_to_matrix(*angles) @ euler_to_matrix(*mount.misalignment)
    roll, tilt, pan = matrix_to_euler(turned)
    return replace(mount, misalignment=(float(roll), float(tilt), float(pan)))


def calibrated_camera(calibration: Calibration, camera: Camera) -> Camera:
    """The camera with the estimated focal lengths, principal point and radial distortion.

    Parameters
    ----------
    calibration
        The estimate.
    camera
        The one it was estimated with.

    Returns
    -------
    The camera, otherwise unchanged.
    """
    both, half = calibration.value("focal"), calibration.value("aspect") / 2
    # A search that goes astray leaves what any lens has.
    times_x, times_y = np.exp(np.clip([both + half, both - half], -MOST_FOCAL, MOST_FOCAL)).tolist()
    return replace(
        camera,
        fx=camera.fx * times_x,
        fy=camera.fy * times_y,
        cx=camera.cx + calibration.value("centre_u"),
        cy=camera.cy + calibration.value("centre_v"),
        distortion=(camera.distortion[0] + calibration.value("radial"), *camera.distortion[1:]),
    )


def calibrated_poses(calibration: Calibration, poses_at: PosesAt) -> CameraPoses:
    """Poses with a calibration applied to clock, position, heading, mount and camera.

    Parameters
    ----------
    calibration
        The estimate.
    poses_at
        Gives the poses, as logged, at the times of the pixels shifted by an offset in seconds.

    Returns
    -------
    The poses; their covariance is that of the logged ones.
    """
    poses = poses_at(calibration.value("clock"))
    shift = np.array([calibration.value(name) for name in ("north", "east", "down")])
    return replace(
        poses,
        p_nb=poses.p_nb + shift,
        R_nb=euler_to_matrix(0.0, 0.0, calibration.value("heading")) @ poses.R_nb,
        mount=apply_calibration(calibration, poses.mount),
        camera=calibrated_camera(calibration, poses.camera),
    )


def georeference_calibrated(
    calibration: Calibration, poses_at: PosesAt, uv: ArrayLike, plane_down: ArrayLike
) -> Array:
    """Ground points with a calibration applied to clock, position, heading and mount.

    Parameters
    ----------
    calibration
        The estimate.
    poses_at
        Gives the poses, as logged, at the times of the pixels shifted by an offset in seconds.
    uv
        (N, 2) pixels.
    plane_down
        Down coordinate of the plane in n, metres, scalar or (N,).

    Returns
    -------
    (N, 3) metres in n; NaN where a ray misses the plane.

    Raises
    ------
    WildlabError
        Where there is another number of poses, or of planes, than of pixels.
    """
    return georeference_pixels(calibrated_poses(calibration, poses_at), uv, plane_down)


def calibration_jacobian(
    calibration: Calibration, poses_at: PosesAt, uv: ArrayLike, plane_down: ArrayLike
) -> Array:
    """Derivatives of :func:`georeference_calibrated`, north and east, with respect to its parameters.

    A correction is carried to the ground as what it amounts to: a shift of the airframe, a turn of the
    airframe or of the mount, a shift of the pixel. The derivative by the clock is a difference over
    :data:`CLOCK_STEP` either way.

    Parameters
    ----------
    calibration
        P parameters, and the values at which derivatives are taken.
    poses_at, uv, plane_down
        As for :func:`georeference_calibrated`.

    Returns
    -------
    (N, 2, P), metres per unit of each parameter; NaN where a ray misses the plane.

    Raises
    ------
    WildlabError
        Where there is another number of poses, or of planes, than of pixels.
    """
    poses = calibrated_poses(calibration, poses_at)
    J, camera = ground_jacobians(poses, uv, plane_down), poses.camera
    turn = J.mount @ np.swapaxes(poses.R_bm, -1, -2)
    _, tilt, pan = (calibration.value(name) for name in BORESIGHT)
    lens, scale = normalise(camera, uv), camera.matrix[:2, :2]
    bent = (np.asarray(uv, float) - (camera.cx, camera.cy)) @ np.linalg.inv(scale).T

    def column(name: str) -> Array:
        match name:
            case "north" | "east" | "down":
                return J.pose[..., ("north", "east", "down").index(name)]
            case "heading":
                return np.einsum("...ij,...j->...i", J.pose[..., 3:], poses.R_nb[..., 2, :])
            case "pan":
                return turn[..., 2]
            case "tilt":
                return turn @ euler_to_matrix(0.0, 0.0, pan)[:, 1]
            case "roll":
                return turn @ euler_to_matrix(0.0, tilt, pan)[:, 0]
            case "clock":
                step = np.array([one == "clock" for one in calibration.names]) * CLOCK_STEP
                later, earlier = (
                    georeference_calibrated(replace(calibration, values=values), poses_at, uv, plane_down)
                    for values in (calibration.values + step, calibration.values - step)
                )
                return (later - earlier)[..., :2] / (2 * CLOCK_STEP)
            case "centre_u" | "centre_v":
                return -J.pixel[..., ("centre_u", "centre_v").index(name)]
        moved = {
            "focal": bent * (camera.fx, camera.fy),
            "aspect": bent * (camera.fx / 2, -camera.fy / 2),
            "radial": lens * (lens**2).sum(axis=-1, keepdims=True) @ scale.T,
        }[name]
        return -np.einsum("...ij,...j->...i", J.pixel, moved)

    columns = [column(name) for name in calibration.names]
    return np.stack(columns, axis=-1) if columns else np.zeros((*lens.shape, 0))
