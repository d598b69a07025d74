"""Words, tables and metrics about accuracy follow from the numbers."""

import numpy as np
import pandas as pd
import pytest

from wildlab.evaluation.errors import Scatter, summarise
from wildlab.evaluation.pose_noise import KINDS, PoseNoise
from wildlab.geometry.calibration import Calibration
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


def scatter(bias, image, within):
    return Scatter(bias, image, within, np.array([3.0, 4.0]), np.array([0.6, 0.8]))


@pytest.mark.parametrize(
    ("shares", "word"),
    [((0.7, 0.2, 0.1), "constant"), ((0.1, 0.8, 0.1), "wrong together"), ((0.1, 0.2, 0.7), "its own way")],
)
def test_the_largest_share_is_named(shares, word):
    assert word in georeferencing.main_limit(scatter(*shares))


def test_too_few_points_are_said_so():
    nan = float("nan")
    silent = Scatter(nan, nan, nan, np.full(2, nan), np.full(2, nan))
    assert "too few" in georeferencing.main_limit(silent)
    assert georeferencing.limiting_factors(silent, summarise(np.ones((2, 2))), None) == []


def test_factors_are_sorted_by_their_share_and_carry_their_numbers():
    logged = summarise(np.array([[3.0, 4.0], [3.0, 4.0]]))
    factors = georeferencing.limiting_factors(scatter(0.2, 0.3, 0.5), logged, None)
    assert ["Single" in factors[0], "pose" in factors[1], "constant" in factors[2]] == [True] * 3
    assert "1.0 m" in factors[0]
    assert "5.0 m" in factors[1]
    assert "5.0 m over all images" in factors[2]


def test_metrics_have_the_promised_names(report):
    georeferencing.record_errors(report, "logged-pose", scored_table(), {"horizontal_error_mean": (0.5, 2.0)})
    names = [m["name"] for m in report._metrics]
    assert names == [
        "horizontal_error_mean", "horizontal_error_median", "horizontal_error_p90", "horizontal_error_max",
        "bias_north", "bias_east", "sd_north", "sd_east", "ellipse_coverage_90",
    ]  # fmt: skip
    assert report._metrics[0]["low"] == 0.5


def test_noise_is_shown_in_degrees():
    noise = PoseNoise(dict.fromkeys(KINDS, np.radians(2.0)), dict.fromkeys(KINDS, 1.5))
    stated = {
        "position_horizontal_m": 1,
        "position_vertical_m": 1,
        "roll_deg": 1,
        "yaw_deg": 1,
        "pixel_px": 1,
    }
    table = georeferencing.noise_table(noise, stated).set_index("what")
    assert table.loc["yaw", "estimated"] == pytest.approx(2.0)
    assert len(table) == len(KINDS)


def test_what_was_not_estimated_is_said_with_its_partners(report):
    found = Calibration(
        ("roll",), np.array([0.02]), np.array([[1e-6]]), {"clock": ("tilt",), "pan": ()}, 10, 5
    )
    words = georeferencing.undetermined_words(found)
    assert "cannot tell it from tilt" in words[0]
    assert "no effect" in words[1]
    table = georeferencing.calibration_table(report, found)
    assert table.loc[0, "value"] == pytest.approx(np.degrees(0.02))
    assert table.loc[0, "verdict"] == "differs from zero"
    assert report._metrics[0]["name"] == "boresight_roll"


def test_lengths_in_words():
    assert georeferencing.length(5.06) == "5.1 metres"
    assert georeferencing.length(0.404) == "40 centimetres"
    assert georeferencing.short_length(0.404) == "40 cm"
    assert georeferencing.span([50.6, 111.2, np.nan]) == "51 to 111"
    assert georeferencing.span([100.1, 99.9]) == "100"


def test_too_few_points_are_not_praised():
    few, many_points = summarise(np.ones((3, 2))), summarise(np.ones((20, 2)))
    assert "too few" in georeferencing.summary_sentences(few, scatter(1, 0, 0))[0]
    assert "nine times out of ten" in georeferencing.summary_sentences(many_points, scatter(1, 0, 0))[0]
