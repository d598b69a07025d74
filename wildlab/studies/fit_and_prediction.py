"""What a twin was fitted to, and what it predicts: the two are never to be taken for each other."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import NamedTuple

from wildlab.simulation.parameters import TwinParameters, each_parameter, fitted_to, load_twin


class Apart(NamedTuple):
    """Published tables, by what a twin has to do with them.

    Attributes
    ----------
    fitted
        Those that its parameters were fitted to: agreement is no test.
    predicted
        The others.
    """

    fitted: tuple[str, ...]
    predicted: tuple[str, ...]


def tables_apart(sources: Iterable[str], fitted: Iterable[str]) -> Apart:
    """Published tables, parted by whether a twin was fitted to them.

    Parameters
    ----------
    sources
        As published numbers name them, ``"H table 5.6"``; often the same one many times.
    fitted
        As `wildlab.simulation.parameters.fitted_to` gives them.

    Returns
    -------
    Apart
        Each table once, in the order of ``sources``.

    Examples
    --------
    >>> tables_apart(["H table 5.4", "H table 5.5", "H table 5.4"], ["H table 5.4"])
    Apart(fitted=('H table 5.4',), predicted=('H table 5.5',))
    """
    known, tables = set(fitted), tuple(dict.fromkeys(sources))
    return Apart(
        tuple(table for table in tables if table in known),
        tuple(table for table in tables if table not in known),
    )


def fit_words(sources: Iterable[str], twin: TwinParameters | str | Path) -> str:
    """Which of the tables beside which a twin is held it was fitted to, in sentences.

    Parameters
    ----------
    sources
        As for `tables_apart`.
    twin
        Its parameters, or its name or file.

    Returns
    -------
    str
        Says also which groups of parameters were fitted.

    Raises
    ------
    WildlabError
        Where there is no such twin.
    """
    parameters = twin if isinstance(twin, TwinParameters) else load_twin(twin)
    tables = fitted_to(parameters)
    if not tables:
        return "No parameter of this twin was fitted to a published table."
    groups = dict.fromkeys(group for group, _, p in each_parameter(parameters) if p.fitted_to)
    what = _listed([group.replace("_", " ") for group in groups])
    parts = [f"Of this twin's parameters {what} were fitted to {_listed(tables)} ({_NOT_KNOWN})."]
    apart = tables_apart(sources, tables)
    if apart.fitted:
        parts.append(f"What stands beside {_listed(apart.fitted)} is therefore a fit, and no test.")
    if apart.predicted:
        parts.append(f"What stands beside {_listed(apart.predicted)} is a prediction.")
    return " ".join(parts)


_NOT_KNOWN = "sizes were chosen by how near they bring these tables; what causes such errors is not known"


def _listed(words: Sequence[str]) -> str:
    return words[0] if len(words) == 1 else f"{', '.join(words[:-1])} and {words[-1]}"
