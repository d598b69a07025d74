"""Studies of one, two or three flights, and of flights of which nothing is known.

Every function that makes text, tables or figures of a study's trials is found by its parameter ``spread``.
The columns that it asks for are found by asking: a table without one raises a KeyError that names it.
"""

from __future__ import annotations

import importlib
import inspect
import pkgutil
import re
import warnings
import zlib
from collections import defaultdict
from collections.abc import Callable, Iterator
from functools import cache
from typing import Any

import numpy as np
import pandas as pd
import pytest
from matplotlib.figure import Figure
from matplotlib.text import Text

from wildlab import studies
from wildlab.analysis.navigation_errors import AXES, PLACES
from wildlab.errors import WildlabError
from wildlab.evaluation.shares import UNDECIDED
from wildlab.reporting.report import Report, open_report
from wildlab.reporting.text import known
from wildlab.studies.end_to_end.trial import check_claims as end_to_end_claims  # asks what columns there are

#: Two minutes of the processor's time.
pytestmark = pytest.mark.slow

#: What else such a function may ask for, by its parameter.
GIVEN: dict[str, Callable[[], Any]] = {
    "published": lambda: defaultdict(lambda: 1.0),
    "printed": lambda: dict.fromkeys((f"mean_sd_{axis}" for axis in (*PLACES, *AXES)), 1.0),
    "claims": lambda: defaultdict(lambda: {"verdict": UNDECIDED, "fraction": np.nan}),
    "report": lambda: open_report(study="schmidt-fast-vessel", kind="twin"),
    "bound": lambda: 0.1,
    "n": lambda: 5,
    "frames": lambda: 5,
    "vessel": lambda: "a vessel",
    "tuned": lambda: "mekf",
    "percent_of_lap": lambda: 100,
    "platform": lambda: "uav",
    "loads": lambda: np.ones(3),
}
#: Those of one subject or a second table, which others call with theirs.
OTHERS = {"subject", "who", "name", "way", "kind", "method", "weather", "subjects", "first", "times", "cost"}
OTHERS |= {"verdicts", "heights", "other", "count", "methods", "base"}
#: Of what there is always a number.
COUNTS = {"images", "detections", "pauses", "images_with_missed", "images_with_false", "merged", "pieces"}
#: What may be said of flights of which nothing is known.
UNKNOWN = re.compile(
    r"not known|not told?|do not tell|not tested|cannot|can the|too few|never|\bno\b|\bNo\b|[Nn]one"
    r"|[Nn]othing|[Tt]here is no|–"
)


def text_functions() -> Iterator[tuple[str, Callable[..., Any]]]:
    """All that are public and take a ``spread``, but those that others call for a part of it."""
    for module in pkgutil.walk_packages(studies.__path__, "wildlab.studies."):
        if module.name.endswith(("_file", "monte_carlo")):
            continue
        for name, function in vars(importlib.import_module(module.name)).items():
            if inspect.isfunction(function) and function.__module__ == module.name and name[0] != "_":
                asked = {
                    p.name for p in inspect.signature(function).parameters.values() if p.default is p.empty
                }
                if "spread" in asked and not asked & OTHERS and function is not end_to_end_claims:
                    yield f"{module.name.removeprefix('wildlab.studies.')}.{name}", function


FUNCTIONS = dict(text_functions())
#: Those that make sentences.
TEXTS = [name for name in FUNCTIONS if "text" in name or "headline" in name]


def value_of(key: Any, variant: int) -> float:
    """A number from 0 to 1 of a column, and another one for each variant."""
    return (zlib.crc32(repr((key, variant)).encode()) % 1000 + 1) / 1001


@cache
def _columns_of(case: str) -> list[Any]:
    return [("", "")]


def columns_of(function: Callable[..., Any]) -> list[Any]:
    """The columns that the functions of a case have asked for so far."""
    return _columns_of(function.__module__.split(".")[2])


class Asked(pd.DataFrame):
    """A table that has every column that it is asked for by its whole name, and notes which."""

    _metadata = ("columns_asked", "value_of_column")

    def __getitem__(self, key: Any) -> Any:
        for one in key if isinstance(key, list) else [key]:
            whole = isinstance(one, tuple) and len(one) == 2 and all(isinstance(part, str) for part in one)
            if whole and one not in self.columns_asked:
                self.columns_asked.append(one)
                self[one] = self.value_of_column(one)
        return super().__getitem__(key)


def called(function: Callable[..., Any], value: Callable[[Any], Any], rows: int) -> Any:
    """What it gives of so many flights, each column of which has the value or (rows,) values."""
    others = {name: GIVEN[name]() for name in inspect.signature(function).parameters if name in GIVEN}
    columns = columns_of(function)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        for _ in range(2000):
            known_before = len(columns)
            spread = Asked({key: np.full(rows, value(key)) for key in columns}, index=range(rows))
            spread.columns_asked, spread.value_of_column = columns, value
            try:
                return function(spread=spread, **others)
            except KeyError as lacking:
                # Of several columns at once pandas gives the names in a sentence.
                named = re.findall(r"\('([^']+)', '([^']+)'\)", str(lacking.args[0])) or [lacking.args[0]]
                columns += [key for key in named if key not in columns]
                if len(columns) == known_before:
                    raise
    raise AssertionError("asks for ever more columns")


def sentences(found: Any) -> set[str]:
    """All that a reader reads of it, less what a report leaves out."""
    if isinstance(found, str):
        return {one for one in re.split(r"(?<=[.!?])\s+", known(found)) if one}
    if isinstance(found, Figure):
        return set().union(*(sentences(one.get_text()) for one in found.findobj(Text)), set())
    if isinstance(found, pd.DataFrame):
        return set()
    if isinstance(found, tuple) and any(isinstance(one, str) and not known(one) for one in found):
        return set()  # a tile is left out as a whole
    if isinstance(found, dict):
        found = list(found.values())
    if isinstance(found, Report):
        found = found.parts
    return set().union(*map(sentences, found), set()) if isinstance(found, list | tuple) else set()


@pytest.mark.parametrize("name", FUNCTIONS)
def test_few_flights_are_enough(name):
    for rows in (1, 2, 3):
        called(FUNCTIONS[name], lambda key: 1.0, rows)


def said_of_nothing(function: Callable[..., Any]) -> set[str]:
    """What is said of NaN that is not said of any numbers, and does not say that nothing is known."""
    of_any = [sentences(called(function, lambda key: 1.0, 3))]
    for variant in range(2):
        try:
            of_any.append(sentences(called(function, lambda key, v=variant: value_of(key, v), 3)))
        except WildlabError:  # a count of more than there are
            continue
    of_nothing = sentences(called(function, lambda key: 1.0 if key[1] in COUNTS else np.nan, 3))
    return {one for one in of_nothing - set.intersection(*of_any) if not UNKNOWN.search(one)}


@pytest.mark.parametrize("name", TEXTS)
def test_what_is_not_known_is_not_said(name):
    assert said_of_nothing(FUNCTIONS[name]) == set()


@pytest.mark.parametrize("name", [name for name in FUNCTIONS if "check_claims" in name or "summary" in name])
def test_what_one_subject_lacks_stops_nothing(name):
    called(FUNCTIONS[name], lambda key: 1.0, 3)
    subjects = {key[0] for key in columns_of(FUNCTIONS[name])}
    for subject in subjects:
        called(
            FUNCTIONS[name],
            lambda key, s=subject: np.nan if key[0] == s and key[1] not in COUNTS else 1.0,
            3,
        )
