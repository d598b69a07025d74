"""A target's velocity from optical flow: H 5.4, 5.6.3."""

from __future__ import annotations

from wildlab.studies.optical_flow_velocity import trial
from wildlab.studies.page import Facts
from wildlab.studies.protocol import Study, name_metrics


def answer(facts: Facts) -> list[str]:
    """How much the velocities of single pairs scatter, and whether poses or images cause it."""
    return [
        f"scatter-{facts.outcome('very-large-variance')}",
        f"own-motion-{facts.outcome('own-motion-dominates')}",
    ]


STUDY = Study(
    "optical-flow-velocity",
    trial.SUBJECTS,
    trial.trial,
    trial.check_claims,
    name_metrics(trial.RECORDED),
    answer,
)
