"""Every case offers what the protocol of studies asks for, and what published tables and claims need."""

from __future__ import annotations

import inspect

import numpy as np
import pandas as pd
import pytest

from wildlab.evaluation.shares import Check
from wildlab.evaluation.whiteness import white_bound
from wildlab.pipeline.navigation_errors import TUNINGS
from wildlab.reporting.published import load_claims, load_published
from wildlab.runner.catalogue import StudyEntry, load_studies
from wildlab.studies.line_of_sight.timing import WAYS
from wildlab.studies.line_of_sight.trial import HEIGHTS, VIEW
from wildlab.studies.protocol import Study, case_names, find_case, run_trial

STUDIES = load_studies()
CASES = {case: find_case(case) for case in case_names()}
WITH_TRIAL = {case: study for case, study in CASES.items() if study.trial is not None}
#: What a notebook tells a case's claims besides the flights.
TOLD = {
    "line-of-sight": {
        "times": pd.DataFrame(
            1.0, index=range(3), columns=pd.MultiIndex.from_product([(*WAYS, VIEW), HEIGHTS])
        )
    },
    "static-point": {"bound": white_bound(551)},
    "navigation": {"tuned": next(iter(TUNINGS))},
    "information-planning": {"loads": np.full(3, 1e-3)},
    "wildlife-tracking": {"cost": np.full(3, 9.0)},
}


def shown_by(case: str) -> list[StudyEntry]:
    return [entry for entry in STUDIES.values() if entry.case == case]


def test_every_study_names_a_case_and_every_case_is_shown() -> None:
    assert {entry.case for entry in STUDIES.values()} == set(CASES)
    assert {"schmidt", "navigation", "sensitivity", "autoferry"} <= set(CASES)


@pytest.mark.parametrize("case", CASES)
def test_a_case_is_what_it_says(case: str) -> None:
    study = CASES[case]
    assert isinstance(study, Study) and study.case == case
    given = shown_by(case)
    if study.trial is None:
        assert study.check_claims is None and study.metric_of is None
        return
    found = inspect.signature(study.trial).parameters
    assert next(iter(found)) == "seed"
    rest = list(found.values())[1:]
    assert all(one.kind is one.KEYWORD_ONLY and one.default is one.empty for one in rest)
    for entry in given:
        if entry.seeds is not None:
            assert entry.shown_case() is study
            assert set(study.parameters) - {"twin"} <= set(entry.parameters) and entry.twin is not None


@pytest.mark.parametrize("case", CASES)
def test_published_numbers_have_the_subjects_of_their_case(case: str) -> None:
    subjects = CASES[case].subjects
    for entry in shown_by(case):
        for published in load_published(entry.name)["subject"]:
            assert any(published == one or published.startswith(f"{one}/") for one in subjects), published


@pytest.mark.slow
@pytest.mark.parametrize("case", WITH_TRIAL)
def test_a_trial_gives_what_metrics_and_claims_ask_for(case: str) -> None:
    study, entry = CASES[case], next(one for one in shown_by(case) if one.seeds is not None)
    few = {**entry.parameters, **entry.first_look, "twin": entry.twin}  # a trial's keys are the same of any
    given = {name: few[name] for name in study.parameters}
    values = run_trial(case, 2, given)
    assert values == run_trial(case, 2, given), "the same seed, the same numbers"
    keys = [tuple(key.split("/")) for key in values]
    assert study.metric_of is not None and study.check_claims is not None
    metrics = {(m.name, m.subject) for key in keys if (m := study.metric_of(*key)) is not None}
    printed = load_published(entry.name)
    assert set(zip(printed["name"], printed["subject"], strict=True)) <= metrics
    named = [study.metric_of(*key) for key in keys]
    assert len({m[:2] for m in named if m is not None}) == sum(m is not None for m in named), "named twice"
    spread = pd.DataFrame([dict(zip(keys, values.values(), strict=True))] * 3)
    given_checks = study.check_claims(spread, **TOLD.get(case, {}))
    checks = {claim: Check.of(check) for claim, check in given_checks.items()}
    assert {claim["id"] for claim in load_claims(entry.name)} <= set(checks)
    thresholds = {claim["id"]: claim.get("threshold") for claim in load_claims(entry.name)}
    for claim, check in checks.items():
        threshold = thresholds.get(claim, 1.0 if check.measured is not None else None)
        array = np.asarray(check.holds(None if threshold is None else float(threshold)))
        assert array.shape == (3,) and array.dtype == bool, claim
        for more in (check.premise, check.first, check.second):
            assert more is None or np.shape(more) == (3,), claim
        assert len(set(array.tolist())) == 1, "the same flight, the same verdict"
