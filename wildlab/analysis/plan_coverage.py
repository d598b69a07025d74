"""What a plan will have seen of its areas, what hides from it, and how many animals that may find.

Images are taken along the rows, near enough that each is mostly in the next. Ground counts as seen where an
image shows it sharply with nothing before it; what shows it only near its edge does not count, for errors of
the pose. Trees are not in a map of the ground: under them less is seen (F 8.2).
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from wildlab.analysis.plan import Plan, Sortie
from wildlab.analysis.plan_request import FURTHEST, simplified
from wildlab.geometry.camera import Camera
from wildlab.geometry.camera_poses import CameraPoses
from wildlab.geometry.frames import Array, Indices, Mask, euler_to_matrix, rotation_vector_to_matrix
from wildlab.geometry.georeference import Terrain, intersect_terrain, pixel_rays
from wildlab.geometry.viewsheds import lines_clear
from wildlab.planning.coverage import Coverage, from_sightings, see
from wildlab.planning.gimbal import (
    GimbalAngles,
    adapt_roll,
    blur,
    camera_on_course,
    swing_rate,
    swing_roll,
    swing_yaw,
    view_inside,
)
from wildlab.planning.patterns import contains, distances_along, grid_points
from wildlab.simulation.error_models import gauss_markov

#: Share of an image's shorter side that its edge is: what lies in it is not counted.
EDGE = 0.05
#: Blur up to which an image is sharp, as a share of an animal's length in it.
SHARP = 0.25
#: Share of an image's ground, and of its field of view, by which the next one is moved.
NEXT = 0.25
#: Nodes across a strip, and in all areas at most.
ACROSS, MOST_NODES = 40, 400_000
#: Share of their distance that nodes tell a fence by.
TOLD = 0.1
#: Metres above the ground that is looked at: an animal is not flat, and a grid is not exact.
ABOVE = 0.1
#: Share of its length that a swing sees again, and rolls at which an adaptive one looks ahead.
AGAIN, ROLLS = 0.1, 17
#: Sightings whose lines are looked along at once.
TOGETHER = 500_000


class Covered(NamedTuple):
    """An area on a grid whose rows run north and whose columns run east.

    Attributes
    ----------
    north, east, step
        Of the node (0, 0), and between neighbours, metres.
    inside
        (R, C) bool: in the area, and not in its holes.
    looks
        (R, C) in how many sharp images a node is, not hidden.
    hidden
        (R, C) bool: in an image, but never without ground before it.
    blurred
        (R, C) bool: in blurred images alone.
    """

    north: float
    east: float
    step: float
    inside: Mask
    looks: Indices
    hidden: Mask
    blurred: Mask

    def share(self, which: Mask) -> float:
        """Of the area's nodes, those that ``which`` (R, C) marks."""
        return float(which[self.inside].mean())

    @property
    def seen(self) -> float:
        """Share of the area that is seen."""
        return self.share(self.looks > 0)


def cover(plan: Plan, tell: Callable[[int, int], None] = lambda done, of: None) -> list[Covered]:
    """What a plan will have seen of each area.

    Parameters
    ----------
    plan
        From `wildlab.analysis.plan.make_plan`.
    tell
        Called with how many areas are done, of how many.

    Returns
    -------
    list of Covered
        One for each area.
    """
    images = [images_of(plan, one) for one in plan.sorties]
    areas = plan.areas.areas
    extent = sum(float(np.ptp(one.outline, axis=0).prod()) for one in areas)
    step = max(plan.strip / ACROSS, math.sqrt(extent / MOST_NODES))
    found = []
    for k, area in enumerate(areas):
        nodes, inside = _nodes(area.outline, area.holes, plan.terrain, step)
        found.append(_covered(plan, nodes, inside, images))
        tell(k + 1, len(areas))
    return found


class Images(NamedTuple):
    """Poses of the images of a flight, and which of them are sharp."""

    poses: CameraPoses
    sharp: Mask


def images_of(plan: Plan, sortie: Sortie) -> Images:
    """Where the camera is and looks when it takes the images of the rows of a flight.

    Parameters
    ----------
    plan
        From `wildlab.analysis.plan.make_plan`.
    sortie
        One of its flights.

    Returns
    -------
    Images
    """
    wanted, course = plan.wanted, sortie.course
    rate = gimbal_rate(plan)
    step = NEXT * min(plan.view.length, 1.0) * plan.height / wanted.fastest_m_s
    if rate > 0:
        step = min(step, NEXT * 2 * math.atan(plan.wanted.camera.width / 2 / wanted.camera.fx) / rate)
    if wanted.photo_m > 0:
        # Over the ground so far apart at most, as in the slowest row; the trigger knows no ends of rows.
        step = wanted.photo_m / max(wanted.slowest_m_s, 0.5)
        times = np.arange(0.0, course.times[-1], step)
    else:
        times = _instants(course.times, sortie.row_of, step)
    points, headings = course.at(times)
    piece = np.clip(np.searchsorted(course.times, times, side="right") - 1, 0, len(course.times) - 1)
    row_of = sortie.row_of[piece]
    on_row = row_of >= 0
    # On a row the way is straight; between pieces of a turn, headings run from one to the next.
    headings = np.where(on_row, course.headings[piece], headings)
    if wanted.vehicle == "fixed-wing":
        headings = _nose(headings, wanted.speed_m_s, wanted.wind)
    ground = np.zeros(len(points)) if plan.terrain is None else _known(plan.terrain, points)
    positions = np.column_stack([points, -(ground + _above(sortie, points, times))])
    angles = _angles(plan, times, positions, headings, rate)
    poses = camera_on_course(_within_edge(wanted.camera), positions, headings, angles)
    rows = np.flatnonzero(on_row)
    blurred = np.zeros(len(times))
    # Row by row: the turn before a row blurs none of its images.
    for run in np.split(rows, np.flatnonzero(np.diff(row_of[rows]) != 0) + 1):
        if len(run) > 1:
            slant = plan.view.slant * plan.height
            blurred[run] = blur(wanted.camera, poses.take(run), times[run], wanted.exposure_ms / 1000, slant)
    most = SHARP * plan.view.pixels(wanted.camera, wanted.animal_m, plan.height)
    return Images(poses.take(rows), (blurred <= most)[rows])


def _instants(times: Array, row_of: Indices, step: float) -> Array:
    """When images are taken: every ``step`` seconds, and at both ends of each row."""
    begins = np.flatnonzero(row_of[:-1] >= 0)
    # Just before a row ends: at its end, the next piece begins.
    ends = times[begins + 1] - 1e-3 * step
    every = np.unique(np.concatenate([np.arange(0.0, times[-1], step), times[begins], ends]))
    apart = np.diff(every, prepend=-np.inf) > 1e-2 * step
    return every[apart | np.isin(every, times[begins])]


def gimbal_rate(plan: Plan) -> float:
    """Radians per second at which the camera swings; 0 where it does not."""
    wanted = plan.wanted
    if wanted.gimbal == "fixed":
        return 0.0
    if wanted.rate_deg_s is not None:
        return math.radians(wanted.rate_deg_s)
    limit, length = math.radians(wanted.swing_deg), plan.view.length * plan.height
    return swing_rate(limit, length, wanted.fastest_m_s, AGAIN)


def _nose(headings: Array, speed: float, wind: Array) -> Array:
    """Where the nose points so that the way over ground is that of the headings: into the wind."""
    across = np.cos(headings) * wind[1] - np.sin(headings) * wind[0]
    return headings - np.arcsin(across / speed)


def _known(terrain: Terrain, points: Array) -> Array:
    """Heights of the ground; zero where nothing is known, which is nowhere on a row that was planned."""
    return np.nan_to_num(terrain.heights_at(points))


def _above(sortie: Sortie, points: Array, times: Array) -> Array:
    """Heights above the ground at times of the course, between the way points, (N,) metres."""
    way = sortie.way
    far = distances_along(way.points)
    course = sortie.course
    along = distances_along(course.points)
    # Way points leave out some of an arc, so both are counted by their share of the whole.
    at = np.interp(times, course.times, along) * far[-1] / max(float(along[-1]), 1e-9)
    return np.interp(at, far, way.height - way.ground)


def _angles(plan: Plan, times: Array, positions: Array, headings: Array, rate: float) -> GimbalAngles:
    wanted = plan.wanted
    pitch, limit = -math.radians(wanted.tilt_deg), math.radians(wanted.swing_deg)
    if wanted.gimbal == "yaw":
        return swing_yaw(times, limit, rate, pitch)
    if wanted.gimbal == "roll":
        return swing_roll(times, limit, rate, pitch)
    if wanted.gimbal == "adaptive":
        rolls = np.linspace(-limit, limit, ROLLS)
        fences = [area.outline for area in plan.areas.areas]
        ground = plan.terrain if plan.terrain is not None else _flat(fences, plan.height)
        inside = view_inside(wanted.camera, positions, headings, rolls, pitch, fences, ground)
        return adapt_roll(times, inside, rolls, (0.0, limit), rate, pitch)
    still = np.zeros(len(times))
    return GimbalAngles(times, still, still + pitch, still)


def _flat(fences: list[Array], height: float) -> Terrain:
    """Flat ground as far as a camera over the areas looks."""
    points = np.concatenate(fences)
    low, high = points.min(axis=0) - 2 * FURTHEST * height, points.max(axis=0) + 2 * FURTHEST * height
    step = float((high - low).max()) / 2
    return Terrain(np.zeros((4, 4), np.float32), float(low[0]), float(low[1]), step)


def _nodes(
    outline: Array, holes: tuple[Array, ...], terrain: Terrain | None, step: float
) -> tuple[Terrain, Mask]:
    """A grid over an area, its heights those of the ground, and which nodes lie in the area."""
    low, high = outline.min(axis=0), outline.max(axis=0)
    # Nodes stand for the cells about them: none on the border itself.
    step = min(step, float((high - low).min()) / 2)
    count = np.maximum(np.ceil((high - low) / step).astype(int), 2)
    north, east = (low[k] + step * (np.arange(count[k]) + 0.5) for k in (0, 1))
    points = grid_points(north, east)
    # Corners that differ from a straight fence by less than nodes can tell cost time and nothing else.
    inside = contains(simplified(outline, TOLD * step), points)
    for hole in holes:
        inside &= ~contains(simplified(hole, TOLD * step), points)
    shape = (len(north), len(east))
    ground = np.zeros(len(points)) if terrain is None else terrain.heights_at(points)
    if not np.isfinite(ground).any():
        ground = np.zeros(len(points))
    height = (ground + ABOVE).astype(np.float32).reshape(shape)
    return Terrain(height, float(north[0]), float(east[0]), step), inside.reshape(shape)


def _within_edge(camera: Camera) -> Camera:
    """The camera without the edge of its image: the same rays, fewer of them."""
    edge = int(EDGE * min(camera.width, camera.height))
    return replace(
        camera,
        width=camera.width - 2 * edge,
        height=camera.height - 2 * edge,
        cx=camera.cx - edge,
        cy=camera.cy - edge,
    )


def _covered(plan: Plan, nodes: Terrain, inside: Mask, images: list[Images]) -> Covered:
    shape, size = nodes.height.shape, nodes.height.size
    looks, shown, soft = (np.zeros(size, np.intp) for _ in range(3))
    wanted = np.flatnonzero(inside.ravel())
    mask = np.zeros(size, bool)
    mask[wanted] = True
    flat = nodes.height.ravel()
    for one in images:
        if not one.poses.rows[0]:
            continue
        found = see(nodes, one.poses, FURTHEST * plan.height, hidden=False)
        found = found.take(mask[found.node])
        shown += np.bincount(found.node, minlength=size)
        if plan.terrain is not None:
            clear = np.ones(len(found.node), bool)
            for begin in range(0, len(clear), TOGETHER):
                part = slice(begin, begin + TOGETHER)
                row, column = np.divmod(found.node[part], shape[1])
                points = np.column_stack(
                    [
                        nodes.north + nodes.step * row,
                        nodes.east + nodes.step * column,
                        -flat[found.node[part]],
                    ]
                )
                clear[part] = lines_clear(plan.terrain, points, one.poses.p_nc[found.image[part]])
            found = found.take(clear)
        sharp = one.sharp[found.image]
        looks += np.bincount(found.node[sharp], minlength=size)
        soft += np.bincount(found.node[~sharp], minlength=size)
    return Covered(
        nodes.north,
        nodes.east,
        nodes.step,
        inside,
        looks.reshape(shape),
        ((shown > 0) & (looks + soft == 0)).reshape(shape) & inside,
        ((soft > 0) & (looks == 0)).reshape(shape) & inside,
    )


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
    # About the platform's axes, given in n.
    axes = euler_to_matrix(0.0, 0.0, headings) @ turn[..., None]
    R = rotation_vector_to_matrix(axes[..., 0]) @ poses.R_nc
    return CameraPoses.at_lens(poses.camera, poses.p_nc + off, R, np.eye(3))


def as_planned(terrain: Terrain, poses: CameraPoses, times: ArrayLike, looks: Looks) -> Coverage:
    """What a plan says will be seen in sharp images, without any errors.

    Parameters
    ----------
    terrain
        In the same n.
    poses
        As planned, N rows, evenly spaced in time.
    times
        (N,) s.
    looks
        What is looked for.
    """
    t, camera = np.asarray(times, float), poses.camera
    middle = pixel_rays(camera, np.array([[camera.width / 2, camera.height / 2]]), poses.R_nc)
    met = intersect_terrain(terrain, middle.reshape(-1, 3), poses.p_nc).points
    distance = np.nan_to_num(np.linalg.norm(met - poses.p_nc, axis=1), nan=looks.furthest)
    # In pixels an animal shrinks with the distance, and so does what it may be smeared by.
    allowed = looks.blur_share * looks.size * min(camera.fx, camera.fy) / distance
    sharp = blur(camera, poses, t, looks.exposure, distance) <= allowed
    found = see(terrain, poses, looks.furthest)
    return from_sightings(found, terrain, t, sharp, looks.range_scale)
