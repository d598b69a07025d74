"""Which filter leads and what the verdict is turn with the numbers of the tracks."""

from __future__ import annotations

import re

import numpy as np
import pandas as pd
import pytest

from wildlab.analysis.tracks.tracker import SensorPair, leading_filter
from wildlab.evaluation.consistency import Average
from wildlab.messages.catalogue import load_texts
from wildlab.reporting import tracking as page


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


def colour(rows: pd.DataFrame, pairs: list[SensorPair] | None = None) -> str:
    return page.judge_tracks(rows, pairs or []).colour


def keys(rows: pd.DataFrame, pairs: list[SensorPair] | None = None) -> list[str]:
    return [one.key for one in page.answer(rows, pairs or [])]


def test_the_best_consistent_filter_leads():
    assert leading_filter(rows()) == "schmidt"
    # However much larger its error is than that of one which is not consistent.
    assert leading_filter(rows(rmse=8.0)) == "schmidt"
    both = rows().assign(verdict="consistent", nees=2.0, rmse=[3.9, 4.0])
    assert leading_filter(both) == "ekf" == leading_filter(both.iloc[::-1])


def test_where_no_filter_is_consistent_the_least_error_leads():
    worse = rows(nees=50.0, verdict="overconfident", rmse=8.0)
    assert page.judge_tracks(worse, []).value == "look closer"
    assert leading_filter(worse) == "ekf"
    assert leading_filter(rows(nees=50.0, verdict="overconfident", rmse=2.0)) == "schmidt"
    assert leading_filter(rows(rmse=np.nan, nees=np.nan, verdict="not judged")) == "ekf"


@pytest.mark.parametrize(("nis", "level"), [(2.5, "good"), (3.15, "warn"), (20.0, "warn")])
def test_a_filter_that_its_detections_surprise_is_looked_at(nis, level):
    # Of two elements: 1.15 times is 2.6.
    odd = rows(nis=nis, nis_verdict="overconfident")
    assert colour(odd) == level
    assert ("surprised" in keys(odd)) == (level == "warn")


def test_every_track_that_is_surprised_is_counted():
    """Also one whose errors are not as predicted; and the table has a verdict on each of both."""
    odd = {"nis": 18.0, "nis_verdict": "overconfident"}
    both = pd.concat([rows(**odd), rows(target="b", nees=5.6, verdict="overconfident", **odd)])
    beside = page.answer(both, [])[1]
    assert beside.key == "surprised" and beside.values == {"tracks": 2, "n": 2, "times": "3.0"}
    mine = both[both["filter"] == "schmidt"]
    assert page.tracks_table(mine)[["verdict", "nis_verdict"]].to_numpy().tolist() == [
        ["consistent", "overconfident"],
        ["overconfident", "overconfident"],
    ]


@pytest.mark.parametrize(
    ("changes", "level", "first"),
    [
        ({}, "good", "errors-consistent"),
        ({"verdict": "not judged"}, "neutral", "errors-unknown"),
        ({"nees": 9.0, "verdict": "overconfident", "rmse": 1.0}, "warn", "errors-overconfident"),
        ({"nees": 0.1, "verdict": "too cautious", "rmse": 1.0}, "warn", "errors-conservative"),
    ],
)
def test_verdict_and_answer_follow_the_leading_filter(changes, level, first):
    assert colour(rows(**changes)) == level and keys(rows(**changes))[0] == first


def test_how_many_times_errors_are_what_is_predicted():
    """A mean NEES or NIS of 50 with two elements: errors are five times as large."""
    surprised = rows().assign(
        nees=50.0, nis=[18.0, 50.0], verdict="overconfident", nis_verdict="overconfident"
    )
    assert page.answer(surprised, [])[0].values["times"] == "5.0"
    unseen = surprised.assign(compared=0, nees=np.nan, verdict="not judged", nis=50.0)
    assert page.answer(unseen, [])[0].values["times"] == "5.0"
    assert page.answer(unseen.assign(nis=75.0, dof=3.0), [])[0].values["times"] == "5.0"


def test_what_could_not_be_judged_is_in_no_number_and_makes_nothing_sound():
    """One track that is consistent, and nine that are far off and were not judged."""
    others = [rows(target=f"t{k}", rmse=40.0, nees=30.0, verdict="not judged").iloc[1:] for k in range(9)]
    many = pd.concat([rows().iloc[1:], *others])
    first = page.answer(many, [])[0]
    assert first.key == "errors-mixed" and (first.values["judged"], first.values["rmse"]) == (1, "4.0 m")
    assert colour(many) != "good" == colour(pd.concat([rows().iloc[1:], *others[:0]]))


def test_every_track_is_in_the_denominator():
    """Two judged tracks, one that nothing could be compared with, and one by a sensor without that filter."""
    lost = rows(target="t", compared=0, rmse=np.nan, nees=np.nan, verdict="not judged")
    other = rows().iloc[:1].assign(sensor="lidar")
    both = pd.concat([rows(), rows(target="u", nees=50.0, verdict="overconfident"), lost, other])
    first = page.answer(both, [])[0]
    assert first.key == "errors-mixed" and (first.values["n"], first.values["judged"]) == (4, 3)
    assert page.reason(both).values["counts"] == "consistent (1), overconfident (2), not judged (1)"


def test_every_filter_that_the_numbers_are_of_is_named():
    """A radar's track by the Schmidt filter, and three of a sensor that has the EKF alone."""
    others = [rows(target=f"t{k}", rmse=40.0, nees=80.0, verdict="overconfident") for k in range(3)]
    others = [one.iloc[1:].assign(filter="ekf", sensor="lidar") for one in others]
    mine = rows(rmse=1.0, nees=80.0, verdict="overconfident")
    first = page.answer(pd.concat([mine, *others]), [])[0]
    assert (first.values["filter"], first.values["rmse"]) == ("EKF and Schmidt filter", "40 m")


def blind(**changes: object) -> pd.DataFrame:
    return rows().assign(compared=0, rmse=np.nan, nees=np.nan, verdict="not judged", **changes)


def test_without_truth_the_filter_leads_whose_innovations_are_as_it_expects():
    seen = blind(nis=[1.99, 9.0])
    assert leading_filter(seen.assign(nis_verdict=["consistent", "overconfident"])) == "ekf"
    assert leading_filter(seen.assign(nis_verdict=["overconfident", "consistent"])) == "schmidt"
    assert leading_filter(seen.assign(nis_verdict="overconfident", nis=[9.0, 1.0])) == "schmidt"
    assert "rmse" not in page.tracks_table(seen)
    assert page.reason(seen).key == "reason-nis"


@pytest.mark.parametrize(
    ("nis", "word", "key"),
    [
        (2.0, "consistent", "innovations-consistent"),
        (9.0, "overconfident", "innovations-overconfident"),
        (0.5, "too cautious", "innovations-conservative"),
        (np.nan, "not judged", "innovations-unknown"),
    ],
)
def test_innovations_answer_where_there_is_no_truth(nis, word, key):
    assert keys(blind(nis=nis, nis_verdict=word)) == [key, "no-truth"]


PAIR = SensorPair("boat", "schmidt", "radar", "lidar", 3.0, 90, Average(8.0, 1.5, 2.5, 90, 60.0, 2.0))


def test_sensors_that_contradict_each_other_are_looked_at():
    agreeing = PAIR._replace(squares=Average(2.0, 1.5, 2.5, 90, 60.0, 2.0))
    assert colour(blind(), [PAIR]) == "warn" != colour(blind(), [agreeing])
    beside = page.answer(blind(), [PAIR, agreeing])[1]
    assert beside.key == "apart" and (beside.values["times"], beside.values["rms"]) == ("2.0", "3.0 m")


@pytest.mark.parametrize(("used", "key"), [(0, "no-track"), (1, "one-detection")])
def test_without_a_second_detection_nothing_is_judged(used, key):
    one = rows().assign(detections=0, used=used, compared=0, verdict="not judged")
    assert colour(one) == "bad" and keys(one) == [key] and page.reason(one).key == "reason-none"


@pytest.mark.parametrize(("rmse", "level"), [(261.0, "warn"), (4.9, "warn"), (4.7, "good"), (3.0, "good")])
def test_all_sensors_together_must_not_be_worse_than_the_best_alone(rmse, level):
    together = rows(rmse=rmse, nees=900.0, verdict="overconfident")
    both = pd.concat([rows(), together.assign(sensor="together", kind="together")])
    assert colour(both) == level
    assert ("worse-together" in keys(both)) == (level == "warn")


def test_what_contradicts_itself_is_mended_before_tracks_are_believed():
    assert page.judge_tracks(rows(), [], 1).value == "mend first"
    assert page.reason(rows(), 1).key == "reason-contradictions"


def test_the_track_that_is_worst_stands_first_and_filters_that_do_not_lead_last():
    a, b, c = (rows(target=name) for name in "abc")
    b.loc[1, ["verdict", "nees"]] = ["overconfident", 30.0]
    c.loc[1, "rmse"] = 5.0
    found = page.most_pressing_first(pd.concat([a, b, c], ignore_index=True))
    assert list(found["filter"]) == ["schmidt"] * 3 + ["ekf"] * 3
    assert list(found["target"][:3]) == ["b", "c", "a"]
    odd = rows(target="a", nis=20.0, nis_verdict="overconfident")
    found = page.most_pressing_first(pd.concat([c, odd], ignore_index=True))
    assert list(found["target"][:2]) == ["a", "c"]
    assert not len(page.most_pressing_first(rows()[:0]))


def test_every_sentence_is_one_of_the_catalogue():
    mixed = pd.concat([blind(), blind(target="b", nis_verdict="overconfident", nis=9.0)])
    said = [*page.answer(mixed, []), page.reason(rows()), page.reason(rows(nees_worth=4.0))]
    said += [page.reason(blind(nis_worth=4.0)), page.reason(rows(), 1)]
    texts = load_texts("tracking").answers
    assert said[0].key == "innovations-mixed"
    for one in said:
        assert set(re.findall(r"{(\w+)}", texts[one.key])) <= set(one.values)
