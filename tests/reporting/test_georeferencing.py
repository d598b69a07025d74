"""Tables and metrics about accuracy follow from the numbers."""

import numpy as np
import pandas as pd
import pytest

from wildlab.evaluation.errors import summarise
from wildlab.evaluation.pose_noise import KINDS, PoseNoise
from wildlab.reporting import georeferencing
from wildlab.reporting.report import open_report


@pytest.fixture
def report():
    return open_report(study="made-up", kind="twin")


def scored_table(n=20, seed=0):
    rng = np.random.default_rng(seed)
    e = rng.normal(size=(n, 2))
    return pd.DataFrame(
        {"frame_id": np.repeat([f"I{i}" for i in range(n // 2)], 2), "error_north_m": e[:, 0],
         "error_east_m": e[:, 1],
         "error_m": np.hypot(*e.T), "inside_90": 1.0, "ellipse": "linear"}
    )  # fmt: skip


def test_metrics_have_the_promised_names(report):
    georeferencing.record_errors(report, "logged-pose", scored_table(), {"horizontal_error_mean": (0.5, 2.0)})
    assert [m["name"] for m in report._metrics] == [
        *(f"horizontal_error_{one}" for one in ("mean", "median", "p90", "max")),
        *("bias_north", "bias_east", "sd_north", "sd_east", "ellipse_coverage_90"),
    ]
    assert report._metrics[0]["low"] == 0.5


def test_noise_is_shown_in_degrees():
    noise = PoseNoise(dict.fromkeys(KINDS, np.radians(2.0)), dict.fromkeys(KINDS, 1.5))
    units = ("position_horizontal_m", "position_vertical_m", "tilt_deg", "heading_deg", "pixel_px")
    table = georeferencing.noise_table(noise, dict.fromkeys(units, 1)).set_index("what")
    assert table.loc["heading", "estimated"] == pytest.approx(2.0) and len(table) == len(KINDS)


def test_too_few_points_are_not_praised():
    few, many = summarise(np.ones((3, 2))), summarise(np.ones((20, 2)))
    assert len(georeferencing.headline(few, 3)) == 3 and len(georeferencing.headline(many, 20)) == 1
    assert "20 of 25" in georeferencing.headline(many, 25)[0]
    assert georeferencing.headline(summarise(np.empty((0, 2))), 25) == []


def test_names_that_may_tell_of_a_place_are_numbered_unless_it_is_open() -> None:
    tables = {name: pd.DataFrame() for name in ("Flight 1", "Flight  1", "north gate")}
    assert list(georeferencing.named(tables, "part", shown=False)) == ["part-1", "part-2", "part-3"]
    assert list(georeferencing.named(tables, "part", shown=True)) == [
        "Flight-1",
        "Flight-1-again",
        "north-gate",
    ]
    assert "north gate" not in georeferencing.unlabelled_words(["north gate"], shown=False)[0]
    assert "40" not in georeferencing.vertical_words(40.3)
