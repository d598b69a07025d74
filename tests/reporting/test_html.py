"""Pages: what they promise is examined, what comes out of a log stays text, and parts have their order."""

from __future__ import annotations

import re

import nbformat
import pandas as pd
import pytest
from bs4 import BeautifulSoup, Tag
from hypothesis import given
from hypothesis import strategies as st

from tests.notebooks import notebook, shown
from wildlab.errors import WildlabError
from wildlab.reporting import notebook_pages as html
from wildlab.reporting.figures import new_figure
from wildlab.reporting.notebook_pages import (
    ADVICE,
    LIMITS,
    METHOD,
    MOST,
    Word,
    arrange_parts,
    explain_words,
    load_glossary,
)
from wildlab.reporting.report import Report, open_report
from wildlab.reporting.text import STYLE, failure_page, page

HOSTILE = "<script>alert(1)</script>\"'\n<img src=x onerror=alert(2)>"


def hostile_report() -> Report:
    """Everything a report can show, with a name that tries to break out of every part of it."""
    report = open_report(study="test", kind="logged", flight=HOSTILE, seed=1)
    report.head(f"Title {HOSTILE}", HOSTILE)
    report.summary([HOSTILE, HOSTILE], level="warn", verdict=(HOSTILE, HOSTILE))
    report.alert(HOSTILE, [HOSTILE] * 5)
    report.tiles([(HOSTILE, HOSTILE)] * 4)
    report.section(HOSTILE, HOSTILE)
    report.points([HOSTILE, "w" * 300], ordered=True)
    for width in (5.0, 9.0):
        fig, ax = new_figure(width, 3)
        ax.plot([0, 1], [0, 1])
        report.figure(fig, name=f"figure-{width:.0f}", alt=HOSTILE, caption=HOSTILE, main=width < 6)
    wide = pd.DataFrame({HOSTILE: [HOSTILE, None], **{f"column {i}": [i, i / 3] for i in range(12)}})
    report.table(wide, caption=HOSTILE, fold=HOSTILE)
    formula = r"\epsilon_k = \tilde{x}_k^\top P_k^{-1} \tilde{x}_k " + "+ a_{k} b_{k} " * 30
    report.text(f"$${formula}$$")
    report.limits([HOSTILE])
    report.method(f"{HOSTILE}\n\nwith $R_{{nb}}$")
    return report


def test_hostile_names_stay_text(tmp_path, faults):
    whole = html.report_page(shown(hostile_report()), study=HOSTILE)
    assert "<script" not in whole and "<img src=x" not in whole
    path = tmp_path / "report.html"
    path.write_text(whole, encoding="utf-8")
    assert faults(path) == []


def test_failure_page_opens_offline_and_stays_text(tmp_path, faults):
    status = {"study": HOSTILE, "reason": HOSTILE, "seconds": 3.0}
    path = tmp_path / "report.html"
    path.write_text(
        failure_page(status, title=HOSTILE, step=HOSTILE, details=HOSTILE * 50, again=HOSTILE),
        encoding="utf-8",
    )
    assert "<script" not in path.read_text(encoding="utf-8")
    assert faults(path) == []


def test_code_prints_warnings_and_parameters_are_left_out():
    node = notebook("secret = 1")
    outputs = [
        nbformat.v4.new_output("stream", name="stderr", text="a warning"),
        nbformat.v4.new_output("stream", name="stdout", text="a print"),
        nbformat.v4.new_output("execute_result", {"text/plain": "a value"}),
        nbformat.v4.new_output("display_data", {"text/html": "<h1>Shown</h1>", "text/plain": "x"}),
    ]
    node.cells[1].outputs = outputs
    node.cells[0].outputs = [nbformat.v4.new_output("display_data", {"text/html": "<p>parameters</p>"})]
    body = html.notebook_body(node)
    assert body == "<h1>Shown</h1>"


def test_markdown_cells_have_their_maths_translated_and_their_html_escaped():
    body = html.notebook_body(notebook("# Title with $x_1 < 2$\n\n$$y$$\n\n<script>alert(1)</script>"))
    assert body.count("<math") == 2 and "$" not in body and "<script" not in body and "¶" not in body


def test_page_says_what_browsers_may_do():
    whole = page(title="a <b>", body="<h1>a</h1>")
    assert "default-src 'none'; img-src data:; style-src 'unsafe-inline'" in whole
    assert (
        '<html lang="en">' in whole and "<title>a &lt;b&gt;</title>" in whole and 'name="viewport"' in whole
    )
    html.examine(whole, "study")


@pytest.mark.parametrize(
    ("body", "sentence"),
    [
        ("<h1>a</h1><script>1</script>", "<script>"),
        ('<h1>a</h1><p onclick="x()">b</p>', "'onclick'"),
        ('<h1>a</h1><img alt="b" src="https://example.org/a.png">', "'https://example.org"),
        ('<h1>a</h1><a href=" JavaScript:x()">b</a>', "link runs"),
        ('<h1>a</h1><p style="background:url(//example.org)">b</p>', "style"),
        ('<h1>a</h1><img src="data:image/png;base64,AA==">', "alt"),
        ("<p>a</p>", "has 0"),
        ("<h1>a</h1><h3>b</h3>", "level 3"),
        ("<h1>a</h1>" + "x" * 5_000_000, "5 MB"),
    ],
)
def test_a_page_that_breaks_a_promise_is_refused(body, sentence):
    with pytest.raises(WildlabError, match=f"report.html: .*{sentence}"):
        html.examine(page(title="a", body=body), "study")


@pytest.mark.parametrize("to", ["ledger.html", "a-b/report.html#x", "100%25/report.html"])
def test_pages_of_the_folder_may_lead_to_one_another(to):
    whole = page(title="a", body=f'<h1>a</h1><a href="{to}">x</a>')
    html.examine(whole, "index", alone=False)
    with pytest.raises(WildlabError, match="mailed alone"):
        html.examine(whole, "study")
    for away in ("//host/x", "/etc/x", "http://host/x", "file:x", "a b", "javascript:x", ""):
        with pytest.raises(WildlabError):
            html.examine(whole.replace(to, away), "index", alone=False)


WORDS = ("ink", "dim", "link", "good", "warn", "bad")


def colours(rule: str) -> dict[str, str]:
    """The variables of the first ``:root`` after ``rule``, those that are a plain colour."""
    block = re.search(r":root \{(.*?)\}", STYLE[STYLE.index(rule) :], re.S)
    assert block is not None
    return dict(re.findall(r"--([a-z]+): (#[0-9a-f]{6})(?![0-9a-f])", block[1]))


def luminance(colour: str) -> float:
    """Relative luminance of WCAG 2.2."""
    channels = [int(colour[i : i + 2], 16) / 255 for i in (1, 3, 5)]
    red, green, blue = [c / 12.92 if c <= 0.04045 else ((c + 0.055) / 1.055) ** 2.4 for c in channels]
    return 0.2126 * red + 0.7152 * green + 0.0722 * blue


def contrast(one: str, other: str) -> float:
    """The contrast ratio of WCAG 2.2."""
    low, high = sorted((luminance(one), luminance(other)))
    return (high + 0.05) / (low + 0.05)


@pytest.mark.parametrize("scheme", [":root", "prefers-color-scheme: dark"])
def test_every_colour_of_words_can_be_read(scheme):
    found = colours(":root") | colours(scheme)
    for behind in ("bg", "soft"):
        for word in WORDS:
            assert contrast(found[word], found[behind]) >= 4.5, (scheme, word, behind)
    for status in ("dim", "good", "warn", "bad"):
        assert contrast(found["on"], found[status]) >= 4.5, (scheme, status)
    # What is drawn, not written.
    for mark in ("blue", "ink"):
        assert contrast(found[mark], found["bg"]) >= 3.0


IMAGE = '<img alt="a" src="data:image/png;base64,AA==">'


def in_order(*parts: str) -> str:
    return order_report("\n".join(parts))


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
    "numbers": f'<h2>numbers</h2>\n<p>before</p><figure data-part="main">{IMAGE}'
    "<figcaption><b>Figure 1.</b> picture</figcaption></figure><p>after</p>",
    "method": f'<details class="method" data-part="{METHOD}"><summary>by</summary><p>thus</p></details>',
}


@given(st.permutations(list(PARTS)))
def test_any_order_of_the_parts_becomes_the_one(names):
    html = in_order(*(PARTS[name] for name in names))
    wanted = ["head</h1", "summary</p", "alert</p", "picture", "tiles</li", "advice", "do this"]
    wanted += ["limits", "doubt", "numbers</h2", "before", "after", "by</summary", "thus"]
    assert order(html, *wanted) == wanted
    # Nothing is lost, and nothing is said twice.
    assert all(html.count(word) == 1 for word in wanted) and "data-part" not in html


def test_the_marked_figure_stands_first():
    one = report()
    one.head("Title")
    one.section("Section")
    for name in ("b", "a", "c"):
        one.figure(new_figure()[0], name=name, alt=name, caption=f"Shows {name}.", main=name == "b")
    soup = BeautifulSoup(order_report("\n".join(one.parts)), "html.parser")
    captions = [caption.get_text() for caption in soup.find_all("figcaption")]
    assert captions == ["Figure 1. Shows b.", "Figure 2. Shows a.", "Figure 3. Shows c."]
    assert [box["aria-label"] for box in soup.find_all(role="group")] == ["Figure 1", "Figure 2", "Figure 3"]
    assert soup.find(attrs={"data-part": True}) is None
    first, heading = soup.find("figure"), soup.h2
    assert isinstance(first, Tag) and heading in first.find_all_next()


def test_the_last_verdict_colours_the_bar():
    verdicts = [
        f'<p class="verdict" data-part="verdict" data-level="{one}">{one} word</p>' for one in ("warn", "bad")
    ]
    whole = in_order(PARTS["head"], PARTS["summary"], PARTS["numbers"], *verdicts)
    assert order(whole, "word", "picture", "before") == ["word", "picture", "before"]
    box = BeautifulSoup(whole, "html.parser").section
    assert box is not None and box["class"] == ["summary", "bad"]
    assert box.get_text() == "summarybad word" and "data-level" not in str(box)


def with_glossary(body: str, known: list[Word] | None = None) -> str:
    soup = BeautifulSoup(body, "html.parser")
    explain_words(soup, known)
    return str(soup)


def order_report(body: str) -> str:
    soup = BeautifulSoup(body, "html.parser")
    arrange_parts(soup)
    return str(soup)


A, B = Word("NEES", ("NEES",), "Squares."), Word("pose", ("poses", "pose"), "Where & which way.")


def links(html: str) -> list[tuple[str, str]]:
    soup = BeautifulSoup(html, "html.parser")
    return [(str(link["href"]), link.get_text()) for link in soup.find_all("a", class_="word")]


def test_the_first_use_is_linked_and_explained():
    html = with_glossary("<p>Poses, and the mean NEES; a pose again, NEES.</p>", [A, B])
    assert links(html) == [("#word-pose", "Poses"), ("#word-nees", "NEES")]
    assert '<dt id="word-pose">pose</dt><dd>Where &amp; which way.</dd>' in html
    assert BeautifulSoup(html, "html.parser").p.get_text() == "Poses, and the mean NEES; a pose again, NEES."


@pytest.mark.parametrize(
    "within",
    [
        "<code>NEES</code>",
        "<math><mi>NEES</mi></math>",
        "<table><thead><tr><th>NEES</th></tr></thead></table>",
    ],
)
def test_headings_links_code_and_formulas_are_no_use(within):
    assert with_glossary(within, [A]) == within
    assert links(with_glossary(f"{within}<p>the NEES</p>", [A])) == [("#word-nees", "NEES")]


def test_only_whole_words_count():
    text = "<p>nees, anNEES, NEES-like</p>"
    assert with_glossary(text, [A]) == text


@given(st.lists(st.integers(1, 4), min_size=1, max_size=14))
def test_the_words_used_most_are_kept_and_every_link_has_its_anchor(counts):
    known = [Word(f"w{chr(97 + i)}", (f"w{chr(97 + i)}",), "t") for i in range(len(counts))]
    text = " ".join(" ".join([word.name] * n) for word, n in zip(known, counts, strict=True))
    html = with_glossary(f"<p>{text}</p>", known)
    soup = BeautifulSoup(html, "html.parser")
    kept = {str(dt["id"]) for dt in soup.find_all("dt")}
    assert len(kept) == min(MOST, len(counts)) and {to[1:] for to, _ in links(html)} == kept
    left = [n for word, n in zip(known, counts, strict=True) if word.anchor not in kept]
    assert not left or max(left) <= min(n for w, n in zip(known, counts, strict=True) if w.anchor in kept)


def test_every_word_we_have_is_linked():
    words = load_glossary()
    spellings = [spelling.lower() for word in words for spelling in word.match]
    assert len(set(spellings)) == len(spellings) and len({word.anchor for word in words}) == len(words)
    for word in words:
        assert word.text
        assert links(with_glossary(f"<p>{word.match[0]}</p>")) == [(f"#{word.anchor}", word.match[0])]
