"""Two vessels that cross, told apart by their images: H 6.4.4."""

from __future__ import annotations

from wildlab.studies.crossing_vessels import trial
from wildlab.studies.crossing_vessels.claims import check_claims
from wildlab.studies.crossing_vessels.trial import joint
from wildlab.studies.crossing_vessels.trial import reacquisition as again
from wildlab.studies.protocol import Metric, Study


def _metric(subject: str, name: str) -> Metric | None:
    unit = trial.UNITS.get(name)
    return None if unit is None else Metric(name, subject, unit)


STUDY = Study(
    "crossing-vessels",
    (
        *trial.SUBJECTS,
        joint.JOINT,
        trial.LOOKS,
        *map(trial.curve_subject, trial.SEPARATIONS),
        *again.WAYS,
    ),
    trial.trial,
    check_claims,
    _metric,
)
