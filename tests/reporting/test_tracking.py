"""Which filter leads and what the verdict is turn with the numbers of the tracks."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest

from wildlab.analysis.following.judged import Apart, leading_filter
from wildlab.evaluation.consistency import Average
from wildlab.reporting import tracking as words


def rows(**changes: object) -> pd.DataFrame:
    """A white and a Schmidt track of one boat."""
    base = {
        "sensor": "radar", "kind": "range-bearing", "target": "boat", "detections": 100, "compared": 100,
        "used": 100, "wait": 1.0, "without": 0, "rmse_without": np.nan,
        "rmse": 4.0, "mae": 3.0, "rmse_speed": 0.5, "nees_low": 0.5, "nees_high": 5.0, "nees_worth": 6.0,
        "inside": 0.9, "inside_low": 0.6, "inside_high": 1.0, "nis": 2.0, "nis_low": 1.7, "nis_high": 2.3,
        "nis_worth": 90.0, "nis_verdict": "consistent", "dof": 2.0, "lag1": 0.1, "lag1_bound": 0.2,
        "followed": 1.0,
    }  # fmt: skip
    white = base | {"filter": "ekf", "nees": 80.0, "verdict": "overconfident"}
    schmidt = base | {"filter": "schmidt", "nees": 2.0, "verdict": "consistent"} | changes
    return pd.DataFrame([white, schmidt])


def colour(rows: pd.DataFrame, pairs: list[Apart] | None = None) -> str:
    return words.summary(rows, pairs or [], None)[1].colour


def test_the_best_consistent_filter_leads():
    assert leading_filter(rows()) == "schmidt"
    # However much larger its error is than that of one which is not consistent.
    assert leading_filter(rows(rmse=8.0)) == "schmidt"
    both = rows().assign(verdict="consistent", nees=2.0, rmse=[3.9, 4.0])
    assert leading_filter(both) == "ekf" == leading_filter(both.iloc[::-1])


def test_where_no_filter_is_consistent_the_least_error_leads():
    worse = rows(nees=50.0, verdict="overconfident", rmse=8.0)
    said, verdict = words.summary(worse, [], None)
    assert verdict.value == "look closer" and said[0] == words.NONE_CONSISTENT
    assert leading_filter(worse) == "ekf"
    assert leading_filter(rows(nees=50.0, verdict="overconfident", rmse=2.0)) == "schmidt"
    assert leading_filter(rows(rmse=np.nan, nees=np.nan, verdict="not judged")) == "ekf"


@pytest.mark.parametrize(("nis", "level"), [(4.0, "good"), (5.0, "warn"), (20.0, "warn")])
def test_a_filter_that_its_detections_surprise_is_looked_at(nis, level):
    # Of two elements: 1.5 times is 4.5.
    odd = rows(nis=nis, nis_verdict="overconfident")
    assert colour(odd) == level
    assert ("detections" in words.reason_of(odd)) == (level == "warn")


@pytest.mark.parametrize(
    ("changes", "level"),
    [
        ({}, "good"),
        # Few detections do not surprise, and what few values say is neither green nor red.
        ({"nis": 4.6, "nis_high": 3.9, "nis_worth": 6.0, "nis_verdict": "overconfident"}, "good"),
        ({"nees_worth": 4.0}, "neutral"),
        ({"nees": 5.3, "verdict": "overconfident"}, "warn"),
    ],
)
def test_the_colour_of_the_verdict(changes, level):
    assert colour(rows(**changes)) == level


def blind() -> pd.DataFrame:
    return rows().assign(compared=0, rmse=np.nan, nees=np.nan, verdict="not judged")


def test_without_truth_the_filter_leads_whose_innovations_are_as_it_expects():
    seen = blind().assign(nis=[1.99, 9.0])
    assert leading_filter(seen.assign(nis_verdict=["consistent", "overconfident"])) == "ekf"
    assert leading_filter(seen.assign(nis_verdict=["overconfident", "consistent"])) == "schmidt"
    assert leading_filter(seen.assign(nis_verdict="overconfident", nis=[9.0, 1.0])) == "schmidt"
    assert "rmse" not in words.columns_of(words.tracks_table(seen))


def test_sensors_that_contradict_each_other_are_looked_at():
    pair = Apart("boat", "schmidt", "radar", "lidar", 3.0, 90, Average(8.0, 1.5, 2.5, 90, 60.0))
    agreeing = pair._replace(squares=Average(2.0, 1.5, 2.5, 90, 60.0))
    assert colour(blind(), [pair]) == "warn" != colour(blind(), [agreeing])
    assert "2.0 times" in words.apart_sentence(pair) and "3.0 m" in words.apart_sentence(pair)


def test_a_smoothed_track_without_innovations_is_not_a_lost_one():
    both = pd.concat([rows(), rows(filter="schmidt-smoothed", detections=0, nis=np.nan).iloc[1:]])
    assert not any("boat by" in one for one in words.summary(both, [], None)[0])
    lost = rows().assign(detections=0, compared=0, sensor="ir", nees=np.nan, verdict="not judged")
    assert "boat by ir" in words.summary(pd.concat([rows(), lost]), [], None)[0][-1]
    assert words.tracks_table(both)["detections"].tolist() == ["100", "100", words.NOTHING]


@pytest.mark.parametrize(("nees", "few"), [(5.5, True), (7.4, True), (7.6, False), (2.0, False)])
def test_few_values_are_an_excuse_near_the_band_only(nees, few):
    row = rows(nees=nees, verdict="overconfident" if nees > 5 else "consistent").iloc[1]
    assert words.on_few(row) == few


def test_time_without_the_target_is_a_number_of_its_own():
    lost = rows(rmse=9.4, compared=263, without=1084, rmse_without=205.0, wait=67.7)
    said, _ = words.summary(lost, [], None)
    assert "263 of 1347" in said[0] and "205 m" in said[1]
    table = words.tracks_table(lost)
    assert table["compared"].tolist() == [100, 263] and table["rmse_without"].iloc[1] == 205.0


@pytest.mark.parametrize("used", [0, 1])
def test_without_a_second_detection_nothing_is_judged(used):
    one = rows().assign(detections=0, used=used, compared=0, verdict="not judged")
    assert colour(one) == "bad"


@pytest.mark.parametrize(("rmse", "level"), [(261.0, "warn"), (4.9, "warn"), (4.7, "good"), (3.0, "good")])
def test_all_sensors_together_must_not_be_worse_than_the_best_alone(rmse, level):
    together = rows(rmse=rmse, nees=900.0, verdict="overconfident")
    both = pd.concat([rows(), together.assign(sensor="together", kind="together")])
    assert colour(both) == level
    assert f"{words.length(rmse)} from boat" in words.summary(both, [], None)[0][1]
