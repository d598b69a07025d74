"""A study while its notebook runs: its flight, its simulated flights, its report and its page.

::

    study = open_study("schmidt-fast-vessel", seeds=5)
    compared = schmidt.compare_flight(study.data, study.seed)     # one flight
    runs = study.runs(schmidt.summarise(compared))                # the same of every seed
    study.record(runs)
    study.show(figures=[...], checks=study.checks(runs))
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import cached_property
from pathlib import Path
from typing import Any

import pandas as pd
from numpy.typing import ArrayLike

from wildlab.errors import RunFailed, WildlabError
from wildlab.evaluation.shares import Check
from wildlab.flight.store import Flight
from wildlab.messages.catalogue import PageTexts, load_texts
from wildlab.paths import REPORTS
from wildlab.reporting.report import Report, open_report
from wildlab.runner.catalogue import StudyEntry, find_study, flights_for, load_studies
from wildlab.runner.scheduling import compute_seeds
from wildlab.runner.seeds import (
    make_work,
    read_seed,
)
from wildlab.studies.page import Shown, record_spread, show_page, show_twins
from wildlab.studies.protocol import Study, find_case, split_keys


def open_study(
    study: str,
    *,
    flight: str = "",
    others: Sequence[str] = (),
    seed: int = 1,
    seeds: int | None = None,
    out: str = "",
) -> OpenStudy:
    """Begin a study's notebook.

    Parameters
    ----------
    study
        Its name in ``studies.toml``; of a report on somebody's own flight with that flight's name behind it.
    flight, others
        Folders of its flights, as the runner gives them; left out, its twin is simulated for ``seed``, or its
        data set is imported.
    seed
        Of the flight that the figures show, or of whatever is drawn at random.
    seeds
        How many simulated flights the numbers are of.
    out
        Folder of the report; "" (a notebook opened by hand) writes nothing.

    Returns
    -------
    OpenStudy

    Raises
    ------
    WildlabError
        If there is no such study.

    Examples
    --------
    >>> open_study("consistency-bounds").case.case
    'consistency-bounds'
    """
    studies = load_studies()
    named = [one for one in studies if flight and study.startswith(f"{one}-")]
    entry = find_study(study if study in studies or not named else max(named, key=len), studies)
    if entry.case is None:
        raise WildlabError(f"the study {study!r} is of no case", "name its case", field="case")
    return OpenStudy(study, entry, find_case(entry.case), (flight, *others), seed, seeds, out)


class OpenStudy:
    """A study while its notebook runs; see the module. Make one with `open_study`."""

    def __init__(
        self,
        name: str,
        entry: StudyEntry,
        case: Study,
        folders: tuple[str, ...],
        seed: int,
        seeds: int | None,
        out: str,
    ) -> None:
        self.name, self.entry, self.case = name, entry, case
        self.seed, self.seeds, self.out = seed, seeds, out
        self._folders = folders

    @cached_property
    def flights(self) -> list[Flight]:
        """Its flights, the one that the figures show first; none where it is a calculation."""
        if self.entry.kind == "computed":
            return []
        return flights_for(self.entry.name, self._folders[0], self._folders[1:], self.seed)

    @property
    def data(self) -> Flight:
        """The flight that the figures show."""
        return self.flights[0]

    @cached_property
    def report(self) -> Report:
        """Its report."""
        first = self.flights[0] if self.flights else None
        name = "" if first is None else first.name
        return open_report(
            study=self.name,
            flight=name if len(self.flights) < 2 else self.name,
            kind=self.entry.kind if first is None else first.manifest.kind,
            seed=self.seed,
            seeds=self.seeds,
            out=self.out,
        )

    @cached_property
    def texts(self) -> PageTexts:
        """What its page says."""
        return load_texts(self.case.case)

    @property
    def twin(self) -> str:
        """The twin that the flight is simulated by."""
        return str(self.data.manifest.twin.name) if self.data.manifest.twin else ""

    def runs(self, drawn: Mapping[tuple[str, str], float], **parameters: Any) -> pd.DataFrame:
        """What the case's trial gives on each flight: columns (subject, name), a row for each seed.

        Parameters
        ----------
        drawn
            The same numbers of the flight that the figures show, which is the first row.
        parameters
            The trial's, besides its twin.
        """
        if "twin" in self.case.parameters:
            parameters.setdefault("twin", self.twin)
        return trials_table(
            self.case.case,
            self.seeds or 1,
            study=self.name,
            seed=self.seed,
            drawn=drawn,
            out=self.out,
            **parameters,
        )

    def record(self, runs: pd.DataFrame, n: Mapping[str, int] | None = None) -> None:
        """Record what all flights give, by the case's metrics; ``n``: how many observations a subject has."""
        record_spread(self.report, self.case.rules.unit_of, runs, dict(n or {}))

    def checks(self, runs: pd.DataFrame, more: Mapping[str, ArrayLike] | None = None) -> dict[str, Check]:
        """What the flights give for each claim, by the case's rules; see `Study.checks`."""
        return self.case.checks(runs, more)

    def show(
        self,
        figures: Sequence[Shown],
        checks: Mapping[str, Check] | None = None,
        tables: Mapping[str, pd.DataFrame] | None = None,
        values: Mapping[str, Any] | None = None,
        twins: Sequence[str] = (),
    ) -> None:
        """Show the page (`wildlab.studies.page.show_page`), and write its numbers.

        Parameters
        ----------
        figures, checks, tables, values
            As of `show_page`.
        twins
            Whose parameters are listed besides those of the flight's own twin.
        """
        count = self.seeds or 1
        words = f"{count} simulated flights" if count > 1 else "one simulated flight"
        given = {"flights": words, "seed": self.seed, **(values or {})}
        show_page(
            self.report,
            self.texts,
            title=self.entry.title,
            answer=self.case.rules.answers,
            figures=figures,
            checks=checks,
            tables=tables,
            values=given,
            thesis="F" if self.entry.section.startswith("F") else "H",
        )
        own = (self.twin,) if self.flights and self.twin else ()
        if own or twins:
            show_twins(self.report, [*own, *(one for one in twins if one not in own)], self.entry.name)
        self.report.save()


def trials_table(
    case: str,
    seeds: int,
    *,
    study: str,
    seed: int,
    drawn: Mapping[tuple[str, str], float],
    out: str = "",
    **parameters: Any,
) -> pd.DataFrame:
    """The numbers of all flights: columns (subject, name), one row for each seed, the flight drawn first.

    `wildlab run` has computed them before the notebook starts. In a notebook opened by hand, those that are
    not there yet, and those whose kept numbers are damaged, are computed now, in a process beside the kernel,
    and kept.

    Parameters
    ----------
    case
        Whose trial it is (``case`` in ``studies.toml``).
    seeds
        How many flights, the one drawn included.
    seed, drawn
        Seed of the flight that the figures show, and what the notebook has computed on it.
    out
        The notebook's parameter: the report's folder, beside which the store is.
    parameters
        The trial's.

    Raises
    ------
    WildlabError
        If a parameter is missing, a seed fails, or its numbers have other names than those of the others; it
        names the seed.
    """
    reports = Path(out).parent if out else REPORTS
    work = make_work(reports, study, case, seed, seeds, parameters)
    failures = compute_seeds(
        [work], 1, lambda done, count: print(f"\r{study}: {done} of {count} seeds", end="")
    )
    if failures:
        raise RunFailed(failures[study], "mend that; the seeds that are finished are kept")
    rows = {one: read_seed(work, one) for one in work.seeds}
    first = next(iter(rows.values()), None) or {}
    for one, values in rows.items():
        if values is None:
            raise RunFailed(
                f"the numbers of seed {one} do not read back as they were written",
                "see whether the disk is full or failing, and run it again",
            )
        if values.keys() != first.keys():
            apart = ", ".join(sorted(map(repr, values.keys() ^ first.keys()))[:3])
            raise RunFailed(
                f"seed {one} has numbers of other names than seed {work.seeds[0]}: {apart}",
                "let the trial give the same names for each seed, and NaN for what a flight has no value for",
            )
    own = {key: float(value) for key, value in drawn.items()}
    tables = [own, *(split_keys(values) for values in rows.values() if values is not None)]
    return pd.DataFrame(tables, index=pd.Index([seed, *work.seeds], name="seed"))
