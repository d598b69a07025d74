"""All boats of a harbour at once, clutter left in: many targets on public data (H 3.3, 3.4, 8.2)."""

from __future__ import annotations

from wildlab.studies.protocol import Study

STUDY = Study("autoferry-many", ())
