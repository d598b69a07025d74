"""What a study is: one case of a thesis, and what the runner and the reports may ask of it.

Everything that belongs to a case lies in its folder, ``wildlab/studies/<case>/`` (hyphens become
underscores), whose ``__init__.py`` ends in ``STUDY = Study(...)``. ``notebooks/studies.toml`` names the case
and the flight or twin that a notebook shows it on; nothing else has to be told of a new one, for the folders
are the list.

A *trial* is what is computed on one simulated flight, a pure function::

    def trial(seed: int, *, twin: str, runs: int) -> Numbers:
        flight = simulate_twin(twin, seed)
        ...
        return {("kalman", "rmse_north"): 1.8, ...}

- It gets the seed and, by keyword, its parameters: ``twin`` is the study's twin, the others are parameters of
  the study in ``studies.toml``. Each must be given; none has a default.
- It depends on nothing else: no file but those of ``data/``, no clock, no state. Randomness comes from the
  seed.
- It gives numbers by (subject, name), the same names for each seed; NaN stands for what this flight has no
  value for. Neither a subject nor a name has a ``/`` in it.
- A flight from which nothing can be concluded (no solution, no observations) raises: `WildlabError` with a
  sentence. The run then names the seed. It never returns NaN throughout in place of an error.
- It lies in the case's ``trial.py``, which imports nothing of the studies but other cases' ``trial``: the
  kept numbers of a seed are good as long as these files and the rooms below them do not change.

`wildlab.runner` spreads the seeds over processes or machines, and the notebook reads the table with
`wildlab.runner.open_study.trials_table`.
"""

from __future__ import annotations

import importlib
import inspect
import pkgutil
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from numpy.typing import ArrayLike

from wildlab import studies
from wildlab.errors import WildlabError

if TYPE_CHECKING:
    from wildlab.evaluation.shares import Check
    from wildlab.studies.page import Facts

#: The parameter of `run_trial` that moves the twins.
VARIED = "varied"
#: Numbers of one flight by (subject, name).
Numbers = Mapping[tuple[str, str], float]
#: The same by "subject/name", as they are kept.
Values = dict[str, float]


@dataclass(frozen=True)
class Study:
    """One case.

    Attributes
    ----------
    case
        Its name: the folder's, with hyphens.
    trial
        What is computed for a seed; None where the case does not go over simulated flights one by one.
    check_claims
        Trials, one row for each flight and columns (subject, name), and whatever else the notebook has to say
        -> what the flights give for each claim, by the claim's id: a `Check`, or (flights,) bools.
    unit_of
        Name of a number of the trial -> its unit in ``metrics.json``; None where it is not recorded.
    answer
        What was recorded (`wildlab.studies.page.Facts`) -> keys of the sentences of
        ``data/messages/en/<case>.toml`` that answer the page's question, the most important first.
    """

    case: str
    trial: Callable[..., Numbers] | None = None
    check_claims: Callable[..., Mapping[str, Check] | Mapping[str, ArrayLike]] | None = None
    unit_of: Callable[[str], str | None] | None = None
    answer: Callable[[Facts], Sequence[str]] | None = None

    @property
    def parameters(self) -> tuple[str, ...]:
        """What the trial takes besides the seed."""
        if self.trial is None:
            return ()
        return tuple(name for name in inspect.signature(self.trial).parameters if name != "seed")


def case_names() -> tuple[str, ...]:
    """All cases: the folders of `wildlab.studies`."""
    found = pkgutil.iter_modules(studies.__path__)
    return tuple(sorted(module.name.replace("_", "-") for module in found if module.ispkg))


def find_case(case: str) -> Study:
    """The study of that case.

    Raises
    ------
    WildlabError
        If there is none.
    """
    if case not in case_names():
        raise WildlabError(
            f"there is no case {case!r}",
            f"use one of: {', '.join(case_names())}; or give it a folder in wildlab/studies",
            field="case",
        )
    study: Study = importlib.import_module(f"wildlab.studies.{case.replace('-', '_')}").STUDY
    return study


def run_trial(case: str, seed: int, parameters: Mapping[str, Any]) -> Values:
    """What the trial of a case gives for a seed, by "subject/name".

    Besides the trial's own there may be the parameter `VARIED`: factors for parameters of its twins, as
    `wildlab.simulation.variation.varied` takes them.

    Raises
    ------
    WildlabError
        If there is no such case, it has no trial, or what it gives is not numbers by (subject, name); and
        whatever the trial raises.
    """
    from wildlab.simulation.variation import varied  # who lists the studies moves none

    trial = find_case(case).trial
    if trial is None:
        raise WildlabError(f"the case {case!r} has no trial for each seed", "give it one, or leave seeds out")
    given = dict(parameters)
    with varied(given.pop(VARIED, {})):
        found = trial(seed, **given)
    values = {f"{subject}/{name}": float(value) for (subject, name), value in found.items()}
    wrong = next((key for key in values if key.count("/") != 1), None)
    if not values or wrong is not None:
        fault = "gives nothing" if wrong is None else f"names a number {wrong!r}"
        raise WildlabError(f"the trial of {case!r} {fault}", "give numbers by (subject, name)")
    return values


def split_keys(values: Mapping[str, float]) -> dict[tuple[str, str], float]:
    """Keys "subject/name" as (subject, name)."""
    result = {}
    for key, value in values.items():
        subject, _, name = key.partition("/")
        result[subject, name] = value
    return result
