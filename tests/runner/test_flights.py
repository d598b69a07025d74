"""The flights studies need: kept until their source changes; absent data are a sentence, not a failure."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from tests.flight.conftest import make_flight
from tests.notebooks import OPEN, notebook, write
from wildlab.errors import WildlabError
from wildlab.files import write_json
from wildlab.flight.store import Flight, load_flight, save_flight
from wildlab.runner import catalogue as flights
from wildlab.runner.evaluate import evaluate_flight, refuse_other_flight
from wildlab.runner.provenance import provenance_of_flight
from wildlab.runner.run import run_studies

__all__ = ["make_flight"]

SHOW = (
    'report.head("Title")\nfrom wildlab.flight.store import load_flight\n'
    'report.metric("frames", "all", len(load_flight(flight).frames), "")\nreport.save()'
)


@pytest.fixture
def simulated(monkeypatch: pytest.MonkeyPatch, make_flight: Callable[..., Flight]) -> list[tuple[str, int]]:
    calls: list[tuple[str, int]] = []

    def simulate(name: str, seed: int) -> Flight:
        calls.append((name, seed))
        return make_flight()

    monkeypatch.setattr("wildlab.simulation.twins.simulate_twin", simulate)
    return calls


def test_a_twin_is_simulated_once_per_seed(tmp_path, simulated):
    one = flights.twin_flight("antenna", 1, tmp_path)
    assert flights.twin_flight("antenna", 1, tmp_path) == one == tmp_path / ".flights" / "antenna-1"
    flights.twin_flight("antenna", 2, tmp_path)
    assert simulated == [("antenna", 1), ("antenna", 2)]
    assert load_flight(one).name == "antenna-1"
    assert {path.name for path in one.parent.iterdir()} == {
        *("antenna-1", "antenna-1.key", "antenna-2", "antenna-2.key")
    }


def test_it_is_simulated_again_when_its_parameters_change(tmp_path, simulated, monkeypatch):
    monkeypatch.setattr(flights, "DATA", tmp_path / "data")
    (tmp_path / "data" / "twins").mkdir(parents=True)
    flights.twin_flight("antenna", 1, tmp_path)
    (tmp_path / "data" / "twins" / "antenna.toml").write_text("height_m = 350")
    flights.twin_flight("antenna", 1, tmp_path)
    assert len(simulated) == 2
    (tmp_path / "data" / "twins" / "parts").mkdir()
    (tmp_path / "data" / "twins" / "parts" / "camera.toml").write_text("shared by twins")
    flights.twin_flight("antenna", 1, tmp_path)
    assert len(simulated) == 3


def studies(folder: Path) -> Path:
    write(folder, "georeferencing.ipynb", notebook(OPEN, SHOW, more='source = ""\namiss = None'))
    own = OPEN.replace("3.0", "4.0")
    write(
        folder,
        "overview.ipynb",
        notebook(own, SHOW, more='beside = []\nlacking = []\nsource = ""\namiss = None'),
    )
    text = '[s]\ntitle = "S"\nnotebook = "georeferencing.ipynb"\n'
    text += 'dataset = "openathena"\nrecipe = "openathena.toml"\n'
    (folder / "studies.toml").write_text(text)
    return folder


def test_absent_data_are_skipped_or_an_error(tmp_path, monkeypatch):
    monkeypatch.setattr("wildlab.flight.catalog.is_fetched", lambda name: False)
    where: dict[str, Any] = {"notebooks": studies(tmp_path / "notebooks"), "reports": tmp_path / "reports"}
    (outcome,) = run_studies(everything=True, **where)
    assert outcome.state == "skipped" and "wildlab fetch openathena" in outcome.reason
    with pytest.raises(WildlabError, match="wildlab fetch openathena") as caught:
        run_studies(["s"], **where)
    assert caught.value.exit_code == 2


@pytest.mark.slow
def test_any_flight_folder_can_be_evaluated(tmp_path, make_flight):
    folder = tmp_path / "tuesday"
    save_flight(make_flight(), folder)
    where: dict[str, Any] = {"notebooks": studies(tmp_path / "notebooks"), "reports": tmp_path / "reports"}
    overview, outcome = evaluate_flight(folder, **where)
    assert overview.state == outcome.state == "done", (overview.reason, outcome.reason)
    assert overview.folder == (tmp_path / "reports" / "tuesday-overview").resolve()
    assert outcome.folder == (tmp_path / "reports" / "tuesday").resolve()
    content = json.loads((outcome.folder / "metrics.json").read_text())
    assert content["metrics"][0]["value"] == 3
    assert "tuesday/report.html" in (tmp_path / "reports" / "index.html").read_text(encoding="utf-8")
    origin = json.loads((outcome.folder / "provenance.json").read_text())["flight"]
    assert origin["name"] == "tuesday" and "flight.toml" in origin["files"]
    # The place of a flight whose locations are withheld gets into nothing that is written.
    for path in outcome.folder.rglob("*"):
        assert not path.is_file() or b"63.4" not in path.read_bytes()
    (outcome,) = run_studies(["s"], flight=folder, **where)
    assert outcome.state == "done" and outcome.name == "s-tuesday"


@pytest.mark.parametrize(
    "cell",
    [
        pytest.param("report.save()", marks=pytest.mark.slow),
        pytest.param("raise RuntimeError(flight)", marks=pytest.mark.slow),
        # A folder beside the flight. A failure quotes this line: it must not hold the name looked for.
        "load_flight(flight[:-7] + 'monday')",
    ],
)
def test_no_folder_of_a_flight_gets_into_a_report(tmp_path, make_flight, cell):
    """Of where it lies only its own folder's name, by which it and its reports are called."""
    folder = tmp_path / "north-gate" / "october"
    save_flight(make_flight(), folder)
    show = f'from wildlab.flight.store import load_flight\nprint(flight)\nreport.head("A")\n{cell}'
    begin = OPEN.replace("flight=flight", "flight='x'")
    write(tmp_path / "notebooks", "n.ipynb", notebook(begin, show))
    (tmp_path / "notebooks" / "studies.toml").write_text('[s]\ntitle = "S"\nnotebook = "n.ipynb"\n')
    (outcome,) = run_studies(["s"], flight=folder, notebooks=tmp_path / "notebooks", reports=tmp_path / "out")
    assert (outcome.state == "done") == (cell == "report.save()"), outcome.reason
    assert outcome.folder == (tmp_path / "out" / "s-october").resolve()
    left = [path for path in (tmp_path / "out").rglob("*") if path.is_file()]
    assert {"status.json", "notebook.ipynb", "report.html"} <= {path.name for path in left}
    for path in left:
        content = path.read_bytes()
        assert b"north-gate" not in content and bytes(tmp_path) not in content, path
        # One name, also where the flight is printed: not a second one out of its manifest.
        assert b"small-flight" not in content, path


def test_poses_that_are_not_there_are_told_before_anything_runs(tmp_path, make_flight):
    flight = make_flight()
    first = next(iter(flight.nav.values()))
    flight.nav = {"autopilot": first, "observer": first, "truth": first}
    save_flight(flight, tmp_path / "flight")
    where: dict[str, Any] = {"notebooks": studies(tmp_path / "notebooks"), "reports": tmp_path / "reports"}
    with pytest.raises(WildlabError, match="no nav source 'mekf'") as caught:
        evaluate_flight(tmp_path / "flight", source="mekf", **where)
    assert "--source observer or autopilot" in caught.value.fix
    assert not (tmp_path / "reports").exists()


def test_a_flight_named_like_a_study_would_replace_its_report(tmp_path, make_flight):
    save_flight(make_flight(), tmp_path / "s")
    with pytest.raises(WildlabError, match="like a study"):
        evaluate_flight(tmp_path / "s", notebooks=studies(tmp_path / "notebooks"), reports=tmp_path / "out")


def test_folders_whose_names_differ_have_reports_of_their_own(tmp_path, make_flight):
    for folder in ("Flight A", "Flight B"):
        save_flight(make_flight(name="card"), tmp_path / folder)
    names = {load_flight(tmp_path / folder).name for folder in ("Flight A", "Flight B")}
    assert len(names - {"card"}) == 2


def left_report(flight: Path, reports: Path) -> None:
    """What a report on a flight is told by, as a run leaves it."""
    refuse_other_flight(flight, reports / "tuesday")
    write_json(reports / "tuesday" / "provenance.json", {"flight": provenance_of_flight(flight)})


def shifted(flight: Flight, *, but: str = "") -> Flight:
    """Another flight: all numbers of its tables differ."""
    for name, table in (*flight.nav.items(), *flight.tables.items()):
        if name != but:
            numbers = [one for one in map(str, table) if table[one].dtype == float and one[:2] != "q_"]
            table[numbers] = table[numbers] + 0.25
    return flight


def test_the_report_of_another_flight_of_the_same_name_is_not_replaced(tmp_path, make_flight):
    reports, one, other = tmp_path / "reports", tmp_path / "may" / "tuesday", tmp_path / "june" / "tuesday"
    (reports / "tuesday").mkdir(parents=True)
    save_flight(make_flight(), one)
    left_report(one, reports)
    # The same flight, corrected: its clock, and one table of several.
    again = make_flight(clocks={"camera_offset_s": 0.1})
    again.tables["frames"]["time_s"] += 0.5
    save_flight(again, one, overwrite=True)
    left_report(one, reports)

    save_flight(shifted(make_flight()), other)
    where: dict[str, Any] = {"notebooks": studies(tmp_path / "notebooks"), "reports": reports}
    with pytest.raises(WildlabError, match="another flight"):
        evaluate_flight(other, **where)
    refuse_other_flight(other, tmp_path / "elsewhere" / "tuesday")


def test_flights_that_share_marks_and_terrain_alone_are_two(tmp_path, make_flight):
    reports, one, other = tmp_path / "reports", tmp_path / "may" / "tuesday", tmp_path / "june" / "tuesday"
    (reports / "tuesday").mkdir(parents=True)
    raw = {name: {"file": f"{name}.bin", "sha256": name * 64} for name in "abc"}
    save_flight(make_flight(sources=[raw["a"], raw["b"]]), one)
    left_report(one, reports)
    # Another log, with the same true places of the same marks, and their file.
    save_flight(shifted(make_flight(sources=[raw["b"], raw["c"]]), but="truth"), other)
    with pytest.raises(WildlabError, match="share none"):
        refuse_other_flight(other, reports / "tuesday")
    # Imported again with one file more it is the same flight, whatever its tables are now.
    more = make_flight(sources=list(raw.values()))
    again = load_flight(other)
    save_flight(Flight(more.manifest, again.nav, again.tables), other, overwrite=True)
    left_report(other, reports)
