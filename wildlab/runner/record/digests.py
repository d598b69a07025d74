"""Digests of a report's files in its ``status.json``, and of that itself: a bit that the disk has turned
would else become another number or another verdict."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from wildlab.errors import WildlabError
from wildlab.files import digest, sha256, write_json

STATUS = "status.json"
#: Of ``status.json``: the digests of the other files by name, and that of all else that it says.
FILES, OWN = "files", "digest"
#: What a run leaves and others put there later, too.
_LATER = frozenset({"replay.html"})
AGAIN = "make the report again, or take the file from a copy of it"
#: What is said of a report that was written before there were digests.
BEFORE_DIGESTS = "made before digests; run again"


def seal(folder: Path, status: Mapping[str, Any], names: tuple[str, ...]) -> None:
    """Write ``status.json`` with the digests of what a run left, atomically.

    Parameters
    ----------
    folder
        Of the report, with all else in place.
    status
        What the file says besides.
    names
        Of the files that a run may leave; its figures are sealed, too.
    """
    figures = (
        path.relative_to(folder).as_posix() for path in (folder / "figures").rglob("*") if path.is_file()
    )
    there = sorted({*(name for name in names if (folder / name).is_file()), *figures} - _LATER)
    content = {**status, FILES: {name: sha256(folder / name) for name in there}}
    write_json(folder / STATUS, {**content, OWN: digest(content)})


def misfits(folder: Path, status: Mapping[str, Any]) -> list[WildlabError]:
    """What of a report is not as it was written: the file, the field of ``status.json``, and what to do.

    Parameters
    ----------
    folder
        Of the report.
    status
        Its ``status.json``; one without digests says nothing of the files.
    """
    if not has_digests(status):
        return []
    files = status.get(FILES)
    content = {key: value for key, value in status.items() if key != OWN}
    if not isinstance(files, dict) or status.get(OWN) != digest(content):
        return [WildlabError("it is not as it was written", AGAIN, file=folder / STATUS, field=OWN)]
    found = []
    for name, written in files.items():
        path = folder / name
        if not path.is_file():
            found.append(WildlabError("this file is missing", AGAIN, file=path, field=f"{FILES}.{name}"))
        elif sha256(path) != written:
            problem = (
                f"its SHA-256 is not the one in {STATUS}: it was damaged or changed since it was written"
            )
            found.append(WildlabError(problem, AGAIN, file=path, field=f"{FILES}.{name}"))
    return found


def has_digests(status: Mapping[str, Any]) -> bool:
    """Whether a report was written with digests; one turned bit cannot take both keys away."""
    return FILES in status or OWN in status


def read_status(folder: Path) -> dict[str, Any]:
    """``status.json`` of a report's folder; nothing where there is none, or none that can be read. Of a
    report that is not as it was written, the state is "damaged" and the reason says what does not fit."""
    try:
        status = json.loads((folder / STATUS).read_text(encoding="utf-8"))
    except (OSError, ValueError, RecursionError):
        return {}
    if not isinstance(status, dict):
        return {}
    try:
        found = misfits(folder, status)
    except OSError as error:
        found = [WildlabError(str(error.strerror), AGAIN, file=error.filename)]
    if not found:
        return status
    more = f" (and {len(found) - 1} more)" if len(found) > 1 else ""
    reason = f"{Path(found[0].file or '').name} is not as the run wrote it{more}; see: wildlab verify"
    return {"state": "damaged", "reason": reason, "seconds": 0.0}
