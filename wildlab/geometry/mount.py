"""How the camera is fixed to the airframe: gimbal, misalignment, lever arm (H 5.8-5.12, 5.3.2)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from wildlab.geometry.frames import Array, euler_to_matrix

Looks = Literal["down", "forward"]

#: ``R_mc`` for a camera whose lens points along z of the mount, image x to the right: H (5.12) transposed.
R_MC_DOWN: Array = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
#: ``R_mc`` for a camera whose lens points along x of the mount, image upright: F table 2.1.
R_MC_FORWARD: Array = np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])


@dataclass(frozen=True)
class Mount:
    """Where and how the camera sits on the airframe. Radians and metres.

    Attributes
    ----------
    looks
        Along which axis the lens points while pan, tilt and misalignment are zero: ``"down"`` (H 5.12, the
        top of the image is forward) or ``"forward"`` (F table 2.1; also what logs mean that give the pose of
        the camera itself).
    pan, tilt
        Gimbal angles, rotations about z and y (H 5.11).
    misalignment
        Roll, tilt and pan by which the base of the gimbal is turned against the airframe, right-handed about
        x, y and z of the body in zyx order (H 5.3.2).
    lever_arm
        Position of the lens in b, metres (H 5.8).

    Examples
    --------
    A camera in the nose that looks forward and 30 deg down:

    >>> mount = Mount("forward", tilt=np.radians(-30.0), lever_arm=(0.5, 0.0, 0.1))
    """

    looks: Looks = "down"
    pan: float = 0.0
    tilt: float = 0.0
    misalignment: tuple[float, float, float] = (0.0, 0.0, 0.0)
    lever_arm: tuple[float, float, float] = (0.0, 0.0, 0.0)


def helgesen_misalignment(roll: float, tilt: float, pan: float) -> tuple[float, float, float]:
    """The misalignment angles as H 5.6.1 prints them, in the right-handed sense of :class:`Mount`.

    H does not print how the three angles are combined. Tables 5.1-5.3 decide: all 42 numbers come out
    to better than 0.15 m when roll and pan count positive the other way round, as in axes with y to the left.

    Parameters
    ----------
    roll, tilt, pan
        As printed, radians.

    Returns
    -------
    Roll, tilt and pan of a :class:`Mount`, radians.
    """
    return -roll, tilt, -pan


def mount_rotation(mount: Mount, pan: ArrayLike | None = None, tilt: ArrayLike | None = None) -> Array:
    """``R_bm``: misalignment, then the gimbal's pan and tilt, H (5.11) transposed.

    Parameters
    ----------
    mount
        Of the camera.
    pan, tilt
        Gimbal angles, (N,) radians, in place of the mount's own where the gimbal moves.

    Returns
    -------
    (3, 3), or (N, 3, 3); takes a vector from the mount to b.
    """
    roll, lean, turn = mount.misalignment
    base = euler_to_matrix(roll, lean, turn)
    gimbal = euler_to_matrix(0.0, mount.tilt if tilt is None else tilt, mount.pan if pan is None else pan)
    return np.asarray(base @ gimbal)


def camera_rotation(mount: Mount, pan: ArrayLike | None = None, tilt: ArrayLike | None = None) -> Array:
    """``R_bc``, H (5.9).

    Parameters
    ----------
    mount
        Of the camera.
    pan, tilt
        Gimbal angles, (N,) radians, in place of the mount's own where the gimbal moves.

    Returns
    -------
    (3, 3), or (N, 3, 3); takes a vector from c to b.

    Examples
    --------
    A camera that looks down has its z, out of the lens, along z of the airframe, and its y backward:

    >>> camera_rotation(Mount("down"))
    array([[ 0., -1.,  0.],
           [ 1.,  0.,  0.],
           [ 0.,  0.,  1.]])
    """
    R_mc = R_MC_DOWN if mount.looks == "down" else R_MC_FORWARD
    return np.asarray(mount_rotation(mount, pan, tilt) @ R_mc)


def camera_pose(
    mount: Mount,
    p_nb: ArrayLike,
    R_nb: ArrayLike,
    pan: ArrayLike | None = None,
    tilt: ArrayLike | None = None,
) -> tuple[Array, Array]:
    """Pose of the camera from the pose of the airframe, H (5.8) and (5.9).

    :class:`~wildlab.geometry.camera_poses.CameraPoses` keeps both together, with the camera.

    Parameters
    ----------
    mount
        Of the camera.
    p_nb, R_nb
        Pose of the airframe, (N, 3) metres and (N, 3, 3), or one.
    pan, tilt
        Gimbal angles, (N,) radians, in place of the mount's own where the gimbal moves.

    Returns
    -------
    ``p_nc`` (N, 3), metres, and ``R_nc`` (N, 3, 3).
    """
    R = np.asarray(R_nb, float)
    p_nc = np.asarray(p_nb, float) + R @ np.asarray(mount.lever_arm)
    return np.asarray(p_nc), np.asarray(R @ camera_rotation(mount, pan, tilt))
