"""Which reports are meant, what each was made from, and those of a copy, computed again from the generalised
flight."""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NamedTuple

from bs4 import BeautifulSoup
from rich.console import Console

from wildlab.errors import RunFailed, WildlabError
from wildlab.files import write_atomic
from wildlab.flight.calibration_files import Learnt, parse_learnt, read_learnt, write_calibration
from wildlab.flight.files import dump_toml
from wildlab.flight.manifest import FILE_NAME, parse_settings, read_manifest
from wildlab.flight.store import CALIBRATION, Flight, save_flight
from wildlab.paths import REPORTS
from wildlab.reporting.front_page import OwnFlight
from wildlab.reporting.metrics import AGAINST
from wildlab.runner.catalogue import StudyEntry
from wildlab.runner.evaluate import MANY_NOTEBOOK, evaluate_flight, track_many
from wildlab.runner.job import typed
from wildlab.runner.ledger import ABOUT, finished_metrics, own_flights
from wildlab.runner.provenance import (
    flight_of_report,
    flights_near,
    provenance_of_flight,
    read_provenance,
    same_flight,
)
from wildlab.runner.scheduling import Outcome
from wildlab.runner.status import read_status
from wildlab.sharing.generalisation import Generalised, Names, neutral_learnt, neutral_settings
from wildlab.sharing.tiers import describe
from wildlab.simulation.parameters import load_twin, twin_names

#: What the names of the reports on a flight end in, in the order in which they are read.
ENDS = tuple(sorted(ABOUT, key=("-overview", "", "-navigation", "-tracking", "-many").index))
#: Of the one that `wildlab track --many` makes; `wildlab evaluate` makes the others.
MANY = "-many"


@dataclass(frozen=True)
class Source:
    """One flight with its reports, or one study.

    Attributes
    ----------
    name
        Of the flight or the study.
    folders
        Of its reports that are done, in order.
    logged
        Whether it is a flight whose place and date are somebody's: its reports are drawn again.
    flight
        What provenance says of the flight.
    parameters
        By the name of the report's folder.
    """

    name: str
    folders: tuple[Path, ...]
    logged: bool
    flight: dict[str, Any] = field(default_factory=dict)
    parameters: dict[str, dict[str, Any]] = field(default_factory=dict)


def sources_of(
    path: Path, studies: dict[str, StudyEntry], reports: Path = REPORTS
) -> tuple[list[Source], list[str]]:
    """What a report's folder, or a folder of reports, is made from.

    Parameters
    ----------
    path
        ``reports/NAME``, its ``report.html``, ``reports``, or the folder of a flight.
    studies
        By name.
    reports
        Where those of a flight's folder are.

    Returns
    -------
    sources : list of Source
        Of a single report on a flight, with all of the flight's reports.
    left_out : list of str
        Sentences, on reports that do not go along: they cannot be shared, or are of other tables.

    Raises
    ------
    WildlabError
        Where there is no report, or the one that is meant cannot be shared, with the reason.
    """
    if (path / FILE_NAME).is_file():
        mine = provenance_of_flight(path)
        ours = [
            one
            for one in _made(reports, mine["name"])
            if same_flight(read_provenance(one).get("flight") or {}, mine)
        ]
        if not ours:
            raise WildlabError(
                f"there is no report on this flight as it is in {reports.resolve()}",
                f"evaluate it: {typed('wildlab evaluate', path)}; after evaluate --out FOLDER: "
                f"{typed('wildlab share FOLDER', flight=path)}",
                file=path,
            )
        path = ours[0]
    folder = path.parent if path.name == "report.html" else path
    if not folder.is_dir():
        fix = "name the folder of a report, or of all of them"
        raise WildlabError("there is no such report", fix, file=path)
    if (folder / "report.html").is_file():
        source, left_out = _with_siblings(_source(folder, studies), studies)
        return [source], left_out
    found: dict[str, Source] = {}
    single: list[Source] = []
    left_out = []
    for one in sorted(folder.iterdir()):
        if one.name.startswith(".") or not (one / "report.html").is_file():
            continue
        try:
            single.append(_source(one, studies))
        except WildlabError as error:
            left_out.append(str(error))
    # The flight as it was evaluated is the one that is meant; targets may have been followed before that.
    for source in sorted(single, key=lambda one: one.folders[0].name == f"{one.name}{MANY}"):
        if source.name not in found:
            found[source.name], more = _with_siblings(source, studies)
            left_out += more
    if not found:
        why = f" ({left_out[0]})" if left_out else ""
        raise WildlabError(f"no report here can be shared{why}", "name a folder with others", file=path)
    return list(found.values()), list(dict.fromkeys(left_out))


def _source(folder: Path, studies: dict[str, StudyEntry]) -> Source:
    status = read_status(folder)
    if status.get("state") == "damaged":
        raise WildlabError(str(status["reason"]), "make the report again", file=folder)
    if status.get("state") != "done":
        raise WildlabError("this report is not done", "make it again", file=folder)
    provenance = read_provenance(folder)
    if not provenance:
        fix = "evaluate the flight, and share what that makes"
        raise WildlabError("nothing says what this report was made from", fix, file=folder)
    flight = provenance.get("flight")
    given = provenance.get("parameters")
    parameters = {folder.name: given if isinstance(given, dict) else {}}
    entry = studies.get(folder.name)
    # Of the catalogue: everybody has the data.
    public = entry is not None and (entry.dataset is not None or entry.twin is not None)
    if not isinstance(flight, dict) or public or (entry is not None and of_a_study(flight, folder.parent)):
        return Source(folder.name, (folder,), False, {}, parameters)
    name = str(flight.get("name", ""))
    if not _drawn_again(folder, name, provenance):
        raise WildlabError(
            "this report cannot be drawn again from generalised data",
            "evaluate the flight, and share what that makes",
            file=folder,
        )
    return Source(name, (folder,), True, flight, parameters)


def _drawn_again(folder: Path, name: str, provenance: Mapping[str, Any]) -> bool:
    """Whether a report is one that is made again from the flight of this name.

    What is called like that on many targets may be another one: `wildlab track` leaves its own where it is
    told to.
    """
    if folder.name not in {f"{name}{end}" for end in ABOUT}:
        return False
    notebook = provenance.get("notebook")
    file = notebook.get("file") if isinstance(notebook, dict) else None
    return folder.name != f"{name}{MANY}" or file == MANY_NOTEBOOK


def _made(reports: Path, name: str) -> list[Path]:
    """The reports that there are on a flight of this name, are made again, and are done."""
    found = [reports / f"{name}{end}" for end in ENDS]
    found = [one for one in found if _drawn_again(one, name, read_provenance(one))]
    return [
        one for one in found if (one / "report.html").is_file() and read_status(one).get("state") == "done"
    ]


def of_a_study(flight: dict[str, Any], reports: Path) -> bool:
    """Whether it is a twin that comes with wildlab, whose place everybody knows.

    Any other twin is somebody's: its place may be a true one, and so is its name.
    """
    name = str(flight.get("name", ""))
    twin = name.rpartition("-")[0]
    if flight.get("kind") != "twin" or twin not in twin_names():
        return False
    place = load_twin(twin).place
    packaged = (place.latitude.number, place.longitude.number)
    for folder in flights_near(reports / name, name):
        try:
            manifest = read_manifest(folder / FILE_NAME)
        except WildlabError:
            continue
        # Of one that is called so and lies elsewhere, it may be the one that is meant.
        if (
            name in (folder.name, manifest.name)
            and (manifest.origin.latitude_deg, manifest.origin.longitude_deg) != packaged
        ):
            return False
    return True


def _with_siblings(source: Source, studies: dict[str, StudyEntry]) -> tuple[Source, list[str]]:
    """All reports on the flight beside one, in their usual order; and sentences on those of its name that do
    not go along, since they are of other tables or not as they were written, and on those that nothing tells
    it of."""
    if not source.logged:
        return source, []
    reports = source.folders[0].parent
    folders: list[Path] = []
    parameters: dict[str, dict[str, Any]] = {}
    left_out = []
    for folder in (reports / f"{source.name}{end}" for end in ENDS):
        if not (folder / "report.html").is_file():
            continue
        try:
            one = _source(folder, studies)
        except WildlabError as error:
            left_out += [str(error)] if read_status(folder).get("state") == "damaged" else []
            continue
        if not one.logged or one.name != source.name:
            continue
        if same_flight(one.flight, source.flight):
            folders.append(folder)
            parameters |= one.parameters
        else:
            left_out.append(f"{folder}: it was made from other tables.")
    return Source(source.name, tuple(folders), True, source.flight, parameters), left_out


def flight_folder(source: Source, given: Path | None) -> Path:
    """The flight that reports were made from: the one that is given, or one that lies where flights lie.

    Parameters
    ----------
    source
        With what provenance says.
    given
        What the user names, if anything.

    Returns
    -------
    Path

    Raises
    ------
    WildlabError
        Where none is found, or the one given is another, with what to type.
    """
    again = f"{typed('wildlab share', source.folders[0])} --flight FOLDER"
    if given is not None:
        if not (given / FILE_NAME).is_file():
            raise WildlabError("there is no flight in this folder", "name its folder", file=given)
        if not same_flight(provenance_of_flight(given), source.flight):
            raise WildlabError(
                f"this is not the flight that the reports on {source.name} were made from",
                f"evaluate it again, or: {again}",
                file=given,
                field="--flight",
            )
        return given
    return flight_of_report(source.folders[0], source.flight, again)


#: What `wildlab evaluate` does not set of these, `wildlab track` was told.
_TOLD = ("filters", "targets", "sensors", "settings", "tuned", "smooth")


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


class RecomputedReports(NamedTuple):
    """A generalised flight and its reports.

    Attributes
    ----------
    made
        The flight, and what was taken out of it.
    folders
        Of the reports, by the end of their name (`ENDS`), in order.
    own
        The flight with its reports, as the edition takes it.
    agreement
        With the sender's own reports.
    notes
        Sentences for the sender.
    missing
        What no report could be made on, in words of the report.
    """

    made: Generalised
    folders: dict[str, Path]
    own: OwnFlight
    agreement: Agreement
    notes: tuple[str, ...]
    missing: tuple[str, ...]


def recompute_reports(
    flight: Flight,
    made: Generalised,
    source: Source,
    work: Path,
    *,
    console: Console | None = None,
) -> RecomputedReports:
    """Make the reports of a flight again from its generalised copy.

    Parameters
    ----------
    flight, made
        The true one, from its folder, and its generalised copy.
    source
        Its reports here, whose parameters are used again.
    work
        A folder to work in, which is gone afterwards.
    console
        As for `evaluate_flight`.

    Returns
    -------
    Redrawn

    Raises
    ------
    RunFailed
        Where a report could not be made again that is done here.
    """
    name = made.flight.name
    copy, reports = work / name, work / "reports"
    kept = None if flight.calibration is None else neutral_learnt(read_learnt(flight.calibration), made)
    save_flight(made.flight, copy, calibration=kept)
    told = _told(source, made)
    learnt: Learnt | None = told["calibration"]
    applied = None
    if learnt is not None and not (kept is not None and learnt == kept):
        applied = work / CALIBRATION
        write_calibration(learnt, applied)
    outcomes = evaluate_flight(
        copy,
        source=told["source"],
        calibration=applied,
        reports=reports,
        console=console,
        ledger=False,
    )
    done = {one.name for one in source.folders}
    several = f"{source.name}{MANY}" in done
    if several:
        outcome, more = _many(copy, made, source, work, reports, console)
        outcomes = [*outcomes, outcome]
        told["notes"] += more
    failed = [outcome for outcome in outcomes if outcome.state == "failed"]
    for outcome in failed:
        if f"{source.name}{outcome.name.removeprefix(name)}" in done:
            why = outcome.reason.rstrip(".")
            raise RunFailed(
                f"the report {outcome.name} could not be made from generalised data ({why})",
                "check and evaluate the flight, then share it again",
                file=flight.folder,
            )
    wanted = [end for end in ENDS if end != MANY or several]
    ends = [end for end in wanted if f"{name}{end}" not in {outcome.name for outcome in failed}]
    folders = {
        end: reports / f"{name}{end}" for end in ends if (reports / f"{name}{end}" / "report.html").is_file()
    }
    mine = {one.name: one for one in source.folders}
    pairs = {
        mine[f"{source.name}{end}"]: there for end, there in folders.items() if f"{source.name}{end}" in mine
    }
    lost = [one for one in mine if mine[one] not in pairs]
    notes = told["notes"] + [describe("note-lost", report=one) for one in lost]
    missing = tuple(ABOUT[end] for end in wanted if end not in ends)
    notes += [describe("note-missing", what=one) for one in missing]
    (own,) = own_flights(reports, ())
    numbered = [one for one in pairs if one.name == f"{source.name}{MANY}"]
    agreement = compare(pairs, made.names, numbered)
    return RecomputedReports(made, folders, own, agreement, tuple(notes), missing)


def _many(
    copy: Path,
    made: Generalised,
    source: Source,
    work: Path,
    reports: Path,
    console: Console | None,
) -> tuple[Outcome, list[str]]:
    """The report on many targets, told what the sender's was told; and notes for the sender."""
    given = source.parameters.get(f"{source.name}{MANY}", {})
    named = f"{made.flight.manifest.name}{MANY}"
    notes = []
    try:
        text, file = str(given.get("settings") or ""), None
        if text:
            told, left_out = neutral_settings(parse_settings(text), made.names, made.clocks, made.pixels)
            file = work / "settings.toml"
            write_atomic(file, dump_toml(told.model_dump(exclude_none=True)))
            report = f"{source.name}{MANY}"
            notes = [describe("note-settings", report=report, name=repr(one)) for one in left_out]
        if given.get("tuned"):
            notes.append(describe("note-untuned", report=f"{source.name}{MANY}"))
        sensors = given.get("sensors") or ()
        poses = given.get("source")
        outcome = track_many(
            copy,
            sensors=[made.names.of("sensor", str(one)) for one in sensors],
            settings=file,
            source=made.names.of("poses", str(poses)) if poses else None,
            reports=reports,
            console=console,
        )
    except WildlabError as error:
        raise RunFailed(
            f"the report {named} could not be made from generalised data ({error.problem.rstrip('.')})",
            error.fix,
            file=source.folders[0].with_name(f"{source.name}{MANY}"),
            field=error.field,
        ) from None
    return outcome, notes


def _told(source: Source, made: Generalised) -> dict[str, Any]:
    """What the sender's reports were told, in the copy's names."""
    given: Mapping[str, Any] = {}
    notes = []
    for end in ENDS:
        if end == MANY and len(source.folders) > 1:
            # What it was told says nothing of what the others were told.
            continue
        parameters = source.parameters.get(f"{source.name}{end}", {})
        given = {**{key: value for key, value in parameters.items() if value}, **given}
        if end == "-tracking" and any(parameters.get(key) for key in _TOLD):
            notes.append(describe("note-tracking"))
    poses, calibration = given.get("source"), given.get("calibration")
    return {
        "source": made.names.of("poses", str(poses)) if poses else None,
        "calibration": neutral_learnt(parse_learnt(str(calibration)), made) if calibration else None,
        "notes": notes,
    }


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
    about, found = theirs.title.rstrip("?. ") or "a report", []
    if mine.title != theirs.title:
        found.append(describe("other-title", one=mine.title, other=theirs.title))
    if mine.verdict != theirs.verdict:
        one, other = mine.verdict or "nothing", theirs.verdict or "nothing"
        found.append(describe("other-answer", about=about, one=one, other=other))
    # A report of before it was recorded does not say.
    if mine.against and mine.against != theirs.against:
        one, other = (" and ".join(report.against) or "nothing" for report in (mine, theirs))
        found.append(describe("other-reference", about=about, one=one, other=other))
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


def describe_agreement(found: Agreement) -> str:
    """For the page: what it says of its own numbers; nothing where nothing was compared."""
    if not found.compared:
        return ""
    key = "agrees" if found.same == found.compared else "differs"
    worst = f"{found.worst:.1%}"
    return describe(key, compared=found.compared, same=found.same, to=f"{SAME:.1%}", worst=worst)
