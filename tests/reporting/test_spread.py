"""The spread over few flights is not called what only many flights have."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest

from wildlab.reporting.report import open_report
from wildlab.reporting.spread import bounds_of, range_clause, range_words, share_below, spread_words
from wildlab.studies import monte_carlo, single_target
from wildlab.studies.protocol import Metric, Study

FLIGHTS = pd.Series(np.random.default_rng(1).permutation(np.arange(200.0)))


@pytest.mark.parametrize("n", [2, 18, 19, 200])
def test_few_flights_have_a_range_and_many_the_prediction_interval_of_one_more(n: int) -> None:
    values, rank = FLIGHTS[:n], max((n + 1) // 20, 1)
    assert bounds_of(values) == (np.sort(values)[rank - 1], np.sort(values)[-rank])
    assert spread_words(n).key == ("lowest to highest" if n < 19 else "middle 90 %")


def test_one_flight_has_no_spread() -> None:
    assert np.isnan(bounds_of(FLIGHTS[:1])).all()
    assert spread_words(1).key == range_words(FLIGHTS[:1]) == range_clause(FLIGHTS[:1]) == ""


def test_flights_without_a_value_are_left_out_and_still_counted() -> None:
    few = pd.Series([np.nan, 3.0, 1.0])
    assert bounds_of(few) == (1.0, 3.0)
    many = pd.concat([FLIGHTS[:20], pd.Series([np.nan] * 10)])
    assert bounds_of(many) == (FLIGHTS[:20].min(), FLIGHTS[:20].max())


def test_flights_on_a_printed_number_count_by_halves() -> None:
    values = pd.Series([1.0, 2.0, 2.0, 5.0, np.nan])
    assert [share_below(values, one) for one in (0.5, 2.0, 3.0, 9.0)] == [0.0, 0.5, 0.75, 1.0]
    assert np.isnan(share_below(values[:0], 1.0))


def test_ranges_are_typeset_with_a_minus() -> None:
    assert range_words([-2.0, -1.0]) == "−2.0 to −1.0" and range_words([1.4, 3.6], 0) == "1 to 4"


@pytest.mark.parametrize("n", [1, 2, 18, 19])
def test_tables_follow_the_number_of_flights(n: int) -> None:
    spread = pd.DataFrame({("kf", "mae"): FLIGHTS[:n]})
    study = Study("x", ("kf",), metric_of=lambda subject, name: Metric(name, subject, "m"))
    report = open_report(study="linear-vs-nonlinear-fast", kind="twin")
    monte_carlo.record_spread(report, study, spread, {})
    table = monte_carlo.beside_published(report, spread, {"kf": "A"}, ["mae"])
    for columns in (monte_carlo.published_columns(n), single_target.published_columns(n)):
        assert set(columns) <= set(table)
        assert columns.get("range", "") == spread_words(n).heading and ("below" in columns) == (n > 1)
    assert table.loc[0, "range"] == range_words(FLIGHTS[:n])


@pytest.mark.parametrize("n", [1, 2, 18, 99])
def test_metrics_have_the_bounds_that_are_shown(n: int) -> None:
    study = Study("x", ("a",), metric_of=lambda subject, name: Metric(name, subject, "m"))
    report = open_report(study="x", kind="twin")
    values = FLIGHTS[:n]
    monte_carlo.record_spread(report, study, pd.DataFrame({("a", "mae"): values}), {})
    (entry,) = report._metrics
    assert (entry["low"], entry["high"]) == (bounds_of(values) if n > 1 else (None, None))
    assert entry["value"] == values.median()
