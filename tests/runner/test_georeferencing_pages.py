"""The page of a flight that is lost and contradicts itself: made all the same, and not green."""

import pytest

from tests.analysis.survey_twin import Survey, simulate
from tests.notebooks import run_here
from wildlab.flight.manifest import replace_in_manifest
from wildlab.flight.store import save_flight


@pytest.mark.slow
@pytest.mark.parametrize("sensitivity", ["open", "withheld"])
def test_what_does_not_fit_together_is_said_and_names_no_place(tmp_path, sensitivity):
    flight = simulate(Survey(images=8))
    changes = {"mount": {"tilt_deg": 120.0}, "locations": {"sensitivity": sensitivity}}
    flight.manifest = replace_in_manifest(flight.manifest, changes)
    save_flight(flight, tmp_path / "flight")
    (tmp_path / "out").mkdir()
    shown = run_here(
        "georeferencing.ipynb", study="flight", flight=str(tmp_path / "flight"), out=str(tmp_path / "out")
    )
    text = "".join(str(one.get("text/html", "")) for one in shown)
    assert 'class="summary bad"' in text and "40 points" in text
    # What the check proposes; where the flight was is nowhere.
    origin = flight.manifest.origin
    assert "-90 deg" in text
    assert not any(f"{one:.3f}" in text for one in (origin.latitude_deg, origin.longitude_deg))
