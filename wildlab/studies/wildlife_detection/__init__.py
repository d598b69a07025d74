"""Finding warm animals on cold and on sun-heated ground: F 3, 7.4, 8.1, 8.4."""

from __future__ import annotations

from wildlab.studies.protocol import Metric, Study
from wildlab.studies.wildlife_detection import trial
from wildlab.studies.wildlife_detection.claims import check_claims


def _metric(subject: str, name: str) -> Metric | None:
    unit = trial.RECORDED.get(name)
    return None if unit is None else Metric(name, subject, unit)


STUDY = Study(
    "wildlife-detection", (*trial.SUBJECTS, "ground", "herd", "masks"), trial.trial, check_claims, _metric
)
