"""The flight a study needs: made once, and kept in ``reports/.flights`` until its source changes."""

from __future__ import annotations

import hashlib
import os
import shutil
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

from wildlab.errors import WildlabError
from wildlab.files import sha256, write_atomic
from wildlab.paths import DATA, PACKAGE

#: A change in any of these rooms can change a flight.
_ROOMS = ("geometry", "flight", "simulation")


def twin_flight(twin: str, seed: int, reports: Path) -> Path:
    """Folder of the simulated flight; simulates it unless it is there already, made by the same code.

    Raises
    ------
    WildlabError
        If there is no such twin, or its parameters are wrong.
    """
    from wildlab.simulation.twins import simulate_twin

    # Twins share parts, so a change of any of their files may be a change of this one.
    key = _fingerprint([f"{twin} {seed}"], sorted((DATA / "twins").rglob("*.toml")))
    return _kept(reports, f"{twin}-{seed}", key, lambda _: simulate_twin(twin, seed))


def dataset_flight(dataset: str | None, recipe: str, reports: Path) -> Path:
    """Folder of the imported flight; imports it unless it is there already, from the same files by the same
    code.

    Raises
    ------
    WildlabError
        If the data set is not fetched, or the import fails.
    """
    from wildlab.flight.recipe.importing import import_flight

    recipe_path = DATA / "recipes" / recipe
    source = dataset_source(dataset) if dataset else None
    raw = sorted(path for path in source.rglob("*") if path.is_file()) if source else []
    key = _fingerprint([str(dataset), recipe], [recipe_path, *raw])

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
            from wildlab.flight.store import save_flight

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


def _fingerprint(words: Iterable[str], files: Iterable[Path]) -> str:
    import numpy as np

    digest = hashlib.sha256(repr([np.__version__, *words]).encode())
    code = sorted(path for room in _ROOMS for path in (PACKAGE / room).glob("**/*.py"))
    for path in [*code, *files]:
        digest.update(f"{path.name} {sha256(path) if path.is_file() else 'absent'}\n".encode())
    return digest.hexdigest()
