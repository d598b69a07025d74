"""House style for figures: one look, one colour per subject in all pages, maps that can be measured.

A figure carries one message, and its title says the message. It must stay legible on a phone: keep single
panels at the default 5.6 inches or below, and show two panels as two figures in a row (`Report.figures`),
which stack. Letters keep their size on a phone, and titles are broken where they do not fit.
"""

from __future__ import annotations

import base64
import io
import math
import os
import re
import textwrap
from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache, partial
from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.legend import Legend
from matplotlib.patches import Ellipse
from matplotlib.text import Annotation, Text
from matplotlib.ticker import FuncFormatter, LogFormatter, LogFormatterMathtext
from numpy.typing import ArrayLike, NDArray

from wildlab.errors import WildlabError
from wildlab.geometry.covariances import chi2_quantile
from wildlab.messages.quantities import known, nice_length
from wildlab.names import visible
from wildlab.paths import DATA
from wildlab.reporting.text import escape, inline

WORDS = {
    "ekf": "white noise (EKF)",
    "ukf": "white noise (UKF)",
    "imm": "two motions (IMM)",
    "coloured": "coloured noise",
    "schmidt": "considered errors (Schmidt)",
    "thinned": "thinned detections",
}
SHORT = dict(zip(WORDS, ("EKF", "UKF", "IMM", "coloured", "Schmidt", "thinned"), strict=True))


def short_words(name: str) -> str:
    """A filter's name for titles."""
    base = name.removesuffix("-smoothed")
    return SHORT.get(base, base) + (" smoothed" if name != base else "")


def filter_words(name: str) -> str:
    """A filter's name in words; a smoothed one says so."""
    base = name.removesuffix("-smoothed")
    return WORDS.get(base, base) + (", smoothed" if name != base else "")


#: CSS pixels per inch of a figure: full size on a desk, and the least at which its 10-point text can be read.
FULL_SIZE, LEAST_SIZE = 128, 80
#: CSS pixels that the smallest letters of a figure have on a phone; where they do not fit, it scrolls.
LEAST_TEXT = 11.0
#: Pixels that a title keeps from the figure's edge, and the share of its row that the name of a side has.
_EDGE, _UPWARDS = 8.0, 0.6
#: Letters that a line of a title has at least.
_FEWEST = 10
#: How often names that lie on each other are moved: ten in a heap are apart after fewer.
_ROUNDS = 200
#: The space between a number and its unit.
_UNITS = re.compile(r"(?<=\d) (?=[^\W\d]{1,3}(?:/\w+)?\b|[%°])")
#: What marks a line's name at its end.
END_LABEL = "end-label"


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
    texts = (one for one in figure.findobj(Text) if isinstance(one, Text) and one.get_visible())
    sizes = [float(text.get_fontsize()) for text in texts if text.get_text().strip()]
    return 72.0 * LEAST_TEXT / min(sizes) if sizes else float(LEAST_SIZE)


def fit_text(figure: Figure) -> None:
    """Make a figure's letters fit, whatever its data are: legends, titles, names at the ends of lines.

    Letters that give a number which is not known are left out. The figure is laid out.

    Parameters
    ----------
    figure
        With everything on it.
    """
    _harmless(figure)
    for legend in list(figure.legends):
        _narrow(figure, legend)
    wide, high = figure.bbox.width, figure.bbox.height
    for text in filter(None, (figure._suptitle, figure._supxlabel)):  # type: ignore[attr-defined]
        _break(text, wide - 2 * _EDGE)
    for axes in figure.get_axes():
        spec = axes.get_subplotspec()
        rows, columns = (1, 1) if spec is None else spec.get_gridspec().get_geometry()
        *across, upwards = _names_of(axes)
        for text in across:
            _break(text, wide / columns - 2 * _EDGE)
        _break(upwards, _UPWARDS * high / rows, "height")
    lay_out(figure)
    # A title that would leave the figure begins before its panel.
    for axes in figure.get_axes():
        for text in _names_of(axes)[:-1]:
            beyond = text.get_window_extent().x1 - (wide - _EDGE)
            if beyond > 0:
                text.set_x(text.get_position()[0] - beyond / axes.get_window_extent().width)
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
    """Move names up and down until none lies on another: each of two that do by half of what they overlap."""
    boxes = [name.get_window_extent() for name in names]
    y, heights = np.array([(b.y0 + b.y1) / 2 for b in boxes]), np.array([b.height for b in boxes])
    pairs = [
        (i, k) if (y[i], i) < (y[k], k) else (k, i)
        for k in range(len(boxes))
        for i in range(k)
        if boxes[i].x0 < boxes[k].x1 and boxes[k].x0 < boxes[i].x1
    ]
    places = y.copy()
    for _ in range(_ROUNDS):
        for below, above in pairs:
            needed = (heights[below] + heights[above]) / 2 - (places[above] - places[below])
            if needed > 0:
                places[[below, above]] += (-needed / 2, needed / 2)
    for name, moved in zip(names, (places - y) * points, strict=True):
        name.xyann = (name.xyann[0], name.xyann[1] + float(moved))


def _narrow(figure: Figure, legend: Legend) -> None:
    """Set a legend outside of the axes that is wider than the figure in fewer columns."""
    columns, place = legend._ncols, getattr(legend, "_outside_loc", None)  # type: ignore[attr-defined]
    while place and columns > 1 and legend.get_window_extent().width > figure.bbox.width:
        columns -= 1
        texts = [text.get_text() for text in legend.get_texts()]
        handles = [one for one in legend.legend_handles if one is not None]
        legend.remove()
        where: Any = f"outside {place} center"
        legend = figure.legend(handles, texts, loc=where, ncols=columns, markerscale=1)


def _names_of(axes: Axes) -> list[Text]:
    """The titles of axes and the names of their sides, that of the ordinate last."""
    titles = (axes.title, axes._left_title, axes._right_title)  # type: ignore[attr-defined]
    return [*filter(Text.get_text, (*titles, axes.xaxis.label)), axes.yaxis.label]


def lay_out(figure: Figure) -> None:
    """Put axes and legends where they belong; nothing is drawn for it."""
    engine = figure.get_layout_engine()
    if engine is None:
        figure.draw_without_rendering()
        return
    engine.execute(figure)
    # Limits that follow from the shape of a map may have longer numbers than those that were laid out.
    if any(axes.get_aspect() != "auto" and axes.get_adjustable() == "datalim" for axes in figure.get_axes()):
        for axes in figure.get_axes():
            axes.apply_aspect()
        engine.execute(figure)


def _break(text: Text, room: float, side: str = "width") -> None:
    """Set a text on as many lines as it needs to be no longer than ``room``, pixels, along its lines; a
    number stays with its unit."""
    words = _UNITS.sub("\u00a0", text.get_text())
    letters = max(map(len, words.split("\n")))
    while getattr(text.get_window_extent(), side) > room and letters > _FEWEST:
        letters -= 1
        lines = textwrap.wrap(words, letters, break_long_words=False)
        text.set_text("\n".join(lines).replace("\u00a0", " "))


#: What a figure has of the inches that a chart asks for: letters of 10 points then have 11 pixels on a phone,
#: where 6 inches asked for are 361 pixels.
WIDTH, HEIGHT = 0.76, 0.82
#: Set in the environment of a first look and of pages on a user's flight: no PDF, half of a figure's time.
QUICK = "WILDLAB_QUICK_FIGURES"
#: Points of a line beyond which a figure only grows: more than a screen has columns.
MOST_POINTS = 3000
#: Okabe and Ito's colours, which colour-blind readers can tell apart, their orange and sky blue darkened
#: until a line of them has a contrast of 3:1 to white (WCAG 2.2, 1.4.11); yellow is left out.
ORANGE, SKY, GREEN, BLUE = "#BF8400", "#3A96D0", "#009E73", "#0072B2"
VERMILLION, PURPLE, GREY, INK = "#D55E00", "#CC79A7", "#6B7480", "#18222D"

#: Seven colours and more subjects: sources of a pose, tracking filters and judged poses are three families,
#: and within a family, which is what shares a figure, no colour comes twice.
COLOURS = {
    "truth": "#000000",
    "measurement": GREY,
    "recorded": GREY,
    "ground": GREY,
    # sources of a pose
    "autopilot": ORANGE,
    "observer": GREEN,
    "mekf": BLUE,
    # tracking filters
    "kf": BLUE,
    "ekf": VERMILLION,
    "schmidt": GREEN,
    "coloured": PURPLE,
    "ukf": SKY,
    "imm": ORANGE,
    "cv": BLUE,
    "singer": ORANGE,
    # poses a position was computed from
    "logged-pose": BLUE,
    "calibrated-pose": VERMILLION,
}
#: The house style, as matplotlib reads it.
STYLE_FILE = DATA / "pages" / "figures.mplstyle"


def colour(subject: str) -> str:
    """The fixed colour of a subject; grey for one that has none.

    Parameters
    ----------
    subject
        ``truth``, ``kf``, ``mekf``: see `COLOURS`.

    Returns
    -------
    str

    Examples
    --------
    >>> colour("truth"), colour("nobody") == GREY
    ('#000000', True)
    """
    return COLOURS.get(subject, GREY)


@cache
def house_rc() -> mpl.RcParams:
    """What the house style sets."""
    return mpl.rc_params_from_file(STYLE_FILE, use_default_template=False)


def new_figure(
    width: float = 5.6, height: float = 3.6, *, rows: int = 1, columns: int = 1, **subplots: Any
) -> tuple[Figure, Any]:
    """A figure in house style and its axes (one `Axes`, or an array of them), apart from pyplot's global
    state.

    Parameters
    ----------
    width, height
        Inches on a desk, drawn at `WIDTH` and `HEIGHT` of them, so that letters are as large as a phone asks
        for. Above 6 inches a phone shows the figure in a box that scrolls sideways.
    rows
        Of axes.
    columns
        Of axes.
    **subplots
        Passed to `Figure.subplots` (``sharex``, ``width_ratios``, ...).

    Returns
    -------
    (Figure, Axes or array of Axes)

    Examples
    --------
    >>> figure, axes = new_figure(rows=2)
    >>> axes.shape
    (2,)
    """
    # Whatever the reader's own settings file says.
    mpl.rcdefaults()
    mpl.rcParams.update(house_rc())
    figure = Figure(figsize=(WIDTH * width, HEIGHT * height), layout="constrained")
    FigureCanvasAgg(figure)
    return figure, figure.subplots(rows, columns, **subplots)


def map_axes(ax: Axes, *, scale_bar: bool = True, east: str = "east (m)", north: str = "north (m)") -> None:
    """Make ``ax`` a map in local metres: equal aspect, north arrow, scale bar. Call it after plotting.

    Parameters
    ----------
    ax
        With everything on it.
    scale_bar
        Whether to draw one.
    east
        Label to the right.
    north
        Label upwards.
    """
    ax.set_aspect("equal", adjustable="datalim")
    ax.set_xlabel(east)
    ax.set_ylabel(north)
    left, right = sorted(ax.get_xlim())
    if scale_bar and right > left:
        from mpl_toolkits.axes_grid1.anchored_artists import (
            AnchoredSizeBar,
        )

        length = nice_length((right - left) / 4)
        bar = AnchoredSizeBar(
            ax.transData,
            length,
            f"{length:g} m",
            "lower right",
            frameon=False,
            pad=0.3,
            sep=3,
            size_vertical=0,
        )
        ax.add_artist(bar)
    ax.annotate(
        "N",
        xy=(0.965, 0.99),
        xytext=(0.965, 0.87),
        xycoords="axes fraction",
        ha="center",
        va="center",
        fontsize=10,
        arrowprops={"arrowstyle": "-|>", "color": INK, "lw": 1.0},
    )


def ellipse(
    ax: Axes,
    mean_en: ArrayLike,
    covariance: ArrayLike,
    probability: float = 0.9,
    *,
    color: str = BLUE,
    **patch: Any,
) -> Ellipse | None:
    """Draw the ellipse that holds ``probability`` of a two-dimensional normal distribution.

    Parameters
    ----------
    ax
        A map: east to the right.
    mean_en
        Centre (east, north), metres.
    covariance
        2x2, of (east, north), square metres. With NaN in either, nothing is drawn and None comes back.
    probability
        Between 0 and 1.
    color
        Of the line.
    **patch
        Passed to `matplotlib.patches.Ellipse`.

    Returns
    -------
    Ellipse or None
    """
    centre = np.asarray(mean_en, dtype=float)
    matrix = np.asarray(covariance, dtype=float)
    if not (np.isfinite(centre).all() and np.isfinite(matrix).all()):
        return None
    values, vectors = np.linalg.eigh((matrix + matrix.T) / 2)
    half_axes = np.sqrt(np.clip(values, 0, None) * chi2_quantile(probability, 2))
    angle = math.degrees(math.atan2(vectors[1, 1], vectors[0, 1]))
    patch = {"lw": 1.6, "edgecolor": color, "facecolor": "none"} | patch
    shape = Ellipse((centre[0], centre[1]), 2 * half_axes[1], 2 * half_axes[0], angle=angle, **patch)
    ax.add_patch(shape)
    # Patches do not widen the view by themselves when the axes are shared with scatter points.
    reach = np.hypot(*half_axes)
    ax.update_datalim([centre - reach, centre + reach])
    ax.autoscale_view()
    return shape


def log_band(ax: Axes, low: float, high: float, label: str = "95 % band", *, color: str = GREEN) -> None:
    """Logarithmic y-axis with the band a consistent filter stays in, for NEES and NIS.

    Parameters
    ----------
    ax
        The axes.
    low
        Of the band.
    high
        Of the band.
    label
        Beside it.
    color
        Of the band.
    """
    ax.set_yscale("log")
    ax.axhspan(low, high, color=color, alpha=0.13, lw=0, zorder=0)
    for edge in (low, high):
        ax.axhline(edge, color=color, lw=0.8, alpha=0.7, zorder=0.5)
    # Beside the axes, where the words cover nothing.
    ax.annotate(
        label,
        xy=(1.0, (low * high) ** 0.5),
        xycoords=("axes fraction", "data"),
        xytext=(3, 0),
        textcoords="offset points",
        ha="left",
        va="center",
        rotation=270,
        fontsize=10,
        color="#00664B",
        annotation_clip=False,
    )
    plain_numbers(ax.yaxis)


def plain_numbers(axis: Any) -> None:
    """Write the numbers of a logarithmic axis out."""
    axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))


def mark_gaps(ax: Axes, times: ArrayLike, longest_s: float) -> int:
    """Shade the periods without measurements longer than ``longest_s``; returns how many there are."""
    stamps: NDArray[np.float64] = np.sort(np.asarray(times, dtype=float))
    gaps = np.flatnonzero(np.diff(stamps) > longest_s)
    for index in gaps:
        ax.axvspan(stamps[index], stamps[index + 1], color=GREY, alpha=0.13, lw=0, zorder=0)
    return len(gaps)


def end_label(ax: Axes, x: float, y: float, text: str, color: str, **annotate: Any) -> None:
    """Write a line's name at its end, in its colour: easier to read than a legend. Those of
    one panel are moved apart where the figure is saved."""
    settings: dict[str, Any] = {"va": "center", "fontsize": 10, "annotation_clip": False} | annotate
    ax.annotate(
        text, xy=(x, y), xytext=(5, 0), textcoords="offset points", color=color, gid=END_LABEL, **settings
    )


def thinned(count: int) -> slice:
    """Which of ``count`` points a line keeps, evenly, so that there are no more than `MOST_POINTS`."""
    return slice(None, None, max(1, -(-count // MOST_POINTS)))


def png_bytes(figure: Figure) -> bytes:
    """The figure as PNG at 190 dpi, without a date or the name of a program.

    Parameters
    ----------
    figure
        From `new_figure`.

    Returns
    -------
    bytes

    Examples
    --------
    >>> png_bytes(new_figure()[0])[1:4]
    b'PNG'
    """
    buffer = io.BytesIO()
    fit_text(figure)
    with _laid_out(figure):
        # `savefig` would draw it twice.
        canvas: Any = FigureCanvasAgg(figure)
        canvas.print_png(buffer, metadata={"Software": None})
    return buffer.getvalue()


@contextmanager
def _laid_out(figure: Figure) -> Iterator[None]:
    """Within it a figure that is laid out is saved as it is: once is enough."""
    engine = figure.get_layout_engine()
    figure.set_layout_engine("none")
    try:
        yield
    finally:
        figure.set_layout_engine(engine)


def with_alt(figure: Figure, alt: str) -> Figure:
    """The same figure, which a notebook then shows with words for those who do not see it.

    Parameters
    ----------
    figure
        From `new_figure` or `wildlab.plot`.
    alt
        What it shows, in a sentence or two.

    Returns
    -------
    Figure

    Raises
    ------
    WildlabError
        Where the words are missing.

    Examples
    --------
    >>> figure = with_alt(new_figure()[0], "An empty frame.")
    >>> figure._repr_png_()[1]["alt"]
    'An empty frame.'
    """
    if not alt.strip():
        raise WildlabError("a figure has no alt text", "say in words what it shows", field="alt")
    width, height = (round(inches * FULL_SIZE) for inches in figure.get_size_inches())
    about = {"alt": alt, "width": width, "height": height}
    figure._repr_png_ = partial(_shown, figure, about)  # type: ignore[attr-defined]
    return figure


def _shown(figure: Figure, about: dict[str, Any]) -> tuple[bytes, dict[str, Any]]:
    """What IPython takes for a picture: its bytes, and what there is to say about it."""
    return png_bytes(figure), about


def save_figure(figure: Figure, folder: Path, name: str) -> bytes:
    """Write ``name.png`` into ``folder``, and ``name.pdf`` unless `QUICK`: the same bytes each time.

    Parameters
    ----------
    figure
        From `new_figure`.
    folder
        Made where it is not there.
    name
        Of the files, without ending.

    Returns
    -------
    bytes
        The PNG.
    """
    folder.mkdir(parents=True, exist_ok=True)
    png = png_bytes(figure)
    (folder / f"{name}.png").write_bytes(png)
    if not os.environ.get(QUICK):
        with _laid_out(figure), mpl.rc_context({"pdf.fonttype": 42}):
            figure.savefig(
                folder / f"{name}.pdf",
                metadata={"CreationDate": None, "Producer": None, "Creator": "wildlab"},
            )
    return png


#: CSS pixels that a phone of 390 has for a figure.
PHONE_WIDTH = 361


def figure_html(
    figure: Figure, png: bytes, *, ordinal: int, alt: str, caption: str = "", main: bool = False
) -> str:
    """``<figure>`` with the picture in it.

    Parameters
    ----------
    figure
        As it was drawn.
    png
        The same as a picture.
    ordinal
        Which of the page's figures it is.
    alt
        What it shows.
    caption
        Below it; "" for none.
    main
        Whether it is the page's main picture.

    Returns
    -------
    str
        HTML. Where the letters would be too small on a phone the figure is wider than it, and marked so.
    """
    wide, high = figure.get_size_inches()
    # The size in pixels lets a browser keep the place before it has decoded the picture.
    width, height = round(wide * FULL_SIZE), round(high * FULL_SIZE)
    least = min(width, round(wide * least_size(figure)))
    data = base64.b64encode(png).decode("ascii")
    image = (
        f'<img alt="{escape(alt)}" width="{width}" height="{height}" '
        f'style="max-width:{width}px;min-width:{least}px" src="data:image/png;base64,{data}">'
    )
    slides = " slides" if least > PHONE_WIDTH else ""
    box = f'class="scroll{slides}" role="group" tabindex="0" aria-label="Figure {ordinal}"'
    label = f"<figcaption><b>Figure {ordinal}.</b> {inline(caption)}</figcaption>" if caption else ""
    part = ' data-part="main"' if main else ""
    return f"<figure{part}><div {box}>{image}</div>{label}</figure>"
