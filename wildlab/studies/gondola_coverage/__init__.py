"""Four ways to move the camera of a gondola: F 5.4, 7.5.2, 8.2."""

from __future__ import annotations

import pandas as pd

from wildlab.studies.gondola_coverage import trial
from wildlab.studies.gondola_coverage.trial import ADAPT, DOWN, ROLL, STRATEGIES
from wildlab.studies.page import Facts
from wildlab.studies.protocol import Study

#: Quantities of the page's table.
TABLE = ("seen", "near", "ground", "share_outside", "in_sight")
#: The settings that are compared in words: of the thesis's limits the middle one.
PLAIN, ADAPTIVE = list(ROLL)[1], list(ADAPT)[1]


def with_share_outside(runs: pd.DataFrame) -> pd.DataFrame:
    """``runs`` with the share of the ground seen that lies outside the enclosures, as ``share_outside``."""
    more = runs.copy()
    for one in STRATEGIES:
        more[one, "share_outside"] = runs[one, "outside"] / runs[one, "ground"]
    return more


def answer(facts: Facts) -> list[str]:
    """What a swing adds to a camera that looks straight down, then what the adaptive swing adds to that."""
    swing = facts.compare((PLAIN, "seen"), (DOWN, "seen"))
    if "unknown" in (swing, facts.compare((ADAPTIVE, "seen"), (DOWN, "seen"))):
        return ["unknown"]
    inside, more = (facts.outcome(claim) for claim in ("adaptive-least-outside", "adaptive-sees-more"))
    seen = {"holds": "sees-more", "fails": "sees-no-more"}.get(more, "inside")
    return [
        f"roll-{swing if swing in ('more', 'less') else 'open'}",
        f"adaptive-{seen if inside == 'holds' else 'not-better'}",
    ]


STUDY = Study("gondola-coverage", trial.trial, trial.check_claims, trial.RECORDED.get, answer)
