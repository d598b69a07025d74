"""Checksums of a flight's tables, kept in `flight.toml`: a byte that changed by itself is found on load.

The part ``[checksums]`` is the last of the file, and has one of the text above it too. Whoever changes
something on purpose writes the part anew with `accept_changes` (``wildlab check --accept``); the rest of the
file, comments too, stays as it is. A changed table is refused; a changed `flight.toml` is used and said,
since that is where a flight is corrected by hand.
"""

from __future__ import annotations

import hashlib
import re
import tomllib
from collections.abc import Iterator, Mapping
from itertools import product
from pathlib import Path
from typing import get_args

from wildlab.errors import WildlabError
from wildlab.files import sha256, write_atomic
from wildlab.flight.files import TOML_LIMIT, dump_toml, inside, read_regular
from wildlab.flight.manifest import FILE_NAME, parse_manifest, read_manifest
from wildlab.flight.manifest_parts import LocationsPart, Sensitivity
from wildlab.flight.schema import TABLES

TERRAIN = "terrain.tif"
#: What was learnt on another flight, where this one came with it.
CALIBRATION = "calibration.toml"
#: The part of `flight.toml`, and its line.
PART = "checksums"
#: The part on how sensitive places are: stated by hand whenever that is known, so its change is no damage. It
#: has a checksum of its own, of what was confirmed last.
STATED = "locations"
_HEADERS = {part: re.compile(rf"^[ \t]*\[[ \t]*{part}[ \t]*\].*$", re.MULTILINE) for part in (PART, STATED)}
_NEXT = re.compile(r"^[ \t]*\[", re.MULTILINE)


def table_files(folder: Path) -> dict[str, Path]:
    """Tables, terrain and calibration of a flight folder, by their names in it: ``"nav/logged.parquet"``."""
    names = [f"{name}.parquet" for name in TABLES] + [TERRAIN, CALIBRATION]
    names += sorted(f"nav/{path.name}" for path in (folder / "nav").glob("*.parquet"))
    return {name: folder / name for name in names if (folder / name).is_file()}


def checksums_of(folder: Path) -> dict[str, str]:
    """SHA-256 of every table of a flight folder.

    Parameters
    ----------
    folder
        The flight folder.

    Returns
    -------
    dict
        64 hexadecimal digits by the file's name in the folder.

    Raises
    ------
    WildlabError
        Where a table is a link out of the folder.
    """
    return {
        name: sha256(inside(folder, name, file=folder, field=name)) for name in sorted(table_files(folder))
    }


def verify(folder: Path, stated: Mapping[str, str]) -> None:
    """Hold every table against its checksum. Without any checksums there is nothing to hold it against.

    Parameters
    ----------
    folder
        The flight folder.
    stated
        The checksums that `flight.toml` states.

    Raises
    ------
    WildlabError
        Naming the first table that is missing, was added or was changed.
    """
    if not stated:
        return
    meant = f'if it is meant: wildlab check --accept "{folder}"'
    found = checksums_of(folder)
    for name in sorted({*stated, *found} - {FILE_NAME, STATED}):
        if name not in found:
            raise WildlabError(
                "this file is missing",
                f"restore it, or import again; {meant}",
                file=folder / name,
            )
        if name not in stated:
            raise WildlabError(
                "it has no checksum in flight.toml: it was added later",
                f"move it elsewhere; {meant}",
                file=folder / name,
            )
        if found[name] != stated[name]:
            raise WildlabError(
                "its SHA-256 is not that in flight.toml: it was damaged or changed",
                f"restore it, or import again; {meant}",
                file=folder / name,
            )


def accept_changes(folder: Path) -> list[str]:
    """Write the checksums of the tables as they are into `flight.toml`.

    Parameters
    ----------
    folder
        The flight folder.

    Returns
    -------
    list of str
        The tables whose checksum is another one now, were added or are gone.

    Raises
    ------
    WildlabError
        Where `flight.toml` cannot be read, or no part can be told in it.
    """
    path = inside(folder, FILE_NAME, file=folder, field=FILE_NAME)
    before, tables = read_manifest(path).checksums, checksums_of(folder)
    text = _text(path)
    now = tables | {FILE_NAME: _of_text(text), STATED: _of_places(read_manifest(path).locations)}
    changed = [name for name in sorted({*before, *now}) if before.get(name) != now.get(name)]
    if changed:
        new = with_checksums(text, tables)
        # What looks like the part may stand inside of a text of several lines.
        plain: dict[str, dict[str, str]] = {"checksums": {}}
        if read_manifest(path).model_copy(update=plain) != parse_manifest(new, path).model_copy(update=plain):
            raise WildlabError(
                "a text in it has a line that reads [checksums]", "reword that line", file=path, field=PART
            )
        write_atomic(path, new)
    return changed


def manifest_changed(folder: Path) -> bool | None:
    """Whether `flight.toml`, but for its part ``[locations]``, is another text than the one that was written;
    None where that cannot be told.

    Raises
    ------
    WildlabError
        Where `flight.toml` cannot be read.
    """
    path = inside(folder, FILE_NAME, file=folder, field=FILE_NAME)
    stated = read_manifest(path).checksums.get(FILE_NAME)
    text = _text(path)
    return None if stated is None else stated != _of_text(text)


def confirmed_locations(folder: Path) -> LocationsPart:
    """How sensitive the places of a flight are by what was written or accepted last.

    Only its checksum is kept, and every ``[locations]`` that there can be is held against it; where none
    fits, or there is no checksum, nothing was confirmed and places are withheld.

    Raises
    ------
    WildlabError
        Where `flight.toml` cannot be read.
    """
    stated = read_manifest(inside(folder, FILE_NAME, file=folder, field=FILE_NAME)).checksums.get(STATED)
    return next((one for one in _every_locations() if _of_places(one) == stated), LocationsPart())


def locations_confirmed(folder: Path) -> bool:
    """Whether ``[locations]`` is as it was written or accepted last; true of a flight without that checksum
    that states nothing.

    Raises
    ------
    WildlabError
        Where `flight.toml` cannot be read.
    """
    manifest = read_manifest(inside(folder, FILE_NAME, file=folder, field=FILE_NAME))
    return manifest.checksums.get(STATED, _of_places(LocationsPart())) == _of_places(manifest.locations)


def _every_locations() -> Iterator[LocationsPart]:
    categories = (None, 1, 2, 3, 4)
    for sensitivity, own, agreed in product(get_args(Sensitivity), categories, categories):
        yield LocationsPart(sensitivity=sensitivity, category=own, agreed_category=agreed)


def _of_places(locations: LocationsPart) -> str:
    return hashlib.sha256(locations.model_dump_json().encode()).hexdigest()


def _text(path: Path) -> str:
    return read_regular(path, TOML_LIMIT).decode("utf-8")


def _of_text(text: str) -> str:
    """SHA-256 of a manifest's text but for the checksums and what is `STATED` of places."""
    return hashlib.sha256(_without(_without(text), STATED).encode("utf-8")).hexdigest()


def _without(text: str, part: str = PART) -> str:
    header = _HEADERS[part].search(text)
    if header is not None:
        rest = _NEXT.search(text, header.end())
        text = text[: header.start()] + (text[rest.start() :] if rest is not None else "")
    return text.rstrip("\n") + "\n"


def with_checksums(text: str, tables: Mapping[str, str]) -> str:
    """The text of a `flight.toml` with these checksums and its own as the last part, and no others.

    Parameters
    ----------
    text
        Of the file.
    tables
        The checksums of the tables, by file name.

    Returns
    -------
    str

    Examples
    --------
    >>> text = with_checksums('name = "lake"  # ours', {"frames.parquet": "00"})
    >>> text.splitlines()[:3]
    ['name = "lake"  # ours', '', '[checksums]']
    >>> with_checksums(text, {"frames.parquet": "00"}) == text
    True
    """
    places = LocationsPart.model_validate(tomllib.loads(text).get(STATED, {}))
    own = {FILE_NAME: _of_text(text), STATED: _of_places(places)}
    return _without(text) + "\n" + dump_toml({PART: {**own, **tables}})
