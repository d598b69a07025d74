"""What is said of accuracy follows from the numbers; points that a report hands over, and known positions."""

from __future__ import annotations

import base64
import io
import json
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pandas as pd
import pymap3d
import pytest
from bs4 import BeautifulSoup

from wildlab.analysis.georeference import georeference, observe
from wildlab.evaluation.errors import Scatter, summarise
from wildlab.evaluation.pose_noise import KINDS, PoseNoise
from wildlab.flight.manifest import replace_in_manifest
from wildlab.flight.store import Flight
from wildlab.reporting import georeferencing
from wildlab.reporting.georeferencing import noise_table
from wildlab.reporting.georeferencing_left import remaining_parts
from wildlab.reporting.georeferencing_points import COLUMNS, points_section
from wildlab.reporting.ground import level_sentence
from wildlab.reporting.known_positions import EXACT, known_limits, known_positions, offset_sentence
from wildlab.reporting.report import Report, open_report
from wildlab.simulation.twins import simulate_twin


@pytest.fixture
def report():
    return open_report(study="made-up", kind="twin")


def scored_table(n=20, seed=0):
    rng = np.random.default_rng(seed)
    e = rng.normal(size=(n, 2))
    return pd.DataFrame(
        {"frame_id": np.repeat([f"I{i}" for i in range(n // 2)], 2), "error_north_m": e[:, 0],
         "error_east_m": e[:, 1],
         "error_m": np.hypot(*e.T), "inside_90": 1.0, "ellipse": "linear"}
    )  # fmt: skip


def test_metrics_have_the_promised_names(report):
    georeferencing.record_errors(report, "logged-pose", scored_table(), {"horizontal_error_mean": (0.5, 2.0)})
    assert [m["name"] for m in report._metrics] == [
        *(f"horizontal_error_{one}" for one in ("mean", "median", "p90", "max")),
        *("bias_north", "bias_east", "sd_north", "sd_east", "ellipse_coverage_90"),
    ]
    assert report._metrics[0]["low"] == 0.5


def test_noise_is_shown_in_degrees():
    noise = PoseNoise(dict.fromkeys(KINDS, np.radians(2.0)), dict.fromkeys(KINDS, 1.5))
    units = ("position_horizontal_m", "position_vertical_m", "tilt_deg", "heading_deg", "pixel_px")
    table = georeferencing.noise_table(noise, dict.fromkeys(units, 1)).set_index("what")
    assert table.loc["heading", "estimated"] == pytest.approx(2.0) and len(table) == len(KINDS)


def test_too_few_points_are_not_praised():
    few, many = summarise(np.ones((3, 2))), summarise(np.ones((20, 2)))
    assert len(georeferencing.headline(few, 3)) == 3 and len(georeferencing.headline(many, 20)) == 1
    assert "20 of 25" in georeferencing.headline(many, 25)[0]
    assert georeferencing.headline(summarise(np.empty((0, 2))), 25) == []


def test_the_title_of_the_scatter_follows_the_bias():
    wide = summarise(np.random.default_rng(0).normal(size=(200, 2)))
    off = summarise(np.tile([3.0, 4.0], (9, 1)))
    assert "5.0 m" in georeferencing.scatter_title(off) and " m" not in georeferencing.scatter_title(wide)
    assert georeferencing.span([50.6, 111.2, np.nan]) == "51 to 111"


def test_names_that_may_tell_of_a_place_are_numbered_unless_it_is_open():
    tables = {name: pd.DataFrame() for name in ("Flight 1", "Flight  1", "north gate")}
    assert list(georeferencing.named(tables, "part", shown=False)) == ["part-1", "part-2", "part-3"]
    assert list(georeferencing.named(tables, "part", shown=True)) == [
        "Flight-1",
        "Flight-1-again",
        "north-gate",
    ]
    assert "north gate" not in georeferencing.unlabelled_words(["north gate"], shown=False)[0]
    assert "40" not in georeferencing.vertical_words(40.3)


@pytest.fixture(scope="module")
def made() -> tuple[Flight, Any]:
    flight = simulate_twin("large-ship", 1)
    points = georeference(flight, observe(flight, "autopilot"), np.random.default_rng(1))
    points.loc[3, ["north_m", "east_m", "down_m"]] = np.nan
    return flight, points


def with_locations(flight: Flight, sensitivity: str) -> Flight:
    manifest = replace_in_manifest(flight.manifest, {"locations": {"sensitivity": sensitivity}})
    return replace(flight, manifest=manifest)


def handed_over(report: Report) -> dict[str, bytes]:
    links = BeautifulSoup("".join(report.parts), "html.parser").find_all("a")
    return {str(one["download"]): base64.b64decode(str(one["href"]).split("base64,")[1]) for one in links}


def shown(made: tuple[Flight, Any], sensitivity: str) -> Report:
    flight, points = made
    report = open_report(study="mine", kind="twin")
    points_section(report, with_locations(flight, sensitivity), points, "autopilot")
    return report


@pytest.mark.parametrize("sensitivity", ["withheld", "generalised"])
def test_metres_alone_are_handed_over_where_places_are_not_open(made, sensitivity):
    flight, points = made
    files = handed_over(shown(made, sensitivity))
    assert list(files) == ["points.csv"]
    table = pd.read_csv(io.BytesIO(files["points.csv"]))
    assert tuple(table) == COLUMNS and len(table) == len(points)
    np.testing.assert_allclose(table["north_m"], points["north_m"], atol=6e-4)
    np.testing.assert_allclose(table["east_m"], points["east_m"], atol=6e-4)
    assert table["seconds"].min() == 0
    np.testing.assert_allclose(np.diff(table["seconds"]), np.diff(points["time_s"]), atol=2e-3)
    # The ellipse's area is that of the covariance, by the determinant: 4.605 is chi-square's 90 % of two.
    area = np.sqrt(points["cov_nn"] * points["cov_ee"] - points["cov_ne"] ** 2) * 4.60517
    np.testing.assert_allclose(table["long_90_m"] * table["short_90_m"], area, rtol=2e-3)
    assert flight.name.encode() not in files["points.csv"]


def test_places_are_handed_over_where_they_are_open(made):
    flight, points = made
    files = handed_over(shown(made, "open"))
    features = json.loads(files["points.geojson"])["features"]
    placed = points[points["north_m"].notna()]
    assert len(features) == len(placed) == len(points) - 1
    origin = flight.manifest.origin
    latitude, longitude, _ = pymap3d.ned2geodetic(
        *placed[["north_m", "east_m", "down_m"]].to_numpy(float).T,
        *(origin.latitude_deg, origin.longitude_deg, origin.height_m),
    )
    found = np.array([one["geometry"]["coordinates"][:2] for one in features])
    np.testing.assert_allclose(found, np.stack([longitude, latitude], axis=1), atol=2e-8)


SCATTER = Scatter(0.1, 0.3, 0.6, *(np.array([a, a]) for a in (0.6, 3.0, 1.2)), 4.7)


def flown(kind="logged", **columns):
    truth = pd.DataFrame({"target_id": ["m1", "m2", "walker", "walker"],
                          "time_s": [np.nan, np.nan, 1.0, 2.0], **columns})  # fmt: skip
    return SimpleNamespace(manifest=SimpleNamespace(kind=kind), table=lambda _: truth)


def scored(*names):
    return pd.DataFrame({"truth_id": names})


WALK = known_positions(flown(), scored("walker", "walker", "m1"))
MARKS = known_positions(flown(), scored("m1", "m1", "m2"))


def test_points_are_counted_by_what_they_are_held_against():
    assert WALK[:4] == (1, 2, 1, 1) and MARKS[:4] == (3, 0, 2, 0)
    stated = known_positions(flown(sd_horizontal_m=[0.02, np.nan, 1.4, 1.6]), scored("walker", "m1"))
    assert stated[4:] == (0.02, pytest.approx(1.5))
    assert known_positions(flown("twin"), scored("walker")) == EXACT


def test_marks_and_tracks_are_told_apart():
    stated = known_positions(flown(sd_horizontal_m=[0.02, np.nan, 1.4, 1.6]), scored("walker"))
    for known, numbers in ((WALK, ["2 points", "One point"]), (MARKS, ["3 points"]), (stated, ["1.5 m"])):
        limits = known_limits(known)
        assert [number in one for number, one in zip(numbers, limits, strict=True)] == [True] * len(numbers)
    assert known_limits(EXACT) == []


def test_clicks_and_lens_are_not_blamed_for_the_target_s_receiver():
    noise = PoseNoise(dict.fromkeys(KINDS, 0.1), dict.fromkeys(KINDS, 1.5))
    assumed = dict.fromkeys(("position_horizontal_m", "position_vertical_m", "tilt_deg", "heading_deg"), 1.0)
    for known in (WALK, MARKS, EXACT):
        table = noise_table(noise, {**assumed, "pixel_px": 1.0}, known)
        for text in (" ".join(table["what"]), " ".join(remaining_parts(SCATTER, known))):
            assert ("receiver" in text) == (known is WALK)


def corrected(offset, kind="logged"):
    clocks = SimpleNamespace(camera_offset_s=offset)
    return offset_sentence(SimpleNamespace(manifest=SimpleNamespace(kind=kind, clocks=clocks)))


def test_an_offset_of_the_camera_s_clock_is_parted_from_its_zone():
    assert "+1.58 s" in corrected(-45898.42) and "-12.75 h" in corrected(-45898.42)
    assert "-0.40 s" in corrected(-0.4) and " h" not in corrected(-0.4).partition("s")[0]
    # A zone is read from the hours of the flight, and no point is fitted.
    assert corrected(0.0) == corrected(-45900.0) == corrected(0.4, "twin") == ""


@pytest.mark.parametrize(
    ("terrain", "level", "interval", "words"),
    [
        (2.0, 5.0, (1.0, 4.0), "the terrain is nearer"),
        (5.0, 2.0, (-4.0, -1.0), "level ground is nearer"),
        (5.0, 4.0, (-2.0, 1.0), "not decide"),
        (5.0, 4.0, (np.nan, np.nan), "too few"),
    ],
)
def test_which_is_nearer_follows_the_interval(terrain, level, interval, words):
    said = level_sentence(terrain, level, 30, interval)
    assert words in said and (f"{level - terrain:+.2f} m" in said) == (words != "too few")
