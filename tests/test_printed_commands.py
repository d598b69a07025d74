"""Commands that pages, help texts and the README print are ones that can be typed."""

from __future__ import annotations

import re
import shlex
from pathlib import Path
from typing import Any

import click
import pytest

from wildlab.cli import main, wildlab
from wildlab.files import write_atomic, write_json
from wildlab.flight.store import load_flight, save_flight
from wildlab.paths import ROOT
from wildlab.runner import evaluate, track
from wildlab.runner.catalogue import load_studies
from wildlab.runner.processes.job import FILES, Job
from wildlab.runner.record.digests import seal
from wildlab.runner.record.provenance import provenance_of_flight
from wildlab.sharing.reports import sources_of
from wildlab.simulation.twins import simulate_twin

#: In backticks, as HTML, or on a line of its own; what stands two blanks behind it is an explanation.
_PRINTED = re.compile(r"(?:`|<code>|^ {4,8})wildlab ([a-z][a-z-]*(?: [^`<\n]*?)?)(?:`|<| {2,}|$)", re.M)


def printed() -> list[str]:
    assert ROOT is not None
    folders = [ROOT / "wildlab", ROOT / "data", ROOT / "docs"]
    files = [file for folder in folders for file in (*folder.rglob("*.py"), *folder.rglob("*.md"))]
    files += [ROOT / "README.md", *(ROOT / "notebooks").glob("*.ipynb")]
    found = [command for file in files for command in _PRINTED.findall(file.read_text(encoding="utf-8"))]
    return sorted({command.strip() for command in found if "{" not in command and "..." not in command})


def test_every_command_that_is_printed_can_be_typed():
    commands, wrong = printed(), []
    assert len(commands) > 60
    for command in commands:
        name, *arguments = shlex.split(command, comments=True)
        if name not in wildlab.commands:
            wrong.append(command)
        elif arguments:
            try:
                wildlab.commands[name].make_context(name, arguments)
            except click.UsageError as error:
                # A text may name a command with an option alone, and its files are not here.
                named = isinstance(error, click.MissingParameter) or "requires an argument" in error.message
                if not named and "does not exist" not in error.message:
                    wrong.append(f"{command}: {error.message}")
    assert wrong == []


@pytest.mark.slow
@pytest.mark.parametrize("twin", ["slow-vessel", "static-antenna", "gondola", "uav-search"])
def test_a_simulated_flight_is_evaluated_tracked_and_shared_as_it_is(twin, tmp_path, monkeypatch):
    """A vessel, a known point, a wildlife twin and a survey twin: what would run, and under which name."""
    monkeypatch.chdir(tmp_path)
    folder, reports = Path("flights/trial"), tmp_path / "reports"
    save_flight(simulate_twin(twin, 1, without=("imu", "gnss")), folder)
    jobs: list[Job] = []

    def keep(job: Job, *_: Any, **__: Any) -> None:
        jobs.append(job)

    def keep_all(passes: list[list[Job]], *_: Any, **__: Any) -> list[Any]:
        jobs.extend(job for one in passes for job in one)
        return []

    monkeypatch.setattr(track, "run_alone", keep)
    monkeypatch.setattr(evaluate, "run_all", keep_all)
    evaluate.evaluate_flight(folder, reports=reports)
    track.track_flight(folder, reports=reports)
    assert {job.name for job in jobs} == {"trial", "trial-tracking", "trial-overview"}
    assert {job.parameters["source"] for job in jobs} <= {"autopilot", ""}
    assert all("flights/trial" in job.again for job in jobs)
    # The flight's own folder stands for its reports.
    for job in jobs:
        (reports / job.name).mkdir(parents=True, exist_ok=True)
        write_atomic(reports / job.name / "report.html", "<p>x</p>")
        about = {"flight": provenance_of_flight(folder), "parameters": job.parameters}
        write_json(reports / job.name / "provenance.json", about)
        seal(reports / job.name, {"state": "done"}, FILES)
    assert ROOT is not None
    (source,), left_out = sources_of(folder, load_studies(ROOT / "notebooks" / "studies.toml"), reports)
    assert source.name == "trial" == load_flight(folder).name and not left_out
    assert {one.name for one in source.folders} == {job.name for job in jobs}


@pytest.mark.slow
def test_the_front_pages_own_commands_run(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    out = str(tmp_path / "reports")
    for line in (
        "simulate large-ship --out flights/trial",
        f"evaluate flights/trial --out {out}",
        f"track flights/trial --out {out}/trial-tracking",
        f"replay flights/trial --out {out}/trial-replay",
        f"share {out}/trial",
    ):
        with pytest.raises(SystemExit) as ended:
            main(line.split())
        assert ended.value.code == 0, line
    assert (tmp_path / "flight-public.html").is_file()
