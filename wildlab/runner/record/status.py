"""Where each study stands: what its last run left behind, beside the published numbers and claims."""

from __future__ import annotations

import math
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

from wildlab.errors import WildlabError
from wildlab.reporting.metrics import read_metrics
from wildlab.reporting.published import FOLDER, compared_number, load_claims, published_rows
from wildlab.reporting.status import FIRST_LOOK, Claim, Number, StudyStatus, describe_first_look
from wildlab.runner.catalogue import StudyEntry
from wildlab.runner.record.digests import BEFORE_DIGESTS, STATUS, has_digests, read_status


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
    if state == "done" and not has_digests(status):
        reason = BEFORE_DIGESTS
    if state == "done" and look:
        state = FIRST_LOOK
    return StudyStatus(
        study=study,
        state=state,
        reason=reason,
        seconds=status.get("seconds"),
        finished=str(status.get("finished", "")),
        flight=metrics["flight"] if metrics else "",
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
    return plain | told | {"difference": number.difference}


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
                fraction=ours.get("fraction"),
                seeds=ours.get("seeds"),
                low=ours.get("low"),
                high=ours.get("high"),
                met=ours.get("met"),
                premise=theirs.get("premise", ""),
                own=bool(theirs.get("own", not theirs)),
            )
        )
    return claims
