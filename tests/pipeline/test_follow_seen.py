"""A track is judged where its target was seen; where it was not is a number of its own."""

from __future__ import annotations

import numpy as np
import pytest

from tests.pipeline.robots import KNOWN, robot_flight, rows_of
from wildlab.flight.following import parse_settings
from wildlab.flight.store import Flight
from wildlab.pipeline.following.follow import follow_targets
from wildlab.pipeline.following.judged import UNKNOWN, used_of


def seen_only(flight: Flight, keep: np.ndarray) -> Flight:
    """Detections of some of the looks alone; the looks stay."""
    detections = flight.tables["detections"]
    names = flight.tables["frames"]["frame_id"][keep]
    flight.tables["detections"] = detections[detections["frame_id"].isin(names)].reset_index(drop=True)
    return flight


def test_errors_of_a_long_wait_are_not_those_of_the_track_that_is_seen() -> None:
    flight = robot_flight(3)
    t = flight.tables["frames"]["time_s"].to_numpy()
    followed = follow_targets(seen_only(flight, (t < 40) | (t > 90)), settings=parse_settings(KNOWN))
    row = rows_of(followed).loc["ekf"]
    one = next(one for one in followed.tracks if one.filter == "ekf")
    away, used = np.hypot(*one.error[:, :2].T), used_of(one)
    assert row["rmse"] == pytest.approx(np.sqrt(np.mean(away[used & np.isfinite(away)] ** 2)))
    assert row["rmse_without"] == pytest.approx(np.sqrt(np.mean(away[~used & np.isfinite(away)] ** 2)))
    assert row["rmse"] < 1.5 < 3 < row["rmse_without"]
    assert row["nees"] == pytest.approx(np.nanmean(one.nees[used]))
    assert row["compared"] == (used & np.isfinite(away)).sum()
    # The track ends within the wait: looks without one are counted, and are in neither number.
    assert row["without"] + row["gone"] == 101 and row["gone"] > 0 and row["anew"] == 1
    assert row["wait"] == pytest.approx(51.0, abs=1.1)


@pytest.mark.parametrize("count", [1, 3])
def test_of_one_or_three_detections_nothing_is_judged(count: int) -> None:
    flight = robot_flight(3)
    few = seen_only(flight, np.arange(len(flight.tables["frames"])) < count)
    followed = follow_targets(few, settings=parse_settings(KNOWN))
    rows = rows_of(followed)
    assert set(rows["verdict"]) == {UNKNOWN} and set(rows["nis_verdict"]) == {UNKNOWN}
    assert (rows["used"] == count).all()


def test_a_track_that_lost_its_target_is_judged_where_the_target_was_seen() -> None:
    """What a gate no longer lets in was seen all the same."""
    flight = robot_flight(3, labelled=False)
    detections, t = flight.tables["detections"], flight.tables["frames"]["time_s"].to_numpy()
    after = detections["frame_id"].isin(flight.tables["frames"]["frame_id"][t > 60])
    detections.loc[after, "range_m"] += 6.0
    row = rows_of(follow_targets(flight, settings=parse_settings(KNOWN))).loc["ekf"]
    assert row["compared"] > row["used"]
