"""Run studies: one process per notebook, a time limit, and outputs that appear whole or not at all.

A run works in a folder beside its report's. Only when it is over are the files moved into
``reports/<name>/``, and ``status.json`` comes last: as long as it is not there, nothing beside it is to be
trusted. A failed run leaves a page that says so; a run that is broken off (Ctrl-C) leaves the former report
as it was.
"""

from __future__ import annotations

import contextlib
import fcntl
import multiprocessing
import os
import re
import shutil
import signal
import tempfile
import threading
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from multiprocessing import connection
from multiprocessing.context import SpawnProcess
from pathlib import Path
from typing import Any

import numpy as np

from wildlab.errors import WildlabError
from wildlab.paths import NOTEBOOKS, REPORTS
from wildlab.reporting.failure import failure_page, step_of
from wildlab.reporting.files import write_atomic, write_json
from wildlab.reporting.html import read_notebook
from wildlab.reporting.job import Failure, Job, end_tree, work
from wildlab.reporting.privacy import clean_notebook, clean_text
from wildlab.reporting.studies import STANDARD_PARAMETERS, Study

#: What a run may leave in a report's folder, besides ``figures/``. Anything else there is not ours, and
#: stays.
FILES = ("report.html", "metrics.json", "provenance.json", "notebook.ipynb", "replay.rrd")
_PART = re.compile(r"\.(?P<name>.+)\.(?P<pid>\d+)\.part")


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


def plain_parameters(parameters: Mapping[str, Any]) -> dict[str, Any]:
    """Parameters as papermill can hand them on: str, int, float, bool, None, and lists of these.

    Raises
    ------
    WildlabError
        If one is something else.
    """
    return {name: _plain(value, name) for name, value in parameters.items()}


def _plain(value: Any, name: str) -> Any:
    if value is None or isinstance(value, (str, bool)):
        return value
    if isinstance(value, (os.PathLike,)):
        return os.fspath(value)
    if isinstance(value, np.generic):
        return _plain(value.item(), name)
    if isinstance(value, (int, float)):
        return value
    if isinstance(value, np.ndarray):
        return _plain(value.tolist(), name)
    if isinstance(value, (list, tuple)):
        return [_plain(entry, name) for entry in value]
    raise WildlabError(
        f"the parameter {name!r} is of type {type(value).__name__}",
        "give text, numbers, true/false or a list of these",
    )


def check_notebook(notebook: Path, parameters: Sequence[str]) -> None:
    """Refuse a notebook that would not do as it is told.

    Raises
    ------
    WildlabError
        If the notebook is absent or not one, has no or several cells tagged ``parameters``, or does not
        know one of the parameters. papermill lets all of these pass.
    """
    import papermill

    if not notebook.is_file():
        raise WildlabError(
            "there is no such notebook", "restore it, or name another in studies.toml", file=notebook.name
        )
    node = read_notebook(notebook)
    tagged = sum("parameters" in cell.metadata.get("tags", []) for cell in node.cells)
    if tagged != 1:
        raise WildlabError(
            f"the notebook has {tagged} cells tagged `parameters`", "tag exactly one", file=notebook.name
        )
    node.metadata["kernelspec"] = {"name": "python3", "language": "python", "display_name": "Python 3"}
    known = papermill.inspect_notebook(node)
    for name in parameters:
        if name not in known:
            raise WildlabError(
                f"the notebook has no parameter {name!r}",
                f"it has: {', '.join(known)}; add it to its parameters cell, or take it out of studies.toml",
                file=notebook.name,
            )


def make_job(
    study: Study,
    *,
    seed: int | None = None,
    flight: Path | None = None,
    reports: Path = REPORTS,
    notebooks: Path = NOTEBOOKS,
    timeout_s: float | None = None,
    name: str | None = None,
) -> Job:
    """The job that runs a study, checked as far as it can be before it starts.

    Parameters
    ----------
    flight
        A flight folder to use in place of the study's own.
    name
        Name of the report's folder; the study's if not given.

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
        timeout_s=study.timeout_minutes * 60 if timeout_s is None else timeout_s,
    )


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
        _sweep(folder)
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
            _clear(one.job)
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
                    "If it only needs longer, give it more: --timeout MINUTES"
                )
        if self.done or self.failure:
            self.end()
            return True
        return False

    def _failure(self, reason: str) -> Failure:
        return Failure(f"{reason}.", "", _log(self.job))

    def end(self) -> None:
        """End the process and all below it. Harmless where it has ended."""
        if self.done or (self.failure and self.process.is_alive()):
            self.process.join(3)
        if self.process.pid is not None and self.process.is_alive():
            end_tree(self.process.pid)
        self.process.join()
        self.pipe.close()


def _start(job: Job) -> _Running:
    _clear(job)
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
            _leave_failure(job, one.failure, one.cell, status, folder)
        install(folder, target, status)
    finally:
        _clear(job)
    return Outcome(job.name, str(status["state"]), seconds, str(status["reason"]), target)


def _leave_failure(
    job: Job, failure: Failure, cell: int | None, status: dict[str, Any], folder: Path
) -> None:
    """Turn a work folder into that of a failed run: the page, the notebook as far as it came, no numbers."""
    step, executed = failure.step, folder / "notebook.ipynb"
    if executed.is_file():
        try:
            notebook = read_notebook(executed)
            # A process that was ended could not clean its notebook itself.
            shown = {**job.parameters, "study": job.name, "seed": job.seed}
            shown |= {"flight": Path(job.flight).name, "out": ".", "expected_prefix": ""}
            write_notebook(executed, clean_notebook(notebook, shown, {str(folder): "."}))
            step = step or step_of(notebook, cell)
        except WildlabError:
            executed.unlink()
    for name in ("metrics.json", "replay.rrd"):
        (folder / name).unlink(missing_ok=True)
    shutil.rmtree(folder / "figures", ignore_errors=True)
    beside = [name for name in ("provenance.json", "notebook.ipynb") if (folder / name).is_file()]
    ended = str(status["finished"]).replace("T", " ").replace("+00:00", " UTC")
    links = [f'<a href="{name}">{name}</a>' for name in beside]
    footer = f"<p>{' · '.join([f'ended {ended}', *links])}</p>"
    details = failure.details or _log(job)
    write_atomic(
        folder / "report.html",
        failure_page(status, title=job.title, step=step, details=details, footer=footer),
    )


def write_notebook(path: Path, notebook: Any) -> None:
    """Write a notebook atomically."""
    import nbformat

    write_atomic(path, nbformat.writes(notebook) + "\n")


def install(folder: Path, target: Path, status: dict[str, Any]) -> None:
    """Move the files of a finished run into the report's folder, ``status.json`` last.

    Ctrl-C is held back meanwhile. If the machine dies in the middle, no ``status.json`` is there, and the
    ledger says that the study has to be run again.
    """
    with _undisturbed(), _locked(target.parent):
        if target.is_symlink() or (target.exists() and not target.is_dir()):
            raise WildlabError("a file is in the place of the report's folder", "move it away", file=target)
        target.mkdir(exist_ok=True)
        (target / "status.json").unlink(missing_ok=True)
        figures = folder / "figures"
        if (target / "figures").is_dir():
            shutil.rmtree(target / "figures")
        if figures.is_dir():
            figures.replace(target / "figures")
        for name in FILES:
            if (folder / name).is_file():
                (folder / name).replace(target / name)
            else:
                (target / name).unlink(missing_ok=True)
        write_json(target / "status.json", status)


@contextlib.contextmanager
def _undisturbed() -> Iterator[None]:
    """Hold Ctrl-C back for the few milliseconds of a move. Only the main thread is ever interrupted."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    held: list[int] = []
    before = signal.signal(signal.SIGINT, lambda number, _: held.append(number))
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, before)
    if held:
        raise KeyboardInterrupt


@contextlib.contextmanager
def _locked(folder: Path) -> Iterator[None]:
    """Two runners that finish the same study at once take turns."""
    with (folder / ".lock").open("w") as file:
        fcntl.flock(file, fcntl.LOCK_EX)
        yield


def _sweep(folder: Path) -> None:
    """Remove what runners that were killed have left behind."""
    for path in folder.glob(".*.part"):
        match = _PART.fullmatch(path.name)
        if match and not _alive(int(match["pid"])):
            shutil.rmtree(path, ignore_errors=True)


def _alive(pid: int) -> bool:
    try:
        os.kill(pid, 0)
    except ProcessLookupError:
        return False
    except PermissionError:
        pass
    return True


def _clear(job: Job) -> None:
    for folder in (job.work, job.runtime):
        shutil.rmtree(folder, ignore_errors=True)


def _log(job: Job) -> str:
    """The end of what the process printed: the only witness where it died."""
    try:
        text = (Path(job.work) / ".log").read_text(encoding="utf-8", errors="replace")
    except OSError:
        return ""
    return clean_text(text[-4000:], {job.work: "."})


def _socket_folder() -> Path:
    """Where sockets may lie: their paths must be short, and macOS's temporary folder is not."""
    short = Path("/tmp")  # noqa: S108 - a folder of our own is made in it, readable by us alone
    return short if os.access(short, os.W_OK | os.X_OK) else Path(tempfile.gettempdir())


def _duration(seconds: float) -> str:
    return f"{seconds / 60:g} minutes" if seconds >= 120 else f"{seconds:g} seconds"
