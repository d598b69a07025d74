"""Reports as one HTML file that opens anywhere: no script, no network, maths as MathML.

What the cells of a notebook have shown is put in the one order of a report, its words are explained, and the
page is examined before it is written. A tutorial's page also has the code, and what it printed.
"""

from __future__ import annotations

import html
import re
import sys
import tempfile
import tomllib
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from functools import cache, lru_cache
from html import unescape
from html.parser import HTMLParser
from itertools import pairwise
from pathlib import Path
from typing import Any, NamedTuple

import nbformat
from bs4 import BeautifulSoup, Tag
from bs4.element import NavigableString, PageElement
from nbformat import NotebookNode

from wildlab.errors import WildlabError
from wildlab.files import write_atomic
from wildlab.messages.catalogue import load_texts
from wildlab.paths import DATA, PACKAGE, ROOT
from wildlab.reporting.text import HANDED_OVER, escape, maths, page, read_style, render, slug

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
    _judge(groups[SUMMARY], groups[VERDICT])
    for marked in soup.find_all(None, {"data-part": True}):
        del marked["data-part"]
    _drop_bare_headings(soup)


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


def read_notebook(path: Path) -> nbformat.NotebookNode:
    """Read a notebook.

    Raises
    ------
    WildlabError
        If it is not one.
    """
    try:
        notebook: nbformat.NotebookNode = nbformat.read(path, as_version=4)
        return notebook
    except Exception as error:  # nbformat raises its own, json's and jsonschema's errors
        raise WildlabError(
            f"this is not a notebook ({type(error).__name__})", "restore the file", file=path.name
        ) from error


def write_notebook(path: Path, notebook: NotebookNode) -> None:
    """Write a notebook atomically: whoever is ended as it writes leaves the former state, not half of one."""
    write_atomic(path, nbformat.writes(notebook) + "\n")


_HEADING = re.compile(r"^#{1,6}\s+(.+?)\s*#*$", re.M)
_SHOWN_HEADING = re.compile(r"<h[1-6][^>]*>(.*?)</h[1-6]>", re.S)
_TAG = re.compile(r"<[^>]+>")
#: The tag of the cell with what a run was given.
INJECTED = "injected-parameters"
#: The tag of the cells in which papermill says where a run stopped.
_ERROR_MARK = "papermill-error-cell-tag"
_KERNEL_CELL = re.compile(r"(/[\w.+@-]+)*/ipykernel_\d+/\d+\.py")
_ANSI = re.compile(r"\x1b\[[0-9;]*[A-Za-z]")


def _assigned(parameters: Mapping[str, Any]) -> str:
    given = (f"{name} = {value!r}" for name, value in parameters.items())
    return "\n".join(["# What this run was given", *given])


def clean_text(text: str, folders: dict[str, str] | None = None) -> str:
    """``text`` with this machine's folders cut out.

    Parameters
    ----------
    folders
        What else to replace, before all: folder -> what stands for it.
    """
    text = _ANSI.sub("", text)
    if "ipykernel_" in text:
        text = _KERNEL_CELL.sub("[cell]", text)
    pattern, known = _folders_of(tuple((folders or {}).items()))
    return pattern.sub(lambda match: known[match[0]], text)


@lru_cache(maxsize=32)
def _folders_of(folders: tuple[tuple[str, str], ...]) -> tuple[re.Pattern[str], dict[str, str]]:
    """What finds folders of this machine and those given, and what stands for each spelling."""
    known = dict(folders)
    known |= {sys.prefix: "[environment]", sys.base_prefix: "[python]", str(ROOT or PACKAGE): "[wildlab]"}
    home = str(Path.home())
    known |= {tempfile.gettempdir(): "[temporary]"} | ({home: "~"} if len(home) > 1 else {})
    found = {str(Path(folder).resolve()): word for folder, word in known.items()} | known
    # Longest first: the environment may lie inside the project, and the project inside the home folder.
    # Square brackets, because some of this text is HTML already.
    spellings = sorted((one for one in found if len(one) > 1), key=len, reverse=True)
    # A full stop behind it ends a sentence, and one before a letter goes on with the name.
    return re.compile(rf"(?:{'|'.join(map(re.escape, spellings))})(?![\w-]|\.\w)"), found


def clean_notebook(
    notebook: nbformat.NotebookNode, parameters: dict[str, Any], folders: dict[str, str]
) -> nbformat.NotebookNode:
    """A copy of an executed notebook that can be passed on.

    Parameters
    ----------
    parameters
        What the cell of injected parameters shall say instead (relative folders).
    folders
        As in `clean_text`.
    """
    copy: nbformat.NotebookNode = nbformat.from_dict(_clean(dict(notebook), folders))
    copy.metadata.pop("papermill", None)
    copy.cells = [cell for cell in copy.cells if _ERROR_MARK not in cell.metadata.get("tags", [])]
    for cell in copy.cells:
        cell.metadata.pop("papermill", None)
        cell.metadata.pop("execution", None)
        if INJECTED in cell.metadata.get("tags", []):
            cell.source = _assigned(parameters)
    return copy


def _clean(value: Any, folders: dict[str, str]) -> Any:
    if isinstance(value, str):
        return clean_text(value, folders)
    if isinstance(value, dict):
        return {key: _clean(entry, folders) for key, entry in value.items()}
    if isinstance(value, list):
        return [_clean(entry, folders) for entry in value]
    return value


def step_of(notebook: Any, cell_index: int | None) -> str:
    """The heading under which a cell stands: the last one above it, in markdown or shown by a report."""
    heading = ""
    for cell in notebook.cells[: len(notebook.cells) if cell_index is None else cell_index + 1]:
        if cell.cell_type == "markdown":
            found = _HEADING.findall(cell.source)
        else:
            shown = [output.get("data", {}).get("text/html", "") for output in cell.get("outputs", [])]
            found = [_heading_text(text) for html in shown for text in _SHOWN_HEADING.findall(html)]
        heading = found[-1] if found else heading
    return heading


def _heading_text(html: str) -> str:
    return unescape(_TAG.sub("", html)).strip()


MAX_BYTES = 5_000_000
#: Cells that belong to the machinery, not to the report.
REMOVED_TAGS = frozenset({"parameters", "injected-parameters", "remove_cell"})
#: Elements that could run something, ask for something, or send something.
FORBIDDEN = re.compile(
    "script|i?frame|object|embed|applet|link|base|meta|form|input|button|select|textarea|audio|video|source|"
    "track|portal|template|noscript"
)
_CITED = re.compile(r"\b([HF])\s(?:\(?\d|(?:section|chapter|example|equation|table|figure)s?\s\(?\d)")
_FETCHING = ("src", "srcset", "poster", "background", "data", "xlink:href", "action", "formaction", "ping")
#: A link to a file in the same folder or below it: no scheme, no host.
_BESIDE = re.compile(r"[\w.%~-]+(/[\w.%~-]+)*(#[\w.%~-]*)?")
_CSS_REQUEST = re.compile(r"@import|url\s*\(\s*['\"]?(?!data:)", re.I)


def notebook_body(notebook: NotebookNode) -> str:
    """What the cells of a report have shown, as HTML: no code, no prints, no warnings, no bare values."""
    parts = []
    for cell in notebook.cells:
        if REMOVED_TAGS.intersection(cell.metadata.get("tags", ())):
            continue
        if cell.cell_type == "markdown":
            parts.append(markdown_html(cell.source))
        parts += [
            _shown_output(output)
            for output in cell.get("outputs", ())
            if {"text/html", "image/png"} & set(output.get("data", {}))
        ]
    return re.sub(r"\n\s*\n+", "\n", "\n".join(parts)).strip()


def markdown_html(source: str) -> str:
    """A cell of words as HTML, with its maths translated here, since no script will do it in the browser."""
    from nbconvert.filters.markdown_mistune import IPythonRenderer, MarkdownWithMath  # few notebooks have one

    class Renderer(IPythonRenderer):
        def block_math(self, body: str) -> str:
            return maths(body, block=True)

        def inline_math(self, body: str) -> str:
            return maths(body)

        def multiline_math(self, text: str) -> str:
            return maths(text.strip("$"), block=True)

        def latex_environment(self, name: str, body: str) -> str:
            return maths(f"\\begin{{{name}}}{body}\\end{{{name}}}", block=True)

    return str(MarkdownWithMath(renderer=Renderer(escape=True, exclude_anchor_links=True)).render(source))


def report_page(
    notebook: NotebookNode,
    *,
    study: str,
    footer: str = "",
    notice: str = "",
    alert: str = "",
    title: str = "",
    made: str = "",
) -> str:
    """The whole page of a report, examined.

    Parameters
    ----------
    footer
        HTML of the provenance line (`wildlab.runner.provenance.footer`).
    notice
        HTML of a paragraph that says that this is a first look. Nothing is claimed of one: it takes the place
        of the verdict.
    alert
        HTML of a section that stands below the heading.
    title
        Of the study, in place of the heading that the notebook has.
    made
        When, as ISO 8601; the day is shown.

    Raises
    ------
    WildlabError
        If the page would break one of the promises in `examine`.
    """
    soup = BeautifulSoup(notebook_body(notebook), "html.parser")
    if title and soup.header is not None and soup.h1 is not None:
        soup.h1.string = title
    if notice:
        _first_look(soup, notice)
    if alert and soup.header is not None:
        soup.header.insert_after(BeautifulSoup(alert, "html.parser"))
    about = footer + cited_theses(soup.get_text(" "))
    arrange_parts(soup)
    explain_words(soup)
    # A page that is mailed alone has nothing beside it: the way to the ledger is words, not a link.
    whole = page(
        title=soup.h1.get_text(" ", strip=True) if soup.h1 else study,
        body=str(soup),
        kicker=" · ".join(filter(None, [f"wildlab › {escape(study)}", escape(made[:10])])),
        footer=f'<details class="plain"><summary>How to reproduce this page</summary>{about}</details>'
        if about
        else "",
    )
    examine(whole, study)
    return whole


def finished_page(parts: Sequence[str], *, title: str, name: str, kicker: str, footer: str = "") -> str:
    """The whole page of a report that no notebook made, examined.

    Parameters
    ----------
    parts
        HTML of its parts, as `wildlab.reporting.report.Report` has them.
    title, name
        Of the page, and what it is called in errors.
    kicker, footer
        HTML above and below it.
    """
    soup = BeautifulSoup("\n".join(parts), "html.parser")
    arrange_parts(soup)
    explain_words(soup)
    whole = page(title=title, body=str(soup), kicker=kicker, footer=footer)
    examine(whole, name)
    return whole


def _first_look(soup: BeautifulSoup, notice: str) -> None:
    for one in soup.find_all(None, {"data-part": VERDICT}):
        one.decompose()
    said = BeautifulSoup(notice, "html.parser")
    if soup.find("section", class_="summary") is not None and said.p is not None:
        said.p.attrs = {"class": "verdict", "data-part": VERDICT, "data-level": "warn"}
    soup.append(said)


def cited_theses(text: str) -> str:
    """A line of HTML that says what H and F are, those of them that a text cites; "" where it cites neither.

    Examples
    --------
    >>> cited_theses("after H (5.15) to (5.17)")[:22]
    '<p>H: H. H. Helgesen, '
    >>> cited_theses("the matrix H is not a thesis")
    ''
    """
    found = set(_CITED.findall(text))
    named = [
        f"{letter}: {escape(about)}"
        for letter, about in load_texts("published").subjects.items()
        if letter in found
    ]
    return f"<p>{'. '.join(named)}.</p>" if named else ""


def examine(whole: str, name: str, *, alone: bool = True) -> None:
    """Refuse a page that breaks a promise.

    Parameters
    ----------
    whole, name
        The page, and what it is called.
    alone
        Whether it may be mailed alone. The pages of the folder of reports lead to one another.

    Raises
    ------
    WildlabError
        If the page is above 5 MB, has something that runs, asks the network or sends, an image without alt
        text, headings that are out of order, or a link that leads nowhere once the page is mailed alone.
    """
    file = f"{name}/report.html"
    size = len(whole.encode("utf-8"))
    if size > MAX_BYTES:
        raise WildlabError(
            f"the report has {size / 1e6:.1f} MB, more than {MAX_BYTES / 1e6:.0f} MB",
            "show fewer points or figures",
            file=file,
        )
    examiner = _Examiner(file, alone)
    examiner.feed(whole)
    examiner.close()
    examiner.conclude()


class _Examiner(HTMLParser):
    """Goes through a page once, and stops at what it must not have."""

    def __init__(self, file: str, alone: bool) -> None:
        super().__init__()
        self.file, self.alone = file, alone
        self.in_head, self.in_style = True, False
        self.levels: list[int] = []
        self.ids: set[str] = set()
        self.within: list[str] = []

    def refuse(self, problem: str, fix: str) -> None:
        raise WildlabError(problem, fix, file=self.file)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        if FORBIDDEN.fullmatch(tag) and not (tag == "meta" and self.in_head):
            self.refuse(f"the report has a <{tag}>", "leave it out")
        given = dict(attrs)
        for name, value in attrs:
            self.examine_attribute(tag, name, value or "")
            if name == "href":
                self.examine_link(value or "", "download" in given)
        if tag == "img" and not (given.get("alt") or "").strip():
            self.refuse("a picture has no alt text", "say what it shows")
        if re.fullmatch("h[1-6]", tag):
            self.levels.append(int(tag[1]))
        self.ids.add(given.get("id") or "")
        self.in_style = tag == "style"

    def handle_endtag(self, tag: str) -> None:
        self.in_head = self.in_head and tag != "head"
        self.in_style = False

    def handle_data(self, data: str) -> None:
        if self.in_style:
            self.examine_style(data)

    def examine_style(self, text: str) -> None:
        if _CSS_REQUEST.search(text):
            self.refuse("a style asks the network for something", "take the url() out")

    def examine_attribute(self, tag: str, name: str, value: str) -> None:
        if name.startswith("on"):
            self.refuse(f"a <{tag}> has the script attribute {name!r}", "take it out")
        if name in _FETCHING and not value.startswith("data:image/"):
            self.refuse(f"a <{tag}> asks for {value[:60]!r}", "put the picture into the page itself")
        if name == "style":
            self.examine_style(value)

    def examine_link(self, to: str, download: bool) -> None:
        """A page is mailed alone: a link leads to a place in it, hands over a file within, or to the web. One
        that is not may lead to what lies beside it or below."""
        scheme = to.strip().lower()
        if scheme.startswith(("javascript:", "vbscript:")):
            self.refuse(f"a link runs {to[:60]!r}", "link to a page")
        elif scheme.startswith("data:"):
            if not download or not to.startswith(HANDED_OVER):
                self.refuse(f"a link runs {to[:60]!r}", "hand over tables only")
        elif to.startswith("#"):
            self.within.append(to)
        elif not to.startswith("https://") and (self.alone or not _BESIDE.fullmatch(to)):
            problem = f"a link leads to {to[:60]!r}, which is missing where the page is mailed alone"
            self.refuse(problem, "say it in words")

    def conclude(self) -> None:
        """What only the whole page can tell."""
        for to in self.within:
            if to == "#" or to[1:] not in self.ids:
                self.refuse(f"a link leads to {to!r}, which is not on the page", "mend it")
        mains = self.levels.count(1)
        if mains != 1 or self.levels[0] != 1:
            problem = f"the report has {mains} main headings" if mains != 1 else "a heading precedes <h1>"
            self.refuse(problem, "begin the notebook with one report.head(...)")
        for before, after in pairwise(self.levels):
            if after > before + 1:
                problem = f"a heading of level {after} follows one of level {before}"
                self.refuse(problem, "use the level between")


# Code at a line in blue, what it printed on grey. The colours hold 4.5:1 on white.
TUTORIAL_STYLE = read_style("tutorial")


def tutorial_page(notebook: nbformat.NotebookNode, *, name: str, footer: str = "") -> str:
    """The whole page of a tutorial, examined.

    Parameters
    ----------
    notebook
        Executed, its figures shown by `wildlab.reporting.figures.with_alt`.
    name
        Of its file, without ending.
    footer
        HTML of the line that says what it was made by.

    Returns
    -------
    str
        One file that needs nothing beside it.

    Raises
    ------
    WildlabError
        Where the notebook was stopped by an error, or the page would break one of the promises of
        `wildlab.reporting.notebook_pages.examine`.
    """
    for number, cell in enumerate(notebook.cells, start=1):
        if any(output.output_type == "error" for output in cell.get("outputs", [])):
            raise WildlabError(f"cell {number} ended in an error", "mend it", file=f"{name}.ipynb")
    soup = BeautifulSoup("\n".join(_tutorial_parts(notebook)), "html.parser")
    for style in soup.find_all("style"):
        style.decompose()  # pandas has its own for each table
    for i, image in enumerate(soup.find_all("img"), start=1):
        _frame(soup, image, i)
    for i, table in enumerate(soup.find_all("table"), start=1):
        table.attrs.pop("border", None)
        table.wrap(_box(soup, f"Table {i}"))
        for cell in table.find_all("th"):
            if not cell.get_text(strip=True):
                cell.name = "td"  # over the names of rows pandas leaves a heading of nothing
    for i, block in enumerate(soup.find_all("pre"), start=1):
        # What scrolls sideways must be reached without a mouse.
        block.attrs |= {"tabindex": "0", "role": "region", "aria-label": f"Code or output {i}"}
    title = soup.h1.get_text(" ", strip=True) if soup.h1 else name
    way = f"wildlab › tutorials › {escape(name)}"
    whole = page(title=title, body=str(soup), kicker=way, footer=footer, style=TUTORIAL_STYLE)
    examine(whole, name)
    return whole


def _tutorial_parts(notebook: nbformat.NotebookNode) -> Iterator[str]:
    """Words, code and what it left, as HTML; warnings are left out."""
    from nbconvert.filters.highlight import Highlight2HTML

    colour = Highlight2HTML()
    for cell in notebook.cells:
        if REMOVED_TAGS.intersection(cell.metadata.get("tags", ())):
            continue
        yield markdown_html(cell.source) if cell.cell_type == "markdown" else colour(cell.source)
        printed = ""
        for output in cell.get("outputs", []):
            # A kernel sends in pieces what a cell printed in one go.
            if output.get("name") == "stdout":
                printed += output.text
            elif output.output_type != "stream":
                yield _printed(printed) + _shown_output(output)
                printed = ""
        yield _printed(printed)


def _printed(text: str) -> str:
    return f"<pre>{escape(text)}</pre>" if text else ""


def _shown_output(output: nbformat.NotebookNode) -> str:
    """What a cell has shown, in its richest form."""
    data = output.get("data", {})
    if "text/html" in data or "image/png" not in data:
        return str(data.get("text/html") or _printed(data.get("text/plain", "")))
    about = output.metadata.get("image/png", {})
    size = "".join(f' {name}="{about[name]}"' for name in ("width", "height") if name in about)
    source = f"data:image/png;base64,{data['image/png'].strip()}"
    return f'<img alt="{escape(about.get("alt", ""))}"{size} src="{source}">'


def _frame(soup: BeautifulSoup, image: Tag, ordinal: int) -> None:
    """As `wildlab.reporting.report.Report` frames a figure: no larger than meant, and on a phone no smaller
    than can be read."""
    from wildlab.reporting.figures import FULL_SIZE, LEAST_SIZE  # matplotlib takes a while

    width = str(image.get("width") or "")
    if width.isdigit():
        least = int(width) * LEAST_SIZE // FULL_SIZE
        image["style"] = f"max-width:min({width}px,100%);min-width:{least}px"
    image.wrap(_box(soup, f"Figure {ordinal}")).wrap(soup.new_tag("figure"))


def _box(soup: BeautifulSoup, label: str) -> Tag:
    attributes = {"class": "scroll", "role": "region", "tabindex": "0", "aria-label": label}
    return soup.new_tag("div", attrs=attributes)
