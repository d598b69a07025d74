"""Animals along a way rendered as a thermal camera sees them, and what a detector makes of these frames.

Poses, terrain and animals are those of `images`, in place of whose drawn detections a detector that knows
nothing of the scene looks at each frame; the scene's labels only say afterwards whose a detection is.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from wildlab.analysis.animals.images import (
    ABOVE,
    FURTHEST,
    Detector,
    Images,
    footprint_circles,
    to_ground,
)
from wildlab.analysis.plans.flown import ExecutionErrors
from wildlab.detection.detections import Detections
from wildlab.geometry.camera_poses import CameraPoses
from wildlab.geometry.frames import Array
from wildlab.geometry.georeference import pixel_rays
from wildlab.geometry.terrain import Terrain, intersect_terrain
from wildlab.geometry.visibility import lines_clear
from wildlab.simulation.scene.animals import ANIMALS, animal, stone, tree
from wildlab.simulation.scene.bodies import Body
from wildlab.simulation.scene.ground import Land, Weather, rolling_land
from wildlab.simulation.scene.land import LandScene, LandView, render_land
from wildlab.simulation.scene.on_terrain import land_on
from wildlab.simulation.scene.response import CameraResponse, Sensor, expose

#: Animal of a detection that is of none.
NONE = -1
#: A detection is no animal's that is so many times larger, or further from it than so many px.
TOO_LARGE, NEAR = 3.0, 3
#: Stones and trees for each hectare, and between which sizes these are, m. Chosen.
STONES, TREES = 12.0, 4.0
STONE_SIZE, CROWN = (0.4, 2.0), (3.0, 6.0)

#: Looks for animals in the counts of a frame (H, W), given the distance, m, to the ground along its middle.
Finder = Callable[[NDArray[np.uint16], float], Detections]


class Scenery(NamedTuple):
    """What stands on the ground.

    Attributes
    ----------
    land
        The ground, as high as the terrain.
    animals
        One body for each animal, turned as it stays turned; where they are is said for each frame.
    others
        Stones and trees, where they stand.
    """

    land: Land
    animals: tuple[Body, ...]
    others: tuple[Body, ...]


class Thermal(NamedTuple):
    """A thermal camera: what it is like, and the one that is flown."""

    response: CameraResponse
    sensor: Sensor


class Frame(NamedTuple):
    """One rendered frame.

    Attributes
    ----------
    counts
        (H, W) of the camera.
    view
        Temperatures and labels.
    animal
        (B + 1,) whose each label is; `NONE` for what is no animal's, label 0 among it.
    """

    counts: NDArray[np.uint16]
    view: LandView
    animal: NDArray[np.intp]


class Framed(NamedTuple):
    """What the frames of a way gave.

    Attributes
    ----------
    images
        Their detections on the ground, those of no animal with `NONE`.
    uv
        (D, 2) px.
    standing
        (D,) bool: whether something stands there, animals included, or it is bare ground.
    """

    images: Images
    uv: Array
    standing: NDArray[np.bool_]


def furnish(
    terrain: Terrain, fences: Sequence[Array], animals: int, weather: Weather, rng: np.random.Generator
) -> Scenery:
    """Covers, stones and trees on a terrain, and animals of kinds that are drawn once.

    Parameters
    ----------
    terrain
        The ground.
    fences
        (E) each (K, 2) m, corners of rectangles in order: stones and trees are strewn over them.
    animals
        How many there are.
    weather
        For all temperatures.
    rng
        Of all that is drawn.

    Returns
    -------
    Scenery
    """
    land = land_on(terrain, rolling_land(weather, int(rng.integers(2**20))))
    kinds = rng.choice(list(ANIMALS), animals)
    bodies = [
        animal(str(kind), weather, int(rng.integers(64))).at(0.0, 0.0, float(rng.uniform(-np.pi, np.pi)))
        for kind in kinds
    ]
    others: list[Body] = []
    for fence in fences:
        one, other = fence[1] - fence[0], fence[-1] - fence[0]
        hectares = float(np.linalg.norm(one) * np.linalg.norm(other)) / 1e4
        for make, density, sizes in ((stone, STONES, STONE_SIZE), (tree, TREES, CROWN)):
            for _ in range(int(rng.poisson(density * hectares))):
                north, east = fence[0] + rng.random() * one + rng.random() * other
                made = make(float(rng.uniform(*sizes)), weather, int(rng.integers(64)))
                others.append(made.at(float(north), float(east), float(rng.uniform(-np.pi, np.pi))))
    return Scenery(land, tuple(bodies), tuple(others))


def render_frame(
    terrain: Terrain,
    scenery: Scenery,
    true: CameraPoses,
    places: Array,
    thermal: Thermal,
    rng: np.random.Generator,
) -> Frame:
    """One frame, from where the camera is.

    Parameters
    ----------
    terrain
        That the scenery stands on: what it hides is left out.
    scenery
        Ground and bodies.
    true
        One row: the camera's pose.
    places
        (A, 2) m, of the animals.
    thermal
        The camera.
    rng
        Of the noise.

    Returns
    -------
    Frame
    """
    animals = [
        body.at(float(north), float(east), body.course)
        for body, (north, east) in zip(scenery.animals, places, strict=True)
    ]
    bodies = [*animals, *scenery.others]
    owner = np.concatenate([np.arange(len(animals)), np.full(len(scenery.others), NONE)]).astype(np.intp)
    middles = np.array([body.centre(0.0) for body in bodies]).reshape(-1, 3)
    middles[:, 2] = -terrain.heights_at(middles[:, :2]) - [_half_height(body) for body in bodies]
    circle, radius = footprint_circles(terrain, true)
    p = true.p_nc[0]
    # A body reaches some metres about its middle.
    near = np.flatnonzero(np.hypot(*(middles[:, :2] - circle[0]).T) < radius[0] + max(CROWN))
    near = near[lines_clear(terrain, middles[near] - [0.0, 0.0, ABOVE], p)] if len(near) else near
    scene = LandScene(scenery.land, tuple(bodies[k] for k in near))
    view = render_land(scene, true.camera, p, true.R_nc[0])
    counts = expose(view.kelvin, thermal.response, thermal.sensor, rng)
    return Frame(counts, view, np.concatenate([[NONE], owner[near]]).astype(np.intp))


def _half_height(body: Body) -> float:
    return max(layer.height for layer in body.layers) / 2


class FrameMatch(NamedTuple):
    """Of D detections of a frame: whose each is, `NONE` for no animal's; and if anything stands there."""

    animal: NDArray[np.intp]
    standing: NDArray[np.bool_]


def judge(frame: Frame, found: Detections) -> FrameMatch:
    """Whose each detection is: the animal's on whose pixels, or near them, its centroid lies.

    Where pixels of several bodies are there, that which has most of them; no animal's is a detection that is
    `TOO_LARGE` for it.
    """
    labels = frame.view.labels
    animal, standing = np.full(len(found), NONE, np.intp), np.zeros(len(found), bool)
    for row in range(len(found)):
        u, v = np.rint(found.uv[row]).astype(int)
        part = labels[max(v - NEAR, 0) : v + NEAR + 1, max(u - NEAR, 0) : u + NEAR + 1]
        near = np.bincount(part[part > 0], minlength=1)
        best = int(near.argmax())
        standing[row] = near[best] > 0
        if standing[row] and found.area[row] <= TOO_LARGE * int((labels == best).sum()):
            animal[row] = frame.animal[best]
    return FrameMatch(animal, standing)


def ground_distance(terrain: Terrain, told: CameraPoses) -> float:
    """From where the camera, one row, is said to be to the ground along the middle of its image, m.

    `FURTHEST` where that is further, or there is none.
    """
    camera = told.camera
    ray = pixel_rays(camera, np.array([[camera.width / 2, camera.height / 2]]), told.R_nc)
    met = intersect_terrain(terrain, ray, told.p_nc).points
    return float(min(np.nan_to_num(np.linalg.norm(met[0] - told.p_nc[0]), nan=FURTHEST), FURTHEST))


def take_frames(
    terrain: Terrain,
    images: Images,
    headings: Array,
    frame: Callable[[int], Frame],
    find: Finder,
    errors: ExecutionErrors,
    detector: Detector,
    rng: np.random.Generator,
) -> Framed:
    """The images of a way with what a detector finds in their frames in place of drawn detections.

    Parameters
    ----------
    terrain
        The ground.
    images
        Times, told poses and animals.
    headings
        (T,) of the platform, rad.
    frame
        That of an image, by its number.
    find
        The detector.
    errors
        Of the told poses, which each detection's covariance follows from.
    detector
        What the tracks take the camera for.
    rng
        Random numbers of the covariances.

    Returns
    -------
    Framed
    """
    uv, image, judged = list[Array](), list[NDArray[np.intp]](), list[FrameMatch]()
    for k in range(len(images.times)):
        shot = frame(k)
        found = find(shot.counts, ground_distance(terrain, images.poses.take(np.array([k]))))
        uv.append(found.uv)
        image.append(np.full(len(found), k, np.intp))
        judged.append(judge(shot, found))
    pixels, rows = np.concatenate(uv).reshape(-1, 2), np.concatenate(image)
    z, R = np.zeros((0, 2)), np.zeros((0, 2, 2))
    if len(rows):
        z, R = to_ground(terrain, images.poses.take(rows), headings[rows], pixels, errors, detector, rng)
    animal = np.concatenate([one.animal for one in judged])
    standing = np.concatenate([one.standing for one in judged])
    return Framed(images._replace(z=z, R=R, image=rows, animal=animal), pixels, standing)
