"""`check_flight` and `usable_for` on the small flight."""

import pandas as pd
import pytest

from tests.flight.checks.test_mistakes_named import again, put, without
from wildlab.flight.checks.check import check_flight, usable_for


def test_the_right_flight_has_nothing_wrong(make_flight):
    found = check_flight(make_flight(clocks={"camera_offset_s": 0.01}))
    assert found == []


@pytest.mark.parametrize(
    ("manifest", "change", "usable"),
    [
        ({}, lambda flight: None, [True, True]),
        ({}, without("truth"), [False, True]),
        ({}, put("nav/autopilot", "q_w", 5, 2.0), [False, False]),
        ({}, without("detections"), [False, False]),
        ({}, again("frames", 2), [False, False]),
        ({"time": {"kind": "sequence"}}, lambda flight: None, [True, False]),
    ],
)
def test_what_it_can_be_used_for(make_flight, monkeypatch, manifest, change, usable):
    monkeypatch.setattr("wildlab.flight.checks.check.FEWEST_SCANS", 1)
    flight = make_flight(**manifest)
    change(flight)
    uses = usable_for(flight)
    assert [use.usable for use in uses] == [*usable, False]
    assert all(use.why for use in uses)


@pytest.mark.parametrize(("fewest", "usable"), [(3, True), (4, False)])
def test_a_target_seen_in_few_images_has_no_track(make_flight, monkeypatch, fewest, usable):
    flight = make_flight()
    images = flight.tables["frames"]["frame_id"].tolist()[:3]
    seen = flight.tables["detections"].iloc[[0] * 4].assign(frame_id=[*images, images[0]])
    seen = pd.concat([seen, seen.iloc[:1].assign(target_id="seen once")])
    flight.tables["detections"] = seen.assign(detection_id=[f"d{k}" for k in range(5)])
    monkeypatch.setattr("wildlab.flight.checks.check.FEWEST_SCANS", fewest)
    (use,) = [use for use in usable_for(flight) if use.purpose == "tracking"]
    assert use.usable == usable
