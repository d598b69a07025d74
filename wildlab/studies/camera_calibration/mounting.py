"""The mounting calibration of H 5.3.2 on a simulated motion-capture room, and what could leave 0.0229 m.

H prints the three angles, the mean error that is left (0.0229 m at about 1.2 m), and not what the errors are.
Each cause is tried alone, at the size that leaves just that much; then what it does to the angles, and on the
ground from the height of a flight.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from wildlab.evaluation.replication import propagate_rounding
from wildlab.evaluation.runs import Interval
from wildlab.geometry.camera_poses import CameraPoses
from wildlab.geometry.frames import Array, euler_to_matrix
from wildlab.geometry.georeference import ground_to_pixel
from wildlab.geometry.mount import Mount, camera_rotation, helgesen_misalignment
from wildlab.geometry.mounting import Mounting, mounting_from_points
from wildlab.studies.camera_calibration.intrinsics import HEIGHT
from wildlab.studies.sensitivity.tables import TAU2, helgesen_mount

#: As printed: the mean error left, at which range, and what that makes from the height of the flight, metres.
PRINTED_ERROR, PRINTED_RANGE, PRINTED_AT_HEIGHT = 0.0229, 1.2, 6.6
#: Chosen: images, known points in each (a square of this half side, m), attitudes within so many degrees.
POSES, HALF_SIDE, TILTED_DEG = 12, 0.2, 8.0
#: What may be wrong, with the unit it is counted in, and a size to begin with.
CAUSES = {
    "clicks": ("px", 2.0),
    "attitude": ("deg", 0.2),
    "position": ("m", 0.004),
    "lens offset": ("m", 0.01),
    "focal length": ("%", 1.0),
}
#: These are the same in all images, so that more images do not help.
CONSTANT = ("lens offset", "focal length")


class Cause(NamedTuple):
    """One cause alone.

    Attributes
    ----------
    name, unit
        What is wrong, and what its size is counted in.
    size
        That leaves the printed error: a standard deviation, or (of what is constant) the size itself.
    left, left_error
        Mean error left by it in the calibration, and its standard error, with that of the size found, metres.
    angle
        Root mean squared angle by which the lens then points elsewhere, radians.
    ground
        What that makes on the ground from the height of the flight, metres.
    """

    name: str
    unit: str
    size: float
    left: float
    left_error: float
    angle: float
    ground: float


def calibrate_once(rng: np.random.Generator, cause: str, size: float) -> tuple[Mounting, float]:
    """One calibration in the room, with one thing wrong.

    Parameters
    ----------
    rng
        For poses and errors.
    cause
        One of `CAUSES`.
    size
        In its unit.

    Returns
    -------
    tuple
        What was found, and by which angle the lens then points elsewhere (a turn about its own axis does not
        count), radians.
    """
    side = np.linspace(-HALF_SIDE, HALF_SIDE, 3)
    board = np.stack(np.meshgrid(side, side), -1).reshape(-1, 2)
    m = len(board)
    image = np.repeat(np.arange(POSES), m)
    euler = np.radians(rng.uniform(-TILTED_DEG, TILTED_DEG, (POSES, 3))) + [0, 0, 1] * rng.uniform(
        -np.pi, np.pi, (POSES, 1)
    )
    R = euler_to_matrix(*euler.T)
    p = np.column_stack([rng.uniform(-0.1, 0.1, (POSES, 2)), -rng.uniform(0.95, 1.05, POSES) * PRINTED_RANGE])
    points = np.column_stack([np.tile(board, (POSES, 1)), np.zeros(POSES * m)])

    mount = helgesen_mount()
    true = CameraPoses(TAU2, mount, p[image], R[image])
    uv = ground_to_pixel(TAU2, points, true.p_nc, true.R_nc)
    given_p, given_R, camera, given = p, R, TAU2, Mount("down")
    if cause == "clicks":
        uv = uv + rng.normal(0, size, uv.shape)
    elif cause == "attitude":
        given_R = R @ euler_to_matrix(*np.radians(rng.normal(0, size, (3, POSES))))
    elif cause == "position":
        given_p = p + rng.normal(0, size, p.shape)
    elif cause == "lens offset":
        arm = _direction(rng) * size
        given = Mount("down", lever_arm=(float(arm[0]), float(arm[1]), float(arm[2])))
    else:
        share = 1 + rng.choice([-1, 1]) * size / 100
        camera = type(TAU2)(640, 512, TAU2.fx * share, TAU2.fy * share, TAU2.cx, TAU2.cy)
    found = mounting_from_points(
        CameraPoses(camera, given, given_p[image], given_R[image]), uv, points, image
    )
    axes = camera_rotation(found.mount)[:, 2], camera_rotation(mount)[:, 2]
    return found, float(np.linalg.norm(np.cross(*axes)))


def _direction(rng: np.random.Generator) -> Array:
    one = rng.normal(size=3)
    return np.asarray(one / np.linalg.norm(one))


def try_cause(rng: np.random.Generator, cause: str, size: float, runs: int) -> Cause:
    """What one cause of that size leaves in so many calibrations, and what it then does."""
    found = [calibrate_once(rng, cause, size) for _ in range(runs)]
    errors = np.array([one.error for one, _ in found])
    angle = float(np.sqrt(np.mean([angle**2 for _, angle in found])))
    ground = HEIGHT * float(np.tan(angle))
    return Cause(cause, CAUSES[cause][0], size, float(errors.mean()), _standard_error(errors), angle, ground)


def explain(rng: np.random.Generator, cause: str, runs: int) -> Cause:
    """How large one cause must be to leave the printed error, and what it then does.

    Parameters
    ----------
    rng
        For poses and errors.
    cause
        One of `CAUSES`.
    runs
        How many calibrations; half as many to find the size.

    Returns
    -------
    Cause
    """
    _, size = CAUSES[cause]
    for _ in range(2):  # what is left grows with the size, nearly in proportion
        tried = np.array([calibrate_once(rng, cause, size)[0].error for _ in range(max(runs // 2, 2))])
        size *= PRINTED_ERROR / float(tried.mean())
    found = try_cause(rng, cause, size, runs)
    # What chance does to the size that was found counts as well: it is proportional.
    scaled = _standard_error(tried * PRINTED_ERROR / tried.mean())
    return found._replace(left_error=float(np.linalg.norm([found.left_error, scaled])))


def _standard_error(values: Array) -> float:
    return float(values.std(ddof=1) / np.sqrt(len(values))) if len(values) > 1 else np.nan


def printed_angles(found: Mounting) -> tuple[float, float, float]:
    """Roll, tilt and pan (radians) of a mount in the sense in which H 5.6.1 prints them."""
    return helgesen_misalignment(*found.mount.misalignment)


def error_from_height() -> Interval:
    """The printed error taken for one of orientation, at the height of the flight: H 5.6.1 has 6.6 m.

    Returns
    -------
    Interval
        Bounds are of what the printed error and range were rounded from, metres.
    """
    given = [PRINTED_ERROR, PRINTED_RANGE]
    low, high = propagate_rounding(lambda one: one[0] * HEIGHT / one[1], given, [0.00005, 0.05])
    return Interval(PRINTED_ERROR * HEIGHT / PRINTED_RANGE, float(low), float(high))
