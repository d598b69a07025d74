"""The intrinsic matrix from 30 images of a circle grid (H 2.3, 2.4), on simulated images of H's camera."""

from __future__ import annotations

from typing import NamedTuple

import cv2
import numpy as np
import pandas as pd

from wildlab.detection.boards import Board, find_board, grey8
from wildlab.evaluation.replication import propagate_rounding
from wildlab.evaluation.runs import Interval
from wildlab.geometry.board_views import Views, parameters_of, project_board
from wildlab.geometry.camera import Camera, camera_from_data_sheet
from wildlab.geometry.directions import direction_differences
from wildlab.geometry.frames import Array
from wildlab.geometry.intrinsics import PINHOLE, calibrate_camera
from wildlab.simulation.boards import board_image, board_views
from wildlab.studies.sensitivity.tables import TAU2

#: Its data sheet: lens (m), pitch of the pixels (m), H table A.1.
LENS, PITCH = 0.019, 17e-6
#: How many images H took.
IMAGES = 30
#: H prints neither how many circles the plate has nor their distance: chosen.
GRID = Board("circles", 7, 7, 0.03)
#: Chosen: blur of the lens (px), and noise of the sensor with the grid's contrast of 150, in grey levels.
BLUR, NOISE = 0.7, 3.0
#: Height of H 5.6.1, metres.
HEIGHT = 350.0


def theoretical() -> Camera:
    """The camera of H (2.2) by its data sheet, which H (2.4) prints."""
    return camera_from_data_sheet(640, 512, LENS, 640 * PITCH, 512 * PITCH)


def theoretical_focal_length() -> Interval:
    """Its focal length, pixels; bounds are of what 19 mm and 17 µm were rounded from."""
    low, high = propagate_rounding(lambda one: one[0] / one[1], [LENS, PITCH], [0.5e-3, 0.5e-6])
    return Interval(LENS / PITCH, float(low), float(high))


class Centres(NamedTuple):
    """How well circles are found: views with the whole grid found, of how many; root mean squared error of a
    centre along one axis (px); and the last image with its centres."""

    found: int
    images: int
    sd: float
    image: Array
    uv: Array


def measure_centres(rng: np.random.Generator, images: int) -> Centres:
    """Render the warm grid, find its circles, and compare with where they are.

    Parameters
    ----------
    rng
        For views and noise.
    images
        How many.

    Returns
    -------
    Centres
    """
    views = board_views(rng, TAU2, GRID.points, images)
    squares: list[Array] = []
    image, last, found = np.zeros((TAU2.height, TAU2.width)), np.zeros((0, 2)), 0
    for R, t in zip(*views, strict=True):
        clean = board_image(TAU2, R, t, GRID.points, GRID.spacing, circles=True, warm=50.0, cold=200.0)
        noisy = cv2.GaussianBlur(clean, (0, 0), BLUR) + rng.normal(0, NOISE, clean.shape)
        seen = find_board(grey8(noisy), GRID)
        if seen is None:
            continue
        true = project_board(parameters_of(TAU2), Views(R[None], t[None]), GRID.points).uv[0]
        # A square grid does not say which circle is the first: each is compared with the nearest.
        nearest = np.linalg.norm(seen.uv[:, None] - true, axis=2).argmin(axis=1)
        squares.append((seen.uv - true[nearest]) ** 2)
        image, last, found = noisy, seen.uv, found + 1
    sd = float(np.sqrt(np.mean(squares))) if squares else float("nan")
    return Centres(found, images, sd, image, last)


def calibrations(rng: np.random.Generator, runs: int, sd: float, images: int = IMAGES) -> pd.DataFrame:
    """Calibrations of H's camera, each from a first and a second set of images.

    Parameters
    ----------
    rng
        For views and noise.
    runs
        How many.
    sd
        Of a centre along each axis, px.
    images
        In each set.

    Returns
    -------
    DataFrame
        A row a run: ``fx``, ``fy``, ``cx``, ``cy`` of the first set, and with ``sd_`` (as the calibration
        states it), ``inside_`` (the truth in its 95 % interval) and ``second_`` (of the second set).
    """
    truth = dict(zip(PINHOLE, parameters_of(TAU2), strict=False))
    rows = []
    for _ in range(runs):
        row: dict[str, float] = {}
        for prefix in ("", "second_"):
            views = board_views(rng, TAU2, GRID.points, images)
            uv = project_board(parameters_of(TAU2), views, GRID.points).uv
            uv = uv + rng.normal(0, sd, uv.shape)
            first = prefix == ""
            found = calibrate_camera(GRID.points, uv, TAU2.width, TAU2.height, PINHOLE, resample=first)
            for name in PINHOLE:
                row[prefix + name] = found.value(name)
                if first:
                    low, high = found.interval(name)
                    row[f"sd_{name}"] = found.sd(name)
                    row[f"inside_{name}"] = float(low <= truth[name] <= high)
        rows.append(row)
    return pd.DataFrame(rows)


def neglected_distortion(rng: np.random.Generator, k1: float, images: int = IMAGES) -> tuple[float, float]:
    """What neglecting a bent lens costs: the camera is calibrated without noise as if it were straight.

    Parameters
    ----------
    rng
        For the views.
    k1
        Of the lens.
    images
        How many.

    Returns
    -------
    tuple of float
        Root mean squared reprojection error, px, and the largest difference in the direction that a pixel
        looks in, apart from a turn of the whole camera, px.
    """
    bent = Camera(640, 512, TAU2.fx, TAU2.fy, TAU2.cx, TAU2.cy, 0.0, (k1, 0.0, 0.0, 0.0, 0.0))
    views = board_views(rng, bent, GRID.points, images)
    uv = project_board(parameters_of(bent), views, GRID.points).uv
    found = calibrate_camera(GRID.points, uv, 640, 512, PINHOLE, resample=False)
    return found.rms, float(np.linalg.norm(direction_differences(found.camera, bent), axis=1).max())
