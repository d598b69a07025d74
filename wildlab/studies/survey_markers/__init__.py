"""Positions read from single photos against surveyed markers: the question of H 5.6.1 on public flights."""

from __future__ import annotations

from wildlab.studies.protocol import Study

STUDY = Study("survey-markers")
