"""Detectors beside one another on the page of a run: their rates, and precision beside recall."""

from __future__ import annotations

import base64
from collections.abc import Mapping, Sequence
from typing import Any

import pandas as pd
from matplotlib.figure import Figure

from wildlab.analysis.detecting.judged import rate_words
from wildlab.names import figure_name
from wildlab.reporting.figures import BLUE, GREEN, INK, ORANGE, PURPLE, VERMILLION, new_figure, png_bytes
from wildlab.reporting.text import NOTHING, escape

_COLOURS = (BLUE, VERMILLION, GREEN, PURPLE, ORANGE, INK)


def compared_section(compared: Sequence[Mapping[str, Any]], curves: pd.DataFrame) -> str:
    """A table of detectors with their rates, the curves, and what of their files is not judged.

    Parameters
    ----------
    compared
        From `wildlab.analysis.detection_compared.Compared.as_plain`, ours first.
    curves
        From `wildlab.analysis.detection_compared.curve_table`.

    Returns
    -------
    str
        HTML; "" where there is only one detector.
    """
    if len(compared) < 2:
        return ""
    heads = ("detector", "F1", "precision", "recall", "average precision", "F1 minus ours")
    head = "".join(f'<th scope="col"{_text(number == 0)}>{one}</th>' for number, one in enumerate(heads))
    rows = []
    for number, one in enumerate(compared):
        cells = [
            (rate_words(one[key]) or NOTHING) for key in ("f1", "precision", "recall", "average_precision")
        ]
        cells.append("" if number == 0 else (rate_words(one["f1_beyond_ours"], "+") or NOTHING))
        name = f'<th scope="row" class="text">{escape(one["name"])}</th>'
        rows.append(f"<tr>{name}{''.join(f'<td>{cell}</td>' for cell in cells)}</tr>")
    told = [f"<li>{escape(one['name'])}: {escape(line)}</li>" for one in compared for line in one["told"]]
    parts = [
        f'<h2>Detectors beside one another</h2><div class="scroll"><table><thead><tr>{head}</tr></thead>'
        f"<tbody>{''.join(rows)}</tbody></table></div>",
        '<p class="note">Same images, same labels, same rule. F1, precision and recall are of all boxes that '
        "a detector gave; the average precision is the area below its curve. In brackets 95 % intervals; "
        "those of the difference rest on the same draws for both. Draws know only the images that are here: "
        "of few images they say too little.</p>",
    ]
    if len(curves):
        figure, said = curves_shown(compared, curves)
        data = base64.b64encode(png_bytes(figure)).decode("ascii")
        caption = "Each curve from the highest score to the lowest; dot: all boxes. Numbers: compared.csv."
        parts.append(
            f'<figure><img alt="{escape(said)}" src="data:image/png;base64,{data}">'
            f"<figcaption>{caption}</figcaption></figure>"
        )
    if told:
        parts.append(f"<ul>{''.join(told)}</ul>")
    return "\n".join(parts)


def curves_shown(compared: Sequence[Mapping[str, Any]], curves: pd.DataFrame) -> tuple[Figure, str]:
    """Precision beside recall along the score.

    Parameters
    ----------
    compared, curves
        As for `compared_section`.

    Returns
    -------
    (Figure, str)
        And what it shows, in words.
    """
    fig, ax = new_figure(5.6, 3.8)
    said = []
    for number, one in enumerate(compared):
        own = curves[curves["detector"] == one["name"]]
        if own.empty:
            continue
        colour = _COLOURS[number % len(_COLOURS)]
        ax.plot(own["recall"], own["precision"], "-", color=colour, label=figure_name(one["name"]))
        ax.plot(own["recall"].iloc[-1], own["precision"].iloc[-1], "o", color=colour, ms=7)
        area = one["average_precision"]
        if area is not None and area["estimate"] is not None:
            said.append(f"{one['name']} {area['estimate']:.2f}")
    ax.set(xlabel="recall", ylabel="precision", xlim=(0, 1.02), ylim=(0, 1.03))
    ax.set_title("Precision beside recall, along the score")
    fig.legend(*ax.get_legend_handles_labels(), loc="outside lower center", ncols=2)
    areas = f" Average precision: {', '.join(said)}." if said else ""
    return fig, f"Precision beside recall as the score falls, a curve for each detector.{areas}"


def _text(first: bool) -> str:
    return ' class="text"' if first else ""
