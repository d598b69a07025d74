"""What a twin was fitted to is no test of it, and the pages say so."""

from __future__ import annotations

import pytest

from wildlab.reporting.published import load_published, published_rows
from wildlab.runner.catalogue import load_studies
from wildlab.simulation.parameters import each_parameter, fitted_to, load_twin, twin_names
from wildlab.studies.fit_and_prediction import Apart, fit_words, tables_apart


def test_tables_are_parted_once_each_in_their_order():
    sources = ["H table 5.5", "H table 5.4", "H table 5.5", "F table 1.1"]
    assert tables_apart(sources, ["H table 5.4", "H table 7.4"]) == Apart(
        ("H table 5.4",), ("H table 5.5", "F table 1.1")
    )
    assert tables_apart([], ["H table 5.4"]) == Apart((), ())


def test_the_words_follow_the_tables():
    twin = load_twin("static-antenna")
    both = fit_words(["H table 5.4", "H table 5.5"], twin)
    assert "What stands beside H table 5.4 is therefore a fit, and no test." in both
    assert "What stands beside H table 5.5 is a prediction." in both
    assert "not known" in both
    none = fit_words(["H table 5.6"], twin)
    assert "no test" not in none
    assert "camera sway" in none
    only = fit_words(["H table 7.4"], twin)
    assert "prediction" not in only


def test_a_twin_without_fitted_parameters_says_so():
    assert fit_words(["H table 6.1"], "large-ship") == (
        "No parameter of this twin was fitted to a published table."
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
    predicted = tables_apart(load_published("slow-vessel")["source"], fitted_to("slow-vessel"))
    assert predicted == Apart((), ("H table 5.6", "H table 5.7"))


def test_numbers_of_tables_that_a_twin_was_fitted_to_are_not_judged() -> None:
    """What is typed with the published numbers is what the twins' parameters say."""
    for entry in load_studies().values():
        if entry.twin is None:
            continue
        tables = set(fitted_to(load_twin(entry.twin)))
        for row in published_rows(entry.name):
            told = "camera was fitted" in row["fitted"]
            assert told == (row["source"] in tables), (entry.name, row["name"], row["subject"])
