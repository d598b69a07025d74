"""The one page frame of everything we show: head, security policy, style.

Reports, failure pages and the ledger all come out of `page`, so a page that asks the network for something,
or runs something, cannot be made by accident: the policy in its head forbids both. What is more than a few
elements is a template of ``data/pages``, which escapes whatever is put into it.
"""

from __future__ import annotations

from typing import Any

from markupsafe import Markup

from wildlab.reporting.text import escape, read_style, render

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
STYLE = read_style("page")


def first_look_notice(look: str, again: str) -> str:
    """What is said of a first look, as HTML.

    Parameters
    ----------
    look
        What it shows of what: "5 of 200 flights".
    again
        What to type for the full numbers.
    """
    return render("first-look", look=look, again=again)


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
    parts = {"body": body, "kicker": kicker, "footer": footer, "style": f"{STYLE}\n{style}".strip()}
    return (
        render(
            "page",
            title=title,
            policy=POLICY,
            **{name: Markup(part) for name, part in parts.items()},  # noqa: S704 - HTML, as the caller says
        )
        + "\n"
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
    body = render("failure", status=status, title=title, step=step, details=details.strip(), again=again)
    kicker = f"wildlab › {escape(str(status['study']))}"
    return page(title=f"Failed: {title}", body=body, kicker=kicker, footer=footer)
