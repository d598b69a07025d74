"""The lens of the wildlife camera and its approximate inverse: F 2.3.6, 2.4, 7.1."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from wildlab.detection.boards import Board
from wildlab.geometry.camera import Camera, normalise, undistort, undistort_approximately
from wildlab.geometry.frames import Array
from wildlab.geometry.intrinsics import PINHOLE, calibrate_camera, project_board
from wildlab.reporting.charts.drawing import fields_chart
from wildlab.reporting.published import error_name
from wildlab.simulation.boards import board_views

#: F 7.1, as printed. The skew and k2 to k5 "are assumed to be zero, and therefore not estimated".
FX, FY, CX, CY, K1 = 1267.0, 1117.0, 356.0, 216.6, 0.446
#: Focal length by the data sheet, pixels: 19 mm over 17 um (F 6, FLIR Tau 2 640 with a 19 mm lens).
DATA_SHEET = 0.019 / 17e-6
#: F prints no size of the image. What the camera or its analogue video may have been digitised to, with the
#: part of the sensor's 640 x 512 pixels that is in it.
VIDEOS: dict[str, tuple[int, int, int, int]] = {
    "640 x 512, digital": (640, 512, 640, 512),
    "640 x 480, NTSC": (640, 480, 640, 480),
    "720 x 480, NTSC": (720, 480, 640, 480),
    "720 x 576, PAL": (720, 576, 640, 512),
    "768 x 576, PAL": (768, 576, 640, 512),
}
#: F's board is not described: chosen, as is how many pictures were taken.
BOARD = Board("chessboard", 8, 6, 0.05)
IMAGES = 20


class Video(NamedTuple):
    """One reading of what the printed numbers are in.

    Attributes
    ----------
    name
        Of the video.
    width, height
        Of its pictures, pixels.
    fx, fy
        Focal lengths that the data sheet gives in these pixels.
    off
        How far the printed ones are from them, root mean square, per cent.
    centre
        How far the printed principal point is from the middle, pixels.
    """

    name: str
    width: int
    height: int
    fx: float
    fy: float
    off: float
    centre: float


def printed_camera(width: int, height: int) -> Camera:
    """F's camera for pictures of that size."""
    return Camera(width, height, FX, FY, CX, CY, 0.0, (K1, 0.0, 0.0, 0.0, 0.0))


def read_videos() -> list[Video]:
    """How well the numbers of the calibration fit each of `VIDEOS`, the best first."""
    found = []
    for name, (width, height, columns, rows) in VIDEOS.items():
        sheet = (DATA_SHEET * width / columns, DATA_SHEET * height / rows)
        off = 100 * float(np.sqrt(((FX / sheet[0] - 1) ** 2 + (FY / sheet[1] - 1) ** 2) / 2))
        centre = float(np.hypot(CX - (width - 1) / 2, CY - (height - 1) / 2))
        found.append(Video(name, width, height, *sheet, off, centre))
    return sorted(found, key=lambda one: one.off)


class Inverse(NamedTuple):
    """The approximate inverse over an image: ``u``, ``v`` (rows, columns) px, and by how much its direction
    is off, ``error`` (rows, columns) px of an undistorted image."""

    u: Array
    v: Array
    error: Array


def inverse_error(camera: Camera) -> Inverse:
    """By how much F (2.19) misses the exact inverse of F (2.18), over the image.

    Parameters
    ----------
    camera
        With one parameter, k1.

    Returns
    -------
    Inverse
    """
    u, v = np.meshgrid(np.linspace(0, camera.width - 1, 61), np.linspace(0, camera.height - 1, 41))
    uv = np.column_stack([u.ravel(), v.ravel()])
    distorted = normalise(replace(camera, distortion=(0.0,) * 5), uv)
    k1 = camera.distortion[0]
    apart = undistort_approximately(distorted, k1) - undistort(distorted, (k1, 0.0, 0.0, 0.0, 0.0))
    error = np.linalg.norm(apart * [camera.fx, camera.fy], axis=1)
    return Inverse(u, v, error.reshape(u.shape))


def come_back(
    rng: np.random.Generator, camera: Camera, noise: float, runs: int, images: int = IMAGES
) -> pd.DataFrame:
    """Calibrations with F's model: does the camera come back?

    Parameters
    ----------
    rng
        For views and noise.
    camera
        The truth.
    noise
        Standard deviation of a corner along each axis, px.
    runs
        How many calibrations.
    images
        In each.

    Returns
    -------
    DataFrame
        A row a run: fx, fy, cx, cy (px) and k1.
    """
    values = []
    for _ in range(runs):
        views = board_views(rng, camera, BOARD.points, images)
        uv = project_board(camera, views, BOARD.points)
        uv = uv + rng.normal(0, noise, uv.shape)
        found = calibrate_camera(BOARD.points, uv, camera.width, camera.height, "k1", resample=False)
        values.append(found.values)
    return pd.DataFrame(values, columns=[*PINHOLE, "k1"])


def videos_table(videos: Sequence[Video], height: float) -> pd.DataFrame:
    """A row for each video, with the largest error of F (2.19) over its image, px, and on the ground from
    ``height``, m."""
    rows = []
    for one in videos:
        largest = float(inverse_error(printed_camera(one.width, one.height)).error.max())
        rows.append({**one._asdict(), "largest": largest, "ground": height * largest / FY})
    return pd.DataFrame(rows)


def metrics_of(back: pd.DataFrame, videos: Sequence[Video], inverse: Inverse) -> list[dict[str, Any]]:
    """What the study records; ``back`` from `come_back`."""
    found: list[dict[str, Any]] = []
    for name, values in back.items():
        about = {"subject": "tau2", "unit": "" if name == "k1" else "px", "n": len(back)}
        found.append({"name": name, "value": values.mean(), **about})
        found.append({"name": error_name(str(name)), "value": values.sem(), **about})
    rms = float(np.sqrt((inverse.error**2).mean()))
    return [
        *found,
        {"name": "best_video_off", "subject": "tau2-data-sheet", "value": videos[0].off, "unit": "%"},
        {"name": "largest_error", "subject": "inverse", "value": inverse.error.max(), "unit": "px"},
        {"name": "rms_error", "subject": "inverse", "value": rms, "unit": "px"},
    ]


def plot_inverse(inverse: Inverse, camera: Camera) -> Figure:
    """Contours of the error of the approximate inverse over the image; a cross at the principal point."""
    levels, centre = np.linspace(0, float(inverse.error.max()), 11), (camera.cx, camera.cy)
    some = levels[[1, 3, 6, 9]]
    return fields_chart(
        inverse.u, inverse.v, {"": inverse.error}, levels, some, "%.2g px", centre, (5.6, 4.0)
    )
