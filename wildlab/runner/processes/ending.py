"""Ending processes for certain, starting them on one thread each, and where their sockets lie."""

from __future__ import annotations

import contextlib
import os
import signal
import tempfile
from collections.abc import Iterator
from pathlib import Path

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


def socket_folder() -> Path:
    """Where sockets may lie: their paths must be short, and macOS's temporary folder is not."""
    short = Path("/tmp")  # noqa: S108 - a folder of our own is made in it, readable by us alone
    return short if os.access(short, os.W_OK | os.X_OK) else Path(tempfile.gettempdir())
