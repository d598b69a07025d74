"""Every study, run as a user runs it: its promised metrics, its figures, its page in a browser."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from wildlab.flight.recipe.importing import import_flight
from wildlab.paths import DATA
from wildlab.runner.evaluate import evaluate_flight
from wildlab.runner.run import run_studies
from wildlab.studies.printed_numbers.items import all_items

pytestmark = pytest.mark.slow

Faults = Callable[[Path], list[str]]
ACCURACY = {
    "horizontal_error_mean",
    "horizontal_error_median",
    "horizontal_error_p90",
    "horizontal_error_max",
    "bias_north",
    "bias_east",
    "sd_north",
    "sd_east",
    "ellipse_coverage_90",
}


@pytest.fixture(scope="module")
def reports(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("reports")


def values(folder: Path | None) -> dict[tuple[str, str], dict[str, Any]]:
    """The metrics of a report by (name, subject)."""
    assert folder is not None
    content = json.loads((folder / "metrics.json").read_text(encoding="utf-8"))
    return {(m["name"], m["subject"]): m for m in content["metrics"]}


def run(name: str, reports: Path, **kwargs: Any) -> Path:
    (outcome,) = run_studies([name], reports=reports, **kwargs)
    assert outcome.state == "done", outcome.reason
    assert outcome.folder is not None
    return outcome.folder


def test_sensitivity_meets_the_print(reports: Path, faults: Faults) -> None:
    folder = run("sensitivity", reports)
    metrics = [m for (name, _), m in values(folder).items() if name == "horizontal_error"]
    assert len(metrics) == 42
    assert all(abs(m["value"] - m["published"]) <= 0.15 for m in metrics)
    assert {m["subject"].split("/")[0] for m in metrics} == {"level", "turn", "ascent"}
    assert {m["subject"].split("/")[2] for m in metrics} == {"100m", "400m"}
    assert faults(folder / "report.html") == []


def test_consistency_bounds_meet_the_print(reports: Path, faults: Faults) -> None:
    folder = run("consistency-bounds", reports)
    printed = [m for m in values(folder).values() if m["published"] is not None]
    assert len(printed) == 6
    assert faults(folder / "report.html") == []


@pytest.mark.parametrize("study", ["camera-calibration", "wildlife-camera"])
def test_cameras_come_back_as_printed(study: str, reports: Path, faults: Faults) -> None:
    folder = run(study, reports)
    found = values(folder)
    for name in ("fx", "fy", "cx", "cy"):
        one = found[name, "tau2"]
        assert one["published"] is not None
        assert one["value"] == pytest.approx(one["published"], rel=0.005), name
    assert faults(folder / "report.html") == []


def test_printed_numbers_stand_beside_each_other(reports: Path, faults: Faults) -> None:
    folder = run("printed-numbers", reports)
    found = values(folder)
    assert {name for name, _ in found} == {"ratio"}
    assert {subject: m["value"] for (_, subject), m in found.items()} == pytest.approx(
        {item.key: item.ratio for item in all_items()}
    )
    assert json.loads((folder / "metrics.json").read_text(encoding="utf-8"))["kind"] == "computed"
    assert faults(folder / "report.html") == []


def test_static_point_over_a_few_flights(reports: Path, faults: Faults) -> None:
    folder = run("static-point", reports, seeds=4, parallel=2)
    found = values(folder)
    for column in (
        "observer",
        "pixhawk-autopilot",
        "without-time-synchronization",
        "without-misalignment-calibration",
    ):
        for name in ("mean_north", "mean_east", "sd_north", "sd_east", "mae"):
            metric = found[name, column]
            assert metric["low"] <= metric["value"] <= metric["high"]
            assert metric["published"] is not None
    content = json.loads((folder / "metrics.json").read_text(encoding="utf-8"))
    assert (content["kind"], content["seeds"], len(content["claims"])) == ("twin", 4, 10)
    assert json.loads((folder / "provenance.json").read_text())["seeds"]["seeds"] == [1, 2, 3]
    for figure in ("02", "03a", "03b", "04a", "04b", "05a", "05b", "06", "07"):
        assert (folder / "figures" / f"fig-5-{figure}.pdf").is_file()
        assert (folder / "figures" / f"fig-5-{figure}.png").is_file()
    assert faults(folder / "report.html") == []


def test_the_velocity_of_a_ship_at_rest_comes_out_of_flow(reports: Path, faults: Faults) -> None:
    folder = run("optical-flow-velocity", reports, seeds=2, first_look=True)
    found = values(folder)
    assert found["feature_rate", "images"]["published"] is not None
    for axis in ("north", "east"):
        assert abs(found[f"mean_{axis}", "true-poses"]["value"]) < 1.0
        assert found[f"sd_{axis}", "true-poses"]["value"] < found[f"sd_{axis}", "logged"]["value"]
    content = json.loads((folder / "metrics.json").read_text(encoding="utf-8"))
    assert (content["kind"], content["seeds"], len(content["claims"])) == ("twin", 2, 6)
    for figure in ("path", "gimbal", "features", "flow", "velocity", "readings"):
        assert (folder / "figures" / f"{figure}.png").is_file()
    assert faults(folder / "report.html") == []


def test_vessels_are_looked_for_on_two_flights(reports: Path, faults: Faults) -> None:
    folder = run("vessel-detection", reports, seeds=2)
    found = values(folder)
    for name, subject in (
        ("detection_rate", "ship"),
        ("detection_rate", "boats-whole"),
        ("false_alarms_per_image", "ship"),
        ("false_alarms_per_image", "boats"),
    ):
        metric = found[name, subject]
        assert metric["low"] <= metric["value"] <= metric["high"]
        assert metric["published"] is not None
    content = json.loads((folder / "metrics.json").read_text(encoding="utf-8"))
    assert (content["kind"], content["seeds"], len(content["claims"])) == ("twin", 2, 5)
    for figure in ("rates", "steps-ship", "steps-boats-whole", "shares", "heights", "contrast", "weather"):
        assert (folder / "figures" / f"{figure}.png").is_file()
    assert faults(folder / "report.html") == []


@pytest.mark.parametrize(
    ("study", "claims", "figures"),
    [
        ("uav-coverage", 9, ("fig-7-12a", "fig-7-12d", "age", "gap", "detected", "land")),
        ("gondola-coverage", 6, ("fig-7-15", "fig-7-16", "fig-7-17", "fig-7-18")),
    ],
)
def test_what_plans_cover_is_seen_by_flights(
    study: str, claims: int, figures: tuple[str, ...], reports: Path, faults: Faults
) -> None:
    folder = run(study, reports, seeds=2, first_look=True)
    held = [m for (name, _), m in values(folder).items() if name == "held"]
    assert held and all(metric["value"] >= 0.95 for metric in held)
    content = json.loads((folder / "metrics.json").read_text(encoding="utf-8"))
    assert (content["kind"], content["seeds"], len(content["claims"])) == ("twin", 2, claims)
    for figure in figures:
        assert (folder / "figures" / f"{figure}.png").is_file()
    assert faults(folder / "report.html") == []


def test_a_tarpaulin_is_looked_for_on_one_flight(reports: Path, faults: Faults) -> None:
    folder = run("precision-drop", reports, seeds=1)
    found = values(folder)
    assert found["detections", "mean"]["value"] == 75
    assert 0 < found["error", "mean"]["value"] < 15
    content = json.loads((folder / "metrics.json").read_text(encoding="utf-8"))
    assert (content["kind"], content["seeds"], len(content["claims"])) == ("twin", 1, 6)
    for figure in ("found", "horizon", "mean", "scatter"):
        assert (folder / "figures" / f"{figure}.png").is_file()
    assert faults(folder / "report.html") == []


def test_two_worlds_are_searched_by_every_planner(reports: Path, faults: Faults) -> None:
    folder = run("information-planning", reports, seeds=2)
    found = values(folder)
    for planner in ("information", "information-down", "rows", "rows-swing", "chance"):
        metric = found["all_found", planner]
        assert 0 < metric["low"] <= metric["value"] <= metric["high"] <= 1200
    assert found["tour_time", "look-ahead"]["value"] <= found["tour_time", "greedy"]["value"]
    content = json.loads((folder / "metrics.json").read_text(encoding="utf-8"))
    assert (content["kind"], content["seeds"], len(content["claims"])) == ("twin", 2, 9)
    for figure in ("share-found", "times", "way-information", "way-rows", "way-chance", "greedy"):
        assert (folder / "figures" / f"{figure}.png").is_file()
    assert faults(folder / "report.html") == []


def test_animals_are_looked_for_in_four_kinds_of_weather(reports: Path, faults: Faults) -> None:
    folder = run("wildlife-detection", reports, seeds=2)
    found = values(folder)
    for weather in ("night", "morning", "noon", "cloudy"):
        metric = found[f"recall_{weather}", "subtracted"]
        assert metric["low"] <= metric["value"] <= metric["high"] and metric["n"] == 6
    content = json.loads((folder / "metrics.json").read_text(encoding="utf-8"))
    assert (content["kind"], content["seeds"], len(content["claims"])) == ("twin", 2, 17)
    for figure in ("methods-noon", "sequence", "blocks-offset-65", "weather-recall", "heights"):
        assert (folder / "figures" / f"{figure}.png").is_file()
    assert faults(folder / "report.html") == []


def test_a_large_ship_is_tracked_on_two_flights(reports: Path, faults: Faults) -> None:
    folder = run("large-ship", reports, seeds=2)
    found = values(folder)
    for subject in ("with-adjustment", "without-adjustment"):
        for name in ("mean_north", "mean_east", "sd_north", "sd_east", "mae", "mae_after_start"):
            metric = found[name, subject]
            assert metric["low"] <= metric["value"] <= metric["high"]
            assert metric["published"] is not None
    assert found["detection_rate", "detector"]["published"] == 0.993
    content = json.loads((folder / "metrics.json").read_text(encoding="utf-8"))
    assert (content["kind"], content["seeds"], len(content["claims"])) == ("twin", 2, 11)
    for figure in ("fig-6-2", "fig-6-3", "fig-6-4"):
        assert (folder / "figures" / f"{figure}.png").is_file()
    assert faults(folder / "report.html") == []


def test_crossing_vessels_are_told_apart_on_two_flights(reports: Path, faults: Faults) -> None:
    folder = run("crossing-vessels", reports, seeds=2)
    found = values(folder)
    assert found["wrong_rate_boat_1", "with-features"]["published"] == 0.0033
    assert found["wrong", "with-features"]["value"] < found["wrong", "without-features"]["value"]
    assert found["wrong", "separation-6"]["value"] < found["wrong", "separation-0"]["value"]
    content = json.loads((folder / "metrics.json").read_text(encoding="utf-8"))
    assert (content["kind"], content["seeds"], len(content["claims"])) == ("twin", 2, 10)
    for figure in ("fig-6-21", "fig-6-23", "separation"):
        assert (folder / "figures" / f"{figure}.png").is_file()
    assert faults(folder / "report.html") == []


def test_both_kinds_of_detections_are_tracked_on_two_flights(reports: Path, faults: Faults) -> None:
    folder = run("end-to-end-fast", reports, seeds=2)
    found = values(folder)
    assert found["pixel_rms", "rendered"]["value"] < found["pixel_rms", "drawn"]["value"]
    assert found["detection_rate", "rendered"]["value"] > 0.9
    assert {who for name, who in found if name == "mae"} >= {"drawn-kf", "rendered-kf", "rendered-coloured"}
    content = json.loads((folder / "metrics.json").read_text(encoding="utf-8"))
    assert (content["kind"], content["seeds"], len(content["claims"])) == ("twin", 2, 4)
    for figure in ("frame", "pixels", "tracks"):
        assert (folder / "figures" / f"{figure}.png").is_file()
    assert faults(folder / "report.html") == []


def test_the_line_of_sight_is_looked_at_on_two_lands(reports: Path, faults: Faults) -> None:
    folder = run("line-of-sight", reports, seeds=2)
    found = values(folder)
    assert 0.8 < found["agreement_60m", "bresenham"]["value"] < 1
    assert found["seen_60m", "by-the-letter"]["value"] == 0
    content = json.loads((folder / "metrics.json").read_text(encoding="utf-8"))
    assert (content["kind"], content["seeds"], len(content["claims"])) == ("twin", 2, 8)
    for figure in ("agreement", "map", "times", "steps", "trees"):
        assert (folder / "figures" / f"{figure}.png").is_file()
    assert faults(folder / "report.html") == []


def test_survey_markers_beside_the_published_accuracy(
    reports: Path, tmp_path: Path, shared_data: Callable[..., Path], faults: Faults
) -> None:
    raw = shared_data("georeferencing", "openathena")
    import_flight(DATA / "recipes" / "openathena.toml", raw, tmp_path / "flight")
    folder = run("survey-markers", reports, flight=tmp_path / "flight")
    found = values(folder)
    assert {name for name, other in found if other == "logged-pose"} == ACCURACY
    gain = found["gain", "winner"]
    certain = gain["low"] > 0
    of_cause = {name for name, other in found if other == "calibrated-pose"}
    assert of_cause == (ACCURACY - {"ellipse_coverage_90"} if certain else set())
    assert gain["low"] <= gain["value"] <= gain["high"]
    assert found["horizontal_error_mean", "logged-pose"]["value"] <= 5.6
    assert found["horizontal_error_median", "logged-pose"]["value"] <= 5.2
    assert found["horizontal_error_p90", "logged-pose"]["value"] <= 9.1
    assert found["horizontal_error_mean", "recorded-answers"]["value"] == pytest.approx(9.05, abs=0.05)
    assert faults(folder / "report.html") == []


def test_a_flight_with_labelled_markers_is_evaluated(
    reports: Path, tmp_path: Path, shared_data: Callable[..., Path], faults: Faults
) -> None:
    raw = shared_data("georeferencing", "openathena-f1")
    import_flight(DATA / "recipes" / "openathena-f1.toml", raw, tmp_path / "flight")
    _, outcome = evaluate_flight(tmp_path / "flight", reports=reports)
    found = values(outcome.folder)
    assert found["horizontal_error_mean", "logged-pose"]["value"] <= 3.0
    assert found["horizontal_error_mean", "logged-pose"]["n"] == 103
    before, after = (
        found["ellipse_coverage_90", subject]["value"]
        for subject in ("logged-pose", "logged-pose/estimated-noise")
    )
    assert 0.8 <= after <= before <= 1.0
    assert outcome.folder is not None
    assert faults(outcome.folder / "report.html") == []


def test_a_flight_without_a_camera_is_evaluated_by_its_navigation(
    reports: Path, tmp_path: Path, shared_data: Callable[..., Path], faults: Faults
) -> None:
    raw = shared_data("logs", "umn_thor75")
    import_flight(DATA / "recipes" / "umn-thor75.toml", raw, tmp_path / "flight")
    _, outcome = evaluate_flight(tmp_path / "flight", reports=reports)
    assert outcome.name == "umn-thor75-navigation"
    found = values(outcome.folder)
    # In the air, which nobody had to point out: rotations about the axes of the body, in degrees.
    for axis, most in (("roll", 1.0), ("pitch", 1.0), ("yaw", 2.0)):
        assert found[f"rms_{axis}", "mekf"]["value"] < most
        assert found[f"rms_{axis}", "observer"]["value"] < 2 * most
    assert outcome.folder is not None
    assert faults(outcome.folder / "report.html") == []


def test_sensors_of_a_ferry_judged_on_one_scenario(
    reports: Path, tmp_path: Path, shared_data: Callable[..., Path], faults: Faults
) -> None:
    raw = shared_data("tracking", "autoferry")
    import_flight(DATA / "recipes" / "autoferry-17.toml", raw, tmp_path / "flight")
    folder = run("autoferry", reports, flight=tmp_path / "flight")
    found = values(folder)
    content = json.loads((folder / "metrics.json").read_text(encoding="utf-8"))
    assert len(content["claims"]) == 8
    names = {name for name, subject in found if subject == "radar/havfruen/scenario-17/coloured"}
    assert {"rmse", "anees", "anis", "lag1_autocorrelation_north", "fraction_nees_inside"} <= names
    assert "lag1_autocorrelation" in {
        name for name, subject in found if subject == "eo/jet-boat/scenario-17/ekf"
    }
    counts = [
        one
        for (name, subject), one in found.items()
        if subject.endswith("/all-sensors") and name.startswith("tracks_")
    ]
    assert {sum(one["value"] for one in counts)} == {one["n"] for one in counts}
    assert (folder / "figures" / "map-scenario-17.png").is_file()
    assert faults(folder / "report.html") == []


def test_gating_beside_the_print(reports: Path, faults: Faults) -> None:
    folder = run("gating", reports)
    found = values(folder)
    for form in ("position", "pixels", "angles"):
        own, assigned = (found["success_rate", f"{form}{fed}"] for fed in ("", "/updated-with-assigned"))
        assert own["published"] is not None and assigned["n"] == own["n"] == 10_000
        assert assigned["published"] is None and assigned["value"] < own["value"]
        assert abs(own["value"] - own["published"]) <= 2.0
        assert found["success_rate_se", form]["value"] < 0.5
    assert found["success_rate", "pixels-and-angles"]["n"] == 10_000
    for figure in ("17a", "17b", "18a", "18b", "19a", "19b"):
        assert (folder / "figures" / f"fig-6-{figure}.png").is_file()
    assert faults(folder / "report.html") == []


TRACKED = {
    "linear-vs-nonlinear-fast": {"kf", "ekf"},
    "linear-vs-nonlinear-slow": {"kf", "ekf"},
    "coloured-noise-fast": {"cv", "singer", "coloured"},
    "coloured-noise-drifting": {"cv", "singer", "coloured"},
    "schmidt-fast-vessel": {"ekf", "schmidt"},
    "schmidt-slow-vessel-eight": {"ekf", "schmidt"},
    "schmidt-drifting-vessel-eight": {"ekf", "schmidt"},
}


@pytest.mark.parametrize("study", TRACKED)
def test_tracks_of_a_vessel_over_a_few_flights(study: str, reports: Path, faults: Faults) -> None:
    folder = run(study, reports, seeds=3, parallel=2)
    found = values(folder)
    for subject in TRACKED[study]:
        for name in ("mean_north", "mean_east", "mae", "nees", "nis"):
            metric = found[name, subject]
            assert metric["low"] <= metric["value"] <= metric["high"]
            assert metric["published"] is not None
    content = json.loads((folder / "metrics.json").read_text(encoding="utf-8"))
    assert content["seeds"] == 3
    assert content["claims"]
    assert faults(folder / "report.html") == []


@pytest.mark.parametrize(
    "study", ["navigation-fast-vessel", "navigation-slow-vessel-eight", "navigation-drifting-vessel-eight"]
)
def test_navigation_beside_the_published_deviations(study: str, reports: Path, faults: Faults) -> None:
    folder = run(study, reports, seeds=2, parallel=2)
    found = values(folder)
    for axis in ("north", "east", "down", "roll", "pitch", "yaw"):
        assert found[f"mean_sd_{axis}", "mekf-published-like"]["published"] is not None
    assert {"nees_position", "nees_attitude", "rms_yaw"} <= {name for name, who in found if who == "mekf"}
    assert faults(folder / "report.html") == []


@pytest.mark.parametrize(
    ("dataset", "study"), [("umn_thor75", "navigation-thor75"), ("inertialnav_x8", "navigation-x8")]
)
def test_navigation_of_a_logged_flight(
    dataset: str, study: str, reports: Path, tmp_path: Path, shared_data: Callable[..., Path], faults: Faults
) -> None:
    raw = shared_data("logs", dataset)
    import_flight(DATA / "recipes" / f"{dataset.replace('_', '-')}.toml", raw, tmp_path / "flight")
    folder = run(study, reports, flight=tmp_path / "flight")
    content = json.loads((folder / "metrics.json").read_text(encoding="utf-8"))
    assert content["kind"] == "logged"
    assert {metric["subject"].split("/")[0] for metric in content["metrics"]} >= {"mekf", "observer"}
    assert faults(folder / "report.html") == []


def test_slow_vessel_over_a_few_flights(reports: Path, faults: Faults) -> None:
    folder = run("slow-vessel", reports, seeds=3, parallel=2)
    content = json.loads((folder / "metrics.json").read_text(encoding="utf-8"))
    assert sum(metric["published"] is not None for metric in content["metrics"]) == 20
    assert content["claims"]
    assert faults(folder / "report.html") == []


def test_the_ledger_of_all_of_them(reports: Path, faults: Faults) -> None:
    page = reports / "ledger.html"
    assert "42 published numbers: 34 agree, 8 differ" in page.read_text(encoding="utf-8")
    assert faults(page) == []
    front = reports / "index.html"
    # Beside its marks; the count above is of all studies that are done.
    assert '<span class="said">34 agree, 8 differ</span>' in front.read_text(encoding="utf-8")
    assert faults(front) == []
