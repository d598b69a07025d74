"""Pages of flights that are hopeless, lack truth, or come with a calibration: done, and the page says so."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from tests.notebooks import run_here
from tests.pipeline.survey_twin import Survey, simulate
from wildlab.flight.learnt import learnt_toml
from wildlab.flight.manifest import replace_in_manifest
from wildlab.flight.store import Flight, save_flight
from wildlab.pipeline.georeference import observe
from wildlab.pipeline.learn import learn_flight

pytestmark = pytest.mark.slow


def page(flight: Flight, folder: Path, notebook: str = "georeferencing.ipynb", **more: str) -> str:
    """What the notebook shows of a flight, as HTML."""
    save_flight(flight, folder / "flight")
    out = folder / "out"
    out.mkdir()
    shown = run_here(notebook, study="flight", flight=str(folder / "flight"), out=str(out), **more)
    return "".join(str(one.get("text/html", "")) for one in shown)


def test_all_lost_is_an_outcome_with_a_sentence(tmp_path: Path) -> None:
    flight = simulate(Survey(images=8))
    flight.manifest = replace_in_manifest(flight.manifest, {"mount": {"tilt_deg": 120.0}})
    text = page(flight, tmp_path)
    assert "None of the 40 points has a position" in text
    assert 'class="summary bad"' in text and "typically" not in text


def test_without_truth_the_scatter_is_judged_and_what_contradicts_itself_comes_first(tmp_path: Path) -> None:
    """It says that it flies north where it goes south."""
    flight = simulate(Survey(images=12))
    del flight.tables["truth"]
    nav = flight.nav["logged"]
    for axis, sign in (("north", -1.0), ("east", 1.0), ("down", 1.0)):
        nav[f"v_{axis}_m_s"] = sign * np.gradient(nav[f"{axis}_m"], nav["time_s"])
    text = page(flight, tmp_path, "repeat-sightings.ipynb", source="logged")
    assert "Sightings of the same thing" in text and "cannot be said without known points" in text
    assert "contradict each other: one thing does not fit" in text and "What does not fit together" in text
    assert 'class="summary bad"' in text and "typically" not in text


def test_the_page_says_which_calibration(tmp_path: Path) -> None:
    first = simulate(Survey(tilt_deg=5.0, images=18))
    first.manifest = replace_in_manifest(first.manifest, {"name": "tuesday"})
    learnt = learnt_toml(learn_flight(first, np.random.default_rng(0))[0])
    text = page(simulate(Survey(tilt_deg=5.0, images=18, seed=5)), tmp_path, calibration=learnt)
    assert "learnt on the flight tuesday" in text and "flown again" not in text


def test_what_does_not_fit_together_stands_first_and_withholds_which(tmp_path: Path) -> None:
    flight = simulate(Survey(images=12))
    changes = {"mount": {"looks": "down"}, "locations": {"sensitivity": "withheld"}}
    flight.manifest = replace_in_manifest(flight.manifest, changes)
    text = page(flight, tmp_path)
    assert 'class="summary bad"' in text and "contradict each other" in text and "says which" in text
    assert "looks = &quot;forward&quot;" not in text and 'looks = "forward"' not in text


def test_views_that_nothing_was_judged_in_are_not_said_to_be_covered(tmp_path: Path) -> None:
    flight = simulate(Survey(images=12))
    depression = np.degrees(np.arcsin(observe(flight).poses.R_nc[:, 2, 2]))
    flat = depression < 45
    flight.detections.loc[flat, "target_id"] = ""
    text = page(flight, tmp_path)
    assert f"flatter views than {depression[~flat].min():.0f}°" in text
    assert f"flatter views than {depression.min():.0f}°" not in text
