"""What the thermal camera of F sees of land that was drawn: exactly, and by the two ways of F 2.5.2.

For each seed land is drawn, and the camera set above it at several heights and tilts, at places and with
headings that are drawn, too. Nothing flies. All three ways are asked of the same grid points: those in the
field of view of F (2.23). Times are no part of this: they are not the same twice (`timing`).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from wildlab.geometry.camera import Camera
from wildlab.geometry.camera_poses import CameraPoses
from wildlab.geometry.flodell import camera_rotation
from wildlab.geometry.frames import Array
from wildlab.geometry.line_of_sight import Looked, cast_rays, compare_angles, field_of_view, in_field_of_view
from wildlab.geometry.terrain import Terrain
from wildlab.geometry.viewsheds import footprint, lines_clear
from wildlab.simulation.error_models import stream
from wildlab.simulation.landscape import grow_trees, synthetic_landscape
from wildlab.simulation.parameters import load_twin

#: Ways to tell whether a point is seen, and what else there are numbers of.
RAYS, ANGLES, EXACT = "ray-casting", "bresenham", "exact"
#: Rays that begin at the camera and not at the highest ground in view.
WHOLE_RAYS = "whole-rays"
LETTER, VIEW, TREES = "by-the-letter", "field-of-view", "trees"
#: Heights above the ground below the camera, metres: F's gondola is at 3 to 20 m (8.2), its multicopter at
#: 25 to 60 m (7.5.1); twice and four times that beside them.
HEIGHTS = (10, 20, 40, 60, 120, 240)
#: Angles between the lens and straight down, degrees. F prints 60 as the limit of the multicopter (7.5.1).
TILTS = (0, 30, 60, 75)
#: At which of them heights are compared and times taken, and at which height tilts are.
TILT, HEIGHT = 60, 60
#: Of algorithm 1, metres: half a cell, and a cell. F prints neither.
STEP, TOLERANCE = 1.0, 2.0
#: Between the line of sight and straight down, degrees, where trees are looked at; and at how many points.
INCIDENCES = (0, 15, 30, 45, 60, 75)
POINTS = 1000
#: Fewer grid points than this in view tell nothing of a share.
FEWEST = 30
#: How far places stay from the border of the map, metres.
MARGIN = 50.0


class TerrainView(NamedTuple):
    """The camera above land, and the grid points in its field of view.

    Attributes
    ----------
    p_nc, R_nc
        (3,) metres and (3, 3).
    nodes
        (N, 2) rows and columns.
    points
        (N, 3) metres in n.
    """

    p_nc: Array
    R_nc: Array
    nodes: NDArray[np.int64]
    points: Array


def camera_of(twin: str) -> Camera:
    """The camera of a twin as F 2.5.1 has it: centred, without distortion."""
    found = load_twin(twin).camera
    width, height = int(found.width.value), int(found.height.value)
    return Camera(width, height, found.fx.si, found.fy.si, width / 2, height / 2)


def look(land: Terrain, camera: Camera, rng: np.random.Generator, height: float, tilt: float) -> TerrainView:
    """The camera at a place and with a heading that are drawn: over the map, and looking at it.

    Parameters
    ----------
    land
        The ground.
    camera
        Centred, without distortion.
    rng
        For place and heading.
    height
        Above the ground below the camera, metres.
    tilt
        Of the lens from straight down, degrees.
    """
    south, north, west, east = land.extent
    ahead = height * np.tan(np.radians(tilt))
    place, aim, heading = np.zeros(2), np.full(2, np.nan), 0.0
    while np.isnan(land.heights_at(aim[None])[0]):
        place = rng.uniform([south + MARGIN, west + MARGIN], [north - MARGIN, east - MARGIN])
        heading = rng.uniform(-np.pi, np.pi)
        aim = place + ahead * np.array([np.cos(heading), np.sin(heading)])
    p_nc = np.array([*place, -(float(land.heights_at(place[None])[0]) + height)])
    R_nc = camera_rotation(0.0, np.radians(tilt - 90.0), heading)
    nodes, points = nodes_of(land)
    inside = in_field_of_view(field_of_view(camera), points, p_nc, R_nc)
    return TerrainView(p_nc, R_nc, nodes[inside], points[inside])


def nodes_of(land: Terrain) -> tuple[NDArray[np.int64], Array]:
    """(N, 2) rows and columns of all grid points, and (N, 3) metres in n."""
    nodes = np.argwhere(np.isfinite(land.height))
    north_east = np.array([land.north, land.east]) + land.step * nodes
    return nodes, np.column_stack([north_east, -land.height[tuple(nodes.T)].astype(float)])


def width_on_ground(land: Terrain, camera: Camera, view: TerrainView) -> float:
    """How far the middles of the left and the right side of the image are apart on the ground, metres."""
    pose = CameraPoses.at_lens(camera, view.p_nc, view.R_nc, np.eye(3))
    outline = footprint(land, pose, per_side=2).points
    return float(np.linalg.norm(outline[3] - outline[7]))


def trial(seed: int, *, twin: str, views: int) -> dict[tuple[str, str], float]:
    """What the ways say of land that is drawn for this seed.

    Parameters
    ----------
    seed
        Of the land, its trees, places and headings.
    twin
        Whose camera it is.
    views
        How many places, for each height and tilt.

    Returns
    -------
    dict of float
        By (subject, name). Of each of `settings`, over the grid points of all its views: the share that is
        ``seen``; of both ways of F their ``agreement`` with the exact one, the shares that only they see
        (``too_many``) and only the exact one (``too_few``), and their ``steps`` a grid point, those of rays
        that begin at the camera, too; of (2.24) by the letter the share that is
        ``seen``. Of trees the share of the grid points on which they are ``planted``, and at each of
        `INCIDENCES` the share that they hide of what is seen without them (``hidden``).
        Of the field of view, straight down, the ``exponent`` with which its width grows with the height.
    """
    land, camera, rng = synthetic_landscape(seed), camera_of(twin), stream(seed, "line of sight")
    numbers: dict[tuple[str, str], float] = {}
    for name, height, tilt in settings():
        drawn = [look(land, camera, rng, height, tilt) for _ in range(views)]
        for (subject, what), value in compare(land, drawn).items():
            numbers[subject, f"{what}_{name}"] = value
    grown = grow_trees(land, seed)
    numbers[TREES, "planted"] = (grown.height > land.height).mean()
    trees = hidden_by_trees(land, grown, stream(seed, "trees"))
    numbers |= {(TREES, f"hidden_{degrees}deg"): share for degrees, share in trees.items()}
    widths = []
    for height in HEIGHTS:
        below = [look(land, camera, rng, height, 0.0) for _ in range(views)]
        widths.append(float(np.nanmean([width_on_ground(land, camera, one) for one in below])))
    numbers[VIEW, "exponent"] = np.polyfit(np.log(HEIGHTS), np.log(widths), 1)[0]
    return numbers


def settings() -> list[tuple[str, float, float]]:
    """Name, height (m) and tilt (deg) of all that is compared, each once."""
    heights = [(f"{height}m", float(height), float(TILT)) for height in HEIGHTS]
    return heights + [(f"{tilt}deg", float(HEIGHT), float(tilt)) for tilt in TILTS if tilt != TILT]


def compare(land: Terrain, views: list[TerrainView]) -> dict[tuple[str, str], float]:
    """What the ways say of the grid points of all views together, by (subject, name); see `trial`.

    NaN where fewer than `FEWEST` points are in view.
    """
    exact = np.concatenate([lines_clear(land, one.points, one.p_nc) for one in views])
    if len(exact) < FEWEST:
        exact = np.full(len(exact), np.nan)
    ways = {
        RAYS: [cast_rays(land, one.nodes, one.p_nc, STEP, TOLERANCE) for one in views],
        ANGLES: [compare_angles(land, one.nodes, one.p_nc) for one in views],
    }
    numbers = {(EXACT, "seen"): _share(exact)}
    for subject, found in ways.items():
        clear = np.concatenate([one.clear for one in found]).astype(float)
        numbers[subject, "agreement"] = _share(1 - np.abs(clear - exact))
        numbers[subject, "too_many"] = _share(clear * (1 - exact))
        numbers[subject, "too_few"] = _share((1 - clear) * exact)
        numbers[subject, "steps"] = _share(_steps(found) + 0 * exact)
    whole = [cast_rays(land, one.nodes, one.p_nc, STEP, TOLERANCE, shorten=False) for one in views]
    numbers[WHOLE_RAYS, "steps"] = _share(_steps(whole) + 0 * exact)
    letter = [compare_angles(land, one.nodes, one.p_nc, itself=True, signed=True) for one in views]
    numbers[LETTER, "seen"] = _share(np.concatenate([one.clear for one in letter]) + 0 * exact)
    return numbers


def hidden_by_trees(land: Terrain, grown: Terrain, rng: np.random.Generator) -> dict[int, float]:
    """Of the ground that is seen of land without trees, the share that trees hide, by incidence (deg).

    Points are drawn all over the land, each with a bearing; along that the camera stands as far off as the
    incidence asks for, `HEIGHT` above the point. Points and bearings are the same for all incidences.
    """
    south, north, west, east = land.extent
    where = rng.uniform([south, west], [north, east], (POINTS, 2))
    points = np.column_stack([where, -land.heights_at(where)])
    bearing = rng.uniform(-np.pi, np.pi, POINTS)
    off = np.column_stack([np.cos(bearing), np.sin(bearing)])
    found = {}
    for degrees in INCIDENCES:
        away = HEIGHT * np.tan(np.radians(degrees)) * off
        lenses = np.column_stack([where + away, points[:, 2] - HEIGHT])
        on_map = ~np.isnan(land.heights_at(lenses[:, :2]))
        # The other way round where the map ends; what stands beyond its end is not known.
        lenses[~on_map, :2] -= 2 * away[~on_map]
        on_map = ~np.isnan(land.heights_at(lenses[:, :2]))
        seen = on_map & lines_clear(land, points, lenses)
        found[degrees] = 1 - lines_clear(grown, points[seen], lenses[seen]).mean()
    return found


def _share(values: Array) -> float:
    return float(np.mean(values)) if len(values) else np.nan


def _steps(found: list[Looked]) -> Array:
    return np.concatenate([one.steps for one in found]).astype(float)
