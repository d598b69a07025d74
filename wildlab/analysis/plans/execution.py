"""A plan beside what a flight of it shows: the same course with errors of the pose, on the same terrain."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from wildlab.geometry.camera import Camera
from wildlab.geometry.camera_poses import CameraPoses
from wildlab.geometry.frames import Array, Mask, rotation_vector_to_matrix
from wildlab.geometry.georeference import pixel_rays
from wildlab.geometry.terrain import Terrain, intersect_terrain
from wildlab.planning.coverage import Coverage, Sightings, from_sightings, see
from wildlab.planning.gimbal import blur
from wildlab.simulation.error_models import gauss_markov


class Looks(NamedTuple):
    """What is looked for, and when an image is good enough for it.

    Attributes
    ----------
    size
        Length of an animal, metres.
    exposure
        Of an image, s; of a microbolometer its thermal time constant.
    blur_share
        An image is sharp while it is blurred by less than this share of an animal's length in it.
    furthest
        Distance up to which animals are looked for, metres.
    range_scale
        ``r`` of F (5.9), metres.
    """

    size: float
    exposure: float
    blur_share: float
    furthest: float
    range_scale: float


class ExecutionErrors(NamedTuple):
    """How far the camera is from where it was planned to be: standard deviations and correlation times.

    Attributes
    ----------
    horizontal, vertical
        Of the position, each axis, metres.
    position_time
        How long such an error lasts, s.
    roll, pitch, yaw
        Of the attitude, radians, about the axes of a level platform.
    attitude_time
        As for the position, s.
    """

    horizontal: float
    vertical: float
    position_time: float
    roll: float
    pitch: float
    yaw: float
    attitude_time: float


class Planned(NamedTuple):
    """A plan alone.

    Attributes
    ----------
    coverage
        By its sharp images.
    found
        Its sightings.
    sharp
        (N,) bool of its images.
    distance
        (N,) metres to the ground in the middle of each image.
    """

    coverage: Coverage
    found: Sightings
    sharp: Mask
    distance: Array


class Executed(NamedTuple):
    """A plan, and one flight of it.

    Attributes
    ----------
    planned, flown
        Coverage of both.
    sure
        (R, C) bool: planned to be seen with a margin against errors.
    found
        Sightings of the plan.
    sharp
        (N,) bool of its images.
    margin_px
        Median margin, pixels.
    """

    planned: Coverage
    flown: Coverage
    sure: Mask
    found: Sightings
    sharp: Mask
    margin_px: float

    @property
    def held(self) -> float:
        """Share of what was surely to be seen that the flight showed; NaN where that is nothing."""
        return float(self.flown.seen[self.sure].mean()) if self.sure.any() else np.nan


def with_errors(
    poses: CameraPoses, headings: ArrayLike, errors: ExecutionErrors, step: float, rng: np.random.Generator
) -> CameraPoses:
    """Where the camera really is on a flight of the plan.

    Parameters
    ----------
    poses
        As planned, N rows.
    headings
        (N,) of the platform, radians.
    errors
        Their size.
    step
        Between two rows, s.
    rng
        Random numbers.

    Returns
    -------
    CameraPoses
    """
    off, turn = drawn_errors(poses.rows[0], errors, step, rng)
    return displaced(poses, headings, off, turn)


def drawn_errors(
    count: int, errors: ExecutionErrors, step: float, rng: np.random.Generator
) -> tuple[Array, Array]:
    """Errors of ``count`` poses, ``step`` s apart.

    Returns
    -------
    off, turn
        (count, 3) m in n, and (count, 3) rad about the axes of a level platform.
    """
    position_sd = [errors.horizontal, errors.horizontal, errors.vertical]
    off = gauss_markov(count, step, position_sd, errors.position_time, rng)
    return off, gauss_markov(count, step, [errors.roll, errors.pitch, errors.yaw], errors.attitude_time, rng)


def displaced(poses: CameraPoses, headings: ArrayLike, off: Array, turn: Array) -> CameraPoses:
    """The same poses with errors as `drawn_errors` gives them, for platforms with these headings, rad."""
    h = np.asarray(headings, float)
    # About the platform's axes, given in n.
    cos, sin = np.cos(h), np.sin(h)
    axes = [turn[:, 0] * cos - turn[:, 1] * sin, turn[:, 0] * sin + turn[:, 1] * cos, turn[:, 2]]
    R = rotation_vector_to_matrix(np.stack(axes, axis=-1)) @ poses.R_nc
    return CameraPoses.at_lens(poses.camera, poses.p_nc + off, R, np.eye(3))


def margin_px(camera: Camera, errors: ExecutionErrors, distance: ArrayLike, sigmas: float) -> Array:
    """How far inside an image something must be planned to be in it on the flight, too.

    Parameters
    ----------
    camera
        The intrinsic parameters.
    errors
        Of the execution.
    distance
        (N,) to what is looked at, metres.
    sigmas
        Standard deviations that the margin allows for.

    Returns
    -------
    (N,) pixels: position over distance and attitude, each by the focal length; height and yaw at half the
    image's diagonal, which is the most that they move.
    """
    d = np.asarray(distance, float)
    focal, half = max(camera.fx, camera.fy), np.hypot(camera.width, camera.height) / 2
    tilt = max(errors.roll, errors.pitch)
    variance = (focal * errors.horizontal / d) ** 2 + (focal * tilt) ** 2
    variance += (half * errors.vertical / d) ** 2 + (half * errors.yaw) ** 2
    return np.asarray(sigmas * np.sqrt(variance))


def execute(
    terrain: Terrain,
    poses: CameraPoses,
    headings: ArrayLike,
    times: ArrayLike,
    looks: Looks,
    errors: ExecutionErrors,
    sigmas: float,
    rng: np.random.Generator,
) -> Executed:
    """What a plan says will be seen, and what a flight of it with errors of the pose sees.

    Parameters
    ----------
    terrain
        In the same n.
    poses
        As planned, N rows, evenly spaced in time.
    headings
        (N,) of the platform, radians.
    times
        (N,) s.
    looks
        What is looked for.
    errors, sigmas
        Of the execution, and how many standard deviations of them the plan's margin allows for.
    rng
        Random numbers.

    Returns
    -------
    Executed
    """
    t = np.asarray(times, float)
    planned = as_planned(terrain, poses, t, looks)
    found, sharp = planned.found, planned.sharp
    margin = margin_px(poses.camera, errors, planned.distance, sigmas)
    surely = found.take((found.edge >= margin[found.image]) & sharp[found.image])
    sure = np.bincount(surely.node, minlength=terrain.height.size).reshape(terrain.height.shape) > 0
    really = with_errors(poses, headings, errors, float(np.median(np.diff(t))), rng)
    seen = see(terrain, really, looks.furthest)
    return Executed(
        planned.coverage,
        from_sightings(seen, terrain, t, sharp, looks.range_scale),
        np.asarray(sure),
        found,
        sharp,
        float(np.median(margin)),
    )


def as_planned(terrain: Terrain, poses: CameraPoses, times: ArrayLike, looks: Looks) -> Planned:
    """What a plan says will be seen, without any errors.

    Parameters
    ----------
    terrain, poses, times, looks
        As for `execute`.

    Returns
    -------
    Planned
    """
    t, camera = np.asarray(times, float), poses.camera
    middle = pixel_rays(camera, np.array([[camera.width / 2, camera.height / 2]]), poses.R_nc)
    met = intersect_terrain(terrain, middle.reshape(-1, 3), poses.p_nc).points
    distance = np.nan_to_num(np.linalg.norm(met - poses.p_nc, axis=1), nan=looks.furthest)
    # In pixels an animal shrinks with the distance, and so does what it may be smeared by.
    allowed = looks.blur_share * looks.size * min(camera.fx, camera.fy) / distance
    sharp = blur(camera, poses, t, looks.exposure, distance) <= allowed
    found = see(terrain, poses, looks.furthest)
    return Planned(from_sightings(found, terrain, t, sharp, looks.range_scale), found, sharp, distance)
