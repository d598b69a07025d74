"""What the detector finds of the two vessels in rendered frames, and whose each detection is."""

from __future__ import annotations

from collections.abc import Iterable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from wildlab.analysis.rendered import Shot
from wildlab.detection.centres import cut_sides
from wildlab.studies.crossing_vessels.trial.crossing import BOATS, NONE

Array = NDArray[np.float64]
Index = NDArray[np.int64]
Bools = NDArray[np.bool_]

#: A vessel of which so much is in view is whole.
WHOLE = 1 - 1e-9


class Spotted(NamedTuple):
    """What the detector made of F frames: D detections, and what there was to see.

    Attributes
    ----------
    frames
        (F,) exposures that were looked at.
    exposure
        (D,) exposure of each detection.
    uv, area, intensity, hu
        (D, 2) px, (D,) px^2, (D,) counts and (D,), Hu's first moment.
    boat
        (D,) whose each is; `NONE` where it is of nothing.
    both
        (D,) whether the other vessel lies in it too, and has no detection of its own.
    cut
        (D,) whether its box touches the border of the image.
    share
        (F, 2) of each vessel's outline in view.
    found, joined
        (F, 2) whether a vessel was detected on its own, and whether it lies in the other's detection.
    """

    frames: Index
    exposure: Index
    uv: Array
    area: Array
    intensity: Array
    hu: Array
    boat: Index
    both: Bools
    cut: Bools
    share: Array
    found: Bools
    joined: Bools

    def of(self, rows: Bools) -> Spotted:
        """With some of the detections, (D,) bool."""
        names = ("exposure", "uv", "area", "intensity", "hu", "boat", "both", "cut")
        return self._replace(**{name: getattr(self, name)[rows] for name in names})


class Counted(NamedTuple):
    """How the detector did, over some frames.

    Attributes
    ----------
    frames, false
        How many, and detections of nothing in them.
    whole, found, joined
        Times that a vessel was whole in view; of these detected on its own; and in one with the other.
    """

    frames: int
    false: int
    whole: int
    found: int
    joined: int

    @property
    def missed(self) -> int:
        """Times that a vessel was whole in view and in no detection."""
        return self.whole - self.found - self.joined


def spot(shots: Iterable[Shot], shape: tuple[int, int]) -> Spotted:
    """The detections in images of the two, with whose each is.

    Parameters
    ----------
    shots
        From `Photographer.shoot`; the vessels are numbered as in `BOATS`.
    shape
        Rows and columns of an image.

    Returns
    -------
    Spotted
    """
    taken = list(shots)
    n = len(taken)
    share, found, joined = np.zeros((n, 2)), np.zeros((n, 2), bool), np.zeros((n, 2), bool)
    boat, both = [np.zeros(0, np.int64)], [np.zeros(0, bool)]
    for k, shot in enumerate(taken):
        whose, with_other = np.full(len(shot.detections), NONE), np.zeros(len(shot.detections), bool)
        for seen in shot.seen:
            share[k, seen.number - 1] = seen.share
        for number, rows in shot.judged.found.items():
            whose[rows], found[k, number - 1] = number - 1, bool(rows)
        for number in shot.judged.merged:
            joined[k, number - 1] = True
            # It lies in the largest detection of the only other one.
            with_other[shot.judged.found[len(BOATS) + 1 - number][:1]] = True
        boat.append(whose)
        both.append(with_other)
    all_of = [shot.detections for shot in taken]
    return Spotted(
        frames=np.array([shot.exposure for shot in taken], np.int64),
        exposure=np.repeat([shot.exposure for shot in taken], [len(one) for one in all_of]).astype(np.int64),
        uv=np.concatenate([np.zeros((0, 2)), *(one.uv for one in all_of)]),
        area=np.concatenate([np.zeros(0), *(one.area for one in all_of)]),
        intensity=np.concatenate([np.zeros(0), *(one.intensity for one in all_of)]),
        hu=np.concatenate([np.zeros(0), *(one.hu[:, 0] for one in all_of)]),
        boat=np.concatenate(boat),
        both=np.concatenate(both),
        cut=np.array([cut_sides(box, shape).any() for one in all_of for box in one.box], bool),
        share=share,
        found=found,
        joined=joined,
    )


def count(spotted: Spotted) -> Counted:
    """How often what is in view was detected, and how often nothing was."""
    whole = spotted.share >= WHOLE
    return Counted(
        frames=len(spotted.frames),
        false=int((spotted.boat == NONE).sum()),
        whole=int(whole.sum()),
        found=int((whole & spotted.found).sum()),
        joined=int((whole & spotted.joined).sum()),
    )
