"""Where a gimbal points the camera along a course (F 5.4): down, swinging about yaw or roll, or adaptively.

Angles are those of F's gimbal on a platform that flies level: ``pitch`` of -90 degrees looks straight down
and 0 to the front, ``yaw`` turns about the vertical, ``roll`` about the platform's length, on the outside of
pitch. (Roll inside of pitch, as in the order of Euler's angles, would turn the image of a camera that looks
down and leave it looking down.) Positive roll looks to the left, positive yaw to the right.

F Algorithm 2 cannot be run as printed:

- ``rollMinGoal`` and ``rollMaxGoal`` are compared with and never set; only ``maximumRoll`` is given.
- Both comparisons are ``rollCamera >= ...``, whichever way the camera turns. On the negative side neither
  limit is ever reached, and on the positive side the direction is changed again in each following step.
- The condition ``FOV ∩ Enclosures ≠ |FOV|`` compares a set with a size.

Here, as the prose has it: the camera turns on at an even rate. It turns round where the angle *in the
direction of the turn* has reached the maximum, or has reached the minimum while the field of view is not
wholly within the enclosures.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from wildlab.geometry.camera import Camera
from wildlab.geometry.camera_poses import R_MC_FORWARD, CameraPoses
from wildlab.geometry.frames import Array, Mask, euler_to_matrix, matrix_to_rotation_vector
from wildlab.geometry.georeference import Terrain, intersect_terrain, pixel_rays
from wildlab.planning.patterns import contains

#: Straight down.
NADIR = -np.pi / 2


class GimbalAngles(NamedTuple):
    """Angles of a gimbal at N instants, radians.

    Attributes
    ----------
    times
        (N,) s, ascending.
    roll, pitch, yaw
        (N,) about the platform's length, up from level, and about the vertical.
    """

    times: Array
    roll: Array
    pitch: Array
    yaw: Array

    def at(self, times: ArrayLike) -> GimbalAngles:
        """Angles at other times, linear between.

        Parameters
        ----------
        times
            (M,) s.

        Returns
        -------
        GimbalAngles
        """
        t = np.asarray(times, float)
        roll, pitch, yaw = (np.interp(t, self.times, one) for one in (self.roll, self.pitch, self.yaw))
        return GimbalAngles(t, roll, pitch, yaw)


def swing(times: ArrayLike, limit: float, rate: float, start: float = 0.0) -> Array:
    """An angle that goes to and fro at an even rate between two limits.

    Parameters
    ----------
    times
        (N,) s.
    limit
        The angle on either side, radians.
    rate
        Radians per second, above zero.
    start
        Where in the swing it is at time 0, in swings to and fro: 0 is the middle on the way up.

    Returns
    -------
    (N,) radians. It turns round in no time: a gimbal takes hundredths of a second.

    Examples
    --------
    >>> print(swing([0.0, 1.0, 2.0, 3.0], limit=1.0, rate=1.0))
    [ 0.  1.  0. -1.]
    """
    t = np.asarray(times, float)
    if limit == 0:
        return np.zeros(t.shape)
    phase = np.mod(t * rate / (4 * limit) + start + 0.25, 1.0)
    return np.asarray(limit * (1 - np.abs(4 * phase - 2)))


def look_down(times: ArrayLike) -> GimbalAngles:
    """The camera straight down at all times (F 5.4), the top of the image ahead.

    Parameters
    ----------
    times
        (N,) s.

    Returns
    -------
    GimbalAngles
    """
    t = np.asarray(times, float)
    return GimbalAngles(t, 0 * t, 0 * t + NADIR, 0 * t)


def swing_yaw(times: ArrayLike, limit: float, rate: float, pitch: float, start: float = 0.0) -> GimbalAngles:
    """To and fro about the vertical with a fixed pitch (F 5.4.1, figure 5.7).

    Parameters
    ----------
    times
        (N,) s.
    limit, rate, start
        As for `swing`.
    pitch
        Radians, -pi/2 is straight down.

    Returns
    -------
    GimbalAngles
    """
    t = np.asarray(times, float)
    return GimbalAngles(t, 0 * t, 0 * t + pitch, swing(t, limit, rate, start))


def swing_roll(
    times: ArrayLike, limit: float, rate: float, pitch: float = NADIR, start: float = 0.0
) -> GimbalAngles:
    """From side to side about the platform's length with a fixed pitch (F 5.4.1, figure 5.6).

    Parameters
    ----------
    times
        (N,) s.
    limit, rate, start
        As for `swing`.
    pitch
        Radians, -pi/2 is straight down; F raises it slightly where the ground is near.

    Returns
    -------
    GimbalAngles
    """
    t = np.asarray(times, float)
    return GimbalAngles(t, swing(t, limit, rate, start), 0 * t + pitch, 0 * t)


def camera_attitudes(headings: ArrayLike, angles: GimbalAngles) -> Array:
    """Attitudes of the camera on a level platform.

    Parameters
    ----------
    headings
        (N,) of the platform, from north to the east, radians.
    angles
        Of the gimbal at the same instants.

    Returns
    -------
    ``R_nc`` (N, 3, 3).

    Examples
    --------
    Straight down, the top of the image ahead: the camera's z is down, and its y is to the south.

    >>> print(np.round(camera_attitudes([0.0], look_down([0.0]))[0] @ [0, 0, 1], 9) + 0.0)
    [0. 0. 1.]
    """
    platform = euler_to_matrix(0.0, 0.0, np.asarray(headings, float))
    roll = euler_to_matrix(angles.roll, 0.0, 0.0)
    return np.asarray(platform @ roll @ euler_to_matrix(0.0, angles.pitch, angles.yaw) @ R_MC_FORWARD)


def camera_on_course(
    camera: Camera, positions: ArrayLike, headings: ArrayLike, angles: GimbalAngles
) -> CameraPoses:
    """Poses of a camera on a gimbal along a course.

    Parameters
    ----------
    camera
        The intrinsic parameters.
    positions
        (N, 3) of the lens in n, metres.
    headings
        (N,) radians.
    angles
        At the same instants.

    Returns
    -------
    CameraPoses
        With N rows.
    """
    return CameraPoses.at_lens(camera, positions, camera_attitudes(headings, angles), np.eye(3))


def blur(camera: Camera, poses: CameraPoses, times: ArrayLike, exposure: float, distance: ArrayLike) -> Array:
    """By how many pixels the middle of each image is blurred while it is exposed (F 5.4, 5.3.2).

    Parameters
    ----------
    camera
        The intrinsic parameters.
    poses
        N rows, near enough in time that the camera turns evenly between two.
    times
        (N,) s, ascending, at least two.
    exposure
        s; of a microbolometer its thermal time constant.
    distance
        (N,) or one, to what is looked at, metres: the platform's own way blurs the less the further that is.

    Returns
    -------
    (N,) pixels: angular rate, and speed over distance, each times exposure and focal length. Their sum bounds
    what both do together. A turn about the optical axis counts at the image's corner.
    """
    t = np.asarray(times, float)
    step = np.diff(t)
    turned = matrix_to_rotation_vector(np.swapaxes(poses.R_nc[:-1], -1, -2) @ poses.R_nc[1:]) / step[:, None]
    moved = np.linalg.norm(np.diff(poses.p_nc, axis=0), axis=1) / step
    # Of two neighbouring intervals the faster one: where the gimbal turns round, the mean would be still.
    rates = np.linalg.norm(turned[:, :2], axis=1) * max(camera.fx, camera.fy)
    rates += np.abs(turned[:, 2]) * np.hypot(camera.width, camera.height) / 2
    both = [
        np.maximum(np.concatenate([one[:1], one]), np.concatenate([one, one[-1:]])) for one in (rates, moved)
    ]
    return np.asarray(
        exposure * (both[0] + both[1] / np.asarray(distance, float) * max(camera.fx, camera.fy))
    )


def view_inside(
    camera: Camera,
    positions: ArrayLike,
    headings: ArrayLike,
    rolls: ArrayLike,
    pitch: float,
    fences: Sequence[ArrayLike],
    terrain: Terrain,
) -> Mask:
    """Whether the whole field of view would lie within the areas, for each place and each roll.

    Parameters
    ----------
    camera
        The intrinsic parameters.
    positions, headings
        Of the platform, (N, 3) metres and (N,) radians.
    rolls
        (K,) radians.
    pitch
        Radians.
    fences
        Areas, each (K, 2) metres; F's enclosures. A view over two of them that touch counts as inside.
    terrain
        In the same n.

    Returns
    -------
    (N, K) bool: by the corners of the image and the middles of its sides. False where one of them meets no
    ground.
    """
    p, h, phi = np.asarray(positions, float), np.asarray(headings, float), np.asarray(rolls, float)
    n, k = len(p), len(phi)
    x, y = camera.width / 2, camera.height / 2
    uv = np.array([[a * x, b * y] for a in (0, 1, 2) for b in (0, 1, 2) if (a, b) != (1, 1)])
    angles = GimbalAngles(np.zeros(n * k), np.tile(phi, n), np.full(n * k, pitch), np.zeros(n * k))
    R = camera_attitudes(np.repeat(h, k), angles)
    rays = np.einsum("nij,bj->nbi", R, pixel_rays(camera, uv, np.eye(3)))
    starts = np.repeat(p, k * len(uv), axis=0)
    points = intersect_terrain(terrain, rays.reshape(-1, 3), starts).points[:, :2]
    within = np.zeros(len(points), bool)
    for fence in fences:
        within |= contains(fence, points)
    return np.asarray(within.reshape(n, k, len(uv)).all(axis=-1))


def adapt_roll(
    times: ArrayLike,
    inside: Mask,
    rolls: ArrayLike,
    limits: tuple[float, float],
    rate: float,
    pitch: float = NADIR,
    start: float = 0.0,
) -> GimbalAngles:
    """The adaptive strategy (F 5.4.2, Algorithm 2, mended as said above), about roll.

    Parameters
    ----------
    times
        (N,) s, evenly spaced and near: the camera turns by ``rate`` times their step between two decisions.
    inside
        (N, K) bool, whether the view would lie within the areas at each time and roll, from `view_inside`.
    rolls
        (K,) radians, ascending: at which ``inside`` is known; the nearest one decides.
    limits
        Least and greatest angle at which the camera turns round, radians. The least keeps it swinging where
        the platform is outside of all areas.
    rate
        Radians per second.
    pitch
        Radians.
    start
        Where in a swing between the least limits it begins, as for `swing`: 0 is straight below, turning to
        positive roll.

    Returns
    -------
    GimbalAngles

    Examples
    --------
    Outside at all times it swings between the least limits:

    >>> never = np.zeros((5, 3), bool)
    >>> print(adapt_roll(np.arange(5.0), never, [-1.0, 0.0, 1.0], (1.0, 3.0), 1.0).roll)
    [ 0.  1.  0. -1.  0.]
    """
    least, most = limits
    t, known = np.asarray(times, float), np.asarray(rolls, float)
    roll = np.zeros(len(t))
    phase = float(np.mod(start + 0.25, 1.0))
    angle, sense = least * (1 - abs(4 * phase - 2)), 1 if phase < 0.5 else -1
    roll[:1] = angle
    for k in range(1, len(t)):
        reached = sense * angle
        nearest = int(np.abs(known - angle).argmin())
        if reached >= most - 1e-12 or (reached >= least - 1e-12 and not inside[k - 1, nearest]):
            sense = -sense
        angle = float(np.clip(angle + sense * rate * (t[k] - t[k - 1]), -most, most))
        roll[k] = angle
    return GimbalAngles(t, roll, np.full(len(t), pitch), np.zeros(len(t)))


def swing_rate(limit: float, length: float, speed: float, overlap: float = 0.0) -> float:
    """How fast a camera must swing for no ground to be left out while the platform passes (F 5.4).

    Within one swing to and fro the platform comes no further than the image reaches along its way.

    Parameters
    ----------
    limit
        Of the swing on either side, radians.
    length
        Of the ground in the image along the way, metres.
    speed
        Over ground, m/s.
    overlap
        Share of the length that the next swing sees again.

    Returns
    -------
    float, radians per second.

    Examples
    --------
    >>> swing_rate(limit=0.5, length=20.0, speed=5.0)
    0.5
    """
    return 4 * limit * speed / (length * (1 - overlap))
