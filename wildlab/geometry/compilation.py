"""Compiled functions: kept on disk after the first use, and a word where that first use takes its time.

They are kept in the user's cache folder by the content of their files, so that every checkout and installed
package with the same code shares them: a new clone does not compile for minutes what is there already.
"""

from __future__ import annotations

import hashlib
import logging
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import lru_cache
from pathlib import Path
from types import FunctionType
from typing import Any, TypeVar, cast

import numba
from numba.core import caching, event
from numba.core import config as numba_config

Function = TypeVar("Function", bound=Callable[..., Any])

#: Says at level INFO that something is being compiled: `logging.basicConfig(level=logging.INFO)` shows it.
LOGGER = logging.getLogger("wildlab.compilation")


def compiled(function: Function) -> Function:
    """Compile at the first call with new types, and keep the result in the user's cache folder.

    Division by zero gives infinity or NaN, as in numpy.
    """
    decorate = numba.njit(cache=True, error_model="numpy")
    with _kept_by_content():
        return cast(Function, decorate(function))


class ByContent(caching.UserWideCacheLocator):
    """Where numba keeps a function: by the content of its file and of those whose functions it may call."""

    def __init__(self, py_func: FunctionType, py_file: str) -> None:
        super().__init__(py_func, py_file)  # type: ignore[no-untyped-call]
        self._cache_path = str(Path(self._cache_path).with_name(f"wildlab-{_digest(py_func)}"))


@contextmanager
def _kept_by_content() -> Iterator[None]:
    """Within it numba asks `ByContent` first where to keep a function, unless the user has said where."""
    config: Any = numba_config
    before = config.CACHE_LOCATOR_CLASSES
    if not before and not config.CACHE_DIR:
        ours = f"{ByContent.__module__}.{ByContent.__qualname__}"
        others = (caching.InTreeCacheLocator, caching.UserWideCacheLocator)
        config.CACHE_LOCATOR_CLASSES = ",".join([ours, *(one.__name__ for one in others)])
    try:
        yield
    finally:
        config.CACHE_LOCATOR_CLASSES = before


def _digest(function: FunctionType) -> str:
    """Of the function's file, and of the files of all compiled functions that its module knows."""
    files, waiting = set[str](), [function]
    while waiting:
        one = waiting.pop()
        if one.__code__.co_filename not in files:
            files.add(one.__code__.co_filename)
            waiting += [known.py_func for known in one.__globals__.values() if hasattr(known, "py_func")]
    said = sorted(_file_digest(file) for file in files)
    return hashlib.sha256("".join(said).encode()).hexdigest()[:32]


@lru_cache
def _file_digest(file: str) -> str:
    return hashlib.sha256(Path(file).read_bytes()).hexdigest()


class _Announcer(event.Listener):
    """Says once that something has to be compiled."""

    said = False

    def on_start(self, event: Any) -> None:
        if not self.said:
            LOGGER.info("compiling for this machine; this is kept, the next run starts at once")
            self.said = True

    def on_end(self, event: Any) -> None:
        """Nobody asks how long it took."""


ANNOUNCER = _Announcer()
event.register("numba:compile", ANNOUNCER)  # type: ignore[no-untyped-call]
