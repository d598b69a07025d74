"""From a folder of reports, and a flight, to the page."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from tests.flight.conftest import make_flight  # noqa: F401 - a fixture of another room
from tests.sharing.left import leave_report
from wildlab.errors import WildlabError
from wildlab.flight.store import Flight
from wildlab.geometry.georeference import georeference_pixels
from wildlab.pipeline.georeference import observe
from wildlab.reporting.metrics import metric
from wildlab.sharing.edition.edition import Place
from wildlab.sharing.edition.flight_map import map_of
from wildlab.sharing.edition.make import make_edition

WITHHELD = Place("withheld")


def leave(folder: Path, **numbers: tuple[str, float]) -> None:
    entries = [metric(name, subject, value, "1", n=50) for name, (subject, value) in numbers.items()]
    leave_report(folder, "f", metrics=entries)


def sound(reports: Path) -> None:
    counts = dict.fromkeys(("problems", "worth_fixing", "troubled", "broken", "alarmed"), ("flight", 0.0))
    leave(reports / "f-overview", **counts, reports_beside=("flight", 1.0))


def test_the_page_of_a_folder_of_reports(tmp_path: Path) -> None:
    sound(tmp_path)
    error = {"horizontal_error_median": ("logged-pose", 6.4), "horizontal_error_p90": ("logged-pose", 9.0)}
    leave(tmp_path / "f", **error)
    html = make_edition(tmp_path, "f", place=WITHHELD, called="flight 1")
    assert "6.4\u00a0metres" in html and "flight 1" in html
    assert "6,4\u00a0meter" in make_edition(tmp_path, "f", place=WITHHELD, language="nb")


def test_a_flight_that_was_not_evaluated(tmp_path: Path) -> None:
    with pytest.raises(WildlabError, match="'g'"):
        make_edition(tmp_path, "g", place=WITHHELD)
    sound(tmp_path)
    with pytest.raises(WildlabError, match=r"some on f\."):
        make_edition(tmp_path, "g", place=WITHHELD)


def test_the_map_of_a_flight(make_flight: Callable[..., Flight], tmp_path: Path) -> None:  # noqa: F811
    flight = make_flight()
    drawn = map_of(flight)
    assert drawn is not None
    nav = flight.nav["autopilot"]
    assert np.array_equal(drawn.path, nav[["north_m", "east_m"]].to_numpy())
    seen = observe(flight, "autopilot")
    expected = georeference_pixels(seen.poses, seen.uv, seen.plane_down)[:, :2]
    assert np.array_equal(drawn.seen, expected, equal_nan=True) and len(drawn.truth) == 3
    sound(tmp_path)
    html = make_edition(tmp_path, "f", place=WITHHELD, flight=flight)
    assert len(re.findall('<path class="way"', html)) == 1 and '<circle class="true"' in html
