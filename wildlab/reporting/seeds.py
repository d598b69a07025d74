"""What was computed for each seed of a study, kept so that nothing is computed twice.

``reports/.seeds/<study>/<key>/<seed>.json`` holds one seed's numbers. The key stands for everything else that
they depend on: the code, the twins' parameters, the packages' versions and the parameters. Only whole files
ever appear there, so a run that is broken off loses at most the seeds under way. A run that succeeds removes
what older keys have left.

Floats are written as the shortest text that reads back as the same float. JSON has no word for NaN and
infinity: they are the texts "nan", "inf" and "-inf".
"""

from __future__ import annotations

import json
import math
import shutil
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from wildlab.errors import RunFailed, WildlabError
from wildlab.paths import REPORTS
from wildlab.pipeline.flown import Values, code_key, find_flown, work_key
from wildlab.reporting.files import write_json

if TYPE_CHECKING:
    import pandas as pd

#: Folder of the store among the reports.
STORE = ".seeds"


@dataclass(frozen=True)
class SeedWork:
    """What is to be computed for each seed of a study.

    Attributes
    ----------
    reports
        The folder that the store is in.
    study
        Name of the report, and of its folder in the store.
    name
        The function, as `wildlab.pipeline.flown.FLOWN` names it.
    code, key
        `code_key` and `work_key` of `wildlab.pipeline.flown`.
    seeds
        All of them, whether they are there already or not; without the one whose flight the figures show.
    """

    reports: Path
    study: str
    name: str
    parameters: dict[str, Any]
    code: str
    key: str
    seeds: tuple[int, ...]

    def provenance(self) -> dict[str, Any]:
        """What ``provenance.json`` says about the seeds."""
        return {
            "function": self.name,
            "parameters": self.parameters,
            "key": self.key,
            "seeds": list(self.seeds),
        }

    @property
    def folder(self) -> Path:
        """Where its numbers lie."""
        return self.reports / STORE / self.study / self.key


def other_seeds(drawn: int, count: int) -> tuple[int, ...]:
    """The seeds of ``count`` flights besides the one drawn: from 1 upwards, without that one."""
    return tuple(seed for seed in range(1, count + 1) if seed != drawn)[: count - 1]


def make_work(
    reports: Path, study: str, name: str, drawn: int, count: int, parameters: Mapping[str, Any]
) -> SeedWork:
    """The work for ``count`` flights of a study.

    Parameters
    ----------
    parameters
        Those of the function; others are left out.

    Raises
    ------
    WildlabError
        If there is no function of that name, or one of its parameters is not given.
    """
    wanted = find_flown(name).parameters
    absent = [parameter for parameter in wanted if parameters.get(parameter) is None]
    if absent:
        raise WildlabError(
            f"what is computed for each seed needs the parameter {absent[0]!r}",
            "give it among the study's parameters" if absent[0] != "twin" else "name the study's twin",
            file="studies.toml",
            field=f"[{study}]",
        )
    given = {parameter: parameters[parameter] for parameter in wanted}
    code = code_key()
    return SeedWork(reports, study, name, given, code, work_key(name, given, code), other_seeds(drawn, count))


# -- the store
# ------------------------------------------------------------------------------------


def write_seed(work: SeedWork, seed: int, values: Values) -> None:
    """Keep a seed's numbers; the file is there whole or not at all."""
    folder = work.folder
    folder.mkdir(parents=True, exist_ok=True)
    plain = {key: value if math.isfinite(value) else str(value) for key, value in values.items()}
    write_json(folder / f"{seed}.json", {"function": work.name, "seed": seed, "values": plain})


def read_seed(work: SeedWork, seed: int) -> Values | None:
    """A seed's numbers, or None where they are not there or cannot be read."""
    try:
        text = (work.folder / f"{seed}.json").read_text(encoding="utf-8")
        content = json.loads(text)
        if (content["function"], content["seed"]) != (work.name, seed):
            return None
        return {str(key): float(value) for key, value in content["values"].items()}
    except (OSError, ValueError, KeyError, TypeError, AttributeError):
        return None


def missing_seeds(work: SeedWork) -> list[int]:
    """The seeds whose numbers are not there, ascending."""
    return [seed for seed in work.seeds if read_seed(work, seed) is None]


def sweep_seeds(work: SeedWork) -> None:
    """Remove what is there under other keys, and halves of files that a machine has left when it stopped."""
    for folder in work.folder.parent.glob("*"):
        if folder.name != work.key:
            shutil.rmtree(folder, ignore_errors=True)
    for part in work.folder.glob(".*.json.*"):
        part.unlink(missing_ok=True)


# -- in the notebook
# ------------------------------------------------------------------------------------


def seeds_table(
    name: str,
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
    not there yet are computed now, in a process beside the kernel, and kept.

    Parameters
    ----------
    name
        The function, as `wildlab.pipeline.flown.FLOWN` names it (``each_seed`` in ``studies.toml``).
    seeds
        How many flights, the one drawn included.
    seed, drawn
        Seed of the flight that the figures show, and what the notebook has computed on it.
    out
        The notebook's parameter: the report's folder, beside which the store is.
    parameters
        The function's.

    Raises
    ------
    WildlabError
        If a parameter is missing, or a seed fails; it names the seed.
    """
    import pandas as pd

    reports = Path(out).parent if out else REPORTS
    work = make_work(reports, study, name, seed, seeds, parameters)
    missing = missing_seeds(work)
    if missing:
        _compute(work, missing)
    rows = {one: read_seed(work, one) for one in work.seeds}
    unread = [one for one, values in rows.items() if values is None]
    if unread:
        raise RunFailed(f"the numbers of seed {unread[0]} have gone while they were read", "run it again")
    tables = [dict(drawn), *(split_keys(values) for values in rows.values() if values is not None)]
    return pd.DataFrame(tables, index=pd.Index([seed, *work.seeds], name="seed"))


def split_keys(values: Mapping[str, float]) -> dict[tuple[str, str], float]:
    """Keys "subject/name" as (subject, name)."""
    result = {}
    for key, value in values.items():
        subject, _, name = key.partition("/")
        result[subject, name] = value
    return result


def _compute(work: SeedWork, missing: Sequence[int]) -> None:
    from wildlab.reporting.crew import Crew

    failures: list[tuple[int, str]] = []
    with Crew() as crew:
        for done, one in enumerate(missing):
            print(f"\r{work.study}: {done} of {len(missing)} seeds", end="", flush=True)
            crew.give(work, one)
            while not (results := crew.collect(wait_s=0.25)):
                pass
            failures += [(result.seed, result.failure.reason) for result in results if result.failure]
    print(f"\r{work.study}: {len(missing) - len(failures)} of {len(missing)} seeds", flush=True)
    if failures:
        raise RunFailed(failed_seeds(failures), "mend that; the seeds that are finished are kept")


def failed_seeds(failures: Sequence[tuple[int, str]]) -> str:
    """(seed, reason) of each seed that failed as a clause: the first one's reason, the others' numbers."""
    (first, reason), *others = sorted(failures)
    numbers = ", ".join(str(seed) for seed, _ in others[:8]) + (", ..." if len(others) > 8 else "")
    also = f" (so did {len(others)} more: {numbers})" if others else ""
    return f"seed {first} failed{also}: {reason.rstrip('.')}"
