"""A figure on a page: no larger than meant, and on a phone no smaller than can be read."""

from __future__ import annotations

import base64

from matplotlib.figure import Figure

from wildlab.reporting.figure_text import FULL_SIZE, least_size
from wildlab.reporting.text import escape, inline

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
    return f"<figure{' data-main' if main else ''}><div {box}>{image}</div>{label}</figure>"
