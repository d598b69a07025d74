"""Thresholds of a detector as a file: written by a run, read by another."""

from __future__ import annotations

import dataclasses
import json
import math
from dataclasses import asdict
from pathlib import Path
from typing import Any

from wildlab.errors import WildlabError
from wildlab.files import write_json
from wildlab.flight.files import read_regular
from wildlab.pipeline.detect import thresholds_from
from wildlab.pipeline.detection_methods import METHODS

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
    write_json(path, {"method": method, "thresholds": _plain(asdict(thresholds))})


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
