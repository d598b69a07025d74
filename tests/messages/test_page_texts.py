"""Texts of pages: what stands in the files, and how recorded numbers are put into them."""

from __future__ import annotations

import math
import re

import pytest
from hypothesis import given
from hypothesis import strategies as st

from wildlab.errors import WildlabError
from wildlab.messages.catalogue import FOLDER, fill, load_texts
from wildlab.messages.quantities import measure, percent_of, significant

PAGES = sorted(path.stem for path in FOLDER.glob("*.toml"))
MAE = {("mae", "ekf"): {"value": 9.81, "unit": "m", "low": 5.12, "high": 16.3, "n": 40}}


@given(st.floats(-1e6, 1e6, allow_nan=False))
def test_two_figures_are_within_half_of_the_last_one(value):
    shown = float(significant(value).replace("−", "-"))
    assert math.isclose(shown, value, rel_tol=0.0501, abs_tol=1e-300) or abs(value) >= 100
    if abs(value) >= 100:
        assert abs(shown - value) <= 0.5


@given(st.floats(0, 1))
def test_only_all_is_all_and_only_none_is_none(share):
    shown = float(percent_of(share).removesuffix(" %"))
    assert (shown == 100) == (1 - share < 1e-9) and (shown == 0) == (share < 1e-9)


def test_what_is_not_known_is_nan_in_every_form():
    nothing = {("mae", "ekf"): {"value": None, "unit": "m", "low": None, "high": None}}
    for form in ("", ":range", ":interval", ":percent", ":shares", ":number"):
        assert fill(f"{{ekf/mae{form}}}", nothing, {}).startswith("nan")
    assert measure(math.nan, "m").startswith("nan")


def test_numbers_and_values_are_put_in_once():
    values = {"flights": "{ekf/mae}", "factor": 2.96, "share": 0.937, "n": 1234}
    assert fill("{ekf/mae:range}; {ekf/mae:count}", MAE, {}) == "9.8 m (5.1 to 16); 40"
    # A value that looks like a placeholder stays what it is.
    assert fill("{flights}, {factor}, {share:percent}, {n}", MAE, values) == "{ekf/mae}, 3.0, 94 %, 1234"


@pytest.mark.parametrize(
    ("text", "error"),
    [("{ekf/nees}", WildlabError), ("{kf/mae}", WildlabError), ("{no}", KeyError), ("{ekf/mae:m}", KeyError)],
)
def test_a_number_that_was_never_recorded_is_a_fault(text, error):
    with pytest.raises(error):
        fill(text, MAE, {})


def test_a_text_that_is_not_there_is_named_with_its_file():
    with pytest.raises(WildlabError) as found:
        load_texts("schmidt").figures["nothing"]
    assert found.value.field == "figure.nothing" and "schmidt.toml" in str(found.value)


@pytest.mark.parametrize("page", PAGES)
def test_a_page_keeps_to_its_form(page):
    """At most two sentences of 60 words in the answer, 40 words a caption, five limits, four tiles."""
    texts = load_texts(page)
    for text in texts.answers.values():
        assert len(text.split()) <= 40
    for figure in texts.figures.values():
        assert figure.alt and len(figure.caption.split()) <= 40
    assert len(texts.limits) <= 5 and len(texts.tiles) <= 4
    assert all(len(limit.split()) <= 30 for limit in texts.limits)
    # A finding is a number of this run, and so a placeholder: what is written down asserts none.
    assert not re.search(r"\d+ (of|flights) ", " ".join(texts.answers.values()))
