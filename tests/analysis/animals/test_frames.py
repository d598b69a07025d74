"""That rendered animals are where the world has them, how detections in them are judged and put on the
ground, and that a detection of no animal is nobody's sighting."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from wildlab.analysis.animals.images import (
    NEAR,
    NONE,
    TOO_LARGE,
    Detector,
    Frame,
    Framed,
    Images,
    Scenery,
    Thermal,
    judge,
    render_frame,
    take_frames,
)
from wildlab.analysis.plans.coverage import ExecutionErrors
from wildlab.detection.detections import Detections, describe
from wildlab.geometry.camera import Camera
from wildlab.geometry.camera_poses import CameraPoses
from wildlab.geometry.frames import Array, euler_to_matrix
from wildlab.geometry.georeference import ground_to_pixel, pixel_rays
from wildlab.geometry.mount import R_MC_DOWN
from wildlab.geometry.terrain import Terrain
from wildlab.simulation.landscape import synthetic_landscape
from wildlab.simulation.scene.bodies import ANIMALS, animal
from wildlab.simulation.scene.ground import EVEN_LAND, Weather
from wildlab.simulation.scene.land import LandView, land_on
from wildlab.simulation.scene.response import IDEAL, sensor_of

CAMERA = Camera(320, 240, 600.0, 600.0, 159.5, 119.5)
SHAPE = (CAMERA.height, CAMERA.width)
NIGHT = Weather(hour=4.0)
HILLS = synthetic_landscape(5, north=400.0, east=400.0, relief=40.0)
THERMAL = Thermal(IDEAL, sensor_of(IDEAL, SHAPE, np.random.default_rng(0)))
ERRORS = ExecutionErrors(0.5, 0.5, 300.0, 0.01, 0.01, 0.01, 60.0)
DETECTOR = Detector(detected=0.9, sd=2.0, border=2.0, height=0.7)


def poses(p: Array, R: Array) -> CameraPoses:
    return CameraPoses.at_lens(CAMERA, np.atleast_2d(p), np.asarray(R, float).reshape(-1, 3, 3), np.eye(3))


def looking_at(place: Array, roll: float, pitch: float, yaw: float) -> CameraPoses:
    """A camera 60 m from a place on the hills, which is not quite in the middle of its image."""
    R = euler_to_matrix(np.radians(roll), np.radians(pitch), np.radians(yaw)) @ R_MC_DOWN
    ray = pixel_rays(CAMERA, np.array([[200.0, 90.0]]), R[None])[0]
    on = np.array([*place, -HILLS.heights_at([place])[0]])
    return poses(on - 60.0 * ray / np.linalg.norm(ray), R)


def scenery(*kinds: str) -> Scenery:
    return Scenery(land_on(HILLS, EVEN_LAND), tuple(animal(kind, NIGHT) for kind in kinds), ())


VIEWS = [
    ((31.0, -47.0), 0, 0, 0), ((-90.0, 12.0), 40, 0, 30),
    ((64.0, 120.0), -50, 10, 200), ((5.0, 80.0), 0, -45, 90),
]  # fmt: skip


@pytest.mark.parametrize(("kind", "view"), list(zip(sorted(ANIMALS), [*VIEWS, *VIEWS], strict=False)))
def test_an_animal_is_where_the_terrain_puts_it(kind, view):
    place, roll, pitch, yaw = view
    at = np.array(place)
    pose = looking_at(at, roll, pitch, yaw)
    assert abs(HILLS.heights_at([at])[0]) > 5  # on the plane at zero it would be elsewhere
    frame = render_frame(HILLS, scenery(kind), pose, at[None], THERMAL, np.random.default_rng(1))
    pixels = np.argwhere(frame.view.labels == 1)[:, ::-1]
    assert frame.animal[1] == 0 and len(pixels) > 20
    k = ANIMALS[kind]
    middle = np.array([[*at, -HILLS.heights_at([at])[0] - k.height / 2]])
    want = ground_to_pixel(CAMERA, middle, pose.p_nc, pose.R_nc)[0]
    # Head and tail make it no oval, and its side is seen from above: a part of its own size, and of a pixel.
    per_m = 600.0 / 60.0
    assert np.linalg.norm(pixels.mean(axis=0) - want) < 0.15 * k.length * per_m + 0.5


def frame_of(labels: Array, whose: list[int]) -> Frame:
    view = LandView(np.zeros(SHAPE, np.float32), labels.astype(np.int16), np.ones(SHAPE, bool), ())
    return Frame(np.zeros(SHAPE, np.uint16), view, np.array([NONE, *whose], np.intp))


def detections(*boxes: tuple[int, int, int, int]) -> Detections:
    """Of rectangles: left, top, width, height."""
    mask = np.zeros(SHAPE, np.int32)
    for number, (left, top, width, height) in enumerate(boxes, start=1):
        mask[top : top + height, left : left + width] = number
    return describe(
        mask, mask.astype(np.uint8), np.ones(SHAPE, bool), contrast=mask.astype(np.uint8), noise=1.0
    )


def test_detections_are_judged_by_what_is_under_them():
    labels = np.zeros(SHAPE)
    labels[50:60, 100:120] = 1  # animal 4
    labels[150:160, 200:220] = 2  # a stone
    frame = frame_of(labels, [4, NONE])
    found = detections((100, 50, 20, 10), (200, 150, 20, 10), (20, 200, 10, 10))
    judged = judge(frame, found)
    order = np.argsort(found.uv[:, 1])
    assert judged[order].tolist() == [4, NONE, NONE]
    # A centroid near an animal is of it, one of much more than the animal is not.
    widest = int(TOO_LARGE * 20)
    for box, whose in (
        ((117 + NEAR, 50, 5, 5), 4),
        ((118 + NEAR, 50, 5, 5), NONE),
        ((110 - (widest - 1) // 2, 50, widest - 1, 10), 4),
        ((110 - (widest + 1) // 2, 50, widest + 1, 10), NONE),
    ):
        assert judge(frame, detections(box)).tolist() == [whose], box


def framed(labels: Array, find: Callable[[np.ndarray, float], Detections]) -> Framed:
    """Two images, 3 m apart, straight down over ground at 8 m, that show an animal where it is labelled."""
    flat = Terrain(np.full((41, 41), 8.0, np.float32), north=-200.0, east=-200.0, step=10.0)
    told = poses(np.array([[0.0, 0.0, -58.0], [3.0, 0.0, -58.0]]), np.array([R_MC_DOWN] * 2))
    none = np.zeros(0, np.intp)
    images = Images(
        np.arange(2.0), told, np.zeros((0, 2)), np.zeros((0, 2, 2)), none, none, np.zeros((2, 1, 2)),
        np.ones((2, 1), bool),
    )  # fmt: skip
    return take_frames(
        flat, images, np.zeros(2), lambda k: frame_of(labels, [0]), find, ERRORS, DETECTOR,
        np.random.default_rng(0),
    )  # fmt: skip


def test_detections_go_to_the_ground_from_the_told_pose():
    labels = np.zeros(SHAPE)
    labels[50:61, 100:121] = 1
    asked = []

    def find(counts: np.ndarray, distance: float) -> Detections:
        asked.append(distance)
        return detections((100, 50, 21, 11), (10, 10, 5, 5))

    images = framed(labels, find).images
    assert asked == pytest.approx([50.0, 50.0], abs=0.01)
    assert images.image.tolist() == [0, 0, 1, 1]
    assert sorted(images.animal.tolist()) == [NONE, NONE, 0, 0]
    own = images.animal == 0
    # By hand: 58 m less 8 m less 0.7 m above the plane of middles, over 600 px, from the image's middle.
    per_px = (58.0 - 8.0 - DETECTOR.height) / 600.0
    off = (np.array([110.0, 55.0]) - [159.5, 119.5]) * per_px
    ahead = (R_MC_DOWN @ [*off, 0.0])[:2]
    np.testing.assert_allclose(images.z[own], ahead + np.array([[0.0, 0.0], [3.0, 0.0]]), atol=1e-6)
    assert (np.linalg.eigvalsh(images.R) > 0).all()
    # At least what two pixels and half a metre of the pose are.
    assert (np.trace(images.R, axis1=1, axis2=2) > 2 * ((DETECTOR.sd * per_px) ** 2 + 0.5**2) * 0.99).all()
