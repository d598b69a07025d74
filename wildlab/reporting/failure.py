"""The page a failed run leaves in place of its report: what failed, where, and what to do, in plain words."""

from __future__ import annotations

import re
from typing import Any

from wildlab.reporting.page import page
from wildlab.reporting.text import escape, inline

_HEADING = re.compile(r"^#{1,6}\s+(.+?)\s*#*$", re.M)
_SHOWN_HEADING = re.compile(r"<h[1-6][^>]*>(.*?)</h[1-6]>", re.S)
_TAG = re.compile(r"<[^>]+>")


def step_of(notebook: Any, cell_index: int | None) -> str:
    """The heading under which a cell stands: the last one above it, in markdown or shown by a report."""
    heading = ""
    for cell in notebook.cells[: len(notebook.cells) if cell_index is None else cell_index + 1]:
        if cell.cell_type == "markdown":
            found = _HEADING.findall(cell.source)
        else:
            shown = [output.get("data", {}).get("text/html", "") for output in cell.get("outputs", [])]
            found = [_plain(text) for html in shown for text in _SHOWN_HEADING.findall(html)]
        heading = found[-1] if found else heading
    return heading


def _plain(html: str) -> str:
    from html import unescape

    return unescape(_TAG.sub("", html)).strip()


def failure_page(
    status: dict[str, Any], *, title: str, step: str, details: str, again: str, footer: str = ""
) -> str:
    """The whole page.

    Parameters
    ----------
    status
        Content of ``status.json``; its ``reason`` is the sentence shown.
    title
        The study's title.
    step
        Heading near which it stopped; "" where it did not get that far.
    details
        For whoever mends it: the traceback.
    again
        What to type to run it again.
    """
    study = str(status["study"])
    where = (
        f"It stopped in the step <b>{escape(step)}</b>"
        if step
        else "It stopped before its first step was done"
    )
    after = f"{where}, after {status['seconds']:.0f} s."
    steps = [
        "If the sentence above names a file, an option or a download, mend that first.",
        f"Run it again: `{again}`",
        "If it stops again, open `notebook.ipynb` beside this page: it is the run as far as it came, "
        "and its last cells show what was being computed.",
    ]
    body = (
        f"<header><h1>{inline(title)}</h1></header>\n"
        '<section class="summary bad" aria-label="Summary"><p>'
        "<b>This study failed, so there are no results to show.</b></p>"
        f'<p class="verdict"><span class="pill no">did not finish</span> {inline(status["reason"])}</p>'
        f"</section>\n<p>{after}</p>\n"
        f"<h2>What to do</h2>\n<ol>{''.join(f'<li>{inline(step)}</li>' for step in steps)}</ol>\n"
    )
    if details.strip():
        body += (
            '<details><summary>Technical details</summary><pre tabindex="0" role="group" '
            f'aria-label="Traceback">{escape(details.strip())}</pre></details>\n'
        )
    return page(title=f"Failed: {title}", body=body, kicker=f"wildlab › {escape(study)}", footer=footer)
