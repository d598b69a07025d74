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
from typing import Any

from wildlab.errors import WildlabError
from wildlab.files import write_json
from wildlab.runner.seeds.fingerprint import code_key, trial_key
from wildlab.studies.protocol import Values, find_case

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
    case
        Whose trial it is (`wildlab.studies.protocol`).
    code, key
        `code_key` and `trial_key` of `wildlab.runner.seeds.fingerprint`.
    seeds
        All of them, whether they are there already or not; without the one whose flight the figures show.
    """

    reports: Path
    study: str
    case: str
    parameters: dict[str, Any]
    code: str
    key: str
    seeds: tuple[int, ...]

    def provenance(self) -> dict[str, Any]:
        """What ``provenance.json`` says about the seeds."""
        return {
            "case": self.case,
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
    reports: Path, study: str, case: str, drawn: int, count: int, parameters: Mapping[str, Any]
) -> SeedWork:
    """The work for ``count`` flights of a study.

    Parameters
    ----------
    parameters
        Those of the trial; others are left out.

    Raises
    ------
    WildlabError
        If there is no such case, or one of its trial's parameters is not given.
    """
    wanted = find_case(case).parameters
    absent = [parameter for parameter in wanted if parameters.get(parameter) is None]
    if absent:
        raise WildlabError(
            f"the trial of {case!r} needs the parameter {absent[0]!r}",
            "give it among the study's parameters" if absent[0] != "twin" else "name the study's twin",
            file="studies.toml",
            field=f"[{study}]",
        )
    given = {parameter: parameters[parameter] for parameter in wanted}
    code = code_key()
    key = trial_key(case, given, code)
    return SeedWork(reports, study, case, given, code, key, other_seeds(drawn, count))


# -- the store
# ------------------------------------------------------------------------------------


def write_seed(work: SeedWork, seed: int, values: Values) -> None:
    """Keep a seed's numbers; the file is there whole or not at all."""
    folder = work.folder
    folder.mkdir(parents=True, exist_ok=True)
    plain = {key: value if math.isfinite(value) else str(value) for key, value in values.items()}
    write_json(folder / f"{seed}.json", {"case": work.case, "seed": seed, "values": plain})


def read_seed(work: SeedWork, seed: int) -> Values | None:
    """A seed's numbers, or None where they are not there or cannot be read."""
    try:
        text = (work.folder / f"{seed}.json").read_text(encoding="utf-8")
        content = json.loads(text)
        if (content["case"], content["seed"]) != (work.case, seed):
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


def failed_seeds(failures: Sequence[tuple[int, str]]) -> str:
    """(seed, reason) of each seed that failed as a clause: the first one's reason, the others' numbers."""
    (first, reason), *others = sorted(failures)
    numbers = ", ".join(str(seed) for seed, _ in others[:8]) + (", ..." if len(others) > 8 else "")
    also = f" (so did {len(others)} more: {numbers})" if others else ""
    return f"seed {first} failed{also}: {reason.rstrip('.')}"
