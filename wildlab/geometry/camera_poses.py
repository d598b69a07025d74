"""How the camera is fixed to the airframe: gimbal, misalignment, lever arm (H 5.8-5.12, 5.3.2).

Where a camera was and which way it looked: poses of the airframe, the mount, and what follows.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from wildlab.errors import WildlabError
from wildlab.geometry.camera import Camera
from wildlab.geometry.frames import Array, euler_to_matrix, matrix_to_euler

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


#: Some of the rows of an array, as numpy takes them: a number, numbers, a mask, slices.
Rows = int | slice | NDArray[np.bool_] | NDArray[np.intp] | tuple[int | slice | None, ...]

#: The axes of a single value of each field.
_EACH: dict[str, tuple[int, ...]] = {
    "p_nb": (3,), "R_nb": (3, 3), "p_nc": (3,), "R_nc": (3, 3), "pan": (), "tilt": (), "covariance": (6, 6),
}  # fmt: skip


@dataclass(frozen=True, eq=False)
class CameraPoses:
    """A camera on an airframe at N instants: all that georeferencing and the filters know of it.

    The rows are the leading axes of the arrays: (N,), or (B, N) for B runs of a flight, or none, which is one
    pose for all rows. A field may be given once for all rows beside others that have their own. The pose of
    the camera itself is worked out once, when it is first asked for, and goes along with `take`.

    Parameters
    ----------
    camera
        The intrinsic parameters.
    mount
        How the camera sits on the airframe.
    p_nb
        Position of the airframe in n, (N, 3) or (3,), metres. NaN where it is not known.
    R_nb
        Attitude of the airframe, (N, 3, 3) or (3, 3); takes a vector from b to n.
    pan, tilt
        Angles of the gimbal, (N,), radians, where it moves; they take the place of the mount's own.
    covariance
        Of the pose, (N, 6, 6) or (6, 6), where it is known: position in n, attitude as a rotation vector in
        b (H 7.15); metres and radians.

    Raises
    ------
    ValueError
        Where a field has another shape or another number of rows than the others.

    Examples
    --------
    100 m above the origin, the lens 0.2 m below the airframe's own origin:

    >>> camera = Camera(640, 512, 1159.2, 1167.8, 313.0, 265.0)
    >>> mount = Mount("down", lever_arm=(0.0, 0.0, 0.2))
    >>> poses = CameraPoses(camera, mount, np.array([[0.0, 0.0, -100.0]]), np.eye(3))
    >>> poses.p_nc
    array([[  0. ,   0. , -99.8]])
    >>> poses.rows
    (1,)
    """

    camera: Camera
    mount: Mount
    p_nb: Array
    R_nb: Array
    pan: Array | None = None
    tilt: Array | None = None
    covariance: Array | None = None

    def __post_init__(self) -> None:
        given = {name: getattr(self, name) for name in ("p_nb", "R_nb", "pan", "tilt", "covariance")}
        for name, values in _aligned(given).items():
            object.__setattr__(self, name, values)

    @classmethod
    def at_lens(
        cls,
        camera: Camera,
        p_nc: ArrayLike,
        R_nc: ArrayLike,
        R_bc: ArrayLike,
        lever_arm: ArrayLike = (0.0, 0.0, 0.0),
        covariance: ArrayLike | None = None,
    ) -> CameraPoses:
        """Poses of a camera that are known themselves, and not by way of an airframe and its mount.

        Parameters
        ----------
        camera
            The intrinsic parameters.
        p_nc, R_nc
            Pose of the camera, (N, 3) metres and (N, 3, 3), or one for all rows.
        R_bc
            (3, 3), takes a vector from c to b, the frame in which errors of the attitude are counted.
        lever_arm
            Position of the lens in b, (3,), metres; H (7.43) has zero.
        covariance
            Of the pose of b, as in `CameraPoses`.

        Returns
        -------
        CameraPoses
            Their mount has the whole of ``R_bc`` for its misalignment.

        Raises
        ------
        ValueError
            Where a field has another shape or another number of rows than the others.

        Examples
        --------
        >>> camera = Camera(640, 512, 1159.2, 1167.8, 313.0, 265.0)
        >>> poses = CameraPoses.at_lens(camera, [0.0, 0.0, -100.0], np.eye(3), np.eye(3))
        >>> poses.rows  # one pose for all
        ()
        """
        turn, lever = np.asarray(R_bc, float), np.asarray(lever_arm, float)
        given = _aligned({"p_nc": p_nc, "R_nc": R_nc, "covariance": covariance})
        p, R = given["p_nc"], given["R_nc"]
        roll, lean, pan = (float(angle) for angle in matrix_to_euler(turn @ R_MC_DOWN.T))
        x, y, z = (float(part) for part in lever)
        mount = Mount("down", misalignment=(roll, lean, pan), lever_arm=(x, y, z))
        R_nb = R @ turn.T
        poses = cls(camera, mount, p - R_nb @ lever, R_nb, covariance=given.get("covariance"))
        vars(poses).update(_lens=(p, R), R_bc=turn)
        return poses

    @property
    def rows(self) -> tuple[int, ...]:
        """The leading axes: ``(N,)``, or ``()`` where there is one pose for all rows."""
        return self.p_nb.shape[:-1]

    @property
    def p_nc(self) -> Array:
        """Position of the camera in n, (N, 3) metres, H (5.8)."""
        return self._lens[0]

    @property
    def R_nc(self) -> Array:
        """Attitude of the camera, (N, 3, 3), H (5.9); takes a vector from c to n."""
        return self._lens[1]

    @cached_property
    def R_bc(self) -> Array:
        """(3, 3), or (N, 3, 3) where the gimbal moves; takes a vector from c to b."""
        return camera_rotation(self.mount, self.pan, self.tilt)

    @property
    def R_mc(self) -> Array:
        """(3, 3), takes a vector from c to the mount."""
        return R_MC_DOWN if self.mount.looks == "down" else R_MC_FORWARD

    @property
    def R_bm(self) -> Array:
        """(3, 3), or (N, 3, 3) where the gimbal moves; takes a vector from the mount to b."""
        return np.asarray(self.R_bc @ self.R_mc.T)

    @property
    def lever_arm(self) -> Array:
        """Position of the lens in b, (3,), metres."""
        return np.asarray(self.mount.lever_arm, float)

    @cached_property
    def _lens(self) -> tuple[Array, Array]:
        return camera_pose(self.mount, self.p_nb, self.R_nb, self.pan, self.tilt)

    def take(self, rows: Rows) -> CameraPoses:
        """The poses of some rows; one pose for all rows is that of any.

        Parameters
        ----------
        rows
            A number, numbers, a mask or slices.

        Returns
        -------
        CameraPoses
            With the camera's own poses, which are not worked out again.

        Raises
        ------
        IndexError
            Where there is no such row.
        """
        if not self.rows:
            return self
        if isinstance(rows, tuple) and sum(part is not None for part in rows) > len(self.rows):
            raise IndexError(f"too many indices for poses with the rows {self.rows}")
        taken = object.__new__(CameraPoses)
        # The rows of arrays that go together go together, and a filter asks for one row after the other.
        vars(taken).update(
            camera=self.camera,
            mount=self.mount,
            p_nb=self.p_nb[rows],
            R_nb=self.R_nb[rows],
            pan=None if self.pan is None else self.pan[rows],
            tilt=None if self.tilt is None else self.tilt[rows],
            covariance=None if self.covariance is None else self.covariance[rows],
            R_bc=self.R_bc if self.R_bc.ndim == 2 else self.R_bc[rows],
            _lens=(self.p_nc[rows], self.R_nc[rows]),
        )
        return taken

    def require_rows(self, rows: tuple[int, ...], field: str) -> None:
        """Refuse measurements of another length than the poses.

        Parameters
        ----------
        rows
            The leading axes of the measurements.
        field
            What they are called.

        Raises
        ------
        WildlabError
            Where the poses have rows, and not these.
        """
        if self.rows and rows != self.rows:
            raise WildlabError(
                f"{_count(rows)} for poses with {_count(self.rows)}",
                "give one pose for each row, or one for all rows",
                field=field,
            )


def _aligned(given: Mapping[str, ArrayLike | None]) -> dict[str, Array]:
    """Fields as arrays with the same rows; those that are not given are left out."""
    arrays = {name: np.asarray(values, float) for name, values in given.items() if values is not None}
    rows = np.broadcast_shapes(
        *(values.shape[: values.ndim - len(_EACH[name])] for name, values in arrays.items())
    )
    return {name: np.broadcast_to(values, (*rows, *_EACH[name])) for name, values in arrays.items()}


def _count(rows: tuple[int, ...]) -> str:
    return "one row" if not rows else " by ".join(map(str, rows)) + (" rows" if rows != (1,) else " row")
