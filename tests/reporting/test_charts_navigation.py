"""Charts of navigation draw the numbers they are given, bounds and bands included."""

from __future__ import annotations

import numpy as np
import pytest

from wildlab.evaluation.consistency import chi_square_interval
from wildlab.reporting.charts.navigation import (
    bias_chart,
    error_bands,
    speed_chart,
    squares_chart,
)
from wildlab.reporting.figures import MOST_POINTS

TIMES = np.linspace(0.0, 60.0, 301)


def test_errors_and_twice_their_deviations_are_drawn():
    rng, sds = np.random.default_rng(0), [1.0, 2.0, 3.0]
    error, sd = rng.normal(0, sds, (301, 3)), np.tile(sds, (301, 1))
    fig = error_bands(TIMES, {"mekf": error}, {"mekf": sd}, ["a (m)", "b (m)", "c (m)"], "Errors")
    for i, ax in enumerate(fig.axes[:3]):
        (band,) = ax.collections
        assert band.get_paths()[0].get_extents().y1 == pytest.approx(2 * sds[i])
        assert any(np.array_equal(line.get_ydata(), error[:, i]) for line in ax.lines)
        assert ax.get_ylim()[1] >= np.abs(error[:, i]).max()


def test_squares_have_the_band_of_chi_square():
    values = np.random.default_rng(1).chisquare(3, 301)
    fig = squares_chart({"position": (TIMES, values)}, 3, "NIS", "NIS")
    edges = [line.get_ydata()[0] for line in fig.axes[0].lines if len(line.get_ydata()) == 2]
    assert sorted(edges) == pytest.approx(chi_square_interval(3))


def test_units_of_biases_and_long_lines():
    biases = np.tile([0.01, 0, 0, np.radians(1) / 3600, 0, 0], (301, 1))
    forces, rates = bias_chart(TIMES, biases, 0.5 * biases, "Biases").axes
    assert forces.lines[0].get_ydata()[0] == pytest.approx(10.0)  # mm/s^2
    assert forces.collections[0].get_paths()[0].get_extents().y1 == pytest.approx(20.0)
    assert rates.lines[0].get_ydata()[0] == pytest.approx(1.0)  # deg/h
    many = np.linspace(0, 1, 10 * MOST_POINTS)
    speed = speed_chart({"mekf": (many, np.tile([3.0, 4.0, 0.0], (len(many), 1)))}, "Speed")
    shown = speed.axes[0].lines[0].get_ydata()
    assert len(shown) <= MOST_POINTS and shown[0] == pytest.approx(5.0)
