"""Several reports as one page: no file beside it, no link out of it, nothing about who made it when."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import accumulate
from pathlib import Path

from bs4 import BeautifulSoup, Tag
from bs4.element import NavigableString, PageElement
from markupsafe import Markup

from wildlab.errors import WildlabError
from wildlab.flight.files import read_regular
from wildlab.reporting.text import page, render
from wildlab.sharing.allow_list import Writer

#: A report is a tenth of this.
_MOST_BYTES = 100_000_000
_HASH = re.compile(r"\b[0-9a-f]{8,64}\b")
#: What is typed, or stated in a file, where wildlab and the flight are; what a sentence stands in.
_COMMAND = re.compile(r"wildlab [a-z]|--[a-z]|[a-z]+_\w+ = |[a-z]+ = (?:true|false)$")
_BLOCKS = ("p", "li", "td", "th", "figcaption", "caption", "summary", "dd", "h2", "h3", "div")


@dataclass(frozen=True)
class Part:
    """One report, ready to stand beside others on a page: its number there, title and HTML."""

    number: int
    title: str
    body: Markup


@dataclass(frozen=True)
class Chapter:
    """What belongs together on a page: a flight or a study.

    Attributes
    ----------
    heading
        Its own.
    lead
        Where and when it was, in a sentence or two: the first thing read.
    about
        Sentences on the copy, for whoever asks: the last.
    parts
        Its reports.
    """

    heading: str
    lead: str
    about: tuple[str, ...]
    parts: tuple[Part, ...]


def read_part(report: Path, number: int, *, exact: bool, generalised: bool) -> Part:
    """One report out of its file.

    Parameters
    ----------
    report
        ``report.html``.
    number
        Which one it is on its page.
    exact
        Whether it is for those who have the flight and wildlab: then the foot of the page says by which
        hashes its data and code are known and when it was made, and advice may be a command to type.
    generalised
        Whether it may have no words and numbers but those of `wildlab.sharing.allow_list`.

    Returns
    -------
    Part

    Raises
    ------
    WildlabError
        Where there is no such file, or it is no page of ours.
    RunFailed
        Where it has anything that may not go out.
    """
    try:
        text = read_regular(report, _MOST_BYTES).decode("utf-8")
    except (OSError, UnicodeDecodeError):
        raise WildlabError("this report cannot be read", "make it again", file=report) from None
    soup = BeautifulSoup(text, "html.parser")
    body, main = soup.body, soup.main
    heading = None if main is None else main.h1
    if body is None or main is None or heading is None:
        raise WildlabError("this is not a report of wildlab", "make it again", file=report)
    # The way back to the ledger is none here, and the whole page gets its copies for paper once more.
    for unwanted in body.select("p.kicker, section.paper"):
        unwanted.decompose()
    footer = body.find("footer")
    for line in footer.find_all("p") if isinstance(footer, Tag) else ():
        if _stays(line, exact):
            line["class"] = "note"
            main.append(line)
    for link in main.find_all("a"):
        _tie(link)
    if not exact:
        _leave_out_commands(main)
    writer = Writer(
        report, number, frozenset(str(one["id"]) for one in main.find_all(id=True)), exact=not generalised
    )
    return Part(number, heading.get_text(" ", strip=True), Markup(writer.inside(main).strip()))  # noqa: S704 - written by the allow-list


def _stays(paragraph: Tag, exact: bool) -> bool:
    """Whether a line at the foot stays: not where it points to files beside the page."""
    beside = any(not str(a.get("href", "")).startswith(("#", "data:")) for a in paragraph.find_all("a"))
    return not beside and (exact or (paragraph.code is None and not _HASH.search(paragraph.get_text())))


def _leave_out_commands(main: Tag) -> None:
    """Without the sentences that say what to type: who gets the copy has neither program nor flight."""
    for code in main.find_all("code"):
        block = code.find_parent(_BLOCKS)
        if block is None or not _COMMAND.match(code.get_text().strip()):
            continue
        kept: list[PageElement] = []
        for sentence in _sentences(block):
            found = [tag for one in sentence if isinstance(one, Tag) for tag in (one, *one.find_all("code"))]
            if not any(tag.name == "code" and _COMMAND.match(tag.get_text().strip()) for tag in found):
                kept += sentence
        block.clear()
        block.extend(kept)
        while not block.get_text(strip=True) and block.name in ("p", "li", "ul", "ol") and block.parent:
            block, empty = block.parent, block
            empty.decompose()


def _sentences(block: Tag) -> list[list[PageElement]]:
    """What is in a block, in sentences; what is marked in it stays whole."""
    found: list[list[PageElement]] = [[]]
    for child in list(block.children):
        # The end of a sentence stays with it.
        pieces = re.split(r"(?<=[.!?])(?=\s)", str(child)) if type(child) is NavigableString else [child]
        for i, piece in enumerate(pieces):
            last = "".join(one.get_text() for one in found[-1])
            begins = piece if isinstance(piece, str) else piece.get_text()
            if i or re.search(r"[.!?]\s+$", last) or re.search(r"[.!?]\s", last[-1:] + begins[:1]):
                found.append([])
            found[-1].append(NavigableString(piece) if isinstance(piece, str) else piece)
    return found


def _tie(link: Tag) -> None:
    """A link out of the page becomes its words: mailed alone, it would be dead. Maps are places."""
    target = str(link.get("href", ""))
    if not target.startswith("data:"):
        link.unwrap() if not target.startswith("#") else None
    elif not target.startswith("data:text/csv"):
        link.decompose()


def join_chapters(chapters: Sequence[Chapter], heading: str) -> str:
    """One page with all chapters, and a list of their reports first where there is more than one.

    Parameters
    ----------
    chapters
        In their order.
    heading
        Of the page, where there are several.

    Returns
    -------
    str
    """
    several = len(chapters) > 1
    # Counted through all chapters: a report is also told from one of the same title by its number.
    starts = [0, *accumulate(len(chapter.parts) for chapter in chapters)]
    numbered = list(zip(chapters, starts, strict=False))
    body = render("copy", chapters=numbered, heading=heading, count=starts[-1])
    return page(title=heading if several else chapters[0].heading, body=body, style=_STYLE)


_STYLE = """.shared { border-top: 3px solid var(--line); margin-top: 3rem; padding-top: 1.5rem }
@media print { .shared { break-before: page; border: 0; margin: 0; padding: 0 } }"""
