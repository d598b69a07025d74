"""What is said of accuracy follows from the numbers; and known positions."""

from __future__ import annotations

from types import MappingProxyType, SimpleNamespace

import numpy as np
import pandas as pd

from wildlab.reporting import georeferencing
from wildlab.reporting.georeferencing import truth_errors, worst_sightings


def test_names_that_may_tell_of_a_place_are_numbered_unless_it_is_open():
    tables = {name: pd.DataFrame() for name in ("Flight 1", "Flight  1", "north gate")}
    assert list(georeferencing.named(tables, "part", shown=False)) == ["part-1", "part-2", "part-3"]
    assert list(georeferencing.named(tables, "part", shown=True)) == [
        "Flight-1",
        "Flight-1-again",
        "north-gate",
    ]


def test_a_truth_s_own_error_is_that_of_what_points_are_compared_with():
    by_target = pd.DataFrame(
        {"target": ["m1", "m2", "w"], "kind": ["mark", "mark", "track"], "sd": [0.02, np.nan, 1.5]}
    )

    def errors(*names):
        return truth_errors(SimpleNamespace(by_target=by_target, best=pd.DataFrame({"truth_id": names})))

    assert errors("w", "w", "m1") == {"mark": 0.02, "track": 1.5}
    assert np.isnan(errors("m2").pop("mark"))


def limits_with(offset=0.0, kind="logged", truth=MappingProxyType({}), certain=False, lost=0):
    manifest = SimpleNamespace(
        kind=kind, clocks=SimpleNamespace(camera_offset_s=offset), time=SimpleNamespace(kind="utc"),
        vertical=SimpleNamespace(correction_m=0.0),
    )  # fmt: skip
    flight = SimpleNamespace(manifest=manifest, pose_source=lambda _: ("nav", []))
    winner = SimpleNamespace(causes=())
    found = SimpleNamespace(
        diagnosis=SimpleNamespace(
            counts=certain, winner=winner, inseparable=(), extended=False, misfit=False
        ),
        visible_m=np.nan, points=pd.DataFrame({"ground": ["stated"]}),
        lost=lost, scored=range(100),
    )  # fmt: skip
    return {one.key: dict(one.values) for one in georeferencing.limits(flight, found, truth, [], None)}


def test_an_offset_of_the_camera_s_clock_is_parted_from_its_zone():
    assert limits_with(-45898.42)["limit-clock-fitted"] == {"offset": "+1.58"}
    assert limits_with(-0.4)["limit-clock-fitted"] == {"offset": "-0.40"}
    # A zone is read from the hours of the flight, and no point is fitted.
    for said in (limits_with(0.0), limits_with(-45900.0), limits_with(0.4, "twin")):
        assert "limit-clock-fitted" not in said


def test_of_each_of_the_worst_images_the_detection_that_is_furthest_off_is_shown():
    points = pd.DataFrame({
        "detection_id": ["d1", "d2", "d3", "d4"], "frame_id": ["f1", "f1", "f2", "f3"],
        "error_m": [8.0, 2.0, 7.0, np.nan],
    })  # fmt: skip
    pixels = pd.DataFrame(
        {"detection_id": ["d4", "d3", "d2", "d1"], "u_px": [4.0, 3, 2, 1], "v_px": [40.0, 30, 20, 10]}
    )
    found = worst_sightings(SimpleNamespace(table=lambda _: pixels), points)
    assert found[["image", "u_px", "v_px", "line"]].to_numpy().tolist() == [
        ["f2", 3, 30, "1: 7.0 m"],
        ["f1", 1, 10, "2: 8.0 m"],
    ]
