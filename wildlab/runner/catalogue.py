"""``notebooks/studies.toml``: each study, the notebook that does it, what the notebook is given, and its
flights: made once, and kept in ``reports/.flights`` until their source changes.

::

    [static-point]
    title = "How well is one point on the ground located?"
    case = "static-point"                # what it shows: a folder in wildlab/studies
    section = "H 5.6.1"                  # of the thesis it answers to
    notebook = "static-point.ipynb"
    twin = "static-antenna"              # flight simulated from data/twins/static-antenna.toml, or ...
    # dataset = "openathena"             # ... imported from a public data set
    # recipe = "openathena.toml"         # ... by data/recipes/openathena.toml
    # beside = ["second.toml"]           # further flights of the data set; the notebook gets them as `others`
    seed = 1                             # of the flight that the figures show
    seeds = 100                          # over how many flights; handed to the notebook as `seeds`. The
                                         # case's trial is computed for each before the notebook starts
    timeout_minutes = 30                 # for the notebook, and for each seed
    # apart = true                       # runs where it is named only, not with all
    [static-point.parameters]            # handed to the notebook besides the five every notebook gets
    steps = 60
    [static-point.first_look]            # what a first look takes less of than the study, besides `seeds`,
    steps = 10                           # of which it takes FIRST_LOOK_SEEDS
"""

from __future__ import annotations

import ast
import difflib
import os
import re
import shutil
import tomllib
from collections.abc import Callable, Iterable, Sequence
from importlib.metadata import version
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pydantic import BaseModel, ConfigDict, Field, ValidationError, model_validator

from wildlab.errors import WildlabError
from wildlab.files import digest, write_atomic
from wildlab.paths import DATA, NOTEBOOKS, PACKAGE, REPORTS
from wildlab.studies.protocol import Study, case_names, find_case

if TYPE_CHECKING:
    from wildlab.flight.store import Flight

#: What the runner gives to every notebook; a study's own parameters may not use these names.
STANDARD_PARAMETERS = ("study", "flight", "seed", "out")

#: What a study with further flights gets besides: a list of their folders, in the order of `beside`.
OTHERS = "others"

#: Over how many flights a first look is taken, the one drawn included: the fewest whose median has one below
#: and one above it. The next flight lies between the outermost of three one time in two, of five two in
#: three: not worth two more flights of every study before there is a page, as nothing is claimed of either.
FIRST_LOOK_SEEDS = 3

_NAME = re.compile(r"[a-z0-9][a-z0-9-]*")


class StudyEntry(BaseModel):
    """One entry of ``studies.toml``."""

    model_config = ConfigDict(extra="forbid", frozen=True, strict=True)

    name: str
    title: str
    case: str | None = None
    section: str = ""
    notebook: str
    twin: str | None = None
    dataset: str | None = None
    recipe: str | None = None
    beside: list[str] = Field(default_factory=list)
    seed: int = Field(default=1, ge=0, lt=2**32)
    seeds: int | None = Field(default=None, ge=1, le=1_000_000)
    apart: bool = False
    timeout_minutes: float = Field(default=30.0, gt=0, allow_inf_nan=False)
    parameters: dict[str, Any] = Field(default_factory=dict)
    first_look: dict[str, int] = Field(default_factory=dict)

    @property
    def kind(self) -> str:
        """``twin``, ``logged``, or ``computed`` where no flight is involved."""
        return "twin" if self.twin else "logged" if self.recipe else "computed"

    def shown_case(self) -> Study | None:
        """The case whose trial is to be computed for each seed; None where there is none."""
        if self.case is None or self.seeds is None:
            return None
        case = find_case(self.case)
        return None if case.trial is None else case

    def reductions(self) -> dict[str, tuple[int, float]]:
        """What a first look takes less of, by parameter: (how many, of how many). Empty for a study that is
        quick enough as it is."""
        found: dict[str, tuple[int, float]] = {}
        if self.seeds is not None and self.seeds > FIRST_LOOK_SEEDS:
            found["seeds"] = (FIRST_LOOK_SEEDS, self.seeds)
        return found | {name: (few, self.parameters[name]) for name, few in self.first_look.items()}

    @model_validator(mode="after")
    def _consistent(self) -> StudyEntry:
        if not _NAME.fullmatch(self.name):
            raise ValueError("a study's name is made of a-z, 0-9 and hyphens")
        if self.case is not None and self.case not in case_names():
            raise ValueError(f"there is no case {self.case!r}; use one of: {', '.join(case_names())}")
        if self.seeds is not None and "seeds" in self.parameters:
            raise ValueError("the number of seeds is given twice")
        for name, few in self.first_look.items():
            whole = self.parameters.get(name)
            if isinstance(whole, bool) or not isinstance(whole, int | float) or not 0 <= few < whole:
                raise ValueError(
                    f"a first look takes {few} of {name!r}, and the study's own is {whole!r}: "
                    "give a whole number from 0 to below the study's own"
                )
        taken = sorted(set(self.parameters) & {*STANDARD_PARAMETERS, OTHERS})
        if taken:
            raise ValueError(f"the parameter {taken[0]!r} is set by the runner")
        return self


def load_studies(path: Path = NOTEBOOKS / "studies.toml") -> dict[str, StudyEntry]:
    """All studies by name, in the order of the file.

    Raises
    ------
    WildlabError
        If the file cannot be read or an entry is wrong.
    """
    try:
        content = tomllib.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        raise WildlabError(f"it cannot be read ({error})", "mend the file", file=path.name) from error
    studies: dict[str, StudyEntry] = {}
    for name, entry in content.items():
        try:
            studies[name] = StudyEntry.model_validate(
                {"name": name, **entry} if isinstance(entry, dict) else entry
            )
        except ValidationError as error:
            first = error.errors()[0]
            field = ".".join(str(part) for part in first["loc"])
            raise WildlabError(
                first["msg"].removeprefix("Value error, "),
                "mend this entry",
                file=path.name,
                field=f"[{name}] {field}".strip(),
            ) from error
    return studies


def find_studies(name: str, studies: dict[str, StudyEntry]) -> list[StudyEntry]:
    """The study of that name, or all studies of the case of that name.

    Raises
    ------
    WildlabError
        If there is neither; names the nearest study.
    """
    if name not in studies and (of_case := [study for study in studies.values() if study.case == name]):
        return of_case
    return [find_study(name, studies)]


def find_study(name: str, studies: dict[str, StudyEntry]) -> StudyEntry:
    """The study of that name.

    Raises
    ------
    WildlabError
        If there is none; names the nearest one.
    """
    if name in studies:
        return studies[name]
    alike = [known for known in studies if name and name in known]
    near = alike or difflib.get_close_matches(name, studies, n=1)
    words = " or ".join(repr(known) for known in near)
    raise WildlabError(f"there is no study {name!r}", f"use {words}" if near else "see: wildlab list")


def check_notebook(notebook: Path, parameters: Sequence[str]) -> int:
    """Refuse a notebook that would not do as it is told; the number of cells of one that will.

    Raises
    ------
    WildlabError
        If the notebook is absent or not one, has no or several cells tagged ``parameters``, or does not
        know one of the parameters.
    """
    from wildlab.reporting.notebook_pages import read_notebook  # takes a while, too

    if not notebook.is_file():
        raise WildlabError(
            "there is no such notebook", "restore it, or name another in studies.toml", file=notebook.name
        )
    node = read_notebook(notebook)
    tagged = [cell.source for cell in node.cells if "parameters" in cell.metadata.get("tags", [])]
    if len(tagged) != 1:
        raise WildlabError(
            f"the notebook has {len(tagged)} cells tagged `parameters`", "tag exactly one", file=notebook.name
        )
    try:
        nodes = list(ast.walk(ast.parse(tagged[0])))
    except SyntaxError:
        nodes = []
    known = [one.id for one in nodes if isinstance(one, ast.Name) and isinstance(one.ctx, ast.Store)]
    for name in parameters:
        if name not in known:
            raise WildlabError(
                f"the notebook has no parameter {name!r}",
                f"it has: {', '.join(known)}; add it to its parameters cell, or take it out of studies.toml",
                file=notebook.name,
            )
    return len(node.cells)


#: A change in any of these rooms can change a flight.
_ROOMS = ("geometry", "flight", "simulation")


def flight_for(study: str, flight: str, seed: int) -> Flight:
    """The flight in the folder ``flight``; where that is "", the first of `flights_for`."""
    return flights_for(study, flight, (), seed)[0]


def flights_for(study: str, flight: str, others: Sequence[str], seed: int) -> list[Flight]:
    """The flights of a study, the first one first.

    Parameters
    ----------
    study
        Its name in ``studies.toml``.
    flight, others
        Folders, as the runner gives them. Where ``flight`` is "", the study's own twin is simulated for
        ``seed``, or its own data set is imported; both are kept with those of the runner.

    Raises
    ------
    WildlabError
        If no flight is given and there is no such study, it has no flight, or its data set is not here; says
        how to get it.
    """
    from wildlab.flight.store import load_flight  # takes a while

    if flight:
        return [load_flight(Path(folder)) for folder in (flight, *others)]
    entry = find_study(study, load_studies())
    if entry.twin is not None:
        return [load_flight(twin_flight(entry.twin, seed, REPORTS))]
    if entry.recipe is None:
        raise WildlabError(
            f"the study {study!r} has no flight of its own", "name a flight's folder", field="flight"
        )
    recipes = (entry.recipe, *entry.beside)
    return [load_flight(dataset_flight(entry.dataset, recipe, REPORTS)) for recipe in recipes]


def twin_flight(twin: str, seed: int, reports: Path) -> Path:
    """Folder of the simulated flight; simulates it unless it is there already, made by the same code.

    Raises
    ------
    WildlabError
        If there is no such twin, or its parameters are wrong.
    """
    from wildlab.simulation.twins import simulate_twin

    # Twins share parts, so a change of any of their files may be a change of this one.
    key = _key([twin, seed], sorted((DATA / "twins").rglob("*.toml")))
    return _kept(reports, f"{twin}-{seed}", key, lambda _: simulate_twin(twin, seed))


def dataset_flight(dataset: str | None, recipe: str, reports: Path) -> Path:
    """Folder of the imported flight; imports it unless it is there already, from the same files by the same
    code.

    Raises
    ------
    WildlabError
        If the data set is not fetched, or the import fails.
    """
    from wildlab.flight.importing import import_flight

    recipe_path = DATA / "recipes" / recipe
    source = dataset_source(dataset) if dataset else None
    raw = sorted(path for path in source.rglob("*") if path.is_file()) if source else []
    key = _key([dataset, recipe], [recipe_path, *raw])

    def build(folder: Path) -> Any:
        return import_flight(recipe_path, source, folder, overwrite=False)

    return _kept(reports, recipe_path.stem, key, build)


def dataset_source(dataset: str) -> Path:
    """Folder of a fetched data set.

    Raises
    ------
    WildlabError
        If it is not there.
    """
    from wildlab.flight.catalog import dataset_folder, is_fetched

    if not is_fetched(dataset):
        raise WildlabError(
            f"the data set {dataset!r} is not here yet", f"get it first: wildlab fetch {dataset}"
        )
    return Path(dataset_folder(dataset))


def _kept(reports: Path, name: str, key: str, build: Callable[[Path], Any]) -> Path:
    """``reports/.flights/<name>``, built anew where its key differs."""
    from wildlab.flight.store import save_flight

    store = reports / ".flights"
    store.mkdir(parents=True, exist_ok=True)
    target, stamp = store / name, store / f"{name}.key"
    if target.is_dir() and stamp.is_file() and stamp.read_text(encoding="utf-8") == key:
        return target
    part = store / f".{name}.{os.getpid()}"
    shutil.rmtree(part, ignore_errors=True)
    try:
        flight = build(part)
        if not part.is_dir():
            save_flight(flight, part)
        # Another study that needs the same flight may be building it too: it has the same content, so whoever
        # comes last may win. The key goes first and comes last, so that it never vouches for another content.
        stamp.unlink(missing_ok=True)
        if target.exists():
            target.rename(store / f".{name}.{os.getpid()}.old")
        part.rename(target)
        write_atomic(stamp, key)
    finally:
        shutil.rmtree(part, ignore_errors=True)
        shutil.rmtree(store / f".{name}.{os.getpid()}.old", ignore_errors=True)
    return target


def _key(made_from: Sequence[Any], files: Iterable[Path]) -> str:
    """What a flight depends on: ``made_from``, files, and the code that makes it."""
    code = sorted(path for room in _ROOMS for path in (PACKAGE / room).rglob("*.py"))
    return digest([version("numpy"), *made_from], [(path.name, path) for path in [*code, *files]])
