"""From the numbers that reports recorded to plain values."""

from __future__ import annotations

import math

import pytest

from tests.analysis.robots import KNOWN, robot_flight
from tests.sharing.edition.flights import flight, overview, report
from wildlab.analysis.tracks.tracker import score_tracks, track
from wildlab.analysis.verdict import Gain, numbers_of
from wildlab.flight.manifest import parse_settings
from wildlab.reporting import tracking
from wildlab.reporting.metrics import NEAR_THE_BAND, read_metrics
from wildlab.reporting.report import open_report
from wildlab.sharing.edition import facts_of

ERROR = {
    ("horizontal_error_median", "logged-pose"): {"value": 3.0, "n": 40},
    ("horizontal_error_p90", "logged-pose"): {"value": 8.0, "n": 40},
    ("horizontal_error_mean", "logged-pose"): {"value": 4.0, "n": 40},
}


def test_errors_and_gains():
    places = report("georeferencing", {
        **ERROR,
        ("gain", "winner"): {"value": 1.5, "n": 40, "low": 1.0, "high": 2.0},
        ("horizontal_error_mean", "calibrated-pose"): {"value": 2.5, "n": 40},
        ("clock_offset", "calibration"): {"value": 0.2},
        ("down_offset", "calibration"): {"value": 0.2, "low": -0.5, "high": 0.9},
    })  # fmt: skip
    seen = overview(
        {"worth_fixing": 2}, gain_share__cause={"value": 0.375},
        gain_share__images_without_pose={"value": 0.5}, lost__images_without_pose={"value": 10, "n": 20},
        detections={"value": 60}, duration={"value": 100.0},
    )  # fmt: skip
    facts = facts_of(flight(seen, places))
    assert (facts.error_median, facts.error_p90, facts.compared) == (3.0, 8.0, 40)
    assert facts.gains == (
        Gain("images_without_pose", (), 10.0, 20.0, 0.5),
        Gain("cause", ("camera's clock",), 1.5, 4.0, 0.375),
    )
    assert facts.verdict == "worth fixing" and facts.seen == 60 and math.isnan(facts.things)
    assert facts.possible is None


def test_a_gain_that_is_not_certain_is_possible():
    places = report("georeferencing", {**ERROR, ("gain", "winner"): {"value": 1.0, "low": -0.5, "high": 2.0}})
    facts = facts_of(flight(overview({"troubled": 1}), places))
    assert facts.possible is not None and (facts.possible.value, facts.possible.of) == (1.0, 4.0)
    assert facts.verdict == "look closer"


def test_alarms_stand_in_order_and_troubles_by_time():
    facts = facts_of(flight(overview(
        {"broken": 1}, alarm__shakes={"value": 70.0, "n": 1}, alarm__jumps={"value": 9.0, "n": 2},
        **{"trouble__no-poses": {"value": 3.0}, "trouble__fewer-than-6-satellites": {"value": 30.0}},
    )))  # fmt: skip
    assert [(one.what, one.size, one.often) for one in facts.alarms] == [
        ("jumps", 9.0, 2),
        ("shakes", 70.0, 1),
    ]
    assert facts.troubles == (("few_satellites", 30.0), ("poses", 3.0))
    assert facts.verdict == "went wrong"


@pytest.mark.parametrize("off_deg", [2.0, 0.0])
def test_a_filter_is_as_sure_as_the_tracking_report_found(off_deg, tmp_path):
    """Through the report's own metrics.json: a filter that knows of no error of the heading."""
    settings = parse_settings(KNOWN)
    followed = track(robot_flight(0, heading_off_deg=off_deg), filters=("ekf",), settings=settings)
    made = open_report(study="f-tracking", kind="logged", flight="f", out=str(tmp_path))
    rows = score_tracks(followed)
    tracking.record(made, rows)
    made.save()
    numbers = numbers_of([read_metrics(tmp_path / "metrics.json")])
    there = report("tracking")._replace(numbers=numbers)
    facts = facts_of(flight(overview(), there))
    sure = float((rows["nees"] / rows["nees_high"]).iloc[0])
    assert facts.track_sure == pytest.approx(sure)
    assert set(rows["verdict"]) == ({"overconfident"} if off_deg else {"consistent"})
    assert (facts.track_sure > NEAR_THE_BAND) == bool(off_deg)


@pytest.mark.parametrize(
    ("height", "way", "flown"),
    [
        (118.0, 9000.0, True),
        # A boat; a radar on a tower; poses of which the ground is not known.
        (4.0, 9000.0, False),
        (45.0, 0.0, False),
        (None, 9000.0, False),
        (118.0, None, False),
    ],
)
def test_only_what_moves_high_above_the_ground_is_known_to_fly(height, way, flown):
    known = {"height_above_ground": height, "path_length": way}
    values = {name: {"value": value} for name, value in known.items() if value is not None}
    assert facts_of(flight(overview(**values))).flown == flown
    assert not facts_of(flight()).flown
