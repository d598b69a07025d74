"""Two cameras' runs as one table: joined frame by frame, and nothing of either is lost."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest

from tests.refused import refused
from wildlab.pipeline.detecting.fused import FUSED_COLUMNS, fuse_runs

#: The second camera has twice as many pixels, and its corner elsewhere.
TO_FIRST = np.array([[0.5, 0, -10], [0, 0.5, 5], [0, 0, 1]])


def table(places: dict[str, list[tuple[float, float]]], variance: float) -> pd.DataFrame:
    rows = [
        (f"{frame}/{row}", frame, u, v, variance, 0.0, variance)
        for frame, points in places.items()
        for row, (u, v) in enumerate(points)
    ]
    columns = ["detection_id", "frame_id", "u_px", "v_px", "cov_uu_px2", "cov_uv_px2", "cov_vv_px2"]
    return pd.DataFrame(rows, columns=columns)


def test_what_both_saw_is_joined_and_the_rest_is_kept() -> None:
    thermal = table({"a.tiff": [(50, 50), (100, 80)], "b.tiff": [(10, 10)]}, 1.0)
    # In the first image: (50, 50), (200, 100); then only the second camera found something in c.
    colour = table({"a.jpg": [(120, 90), (420, 190)], "c.jpg": [(60, 30)]}, 4.0)
    found = fuse_runs(thermal, colour, TO_FIRST)
    assert list(found.columns) == list(FUSED_COLUMNS)
    said = found[["frame_id", "seen_by", "first_id", "second_id"]].to_numpy().tolist()
    assert said == [
        ["a.tiff", "both", "a.tiff/0", "a.jpg/0"],
        ["a.tiff", "first", "a.tiff/1", ""],
        ["a.tiff", "second", "", "a.jpg/1"],
        ["b.tiff", "first", "b.tiff/0", ""],
        ["c.jpg", "second", "", "c.jpg/0"],
    ]
    assert np.allclose(found[["u_px", "v_px"]], [[50, 50], [100, 80], [200, 100], [10, 10], [20, 20]])
    # Half as large pixels: a variance of 4 is 1 in the first image, and two of 1 are one of a half.
    assert np.allclose(found["cov_uu_px2"], [0.5, 1, 1, 1, 1])
    assert found["distance2"].iloc[0] == 0 and found["distance2"].iloc[1:].isna().all()


def test_frames_can_be_said_to_belong_together() -> None:
    thermal, colour = table({"T1": [(50, 50)]}, 1.0), table({"W1": [(120, 90)], "W2": [(120, 90)]}, 4.0)
    with refused("None of 1"):
        fuse_runs(thermal, colour, TO_FIRST)
    found = fuse_runs(thermal, colour, TO_FIRST, frames={"T1": "W1", "T2": "W2"}, registration_px=1.0)
    assert found["seen_by"].tolist() == ["both", "second"] and found["frame_id"].tolist() == ["T1", "T2"]
    assert found["cov_uu_px2"].tolist() == pytest.approx([1 / (1 + 1 / 2), 2.0])
    empty = thermal.iloc[:0]
    assert fuse_runs(empty, empty, TO_FIRST).empty
    assert fuse_runs(thermal, empty, TO_FIRST)["seen_by"].tolist() == ["first"]


def test_a_table_of_something_else_is_refused() -> None:
    with refused("'cov_uu_px2'"):
        fuse_runs(table({}, 1.0), table({}, 1.0).drop(columns="cov_uu_px2"), TO_FIRST)
