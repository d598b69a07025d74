"""Within which bounds NEES and NIS of a consistent filter lie: H 3.5, example 3.1."""

from __future__ import annotations

import math

from wildlab.studies.page import Facts
from wildlab.studies.protocol import Study

#: An overconfident filter is inside the limits less often than an honest one by more than this.
APART = 0.1


def answer(facts: Facts) -> list[str]:
    """Whether the limits hold an honest filter's errors, then whether they show an overconfident one."""
    honest, overconfident = (
        facts.value(f"{who}/nees-1-run", "share_inside") for who in ("honest", "overconfident")
    )
    if math.isnan(honest + overconfident):
        return ["unknown"]
    return [
        "honest-inside" if facts.holds("nees-1-run") else "honest-otherwise",
        "overconfident-outside" if honest - overconfident > APART else "overconfident-inside",
    ]


STUDY = Study("consistency-bounds", ("nees-1-run", "nis-1-run", "nis-50-runs"), answer=answer)
