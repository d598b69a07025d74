"""What a replay shows, held against the flight's own numbers and geometry; and whatever a flight lacks."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import cv2
import numpy as np
import pandas as pd
import pytest

from wildlab.analysis.overview import cover_images
from wildlab.flight.clocks import frame_times
from wildlab.flight.manifest import replace_in_manifest
from wildlab.flight.store import Flight
from wildlab.replay.page import page
from wildlab.replay.scene import plain, relief, scene_of
from wildlab.simulation.twins import simulate_twin


@pytest.fixture(scope="module")
def ship() -> Flight:
    return simulate_twin("large-ship", 1)


def test_places_and_times_are_those_of_the_flight(ship):
    scene, nav = scene_of(ship), ship.nav["autopilot"]
    begin = nav["time_s"].iloc[0]
    assert scene.path is not None and scene.views is not None and scene.path.times[0] == 0
    at = np.searchsorted(nav["time_s"], scene.path.times + begin + 1e-6) - 1
    assert np.allclose(nav["time_s"].to_numpy()[at] - begin, scene.path.times, atol=2e-9)
    assert np.array_equal(nav[["north_m", "east_m", "down_m"]].to_numpy()[at], scene.path.places)
    stamps = frame_times(ship) - begin
    row = np.array([int(np.abs(stamps - t).argmin()) for t in scene.views.times])
    assert np.allclose(stamps[row], scene.views.times, atol=1e-6)
    cover = cover_images(ship, "autopilot")
    assert cover is not None
    assert np.array_equal(scene.views.outlines, cover.outlines[row], equal_nan=True)


def test_time_counts_from_the_first_pose_whatever_the_clock_shows(ship):
    def later(tables: dict[str, pd.DataFrame]) -> dict[str, pd.DataFrame]:
        return {
            name: table.assign(time_s=table["time_s"] + 1000.0) if "time_s" in table else table
            for name, table in tables.items()
        }

    moved = replace(ship, nav=later(ship.nav), tables=later(ship.tables))
    one, other = (scene_of(flight) for flight in (ship, moved))
    for part in ("path", "views", "points"):
        assert np.allclose(getattr(one, part).times, getattr(other, part).times)
    assert other.path is not None and other.path.times[0] == 0.0


def test_what_is_seen_lies_in_its_footprint(ship):
    scene = scene_of(ship)
    points, views = scene.points, scene.views
    assert points is not None and views is not None
    inside = []
    for time, place in zip(points.times, points.places[:, :2], strict=True):
        outline = views.outlines[int(np.abs(views.times - time).argmin())]
        if np.isfinite(outline).all():
            inside.append(cv2.pointPolygonTest(outline.astype(np.float32), place.tolist(), False) >= 0)
    assert len(inside) > 50 and np.mean(inside) > 0.99


def test_no_ray_past_the_horizon_makes_a_footprint(ship):
    level = replace_in_manifest(ship.manifest, {"mount": {"looks": "forward", "tilt_deg": 0.0}})
    scene = scene_of(replace(ship, manifest=level))
    assert scene.views is not None and np.isnan(scene.views.outlines).all()
    assert len(scene.lacks) > len(scene_of(ship).lacks)


def test_errors_and_nees_are_those_of_the_tables(ship):
    points = scene_of(ship).points
    assert points is not None
    known = np.isfinite(points.error)
    k = int(np.flatnonzero(known)[0])
    truth = ship.truth[ship.truth["target_id"] == points.names[k]]
    if truth["time_s"].notna().any():
        offset = ship.manifest.clocks.truth_offset_s - ship.nav["autopilot"]["time_s"].iloc[0]
        stamps = truth["time_s"].to_numpy() + offset
        at = [np.interp(points.times[k], stamps, truth[name]) for name in ("north_m", "east_m")]
    else:
        at = truth[["north_m", "east_m"]].to_numpy()[0]
    e = points.places[k, :2] - at
    of_error = points.covariance[k] + np.eye(2) * float(truth["sd_horizontal_m"].iloc[0]) ** 2
    assert points.error[k] == pytest.approx(np.hypot(*e), rel=1e-6)
    assert points.nees[k] == pytest.approx(e @ np.linalg.solve(of_error, e), rel=1e-6)


def test_terrain_is_lit_from_the_north_west():
    # A ridge from the south-west to the north-east.
    north, east = 5.0 * np.mgrid[0:9, 0:9]
    heights, shades = relief((-np.abs(east - north)).astype(np.float32), 5.0)
    assert shades.shape == (9, 9, 3) and heights[8, 0] == -40
    assert (shades[8, 0] > shades[0, 8]).all()


LACKING: dict[str, tuple[Callable[[Flight], Flight], str, str]] = {
    "images": (lambda f: without(f, "frames", "detections"), "images", "path"),
    "camera": (
        lambda f: replace(f, manifest=f.manifest.model_copy(update={"camera": None})),
        "camera, poses or ground",
        "sightings",
    ),
    "poses of the camera": (
        lambda f: replace(f, nav={"autopilot": f.nav["autopilot"].head(5)}),
        "no pose",
        "sightings",
    ),
}


def without(flight: Flight, *tables: str) -> Flight:
    return replace(flight, tables={n: t for n, t in flight.tables.items() if n not in tables})


@pytest.mark.parametrize("what", LACKING)
def test_what_lacks_is_said_and_the_rest_is_shown(ship, what):
    spoil, said, still = LACKING[what]
    flight = spoil(ship)
    scene = scene_of(flight)
    assert any(said in one for one in scene.lacks), scene.lacks
    assert not any(said in one for one in scene_of(ship).lacks)
    assert getattr(scene, still) is not None


def test_nothing_tells_where_when_or_by_whom(ship, tmp_path):
    manifest = replace_in_manifest(
        ship.manifest,
        {"origin": {"latitude_deg": 12.345678, "longitude_deg": 98.765432, "height_m": 432.125}},
    )
    text = page(scene_of(replace(ship, manifest=manifest, folder=tmp_path)), {})
    assert ship.manifest.time.epoch is not None
    needles = (
        "12.345",
        "98.765",
        "432.125",
        str(tmp_path),
        "latitude",
        "longitude",
        f"{ship.manifest.time.epoch.year}-",
    )
    assert [one for one in needles if one in text] == []


def test_names_of_strangers_are_one_short_line():
    for name in ("\u202egpj.exe\n# big", "x" * 5000, ""):
        shown = plain(name)
        assert len(shown) <= 60 and "\u202e" not in shown and "\n" not in shown
