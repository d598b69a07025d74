"""Run studies: one process per notebook, a time limit, and outputs that appear whole or not at all.

A run works in a folder beside its report's. Only when it is over are the files moved into
``reports/<name>/``, and ``status.json`` comes last: as long as it is not there, nothing beside it is to be
trusted. A failed run leaves a page that says so; a run that is broken off (Ctrl-C) leaves the former report
as it was.

A first look is a page from a few flights; the full numbers take its place, and no flight is computed again
that it had. Of all studies those are left alone whose full reports are there, from the same code, data and
parameters; whenever it is broken off, every page that is there says what it shows.
"""

from __future__ import annotations

import os
import time
from collections.abc import Sequence
from contextlib import nullcontext
from pathlib import Path
from typing import Any

from rich.console import Console

from wildlab.errors import WildlabError
from wildlab.flight.files import flight_name
from wildlab.flight.manifest import FILE_NAME, read_manifest
from wildlab.paths import NOTEBOOKS, REPORTS
from wildlab.runner.catalogue import (
    OTHERS,
    STANDARD_PARAMETERS,
    StudyEntry,
    check_notebook,
    dataset_source,
    find_studies,
    load_studies,
)
from wildlab.runner.job import Job, other_reports, typed_in_report
from wildlab.runner.ledger import build_ledger
from wildlab.runner.progress import outcome_line, pass_line, shown
from wildlab.runner.scheduling import Outcome, run_jobs
from wildlab.runner.seeds import SeedWork, code_key, make_work, page_key
from wildlab.runner.status import read_status

#: Guessed seconds of a study that has not been run here yet. Only their order matters.
GUESSED_S = {"computed": 5.0, "logged": 30.0, "twin": 60.0}
#: How old the ledger may be when a study ends, s: it takes a second to write, and a front page to look up.
LEDGER_EVERY_S = 10.0
THERE = "its full report is there already, from the same code, data and parameters"


def make_job(
    study: StudyEntry,
    *,
    seed: int | None = None,
    seeds: int | None = None,
    flight: Path | None = None,
    reports: Path = REPORTS,
    notebooks: Path = NOTEBOOKS,
    timeout_s: float | None = None,
    name: str | None = None,
    again: str | None = None,
    first_look: bool = False,
) -> Job:
    """The job that runs a study, checked as far as it can be before it starts.

    Parameters
    ----------
    seeds
        Over how many simulated flights, in place of the study's own number; nothing to a study without one.
    flight
        A flight folder to use in place of the study's own.
    name
        Name of the report's folder; the study's if not given.
    again
        What to type to run it again, where that is not `wildlab run STUDY`.
    first_look
        With no more flights and runs than a first look takes; the job says so in its ``first_look``, as it
        does where ``seeds`` are fewer than the study's own.

    Raises
    ------
    WildlabError
        As `check_notebook` and `wildlab.runner.seeds.make_work`.
    """
    notebook = notebooks / study.notebook
    parameters = dict(study.parameters)
    flight_name = "" if flight is None else _flight_name(flight)
    reductions = study.reductions() if first_look else {}
    if study.seeds is not None:
        parameters["seeds"] = study.seeds if seeds is None else seeds
    if study.seeds is not None and seeds is not None:
        reductions.pop("seeds", None)
        if seeds < study.seeds:
            # Whoever asks for fewer flights gets a first look as well: the page and the ledger say so.
            reductions["seeds"] = (seeds, study.seeds)
    if again is None:
        more = str(seeds) if seeds is not None and "seeds" not in reductions else None
        own_seed = None if seed is None or seed == study.seed else str(seed)
        out = None if reductions else other_reports(reports)
        again = typed_in_report("wildlab run", study.name, flight=flight, seeds=more, seed=own_seed, out=out)
    parameters |= {parameter: few for parameter, (few, _) in reductions.items()}
    others = [OTHERS] if study.beside else []
    cells = check_notebook(notebook, [*STANDARD_PARAMETERS, *parameters, *others])
    seed = study.seed if seed is None else seed
    reports = reports.resolve()
    # Reports on somebody's own flight ask what the notebook asks; a study is called the same everywhere.
    heading = study.title if name is None else ""
    name = name or study.name
    own = flight is None
    work = _seed_work(study, name, seed, flight, reports, parameters)
    if "seeds" in reductions and study.shown_case() is not None and work is None:
        # A logged flight is the only one of its kind.
        parameters["seeds"] = reductions.pop("seeds")[1]
    given = {**parameters, "seed": seed, "flight": "" if flight is None else str(flight.resolve())}
    given |= {"twin": study.twin, "dataset": study.dataset, "recipes": [study.recipe, *study.beside]}
    return Job(
        name=name,
        title=study.title,
        heading=heading,
        notebook=str(notebook.resolve()),
        work=str(reports / f".{name}.{os.getpid()}.part"),
        reports=str(reports),
        seed=seed,
        flight="" if flight is None else str(flight.resolve()),
        flight_name=flight_name,
        twin=study.twin if own else None,
        dataset=study.dataset if own else None,
        recipe=study.recipe if own else None,
        beside=tuple(study.beside) if own else (),
        parameters=parameters,
        again=again,
        timeout_s=study.timeout_minutes * 60 if timeout_s is None else timeout_s,
        cells=cells + 1,  # and the one with the parameters
        seeds=work,
        first_look=reductions,
        fingerprint=page_key(notebook, given, work.code if work is not None else code_key()),
    )


def _seed_work(
    study: StudyEntry, name: str, seed: int, flight: Path | None, reports: Path, parameters: dict[str, Any]
) -> SeedWork | None:
    """What is to be computed for each seed before the notebook starts; None where nothing is."""
    case = study.shown_case()
    if case is None:
        return None
    twin = study.twin
    if flight is not None:
        simulated = read_manifest(flight / FILE_NAME).twin
        if simulated is None:
            return None  # a logged flight is the only one of its kind
        twin = simulated.name
    given = {**parameters, "twin": twin}
    return make_work(reports, name, case.case, seed, parameters["seeds"], given)


def run_studies(
    names: Sequence[str] = (),
    *,
    everything: bool = False,
    first_look: bool = False,
    seed: int | None = None,
    seeds: int | None = None,
    flight: Path | None = None,
    reports: Path = REPORTS,
    notebooks: Path = NOTEBOOKS,
    parallel: int = 1,
    scheduler: str | None = None,
    timeout_s: float | None = None,
    console: Console | None = None,
) -> list[Outcome]:
    """Run studies by name or case, or all. The ledger is written first, from time to time, and at the end.

    Parameters
    ----------
    everything
        Run all studies, the quick ones first, but for those whose full report is there. One whose public
        data are not here is skipped, and says so; asked for by name, it is an error. One that is kept apart
        is left out.
    first_look
        Take the first look alone, at all studies or those named.
    seeds
        Over how many simulated flights, in place of each study's own number.
    flight
        A flight folder for the one study named, in place of its own; its report is then named
        ``<study>-<flight>``.
    parallel
        How many processes at a time, for notebooks and seeds together.
    scheduler
        Address of a `dask.distributed` scheduler whose workers compute the seeds.
    timeout_s
        How long a notebook may take, and each seed.
    console
        Where progress is shown; nowhere if not given.

    Returns
    -------
    list of Outcome
        One per study, also of those that failed: a study that fails does not stop the others.

    Raises
    ------
    WildlabError
        Before anything runs, if a study is not known or cannot be run as it is written, or the cluster cannot
        be used; and if the cluster is lost on the way.
    """
    studies = load_studies(notebooks / "studies.toml")
    chosen = (
        [study for study in studies.values() if not study.apart]
        if everything
        else list({study.name: study for name in names for study in find_studies(name, studies)}.values())
    )
    if not chosen:
        raise WildlabError("no study was named", "name one (see: wildlab list), or say --all")
    report = None
    if flight is not None:
        if len(chosen) != 1:
            raise WildlabError("a flight goes with one study", "name one study", field="--flight")
        report = f"{chosen[0].name}-{_flight_name(flight)}"
    if everything:
        chosen = quick_first(chosen, reports)
    ready, skipped = [], []
    for study in chosen:
        absent = _absent_data(study) if flight is None else None
        if absent is not None and everything:
            skipped.append(Outcome(study.name, "skipped", 0.0, str(absent)))
            continue
        if absent is not None:
            raise absent
        ready.append(study)

    def job(study: StudyEntry, few: bool = False) -> Job:
        return make_job(
            study,
            seed=seed,
            seeds=seeds,
            flight=flight,
            reports=reports,
            notebooks=notebooks,
            timeout_s=timeout_s,
            name=report,
            first_look=few,
        )

    jobs = []
    for study in ready:
        whole = job(study)
        if (everything or first_look) and has_whole_report(whole):
            skipped.append(Outcome(whole.name, "skipped", 0.0, THERE, Path(whole.reports) / whole.name))
        else:
            jobs.append(job(study, few=True) if first_look else whole)
    notes = _notes(chosen, seeds, scheduler)
    apart = [study.name for study in studies.values() if study.apart]
    if everything and apart:
        notes.append(f"Not among all, to be run by name: {', '.join(apart)}.")
    return run_all(
        jobs, skipped, studies, reports, console, notes=notes, parallel=parallel, scheduler=scheduler
    )


def _notes(chosen: Sequence[StudyEntry], seeds: int | None, scheduler: str | None) -> list[str]:
    """What was asked for and has no effect, in sentences."""
    notes = []
    once = ", ".join(study.name for study in chosen if study.seeds is None)
    if seeds is not None and once:
        notes.append(f"--seeds has no effect on {once}: not computed over simulated flights.")
    here = ", ".join(study.name for study in chosen if study.shown_case() is None)
    if scheduler is not None and here:
        notes.append(f"--scheduler has no effect on {here}: nothing is computed for each seed.")
    return notes


def run_all(
    jobs: Sequence[Job],
    skipped: list[Outcome],
    studies: dict[str, StudyEntry] | None,
    reports: Path,
    console: Console | None,
    *,
    notes: Sequence[str] = (),
    parallel: int = 1,
    scheduler: str | None = None,
) -> list[Outcome]:
    """Run what was made ready, and show how it goes; outcomes as of `run_studies`.

    The ledger of the studies is written before anything else, from time to time, and at the end, however that
    comes: it says what is there. Without studies there is none.
    """

    def write() -> float:
        if studies is not None:
            build_ledger(reports, studies)
        return time.monotonic()

    if console is not None:
        for note in notes:
            console.print(note, highlight=False, soft_wrap=True)
        for outcome in skipped:
            console.print(outcome_line(outcome), highlight=False, soft_wrap=True)
        if line := pass_line(jobs):
            console.print(line, highlight=False, soft_wrap=True)
    written = write()
    if not jobs:
        return skipped
    try:
        with shown(console) if console is not None else nullcontext() as listen:

            def tell(name: str, event: str, what: Any) -> None:
                nonlocal written
                if event == "end" and time.monotonic() - written > LEDGER_EVERY_S:
                    written = write()
                if listen is not None:
                    listen(name, event, what)

            return [*run_jobs(jobs, parallel=parallel, scheduler=scheduler, listen=tell), *skipped]
    finally:
        write()


def _flight_name(folder: Path) -> str:
    return flight_name(folder, read_manifest(folder / FILE_NAME).name)


def _absent_data(study: StudyEntry) -> WildlabError | None:
    if study.dataset is None:
        return None
    try:
        dataset_source(study.dataset)
    except WildlabError as error:
        return error
    return None


def has_whole_report(job: Job) -> bool:
    """Whether the report of this very job is there, and not a first look."""
    folder = Path(job.reports) / job.name
    status = read_status(folder)
    return (
        status.get("state") == "done"
        and status.get("fingerprint") == job.fingerprint
        and not status.get("first_look")
        and (folder / "report.html").is_file()
    )


def quick_first(studies: Sequence[StudyEntry], reports: Path) -> list[StudyEntry]:
    """The studies by how long they took when they were last run, or by what they need: no flight, a logged
    one, simulated ones."""

    def cost(study: StudyEntry) -> float:
        seconds = read_status(reports / study.name).get("seconds")
        return float(seconds) if isinstance(seconds, (int, float)) else GUESSED_S[study.kind]

    return sorted(studies, key=cost)
