"""Something of one colour in a colour image, as a blue tarpaulin on the ground (H 4.4.2)."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from wildlab.detection.detections import Detections, describe, no_detections
from wildlab.errors import WildlabError
from wildlab.geometry.frames import Array, Mask

#: Regions that are described at most, the largest first: an image full of them shows nothing that is wanted.
MOST_REGIONS = 1000


@dataclass(frozen=True)
class Colour:
    """Thresholds of H 4.4.2; all but `part` are printed there, for a blue tarpaulin.

    Attributes
    ----------
    width_px
        An image wider than this is reduced to it; H's images become 640 x 360.
    hue
        Least and most, 0 to 180 as OpenCV has it; where the first is larger, through 0 (red).
    saturation, value
        Least and most, 0 to 1.
    smallest_px
        Area of a region, px^2 of the reduced image.
    only_largest
        Whether one region is wanted, the largest.
    border_px
        How far the centre is from the left and right, and from the upper and lower border at least, px of the
        reduced image: the horizon is blue, too.
    part
        Standard deviation of the centre of the thing about that of what is seen of it, over its length:
        strict limits leave its weakly coloured rim out. Chosen.
    """

    width_px: int = 640
    hue: tuple[float, float] = (100.0, 110.0)
    saturation: tuple[float, float] = (0.75, 1.0)
    value: tuple[float, float] = (0.75, 1.0)
    smallest_px: float = 50.0
    only_largest: bool = True
    border_px: tuple[float, float] = (30.0, 60.0)
    part: float = 0.05

    def __post_init__(self) -> None:
        for name, (low, high), most in (
            ("saturation", self.saturation, 1.0),
            ("value", self.value, 1.0),
            ("hue", (min(self.hue), max(self.hue)), 180.0),
        ):
            if not 0 <= low <= high <= most:
                raise WildlabError(
                    f"the limits of {name} are {getattr(self, name)}", f"give two from 0 to {most:g}"
                )
        if self.width_px < 1 or not self.smallest_px > 0 or min(self.border_px) < 0 or self.part < 0:
            raise WildlabError("a length or an area is below zero, or the width is", "give one above zero")


def find_coloured(image: NDArray[Any], valid: Mask, thresholds: Colour | None = None) -> Detections:
    """Regions of one colour.

    Parameters
    ----------
    image
        (H, W, 3) uint8: red, green, blue.
    valid
        (H, W) bool: where there is a scene.
    thresholds
        None takes those of H 4.4.2.

    Returns
    -------
    Detections
        In pixels of the whole image, the largest first; the intensity is the mean value, 0 to 255, the score
        the area.

    Raises
    ------
    WildlabError
        Where the image has no colours.

    Examples
    --------
    >>> image = np.full((360, 640, 3), 120, np.uint8)
    >>> image[200:210, 300:330] = (0, 110, 255)
    >>> find_coloured(image, np.ones((360, 640), bool)).uv.tolist()
    [[314.5, 204.5]]
    """
    t = thresholds or Colour()
    if image.ndim != 3 or image.shape[2] != 3 or image.dtype != np.uint8:
        raise WildlabError(
            "the image has no colours", "take a method for thermal images: contrast, warm or floating"
        )
    scale = max(1.0, image.shape[1] / t.width_px)
    size = (round(image.shape[1] / scale), max(1, round(image.shape[0] / scale)))
    small = image if scale == 1.0 else cv2.resize(image, size, interpolation=cv2.INTER_AREA)
    scene = np.asarray(cv2.resize(valid.astype(np.uint8), size, interpolation=cv2.INTER_NEAREST), bool)
    hsv = cv2.cvtColor(np.asarray(small, np.uint8), cv2.COLOR_RGB2HSV)
    wanted = coloured(np.asarray(hsv), t) & scene
    labels, areas = _regions(wanted.astype(np.uint8), t)
    if not len(areas):
        return no_detections()
    found = describe(labels, np.asarray(hsv[..., 2]), scene, part=t.part, score=areas)
    height, width = wanted.shape
    across, down = t.border_px
    u, v = found.uv.T
    inside = (u >= across) & (u <= width - 1 - across) & (v >= down) & (v <= height - 1 - down)
    return _enlarged(found.select(inside), scale)


def coloured(hsv: NDArray[np.uint8], t: Colour) -> Mask:
    """Which pixels lie within the limits.

    Parameters
    ----------
    hsv
        (H, W, 3) as OpenCV has it: hue 0 to 180, saturation and value 0 to 255.
    t
        Thresholds.

    Returns
    -------
    (H, W) bool
    """
    hue = hsv[..., 0].astype(float)
    low, high = t.hue
    good = (hue >= low) & (hue <= high) if low <= high else (hue >= low) | (hue <= high)
    for channel, (low, high) in ((1, t.saturation), (2, t.value)):
        share = hsv[..., channel] / 255.0
        good &= (share >= low) & (share <= high)
    return np.asarray(good)


def _regions(wanted: NDArray[np.uint8], t: Colour) -> tuple[NDArray[np.int32], Array]:
    """Labels (H, W) of what lies inside outer contours of sufficient area, the largest first, and areas."""
    outlines, _ = cv2.findContours(wanted, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)
    areas = []
    for outline in outlines:
        left, top, width, height = cv2.boundingRect(outline)
        mask = np.zeros((height, width), np.uint8)
        cv2.drawContours(mask, [outline], 0, 1, cv2.FILLED, offset=(-left, -top))
        areas.append(int(mask.sum()))
    order = [row for row in np.argsort(areas, kind="stable")[::-1] if areas[row] >= t.smallest_px]
    order = order[: 1 if t.only_largest else MOST_REGIONS]
    labels = np.zeros(wanted.shape, np.int32)
    for number, row in enumerate(order, start=1):
        cv2.drawContours(labels, outlines, int(row), number, cv2.FILLED)
    return labels, np.array([areas[row] for row in order], float)


def _enlarged(found: Detections, scale: float) -> Detections:
    """Detections of a reduced image in pixels of the whole one; the middle of the first pixel is (0, 0)."""
    if scale == 1.0:
        return found
    box = found.box * scale
    box[:, :2] += (scale - 1) / 2
    return replace(
        found,
        uv=(found.uv + 0.5) * scale - 0.5,
        covariance=found.covariance * scale**2,
        area=found.area * scale**2,
        box=box,
        axes=found.axes * scale,
        score=found.score * scale**2,
    )
