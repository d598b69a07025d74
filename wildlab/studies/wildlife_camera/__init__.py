"""The lens of the wildlife camera, its approximate inverse, and what was assumed zero: F 2.3.6, 2.4, 7.1."""

from __future__ import annotations

from wildlab.studies.protocol import Study

STUDY = Study("wildlife-camera", ("tau2", "tau2-data-sheet", "inverse"))
