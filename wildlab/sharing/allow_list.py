"""The first wall: what a page that goes out may consist of. Whatever is of no such kind is refused.

A page is *written* from reports' elements, attributes, words, numbers, tables, drawings and pictures, one by
one: each must be of a kind that wildlab's own reports have (``data/sharing/page.toml``). Words are those of
wildlab's own sources, so that a name, a code or a date that somebody else gave is none; numbers are written
as reports write them. There is no file beside it, no link out of it, and nothing about who made it when.
"""

from __future__ import annotations

import base64
import binascii
import csv
import io
import re
import struct
import zlib
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache
from itertools import accumulate
from pathlib import Path

from bs4 import BeautifulSoup, Tag
from bs4.element import Comment, NavigableString, PageElement
from markupsafe import Markup

from wildlab.errors import RunFailed, WildlabError
from wildlab.flight.files import read_regular, read_toml
from wildlab.paths import DATA, NOTEBOOKS, PACKAGE
from wildlab.reporting.text import escape, page, render
from wildlab.sharing.generalisation import KINDS

_VOID = frozenset(("br", "img"))
#: Numbers to a tenth, of four digits, in the lines of a drawing.
_DRAWN = r"(?:[, ]{0,3}+[MLHVZCSQTAmlhvzcsqta]{0,2}+-?+(?:1?\d{1,3}(?:\.\d)?|\.\d\d?)(?!\.?\d))*+[Zz ]{0,3}"
#: What an attribute may be, by what it holds; `Writer` has functions for the other kinds.
FORMS = {
    "word": re.compile(r"[A-Za-z][\w-]{0,40}(?: [A-Za-z][\w-]{0,40}){0,4}"),
    "size": re.compile(r"-?\d{0,4}(?:\.\d{1,3})?(?:em|rem|px|%)?"),
    "paper": re.compile(_DRAWN),
    "flag": re.compile("|true|false"),
    "widths": re.compile(r"(?:m(?:ax|in)-width:\d{1,4}(?:\.\d+)?(?:px|rem);?)*"),
    "space": re.compile(r"http://www\.w3\.org/(?:1998/Math/MathML|2000/svg)"),
}
_LANDMARKS = ("section", "nav", "aside")
#: A number as reports write it: with no more digits before the point than a count of samples has.
_NUMBER = re.compile(r"[-+\N{MINUS SIGN}]?\d{1,7}(?:\.\d+)?(?:e[-+]?\d{1,2})?")
#: A name that stands for one of somebody's (`wildlab.sharing.generalisation`), alone or with its table.
_NEUTRAL = re.compile(
    rf"(?:[a-z_]+[./])*(?:{'|'.join({*KINDS.values(), 'poses', 'truth', 'flight'})})-\d{{1,6}}"
    r"(?:[./][a-z_]+)*"
)
_CHUNK = re.compile(r"(?<!\S)(?=[^\s\d]*\d)\S+")
_AROUND = "()[]{}\"'“”‘’.,;:!?=<>≤≥≈±×·…%°²³*/$\\|"
_LETTERS = re.compile(r"[^\W\d_]+")
#: A run of letters and digits this long is a coded text: no page of ours has one.
_CODED = re.compile(r"(?=[A-Za-z0-9+/]*\d)[A-Za-z0-9+/]{28,}|[A-Za-z0-9]{40,}")
DATA_ADDRESS = re.compile(r"data:([\w/+.-]+);base64,([A-Za-z0-9+/=]*)")
#: Chunks of a PNG that draw it; another may say anything.
_DRAWING = (b"IHDR", b"PLTE", b"tRNS", b"pHYs", b"IDAT", b"IEND")
_CHANNELS = {0: 1, 2: 3, 3: 1, 4: 2, 6: 4}


#: Docstrings and comments, which are on no page and may give an example of what is not to be on one.
_NOT_WRITTEN = re.compile(r'^[ \t]*r?"""(?:[^"]|"(?!""))*"""|(?:^|[ \t]{2})#[ :!].*$', re.MULTILINE)


@cache
def _kinds() -> tuple[frozenset[str], dict[str, str]]:
    """The elements that there are, and what each attribute holds."""
    table = read_toml(DATA / "sharing" / "page.toml", "what a page may consist of")
    attributes = {name: kind for kind, names in table["attributes"].items() for name in names}
    return frozenset(name for names in table["elements"].values() for name in names), attributes


@cache
def own_text() -> str:
    """What wildlab writes, in small letters: that it stands on a page says nothing of a flight."""
    files = [*PACKAGE.rglob("*.py"), *NOTEBOOKS.glob("*.ipynb")]
    files += [DATA / "glossary.toml", DATA / "headings.toml"]
    # Not the sheet for partners: it is no report, and its words are of several languages.
    files += [path for folder in ("messages", "messages/en") for path in (DATA / folder).glob("*.toml")]
    files += (DATA / "pages").glob("*.html")
    texts = (path.read_text(encoding="utf-8", errors="replace") for path in sorted(files))
    return _NOT_WRITTEN.sub("", "\n".join(texts)).casefold()


@cache
def own_phrases() -> str:
    """Its words in order, with a blank between."""
    return " ".join(["", *re.findall(r"[^\W_]+", own_text()), ""])


@cache
def own_vocabulary() -> frozenset[str]:
    """The different ones among them."""
    return frozenset(own_phrases().split())


@cache
def sheet_words() -> frozenset[str]:
    """The words of the sheets for partners, in all their languages."""
    texts = [path.read_text(encoding="utf-8") for path in (DATA / "messages" / "edition").glob("*.toml")]
    return frozenset(re.findall(r"[^\W_]+", "\n".join(texts).casefold()))


@cache
def _own_tokens() -> frozenset[str]:
    """The same, runs of letters alone, names with _, and whatever short thing has a digit: ``H 7.2.2``."""
    text = own_text()
    chunks = {chunk.strip(_AROUND) for chunk in _CHUNK.findall(text) if len(chunk) < 20}
    return own_vocabulary() | set(_LETTERS.findall(text)) | set(re.findall(r"\w+", text)) | chunks


def first_foreign_word(text: str) -> str:
    """The first word or number in a text that no report of wildlab has; nothing where all are its own.

    Examples
    --------
    >>> texts = ("The mean error is 6.4 m, of target-2.", "seen near Skukuza", "9/17/23", "1694960631")
    >>> [first_foreign_word(text) for text in texts]
    ['', 'skukuza', '9/17/23', '1694960631']
    """
    coded = _CODED.search(text)
    if coded:
        return coded[0]
    known = _own_tokens()
    small = text.casefold()
    for chunk in _CHUNK.findall(small):
        bare = chunk.strip(_AROUND)
        ours = bare in known or _NUMBER.fullmatch(bare) or _NEUTRAL.fullmatch(bare)
        if bare and not ours:
            return str(bare)
    for word in _LETTERS.findall(small):
        if len(word) > 1 and word not in known:
            return str(word)
    return ""


class Writer:
    """Writes the elements of one report.

    Parameters
    ----------
    file
        The report, for errors.
    number
        Which one it is on its page: what it names by id then is its own.
    ids
        Of its elements; a link to another leads to its beginning.
    exact
        Whether it may have any words and numbers: it is a study's, or for those who have the flight.

    Raises
    ------
    RunFailed
        Where the report has anything that is of no known kind, with the element.
    """

    def __init__(self, file: Path, number: int, ids: frozenset[str] = frozenset(), *, exact: bool) -> None:
        self.file, self.number, self.ids, self.exact = file, number, ids, exact

    def inside(self, tag: Tag) -> str:
        """What is in an element, as HTML."""
        parts = []
        for child in tag.children:
            if isinstance(child, Tag):
                parts.append(self.element(child))
            elif type(child) is NavigableString:
                self._words(str(child), tag)
                parts.append(escape(str(child)))
            elif not isinstance(child, Comment):
                raise self._refusal(tag, f"has a {type(child).__name__} in it")
        return "".join(parts)

    def element(self, tag: Tag) -> str:
        """An element with all that is in it, as HTML; a style is none: all pages have the same."""
        if tag.name == "style":
            return ""
        if tag.name not in _kinds()[0]:
            raise self._refusal(tag, "is no element of a report")
        written = "".join(f' {name}="{escape(self._value(tag, name))}"' for name in tag.attrs)
        return f"<{tag.name}{written}>" + ("" if tag.name in _VOID else f"{self.inside(tag)}</{tag.name}>")

    def _value(self, tag: Tag, name: str) -> str:
        value = tag.attrs[name]
        text = " ".join(value) if isinstance(value, list) else str(value)
        kind = _kinds()[1].get(name, "")
        if kind in FORMS and FORMS[kind].fullmatch(text):
            self._words(text.replace("-", " ") if kind == "word" else "", tag)
            return text
        if kind == "spoken":
            self._words(text, tag)
            return f"{text} ({self.number})" if name == "aria-label" and tag.name in _LANDMARKS else text
        if kind == "naming":
            self._words(re.sub(r"[-\s]", " ", text), tag)
            return " ".join(f"r{self.number}-{word}" if word in self.ids else word for word in text.split())
        if kind == "link" and re.fullmatch(r"#[\w-]+", text):
            return f"#r{self.number}-{text[1:] if text[1:] in self.ids else 'top'}"
        if kind == "file" and re.fullmatch(r"[\w-]{1,80}\.csv", text):
            self._words(re.sub("[-.]", " ", text), tag)
            return text
        packed = DATA_ADDRESS.fullmatch(text)
        readers: dict[tuple[str, str], Callable[[bytes, Tag], bytes]] = {
            ("link", "text/csv"): self._table, ("picture", "image/png"): self._picture,
        }  # fmt: skip
        if packed and (kind, packed[1]) in readers:
            try:
                content = readers[kind, packed[1]](base64.b64decode(packed[2], validate=True), tag)
            except (binascii.Error, UnicodeDecodeError, csv.Error, struct.error, zlib.error, KeyError):
                raise self._refusal(tag, f"has a damaged {packed[1]} in it") from None
            return f"data:{packed[1]};base64,{base64.b64encode(content).decode('ascii')}"
        raise self._refusal(tag, f"has {name}={text[:60]!r}")

    def _words(self, text: str, tag: Tag) -> None:
        found = next(iter(_CODED.findall(text)), "") if self.exact else first_foreign_word(text)
        if found:
            raise self._refusal(tag, f"says {found[:60]!r}, which is no word or number of a report")

    def _table(self, content: bytes, tag: Tag) -> bytes:
        """A table as CSV: known columns, and words and numbers of ours in its cells."""
        text = content.decode("utf-8")
        rows = list(csv.reader(io.StringIO(text), strict=True))
        if len({len(row) for row in rows}) != 1:
            raise self._refusal(tag, "has a table whose rows are not equally long")
        for name in [] if self.exact else rows[0]:
            if not re.fullmatch(r"\w+", name) or name.casefold() not in _own_tokens():
                raise self._refusal(tag, f"has a table with the column {name[:60]!r}")
        for cell in {cell for row in rows for cell in row}:
            self._words(cell, tag)
        return content

    def _picture(self, content: bytes, tag: Tag) -> bytes:
        """A PNG of what draws it alone: pixels, palette and scale, and nothing behind any of them."""
        at, kept, pixels = 8, [content[:8]], b""
        width, height, depth, kind, interlaced = (*struct.unpack(">IIBB", content[16:26]), content[28])
        while at < len(content):
            size, name = struct.unpack(">I4s", content[at : at + 8])
            chunk = content[at : at + 12 + size]
            if (
                name not in _DRAWING
                or len(chunk) != 12 + size
                or (name == b"IEND" and at + 12 != len(content))
            ):
                raise self._refusal(tag, f"has a picture with {name!r} in it")
            kept.append(chunk)
            pixels += chunk[8:-4] if name == b"IDAT" else b""
            at += 12 + size
        unpacker = zlib.decompressobj()
        rows = height * (1 + (width * depth * _CHANNELS[kind] + 7) // 8)
        drawn = unpacker.decompress(pixels, rows + 1)
        whole = content[:8] == b"\x89PNG\r\n\x1a\n" and kept[-1][4:8] == b"IEND" and not interlaced
        if not whole or len(drawn) != rows or unpacker.unused_data:
            raise self._refusal(tag, "has a picture that is not its pixels alone")
        return b"".join(kept)

    def _refusal(self, tag: Tag, what: str) -> RunFailed:
        above = [
            one.name
            for one in reversed([tag, *tag.parents])
            if one.name not in ("[document]", "html", "body")
        ]
        return RunFailed(
            f"there is no copy: an element of the report {what}",
            "evaluate the flight again; if it stays, tell the makers of wildlab",
            file=self.file,
            field=" > ".join(above),
        )


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
