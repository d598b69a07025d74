"""Track errors against geometry that can be done in the head."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from wildlab.errors import WildlabError
from wildlab.evaluation.consistency import ERROR_CONVENTION
from wildlab.evaluation.errors import summarise_track, track_errors


def test_errors_are_truth_minus_estimate():
    assert ERROR_CONVENTION == "truth minus estimate"
    e = track_errors([[10.0, 5.0, 3.0, 4.0]], [[7.0, 9.0, 0.0, 2.0]])
    np.testing.assert_allclose(e.position, [[3.0, -4.0]])
    np.testing.assert_allclose(e.speed, [5.0 - 2.0])


def test_course_errors_do_not_jump_through_north():
    degrees = np.radians([[1.0], [359.0], [180.0]])
    t = np.column_stack([np.zeros((3, 2)), 5 * np.cos(degrees), 5 * np.sin(degrees)])
    other = np.radians([[359.0], [1.0], [0.0]])
    x = np.column_stack([np.zeros((3, 2)), 2 * np.cos(other), 2 * np.sin(other)])
    np.testing.assert_allclose(np.degrees(track_errors(t, x).course), [2.0, -2.0, 180.0], atol=1e-9)
    summary = summarise_track(track_errors(t[:2], x[:2]))
    assert np.degrees(summary.rmse_course) == pytest.approx(2.0)


@given(st.floats(-np.pi, np.pi), st.floats(-np.pi, np.pi))
def test_a_course_error_is_the_turn_from_the_estimate_to_the_truth(true, estimated):
    t, x = ([[0.0, 0.0, 2 * np.cos(angle), 2 * np.sin(angle)]] for angle in (true, estimated))
    error = track_errors(t, x).course[0]
    assert -np.pi < error <= np.pi
    assert np.exp(1j * (estimated + error)) == pytest.approx(np.exp(1j * true), abs=1e-9)


def test_a_target_at_rest_has_no_course():
    e = track_errors([[3.0, 4.0, 0.01, 0.0]], [[0.0, 0.0, 1.0, 0.0]])
    assert np.isnan(e.course[0])
    summary = summarise_track(e)
    assert (summary.n, summary.mae) == (1, 5.0)
    assert np.isnan(summary.rmse_course)


def test_rows_without_truth_are_counted_and_not_dropped():
    truth = np.zeros((5, 4))
    truth[3:] = np.nan
    truth[0, 2:] = np.nan  # a position without a velocity can be compared
    estimate = np.zeros((5, 4))
    estimate[:, 0] = [3.0, np.nan, -4.0, 9.0, np.nan]
    e = track_errors(truth, estimate)
    assert e.position.shape == (5, 2)
    np.testing.assert_array_equal(np.isnan(e.position[:, 0]), [False, True, False, True, True])
    summary = summarise_track(e)
    assert (summary.n, summary.no_truth, summary.no_estimate) == (2, 2, 2)
    assert summary.mae == pytest.approx(3.5)
    assert summary.rmse == pytest.approx(np.sqrt(12.5))
    assert summary.mean_north == pytest.approx(0.5)


def test_nothing_to_compare_is_nan_and_not_a_crash():
    summary = summarise_track(track_errors(np.full((3, 4), np.nan), np.zeros((3, 4))))
    assert (summary.n, summary.no_truth) == (0, 3)
    assert np.isnan(summary.mae)


def test_shapes_that_do_not_fit_are_refused():
    with pytest.raises(WildlabError, match="does not go"):
        track_errors(np.zeros((2, 4)), np.zeros((3, 4)))
    with pytest.raises(WildlabError, match="velocity east"):
        track_errors(np.zeros((2, 2)), np.zeros((2, 2)))
