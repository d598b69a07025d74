"""The case studies of both theses, ``data/cases.toml``: what there is to be rebuilt, studied or not."""

from __future__ import annotations

import tomllib
from pathlib import Path
from typing import NamedTuple

from wildlab.errors import WildlabError
from wildlab.paths import DATA

FILE = DATA / "cases.toml"


class Case(NamedTuple):
    """One case of a thesis: its name, its section ("H 5.6.1"), and what it shows, a sentence."""

    id: str
    section: str
    shows: str


def load_cases(path: Path = FILE) -> list[Case]:
    """All cases, in the order of the theses.

    Parameters
    ----------
    path
        Left out, ``data/cases.toml``.

    Returns
    -------
    list of Case

    Raises
    ------
    WildlabError
        If the file cannot be read, or an entry is not a case.

    Examples
    --------
    >>> load_cases()[0].id
    'camera-calibration'
    """
    try:
        content = tomllib.loads(path.read_text(encoding="utf-8"))
        return [Case(**{key: str(value) for key, value in entry.items()}) for entry in content["case"]]
    except (OSError, ValueError, KeyError, TypeError, AttributeError) as error:
        raise WildlabError(f"it is no list of cases ({error})", "mend the file", file=path.name) from error
