"""The lens of the wildlife camera, its approximate inverse, and what was assumed zero: F 2.3.6, 2.4, 7.1."""

from __future__ import annotations

import math

from wildlab.studies.page import Facts
from wildlab.studies.protocol import Study

#: Focal lengths that fit a video by so many per cent are those of its pictures.
FITS_PERCENT = 2.0
#: A direction that is off by so many pixels is not noticed beside the error of a detection.
UNNOTICED_PX = 0.5


def answer(facts: Facts) -> list[str]:
    """Which video the published focal lengths are of, and whether the approximate inverse can be used."""
    off, error = facts.value("tau2-data-sheet", "best_video_off"), facts.value("inverse", "largest_error")
    if math.isnan(off + error):
        return ["video-unknown", "inverse-unknown"]
    return [
        "video-fits" if off < FITS_PERCENT else "video-open",
        "inverse-unnoticed" if error < UNNOTICED_PX else "inverse-rim",
    ]


STUDY = Study("wildlife-camera", ("tau2", "tau2-data-sheet", "inverse"), answer=answer)
