"""Whether numbers computed from generalised data are those of the sender's own report."""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping
from pathlib import Path
from typing import Any, NamedTuple

from bs4 import BeautifulSoup

from wildlab.reporting.metrics import AGAINST
from wildlab.runner.record.own_flights import finished_metrics
from wildlab.sharing.names import Names

#: Numbers that differ by no more than this share are the same.
SAME = 1e-3
#: Nor do these, whatever they are a share of: beyond what any report prints.
NOTHING = 1e-6


class Agreement(NamedTuple):
    """How many numbers both have, how many are the same, and the one that differs most.

    Attributes
    ----------
    compared, same
        Numbers.
    worst
        Greatest difference as a share of the greater number; 0 without any.
    which
        The number that has it, for the sender; "" without any.
    otherwise
        Sentences: where a report of the copy says something else than the sender's.
    """

    compared: int
    same: int
    worst: float
    which: str
    otherwise: tuple[str, ...] = ()


def compare(pairs: Mapping[Path, Path], names: Names, numbered: Collection[Path] = ()) -> Agreement:
    """Numbers of the sender's reports against those of the copy's.

    Parameters
    ----------
    pairs
        Folders: of the copy's report by the sender's.
    names
        Neutral names by the true ones, which subjects may hold.
    numbered
        Those of the sender's reports whose subjects are no names: a target that is the first there is the
        first in the copy, whatever it is called.

    Returns
    -------
    Agreement
    """
    compared = same = 0
    worst, which = 0.0, ""
    otherwise: list[str] = []
    for mine, theirs in pairs.items():
        here, there = _numbers(mine), _numbers(theirs)
        otherwise += _otherwise(_said(mine, here), _said(theirs, there))
        for (name, subject), value in here.items():
            other = there.get((name, subject if mine in numbered else _neutral(subject, names)))
            if other is None:
                continue
            compared += 1
            difference = share_apart(value, other)
            same += difference <= SAME
            if difference > worst:
                worst, which = (
                    difference,
                    f"{mine.name}: {name} of {subject} is {value:.6g}, in the copy {other:.6g}",
                )
    return Agreement(compared, same, worst, which, tuple(otherwise))


class _Report(NamedTuple):
    """What a report asks, what it answers in a word, and what it held its flight against."""

    title: str
    verdict: str
    against: tuple[str, ...]


def _said(report: Path, numbers: Mapping[tuple[str, str], float]) -> _Report:
    text = (report / "report.html").read_text(encoding="utf-8")
    # What is asked and answered stands before the figures, which are most of a page.
    for piece in (text.partition("<figure")[0], text):
        soup = BeautifulSoup(piece, "html.parser")
        title, word = soup.h1, soup.select_one("p.verdict .pill")
        if title is not None and word is not None:
            break
    against = tuple(subject for name, subject in numbers if name == AGAINST)
    return _Report(
        "" if title is None else title.get_text(" ", strip=True),
        "" if word is None else word.get_text(" ", strip=True),
        against,
    )


def _otherwise(mine: _Report, theirs: _Report) -> list[str]:
    """Where a copy says something else than the report that it was made from."""
    found = []
    about = theirs.title.rstrip("?. ") or "a report"
    if mine.title != theirs.title:
        found.append(f'One report is called "{mine.title}" in the original, and "{theirs.title}" here.')
    if mine.verdict != theirs.verdict:
        found.append(
            f'To "{about}" the original answers "{mine.verdict or "nothing"}", and this copy '
            f'"{theirs.verdict or "nothing"}".'
        )
    # A report of before it was recorded does not say.
    if mine.against and mine.against != theirs.against:
        one, other = (" and ".join(report.against) or "nothing" for report in (mine, theirs))
        found.append(f'For "{about}" the original compares with {one}, and this copy with {other}.')
    return found


def share_apart(one: float, other: float) -> float:
    """How far two numbers are apart as a share of the greater one.

    Examples
    --------
    >>> share_apart(2.0, 1.0), share_apart(0.0, 1e-9)
    (0.5, 0.0)
    """
    if math.isnan(one) and math.isnan(other):
        return 0.0
    apart = abs(one - other)
    if math.isnan(apart):
        return 1.0
    return 0.0 if apart <= NOTHING else apart / max(abs(one), abs(other))


def agreement_words(found: Agreement) -> str:
    """For the page: what it says of its own numbers; nothing where nothing was compared."""
    if not found.compared:
        return ""
    if found.same == found.compared:
        return (
            f"All {found.compared} numbers are those of the report that was made from the exact data, to "
            f"{SAME:.1%} or better."
        )
    return (
        f"Of {found.compared} numbers, {found.same} are those of the report that was made from the exact "
        f"data, to {SAME:.1%} or better; the others differ, by {found.worst:.1%} at most."
    )


def _neutral(subject: str, names: Names) -> str:
    """A subject as the copy calls it: whole, or part by part."""
    known = {true: neutral for kind in names.by_kind.values() for true, neutral in kind.items()}
    return known.get(subject) or "/".join(known.get(part, part) for part in subject.split("/"))


def _numbers(report: Path) -> dict[tuple[str, str], float]:
    metrics: dict[str, Any] = finished_metrics(report) or {}
    return {
        (str(one["name"]), str(one["subject"])): math.nan if one["value"] is None else float(one["value"])
        for one in metrics.get("metrics", [])
    }
