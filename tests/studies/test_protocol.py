"""Every case offers what the protocol of studies asks for, and what published tables and claims need."""

from __future__ import annotations

import inspect

import pytest

from wildlab.messages.catalogue import load_texts
from wildlab.reporting.published import load_published
from wildlab.runner.catalogue import StudyEntry, load_studies
from wildlab.studies.protocol import Study, case_names, find_case

STUDIES = load_studies()
CASES = {case: find_case(case) for case in case_names()}


def shown_by(case: str) -> list[StudyEntry]:
    return [entry for entry in STUDIES.values() if entry.case == case]


def test_every_study_names_a_case_and_every_case_is_shown():
    assert {entry.case for entry in STUDIES.values()} == set(CASES)
    assert {"schmidt", "navigation", "sensitivity", "autoferry"} <= set(CASES)


@pytest.mark.parametrize("case", CASES)
def test_a_case_is_what_it_says(case):
    study = CASES[case]
    assert isinstance(study, Study) and study.case == case
    given = shown_by(case)
    if study.trial is None:
        assert not study.rules.unit
        return
    found = inspect.signature(study.trial).parameters
    assert next(iter(found)) == "seed"
    rest = list(found.values())[1:]
    assert all(one.kind is one.KEYWORD_ONLY and one.default is one.empty for one in rest)
    for entry in given:
        if entry.seeds is not None:
            assert entry.shown_case() == study
            assert set(study.parameters) - {"twin"} <= set(entry.parameters) and entry.twin is not None


@pytest.mark.parametrize("name", [name for name in STUDIES if name not in ("sensitivity", "survey-markers")])
def test_published_numbers_have_subjects_that_the_page_has_words_for(name):
    subjects = load_texts(STUDIES[name].case).subjects
    assert set(load_published(name)["subject"]) <= set(subjects)
