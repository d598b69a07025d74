"""Text, tables and the frame of a page, all safe: everything escaped, three marks allowed, nothing asked for.

Names of flights, targets and columns come out of other people's logs. They reach a page through the functions
below and no other way, so that ``<script>`` in a target's name is a strange name and nothing more. What is
more than a few elements is a template of ``data/pages``, which escapes whatever is put into it. Reports,
failure pages and the ledger all come out of `page`, so a page that asks the network for something, or runs
something, cannot be made by accident: the policy in its head forbids both.
"""

from __future__ import annotations

import base64
import html
import re
from collections.abc import Collection, Mapping, Sequence
from functools import cache
from typing import TYPE_CHECKING, Any

from jinja2 import Environment, FileSystemLoader, StrictUndefined
from markupsafe import Markup

from wildlab.errors import WildlabError
from wildlab.files import csv_text
from wildlab.messages.quantities import NOTHING, duration, known, number, percent
from wildlab.names import visible
from wildlab.paths import DATA

if TYPE_CHECKING:
    import pandas as pd

#: A number and its sign stay on one line.
_PERCENT = re.compile(r"(\d) %")
_MARKS = re.compile(r"\*\*(.+?)\*\*|`(.+?)`")
_BOLD = re.compile(r"\*\*(.+?)\*\*", re.S)
_CODE = re.compile(r"`([^`\n]+)`")
_MATHS = re.compile(r"(?<!\\)\$\$(.+?)\$\$|(?<!\\)\$([^$\n]+?)\$", re.S)
_MATHML_TAG = re.compile(r"</?m[a-z]+(?: [a-zA-Z:]+=\"[^\"<>]*\")*\s*/?>")


def escape(text: object) -> str:
    """``text`` with everything HTML gives a meaning to made harmless, quotes included."""
    return html.escape(visible(text), quote=True)


def inline(text: object) -> str:
    """Escaped ``text`` in which ``**bold**`` and a `````code````` span keep their meaning."""
    kept = _PERCENT.sub("\\1\N{NO-BREAK SPACE}%", escape(text))
    return _CODE.sub(_code, _BOLD.sub(r"<b>\1</b>", kept))


def _code(match: re.Match[str]) -> str:
    # A command broken at its hyphens reads wrong; a long one has to break somewhere on a phone.
    short = ' class="short"' if len(match[1]) <= 32 else ""
    return f"<code{short}>{match[1]}</code>"


def maths(latex: str, *, block: bool = False) -> str:
    """One LaTeX formula as MathML.

    Raises
    ------
    WildlabError
        If the formula is not understood: a page must not show half-translated LaTeX.
    """
    from latex2mathml.converter import convert  # few pages have formulas

    try:
        mathml = convert(latex.strip(), display="block" if block else "inline")
    except Exception as error:  # latex2mathml has a dozen exceptions of its own and raises IndexError too
        raise WildlabError(
            f"the formula {latex.strip()!r} cannot be translated ({type(error).__name__})",
            "use simpler LaTeX; check braces and \\left/\\right pairs",
        ) from error
    unknown = re.search(r"<m[a-z]+>(\\[A-Za-z]+)", mathml)
    if unknown:
        raise WildlabError(
            f"{unknown[1]} in the formula {latex.strip()!r} has no translation", "write it another way"
        )
    # The converter does not escape what stands in \\text{}.
    if re.search("[<>]", _MATHML_TAG.sub("", mathml)):
        raise WildlabError(f"the formula {latex.strip()!r} has a bare < or > in text", "use \\lt or \\gt")
    # What may scroll sideways must be reached without a mouse.
    box = 'class="scroll formula" role="group" tabindex="0" aria-label="Formula"'
    return f"<div {box}>{mathml}</div>" if block else mathml


def prose(text: str) -> str:
    """Paragraphs, split at blank lines, with the marks of `inline` and ``$maths$`` or ``$$maths$$``."""
    paragraphs = [part for part in re.split(r"\n\s*\n", text.strip()) if part.strip()]
    return "".join(_paragraph(part) for part in paragraphs)


def _paragraph(text: str) -> str:
    pieces: list[str] = []
    at = 0
    for match in _MATHS.finditer(text):
        pieces.append(inline(text[at : match.start()].replace("\\$", "$")))
        block, within = match.groups()
        # A formula on its own line may not stand inside <p>: close it and open it again.
        pieces.append(f"</p>{maths(block, block=True)}<p>" if block else maths(within))
        at = match.end()
    pieces.append(inline(text[at:].replace("\\$", "$")))
    return re.sub(r"<p>\s*</p>", "", f"<p>{''.join(pieces)}</p>")


def slug(text: str) -> str:
    """Letters, digits and hyphens only: for the names of files and the ids of headings."""
    return re.sub(r"[^a-z0-9]+", "-", text.lower()).strip("-") or "part"


#: Bytes of a file that is put into a link, and how its address begins: a table, which no browser runs.
MOST_BYTES, HANDED_OVER = 500_000, "data:text/csv;base64,"
#: Columns of a table that still fits a phone beside one another.
NARROW = 3
#: Columns that say where on Earth something is: they are in no link.
_PLACES = re.compile(
    r"^(lat|latitude|lon|lng|longitude|mgrs|utm\w*|ecef\w*|easting\w*|northing\w*)(_|$)", re.I
)


#: The folder of templates and styles.
TEMPLATES = DATA / "pages"


def read_style(name: str) -> str:
    """A style sheet of ``data/pages``."""
    return (TEMPLATES / f"{name}.css").read_text(encoding="utf-8").strip()


@cache
def _templates() -> Environment:
    found = Environment(
        loader=FileSystemLoader(TEMPLATES),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        # Names of strangers turn no text around.
        finalize=lambda value: value if hasattr(value, "__html__") else visible(value),
    )
    found.filters["inline"] = mark_up
    found.filters |= {"percent": percent, "duration": duration}
    return found


def mark_up(text: object) -> Markup:
    """Text with its marks, as HTML; what is HTML stays as it is."""
    return text if isinstance(text, Markup) else Markup(inline(text))  # noqa: S704 - escaped there


def render(template: str, /, **values: Any) -> Markup:
    """HTML of a template of ``data/pages``: values are escaped, but for those that are `Markup` already.

    Parameters
    ----------
    template
        Its name, without ending.
    **values
        By name; one that is missing is an error.
    """
    return Markup(_templates().get_template(f"{template}.html").render(values).strip())  # noqa: S704 - escaped


def pill(word: object, colour: str = "") -> Markup:
    """A verdict in its colour: "yes", "part", "no" or ""."""
    return Markup('<span class="pill {}">{}</span>').format(colour, word)


def dim(text: object) -> Markup:
    """Text of less weight."""
    return Markup('<span class="dim">{}</span>').format(text)


def table(
    heads: Sequence[str],
    rows: Sequence[Sequence[object]],
    label: str,
    *,
    text: Collection[int] = (0,),
    wide: bool = False,
    many: bool = False,
) -> Markup:
    """A table that scrolls sideways where it has to.

    Parameters
    ----------
    heads
        Of the columns, with marks; one that is "" is no heading.
    rows
        Cells, escaped here but for HTML (`Markup`). The last cell of a short row spans what is left.
    label
        What it is, for who hears the page.
    text
        Columns of words, to the left; all others hold numbers.
    wide
        Whether the first column holds sentences.
    many
        Whether a phone shows it as a list. Roles are written out: what a style turns into a list would else
        be no table to who hears it.
    """
    labels = [
        one.striptags() if isinstance(one, Markup) else _MARKS.sub(lambda found: found[1] or found[2], one)
        for one in heads
    ]
    return render(
        "table", heads=heads, labels=labels, rows=rows, label=label, text=text, wide=wide, many=many
    )


def table_html(
    frame: pd.DataFrame,
    headings: Mapping[str, str],
    digits: Mapping[str, int] | int | None,
    label: str = "",
) -> Markup:
    """The table of a frame without its index: numbers to the right, text to the left.

    Parameters
    ----------
    frame
        Its columns.
    headings
        By column; the column's name where there is none.
    digits
        Decimals by column, or for all; three figures otherwise.
    label
        What it is, for who hears the page.
    """
    import pandas as pd  # `wildlab list` makes no table, and is there in half the time

    cells: list[list[Markup | str]] = []
    text = []
    for k, name in enumerate(frame):
        column = frame[name]
        numeric = pd.api.types.is_numeric_dtype(column) and not pd.api.types.is_bool_dtype(column)
        decimals = digits if isinstance(digits, int) else (digits or {}).get(str(name))
        if decimals is None and pd.api.types.is_integer_dtype(column):
            decimals = 0
        text += [] if numeric else [k]
        cells.append([number(value, decimals) if numeric else _cell(value) for value in column])
    titles = [headings.get(str(name), str(name)) for name in frame]
    rows = list(zip(*cells, strict=True))
    return table(titles, rows, label, text=text, many=len(titles) > NARROW)


def csv_link(frame: pd.DataFrame, name: str, words: str = "CSV") -> str:
    """A link that hands over a table as CSV, all digits; "" where it is too large, empty, or holds places.

    Parameters
    ----------
    frame
        Its columns are named in the file as here.
    name
        Of the file, without ending; anything but letters, digits and hyphens is replaced.
    words
        Of the link.

    Returns
    -------
    str
        ``<a download>`` with the file within.
    """
    content = csv_text(frame).encode("utf-8")
    if frame.empty or len(content) > MOST_BYTES or any(_PLACES.match(str(column)) for column in frame):
        return ""
    data = base64.b64encode(content).decode("ascii")
    return f'<a class="data" download="{slug(name)}.csv" href="{HANDED_OVER}{data}">{escape(words)}</a>'


def _cell(value: object) -> Markup | str:
    import pandas as pd

    if isinstance(value, bool):
        return "yes" if value else "no"
    if value is None or (isinstance(value, float) and value != value) or value is pd.NaT or value is pd.NA:
        return NOTHING
    return mark_up(known(str(value))) or (NOTHING if str(value) else "")


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
