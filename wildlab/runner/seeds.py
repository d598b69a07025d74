"""What was computed for each seed of a study, kept so that nothing is computed twice.

``reports/.seeds/<study>/<key>/<seed>.json`` holds one seed's numbers. The key stands for everything else that
they depend on: the code, the twins' parameters, the packages' versions and the parameters. Only whole files
ever appear there, so a run that is broken off loses at most the seeds under way. A run that succeeds removes
what older keys have left.

Floats are written as the shortest text that reads back as the same float. JSON has no word for NaN and
infinity: they are the texts "nan", "inf" and "-inf".

Each file carries a digest of all that it says, and it is read only where it is, byte for byte, what would be
written for the numbers that stand in it: a bit that the disk has turned, a number gone or added by hand, or a
file of another key or seed would else become a verdict. Such a file is damaged: its seed is computed again.
"""

from __future__ import annotations

import contextlib
import hashlib
import json
import logging
import math
import os
import platform
import shutil
import traceback
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from importlib.metadata import PackageNotFoundError, version
from multiprocessing import connection
from pathlib import Path
from typing import Any

from wildlab.errors import WildlabError
from wildlab.files import digest, write_atomic
from wildlab.paths import DATA, PACKAGE
from wildlab.runner.processes import end_with_runner
from wildlab.studies.protocol import Values, case_names, find_case, run_trial

#: A change in any of these rooms can change a number.
ROOMS = (
    "geometry",
    "flight",
    "simulation",
    "navigation",
    "detection",
    "tracking",
    "planning",
    "evaluation",
    "analysis",
)
#: Packages below them whose version can.
PACKAGES = (
    "filterpy",
    "numba",
    "numpy",
    "opencv-python-headless",
    "pandas",
    "pyarrow",
    "pymap3d",
    "pyproj",
    "rasterio",
    "scipy",
)
#: Folder of the store among the reports.
STORE = ".seeds"


# -- what numbers depend on: two machines with the same key compute the same thing
# ------------------------------------------------------------------------------------


def trial_key(case: str, parameters: Mapping[str, Any], code: str) -> str:
    """What a trial's numbers depend on besides the seed, as 64 hexadecimal digits. ``code``: `code_key`."""
    return digest([case, dict(parameters), code])


def page_key(notebook: Path, given: Mapping[str, Any], code: str) -> str:
    """What a study's page depends on, as 64 hexadecimal digits: `code_key`, how it is shown and said, what is
    published, the notebook, and ``given``, whatever the notebook is given."""
    rooms = ("studies", "reporting", "messages")
    shown = [path for room in rooms for path in (PACKAGE / room).rglob("*.py")]
    texts = [
        path for folder in ("published", "studies", "messages") for path in (DATA / folder).rglob("*.toml")
    ]
    shown += [DATA / "glossary.toml", *texts, *(DATA / "pages").glob("*")]
    return digest([code, dict(given)], [(path.name, path) for path in [*sorted(shown), notebook]])


def code_key() -> str:
    """The code of all trials and below them, the twins' parameters and the packages' versions, as 64
    hexadecimal digits."""
    code = [path for room in ROOMS for path in (PACKAGE / room).rglob("*.py")]
    # Of the studies the cases can; rules, pages and words cannot.
    cases = (PACKAGE / "studies" / f"{name.replace('-', '_')}.py" for name in case_names())
    code += [path for path in cases if path.is_file()]
    # Twins share parts, so a change of any of their files may be a change of each. Named as in a checkout, so
    # that a wheel of the same code has the same key.
    named = [(f"wildlab/{path.relative_to(PACKAGE).as_posix()}", path) for path in code]
    named += [
        (f"data/{path.relative_to(DATA).as_posix()}", path) for path in (DATA / "twins").rglob("*.toml")
    ]
    versions = {package: package_version(package) for package in PACKAGES}
    return digest([platform.python_version_tuple()[:2], versions], sorted(named))


def package_version(package: str) -> str | None:
    """The version of a package; None where it is not installed."""
    try:
        return version(package)
    except PackageNotFoundError:
        return None


# -- what is to be computed
# ------------------------------------------------------------------------------------


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
        Of `code_key` and `trial_key`.
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
        """What ``provenance.json`` says about the seeds: what their numbers depend on, and the digest of each
        seed's and of all of them."""
        kept = {seed: read_seed(self, seed) for seed in self.seeds}
        digests = {
            str(seed): seed_digest(self, seed, values) for seed, values in kept.items() if values is not None
        }
        return {
            "case": self.case,
            "parameters": self.parameters,
            "key": self.key,
            "seeds": list(self.seeds),
            "digests": digests,
            "digest": hashlib.sha256(json.dumps(digests).encode()).hexdigest(),
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


def seed_digest(work: SeedWork, seed: int, values: Values) -> str:
    """SHA-256 of case, key, seed and all numbers with their names, as 64 hexadecimal digits.

    Of their canonical form: names in alphabetical order, floats as the shortest text that reads back the
    same. So it is the same wherever, and in whatever order, the same numbers were computed.
    """
    return digest([work.case, work.key, seed, sorted(_plain(values).items())])


def write_seed(work: SeedWork, seed: int, values: Values) -> None:
    """Keep a seed's numbers; the file is there whole or not at all."""
    work.folder.mkdir(parents=True, exist_ok=True)
    write_atomic(_file(work, seed), _text(work, seed, values))


def read_seed(work: SeedWork, seed: int) -> Values | None:
    """A seed's numbers, or None where they are not there or the file is not as it was written."""
    try:
        text = _file(work, seed).read_bytes().decode("utf-8")
        values = {str(name): float(value) for name, value in json.loads(text)["values"].items()}
        return values if text == _text(work, seed, values) else None
    except (OSError, ValueError, KeyError, TypeError, AttributeError, RecursionError):
        return None


def missing_seeds(work: SeedWork) -> list[int]:
    """The seeds that are to be computed, ascending: nothing is there, or it is damaged."""
    return [seed for seed in work.seeds if read_seed(work, seed) is None]


def _text(work: SeedWork, seed: int, values: Values) -> str:
    content = {
        "case": work.case,
        "key": work.key,
        "seed": seed,
        "names": sorted(values),
        "values": _plain(values),
        "digest": seed_digest(work, seed, values),
    }
    return json.dumps(content, indent=1, allow_nan=False) + "\n"


def _plain(values: Values) -> dict[str, float | str]:
    plain = {name: float(value) for name, value in values.items()}
    return {name: value if math.isfinite(value) else str(value) for name, value in plain.items()}


def _file(work: SeedWork, seed: int) -> Path:
    return work.folder / f"{seed}.json"


def _first(seeds: Sequence[int]) -> str:
    return ", ".join(str(seed) for seed in seeds[:8]) + (", ..." if len(seeds) > 8 else "")


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
    also = f" (so did {len(others)} more: {_first([seed for seed, _ in others])})" if others else ""
    return f"seed {first} failed{also}: {reason.rstrip('.')}"


# -- computing them
# ------------------------------------------------------------------------------------


def answer(case: str, seed: int, parameters: dict[str, Any], code: str) -> tuple[str, Any]:
    """``("done", values)`` or ``("failed", (reason, "", details))`` for one seed, here or on a cluster.

    ``code`` is the runner's `code_key`: numbers of other code are not mixed in.
    """
    from wildlab.reporting.notebook_pages import clean_text

    try:
        _same_code(code)
        return "done", run_trial(case, seed, parameters)
    except Exception as error:  # whatever it is, the runner must hear of it
        known = isinstance(error, WildlabError)
        reason = str(error) if known else f"The computation raised {type(error).__name__}: {error}."
        return "failed", (clean_text(reason), "", clean_text(traceback.format_exc()))


#: The code that this process runs; looked up once, because modules are imported once.
_CODE: list[str] = []


def _same_code(code: str) -> None:
    if not _CODE:
        _CODE.append(code_key())
    if _CODE[0] != code:
        raise WildlabError(
            "the code, the twins' parameters or the packages here are not those that the run began with",
            "run it again; on a cluster, give every worker the same wildlab and environment",
        )


def serve(pipe: connection.Connection) -> None:
    """Body of a process: what `answer` is given comes in, an answer goes out; ends when the pipe does."""
    end_with_runner()
    nowhere = os.open(os.devnull, os.O_WRONLY)
    for stream in (1, 2):  # a warning would break the runner's display
        os.dup2(nowhere, stream)
    logger = logging.getLogger("wildlab")
    logger.setLevel(logging.INFO)
    logger.addHandler(_ToRunner(pipe))
    with contextlib.suppress(EOFError, OSError):
        while True:
            pipe.send(answer(*pipe.recv()))


class _ToRunner(logging.Handler):
    """What the code below logs (that it compiles, which takes a while) goes to the runner, to be shown."""

    def __init__(self, pipe: connection.Connection) -> None:
        super().__init__(logging.INFO)
        self._pipe = pipe

    def emit(self, record: logging.LogRecord) -> None:
        with contextlib.suppress(OSError):
            self._pipe.send(("note", record.getMessage()))
