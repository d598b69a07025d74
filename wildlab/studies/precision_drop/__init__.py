"""Finding a tarpaulin by its colour, and the mean of many positions: H 4.4.2."""

from __future__ import annotations

from wildlab.studies.page import Facts
from wildlab.studies.precision_drop import trial
from wildlab.studies.protocol import Study, name_metrics


def answer(facts: Facts) -> list[str]:
    """Whether the mean of many positions is near enough, and whether it is nearer than a single one."""
    return [f"mean-{facts.outcome('within-a-few-metres')}", f"single-{facts.outcome('single-is-inaccurate')}"]


STUDY = Study(
    "precision-drop", trial.SUBJECTS, trial.trial, trial.check_claims, name_metrics(trial.RECORDED), answer
)
