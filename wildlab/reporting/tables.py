"""Tables of a report: as HTML that becomes a list on a phone, and as CSV within a link."""

from __future__ import annotations

import base64
import re
from collections.abc import Mapping

import pandas as pd

from wildlab.files import csv_text
from wildlab.reporting.text import NOTHING, escape, inline, known, number, slug

#: Bytes of a file that is put into a link; larger ones are not embedded.
MOST_BYTES = 500_000
#: Columns of a table that still fits a phone beside one another.
NARROW = 3
#: Columns that say where on Earth something is: they are in no link.
_PLACES = re.compile(
    r"^(lat|latitude|lon|lng|longitude|mgrs|utm\w*|ecef\w*|easting\w*|northing\w*)(_|$)", re.I
)


def table_html(
    frame: pd.DataFrame, headings: Mapping[str, str], digits: Mapping[str, int] | int | None
) -> str:
    """``<table>``: numbers to the right, text to the left, every cell labelled for where there is no room.

    Parameters
    ----------
    frame
        Without its index.
    headings
        By column; the column's name where there is none.
    digits
        Decimals by column, or for all; three figures otherwise.

    Returns
    -------
    str
        HTML. Roles are written out: what a style turns into a list would else be no table to who hears it.
    """
    cells: list[list[str]] = []
    classes: list[str] = []
    for name in frame:
        column = frame[name]
        numeric = pd.api.types.is_numeric_dtype(column) and not pd.api.types.is_bool_dtype(column)
        decimals = digits if isinstance(digits, int) else (digits or {}).get(str(name))
        if decimals is None and pd.api.types.is_integer_dtype(column):
            decimals = 0
        classes.append("" if numeric else ' class="text"')
        cells.append([number(value, decimals) if numeric else _words(value) for value in column])
    titles = [headings.get(str(name), str(name)) for name in frame]
    labels = [f' data-label="{escape(_plain(title))}"' for title in titles]
    head = "".join(
        f'<th role="columnheader" scope="col"{style}>{inline(title)}</th>'
        if title.strip()
        else '<td role="cell"></td>'  # a heading that says nothing is none
        for title, style in zip(titles, classes, strict=True)
    )
    rows = "".join(
        '<tr role="row">'
        + "".join(
            f'<th role="rowheader" scope="row"{style}{label}>{cell}</th>'
            if index == 0
            else f'<td role="cell"{style}{label}>{cell}</td>'
            for index, (cell, style, label) in enumerate(zip(row, classes, labels, strict=True))
        )
        + "</tr>"
        for row in zip(*cells, strict=True)
    )
    kind = ' class="many"' if len(titles) > NARROW else ""
    return (
        f'<table{kind} role="table"><thead role="rowgroup"><tr role="row">{head}</tr></thead>'
        f'<tbody role="rowgroup">{rows}</tbody></table>'
    )


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
    if frame.empty or any(_PLACES.match(str(column)) for column in frame):
        return ""
    return data_link(csv_text(frame).encode("utf-8"), "text/csv", f"{slug(name)}.csv", words)


def data_link(content: bytes, kind: str, name: str, words: str) -> str:
    """A link with a file within; "" where the file is too large for that.

    Parameters
    ----------
    content
        Of the file.
    kind
        ``text/csv`` or ``application/geo+json``.
    name
        It is saved under.
    words
        Of the link.
    """
    if len(content) > MOST_BYTES:
        return ""
    data = base64.b64encode(content).decode("ascii")
    return f'<a class="data" download="{escape(name)}" href="data:{kind};base64,{data}">{escape(words)}</a>'


def _plain(title: str) -> str:
    return re.sub(r"\*\*(.+?)\*\*|`(.+?)`", lambda match: match[1] or match[2], title)


def _words(value: object) -> str:
    if isinstance(value, bool):
        return "yes" if value else "no"
    if value is None or (isinstance(value, float) and value != value) or value is pd.NaT or value is pd.NA:
        return NOTHING
    return inline(known(str(value))) or (NOTHING if str(value) else "")
