"""A tutorial's page: an executed notebook with its code, what the code printed, and its pictures.

The frame, the security policy and the examination are those of a report (`wildlab.reporting.html`).
"""

from __future__ import annotations

import re

import nbformat
from bs4 import BeautifulSoup, Tag

from wildlab.errors import WildlabError
from wildlab.reporting.figure_text import FULL_SIZE, LEAST_SIZE
from wildlab.reporting.html import REMOVED_TAGS, examine, markdown_html
from wildlab.reporting.page import page
from wildlab.reporting.text import escape

#: The classes of nbconvert's own wrappers.
_WRAPPERS = re.compile("^(cell|inner_cell|output(_wrapper|_area|_subarea)?|text_cell_render|prompt|input)$")
# Code at a line in blue, what it printed on grey. The colours hold 4.5:1 on white.
STYLE = """
.highlight pre { background: none; border-left: 3px solid var(--blue); padding: .1rem 0 .1rem .9rem;
  margin: 1.1rem 0 .6rem }
.highlight .k, .highlight .kn, .highlight .kc, .highlight .ow { color: var(--link); font-weight: 600 }
.highlight .s1, .highlight .s2, .highlight .sa, .highlight .s { color: var(--good) }
.highlight .c1 { color: var(--dim); font-style: italic }
.highlight .mi, .highlight .mf { color: var(--warn) }
table { width: auto }
tbody th { text-align: left }
caption { text-align: left; font-weight: 600; padding: .3rem 0 }
caption ~ tbody td, caption ~ tbody th { text-align: left; white-space: normal; max-width: 34rem }
figure img { width: auto }
@media print { pre { white-space: pre-wrap; break-inside: avoid } }"""


def tutorial_page(notebook: nbformat.NotebookNode, *, name: str, footer: str = "") -> str:
    """The whole page of a tutorial, examined.

    Parameters
    ----------
    notebook
        Executed, its figures shown by `wildlab.reporting.with_alt`.
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
        `wildlab.reporting.html.examine`.
    """
    for number, cell in enumerate(notebook.cells, start=1):
        if any(output.output_type == "error" for output in cell.get("outputs", [])):
            raise WildlabError(f"cell {number} ended in an error", "mend it", file=f"{name}.ipynb")
    soup = BeautifulSoup(_body(_joined(notebook)), "html.parser")
    for block in soup.find_all("div", class_=_WRAPPERS):
        block.unwrap()
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
    whole = page(title=title, body=str(soup), kicker=way, footer=footer, style=STYLE)
    examine(whole, name)
    return whole


def _body(notebook: nbformat.NotebookNode) -> str:
    """Code and what it left, as HTML of nbconvert's template ``basic``."""
    from nbconvert import HTMLExporter
    from traitlets.config import Config

    off = ("exclude_input_prompt", "exclude_output_prompt", "exclude_output_stdin", "exclude_anchor_links")
    exporter = HTMLExporter(
        config=Config(
            {
                "TagRemovePreprocessor": {"enabled": True, "remove_cell_tags": sorted(REMOVED_TAGS)},
                "HTMLExporter": {
                    "template_name": "basic",
                    **dict.fromkeys(off, True),
                    "embed_images": True,
                    **dict.fromkeys(("require_js_url", "mathjax_url", "jquery_url", "mermaid_js_url"), ""),
                    "widget_renderer_url": "",
                    "preprocessors": ["nbconvert.preprocessors.TagRemovePreprocessor"],
                },
            }
        )
    )
    exporter.register_filter("markdown2html", lambda source, *_, **__: markdown_html(source))
    return str(exporter.from_notebook_node(notebook)[0])


def _joined(notebook: nbformat.NotebookNode) -> nbformat.NotebookNode:
    """A copy without warnings, in which what a cell printed in one go is one output: a kernel sends it in
    pieces."""
    copy: nbformat.NotebookNode = nbformat.from_dict(notebook)
    for cell in copy.cells:
        joined: list[nbformat.NotebookNode] = []
        for output in cell.get("outputs", []):
            if output.get("name") == "stderr":
                continue
            if joined and output.get("name", "") == joined[-1].get("name") and "text" in output:
                joined[-1].text += output.text
            else:
                joined.append(nbformat.from_dict(output))
        if cell.cell_type == "code":
            cell.outputs = joined
    return copy


def _frame(soup: BeautifulSoup, image: Tag, ordinal: int) -> None:
    """As `wildlab.reporting.report.Report` frames a figure: no larger than meant, and on a phone no smaller
    than can be read."""
    width = str(image.get("width") or "")
    if width.isdigit():
        least = int(width) * LEAST_SIZE // FULL_SIZE
        image["style"] = f"max-width:min({width}px,100%);min-width:{least}px"
    image.wrap(_box(soup, f"Figure {ordinal}")).wrap(soup.new_tag("figure"))


def _box(soup: BeautifulSoup, label: str) -> Tag:
    attributes = {"class": "scroll", "role": "region", "tabindex": "0", "aria-label": label}
    return soup.new_tag("div", attrs=attributes)
