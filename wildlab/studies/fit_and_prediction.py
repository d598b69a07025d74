"""What a twin was fitted to, and what it predicts: the two are never to be taken for each other."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import pandas as pd

from wildlab.names import listed
from wildlab.reporting.published import load_published
from wildlab.reporting.report import Report
from wildlab.simulation.parameters import (
    TwinParameters,
    each_parameter,
    fitted_to,
    load_twin,
    parameters_table,
    status_words,
)


class Beside(NamedTuple):
    """What a simulated flight has to do with the published numbers of one table.

    Attributes
    ----------
    source
        The table.
    used, numbers
        How many of its numbers were used in making the flight, of how many.
    reasons
        How, as `data/published` says.
    """

    source: str
    used: int
    numbers: int
    reasons: tuple[str, ...]


def tables_apart(published: pd.DataFrame) -> list[Beside]:
    """Published tables, by how many of their numbers were used in making the simulated flight.

    Parameters
    ----------
    published
        Columns ``source`` and ``fitted``, as `wildlab.reporting.published.load_published` gives them.

    Returns
    -------
    list of Beside
        Each table once, in the order of ``published``.

    Examples
    --------
    >>> rows = pd.DataFrame({"source": ["H table 5.4", "H table 5.5"], "fitted": ["the sway", ""]})
    >>> [(one.source, one.used) for one in tables_apart(rows)]
    [('H table 5.4', 1), ('H table 5.5', 0)]
    """
    found = []
    for source, rows in published.groupby("source", sort=False):
        reasons = [reason for reason in rows["fitted"] if reason]
        found.append(Beside(str(source), len(reasons), len(rows), tuple(dict.fromkeys(reasons))))
    return found


def fit_words(published: pd.DataFrame, twin: TwinParameters | str | Path) -> str:
    """Which of the tables beside which a twin is held it was fitted to, in sentences.

    Parameters
    ----------
    published
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
    parts = []
    if tables:
        groups = dict.fromkeys(group for group, _, p in each_parameter(parameters) if p.fitted_to)
        what = listed([group.replace("_", " ") for group in groups])
        parts.append(f"Of this twin's parameters {what} were fitted to {listed(tables)} ({_NOT_KNOWN}).")
    else:
        parts.append("No parameter of this twin was fitted to a published table.")
    apart = tables_apart(published)
    for one in apart:
        if one.used:
            what = "What stands" if one.used == one.numbers else f"{one.used} of {one.numbers} numbers"
            verb = "is" if one.used == one.numbers else "are"
            parts.append(f"{what} beside {one.source} {verb} no test: {'; '.join(one.reasons)}.")
    predicted = [one.source for one in apart if not one.used]
    if predicted:
        parts.append(f"What stands beside {listed(predicted)} is a prediction.")
    return " ".join(parts)


_NOT_KNOWN = "sizes were chosen by how near they bring these tables; what causes such errors is not known"


def show_twins(report: Report, twins: Sequence[str], study: str) -> None:
    """The section of a report on what was simulated: every parameter of each twin, folded away.

    Parameters
    ----------
    twins
        Their names.
    study
        Whose published tables stand beside them.
    """
    report.section("What was simulated")
    for twin in twins:
        table = parameters_table(twin)
        report.table(
            table,
            fold=f"The twin {twin}: {status_words(table)}",
            caption=f"Every parameter of the twin. {fit_words(load_published(study), twin)}",
        )
