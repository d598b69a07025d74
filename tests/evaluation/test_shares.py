"""What a share of flights allows to be said."""

import numpy as np
import pytest
from scipy.stats import binom, ttest_rel

from wildlab.errors import WildlabError
from wildlab.evaluation import shares as s
from wildlab.evaluation.intervals import share_interval


@pytest.mark.parametrize(
    ("count", "flights", "verdict"),
    [
        (189, 200, s.HOLDS),
        (188, 200, s.MOSTLY),
        (115, 200, s.MOSTLY),
        (113, 200, s.UNDECIDED),
        (85, 200, s.MOSTLY_NOT),
        (12, 200, s.MOSTLY_NOT),
        (11, 200, s.FAILS),
        (3, 3, s.UNDECIDED),
        (5, 5, s.MOSTLY),
        (35, 35, s.HOLDS),
    ],
)
def test_the_interval_decides(count, flights, verdict):
    assert s.share_verdict(share_interval(count, flights)) == verdict
    assert s.decide(np.arange(flights) < count).verdict == verdict


def test_a_denial_is_judged_as_the_mirror_of_its_claim():
    mirror = dict(zip(s.SHARE_VERDICTS, reversed(s.SHARE_VERDICTS), strict=True))
    for n in (7, 40, 200):
        for k in range(n + 1):
            there, back = (s.share_verdict(share_interval(one, n)) for one in (k, n - k))
            assert mirror[there] == back


def test_only_flights_that_meet_the_premise_are_asked():
    true, met = np.arange(100) < 50, np.arange(100) < 60
    found = s.decide(true, met)
    assert (found.true, found.met, found.flights) == (50, 60, 100)
    assert found.share == share_interval(50, 60)
    none = s.decide(true, np.arange(100) < 49)
    assert (none.verdict, none.share, none.met) == (s.NO_PREMISE, None, 49)


def test_a_measure_is_held_against_the_threshold():
    measured = np.array([0.1, 0.2, 0.3, np.nan])
    assert s.Check(measured=measured).holds(0.25).tolist() == [True, True, False, False]
    assert s.Check(measured=measured, above=True).holds(0.25).tolist() == [False, False, True, False]
    both = s.Check(measured=measured, true=np.array([False, True, True, True]))
    assert both.holds(0.25).tolist() == [False, True, False, False]
    assert len(both) == 4
    for check in (s.Check(measured=measured), s.Check()):
        with pytest.raises(WildlabError, match="threshold"):
            check.holds()


def test_a_threshold_may_say_what_is_counted():
    yes, no = np.array([True, True]), np.array([True, False])
    check = s.Check(by_threshold={5.0: no, 10.0: yes}, first=np.ones(2), second=np.zeros(2))
    assert check.holds(5).tolist() == [True, False] and check.holds(10).all()
    assert len(check) == 2 and check.reaches(10)
    assert s.decide_check(check, 5).true == 1
    with pytest.raises(WildlabError, match="threshold 7"):
        check.holds(7)


def test_a_threshold_at_the_end_of_what_can_be_measured_alone_gives_the_answer():
    for above, reaches in ((True, [True, True, False]), (False, [False, True, True])):
        check = s.Check(measured=np.array([0.5]), above=above, reach=(0.0, 1.0))
        assert [check.reaches(threshold) for threshold in (0.0, 0.5, 1.0)] == reaches


def test_a_paired_difference_has_students_interval():
    rng = np.random.default_rng(1)
    first, second = rng.normal(5, 2, 30), rng.normal(4, 2, 30)
    known = ttest_rel(first, second).confidence_interval(0.95)
    found = s.paired_difference([*first, np.nan], [*second, 1.0])
    assert found == pytest.approx(((first - second).mean(), known.low, known.high))
    assert s.paired_difference([1.0, np.nan], [1.0, 1.0]) is None


@pytest.mark.parametrize("flights", [35, 100, 150, 200, 300])
def test_how_often_chance_makes_a_verdict_wrong(flights):
    counts = np.arange(flights + 1)
    verdicts = np.array([s.share_verdict(share_interval(int(k), flights)) for k in counts])
    for border, wrong in ((0.9, [s.HOLDS]), (0.5, [s.HOLDS, s.MOSTLY]), (0.1, [s.FAILS])):
        assert binom.pmf(counts[np.isin(verdicts, wrong)], flights, border).sum() <= s.WRONG
    assert s.expected_wrong(100) == 100 * s.WRONG


@pytest.mark.parametrize(
    ("count", "of", "above", "verdict"),
    [
        (0, 48, False, s.UNDECIDED),
        (0, 500, False, s.HOLDS),
        (20, 500, False, s.FAILS),
        (20, 500, True, s.HOLDS),
        (0, 500, True, s.FAILS),
        (0, 0, False, s.NO_PREMISE),
    ],
)
def test_images_together_are_held_against_the_threshold(count, of, above, verdict):
    check = s.Check(measured=np.zeros(6), pooled=s.Pooled(count, of), above=above)
    assert s.decide_check(check, 0.01).verdict == verdict


def test_a_calculation_holds_or_does_not_and_has_no_share():
    check = s.Check(measured=np.array([0.55, 0.57]), calculated=True)
    found = [s.decide_check(check, threshold) for threshold in (1.0, 0.5, 0.56)]
    assert [one.verdict for one in found] == [s.HOLDS, s.FAILS, s.UNDECIDED]
    assert all(one.share is None for one in found)


def test_what_no_flight_measures_is_not_decided_and_a_flight_without_counts_against():
    none, few = np.full(40, np.nan), np.r_[np.full(30, np.nan), np.zeros(10)]
    assert s.decide_check(s.Check(measured=none), 1.0).verdict == s.NO_PREMISE
    found = s.decide_check(s.Check(measured=few), 1.0)
    assert (found.true, found.met, found.flights) == (10, 40, 40) and found.verdict == s.MOSTLY_NOT
