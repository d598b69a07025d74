"""The letters of a figure: how large they are on a phone, and titles broken where they do not fit."""

from __future__ import annotations

import re
import textwrap
from typing import Any

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.legend import Legend
from matplotlib.text import Annotation, Text
from matplotlib.ticker import LogFormatter, LogFormatterMathtext

from wildlab.names import visible
from wildlab.reporting.text import known

#: CSS pixels per inch of a figure: full size on a desk, and the least at which its 10-point text can be read.
FULL_SIZE, LEAST_SIZE = 128, 80
#: CSS pixels that the smallest letters of a figure have on a phone; where they do not fit, it scrolls.
LEAST_TEXT = 11.0
#: A share of the figure that a title has at least, and where it begins to have it, pixels from the edge.
_NARROWEST, _EDGE = 0.7, 8.0
#: How often the whole is laid out again at most.
_ROUNDS = 4
#: Letters that a line of a title has at least.
_FEWEST = 10
#: What stands beside a title, points.
_BESIDE = 60.0
#: The space between a number and its unit.
_UNITS = re.compile(r"(?<=\d) (?=[^\W\d]{1,3}(?:/\w+)?\b|[%°])")
#: What marks a line's name at its end.
END_LABEL = "end-label"
#: Width of a usual letter of a title as a share of its height: what is shorter than that is not measured.
_NARROW = 0.6


def least_size(figure: Figure) -> float:
    """CSS pixels per inch at which the smallest text of a figure still has `LEAST_TEXT` pixels.

    Parameters
    ----------
    figure
        With everything on it.

    Returns
    -------
    float
        `LEAST_SIZE` where it has no text.
    """
    sizes = [float(text.get_fontsize()) for text in figure.findobj(Text) if _is_seen(text)]
    return 72.0 * LEAST_TEXT / min(sizes) if sizes else float(LEAST_SIZE)


def _is_seen(artist: Artist) -> bool:
    """Whether a text is on the figure: it says something, and neither it nor what holds it is hidden."""
    return isinstance(artist, Text) and bool(artist.get_text().strip()) and artist.get_visible()


def fit_text(figure: Figure) -> None:
    """Make a figure's letters fit, whatever its data are: legends, titles, names at the ends of lines.

    Letters that give a number which is not known are left out. The figure is laid out.

    Parameters
    ----------
    figure
        With everything on it.
    """
    _harmless(figure)
    fit_legends(figure)
    fit_titles(figure)
    for axes in figure.get_axes():
        names = [text for text in axes.texts if text.get_gid() == END_LABEL and isinstance(text, Annotation)]
        if len(names) > 1:
            _apart(names, 72.0 / figure.dpi)


def _harmless(figure: Figure) -> None:
    """Names of strangers turn no text around, what matplotlib itself writes is no maths either, and what is
    not known is not written."""
    over_all = (figure._suptitle, figure._supxlabel, figure._supylabel)  # type: ignore[attr-defined]
    texts = [*figure.texts, *filter(None, over_all)]
    legends = list(figure.legends)
    for axes in figure.get_axes():
        texts += [*_names_of(axes), *axes.texts]
        legends += filter(None, [axes.get_legend()])
    for text in (*texts, *(text for legend in legends for text in legend.get_texts())):
        text.set_text(visible(text.get_text()) if known(text.get_text()) else "")
    for axes in figure.get_axes():
        for axis in (axes.xaxis, axes.yaxis):
            if isinstance(axis.get_major_formatter(), LogFormatterMathtext):
                axis.set_major_formatter(Powers())
            minor = axis.get_minor_formatter()
            if isinstance(minor, LogFormatterMathtext):
                axis.set_minor_formatter(Powers(labelOnlyBase=minor.labelOnlyBase))


class Powers(LogFormatter):
    """Numbers beside a logarithmic axis, without maths.

    Examples
    --------
    >>> Powers.text(-2e6), Powers.text(30.0), Powers.text(0.0)
    ('−2·10⁶', '30', '0')
    """

    def __call__(self, x: float, pos: int | None = None) -> str:
        return self.text(x) if super().__call__(x, pos) else ""

    @staticmethod
    def text(value: float) -> str:
        """A number over many powers of ten, short."""
        if abs(value) < 1e4:
            return f"{value:g}".replace("-", "−")
        factor, power = f"{value:.0e}".split("e")
        raised = str(int(power)).translate(str.maketrans("0123456789", "⁰¹²³⁴⁵⁶⁷⁸⁹"))
        return f"{factor}·10{raised}".replace("-", "−")


def _apart(names: list[Annotation], points: float) -> None:
    """Move names up and down until none lies on another, in the order in which their lines end."""
    boxes = {id(name): name.get_window_extent() for name in names}
    names = sorted(names, key=lambda name: boxes[id(name)].y0 + boxes[id(name)].y1)
    wanted = np.array([(boxes[id(name)].y0 + boxes[id(name)].y1) / 2 for name in names])
    heights = np.array([boxes[id(name)].height for name in names])
    places, least = wanted.copy(), (heights[:-1] + heights[1:]) / 2
    for _ in range(100):
        off = False
        for i, room in enumerate(least):
            lack = room - (places[i + 1] - places[i])
            if lack > 0.5:
                places[i : i + 2] += -lack / 2, lack / 2
                off = True
        if not off:
            break
    for name, moved in zip(names, (places - wanted) * points, strict=True):
        name.xyann = (name.xyann[0], name.xyann[1] + float(moved))


def fit_legends(figure: Figure) -> None:
    """Set legends beside the axes that are wider than the figure in fewer columns.

    Parameters
    ----------
    figure
        With everything on it.
    """
    places = {code: name for name, code in Legend.codes.items()}
    for legend in list(figure.legends):
        columns = legend._ncols  # type: ignore[attr-defined]
        outside = getattr(legend, "_outside_loc", None)
        while columns > 1 and legend.get_window_extent().width > figure.bbox.width:
            columns -= 1
            place = places[legend._loc_real]  # type: ignore[attr-defined]
            texts = [text.get_text() for text in legend.get_texts()]
            handles = [one for one in legend.legend_handles if one is not None]
            legend.remove()
            where: Any = _place(place, outside)
            legend = figure.legend(handles, texts, loc=where, ncols=columns)


def _place(place: str, outside: str | None) -> str:
    """Where a legend was asked to be: ``lower right``, ``outside lower right`` or ``outside right lower``."""
    if outside is None:
        return place
    vertical = place.split()[0]
    return f"outside {outside} {vertical}" if outside in ("left", "right") else f"outside {place}"


def fit_titles(figure: Figure) -> None:
    """Break titles and names of axes that are wider than their place onto more lines; they hold data, too.

    Parameters
    ----------
    figure
        With everything on it; it is laid out. A title may go on to the figure's edge, or, where another
        panel stands to the right, to the end of its own.
    """
    beside = _BESIDE * figure.dpi / 72
    every = [(axes, text, text is axes.yaxis.label) for axes in figure.get_axes() for text in _names_of(axes)]
    for axes, text, upwards in every:
        room = (figure.bbox.height if upwards else figure.bbox.width / _columns(axes)) - beside
        (x0, y0), (x1, y1) = text.get_window_extent().get_points()
        if (y1 - y0 if upwards else x1 - x0) <= room:
            continue
        if not upwards and _columns(axes) == 1 and text.get_horizontalalignment() == "left":
            # It begins where the axes do, beside their numbers.
            numbers = axes.yaxis.get_tightbbox()
            room = figure.bbox.width - 2 * _EDGE - (0.0 if numbers is None else numbers.width)
            if room < _NARROWEST * figure.bbox.width:
                room = figure.bbox.width - 2 * _EDGE
        _break(text, room, upwards)
    for text in (figure._suptitle, figure._supxlabel):  # type: ignore[attr-defined]
        if text is not None:
            _break(text, figure.bbox.width - 2 * _EDGE)
    # Once is enough but for what stands beside or above much: where its lines change, the panels move.
    for _ in range(_ROUNDS):
        lay_out(figure)
        off = [one for one in every if _leaves(*one)]
        if not off:
            return
        for axes, text, upwards in off:
            _break(text, _room_of(axes, text, upwards), upwards)
    lay_out(figure)


def _names_of(axes: Axes) -> list[Text]:
    """The titles of axes and the names of their sides, where there are any."""
    titles = (axes.title, axes._left_title, axes._right_title)  # type: ignore[attr-defined]
    return [text for text in (*titles, axes.xaxis.label, axes.yaxis.label) if text.get_text()]


def _leaves(axes: Axes, text: Text, upwards: bool) -> bool:
    """Whether a text leaves the figure, or, where panels stand side by side, goes on into the next."""
    (x0, y0), (x1, y1) = text.get_window_extent().get_points()
    figure, panel = axes.figure.bbox, axes.get_window_extent()
    if upwards:
        return bool(y0 < 0 or y1 > figure.y1)
    return bool(x0 < 0 or x1 > (figure.x1 if _columns(axes) == 1 else panel.x1 + _EDGE))


def lay_out(figure: Figure) -> None:
    """Put axes and legends where they belong; nothing is drawn for it."""
    engine = figure.get_layout_engine()
    if engine is None:
        figure.draw_without_rendering()
    else:
        engine.execute(figure)


def _room_of(axes: Axes, text: Text, upwards: bool) -> float:
    """Pixels that a text may take along its lines; a title beside long names on the axis goes over them."""
    figure, panel = axes.get_figure(root=True), axes.get_window_extent()
    assert figure is not None  # noqa: S101 - for the type checker
    edge, alone = figure.bbox.x1 - 4, _columns(axes) == 1
    if upwards:
        middle = (panel.y0 + panel.y1) / 2
        return float(2 * min(middle, figure.bbox.y1 - 4 - middle))
    if text.get_horizontalalignment() == "left":
        room = float((edge if alone else panel.x1) - panel.x0)
        if alone and room < _NARROWEST * figure.bbox.width:
            text.set_x((_EDGE - panel.x0) / panel.width)
            room = edge - _EDGE
        return room
    middle = (panel.x0 + panel.x1) / 2
    return float(2 * min(middle, edge - middle) if alone else panel.width)


def _break(text: Text, room: float, upwards: bool = False) -> None:
    """Set a text on as many lines as it needs to be no longer than ``room``, pixels, along its lines; a
    number stays with its unit."""
    words = _UNITS.sub("\u00a0", text.get_text())
    letters = max(map(len, words.split("\n")))
    side = "height" if upwards else "width"
    while getattr(text.get_window_extent(), side) > room and letters > _FEWEST:
        letters -= 1
        lines = textwrap.wrap(words, letters, break_long_words=False)
        text.set_text("\n".join(lines).replace("\u00a0", " "))


def _columns(axes: Axes) -> int:
    """How many panels stand side by side where the axes are."""
    spec = axes.get_subplotspec()
    return 1 if spec is None else int(spec.get_gridspec().ncols)
