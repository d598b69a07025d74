"""The camera and how it is mounted, from patterns and known points: H 2.5.1, 5.3.2, 5.6.1."""

from __future__ import annotations

import math

from wildlab.studies.page import Facts
from wildlab.studies.protocol import Study

#: A focal length known to less than this, px, and a mounting error below this from 350 m, m, are small.
WELL_PX, SMALL_M = 1.0, 1.0


def answer(facts: Facts) -> list[str]:
    """How well the camera is known, then what the mounting calibration leaves."""
    camera, mounting = facts.value("tau2", "sd_fx"), facts.value("mounting", "error_at_350_m")
    if math.isnan(camera + mounting):
        return ["unknown"]
    return [
        f"camera-{'well' if camera < WELL_PX else 'poorly'}",
        f"mounting-{'small' if mounting < SMALL_M else 'large'}",
    ]


STUDY = Study("camera-calibration", ("tau2", "data-sheet", "tau2-data-sheet", "mounting"), answer=answer)
