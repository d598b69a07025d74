"""What a detector gives: one row for each thing that it found in one image."""

from __future__ import annotations

from dataclasses import dataclass

from wildlab.geometry.frames import Array


@dataclass(frozen=True)
class Detections:
    """N things found in one image; pixels to the right (u) and down (v).

    Attributes
    ----------
    uv
        (N, 2) centre, px.
    covariance
        (N, 2, 2) of that centre, px^2.
    area
        (N,) px^2.
    intensity
        (N,) mean of the pixels, in the image's unit.
    box
        (N, 4) left, top, width, height, px.
    axes
        (N, 2) full length of the major and the minor axis, px.
    orientation
        (N,) of the major axis, from u towards v, rad.
    hu
        (N, 7) Hu's moment invariants.
    score
        (N,) the detector's own measure; larger is surer.
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
