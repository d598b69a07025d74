"""What runs when: notebooks and the seeds they need, so many processes at a time and no more.

A notebook starts once its seeds are there. One that is ready goes before further seeds, and a process that
has computed seeds ends where a notebook needs its place.

Seeds may be computed by a cluster of `dask.distributed` (the extra ``cluster``), whose every worker needs the
same wildlab and the same environment; whether it has them is looked at before it computes. It sends numbers
and nothing else, and this process puts them into the same store. A worker that is lost costs its seeds under
way, which another one computes again.
"""

from __future__ import annotations

import re
import time
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass, field
from datetime import UTC, datetime
from multiprocessing import connection
from pathlib import Path
from typing import Any

from wildlab.errors import RunFailed, WildlabError
from wildlab.runner.job import Failure, Job, clear, install, leave_failure, log_of, run_notebook, sweep
from wildlab.runner.processes import Child
from wildlab.runner.seeds import (
    SeedWork,
    answer,
    failed_seeds,
    missing_seeds,
    serve,
    sweep_seeds,
    write_seed,
)
from wildlab.runner.status import read_status


@dataclass(frozen=True)
class Outcome:
    """How a run ended: ``state`` is "done", "failed" or "skipped"; ``reason`` says why in a sentence."""

    name: str
    state: str
    seconds: float
    reason: str = ""
    folder: Path | None = None


#: Called with (name, event, what). First of all ("", "plan", how many seeds and cells there are to do); then
#: for each study "start" seconds of the last time or None, "seeds" (to compute, all),
#: "seed" (done, to compute), "note" text, "stage" (text,), "cell" (index, count), "end" Outcome; and several
#: times a second ("", "tick", None).
Listener = Callable[[str, str, Any], None]


@dataclass
class _Study:
    """A study on its way: its seeds, then its notebook, if it has one."""

    name: str
    work: SeedWork | None
    job: Job | None = None
    #: Seeds not handed out yet; how many are under way; how many there were.
    seeds: deque[int] = field(default_factory=deque)
    under_way: int = 0
    count: int = 0
    failures: list[tuple[int, Failure]] = field(default_factory=list)
    #: When it began, its seeds included; the notebook's cell under way.
    started: float | None = None
    began: str = ""
    cell: int | None = None
    #: Whether its notebook waits for the jobs that it comes after.
    waits: bool = False

    def __post_init__(self) -> None:
        self.seeds.extend([] if self.work is None else missing_seeds(self.work))
        self.count = len(self.seeds)

    @property
    def ready(self) -> bool:
        return not self.seeds and not self.under_way

    def start(self, tell: Listener) -> None:
        """Note the time of its first step."""
        if self.started is None:
            self.started, self.began = time.monotonic(), _now()
            last: dict[str, Any] = {}
            if self.job is not None and self.work is None:  # which of its seeds were there, nobody knows
                last = read_status(Path(self.job.reports) / self.job.name)
            tell(self.name, "start", last.get("seconds") if last.get("state") == "done" else None)
            if self.work is not None:
                tell(self.name, "seeds", (self.count, len(self.work.seeds)))


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
    waiting = [_Study(job.name, job.seeds, job) for job in jobs]
    tell("", "plan", sum(one.count + job.cells for one, job in zip(waiting, jobs, strict=True)))
    patience_s = max((job.timeout_s for job in jobs), default=0.0)
    with nullcontext() if scheduler is None else Cluster(scheduler, timeout_s=patience_s) as cluster:
        outcomes = _Scheduler(waiting, cluster, max(1, parallel), tell).run()
    return [outcomes[job.name] for job in jobs]


def compute_seeds(
    works: Sequence[SeedWork], parallel: int, tell: Callable[[int, int], object]
) -> dict[str, str]:
    """Compute the seeds that are missing.

    Parameters
    ----------
    parallel
        How many processes.
    tell
        Called with how many seeds are done, of how many.

    Returns
    -------
    dict
        By the work's study why it failed: one flight that cannot be computed is enough.
    """
    waiting = [_Study(work.study, work) for work in works]
    total, over = sum(one.count for one in waiting), 0

    def listen(_: str, event: str, __: Any) -> None:
        nonlocal over
        if event == "seed":
            over += 1
            tell(over, total)

    _Scheduler(list(waiting), None, parallel, listen).run()
    return {one.name: _reason(one) for one in waiting if one.failures}


@dataclass
class _Scheduler:
    waiting: list[_Study]
    cluster: Cluster | None
    parallel: int
    tell: Listener
    #: Of this machine: those that compute seeds, or wait for more, and notebooks.
    children: list[Child] = field(default_factory=list)
    outcomes: dict[str, Outcome] = field(default_factory=dict)
    #: Cases of which a seed has been computed here.
    known: set[str] = field(default_factory=set)

    def run(self) -> dict[str, Outcome]:
        try:
            while self.waiting or self.busy:
                self.start_notebooks()
                self.hand_out_seeds()
                connection.wait([child.pipe for child in self.busy], timeout=0.25)
                self.collect()
                self.tell("", "tick", None)
        finally:
            for child in self.children:
                child.end()
                if child.doing is not None and child.doing[1] is None:
                    clear(child.doing[0].job)
        return self.outcomes

    @property
    def busy(self) -> list[Child]:
        return [child for child in self.children if child.doing is not None]

    @property
    def room(self) -> int:
        """How many more processes may be started."""
        return self.parallel - len(self.children)

    def start_notebooks(self) -> None:
        for one in [one for one in self.waiting if one.ready]:
            if one.job is not None and not one.failures:
                if self.room < 1:
                    self.dismiss(1)
                if self.room < 1:
                    return
            self.waiting.remove(one)
            if one.job is None:
                continue
            one.start(self.tell)
            clear(one.job)
            Path(one.job.work).mkdir(parents=True)
            if one.failures:
                # Those that did not fail are kept.
                details = min(one.failures, key=lambda failed: failed[0])[1].details
                reason = _reason(one)
                self.end(one, one.job, Failure(f"{reason[:1].upper()}{reason[1:]}.", "", details))
                continue
            child = Child(f"wildlab {one.name}", run_notebook, one.job)
            child.do((one, None), one.job.timeout_s)
            self.children.append(child)

    def hand_out_seeds(self) -> None:
        if any(one.ready for one in self.waiting):
            return
        for one in self.waiting:
            while one.seeds and one.work is not None and not self.compiling(one.work.case):
                if not self.submit(one, one.work, one.seeds[0]):
                    return
                one.start(self.tell)
                one.seeds.popleft()
                one.under_way += 1
        if not any(one.seeds for one in self.waiting):
            self.dismiss(len(self.children))

    def submit(self, one: _Study, work: SeedWork, seed: int) -> bool:
        """Hand a seed to the cluster, to an idle process or a new one; False where there is no room."""
        given = (work.case, seed, work.parameters, work.code)
        if self.cluster is not None:
            self.cluster.submit((one, seed), given)
            return True
        idle = next((child for child in self.children if child.doing is None), None)
        if idle is None:
            if self.room < 1:
                return False
            idle = Child("wildlab seeds", serve)
            self.children.append(idle)
        idle.do((one, seed), float("inf") if one.job is None else one.job.timeout_s, given)
        return True

    def dismiss(self, count: int) -> None:
        """End so many processes at most, of those that have nothing to do."""
        for child in [child for child in self.children if child.doing is None][:count]:
            self.children.remove(child)
            child.end()

    def compiling(self, case: str) -> bool:
        """Whether the first seed of a case is under way: what its process compiles on first use of this
        machine, the others shall find compiled."""
        under_way = {one.work.case for one in self.waiting if one.under_way and one.work}
        return self.cluster is None and case in under_way - self.known

    def collect(self) -> None:
        for child in self.busy:
            while child.doing is not None and (said := child.hear()) is not None:
                self.take(child, *said)
        for child in self.busy:
            one, job = child.doing[0], child.doing[0].job
            if one.waits and self.outcomes.keys() >= set(job.after):
                one.waits = False
                child.do(child.doing, job.timeout_s, None)
        if self.cluster is not None:
            for (one, seed), said in self.cluster.collect():
                self.take_seed(one, seed, *said)

    def take(self, child: Child, kind: str, content: Any) -> None:
        """What a process says."""
        one, seed = child.doing
        if kind not in ("done", "failed", "lost"):
            one.cell = content[0] if kind == "cell" else one.cell
            one.waits |= kind == "after"
            self.tell(one.name, kind, content)
            return
        child.doing = None
        if kind == "lost" or seed is None:
            self.children.remove(child)
            child.end(0.0 if kind == "lost" else 3.0)
        if kind == "lost":
            content = Failure(content, "", log_of(one.job) if seed is None else "")
        if seed is not None:
            self.take_seed(one, seed, kind, content)
        else:
            self.end(one, one.job, content)

    def take_seed(self, one: _Study, seed: int, kind: str, content: Any) -> None:
        """A seed that is over: its numbers go into the store."""
        assert one.work is not None  # noqa: S101 - for the type checker
        one.under_way -= 1
        self.known.add(one.work.case)
        if kind == "done":
            write_seed(one.work, seed, content)
        else:
            one.failures.append((seed, Failure(*content)))
        self.tell(one.name, "seed", (one.count - len(one.seeds) - one.under_way, one.count))

    def end(self, one: _Study, job: Job, failure: Failure | None) -> None:
        """Move the outputs into place, and say how it went."""
        folder, target = Path(job.work), Path(job.reports) / job.name
        seconds = round(time.monotonic() - (one.started or 0.0), 1)
        status: dict[str, Any] = {
            "study": job.name,
            "state": "failed" if failure else "done",
            "reason": failure.reason if failure else "",
            "started": one.began,
            "finished": _now(),
            "seconds": seconds,
            "fingerprint": job.fingerprint,
            # Of what the page shows less than the study's own: {"seeds": [5, 200]}; {} where it is whole.
            "first_look": {} if failure else job.first_look,
        }
        try:
            if failure is not None:
                leave_failure(job, failure, one.cell, status, folder)
            install(folder, target, status)
        finally:
            clear(job)
        if failure is None and job.seeds is not None:
            sweep_seeds(job.seeds)
        outcome = Outcome(job.name, str(status["state"]), seconds, str(status["reason"]), target)
        self.outcomes[job.name] = outcome
        self.tell(job.name, "end", outcome)


def _reason(one: _Study) -> str:
    return failed_seeds([(seed, failure.reason) for seed, failure in one.failures])


def _now() -> str:
    return datetime.now(UTC).isoformat(timespec="seconds")


_ADDRESS = re.compile(r"(tcp|tls)://(\[[0-9A-Fa-f:.]+\]|[\w.-]+):\d{1,5}")
#: How long a scheduler may take to answer at first, in seconds.
PATIENCE_S = 15
#: How often a seed is tried again whose worker could not take it up (not: whose computation failed).
RETRIES = 2


class Cluster(AbstractContextManager["Cluster"]):
    """A cluster that computes seeds in place of processes of this machine; the queue is its scheduler's.

    Parameters
    ----------
    address
        Of the scheduler: ``tcp://HOST:PORT``, or ``tls://HOST:PORT`` with dask configured for it.
    timeout_s
        How long to wait for the next seed before giving up.

    Raises
    ------
    WildlabError
        If dask is not installed, the address is none, no scheduler answers there, or it has no workers.
    """

    def __init__(self, address: str, *, timeout_s: float = 1800.0) -> None:
        self._client = _connect(address)
        self._timeout_s = timeout_s
        self._heard = time.monotonic()
        self._under_way: dict[Any, Any] = {}

    def __exit__(self, *_: object) -> None:
        if self._under_way and self._client.status == "running":
            self._client.cancel(list(self._under_way), force=True)
        self._client.close(timeout=5)

    def submit(self, doing: Any, given: Sequence[Any]) -> None:
        """Send what `wildlab.runner.seeds.answer` takes to the scheduler."""
        if not self._under_way:
            self._heard = time.monotonic()
        self._under_way[self._client.submit(answer, *given, pure=False, retries=RETRIES)] = doing

    def collect(self) -> Iterator[tuple[Any, tuple[str, Any]]]:
        """What is over since the last time, with its answer.

        Raises
        ------
        RunFailed
            If the scheduler is gone, or nothing was heard for too long.
        """
        for future in [one for one in self._under_way if one.done()]:
            self.refuse_lost()
            doing, self._heard = self._under_way.pop(future), time.monotonic()
            try:
                said: tuple[str, Any] = future.result(timeout=PATIENCE_S)
            except Exception as error:  # the worker's, or dask's own
                self.refuse_lost()
                why = f"{type(error).__name__}: {error}".splitlines()[0][:300]
                said = "failed", (f"The cluster could not compute it ({why}).", "", "")
            yield doing, said
        self.refuse_lost()

    def refuse_lost(self) -> None:
        """Stop where the scheduler is gone, or says nothing."""
        if not self._under_way:
            return
        lost = self._client.status != "running"
        if lost or time.monotonic() - self._heard > self._timeout_s:
            raise RunFailed(
                "the connection to the scheduler is lost"
                if lost
                else f"no seed came back from the cluster for {self._timeout_s:g} s",
                "see that it and its workers run, and run it again; the finished seeds are kept",
                field="--scheduler",
            )


def _connect(address: str) -> Any:
    try:
        from distributed import Client
    except ImportError as error:
        raise WildlabError(
            "a cluster needs dask.distributed, which is not installed here",
            "install it: python -m pip install distributed (in a checkout: make environment)",
            field="--scheduler",
        ) from error
    if not _ADDRESS.fullmatch(address):
        raise WildlabError(
            f"{address!r} is no address of a scheduler",
            "give it as the scheduler prints it, for example tcp://127.0.0.1:8786",
            field="--scheduler",
        )
    try:
        client = Client(address, timeout=PATIENCE_S, set_as_default=False)
    except (OSError, TimeoutError, ValueError, RuntimeError) as error:
        raise WildlabError(
            f"no scheduler answers at {address}",
            "start one (dask scheduler), and see that its port can be reached from here",
            field="--scheduler",
        ) from error
    if not client.scheduler_info()["workers"]:
        client.close(timeout=5)
        raise WildlabError(
            f"the scheduler at {address} has no workers",
            f"start some, in this environment: dask worker {address} --nthreads 1",
            field="--scheduler",
        )
    return client
