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
from wildlab.flight.manifest import replace_in_manifest
from wildlab.flight.store import Flight
from wildlab.reporting import georeferencing
from wildlab.reporting.georeferencing import EXACT, truth_kinds
from wildlab.reporting.georeferencing_tables import POINT_COLUMNS, point_links
from wildlab.reporting.report import Report, open_report
from wildlab.simulation.twins import simulate_twin


@pytest.fixture
def report():
    return open_report(study="made-up", kind="twin")


def test_names_that_may_tell_of_a_place_are_numbered_unless_it_is_open():
    tables = {name: pd.DataFrame() for name in ("Flight 1", "Flight  1", "north gate")}
    assert list(georeferencing.named(tables, "part", shown=False)) == ["part-1", "part-2", "part-3"]
    assert list(georeferencing.named(tables, "part", shown=True)) == [
        "Flight-1",
        "Flight-1-again",
        "north-gate",
    ]


@pytest.fixture(scope="module")
def made() -> tuple[Flight, Any]:
    flight = simulate_twin("large-ship", 1)
    points = georeference(observe(flight, "autopilot"), np.random.default_rng(1))
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
    report.files("", point_links(with_locations(flight, sensitivity), points, "autopilot"))
    return report


@pytest.mark.parametrize("sensitivity", ["withheld", "generalised"])
def test_metres_alone_are_handed_over_where_places_are_not_open(made, sensitivity):
    flight, points = made
    files = handed_over(shown(made, sensitivity))
    assert list(files) == ["points.csv"]
    table = pd.read_csv(io.BytesIO(files["points.csv"]))
    assert tuple(table) == POINT_COLUMNS and len(table) == len(points)
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


def flown(kind="logged", **columns):
    truth = pd.DataFrame({"target_id": ["m1", "m2", "walker", "walker"],
                          "time_s": [np.nan, np.nan, 1.0, 2.0], **columns})  # fmt: skip
    return SimpleNamespace(manifest=SimpleNamespace(kind=kind), table=lambda _: truth)


def scored(*names):
    return pd.DataFrame({"truth_id": names})


def test_points_are_counted_by_what_they_are_compared_with():
    assert truth_kinds(flown(), scored("walker", "walker", "m1"))[:2] == (1, 2)
    assert truth_kinds(flown(), scored("m1", "m1", "m2"))[:2] == (3, 0)
    reported = truth_kinds(flown(sd_horizontal_m=[0.02, np.nan, 1.4, 1.6]), scored("walker", "m1"))
    assert reported[2:] == (0.02, pytest.approx(1.5))
    assert truth_kinds(flown("twin"), scored("walker")) == EXACT


def limits_with(offset=0.0, kind="logged", truth=EXACT, certain=False, halves=False, lost=0):
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
        visible_m=np.nan,
        lost=lost, scored=range(100), halves=SimpleNamespace(disagree=halves),
    )  # fmt: skip
    return {one.key: dict(one.values) for one in georeferencing.limits(flight, found, truth, [], None)}


def test_an_offset_of_the_camera_s_clock_is_parted_from_its_zone():
    assert limits_with(-45898.42)["limit-clock-fitted"] == {"offset": "+1.58"}
    assert limits_with(-0.4)["limit-clock-fitted"] == {"offset": "-0.40"}
    # A zone is read from the hours of the flight, and no point is fitted.
    for said in (limits_with(0.0), limits_with(-45900.0), limits_with(0.4, "twin")):
        assert "limit-clock-fitted" not in said
