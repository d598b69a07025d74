"""The words of a page that not every reader knows: explained at its end, linked from where each comes first.

The explanations are data, ``data/glossary.toml``.
"""

from __future__ import annotations

import re
import tomllib
from collections import Counter
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
_NOT_IN = re.compile("a|h[1-6]|code|pre|summary|math|svg|style|script|title|thead|footer|dl|button")


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
    found = []
    for row in tomllib.loads(file.read_text(encoding="utf-8")).get("word", []):
        if lacking := [field for field in Word._fields if not row.get(field)]:
            problem = f"the word {row.get('name', '?')!r} has no {lacking[0]}"
            raise WildlabError(problem, "write it", file=file.name, field=lacking[0])
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
    soup = BeautifulSoup(body, "html.parser")
    return str(soup) if explain_words(soup, known) else body


def explain_words(soup: BeautifulSoup, known: Sequence[Word] | None = None) -> bool:
    """Explain the words of a page's body, see `with_glossary`; whether it uses any."""
    known = words() if known is None else known
    # The longest spelling first; one of small letters also begins a sentence.
    written = {spelling: word for word in known for spelling in word.match}
    begun = {one[0].upper() + one[1:]: word for one, word in written.items() if one[0].islower()}
    by_spelling = begun | written
    longest = sorted(map(re.escape, by_spelling), key=len, reverse=True)
    pattern = re.compile(rf"(?<![\w-])(?:{'|'.join(longest)})(?![\w-])")
    found = [
        (node, matches)
        for node in soup.find_all(string=True)
        if type(node) is NavigableString
        and (matches := list(pattern.finditer(node)))
        and not any(_NOT_IN.fullmatch(one.name) for one in node.parents)
    ]
    top = soup.find("h2")
    before = set() if top is None else {id(text) for text in top.find_all_previous(string=True)}
    uses = Counter(by_spelling[match[0]].name for _, matches in found for match in matches)
    first = {by_spelling[match[0]].name for node, matches in found if id(node) in before for match in matches}
    order = {word.name: i for i, word in enumerate(known)}
    # Those of the first screens come before all others: not everybody reads on.
    kept = sorted(uses, key=lambda name: (name not in first, -uses[name], order[name]))[:MOST]
    if not kept:
        return False
    waiting = set(kept)
    # What is folded away is linked only where there is no other use.
    for node, matches in sorted(found, key=lambda one: one[0].find_parent("details") is not None):
        pieces: list[PageElement] = []
        at = 0
        for match in matches:
            word = by_spelling[match[0]]
            if word.name in waiting:
                waiting.discard(word.name)
                link = soup.new_tag("a", attrs={"class": "word", "href": f"#{word.anchor}"}, string=match[0])
                pieces += [NavigableString(node[at : match.start()]), link]
                at = match.end()
        if pieces:
            node.replace_with(*pieces, NavigableString(node[at:]))
    items = "".join(
        f'<dt id="{word.anchor}">{escape(word.name)}</dt><dd>{escape(word.text)}</dd>'
        for word in sorted((word for word in known if word.name in kept), key=lambda word: word.name.lower())
    )
    listed = BeautifulSoup(
        '<details class="plain" id="glossary"><summary>Words used here</summary>'
        f'<dl class="words">{items}</dl></details>',
        "html.parser",
    )
    method = soup.find("details", class_="method")
    for part in list(listed.contents):
        if isinstance(method, Tag):
            method.insert_before(part)
        else:
            soup.append(part)
    return True
