"""What runs when: notebooks and the seeds they need, so many processes at a time and no more.

A notebook starts once its seeds are there. One that is ready goes before further seeds, and a process that
has computed seeds ends where a notebook needs its place.
"""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from datetime import UTC, datetime
from multiprocessing import connection
from multiprocessing.process import BaseProcess
from pathlib import Path
from typing import Any

from wildlab.runner.job import Failure, Job, clear, install, leave_failure, log_of, sweep
from wildlab.runner.notebook_process import run_notebook
from wildlab.runner.processes import end_tree, start_process
from wildlab.runner.seeds import failed_seeds, missing_seeds, sweep_seeds
from wildlab.runner.worker_pool import Cluster, WorkerPool


@dataclass(frozen=True)
class Outcome:
    """How a run ended: ``state`` is "done", "failed" or "skipped"; ``reason`` says why in a sentence."""

    name: str
    state: str
    seconds: float
    reason: str = ""
    folder: Path | None = None


#: Called with (name, event, what). First of all ("", "plan", how many seeds and cells there are to do); then
#: for each study "start" None, "seeds" (to compute, all),
#: "seed" (done, to compute), "note" text, "stage" (text,), "cell" (index, count), "end" Outcome.
Listener = Callable[[str, str, Any], None]


@dataclass
class _Waiting:
    """A study whose notebook has not started yet."""

    job: Job
    #: Seeds not handed out yet; how many are under way; how many there were.
    seeds: deque[int]
    under_way: int = 0
    count: int = 0
    failures: list[tuple[int, Failure]] = field(default_factory=list)
    started: float | None = None
    began: str = ""

    @property
    def ready(self) -> bool:
        return not self.seeds and not self.under_way

    def start(self, tell: Listener) -> None:
        """Note the time of its first step."""
        if self.started is None:
            self.started, self.began = time.monotonic(), _now()
            tell(self.job.name, "start", None)
            if self.job.seeds is not None:
                tell(self.job.name, "seeds", (self.count, len(self.job.seeds.seeds)))


def run_jobs(
    jobs: Sequence[Job], *, parallel: int = 1, scheduler: str | None = None, listen: Listener | None = None
) -> list[Outcome]:
    """Run jobs on ``parallel`` processes in all; one that fails does not stop the others.

    Parameters
    ----------
    scheduler
        Address of a cluster that computes the seeds; the notebooks run here.

    Returns
    -------
    list of Outcome
        In the order of ``jobs``.

    Raises
    ------
    WildlabError
        If the cluster cannot be used, or is lost on the way.
    KeyboardInterrupt
        After everything started here has been ended and its unfinished files removed.
    """
    tell = listen or (lambda *_: None)
    for folder in {Path(job.reports) for job in jobs}:
        folder.mkdir(parents=True, exist_ok=True)
        sweep(folder)
    waiting = [_waiting(job) for job in jobs]
    tell("", "plan", sum(one.count + one.job.cells for one in waiting))
    patience_s = max((job.timeout_s for job in jobs), default=0.0)
    with WorkerPool() if scheduler is None else Cluster(scheduler, timeout_s=patience_s) as pool:
        outcomes = _Scheduler(waiting, pool, max(1, parallel), tell).run()
    return [outcomes[job.name] for job in jobs]


def _waiting(job: Job) -> _Waiting:
    if job.seeds is None:
        return _Waiting(job, deque())
    missing = missing_seeds(job.seeds)
    return _Waiting(job, deque(missing), count=len(missing))


@dataclass
class _Scheduler:
    waiting: list[_Waiting]
    pool: WorkerPool | Cluster
    parallel: int
    tell: Listener
    running: list[_Running] = field(default_factory=list)
    outcomes: dict[str, Outcome] = field(default_factory=dict)
    #: Cases of which a seed has been computed here.
    known: set[str] = field(default_factory=set)

    def run(self) -> dict[str, Outcome]:
        try:
            while self.waiting or self.running:
                self.start_notebooks()
                self.hand_out_seeds()
                connection.wait([*(one.pipe for one in self.running), *self.pool.pipes], timeout=0.25)
                self.collect_seeds()
                self.collect_notebooks()
        finally:
            for one in self.running:
                one.end()
                clear(one.job)
        return self.outcomes

    @property
    def room(self) -> int:
        """How many more processes may be started."""
        return self.parallel - len(self.running) - self.pool.size

    def start_notebooks(self) -> None:
        for one in [one for one in self.waiting if one.ready]:
            one.start(self.tell)
            if one.failures:
                self.waiting.remove(one)
                self.end(one.job, _finish_without_notebook(one))
                continue
            if self.room < 1:
                self.pool.shutdown(1)
            if self.room < 1:
                return
            self.waiting.remove(one)
            self.running.append(_start(one))

    def hand_out_seeds(self) -> None:
        if any(one.ready for one in self.waiting):
            return
        for one in self.waiting:
            while one.seeds and one.job.seeds is not None and self.pool.places(self.room):
                if self.compiling(one.job.seeds.case):
                    break
                one.start(self.tell)
                self.pool.submit(one.job.seeds, one.seeds[0], one.job.timeout_s)
                one.seeds.popleft()
                one.under_way += 1
        if not any(one.seeds for one in self.waiting):
            self.pool.shutdown(self.pool.size)

    def compiling(self, case: str) -> bool:
        """Whether the first seed of a case is under way: what its process compiles on first use of this
        machine, the others shall find compiled."""
        under_way = {one.job.seeds.case for one in self.waiting if one.under_way and one.job.seeds}
        return isinstance(self.pool, WorkerPool) and case in under_way - self.known

    def collect_seeds(self) -> None:
        by_name = {one.job.name: one for one in self.waiting}
        for result in self.pool.collect():
            one = by_name[result.study]
            one.under_way -= 1
            if one.job.seeds is not None:
                self.known.add(one.job.seeds.case)
            if result.failure is not None:
                one.failures.append((result.seed, result.failure))
            self.tell(one.job.name, "seed", (one.count - len(one.seeds) - one.under_way, one.count))
        for name, text in self.pool.notes():
            self.tell(name, "note", text)

    def collect_notebooks(self) -> None:
        for one in list(self.running):
            if one.over(self.tell):
                self.running.remove(one)
                self.end(one.job, _finish(one.job, one.failure, one.cell, one.started, one.began))

    def end(self, job: Job, outcome: Outcome) -> None:
        self.outcomes[job.name] = outcome
        self.tell(job.name, "end", outcome)


@dataclass
class _Running:
    job: Job
    process: BaseProcess
    pipe: connection.Connection
    #: When the study began, its seeds included, and when this process did.
    started: float
    began: str
    alone: float
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
                    f"Its process crashed or was ended from outside (exit code {self.process.exitcode}); "
                    "the usual cause is too little memory: close other programs, or run with `--jobs 1`"
                )
            elif time.monotonic() - self.alone > self.job.timeout_s:
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


def _start(waiting: _Waiting) -> _Running:
    job = waiting.job
    clear(job)
    Path(job.work).mkdir(parents=True)
    ours, theirs = connection.Pipe(duplex=False)
    process = start_process(f"wildlab {job.name}", run_notebook, theirs, job)
    theirs.close()
    now = time.monotonic()
    return _Running(job, process, ours, waiting.started or now, waiting.began, now)


def _finish_without_notebook(one: _Waiting) -> Outcome:
    """The end of a study whose seeds failed. Those that did not are kept."""
    clear(one.job)
    Path(one.job.work).mkdir(parents=True)
    first = min(one.failures, key=lambda failed: failed[0])[1]
    reason = failed_seeds([(seed, failure.reason) for seed, failure in one.failures])
    failure = Failure(f"{reason[:1].upper()}{reason[1:]}.", "", first.details)
    return _finish(one.job, failure, None, one.started or time.monotonic(), one.began)


def _finish(job: Job, failure: Failure | None, cell: int | None, started: float, began: str) -> Outcome:
    """Move the outputs into place and say how it went."""
    folder, target = Path(job.work), Path(job.reports) / job.name
    seconds = round(time.monotonic() - started, 1)
    status: dict[str, Any] = {
        "study": job.name,
        "state": "failed" if failure else "done",
        "reason": failure.reason if failure else "",
        "started": began,
        "finished": _now(),
        "seconds": seconds,
        "fingerprint": job.fingerprint,
        # Of what the page shows less than the study's own: {"seeds": [5, 200]}; {} where it is whole.
        "first_look": {} if failure else job.first_look,
    }
    try:
        if failure is not None:
            leave_failure(job, failure, cell, status, folder)
        install(folder, target, status)
    finally:
        clear(job)
    if failure is None and job.seeds is not None:
        sweep_seeds(job.seeds)
    return Outcome(job.name, str(status["state"]), seconds, str(status["reason"]), target)


def _now() -> str:
    return datetime.now(UTC).isoformat(timespec="seconds")


def _duration(seconds: float) -> str:
    return f"{seconds / 60:g} minutes" if seconds >= 120 else f"{seconds:g} seconds"
