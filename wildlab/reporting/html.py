"""An executed notebook as one HTML file that opens anywhere: no script, no network, maths as MathML.

nbconvert's template ``basic`` turns the outputs into HTML; everything around them is ours (`page`), and the
result is examined before it is written: what could ask the network for something, run something, or shut
out a reader who does not see the figures, stops the build with a sentence.
"""

from __future__ import annotations

import re
from itertools import pairwise
from typing import Any

from bs4 import BeautifulSoup, Tag
from nbconvert import HTMLExporter
from nbconvert.filters.markdown_mistune import IPythonRenderer, MarkdownWithMath
from traitlets.config import Config

from wildlab.errors import WildlabError
from wildlab.reporting.arrange import VERDICT, arranged
from wildlab.reporting.glossary import with_glossary
from wildlab.reporting.notebook_file import nbformat
from wildlab.reporting.page import page
from wildlab.reporting.text import escape, maths

MAX_BYTES = 5_000_000
#: Cells that belong to the machinery, not to the report.
REMOVED_TAGS = ("parameters", "injected-parameters", "remove_cell")
#: Elements that could run something, ask for something, or send something.
FORBIDDEN = (
    *(
        "script",
        "iframe",
        "frame",
        "object",
        "embed",
        "applet",
        "link",
        "base",
        "meta",
        "form",
        "input",
        "button",
    ),
    *("select", "textarea", "audio", "video", "source", "track", "portal", "template", "noscript"),
)
#: The classes of nbconvert's own wrappers.
_WRAPPERS = {
    *("cell", "inner_cell", "output_wrapper", "output", "output_area", "output_subarea", "text_cell_render"),
    *("prompt", "input"),
}
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


class _Renderer(IPythonRenderer):
    """Markdown cells with their maths translated here, since no script will do it in the browser."""

    def block_math(self, body: str) -> str:
        return maths(body, block=True)

    def inline_math(self, body: str) -> str:
        return maths(body)

    def multiline_math(self, text: str) -> str:
        return maths(text.strip("$"), block=True)

    def latex_environment(self, name: str, body: str) -> str:
        return maths(f"\\begin{{{name}}}{body}\\end{{{name}}}", block=True)


def _markdown(source: str) -> str:
    return str(MarkdownWithMath(renderer=_Renderer(escape=True, exclude_anchor_links=True)).render(source))


def notebook_body(notebook: nbformat.NotebookNode, *, code: bool = False) -> str:
    """What an executed notebook shows, as HTML without nbconvert's wrappers, and never its warnings.

    Parameters
    ----------
    code
        Whether to show code, prints and the bare values of last lines as well: a tutorial's, not a report's.
    """
    exporter = HTMLExporter(
        config=Config(
            {
                "TagRemovePreprocessor": {"enabled": True, "remove_cell_tags": list(REMOVED_TAGS)},
                "HTMLExporter": {
                    "template_name": "basic",
                    "exclude_input": not code,
                    "exclude_input_prompt": True,
                    "exclude_output_prompt": True,
                    "exclude_output_stdin": True,
                    "exclude_anchor_links": True,
                    "embed_images": True,
                    "require_js_url": "",
                    "mathjax_url": "",
                    "jquery_url": "",
                    "mermaid_js_url": "",
                    "widget_renderer_url": "",
                    "preprocessors": ["nbconvert.preprocessors.TagRemovePreprocessor"],
                },
            }
        )
    )
    exporter.register_filter("markdown2html", _no_context(_markdown))
    shown = nbformat.from_dict(notebook)
    for cell in shown.cells:
        if cell.cell_type == "code":
            cell.outputs = [output for output in cell.outputs if _is_shown(output, code)]
    body, _ = exporter.from_notebook_node(shown)
    soup = BeautifulSoup(body, "html.parser")
    for block in soup.find_all("div", class_=_is_wrapper):
        block.unwrap()
    # Blank lines between the parts say nothing; those within code do.
    return str(soup).strip() if code else re.sub(r"\n\s*\n+", "\n", str(soup)).strip()


def _is_shown(output: nbformat.NotebookNode, code: bool) -> bool:
    if code:
        return bool(output.get("name") != "stderr")
    # Prints, warnings and the bare value of a last line are for whoever writes the notebook.
    return bool(set(output.get("data", {})) - {"text/plain"})


def _no_context(function: Any) -> Any:
    def render(source: str, *_: Any, **__: Any) -> str:
        return str(function(source))

    return render


def _is_wrapper(name: str | None) -> bool:
    return name in _WRAPPERS


def _folded(summary: str, html: str) -> str:
    return f'<details class="plain"><summary>{escape(summary)}</summary>{html}</details>' if html else ""


def report_page(
    notebook: nbformat.NotebookNode,
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
    body = with_glossary(arranged(str(soup)))
    heading = soup.h1
    # A page that is mailed alone has nothing beside it: the way to the ledger is words, not a link.
    whole = page(
        title=heading.get_text(" ", strip=True) if heading else study,
        body=body,
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
    soup = BeautifulSoup(whole, "html.parser")
    for tag in soup.find_all(list(FORBIDDEN)):
        if tag.name == "meta" and tag.parent is not None and tag.parent.name == "head":
            continue
        raise WildlabError(
            f"the report has a <{tag.name}>", "show text, tables and pictures only, through Report", file=file
        )
    for tag in soup.find_all(True):
        _examine_attributes(tag, file, alone)
    for style in soup.find_all("style"):
        if _CSS_REQUEST.search(style.get_text()):
            raise WildlabError("a style asks the network for something", "take the url() out", file=file)
    for image in soup.find_all("img"):
        if not str(image.get("alt") or "").strip():
            raise WildlabError(
                "a picture has no alt text",
                "show it with Report.figure(alt=...), saying what it shows",
                file=file,
            )
    _examine_headings([int(tag.name[1]) for tag in soup.find_all(re.compile("^h[1-6]$"))], file)


def _examine_attributes(tag: Tag, file: str, alone: bool) -> None:
    for name, value in tag.attrs.items():
        text = " ".join(value) if isinstance(value, list) else str(value)
        if name.lower().startswith("on"):
            raise WildlabError(f"a <{tag.name}> has the script attribute {name!r}", "take it out", file=file)
        if name.lower() in _FETCHING and not text.startswith("data:image/"):
            raise WildlabError(
                f"a <{tag.name}> asks for {text[:60]!r}", "put the picture into the page itself", file=file
            )
        if name.lower() == "href":
            _examine_link(tag, text, file, alone)
        if name.lower() == "style" and _CSS_REQUEST.search(text):
            raise WildlabError("a style asks the network for something", "take the url() out", file=file)


def _examine_link(tag: Tag, to: str, file: str, alone: bool) -> None:
    """A page is mailed alone: a link leads to a place in it, hands over a file within, or to the web. One
    that is not may lead to what lies beside it or below."""
    if re.match(r"\s*(javascript|vbscript):", to, re.I):
        raise WildlabError(f"a link runs {to[:60]!r}", "link to a page", file=file)
    if re.match(r"\s*data:", to, re.I):
        if tag.get("download") is None or not to.startswith(HANDED_OVER):
            raise WildlabError(
                f"a link runs {to[:60]!r}", "hand over tables only, by wildlab.reporting.tables", file=file
            )
        return
    if to.startswith("#"):
        root = tag.find_parent("html") or tag
        if len(to) < 2 or root.find(id=to[1:]) is None:
            raise WildlabError(f"a link leads to {to!r}, which is not on the page", "mend it", file=file)
    elif not to.startswith("https://") and (alone or not _BESIDE.fullmatch(to)):
        raise WildlabError(
            f"a link leads to {to[:60]!r}, which is missing where the page is mailed alone",
            "say it in words",
            file=file,
        )


def _examine_headings(levels: list[int], file: str) -> None:
    if levels[:1] != [1] or levels.count(1) != 1:
        raise WildlabError(
            f"the report has {levels.count(1)} main headings"
            if levels.count(1) != 1
            else "a heading precedes <h1>",
            "begin the notebook with one report.head(...)",
            file=file,
        )
    for before, after in pairwise(levels):
        if after > before + 1:
            raise WildlabError(
                f"a heading of level {after} follows one of level {before}",
                "use the level between",
                file=file,
            )
