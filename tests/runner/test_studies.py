"""Every study, run as a user runs it: its promised metrics and figures, its trial, its page in a browser."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
import pytest

from tests.page_words import MOST_IN_ANSWER, MOST_WORDS, words_in_sight
from tests.studies.claims import checks_of
from wildlab.evaluation.consistency import white_bound
from wildlab.flight.importing import import_flight
from wildlab.paths import DATA
from wildlab.reporting.published import load_claims, load_published
from wildlab.runner.catalogue import StudyEntry, load_studies
from wildlab.runner.evaluate import evaluate_flight
from wildlab.runner.run import run_studies
from wildlab.sharing.allow_list import read_part
from wildlab.studies.navigation import TUNINGS
from wildlab.studies.printed_numbers import all_pairs
from wildlab.studies.protocol import run_trial, split_keys

pytestmark = pytest.mark.slow

STUDIES = load_studies()
Faults = Callable[[Path], list[str]]
#: The metrics of a report by (name, subject).
Values = Mapping[tuple[str, str], Mapping[str, Any]]


@pytest.fixture
def reports(tmp_path: Path) -> Path:
    return tmp_path / "reports"


def values(folder: Path | None) -> Values:
    assert folder is not None
    content = json.loads((folder / "metrics.json").read_text(encoding="utf-8"))
    return {(m["name"], m["subject"]): m for m in content["metrics"]}


def run(name: str, reports: Path, **kwargs: Any) -> Path:
    (outcome,) = run_studies([name], reports=reports, **kwargs)
    assert outcome.state == "done", outcome.reason
    assert outcome.folder is not None
    if "flight" not in kwargs:  # which may be one of several that are printed
        printed, claims = load_published(name), load_claims(name)
        assert set(zip(printed["name"], printed["subject"], strict=True)) <= set(values(outcome.folder))
        content = json.loads((outcome.folder / "metrics.json").read_text(encoding="utf-8"))
        assert {claim["id"] for claim in claims} <= {claim["id"] for claim in content["claims"]}
    return outcome.folder


class Page(NamedTuple):
    """What a study's page is made from, and holds.

    Attributes
    ----------
    seeds
        Over how many flights, at a first look; None where it has none.
    figures
        That have to be there, as PNG.
    judge
        Of the metrics, besides what `run` asks of all.
    """

    seeds: int | None = None
    figures: tuple[str, ...] = ()
    judge: Callable[[Values], None] | None = None


def has_intervals(found: Values) -> None:
    for metric in found.values():
        if metric["published"] is not None and metric["low"] is not None:
            assert metric["low"] <= metric["value"] <= metric["high"]


def sensitivity(found: Values) -> None:
    metrics = [m for (name, _), m in found.items() if name == "horizontal_error"]
    assert len(metrics) == 42 and all(abs(m["value"] - m["published"]) <= 0.15 for m in metrics)
    assert {m["subject"].split("/")[0] for m in metrics} == {"level", "turn", "ascent"}
    assert {m["subject"].split("/")[2] for m in metrics} == {"100m", "400m"}


def camera(found: Values) -> None:
    for name in ("fx", "fy", "cx", "cy"):
        one = found[name, "tau2"]
        assert one["value"] == pytest.approx(one["published"], rel=0.005), name


def printed_numbers(found: Values) -> None:
    assert {subject: m["value"] for (name, subject), m in found.items() if name == "ratio"} == pytest.approx(
        {pair.key: pair.ratio for pair in all_pairs()}
    )


def gating(found: Values) -> None:
    for form in ("position", "pixels", "angles"):
        own = found["success_rate", form]
        assert own["n"] == STUDIES["gating"].first_look["runs"]
        assert abs(own["value"] - own["published"]) <= 2.0 + 3 * found["success_rate_se", form]["value"]


def flow(found: Values) -> None:
    for axis in ("north", "east"):
        assert abs(found[f"mean_{axis}", "true-poses"]["value"]) < 1.0
        assert found[f"sd_{axis}", "true-poses"]["value"] < found[f"sd_{axis}", "logged"]["value"]


def covered(found: Values) -> None:
    seen = {who: m["value"] for (name, who), m in found.items() if name == "seen"}
    assert len(seen) > 3 and all(0 < share <= 1 for share in seen.values())


def drop(found: Values) -> None:
    assert 0 < found["error", "mean"]["value"] < 15


def planning(found: Values) -> None:
    for planner in ("information", "information-down", "rows", "rows-swing", "chance"):
        metric = found["all_found", planner]
        assert 0 < metric["low"] <= metric["value"] <= metric["high"] <= 1200
    assert found["tour_time", "look-ahead"]["value"] <= found["tour_time", "greedy"]["value"]


def crossing(found: Values) -> None:
    assert found["wrong", "with-features"]["value"] < found["wrong", "without-features"]["value"]


def end_to_end(found: Values) -> None:
    assert found["pixel_rms", "rendered"]["value"] < found["pixel_rms", "drawn"]["value"]
    assert found["detection_rate", "rendered"]["value"] > 0.9
    assert {who for name, who in found if name == "mae"} >= {"drawn-kf", "rendered-kf", "rendered-coloured"}


def sight(found: Values) -> None:
    assert 0.8 < found["agreement_60m", "bresenham"]["value"] < 1
    assert found["seen_60m", "by-the-letter"]["value"] == 0


def navigation(found: Values) -> None:
    assert {"nees_position", "nees_attitude", "rms_yaw"} <= {name for name, who in found if who == "mekf"}


FIG_5 = ("02", "03a", "03b", "04a", "04b", "05a", "05b", "06", "07")
FIG_6 = ("17a", "17b", "18a", "18b", "19a", "19b")
PAGES = {
    "sensitivity": Page(judge=sensitivity),
    "consistency-bounds": Page(),
    "camera-calibration": Page(judge=camera),
    "wildlife-camera": Page(judge=camera),
    "printed-numbers": Page(judge=printed_numbers),
    "gating": Page(None, tuple(f"fig-6-{one}" for one in FIG_6), gating),
    "static-point": Page(3, tuple(f"fig-5-{one}" for one in FIG_5)),
    "optical-flow-velocity": Page(2, ("path", "gimbal", "features", "flow", "velocity", "readings"), flow),
    "vessel-detection": Page(2, ("rates", "steps-ship", "steps-boats-whole", "shares")),
    "uav-coverage": Page(2, ("shares", "fig-7-12a", "fig-7-12d", "age", "detected"), covered),
    "gondola-coverage": Page(2, ("shares", "fig-7-15", "fig-7-16", "fig-7-17", "fig-7-18"), covered),
    "precision-drop": Page(2, ("found", "horizon", "mean", "scatter"), drop),
    "information-planning": Page(2, ("share-found", "way-information", "way-rows"), planning),
    "wildlife-detection": Page(2, ("sequence", "blocks-offset-65", "weather-recall")),
    "wildlife-tracking": Page(1),
    "large-ship": Page(2, ("fig-6-2", "fig-6-3", "fig-6-4")),
    "crossing-vessels": Page(1, ("fig-6-21", "fig-6-23"), crossing),
    "end-to-end-fast": Page(2, ("frame", "tracks"), end_to_end),
    "line-of-sight": Page(2, ("agreement", "map", "times", "trees"), sight),
    "linear-vs-nonlinear-fast": Page(2),
    "linear-vs-nonlinear-slow": Page(1),
    "coloured-noise-fast": Page(2),
    "coloured-noise-drifting": Page(1),
    "schmidt-fast-vessel": Page(3),
    "schmidt-drifting-vessel-eight": Page(1),
    "navigation-fast-vessel": Page(2, judge=navigation),
    "navigation-drifting-vessel-eight": Page(1, judge=navigation),
    "slow-vessel": Page(2),
    "replay": Page(2),
}
#: What a notebook tells the rules of claims besides the flights; and whom it calls so.
TOLD = {
    "line-of-sight": dict.fromkeys(
        (f"times/{one}" for one in ("ray-casting", "whole-rays", "cheap", "dear")), np.ones(3)
    ),
    "static-point": {"bound": white_bound(551)},
    "information-planning": {"loads": np.full(3, 1e-3)},
    "wildlife-tracking": {"cost": np.full(3, 9.0)},
}
TUNED = {next(iter(TUNINGS)): "tuned"}


@pytest.mark.parametrize("name", PAGES)
def test_a_study_and_its_page(name, reports, faults):
    page, entry = PAGES[name], STUDIES[name]
    folder = run(name, reports, seeds=page.seeds, first_look=True)
    content = json.loads((folder / "metrics.json").read_text(encoding="utf-8"))
    assert content["kind"] == entry.kind
    if page.seeds is not None:
        assert content["seeds"] == page.seeds
    found = values(folder)
    has_intervals(found)
    if page.judge is not None:
        page.judge(found)
    assert read_part(folder / "report.html", 1, exact=False, generalised=False).body, "it may go out"
    words, answer = words_in_sight(folder / "report.html")
    assert words <= MOST_WORDS and answer <= MOST_IN_ANSWER
    assert {f"{one}.png" for one in page.figures} <= {one.name for one in (folder / "figures").glob("*.png")}
    if name == next(one for one in PAGES if STUDIES[one].notebook == entry.notebook):
        assert faults(folder / "report.html") == []
    if name == "sensitivity":
        ledger, front = reports / "ledger.html", reports / "index.html"
        assert "42 published numbers: 42 close" in ledger.read_text(encoding="utf-8")
        assert faults(ledger) == [] and faults(front) == []
    if page.seeds is not None and page.seeds > 1 and name == first_of_case(entry.case):
        trial_gives_what_is_asked(entry, folder)


def first_of_case(case: str) -> str:
    return next(name for name in PAGES if STUDIES[name].case == case)


def trial_gives_what_is_asked(entry: StudyEntry, folder: Path) -> None:
    """The numbers that a process kept of a flight are those of the same flight here, with a name, unit and
    verdict for each that metrics and claims ask for."""
    seeds = json.loads((folder / "provenance.json").read_text(encoding="utf-8"))["seeds"]
    (kept,) = (folder.parent / ".seeds" / entry.name / seeds["key"]).glob(f"{seeds['seeds'][0]}.json")
    numbers = {key: float(one) for key, one in json.loads(kept.read_text())["values"].items()}
    again = run_trial(entry.case, seeds["seeds"][0], seeds["parameters"])
    np.testing.assert_equal(again, numbers)
    case = entry.shown_case()
    assert case is not None
    keys = split_keys(numbers)
    assert any(case.rules.unit_of(name) for _, name in keys)
    spread = pd.DataFrame([{(TUNED.get(who, who), name): one for (who, name), one in keys.items()}] * 3)
    thresholds = {claim["id"]: claim.get("threshold") for claim in load_claims(entry.name)}
    checks = checks_of(str(entry.case), spread, TOLD.get(str(entry.case)))
    assert {claim["id"] for claim in load_claims(entry.name) if "needs" not in claim} <= set(checks)
    for claim, check in checks.items():
        threshold = thresholds.get(claim, 1.0 if check.measured is not None else None)
        array = np.asarray(check.holds(None if threshold is None else float(threshold)))
        assert array.shape == (3,) and array.dtype == bool, claim
        for more in (check.premise, check.first, check.second):
            assert more is None or np.shape(more) == (3,), claim
        assert len(set(array.tolist())) == 1, "the same flight, the same verdict"


def test_every_study_has_its_page_here():
    of_logs = {name for name, entry in STUDIES.items() if entry.recipe is not None}
    # Of one notebook on three flights the first and the longest.
    left_out = {"end-to-end-slow", "navigation-slow-vessel-eight", "schmidt-slow-vessel-eight"}
    assert set(STUDIES) - of_logs - set(PAGES) == left_out


# -- on logged flights -----------------------------------------------------------------------------------


def imported(folder: Path, recipe: str, raw: Path) -> Path:
    """A flight in the folder, named after its recipe: reports of one name are of one flight."""
    import_flight(DATA / "recipes" / f"{recipe}.toml", raw, folder / recipe)
    return folder / recipe


def test_survey_markers_beside_the_published_accuracy(reports, tmp_path, shared_data, faults):
    flight = imported(tmp_path, "openathena", shared_data("georeferencing", "openathena"))
    folder = run("survey-markers", reports, flight=flight)
    found = values(folder)
    sizes = {"mean", "median", "p90", "max"}
    accuracy = {
        *(f"horizontal_error_{one}" for one in sizes),
        *(f"{one}_{axis}" for one in ("bias", "sd") for axis in ("north", "east")),
    }
    assert {name for name, who in found if who == "logged-pose"} == accuracy | {"ellipse_coverage_90"}
    gain = found["gain", "winner"]
    of_cause = {name for name, who in found if who == "calibrated-pose"}
    assert of_cause == (accuracy if gain["low"] > 0 else set())
    assert gain["low"] <= gain["value"] <= gain["high"]
    assert found["horizontal_error_mean", "logged-pose"]["value"] <= 5.6
    assert found["horizontal_error_median", "logged-pose"]["value"] <= 5.2
    assert found["horizontal_error_p90", "logged-pose"]["value"] <= 9.1
    assert found["horizontal_error_mean", "recorded-answers"]["value"] == pytest.approx(9.05, abs=0.05)
    assert faults(folder / "report.html") == []


def test_a_flight_with_labelled_markers_is_evaluated(reports, tmp_path, shared_data, faults):
    flight = imported(tmp_path, "openathena-f1", shared_data("georeferencing", "openathena-f1"))
    _, outcome = evaluate_flight(flight, reports=reports)
    found = values(outcome.folder)
    # On the ground that the other program took; by the markers' surveyed heights it would be 2.8 m.
    assert found["horizontal_error_mean", "logged-pose"]["value"] <= 4.8
    assert found["horizontal_error_mean", "logged-pose"]["n"] == 103
    assert 0.8 <= found["ellipse_coverage_90", "logged-pose"]["value"] <= 1.0
    assert outcome.folder is not None and faults(outcome.folder / "report.html") == []


def test_a_flight_without_a_camera_is_evaluated_by_its_navigation(reports, tmp_path, shared_data, faults):
    flight = imported(tmp_path, "umn-thor75", shared_data("logs", "umn_thor75"))
    _, outcome = evaluate_flight(flight, reports=reports)
    assert outcome.name == "umn-thor75-navigation"
    found = values(outcome.folder)
    # In the air, which nobody had to point out: rotations about the axes of the body, in degrees.
    for axis, most in (("roll", 1.0), ("pitch", 1.0), ("yaw", 2.0)):
        assert found[f"rms_{axis}", "mekf"]["value"] < most
        assert found[f"rms_{axis}", "observer"]["value"] < 2 * most
    assert outcome.folder is not None and faults(outcome.folder / "report.html") == []


def test_navigation_of_a_logged_flight(reports, tmp_path, shared_data, faults):
    flight = imported(tmp_path, "umn-thor75", shared_data("logs", "umn_thor75"))
    folder = run("navigation-thor75", reports, flight=flight)
    content = json.loads((folder / "metrics.json").read_text(encoding="utf-8"))
    assert content["kind"] == "logged"
    assert {metric["subject"].split("/")[0] for metric in content["metrics"]} >= {"mekf", "observer"}
    assert faults(folder / "report.html") == []


def test_sensors_of_a_ferry_judged_on_one_scenario(reports, tmp_path, shared_data, faults):
    flight = imported(tmp_path, "autoferry-17", shared_data("tracking", "autoferry"))
    folder = run("autoferry", reports, flight=flight)
    found = values(folder)
    names = {name for name, subject in found if subject == "radar/havfruen/scenario-17/coloured"}
    assert {"rmse", "anees", "anis", "lag1_autocorrelation", "fraction_nees_inside"} <= names
    assert ("lag1_autocorrelation", "eo/jet-boat/scenario-17/ekf") in found
    counts = [
        one
        for (name, subject), one in found.items()
        if subject.endswith("/all-sensors") and name.startswith("tracks_")
    ]
    assert {sum(one["value"] for one in counts)} == {one["n"] for one in counts}
    assert (folder / "figures" / "map-scenario-17.png").is_file()
    assert faults(folder / "report.html") == []


def test_all_boats_followed_on_one_scenario(reports, tmp_path, shared_data, faults):
    flight = imported(tmp_path, "autoferry-17", shared_data("tracking", "autoferry"))
    folder = run("autoferry-many", reports, flight=flight, first_look=True)
    assert (folder / "figures" / "wrong.png").is_file()
    assert faults(folder / "report.html") == []
