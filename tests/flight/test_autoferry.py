"""The Autoferry JSON: its three spellings of a measurement, hostile files, and the published scenarios."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tests.flight.conftest import fault
from wildlab.errors import WildlabError
from wildlab.flight.checks.check import check_flight
from wildlab.flight.importing import import_flight
from wildlab.flight.readers.tracks import SENSORS, read_part
from wildlab.flight.store import Flight, load_flight
from wildlab.paths import DATA

HERE = Path("log.json")
SCENARIOS = {2: "gunnerus", 3: "gunnerus", 5: "gunnerus", 13: "jet-boat", 17: "jet-boat"}


def frame(sensor: Any, time: Any, measurement: Any, own: Any = (100.0, -50.0)) -> dict[str, Any]:
    return {"sensorID": sensor, "ownshipPosition": own, "time": time, "measurement": measurement}


def target(identity: Any = 1, time: Any = 5.0, position: Any = (1.0, 2.0, 0.0)) -> dict[str, Any]:
    return {"targetID": identity, "time": time, "position": position}


GOOD = [
    frame(4, 10.0, [0.1, -3.0]),
    frame(1, 10.5, [[1.0, 2.0, 3.0], [10.0, 20.0, 30.0]], [0.0, 5.0]),
    frame(3, 10.2, 0.7),
    frame(2, 11.0, [7.0, -8.0]),
    frame(1, 11.5, []),
    frame(3, 12.0, []),
]


def read(content: Any, part: Any = "frames") -> tuple[dict[str, Any], Any]:
    return read_part(HERE, json.dumps(content).encode(), part)


def test_frames_are_in_order_of_time_and_none_is_lost():
    columns, rows = read(GOOD)
    assert list(columns["frame"]) == [
        "eo-0001",
        "ir-0001",
        "lidar-0001",
        "radar-0001",
        "lidar-0002",
        "ir-0002",
    ]
    np.testing.assert_array_equal(rows, [1, 3, 2, 4, 5, 6])
    np.testing.assert_array_equal(columns["time"], np.sort(columns["time"]))
    assert columns["east"][2] == 5.0


def test_a_list_a_pair_a_number_and_nothing():
    lidar, rows = read(GOOD, "lidar")
    np.testing.assert_array_equal(
        np.column_stack([lidar["north"], lidar["east"]]), [[1, 15], [2, 25], [3, 35]]
    )
    assert list(lidar["frame"]) == ["lidar-0001"] * 3
    np.testing.assert_array_equal(rows, [2, 2, 2])
    radar, _ = read(GOOD, "radar")
    assert (radar["north"].tolist(), radar["east"].tolist()) == ([107.0], [-58.0])
    ir, _ = read(GOOD, "ir")
    assert (ir["bearing"].tolist(), list(ir["frame"])) == ([0.7], ["ir-0001"])
    assert read(GOOD, "eo")[0]["bearing"].tolist() == [0.1, -3.0]
    assert len(read(GOOD[:1], "radar")[1]) == 0


def test_truth_is_each_sample_once():
    content = [[target(), target(2, 4.0)], [target(), target(2, 4.5, [3, 4, 5])], target(1, 6.0)]
    columns, rows = read(content, "truth")
    assert list(columns["target"]) == ["1", "1", "2", "2"]
    assert columns["time"].tolist() == [5.0, 6.0, 4.0, 4.5]
    assert (columns["north"][3], columns["east"][3], columns["down"][3]) == (3, 4, 5)
    np.testing.assert_array_equal(rows, [1, 3, 1, 2])
    assert len(read([[], []], "truth")[1]) == 0


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ('{"sensorID": 5}', "sensorID"),
        ('{"sensorID": {}}', "sensorID"),
        ('{"time": "noon"}', "time"),
        (f'{{"time": 1{"0" * 400}}}', "time"),
        ('{"ownshipPosition": [4.0, 1e9]}', "ownshipPosition"),
        ('{"ownshipPosition": [4.0]}', "ownshipPosition"),
        ('{"sensorID": 1, "measurement": [1.0, 2.0, 3.0]}', "measurement"),
        ('{"sensorID": 1, "measurement": [[1.0, 2.0], [3.0]]}', "measurement"),
        ('{"sensorID": 2, "measurement": [[1.0, "x"], [3.0, 4.0]]}', "measurement"),
        ('{"measurement": [0.1, 57.0]}', "measurement"),
    ],
)
def test_hostile_detections_are_refused(change, said):
    with pytest.raises(WildlabError, match=fault(f"log.json, {said}: frame 1")):
        read([GOOD[0] | json.loads(change)], "radar")


@pytest.fixture(scope="module")
def scenarios(
    shared_data: Callable[..., Path], tmp_path_factory: pytest.TempPathFactory
) -> dict[int, Flight]:
    source, into = shared_data("tracking", "autoferry"), tmp_path_factory.mktemp("autoferry")
    for number in SCENARIOS:
        import_flight(DATA / "recipes" / f"autoferry-{number}.toml", source, into / str(number))
    return {number: load_flight(into / str(number)) for number in SCENARIOS}


@pytest.mark.slow
def test_the_published_scenarios(scenarios):
    for number, flight in scenarios.items():
        assert set(flight.table("frames")["sensor"]) == set(SENSORS.values())
        assert set(flight.table("truth")["target_id"]) == {"havfruen", SCENARIOS[number]}
        assert 79 < flight.table("frames")["time_s"].iloc[-1] < 152
        assert not [one for one in check_flight(flight) if one.level == "problem"]
    # Counted in the files with other means: grep -o sensorID, and the lists of frames 1 and 2 of scenario 2.
    first = scenarios[2]
    assert first.table("frames")["sensor"].value_counts().to_dict() == {
        "ir": 1012, "eo": 591, "lidar": 234, "radar": 70,
    }  # fmt: skip
    seen = first.table("detections")
    np.testing.assert_allclose(
        seen.loc[seen["frame_id"] == "eo-0001", "azimuth_rad"],
        [0.42121200533586833, -2.1709064241401057, 1.068133430517189, 1.2572239053389533],
    )
    assert seen.loc[seen["frame_id"] == "ir-0001", "azimuth_rad"].item() == -2.2054613959028848


RECIPE = (DATA / "recipes" / "autoferry-2.toml").read_text(encoding="utf-8")
