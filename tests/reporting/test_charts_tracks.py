"""Charts of tracks draw what they are given, in strips for as many quantities as there are."""

from __future__ import annotations

import numpy as np
import pytest

from wildlab.reporting.charts.tracks import (
    error_over_time,
    speed_and_course,
    squares_over_time,
)

TIMES = np.arange(0.0, 20.0, 0.1)
SEEN = (TIMES < 5.0) | (TIMES > 15.0)
NAMES = {"ekf": "Extended", "schmidt": "Schmidt"}
#: At 1 m/s to the north, a little east and west of it.
TRUTH = np.column_stack([TIMES, 0 * TIMES, 0 * TIMES + 1.0, 0.05 * np.sin(TIMES)])


@pytest.mark.parametrize("strips", [1, 2])
def test_errors_are_distances_or_north_and_east(strips):
    error = TRUTH[:, 0] if strips == 1 else TRUTH[:, :2]
    figure = error_over_time(TIMES, SEEN, {"ekf": error}, NAMES, "Errors", measured=error)
    assert len(figure.axes) == strips
    for i, ax in enumerate(figure.axes):
        line = next(line for line in ax.lines if line.get_label() == "Extended")
        assert np.array_equal(line.get_ydata(), np.column_stack([error])[:, i])
        assert len(ax.patches) == 1  # the pause
        assert len(ax.lines[-1].get_xdata()) == SEEN.sum()


def courses(figure):
    return {line.get_label(): np.asarray(line.get_ydata(), float) for line in figure.axes[1].lines}


def test_a_steady_course_is_drawn_about_itself_also_over_north():
    rest = TRUTH.copy()
    rest[:, 2:] *= 0.1
    figure = speed_and_course(TIMES, SEEN, TRUTH, {"ekf": rest}, NAMES, "Speed")
    assert np.isnan(courses(figure)["Extended"]).all()  # of what hardly moves
    about = courses(figure)["truth"]
    assert np.ptp(about) == pytest.approx(2 * np.degrees(np.arctan(0.05)), rel=0.01)
    low, high = figure.axes[1].get_ylim()
    assert low < about.min() and about.max() < high and high - low == pytest.approx(20.0)
    assert figure.axes[1].yaxis.get_major_formatter()(-5.0, 0) == "355"
    assert figure.axes[0].get_ylim()[1] == pytest.approx(1.2, rel=0.01)


def test_courses_all_round_break_over_north():
    turning = TRUTH.copy()
    turning[:, 2], turning[:, 3] = np.cos(0.7 * TIMES), np.sin(0.7 * TIMES)
    figure = speed_and_course(TIMES, SEEN, turning, {"ekf": turning}, NAMES, "Speed")
    angle = courses(figure)["truth"]
    seen = angle[np.isfinite(angle)]
    assert len(seen) < len(angle)
    assert (seen >= 0).all() and (seen <= 360).all()
    assert np.nanmax(np.abs(np.diff(angle))) < 180
    assert figure.axes[1].get_ylim() == (-5.0, 365.0)


def test_values_at_detections_alone_are_dots():
    nis, nees = np.where(SEEN, 0.5, np.nan), np.full(len(TIMES), 2.0)
    figure = squares_over_time(TIMES, SEEN, {"NIS": {"ekf": nis}, "NEES": {"ekf": nees}}, NAMES, "Squares")
    dots, line = (one for ax in figure.axes for one in ax.lines if one.get_label() == "Extended")
    assert (dots.get_linestyle(), line.get_linestyle()) == ("None", "-")
