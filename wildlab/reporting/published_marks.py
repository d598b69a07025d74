"""The published numbers at once, each a mark on one axis: ours divided by the printed one, logarithmic.

Whether a number is close is a shape; whether it is within the prediction interval of our flights is a
colour, and a ring around what is outside, so that neither eyes nor printers that see no colour miss it. What
was fitted is underlined. What has no ratio (a signed mean, a zero) or was not run is not drawn; whoever draws
says how many.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import NamedTuple

from markupsafe import Markup

from wildlab.evaluation.replication import KINDS, Closeness, Compatibility
from wildlab.reporting.published_tables import PREDICTED, WIDEST, Counts, place
from wildlab.reporting.status import FIRST_LOOK, Number, Standing, StudyStatus, standing
from wildlab.reporting.text import read_style, render

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
STYLE = read_style("marks")
#: The page beside the front page, and the width of the axis, in units.
LEDGER, WIDTH = "ledger.html", 320.0
#: Rows of marks on an axis at most; beyond that, marks overlap.
MOST_LEVELS = 5


class Mark(NamedTuple):
    """A number drawn: where (units from the left, and from the middle down), both answers, whether it is
    fitted, and whether the axis ends before it (-1 left, 1 right, 0 not)."""

    x: float
    y: float
    closeness: str
    compatibility: str
    fitted: bool
    beyond: int


def drawable(numbers: Iterable[Number]) -> list[Number]:
    """Those with a ratio and a shape."""
    return [one for one in numbers if one.ratio is not None and one.ratio > 0 and one.answers[0] in SHAPES]


def arrange_marks(numbers: Sequence[Number], levels: int) -> list[Mark]:
    """Marks for numbers, beside one another where they would hide each other.

    Parameters
    ----------
    numbers
        From `drawable`.
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
        x = place(ratio, WIDTH, _HALF)
        crowd = {k: sum(abs(x - other) < _APART for other in taken[k]) for k in middle_first}
        level = min(middle_first, key=lambda k: crowd[k])
        taken[level].append(x)
        beyond = 1 if ratio > WIDEST else -1 if ratio < 1 / WIDEST else 0
        marks.append(Mark(x, (level - levels // 2) * _APART, *one.answers, bool(one.fitted), beyond))
    return marks[::-1]


def levels_for(numbers: Sequence[Number], most: int = MOST_LEVELS) -> int:
    """Rows of marks that numbers need so that none hides another, odd, and at most so many."""
    for levels in range(1, most, 2):
        marks = arrange_marks(numbers, levels)
        if all(abs(a.x - b.x) >= _APART or a.y != b.y for i, a in enumerate(marks) for b in marks[:i]):
            return levels
    return most


def plot(numbers: Iterable[Number], *, alt: str) -> Markup:
    """Numbers as marks on the axis, an SVG element.

    Parameters
    ----------
    numbers
        Those that cannot be drawn are left out.
    alt
        What a reader who cannot see it should know.
    """
    shown = drawable(numbers)
    levels = levels_for(shown)
    height = levels * _APART + 5
    return render(
        "marks",
        alt=alt,
        width=WIDTH,
        height=height,
        axis=[("one" if ratio == 1 else "axis", place(ratio, WIDTH, _HALF)) for ratio in TICKS],
        near=(place(1 / CLOSE, WIDTH, _HALF), place(CLOSE, WIDTH, _HALF)),
        marks=[
            (one, height / 2 + one.y, symbol(one.closeness, one.compatibility, one.fitted))
            for one in arrange_marks(shown, levels)
        ],
    )


def symbol(closeness: str, compatibility: str, fitted: bool) -> Markup:
    """The shape of both answers about the origin, an SVG group."""
    name, path = SHAPES[closeness]
    state = compatibility if compatibility in ("within", "outside") else ""
    # A calculation has no flights to be within: its one answer has the colour as well.
    if compatibility == Compatibility.NOT_JUDGED and closeness != Closeness.NOT_JUDGED:
        state = {Closeness.CLOSE: "within", Closeness.NOT_CLOSE: "outside"}.get(Closeness(closeness), "")
    ring = RING if compatibility == Compatibility.OUTSIDE else ""
    below = UNDERLINE if fitted else ""
    return render("mark", state=state, name=name, path=path, ring=ring, below=below)


def ticks() -> Markup:
    """The axis in words, as HTML below a `plot` of the same width."""
    words = [
        (100 * place(ratio, WIDTH, _HALF) / WIDTH, one, ratio in (1 / 2, 2.0))
        for ratio, one in TICKS.items()
        if ratio not in (1 / 4, 4.0)
    ]
    return render("ticks", ticks=words)


def legend(numbers: Iterable[Number]) -> Markup:
    """What each symbol means, of those that occur among some numbers, and the shaded margin; as HTML."""
    shown = drawable(numbers)
    near, inside = ({one.answers[k] for one in shown} for k in (0, 1))
    return render(
        "legend",
        key=[(symbol(one, "", False), one) for one in reversed(SHAPES) if one in near],
        within=symbol(Closeness.CLOSE, Compatibility.WITHIN, False) if "within" in inside else "",
        ring=RING if "outside" in inside else "",
        underline=UNDERLINE if any(one.fitted for one in shown) else "",
        close=CLOSE,
    )


def study_verdict(one: StudyStatus) -> Standing:
    """What a study's numbers and claims come to, as its report says it; a first look comes to nothing yet."""
    if one.state == FIRST_LOOK:
        return Standing("first look", f"{one.first_look}: not counted yet.", "warn")
    compared = [n.compared for n in one.counted if n.compared is not None]
    return standing(compared, (c.verdict for c in one.claims if not c.own))


def headline(counts: Counts) -> list[tuple[str, str]]:
    """What was predicted for flights, in figures; nothing where none is judged."""
    if not counts.of:
        return []
    found = counts.groups[PREDICTED]
    flights = f"{counts.flights} flight{'s' * (counts.flights != 1)}"
    return [
        (f"{found.close['close']} of {counts.of}", f"{PREDICTED} for {flights}, are close"),
        (str(found.compatible["within"]), "within 90 % of our flights"),
        (str(found.compatible["outside"]), f"outside; chance alone gives {found.chance:.1f}"),
    ]
