"""What was computed for each seed of a study, kept so that nothing is computed twice.

``reports/.seeds/<study>/<key>/<seed>.json`` holds one seed's numbers. The key stands for everything else that
they depend on: the code, the twins' parameters, the packages' versions and the parameters. Only whole files
ever appear there, so a run that is broken off loses at most the seeds under way. A run that succeeds removes
what older keys have left.

Floats are written as the shortest text that reads back as the same float. JSON has no word for NaN and
infinity: they are the texts "nan", "inf" and "-inf".

Each file carries a digest of all that it says, and it is read only where it is, byte for byte, what would be
written for the numbers that stand in it: a bit that the disk has turned, a number gone or added by hand, or a
file of another key or seed would else become a verdict. Such a file is *damaged*: it is set aside as
``<seed>.damaged``, and its seed is computed again. So is a seed whose numbers have other names than those of
most seeds.
"""

from __future__ import annotations

import hashlib
import json
import math
import platform
import shutil
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any, NamedTuple

from wildlab.errors import WildlabError
from wildlab.files import write_atomic
from wildlab.paths import DATA, PACKAGE
from wildlab.studies.protocol import Values, find_case

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
#: Of the studies their trials can; how they are shown and said cannot.
TRIALS = "studies/*/trial.py"
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
#: What a file held before it had a digest. Such files count as absent.
_WITHOUT_DIGEST = {"case", "seed", "values"}


# -- what numbers depend on: two machines with the same key compute the same thing
# ------------------------------------------------------------------------------------


def trial_key(case: str, parameters: Mapping[str, Any], code: str) -> str:
    """What a trial's numbers depend on besides the seed, as 64 hexadecimal digits. ``code``: `code_key`."""
    text = json.dumps([case, dict(parameters), code], sort_keys=True, allow_nan=False)
    return hashlib.sha256(text.encode()).hexdigest()


def page_key(notebook: Path, given: Mapping[str, Any], code: str) -> str:
    """What a study's page depends on, as 64 hexadecimal digits: `code_key`, how it is shown and said, what is
    published, the notebook, and ``given``, whatever the notebook is given."""
    rooms = ("studies", "reporting", "messages")
    shown = [path for room in rooms for path in (PACKAGE / room).rglob("*.py")]
    texts = [*(DATA / "published").glob("*.toml"), *(DATA / "messages").rglob("*.toml")]
    shown += [DATA / "glossary.toml", *texts, *(DATA / "pages").glob("*")]
    digest = hashlib.sha256(json.dumps([code, dict(given)], sort_keys=True, allow_nan=False).encode())
    for path in [*sorted(shown), notebook]:
        digest.update(path.name.encode())
        digest.update(hashlib.sha256(path.read_bytes()).digest())
    return digest.hexdigest()


def code_key() -> str:
    """The code of all trials and below them, the twins' parameters and the packages' versions, as 64
    hexadecimal digits."""
    code = [path for room in ROOMS for path in (PACKAGE / room).rglob("*.py")] + [*PACKAGE.glob(TRIALS)]
    # Twins share parts, so a change of any of their files may be a change of each. Named as in a checkout, so
    # that a wheel of the same code has the same key.
    named = [(f"wildlab/{path.relative_to(PACKAGE).as_posix()}", path) for path in code]
    named += [
        (f"data/{path.relative_to(DATA).as_posix()}", path) for path in (DATA / "twins").rglob("*.toml")
    ]
    versions = [f"{package} {_version(package)}" for package in PACKAGES]
    digest = hashlib.sha256(" ".join([*platform.python_version_tuple()[:2], *versions]).encode())
    for name, path in sorted(named):
        digest.update(name.encode())
        digest.update(hashlib.sha256(path.read_bytes()).digest())
    return digest.hexdigest()


def _version(package: str) -> str:
    try:
        return version(package)
    except PackageNotFoundError:
        return "absent"


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
        """What ``provenance.json`` says about the seeds: what their numbers depend on, the digest of each
        seed's and of all of them, and which seeds were computed again because what was kept was damaged."""
        kept = {seed: read_seed(self, seed) for seed in self.seeds}
        digests = {
            str(seed): seed_digest(self, seed, values) for seed, values in kept.items() if values is not None
        }
        damaged = [seed for seed in self.seeds if _aside(self, seed).exists()]
        return {
            "case": self.case,
            "parameters": self.parameters,
            "key": self.key,
            "seeds": list(self.seeds),
            "digests": digests,
            "digest": hashlib.sha256(json.dumps(digests).encode()).hexdigest(),
            "damaged": {"count": len(damaged), "seeds": damaged},
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
    said = [work.case, work.key, seed, sorted(_plain(values).items())]
    return hashlib.sha256(json.dumps(said, allow_nan=False).encode()).hexdigest()


def write_seed(work: SeedWork, seed: int, values: Values) -> None:
    """Keep a seed's numbers; the file is there whole or not at all."""
    work.folder.mkdir(parents=True, exist_ok=True)
    write_atomic(_file(work, seed), _text(work, seed, values))


def read_seed(work: SeedWork, seed: int) -> Values | None:
    """A seed's numbers, or None where they are not there or the file is not as it was written."""
    return _look(work, seed).values


def missing_seeds(work: SeedWork) -> list[int]:
    """The seeds that are to be computed, ascending: see `take_stock`."""
    return list(take_stock(work).missing)


class Stock(NamedTuple):
    """What is kept of a study's seeds. Each of its fields lists seeds, ascending.

    Attributes
    ----------
    absent
        Nothing is there, or a file without a digest, as they once were.
    damaged
        Something is there that is not what was written for this case, key and seed.
    unlike
        Numbers with other names than those of most seeds.
    missing
        All of these.
    """

    absent: tuple[int, ...]
    damaged: tuple[int, ...]
    unlike: tuple[int, ...]

    @property
    def missing(self) -> tuple[int, ...]:
        return tuple(sorted({*self.absent, *self.damaged, *self.unlike}))


def take_stock(work: SeedWork, fresh: Collection[int] = ()) -> Stock:
    """Which of a study's seeds are to be computed, and why. Changes nothing.

    Parameters
    ----------
    fresh
        Seeds computed in this very run. Where two sets of names are equally common, the one that more of them
        have counts as the right one.
    """
    looks = {seed: _look(work, seed) for seed in work.seeds}
    names = {seed: frozenset(look.values) for seed, look in looks.items() if look.values is not None}
    common = _common_names(names, fresh)
    return Stock(
        tuple(seed for seed, look in looks.items() if look.values is None and not look.damaged),
        tuple(seed for seed, look in looks.items() if look.damaged),
        tuple(seed for seed, found in names.items() if found != common),
    )


def set_aside(work: SeedWork, damaged: Iterable[int]) -> None:
    """Move damaged files to ``<seed>.damaged``, where they can be looked at, and where `SeedWork.provenance`
    finds that there were any even if the run that computes them again is broken off."""
    for seed in damaged:
        try:
            _file(work, seed).replace(_aside(work, seed))
        except FileNotFoundError:
            continue  # another run was faster


def faults(work: SeedWork, fresh: Collection[int]) -> list[tuple[int, str]]:
    """(seed, reason) of seeds that were computed in this run and are still not as they should be."""
    stock = take_stock(work, fresh)
    gone = "what was written for it does not read back; see whether the disk is full or failing"
    found = [(seed, gone) for seed in (*stock.absent, *stock.damaged) if seed in fresh]
    names = {seed: frozenset(read_seed(work, seed) or ()) for seed in work.seeds}
    common = _common_names(names, fresh)
    like = min((seed for seed, its in names.items() if its == common), default=0)
    for seed in stock.unlike:
        if seed in fresh:
            less, more = _some(common - names[seed]), _some(names[seed] - common)
            apart = " and ".join([f"lacks {less}"] * bool(less) + [f"has {more} besides"] * bool(more))
            found.append(
                (
                    seed,
                    f"its numbers have other names than those of seed {like}: it {apart}; let the trial give "
                    "the same names for each seed, and NaN for what a flight has no value for",
                )
            )
    return sorted(found)


def again_words(stock: Stock) -> list[str]:
    """What a run says of kept numbers that it does not use."""
    words = []
    if stock.damaged:
        words.append(f"kept numbers are damaged and are computed again: {_seeds(stock.damaged)}")
    if stock.unlike:
        words.append(
            "kept numbers have other names than those of most seeds and are computed again: "
            f"{_seeds(stock.unlike)}"
        )
    return words


class _Look(NamedTuple):
    values: Values | None
    damaged: bool = False


def _look(work: SeedWork, seed: int) -> _Look:
    try:
        text = _file(work, seed).read_bytes().decode("utf-8")
        content = json.loads(text)
        if set(content) == _WITHOUT_DIGEST:
            return _Look(None)
        values = {str(name): float(value) for name, value in content["values"].items()}
        intact = text == _text(work, seed, values)
    except FileNotFoundError:
        return _Look(None)
    except (OSError, ValueError, KeyError, TypeError, AttributeError, RecursionError):
        return _Look(None, damaged=True)
    return _Look(values) if intact else _Look(None, damaged=True)


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


def _aside(work: SeedWork, seed: int) -> Path:
    return work.folder / f"{seed}.damaged"


def _common_names(names: Mapping[int, frozenset[str]], fresh: Collection[int]) -> frozenset[str]:
    """The names that most seeds have; of equally common ones those of more fresh seeds, or of the first."""
    groups: dict[frozenset[str], list[int]] = {}
    for seed, found in names.items():
        groups.setdefault(found, []).append(seed)
    new = set(fresh)

    def weight(its: frozenset[str]) -> tuple[int, int, int]:
        seeds = groups[its]
        return len(seeds), len(new.intersection(seeds)), -seeds[0]

    return max(groups, key=weight, default=frozenset())


def _some(names: Collection[str]) -> str:
    """The first names in quotes, and how many there are besides."""
    shown = ", ".join(repr(name) for name in sorted(names)[:2])
    return shown + (f" and {len(names) - 2} more" if len(names) > 2 else "")


def _seeds(seeds: Sequence[int]) -> str:
    shown = ", ".join(str(seed) for seed in seeds[:8]) + (", ..." if len(seeds) > 8 else "")
    return f"{len(seeds)} seed{'s' * (len(seeds) != 1)} ({shown})"


def sweep_seeds(work: SeedWork) -> None:
    """Remove what is there under other keys, and halves of files that a machine has left when it stopped.

    What was set aside as damaged under this key stays: the numbers that took its place are still in use.
    """
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
