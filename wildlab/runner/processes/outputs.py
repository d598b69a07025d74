"""How the outputs of a run get into the report's folder: whole or not at all, ``status.json`` last."""

from __future__ import annotations

import contextlib
import fcntl
import os
import re
import shutil
import signal
import threading
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from wildlab.errors import WildlabError
from wildlab.files import write_atomic
from wildlab.reporting.failure import failure_page, step_of
from wildlab.reporting.notebook_file import nbformat, read_notebook
from wildlab.reporting.privacy import clean_notebook, clean_text
from wildlab.runner.processes.job import Failure, Job
from wildlab.runner.record.digests import seal

#: What a run may leave in a report's folder, besides ``figures/``. Anything else there is not ours, and
#: stays.
FILES = (
    "report.html",
    "metrics.json",
    "provenance.json",
    "notebook.ipynb",
    "replay.rrd",
    "estimates.parquet",
    "estimates.csv",
)
_PART = re.compile(r"\.(?P<name>.+)\.(?P<pid>\d+)\.part")


def leave_failure(job: Job, failure: Failure, cell: int | None, status: dict[str, Any], folder: Path) -> None:
    """Turn a work folder into that of a failed run: the page, the notebook as far as it came, no numbers."""
    step, executed = failure.step, folder / "notebook.ipynb"
    if executed.is_file():
        try:
            notebook = read_notebook(executed)
            # A process that was ended could not clean its notebook itself.
            shown = {**job.parameters, "study": job.name, "seed": job.seed}
            shown |= {"flight": job.flight_name, "out": "."}
            write_notebook(executed, clean_notebook(notebook, shown, job.hidden() | {str(folder): "."}))
            step = step or step_of(notebook, cell)
        except WildlabError:
            executed.unlink()
    for name in ("metrics.json", "replay.rrd", "estimates.parquet", "estimates.csv"):
        (folder / name).unlink(missing_ok=True)
    clear_folder(folder / "figures")
    beside = [name for name in ("provenance.json", "notebook.ipynb") if (folder / name).is_file()]
    ended = str(status["finished"]).replace("T", " ").replace("+00:00", " UTC")
    # Words, not links: the page is passed on alone.
    names = " and ".join(f"<code>{name}</code>" for name in beside)
    footer = f"<p>ended {ended}{f'. Beside this page: {names}' if names else ''}.</p>"
    details = failure.details or log_of(job)
    write_atomic(
        folder / "report.html",
        failure_page(status, title=job.title, step=step, details=details, again=job.again, footer=footer),
    )


def write_notebook(path: Path, notebook: Any) -> None:
    """Write a notebook atomically."""
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
        seal(target, status, FILES)


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


def sweep(folder: Path) -> None:
    """Remove what runs have left that had no chance to do so themselves, because the machine stopped.

    Only after a day: a runner in a container has process numbers of its own, and may look dead from here.
    """
    for path in folder.glob(".*.part"):
        match = _PART.fullmatch(path.name)
        if match and not alive(int(match["pid"])) and time.time() - path.stat().st_mtime > 86_400:
            clear_folder(path)


def alive(pid: int) -> bool:
    """Whether there is a process of this number."""
    try:
        os.kill(pid, 0)
    except ProcessLookupError:
        return False
    except PermissionError:
        pass
    return True


def clear(job: Job) -> None:
    """Remove the folders a run works in."""
    for folder in (job.work, job.runtime):
        clear_folder(Path(folder))


def clear_folder(folder: Path) -> None:
    """Remove a folder; harmless where there is none."""
    shutil.rmtree(folder, ignore_errors=True)


def log_of(job: Job) -> str:
    """The end of what the process printed: the only witness where it died."""
    try:
        text = (Path(job.work) / ".log").read_text(encoding="utf-8", errors="replace")
    except OSError:
        return ""
    return clean_text(text[-4000:], job.hidden())
