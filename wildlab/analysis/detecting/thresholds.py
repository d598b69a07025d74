"""Thresholds of a detector as a file: written by a run, read by another."""

from __future__ import annotations

import dataclasses
import json
import math
from pathlib import Path
from typing import Any

from wildlab.analysis.detecting.methods import METHODS
from wildlab.errors import WildlabError
from wildlab.files import write_json
from wildlab.flight.files import read_regular

#: Bytes of a file of thresholds at most.
MOST_BYTES = 1_000_000


def write_thresholds(path: Path, method: str, thresholds: Any) -> None:
    """Write thresholds as JSON; infinity is null.

    Parameters
    ----------
    path
        Of the file.
    method, thresholds
        Which detector's.
    """
    write_json(path, {"method": method, "thresholds": _plain(dataclasses.asdict(thresholds))})


def _plain(value: Any) -> Any:
    """Without infinity, for which JSON has no word."""
    if isinstance(value, dict):
        return {name: _plain(one) for name, one in value.items()}
    return None if value == math.inf else value


def read_thresholds(path: Path, method: str) -> Any:
    """Thresholds that `write_thresholds` wrote.

    Parameters
    ----------
    path
        Of the file.
    method
        Whose they have to be.

    Returns
    -------
    object
        Of ``METHODS[method].thresholds``.

    Raises
    ------
    WildlabError
        Where it is no such file, or another method's.
    """
    try:
        given = json.loads(read_regular(path, MOST_BYTES))
        named, values = given["method"], dict(given["thresholds"])
    except FileNotFoundError:
        raise WildlabError("there is no such file", "check the path", file=path) from None
    except (ValueError, TypeError, KeyError):
        raise WildlabError(
            "holds no thresholds", "name the thresholds.json of an earlier run", file=path
        ) from None
    if named != method:
        raise WildlabError(
            f"holds thresholds of {named!r}", f"say --method {named}, or leave it out", file=path
        )
    return _thresholds(METHODS[method].thresholds, method, values)


def _thresholds(kind: type[Any], method: str, values: dict[str, Any]) -> Any:
    """Plain values as a dataclass: null is infinity where the default is, a list a tuple."""
    defaults = {one.name: one.default for one in dataclasses.fields(kind)}
    made: dict[str, Any] = {}
    for name, value in values.items():
        default = defaults.get(name)
        if dataclasses.is_dataclass(default) and isinstance(value, dict):
            made[name] = _thresholds(type(default), method, value)
        elif value is None and default == math.inf:
            made[name] = math.inf
        else:
            made[name] = tuple(value) if isinstance(value, list) else value
    return thresholds_from(kind, made)


def thresholds_from(kind: type[Any], given: dict[str, Any]) -> Any:
    """Thresholds of a method from plain values, as they were written to a file.

    Parameters
    ----------
    kind
        Of thresholds: ``METHODS[method].thresholds``, or one inside it.
    given
        By the name of the field; what is not there keeps its default.

    Returns
    -------
    object
        Of that kind.

    Raises
    ------
    WildlabError
        Where a name is not known, or a value is not of the kind of the default.
    """
    known = {one.name: one.default for one in dataclasses.fields(kind)}
    for name, value in given.items():
        if name not in known:
            raise WildlabError(f"there is no threshold {name!r}", f"there are {', '.join(known)}")
        default = known[name]
        numbers = isinstance(default, int | float) and not isinstance(default, bool)
        plain = isinstance(value, int | float) and not isinstance(value, bool)
        good = plain if numbers else isinstance(value, type(default))
        if default is None:  # a limit, or two, that there may be
            several = value if isinstance(value, tuple) else (value,)
            good = value is None or all(isinstance(one, int | float) for one in several)
        if isinstance(default, tuple):
            good = isinstance(value, tuple) and all(isinstance(one, int | float) for one in value)
        if not good:
            like = "give a number, or leave it out" if default is None else f"give one like {default!r}"
            raise WildlabError(f"the threshold {name!r} is {value!r}", like)
    try:
        return kind(**given)
    except TypeError:  # one number in place of two, or the other way round
        raise WildlabError("the thresholds do not fit together", "write them anew with --fit") from None
