"""What stands on tiles and beside published numbers is what was recorded."""

from __future__ import annotations

import re
from types import SimpleNamespace
from typing import Any

import pytest

from wildlab.evaluation.replication import Closeness, Comparison, Compatibility
from wildlab.messages.catalogue import PageTexts, TileText
from wildlab.reporting.published import Number
from wildlab.reporting.published_tables import published_table
from wildlab.reporting.report import Wording
from wildlab.studies.page import tile_of


def tile(
    entry: dict[str, Any], printed: dict[str, Any] | None = None, form: str = "value"
) -> tuple[str, str]:
    recorded = {("mae", "ekf"): {"unit": "m", **entry}}
    report: Any = SimpleNamespace(recorded=recorded, printed=lambda name, subject: printed)
    return tile_of(report, TileText("ekf", "mae", "mean error", form), Wording(report, PageTexts()))


@pytest.mark.parametrize(
    ("entry", "printed", "number", "words"),
    [
        ({"value": 9.81}, None, "9.8 m", "mean error"),
        ({"value": 9.81, "low": 5.1, "high": 14.0}, None, "9.8 m", "mean error (5.1 to 14)"),
        # Of flights where the median has an interval of its own.
        ({"value": 9.81, "low": 5.1, "high": 14.0, "centre_low": 8.0}, None, "9.8 m",
         "mean error (flights: 5.1 to 14)"),
        ({"value": 9.81, "low": 9.81, "high": 9.81}, None, "9.8 m", "mean error"),
        # With the digits of the print.
        ({"value": 96.834}, {"value": 95.93, "digits": 2}, "96.83 m", "mean error; published 95.93"),
        ({"value": None}, {"value": 95.93, "digits": 2}, "nan m", "mean error; published 96 m"),
    ],
)  # fmt: skip
def test_a_tile_has_the_number_its_interval_and_the_print(entry, printed, number, words):
    assert tile(entry, printed) == (number, words)


def test_a_published_number_has_ours_beside_it():
    one = Number(
        "mae", "ekf", "deg", "H table 7.5", 1.2, 1, 3.456, None, None,
        Comparison(Closeness.NOT_CLOSE, Compatibility.WITHIN, 2.88),
    )  # fmt: skip
    page = published_table([one], {"ekf": "EKF"}, {"mae": "mean error"})
    cells = re.findall(r"<t[hd][^>]*>([^<]*)</t[hd]>", page.split("<tbody")[1])
    assert cells[:4] == ["EKF", "mean error (°)", "1.2", "3.46"]
    signs = re.findall(r'pill (\w+)" role="img" aria-label="[^"]*">(.)<', page)
    assert signs == [("no", "✗"), ("yes", "✓")]
