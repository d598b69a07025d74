"""The chain of digests from raw files to pages, computed again: what does not fit, what was not looked at."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any, NamedTuple

from wildlab.errors import WildlabError
from wildlab.files import sha256
from wildlab.flight.manifest import FILE_NAME, read_manifest
from wildlab.flight.store import manifest_changed, verify
from wildlab.runner.record.digests import (
    AGAIN,
    BEFORE_DIGESTS,
    FILES,
    STATUS,
    has_digests,
    misfits,
)
from wildlab.runner.record.provenance import flights_near, provenance_of_flight, read_provenance
from wildlab.runner.seeds import SeedWork, read_seed, seed_digest


class Verification(NamedTuple):
    """What became of a report's chain of digests.

    Attributes
    ----------
    misfits
        What does not fit: file, field, problem and fix of each.
    checked
        What was computed again, in words.
    unchecked
        What could not be, and why.
    """

    misfits: tuple[WildlabError, ...]
    checked: tuple[str, ...]
    unchecked: tuple[str, ...]


def verify_report(folder: Path, flight: Path | None = None, raw: Path | None = None) -> Verification:
    """Compute the digests of a report again: of its files, its kept seeds, its flights and their raw files.

    Parameters
    ----------
    folder
        Of the report.
    flight
        Its flight, where that does not lie where flights lie.
    raw
        The folder that the flight was imported from; left out, raw files are not read.

    Raises
    ------
    WildlabError
        Where the folder is no report.
    """
    try:
        status = json.loads((folder / STATUS).read_text(encoding="utf-8"))
    except (OSError, ValueError, RecursionError):
        status = None
    if not isinstance(status, dict):
        raise WildlabError("there is no report that is done here", "name a folder reports/NAME", file=folder)
    if not has_digests(status):
        old = WildlabError("the report has no digests", BEFORE_DIGESTS, file=folder / STATUS, field=FILES)
        return Verification((old,), (), ())
    found = misfits(folder, status)
    checked = [f"{len(status.get(FILES) or ())} files of the report"]
    unchecked: list[str] = []
    provenance = read_provenance(folder)
    if seeds := provenance.get("seeds"):
        found += _misfits_of_seeds(folder, seeds, checked, unchecked)
    flights = [one for one in (provenance.get("flight"), *provenance.get("others", ())) if one]
    for one in flights:
        where = flight if flight is not None and len(flights) == 1 else _flight_of(folder, one)
        if where is None:
            unchecked.append(f"the flight {one['name']}, which is not found (name it with --flight)")
            continue
        found += _misfits_of_flight(where, one, checked)
        if raw is not None:
            found += _misfits_of_raw(where, raw, checked)
    if flights and raw is None and any(one.get("sources") for one in flights):
        unchecked.append("raw files (name their folder with --raw)")
    return Verification(tuple(found), tuple(checked), tuple(unchecked))


def _misfits_of_seeds(
    folder: Path, seeds: Mapping[str, Any], checked: list[str], unchecked: list[str]
) -> list[WildlabError]:
    digests: dict[str, str] = seeds["digests"]
    work = SeedWork(
        folder.resolve().parent, folder.name, seeds["case"], seeds["parameters"], "", seeds["key"], ()
    )
    found = []
    if hashlib.sha256(json.dumps(digests).encode()).hexdigest() != seeds["digest"]:
        problem = "the digest of all seeds is not that of the digests of each"
        found.append(WildlabError(problem, AGAIN, file=folder / "provenance.json", field="seeds.digest"))
    if not work.folder.is_dir():
        unchecked.append(f"{len(digests)} kept seeds, which are not here any more")
        return found
    for seed, digest in digests.items():
        values = read_seed(work, int(seed))
        if values is None or seed_digest(work, int(seed), values) != digest:
            problem = "its numbers are not those that the report was made from"
            fix = f"compute the seed again: wildlab run {folder.name}"
            found.append(WildlabError(problem, fix, file=work.folder / f"{seed}.json", field=f"seed {seed}"))
    checked.append(f"{len(digests)} kept seeds")
    return found


def _flight_of(folder: Path, theirs: Mapping[str, Any]) -> Path | None:
    """The flight with these files, or else one of the same name, which was changed."""
    changed = None
    for there in flights_near(folder, theirs["name"]):
        found = provenance_of_flight(there)
        if found["files"] == theirs["files"]:
            return there
        if found["name"] == theirs["name"]:
            changed = changed or there
    return changed


def _misfits_of_flight(folder: Path, theirs: Mapping[str, Any], checked: list[str]) -> Iterator[WildlabError]:
    files, now = theirs["files"], provenance_of_flight(folder)["files"]
    again = "evaluate the flight again, or restore the file"
    for name in sorted({*files, *now}):
        if files.get(name) != now.get(name):
            what = "is missing" if name not in now else "was added" if name not in files else "was changed"
            problem = f"this file {what} since the report was made from the flight"
            yield WildlabError(problem, again, file=folder / name, field=f"flight.files.{name}")
    try:
        verify(folder, read_manifest(folder / FILE_NAME).checksums)
        if manifest_changed(folder):
            problem = "its text is another one than was written: it was changed by hand, or damaged"
            fix = f'if the change is meant: wildlab check --accept "{folder}"; then evaluate it again'
            yield WildlabError(problem, fix, file=folder / FILE_NAME, field=f"checksums.{FILE_NAME}")
    except WildlabError as error:
        yield error
    checked.append(f"{len(files)} files of the flight {theirs['name']}")


def _misfits_of_raw(folder: Path, raw: Path, checked: list[str]) -> Iterator[WildlabError]:
    sources = read_manifest(folder / FILE_NAME).sources
    for one in sources:
        path = raw / one.file
        if not path.is_file():
            fix = "name the folder that the flight was imported from with --raw"
            yield WildlabError("this raw file is missing", fix, file=path, field="sources")
        elif sha256(path) != one.sha256:
            fix = "restore it, or import the flight again"
            yield WildlabError("its SHA-256 is not the one at import", fix, file=path, field="sources")
    checked.append(f"{len(sources)} raw files")
