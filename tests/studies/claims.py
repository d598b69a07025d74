"""What checks say of a study's claims, at the thresholds that are typed."""

from collections.abc import Mapping

from wildlab.evaluation.shares import Check
from wildlab.reporting.published import load_claims


def said(study: str, checks: Mapping[str, Check]) -> dict[str, list[bool]]:
    """Flight by flight, by the claim's id; each claim of the study has a check, and each check a claim."""
    typed = {claim["id"]: claim.get("threshold") for claim in load_claims(study) if "needs" not in claim}
    assert set(checks) == set(typed)
    return {name: check.holds(typed[name]).tolist() for name, check in checks.items()}


def turn(study: str, good: Mapping[str, Check], bad: Mapping[str, Check]) -> bool:
    """Whether every claim holds on all flights of the first, and on none of the second."""
    held, lost = said(study, good), said(study, bad)
    return all(all(one) for one in held.values()) and not any(any(one) for one in lost.values())
