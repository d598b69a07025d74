"""``status.json`` of a report, with digests of its files; and where each study stands: what its last run
left beside the published numbers and claims."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

from wildlab.errors import WildlabError
from wildlab.files import digest, sha256, write_json
from wildlab.reporting.metrics import read_metrics
from wildlab.reporting.published import (
    FIRST_LOOK,
    FOLDER,
    Claim,
    Number,
    StudyStatus,
    compared_number,
    describe_first_look,
    load_claims,
    published_rows,
)
from wildlab.runner.catalogue import StudyEntry

STATUS = "status.json"
#: Of ``status.json``: the digests of the other files by name, and that of all else that it says.
FILES, OWN = "files", "digest"
#: What a run leaves and others put there later, too.
_LATER = frozenset({"replay.html"})
AGAIN = "make the report again, or take the file from a copy of it"


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
    if FILES not in status and OWN not in status:  # one turned bit cannot take both keys away
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


def study_status(study: StudyEntry, reports: Path, published: Path = FOLDER) -> StudyStatus:
    """Where one study stands, from ``reports/<study>/`` and the published numbers.

    A report folder that cannot be read counts as one to be run again; it never raises.
    """
    folder = reports / study.name
    status = _status(folder)
    state = str(status["state"])
    metrics: dict[str, Any] | None = None
    reason = str(status.get("reason", ""))
    look = describe_first_look(status.get("first_look"))
    if state == "done":
        try:
            metrics = read_metrics(folder / "metrics.json")
        except WildlabError:
            metrics = None
        # What cannot be read, or is of another study, must not count as this one's full numbers.
        if metrics is None or metrics["study"] != study.name or (status.get("first_look") and not look):
            state, reason, metrics = "broken off", "", None
    if state == "done" and look:
        state = FIRST_LOOK
    return StudyStatus(
        study=study,
        state=state,
        reason=reason,
        seconds=status.get("seconds"),
        finished=str(status.get("finished", "")),
        seeds=metrics["seeds"] if metrics else None,
        first_look=look if state == FIRST_LOOK else "",
        has_report=state in ("done", FIRST_LOOK, "failed") and (folder / "report.html").is_file(),
        numbers=_numbers(study, metrics, state, published),
        claims=_claims(study, metrics, state, published),
    )


def as_plain(one: StudyStatus) -> dict[str, Any]:
    """A status for JSON: what `wildlab list --json` prints."""
    return {
        "study": one.study.name,
        "title": one.study.title,
        "section": one.study.section,
        "kind": one.study.kind,
        "state": one.state,
        "first_look": one.first_look or None,
        "reason": one.reason,
        "seconds": one.seconds,
        "finished": one.finished or None,
        "published": [_plain(number) for number in one.numbers],
        "claims": [asdict(claim) for claim in one.claims],
    }


def _plain(number: Number) -> dict[str, Any]:
    closeness, compatibility = number.answers
    told = {"closeness": closeness, "compatibility": compatibility}
    plain = {key: value for key, value in asdict(number).items() if key not in ("compared", "waiting")}
    return plain | told


def _status(folder: Path) -> dict[str, Any]:
    if not (folder / STATUS).is_file():
        # A report without a status was being replaced when the machine stopped.
        return {"state": "broken off" if (folder / "report.html").exists() else "not run"}
    status = read_status(folder)
    seconds = status.get("seconds")
    known = status.get("state") in ("done", "failed", "damaged")
    if not known or not isinstance(seconds, int | float) or not math.isfinite(seconds):
        return {"state": "broken off"}
    return status


def _numbers(study: StudyEntry, metrics: dict[str, Any] | None, state: str, published: Path) -> list[Number]:
    ours = {(entry["name"], entry["subject"]): entry for entry in metrics["metrics"]} if metrics else {}
    seeds, kind = (metrics["seeds"], metrics["kind"]) if metrics else (None, "twin")
    numbers = []
    for row in published_rows(study.name, published):
        number = compared_number(row, ours, seeds, kind)
        if number.waiting:
            absent = "" if state not in ("done", FIRST_LOOK) else "the study does not give it yet"
            number = replace(number, reason=absent)
        elif state == FIRST_LOOK:
            number = replace(number, waiting=FIRST_LOOK)
        numbers.append(number)
    return numbers


def _claims(study: StudyEntry, metrics: dict[str, Any] | None, state: str, published: Path) -> list[Claim]:
    typed = {entry["id"]: entry for entry in load_claims(study.name, published)}
    decided = {entry["id"]: entry for entry in metrics["claims"]} if metrics else {}
    claims = []
    for key in [*typed, *(key for key in decided if key not in typed)]:
        ours, theirs = decided.get(key, {}), typed.get(key, {})
        claims.append(
            Claim(
                id=key,
                text=theirs.get("text") or ours["text"],
                source=theirs.get("source", ""),
                verdict=FIRST_LOOK if ours and state == FIRST_LOOK else ours.get("verdict", "not tested yet"),
                **{name: ours.get(name) for name in ("fraction", "seeds", "low", "high", "met")},
                own=bool(theirs.get("own", not theirs)),
            )
        )
    return claims
