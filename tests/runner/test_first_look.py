"""First looks: which pass runs what, what each page says, and when the ledger is written."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import pytest

from tests.notebooks import OPEN, notebook, write
from wildlab.paths import NOTEBOOKS
from wildlab.runner import run as running
from wildlab.runner.catalogue import FIRST_LOOK_SEEDS, load_studies
from wildlab.runner.job import Job
from wildlab.runner.run import THERE, has_whole_report, make_job, run_studies
from wildlab.runner.scheduling import Outcome

STUDIES = load_studies(NOTEBOOKS / "studies.toml")


def jobs(reports: Path, *names: str) -> tuple[list[Job], dict[str, Job]]:
    """The full jobs of studies, and those first looks that take less."""
    whole = [make_job(STUDIES[name], reports=reports) for name in names]
    looks = [make_job(STUDIES[name], reports=reports, first_look=True) for name in names]
    return whole, {look.name: look for look in looks if look.first_look}


def leave_report(job: Job, **more: Any) -> None:
    folder = Path(job.reports) / job.name
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "report.html").write_text("report")
    status = {"state": "done", "seconds": 3.0, "first_look": job.first_look, "fingerprint": job.fingerprint}
    (folder / "status.json").write_text(json.dumps(status | more))


def test_a_first_look_takes_fewer_flights_and_the_same_ones(tmp_path):
    (whole,), looks = jobs(tmp_path, "static-point")
    look = looks["static-point"]
    assert look.first_look == {"seeds": (FIRST_LOOK_SEEDS, 100)} and whole.first_look == {}
    assert (look.parameters["seeds"], whole.parameters["seeds"]) == (FIRST_LOOK_SEEDS, 100)
    assert look.seeds is not None and whole.seeds is not None
    assert look.seed == whole.seed and len(look.seeds.seeds) == FIRST_LOOK_SEEDS - 1
    assert set(look.seeds.seeds) <= set(whole.seeds.seeds) and look.seeds.folder == whole.seeds.folder
    assert look.fingerprint != whole.fingerprint


def test_a_quick_study_has_no_first_look_nor_has_one_whose_flights_are_given(tmp_path):
    assert jobs(tmp_path, "sensitivity", "consistency-bounds")[1] == {}
    look = make_job(STUDIES["static-point"], reports=tmp_path, seeds=7, first_look=True)
    assert look.first_look == {"seeds": (7, 100)} and look.parameters["seeds"] == 7
    assert look.again == "wildlab run static-point", "which gives the full numbers"
    for enough in (100, 101):
        assert make_job(STUDIES["static-point"], reports=tmp_path, seeds=enough).first_look == {}


def test_whatever_is_not_the_full_report_of_the_same_gives_way(tmp_path):
    (whole,), _ = jobs(tmp_path, "gating")
    others: list[dict[str, Any]] = [
        {"fingerprint": "another"},
        {"state": "failed"},
        {"first_look": {"runs": [500, 10000]}},
    ]
    for more in others:
        leave_report(whole, **more)
        assert not has_whole_report(whole)
    leave_report(whole)
    assert has_whole_report(whole)
    (tmp_path / "gating" / "report.html").unlink()
    assert not has_whole_report(whole)
    (tmp_path / "gating" / "status.json").write_text("[]")
    assert not has_whole_report(whole)


class Studies:
    """Studies in ``folder`` whose jobs only leave a status; notes what was run, and what the ledger said."""

    def __init__(self, folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
        self.notebooks, self.reports = folder / "notebooks", folder / "reports"
        self.passes: list[list[tuple[str, dict[str, Any]]]] = []
        self.ledgers: list[str] = []
        #: Break off (Ctrl-C) before this many jobs are done.
        self.stop_after = 99
        entries = []
        for name, few in (("slow", True), ("quick", False), ("other", True)):
            write(self.notebooks, f"{name}.ipynb", notebook(OPEN, more="runs = 1"))
            entries.append(f'[{name}]\ntitle = "{name}"\nnotebook = "{name}.ipynb"\n')
            entries.append(f"{'' if name == 'quick' else 'twin = ' + chr(34) + 'large-ship' + chr(34)}\n")
            entries.append(f"[{name}.parameters]\nruns = 9\n" + f"[{name}.first_look]\nruns = 2\n" * few)
        (self.notebooks / "studies.toml").write_text("".join(entries))
        monkeypatch.setattr(running, "run_jobs", self.run_jobs)
        monkeypatch.setattr(running, "code_key", lambda: "of the code")

    def ledger(self) -> str:
        return (self.reports / "ledger.html").read_text(encoding="utf-8")

    def run_jobs(self, given: Sequence[Job], *, listen: Any, **_: Any) -> list[Outcome]:
        self.passes.append([])
        for job in given:
            self.ledgers.append(self.ledger())
            if sum(map(len, self.passes)) == self.stop_after:
                raise KeyboardInterrupt
            self.passes[-1].append((job.name, job.first_look))
            leave_report(job)
            content = {"study": job.name, "flight": "", "kind": "twin", "seed": 1, "seeds": None}
            (self.reports / job.name / "metrics.json").write_text(
                json.dumps(content | {"metrics": [], "claims": []})
            )
            listen(job.name, "end", Outcome(job.name, "done", 1.0))
        return [Outcome(job.name, "done", 1.0, "look" if job.first_look else "whole") for job in given]

    def run(self, *names: str, **more: Any) -> list[Outcome]:
        return run_studies(names, notebooks=self.notebooks, reports=self.reports, **more)

    def both(self) -> None:
        """First looks at all, then the full numbers."""
        self.run(everything=True, first_look=True)
        self.run(everything=True)


@pytest.fixture
def studies(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Studies:
    return Studies(tmp_path, monkeypatch)


LOOK = {"runs": (2, 9)}


def test_of_all_studies_those_run_whose_full_report_is_not_there(studies):
    studies.both()
    assert studies.passes == [[("quick", {}), ("slow", LOOK), ("other", LOOK)], [("slow", {}), ("other", {})]]
    studies.passes.clear()
    outcomes = studies.run(everything=True)
    assert studies.passes == [] and {(one.state, one.reason) for one in outcomes} == {("skipped", THERE)}
    studies.run("slow", "quick")
    assert studies.passes == [[("slow", {}), ("quick", {})]]


def test_a_first_look_alone(studies):
    studies.run(everything=True, first_look=True)
    assert studies.passes == [[("quick", {}), ("slow", LOOK), ("other", LOOK)]]
    studies.passes.clear()
    studies.run("other", first_look=True)
    assert studies.passes == [[("other", LOOK)]]
    studies.run("other")
    studies.passes.clear()
    (outcome,) = studies.run("other", first_look=True)
    assert studies.passes == [] and (outcome.state, outcome.reason) == ("skipped", THERE)
    assert "first look" not in studies.ledger().partition('id="other"')[2].partition("</section>")[0]


def test_the_ledger_is_there_before_anything_and_after_each_study_that_takes_a_while(studies, monkeypatch):
    monkeypatch.setattr(running, "LEDGER_EVERY_S", -1.0)
    studies.both()
    assert [text.count("not run yet") for text in studies.ledgers] == [3, 2, 1, 0, 0]
    # The words stand on the page itself and in the tile that counts them.
    looks = [text.count('class="look"') for text in [*studies.ledgers, studies.ledger()]]
    assert looks == [0, 0, 1, 2, 1, 0]
    assert "2 of 9 runs" in studies.ledgers[2] and "1 / 3</b>" in studies.ledgers[2]
    assert "3 / 3</b>" in studies.ledger()


def test_of_quick_studies_the_ledger_is_written_at_the_end(studies):
    studies.both()
    assert [text.count("not run yet") for text in studies.ledgers] == [3, 3, 3, 0, 0]
    assert "3 / 3</b>" in studies.ledger()


def test_broken_off_the_ledger_says_what_is_there(studies):
    studies.stop_after = 4
    with pytest.raises(KeyboardInterrupt):
        studies.both()
    assert "2 / 3</b>" in studies.ledger() and studies.ledger().count('class="look"') == 1
    studies.stop_after = 99
    studies.passes.clear()
    studies.run(everything=True)
    assert "3 / 3</b>" in studies.ledger()
    assert studies.passes == [[("other", {})]], "what is there is left alone"
