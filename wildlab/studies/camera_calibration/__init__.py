"""The camera and how it is mounted, from patterns and known points: H 2.5.1, 5.3.2, 5.6.1."""

from __future__ import annotations

from wildlab.studies.protocol import Study

STUDY = Study("camera-calibration", ("tau2", "data-sheet", "tau2-data-sheet", "mounting"))
