"""What checks say of a study's claims, at the thresholds that are typed."""

from collections.abc import Mapping

import pandas as pd
from numpy.typing import ArrayLike

from wildlab.evaluation.shares import Check
from wildlab.reporting.published import load_claims
from wildlab.studies.protocol import find_case


def checks_of(case: str, runs: pd.DataFrame, more: Mapping[str, ArrayLike] | None = None) -> dict[str, Check]:
    """What flights give for the claims of a case; ``more`` numbers as a notebook has them."""
    return find_case(case).checks(runs, more)


def said(study: str, checks: Mapping[str, Check]) -> dict[str, list[bool]]:
    """Flight by flight, by the claim's id; each claim of the study has a check, and each check a claim."""
    typed = {claim["id"]: claim.get("threshold") for claim in load_claims(study) if "needs" not in claim}
    assert set(checks) == set(typed)
    return {name: check.holds(typed[name]).tolist() for name, check in checks.items()}


def turn(study: str, good: Mapping[str, Check], bad: Mapping[str, Check]) -> bool:
    """Whether every claim holds on all flights of the first, and on none of the second."""
    held, lost = said(study, good), said(study, bad)
    return all(all(one) for one in held.values()) and not any(any(one) for one in lost.values())
