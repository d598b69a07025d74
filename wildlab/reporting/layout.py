"""The one order of a report, and the words of it that not every reader knows."""

from __future__ import annotations

import html
import re
import tomllib
from collections import Counter
from collections.abc import Sequence
from functools import cache
from typing import NamedTuple

from bs4 import BeautifulSoup, Tag
from bs4.element import NavigableString, PageElement

from wildlab.paths import DATA
from wildlab.reporting.text import render, slug

#: What a heading or a block may say it is, in the order of the page; "" is a section like any other.
ORDER = HEAD, SUMMARY, ALERT, MAIN, TILES, OPENING, ADVICE, LIMITS, SECTION, METHOD = (
    "head",
    "summary",
    "alert",
    "main",
    "tiles",
    "opening",
    "advice",
    "limits",
    "",
    "method",
)
#: The verdict is shown when all numbers are there, and read in the summary.
VERDICT = "verdict"
_LEVELS = {"good", "warn", "bad", "neutral"}
#: What a block is by its class, where it does not say it.
_BY_CLASS = {"summary": SUMMARY, "look": ALERT, "tiles": TILES}


def arrange_parts(soup: BeautifulSoup) -> None:
    """Put the parts of a report, as a notebook showed them one after the other, in the order of a page.

    Where there is no ``<header>``, nothing is moved: it is no report.
    """
    if soup.header is None:
        return
    groups: dict[str, list[PageElement]] = {part: [] for part in (*ORDER, VERDICT)}
    at = OPENING
    for node in list(soup.contents):
        node.extract()
        if isinstance(node, NavigableString) and not node.strip():
            continue
        part = _part_of(node) if isinstance(node, Tag) else None
        if part is not None and isinstance(node, Tag) and node.name == "h2":
            at = part
        groups[at if part is None else part].append(node)
    soup.extend(node for part in ORDER for node in groups[part])
    _put_first(soup, _main_picture([one for part in (OPENING, ADVICE, SECTION) for one in groups[part]]))
    _judge(groups[SUMMARY], groups[VERDICT])
    for marked in soup.select("[data-part], [data-main]"):
        del marked["data-part"], marked["data-main"]
    _drop_bare_headings(soup)
    _number_figures(soup)


def _part_of(node: Tag) -> str | None:
    """What a block is; None for one that belongs to the section it stands in."""
    said = node.get("data-part")
    if said is not None:
        return str(said)
    by_class = [_BY_CLASS[name] for name in node.get_attribute_list("class") if name in _BY_CLASS]
    return HEAD if node.name == "header" else SECTION if node.name == "h2" else next(iter(by_class), None)


def _judge(summaries: list[PageElement], verdicts: list[PageElement]) -> None:
    """Put the last verdict into the summary, and give its bar the colour that goes with the word."""
    box = next((one for one in summaries if isinstance(one, Tag)), None)
    last = verdicts[-1] if verdicts else None
    if box is None or not isinstance(last, Tag):
        return
    level = str(last.attrs.pop("data-level", "neutral"))
    classes = [str(name) for name in box.get_attribute_list("class") if name not in _LEVELS]
    box["class"] = " ".join([*classes, level])
    box.append(last)


def _main_picture(blocks: list[PageElement]) -> Tag | None:
    """The figure that stands first: the one marked so, else the first that is not folded away."""
    figures = [
        one
        for block in blocks
        if isinstance(block, Tag)
        for one in ([block] if block.name == "figure" else block.find_all("figure"))
        if one.find("img") and not one.find_parent("details")
    ]
    marked = [one for one in figures if one.get("data-main") is not None]
    return next(iter(marked or figures), None)


def _put_first(soup: BeautifulSoup, chosen: Tag | None) -> None:
    """Put the main picture below summary and alerts, and take away the row that it alone stood in."""
    if chosen is None:
        return
    row = chosen.parent
    chosen.extract()
    if row is not None and row.name == "div" and not row.find("figure"):
        row.extract()
    above = [one for one in soup.find_all(recursive=False) if _part_of(one) in (HEAD, SUMMARY, ALERT)]
    above[-1].insert_after(chosen)


def _drop_bare_headings(soup: BeautifulSoup) -> None:
    """Headings of sections whose only figure stands above now, and which say nothing besides."""
    for heading in soup.find_all(["h2", "h3"]):
        after = heading.find_next_sibling()
        if (
            after is None
            or after.name == "h2"
            or (after.name == "h3" and heading.name == "h3")
            or (after.name == "details" and "method" in after.get_attribute_list("class"))
        ):
            heading.decompose()


def _number_figures(soup: BeautifulSoup) -> None:
    """Count figures as they now stand; tables keep their numbers, for they keep their order."""
    figures = [one for one in soup.find_all("figure") if one.find("img")]
    for ordinal, figure in enumerate(figures, start=1):
        box = figure.find("div", class_="scroll")
        if isinstance(box, Tag) and str(box.get("aria-label", "")).startswith("Figure "):
            box["aria-label"] = f"Figure {ordinal}"
        label = figure.select_one("figcaption > b")
        if label is not None and re.fullmatch(r"Figure \d+\.", label.get_text()):
            label.string = f"Figure {ordinal}."


FILE = DATA / "glossary.toml"
#: Words of one page at most; those it uses most.
MOST = 10
#: Where a word is no running text, or has a meaning of its own.
_NOT_IN = re.compile("a|h[1-6]|code|pre|summary|math|svg|style|script|title|thead|footer|dl|button")


class Word(NamedTuple):
    """A word: what it is called in the list, how it is written in text, and what it means."""

    name: str
    match: Sequence[str]
    text: str

    @property
    def anchor(self) -> str:
        """The id of its explanation."""
        return f"word-{slug(self.name)}"


@cache
def load_glossary() -> tuple[Word, ...]:
    """All words of the glossary."""
    return tuple(Word(**row) for row in tomllib.loads(FILE.read_text(encoding="utf-8"))["word"])


def explain_words(soup: BeautifulSoup, known: Sequence[Word] | None = None) -> None:
    """Explain the words of a page's body that it uses most: a list before the method, a link at a first use.

    Parameters
    ----------
    soup
        Is changed, where it uses any.
    known
        The words to look for; those of `load_glossary` by default.
    """
    known = load_glossary() if known is None else known
    # The longest spelling first; one of small letters also begins a sentence.
    written = {spelling: word for word in known for spelling in word.match}
    begun = {one[0].upper() + one[1:]: word for one, word in written.items() if one[0].islower()}
    by_spelling = begun | written
    longest = sorted(map(re.escape, by_spelling), key=len, reverse=True)
    pattern = re.compile(rf"(?<![\w-])(?:{'|'.join(longest)})(?![\w-])")
    found = [
        node
        for node in soup.find_all(string=pattern)
        if type(node) is NavigableString and not any(_NOT_IN.fullmatch(one.name) for one in node.parents)
    ]
    uses = Counter(by_spelling[match].name for node in found for match in pattern.findall(node))
    order = {word.name: i for i, word in enumerate(known)}
    waiting = sorted(uses, key=lambda name: (-uses[name], order[name]))[:MOST]
    words = sorted((word for word in known if word.name in waiting), key=lambda word: word.name.lower())

    def link(match: re.Match[str]) -> str:
        word = by_spelling[match[0]]
        if word.name not in waiting:
            return match[0]
        waiting.remove(word.name)
        return f'<a class="word" href="#{word.anchor}">{match[0]}</a>'

    # What is folded away is linked only where there is no other use.
    for node in sorted(found, key=lambda one: one.find_parent("details") is not None):
        node.replace_with(
            *BeautifulSoup(pattern.sub(link, html.escape(node, quote=False)), "html.parser").contents
        )
    if not words:
        return
    listed = BeautifulSoup(render("glossary", words=words), "html.parser")
    method = soup.find("details", class_="method")
    if isinstance(method, Tag):
        method.insert_before(listed)
    else:
        soup.append(listed)
