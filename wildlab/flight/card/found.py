"""What lies on a card: files known by their content and folders of images, each read, nothing written."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from wildlab.errors import WildlabError
from wildlab.flight.files import printable, read_regular
from wildlab.flight.readers.formats import (
    FOLDERS,
    FORMATS,
    HEAD,
    read_folder,
    read_log,
    recognise,
)
from wildlab.flight.readers.frames.image import SUFFIXES
from wildlab.flight.readers.log import RawLog, Stream
from wildlab.flight.recipe.raw import RAW_LIMIT

Array = NDArray[np.float64]

#: Endings of images, in small letters.
IMAGES = frozenset(SUFFIXES)
#: What lies on cards and is no log: not worth a sentence each.
KNOWN_OTHERS = frozenset({".mp4", ".mov", ".lrv", ".thm", ".dng", ".lrf", ".toml", ".md", ".txt", ".parm"})
#: Why such a file is not read.
OTHER = "is no log by its ending"
#: More files than any card of a day's flights has.
MOST_FILES = 200_000


@dataclass(frozen=True)
class Found:
    """A file or a folder of images.

    Attributes
    ----------
    name
        Below the source folder, with ``/``.
    size
        Bytes.
    format
        As in `FORMATS` and `FOLDERS`; empty where none is known.
    log
        As read, None where it could not be.
    problem
        Why not.
    """

    name: str
    size: int
    format: str = ""
    log: RawLog | None = None
    problem: str = ""

    @property
    def shown(self) -> str:
        """The name as it is told."""
        return "the folder itself" if self.name == "." else printable(self.name)

    @property
    def called(self) -> str:
        """The format in words."""
        if self.format in FOLDERS:
            return FOLDERS[self.format].called
        return FORMATS[self.format].called if self.format else "not known"

    def part(self, name: str) -> Stream | None:
        """One part of the log, where it has one with a row that can be used; images count without a place."""
        stream = None if self.log is None else self.log.parts.get(name)
        return stream if stream is not None and (name == "photos" or stream.used.any()) else None


def source_folder(paths: Sequence[Path]) -> Path:
    """The folder that all of some files and folders lie in, or the one folder that is named.

    Raises
    ------
    WildlabError
        Where one of them does not exist, or they share no folder.
    """
    for path in paths:
        if not path.exists():
            raise WildlabError("there is no such file or folder", "check the name", file=path)
    if len(paths) == 1 and paths[0].is_dir():
        return paths[0]
    try:
        common = os.path.commonpath(
            [path.resolve() if path.is_dir() else path.resolve().parent for path in paths]
        )
    except ValueError:
        raise WildlabError(
            "the files lie on different drives", "copy them into one folder", file=paths[0]
        ) from None
    return Path(common)


def search(
    paths: Sequence[Path],
    source: Path,
    zone: str | None = None,
    tell: Callable[[str], None] = lambda name: None,
) -> list[Found]:
    """Everything in some files and folders that may belong to a flight.

    Parameters
    ----------
    paths
        Files and folders.
    source
        The folder that they lie in, see `source_folder`.
    zone
        Of wall clocks that carry none.
    tell
        Called with the name of each file before it is read.

    Returns
    -------
    list of Found
        In order of their names; also what no reader knows, or could not read.

    Raises
    ------
    WildlabError
        Where there are too many files to be a card.
    """
    found = []
    for path, folder in _items(paths):
        name = path.resolve().relative_to(source.resolve()).as_posix()
        if folder or path.suffix.lower() not in KNOWN_OTHERS:
            tell(name)
        found.append(_read_folder(path, name, folder, zone) if folder else _read_file(path, name, zone))
    return sorted(found, key=lambda one: one.name)


def _items(paths: Sequence[Path]) -> Iterator[tuple[Path, str]]:
    """Files, and folders of one of `FOLDERS`, each once."""
    seen: set[Path] = set()
    for path in paths:
        for item, folder in _below(path) if path.is_dir() else _single(path):
            key = item.resolve() / folder
            if key not in seen:
                seen.add(key)
                yield item, folder
            if len(seen) > MOST_FILES:
                raise WildlabError(
                    f"there are more than {MOST_FILES} files", "name the folder of one flight", file=path
                )


def _single(path: Path) -> Iterator[tuple[Path, str]]:
    if path.suffix.lower() in IMAGES:
        raise WildlabError("is a single image", "name the folder of the images", file=path)
    yield path, ""


def _below(folder: Path) -> Iterator[tuple[Path, str]]:
    pictured: list[Path] = []
    for here, folders, files in os.walk(folder):
        folders[:] = sorted(one for one in folders if not one.startswith("."))
        names = sorted(one for one in files if not one.startswith("."))
        images = {one for one in names if Path(one).suffix.lower() in IMAGES}
        boxes = {one for one in names if one.lower().endswith(".txt") and _is_yolo(Path(here) / one)}
        pictured += [Path(here)] if images else []
        if boxes:
            yield Path(here), "clicks-yolo"
        for name in names:
            if name not in images | boxes:
                yield Path(here) / name, ""
    if pictured:  # 100MEDIA and 101MEDIA are one series of images
        yield Path(os.path.commonpath(pictured)), "photos"


def _is_yolo(path: Path) -> bool:
    """Whether the first line is a class and a box in shares of the image, as YOLO writes it."""
    try:
        with path.open("rb") as stored:
            words = stored.readline(HEAD).split()
        return len(words) in (5, 6) and words[0].isdigit() and all(0 <= float(one) <= 1 for one in words[1:])
    except (OSError, ValueError):
        return False


def _read_folder(folder: Path, name: str, format_: str, zone: str | None) -> Found:
    size = sum(one.stat().st_size for one in folder.rglob("*") if one.is_file())
    try:
        log, _ = read_folder(folder, format_, zone)
    except WildlabError as error:
        return Found(name, size, format_, problem=_why(error))
    return Found(name, size, format_, log)


def _read_file(path: Path, name: str, zone: str | None) -> Found:
    if path.is_symlink() and not path.resolve().is_file():
        return Found(name, 0, problem="a link that leads nowhere")
    size = path.stat().st_size
    try:
        with path.open("rb") as stored:
            head = stored.read(HEAD)
    except OSError as error:
        return Found(name, size, problem=f"cannot be opened ({error.strerror})")
    format_ = recognise(head, path.name)
    if format_ is None:
        known = path.suffix.lower() in KNOWN_OTHERS
        return Found(name, size, problem=OTHER if known else _unknown(head))
    try:
        return Found(name, size, format_, read_log(path, read_regular(path, RAW_LIMIT), format_, zone))
    except WildlabError as error:
        return Found(name, size, format_, problem=_why(error))


def _unknown(head: bytes) -> str:
    return "is empty" if not head else "no reader knows this format"


def _why(error: WildlabError) -> str:
    """Why a file could not be read, and what to do."""
    return f"{error.problem}; {error.fix}" if error.fix else error.problem
