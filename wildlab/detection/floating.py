"""Floating objects in thermal images of the sea, by their edges: the seven steps of H 4.3.

1. Smooth with a Gaussian (4.1).
2. Gradient by the Prewitt operator (4.2), (4.3).
3. Keep what is steep (4.4).
4. Connect, and remove what is too small or too large.
5. Remove what lies in the box of something larger.
6. Fill.
7. At the border of the image, move the centre where the size is known (4.7): `wildlab.detection.centres`.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, Literal, NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from wildlab.detection.centres import (
    AT_BORDER,
    boundary_spread,
    centre_covariance,
    cut_sides,
)
from wildlab.detection.detections import Detections, describe, no_detections
from wildlab.errors import WildlabError, above_zero
from wildlab.geometry.frames import Mask

#: Of how many pixels along each side one is looked at to find an image's range.
SPARSE = 8
_PREWITT = np.array([-1.0, 0.0, 1.0]), np.ones(3)
_AROUND = np.ones((3, 3), np.uint8)


class Steps(NamedTuple):
    """What the steps make of an image, each (H, W).

    Attributes
    ----------
    grey
        0 to 255.
    smoothed
        Step 1.
    gradient
        Step 2, not limited to 255.
    steep
        Step 3: 255 where the gradient is at or above the threshold, 0 elsewhere.
    """

    grey: NDArray[Any]
    smoothed: NDArray[Any]
    gradient: NDArray[Any]
    steep: NDArray[np.uint8]


class FloatingObjects(NamedTuple):
    """What was found: ``labels`` (H, W) is the detection's row plus one inside of it, 0 elsewhere."""

    detections: Detections
    labels: NDArray[np.int32]


def detect_floating(
    image: NDArray[Any],
    valid: Mask | None = None,
    thresholds: FloatingThresholds | None = None,
) -> Detections:
    """Floating objects of one image, H 4.3; `find_objects` gives their pixels as well.

    Parameters
    ----------
    image
        (H, W): uint8 grey levels, uint16 counts or floating kelvin.
    valid
        (H, W): which pixels show anything; None is all of them. NaN shows nothing.
    thresholds
        Those of H 4.4.1 by default.

    Returns
    -------
    Detections
        By area, the largest first. The centre of what the border cuts is that of the visible part, and its
        covariance says so; `wildlab.detection.centres.adjust_at_border` moves it.

    Raises
    ------
    WildlabError
        Where the image is no grey image, or ``valid`` has another shape.

    Examples
    --------
    >>> import numpy as np
    >>> sea = np.full((60, 80), 288.0)
    >>> sea[20:40, 30:61] += 12.0
    >>> detect_floating(sea).uv.round(1)
    array([[45. , 29.5]])
    """
    return find_objects(image, valid, thresholds).detections


def find_objects(
    image: NDArray[Any],
    valid: Mask | None = None,
    thresholds: FloatingThresholds | None = None,
) -> FloatingObjects:
    """As :func:`detect_floating`, with the pixels of each object.

    Parameters
    ----------
    image, valid, thresholds
        As there.

    Returns
    -------
    FloatingObjects

    Raises
    ------
    WildlabError
        As there.
    """
    given = thresholds or FloatingThresholds()
    steps = find_edges(image, valid, given)
    filled, edges = _filled(steps, given)
    outlines, _ = cv2.findContours(filled, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)
    objects = [_within(outline) for outline in outlines]
    if given.area_of == "filled":
        objects = [found for found in objects if _size_fits(int(found.mask.sum()), given)]
    objects.sort(key=lambda found: -int(found.mask.sum()))
    labels = np.zeros(filled.shape, np.int32)
    for number, found in enumerate(objects, start=1):
        labels[found.here][found.mask > 0] = number
    return FloatingObjects(_described(np.asarray(image), steps, edges, objects, labels, given), labels)


class _Region(NamedTuple):
    """The pixels within an outline: their box, what that cuts out of the image, which of it they are."""

    box: tuple[int, int, int, int]
    here: tuple[slice, slice]
    mask: NDArray[np.uint8]
    outline: NDArray[Any]


def _within(outline: Any) -> _Region:
    left, top, width, height = cv2.boundingRect(outline)
    mask = np.zeros((height, width), np.uint8)
    cv2.drawContours(mask, [outline], 0, 1, cv2.FILLED, offset=(-left, -top))
    here = slice(top, top + height), slice(left, left + width)
    return _Region((left, top, width, height), here, mask, outline)


def to_grey(image: NDArray[Any], valid: Mask | None, thresholds: FloatingThresholds) -> NDArray[Any]:
    """An image in 256 grey levels, (H, W); see ``scaling`` of `FloatingThresholds`.

    Parameters
    ----------
    image
        (H, W): uint8 grey levels, uint16 counts or floating kelvin.
    valid
        (H, W): which pixels the range of an image is taken from; None is all of them.
    thresholds
        With the scaling.

    Returns
    -------
    (H, W) uint8.
    """
    if image.dtype == np.uint8:
        return np.ascontiguousarray(image)
    unit = thresholds.counts_per_kelvin if image.dtype.kind in "ui" else 1.0
    plain = image if image.dtype in (np.uint16, np.float32, np.float64) else image.astype(np.float32)
    sparse = image[::SPARSE, ::SPARSE]
    seen = sparse.ravel() if valid is None else sparse[valid[::SPARSE, ::SPARSE]]
    if seen.dtype.kind == "f":
        seen = seen[np.isfinite(seen)]
    if not len(seen):
        return np.zeros(image.shape, np.uint8)
    smallest = thresholds.smallest_range_k * unit
    low, high = np.quantile(seen, [thresholds.stretched_share, 1 - thresholds.stretched_share])
    span = max(high - low, smallest) if thresholds.scaling == "stretched" else smallest
    gain = 255.0 / span
    return np.asarray(cv2.addWeighted(plain, gain, plain, 0.0, -low * gain, dtype=cv2.CV_8U))


def find_edges(image: NDArray[Any], valid: Mask | None, thresholds: FloatingThresholds) -> Steps:
    """Steps 1 to 3, H (4.1) to (4.4).

    Parameters
    ----------
    image, valid, thresholds
        As for :func:`detect_floating`.

    Returns
    -------
    Steps

    Raises
    ------
    WildlabError
        Where the image is no grey image, or ``valid`` has another shape.
    """
    image = np.asarray(image)
    if image.ndim != 2 or not image.size or image.dtype.kind not in "uif":
        raise WildlabError(
            f"an image of the shape {image.shape} and type {image.dtype}",
            "give a grey image: rows by columns of grey levels, counts or kelvin",
            field="image",
        )
    if image.dtype.kind == "f" and not (finite := np.isfinite(image)).all():
        valid = finite if valid is None else valid & finite
    grey = to_grey(image, valid, thresholds)
    size, sd = thresholds.smoothing_size, thresholds.smoothing_sd
    smoothed = np.asarray(cv2.GaussianBlur(grey, (size, size), sd, borderType=cv2.BORDER_REPLICATE))
    along, across = _PREWITT
    du = cv2.sepFilter2D(smoothed, cv2.CV_32F, along, across, borderType=cv2.BORDER_REPLICATE)
    dv = cv2.sepFilter2D(smoothed, cv2.CV_32F, across, along, borderType=cv2.BORDER_REPLICATE)
    gradient: NDArray[Any] = np.asarray(cv2.magnitude(du, dv))
    if thresholds.gradient_gain != 1.0:
        gradient = gradient * np.float32(thresholds.gradient_gain)
    if valid is not None and not valid.all():
        reach = size + 2  # what the two kernels see of a pixel that shows nothing
        shows = cv2.erode(valid.astype(np.uint8), np.ones((reach, reach), np.uint8), borderValue=1)
        gradient = gradient * np.asarray(shows)
    # The gradient image has 8 bits: rounded, and whatever lies above 255 is at or above any threshold.
    limit: Any = thresholds.gradient - 0.5
    steep = cv2.compare(gradient, limit, cv2.CMP_GE)
    return Steps(grey, smoothed, gradient, np.asarray(steep, np.uint8))


def nested_in_boxes(boxes: NDArray[Any]) -> Mask:
    """Which boxes (N, 4), left, top, width, height, lie completely in a larger one, H 4.3.

    Parameters
    ----------
    boxes
        (N, 4) px.

    Returns
    -------
    (N,) bool; of two alike both stay.

    Examples
    --------
    >>> nested_in_boxes(np.array([[0, 0, 9, 9], [2, 2, 5, 5], [6, 6, 5, 5]])).tolist()
    [False, True, False]
    """
    left, top, width, height = np.asarray(boxes, float).T
    area = width * height
    inside = np.zeros(len(left), bool)
    for row in range(len(left)):
        inside[row] = bool(
            (
                (left <= left[row])
                & (top <= top[row])
                & (left + width >= left[row] + width[row])
                & (top + height >= top[row] + height[row])
                & (area > area[row])
            ).any()
        )
    return inside


def _size_fits(area: int, thresholds: FloatingThresholds) -> bool:
    largest = np.inf if thresholds.largest_area is None else thresholds.largest_area
    return bool(thresholds.smallest_area <= area <= largest)


def _filled(steps: Steps, thresholds: FloatingThresholds) -> tuple[NDArray[np.uint8], NDArray[np.uint8]]:
    """Steps 4 to 6: what belongs to objects, filled, and the steep pixels of these, (H, W) of 0 and 1."""
    filled = np.zeros(steps.steep.shape, np.uint8)
    edges = np.zeros_like(filled)
    # Contours in place of labels: the components are the same, and an image has few steep pixels. The first
    # level are outer contours, of components inside the holes of others too.
    outlines, levels = cv2.findContours(steps.steep, cv2.RETR_CCOMP, cv2.CHAIN_APPROX_NONE)
    blobs = []
    for row, outline in enumerate(outlines):
        left, top, width, height = cv2.boundingRect(outline)
        if levels[0, row, 3] >= 0 or width * height < thresholds.smallest_area:
            continue
        here = slice(top, top + height), slice(left, left + width)
        _, labels = cv2.connectedComponents(steps.steep[here], connectivity=8, ltype=cv2.CV_16U)
        u, v = outline[0, 0]
        blob = (labels == labels[v - top, u - left]).astype(np.uint8)
        if thresholds.area_of == "filled" or _size_fits(int(blob.sum()), thresholds):
            blobs.append((outline, (left, top, width, height), here, blob))
    if thresholds.nested == "boxes" and blobs:
        nested = nested_in_boxes(np.array([box for _, box, _, _ in blobs]))
        blobs = [blob for blob, inside in zip(blobs, nested, strict=True) if not inside]
    for outline, _, here, blob in blobs:
        edges[here] |= blob
        cv2.drawContours(filled, [outline], 0, 1, cv2.FILLED)
    if thresholds.close_at_border and blobs:
        _close_at_border(filled, edges, steps.smoothed, warm=thresholds.warm)
    return filled, edges


def _close_at_border(
    filled: NDArray[np.uint8], edges: NDArray[np.uint8], smoothed: NDArray[Any], *, warm: bool
) -> None:
    """Fill, in place, what open contours cut off at the border of the image, where it is on the warm side.

    The pixels of a contour lie on the slope between sea and object, so their mean is between the two: what
    is brighter than the contour it touches is inside.
    """
    rows, columns = filled.shape
    rim = np.ones_like(filled)
    rim[AT_BORDER:-AT_BORDER, AT_BORDER:-AT_BORDER] = 0
    if not (filled & rim).any():
        return
    count, regions, stats, _ = cv2.connectedComponentsWithStats(1 - filled, connectivity=4, ltype=cv2.CV_16U)
    for number in range(1, count):
        left, top, width, height, _ = stats[number]
        if left > 0 and top > 0 and left + width < columns and top + height < rows:
            continue
        here = (
            slice(max(top - 1, 0), min(top + height + 1, rows)),
            slice(max(left - 1, 0), min(left + width + 1, columns)),
        )
        region = (regions[here] == number).astype(np.uint8)
        contour = np.asarray(cv2.dilate(region, _AROUND), np.uint8) & edges[here]
        if not contour.any():
            continue
        inside = cv2.mean(smoothed[here], region)[0] - cv2.mean(smoothed[here], contour)[0]
        if (inside > 0) == warm and inside != 0:
            filled[here] |= region


def _described(
    image: NDArray[Any],
    steps: Steps,
    edges: NDArray[np.uint8],
    objects: list[_Region],
    labels: NDArray[np.int32],
    thresholds: FloatingThresholds,
) -> Detections:
    """Features of the objects, in their order."""
    if not objects:
        return no_detections()
    score = [
        cv2.mean(steps.gradient[here], mask & edges[here])[0] / thresholds.gradient
        for _, here, mask, _ in objects
    ]
    found = describe(
        labels, image, np.ones(labels.shape, bool), contrast=steps.gradient, part=0.0, score=score
    )
    covariance = [
        centre_covariance(
            area, axes, angle, boundary_spread(outline, uv), cut_sides(np.array(box), image.shape),
            thresholds.smoothing_sd,
        )
        for area, axes, angle, uv, (box, _, _, outline) in zip(
            found.area, found.axes, found.orientation, found.uv, objects, strict=True
        )
    ]  # fmt: skip
    boxes = np.array([one.box for one in objects], float)
    return replace(found, covariance=np.array(covariance), box=boxes)


#: What H prints of the detector's numbers; the others it leaves open.
PUBLISHED = ("gradient", "smallest_area")


@dataclass(frozen=True)
class FloatingThresholds:
    """Thresholds of the seven steps of H 4.3; `PUBLISHED` says which are its own.

    Attributes
    ----------
    gradient
        T_g of (4.4), of 255.
    smallest_area, largest_area
        Of a blob, px^2; None is no limit.
    smoothing_size, smoothing_sd
        Of the Gaussian kernel (4.1), px; the size is odd.
    scaling
        How 14 bits become 8: ``"fixed"``, 256 grey levels over ``smallest_range_k``, from the
        ``stretched_share`` of an image's darkest pixels on; ``"stretched"``, from there to that share of its
        brightest, over ``smallest_range_k`` at least. Grey levels stay as they are.
    gradient_gain
        Factor before (4.3).
    area_of
        What the limits are for: the blob of steep pixels (``"edges"``, a ring if the inside is even), or the
        blob once it is filled (``"filled"``).
    nested
        What is removed as a part of something larger: a blob whose box is inside another's (``"boxes"``), or
        only one that is inside another's contour (``"contours"``).
    close_at_border
        Whether what lies between an open contour and the border of the image is filled.
    warm
        Whether objects are brighter than the sea; needed for that filling only.
    """

    gradient: float = 230.0
    smallest_area: float = 50.0
    largest_area: float | None = None
    smoothing_size: int = 5
    smoothing_sd: float = 1.1
    scaling: Literal["fixed", "stretched"] = "fixed"
    stretched_share: float = 0.01
    smallest_range_k: float = 4.0
    counts_per_kelvin: float = 25.0
    gradient_gain: float = 1.0
    area_of: Literal["edges", "filled"] = "edges"
    nested: Literal["boxes", "contours"] = "boxes"
    close_at_border: bool = True
    warm: bool = True

    def __post_init__(self) -> None:
        positive = ("smallest_area", "smoothing_sd", "smallest_range_k", "counts_per_kelvin", "gradient_gain")
        above_zero(**{name: getattr(self, name) for name in positive})
        largest = np.inf if self.largest_area is None else self.largest_area
        limits: tuple[tuple[str, bool, str], ...] = (
            ("gradient", 0 < self.gradient <= 255, "give one above 0, up to 255"),
            ("stretched_share", 0 <= self.stretched_share < 0.5, "give a share from 0 to below 0.5"),
            ("largest_area", largest >= self.smallest_area, "give no less than smallest_area, or None"),
            (
                "smoothing_size",
                self.smoothing_size > 0 and self.smoothing_size % 2 == 1,
                "give an odd number",
            ),
        )
        for field, fine, fix in limits:
            if not fine:
                raise WildlabError(f"{field} is {getattr(self, field)!r}", fix, field=field)
