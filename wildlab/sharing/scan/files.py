"""Look through every byte of files that are about to be sent."""

from __future__ import annotations

import os
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import cast

from wildlab.errors import WildlabError, system_error
from wildlab.sharing.scan.findings import MOST_OF_A_KIND, Finding, Kind
from wildlab.sharing.scan.hits import Hit
from wildlab.sharing.scan.inside.kinds import unpacked
from wildlab.sharing.scan.look import SoughtPlaces, excerpt
from wildlab.sharing.scan.parts import Budget, Part
from wildlab.sharing.scan.secrets import Secrets
from wildlab.sharing.scan.texts import is_text, texts_of
from wildlab.sharing.scan.words import needles_of


def scan(paths: Iterable[Path | str], secrets: Secrets) -> list[Finding]:
    """What must not be in files, and is.

    Parameters
    ----------
    paths
        Files, and folders with all that is below them. Their names are looked at from there downwards: the
        folders above a path that is given are not sent.
    secrets
        What is looked for.

    Returns
    -------
    list
        Findings; empty where nothing was found and everything could be looked into.

    Raises
    ------
    WildlabError
        Where a path is not there or cannot be read.

    Examples
    --------
    >>> from tempfile import TemporaryDirectory
    >>> import numpy as np
    >>> with TemporaryDirectory() as folder:
    ...     page = Path(folder) / "page.html"
    ...     _ = page.write_text("<p>60&deg; 7' 24.3&quot; N, 10&deg; 15' 0.8&quot; E</p>")
    ...     print(scan([page], Secrets(places=np.array([[60.12342, 10.25022, 40.0]])))[0])
    page.html: line 1: place: latitude and longitude, degrees, minutes and seconds
    """
    return scan_contents(_contents(_files([Path(path) for path in paths])), secrets)


def scan_contents(files: Iterable[tuple[str, bytes]], secrets: Secrets) -> list[Finding]:
    """As :func:`scan`, of what is not written yet.

    Parameters
    ----------
    files
        Names and contents.
    secrets
        What is looked for.

    Returns
    -------
    list
    """
    look = SoughtPlaces(secrets)
    findings: list[Finding] = []
    for name, data in files:
        findings += _named(look, name)
        findings += _in_file(look, name, data)
    return findings


def not_searched(secrets: Secrets) -> list[str]:
    """What of the secrets is not looked for, and why: sentences for the sender.

    Parameters
    ----------
    secrets
        As for :func:`scan`.

    Returns
    -------
    list
    """
    said = list(needles_of(secrets.words).skipped)
    said.append("What is drawn is not read: the pixels of pictures, and letters drawn as outlines.")
    return said


def _files(paths: list[Path]) -> Iterator[tuple[Path, str]]:
    """Every file, and its name from where it was given."""
    for path in paths:
        if path.is_dir():
            for folder, _, files in os.walk(path):
                for file in sorted(files):
                    whole = Path(folder) / file
                    yield whole, whole.relative_to(path.parent).as_posix()
        elif path.is_file():
            yield path, path.name
        else:
            raise WildlabError("there is no such file or folder", "check the path", file=path)


def _contents(files: Iterable[tuple[Path, str]]) -> Iterator[tuple[str, bytes]]:
    for path, name in files:
        try:
            yield name, path.read_bytes()
        except OSError as error:
            raise system_error(error, path, cannot="be read") from error


def _named(look: SoughtPlaces, name: str) -> list[Finding]:
    return [Finding(name, "the name of the file", hit.kind, hit.written, name) for hit in look.in_text(name)]


def _in_file(look: SoughtPlaces, name: str, data: bytes) -> list[Finding]:
    found: dict[tuple[str, str, str], list[Finding]] = {}
    for part in unpacked(data, Budget()):
        for finding in _in_part(look, name, part):
            found.setdefault((part.where, finding.kind, finding.written), []).append(finding)
    findings = []
    for several in found.values():
        findings += several[:MOST_OF_A_KIND]
        if len(several) > MOST_OF_A_KIND:
            last = several[MOST_OF_A_KIND - 1]
            more = f"{len(several) - MOST_OF_A_KIND} more like this"
            findings.append(Finding(name, last.where, last.kind, f"{last.written}: {more}"))
    return findings


def _in_part(look: SoughtPlaces, name: str, part: Part) -> Iterator[Finding]:
    where = part.where or "the whole file"
    if part.trouble:
        yield Finding(name, where, "unreadable", part.trouble)
    for moment, written in part.moments:
        if look.is_secret(moment):
            yield Finding(name, where, "date", written, moment.isoformat())
    for box in part.boxes:
        grid = look.in_box(box)
        if grid:
            yield Finding(name, where, "place", f"a map that reaches over it, {grid}")
    for said in look.in_columns(part.columns):
        kind, _, written = said.partition(": ")
        yield Finding(name, where, cast(Kind, kind), written)
    seen = set()
    for text in texts_of(part.data):
        for hit in look.in_text(text, drawn=part.drawn):
            said_so = (hit.kind, hit.written, text[hit.start : hit.end])
            if said_so not in seen:  # the same in another reading
                seen.add(said_so)
                yield Finding(name, _where(part, text, hit), hit.kind, hit.written, excerpt(text, hit))
    if not is_text(part.data):
        for hit in look.in_bytes(part.data):
            found = part.data[hit.start : hit.end].hex()
            yield Finding(name, f"{where}, byte {hit.start}", hit.kind, hit.written, found)


def _where(part: Part, text: str, hit: Hit) -> str:
    line = text.count("\n", 0, hit.start) + 1
    at = f"line {line}" if "\n" in text or len(text) < 200 else f"character {hit.start}"
    return f"{part.where}, {at}" if part.where else at
