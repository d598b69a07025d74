"""Level ground is as high as the surveyed points; tracks count only where there are none, and it is said."""

from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest

from wildlab.pipeline.overviews.image_coverage import ground_height


def height(names, times, downs, kind="logged"):
    truth = pd.DataFrame({"target_id": names, "time_s": times, "down_m": downs})
    manifest = SimpleNamespace(kind=kind)
    return ground_height(SimpleNamespace(truth=truth, detections=None, manifest=manifest))


def test_surveyed_points_come_before_the_track_of_a_receiver():
    names, times = ["a", "b", *["walker"] * 3], [np.nan, np.nan, 1.0, 2.0, 3.0]
    down, words = height(names, times, [-12.0, -11.0, -3.0, -2.0, -1.0])
    assert down == pytest.approx(-11.5) and words == "level ground at the mean height of 2 surveyed points"
    down, words = height(names, times, [np.nan, -11.0, -3.0, -2.0, -1.0])
    assert down == -11.0 and words.endswith("of 1 surveyed point")
    assert "surveyed" not in height(names, times, [-12.0, -11.0, -3.0, -2.0, -1.0], "twin")[1]


def test_tracks_are_named_where_nothing_was_surveyed():
    down, words = height(["x", "x", "y"], [1.0, 2.0, 1.0], [-1.0, -2.0, -9.0])
    assert down == -2.0 and words == "level ground at the median height of the tracks of 2 targets"
    assert height(["x"], [1.0], [-1.0])[1].endswith("the track of one target")
