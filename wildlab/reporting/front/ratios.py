"""Published numbers as marks on one axis: ours divided by the printed one, logarithmic, the same everywhere.

A verdict has a shape and a colour, so that neither eyes nor printers that see no colour miss it. What has no
ratio (a signed mean, a zero) or was not run is not drawn; whoever draws says how many there are.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from typing import NamedTuple

from wildlab.evaluation.printed import AGREES, DIFFERS, MARGINS, NOT_JUDGED, POSSIBLE, TOO_VAGUE
from wildlab.reporting.ledger_tables import WIDEST
from wildlab.reporting.status import FIRST_LOOK, Number
from wildlab.reporting.text import escape

#: Verdicts in the order in which they are drawn, the last on top, and how each is drawn.
SHAPES = {
    FIRST_LOOK: ("look", "M0-3.6 3.6 0 0 3.6-3.6 0Z"),
    NOT_JUDGED: ("none", "M-3-3H3V3H-3Z"),
    TOO_VAGUE: ("vague", "M0-3.6a3.6 3.6 0 1 1-.01 0Z"),
    POSSIBLE: ("maybe", "M0-4.6 4.4 3.4H-4.4Z"),
    DIFFERS: ("off", "M-3.6-3.6 3.6 3.6M3.6-3.6-3.6 3.6"),
    AGREES: ("same", "M0-3.9a3.9 3.9 0 1 1-.01 0Z"),
}
#: What the axis says, by ratio.
TICKS = {1 / 8: "⅛", 1 / 4: "¼", 1 / 2: "½", 1.0: "as printed", 2.0: "2×", 4.0: "4×", 8.0: "8×"}
#: The margin of most printed numbers, the size of an error; it is shaded.
CLOSE = MARGINS["error size"].factor or 1.25
#: Half of a mark, and how far its neighbours are, in units of the drawing.
_HALF, _APART = 4.6, 8.2

# Colours are the page's own.
STYLE = """.marks{display:block;width:100%;height:auto}.marks .axis{stroke:var(--line)}
.marks .one{stroke:var(--ink)}
.marks .close,.legend .close{fill:var(--good);opacity:.13}
.same{fill:var(--good)}.off{fill:none;stroke:var(--bad);stroke-width:1.9}.maybe{fill:var(--blue)}
.vague,.none,.look{fill:none;stroke:var(--dim);stroke-width:1.5}.marks .far{fill:none;stroke:var(--ink)}
.ticks{position:relative;height:1.25em;font-size:.75rem;color:var(--dim)}
.ticks span{position:absolute;transform:translateX(-50%);white-space:nowrap}
.legend{display:flex;flex-wrap:wrap;gap:.15rem 1.2rem;margin:.5rem 0;padding:0;list-style:none;max-width:none;
color:var(--dim);font-size:.88rem}.legend li{margin:0}.legend svg{width:13px;height:13px;margin-right:.35rem;
vertical-align:-2px;overflow:visible}
@media print{.marks,.legend{print-color-adjust:exact;-webkit-print-color-adjust:exact}}"""


class Mark(NamedTuple):
    """A number drawn: where (units from the left, and from the middle down), how, and whether the axis ends
    before it (-1 left, 1 right, 0 not)."""

    x: float
    y: float
    verdict: str
    beyond: int


def place(ratio: float, width: float) -> float:
    """Where a ratio above zero lies on an axis of this width; what lies beyond its ends is put at them."""
    share = (math.log(ratio) / math.log(WIDEST) + 1) / 2
    return _HALF + min(max(share, 0.0), 1.0) * (width - 2 * _HALF)


def drawable(numbers: Iterable[Number]) -> list[Number]:
    """Those with a ratio and a shape."""
    return [one for one in numbers if one.ratio is not None and one.ratio > 0 and one.verdict in SHAPES]


def arranged(numbers: Sequence[Number], width: float, levels: int) -> list[Mark]:
    """Marks for numbers, beside one another where they would hide each other.

    Parameters
    ----------
    numbers
        From `drawable`.
    width
        Of the axis, in units.
    levels
        Rows of marks there is room for, an odd number; beyond that, marks overlap.

    Returns
    -------
    list of Mark
        In the order of `SHAPES`, and of the numbers.
    """
    middle_first = sorted(range(levels), key=lambda k: (abs(k - levels // 2), k))
    taken: dict[int, list[float]] = {k: [] for k in range(levels)}
    order = list(SHAPES)
    marks = []
    for one in sorted(numbers, key=lambda n: order.index(n.verdict), reverse=True):
        ratio = one.ratio or 0.0  # `drawable` has left out those without
        x = place(ratio, width)
        crowd = {k: sum(abs(x - other) < _APART for other in taken[k]) for k in middle_first}
        level = min(middle_first, key=lambda k: crowd[k])
        taken[level].append(x)
        beyond = 1 if ratio > WIDEST else -1 if ratio < 1 / WIDEST else 0
        marks.append(Mark(x, (level - levels // 2) * _APART, one.verdict, beyond))
    return marks[::-1]


def levels_for(numbers: Sequence[Number], width: float, most: int) -> int:
    """Rows of marks that numbers need so that none hides another, odd, and at most so many."""
    for levels in range(1, most, 2):
        marks = arranged(numbers, width, levels)
        if all(abs(a.x - b.x) >= _APART or a.y != b.y for i, a in enumerate(marks) for b in marks[:i]):
            return levels
    return most


def plot(numbers: Iterable[Number], *, alt: str, width: float = 320.0, most_levels: int = 5) -> str:
    """Numbers as marks on the axis, an SVG element.

    Parameters
    ----------
    numbers
        Those that cannot be drawn are left out.
    alt
        What a reader who cannot see it should know.
    width
        In units; the height follows from how many marks are beside one another.
    """
    shown = drawable(numbers)
    levels = levels_for(shown, width, most_levels)
    height = levels * _APART + 5
    parts = [backdrop(width, height)]
    parts += [mark_svg(one, height / 2) for one in arranged(shown, width, levels)]
    return (
        f'<svg class="marks" viewBox="0 0 {width:g} {height:g}" role="img" aria-label="{escape(alt)}">'
        f"{''.join(parts)}</svg>"
    )


def backdrop(width: float, height: float) -> str:
    """The margin, shaded, and the axis at `TICKS`."""
    left, right = place(1 / CLOSE, width), place(CLOSE, width)
    lines = "".join(
        f'<path class="{"one" if ratio == 1 else "axis"}" d="M{place(ratio, width):.1f} 0V{height:.1f}"/>'
        for ratio in TICKS
    )
    return f'<path class="close" d="M{left:.1f} 0H{right:.1f}V{height:.1f}H{left:.1f}Z"/>{lines}'


def mark_svg(one: Mark, middle: float) -> str:
    """A mark; with an arrow where the axis ends before it."""
    name, path = SHAPES[one.verdict]
    x, y = f"{one.x:.1f}", f"{middle + one.y:.1f}"
    drawn = f'<path class="{name}" transform="translate({x} {y})" d="{path}"/>'
    if one.beyond:
        tip = 8 * one.beyond
        at = one.x - tip * 1.5
        drawn += f'<path class="far" d="M{at:.1f} {y}h{tip}m{-tip / 2:g}-3 {tip / 2:g} 3 {-tip / 2:g} 3"/>'
    return drawn


def ticks(few: bool = False) -> str:
    """The axis in words, as HTML below a `plot` of the same width.

    Parameters
    ----------
    few
        Leave out quarters, for narrow ones.
    """
    left_out = (1 / 4, 4.0) if few else ()
    spans = "".join(
        f"<span{' class=near' if ratio in (1 / 2, 2.0) else ''} "
        f'style="left:{place(ratio, 320.0) / 3.2:.2f}%">'
        f"{words}</span>"
        for ratio, words in TICKS.items()
        if ratio not in left_out
    )
    return f'<div class="ticks" aria-hidden="true">{spans}</div>'


def legend(verdicts: Iterable[str]) -> str:
    """What each shape means, of the verdicts that occur, and the shaded margin; as HTML."""
    there = set(verdicts)
    items = "".join(
        f'<li><svg viewBox="-6 -6 12 12" aria-hidden="true"><path class="{name}" d="{path}"/></svg>'
        f"{escape(verdict)}</li>"
        for verdict, (name, path) in reversed(SHAPES.items())
        if verdict in there
    )
    close = (
        '<li><svg viewBox="-6 -6 12 12" aria-hidden="true"><path class="close" d="M-6-6H6V6H-6Z"/></svg>'
        f"within a factor of {CLOSE:g}</li>"
    )
    return f'<ul class="legend">{items}{close}</ul>' if there else ""
