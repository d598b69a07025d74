"""Pixels without names: mistakes show by how many meet a known target, and right ones are not accused."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

from tests.flight.checks.test_mistakes_named import NAV, euler
from wildlab.flight.checks import known_points
from wildlab.flight.checks.check import check_flight, usable_for
from wildlab.flight.checks.findings import Finding
from wildlab.flight.checks.known_points import sightings
from wildlab.flight.manifest import replace_in_manifest
from wildlab.flight.store import Flight
from wildlab.simulation.twins import simulate_twin


@pytest.fixture(scope="module")
def flown() -> Flight:
    """Rows over 25 animals, by a detector that gives no names."""
    flight = simulate_twin("uav-tracking", 1)
    detections = flight.table("detections").assign(target_id="")
    nav = {"autopilot": flight.nav["autopilot"]}
    return replace(flight, nav=nav, tables={**flight.tables, "detections": detections})


def told(flight: Flight) -> list[Finding]:
    return list(known_points.known_points(flight))


def turned(flight: Flight, change: Callable[[np.ndarray], np.ndarray]) -> Flight:
    """With other angles (N, 3), roll, pitch and yaw in degrees, in the poses."""
    return euler(NAV, change)(flight)


def few(flight: Flight, count: int) -> Flight:
    """With the truth of so many of them alone."""
    truth = flight.table("truth")
    kept = truth["target_id"].drop_duplicates().sample(count, random_state=count)
    return replace(flight, tables={**flight.tables, "truth": truth[truth["target_id"].isin(kept)]})


def with_others(flight: Flight) -> Flight:
    return replace(
        flight, manifest=replace_in_manifest(flight.manifest, {"targets": {"many": {"others": True}}})
    )


@pytest.mark.slow
@pytest.mark.parametrize("count", [25, 1])
def test_what_is_right_is_not_accused_however_few_are_known(flown, count):
    assert told(few(flown, count)) == []
    nearest = replace_in_manifest(flown.manifest, {"scoring": {"rule": "nearest"}})
    assert told(replace(few(flown, count), manifest=nearest)) == []


@pytest.mark.slow
def test_where_few_are_known_a_share_that_grows_proves_nothing(flown):
    """Negated yaw, and undone: of 1 of 25 animals a share is too small to be told from others'."""
    assert told(few(turned(flown, lambda a: a * [1, 1, -1]), 1)) == []


@pytest.mark.slow
@pytest.mark.parametrize(("before", "accused"), [(0.29, True), (0.31, False)])
def test_what_meets_targets_often_enough_needs_no_explanation(flown, monkeypatch, before, accused):
    """As where a mount is off by a few degrees, which another mistake may make up for."""
    given = sightings(flown, "autopilot")
    assert given is not None
    monkeypatch.setattr(known_points, "shares", lambda s: np.full(3, before if s is given else 0.9))
    assert bool(list(known_points.nameless(flown, given))) is accused


@pytest.mark.slow
@pytest.mark.parametrize(
    ("change", "cause"),
    [
        (lambda a: a * [1, 1, -1], "sign of yaw"),
        (lambda a: a + np.array([0, 0, 90.0]), "yaw off by -90 deg"),
    ],
)
def test_a_wrong_attitude_is_named_also_where_half_of_them_are_known(flown, change, cause):
    (found,) = told(few(turned(flown, change), 12))
    assert found.level == "warning" and cause in found.causes
    assert told(with_others(turned(flown, change))) == []


@pytest.mark.slow
def test_a_clock_that_is_off_is_named_with_what_to_write(flown):
    frames = flown.table("frames")
    late = replace(flown, tables={**flown.tables, "frames": frames.assign(time_s=frames["time_s"] + 8.0)})
    (found,) = told(late)
    assert "clock of the camera" in found.causes
    written = float(found.fix.split("camera_offset_s = ")[1].split("`")[0])
    assert written == pytest.approx(flown.manifest.clocks.camera_offset_s - 8.0, abs=1.0)


def test_a_name_that_is_no_known_targets_says_nothing_of_known_ones(flown):
    wrong = turned(flown, lambda a: a * [1, 1, -1])
    detections = wrong.table("detections").assign(target_id="somebody else")
    assert told(replace(wrong, tables={**wrong.tables, "detections": detections})) == []


def test_other_things_in_a_photo_are_no_wrong_photo(flown):
    seen_by = flown.table("detections")
    # One in a photo, so that all in it are soon of others.
    rows = seen_by.drop_duplicates("frame_id").iloc[::15].reset_index(drop=True)
    more = [rows.iloc[[5, 25, 45]].assign(u_px=u, v_px=30.0, detection_id=[f"{u}-{i}" for i in range(3)])
            for u in (20.0, 320.0, 620.0)]  # fmt: skip
    both = pd.concat([rows, *more], ignore_index=True)
    strange = replace(flown, tables={**flown.tables, "detections": both})
    assert told(strange) == []
    # Where it is said that each is of a known target, it is.
    nearest = replace_in_manifest(flown.manifest, {"scoring": {"rule": "nearest"}})
    (found,) = told(replace(strange, manifest=nearest))
    assert found.causes == ("one photo off",)


def test_places_can_be_judged_by_names_or_where_the_nearest_is_meant(flown):
    def judged(flight: Flight) -> bool:
        (use,) = [one for one in usable_for(flight) if one.purpose == "georeferencing accuracy"]
        return use.usable

    nearest = replace(flown, manifest=replace_in_manifest(flown.manifest, {"scoring": {"rule": "nearest"}}))
    assert [judged(one) for one in (flown, nearest, with_others(nearest))] == [False, True, False]
    levels = [
        [one.level for one in check_flight(flight) if one.field in ("target_id", "scoring.rule")]
        for flight in (flown, with_others(flown), with_others(nearest))
    ]
    assert levels == [["warning"], ["note"], ["warning"]]
