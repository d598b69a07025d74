"""Examples in docstrings come out as printed, and what a room offers says what it takes and gives."""

from __future__ import annotations

import doctest
import importlib
import inspect
import pkgutil
from types import ModuleType
from typing import get_origin

import pytest

from tests.rooms import DOCUMENTED, WITH_EXAMPLES, lacking, offered


def modules_of(room: str) -> list[str]:
    """The room and every module below it; of `wildlab` itself only the files beside the rooms."""
    package = importlib.import_module(room)
    if room == "wildlab":
        below = [m for m in pkgutil.iter_modules(package.__path__, "wildlab.") if not m.ispkg]
        return [room, *(m.name for m in below if m.name != "wildlab.__main__")]
    return [room, *(m.name for m in pkgutil.walk_packages(package.__path__, f"{room}."))]


def run_examples(module: ModuleType) -> tuple[int, str]:
    """How many examples of a module failed, and what doctest says of them."""
    said: list[str] = []
    runner = doctest.DocTestRunner(optionflags=doctest.NORMALIZE_WHITESPACE | doctest.ELLIPSIS)
    for test in doctest.DocTestFinder(exclude_empty=True).find(module):
        runner.run(test, out=said.append)
    return runner.failures, "".join(said)


@pytest.mark.slow
@pytest.mark.parametrize("room", [room for room in WITH_EXAMPLES if room.count(".") < 2])
def test_examples_come_out(room):
    for name in modules_of(room):
        failures, said = run_examples(importlib.import_module(name))
        assert failures == 0, said


@pytest.mark.parametrize("room", ["geometry", "planning", "detection", "api", "sharing"])
def test_a_docstring_that_lists_parameters_lists_all(room):
    found = []
    for name in modules_of(f"wildlab.{room}"):
        for key, thing in vars(importlib.import_module(name)).items():
            own = inspect.isfunction(thing) and thing.__module__ == name and not key.startswith("_")
            if own and "\nParameters\n" in (inspect.getdoc(thing) or ""):
                found += [one for one in lacking(f"{name}.{key}", thing) if one.endswith("not described")]
    assert found == []


@pytest.mark.parametrize("room", DOCUMENTED)
def test_what_a_room_offers_is_documented(room):
    found = [fault for name, thing in offered(room) for fault in lacking(f"{room}.{name}", thing)]
    found += [
        f"{name}: nothing said"
        for name, thing in offered(room)
        # A name for a type (`Motion`) can be called too, but has no docstring to write in.
        if callable(thing) and get_origin(thing) is None and not thing.__doc__
    ]
    assert found == []
