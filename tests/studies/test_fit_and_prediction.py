"""What a twin was fitted to is no test of it."""

from __future__ import annotations

import pandas as pd
import pytest

from wildlab.reporting.published import load_published, published_rows
from wildlab.runner.catalogue import load_studies
from wildlab.simulation.parameters import each_parameter, fitted_to, load_twin, twin_names
from wildlab.studies.page import fit_words


def test_tables_are_parted_once_each_in_their_order():
    rows = [("H table 5.5", ""), ("H table 5.4", "a"), ("H table 5.5", "b"), ("F table 1.1", "")]
    told = fit_words(pd.DataFrame(rows, columns=["source", "fitted"]), load_twin("slow-vessel"))
    assert told.endswith(
        "1 of 2 numbers beside H table 5.5 are no test: b. "
        "What stands beside H table 5.4 is no test: a. What stands beside F table 1.1 is a prediction."
    )


@pytest.mark.parametrize("name", [name for name in twin_names() if load_twin(name).camera_sway])
def test_what_was_fitted_was_fitted_to_tables_5_4_and_7_4_alone(name):
    twin = load_twin(name)
    assert fitted_to(twin) == ("H table 5.4", "H table 7.4")
    groups = {group for group, _, p in each_parameter(twin) if p.status == "fitted"}
    assert groups == {"boresight", "camera_sway"}


def test_the_names_of_tables_are_those_of_the_published_numbers():
    typed = {
        source
        for study in ("static-point", "coloured-noise-drifting")
        for source in load_published(study)["source"]
    }
    assert set(fitted_to("slow-vessel")) <= typed
    assert "no test" not in fit_words(load_published("slow-vessel"), load_twin("slow-vessel"))


def test_numbers_of_tables_that_a_twin_was_fitted_to_are_not_judged():
    """What is typed with the published numbers is what the twins' parameters say."""
    for entry in load_studies().values():
        if entry.twin is None:
            continue
        tables = set(fitted_to(load_twin(entry.twin)))
        for row in published_rows(entry.name):
            told = "camera was fitted" in row["fitted"]
            assert told == (row["source"] in tables), (entry.name, row["name"], row["subject"])
