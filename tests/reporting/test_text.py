"""Text is escaped, marks are few, and numbers look as a reader wants them."""

from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from wildlab.errors import WildlabError
from wildlab.reporting.text import escape, inline, known, maths, number, percent, percent_between, prose, slug


@given(st.text())
def test_whatever_the_text_no_element_comes_out_of_it(text: str) -> None:
    shown = inline(text)
    for mark in ("<b>", "</b>", "<code>", '<code class="short">', "</code>"):
        shown = shown.replace(mark, "")
    assert "<" not in shown and ">" not in shown and '"' not in shown and "'" not in shown
    assert "<" not in escape(text) and "\x00" not in escape(text)


def test_marks() -> None:
    assert inline("**2 m**, see `a<b`") == '<b>2 m</b>, see <code class="short">a&lt;b</code>'


def test_prose_has_paragraphs_and_maths_but_no_html() -> None:
    shown = prose("One <i>.\n\nTwo $x_k$ and\n\n$$P^{-1}$$\n\nThree costs \\$5.")
    assert shown.startswith("<p>One &lt;i&gt;.</p><p>Two <math")
    assert shown.count("<math") == 2 and "costs $5." in shown and "<p></p>" not in shown


@pytest.mark.parametrize(
    "latex", [r"x^", r"\left( x", r"\nosuchcommand{x}", r"\text{<script>}", r"\text{a < b}"]
)
def test_maths_that_cannot_be_shown_is_refused(latex: str) -> None:
    with pytest.raises(WildlabError, match="formula"):
        maths(latex)


@pytest.mark.parametrize(
    ("value", "digits", "shown"),
    [
        (2.345, 1, "2.3"),
        (-0.004, 2, "0.00"),
        (-1.5, 1, "−1.5"),
        (math.nan, 2, "–"),
        (None, None, "–"),
        (math.inf, 1, "∞"),
        (0.0123456, None, "0.0123"),
        (1234.5, None, "1234"),
        (3e-9, None, "3.00e−09"),
        ("nonsense", 2, "–"),
    ],
)
def test_numbers(value: object, digits: int | None, shown: str) -> None:
    assert number(value, digits) == shown


def test_slug() -> None:
    assert slug("What most limits it?") == "what-most-limits-it"
    assert slug("<>") == "part"


@given(st.floats(1e-8, 1 - 1e-8), st.integers(0, 2))
def test_a_share_is_rounded_by_less_than_itself_and_never_to_all_or_none(share: float, digits: int) -> None:
    shown = float(percent(share, digits).removesuffix(" %")) / 100
    assert 0 < shown < 1
    assert abs(shown - share) <= max(0.5 * 10.0 ** -(digits + 2), min(share, 1 - share)) + 1e-12


def test_what_is_not_known_is_not_said() -> None:
    assert percent(0.004, 0) == "0.4 %"
    for words in (percent(math.nan), percent(math.inf), percent_between([math.nan] * 3), f"{math.nan:.1f} m"):
        assert known(words) == "" and known(f"Two. It is {words} off; 3 m are left. H (5.1) is kept.") == (
            "Two. H (5.1) is kept."
        )
    for said in ("Tirza Nan-Ek and nana-nan5", "", "It is 3.1 m."):
        assert known(said) == said
