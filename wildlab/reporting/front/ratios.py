"""Published numbers as marks on one axis: ours divided by the printed one, logarithmic, the same everywhere.

Whether a number is close is a shape; whether it is within the prediction interval of our flights is a
colour, and a ring around what is outside, so that neither eyes nor printers that see no colour miss it.
What was fitted is underlined. What has no ratio (a signed mean, a zero) or was not run is not drawn;
whoever draws says how many.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from typing import NamedTuple

from wildlab.evaluation.replication import KINDS, Closeness, Compatibility
from wildlab.reporting.ledger_tables import WIDEST
from wildlab.reporting.status import FIRST_LOOK, Number
from wildlab.reporting.text import escape

#: Answers to "close?" in the order in which they are drawn, the last on top, and how each is drawn.
SHAPES: dict[str, tuple[str, str]] = {
    FIRST_LOOK: ("look", "M0-3.6 3.6 0 0 3.6-3.6 0Z"),
    Closeness.NOT_JUDGED: ("none", "M-3-3H3V3H-3Z"),
    Closeness.CANNOT_TELL: ("vague", "M0-3.2a3.2 3.2 0 1 1-.01 0Z"),
    Closeness.NOT_CLOSE: ("off", "M-3.6-3.6 3.6 3.6M3.6-3.6-3.6 3.6"),
    Closeness.CLOSE: ("same", "M0-3.6a3.6 3.6 0 1 1-.01 0Z"),
}
#: Around what is outside; below what is fitted.
RING, UNDERLINE = "M0-5.4a5.4 5.4 0 1 1-.01 0Z", "M-4 6.4H4"
#: What the axis says, by ratio.
TICKS = {1 / 8: "⅛", 1 / 4: "¼", 1 / 2: "½", 1.0: "published", 2.0: "2×", 4.0: "4×", 8.0: "8×"}
#: The margin of most published numbers, the size of an error; it is shaded.
CLOSE = KINDS["error size"].factor
#: Half of a mark, and how far its neighbours are, in units of the drawing.
_HALF, _APART = 6.0, 8.6

# Colours are the page's own.
STYLE = """.marks{display:block;width:100%;height:auto}.marks .axis{stroke:var(--line)}
.marks .one{stroke:var(--ink)}
.marks .close,.legend .close{fill:var(--good);opacity:.13}
.mark path{fill:none;stroke:var(--dim);stroke-width:1.6}.mark .same{fill:var(--dim);stroke:none}
.mark.within path{stroke:var(--good)}.mark.within .same{fill:var(--good);stroke:none}
.mark.outside path{stroke:var(--bad)}.mark.outside .same{fill:var(--bad);stroke:none}
.mark .ring{stroke-width:1}.marks .far{fill:none;stroke:var(--ink)}
.ticks{position:relative;height:1.25em;font-size:.75rem;color:var(--dim)}
.ticks span{position:absolute;transform:translateX(-50%);white-space:nowrap}
.legend{display:flex;flex-wrap:wrap;gap:.15rem 1.2rem;margin:.5rem 0;padding:0;list-style:none;max-width:none;
color:var(--dim);font-size:.88rem}.legend li{margin:0}.legend svg{width:13px;height:13px;margin-right:.35rem;
vertical-align:-2px;overflow:visible}
@media print{.marks,.legend{print-color-adjust:exact;-webkit-print-color-adjust:exact}}"""


class Mark(NamedTuple):
    """A number drawn: where (units from the left, and from the middle down), both answers, whether it is
    fitted, and whether the axis ends before it (-1 left, 1 right, 0 not)."""

    x: float
    y: float
    closeness: str
    compatibility: str
    fitted: bool
    beyond: int


def place(ratio: float, width: float) -> float:
    """Where a ratio above zero lies on an axis of this width; what lies beyond its ends is put at them."""
    share = (math.log(ratio) / math.log(WIDEST) + 1) / 2
    return _HALF + min(max(share, 0.0), 1.0) * (width - 2 * _HALF)


def drawable(numbers: Iterable[Number]) -> list[Number]:
    """Those with a ratio and a shape."""
    return [one for one in numbers if one.ratio is not None and one.ratio > 0 and one.answers[0] in SHAPES]


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
    for one in sorted(numbers, key=lambda n: order.index(n.answers[0]), reverse=True):
        ratio = one.ratio or 0.0  # `drawable` has left out those without
        x = place(ratio, width)
        crowd = {k: sum(abs(x - other) < _APART for other in taken[k]) for k in middle_first}
        level = min(middle_first, key=lambda k: crowd[k])
        taken[level].append(x)
        beyond = 1 if ratio > WIDEST else -1 if ratio < 1 / WIDEST else 0
        marks.append(Mark(x, (level - levels // 2) * _APART, *one.answers, bool(one.fitted), beyond))
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
    x, y = f"{one.x:.1f}", f"{middle + one.y:.1f}"
    drawn = f'<g transform="translate({x} {y})">{symbol(one.closeness, one.compatibility, one.fitted)}</g>'
    if one.beyond:
        tip = 8 * one.beyond
        at = one.x - tip * 1.5
        drawn += f'<path class="far" d="M{at:.1f} {y}h{tip}m{-tip / 2:g}-3 {tip / 2:g} 3 {-tip / 2:g} 3"/>'
    return drawn


def symbol(closeness: str, compatibility: str, fitted: bool) -> str:
    """The shape of both answers about the origin, an SVG group."""
    name, path = SHAPES[closeness]
    state = compatibility if compatibility in ("within", "outside") else ""
    # A calculation has no flights to be within: its one answer has the colour as well.
    if compatibility == Compatibility.NOT_JUDGED and closeness != Closeness.NOT_JUDGED:
        state = {Closeness.CLOSE: "within", Closeness.NOT_CLOSE: "outside"}.get(Closeness(closeness), "")
    ring = f'<path class="ring" d="{RING}"/>' if compatibility == Compatibility.OUTSIDE else ""
    below = f'<path d="{UNDERLINE}"/>' if fitted else ""
    return f'<g class="mark {state}"><path class="{name}" d="{path}"/>{ring}{below}</g>'


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


def key_of(numbers: Iterable[Number]) -> list[tuple[str, str]]:
    """The symbols that occur among some numbers, as SVG about the origin, and what each means."""
    shown = drawable(numbers)
    answers = [one.answers for one in shown]
    key = [
        (symbol(near, "", False), near) for near in reversed(SHAPES) if near in {one[0] for one in answers}
    ]
    inside = {one[1] for one in answers}
    ringed = f'<g class="mark outside"><path class="ring" d="{RING}"/></g>'
    if Compatibility.WITHIN in inside:
        key.append(
            (symbol(Closeness.CLOSE, Compatibility.WITHIN, False), "green: within 90 % of our flights")
        )
    if Compatibility.OUTSIDE in inside:
        key.append((ringed, "red ring: outside"))
    if any(one.fitted for one in shown):
        key.append((f'<g class="mark"><path d="{UNDERLINE}" transform="translate(0 -6)"/></g>', "fitted"))
    return key


def legend(numbers: Iterable[Number]) -> str:
    """What each symbol means, of those that occur, and the shaded margin; as HTML."""
    key = key_of(numbers)
    items = "".join(
        f'<li><svg viewBox="-6 -6 12 12" aria-hidden="true">{drawn}</svg>{escape(words)}</li>'
        for drawn, words in key
    )
    close = (
        '<li><svg viewBox="-6 -6 12 12" aria-hidden="true"><path class="close" d="M-6-6H6V6H-6Z"/></svg>'
        f"within a factor of {CLOSE:g}</li>"
    )
    return f'<ul class="legend">{items}{close}</ul>' if key else ""
