"""What is written on a figure, where it lies, and what lies on what; for tests of charts and of notebooks."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from itertools import combinations
from typing import Any

import pytest
from matplotlib.figure import Figure
from matplotlib.text import Annotation, Text
from matplotlib.transforms import Bbox

from wildlab.reporting.report import Report

#: Points by which boxes may touch: letters have room around them.
TOUCH = 1.5


def written(figure: Figure) -> list[tuple[str, Bbox]]:
    """Every text that is seen, with its box in points."""
    renderer: Any = figure.canvas.get_renderer()  # type: ignore[attr-defined]
    figure.draw(renderer)
    hidden = _not_drawn(figure)
    found = []
    for text in figure.findobj(Text):
        assert isinstance(text, Text)
        if id(text) in hidden or not text.get_visible() or not text.get_text().strip():
            continue
        # Of an annotation, the words without the arrow.
        box = (
            Text.get_window_extent(text, renderer)
            if isinstance(text, Annotation)
            else text.get_window_extent(renderer)
        )
        if box.width > 0 and box.height > 0:
            found.append((text.get_text(), Bbox(box.get_points() * 72.0 / figure.dpi)))
    return found


def _not_drawn(figure: Figure) -> set[int]:
    """Texts that are there and are not drawn: labels of ticks beyond the ends of an axis, and hidden axes."""
    hidden: set[int] = set()
    for axes in figure.get_axes():
        if not axes.get_visible():
            hidden |= {id(text) for text in axes.findobj(Text)}
        for axis in (axes.xaxis, axes.yaxis):
            ticks = [*axis.get_major_ticks(), *axis.get_minor_ticks()]
            drawn = axis._update_ticks() if axes.axison and axis.get_visible() else []  # type: ignore[attr-defined]
            hidden |= {id(label) for tick in ticks for label in (tick.label1, tick.label2)}
            hidden -= {id(label) for tick in drawn for label in (tick.label1, tick.label2)}
    return hidden


def overlapping(figure: Figure) -> list[str]:
    """Pairs of texts that lie on one another, and texts that leave the figure, in words."""
    boxes = written(figure)
    found = []
    for (one, a), (other, b) in combinations(boxes, 2):
        wide = min(a.x1, b.x1) - max(a.x0, b.x0)
        high = min(a.y1, b.y1) - max(a.y0, b.y0)
        if wide > TOUCH and high > TOUCH:
            found.append(f"{one!r} lies on {other!r} by {wide:.0f} x {high:.0f} points")
    width, height = (72.0 * inches for inches in figure.get_size_inches())
    for one, box in boxes:
        out = max(-box.x0, -box.y0, box.x1 - width, box.y1 - height)
        if out > TOUCH:
            found.append(f"{one!r} leaves the figure by {out:.0f} points")
    return found


@contextmanager
def seen_figures(into: dict[str, list[str]]) -> Iterator[None]:
    """Within it, every figure that any `Report` shows is looked at: its faults by name."""
    patch = pytest.MonkeyPatch()
    original = Report._figure

    def look(self: Report, fig: Figure, name: str, *rest: Any, **more: Any) -> str:
        shown = original(self, fig, name, *rest, **more)
        # As it was saved: titles and legends have been fitted.
        into[name] = overlapping(fig)
        return shown

    patch.setattr(Report, "_figure", look)
    try:
        yield
    finally:
        patch.undo()
