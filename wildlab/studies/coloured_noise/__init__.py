"""Noise that is correlated in time, in the target's motion or in its measurements: H 7.2, 7.5.1, 7.5.2."""

from __future__ import annotations

from wildlab.studies.coloured_noise import trial
from wildlab.studies.linear_vs_nonlinear import track_metric
from wildlab.studies.protocol import Study

STUDY = Study(
    "coloured-noise", (*trial.SUBJECTS, "measurements"), trial.trial, trial.check_claims, track_metric
)
