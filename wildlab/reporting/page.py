"""The one page frame of everything we show: head, security policy, style.

Reports, failure pages and the ledger all come out of `page`, so a page that asks the network for something,
or runs something, cannot be made by accident: the policy in its head forbids both.
"""

from __future__ import annotations

from typing import Any

from wildlab.paths import DATA
from wildlab.reporting.text import escape, inline

POLICY = "default-src 'none'; img-src data:; style-src 'unsafe-inline'; base-uri 'none'; form-action 'none'"

#: What each kind of report is called.
TAGS = {
    "logged": "logged flight",
    "twin": "simulated flight (twin)",
    "computed": "computed, no flight",
    "images": "images",
}

#: The pill that goes with the colour of a bar.
PILLS = {"good": "yes", "warn": "part", "bad": "no", "neutral": ""}
#: How every page looks.
STYLE = (DATA / "pages" / "page.css").read_text(encoding="utf-8").strip()


def first_look_notice(look: str, again: str) -> str:
    """What is said of a first look, as HTML.

    Parameters
    ----------
    look
        What it shows of what: "5 of 200 flights".
    again
        What to type for the full numbers.
    """
    return (
        f'<p class="look"><span class="pill part">first look</span> {escape(look)}. '
        f"For the full numbers: <code>make reports</code>, or <code>{escape(again)}</code>.</p>"
    )


def page(*, title: str, body: str, kicker: str = "", footer: str = "", style: str = "") -> str:
    """A whole HTML document.

    Parameters
    ----------
    title
        Text of ``<title>``; escaped here.
    body, kicker, footer
        HTML, made of `wildlab.reporting.text` pieces. ``kicker`` is the line above the ``<h1>`` in ``body``.
    style
        CSS that this page has besides `STYLE`.
    """
    above = f'<p class="kicker">{kicker}</p>\n' if kicker else ""
    below = f"<footer>{footer}</footer>\n" if footer else ""
    rules = f"{STYLE}\n{style}" if style else STYLE
    return (
        '<!doctype html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n'
        '<meta name="viewport" content="width=device-width, initial-scale=1">\n'
        f'<meta http-equiv="Content-Security-Policy" content="{POLICY}">\n'
        '<meta name="referrer" content="no-referrer">\n'
        f"<title>{escape(title)}</title>\n<style>\n{rules}\n</style>\n</head>\n<body>\n"
        f"<main>\n{above}{body}\n</main>\n{below}</body>\n</html>\n"
    )


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
