"""Raw tables: text read block by block as Python's own reader has it, and angles that can be no radians."""

import csv
import io
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from hypothesis import given
from hypothesis import strategies as st

from wildlab.errors import WildlabError
from wildlab.flight import raw_files as raw
from wildlab.flight.raw_files import RawTable, numbers, plain_numbers, read_delimited, texts
from wildlab.flight.recipes import Quantity

CELLS = st.text(st.characters(codec="utf-8", exclude_characters="\0"), max_size=6)


@given(st.lists(st.tuples(CELLS, CELLS, CELLS), min_size=1, max_size=12), st.integers(1, 5))
def test_blocks_and_whole_say_the_same(rows, block):
    written = io.StringIO(newline="")
    writer = csv.writer(written, quoting=csv.QUOTE_ALL)
    writer.writerows([("a", "b", "c"), *rows])
    text = written.getvalue()
    reader = csv.reader(io.StringIO(text, newline=""), skipinitialspace=True)
    expected = [([cell.strip() for cell in row], reader.line_num) for row in reader][1:]
    before, raw.BLOCK = raw.BLOCK, block
    try:
        cells, lines = read_delimited(Path("t.csv"), text.encode(), ",")
    finally:
        raw.BLOCK = before
    assert list(cells) == ["a", "b", "c"]
    assert cells.to_numpy(dtype=object).tolist() == [row for row, _ in expected]
    assert lines.tolist() == [line for _, line in expected]


def test_numbers_over_several_blocks(monkeypatch):
    monkeypatch.setattr(raw, "BLOCK", 2)
    text = "t,x\n1,0.1\n2,1e-3\n3,\n4,7\n5, -8 \n"
    table = RawTable(Path("t.csv"), *read_delimited(Path("t.csv"), text.encode(), ","))
    np.testing.assert_array_equal(plain_numbers(table, "t", "p"), [1, 2, 3, 4, 5])
    np.testing.assert_array_equal(
        plain_numbers(table, "x", "p", may_be_empty=True), [0.1, 1e-3, np.nan, 7, -8]
    )
    assert texts(table, "x", "p", may_be_empty=True).tolist() == ["0.1", "1e-3", "", "7", "-8"]
    some = table.rows(np.array([4, 0]))
    np.testing.assert_array_equal(plain_numbers(some, "x", "p"), [-8, 0.1])
    assert some.cell("x", 0) == "-8" and some.lines.tolist() == [6, 2]
    with pytest.raises(WildlabError, match="line 4: this cell is empty"):
        plain_numbers(table, "x", "p")


def test_the_line_of_a_wrong_byte_far_into_the_file():
    data = b"a,b\n" + b"1,2\n" * 50_000 + b"1,\xff\n"
    with pytest.raises(WildlabError, match="line 50002"):
        read_delimited(Path("t.csv"), data, ",")


def angles(part: str, values: list[float], unit: str = "rad") -> np.ndarray:
    column = np.array(values)
    table = RawTable(Path("log.csv"), pd.DataFrame({"a": column}), np.arange(2, 2 + len(column)))
    return numbers(table, Quantity(column="a", unit=unit), "angle", part, may_be_empty=True)


@pytest.mark.parametrize(
    ("part", "values"),
    [
        ("poses.log.attitude.roll", [0.1, 3.0, 7.5]),
        ("poses.log.attitude.yaw", [0.2, 1.0, 359.0, 3.0]),
        ("poses.log.attitude.yaw", [90.0, 91.0, 92.0]),
        ("poses.log.attitude.yaw", [np.nan, -178.0, np.nan, 179.0]),
        ("detections.azimuth", [1.0, 200.0, 30.0]),
    ],
)
def test_degrees_that_are_said_to_be_radians_are_refused_with_what_to_write(part, values):
    with pytest.raises(WildlabError, match="not in radians") as caught:
        angles(part, values)
    assert caught.value.fix == 'write unit = "deg"'
    assert caught.value.field == f"a (in [{part}])"
    assert np.allclose(angles(part, values, "deg"), np.radians(values), equal_nan=True)


def test_an_angle_may_be_counted_on_over_whole_turns():
    turns = np.linspace(0.3, 40.0, 500)
    assert np.array_equal(angles("poses.log.attitude.yaw", turns.tolist()), turns)
    wrapped = [3.1, -3.1, 3.0, 6.2, 0.1]
    assert np.array_equal(angles("poses.log.attitude.yaw", wrapped), wrapped)
    assert np.isnan(angles("poses.log.attitude.yaw", [np.nan, np.nan])).all()
