"""The order of a page: whatever order a notebook has, what a reader came for stands first."""

from __future__ import annotations

from itertools import permutations

import pytest
from bs4 import BeautifulSoup, Tag
from hypothesis import given
from hypothesis import strategies as st

from wildlab.reporting.arrange import ADVICE, LIMITS, METHOD, arranged
from wildlab.reporting.figures import new_figure
from wildlab.reporting.report import Report, open_report

IMAGE = '<img alt="a" src="data:image/png;base64,AA==">'


def shown(*parts: str) -> str:
    return arranged("\n".join(parts))


def order(html: str, *words: str) -> list[str]:
    """The words in the order in which they come."""
    return sorted(words, key=html.index)


def report() -> Report:
    return open_report(study="test", kind="computed")


PARTS = {
    "head": "<header><h1>head</h1></header>",
    "summary": '<section class="summary neutral"><p>summary</p></section>',
    "alert": '<section class="alert" data-part="alert"><p>alert</p></section>',
    "tiles": '<ul class="tiles"><li>tiles</li></ul>',
    "advice": f'<h2 data-part="{ADVICE}">advice</h2>\n<p>do this</p>',
    "limits": f'<h2 data-part="{LIMITS}">limits</h2>\n<ul><li>doubt</li></ul>',
    "numbers": f"<h2>numbers</h2>\n<p>before</p><figure>{IMAGE}<figcaption><b>Figure 1.</b> picture"
    "</figcaption></figure><p>after</p>",
    "method": f'<details class="method" data-part="{METHOD}"><summary>by</summary><p>thus</p></details>',
}


@given(st.permutations(list(PARTS)))
def test_any_order_of_the_parts_becomes_the_one(names: list[str]) -> None:
    html = shown(*(PARTS[name] for name in names))
    wanted = ["head</h1", "summary</p", "alert</p", "picture", "tiles</li", "advice", "do this"]
    wanted += ["limits", "doubt", "numbers</h2", "before", "after", "by</summary", "thus"]
    assert order(html, *wanted) == wanted
    # Nothing is lost, and nothing is said twice.
    assert all(html.count(word) == 1 for word in wanted) and "data-part" not in html


def test_the_marked_figure_is_the_main_one_and_figures_are_counted_as_they_stand() -> None:
    one = report()
    one.head("Title")
    one.section("Section")
    for name in ("a", "b", "c"):
        one.figure(new_figure()[0], name=name, alt=name, caption=f"Shows {name}.", main=name == "b")
    soup = BeautifulSoup(arranged("\n".join(one.parts)), "html.parser")
    captions = [caption.get_text() for caption in soup.find_all("figcaption")]
    assert captions == ["Figure 1. Shows b.", "Figure 2. Shows a.", "Figure 3. Shows c."]
    assert [box["aria-label"] for box in soup.find_all(role="group")] == ["Figure 1", "Figure 2", "Figure 3"]
    assert soup.find(attrs={"data-main": True}) is None
    first, heading = soup.find("figure"), soup.h2
    assert isinstance(first, Tag) and heading in first.find_all_next()


def test_a_folded_picture_or_a_table_is_not_the_main_picture() -> None:
    folded = f"<details><summary>s</summary><figure>{IMAGE}</figure></details>"
    table = '<figure class="table"><table></table></figure>'
    html = shown(PARTS["head"], "<h2>sec</h2>", table, folded, PARTS["tiles"])
    assert order(html, "tiles", "sec", "<table", "<img") == ["tiles", "sec", "<table", "<img"]


@pytest.mark.parametrize(("level", "given"), [("good", "good"), ("bad", "bad")])
def test_the_last_verdict_colours_the_bar(level: str, given: str) -> None:
    verdicts = [
        f'<p class="verdict" data-part="verdict" data-level="{one}">{one} word</p>' for one in ("warn", level)
    ]
    box = BeautifulSoup(shown(PARTS["head"], PARTS["summary"], *verdicts), "html.parser").section
    assert box is not None and box["class"] == ["summary", given]
    assert box.get_text() == f"summary{given} word" and "data-level" not in str(box)


def test_what_is_no_report_is_left_alone() -> None:
    for names in permutations(("limits", "numbers")):
        body = "\n".join(PARTS[name] for name in names)
        assert arranged(body) == body
