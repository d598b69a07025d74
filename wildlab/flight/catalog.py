"""Public data sets, fetched file by file and checked by SHA-256.

`data/catalog.toml` names them. The environment variable ``WILDLAB_DATA_MIRROR`` points at a folder that
stands in for the network.
"""

from __future__ import annotations

import hashlib
import os
from collections.abc import Callable
from http.client import HTTPException
from pathlib import Path
from typing import Annotated
from urllib.request import urlopen

from pydantic import Field, RootModel

from wildlab.errors import WildlabError, system_error
from wildlab.files import sha256, write_atomic
from wildlab.flight.files import (
    Below,
    SafeName,
    Strict,
    check_model,
    did_you_mean,
    inside,
    read_regular,
    read_toml,
    regular_size,
)
from wildlab.paths import DATA, fetched

MIRROR_VARIABLE = "WILDLAB_DATA_MIRROR"

#: Seconds without an answer after which a download is given up.
TIMEOUT_S = 30

#: Told before each file is fetched: its name, how many are done, how many there are.
Progress = Callable[[str, int, int], None]


class DataFile(Strict):
    path: Below
    url: Annotated[str, Field(pattern=r"^https://")]
    size: Annotated[int, Field(gt=0)]
    sha256: Annotated[str, Field(pattern=r"^[0-9a-f]{64}$")]
    mirror: Below


class DataSet(Strict):
    title: str
    source: str
    commit: str
    licence: str
    files: tuple[DataFile, ...]


def read_catalog() -> dict[str, DataSet]:
    """The data sets by name.

    Returns
    -------
    dict
        Data sets by name.

    Raises
    ------
    WildlabError
        Where the catalog is missing or wrong.

    Examples
    --------
    >>> "openathena" in read_catalog()
    True
    """
    path = DATA / "catalog.toml"
    return check_model(
        RootModel[dict[SafeName, DataSet]], read_toml(path, "the catalog of data sets"), path
    ).root


def find_dataset(name: str) -> DataSet:
    """One data set of the catalog.

    Raises
    ------
    WildlabError
        Where there is none of that name.
    """
    catalog = read_catalog()
    if name not in catalog:
        raise WildlabError(f"there is no data set {name!r} in the catalog", did_you_mean(name, catalog))
    return catalog[name]


def dataset_folder(name: str) -> Path:
    """Folder of a data set below `wildlab.paths.fetched`, fetched or not.

    Raises
    ------
    WildlabError
        Where there is no data set of that name.
    """
    find_dataset(name)
    return fetched() / name


def is_fetched(name: str) -> bool:
    """Whether every file of a data set is there and has the right checksum.

    Parameters
    ----------
    name
        Of the data set.

    Returns
    -------
    bool

    Raises
    ------
    WildlabError
        Where there is no data set of that name.
    """
    folder = dataset_folder(name)
    return all(_is_right(folder / file.path, file) for file in find_dataset(name).files)


def fetch(name: str, progress: Progress | None = None) -> list[Path]:
    """Get the files of a data set; those that are there and right are not fetched again.

    All of them or none: a failure leaves the folder as it was.

    Parameters
    ----------
    name
        Of the catalog.
    progress
        Called before each file that has to be fetched.

    Returns
    -------
    The files, in the order of the catalog.

    Raises
    ------
    WildlabError
        Where there is no such data set, no network and no mirror, a file is larger than the catalog says, its
        checksum is wrong, or the folder cannot take it (a link out of it, a folder in the way, a full disk).
    """
    dataset = find_dataset(name)
    folder = dataset_folder(name)
    missing = [file for file in dataset.files if not _is_right(folder / file.path, file)]
    places = [_place(folder, file) for file in missing]
    mirror = os.environ.get(MIRROR_VARIABLE)
    contents = []
    for number, file in enumerate(missing):
        if progress is not None:
            progress(file.path, number, len(missing))
        contents.append(_read(file, mirror))
    try:
        for place, content in zip(places, contents, strict=True):
            place.parent.mkdir(parents=True, exist_ok=True)
            write_atomic(place, content)
    except OSError as error:
        raise system_error(error, folder) from None
    return [folder / file.path for file in dataset.files]


def _place(folder: Path, file: DataFile) -> Path:
    """Where a file goes: nothing is written through links that leave the folder."""
    return inside(folder, file.path, file=folder, field=file.path)


def _is_right(path: Path, file: DataFile) -> bool:
    try:
        return regular_size(path, file.size) == file.size and sha256(path) == file.sha256
    except (OSError, WildlabError):
        return False


def _read(file: DataFile, mirror: str | None) -> bytes:
    """The bytes of a file, from the mirror or the network: those that the catalog has the checksum of."""
    fix = "try again, or do not trust the source"
    where: Path | str = file.url
    if mirror:
        places = [Path(mirror) / name for name in (file.mirror, file.path, Path(file.path).name)]
        found = next((place for place in places if place.is_file()), None)
        if found is None:
            raise WildlabError(
                f"the folder that {MIRROR_VARIABLE} names has no {file.mirror} and no {file.path}",
                f"copy the file there, or unset {MIRROR_VARIABLE} to download it",
                file=mirror,
            )
        fix, where = "replace it by the published file", found
        # No more than the catalog says: a small answer must not become a large file.
        data = read_regular(found, file.size)
    else:
        data = _download(file)
    digest = hashlib.sha256(data).hexdigest()
    if digest != file.sha256:
        problem = f"has the SHA-256 {digest}, and the catalog says {file.sha256} for {file.path}"
        raise WildlabError(problem, fix, file=where)
    return data


def _download(file: DataFile) -> bytes:
    try:
        # The catalog takes https alone.
        with urlopen(file.url, timeout=TIMEOUT_S) as source:  # noqa: S310
            data: bytes = source.read(file.size + 1)
    except (OSError, HTTPException) as error:
        raise WildlabError(
            f"the file cannot be downloaded from {file.url} ({getattr(error, 'reason', error)})",
            f"check the network, or set {MIRROR_VARIABLE} to a folder that has the file",
            file=file.path,
        ) from None
    if len(data) > file.size:
        raise WildlabError(
            f"is larger than the {file.size:,} bytes that the catalog says",
            "do not trust the source",
            file=file.url,
        )
    return data
