"""A result in a few lines: text where it is printed, a table where a notebook shows it.

Names come from logs and may be anything, so what a terminal or a browser would obey is made harmless. What is
shown tells how much there is and how good it is, and never where: no coordinates, no folders.
"""

from __future__ import annotations

from collections.abc import Sequence
from html import escape
from typing import NamedTuple

#: Longer texts are cut: a name may be a megabyte.
LONGEST = 200
#: Rows that are shown at most.
MOST_ROWS = 40


class Summary(NamedTuple):
    """What is shown: a title, rows of cells, all equally long, and headings where there are more than two."""

    title: str
    rows: Sequence[Sequence[str]]
    head: Sequence[str] = ()


class Brief:
    """A result that prints as its `brief`: a few lines, or in Jupyter a table."""

    def brief(self) -> Summary:
        """What there is to say about it, without any place."""
        raise NotImplementedError

    def __repr__(self) -> str:
        return as_text(self.brief())

    def _repr_html_(self) -> str:
        return as_html(self.brief())


def as_text(summary: Summary) -> str:
    """A summary as lines of text.

    Parameters
    ----------
    summary
        What to show.

    Returns
    -------
    str

    Examples
    --------
    >>> print(as_text(Summary("Flight lake", [("kind", "twin"), ("locations", "withheld")])))
    Flight lake
      kind       twin
      locations  withheld
    """
    rows = [
        [_plain(cell) for cell in row] for row in (*([summary.head] if summary.head else []), *_few(summary))
    ]
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    lines = [
        "  ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True)).rstrip() for row in rows
    ]
    return "\n".join([_plain(summary.title), *(f"  {line}" for line in lines), *_rest(summary, "  ")])


def as_html(summary: Summary) -> str:
    """A summary as an HTML table without style or script; every text in it is escaped.

    Parameters
    ----------
    summary
        What to show.

    Returns
    -------
    str

    Examples
    --------
    >>> as_html(Summary("<b>", [("a", "1")]))
    '<table><caption>&lt;b&gt;</caption><tbody><tr><th scope="row">a</th><td>1</td></tr></tbody></table>'
    """
    head = "".join(f'<th scope="col">{_safe(cell)}</th>' for cell in summary.head)
    body = "".join(
        f'<tr><th scope="row">{_safe(row[0])}</th>'
        + "".join(f"<td>{_safe(cell)}</td>" for cell in row[1:])
        + "</tr>"
        for row in _few(summary)
    )
    return (
        f"<table><caption>{_safe(summary.title)}</caption>"
        + (f"<thead><tr>{head}</tr></thead>" if head else "")
        + f"<tbody>{body}</tbody></table>"
        + "".join(f"<p>{line}</p>" for line in _rest(summary, ""))
    )


def _few(summary: Summary) -> Sequence[Sequence[str]]:
    return summary.rows[:MOST_ROWS]


def _rest(summary: Summary, indent: str) -> list[str]:
    more = len(summary.rows) - MOST_ROWS
    return [f"{indent}and {more} more"] if more > 0 else []


def _plain(text: str) -> str:
    short = text if len(text) <= LONGEST else f"{text[: LONGEST - 3]}..."
    return short if short.isprintable() else repr(short)


def _safe(text: str) -> str:
    return escape(_plain(text))
