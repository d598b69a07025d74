"""What a study says by rules, which are data: units of its numbers, when its claims are true, its answer.

``data/studies/<case>.toml``::

    [unit]                          # of the trial's numbers, by name or pattern; others are not recorded
    mae = "m"

    [given]                         # what rules below name
    known = "finite('ekf/mae' + 'kf/mae')"

    [check.kf-more-accurate]        # what the flights give for a claim, by its id: see `CheckRule`
    smaller = ["'kf/mae'", "'ekf/mae'"]
    unit = "m"

    [[answer]]                      # a sentence: the first whose rule is true, or none
    accuracy-unknown = "not known"
    accuracy-ground = "likely('kf-more-accurate')"
    "accuracy-*" = "outcome('kf-more-accurate')"
    accuracy-unclear = ""

A rule is arithmetic, comparisons, ``and``, ``or`` and ``not`` on numbers, on names of ``[given]`` that stand
above it, and on recorded numbers, ``'subject/name'``; with ``*`` in it these are all that fit, one below the
other. It is written as in Python and worked out here node by node: whatever is no such thing is refused, and
nothing runs. `FUNCTIONS` says which there are, and `facts_functions` which an answer has besides.
"""

from __future__ import annotations

import ast
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from fnmatch import fnmatchcase
from functools import lru_cache, reduce
from itertools import pairwise
from typing import TYPE_CHECKING, Annotated, Any

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike, NDArray
from pydantic import Field, field_validator

from wildlab.errors import WildlabError
from wildlab.evaluation.consistency import chi_square_interval, white_bound
from wildlab.evaluation.intervals import share_interval
from wildlab.evaluation.shares import Check, Pooled
from wildlab.flight.files import Strict, check_model, read_toml
from wildlab.studies import FOLDERS, rule_files

if TYPE_CHECKING:
    from wildlab.studies.page import Facts

_OPERATORS: dict[type[ast.AST], Callable[..., Any]] = {
    ast.Add: np.add, ast.Sub: np.subtract, ast.Mult: np.multiply, ast.Div: np.divide, ast.Pow: np.power,
    ast.USub: np.negative, ast.Not: np.logical_not, ast.And: np.logical_and, ast.Or: np.logical_or,
    ast.Lt: np.less, ast.LtE: np.less_equal, ast.Gt: np.greater, ast.GtE: np.greater_equal, ast.Eq: np.equal,
}  # fmt: skip


def _over(of: Callable[..., Any]) -> Callable[..., Any]:
    """A function of several numbers, or of those that one pattern has found."""
    return lambda *values: of(
        np.stack(np.broadcast_arrays(*values)) if len(values) > 1 else values[0], axis=0
    )


def apart(one: ArrayLike, other: ArrayLike) -> NDArray[np.float64]:
    """By which share of the smaller two positive numbers differ."""
    a, b = np.asarray(one, float), np.asarray(other, float)
    return np.asarray(np.maximum(a, b) / np.minimum(a, b) - 1)


def _share(end: int) -> Callable[..., float]:
    """An end of the interval of a share, of how many and of how many in all."""
    return lambda count, of: share_interval(float(count), float(of))[end]


def _band(end: int) -> Callable[..., Any]:
    """An end of the 95 % band of the mean of so many independent NEES or NIS of two elements."""
    return np.vectorize(lambda runs: chi_square_interval(2, runs=runs)[end], otypes=[float])


FUNCTIONS: Mapping[str, Callable[..., Any]] = {
    **{name: getattr(np, name) for name in ("abs", "log", "exp", "sqrt", "hypot")},
    **{name: _over(getattr(np, name)) for name in ("min", "max", "sum", "mean", "all", "nanmax", "nanmean")},
    "finite": np.isfinite,
    "apart": apart,
    "white_bound": np.vectorize(lambda n: white_bound(int(n)), otypes=[float]),
    "share_low": _share(1),
    "share_high": _share(2),
    "band_low": _band(0),
    "band_high": _band(1),
}


@dataclass(frozen=True)
class Rules:
    """What works out rules.

    Attributes
    ----------
    number
        What gives a recorded number by "subject/name", or those of a pattern.
    given
        Numbers and rules by name.
    functions
        Of texts as they stand, by name.
    """

    number: Callable[[str], Any]
    given: Mapping[str, float | str]
    functions: Mapping[str, Callable[..., Any]] = field(default_factory=dict)
    _known: dict[str, Any] = field(default_factory=dict)

    def __call__(self, rule: float | str) -> Any:
        """The value of a rule.

        Raises
        ------
        WildlabError
            If it has anything in it but what the module names.

        Examples
        --------
        >>> float(Rules({"a/x": np.float64(4.0)}.get, {"half": "'a/x' / 2"})("1 + max(half, 1) ** 2"))
        5.0
        """
        if not isinstance(rule, str):
            return rule
        with np.errstate(invalid="ignore", divide="ignore"):
            try:
                return self._of(_parsed(rule))
            except (SyntaxError, TypeError, ValueError, IndexError, OverflowError, RecursionError) as error:
                fix = "write it as wildlab.studies.rules says"
                raise WildlabError(f"the rule {rule!r} cannot be worked out ({error})", fix) from error

    def _of(self, node: ast.AST) -> Any:
        match node:
            case ast.Constant(value=str(key)):
                return self.number(key)
            case ast.Constant(value=int() | float() as value):
                return float(value)
            case ast.Name(id=name) if name in self.given:
                if name not in self._known:
                    self._known[name] = self(self.given[name])
                return self._known[name]
            case ast.UnaryOp(op=op, operand=one) if type(op) in _OPERATORS:
                return _OPERATORS[type(op)](self._of(one))
            case ast.BinOp(left=left, op=op, right=right) if type(op) in _OPERATORS:
                return _OPERATORS[type(op)](self._of(left), self._of(right))
            case ast.BoolOp(op=op, values=several):
                return reduce(_OPERATORS[type(op)], map(self._of, several))
            case ast.Compare(left=left, ops=ops, comparators=others) if all(
                type(o) in _OPERATORS for o in ops
            ):
                sides = [self._of(one) for one in (left, *others)]
                found = [_OPERATORS[type(op)](*pair) for op, pair in zip(ops, pairwise(sides), strict=True)]
                return reduce(np.logical_and, found)
            case ast.Call(func=ast.Name(id=name), args=given, keywords=[]) if name in self.functions:
                return self.functions[name](*(ast.literal_eval(one) for one in given))
            case ast.Call(func=ast.Name(id=name), args=given, keywords=[]) if name in FUNCTIONS:
                return FUNCTIONS[name](*map(self._of, given))
        raise ValueError(f"what is {ast.unparse(node)}?")


@lru_cache(maxsize=1024)
def _parsed(rule: str) -> ast.AST:
    return ast.parse(rule, mode="eval").body


#: A rule as a file may have it: none is longer than a line.
Rule = Annotated[str, Field(max_length=400)]


class CheckRule(Strict):
    """What the flights give for a claim, by rules; see `wildlab.evaluation.shares.Check`.

    ``larger``: true where the first of two is the larger one; of several pairs where it is in all of them,
    and the closest pair is shown. ``smaller`` likewise. ``between``: what a difference is shown of where it
    is true by another rule. Where the ``unit`` is %, these are shares. ``pooled``: pairs, in how many images
    something is so, and of how many: of several pairs the one with the largest share.
    """

    true: Rule | None = None
    measured: Rule | None = None
    above: bool = False
    premise: Rule | None = None
    larger: list[Rule] | list[list[Rule]] | None = None
    smaller: list[Rule] | None = None
    between: list[Rule] | None = None
    unit: str = ""
    pooled: list[list[Rule]] | None = None
    calculated: bool = False
    by_threshold: dict[str, Rule] | None = None
    reach: list[float | str] = Field(default=["-inf", "inf"], min_length=2, max_length=2)


class StudyRules(Strict):
    """``data/studies/<case>.toml``."""

    unit: dict[str, str] = Field(default_factory=dict)
    given: dict[str, float | Rule] = Field(default_factory=dict, max_length=50)
    check: dict[str, CheckRule] = Field(default_factory=dict)
    answer: list[dict[str, Rule]] = Field(default_factory=list)

    @field_validator("given")
    @classmethod
    def _in_order(cls, given: dict[str, float | str]) -> dict[str, float | str]:
        """Refuse a rule that names itself or what stands below it: it could go round for ever."""
        below = set(given)
        for name, rule in given.items():
            try:
                nodes = [*ast.walk(_parsed(str(rule)))]
            except (SyntaxError, RecursionError) as error:
                raise ValueError(f"{name} is no rule ({error}); write it as Python's arithmetic") from error
            late = [one.id for one in nodes if isinstance(one, ast.Name) and one.id in below]
            if late:
                raise ValueError(f"{name} names {late[0]}, which is not above it; move {late[0]} up")
            below.remove(name)
        return given

    def unit_of(self, name: str) -> str | None:
        """The unit of a number of the trial by the first name or pattern that fits; None: not recorded."""
        return next((unit for pattern, unit in self.unit.items() if fnmatchcase(name, pattern)), None)

    def checks(
        self, runs: pd.DataFrame, more: Mapping[str, ArrayLike] | None = None, **functions: Callable[..., Any]
    ) -> dict[str, Check]:
        """What the flights give for each claim, by its id.

        Parameters
        ----------
        runs
            Columns (subject, name), or names alone, one row for each flight.
        more
            Further numbers by "subject/name", which may be of other flights.
        functions
            Of texts, by the name that rules call them by.

        Returns
        -------
        dict
            A claim one of whose numbers is not there has no check.
        """
        numbers = {
            key if isinstance(key, str) else "/".join(key): runs[key].to_numpy() for key in keys_of(runs)
        }
        numbers |= {name: np.asarray(values) for name, values in (more or {}).items()}
        rules = Rules(_finder(numbers), self.given, functions)
        found = {}
        for claim, rule in self.check.items():
            try:
                found[claim] = _check(rule, rules)
            except KeyError:
                continue
        return found

    def answers(self, facts: Facts) -> list[str]:
        """The keys of the sentences that answer the study's question."""
        rules = Rules(facts.number, self.given, facts_functions(facts))
        keys = []
        for sentence in self.answer:
            for key, rule in sentence.items():
                found = rules(rule) if rule else True
                if np.any(found) if not isinstance(found, str) else found:
                    keys.append(key.replace("*", found) if isinstance(found, str) else key)
                    break
        return [key for key in keys if key]


def keys_of(runs: pd.DataFrame) -> list[tuple[str, str]]:
    """(subject, name) of the columns of a table with a row for each flight."""
    columns: Any = runs.columns
    return list(columns)


def _finder(numbers: Mapping[str, Any]) -> Callable[[str], Any]:
    def find(key: str) -> Any:
        if "*" not in key:
            return numbers[key]
        return np.stack([numbers[one] for one in sorted(numbers) if fnmatchcase(one, key)])

    return find


def _check(rule: CheckRule, rules: Rules) -> Check:
    given: dict[str, Any] = {
        name: None if (text := getattr(rule, name)) is None else np.asarray(rules(text))
        for name in ("true", "measured", "premise")
    }
    pairs: Sequence[Any] = rule.larger or rule.smaller or ()
    if pairs:
        each = [pairs] if isinstance(pairs[0], str) else pairs
        first, second = (np.stack([rules(pair[end]) for pair in each]) for end in (0, 1))
        lead = first - second if rule.larger else second - first
        at = lead.argmin(axis=0), np.arange(lead.shape[1])
        given |= {"true": (first > second if rule.larger else first < second).all(axis=0)}
        given |= {"first": first[at], "second": second[at]}
    elif rule.between:
        given |= {end: rules(one) for end, one in zip(("first", "second"), rule.between, strict=True)}
    if rule.unit == "%" and "first" in given:
        given |= {end: 100 * given[end] for end in ("first", "second")}
    if rule.by_threshold:
        given["by_threshold"] = {float(one): rules(text) for one, text in rule.by_threshold.items()}
    if rule.pooled:
        counts = [[np.asarray(rules(one)) for one in pair] for pair in rule.pooled]
        totals = [Pooled(*(round(float(np.nansum(one))) for one in pair)) for pair in counts]
        shares = [one.so / one.of if one.of else 0.0 for one in totals]
        worst = shares.index(max(shares))
        with np.errstate(invalid="ignore", divide="ignore"):
            given |= {"pooled": totals[worst], "measured": np.divide(*counts[worst])}
    low, high = map(float, rule.reach)
    return Check(**given, above=rule.above, unit=rule.unit, calculated=rule.calculated, reach=(low, high))


def facts_functions(facts: Facts) -> Mapping[str, Callable[..., Any]]:
    """What an answer may ask besides: other entries of a number than its value, the verdict on a claim, which
    of two numbers is larger by their intervals."""
    entries = ("low", "high", "centre_low", "centre_high", "n")
    return {
        **{name: lambda key, name=name: facts.number(key, name) for name in entries},
        "holds": facts.holds,
        "likely": lambda claim: facts.choose(claim, "yes", "no") == "yes",
        "unlikely": lambda claim: facts.choose(claim, "yes", "no") == "no",
        "outcome": facts.outcome,
        "compare": facts.compare,
        "more": lambda one, other: facts.compare(one, other) == "more",
        "less": lambda one, other: facts.compare(one, other) == "less",
        "few": lambda one, other: facts.compare(one, other) == "few",
    }


@lru_cache(maxsize=64)
def load_rules(case: str) -> StudyRules:
    """The rules of a case.

    Raises
    ------
    WildlabError
        Where there is no such file, or it is wrong.
    """
    path = rule_files().get(case, FOLDERS[0] / f"{case}.toml")
    return check_model(StudyRules, read_toml(path, "the rules of a study"), path)
