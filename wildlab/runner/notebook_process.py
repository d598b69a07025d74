"""One study in a process of its own: flight, notebook, page. `wildlab.runner.scheduling` starts, watches and
ends it.

A process each, because papermill changes the working directory of the whole process, and because only a
process can be ended for certain.
"""

from __future__ import annotations

import os
import shutil
import time
from multiprocessing import connection
from pathlib import Path
from typing import Any

from wildlab.errors import WildlabError
from wildlab.paths import ROOT
from wildlab.runner.catalogue import OTHERS, dataset_flight, twin_flight
from wildlab.runner.job import Failure, Job
from wildlab.runner.processes import end_with_runner, runner_is_gone

#: The cells begun in this process, in order.
_STARTED: list[int] = []


def run_notebook(pipe: connection.Connection, job: Job) -> None:
    """Body of the process. Says ``("stage", (text,))``, ``("cell", (index, count))`` and at last
    ``("done", None)`` or ``("failed", Failure)``."""
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
    from wildlab.files import write_atomic, write_json
    from wildlab.reporting import metrics, notebook_pages
    from wildlab.reporting.status import describe_first_look
    from wildlab.reporting.text import first_look_notice
    from wildlab.runner import provenance

    started = time.monotonic()
    folder = Path(job.work)
    pipe.send(("stage", ("flight",)))
    flight, others = _flight(job), _others(job)
    given: dict[str, Any] = {**job.parameters, "study": job.name, "seed": job.seed}
    origin = provenance.collect(
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
            cleaned = notebook_pages.clean_notebook(
                notebook_pages.read_notebook(executed), shown, job.hidden()
            )
            notebook_pages.write_notebook(executed, cleaned)
    pipe.send(("stage", ("page",)))
    if not (folder / "metrics.json").is_file():
        raise WildlabError(
            "the notebook wrote no metrics.json", "end it with report.save()", file=Path(job.notebook).name
        )
    metrics.read_metrics(folder / "metrics.json")
    if job.seeds is not None:
        # Once more: a notebook computes what was damaged since.
        origin["seeds"] = job.seeds.provenance()
    origin["seconds"] = round(time.monotonic() - started, 1)
    write_json(folder / "provenance.json", origin)
    look = describe_first_look(job.first_look)
    notice = first_look_notice(look, job.again) if look else ""
    page = notebook_pages.report_page(
        cleaned,
        study=job.name,
        footer=provenance.footer(origin),
        notice=notice,
        alert=provenance.changed_notice(origin),
        title=job.heading,
        made=str(origin["made"]),
    )
    write_atomic(folder / "report.html", page)


def _tutorial(pipe: connection.Connection, job: Job) -> None:
    """A notebook that takes no parameters and leaves no numbers: only its page."""
    from wildlab.files import write_atomic
    from wildlab.reporting import notebook_pages
    from wildlab.runner import provenance

    pipe.send(("stage", ("notebook",)))
    notebook = _execute(pipe, job, {}, Path(job.work) / "notebook.ipynb")
    pipe.send(("stage", ("page",)))
    cleaned = notebook_pages.clean_notebook(notebook, {}, {job.work: "."})
    origin = provenance.collect(
        study=job.name, notebook=Path(job.notebook), flight=None, parameters={}, seed=None
    )
    page = notebook_pages.tutorial_page(
        cleaned, name=Path(job.notebook).stem, footer=provenance.footer(origin, beside=())
    )
    write_atomic(Path(job.work) / "report.html", page)


def _flight(job: Job) -> Path | None:
    if job.flight:
        return Path(job.flight)
    if job.twin:
        return twin_flight(job.twin, job.seed, Path(job.reports))
    if job.recipe:
        return dataset_flight(job.dataset, job.recipe, Path(job.reports))
    return None


def _others(job: Job) -> list[Path]:
    """The further flights of a study."""
    return [dataset_flight(job.dataset, recipe, Path(job.reports)) for recipe in job.beside]


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
    from wildlab.reporting.notebook_pages import read_notebook
    from wildlab.runner.shell import execute_notebook

    def on_cell(index: int, count: int) -> None:
        _STARTED.append(index)
        pipe.send(("cell", (index, count)))

    notebook = read_notebook(Path(job.notebook))
    return execute_notebook(notebook, Path(job.notebook).parent, executed, parameters, on_cell)


def _explain(error: BaseException, job: Job) -> Failure:
    import traceback

    from wildlab.reporting.notebook_pages import clean_text, read_notebook, step_of
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
