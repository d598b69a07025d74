"""What computes seeds: processes of this machine, or a cluster.

Processes are started when there is work, kept while there is more, and ended with their runner, whatever ends
that. Like a notebook's process, each is a session of its own, so that Ctrl-C reaches the runner alone. Each
computes on one thread: several would take the place of other processes, and a sum over threads is not always
added up in the same order.

Every worker of a cluster of `dask.distributed` (the extra ``cluster``) needs the same wildlab and the same
environment; whether it has them is looked at before it computes. It sends numbers and nothing else, and this
process puts them into the same store. A worker that is lost costs its seeds under way, which another one
computes again.
"""

from __future__ import annotations

import contextlib
import logging
import os
import re
import threading
import time
import traceback
from collections.abc import Callable, Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass
from multiprocessing import connection, parent_process
from multiprocessing.process import BaseProcess
from typing import Any, NamedTuple

from wildlab.errors import RunFailed, WildlabError
from wildlab.reporting.notebook_pages import clean_text
from wildlab.runner.job import Failure
from wildlab.runner.processes import end_tree, start_process
from wildlab.runner.seeds import SeedWork, code_key, failed_seeds, missing_seeds, write_seed


class SeedResult(NamedTuple):
    """A seed that is over: its numbers are in the store, or it failed."""

    study: str
    seed: int
    failure: Failure | None = None


def answer(case: str, seed: int, parameters: dict[str, Any], code: str) -> tuple[str, Any]:
    """``("done", values)`` or ``("failed", (reason, "", details))`` for one seed, here or on a cluster.

    ``code`` is the runner's `code_key`: numbers of other code are not mixed in.
    """
    from wildlab.studies.protocol import run_trial

    try:
        _same_code(code)
        return "done", run_trial(case, seed, parameters)
    except Exception as error:  # whatever it is, the runner must hear of it
        known = isinstance(error, WildlabError)
        reason = str(error) if known else f"The computation raised {type(error).__name__}: {error}."
        return "failed", (clean_text(reason), "", clean_text(traceback.format_exc()))


def keep(work: SeedWork, seed: int, said: tuple[str, Any]) -> Failure | None:
    """Put an answer's numbers into the store; the failure where there are none."""
    kind, content = said
    if kind == "failed":
        return Failure(*content)
    write_seed(work, seed, content)
    return None


#: The code that this process runs; looked up once, because modules are imported once.
_CODE: list[str] = []


def _same_code(code: str) -> None:
    if not _CODE:
        _CODE.append(code_key())
    if _CODE[0] != code:
        raise WildlabError(
            "the code, the twins' parameters or the packages here are not those that the run began with",
            "run it again; on a cluster, give every worker the same wildlab and environment",
        )


def serve(pipe: connection.Connection) -> None:
    """Body of a process: a seed comes in, an answer goes out; ends when the pipe does."""
    os.setsid()
    threading.Thread(target=_end_with_parent, daemon=True).start()
    nowhere = os.open(os.devnull, os.O_WRONLY)
    for stream in (1, 2):  # a warning would break the runner's display
        os.dup2(nowhere, stream)
    logger = logging.getLogger("wildlab")
    logger.setLevel(logging.INFO)
    logger.addHandler(_ToRunner(pipe))
    with contextlib.suppress(EOFError, OSError):
        while True:
            pipe.send(answer(*pipe.recv()))


class _ToRunner(logging.Handler):
    """What the code below logs (that it compiles, which takes a while) goes to the runner, to be shown."""

    def __init__(self, pipe: connection.Connection) -> None:
        super().__init__(logging.INFO)
        self._pipe = pipe

    def emit(self, record: logging.LogRecord) -> None:
        with contextlib.suppress(OSError):
            self._pipe.send(("note", record.getMessage()))


def _end_with_parent() -> None:
    parent = parent_process()
    if parent is not None:
        connection.wait([parent.sentinel])
        end_tree(os.getpid())


@dataclass
class _Worker:
    process: BaseProcess
    pipe: connection.Connection
    work: SeedWork | None = None
    seed: int = 0
    ends: float = 0.0

    def end(self) -> None:
        self.pipe.close()
        if self.process.pid is not None and self.process.is_alive():
            end_tree(self.process.pid)
        self.process.join()


class WorkerPool(AbstractContextManager["WorkerPool"]):
    """The processes of one run. Use it in a ``with``: leaving it ends them all."""

    def __init__(self) -> None:
        self._workers: list[_Worker] = []
        self._notes: list[tuple[str, str]] = []

    def __exit__(self, *_: object) -> None:
        self.shutdown(len(self._workers), idle=False)

    @property
    def size(self) -> int:
        """How many processes there are."""
        return len(self._workers)

    @property
    def pipes(self) -> list[connection.Connection]:
        """What to wait for: something can be read here when a seed is over."""
        return [worker.pipe for worker in self._workers if worker.work is not None]

    def places(self, room: int) -> int:
        """How many seeds it can take now, if it may start ``room`` more processes."""
        return self.size - len(self.pipes) + max(0, room)

    def submit(self, work: SeedWork, seed: int, timeout_s: float = float("inf")) -> None:
        """Hand a seed to an idle process, or to a new one where none is idle."""
        worker = next((one for one in self._workers if one.work is None), None) or self._start()
        worker.work, worker.seed, worker.ends = work, seed, time.monotonic() + timeout_s
        with contextlib.suppress(OSError):  # its end is noticed by `collect`
            worker.pipe.send((work.case, seed, work.parameters, work.code))

    def collect(self, wait_s: float = 0.0) -> list[SeedResult]:
        """The seeds that are over since the last time; their numbers are in the store."""
        if wait_s:
            connection.wait(self.pipes, timeout=wait_s)
        return [result for worker in list(self._workers) if (result := self._result(worker)) is not None]

    def notes(self) -> list[tuple[str, str]]:
        """(study, text) of what the processes have logged since the last time."""
        notes, self._notes = self._notes, []
        return notes

    def shutdown(self, count: int, *, idle: bool = True) -> None:
        """End up to ``count`` processes; only such as have nothing to do, unless told otherwise."""
        for worker in [one for one in self._workers if one.work is None or not idle][: max(0, count)]:
            self._workers.remove(worker)
            worker.end()

    def _start(self) -> _Worker:
        ours, theirs = connection.Pipe()
        process = start_process("wildlab seeds", serve, theirs)
        theirs.close()
        self._workers.append(_Worker(process, ours))
        return self._workers[-1]

    def _result(self, worker: _Worker) -> SeedResult | None:
        work, seed, gone = worker.work, worker.seed, not worker.process.is_alive()
        if work is None:
            return None
        said = None
        try:
            while said is None and worker.pipe.poll():
                said = worker.pipe.recv()
                if said[0] == "note":
                    self._notes.append((work.study, said[1]))
                    said = None
        except (EOFError, OSError):
            gone = True
        if said is not None:
            worker.work = None
            return SeedResult(work.study, seed, keep(work, seed, said))
        if not gone and time.monotonic() < worker.ends:
            return None
        worker.process.join(5 if gone else 0)
        code = worker.process.exitcode
        self._workers.remove(worker)
        worker.end()
        reason = f"its process ended without a word (exit code {code})" if gone else "it took too long"
        fix = (
            "the usual cause is too little memory: run with fewer --jobs" if gone else "--timeout gives more"
        )
        return SeedResult(work.study, seed, Failure(f"{reason}; {fix}.", "", ""))


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
    waiting = [(work, seed) for work in works for seed in missing_seeds(work)]
    total, done = len(waiting), 0
    failures: dict[str, str] = {}
    with WorkerPool() as pool:
        while waiting or pool.pipes:
            while waiting and pool.places(parallel - pool.size) > 0:
                work, seed = waiting.pop(0)
                if work.study in failures:
                    done += 1
                    continue
                pool.submit(work, seed)
            for result in pool.collect(wait_s=0.25):
                done += 1
                if result.failure is not None:
                    failures.setdefault(result.study, failed_seeds([(result.seed, result.failure.reason)]))
                tell(done, total)
    return failures


_ADDRESS = re.compile(r"(tcp|tls)://(\[[0-9A-Fa-f:.]+\]|[\w.-]+):\d{1,5}")
#: How long a scheduler may take to answer at first, in seconds.
PATIENCE_S = 15
#: How often a seed is tried again whose worker could not take it up (not: whose computation failed).
RETRIES = 2


class Cluster(AbstractContextManager["Cluster"]):
    """A cluster in place of a `worker_pool.WorkerPool`: takes no process of this machine's.

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

    size = 0

    def __init__(self, address: str, *, timeout_s: float = 1800.0) -> None:
        self._client = _connect(address)
        self._timeout_s = timeout_s
        self._heard = time.monotonic()
        self._under_way: dict[Any, tuple[SeedWork, int]] = {}
        self._over: Any = None

    def __exit__(self, *_: object) -> None:
        if self._under_way and self._client.status == "running":
            self._client.cancel(list(self._under_way), force=True)
        self._client.close(timeout=5)

    @property
    def pipes(self) -> list[connection.Connection]:
        """None: `collect` is to be asked."""
        return []

    def places(self, room: int) -> int:
        """Without bound: the scheduler keeps the queue. Whatever there is room for here is for notebooks."""
        return 1_000_000

    def submit(self, work: SeedWork, seed: int, timeout_s: float = float("inf")) -> None:
        """Send a seed to the scheduler."""
        from distributed import as_completed

        if not self._under_way:
            self._heard = time.monotonic()
        future = self._client.submit(
            answer, work.case, seed, work.parameters, work.code, pure=False, retries=RETRIES
        )
        self._under_way[future] = (work, seed)
        if self._over is None:
            self._over = as_completed([future], loop=self._client.loop, with_results=True, raise_errors=False)
        else:
            self._over.add(future)

    def collect(self, wait_s: float = 0.0) -> list[SeedResult]:
        """The seeds that are over since the last time; their numbers are in the store.

        Raises
        ------
        RunFailed
            If the scheduler is gone, or nothing was heard for too long.
        """
        time.sleep(wait_s)
        if not self._under_way:
            return []
        if self._client.status != "running":
            raise RunFailed(
                "the connection to the scheduler is lost",
                "see that it runs and run it again; the finished seeds are kept",
                field="--scheduler",
            )
        results = []
        for future, said in self._over.next_batch(block=False):
            work, seed = self._under_way.pop(future)
            failure = (
                keep(work, seed, said)
                if future.status == "finished"
                else Failure(f"The cluster could not compute it ({_lost(said)}).", "", "")
            )
            results.append(SeedResult(work.study, seed, failure))
        if results:
            self._heard = time.monotonic()
        elif time.monotonic() - self._heard > self._timeout_s:
            raise RunFailed(
                f"no seed came back from the cluster for {self._timeout_s:g} s",
                "see that its workers run and run it again, or give it more time with --timeout",
                field="--scheduler",
            )
        return results

    def notes(self) -> list[tuple[str, str]]:
        """None: what a cluster's workers log stays with them."""
        return []

    def shutdown(self, count: int) -> None:
        """Nothing to do: it takes no process of this machine's."""


def _lost(said: Any) -> str:
    """What dask says about a task that it could not run: an error, alone or with kind and traceback."""
    error = (
        next((one for one in said if isinstance(one, BaseException)), said)
        if isinstance(said, tuple)
        else said
    )
    return f"{type(error).__name__}: {error}".splitlines()[0][:300] if error is not None else "cancelled"


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
