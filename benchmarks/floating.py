"""Images searched for floating objects a second, and scenes rendered, on one core, against what is wanted.

A ratio is the wanted rate over ours: below one is fast enough. The plain row is the same gradient in numpy.
"""

from __future__ import annotations

import cv2
import numpy as np

from benchmarks.timing import best_of
from wildlab.detection.floating import FloatingThresholds, find_edges, find_objects
from wildlab.geometry.camera import Camera
from wildlab.geometry.camera_poses import CameraPoses, Mount
from wildlab.geometry.frames import euler_to_matrix
from wildlab.simulation.scene.flights import CameraResponse, expose, sensor_of
from wildlab.simulation.scene.render import Scene, Sea, render, vessel

#: Images a second that are wanted of the search, and scenes a second of the rendering.
SEARCHED, RENDERED = 250.0, 4.0
CAMERA = Camera(640, 512, 1159.2, 1167.8, 313.0, 265.0)


def run() -> tuple[str, list[tuple[str, float, float, str]]]:
    """Title and rows (what, seconds, ratio to what is wanted, what is wanted)."""
    threads = cv2.getNumThreads()
    cv2.setNumThreads(1)
    try:
        return f"Floating objects in images of {CAMERA.width} by {CAMERA.height}, one core", _rows()
    finally:
        cv2.setNumThreads(threads)


def _rows() -> list[tuple[str, float, float, str]]:
    poses = CameraPoses(CAMERA, Mount("down"), np.array([0.0, 0.0, -300.0]), euler_to_matrix(0.05, 0.3, 0.4))
    bodies = (vessel(26.0, 6.0, 8.0, speed=3.0).at(90.0, 20.0, 0.8), vessel(5.0, 2.0).at(130.0, 10.0, 2.0))
    scene = Scene(Sea(sun_elevation=0.8), bodies)
    view = render(scene, CAMERA, poses.p_nc, poses.R_nc)
    response, rng = CameraResponse(), np.random.default_rng(1)
    counts = expose(view.kelvin, response, sensor_of(response, view.kelvin.shape, rng), rng)
    empty = counts.copy()
    empty[view.kelvin > np.quantile(view.kelvin, 0.98)] = int(np.median(counts))
    if not len(find_objects(counts).detections):
        raise RuntimeError("the benchmark's vessels are not found")

    def plain() -> np.ndarray:
        """The gradient alone, in numpy."""
        image = counts.astype(np.float32)
        du = image[:, 2:] - image[:, :-2]
        dv = image[2:] - image[:-2]
        du = du[:-2] + du[1:-1] + du[2:]
        dv = dv[:, :-2] + dv[:, 1:-1] + dv[:, 2:]
        return np.sqrt(du * du + dv * dv)

    times = {
        "gradient alone, in numpy": (best_of(plain, 40), SEARCHED),
        "steps 1 to 3, an image": (
            best_of(lambda: find_edges(counts, None, FloatingThresholds()), 40),
            SEARCHED,
        ),
        "all steps, an image of empty sea": (best_of(lambda: find_objects(empty), 40), SEARCHED),
        "all steps, an image with two vessels": (best_of(lambda: find_objects(counts), 40), SEARCHED),
        "a scene rendered": (best_of(lambda: render(scene, CAMERA, poses.p_nc, poses.R_nc), 10), RENDERED),
    }
    return [
        (what, seconds, wanted * seconds, f"at most 1: {wanted:g} a second")
        for what, (seconds, wanted) in times.items()
    ]
