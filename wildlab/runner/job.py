"""What is run, how it is typed again, and how: a study in a process of its own, which makes flight, notebook
and page; its outputs get into the report's folder whole or not at all, ``status.json`` last.

A process each, because papermill changes the working directory of the whole process, and because only a
process can be ended for certain. `wildlab.runner.scheduling` starts, watches and ends it.
"""

from __future__ import annotations

import contextlib
import fcntl
import os
import re
import shlex
import shutil
import signal
import threading
import time
from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass, field
from multiprocessing import connection
from pathlib import Path
from typing import Any, NamedTuple

from wildlab.errors import WildlabError
from wildlab.files import write_atomic, write_json
from wildlab.paths import REPORTS, ROOT
from wildlab.reporting.metrics import read_metrics
from wildlab.reporting.notebook_pages import (
    clean_notebook,
    clean_text,
    read_notebook,
    report_page,
    step_of,
    tutorial_page,
    write_notebook,
)
from wildlab.reporting.published import describe_first_look
from wildlab.reporting.text import failure_page, first_look_notice
from wildlab.runner.catalogue import OTHERS, dataset_flight, twin_flight
from wildlab.runner.processes import end_with_runner, runner_is_gone
from wildlab.runner.provenance import changed_notice, collect, footer
from wildlab.runner.seeds import SeedWork
from wildlab.runner.status import seal

#: The tag of a notebook's cell that begins once those reports are there that it reads.
AFTER_OTHERS = "after-others"


@dataclass(frozen=True)
class Job:
    """What a process needs to know. Folders are absolute."""

    name: str
    title: str
    notebook: str
    work: str
    reports: str
    seed: int = 1
    #: The page's main heading; "" leaves the notebook's.
    heading: str = ""
    flight: str = ""
    #: As its folder, of which nothing else is told.
    flight_name: str = ""
    twin: str | None = None
    dataset: str | None = None
    recipe: str | None = None
    #: Recipes of further flights of the data set.
    beside: tuple[str, ...] = ()
    parameters: dict[str, Any] = field(default_factory=dict)
    #: What to type to run it again.
    again: str = ""
    timeout_s: float = 1800.0
    #: How many cells the notebook has, and what is to be computed for each seed before it starts.
    cells: int = 0
    seeds: SeedWork | None = None
    #: What a first look takes less of, by parameter: (how many, of how many). Empty: the full numbers.
    first_look: dict[str, tuple[int, float]] = field(default_factory=dict)
    #: What the page depends on, see `wildlab.runner.seeds.page_key`.
    fingerprint: str = ""
    #: Jobs of the same run that must have ended before the cell with the tag `AFTER_OTHERS`.
    after: tuple[str, ...] = ()
    #: Whether the notebook takes no parameters, leaves no numbers, and is shown with its code.
    tutorial: bool = False

    def hidden(self) -> dict[str, str]:
        """Folders that get into nothing that is left behind, with what stands for each."""
        if not self.flight:
            return {self.work: "."}
        around = str(Path(self.flight).parent)
        return {self.work: ".", around: "[flights]", self.flight: f"[flight {self.flight_name}]"}


class Failure(NamedTuple):
    """Why a job failed: a sentence, the step, and the traceback for whoever mends it."""

    reason: str
    step: str = ""
    details: str = ""


def typed(command: str, *arguments: str | Path, **options: str | Path | bool | Sequence[str] | None) -> str:
    """A command line for a shell, with quotes where names have blanks.

    Parameters
    ----------
    command
        As ``wildlab track``, taken as it is.
    arguments
        What follows. Paths are written from the folder that this is run in where they lie below it.
    options
        By name without dashes: a value, several, or True; what is None, False or empty is left out.

    Examples
    --------
    >>> typed("wildlab track", "my flight", filter=("ekf", "ukf"), smooth=True, source=None)
    "wildlab track 'my flight' --filter ekf --filter ukf --smooth"
    """
    words = [shlex.quote(_written(one)) for one in arguments]
    for name, value in options.items():
        if value is True:
            words.append(f"--{name}")
        elif value:
            several = [value] if isinstance(value, str | Path) else list(value) if value else []
            words += [f"--{name} {shlex.quote(_written(one))}" for one in several]
    return " ".join([command, *words])


def typed_in_report(
    command: str, *arguments: str | Path, **options: str | Path | bool | Sequence[str | Path] | None
) -> str:
    """As `typed`; of a path that does not lie below the folder this is run in only the last name.

    A report may be passed on, and does not say where on which machine something lies.

    Examples
    --------
    >>> typed_in_report("wildlab track", Path("flights/tuesday"), settings=Path("/home/me/settings.toml"))
    'wildlab track flights/tuesday --settings settings.toml'
    """

    def named(value: Any) -> Any:
        if isinstance(value, Path):
            written = Path(_written(value))
            return written.name if written.is_absolute() else str(written)
        return [named(one) for one in value] if isinstance(value, list | tuple) else value

    return typed(command, *map(named, arguments), **{name: named(one) for name, one in options.items()})


def other_reports(reports: Path) -> Path | None:
    """The folder of reports where it is not the usual one, and so has to be typed."""
    return None if reports.resolve() == REPORTS.resolve() else reports


def _written(one: str | Path) -> str:
    if not isinstance(one, Path):
        return one
    whole, here = one.resolve(), Path.cwd()
    return str(whole.relative_to(here)) if whole.is_relative_to(here) and whole != here else str(whole)


#: What a run may leave in a report's folder, besides ``figures/``. Anything else there is not ours, and
#: stays.
FILES = (
    "report.html",
    "metrics.json",
    "provenance.json",
    "notebook.ipynb",
    "replay.html",
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
    for name in ("metrics.json", "replay.html", "replay.rrd", "estimates.parquet", "estimates.csv"):
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
    """Remove the folder that a run works in."""
    clear_folder(Path(job.work))


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


#: The cells begun in this process, in order.
_STARTED: list[int] = []


def run_notebook(pipe: connection.Connection, job: Job) -> None:
    """Body of the process. Says ``("stage", (text,))``, ``("cell", (index, count))``, ``("after", None)``
    where it waits to hear that other jobs have ended, and at last ``("done", None)`` or
    ``("failed", Failure)``."""
    ended = end_with_runner(lambda: _remove(job))
    try:
        pipe.send(_outcome(pipe, job))
    except OSError:
        if not runner_is_gone(timeout_s=1.0):
            raise
        ended.join()  # it ends this process when nothing is left of the work


def _outcome(pipe: connection.Connection, job: Job) -> tuple[str, Failure | None]:
    try:
        _keep_to_ourselves(job)
        (_tutorial if job.tutorial else _work)(pipe, job)
    except BaseException as error:  # whatever it is, the runner must hear of it
        return "failed", _explain(error, job)
    return "done", None


def _remove(job: Job) -> None:
    """Remove the work's folder for good: the notebook may write into it until it finds it gone."""
    for _ in range(100):
        shutil.rmtree(job.work, ignore_errors=True)
        if not Path(job.work).exists():
            break
        time.sleep(0.01)


def _keep_to_ourselves(job: Job) -> None:
    """Leave the reader's own settings, history and terminal out of it: the same run everywhere."""
    from wildlab.reporting.figures import QUICK

    os.environ.update(
        JUPYTER_PLATFORM_DIRS="1",
        IPYTHONDIR=str(Path(job.work) / ".ipython"),
        # Figures are shown by Report, with alt text, and not a second time by pyplot.
        MPLBACKEND="agg",
        PYDEVD_DISABLE_FILE_VALIDATION="1",
        PYTHONHASHSEED="0",
        TZ="UTC",
    )
    if job.first_look or job.flight:
        os.environ[QUICK] = "1"
    log = os.open(Path(job.work) / ".log", os.O_WRONLY | os.O_CREAT | os.O_APPEND, 0o644)
    for stream in (1, 2):
        os.dup2(log, stream)
    os.close(log)


def _work(pipe: connection.Connection, job: Job) -> None:
    started = time.monotonic()
    folder = Path(job.work)
    pipe.send(("stage", ("flight",)))
    flight = _flight(job)
    others = [dataset_flight(job.dataset, recipe, Path(job.reports)) for recipe in job.beside]
    given: dict[str, Any] = {**job.parameters, "study": job.name, "seed": job.seed}
    origin = collect(
        study=job.name,
        notebook=Path(job.notebook),
        flight=flight,
        parameters=job.parameters,
        seed=job.seed,
        others=others,
    )
    if job.first_look:
        origin["first_look"] = job.first_look
    if job.seeds is not None:
        origin["seeds"] = job.seeds.provenance()
    write_json(folder / "provenance.json", origin)
    pipe.send(("stage", ("notebook",)))
    shown = {**given, "flight": _relative(flight, job), "out": "."}
    if others:
        given[OTHERS] = [str(other) for other in others]
        shown[OTHERS] = [_relative(other, job) for other in others]
    executed = folder / "notebook.ipynb"
    try:
        _execute(pipe, job, {**given, "flight": str(flight or ""), "out": str(folder)}, executed)
    finally:
        if executed.is_file():
            cleaned = clean_notebook(read_notebook(executed), shown, job.hidden())
            write_notebook(executed, cleaned)
    pipe.send(("stage", ("page",)))
    if not (folder / "metrics.json").is_file():
        raise WildlabError(
            "the notebook wrote no metrics.json", "end it with report.save()", file=Path(job.notebook).name
        )
    read_metrics(folder / "metrics.json")
    if job.seeds is not None:
        # Once more: a notebook computes what was damaged since.
        origin["seeds"] = job.seeds.provenance()
    origin["seconds"] = round(time.monotonic() - started, 1)
    write_json(folder / "provenance.json", origin)
    look = describe_first_look(job.first_look)
    notice = first_look_notice(look, job.again) if look else ""
    page = report_page(
        cleaned,
        study=job.name,
        footer=footer(origin),
        notice=notice,
        alert=changed_notice(origin),
        title=job.heading,
        made=str(origin["made"]),
    )
    write_atomic(folder / "report.html", page)


def _tutorial(pipe: connection.Connection, job: Job) -> None:
    """A notebook that takes no parameters and leaves no numbers: only its page."""
    pipe.send(("stage", ("notebook",)))
    notebook = _execute(pipe, job, {}, Path(job.work) / "notebook.ipynb")
    pipe.send(("stage", ("page",)))
    cleaned = clean_notebook(notebook, {}, {job.work: "."})
    origin = collect(study=job.name, notebook=Path(job.notebook), flight=None, parameters={}, seed=None)
    page = tutorial_page(cleaned, name=Path(job.notebook).stem, footer=footer(origin, beside=()))
    write_atomic(Path(job.work) / "report.html", page)


def _flight(job: Job) -> Path | None:
    if job.flight:
        return Path(job.flight)
    if job.twin:
        return twin_flight(job.twin, job.seed, Path(job.reports))
    if job.recipe:
        return dataset_flight(job.dataset, job.recipe, Path(job.reports))
    return None


def _relative(flight: Path | None, job: Job) -> str:
    """The flight's folder as seen from the report's, where both lie in the checkout; the name of a flight of
    the reader's own."""
    if flight is None or job.flight:
        return job.flight_name
    flight, reports = flight.resolve(), Path(job.reports).resolve()
    inside = ROOT is not None and flight.is_relative_to(ROOT) and reports.is_relative_to(ROOT)
    if flight.is_relative_to(reports) or inside:
        return Path(os.path.relpath(flight, reports / job.name)).as_posix()
    return flight.name


def _execute(pipe: connection.Connection, job: Job, parameters: dict[str, Any], executed: Path) -> Any:
    from wildlab.runner.shell import execute_notebook

    def on_cell(index: int, count: int, tags: Collection[str]) -> None:
        _STARTED.append(index)
        pipe.send(("cell", (index, count)))
        if AFTER_OTHERS in tags and job.after:
            pipe.send(("after", None))
            pipe.recv()

    notebook = read_notebook(Path(job.notebook))
    return execute_notebook(notebook, Path(job.notebook).parent, executed, parameters, on_cell)


def _explain(error: BaseException, job: Job) -> Failure:
    import traceback

    from wildlab.runner.shell import CellError

    details = "".join(traceback.format_exception(error))
    if isinstance(error, CellError):
        details = "\n".join(error.lines)
        ours = error.name in ("WildlabError", "RunFailed")
        raised = f"The computation raised {error}" if error.message else f"It raised {error.name}."
        reason = error.message if ours else raised
    elif isinstance(error, WildlabError):
        reason = str(error)
    else:
        reason = f"It ended with {type(error).__name__}: {error}"
    step, folder = "", Path(job.work)
    if (folder / "notebook.ipynb").is_file():
        notebook = read_notebook(folder / "notebook.ipynb")
        failed = _failed_cell(notebook)
        step = step_of(notebook, failed if failed is not None else (_STARTED or [0])[-1])
    reason = reason.strip()
    reason += "" if reason.endswith((".", "!", "?")) else "."
    return Failure(clean_text(reason, job.hidden()), step, clean_text(details, job.hidden()))


def _failed_cell(notebook: Any) -> int | None:
    for index, cell in enumerate(notebook.cells):
        if any(output.get("output_type") == "error" for output in cell.get("outputs", [])):
            return index
    return None
