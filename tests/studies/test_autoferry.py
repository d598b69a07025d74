"""Scenarios of the ferry: tuned on the first, scored on all, against what is known from elsewhere."""

from __future__ import annotations

from collections.abc import Callable

import pandas as pd
import pytest

from wildlab.analysis.tracks.noise_model import SensorTuning
from wildlab.flight.store import Flight
from wildlab.studies.autoferry import (
    BOATS,
    FILTERS,
    OUTCOMES,
    choose_filter,
    follow_flight,
    of_use,
    outcomes,
    tracks_table,
)

pytestmark = pytest.mark.slow
SCENARIOS = (2, 3, 13)


@pytest.fixture(scope="module")
def tracks(scenario: Callable[[int], Flight], tunings: dict[str, SensorTuning]) -> pd.DataFrame:
    return pd.concat(
        [
            tracks_table(follow_flight(scenario(number), tunings, BOATS), BOATS.size_m).assign(case=number)
            for number in SCENARIOS
        ]
    )


def test_radar_stamps_are_late_by_one_to_three_seconds(tunings):
    # So says who prepared the data set; the sensor stamps what it has finished, not what it has begun.
    assert -3.0 <= tunings["radar"].offset_s <= -1.0
    assert tunings["radar"].offset_low_s <= tunings["radar"].offset_s <= tunings["radar"].offset_high_s


def test_errors_are_coloured(tunings):
    for tuning in tunings.values():
        assert tuning.next_correlation > 0.5
        assert tuning.correlation_time_s > 2 * tuning.interval_s


def test_every_sensor_boat_scenario_and_filter_has_a_row(tracks):
    sensors = {"lidar": "position", "radar": "position", "ir": "bearing", "eo": "bearing"}
    for sensor, kind in sensors.items():
        rows = tracks[tracks["sensor"] == sensor]
        assert len(rows) == len(SCENARIOS) * 2 * len(FILTERS[kind])
        assert set(rows["kind"]) == {kind}


def test_the_cameras_alone_are_of_no_use_and_the_others_are(tracks):
    use = of_use(tracks[tracks["case"] != 2]).set_index("sensor")["of_use"]
    assert use.to_dict() == {"lidar": True, "radar": True, "ir": False, "eo": False}


def test_one_filter_is_judged_where_nothing_was_tuned(tracks):
    keys = ["sensor", "target", "case"]
    fixed = choose_filter(tracks[tracks["case"] == 2], keys)
    held = tracks[(tracks["case"] != 2) & (tracks["kind"] == "position")]
    found = outcomes(held, keys, fixed)
    # Two boats by two sensors through two scenarios: each with one outcome, whatever it is.
    assert len(found) == 8 and set(found["outcome"]) <= set(OUTCOMES)
