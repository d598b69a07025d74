"""Starting processes, on one thread each and with what is large loaded, hearing what they say, and ending
them for certain.

Each is a session of its own, so that Ctrl-C reaches the runner alone, and ends with the runner, whatever ends
that. Several threads would take the place of other processes, and a sum over threads is not always added up
in the same order.
"""

from __future__ import annotations

import contextlib
import multiprocessing
import os
import signal
import threading
import time
from collections.abc import Callable, Iterator
from multiprocessing import connection, forkserver, parent_process, resource_tracker
from multiprocessing.process import BaseProcess
from typing import Any

#: What makes numpy, scipy, numba, OpenCV and Arrow compute on one thread; read when they are imported.
ONE_THREAD = dict.fromkeys(
    (
        "OMP_NUM_THREADS",
        "OPENBLAS_NUM_THREADS",
        "MKL_NUM_THREADS",
        "VECLIB_MAXIMUM_THREADS",
        "NUMBA_NUM_THREADS",
        "OPENCV_FOR_THREADS_NUM",
    ),
    "1",
)


#: What a process has loaded at its start, where the system can fork: packages, which take most of that time.
#: The rooms of wildlab are read anew by each process, for they may have been changed meanwhile.
_PRELOADED = (
    "wildlab",
    "pandas",
    "scipy.optimize",
    "scipy.signal",
    "scipy.spatial.transform",
    "numba",
    "matplotlib.figure",
    "matplotlib.backends.backend_agg",
    "nbformat",
    "papermill",
    "IPython.core.interactiveshell",
    "pydantic.main",
    "cv2",
    "pyarrow.parquet",
    "pymap3d",
    "jinja2",
    "bs4",
)


def start_server() -> None:
    """Start what processes are forked from, where the system can fork: it loads packages in the meantime."""
    if "forkserver" in multiprocessing.get_all_start_methods():
        forkserver.set_forkserver_preload(list(_PRELOADED))
        with one_thread(), _uninterrupted():
            forkserver.ensure_running()


def start_process(name: str, target: Callable[..., None], *arguments: Any) -> BaseProcess:
    """Start a process on one thread, with this one's environment, and nothing else of its memory."""
    start_server()
    fork = "forkserver" in multiprocessing.get_all_start_methods()
    context: Any = multiprocessing.get_context("forkserver" if fork else "spawn")
    with one_thread(), _uninterrupted():
        given = (dict(os.environ), target, *arguments)
        process: BaseProcess = context.Process(target=_begin, args=given, name=name)
        process.start()
    return process


@contextlib.contextmanager
def _uninterrupted() -> Iterator[None]:
    """What is started meanwhile is deaf to Ctrl-C, which is for the one that ends it: neither it nor the
    server that it is forked from has anything to say to the terminal."""
    if not hasattr(signal, "pthread_sigmask"):
        yield
        return
    resource_tracker.ensure_running()  # it hears Ctrl-C again once it has started its own process
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def _begin(environment: dict[str, str], target: Callable[..., None], *arguments: Any) -> None:
    """Body of the process: the one it is forked from has the environment of its own start."""
    os.environ.clear()
    os.environ.update(environment)
    target(*arguments)


@contextlib.contextmanager
def one_thread() -> Iterator[None]:
    """What is started meanwhile computes on one thread."""
    before = {name: os.environ.get(name) for name in ONE_THREAD}
    os.environ.update(ONE_THREAD)
    try:
        yield
    finally:
        for name, value in before.items():
            if value is None:
                del os.environ[name]
            else:
                os.environ[name] = value


class Child:
    """A process that does what it is given, one thing after the other, and says how it goes.

    It says ``(kind, content)``; what is over ends with ``"done"`` or ``"failed"``.

    Attributes
    ----------
    doing
        What it does, for whoever gave it; None where it waits.
    """

    def __init__(self, name: str, target: Callable[..., None], *arguments: Any) -> None:
        self.pipe, theirs = connection.Pipe()
        self._process = start_process(name, target, theirs, *arguments)
        theirs.close()
        self.doing: Any = None
        self._ends, self._limit = float("inf"), 0.0

    def do(self, doing: Any, timeout_s: float, *given: Any) -> None:
        """Note what it does, and for how long it may; what is given is sent to it."""
        self.doing, self._limit, self._ends = doing, timeout_s, time.monotonic() + timeout_s
        with contextlib.suppress(OSError):  # its end is noticed by `hear`
            for one in given:
                self.pipe.send(one)

    def hear(self) -> tuple[str, Any] | None:
        """What it has said next, if anything; ``("lost", reason)`` where it died or is out of time."""
        gone = not self._process.is_alive()
        try:
            if self.pipe.poll():
                said: tuple[str, Any] = self.pipe.recv()
                return said
        except (EOFError, OSError):
            gone = True
        if gone:
            self._process.join(5)
            return "lost", (
                f"Its process crashed or was ended from outside (exit code {self._process.exitcode}); the "
                "usual cause is too little memory: close other programs, or run with `--jobs 1`."
            )
        if time.monotonic() < self._ends:
            return None
        limit = f"{self._limit / 60:g} minutes" if self._limit >= 120 else f"{self._limit:g} seconds"
        return "lost", (
            f"It was stopped at its time limit of {limit}. If it only needs longer, give it more: "
            "`--timeout MINUTES`."
        )

    def end(self, patience_s: float = 0.0) -> None:
        """End it and all below it, unless it does so itself in time. Harmless where it has ended."""
        self._process.join(patience_s)
        if self._process.pid is not None and self._process.is_alive():
            end_tree(self._process.pid)
        self._process.join()
        self.pipe.close()


def end_with_runner(tidy: Callable[[], None] = lambda: None) -> threading.Thread:
    """Make this process a session of its own that ends, with all below it, when the one that started it is
    gone; ``tidy`` is called last."""

    def wait() -> None:
        if runner_is_gone(None):
            end_below(os.getpid())
            tidy()
            os.kill(os.getpid(), signal.SIGKILL)

    os.setsid()
    waiting = threading.Thread(target=wait, daemon=True)
    waiting.start()
    return waiting


def runner_is_gone(timeout_s: float | None) -> bool:
    """Whether the process that started this one ends in that time."""
    parent = parent_process()
    return parent is not None and bool(connection.wait([parent.sentinel], timeout_s))


def end_tree(pid: int) -> None:
    """End a process and everything below it, at once; a process that is gone already is no error."""
    end_below(pid)
    with contextlib.suppress(ProcessLookupError):
        os.kill(pid, signal.SIGKILL)


def end_below(pid: int) -> None:
    """End everything below a process, at once."""
    import psutil  # type: ignore[import-untyped]

    with contextlib.suppress(psutil.NoSuchProcess):
        for process in psutil.Process(pid).children(recursive=True):
            with contextlib.suppress(psutil.NoSuchProcess):
                process.kill()
