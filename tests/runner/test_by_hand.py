"""Study notebooks opened by hand, with no flight and no parameter given: they get their own."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import nbformat
import papermill
import pytest

from tests.figure_text import seen_figures
from tests.notebooks import run_here
from wildlab.errors import WildlabError
from wildlab.flight.catalog import is_fetched
from wildlab.paths import NOTEBOOKS
from wildlab.runner import catalogue as flights
from wildlab.runner.catalogue import StudyEntry, load_studies
from wildlab.runner.open_study import open_study
from wildlab.runner.shell import CellError

STUDIES = load_studies(NOTEBOOKS / "studies.toml")


@pytest.fixture
def made(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> list[tuple[Any, ...]]:
    """What flights were made of; each is a small one of its own."""
    calls: list[tuple[Any, ...]] = []

    def make(*given: Any) -> Path:
        calls.append(given)
        return tmp_path / str(len(calls))

    monkeypatch.setattr(flights, "twin_flight", make)
    monkeypatch.setattr(flights, "dataset_flight", make)
    monkeypatch.setattr("wildlab.flight.store.load_flight", lambda folder: folder)
    return calls


def test_a_study_by_hand_makes_its_own_twin(made, tmp_path):
    assert flights.flight_for("schmidt-fast-vessel", "", 7) == tmp_path / "1"
    assert made == [("fast-vessel", 7, flights.REPORTS)]


def test_a_study_by_hand_imports_all_flights_of_its_data_set(made):
    study = STUDIES["autoferry"]
    assert len(flights.flights_for("autoferry", "", [], 1)) == 1 + len(study.beside)
    assert [recipe for _, recipe, _ in made] == [study.recipe, *study.beside]
    assert {dataset for dataset, _, _ in made} == {"autoferry"}


OF_FLIGHTS = {
    "repeat-sightings.ipynb": "gating",
    "overview.ipynb": "large-ship",
    "tracking.ipynb": "large-ship",
    "tracking-many.ipynb": "large-ship",
}


def by_notebook() -> dict[str, StudyEntry]:
    """The study that each notebook shows by hand, the one that its parameters name; not of `OF_FLIGHTS`,
    which belong to no study."""
    found = {}
    for path in sorted(NOTEBOOKS.glob("*.ipynb")):
        if path.name in OF_FLIGHTS:
            continue
        cells = nbformat.read(path, as_version=4).cells
        parameters = next(cell.source for cell in cells if "parameters" in cell.metadata.get("tags", []))
        name = next(line.split('"')[1] for line in parameters.splitlines() if line.startswith("study = "))
        found[path.name] = STUDIES[name]
    return found


def test_every_study_notebook_names_a_study_that_it_shows():
    shown = by_notebook()
    assert {name: study.notebook for name, study in shown.items()} == {name: name for name in shown}
    assert set(shown) == {study.notebook for study in STUDIES.values()}


@pytest.mark.slow
@pytest.mark.parametrize("name", ["sensitivity.ipynb", "overview.ipynb", "tracking.ipynb"])
def test_a_notebook_runs_by_hand(name, tmp_path, monkeypatch):
    study = STUDIES[OF_FLIGHTS[name]] if name in OF_FLIGHTS else by_notebook()[name]
    monkeypatch.setenv("IPYTHONDIR", str(tmp_path / ".ipython"))
    # What it makes and computes is kept there, and not among the reports of this checkout.
    kept = tmp_path / "reports"
    monkeypatch.setattr("wildlab.paths.REPORTS", kept)
    monkeypatch.setattr(flights, "REPORTS", kept)
    monkeypatch.setattr("wildlab.runner.open_study.REPORTS", kept)

    if study.dataset is not None and not is_fetched(study.dataset):
        with pytest.raises(CellError, match=f"wildlab fetch {study.dataset}"):
            run_here(name)
        return
    drawn: dict[str, list[str]] = {}
    with seen_figures(drawn):
        shown = run_here(name)
    assert {figure: faults for figure, faults in drawn.items() if faults} == {}
    assert any("<h1>" in str(output.get("text/html", "")) for output in shown)
    assert {path.parts[len(kept.parts)] for path in kept.rglob("*") if path.is_file()} == {
        *((".flights",) if study.twin or study.recipe else ()),
        *((".seeds",) if study.shown_case() and name not in OF_FLIGHTS else ()),
    }, "by hand no report is written"


@pytest.mark.slow
def test_a_kernel_of_jupyter_runs_a_notebook_too():
    """As JupyterLab does; all others run without one."""
    shown = papermill.execute_notebook(
        nbformat.read(NOTEBOOKS / "consistency-bounds.ipynb", as_version=4),
        None,
        kernel_name="python3",
        language="python",
        progress_bar=False,
        cwd=NOTEBOOKS,
    )
    outputs = [output for cell in shown.cells for output in cell.get("outputs", [])]
    assert outputs and not any(output.output_type == "error" for output in outputs)


def test_a_report_on_an_own_flight_is_of_the_study_that_its_name_begins_with():
    own = open_study("autoferry-many-mine", flight="flights/mine")
    assert (own.name, own.entry.name) == ("autoferry-many-mine", "autoferry-many")
    with pytest.raises(WildlabError, match="no study"):
        open_study("autoferry-many-mine")
