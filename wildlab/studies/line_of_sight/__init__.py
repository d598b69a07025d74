"""What the camera can see over terrain, by F's two algorithms and exactly: F 2.5, 7.2."""

from __future__ import annotations

from wildlab.studies.line_of_sight import claims, trial
from wildlab.studies.line_of_sight.trial import ANGLES, HEIGHT, INCIDENCES, RAYS, TREES
from wildlab.studies.page import Facts
from wildlab.studies.protocol import Metric, Study

#: Names of the numbers that are recorded begin with these; and their units.
_UNITS = {
    "agreement": "1",
    "too_many": "1",
    "too_few": "1",
    "seen": "1",
    "steps": "1",
    "hidden": "1",
    "planted": "1",
    "covered": "1",
    "width": "m",
    "exponent": "1",
}


def _metric(subject: str, name: str) -> Metric | None:
    unit = _UNITS.get(name.rpartition("_")[0] or name)
    return None if unit is None else Metric(name, subject, unit)


def answer(facts: Facts) -> list[str]:
    """Which algorithm is nearer to the exact line of sight, then what trees would hide."""
    seen = f"agreement_{HEIGHT}m"
    slant, above = (f"hidden_{degrees}deg" for degrees in (INCIDENCES[-1], INCIDENCES[0]))
    return [
        f"rays-{facts.compare((RAYS, seen), (ANGLES, seen))}",
        f"trees-{facts.compare((TREES, slant), (TREES, above))}",
    ]


STUDY = Study("line-of-sight", trial.SUBJECTS, trial.trial, claims.check_claims, _metric, answer)
