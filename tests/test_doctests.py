"""The examples in docstrings, run. A room whose examples are to be run is a line here."""

import doctest
import importlib
import pkgutil

import pytest

ROOMS = [
    "geometry",
]


def modules_of(room):
    """Names of a room's modules, itself included."""
    package = importlib.import_module(f"wildlab.{room}")
    inside = pkgutil.walk_packages(package.__path__, f"{package.__name__}.")
    return [package.__name__, *(one.name for one in inside)]


def examples_of(module):
    """The doctests of a module that have any examples."""
    return [one for one in doctest.DocTestFinder().find(importlib.import_module(module)) if one.examples]


@pytest.mark.parametrize("module", [module for room in ROOMS for module in modules_of(room)])
def test_examples_give_what_they_say(module):
    for example in examples_of(module):
        said = []
        failed, _ = doctest.DocTestRunner().run(example, out=said.append)
        assert not failed, "".join(said)


@pytest.mark.parametrize("room", ROOMS)
def test_a_room_that_is_listed_has_examples(room):
    assert any(examples_of(module) for module in modules_of(room))
