"""The glossary: only words of the page, at most ten, linked where each first comes and may be."""

from __future__ import annotations

from pathlib import Path

import pytest
from bs4 import BeautifulSoup
from hypothesis import given
from hypothesis import strategies as st

from wildlab.errors import WildlabError
from wildlab.reporting.glossary import MOST, Word, with_glossary, words

A, B = Word("NEES", ("NEES",), "Squares."), Word("pose", ("poses", "pose"), "Where & which way.")


def links(html: str) -> list[tuple[str, str]]:
    soup = BeautifulSoup(html, "html.parser")
    return [(str(link["href"]), link.get_text()) for link in soup.find_all("a", class_="word")]


def test_the_first_use_is_linked_and_explained() -> None:
    html = with_glossary("<p>Poses, and the mean NEES; a pose again, NEES.</p>", [A, B])
    assert links(html) == [("#word-pose", "Poses"), ("#word-nees", "NEES")]
    assert '<dt id="word-pose">pose</dt><dd>Where &amp; which way.</dd>' in html
    assert BeautifulSoup(html, "html.parser").p.get_text() == "Poses, and the mean NEES; a pose again, NEES."


@pytest.mark.parametrize(
    "within",
    [
        "<h2>NEES</h2>",
        "<a href='#x'>NEES</a>",
        "<code>NEES</code>",
        "<math><mi>NEES</mi></math>",
        "<table><thead><tr><th>NEES</th></tr></thead></table>",
        "<details><summary>NEES</summary></details>",
    ],
)
def test_headings_links_code_and_formulas_are_no_use(within: str) -> None:
    assert with_glossary(within, [A]) == within
    assert links(with_glossary(f"{within}<p>the NEES</p>", [A])) == [("#word-nees", "NEES")]


@pytest.mark.parametrize("text", ["nees", "NEESES", "anNEES", "NEES-like", "self-NEES", "NEES_1"])
def test_only_whole_words_count(text: str) -> None:
    assert with_glossary(f"<p>{text}</p>", [A]) == f"<p>{text}</p>"


def test_what_is_folded_away_is_linked_only_where_there_is_no_other_use() -> None:
    folded = "<details><summary>s</summary><p>NEES pose</p></details><p>NEES</p>"
    soup = BeautifulSoup(with_glossary(folded, [A, B]), "html.parser")
    assert [link.get_text() for link in soup.select("details a")] == ["pose"]
    assert [link.get_text() for link in soup.select("body > p a, :root > p a, p a")].count("NEES") == 1


@given(st.lists(st.integers(1, 4), min_size=1, max_size=14))
def test_the_words_used_most_are_kept_and_every_link_has_its_anchor(counts: list[int]) -> None:
    known = [Word(f"w{chr(97 + i)}", (f"w{chr(97 + i)}",), "t") for i in range(len(counts))]
    text = " ".join(" ".join([word.name] * n) for word, n in zip(known, counts, strict=True))
    html = with_glossary(f"<p>{text}</p>", known)
    soup = BeautifulSoup(html, "html.parser")
    kept = {str(dt["id"]) for dt in soup.find_all("dt")}
    assert len(kept) == min(MOST, len(counts)) and {to[1:] for to, _ in links(html)} == kept
    left = [n for word, n in zip(known, counts, strict=True) if word.anchor not in kept]
    assert not left or max(left) <= min(n for w, n in zip(known, counts, strict=True) if w.anchor in kept)


def test_every_word_we_have_is_linked() -> None:
    for word in words():
        assert links(with_glossary(f"<p>{word.match[0]}</p>")) == [(f"#{word.anchor}", word.match[0])]


def entry(name: str, match: str) -> str:
    return f'[[word]]\nname = "{name}"\nmatch = ["{match}"]\ntext = "t"\n'


@pytest.mark.parametrize(
    ("toml", "sentence"),
    [
        (entry("a", "a").replace("text", "texts"), "no text"),
        (entry("a", "x") + entry("b", "X"), "'x'.* twice"),
        (entry("a b", "x") + entry("a-b", "y"), "'word-a-b'.* twice"),
    ],
)
def test_a_faulty_glossary_is_refused(tmp_path: Path, toml: str, sentence: str) -> None:
    file = tmp_path / "glossary.toml"
    file.write_text(toml, encoding="utf-8")
    with pytest.raises(WildlabError, match=sentence):
        words(file)
