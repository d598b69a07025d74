"""Calibration boards in images: chessboards and grids of circles, whichever of their sides is the warm one.

On paper a board is dark on white. A thermal camera may see it the other way round (a heated plate shines
through the holes of H 2.5.1; mirrors between painted squares show a cold sky, F 2.4), so each image is tried
as it is and inverted. Boards with codes on them (ChArUco) are not read.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Literal, NamedTuple, cast

import cv2
import numpy as np
from numpy.typing import ArrayLike, NDArray

from wildlab.errors import WildlabError
from wildlab.geometry.frames import Array

Pattern = Literal["chessboard", "circles", "staggered circles"]
Grey = NDArray[np.uint8]

#: Of a square's side, how far about a corner its edges are looked at.
WINDOW = 0.35
#: Shares of the pixels that an image is stretched between: a few hot ones do not make the rest dark.
STRETCHED = (0.5, 99.5)


@dataclass(frozen=True)
class Board:
    """What was photographed.

    Attributes
    ----------
    pattern
        The staggered circles are those of OpenCV's asymmetric grid: every other row moved by half a step.
    columns, rows
        Inner corners, or circles.
    spacing
        Side of a square, or distance of neighbouring circles in a row (staggered: half of it), metres.
    """

    pattern: Pattern
    columns: int
    rows: int
    spacing: float = 1.0

    def __post_init__(self) -> None:
        if min(self.columns, self.rows) < 3 or max(self.columns, self.rows) > 100 or not self.spacing > 0:
            raise WildlabError(
                f"a board of {self.columns} x {self.rows} with a spacing of {self.spacing:g} m",
                "give 3 to 100 inner corners (or circles) each way, and a spacing above zero",
                field="board",
            )

    @property
    def points(self) -> Array:
        """(M, 3) corners or centres in the board's frame, metres, row by row, z = 0."""
        row, column = np.divmod(np.arange(self.columns * self.rows), self.columns)
        x = 2 * column + row % 2 if self.pattern == "staggered circles" else column
        return np.column_stack([x, row, np.zeros(len(row))]) * self.spacing


class BoardImage(NamedTuple):
    """A board in an image: pixels (M, 2) of its points, and whether the image had to be inverted first."""

    uv: Array
    inverted: bool


def grey8(image: ArrayLike) -> Grey:
    """An image of any kind as 8 bit grey, stretched between its darkest and lightest half percent.

    Parameters
    ----------
    image
        (H, W), or (H, W, 3) red, green and blue; counts, kelvin or grey.

    Returns
    -------
    (H, W) uint8; all zero where nothing differs.

    Examples
    --------
    >>> grey8(np.array([[290.0, 300.0], [300.0, 290.0]]))
    array([[  0, 255],
           [255,   0]], dtype=uint8)
    """
    values = np.asarray(image)
    if values.ndim == 3:
        values = values[..., :3].astype(np.float32) @ np.array([0.299, 0.587, 0.114], np.float32)
    values = values.astype(np.float32)
    counts = np.isfinite(values)
    if not counts.any():
        return np.zeros(values.shape, np.uint8)
    low, high = np.percentile(values[counts], STRETCHED)
    if not high > low:
        low, high = float(values[counts].min()), float(values[counts].max())
    if not high > low:
        return np.zeros(values.shape, np.uint8)
    stretched = np.clip((np.nan_to_num(values, nan=low) - low) * (255 / (high - low)), 0, 255)
    return np.asarray(np.rint(stretched), np.uint8)


def find_board(grey: Grey, board: Board) -> BoardImage | None:
    """The points of a board, to a fraction of a pixel.

    Parameters
    ----------
    grey
        (H, W) uint8, from `grey8`.
    board
        What to look for.

    Returns
    -------
    Seen or None
        None where it is not there as a whole.
    """
    ways = (_by_grid, _by_squares) if board.pattern == "chessboard" else (_circles,)
    for inverted in (False, True):
        for find in ways:
            uv = find(255 - grey if inverted else grey, board)
            if uv is not None:
                if board.pattern != "chessboard":
                    return BoardImage(uv, inverted)
                # Squares are dark and light in turn: which way round they were found says nothing of them.
                return BoardImage(_refined(uv, grey, board), inverted and find is _by_grid)
    return None


def _by_grid(grey: Grey, board: Board) -> Array | None:
    flags = cv2.CALIB_CB_NORMALIZE_IMAGE | cv2.CALIB_CB_ACCURACY
    found, corners = cv2.findChessboardCornersSB(grey, (board.columns, board.rows), flags=flags)
    return _as_pixels(cast(Any, corners), grey) if found else None


def _by_squares(grey: Grey, board: Board) -> Array | None:
    # Sees what blur hides from the other one.
    flags = cv2.CALIB_CB_ADAPTIVE_THRESH | cv2.CALIB_CB_NORMALIZE_IMAGE | cv2.CALIB_CB_FAST_CHECK
    found, corners = cv2.findChessboardCorners(grey, (board.columns, board.rows), flags=flags)
    return _as_pixels(cast(Any, corners), grey) if found else None


def _refined(uv: Array, grey: Grey, board: Board) -> Array:
    """Corners where the gradients about them cross, looked for within a third of a square's side."""
    grid = uv.reshape(board.rows, board.columns, 2)
    side = min(np.linalg.norm(np.diff(grid, axis=axis), axis=-1).min() for axis in (0, 1))
    half = int(WINDOW * side)
    if half < 2:
        return uv
    at = uv.astype(np.float32).reshape(-1, 1, 2)
    stop = (cv2.TERM_CRITERIA_EPS + cv2.TERM_CRITERIA_MAX_ITER, 50, 1e-4)
    found = cv2.cornerSubPix(grey, at.copy(), (half, half), (-1, -1), stop).reshape(-1, 2).astype(float)
    # Where it ran off to something else, the first answer stays.
    near = np.linalg.norm(found - uv, axis=1) < half / 2
    return np.where(near[:, None], found, uv)


def _circles(grey: Grey, board: Board) -> Array | None:
    blob = cast(Any, cv2)  # its types lack the detector of blobs
    settings = blob.SimpleBlobDetector_Params()
    settings.minThreshold, settings.maxThreshold, settings.thresholdStep = 20, 235, 10
    # From some pixels across to what would fill the image.
    settings.minArea = 12.0
    settings.maxArea = float(grey.size) / (board.columns * board.rows)
    settings.minDistBetweenBlobs = 3.0
    settings.minConvexity = 0.85
    settings.minInertiaRatio = 0.05
    blobs = blob.SimpleBlobDetector_create(settings)
    layout = cv2.CALIB_CB_SYMMETRIC_GRID if board.pattern == "circles" else cv2.CALIB_CB_ASYMMETRIC_GRID
    for flags in (layout, layout | cv2.CALIB_CB_CLUSTERING):
        found, centres = cv2.findCirclesGrid(
            grey, (board.columns, board.rows), flags=flags, blobDetector=blobs
        )
        if found:
            return _as_pixels(cast(Any, centres), grey)
    return None


def _as_pixels(points: ArrayLike, grey: Grey) -> Array | None:
    """(M, 2), or None where some lie outside the image: not a board."""
    uv = np.asarray(points, float).reshape(-1, 2)
    inside = np.isfinite(uv).all() and (uv > -1).all() and (uv < np.array(grey.shape[::-1])).all()
    return uv if inside else None
