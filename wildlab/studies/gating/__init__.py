"""Which of two measurements belongs to the target that is followed: H 6.3.2, 6.4.3."""

from __future__ import annotations

from wildlab.studies.gating.monte_carlo import FORMS
from wildlab.studies.protocol import Study

STUDY = Study("gating", FORMS)
