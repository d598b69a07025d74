"""The flights a study needs: made once, and kept in ``reports/.flights`` until their source changes."""

from __future__ import annotations

import os
import shutil
from collections.abc import Callable, Iterable, Sequence
from importlib.metadata import version
from pathlib import Path
from typing import Any

from wildlab.errors import WildlabError
from wildlab.files import digest, write_atomic
from wildlab.flight.store import Flight, load_flight, save_flight
from wildlab.paths import DATA, PACKAGE, REPORTS
from wildlab.runner.catalogue import find_study, load_studies

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
