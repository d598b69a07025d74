"""Which numbers that H prints in two places, or of two things that hang together, fit together."""

from __future__ import annotations

from wildlab.studies.protocol import Study

STUDY = Study("printed-numbers", ())
