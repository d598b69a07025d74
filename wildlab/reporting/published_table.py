"""Tables of a study's page: published numbers with ours drawn beside them, and claims, a line each."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from wildlab.evaluation.replication import Closeness, Compatibility
from wildlab.messages.page_texts import fill, load_texts, unit_words, words_of
from wildlab.names import listed
from wildlab.reporting.ledger_tables import PILLS, has_band, strip
from wildlab.reporting.status import Number
from wildlab.reporting.text import NOTHING, escape, inline, number

#: A sign and a colour for each answer, so that neither tells alone.
SIGNS: Mapping[str, tuple[str, str]] = {
    Closeness.CLOSE: ("✓", "yes"),
    Closeness.NOT_CLOSE: ("✗", "no"),
    Closeness.CANNOT_TELL: ("?", "part"),
    Compatibility.WITHIN: ("✓", "yes"),
    Compatibility.OUTSIDE: ("✗", "no"),
    Compatibility.TOO_FEW: ("?", "part"),
    Compatibility.NO_POWER: ("?", "part"),
}
#: Rows beyond these are folded away.
LONGEST = 12
_HEADINGS = ("", "", "published", "here", "published ○, here ●", "close", "within")


def published_table(
    numbers: Sequence[Number], subjects: Mapping[str, str], quantities: Mapping[str, str]
) -> str:
    """A row for each published number.

    Parameters
    ----------
    numbers
        From `wildlab.reporting.verdicts.compared_number`, in the order of the table.
    subjects, quantities
        Words for their subjects and names; what has none goes by its name.

    Returns
    -------
    str
        HTML; "" where there are none.
    """
    if not numbers:
        return ""
    band = ", range ▬" if any(map(has_band, numbers)) else ""
    headings = [one + band if "●" in one else one for one in _HEADINGS]
    labels = [f' data-label="{escape(one)}"' if one else "" for one in headings]
    heads = "".join(
        f'<th role="columnheader" scope="col"{_text(i)}>{one}</th>' if one else '<td role="cell"></td>'
        for i, one in enumerate(headings)
    )
    rows = "".join(_row(one, subjects, quantities, labels) for one in numbers)
    return (
        '<div class="scroll" role="group" tabindex="0" aria-label="Published numbers and ours">'
        f'<table class="many" role="table"><thead role="rowgroup"><tr role="row">{heads}</tr></thead>'
        f'<tbody role="rowgroup">{rows}</tbody></table></div>'
    )


def claims_table(rows: Sequence[tuple[str, str, str, str, str]]) -> str:
    """A row for each claim: its text and source, the verdict, on how much it is true, and the difference.

    Parameters
    ----------
    rows
        Text, source, verdict, share and difference of each, in words.

    Returns
    -------
    str
        HTML; the last columns are left out where no claim has anything in them.
    """
    filled = max((2 + (2 if one[4] else 1 if one[3] else 0) for one in rows), default=2)
    headings = ("claim", "verdict", "true on", "difference")[:filled]
    heads = "".join(
        f'<th role="columnheader" scope="col" class="text{" wide" if i == 0 else ""}">{one}</th>'
        for i, one in enumerate(headings)
    )
    body = []
    for text, source, verdict, *effects in rows:
        where = f' <span class="dim">{escape(source)}</span>' if source else ""
        pill = f'<span class="pill {PILLS.get(verdict, "")}">{escape(verdict)}</span>'
        cells = "".join(
            f'<td role="cell" class="text" data-label="{label}">{inline(one)}</td>'
            for label, one in zip(headings[2:], effects, strict=False)
        )
        body.append(
            f'<tr role="row"><th role="rowheader" scope="row" class="text wide">{inline(text)}{where}</th>'
            f'<td role="cell" class="text">{pill}</td>{cells}</tr>'
        )
    return (
        '<div class="scroll" role="group" tabindex="0" aria-label="Claims">'
        f'<table class="many" role="table"><thead role="rowgroup"><tr role="row">{heads}</tr></thead>'
        f'<tbody role="rowgroup">{"".join(body)}</tbody></table></div>'
    )


def caption_of(numbers: Sequence[Number]) -> str:
    """What *close* and *within* mean for the kinds of numbers that there are, and where these are from."""
    texts = load_texts("published").answers
    kinds = list(dict.fromkeys(one.kind for one in numbers))
    said = [texts[kind.replace(" ", "-")] for kind in kinds]
    return " ".join([*said, texts["signs"], fill(texts["sources"], {}, {"sources": sources_of(numbers)})])


def sources_of(numbers: Sequence[Number]) -> str:
    """The tables that the published numbers are from: "H table 7.5 and H table 7.6"."""
    return listed(list(dict.fromkeys(one.source for one in numbers)))


def _row(
    one: Number, subjects: Mapping[str, str], quantities: Mapping[str, str], labels: Sequence[str]
) -> str:
    unit = unit_words(one.unit).strip()
    quantity = words_of(quantities, one.name) + (f" ({unit})" if unit else "")
    quantity += ", size" if one.by_size else ""
    near, inside = one.answers
    cells = (
        inline(words_of(subjects, one.subject)),
        inline(quantity),
        number(one.published, one.digits),
        number(one.here, one.digits + 1),
        strip(one),
        _sign(near) + (" fitted" if one.fitted else ""),
        _sign(inside) + (' <span class="dim">counted elsewhere</span>' if one.again else ""),
    )
    tags = [
        f'<{tag} role="{role}"{_text(i)}{labels[i]}>{cell}</{tag[:2]}>'
        for i, (cell, (tag, role)) in enumerate(
            zip(cells, [('th scope="row"', "rowheader"), *[("td", "cell")] * 6], strict=True)
        )
    ]
    return f'<tr role="row">{"".join(tags)}</tr>'


def _sign(answer: str) -> str:
    if answer not in SIGNS:
        return f'<span class="dim">{escape(answer)}</span>' if answer != Closeness.NOT_JUDGED else NOTHING
    sign, pill = SIGNS[answer]
    return f'<span class="pill {pill}" role="img" aria-label="{escape(answer)}">{sign}</span>'


def _text(column: int) -> str:
    return ' class="text"' if column in (0, 1, 5, 6) else ""
