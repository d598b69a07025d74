"""Points that a report hands over: read back from the page, with places by another library."""

from __future__ import annotations

import base64
import io
import json
from dataclasses import replace
from typing import Any

import numpy as np
import pandas as pd
import pymap3d
import pytest
from bs4 import BeautifulSoup

from wildlab.flight.manifest import replace_in_manifest
from wildlab.flight.store import Flight
from wildlab.pipeline.georeference import georeference, observe
from wildlab.reporting.georeferencing_points import COLUMNS, points_section
from wildlab.reporting.report import Report, open_report
from wildlab.simulation.twins import simulate_twin


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
def test_metres_alone_are_handed_over_where_places_are_not_open(
    made: tuple[Flight, Any], sensitivity: str
) -> None:
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


def test_places_are_handed_over_where_they_are_open(made: tuple[Flight, Any]) -> None:
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
