"""The words of a page that not every reader knows: explained at its end, linked from where each comes first.

The explanations are data, ``data/glossary.toml``.
"""

from __future__ import annotations

import re
import tomllib
from collections.abc import Sequence
from functools import cache
from pathlib import Path
from typing import NamedTuple

from bs4 import BeautifulSoup, Tag
from bs4.element import NavigableString, PageElement

from wildlab.errors import WildlabError
from wildlab.paths import DATA
from wildlab.reporting.text import escape, slug

FILE = DATA / "glossary.toml"
#: Words of one page at most; those it uses most.
MOST = 10
#: Where a word is no running text, or has a meaning of its own.
_NOT_IN = {*("a", "h1", "h2", "h3", "h4", "h5", "h6", "code", "pre", "summary", "math", "svg", "style")} | {
    *("script", "title", "thead", "footer", "dl", "button")
}


class Word(NamedTuple):
    """A word: what it is called in the list, how it is written in text, and what it means."""

    name: str
    match: tuple[str, ...]
    text: str

    @property
    def anchor(self) -> str:
        """The id of its explanation."""
        return f"word-{slug(self.name)}"


@cache
def words(file: Path = FILE) -> tuple[Word, ...]:
    """All words of the glossary.

    Raises
    ------
    WildlabError
        If a word lacks a part, or two share a name or a way of writing.
    """
    rows = tomllib.loads(file.read_text(encoding="utf-8")).get("word", [])
    found = []
    for row in rows:
        for field in ("name", "match", "text"):
            if not row.get(field):
                raise WildlabError(
                    f"the word {row.get('name', '?')!r} has no {field}",
                    "write it",
                    file=file.name,
                    field=field,
                )
        found.append(Word(row["name"], tuple(row["match"]), row["text"]))
    spellings = [spelling.lower() for word in found for spelling in word.match]
    for many in ([word.anchor for word in found], spellings):
        for one in many:
            if many.count(one) > 1:
                raise WildlabError(f"{one!r} is explained twice", "keep one", file=file.name, field="match")
    return tuple(found)


def with_glossary(body: str, known: Sequence[Word] | None = None) -> str:
    """A page's body with its words explained: a list before the method, and a link at each first use.

    Parameters
    ----------
    body
        HTML.
    known
        The words to look for; those of `words` by default.

    Returns
    -------
    str
        HTML; as it was, where it uses none of them.
    """
    known = words() if known is None else known
    soup = BeautifulSoup(body, "html.parser")
    pattern, by_spelling = _pattern(known)
    uses: dict[str, int] = {}
    first: set[str] = set()
    top = soup.find("h2")
    before = set() if top is None else {id(text) for text in top.find_all_previous(string=True)}
    for node in _texts(soup):
        for match in pattern.finditer(str(node)):
            name = by_spelling[_key(match[0], by_spelling)].name
            uses[name] = uses.get(name, 0) + 1
            if id(node) in before:
                first.add(name)
    order = {word.name: i for i, word in enumerate(known)}
    # Those of the first screens come before all others: not everybody reads on.
    kept = sorted(uses, key=lambda name: (name not in first, -uses[name], order[name]))[:MOST]
    if not kept:
        return body
    _link_first(soup, pattern, by_spelling, set(kept))
    listed = sorted((word for word in known if word.name in kept), key=lambda word: word.name.lower())
    items = "".join(
        f'<dt id="{word.anchor}">{escape(word.name)}</dt><dd>{escape(word.text)}</dd>' for word in listed
    )
    section = BeautifulSoup(
        f'<details class="plain" id="glossary"><summary>Words used here</summary>'
        f'<dl class="words">{items}</dl></details>',
        "html.parser",
    )
    method = soup.find("details", class_="method")
    for part in list(section.contents):
        if isinstance(method, Tag):
            method.insert_before(part)
        else:
            soup.append(part)
    return str(soup)


def _pattern(known: Sequence[Word]) -> tuple[re.Pattern[str], dict[str, Word]]:
    """What finds any of the words, the longest first; and whose each spelling is."""
    by_spelling = {spelling: word for word in known for spelling in word.match}
    parts = []
    for spelling in sorted(by_spelling, key=len, reverse=True):
        first = re.escape(spelling[0])
        if spelling[0].islower():
            first = f"[{spelling[0]}{spelling[0].upper()}]"
        parts.append(first + re.escape(spelling[1:]))
    return re.compile(rf"(?<![\w-])(?:{'|'.join(parts)})(?![\w-])"), by_spelling


def _key(found: str, by_spelling: dict[str, Word]) -> str:
    return found if found in by_spelling else found[0].lower() + found[1:]


def _texts(soup: BeautifulSoup) -> list[NavigableString]:
    """Running text: nothing within links, headings, code, formulas or what is folded away."""
    return [
        node
        for node in soup.find_all(string=True)
        if type(node) is NavigableString and not any(one.name in _NOT_IN for one in node.parents)
    ]


def _link_first(
    soup: BeautifulSoup, pattern: re.Pattern[str], by_spelling: dict[str, Word], wanted: set[str]
) -> None:
    """Link the first use of each word; one that is folded away only where there is no other."""
    texts = _texts(soup)
    folded = [node for node in texts if node.find_parent("details") is not None]
    inside = {id(node) for node in folded}
    for node in [*(one for one in texts if id(one) not in inside), *folded]:
        if not wanted:
            return
        pieces: list[PageElement] = []
        text, at = str(node), 0
        for match in pattern.finditer(text):
            word = by_spelling[_key(match[0], by_spelling)]
            if word.name not in wanted:
                continue
            wanted.discard(word.name)
            link = soup.new_tag("a", attrs={"class": "word", "href": f"#{word.anchor}"})
            link.string = match[0]
            pieces += [NavigableString(text[at : match.start()]), link]
            at = match.end()
        if pieces:
            pieces.append(NavigableString(text[at:]))
            node.replace_with(*pieces)
