"""Compiled functions: kept on disk after the first use, and a word where that first use takes its time."""

from __future__ import annotations

import logging
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any, TypeVar, cast

import numba
from numba.core import event

Function = TypeVar("Function", bound=Callable[..., Any])

#: Says at level INFO that something is being compiled: `logging.basicConfig(level=logging.INFO)` shows it.
LOGGER = logging.getLogger("wildlab.compilation")


def compiled(function: Function) -> Function:
    """Compile at the first call with new types, and keep the result in numba's cache.

    Division by zero gives infinity or NaN, as in numpy. The cache looks only at the file a function stands
    in: functions that call each other belong into one file.
    """
    decorate = numba.njit(cache=True, error_model="numpy")
    return cast(Function, decorate(function))


class _Announcer(event.Listener):
    def __init__(self, what: str) -> None:
        self.what: str | None = what

    def on_start(self, event: Any) -> None:
        if self.what is not None:
            LOGGER.info("compiling %s for this machine; this is kept, the next run starts at once", self.what)
            self.what = None

    def on_end(self, event: Any) -> None:
        """Nobody asks how long it took."""


@contextmanager
def announced(what: str) -> Iterator[None]:
    """Log one line where what is called inside has to be compiled first; none where it is there already."""
    with event.install_listener("numba:compile", _Announcer(what)):
        yield
