"""What the page on tracks says turns with its numbers."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest

from wildlab.evaluation.consistency import Average
from wildlab.pipeline.following.beliefs import Said
from wildlab.pipeline.following.judged import Apart, leading_filter
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


def test_the_best_consistent_filter_leads() -> None:
    said, verdict = words.summary(rows(), [], None)
    assert verdict.colour == "good"
    assert said[0].startswith("The track of the filter with considered errors (Schmidt) is off by 4.0 m")
    assert "about as large as stated: consistent" in said[0]
    assert "6.3 times as large as stated: overconfident; both are about as far off" in said[1]
    # However much larger its error is than that of one which is not consistent.
    assert leading_filter(rows(rmse=8.0)) == "schmidt"
    both = rows().assign(verdict="consistent", nees=2.0, rmse=[3.9, 4.0])
    assert leading_filter(both) == "ekf" == leading_filter(both.iloc[::-1])


def test_where_no_filter_is_consistent_it_is_said_and_the_least_error_leads() -> None:
    worse, verdict = words.summary(rows(nees=50.0, verdict="overconfident", rmse=8.0), [], None)
    assert verdict.value == "look closer" and worse[0] == words.NONE_CONSISTENT
    assert worse[1].startswith("The track of the filter with white noise (EKF) is off by 4.0 m")
    assert leading_filter(rows(nees=50.0, verdict="overconfident", rmse=2.0)) == "schmidt"
    lost = rows(rmse=np.nan, nees=np.nan, verdict="not judged")
    assert leading_filter(lost) == "ekf"


@pytest.mark.parametrize(("nis", "level"), [(4.0, "good"), (5.0, "warn"), (20.0, "warn")])
def test_a_filter_that_its_detections_surprise_is_looked_at(nis: float, level: str) -> None:
    odd = {"nis": nis, "nis_verdict": "overconfident"}  # of two elements: 1.5 times is 4.5
    said, verdict = words.summary(rows(**odd), [], None)
    assert verdict.colour == level and ("from where it expects" in " ".join(said)) == (level == "warn")


def test_without_truth_the_filter_leads_whose_innovations_are_as_it_expects() -> None:
    blind = rows().assign(compared=0, rmse=np.nan, nees=np.nan, verdict="not judged", nis=[1.99, 9.0])
    assert leading_filter(blind.assign(nis_verdict=["consistent", "overconfident"])) == "ekf"
    assert leading_filter(blind.assign(nis_verdict=["overconfident", "consistent"])) == "schmidt"
    assert leading_filter(blind.assign(nis_verdict="overconfident", nis=[9.0, 1.0])) == "schmidt"


def test_a_smoothed_track_without_innovations_is_not_a_lost_one() -> None:
    both = pd.concat([rows(), rows(filter="schmidt-smoothed", detections=0, nis=np.nan).iloc[1:]])
    said, _ = words.summary(both, [], None)
    assert not any("Never followed" in one for one in said)
    lost = rows().assign(detections=0, compared=0, sensor="ir", nees=np.nan, verdict="not judged")
    said, _ = words.summary(pd.concat([rows(), lost]), [], None)
    assert said[-1] == "Never followed: boat by ir."
    table = words.tracks_table(both)
    assert table["detections"].tolist() == ["100", "100", words.NOTHING]


def test_without_truth_surprises_and_sensors_are_spoken_of() -> None:
    blind = rows().assign(compared=0, nees=np.nan, verdict="not judged")
    pair = Apart("boat", "schmidt", "radar", "lidar", 3.0, 90, Average(8.0, 1.5, 2.5, 90, 60.0))
    said, level = words.summary(blind, [pair], None)
    assert level.colour == "warn" and "cannot be said without" in said[1]
    assert (
        said[2]
        == "radar and lidar put boat 3.0 m apart (root mean square), 2.0 times as far as their tracks state."
    )
    assert "rmse" not in words.columns_of(words.tracks_table(blind))


@pytest.mark.parametrize(("nees", "few"), [(5.5, True), (80.0, False), (2.0, False)])
def test_few_values_are_an_excuse_near_the_band_only(nees: float, few: bool) -> None:
    row = rows(nees=nees, verdict="overconfident" if nees > 5 else "consistent").iloc[1]
    assert ("few independent" in words.verdict_words(row)) == few


def test_what_is_assumed_is_counted() -> None:
    said = [Said("radar", "noise", "1 m", "assumed: rough"), Said("targets", "speed", "3 m/s", "stated")]
    assert words.assumed_sentence(said).startswith("1 of 2 values")
    assert words.assumed_sentence(said[1:]).startswith("All that the filters were told is stated")
    assert words.said_table(said[::-1])["source"].tolist() == ["assumed: rough", "stated"]


def test_what_few_values_say_is_neither_green_nor_red() -> None:
    said, level = words.summary(rows(nees_worth=4.0), [], None)
    assert "consistent, on few independent values." in said[0] and level.colour == "neutral"
    said, level = words.summary(rows(nees=5.3, verdict="overconfident"), [], None)
    assert "overconfident, on few independent values." in said[1] and level.colour == "warn"


def test_time_without_the_target_is_a_number_of_its_own() -> None:
    changes = {"rmse": 9.4, "compared": 263, "without": 1084, "rmse_without": 205.0, "wait": 67.7}
    said, _ = words.summary(rows(**changes), [], None)
    assert "is off by 9.4 m (root mean square) where the target is seen, at 263 of 1347 looks" in said[0]
    assert said[1] == (
        "Where it is not seen, it is off by 205 m (root mean square); the longest wait is 67.7 s."
    )
    table = words.tracks_table(rows(**changes))
    assert table["compared"].tolist() == [100, 263] and table["rmse_without"].iloc[1] == 205.0


def test_a_start_that_nothing_followed_is_a_start() -> None:
    one = rows().assign(detections=0, used=1, compared=0, verdict="not judged")
    assert words.summary(one, [], None)[0][0].startswith("One detection started a track, and none followed")
    none = one.assign(used=0)
    assert words.summary(none, [], None)[0][0].startswith("No track was started")


@pytest.mark.parametrize(
    ("rmse", "level", "end"), [(261.0, "warn", "as they are told of."), (3.0, "good", "4.0 m.")]
)
def test_all_sensors_together_stand_beside_the_best_one(rmse: float, level: str, end: str) -> None:
    both = pd.concat([rows(), rows(rmse=rmse, nees=900.0, verdict="overconfident").assign(
        sensor="together", kind="together")])  # fmt: skip
    said, found = words.summary(both, [], None)
    assert said[0].startswith("The track of") and "is off by 4.0 m" in said[0] and found.colour == level
    assert said[1].startswith(
        f"All sensors together are off by {words.length(rmse)} from boat, radar alone by"
    )
    assert said[1].endswith(end)


def test_a_verdict_on_little_says_how_little() -> None:
    """ "About as far as stated: overconfident" contradicts itself unless the factor stands beside it."""
    blind = rows().assign(
        compared=0, nees=np.nan, verdict="not judged", nis=2.42, nis_verdict="overconfident"
    )
    said, level = words.summary(blind[blind["filter"] == "ekf"], [], None)
    assert level.colour == "warn"
    assert "as it states (1.10 times; more than by chance all the same): overconfident" in said[0]
    fine = blind.assign(nis_verdict="consistent")
    assert "times" not in words.summary(fine[fine["filter"] == "ekf"], [], None)[0][0]
    near, _ = words.summary(rows(nees=2.4, verdict="overconfident"), [], None)
    assert "about as large as stated (1.10 times; more than by chance all the same): overconfident" in near[1]
