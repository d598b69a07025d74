"""A photo is called off beyond what stated errors allow for so many photos, and not for a wrong detection."""

import re

import numpy as np
import pytest

from tests.analysis.survey_twin import CAMERA, Survey, simulate
from wildlab.flight.checks.known_points import _off, known_points
from wildlab.flight.store import Flight


def watched(seed: int, clutter: float = 0.0, turned: dict[int, float] | None = None) -> Flight:
    """Photos of marks from poses as wrong as is stated; which detection is of which mark is not told.

    `clutter`: share of detections of nothing known; `turned`: further errors of yaw, deg, of some photos.
    """
    flight = simulate(Survey(seed, images=50, rule="nearest", turned_deg=turned or {}))
    rng, detections = np.random.default_rng(seed), flight.table("detections")
    wrong = rng.random(len(detections)) < clutter
    size = [CAMERA.width, CAMERA.height]
    detections.loc[wrong, ["u_px", "v_px"]] = rng.uniform([0, 0], size, (int(wrong.sum()), 2))
    return flight


def off(flight: Flight) -> list[str]:
    return [one.sentence for one in known_points(flight) if "one photo off" in one.causes]


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("clutter", [0.0, 0.1, 0.25])
def test_a_flight_as_stated_has_no_photo_off(seed, clutter):
    assert off(watched(seed, clutter)) == []


@pytest.mark.parametrize(("sd_m", "off"), [(np.nan, True), (4.0, False)])
def test_a_mark_is_off_where_its_place_is_not_said_to_be_uncertain(sd_m, off):
    flight = simulate(Survey(1, images=50, stated_deg=0.3, off={"M24": (8.0, 0.0)}))
    flight.tables["truth"] = flight.table("truth").assign(sd_horizontal_m=sd_m)
    assert any("one mark off" in one.causes for one in known_points(flight)) == off


def test_one_wrong_of_two_detections_is_no_wrong_photo():
    flight = watched(1)
    detections = flight.table("detections")
    rows = np.flatnonzero(detections["frame_id"] == "I005")
    detections.loc[rows[0], ["u_px", "v_px"]] = 5.0
    flight.tables["detections"] = detections.drop(rows[2:]).reset_index(drop=True)
    assert off(flight) == []


@pytest.mark.parametrize("clutter", [0.0, 0.1])
def test_wrong_photos_are_still_named(clutter):
    (said,) = off(watched(1, clutter, {7: 35.0, 31: -30.0}))
    assert re.findall(r"'(I\d+)'", said) == ["I007", "I031"]


@pytest.mark.parametrize(
    ("far", "others", "wrong"),
    [
        # Half of the points are no wrong photo.
        ((1, 2), [(0, 4)] * 20, False),
        ((2, 4), [(0, 4)] * 20, False),
        ((3, 4), [(0, 4)] * 20, True),
        # A tenth of all points far: in 100 photos of two points both are so in one, by chance.
        ((2, 2), [(1, 2)] * 20 + [(0, 2)] * 80, False),
        ((8, 8), [(1, 2)] * 20 + [(0, 2)] * 80, True),
        # Where no other is far, two of two are enough.
        ((2, 2), [(0, 4)] * 20, True),
    ],
)
def test_how_many_far_points_make_a_wrong_photo(far, others, wrong):
    photos = [far, *others]
    names = np.repeat([f"P{k}" for k in range(len(photos))], [n for _, n in photos]).astype(object)
    rows = np.concatenate([np.arange(n) < some for some, n in photos])
    assert _off(rows, names, np.full(len(rows), True)) == ["P0"] * wrong
