"""All boats of a harbour at once, clutter left in: many targets on public data (H 3.3, 3.4, 8.2)."""

from __future__ import annotations

import math

from wildlab.studies.page import Facts
from wildlab.studies.protocol import Study

#: Where nothing was tuned, by lidar and radar together.
_BOTH = "elsewhere/both"
#: Boats that have a track in so many of the scans (%) are followed nearly all the time, or most of it.
NEARLY_ALL, MOST = 90.0, 50.0


def answer(facts: Facts) -> list[str]:
    """How much boats are tracked and how often their tracks change, then how Stone Soup compares."""
    ahead = facts.value(_BOTH, "scenarios_ahead")
    return [f"boats-{_boats(facts)}", "peer-missing" if math.isnan(ahead) else "peer-compared"]


def _boats(facts: Facts) -> str:
    tracked, changes = (facts.value(_BOTH, name) for name in ("tracked_median", "track_changes"))
    if math.isnan(tracked + changes):
        return "unknown"
    if tracked < MOST:
        return "lost"
    return "tracked" if tracked >= NEARLY_ALL and not changes else "partly"


STUDY = Study("autoferry-many", (), answer=answer)
