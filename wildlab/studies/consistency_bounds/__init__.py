"""Within which bounds NEES and NIS of an honest filter lie: H 3.5, example 3.1."""

from __future__ import annotations

from wildlab.studies.protocol import Study

STUDY = Study("consistency-bounds", ("nees-1-run", "nis-1-run", "nis-50-runs"))
