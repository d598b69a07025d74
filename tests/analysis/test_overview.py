"""The overview of a flight: streams, troubles, coverage and losses by closed forms; and whatever it lacks."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest

from tests.analysis.building import manifest_of, poses_table, surveyed
from tests.analysis.conftest import build, receiver, without_poses
from wildlab.analysis.overview import TROUBLES, Gain, cover_images, look_over
from wildlab.analysis.verdict import (
    gains_of,
    numbers_of,
    possible_gain,
)
from wildlab.evaluation.streams import FLOOR_HZ, pace_of, vibration_of
from wildlab.flight.store import Flight
from wildlab.geometry.camera import Camera
from wildlab.geometry.frames import euler_to_matrix
from wildlab.messages.catalogue import load_texts
from wildlab.reporting.overview import counts_of, show_overview
from wildlab.reporting.report import open_report
from wildlab.simulation.twins import simulate_twin


def page_of(
    flight: Flight, folder: Path, *, numbers: Any = None, judged: int = 0
) -> tuple[str, dict[str, Any]]:
    """The whole report of a flight as HTML, and the numbers it left."""
    overview = look_over(flight)
    found = numbers or {}
    kind = flight.manifest.kind
    report = open_report(study="overview", kind=kind, flight=flight.name, seed=1, out=str(folder))
    show_overview(report, overview, gains_of(overview, found), found, [], ["tracking (none)"], judged)
    report.save()
    return "\n".join(report.parts), json.loads((folder / "metrics.json").read_text())


def values(content: dict[str, Any]) -> dict[tuple[str, str], float]:
    return {(one["name"], one["subject"]): one["value"] for one in content["metrics"]}


def test_a_stream_with_a_hole_and_lost_samples_is_counted():
    t = np.arange(0, 100, 0.02)
    whole = pace_of(t, 1.0)
    assert (whole.n, whole.missing, len(whole.gaps), whole.unordered) == (5000, 0, 0, 0)
    assert whole.rate_hz == pytest.approx(50) and whole.even
    kept = np.delete(t, np.r_[1000:1100, 3000, 3500:3503])
    holed = pace_of(kept, 1.0)
    assert holed.missing == 104
    assert holed.missing_share == pytest.approx(104 / 5000)
    assert holed.gaps == pytest.approx(np.array([[19.98, 22.0]]))
    assert holed.paused_s == pytest.approx(2.02)
    mixed = kept.copy()
    mixed[[10, 11]] = mixed[[11, 10]]
    assert pace_of(mixed, 1.0).unordered == 1


@pytest.mark.parametrize(("hertz", "size"), [(10.0, 4.0), (35.0, 20.0), (90.0, 50.0)])
def test_a_sine_shakes_by_what_theory_says(hertz, size):
    """At a rate high enough for the continuous filter: its high pass, and the root mean square of a sine."""
    t = np.arange(0, 30, 1 / 2000)
    force = np.stack([0 * t, size * np.sin(2 * np.pi * hertz * t), 0 * t - 9.81], axis=1)
    found = vibration_of(t, force)
    passed = size / np.sqrt(2) * hertz / np.hypot(hertz, FLOOR_HZ)
    assert np.sqrt((found[20000:, 1] ** 2).mean()) == pytest.approx(passed, rel=0.03)
    assert found[20000:, 2].max() < 1e-6 * size
    assert found[:, 0].max() < 1e-9


def level_images(places: list[tuple[float, float]], height: float = 100.0, lean_deg: float = 0.0) -> Flight:
    """Images straight down at places (north, east), or leaning forward; the ground is level at 0."""
    n = len(places)
    frames = pd.DataFrame({"frame_id": [f"i{k}" for k in range(n)], "time_s": np.arange(float(n))})
    R = euler_to_matrix(np.zeros(n), np.full(n, np.radians(lean_deg)), np.zeros(n))
    nav = poses_table(np.arange(float(n)), np.insert(places, 2, -height, axis=1), R)
    manifest = manifest_of(Camera(400, 200, 200.0, 200.0, 200.0, 100.0), mount={"looks": "down"})
    tables = {"frames": frames, "truth": surveyed(["t"], np.zeros((1, 3)))}
    return Flight(manifest, {"logged": nav.assign(frame_id=frames["frame_id"])}, tables)


def test_footprints_have_the_area_and_the_overlap_of_rectangles():
    """200 m wide and 100 m long from 100 m: two apart, and two that share half."""
    apart = cover_images(level_images([(0.0, 0.0), (500.0, 0.0)]), "logged")
    assert apart.area_m2 == pytest.approx(2 * 200 * 100, rel=0.01)
    assert apart.counts[apart.counts > 0].mean() == pytest.approx(1)
    assert apart.placed.all() and not apart.flat.any()
    half = cover_images(level_images([(0.0, 0.0), (50.0, 0.0)]), "logged")
    assert half.area_m2 == pytest.approx(200 * 150, rel=0.02)
    assert half.counts[half.counts > 0].mean() == pytest.approx(4 / 3, abs=0.02)


@pytest.mark.parametrize("without", ["frames", "truth"])
def test_without_images_or_a_height_of_the_ground_there_is_no_coverage(without):
    flight = level_images([(0.0, 0.0)])
    del flight.tables[without]
    assert cover_images(flight, "logged") is None and cover_images(flight, None) is None


def holed() -> Flight:
    """A flight whose poses have a hole of five seconds, and a receiver with little to see in it."""
    flight = build(n_images=40)
    flight.tables["gnss"] = receiver(
        flight,
        satellites=lambda t: np.where((t > 20) & (t < 23.9), 5.0, 11.0),
        sd_horizontal_m=lambda t: np.where((t > 30) & (t < 31.9), 9.0, 1.0),
        fix=3.0,
    )
    return without_poses(flight, 10.05, 14.95)


def test_what_is_wrong_along_the_path_is_found():
    overview = look_over(holed())
    found = {one.what: one for one in overview.troubles}
    assert set(found) == {TROUBLES[0], TROUBLES[3], TROUBLES[4]}
    assert found["no poses"].spells == pytest.approx(np.array([[10.0, 15.0]]), abs=0.06)
    assert found[TROUBLES[3]].spells == pytest.approx(np.array([[20.5, 24.0]]))
    assert found[TROUBLES[4]].spells == pytest.approx(np.array([[30.5, 32.0]]))
    assert [one.what for one in overview.troubles] == [what for what in TROUBLES if what in found]


def lost_of(flight: Flight, key: str) -> Gain:
    (lost,) = [one for one in look_over(flight).lost if one.key == key]
    return lost


def test_images_in_a_hole_are_counted():
    flight = holed()
    frames = flight.tables["frames"]
    inside = int(((frames["time_s"] > 10.0) & (frames["time_s"] < 15.0)).sum())
    lost = lost_of(flight, "images_without_pose")
    assert (lost.value, lost.of) == (inside, len(frames)) and inside
    flight.nav["logged"] = flight.nav["logged"].query("time_s < 20")
    lost = lost_of(flight, "images_without_pose")
    after = int((frames["time_s"] >= 20).sum())
    assert lost.value == inside + after


def test_detections_whose_target_has_no_truth_are_counted():
    flight = build(n_images=10)
    detections = flight.tables["detections"]
    detections.loc[:4, "target_id"] = "nobody"
    lost = lost_of(flight, "detections_without_truth")
    assert (lost.value, lost.of) == (5, int((detections["target_id"] != "").sum()))


def entry(name: str, subject: str, value: float, **more: float) -> dict[str, Any]:
    known = {"unit": "s", "low": None, "high": None, "n": 90}
    return {"name": name, "subject": subject, "value": value, **known, **more}


def georeferenced(gain: float, after: float, low: float) -> dict[tuple[str, str], Any]:
    """The numbers of a report on georeferencing."""
    metrics = [
        entry("gain", "winner", gain, low=low, high=2 * gain - low),
        entry("boresight_tilt", "calibration", 1.0),
        entry("clock_offset", "calibration", 0.2),
    ]
    if low > 0:
        metrics.append(entry("horizontal_error_mean", "calibrated-pose", after))
    return numbers_of([{"metrics": metrics}])


def test_only_what_was_measured_is_a_gain():
    overview = look_over(holed())
    alone = gains_of(overview, {})
    assert alone
    first, *others = gains_of(overview, georeferenced(3.0, 1.0, 2.0))
    assert (first.key, first.causes) == ("cause", ("boresight", "camera's clock"))
    assert first.share == pytest.approx(0.75) and first.of == pytest.approx(4.0)
    assert [one.share for one in others] == sorted((one.share for one in others), reverse=True)
    uncertain = gains_of(overview, georeferenced(3.0, 1.0, -0.1))
    assert [one.key for one in uncertain] == [one.key for one in alone]


def test_gains_and_troubles_are_recorded_and_no_place_is_given_away(tmp_path):
    flight = holed()
    html, content = page_of(flight, tmp_path, numbers=georeferenced(3.0, 1.0, 2.0), judged=1)
    found = values(content)
    assert found["worth_fixing", "flight"] == 3 and found["problems", "flight"] == 0
    assert found["gain_share", "cause"] == pytest.approx(0.75)
    assert found["trouble", "no-poses"] == pytest.approx(5.0, abs=0.1)
    origin = flight.manifest.origin
    for value in (origin.latitude_deg, origin.longitude_deg):
        assert f"{value:.3f}" not in html and f"{value:.2f}" not in html


@pytest.mark.parametrize(("flight", "key"), [(holed(), "path-troubles"), (build(n_images=10), "path")])
def test_the_caption_speaks_of_troubles_only_where_there_are_some(flight, key, tmp_path):
    figures, html = load_texts("overview").figures, page_of(flight, tmp_path)[0]
    assert figures[key].alt in html and figures[key].caption in html
    assert (figures["path-troubles"].caption in html) == (key == "path-troubles")


def without(flight: Flight, *, nav: bool = True, tables: tuple[str, ...] = ()) -> Flight:
    kept = {name: table for name, table in flight.tables.items() if name in tables}
    return Flight(flight.manifest, dict(flight.nav) if nav else {}, kept)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("nav", "tables"),
    [
        (True, ()),
        (True, ("frames", "detections")),
        (False, ("gnss",)),
        (False, ("frames", "truth")),
        (False, ()),
    ],
)
def test_a_flight_that_lacks_anything_has_its_page(nav, tables, tmp_path):
    whole = simulate_twin("fast-vessel", 1)
    flight = without(whole, nav=nav, tables=tables)
    html, content = page_of(flight, tmp_path)
    assert not re.search(r"\bnan\b", re.sub('data:image[^"]*', "", html.lower()))
    assert values(content)["reports_beside", "flight"] == 0


def test_poses_without_covariance_or_velocity_and_empty_tables_are_fine(tmp_path):
    whole = simulate_twin("large-ship", 1)
    nav = whole.nav["autopilot"]
    bare = nav[["time_s", "north_m", "east_m", "down_m", "q_w", "q_x", "q_y", "q_z"]]
    flight = Flight(whole.manifest, {"autopilot": bare}, dict(whole.tables))
    assert ("duration", "flight") in values(page_of(flight, tmp_path)[1])
    empty = {name: table.iloc[:0] for name, table in whole.tables.items()}
    nothing = Flight(whole.manifest, {"autopilot": bare.iloc[:0]}, empty)
    assert ("duration", "flight") not in values(page_of(nothing, tmp_path)[1])


def test_poses_that_pause_shortly_count_as_trouble():
    flight = build(n_images=80)
    assert counts_of(look_over(flight), [], 0, 1, None)["troubled"] == 0
    assert counts_of(look_over(without_poses(flight, 10.05, 11.95)), [], 0, 1, None)["troubled"] == 1


@pytest.mark.parametrize(("gain", "possible"), [(1.6, True), (0.3, False)])
def test_a_gain_that_is_large_and_not_certain_is_possible(gain, possible):
    metrics = [
        entry("gain", "winner", gain, low=0.28, high=2.88),
        entry("horizontal_error_mean", "logged-pose", 4.5),
    ]
    found = possible_gain(numbers_of([{"metrics": metrics}]))
    assert (found is not None and found.share == pytest.approx(gain / 4.5)) == possible


def test_detections_of_no_camera_are_not_held_against_the_ground(tmp_path):
    flight = build(n_images=10)
    flight.tables["detections"] = flight.table("detections").assign(
        source="radar", kind="position", north_m=0.0, east_m=0.0, down_m=0.0
    )
    recorded = values(page_of(flight, tmp_path)[1])
    assert recorded["detections_in_images", "flight"] == 0
    assert ("detections_placed", "flight") not in recorded
