"""Numbers as marks on one axis, and the small pictures of cards."""

from __future__ import annotations

import base64
import math
import re

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from wildlab.evaluation.replication import Closeness, Comparison, Compatibility
from wildlab.reporting import published_tables as ratios
from wildlab.reporting.front_page import MOST_PIXELS, read_glimpse, smaller
from wildlab.reporting.published import FIRST_LOOK, MISSING, Number

CLOSE, NOT_CLOSE = Closeness.CLOSE, Closeness.NOT_CLOSE
WITHIN, OUTSIDE = Compatibility.WITHIN, Compatibility.OUTSIDE
VERDICTS = (*Closeness, FIRST_LOOK)


def number(
    ratio: float | None, verdict: str = CLOSE, inside: Compatibility = WITHIN, fitted: str = ""
) -> Number:
    waiting = verdict if verdict in (FIRST_LOOK, MISSING) else ""
    near = CLOSE if waiting else Closeness(verdict)
    compared = Comparison(near, inside, ratio, fitted=fitted)
    return Number(
        "error", "kf", "m", "H", 1.0, 1, ratio, None, None, compared, waiting, ratio=ratio, fitted=fitted
    )


def on_axis(ratio: float, width: float) -> float:
    """A logarithmic axis from an eighth to eight, with room for half a mark at its ends."""
    share = (math.log2(min(max(ratio, 1 / 8), 8)) + 3) / 6
    return 6.0 + share * (width - 12.0)


@settings(max_examples=60)
@given(st.lists(st.tuples(st.floats(1e-3, 1e3), st.sampled_from(VERDICTS)), max_size=60))
def test_every_number_is_drawn_where_its_ratio_lies(given_):
    drawn = str(ratios.marks_plot([number(*one) for one in given_], alt="numbers"))
    found = [float(one) for one in re.findall(r'cx="([\d.]+)"', drawn)]
    assert found == pytest.approx([on_axis(ratio, 320.0) for ratio, _ in given_], abs=0.051)


@pytest.mark.parametrize(
    ("near", "inside", "colour"),
    [(CLOSE, OUTSIDE, "no"), (NOT_CLOSE, WITHIN, "yes"), (FIRST_LOOK, WITHIN, ""),
     (NOT_CLOSE, Compatibility.NOT_JUDGED, "no"), (CLOSE, Compatibility.TOO_FEW, "part")],
)  # fmt: skip
def test_a_dot_has_the_colour_of_its_answer(near, inside, colour):
    drawn = str(ratios.marks_plot([number(1.0, near, inside)], alt="a number"))
    assert f'class="dot {colour}"' in drawn


def png(picture: np.ndarray) -> str:
    return base64.b64encode(cv2.imencode(".png", picture)[1].tobytes()).decode()


def test_what_is_no_picture_gives_none():
    whole = base64.b64decode(png(np.zeros((10, 10, 3), np.uint8)))
    huge = whole[:16] + (60_000).to_bytes(4, "big") * 2 + whole[24:]
    assert MOST_PIXELS < 60_000**2
    for content in (b"", b"GIF89a" + whole, whole[:30], huge):
        assert smaller(base64.b64encode(content).decode()) == ""
    assert smaller("=") == ""


def test_a_glimpse_is_plain_text(tmp_path):
    report = tmp_path / "report.html"
    assert read_glimpse(report) == ("", "", "", "")
    picture = png(np.zeros((10, 20, 3), np.uint8))
    report.write_text(
        '<h1>Is <code>a</code> &lt; b?</h1><section aria-label="Summary" class="summary good"><p><b>It is '
        f'&amp; stays so.</b> More.</p></section><img alt="A &quot;map&quot;" '
        f'src="data:image/png;base64,{picture}">',
        encoding="utf-8",
    )
    found = read_glimpse(report)
    assert found[:2] == ("Is a < b?", "It is & stays so.") and found.alt == 'A "map"' and found.picture
    # It is read again once the report has changed.
    report.write_text("<h1>Other</h1>", encoding="utf-8")
    assert read_glimpse(report) == ("Other", "", "", "")
    report.write_bytes(b"\xff\xfe<h1>")
    assert read_glimpse(report).title == ""
