"""What is written on a figure, where it lies, and what lies on what; for tests of charts and of notebooks."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from itertools import combinations
from typing import Any

import pytest
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
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


def signs(figure: Figure) -> list[tuple[str, Bbox]]:
    """The sign of every entry of a legend, with its box in points."""
    legends = [*figure.legends, *filter(None, (axes.get_legend() for axes in figure.get_axes()))]
    found = []
    for legend in legends:
        for handle, text in zip(legend.legend_handles, legend.get_texts(), strict=True):
            assert handle is not None
            box = _drawn(handle) if isinstance(handle, Line2D) else handle.get_window_extent()
            found.append((f"the sign of {text.get_text()!r}", Bbox(box.get_points() * 72.0 / figure.dpi)))
    return found


def _drawn(line: Line2D) -> Bbox:
    """What a line of a legend covers, pixels: itself, and the marker in its middle."""
    places = line.get_transform().transform(line.get_xydata())
    figure = line.get_figure()
    assert figure is not None
    pixels = figure.dpi / 72.0
    boxes = []
    if line.get_linestyle() not in ("None", "none", "", " "):
        half = [0.0, line.get_linewidth() * pixels / 2]
        boxes.append(Bbox([places.min(axis=0) - half, places.max(axis=0) + half]))
    if line.get_marker() not in ("None", "none", "", " ", None):
        half = line.get_markersize() * pixels / 2
        middle = places[len(places) // 2]
        boxes.append(Bbox([middle - half, middle + half]))
    return Bbox.union(boxes)


def overlapping(figure: Figure) -> list[str]:
    """Pairs of texts, and of a legend's signs, that lie on one another, and texts that leave the figure, in
    words."""
    boxes = written(figure)
    found = []
    for (one, a), (other, b) in combinations([*boxes, *signs(figure)], 2):
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
