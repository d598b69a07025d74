"""Charts of navigation draw the numbers they are given, bounds and bands included."""

from __future__ import annotations

import numpy as np
import pytest

from wildlab.evaluation.consistency import chi_square_interval
from wildlab.reporting.charts.navigation import (
    bias_chart,
    correlation_strips,
    deviation_chart,
    error_bands,
    speed_chart,
    squares_chart,
)
from wildlab.reporting.figures import MOST_POINTS

TIMES = np.linspace(0.0, 60.0, 301)


def test_errors_and_twice_their_deviations_are_drawn():
    rng = np.random.default_rng(0)
    error, sd = rng.normal(0, [1, 2, 3], (301, 3)), np.tile([1.0, 2.0, 3.0], (301, 1))
    fig = error_bands(TIMES, {"mekf": error}, {"mekf": sd}, ["a (m)", "b (m)", "c (m)"], "Errors")
    for i, ax in enumerate(fig.axes[:3]):
        (band,) = ax.collections
        assert band.get_paths()[0].get_extents().y1 == pytest.approx(2 * (i + 1))
        line = next(line for line in ax.lines if len(line.get_ydata()) == 301)
        assert np.array_equal(line.get_ydata(), error[:, i])
        assert ax.get_ylim()[1] >= np.abs(error[:, i]).max()
    cut = error_bands(TIMES, {"mekf": error}, {}, ["a", "b", "c"], "Errors", largest=0.5)
    assert cut.axes[0].get_ylim()[1] == pytest.approx(0.525)


def test_printed_deviations_stand_beside_those_found():
    fig = deviation_chart(TIMES, np.ones((301, 6)), [0.1, 0.2, 0.3, 1, 2, 3], ("m", "°"), "SD")
    broken = [line.get_ydata()[0] for ax in fig.axes for line in ax.lines if line.get_linestyle() != "-"]
    assert broken == [0.1, 0.2, 0.3, 1, 2, 3]
    assert all(ax.get_yscale() == "log" for ax in fig.axes)


def test_squares_have_the_band_of_chi_square():
    values = np.random.default_rng(1).chisquare(3, 301)
    fig = squares_chart({"position": (TIMES, values), "second position": (TIMES, values)}, 3, "NIS", "NIS")
    edges = {round(float(line.get_ydata()[0]), 9) for line in fig.axes[0].lines if len(line.get_ydata()) == 2}
    assert edges == {round(edge, 9) for edge in chi_square_interval(3)}
    assert fig.axes[1].get_ylabel() == "NIS\n2nd antenna"


def test_units_of_biases_and_long_lines_and_white_bands():
    biases = np.tile([0.01, 0, 0, np.radians(1) / 3600, 0, 0], (301, 1))
    fig = bias_chart(TIMES, biases, 0.5 * biases, "Biases")
    assert fig.axes[0].lines[0].get_ydata()[0] == pytest.approx(10.0)  # mm/s^2
    assert fig.axes[0].collections[0].get_paths()[0].get_extents().y1 == pytest.approx(20.0)
    assert fig.axes[1].lines[0].get_ydata()[0] == pytest.approx(1.0)  # deg/h
    many = np.linspace(0, 1, 10 * MOST_POINTS)
    speed = speed_chart({"mekf": (many, np.tile([3.0, 4.0, 0.0], (len(many), 1)))}, "Speed")
    assert len(speed.axes[0].lines[0].get_ydata()) <= MOST_POINTS
    assert speed.axes[0].lines[0].get_ydata()[0] == pytest.approx(5.0)
    rows = np.full((3, 11), 0.05)
    strips = correlation_strips({"velocity": rows}, {"velocity": 0.1}, "White?")
    assert strips.axes[0].patches[0].get_extents() is not None
    assert list(strips.axes[0].lines[0].get_xdata()) == list(range(1, 11))
