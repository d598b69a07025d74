"""How far a wrong pose moves a georeferenced point: H 5.3.1, F 2.3.1."""

from __future__ import annotations

from wildlab.studies.protocol import Study

STUDY = Study("sensitivity", ("level", "turn", "ascent"))
