"""Rules that are data: what they may say, what they give, and that nothing else is worked out."""

import numpy as np
import pandas as pd
import pytest

from wildlab.errors import WildlabError
from wildlab.flight.files import dump_toml
from wildlab.reporting.published import load_claims
from wildlab.runner.catalogue import load_studies
from wildlab.studies.page import Facts
from wildlab.studies.rules import Rules, StudyRules, load_rules

RUNS = pd.DataFrame({("a", "x"): [1.0, 2.0, 3.0], ("a", "y"): [2.0, 2.0, 1.0], ("b", "x"): [0.0, 5.0, 0.0]})


def checks_of(**rules):
    return StudyRules.model_validate({"check": rules}).checks(RUNS)


def test_rules_are_arithmetic_on_numbers():
    rules = Rules({"x": np.array([1.0, 4.0, np.nan])}.get, {"twice": "2 * 'x'", "three": 3})
    assert rules("sqrt('x') + twice ** 2 - three")[:2].tolist() == [2.0, 63.0]
    assert rules("1 < 'x' <= 4 and not finite('x') or 'x' == 1").tolist() == [True, False, False]
    assert rules("max('x', 2)").tolist()[:2] == [2.0, 4.0]
    assert rules("10 ** 19") == 1e19 and rules("2 ** -1") == 0.5


@pytest.mark.parametrize(
    "rule",
    [
        "__import__('os').system('true')", "open('x')", "'x'.real", "[1, 2]", "lambda: 1", "other", "1 +",
        "max('x', key=1)", "min()", "white_bound(1e400)", "(x := 1)", "'a' if 1 else 'b'", "1 << 2", "f'{1}'",
    ],
)  # fmt: skip
def test_nothing_else_is_worked_out(rule):
    with pytest.raises(WildlabError, match="cannot be worked out"):
        Rules({"x": np.ones(2)}.get, {})(rule)


@pytest.mark.parametrize(
    ("given", "named"),
    [
        ({"a": "a + 1"}, "a names a"),
        ({"a": "1", "b": "c", "c": "b"}, "b names c"),
        ({"a": "1 +"}, "a is no rule"),
        ({"a": "-" * 1000 + "1"}, "given.a"),
        ({f"a{k}": f"a{k - 1} + 1" if k else 1 for k in range(1000)}, "50"),
    ],
)
def test_names_that_never_end_are_refused_by_file_and_name(tmp_path, monkeypatch, given, named):
    path = tmp_path / "endless.toml"
    path.write_text(dump_toml({"given": given}))
    monkeypatch.setattr("wildlab.studies.FOLDERS", [tmp_path])
    with pytest.raises(WildlabError, match=named) as refused:
        load_rules("endless")
    assert refused.value.file == str(path) and str(refused.value.field).startswith("given")


def test_a_name_is_worked_out_once():
    asked = []
    given = {"a0": "'x'"} | {f"a{k}": f"a{k - 1} + a{k - 1}" for k in range(1, 49)}
    assert Rules(lambda key: asked.append(key) or 1.0, given)("a48") == 2.0**48 and asked == ["x"]


def test_of_several_pairs_the_closest_is_shown():
    check = checks_of(one={"larger": [["'a/x'", "'b/x'"], ["'a/x'", "'a/y'"]], "unit": "%"})["one"]
    assert check.holds().tolist() == [False, False, True]
    assert (check.first - check.second).tolist() == [-100.0, -300.0, 200.0]
    assert checks_of(one={"smaller": ["'a/x'", "'a/y'"]})["one"].holds().tolist() == [True, False, False]


def test_a_pattern_stands_for_all_that_fit_and_an_absent_number_for_no_check():
    found = checks_of(one={"measured": "max('*/x')"}, other={"measured": "'c/x'"})
    assert found["one"].measured.tolist() == [1.0, 5.0, 3.0] and "other" not in found


def test_a_sentence_is_the_first_whose_rule_is_true():
    rules = StudyRules.model_validate(
        {"answer": [{"none": "not finite('a/x')", "found-*": "outcome('c')"}, {"": "'a/x' > 1", "small": ""}]}
    )
    assert rules.answers(Facts({}, {})) == ["none", "small"]
    assert rules.answers(Facts({("x", "a"): {"value": 2.0}}, {"c": "holds"})) == ["found-holds"]


@pytest.mark.parametrize("name", [name for name, one in load_studies().items() if one.seeds])
def test_every_claim_on_simulated_flights_has_a_rule(name):
    rules = load_rules(load_studies()[name].case).check
    assert {claim["id"] for claim in load_claims(name) if "needs" not in claim} <= set(rules)
