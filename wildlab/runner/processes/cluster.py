"""Seeds on a cluster of `dask.distributed` (the extra ``cluster``) in place of processes of this machine.

Every worker needs the same wildlab and the same environment; whether it has them is looked at before it
computes. It sends numbers and nothing else, and this process puts them into the same store. A worker that is
lost costs its seeds under way, which another one computes again.
"""

from __future__ import annotations

import re
import time
from contextlib import AbstractContextManager
from multiprocessing import connection
from typing import Any

from wildlab.errors import RunFailed, WildlabError
from wildlab.runner.processes.job import Failure
from wildlab.runner.processes.worker_pool import SeedResult, answer, keep
from wildlab.runner.seeds import SeedWork

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
