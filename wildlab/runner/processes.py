"""Starting processes, on one thread each and with what is large loaded, and ending them for certain."""

from __future__ import annotations

import contextlib
import multiprocessing
import os
import signal
from collections.abc import Callable, Iterator
from multiprocessing import forkserver, resource_tracker
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
    "nbformat",
    "IPython.core.interactiveshell",
    "pydantic",
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
    """What is started meanwhile computes on one thread.

    Several would take the place of other processes, and a sum over threads is not always added up in the same
    order.
    """
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
