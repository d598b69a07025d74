"""What was found in one image: a row for each thing, with its shape and with how far off its pixel may be."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from typing import Any

import cv2
import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.spatial import cKDTree

from wildlab.geometry.frames import Array, Indices, Mask

#: Standard deviation of the middle of an animal about that of what is warm of it, over the length of the
#: latter: legs and heads are cold or hidden. From how far labels of people and deer lie from detections
#: (robust, 0.10 to 0.14 of the major axis); errors of the labels are in it.
PART = 0.12
#: px: what is left of the error of a centroid where shape and noise explain none, as slopes of the ground do.
FLOOR = 0.05


@dataclass(frozen=True, eq=False)
class Detections:
    """Things in one image, N rows; pixels are (0, 0) in the middle of the upper left one.

    Attributes
    ----------
    uv
        (N, 2) px, right and down: the centroid.
    covariance
        (N, 2, 2) px^2, of its error.
    area
        (N,) px^2.
    intensity
        (N,) mean, in the unit of the image.
    box
        (N, 4) left, top, width and height, px.
    axes
        (N, 2) px: lengths of major and minor axis of the ellipse with the same second moments.
    orientation
        (N,) rad, of the major axis, from right towards down, within -pi/2 to pi/2.
    hu
        (N, 7) Hu's moments of the shape.
    score
        (N,) the larger the surer; what it is depends on the detector.
    """

    uv: Array
    covariance: Array
    area: Array
    intensity: Array
    box: Array
    axes: Array
    orientation: Array
    hu: Array
    score: Array

    def __len__(self) -> int:
        return len(self.uv)

    def select(self, rows: ArrayLike) -> Detections:
        """Some of the rows.

        Parameters
        ----------
        rows
            (N,) bool, or numbers of rows in the order that is wanted.

        Returns
        -------
        Detections
        """
        chosen = np.asarray(rows)
        chosen = chosen if chosen.dtype == bool else chosen.astype(np.intp)
        return Detections(*(getattr(self, one.name)[chosen] for one in fields(self)))

    def with_score(self, score: ArrayLike) -> Detections:
        """The same with other scores (N,).

        Parameters
        ----------
        score
            (N,).

        Returns
        -------
        Detections
        """
        return replace(self, score=np.asarray(score, float))


def no_detections() -> Detections:
    """Nothing found.

    Returns
    -------
    Detections
        With no rows.

    Examples
    --------
    >>> len(no_detections())
    0
    """
    shapes = ((2,), (2, 2), (), (), (4,), (2,), (), (7,), ())
    return Detections(*(np.zeros((0, *shape)) for shape in shapes))


def detections_of_boxes(boxes: Array, scores: Array) -> Detections:
    """Boxes (N, 4), left, top, width and height, of a detector that tells no more but its scores (N,).

    Their middles are off as in `describe`, by `PART` of what is longer.
    """
    sides, unknown = boxes[:, 2:], np.full(len(boxes), np.nan)
    axes = -np.sort(-sides)
    spread = FLOOR**2 + (PART * axes[:, 0]) ** 2
    return Detections(
        boxes[:, :2] + sides / 2,
        spread[:, None, None] * np.eye(2),
        sides.prod(axis=1),
        unknown,
        boxes,
        axes,
        np.where(sides[:, 0] < sides[:, 1], np.pi / 2, 0.0),
        np.tile(unknown[:, None], 7),
        scores,
    )


def describe(
    labels: NDArray[np.int32],
    image: NDArray[Any],
    valid: Mask,
    *,
    contrast: NDArray[Any] | None = None,
    noise: float = 0.0,
    blur_px: float = 1.0,
    part: float = PART,
    score: ArrayLike | None = None,
) -> Detections:
    """Shapes, intensities and covariances of labelled regions.

    Parameters
    ----------
    labels
        (H, W), 0 for nothing and 1 to N for N regions, none of them empty.
    image
        (H, W) in any unit.
    valid
        (H, W) False where there is no scene: what touches it may be cut off, as at the border of the image.
    contrast
        (H, W) of the image against its background; None takes the image less its median.
    noise
        Standard deviation of ``contrast`` without an object.
    blur_px
        Standard deviation of the blur of camera and smoothing, px.
    part
        Standard deviation of the middle of the thing about that of what is seen of it, over the major axis; 0
        where all of it is seen.
    score
        (N,); None takes the largest contrast.

    Returns
    -------
    Detections

    Notes
    -----
    The covariance is a sum. An edge is found to within a pixel's twelfth and to within the noise divided by
    the slope of the blurred edge, alike over the blur's length; each stretch of contour moves the centroid by
    its lever over the area. `FLOOR` is what neither explains, ``part`` what is not seen of a thing. What is
    cut off at a border goes on beyond it, by up to what is seen: evenly spread, a twelfth of its square.
    """
    inside = np.flatnonzero(labels.ravel() > 0)
    if not len(inside):
        return no_detections()
    # Sorted by region, so that the largest and smallest of each are those of a run.
    number = labels.ravel()[inside]
    order = np.argsort(number, kind="stable")
    inside, of = inside[order], number[order].astype(np.intp) - 1
    count = int(of[-1]) + 1
    starts = np.searchsorted(of, np.arange(count))
    rows, columns = np.divmod(inside, labels.shape[1])
    shown = image.ravel()[inside].astype(float)
    above = shown - np.median(image[valid]) if contrast is None else contrast.ravel()[inside].astype(float)

    place = np.stack([columns, rows], axis=1).astype(float)
    area = np.bincount(of, minlength=count).astype(float)
    uv = np.add.reduceat(place, starts, axis=0) / area[:, None]
    apart = place - uv[of]
    products = apart[:, :, None] * apart[:, None, :]
    # A pixel is a square: its own second moment is a twelfth.
    second = np.add.reduceat(products, starts, axis=0) / area[:, None, None] + np.eye(2) / 12
    powers, directions = np.linalg.eigh(second)
    axes = 4 * np.sqrt(powers[:, ::-1])
    major = directions[:, :, 1]
    orientation = np.arctan2(major[:, 1], major[:, 0])
    orientation -= np.pi * np.rint(orientation / np.pi)
    low, high = np.minimum.reduceat(place, starts), np.maximum.reduceat(place, starts)
    extent = high - low + 1
    peak = np.maximum.reduceat(above, starts)

    slope = np.maximum(peak, 1e-12) / (blur_px * np.sqrt(2 * np.pi))
    edge = 1 / 12 + max(1.0, 2 * np.sqrt(np.pi) * blur_px) * (noise / slope) ** 2
    outline = _outline(labels, rows, columns)
    lever = np.add.reduceat(products * outline[:, None, None], starts, axis=0)
    lever += np.eye(2) * np.add.reduceat(outline.astype(float), starts)[:, None, None] / 12
    alike = FLOOR**2 + (part * axes[:, 0]) ** 2
    covariance = alike[:, None, None] * np.eye(2) + (edge / area**2)[:, None, None] * lever
    cut = np.logical_or.reduceat(_beside(valid, rows, columns), starts, axis=0)
    covariance[:, [0, 1], [0, 1]] += np.where(cut, extent**2 / 12, 0.0)

    return Detections(
        uv,
        covariance,
        area,
        np.add.reduceat(shown, starts) / area,
        np.concatenate([low - 0.5, extent], axis=1),
        axes,
        orientation,
        np.stack([_hu(labels, k + 1, *low[k], *high[k]) for k in range(count)]),
        peak if score is None else np.asarray(score, float),
    )


def _outline(labels: NDArray[np.int32], rows: Indices, columns: Indices) -> Mask:
    """(P,) which pixels have a neighbour that does not belong to their region, or lie at the border."""
    height, width = labels.shape
    own = labels[rows, columns]
    found = (rows == 0) | (columns == 0) | (rows == height - 1) | (columns == width - 1)
    for by in (-1, 1):
        found |= labels[np.clip(rows + by, 0, height - 1), columns] != own
        found |= labels[rows, np.clip(columns + by, 0, width - 1)] != own
    return np.asarray(found)


def _beside(valid: Mask, rows: Indices, columns: Indices) -> Mask:
    """(P, 2) which pixels lie beside a border to the left or right, and above or below: within 2 px."""
    height, width = valid.shape
    found = np.stack([(columns < 2) | (columns >= width - 2), (rows < 2) | (rows >= height - 2)], axis=1)
    if not valid.all():
        for by in (-2, -1, 1, 2):
            found[:, 0] |= ~valid[rows, np.clip(columns + by, 0, width - 1)]
            found[:, 1] |= ~valid[np.clip(rows + by, 0, height - 1), columns]
    return found


def _hu(labels: NDArray[np.int32], number: int, left: float, top: float, right: float, below: float) -> Array:
    """Hu's moments (7,) of one region within its box."""
    here = labels[int(top) : int(below) + 1, int(left) : int(right) + 1]
    found = cv2.moments((here == number).astype(np.uint8), binaryImage=True)
    return np.asarray(cv2.HuMoments(found), float).ravel()


def join(parts: Sequence[Detections]) -> Detections:
    """Rows of several, one after another.

    Parameters
    ----------
    parts
        Of one image.

    Returns
    -------
    Detections

    Examples
    --------
    >>> len(join([no_detections(), no_detections()]))
    0
    """
    if not parts:
        return no_detections()
    names = [one.name for one in fields(Detections)]
    return Detections(*(np.concatenate([getattr(part, name) for part in parts]) for name in names))


def remove_near(found: Detections, apart_px: float) -> Detections:
    """Of detections that are too near one another only the one with the largest score stays (F 3.2.6).

    Parameters
    ----------
    found
        Of one image.
    apart_px
        How far centroids are apart at least; 0 removes nothing.

    Returns
    -------
    Detections
        In the order of the score, largest first.

    Notes
    -----
    F removes detections too near to each other and takes them for one target; which of them stays is not
    said. Here it is the surest.
    """
    order = np.argsort(-found.score, kind="stable")
    found = found.select(order)
    if apart_px <= 0 or len(found) < 2:
        return found
    keep = np.ones(len(found), bool)
    pairs = cKDTree(found.uv).query_pairs(np.nextafter(apart_px, 0), output_type="ndarray")
    # The surer comes first in each pair; it removes others only where it was not removed itself.
    for row, other in pairs[np.lexsort(pairs.T[::-1])]:
        if keep[row]:
            keep[other] = False
    return found.select(keep)
