"""Sensors of a ferry and two boats with satellite positions: the filters of H 7.2 to 7.4 on public data."""

from __future__ import annotations

from wildlab.studies.protocol import Study

STUDY = Study("autoferry", ())
