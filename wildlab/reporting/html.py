"""An executed notebook as one HTML file that opens anywhere: no script, no network, maths as MathML.

What the cells have shown is put in the order of a page (`arrange`) and into its frame (`page`), and the
result is examined before it is written: what could ask the network for something, run something, or shut
out a reader who does not see the figures, stops the build with a sentence.
"""

from __future__ import annotations

import re
from html.parser import HTMLParser
from itertools import pairwise

from bs4 import BeautifulSoup
from nbformat import NotebookNode

from wildlab.errors import WildlabError
from wildlab.reporting.arrange import VERDICT, arrange_parts
from wildlab.reporting.glossary import explain_words
from wildlab.reporting.page import page
from wildlab.reporting.text import escape, maths

MAX_BYTES = 5_000_000
#: Cells that belong to the machinery, not to the report.
REMOVED_TAGS = frozenset({"parameters", "injected-parameters", "remove_cell"})
#: Elements that could run something, ask for something, or send something.
FORBIDDEN = re.compile(
    "script|i?frame|object|embed|applet|link|base|meta|form|input|button|select|textarea|audio|video|source|"
    "track|portal|template|noscript"
)
#: The theses, as reports cite them: "H 5.6.1", "H (7.35)", "F table 3.1" (in full: ``docs/references.md``).
THESES = {
    "H": "H. H. Helgesen, Detection and Tracking of Floating Objects using UAVs with Optical Sensors, "
    "doctoral thesis, Norwegian University of Science and Technology, 2019",
    "F": "A. Flodell and C. Christensson, Wildlife Surveillance Using a UAV and Thermal Imagery, "
    "master's thesis, Linköping University, 2016",
}
_CITED = re.compile(r"\b([HF])\s(?:\(?\d|(?:section|chapter|example|equation|table|figure)s?\s\(?\d)")
#: How the address begins of a file within a link: a table or points, which no browser runs.
HANDED_OVER = ("data:text/csv;base64,", "data:application/geo+json;base64,")
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
        for output in cell.get("outputs", ()):
            data = output.get("data", {})
            if "text/html" in data:
                parts.append(data["text/html"])
            elif "image/png" in data:
                alt = escape(output.metadata.get("image/png", {}).get("alt", ""))
                parts.append(f'<img alt="{alt}" src="data:image/png;base64,{data["image/png"].strip()}">')
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


def _folded(summary: str, html: str) -> str:
    return f'<details class="plain"><summary>{escape(summary)}</summary>{html}</details>' if html else ""


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
        HTML of the provenance line (`wildlab.runner.record.provenance.footer`).
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
    cited = cited_theses(soup.get_text(" "))
    arrange_parts(soup)
    explain_words(soup)
    # A page that is mailed alone has nothing beside it: the way to the ledger is words, not a link.
    whole = page(
        title=soup.h1.get_text(" ", strip=True) if soup.h1 else study,
        body=str(soup),
        kicker=" · ".join(filter(None, [f"wildlab › {escape(study)}", escape(made[:10])])),
        footer=_folded("How to reproduce this page", footer + cited),
    )
    examine(whole, study)
    return whole


def _first_look(soup: BeautifulSoup, notice: str) -> None:
    for one in soup.select(f"[data-part={VERDICT}]"):
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
    named = [f"{letter}: {escape(about)}" for letter, about in THESES.items() if letter in found]
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
            "show fewer points, or fewer and smaller figures",
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
            self.refuse(f"the report has a <{tag}>", "show text, tables and pictures only, through Report")
        given = dict(attrs)
        for name, value in attrs:
            self.examine_attribute(tag, name, value or "")
            if name == "href":
                self.examine_link(value or "", "download" in given)
        if tag == "img" and not (given.get("alt") or "").strip():
            self.refuse(
                "a picture has no alt text", "show it with Report.figure(alt=...), saying what it shows"
            )
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
                self.refuse(f"a link runs {to[:60]!r}", "hand over tables only, by wildlab.reporting.tables")
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
