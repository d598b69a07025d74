"""`wildlab compare`, and the page of all flights evaluated here: by made-up reports, and one evaluation."""

from __future__ import annotations

import json
import re
import shutil
from pathlib import Path
from typing import Any

import pandas as pd
import pytest
from bs4 import BeautifulSoup

from tests.commands import refuse, succeed
from tests.sharing.left import leave_report
from wildlab.flight.store import save_flight
from wildlab.reporting.comparison import QUANTITIES
from wildlab.reporting.metrics import metric
from wildlab.runner.ledger import build_ledger, own_flights
from wildlab.simulation.twins import simulate_twin


def leave(
    reports: Path,
    flight: str,
    end: str = "-overview",
    *,
    numbers: dict[tuple[str, str], float | dict[str, float]] | None = None,
    lacking: tuple[str, ...] = (),
    state: str = "done",
) -> None:
    """What a run leaves behind, without the run."""
    entries = [
        metric(name, subject, unit="m", **(value if isinstance(value, dict) else {"value": value}))
        for (name, subject), value in (numbers or {}).items()
    ]
    told = {"lacking": list(lacking)}
    leave_report(reports / f"{flight}{end}", flight, metrics=entries, parameters=told, state=state)


def counts(problems: int, worth: int, troubled: int, judged: int, length: float = 600.0) -> dict[Any, Any]:
    values = {"problems": problems, "worth_fixing": worth, "troubled": troubled, "reports_beside": judged}
    return {(name, "flight"): value for name, value in (values | {"duration": length}).items()}


@pytest.fixture
def reports(tmp_path: Path) -> Path:
    """Three flights: one whole, one of which only navigation could be judged, one that failed."""
    folder = tmp_path / "reports"
    error = {("horizontal_error_mean", "logged-pose"): {"value": 3.2, "low": 2.8, "high": 3.7, "n": 90},
             ("ellipse_coverage_90", "logged-pose"): {"value": 0.71, "n": 90}}  # fmt: skip
    leave(folder, "monday", numbers=counts(0, 1, 0, 1))
    leave(folder, "monday", "", numbers=error)
    lacking = ("georeferencing (it lacks truth)",)
    leave(folder, "tuesday", numbers=counts(0, 0, 0, 1, 7300.0), lacking=lacking)
    leave(folder, "tuesday", "-navigation", numbers={("rms_yaw", "mekf"): 2.5})
    leave(folder, "friday", numbers=counts(2, 0, 0, 0))
    leave(folder, "friday", "", state="failed")
    return folder


def test_the_page_and_the_table_have_every_flight(reports):
    folders = [reports / f"{name}-overview" for name in ("monday", "tuesday", "friday")]
    out = succeed("compare", *folders, "--reports", reports)
    assert out.strip().endswith("comparison/report.html")
    page = (reports / "comparison" / "report.html").read_text(encoding="utf-8")
    assert "<script" not in page and not re.search("https?:", page)
    table = pd.read_csv(reports / "comparison" / "flights.csv").set_index("flight")
    assert list(table.index) == ["monday", "tuesday", "friday"]
    assert table.loc["monday", ["error_mean_m", "error_mean_m_n"]].tolist() == [3.2, 90]
    assert table.loc["tuesday", ["verdict", "yaw_deg"]].tolist() == ["sound", 2.5]
    assert "truth" in table.loc["tuesday", "error_mean_m_why"]
    assert "failed" in table.loc["friday", "error_mean_m_why"]
    for quantity in QUANTITIES:
        known = table[quantity.key].notna()
        assert (table[f"{quantity.key}_why"].isna() == known).all(), quantity.key


def test_into_another_folder_has_no_links_that_lead_nowhere(reports, tmp_path):
    folders = [reports / "monday", reports / "tuesday-overview"]
    out = succeed("compare", *folders, "--reports", reports, "--out", tmp_path / "a" / "b")
    assert out.strip().endswith("a/b/report.html")
    soup = BeautifulSoup((tmp_path / "a" / "b" / "report.html").read_text(encoding="utf-8"), "html.parser")
    links = [str(link["href"]) for link in soup.find_all("a")]
    assert any(link.startswith("data:text/csv") for link in links)
    assert all(link.startswith(("#", "data:text/csv")) for link in links)


@pytest.mark.parametrize(
    ("named", "said"),
    [
        (("monday-overview",), "nothing to compare"),
        (("monday-overview", "monday"), "twice"),
        (("monday-overview", "nowhere"), "neither a flight"),
    ],
)
def test_what_cannot_be_compared_is_refused(reports, named, said):
    err = refuse("compare", *(reports / name for name in named), "--reports", reports)
    assert said in err.lower()
    assert not (reports / "comparison").exists()


def test_names_out_of_logs_are_only_text(reports):
    (reports / "monday-overview" / "provenance.json").write_text(
        json.dumps({"flight": {"name": "<b>x", "kind": "<i>"}, "parameters": {"lacking": ["<script>"]}})
    )
    build_ledger(reports, {})
    succeed("compare", reports / "monday-overview", reports / "tuesday-overview", "--reports", reports)
    for page in (reports / "flights.html", reports / "comparison" / "report.html"):
        text = page.read_text(encoding="utf-8")
        assert "&lt;b&gt;x" in text and "<b>x" not in text and "<script" not in text and "<i>" not in text


def test_the_list_of_flights_links_their_reports_and_leaves_studies_out(reports):
    (reports / "schmidt-monday").mkdir()
    for name in ("status.json", "provenance.json", "report.html", "metrics.json"):
        (reports / "schmidt-monday" / name).write_text((reports / "monday-overview" / name).read_text())
    flights = {one.name: one for one in own_flights(reports, ("schmidt", "friday"))}
    assert {name: len(one.reports) for name, one in flights.items()} == {
        "monday": 2, "tuesday": 2, "friday": 1,
    }  # fmt: skip
    (one,) = flights["friday"].reports
    assert one.about == "overview" and flights["friday"].verdict == "mend first"
    shutil.rmtree(reports / "schmidt-monday")
    build_ledger(reports, {})
    page = (reports / "flights.html").read_text(encoding="utf-8")
    for link in ("monday-overview", "monday", "tuesday-navigation", "friday"):
        assert f'href="{link}/report.html"' in page
    assert 'href="index.html"' in page
    assert 'href="flights.html"' in (reports / "index.html").read_text(encoding="utf-8")
    assert page.index('href="monday-overview/') < page.index('href="monday/')


@pytest.mark.parametrize("damage", ["status.json", "provenance.json", "metrics.json"])
def test_a_damaged_report_does_not_spoil_the_list(reports, damage):
    (reports / "monday-overview" / damage).write_text("{")
    build_ledger(reports, {})
    page = (reports / "flights.html").read_text(encoding="utf-8")
    assert "tuesday" in page and "friday" in page


@pytest.mark.slow
def test_a_flight_without_reports_is_evaluated_first(reports, tmp_path):
    flight = simulate_twin("large-ship", 1)
    for name in ("detections", "truth", "frames"):
        flight.tables.pop(name, None)
    save_flight(flight, tmp_path / "flight")
    succeed("compare", tmp_path / "flight", reports / "monday", "--reports", reports)
    made = (reports / "flight-overview" / "status.json").stat().st_mtime_ns
    assert "georeferencing" in (reports / "comparison" / "report.html").read_text(encoding="utf-8")
    succeed("compare", tmp_path / "flight", reports / "monday", "--reports", reports)
    assert (reports / "flight-overview" / "status.json").stat().st_mtime_ns == made
