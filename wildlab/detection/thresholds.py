"""What the detector of floating objects is told, and what of that H prints; the rest is chosen."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from wildlab.errors import WildlabError

#: What H prints of the detector's numbers, and where.
PUBLISHED = {
    "gradient": "H 4.4.1: 230 of 255",
    "smallest_area": "H 4.4.1: 50 pixels",
}
#: What H leaves open, and why it is as it is here.
CHOSEN = {
    "smoothing_size": "n of (4.1) is not printed; five pixels keep what is ten pixels wide",
    "smoothing_sd": "sigma_g of (4.1) is not printed; OpenCV's for a kernel of five pixels",
    "scaling": "how 14 bits become 8 is not printed; a fixed range shows an object alike beside any other",
    "stretched_share": "one pixel in a hundred may saturate at the dark end, as cameras do",
    "smallest_range_k": "an even sea must not become black and white; 50 mK of noise are three levels",
    "counts_per_kelvin": "the Tau 2's in its high gain; matters for images in counts only",
    "gradient_gain": "(4.3) has no factor before it",
    "clipping": "a gradient beyond 255 is 255; that an image's largest becomes 255 is the other reading",
    "largest_area": "H 4.3 removes blobs that are too large, and prints no limit",
    "area_of": "H removes small blobs before it fills them: what counts is the blob of steep pixels",
    "nested": "H 4.3 compares the boxes",
    "close_at_border": "what the border of the image cuts has an open contour, and figure 4.8 has it filled",
    "warm": "H 4.1: vessels are warmer than the sea",
}


@dataclass(frozen=True)
class FloatingThresholds:
    """Thresholds of the seven steps of H 4.3; `PUBLISHED` and `CHOSEN` say which are whose.

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
        brightest, over ``smallest_range_k`` at least; ``"counts"``, not at all: only the gradient of counts
        has 8 bits. Grey levels stay as they are.
    gradient_gain
        Factor before (4.3).
    clipping
        What lies beyond 255 in the gradient image: ``"saturated"``, or the image divided by its largest
        gradient (``"normalised"``).
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
    scaling: Literal["fixed", "stretched", "counts"] = "fixed"
    stretched_share: float = 0.01
    smallest_range_k: float = 4.0
    counts_per_kelvin: float = 25.0
    gradient_gain: float = 1.0
    clipping: Literal["saturated", "normalised"] = "saturated"
    area_of: Literal["edges", "filled"] = "edges"
    nested: Literal["boxes", "contours"] = "boxes"
    close_at_border: bool = True
    warm: bool = True

    def __post_init__(self) -> None:
        limits: tuple[tuple[str, bool, str], ...] = (
            ("gradient", 0 < self.gradient <= 255, "give one above 0, up to 255"),
            ("smallest_area", self.smallest_area > 0, "give an area above 0, in pixels"),
            (
                "largest_area",
                self.largest_area is None or self.largest_area >= self.smallest_area,
                "give one that is no smaller than smallest_area, or None",
            ),
            (
                "smoothing_size",
                self.smoothing_size > 0 and self.smoothing_size % 2 == 1,
                "give an odd number of pixels",
            ),
            ("smoothing_sd", self.smoothing_sd > 0, "give one above 0, in pixels"),
            ("stretched_share", 0 <= self.stretched_share < 0.5, "give a share from 0 to below 0.5"),
            ("smallest_range_k", self.smallest_range_k > 0, "give a range above 0, in kelvin"),
            ("counts_per_kelvin", self.counts_per_kelvin > 0, "give a number above 0"),
            ("gradient_gain", self.gradient_gain > 0, "give a factor above 0"),
            (
                "scaling",
                self.scaling in ("fixed", "stretched", "counts"),
                "use 'fixed', 'stretched' or 'counts'",
            ),
            ("clipping", self.clipping in ("saturated", "normalised"), "use 'saturated' or 'normalised'"),
            ("area_of", self.area_of in ("edges", "filled"), "use 'edges' or 'filled'"),
            ("nested", self.nested in ("boxes", "contours"), "use 'boxes' or 'contours'"),
        )
        for field, fine, fix in limits:
            if not fine:
                raise WildlabError(f"{field} is {getattr(self, field)!r}", fix, field=field)

    def at_height(self, height: float, reference: float) -> FloatingThresholds:
        """The same for another height, H 4.4.1: areas scaled by how large things look.

        A filled area goes with the squared scale of the image; a contour, which is as wide as the blur at
        every height, goes with the scale itself.

        Parameters
        ----------
        height
            Of the camera above the sea, m.
        reference
            Height for which these thresholds are, m.

        Returns
        -------
        FloatingThresholds

        Raises
        ------
        WildlabError
            Where a height is not above zero.

        Examples
        --------
        >>> FloatingThresholds(area_of="filled").at_height(200.0, 100.0).smallest_area
        12.5
        """
        if not (height > 0 and reference > 0 and np.isfinite(height) and np.isfinite(reference)):
            raise WildlabError(
                f"heights of {height} and {reference} m", "give both above zero, in metres", field="height"
            )
        factor = (reference / height) ** (2 if self.area_of == "filled" else 1)
        largest = None if self.largest_area is None else self.largest_area * factor
        return replace(self, smallest_area=self.smallest_area * factor, largest_area=largest)


@dataclass(frozen=True)
class CentreErrors:
    """How far a found centre may be from the true one: what `wildlab.detection.floating` states.

    The true centre is that of the object's whole outline in the image. The numbers were set on scenes of
    `wildlab.simulation.scene.drawn` with seeds that no test and no study uses: 1000 to 1499, 3000 to 3299.

    Attributes
    ----------
    floor
        Standard deviation that nothing falls below, px.
    edge
        Of where a piece of the contour lies, as a share of the blur.
    shape
        Share of the object's own spread by which parts that look different (houses, engines, wakes) move the
        centre.
    broken
        Share of the major axis by which the centre moves where the contour is not closed, and the blob is a
        line in place of an area.
    cut
        Share of the major axis by which the border of the image moves it, for the hidden part.
    adjusted
        Share of the major axis that is left of that once the centre was moved by H (4.7).
    """

    floor: float = 0.2
    edge: float = 0.1
    shape: float = 0.01
    broken: float = 0.2
    cut: float = 0.28
    adjusted: float = 0.1


#: Share of its ellipse that a blob fills below which it is not a filled one.
FILLED = 0.9
