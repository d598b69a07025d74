"""What a copy does not have, and whether its numbers are those of the sender's own report."""

from __future__ import annotations

import math
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, NamedTuple

import pandas as pd
from bs4 import BeautifulSoup

from wildlab.flight.manifest import Manifest
from wildlab.flight.store import Flight
from wildlab.messages.catalogue import fill, load_texts
from wildlab.reporting.metrics import AGAINST
from wildlab.runner.record.own_flights import finished_metrics
from wildlab.sharing.names import Names, hulls_of

#: What remains in a copy whatever is done to its numbers, for whoever knows where to look.
REMAINS = tuple(text for key, text in load_texts("sharing").answers.items() if key.startswith("remains-"))


@dataclass(frozen=True)
class Removal:
    """One thing that the copy does not have: what it was, and what stands in its place. For the sender."""

    what: str
    was: str
    now: str


def list_removals(
    flight: Flight, made: Flight, names: Names, start: float, when: str, place: str
) -> Iterator[Removal]:
    """What is gone of the manifest and the tables, as the sender knows it.

    Parameters
    ----------
    flight, made
        The true one and its generalised copy.
    names
        Neutral names by the true ones.
    start
        First stamp of the true one, flight time, s.
    when, place
        What the copy says of them.
    """
    was, now = flight.manifest, made.manifest
    o = was.origin
    yield Removal("origin", f"{o.latitude_deg}, {o.longitude_deg}, {o.height_m} m", place)
    yield Removal("heights", "above the ellipsoid, by the origin", "above the flight's own ground")
    if was.time.epoch is not None:
        true = datetime.fromtimestamp(was.time.epoch.timestamp() + start, UTC)
        yield Removal("date and time", f"{true:%Y-%m-%d %H:%M:%S} UTC", f"{when}, time from the first sample")
    yield Removal("flight", was.name, now.name)
    for what, one, other in (
        ("description", was.description, ""),
        ("platform", was.platform.name, now.platform.name),
        ("camera", was.camera.name if was.camera else "", "camera"),
        ("focal lengths and principal point (px)", _lens(was), _lens(now)),
        ("inertial unit", f"{was.imu.name} {was.imu.note}".strip(), ""),
        ("receiver", f"{was.gnss.name} {was.gnss.note}".strip(), ""),
        ("magnetometer", f"{was.magnetometer.name} {was.magnetometer.note}".strip(), ""),
        ("note on heights", was.vertical.note, ""),
        ("note on uncertainty", was.uncertainty.note, ""),
        ("map", was.terrain.source if was.terrain else "", "map"),
        ("reference of the map", was.terrain.crs if was.terrain else "", "n"),
    ):
        if one and one != other:
            yield Removal(what, one, other or "left out")
    if was.vertical.correction_m or was.vertical.reference != "ellipsoid":
        v = was.vertical
        yield Removal("vertical reference", f"{v.reference}, {v.correction_m} m taken off", "left out")
    if was.magnetometer.declination_deg is not None:
        yield Removal("declination", f"{was.magnetometer.declination_deg} deg", "that of no place")
    for key, value in was.clocks.model_dump().items():
        kept = getattr(now.clocks, key)
        if value != kept:
            yield Removal(key.removesuffix("_s").replace("_", " "), f"{value} s", f"{kept:g} s")
    for name, part in was.sensors.items():
        kept = now.sensors[names.of("sensor", name)].clock_offset_s
        if part.clock_offset_s != kept:
            yield Removal(f"clock offset of {name}", f"{part.clock_offset_s} s", f"{kept:g} s")
    for one in hulls_of(was.targets):
        yield Removal("kind of target", one, "a letter")
    for source in was.sources:
        yield Removal("raw file", f"{source.file} ({source.sha256[:8]})", "left out")
    for key in sorted({*flight.tables} - {*made.tables}):
        yield Removal("table", key, "left out: what the field there did to it cannot be told")
    tables = {**{f"nav/{name}": nav for name, nav in flight.nav.items()}, **flight.tables}
    for name, table in tables.items():
        copied = _copied(made, name, flight)
        for column in [] if copied is None else [one for one in table if one not in copied]:
            yield Removal("column", f"{name}: {column}", "left out")
    if flight.folder is not None:
        yield Removal("folder", str(flight.folder.resolve()), "left out")
    yield from _renames(names)


def _lens(manifest: Manifest) -> str:
    c = manifest.camera
    return "" if c is None else f"{c.fx_px:g}, {c.fy_px:g}, {c.cx_px:g}, {c.cy_px:g}"


def _copied(made: Flight, name: str, flight: Flight) -> pd.DataFrame | None:
    if not name.startswith("nav/"):
        return made.tables.get(name)
    return list(made.nav.values())[list(flight.nav).index(name.removeprefix("nav/"))]


def _renames(names: Names) -> Iterator[Removal]:
    for kind, known in sorted(names.by_kind.items()):
        for true, neutral in known.items():
            if kind not in ("frame", "detection"):
                yield Removal(kind, true, neutral)
        if kind in ("frame", "detection") and known:
            (a, first), *_, (b, last) = (*known.items(), *known.items())
            yield Removal(f"{len(known)} names of {kind}s", f"{a} to {b}", f"{first} to {last}")


def removal_lines(removed: Sequence[Removal]) -> list[str]:
    """One line for each thing: what, what it was, and what stands in its place."""
    return [
        f"{one.what}: {one.was!r} -> {one.now}" if one.was else f"{one.what}: {one.now}" for one in removed
    ]


def sender_list(
    file: str, told: Sequence[tuple[str, Sequence[str]]], notes: Sequence[str], *, generalised: bool
) -> list[str]:
    """The whole list.

    Parameters
    ----------
    file
        Name of the copy.
    told
        Heading and lines for each flight and study.
    notes
        Sentences on the copy as a whole.
    generalised
        Whether there is a place to be hidden in it.

    Returns
    -------
    list of str
    """
    lines = [f"For the sender of {file} alone. Do not send this list: it says what the copy hides.", ""]
    for heading, ones in told:
        lines += [heading, *(f"  {line}" for line in ones), ""]
    if generalised:
        lines += ["What a copy cannot hide", *(f"  {line}" for line in REMAINS), ""]
    if notes:
        lines += ["Also", *(f"  {line}" for line in notes), ""]
    return lines[:-1]


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


class _Answer(NamedTuple):
    """What a report asks, what it answers in a word, and what it held its flight against."""

    title: str
    verdict: str
    against: tuple[str, ...]


def _said(report: Path, numbers: Mapping[tuple[str, str], float]) -> _Answer:
    text = (report / "report.html").read_text(encoding="utf-8")
    # What is asked and answered stands before the figures, which are most of a page.
    for piece in (text.partition("<figure")[0], text):
        soup = BeautifulSoup(piece, "html.parser")
        title, word = soup.h1, soup.select_one("p.verdict .pill")
        if title is not None and word is not None:
            break
    against = tuple(subject for name, subject in numbers if name == AGAINST)
    return _Answer(
        "" if title is None else title.get_text(" ", strip=True),
        "" if word is None else word.get_text(" ", strip=True),
        against,
    )


def _otherwise(mine: _Answer, theirs: _Answer) -> list[str]:
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


def describe_agreement(found: Agreement) -> str:
    """For the page: what it says of its own numbers; nothing where nothing was compared."""
    if not found.compared:
        return ""
    values = {
        "compared": found.compared,
        "same": found.same,
        "to": f"{SAME:.1%}",
        "worst": f"{found.worst:.1%}",
    }
    key = "agrees" if found.same == found.compared else "differs"
    return fill(load_texts("sharing").answers[key], {}, values)


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
