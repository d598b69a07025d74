"""Run studies: one process per notebook, a time limit, and outputs that appear whole or not at all.

A run works in a folder beside its report's. Only when it is over are the files moved into
``reports/<name>/``, and ``status.json`` comes last: as long as it is not there, nothing beside it is to be
trusted. A failed run leaves a page that says so; a run that is broken off (Ctrl-C) leaves the former report
as it was.
"""

from __future__ import annotations

import multiprocessing
import os
import tempfile
import time
from collections.abc import Callable, Sequence
from contextlib import nullcontext
from dataclasses import dataclass
from datetime import UTC, datetime
from multiprocessing import connection
from multiprocessing.context import SpawnProcess
from pathlib import Path
from typing import Any

from rich.console import Console

from wildlab.errors import WildlabError
from wildlab.paths import NOTEBOOKS, REPORTS
from wildlab.reporting.checks import check_notebook, plain_parameters
from wildlab.reporting.job import Failure, Job, end_tree, work
from wildlab.reporting.ledger import build_ledger
from wildlab.reporting.outputs import clear, install, leave_failure, log_of, sweep
from wildlab.reporting.progress import outcome_line, shown
from wildlab.reporting.studies import STANDARD_PARAMETERS, Study, find_study, load_studies

#: The notebook that judges any flight.
EVALUATION = "georeferencing.ipynb"


@dataclass(frozen=True)
class Outcome:
    """How a run ended: ``state`` is "done", "failed" or "skipped"; ``reason`` says why in a sentence."""

    name: str
    state: str
    seconds: float
    reason: str = ""
    folder: Path | None = None


#: Called with (name, "start" | "stage" | "cell" | "end", what).
Listener = Callable[[str, str, Any], None]


def make_job(
    study: Study,
    *,
    seed: int | None = None,
    flight: Path | None = None,
    reports: Path = REPORTS,
    notebooks: Path = NOTEBOOKS,
    timeout_s: float | None = None,
    name: str | None = None,
    again: str | None = None,
) -> Job:
    """The job that runs a study, checked as far as it can be before it starts.

    Parameters
    ----------
    flight
        A flight folder to use in place of the study's own.
    name
        Name of the report's folder; the study's if not given.
    again
        What to type to run it again, where that is not `wildlab run STUDY`.

    Raises
    ------
    WildlabError
        As `check_notebook` and `plain_parameters`.
    """
    notebook = notebooks / study.notebook
    parameters = plain_parameters(study.parameters)
    check_notebook(notebook, [*STANDARD_PARAMETERS, *parameters])
    reports = reports.resolve()
    name = name or study.name
    own = flight is None
    return Job(
        name=name,
        title=study.title,
        notebook=str(notebook.resolve()),
        work=str(reports / f".{name}.{os.getpid()}.part"),
        runtime=str(_socket_folder() / f"wl{os.getpid()}-{os.urandom(4).hex()}"),
        reports=str(reports),
        seed=study.seed if seed is None else seed,
        flight="" if flight is None else str(flight.resolve()),
        twin=study.twin if own else None,
        dataset=study.dataset if own else None,
        recipe=study.recipe if own else None,
        parameters=parameters,
        again=again or f"wildlab run {study.name}" + ("" if flight is None else f" --flight {flight.name}"),
        timeout_s=study.timeout_minutes * 60 if timeout_s is None else timeout_s,
    )


def run_studies(
    names: Sequence[str] = (),
    *,
    everything: bool = False,
    seed: int | None = None,
    flight: Path | None = None,
    reports: Path = REPORTS,
    notebooks: Path = NOTEBOOKS,
    parallel: int = 1,
    timeout_s: float | None = None,
    console: Console | None = None,
) -> list[Outcome]:
    """Run studies by name, or all, and rebuild the ledger.

    Parameters
    ----------
    everything
        Run all studies. One whose public data are not here is skipped, and says so; asked for by name, it
        is an error.
    flight
        A flight folder for the one study named, in place of its own; its report is then named
        ``<study>-<flight>``.
    console
        Where progress is shown; nowhere if not given.

    Returns
    -------
    list of Outcome
        One per study, also of those that failed: a study that fails does not stop the others.

    Raises
    ------
    WildlabError
        Before anything runs, if a study is not known or cannot be run as it is written.
    """
    studies = load_studies(notebooks / "studies.toml")
    chosen = (
        list(studies.values()) if everything else [find_study(name, studies) for name in dict.fromkeys(names)]
    )
    if not chosen:
        raise WildlabError("no study was named", "name one (see: wildlab list), or say --all")
    report = None
    if flight is not None:
        if len(chosen) != 1:
            raise WildlabError("a flight goes with one study", "name one study", field="--flight")
        report = f"{chosen[0].name}-{_flight_name(flight)}"
    jobs, skipped = [], []
    for study in chosen:
        absent = _absent_data(study) if flight is None else None
        if absent is not None and everything:
            skipped.append(Outcome(study.name, "skipped", 0.0, str(absent)))
            continue
        if absent is not None:
            raise absent
        job = make_job(
            study,
            seed=seed,
            flight=flight,
            reports=reports,
            notebooks=notebooks,
            timeout_s=timeout_s,
            name=report,
        )
        jobs.append(job)
    return _run(jobs, skipped, studies, reports, parallel, console)


def evaluate_flight(
    folder: Path,
    *,
    source: str | None = None,
    reports: Path = REPORTS,
    notebooks: Path = NOTEBOOKS,
    timeout_s: float | None = None,
    console: Console | None = None,
) -> Outcome:
    """Judge the georeferencing of a flight folder; the report goes to ``<reports>/<name of the flight>/``.

    Parameters
    ----------
    source
        Which of the flight's poses to judge; not needed where it has one navigation source, or one named
        ``logged``.

    Raises
    ------
    WildlabError
        If the folder is not a usable flight, it is not clear which poses are meant, or its name is that of a
        study.
    """
    from wildlab.flight.store import load_flight

    flight = load_flight(folder)
    name, (source, _) = flight.name, flight.pose_source(source)
    studies = load_studies(notebooks / "studies.toml")
    if name in studies:
        raise WildlabError(
            f"the flight is named {name!r} like a study, whose report it would replace",
            "give the flight another name in flight.toml, or the report another folder with --out",
        )
    job = make_job(
        Study(name="evaluate", title=f"Flight {name}", notebook=EVALUATION, parameters={"source": source}),
        flight=folder,
        reports=reports,
        notebooks=notebooks,
        timeout_s=timeout_s,
        name=name,
        again=f"wildlab evaluate {folder.name} --source {source}",
    )
    return _run([job], [], studies, reports, 1, console)[0]


def _run(
    jobs: list[Job],
    skipped: list[Outcome],
    studies: dict[str, Study],
    reports: Path,
    parallel: int,
    console: Console | None,
) -> list[Outcome]:
    if console is not None:
        for outcome in skipped:
            console.print(outcome_line(outcome), highlight=False, soft_wrap=True)
    with shown(console) if console is not None else nullcontext() as listen:
        outcomes = run_jobs(jobs, parallel=parallel, listen=listen)
    build_ledger(reports, studies)
    return [*outcomes, *skipped]


def _flight_name(folder: Path) -> str:
    from wildlab.flight.store import load_flight

    return str(load_flight(folder).name)


def _absent_data(study: Study) -> WildlabError | None:
    from wildlab.reporting.flights import dataset_source

    if study.dataset is None:
        return None
    try:
        dataset_source(study.dataset)
    except WildlabError as error:
        return error
    return None


def run_jobs(jobs: Sequence[Job], *, parallel: int = 1, listen: Listener | None = None) -> list[Outcome]:
    """Run jobs, ``parallel`` at a time; one that fails does not stop the others.

    Returns
    -------
    list of Outcome
        In the order of ``jobs``.

    Raises
    ------
    KeyboardInterrupt
        After everything started here has been ended and its unfinished files removed.
    """
    tell = listen or (lambda *_: None)
    waiting = list(jobs)
    running: list[_Running] = []
    outcomes: dict[str, Outcome] = {}
    for folder in {Path(job.reports) for job in jobs}:
        folder.mkdir(parents=True, exist_ok=True)
        sweep(folder)
    try:
        while waiting or running:
            while waiting and len(running) < max(1, parallel):
                running.append(_start(waiting.pop(0)))
                tell(running[-1].job.name, "start", None)
            connection.wait([one.pipe for one in running], timeout=0.25)
            for one in list(running):
                if one.over(tell):
                    running.remove(one)
                    outcomes[one.job.name] = _finish(one)
                    tell(one.job.name, "end", outcomes[one.job.name])
    finally:
        for one in running:
            one.end()
            clear(one.job)
    return [outcomes[job.name] for job in jobs]


@dataclass
class _Running:
    job: Job
    process: SpawnProcess
    pipe: connection.Connection
    started: float
    began: str
    cell: int | None = None
    failure: Failure | None = None
    done: bool = False

    def over(self, tell: Listener) -> bool:
        """Read what the process says; True when it is done, failed, gone or out of time."""
        gone = not self.process.is_alive()
        try:
            while not (self.done or self.failure) and self.pipe.poll():
                message = self.pipe.recv()
                if message[0] == "done":
                    self.done = True
                elif message[0] == "failed":
                    self.failure = message[1]
                else:
                    self.cell = message[1] if message[0] == "cell" else self.cell
                    tell(self.job.name, message[0], message[1:])
        except (EOFError, OSError):
            gone = True
        if not (self.done or self.failure):
            if gone:
                self.process.join(5)
                self.failure = self._failure(
                    f"Its process ended without a word (exit code {self.process.exitcode})"
                )
            elif time.monotonic() - self.started > self.job.timeout_s:
                self.failure = self._failure(
                    f"It was stopped at its time limit of {_duration(self.job.timeout_s)}. "
                    "If it only needs longer, give it more: `--timeout MINUTES`"
                )
        if self.done or self.failure:
            self.end()
            return True
        return False

    def _failure(self, reason: str) -> Failure:
        return Failure(f"{reason}.", "", log_of(self.job))

    def end(self) -> None:
        """End the process and all below it. Harmless where it has ended."""
        if self.done or (self.failure and self.process.is_alive()):
            self.process.join(3)
        if self.process.pid is not None and self.process.is_alive():
            end_tree(self.process.pid)
        self.process.join()
        self.pipe.close()


def _start(job: Job) -> _Running:
    clear(job)
    Path(job.work).mkdir(parents=True)
    Path(job.runtime).mkdir(parents=True, mode=0o700)
    context = multiprocessing.get_context("spawn")
    ours, theirs = context.Pipe(duplex=False)
    process = context.Process(target=work, args=(theirs, job), name=f"wildlab {job.name}")
    process.start()
    theirs.close()
    return _Running(job, process, ours, time.monotonic(), datetime.now(UTC).isoformat(timespec="seconds"))


def _finish(one: _Running) -> Outcome:
    """Move the outputs into place and say how it went."""
    job, folder, target = one.job, Path(one.job.work), Path(one.job.reports) / one.job.name
    seconds = round(time.monotonic() - one.started, 1)
    status: dict[str, Any] = {
        "study": job.name,
        "state": "done" if one.done else "failed",
        "reason": one.failure.reason if one.failure else "",
        "started": one.began,
        "finished": datetime.now(UTC).isoformat(timespec="seconds"),
        "seconds": seconds,
    }
    try:
        if one.failure is not None:
            leave_failure(job, one.failure, one.cell, status, folder)
        install(folder, target, status)
    finally:
        clear(job)
    return Outcome(job.name, str(status["state"]), seconds, str(status["reason"]), target)


def _socket_folder() -> Path:
    """Where sockets may lie: their paths must be short, and macOS's temporary folder is not."""
    short = Path("/tmp")  # noqa: S108 - a folder of our own is made in it, readable by us alone
    return short if os.access(short, os.W_OK | os.X_OK) else Path(tempfile.gettempdir())


def _duration(seconds: float) -> str:
    return f"{seconds / 60:g} minutes" if seconds >= 120 else f"{seconds:g} seconds"
