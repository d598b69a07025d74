"""The life of a track: the start of H 3.4.1 against its words, and what ends one."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from wildlab.errors import WildlabError
from wildlab.geometry.validation import gate_threshold
from wildlab.tracking.many.life import CONFIRMED, DROPPED, UNDECIDED, judge_start, outlived, pair_scans

GATE = gate_threshold(0.99, 2)


@pytest.mark.parametrize(("m", "n"), [(3, 5), (1, 1), (2, 2), (1, 4)])
def test_every_course_of_scans_is_decided_as_its_end_says(m, n):
    """Judged at every scan: open until the end is certain, and right from then on."""
    for course in itertools.product([0, 1], repeat=n):
        verdicts = [int(judge_start([sum(course[:scans])], [scans], m, n)[0]) for scans in range(1, n + 1)]
        assert verdicts[-1] == (CONFIRMED if sum(course) >= m else DROPPED)
        for scans, verdict in enumerate(verdicts, start=1):
            ends = {
                sum(course[:scans]) + sum(rest) >= m for rest in itertools.product([0, 1], repeat=n - scans)
            }
            certain = {True: CONFIRMED, False: DROPPED}
            assert verdict == (certain[ends.pop()] if len(ends) == 1 else UNDECIDED)


def test_before_the_first_scan_nothing_is_decided():
    assert judge_start([0], [0]).tolist() == [UNDECIDED]


@pytest.mark.parametrize(
    ("hits", "scans", "m", "n"),
    [
        ([1], [1], 0, 5),
        ([1], [1], 6, 5),
        ([2], [1], 3, 5),
        ([0], [6], 3, 5),
        ([-1], [1], 3, 5),
        ([1], [1, 2], 3, 5),
    ],
)
def test_counts_that_cannot_be_are_refused(hits, scans, m, n):
    with pytest.raises(WildlabError):
        judge_start(hits, scans, m, n)


@given(st.floats(0, 2 * np.pi), st.floats(0.1, 3), st.floats(0, 10), st.floats(0.5, 20))
def test_the_region_is_that_of_noise_about_where_motion_may_lead(angle, dt, speed, sd):
    """Without correlation its edge lies the reach of noise beyond that of motion, all around."""
    edge = speed * dt + np.sqrt(GATE * 2) * sd
    for length, inside in ((0.999 * edge, True), (1.001 * edge, False)):
        point = length * np.array([np.cos(angle), np.sin(angle)])
        found = pair_scans([[0.0, 0.0]], [point], dt, sd**2 * np.eye(2), speed, GATE)
        assert (found.measurement[0] == 0) == inside


def test_a_target_at_rest_is_let_in_as_often_as_the_gate_says():
    rng = np.random.default_rng(2)
    R = np.array([[9.0, 4.0], [4.0, 4.0]])
    z = rng.multivariate_normal([0, 0], R, (20000, 2))
    paired = [pair_scans(one[:1], one[1:], 1.0, R, 0.0, GATE).track[0] == 0 for one in z[:3000]]
    assert np.mean(paired) == pytest.approx(0.99, abs=0.006)


def test_of_several_the_nearest_whole_is_taken():
    """All are within reach of both: the sum of squares decides, not the first."""
    found = pair_scans([[0.0, 0.0], [4.0, 0.0]], [[5.0, 0.0], [1.0, 0.0]], 1.0, np.eye(2), 20.0, GATE)
    assert found.measurement.tolist() == [1, 0]


def test_a_detection_without_a_position_continues_nothing():
    found = pair_scans([[0.0, 0.0]], [[np.nan, np.nan]], 1.0, np.eye(2), 20.0, GATE)
    assert found.track.tolist() == [-1]


def test_no_detections():
    assert pair_scans([], [[1.0, 2.0]], 1.0, np.eye(2), 1.0, GATE).track.tolist() == [-1]
    assert pair_scans([[1.0, 2.0]], [], 1.0, np.eye(2), 1.0, GATE).measurement.tolist() == [-1]


@pytest.mark.parametrize(
    ("dt", "speed", "field"), [(-1.0, 1.0, "dt"), (1.0, np.inf, "max_speed"), (np.nan, 1.0, "dt")]
)
def test_times_and_speeds_that_cannot_be_are_refused(dt, speed, field):
    with pytest.raises(WildlabError, match=f"{field} is"):
        pair_scans([[0.0, 0.0]], [[0.0, 0.0]], dt, np.eye(2), speed, GATE)


def test_a_track_ends_by_time_or_by_its_largest_deviation():
    turned = np.array([[26.0, 24.0], [24.0, 26.0]])  # 50 along the diagonal, 2 across
    P = np.array([turned, turned, turned, np.full((2, 2), np.nan)])
    assert outlived([1, 1, 6, 1], P, 5.0, 7.1).tolist() == [False, False, True, True]
    assert outlived([1, 1, 6, 1], P, np.inf, 7.0).tolist() == [True, True, True, True]
    assert outlived([5, 5, 1e9, 1], P, np.inf, np.inf).tolist() == [False, False, False, True]
    with pytest.raises(WildlabError, match="do not go with covariances"):
        outlived([1.0], P, 1.0, 1.0)
