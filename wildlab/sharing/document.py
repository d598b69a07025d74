"""Several reports as one page: no file beside it, no link out of it, nothing about who made it when."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from bs4 import BeautifulSoup, Comment, Tag
from bs4.element import NavigableString, PageElement

from wildlab.errors import WildlabError
from wildlab.flight.files import read_regular
from wildlab.reporting.page import STYLE, page
from wildlab.reporting.text import escape

#: A report is a tenth of this.
_MOST_BYTES = 100_000_000
#: Data that may go along inside of a page: tables of text. Maps are places.
_DATA = re.compile(r"data:(text/csv|application/json)[;,]", re.IGNORECASE)
#: Attributes that name another part of the page.
_NAMING = (
    "for",
    "headers",
    "aria-labelledby",
    "aria-describedby",
    "aria-controls",
    "aria-owns",
    "aria-details",
)
_REFERENCES = re.compile(r"url\(\s*['\"]?#([^'\")\s]+)['\"]?\s*\)")
_HASH = re.compile(r"\b[0-9a-f]{8,64}\b")
#: Scripts and whatever else loads or runs something; pictures inside of the page stay.
_NEVER = ("script", "iframe", "object", "embed", "link", "meta", "base", "form", "noscript", "template")
#: What is typed, or stated in a file, where wildlab and the flight are; what a sentence stands in.
_COMMAND = re.compile(r"wildlab [a-z]|--[a-z]|[a-z]+_\w+ = |[a-z]+ = (?:true|false)$")
_BLOCKS = ("p", "li", "td", "th", "figcaption", "caption", "summary", "dd", "h2", "h3", "div")
#: What screen readers list by its name, to go to.
_LANDMARKS = "section[aria-label], nav[aria-label], aside[aria-label], [role=region][aria-label]"


@dataclass(frozen=True)
class Part:
    """One report, ready to stand beside others on a page: its number there, title, HTML and style."""

    number: int
    title: str
    body: str
    style: str


def read_part(report: Path, number: int, *, exact: bool) -> Part:
    """One report out of its file.

    Parameters
    ----------
    report
        ``report.html``.
    number
        Which one it is on its page; what it names by id then is its own.
    exact
        Whether it is for those who have the flight and wildlab: then the foot of the page says by which
        hashes its data and code are known and when it was made, and advice may be a command to type.

    Returns
    -------
    Part

    Raises
    ------
    WildlabError
        Where there is no such file, or it is no page of ours.
    """
    try:
        text = read_regular(report, _MOST_BYTES).decode("utf-8")
    except (OSError, UnicodeDecodeError):
        raise WildlabError("this report cannot be read", "make it again", file=report) from None
    soup = BeautifulSoup(text, "html.parser")
    body, main = soup.body, soup.main
    if body is None or main is None or soup.h1 is None:
        raise WildlabError("this is not a report of wildlab", "make it again", file=report)
    style = "\n".join(one.get_text() for one in soup.find_all("style")).replace(STYLE, "").strip()
    title = soup.h1.get_text(" ", strip=True)
    for unwanted in body.find_all([*_NEVER, "style"]):
        unwanted.decompose()
    # The way back to the ledger is none here, and the whole page gets its copies for paper once more.
    for unwanted in body.select("p.kicker, section.paper"):
        unwanted.decompose()
    for comment in body.find_all(string=lambda text: isinstance(text, Comment)):
        comment.extract()
    footer = body.find("footer")
    kept = [] if not isinstance(footer, Tag) else [one for one in footer.find_all("p") if _stays(one, exact)]
    for one in kept:
        one["class"] = "note"
        main.append(one)
    for link in main.find_all("a"):
        _tie(link)
    if not exact:
        _leave_out_commands(main)
    prefix = f"r{number}-"
    ids = {str(one["id"]) for one in main.find_all(id=True)}
    for tag in main.find_all(True):
        _rename(tag, ids, prefix)
    style = re.sub(r"#([\w-]+)", lambda m: f"#{prefix}{m[1]}" if m[1] in ids else m[0], style)
    return Part(number, title, main.decode_contents().strip(), style)


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
    """A link out of the page becomes its words: mailed alone, it would be dead."""
    target = str(link.get("href", ""))
    if target.startswith("#") or _DATA.match(target):
        return
    if target.startswith("data:"):
        link.decompose()
    else:
        link.unwrap()


def _rename(tag: Tag, ids: set[str], prefix: str) -> None:
    for name, value in list(tag.attrs.items()):
        words = value if isinstance(value, list) else str(value).split()
        text = " ".join(words) if isinstance(value, list) else str(value)
        if name.lower().startswith("on") or name in ("srcset", "ping", "action", "formaction"):
            del tag[name]
        elif name == "id":
            tag[name] = prefix + text
        elif name in _NAMING:
            tag[name] = " ".join(prefix + word if word in ids else word for word in words)
        elif name in ("href", "xlink:href") and text.startswith("#"):
            tag[name] = f"#{prefix}{text[1:]}" if text[1:] in ids else f"#{prefix}top"
        elif name in ("src", "poster", "data") and not text.startswith("data:"):
            del tag[name]
        elif "url(" in text:
            tag[name] = _REFERENCES.sub(lambda m: f"url(#{prefix}{m[1]})", text)


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


def joined(chapters: Sequence[Chapter], heading: str) -> str:
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
    body = [f"<header><h1>{escape(heading)}</h1></header>"] if several else []
    parts = [part for chapter in chapters for part in chapter.parts]
    contents = ""
    if len(parts) > 1:
        contents = f'<nav aria-label="Reports"><h2>In this file</h2>{_listed(chapters)}</nav>'
    body.append(contents if several else "")
    level = "h2" if several else "h1"
    for chapter in chapters:
        body.append(
            f"<header><{level}>{escape(chapter.heading)}</{level}>"
            f'<p class="sub">{escape(chapter.lead)}</p></header>'
        )
        body.append("" if several else contents)
        body += [
            f'<article class="shared" id="r{part.number}-top" aria-label="{escape(part.title)}">\n'
            f"{_set_apart(part, parts)}\n</article>"
            for part in chapter.parts
        ]
        told = "".join(f"<li>{escape(one)}</li>" for one in chapter.about)
        if told:
            body.append(f'<section class="shared"><h2>About this copy</h2><ul>{told}</ul></section>')
    styles = dict.fromkeys([*(part.style for part in parts if part.style), _STYLE])
    title = heading if several else chapters[0].heading
    return page(title=title, body="\n".join(filter(None, body)), style="\n".join(styles))


def _listed(chapters: Sequence[Chapter]) -> str:
    """Links to the reports, under the chapters' headings where there are several: titles alone may be the
    same."""
    lists, before = [], 0
    for chapter in chapters:
        items = "".join(
            f'<li><a href="#r{part.number}-top">{escape(part.title)}</a></li>' for part in chapter.parts
        )
        heading = f"<h3>{escape(chapter.heading)}</h3>" if len(chapters) > 1 else ""
        # Counted through all chapters: a report is also told from one of the same title by its number.
        lists.append(f'{heading}<ol start="{before + 1}">{items}</ol>' if items else "")
        before += len(chapter.parts)
    return "".join(lists)


def _set_apart(part: Part, parts: Sequence[Part]) -> str:
    """The part's HTML; beside others, what screen readers list by name is called by the report it is in."""
    if len(parts) == 1:
        return part.body
    alike = sum(one.title == part.title for one in parts) > 1
    whose = f"{part.title} ({parts.index(part) + 1})" if alike else part.title
    soup = BeautifulSoup(part.body, "html.parser")
    for region in soup.select(_LANDMARKS):
        region["aria-label"] = f"{region['aria-label']}: {whose}"
    return soup.decode()


_STYLE = """.shared { border-top: 3px solid var(--line); margin-top: 3rem; padding-top: 1.5rem }
@media print { .shared { break-before: page; border: 0; margin: 0; padding: 0 } }"""
