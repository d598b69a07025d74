"""What a study is: one case of a thesis, and what the runner and the reports may ask of it.

A case is a file of rules, ``data/studies/<case>.toml`` (`wildlab.studies.rules`): units of its numbers, when
its claims are true, which sentences answer its question. Where something is computed for it there is a
module, ``wildlab/studies/<case>.py`` (hyphens become underscores), with what is computed on one flight, and
with its figures. ``notebooks/studies.toml`` names the case and the flight or twin that a notebook shows it
on; nothing else has to be told of a new one, for the files are the list.

A *trial* is what is computed on one simulated flight, a pure function of the module::

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
- It computes with the cases and the rooms below the studies: the kept numbers of a seed are good as
  long as these do not change.

`wildlab.runner` spreads the seeds over processes or machines, and the notebook reads the table with
`wildlab.runner.open_study.trials_table`.
"""

from __future__ import annotations

import importlib
import importlib.util
import inspect
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from wildlab.errors import WildlabError
from wildlab.studies import rule_files

if TYPE_CHECKING:
    import pandas as pd
    from numpy.typing import ArrayLike

    from wildlab.evaluation.shares import Check
    from wildlab.studies.rules import StudyRules

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
        Its name.
    rules
        Of its numbers, claims and answer.
    trial
        What is computed for a seed; None where the case does not go over simulated flights one by one.
    claim_numbers, claim_functions
        Trials -> what the rules of claims ask besides, as `StudyRules.checks` takes it.
    """

    case: str
    rules: StudyRules
    trial: Callable[..., Numbers] | None = None
    claim_numbers: Callable[[pd.DataFrame], Mapping[str, ArrayLike]] | None = None
    claim_functions: Callable[[pd.DataFrame], Mapping[str, Callable[..., Any]]] | None = None

    @property
    def parameters(self) -> tuple[str, ...]:
        """What the trial takes besides the seed."""
        if self.trial is None:
            return ()
        return tuple(name for name in inspect.signature(self.trial).parameters if name != "seed")

    def checks(self, runs: pd.DataFrame, more: Mapping[str, ArrayLike] | None = None) -> dict[str, Check]:
        """What the flights give for each claim, by its id; parameters as of `StudyRules.checks`."""
        numbers = {} if self.claim_numbers is None else self.claim_numbers(runs)
        functions = {} if self.claim_functions is None else self.claim_functions(runs)
        return self.rules.checks(runs, {**numbers, **(more or {})}, **functions)


def case_names() -> tuple[str, ...]:
    """All cases, by their files of rules."""
    return tuple(sorted(rule_files()))


def find_case(case: str) -> Study:
    """The study of that case.

    Raises
    ------
    WildlabError
        If there is none.
    """
    from wildlab.studies.rules import load_rules  # who lists the studies reads no rules

    if case not in case_names():
        raise WildlabError(
            f"there is no case {case!r}",
            f"use one of: {', '.join(case_names())}; or give it a file in data/studies",
            field="case",
        )
    name = f"wildlab.studies.{case.replace('-', '_')}"
    module = importlib.import_module(name) if importlib.util.find_spec(name) is not None else None
    offered = ("trial", "claim_numbers", "claim_functions")
    return Study(case, load_rules(case), *(getattr(module, one, None) for one in offered))


def run_trial(case: str, seed: int, parameters: Mapping[str, Any]) -> Values:
    """What the trial of a case gives for a seed, by "subject/name".

    Besides the trial's own there may be the parameter `VARIED`: factors for parameters of its twins, as
    `wildlab.simulation.parameters.varied` takes them.

    Raises
    ------
    WildlabError
        If there is no such case, it has no trial, or what it gives is not numbers by (subject, name); and
        whatever the trial raises.
    """
    from wildlab.simulation.parameters import varied  # who lists the studies moves none

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
