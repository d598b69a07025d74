"""The small pictures of cards, what else a card shows of a report, and where a ratio lies on its strip."""

from __future__ import annotations

import base64

import cv2
import numpy as np
import pytest

from wildlab.reporting.front_page import MOST_PIXELS, read_glimpse, smaller
from wildlab.reporting.published_tables import place


def png(picture: np.ndarray) -> str:
    return base64.b64encode(cv2.imencode(".png", picture)[1].tobytes()).decode()


def test_a_ratio_lies_on_a_logarithmic_axis_from_an_eighth_to_eight():
    assert [place(ratio) for ratio in (0.0, 1e-3, 1 / 8, 1 / 2, 1.0, 2.0, 8.0, 1e3)] == pytest.approx(
        [8, 8, 8, 56, 80, 104, 152, 152]
    )


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
