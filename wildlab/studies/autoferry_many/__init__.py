"""All boats of a harbour at once, clutter left in: many targets on public data (H 3.3, 3.4, 8.2)."""

from __future__ import annotations

import math

from wildlab.studies.page import Facts
from wildlab.studies.protocol import Study

#: Where nothing was tuned, by lidar and radar together.
_BOTH = "elsewhere/both"


def answer(facts: Facts) -> list[str]:
    """How often tracks change their boat, then how Stone Soup compares: by ranges over the best draws."""
    swaps = [
        facts.value(who, name) for name, who in facts.recorded if name == "swaps" and who.endswith("/both")
    ]
    known = not math.isnan(facts.value(_BOTH, "gospa_median"))
    return [
        "boats-unknown" if not known else "boats-swapped" if sum(swaps) else "boats-tracked",
        f"peer-{_peer(facts)}",
    ]


def _peer(facts: Facts) -> str:
    ours, theirs = (
        tuple(facts.value(_BOTH, name, end) for end in ("low", "high"))
        for name in ("gospa_median", "gospa_median_stone_soup")
    )
    if any(math.isnan(one) for one in (*ours, *theirs)):
        return "missing"
    return "worse" if ours[1] < theirs[0] else "better" if ours[0] > theirs[1] else "alike"


STUDY = Study("autoferry-many", (), answer=answer)
