"""Pages of flights that are hopeless, lack truth, or come with a calibration: done, and the page says so."""

import numpy as np
import pytest

from tests.pipeline.survey_twin import Survey, simulate
from wildlab.flight.learnt import write_learnt
from wildlab.flight.manifest import replace_in_manifest
from wildlab.flight.store import save_flight
from wildlab.pipeline.georeference import observe
from wildlab.pipeline.learn import learn_flight
from wildlab.runner.evaluate import evaluate_flight

pytestmark = pytest.mark.slow


def page(flight, folder, **more):
    save_flight(flight, folder / "flight")
    _, outcome = evaluate_flight(folder / "flight", reports=folder / "reports", **more)
    assert outcome.state == "done", outcome.reason
    return (outcome.folder / "report.html").read_text(encoding="utf-8")


def test_all_lost_is_an_outcome_with_a_sentence(tmp_path):
    flight = simulate(Survey(images=8))
    flight.manifest = replace_in_manifest(flight.manifest, {"mount": {"tilt_deg": 120.0}})
    text = page(flight, tmp_path)
    assert "None of the 40 points has a position" in text
    assert 'class="summary bad"' in text and "typically" not in text


def test_without_truth_the_scatter_is_judged_and_no_error_claimed(tmp_path):
    flight = simulate(Survey(images=12))
    del flight.tables["truth"]
    text = page(flight, tmp_path)
    assert "Sightings of the same thing" in text and "cannot be said without known points" in text
    assert "typically" not in text and "The cause" not in text


def test_without_truth_too_a_flight_that_contradicts_itself_says_so_first(tmp_path):
    """It says that it flies north where it goes south."""
    flight = simulate(Survey(images=12))
    del flight.tables["truth"]
    nav = flight.nav["logged"]
    for axis, sign in (("north", -1.0), ("east", 1.0), ("down", 1.0)):
        nav[f"v_{axis}_m_s"] = sign * np.gradient(nav[f"{axis}_m"], nav["time_s"])
    text = page(flight, tmp_path)
    assert "contradict each other: one thing does not fit" in text and "What does not fit together" in text
    assert 'class="summary bad"' in text


def test_the_page_says_which_calibration_and_names_no_folder(tmp_path):
    first = simulate(Survey(tilt_deg=5.0, images=18))
    first.manifest = replace_in_manifest(first.manifest, {"name": "tuesday"})
    write_learnt(learn_flight(first, np.random.default_rng(0))[0], tmp_path / "c.toml")
    text = page(simulate(Survey(tilt_deg=5.0, images=18, seed=5)), tmp_path, calibration=tmp_path / "c.toml")
    assert "learnt on the flight tuesday" in text
    assert "flown again" not in text
    for path in (tmp_path / "reports").rglob("*.json"):
        assert str(tmp_path) not in path.read_text(encoding="utf-8")


@pytest.mark.parametrize("shown", ["open", "withheld"])
def test_what_does_not_fit_together_stands_first(tmp_path, shown):
    flight = simulate(Survey(images=12))
    changes = {"mount": {"looks": "down"}, "locations": {"sensitivity": shown}}
    flight.manifest = replace_in_manifest(flight.manifest, changes)
    text = page(flight, tmp_path)
    assert 'class="summary bad"' in text and "contradict each other" in text
    assert ("looks = &quot;forward&quot;" in text or 'looks = "forward"' in text) == (shown == "open")
    assert ("says which" in text) == (shown == "withheld")


def test_views_that_nothing_was_judged_in_are_not_said_to_be_covered(tmp_path):
    flight = simulate(Survey(images=12))
    seen = observe(flight)
    depression = np.degrees(np.arcsin(seen.poses.R_nc[:, 2, 2]))
    flat = depression < 45
    flight.detections.loc[flat, "target_id"] = ""
    text = page(flight, tmp_path)
    assert f"flatter views than {depression[~flat].min():.0f}°" in text
    assert f"flatter views than {depression.min():.0f}°" not in text
