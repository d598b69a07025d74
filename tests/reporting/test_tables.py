"""Tables: labelled for a phone, within a link as CSV, and no place on Earth in one."""

from __future__ import annotations

import base64
import io

import numpy as np
import pandas as pd
import pytest
from bs4 import BeautifulSoup

from wildlab.reporting.tables import MOST_BYTES, csv_link, data_link, table_html


def content(link: str) -> str:
    anchor = BeautifulSoup(link, "html.parser").a
    assert anchor is not None and str(anchor["href"]).startswith("data:text/csv;base64,")
    return base64.b64decode(str(anchor["href"]).split(",", 1)[1]).decode("utf-8")


def test_every_cell_says_which_column_it_is_of() -> None:
    frame = pd.DataFrame({"a": ["x", "y"], "b": [1, 2], "c": [0.5, np.nan], "d": [True, False]})
    soup = BeautifulSoup(table_html(frame, {"b": 'the **second** "b"'}, None), "html.parser")
    heads = [one.get_text() for one in soup.select("thead th")]
    for row in soup.select("tbody tr"):
        assert (
            [cell["data-label"] for cell in row.find_all(["th", "td"])]
            == heads
            == ["a", 'the second "b"', "c", "d"]
        )
    # A style that makes blocks of rows takes the table away from who hears it; roles give it back.
    assert {one["role"] for one in soup.find_all(role=True)} == {
        *("table", "rowgroup", "row", "columnheader", "rowheader", "cell")
    }
    assert soup.table is not None and soup.table["class"] == ["many"]
    assert "many" not in table_html(frame[["a", "b"]], {}, None)


def test_the_link_holds_the_table_to_the_last_digit() -> None:
    rng = np.random.default_rng(0)
    frame = pd.DataFrame({"name": ["ä", "b,c", '"'], "value": rng.normal(size=3) * 1e5})
    back = pd.read_csv(io.StringIO(content(csv_link(frame, "Study/../x", "words"))))
    pd.testing.assert_frame_equal(back, frame)
    assert 'download="study-x.csv"' in csv_link(frame, "Study/../x", "words")


def test_no_cell_and_no_column_is_a_formula() -> None:
    text = content(csv_link(pd.DataFrame({"=1+1": ["@x", "-3"]}), "a"))
    assert text.splitlines() == ["'=1+1", "'@x", "'-3"]


@pytest.mark.parametrize("column", ["lat", "lon_deg", "Latitude", "longitude", "utm_zone", "ecef_x", "mgrs"])
def test_where_on_earth_something_is_gets_into_no_link(column: str) -> None:
    assert csv_link(pd.DataFrame({"name": ["a"], column: [1.0]}), "a") == ""


def test_local_metres_do_and_words_that_begin_alike() -> None:
    assert csv_link(pd.DataFrame({"north_m": [1.0], "later": [2.0], "long": [3.0]}), "a")


def test_what_is_empty_or_large_is_not_embedded() -> None:
    assert csv_link(pd.DataFrame({"a": []}), "a") == ""
    assert data_link(b"x" * MOST_BYTES, "text/csv", "a.csv", "w")
    assert data_link(b"x" * (MOST_BYTES + 1), "text/csv", "a.csv", "w") == ""
