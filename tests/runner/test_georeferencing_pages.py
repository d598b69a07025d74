"""Pages of flights that are hopeless or contradict themselves: made all the same, and not green."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.notebooks import run_here
from tests.pipeline.survey_twin import Survey, simulate
from wildlab.flight.manifest import replace_in_manifest
from wildlab.flight.store import Flight, save_flight

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
    assert 'class="summary bad"' in text and "40 points" in text


def test_what_does_not_fit_together_stands_first_and_withholds_which(tmp_path: Path) -> None:
    flight = simulate(Survey(images=12))
    changes = {"mount": {"looks": "down"}, "locations": {"sensitivity": "withheld"}}
    flight.manifest = replace_in_manifest(flight.manifest, changes)
    text = page(flight, tmp_path)
    assert 'class="summary bad"' in text
    assert "looks = &quot;forward&quot;" not in text and 'looks = "forward"' not in text
