"""`wildlab vary`: which verdicts of a study turn when the parameters that were chosen for its twin are moved.

Each group of chosen or fitted parameters (`wildlab.simulation.parameters.groups_of`) is multiplied by each
factor, the filters' tuning stays what it is, and the study's trial is computed on the same seeds. Verdicts of
these flights stand beside those of as many flights of the twin as it is.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pandas as pd

from wildlab.errors import RunFailed, WildlabError
from wildlab.paths import REPORTS
from wildlab.reporting.published import judge, load_claims, published_rows
from wildlab.reporting.report import open_report
from wildlab.reporting.text import slug
from wildlab.runner.catalogue import StudyEntry, find_study, load_studies
from wildlab.runner.scheduling import compute_seeds
from wildlab.runner.seeds import (
    SeedWork,
    make_work,
    missing_seeds,
    read_seed,
    sweep_seeds,
    trial_key,
)
from wildlab.simulation.parameters import groups_of, load_twin
from wildlab.studies.page import decide_claims, record_spread
from wildlab.studies.protocol import VARIED, Study, split_keys

#: By what parameters are multiplied, and over how many flights, where nothing else is asked for.
FACTORS, SEEDS = (0.5, 0.8, 1.25, 2.0), 20
#: The move that moves nothing, which the others are compared with.
AS_IT_IS = "as it is"


class Moved(NamedTuple):
    """One group moved: by which factor, the verdicts by what they are on, and why there are none."""

    group: str
    factor: float
    verdicts: dict[str, str]
    reason: str = ""


def vary_study(
    name: str,
    *,
    factors: Sequence[float] = FACTORS,
    seeds: int = SEEDS,
    reports: Path = REPORTS,
    parallel: int = 1,
    tell: Callable[[str], None] = lambda line: None,
) -> pd.DataFrame:
    """Move each group of a study's twin, and see which verdicts turn.

    What is computed is kept, so that a run that is broken off goes on where it stopped.

    Parameters
    ----------
    name
        Of the study.
    factors
        By which the parameters are multiplied.
    seeds
        Over how many flights, the same for all.
    parallel
        How many processes.
    tell
        Called with a line on how it goes.

    Returns
    -------
    DataFrame
        `turned_table`.

    Raises
    ------
    WildlabError
        If the study is unknown or has no trial on simulated flights, a factor is not above zero, or its twin
        cannot be computed as it is.
    """
    study = find_study(name, load_studies())
    case = study.shown_case()
    if case is None or study.twin is None:
        raise WildlabError(
            f"{name!r} is not computed over simulated flights, so there is nothing to move",
            "see which are: wildlab list (kind twin, and a number of flights)",
        )
    if not factors or any(not np.isfinite(one) or one <= 0 or one == 1 for one in factors):
        raise WildlabError(
            f"factors {', '.join(f'{one:g}' for one in factors)}",
            "give numbers above zero other than one: --by 0.5,2",
        )
    moves: dict[tuple[str, float], dict[str, float]] = {(AS_IT_IS, 1.0): {}}
    for group, parameters in groups_of(load_twin(study.twin)).items():
        moves |= {(group, float(one)): dict.fromkeys(parameters, float(one)) for one in factors}
    works = {move: _work(study, case, seeds, move, given, reports) for move, given in moves.items()}
    missing = sum(len(missing_seeds(work)) for work in works.values())
    there = sum(len(work.seeds) for work in works.values()) - missing
    tell(f"{len(works) - 1} moves and the twin as it is: {missing} flights to compute, {there} are there")

    def progress(done: int, count: int) -> None:
        if done % 20 == 0:
            tell(f"{done} of {count} flights")

    failures = compute_seeds(list(works.values()), parallel, progress)
    for work in works.values():
        if work.study not in failures:
            sweep_seeds(work)
    moved = []
    for (group, factor), work in works.items():
        reason = failures.get(work.study, "")
        if reason and group == AS_IT_IS:
            raise RunFailed(reason, "mend that first")
        verdicts = {} if reason else _verdicts(study, case, work)
        moved.append(Moved(group, factor, verdicts, reason))
    return turned_table(moved)


def turned_table(moved: Sequence[Moved]) -> pd.DataFrame:
    """Which verdicts are others than on the twin as it is, the first of ``moved``.

    Returns
    -------
    DataFrame
        Columns ``group``, ``factor``, ``turned`` (how many), ``of`` and ``which``, a line for each that
        turned; where nothing could be computed ``which`` says why, and ``turned`` is NaN.
    """
    (base, *others) = moved
    rows = []
    for one in others:
        turned = [
            f"{key}: {base.verdicts[key]} → {verdict}"
            for key, verdict in one.verdicts.items()
            if base.verdicts.get(key, verdict) != verdict
        ]
        rows.append(
            {
                "group": one.group,
                "factor": one.factor,
                "turned": float("nan") if one.reason else float(len(turned)),
                "of": len(base.verdicts),
                "which": one.reason or "; ".join(turned),
            }
        )
    return pd.DataFrame(rows, columns=["group", "factor", "turned", "of", "which"])


def _work(
    study: StudyEntry,
    case: Study,
    seeds: int,
    move: tuple[str, float],
    factors: dict[str, float],
    reports: Path,
) -> SeedWork:
    given = {**study.parameters, "twin": study.twin}
    group, factor = move
    # No flight is drawn here: all seeds from one upwards.
    work = make_work(reports, f"{study.name}.vary.{slug(group)}-{factor:g}", case.case, 0, seeds + 1, given)
    parameters = work.parameters | ({VARIED: factors} if factors else {})
    return replace(work, parameters=parameters, key=trial_key(case.case, parameters, work.code))


def _verdicts(study: StudyEntry, case: Study, work: SeedWork) -> dict[str, str]:
    """The verdicts on a study's claims and published numbers, by what they are on."""
    rows = [values for seed in work.seeds if (values := read_seed(work, seed)) is not None]
    if len(rows) < len(work.seeds):
        raise RunFailed(f"numbers of {work.study} have gone while they were read", "run it again")
    spread = pd.DataFrame([split_keys(values) for values in rows])
    report = open_report(study=study.name, kind="twin", seeds=len(rows))
    record_spread(report, case.rules.unit_of, spread, {})
    # What a claim asks besides the flights, a notebook measures.
    checks = case.checks(spread)
    decide_claims(report, [claim for claim in load_claims(study.name) if claim["id"] in checks], checks)
    found = {claim["id"]: claim["verdict"] for claim in report.claims}
    for row in published_rows(study.name):
        compared = judge(row, report.recorded)
        if compared is not None:
            found[f"{row['name']} of {row['subject']}"] = compared.words
    return found
